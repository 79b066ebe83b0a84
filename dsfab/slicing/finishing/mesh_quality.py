"""Quality of the triangles of a sheet, and its improvement."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, distances_from_segments, distinct, equal_key_groups
from dsfab.slicing.cutting.sheet import VOID, Sheet, weight_entries
from dsfab.slicing.cutting.split import CELL_AREA
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import next_half_edge, on_boundary


class Quality(NamedTuple):
    """Shape of triangles.
    worst_angle : the smallest angle, degrees, at `place` (3,).    needles : share of triangles under 1 degree.
    median      : median of 4 sqrt(3) area / sum of squared sides; equilateral triangles have 1 [Bank, Smith 1997]."""

    worst_angle: float
    place: Floats
    needles: float
    median: float


def quality(surface: Surface) -> Quality:
    """Measure the shape of the triangles of a surface."""
    P = surface.V[surface.F]
    sides = np.roll(P, -1, axis=1) - P
    squares = np.einsum("mci,mci->mc", sides, sides)
    back = -np.roll(sides, 1, axis=1)
    angles = np.degrees(np.arctan2(2 * surface.areas[:, None], np.einsum("mci,mci->mc", sides, back))).min(axis=1)
    shape = 4 * np.sqrt(3) * surface.areas / squares.sum(axis=1)
    worst = int(angles.argmin())
    return Quality(float(angles[worst]), surface.centroids[worst], float((angles < 1).mean()), float(np.median(shape)))


def least_angles(P: Floats, normals: Floats) -> Floats:
    """Return the smallest angle (k,) of triangles P (k, 3, 3), degrees; negative if a triangle is reversed."""
    sides = np.roll(P, -1, axis=1) - P
    back = -np.roll(sides, 1, axis=1)
    twice = np.einsum("ki,ki->k", np.cross(sides[:, 0], back[:, 0]), normals)
    return np.asarray(np.degrees(np.arctan2(twice[:, None], np.einsum("kci,kci->kc", sides, back))).min(axis=1))


GAIN = 1.01
"""Minimum factor by which a step must increase the smallest angle; a smaller gain may be a rounding error."""


@dataclass(frozen=True, eq=False)
class CellMesh:
    """A cut sheet during its improvement, and the surface `uncut` before the cut.
    strayed        : (n',) upper bound of the distance by which stripe edges have moved at each vertex, metres.
    smallest_angle : (m',) the smallest angle of each cell, degrees.
    least_area     : minimum area of a cell, square metres."""

    sheet: Sheet
    uncut: Surface
    strayed: Floats
    smallest_angle: Floats
    least_area: float

    @classmethod
    def from_sheet(cls, sheet: Sheet, uncut: Surface) -> Self:
        """Return the mesh of all cells of `sheet`. uncut : surface before the cut."""
        least_area = CELL_AREA * float(np.sum(np.ptp(sheet.surface.V, axis=0) ** 2))
        angle = _cell_angles(sheet.surface.V[sheet.surface.F], uncut.normals[sheet.parent], least_area)
        return cls(replace(sheet, sides_on=sheet.lines_of_edges), uncut, np.zeros(sheet.surface.n), angle, least_area)

    @property
    def surface(self) -> Surface:
        """The surface of all cells; some vertices may be unused."""
        return self.sheet.surface

    @cached_property
    def support(self) -> Ints:
        """(n', 3) corners of the uncut face, edge or vertex on which each vertex lies; -1 in unused columns."""
        weights = self.sheet.weights
        return np.where(np.arange(3) < np.diff(weights.indptr)[:, None], weight_entries(weights)[0], -1)

    @cached_property
    def keys(self) -> Ints:
        return self.key(*self.surface.edges.ends.T)

    def key(self, a: Ints, b: Ints) -> Ints:
        """Return a unique number (k,) for each pair of vertices a (k,) and b (k,), independent of their order."""
        return np.minimum(a, b) * len(self.surface.V) + np.maximum(a, b)

    def edge(self, a: Ints, b: Ints) -> Ints:
        """Return the edges (k,) between vertices a (k,) and b (k,); -1 if there is no edge."""
        key = self.key(a, b)
        index = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        return np.where(self.keys[index] == key, index, -1)

    @cached_property
    def lines(self) -> Bools:
        """(e,) mask of edges on the surface's boundary, or between cells of different families."""
        result = np.ones(len(self.keys), dtype=bool)
        two = self.surface.edges.count == 2
        f, g = (self.surface.edges.pairs // 3).T
        result[two] = self.sheet.family[f] != self.sheet.family[g]
        return result

    @cached_property
    def outline(self) -> Bools:
        """(e,) mask of edges between material and void."""
        result = np.zeros(len(self.keys), dtype=bool)
        f, g = (self.surface.edges.pairs // 3).T
        result[self.surface.edges.count == 2] = self.sheet.material[f] != self.sheet.material[g]
        return result

    @cached_property
    def line_ends(self) -> Ints:
        """(n',) for each vertex, the sum of the indices of its neighbours along edges in `lines`."""
        total = np.zeros(len(self.surface.V), dtype=np.int64)
        a, b = self.surface.edges.ends[self.lines].T
        np.add.at(total, a, b)
        np.add.at(total, b, a)
        return total

    def angles(self, F: Ints, parent: Ints) -> Floats:
        """Return the smallest angle (k,) of each triangle F (k, 3), degrees: negative if reversed, 0 without area.
        parent : (k,) uncut face of each triangle."""
        return _cell_angles(self.surface.V[F], self.uncut.normals[parent], self.least_area)

    @cached_property
    def stars(self) -> tuple[Ints, Ints]:
        """Cells (3 m',), sorted by vertex, and start (n' + 1,). Vertex v has cells[start[v] : start[v + 1]]."""
        start = np.concatenate([[0], np.cumsum(np.bincount(self.surface.F.ravel(), minlength=len(self.surface.V)))])
        return equal_key_groups(self.surface.F.ravel())[0] // 3, start

    def star_cells(self, vertex: Ints) -> tuple[Ints, Ints]:
        """Return the cells around vertices (k,), as two arrays: index in `vertex`, ascending; cell at this vertex."""
        faces, start = self.stars
        count = start[vertex + 1] - start[vertex]
        row = np.repeat(np.arange(len(vertex)), count)
        begin = np.repeat(start[vertex] - np.concatenate([[0], np.cumsum(count)[:-1]]), count)
        return row, faces[begin + np.arange(len(row))]

    def with_cells(self, F: Ints, sides_on: Ints, keep: Bools, strayed: Floats) -> "CellMesh":
        """Return the mesh with the triangles of F (m', 3) that `keep` (m',) marks. sides_on : (m', 3) as in `Sheet`."""
        parent, angle = self.sheet.parent, self.smallest_angle.copy()
        changed = (F != self.surface.F).any(axis=1) & keep
        angle[changed] = self.angles(F[changed], parent[changed])
        columns = (parent[keep], self.sheet.family[keep], self.sheet.weights, 0, sides_on[keep])
        sheet = Sheet(Surface(self.surface.V, F[keep]), *columns, self.sheet.lines)
        return replace(self, sheet=sheet, strayed=strayed, smallest_angle=angle[keep])


def _cell_angles(P: Floats, normals: Floats, least_area: float) -> Floats:
    twice = np.einsum("ki,ki->k", np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]), normals)
    return np.where(np.abs(twice) <= 2 * least_area, 0.0, least_angles(P, normals))


def independent(row: Ints, face: Ints, rank: Ints, m: int) -> Bools:
    """Return a mask (k,) of mesh changes that share no face with a change of lower rank.
    rank : (k,) order of preference.    row, face : change row[i] affects face[i].    m : number of faces."""
    lowest_rank = np.full(m, len(rank))
    np.minimum.at(lowest_rank, face, rank[row])
    free = np.ones(len(rank), dtype=bool)
    free[row[lowest_rank[face] != rank[row]]] = False
    return free


class CollapseMoves(NamedTuple):
    """Moves of vertices v (k,) onto neighbours w (k,). strayed : (k,) largest moves of stripe edges, m."""

    v: Ints
    w: Ints
    strayed: Floats

    def subset(self, which: Bools | Ints) -> "CollapseMoves":
        """Return the moves that the mask or index array `which` selects."""
        return CollapseMoves._make(column[which] for column in self)


class Change(NamedTuple):
    """A mesh after some changes, and the number of changes. zone : (n',) mask of vertices for the next round."""

    mesh: CellMesh
    number: int
    zone: Bools


def collapse_edges(cut: CellMesh, tolerance: float, zone: Bools) -> Change:
    """Collapse edges where this increases the smallest angle around a vertex.
    tolerance : largest move of stripe edges and of the surface's boundary, m.    zone : (n',) vertices to check."""
    moves = _within_faces(cut, _along_lines(cut, _candidates(cut, zone), tolerance))
    moves, gain = _improving_moves(cut, moves)
    zone = np.zeros(len(zone), dtype=bool)
    if not len(moves.v):
        return Change(cut, 0, zone)
    rank = np.empty(len(gain), dtype=np.int64)
    rank[np.argsort(-gain, kind="stable")] = np.arange(len(gain))
    stars = [cut.star_cells(end) for end in (moves.v, moves.w)]
    row, face = (np.concatenate(column) for column in zip(*stars, strict=True))
    zone[cut.surface.F[face]] = True
    moves = moves.subset(independent(row, face, rank, len(cut.surface.F)))
    onto = np.arange(len(cut.surface.V))
    onto[moves.v] = moves.w
    F = onto[cut.surface.F]
    strayed = cut.strayed.copy()
    ends = cut.surface.edges.ends[cut.lines]
    moved = np.zeros(len(cut.surface.V))
    moved[moves.v] = moves.strayed
    for p, q in (ends.T, ends[:, ::-1].T):
        np.maximum.at(strayed, onto[q], moved[p])
    np.maximum.at(strayed, moves.w, moves.strayed)
    has_area = (np.roll(F, 1, axis=1) != F).all(axis=1)
    sides_on = _merged_sides(cut.sheet, np.flatnonzero(~has_area), onto)
    return Change(cut.with_cells(F, sides_on, has_area, strayed), len(moves.v), zone)


def _merged_sides(sheet: Sheet, cells: Ints, onto: Ints) -> Ints:
    row, F = np.arange(len(cells)), sheet.surface.F[cells]
    place = (onto[F] != F).argmax(axis=1)
    begins_at_w = F[row, (place + 1) % 3] == onto[F[row, place]]
    opposite, free_side = 3 * cells + (place + 1) % 3, 3 * cells + np.where(begins_at_w, (place + 2) % 3, place)
    sides_on, beyond = sheet.sides_on.ravel().copy(), sheet.surface.edges.twins[free_side]
    line = np.where(sides_on[opposite] > 0, sides_on[opposite], sides_on[free_side])
    sides_on[beyond[beyond >= 0]] = line[beyond >= 0]
    return sides_on.reshape(-1, 3)


def _candidates(cut: CellMesh, zone: Bools) -> CollapseMoves:
    poor = (cut.smallest_angle < 25) & cut.sheet.material
    edge = distinct(cut.surface.edges.of[poor])
    edge = edge[zone[cut.surface.edges.ends[edge]].any(axis=1)]
    v, w = np.concatenate([cut.surface.edges.ends[edge], cut.surface.edges.ends[edge][:, ::-1]]).T
    is_new = (cut.support[v] >= 0).sum(axis=1) > 1
    return CollapseMoves(v[is_new], w[is_new], np.zeros(np.count_nonzero(is_new)))


def _within_faces(cut: CellMesh, moves: CollapseMoves) -> CollapseMoves:
    row, face = cut.star_cells(moves.v)
    corner, support = cut.uncut.F[cut.sheet.parent[face]], cut.support[moves.w[row]]
    outside = ((support >= 0) & (support[:, :, None] != corner[:, None]).all(axis=2)).any(axis=1)
    return moves.subset(np.bincount(row, outside, len(moves.v)) == 0)


def _along_lines(cut: CellMesh, moves: CollapseMoves, tolerance: float) -> CollapseMoves:
    v, w, _ = moves
    count = np.bincount(cut.surface.edges.ends[cut.lines].ravel(), minlength=len(cut.surface.V))
    rim = on_boundary(cut.surface.edges, len(cut.surface.V))
    edge = cut.edge(v, w)
    along = cut.lines[edge]
    step = np.linalg.norm(cut.surface.V[v] - cut.surface.V[w], axis=1)
    slides = along & (count[v] == 2)
    total = cut.line_ends
    u = np.where(slides, total[v] - w, v)  # w and u are the neighbours of v on the line
    distance = np.where(slides, distances_from_segments(cut.surface.V[v], cut.surface.V[u], cut.surface.V[w]), step)
    distance[distance <= 1e-12 * np.abs(cut.surface.V).max()] = 0  # a rounding error
    strayed = np.where(count[v] > 0, np.maximum.reduce([cut.strayed[v], cut.strayed[w], cut.strayed[u]]) + distance, 0)
    joints = (count[v] == 3) & (count[w] == 3) & cut.outline[edge] & ~rim[v] & ~rim[w]
    connected = np.where(along, (count[v] == 2) | (count[w] == 2) | joints, count[w] == 0)
    onto = ~rim[v] | cut.surface.edges.boundary[edge]
    allowed = (count[v] == 0) | (connected & onto & (strayed <= tolerance))
    return CollapseMoves(v, w, strayed).subset(allowed)


def _improving_moves(cut: CellMesh, moves: CollapseMoves) -> tuple[CollapseMoves, Floats]:
    """Select moves that increase the smallest angle; return also the increases, degrees."""
    row, face = cut.star_cells(moves.v)
    F, material, parent = cut.surface.F[face], cut.sheet.material[face], cut.sheet.parent[face]
    v, w = moves.v[row], moves.w[row]
    removed = (w[:, None] == F).any(axis=1)
    new_angle = np.full(len(row), np.inf)
    new_angle[~removed] = cut.angles(np.where(v[:, None] == F, w[:, None], F)[~removed], parent[~removed])
    before, after = np.full((2, 2, len(moves.v)), np.inf)
    for kind in (0, 1):
        same_kind = material == bool(kind)
        np.minimum.at(before[kind], row[same_kind], cut.smallest_angle[face[same_kind]])
        np.minimum.at(after[kind], row[same_kind], new_angle[same_kind])
    accepted = (after[1] > GAIN * before[1]) & (after[0] >= np.minimum(before[0], after[1])) & (after[0] > 0)
    accepted &= np.isfinite(after[1]) & _satisfies_link_condition(cut, moves, row, F)
    return moves.subset(accepted), (after[1] - before[1])[accepted]


def _satisfies_link_condition(cut: CellMesh, moves: CollapseMoves, row: Ints, F: Ints) -> Bools:
    """Return a mask of moves v -> w that keep the mesh a surface [Dey et al. 1999]."""
    star_vertices = np.repeat(row, 3), F.ravel()
    is_neighbour = (star_vertices[1] != moves.v[star_vertices[0]]) & (star_vertices[1] != moves.w[star_vertices[0]])
    pair = distinct(star_vertices[0][is_neighbour] * len(cut.surface.V) + star_vertices[1][is_neighbour])
    move, x = pair // len(cut.surface.V), pair % len(cut.surface.V)
    edge_to_w = cut.edge(x, moves.w[move])
    common = np.bincount(move[edge_to_w >= 0], minlength=len(moves.v))
    two_lines = (edge_to_w >= 0) & cut.lines[edge_to_w] & cut.lines[cut.edge(x, moves.v[move])]
    closes = np.bincount(move[two_lines], minlength=len(moves.v)) > 0
    return np.asarray((common == cut.surface.edges.count[cut.edge(moves.v, moves.w)]) & ~closes)


def flip_edges(cut: CellMesh, zone: Bools) -> Change:
    r"""Flip edges where this increases the smallest angle of two neighbouring cells.

      c            c
     /|\          / \        Both cells must have the same family and the same uncut face.
    a | b   ->   a---b
     \|/          \ /
      d            d

    zone : (n',) mask of vertices. It must mark all corners of at least one of the two cells."""
    h, g = cut.surface.edges.pairs.T
    f, e = h // 3, g // 3
    parent, family = cut.sheet.parent, cut.sheet.family
    in_zone = np.asarray(zone[cut.surface.F].all(axis=1))
    flippable = (parent[f] == parent[e]) & (family[f] == family[e]) & (family[f] != VOID) & (in_zone[f] | in_zone[e])
    h, g, f, e = h[flippable], g[flippable], f[flippable], e[flippable]
    d, c, b = (cut.surface.F[f, (h + k) % 3] for k in range(3))  # half-edge h: from d to c
    a = cut.surface.F[e, (g + 2) % 3]
    first_cell, second_cell = np.stack([a, c, b], axis=1), np.stack([b, d, a], axis=1)
    parent = parent[f]
    new_angle = np.minimum(cut.angles(first_cell, parent), cut.angles(second_cell, parent))
    old_angle = np.minimum(cut.smallest_angle[f], cut.smallest_angle[e])
    better = np.flatnonzero(new_angle > GAIN * old_angle)  # edge a-b cannot exist yet: it would cross c-d
    better = better[np.argsort(-(new_angle - old_angle)[better], kind="stable")]
    zone = np.zeros(len(zone), dtype=bool)
    zone[first_cell[better]] = zone[second_cell[better]] = True
    rank = np.arange(len(better))
    pair_faces = np.concatenate([f[better], e[better]])
    chosen = better[independent(np.concatenate([rank, rank]), pair_faces, rank, len(cut.surface.F))]
    F = cut.surface.F.copy()
    F[f[chosen]], F[e[chosen]] = first_cell[chosen], second_cell[chosen]
    cb, bd, da, ac = (
        cut.sheet.sides_on.ravel()[next_half_edge(half[chosen], steps)] for half in (h, g) for steps in (1, 2)
    )
    sides_on = cut.sheet.sides_on.copy()
    sides_on[f[chosen]], sides_on[e[chosen]] = (np.stack([*pair, 0 * cb], axis=1) for pair in ((ac, cb), (bd, da)))
    return Change(cut.with_cells(F, sides_on, np.ones(len(F), dtype=bool), cut.strayed), len(chosen), zone)


@dataclass(frozen=True, eq=False)
class ImprovedSheet:
    """A sheet after the improvement of its cells.
    sheet         : all cells, material and void.      flips, collapses : numbers of changed edges.
    before, after : shape of the material's cells.
    strayed       : largest distance by which the edge of a stripe moved, metres."""

    sheet: Sheet
    flips: int
    collapses: int
    before: Quality
    after: Quality
    strayed: float

    @property
    def summary(self) -> str:
        """Return a sentence about the improvement."""
        a, b = self.before, self.after
        return (
            f"{self.flips} edges flipped and {self.collapses} collapsed: smallest angle {a.worst_angle:.2g} -> "
            f"{b.worst_angle:.2g} degrees, under 1 degree {a.needles:.2%} -> {b.needles:.2%}, median quality "
            f"{a.median:.2f} -> {b.median:.2f}"
        )


def improve_cells(sheet: Sheet, uncut: Surface, tolerance: float = 0.0) -> ImprovedSheet:
    """Flip and collapse edges to increase the smallest angle of a sheet's material.
    sheet     : all cells cut from the surface `uncut`, material and void.
    tolerance : largest move of stripe edges and of the surface's boundary, metres."""
    cut, zone = CellMesh.from_sheet(sheet, uncut), np.ones(sheet.surface.n, dtype=bool)
    flips = collapses = 0
    for _ in range(40):  # usually the loop ends after fewer than ten rounds
        cut, fewer, collapse_zone = collapse_edges(cut, tolerance, zone)
        cut, turned, flip_zone = flip_edges(cut, zone | collapse_zone)
        flips, collapses, zone = flips + turned, collapses + fewer, collapse_zone | flip_zone
        if not fewer and not turned:
            break
    before = quality(sheet.subset().surface)
    if not flips and not collapses:
        return ImprovedSheet(sheet, 0, 0, before, before, 0.0)
    used = np.zeros(len(cut.surface.V), dtype=bool)
    used[cut.surface.F] = True
    used[: uncut.n] = True
    surface = Surface(cut.surface.V[used], (np.cumsum(used) - 1)[cut.surface.F])
    columns = (cut.sheet.parent, cut.sheet.family, cut.sheet.weights[used], 0, cut.sheet.sides_on, sheet.lines)
    better = Sheet(surface, *columns)
    return ImprovedSheet(better, flips, collapses, before, quality(better.subset().surface), float(cut.strayed.max()))
