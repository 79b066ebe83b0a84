"""Round corners of openings: an arc at each corner that a rolling disc cannot reach."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, unit_vectors
from dsfab.core.errors import PatternError
from dsfab.slicing.cutting.cut import recut_polygons, with_polygons
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import LineKind, Sheet
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.cutting.walls import SHARPEST, Stretches, Walls, next_in_chains
from dsfab.slicing.finishing.flat_openings import FlatOpenings, flat_openings_of, nearest_in_plane
from dsfab.slicing.finishing.opening_corners import SMALLER, Arcs, Corners, circle_centres, tangent_arcs
from dsfab.slicing.finishing.openings import SNAP
from dsfab.slicing.finishing.point_contacts import pinched_vertices


@dataclass(frozen=True, eq=False)
class DiscStops:
    """Positions (p,) at which a disc that rolls inside a flat opening stops, because it touches two walls.
    middle : (p, 2) centre of the disc, metres.    before, behind : (p, 2) unit vectors from the centre to the walls.
    a, b   : (p,) the two walls, as indices into `FlatOpenings.wall`.
    share_a, share_b : (p,) positions of the contacts on the walls, 0 to 1."""

    middle: Floats
    before: Floats
    behind: Floats
    a: Ints
    b: Ints
    share_a: Floats
    share_b: Floats

    def subset(self, chosen: Bools) -> "DiscStops":
        """Return the discs that the mask `chosen` (p,) marks."""
        return DiscStops(*(getattr(self, field.name)[chosen] for field in fields(self)))


def rolled_arcs(sheet: Sheet, radius: float, taken: list[Stretches]) -> Iterator[tuple[Corners, Arcs]]:
    """Yield corners (p,) in narrow tips that a disc of `radius` metres cannot reach, and their arcs.
    taken : parts of walls without new corners. The caller may add parts between the yields."""
    flat, walls = flat_openings_of(sheet), sheet.walls
    loops = [np.asarray(loop) for loop in flat.room(radius).to_polygons() if len(loop) > 2]
    if loops:
        stop, *tips = _tips(flat, _stops(flat, loops, radius), loops, radius)
        for tip in tips:
            wall, free = flat.wall[tip], np.ones(len(tip), dtype=bool)
            for stretches in taken:
                free &= ~stretches.covers(walls.chain[wall], walls.place[wall])
            yield _arcs_in_planes(walls, flat, stop.subset(free), tip[free], radius)


def _arcs_in_planes(
    walls: Walls, flat: FlatOpenings, stop: DiscStops, tip: Ints, radius: float
) -> tuple[Corners, Arcs]:
    wall_a, wall_b, wall = flat.wall[stop.a], flat.wall[stop.b], flat.wall[tip]
    total, tip_place, size = walls.total[walls.chain[wall]], walls.place[wall], np.full(len(wall), radius)
    way_a = (tip_place - walls.place[wall_a] - stop.share_a * walls.length[wall_a]) % total
    way_b = (walls.place[wall_b] + stop.share_b * walls.length[wall_b] - tip_place) % total
    tips = Corners(walls, wall, np.zeros(len(wall)), tip_place)

    def in_frame(w: Ints, share: Floats, to_wall: Floats) -> tuple[Floats, Floats]:
        foot = walls.points(w, share) - tips.origin
        inward = -np.einsum("pj,pji->pi", to_wall, flat.frame[tip])
        p, n = (np.einsum("pi,pji->pj", x, tips.frames) for x in (foot, inward))
        return p, unit_vectors(n)

    line_a, line_b = in_frame(wall_a, stop.share_a, stop.before), in_frame(wall_b, stop.share_b, stop.behind)
    centre, exists = circle_centres(*line_a, *line_b, size)
    all_tips, margin = np.arange(len(wall)), 0.6 * radius  # margin: metres of wall beyond the ends of an arc
    lines = tips.wall_line(all_tips, way_a + margin, back=True), tips.wall_line(all_tips, way_b + margin, back=False)
    arcs = tangent_arcs(*lines, size, centre)
    valid = np.flatnonzero(arcs.touching & exists & (arcs.angle > SHARPEST))
    valid = valid[tips.subset(valid).stretches(arcs.subset(valid)).disjoint(len(valid))]
    return tips.subset(valid), arcs.subset(valid)


def _stops(flat: FlatOpenings, loops: list[Floats], radius: float) -> DiscStops:
    middle, before, behind = _left_turns(loops)
    (a, share_a), (b, share_b) = (flat.nearest_walls(middle + radius * x) for x in (before, behind))
    between_walls = (flat.chain[a] == flat.chain[b]) & (a != b)
    return DiscStops(middle, before, behind, a, b, share_a, share_b).subset(between_walls)


def _left_turns(loops: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return the points (p, 2) at which loops turn left, and right unit normals (p, 2) before and after the turn."""
    empty = np.empty((0, 2))
    points, rights = [empty], ([empty], [empty])
    for loop in loops:
        ahead = unit_vectors(np.roll(loop, -1, axis=0) - loop)
        back = np.roll(ahead, 1, axis=0)
        turn = np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1))
        turns = turn > SHARPEST
        points.append(loop[turns])
        for right, along in zip(rights, (back, ahead), strict=True):
            right.append(np.stack([along[turns, 1], -along[turns, 0]], axis=1))
    return np.concatenate(points), np.concatenate(rights[0]), np.concatenate(rights[1])


def _tips(flat: FlatOpenings, stop: DiscStops, loops: list[Floats], radius: float) -> tuple[DiscStops, Ints, Ints]:
    """Return the discs of `stop` that stop before a narrow tip of an opening.
    Return also two candidates for the vertex of each tip, as indices into `FlatOpenings.wall`."""
    size = np.bincount(flat.chain)
    begin = np.cumsum(size) - size
    chain_start, chain_size = begin[flat.chain[stop.a]], size[flat.chain[stop.a]]
    count = (stop.b - stop.a) % chain_size
    row = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 1
    wall = chain_start[row] + (stop.a[row] - chain_start[row] + step) % chain_size[row]
    start = flat.start[wall]
    touched = _distance(flat.start, loops)[wall] < (1 + 3e-3) * radius
    for to_wall in (stop.before, stop.behind):
        foot = (stop.middle + radius * to_wall)[row]
        touched &= np.linalg.norm(start - foot, axis=1) > 0.1 * radius  # vertices near the arc's ends do not count
    free = np.bincount(row, touched, len(count)) == 0
    distance = np.linalg.norm(start - stop.middle[row], axis=1)
    close_by = distance < 1.2 * radius
    orders = (np.lexsort((np.where(close_by, -distance, distance), close_by, row)), np.lexsort((-distance, row)))
    nearby, farthest = (wall[order][np.unique(row[order], return_index=True)[1]] for order in orders)
    return stop.subset(free), nearby[free], farthest[free]


def _distance(points: Floats, loops: list[Floats]) -> Floats:
    after = next_in_chains(np.repeat(np.arange(len(loops)), [len(loop) for loop in loops]))
    edges = np.stack([np.arange(len(after)), after], axis=1)
    return nearest_in_plane(points, np.concatenate(loops), edges).distance


COLUMNS = ("wall", "circle", "normal", "distance", "ray", "ray_distance")


@dataclass(frozen=True, eq=False)
class Fillets:
    """Round corners of openings: an arc at each corner (k,). The void beyond the arc's chords becomes material.
    normal, distance : (k, c, 3), (k, c) planes through an arc's chords: outward normals, and metres from the origin.
    ray, ray_distance : (k, 2, 3), (k, 2) planes through an arc's two end rays: normals, and metres from the origin.
    wall : (k,) the walls that begin at the corners.    circle : (k, 7) as in `CutLines`.    Missing normals are 0.
    pair : (p, 2) number of an arc, and of a void cell that the arc fills at least in part."""

    wall: Ints
    circle: Floats
    normal: Floats
    distance: Floats
    ray: Floats
    ray_distance: Floats
    pair: Ints

    @property
    def count(self) -> int:
        return len(self.wall)

    @property
    def radius(self) -> Floats:
        """(k,) radius of each arc, metres."""
        return np.asarray(self.circle[:, 6])

    def beyond_chords(self, arc: Ints, X: Floats) -> Floats:
        """Return the distances (p,), m, of points X (p, 3) beyond the chords of arcs (p,); negative inside."""
        return np.asarray((np.einsum("pci,pi->pc", self.normal[arc], X) - self.distance[arc]).max(axis=1))

    def outside_rays(self, arc: Ints, X: Floats) -> Floats:
        """Return the distances (p,), m, of points X (p, 3) outside the end rays of arcs (p,); negative between them."""
        return np.asarray((np.einsum("pci,pi->pc", self.ray[arc], X) - self.ray_distance[arc]).max(axis=1))

    def subset(self, chosen: Bools) -> "Fillets":
        """Return the marked fillets (k,), with their void cells."""
        number = np.cumsum(chosen) - 1
        pair = self.pair[chosen[self.pair[:, 0]]]
        pair = np.stack([number[pair[:, 0]], pair[:, 1]], axis=1)
        return Fillets(**{name: getattr(self, name)[chosen] for name in COLUMNS}, pair=pair)

    @classmethod
    def from_parts(cls, parts: Sequence["Fillets"]) -> "Fillets":
        """Join several sets of fillets."""
        before = np.cumsum([0, *(part.count for part in parts)])
        pair = np.concatenate([part.pair + [begin, 0] for part, begin in zip(parts, before[:-1], strict=True)])
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
        return cls(**columns, pair=pair)


def fitting_fillets(sheet: Sheet, radius: float) -> Fillets:
    """Return an arc at each corner of an opening where an arc fits. radius : largest radius, metres."""
    corners, accepted, taken = Corners.from_walls(sheet.walls), list[Fillets](), list[Stretches]()
    for tips, arcs in rolled_arcs(sheet, radius, taken):
        for rays in (False, True):
            for earlier in taken:
                free = ~tips.stretches(arcs).overlaps(earlier, len(tips.first))
                tips, arcs = tips.subset(free), arcs.subset(free)
            rolled, clear = _fillets_in_space(tips, np.arange(len(tips.first)), arcs, rays)
            accepted.append(rolled.subset(clear))
            taken.append(tips.subset(clear).stretches(arcs.subset(clear)))
            corners = corners.with_arc_feet(tips.subset(clear), arcs.subset(clear))
    radii = corners.largest(radius)
    smallest = 0.02 * radius  # smallest radius of an arc; a corner stays sharp if no larger arc fits
    waiting = np.flatnonzero(radii >= smallest)
    for _ in range(12):
        arcs, factor = corners.arcs(waiting, radii[waiting])
        fits = factor == 1
        fillets, clear = _fillets_in_space(corners, waiting[fits], arcs.subset(fits))
        accepted.append(fillets.subset(clear))
        factor[np.flatnonzero(fits)[~clear]] = SMALLER
        radii[waiting] *= factor
        waiting = waiting[factor < 1]
        waiting = waiting[radii[waiting] >= smallest]
        if not len(waiting):
            break
    return Fillets.from_parts(accepted)


def _fillets_in_space(corners: Corners, corner_rows: Ints, arcs: Arcs, rays: bool = False) -> tuple[Fillets, Bools]:
    """Convert plane arcs to fillets in space. Return also a mask (k,) of arcs that touch no further walls."""
    walls, surface, void_neighbours = corners.walls, corners.walls.surface, corners.walls.void_neighbours
    flat, distance = arcs.chords()
    normal = np.einsum("kcj,kji->kci", flat, corners.frames[corner_rows])
    distance = distance + np.einsum("kci,ki->kc", normal, corners.origin[corner_rows])
    arc, cell = np.arange(len(corner_rows)), walls.void_cells[corners.first[corner_rows]]
    ray, ray_distance = np.zeros((len(corner_rows), 2, 3)), np.ones((len(corner_rows), 2))
    if rays:
        flat, ray_distance = arcs.rays()
        ray = np.einsum("kcj,kji->kci", flat, corners.frames[corner_rows])
        ray_distance = ray_distance + np.einsum("kci,ki->kc", ray, corners.origin[corner_rows])
    pair = np.stack([arc, cell], axis=1)
    circle = corners.circles(corner_rows, arcs)
    fillets = Fillets(corners.first[corner_rows], circle, normal, distance, ray, ray_distance, pair)
    seen = key = arc * surface.m + cell
    clear = np.ones(len(corner_rows), dtype=bool)
    edge = np.zeros(surface.n, dtype=bool)
    edge[surface.edges.ends[surface.edges.boundary]] = True
    edge[walls.start] = True
    while len(key):
        arc, cell = key // surface.m, key % surface.m
        vertex = surface.F[cell]
        beyond = np.stack([fillets.beyond_chords(arc, surface.V[v]) for v in vertex.T], axis=1)
        outside = np.stack([fillets.outside_rays(arc, surface.V[v]) for v in vertex.T], axis=1)
        least = SNAP * arcs.radius[arc][:, None]
        row, c = np.nonzero((beyond > -least) & edge[vertex])
        between = corners.between_feet(corner_rows[arc[row]], arcs.subset(arc[row]), vertex[row, c])
        excess = outside[row, c]
        stray = np.where(between, excess > least[row, 0], excess < -least[row, 0])
        clear[arc[row[stray]]] = False
        through = (np.maximum(beyond, np.roll(beyond, -1, axis=1)) > 0) & (void_neighbours[cell] >= 0)
        through &= np.minimum(outside, np.roll(outside, -1, axis=1)) < 0
        row, c = np.nonzero(through & clear[arc][:, None])
        key = np.setdiff1d(arc[row] * surface.m + void_neighbours[cell][row, c], seen)
        seen = np.concatenate([seen, key])
    fillets = replace(fillets, pair=np.stack([seen // surface.m, seen % surface.m], axis=1))
    return fillets, clear & _within_feet(corners, corner_rows, arcs, fillets)


def _within_feet(corners: Corners, corner_rows: Ints, arcs: Arcs, fillets: Fillets) -> Bools:
    surface, (arc, cell) = corners.walls.surface, fillets.pair.T
    reach = 1.1 * np.maximum(arcs.way_a, arcs.way_b)

    def beyond_reach(arc: Ints, X: Floats) -> Bools:
        row = corner_rows[arc]
        flat = np.einsum("p...i,pji->p...j", X - corners.origin[row][:, None], corners.frames[row])
        return np.asarray(np.linalg.norm(flat, axis=-1) > reach[arc][:, None])

    far_rows = beyond_reach(arc, surface.V[surface.F[cell]]).any(axis=1)  # cells near the corner need no check
    arc, X = arc[far_rows], surface.V[surface.F[cell[far_rows]]]
    bad = np.zeros(len(corner_rows), dtype=bool)
    for c in range(fillets.normal.shape[1]):
        depth = np.einsum("pvi,pi->pv", X, fillets.normal[arc, c]) - fillets.distance[arc, c][:, None]
        next_depth = np.roll(depth, -1, axis=1)
        crossed = depth * next_depth < 0
        share = np.divide(depth, depth - next_depth, out=np.zeros_like(depth), where=crossed)
        ends = X + share[:, :, None] * (np.roll(X, -1, axis=1) - X)
        ray_excess = np.einsum("pvi,pri->pvr", ends, fillets.ray[arc]) - fillets.ray_distance[arc][:, None]
        too_far = (crossed | (depth > 0)) & (ray_excess < 0).all(axis=2) & beyond_reach(arc, ends)
        bad[arc[too_far.any(axis=1)]] = True
    return ~bad


GOLDEN = (5**0.5 - 1) / 2  # Golden ratio: the fractional parts of its multiples are evenly distributed.


def rounded_corners(sheet: Sheet, radius: float) -> tuple[Sheet, Floats]:
    """Round the corners of openings of a sheet; return also the fillets' radii (k,), metres.
    radius : metres; smaller where an arc does not fit.    Raises PatternError for a radius that is not a length."""
    if not (np.isfinite(radius) and radius > 0):
        raise PatternError(f"the radius {radius} of fillets must be a positive length in metres")
    if not len(sheet.walls.start):
        return sheet, np.empty(0)
    fillets = fitting_fillets(sheet, radius)
    while fillets.count:
        rounded = _with_fillets(sheet, fillets)
        clear = _clear_of_points(sheet, fillets, rounded.surface.V[pinched_vertices(rounded)])
        if clear.all():
            return rounded, fillets.radius
        fillets = fillets.subset(clear)
    return sheet, np.empty(0)


def _clear_of_points(sheet: Sheet, fillets: Fillets, X: Floats) -> Bools:
    surface, (arc, cell) = sheet.surface, fillets.pair.T
    box, margin = surface.V[surface.F[cell]], SNAP * fillets.radius[arc][:, None]
    clear = np.ones(fillets.count, dtype=bool)
    for x in X:
        clear[arc[((box.min(axis=1) - margin <= x) & (x <= box.max(axis=1) + margin)).all(axis=1)]] = False
    return clear


def _with_fillets(sheet: Sheet, fillets: Fillets) -> Sheet:
    arc, cell = fillets.pair.T
    mesh, source = recut_polygons(sheet, cell)
    mesh = replace(mesh, lines=sheet.lines.with_more(LineKind.FILLET, fillets.count, circle=fillets.circle))
    corner = np.searchsorted(np.unique(sheet.surface.F[source]), sheet.walls.start[fillets.wall])
    family = sheet.family[sheet.walls.material_cells[fillets.wall]]
    colour = _colours(arc, mesh.cells.corner.reshape(-1, 3)[np.searchsorted(source, cell)])
    for group in range(int(colour.max()) + 1):
        arc_of_cell = np.full(sheet.surface.m, -1)
        pairs = colour[arc] == group
        arc_of_cell[cell[pairs]] = arc[pairs]
        mesh, rows, filled_in = _filled_corners(mesh, arc_of_cell[source], fillets, corner, sheet.surface.size)
        source = source[rows]
        mesh.family[filled_in] = family[arc_of_cell[source[filled_in]]]
    return with_polygons(sheet, mesh, source)


def _colours(arc: Ints, corner: Ints) -> Ints:
    """Return the group of each arc. Cells of different arcs in a group share no vertex."""
    vertex, arc = corner.ravel(), np.repeat(arc, 3)
    count = int(arc.max()) + 1
    rank = np.argsort(np.argsort(np.arange(count) * GOLDEN % 1))
    colour, waiting, group = np.full(count, -1), np.ones(count, dtype=bool), 0
    while waiting.any():
        active = waiting[arc]
        lowest_rank = np.full(int(vertex.max()) + 1, count)
        np.minimum.at(lowest_rank, vertex[active], rank[arc[active]])
        chosen = waiting.copy()
        chosen[arc[active & (lowest_rank[vertex] != rank[arc])]] = False
        colour[chosen], group = group, group + 1
        waiting &= ~chosen
    return colour


def _filled_corners(
    mesh: PolygonMesh, arc: Ints, fillets: Fillets, corner: Ints, size: float
) -> tuple[PolygonMesh, Ints, Bools]:
    """Cut void polygons along fillets. Return the mesh, each polygon's old number (c,), and a mask of new material."""
    arc = np.where(mesh.void, arc, -1)
    source, beyond = np.arange(len(arc)), np.zeros(len(arc), dtype=bool)
    planes = [(fillets.ray[:, k], fillets.ray_distance[:, k], True) for k in range(fillets.ray.shape[1])]
    planes += [(fillets.normal[:, k], fillets.distance[:, k], False) for k in range(fillets.normal.shape[1])]
    for normal, distance, outside in planes:
        active = (arc >= 0) & ~beyond
        active[active] = normal[arc[active]].any(axis=1)
        if not active.any():
            continue
        x = _heights(mesh, arc, active, normal, distance, SNAP * fillets.radius)
        split = clean_split(mesh.cells, mesh.X, x, np.zeros(1), active, Snapping(0.0, size))
        source, arc, beyond = source[split.source], arc[split.source], beyond[split.source]
        mesh = mesh.after_split(split, mesh.lines.count - fillets.count + arc[None])
        if outside:
            arc = np.where(split.strip == 1, -1, arc)
        else:
            beyond |= split.strip == 1
    part = mesh.part_labels(beyond)
    corner_slots = beyond[mesh.cells.owner] & (mesh.cells.corner == corner[arc[mesh.cells.owner]])
    at_corner = np.zeros(len(beyond), dtype=bool)
    at_corner[part[mesh.cells.owner[corner_slots]]] = True
    return mesh, source, beyond & at_corner[part]


def _heights(mesh: PolygonMesh, arc: Ints, active: Bools, normal: Floats, distance: Floats, snap: Floats) -> Floats:
    """Return the heights (n',), metres, of vertices above a plane of the polygon's arc."""
    slots = mesh.cells.slots(np.flatnonzero(active))
    vertex, arc_of_slot = mesh.cells.corner[slots], arc[mesh.cells.owner[slots]]
    height = np.einsum("ki,ki->k", normal[arc_of_slot], mesh.X[vertex]) - distance[arc_of_slot]
    x = np.zeros(len(mesh.X))
    x[vertex] = np.where(np.abs(height) < snap[arc_of_slot], 0.0, height)
    return x
