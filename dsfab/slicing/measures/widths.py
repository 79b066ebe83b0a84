"""Smallest widths of members, gaps and edges of a cut sheet."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lock, sorted_order, weighted_quantiles
from dsfab.slicing.cutting.sheet import VOID, Sheet, SheetPart, hydraulic_diameters
from dsfab.surface import Surface, next_half_edge, pieces


class FarEnds(NamedTuple):
    """Ends of k straight lines across a sheet, on the sheet's boundary.
    edge   : half-edge on the boundary, -1 if unknown.    place : metres along this half-edge.
    slope  : cosine between line and half-edge.    length : length of the line, metres."""

    edge: Ints
    place: Floats
    slope: Floats
    length: Floats

    def subset(self, chosen: Ints) -> "FarEnds":
        """Return the ends of the lines with the numbers `chosen`."""
        return FarEnds._make(column[chosen] for column in self)


class _Lines(NamedTuple):
    """Straight lines at the edge of the triangle that they enter next: position, direction, and length so far."""

    number: Ints
    edge: Ints
    s: Floats
    x: Floats
    y: Floats
    way: Floats

    def subset(self, active: Bools) -> "_Lines":
        return _Lines._make(column[active] for column in self)


def far_ends(surface: Surface, start: Ints, place: Floats, reach: float = np.inf) -> FarEnds:
    """Follow straight lines across a sheet, at right angles to boundary half-edges `start` (k,); return their ends.
    place : (k,) metres from the half-edge's start.    reach : metres; longer lines may have no end."""
    frames, twin, start_vertex = _frames(surface), surface.edges.twins, surface.F.ravel()
    against = start_vertex != start_vertex[twin]  # True for opposite directions
    count = len(start)
    result = FarEnds(np.full(count, -1), np.zeros(count), np.ones(count), np.full(count, np.inf))
    lines = _Lines(np.arange(count), start, place, np.zeros(count), np.ones(count), np.zeros(count))
    for _ in range(2000):  # lines across members end sooner
        if not len(lines.number):
            break
        lines = _at_exit(lines, frames[lines.edge])
        beyond = twin[lines.edge]
        if (ends := beyond < 0).any():
            finished = lines.number[ends]
            result.edge[finished], result.place[finished] = lines.edge[ends], lines.s[ends]
            result.slope[finished], result.length[finished] = lines.x[ends], lines.way[ends]
        active = ~ends & np.isfinite(lines.way) & (lines.way <= reach)
        edge, lines = beyond[active], lines.subset(active)
        turned = against[edge]
        s, x = np.where(turned, frames[edge, 0] - lines.s, lines.s), np.where(turned, -lines.x, lines.x)
        lines = lines._replace(edge=edge, s=s, x=x)
    return result


def _at_exit(lines: _Lines, frame: Floats) -> _Lines:
    length, ax, ay, bx, by, cx, cy = frame.T
    s, x, y = lines.s, lines.x, lines.y
    over_next, over_last = by * x - bx * y, cy * x - cx * y
    with np.errstate(divide="ignore", invalid="ignore"):
        to_next = np.where(over_next > 0, np.maximum(by * (length - s), 0) / over_next, np.inf)
        to_last = np.where(over_last > 0, np.maximum(-cy * s, 0) / over_last, np.inf)
        second = to_last < to_next
        step = np.where(second, to_last, to_next)
        ux, uy = np.where(second, cx, bx), np.where(second, cy, by)
        exit_place = (s + step * x - np.where(second, ax, length)) * ux + (step * y - np.where(second, ay, 0)) * uy
    edge = next_half_edge(lines.edge, 1 + second)
    outwards = np.where(second, over_last, over_next)
    return _Lines(lines.number, edge, exit_place, x * ux + y * uy, outwards, lines.way + step)


def _frames(surface: Surface) -> Floats:
    V, F = surface.V, surface.F
    along, apex = (V[np.roll(F, -k, axis=1)].reshape(-1, 3) - V[F].reshape(-1, 3) for k in (1, 2))
    size = np.linalg.norm(along, axis=1)
    ax, ay = np.einsum("hi,hi->h", apex, along) / size, 2 * np.repeat(surface.areas, 3) / size
    second_size, third_size = (np.roll(size.reshape(-1, 3), -k, axis=1).ravel() for k in (1, 2))
    second, third = ((ax - size) / second_size, ay / second_size), (-ax / third_size, -ay / third_size)
    return np.stack([size, ax, ay, *second, *third], axis=1)


MIDDLE = 0.5
AT = (1e-3, MIDDLE, 1 - 1e-3)
"""Positions on a boundary edge, 0 to 1, from which lines across the sheet measure widths."""
OPPOSED = float(np.sin(np.radians(20)))
"""Two walls at an angle over 20 degrees are not opposite: they form a corner, so their distance is not a width."""
TAPER = float(np.radians(1.5))  # Smallest angle between two walls that form a tip, radians.


@dataclass(frozen=True, eq=False)
class Crossings:
    """Widths of a sheet along lines between opposite walls (boundary edges).
    width  : (k,) shortest distance from a line's start to the opposite wall, metres.
    place  : (k, 3) the start, metres.    face : (k,) the triangle at the start.
    weight : (k,) length of the wall at the start, metres; 0 for lines that start away from its middle.
    walls  : (k, 2) numbers of the boundary edges at the line's ends."""

    width: Floats
    place: Floats
    face: Ints
    weight: Floats
    walls: Ints


@dataclass(frozen=True, eq=False)
class _EdgePoints:
    edge: Ints
    t: Floats

    def subset(self, chosen: Ints | Bools) -> "_EdgePoints":
        return _EdgePoints(self.edge[chosen], self.t[chosen])


def crossings(
    surface: Surface,
    walls: Bools,
    start: Bools | None = None,
    shares: tuple[float, ...] = AT,
    tips: bool = False,
    reach: float = np.inf,
) -> Crossings:
    """Return the widths of a sheet along lines from wall to wall.
    walls   : (e,) mask of boundary edges that count as walls.
    start   : (e,) mask of walls at which lines start; default all.    shares : positions of starts on a wall, 0 to 1.
    tips    : True to count lines in tips, where walls converge.    reach : metres; longer lines may be left out."""
    starting = walls if start is None else walls & start
    if not starting.any():
        none = np.empty((0, 2), dtype=np.int64)
        return Crossings(np.empty(0), np.empty((0, 3)), none[:, 0], np.empty(0), none)
    h, edge_of = surface.edges.order[surface.edges.start[:-1][starting]], surface.edges.of.ravel()
    size = np.linalg.norm(_edge_vectors(surface, h), axis=1)
    starts = _EdgePoints(np.tile(h, len(shares)), np.repeat(shares, len(h)))
    ends = far_ends(surface, starts.edge, starts.t * np.tile(size, len(shares)), reach / np.sqrt(1 - OPPOSED**2))
    valid = np.flatnonzero((ends.edge >= 0) & walls[edge_of[ends.edge]] & (np.abs(ends.slope) < OPPOSED))
    met, width = _feet(surface, ends.subset(valid))
    accepted = tips | ~_tips(surface, starts.subset(valid), met, width, ends.slope[valid])
    valid, met, width = valid[accepted], met.subset(accepted), width[accepted]
    starts = starts.subset(valid)
    weight = np.where(starts.t == MIDDLE, np.tile(size, len(shares))[valid], 0.0)
    point = surface.V[surface.F.ravel()[starts.edge]] + starts.t[:, None] * _edge_vectors(surface, starts.edge)
    between = edge_of[np.stack([starts.edge, met.edge], axis=1)]
    return Crossings(width, point, starts.edge // 3, weight, between)


def _feet(surface: Surface, ends: FarEnds) -> tuple[_EdgePoints, Floats]:
    size = np.linalg.norm(_edge_vectors(surface, ends.edge), axis=1)
    foot = ends.place - ends.length * ends.slope
    nearest = np.clip(foot, 0, size)
    width = np.hypot(ends.length * np.sqrt(1 - np.minimum(ends.slope**2, 1)), foot - nearest)
    return _EdgePoints(ends.edge, nearest / size), width


def _tips(surface: Surface, start: _EdgePoints, finish: _EdgePoints, width: Floats, slope: Floats) -> Bools:
    loop, middle, ahead, total = _loop_positions(surface)

    def position(spot: _EdgePoints) -> Floats:
        size = np.linalg.norm(_edge_vectors(surface, spot.edge), axis=1)
        return np.asarray(middle[spot.edge] + np.where(ahead[spot.edge], 1, -1) * (spot.t - 0.5) * size)

    onward = (position(start) - position(finish)) * np.where((slope < 0) == ahead[finish.edge], 1, -1)
    wall_length = np.where(loop[start.edge] == loop[finish.edge], onward % total[loop[start.edge]], np.inf)
    angle = np.arcsin(np.minimum(np.abs(slope), 1))
    wedge = width / np.tan(np.maximum(angle, TAPER) / 2)
    ends = start.edge, next_half_edge(start.edge), finish.edge, next_half_edge(finish.edge)
    corner = np.stack([surface.F.ravel()[h] for h in ends])
    neighbours = (corner[:2, None] == corner[None, 2:]).any(axis=(0, 1))  # start and end edge share a corner
    return np.asarray(neighbours | ((angle >= TAPER) & (wall_length >= 0.4 * wedge) & (wall_length <= 1.7 * wedge)))


def _loop_positions(surface: Surface) -> tuple[Ints, Floats, Bools, Floats]:
    edge = np.flatnonzero(surface.edges.boundary)
    h = surface.edges.order[surface.edges.start[:-1][edge]]
    label, chain, loops = _loop_chains(surface.edges.ends[edge])
    length = np.linalg.norm(_edge_vectors(surface, h), axis=1)
    total = np.bincount(label, length, loops).astype(np.float64)
    chain_start = np.searchsorted(label[chain], np.arange(loops))
    after = np.roll(chain, -1)
    after[np.append(chain_start[1:], len(chain)) - 1] = chain[chain_start]
    ahead = (surface.edges.ends[edge[after]] == surface.F.ravel()[next_half_edge(h[chain])][:, None]).any(axis=1)
    loop, place, forward = np.full(3 * surface.m, -1), np.zeros(3 * surface.m), np.zeros(3 * surface.m, dtype=bool)
    loop[h], forward[h[chain]] = label, ahead
    place[h[chain]] = np.cumsum(length[chain]) - length[chain] / 2 - (np.cumsum(total) - total)[label[chain]]
    return loop, place, forward, total


def _loop_chains(ends: Ints) -> tuple[Ints, Ints, int]:
    slot = sorted_order(ends.ravel())  # ends of edges, sorted by vertex; end s of edge i has the number 2 i + s
    onward = np.empty_like(slot)
    onward[slot] = slot.reshape(-1, 2)[:, ::-1].ravel() ^ 1  # far end of the second edge at the vertex
    after, leaving = onward.tolist(), (2 * np.arange(len(ends)) + (ends[:, 0] > ends[:, 1])).tolist()
    label, chain, loops = [-1] * len(ends), list[int](), 0
    for start, state in enumerate(leaving):
        edge, loops = start, loops + (label[start] < 0)
        while label[edge] < 0:
            label[edge] = loops - 1
            chain.append(edge)
            state = after[state]
            edge = state >> 1
    return np.array(label, dtype=np.int64), np.array(chain, dtype=np.int64), loops


def _edge_vectors(surface: Surface, h: Ints) -> Floats:
    F = surface.F.ravel()
    return np.asarray(surface.V[F[next_half_edge(h)]] - surface.V[F[h]])


ROUNDING = 1e-6  # A width still meets a limit if it is smaller by at most this fraction of the limit.


@dataclass(frozen=True, eq=False)
class Feature:
    """The smallest member, gap or edge. size : m.    place : (3,), m.    what : name.    mesh : mesh size there, m."""

    size: float
    place: Floats
    what: str
    mesh: float

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class Features:
    """Smallest member and smallest gap of a sheet (None without members or gaps), and widths of members.
    edge   : the shortest edge of a triangle.
    widths : (k,) widths of members along the walls.    weight : (k,) length of wall with each width, metres."""

    member: Feature | None
    gap: Feature | None
    edge: Feature
    widths: Floats
    weight: Floats

    def quantiles(self, shares: Sequence[float]) -> Floats:
        """Return quantiles (q,) of the members' widths, metres. shares : (q,), 0 to 1."""
        return weighted_quantiles(self.widths, self.weight, shares) if self.weight.sum() else np.empty(0)

    def histogram(self, limit: float = 0.0) -> tuple[Floats, Floats]:
        """Return limits (b + 1,) of bins of member widths, metres, and the fraction (b,) of wall length in each bin.
        limit : a width, metres, at which a bin ends; 0 for none."""
        if not self.weight.sum():
            return np.empty(0), np.empty(0)
        usual, widest = self.quantiles([0.5, 0.99]).tolist()
        limits = _bins(min(widest, 3.0 * usual) * (1 + 1e-9), limit * (1 - ROUNDING))
        share, _ = np.histogram(np.minimum(self.widths, limits[-1]), limits, weights=self.weight)
        return limits, np.asarray(share / self.weight.sum())


def below_limit(sizes: float | Floats, limit: float) -> Bools:
    """Return a mask (k,) of sizes (k,) under a limit, metres."""
    return np.asarray(np.asarray(sizes) < limit * (1 - ROUNDING))


def _bins(end: float, limit: float, count: int = 20, largest_count: int = 60) -> Floats:
    if not 0 < limit < end:
        return np.linspace(0, end, count + 1)
    step = limit / max(1, round(limit / end * count))
    if end / step > largest_count:
        return np.concatenate([[0.0], np.linspace(limit, end, count + 1)])
    return step * np.arange(np.ceil(end / step) + 1)


def features(cells: Sheet, built: Bools, names: Sequence[str], tips: bool = False) -> Features:
    """Measure the smallest member, gap and triangle edge of a cut sheet, and the widths of members.
    cells : all cells, material and void.    built : (m',) mask of the structure's cells.
    tips  : True to measure gaps also in the tips of openings."""
    part, mesh = SheetPart.from_cells(cells.surface, built), _mesh_width(cells)
    material, from_material = part.surface, part.cells
    across = crossings(material, material.edges.boundary)
    cell = from_material[across.face]
    member = _smallest(across, mesh[cell], [_member(names, f) for f in cells.family[cell]])
    walls, widths = material.edges.boundary, mesh[from_material]
    member = _smallest_feature(member, _smallest_compact_piece(material, walls, across, widths, "a loose piece"))
    gap = None
    if not built.all():
        part = SheetPart.from_cells(cells.surface, ~built)
        void, from_void, walls = part.surface, part.cells, part.walls
        between = crossings(void, walls, tips=tips)
        gap = _smallest(between, mesh[from_void[between.face]], ["a gap"] * len(between.width))
        gap = _smallest_feature(gap, _smallest_compact_piece(void, walls, between, mesh[from_void], "an opening"))
    return Features(member, gap, _shortest(material, mesh[from_material]), across.width, across.weight)


def kept_cells(cells: Sheet, sheet: Sheet) -> Bools:
    """Return a mask (m',) of the material cells of `cells` that are also in `sheet`."""
    material = cells.material
    if material.sum() == sheet.surface.m:
        return np.asarray(material)
    built_centroids = {row.tobytes() for row in sheet.surface.centroids}
    material_cells = np.flatnonzero(material)
    label = cells.material_part.surface.pieces[1]
    _, first_cells = np.unique(label, return_index=True)
    first_centroids = cells.surface.centroids[material_cells[first_cells]]
    built = np.array([row.tobytes() in built_centroids for row in first_centroids])
    result = np.zeros(cells.surface.m, dtype=bool)
    result[material_cells] = built[label]
    return result


def _mesh_width(cells: Sheet) -> Floats:
    """Return for each cell the typical edge length (m',) of its uncut face, metres."""
    area = np.bincount(cells.parent, cells.surface.areas)
    return np.asarray(np.sqrt(4 / np.sqrt(3) * area[cells.parent]))


def _member(names: Sequence[str], family: int) -> str:
    if family == VOID or family >= len(names):
        return "a member"
    return {"keep": "a kept region", "rim": "the rim"}.get(names[family], f"a {names[family]} stripe")


def _smallest(across: Crossings, mesh: Floats, what: Sequence[str]) -> Feature | None:
    if not len(across.width):
        return None
    k = int(across.width.argmin())
    return Feature(float(across.width[k]), across.place[k], what[k], float(mesh[k]))


def _smallest_feature(first: Feature | None, second: Feature | None) -> Feature | None:
    present = [feature for feature in (first, second) if feature is not None]
    return min(present, key=lambda feature: feature.size, default=None)


def _smallest_compact_piece(part: Surface, walls: Bools, across: Crossings, mesh: Floats, what: str) -> Feature | None:
    count, label = pieces(part.F, part.edges)
    sizes = hydraulic_diameters(part, walls, label, count)
    sizes[label[across.face]] = np.inf
    k = int(sizes.argmin())
    if not np.isfinite(sizes[k]):
        return None
    faces = np.flatnonzero(label == k)
    return Feature(float(sizes[k]), part.centroids[faces].mean(axis=0), what, float(mesh[faces].mean()))


def _shortest(part: Surface, mesh: Floats) -> Feature:
    length = part.edge_lengths
    k = int(length.argmin())
    face = int(part.edges.order[part.edges.start[k]] // 3)
    place = part.V[part.edges.ends[k]].mean(axis=0)
    return Feature(float(length[k]), place, "an edge of a triangle", float(mesh[face]))
