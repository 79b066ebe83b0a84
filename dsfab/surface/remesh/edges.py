"""Edge operations of remeshing: division in the middle, collapse and flip."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, edge_lengths, lengths, row_max, row_min, unit_vectors
from dsfab.surface.edge_changes import (
    contracted_faces,
    halved_edges,
    has_new_diagonal,
    has_three_corners,
    leading_candidates,
    meets_link_condition,
    quads,
    sharp_edges,
    with_other_diagonals,
)
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.features import CORNER, TOLERANCE, FeatureCurves
from dsfab.surface.topology import EdgeTable, edge_table, faces_at, next_half_edge, on_boundary

FREE, ON_CURVE, FIXED = 0, 1, 2  # Kinds of vertices: free on the surface, on a boundary or crease, fixed.


@dataclass(frozen=True, eq=False)
class NetFaces:
    """Faces F (m, 3) of a mesh and their edges."""

    F: Ints

    @cached_property
    def edges(self) -> EdgeTable:
        return edge_table(self.F)


@dataclass(frozen=True, eq=False)
class Net:
    """Mesh during remeshing: vertices V (n, 3), metres, and faces. Boundaries and creases are called curves.
    kind  : (n,) `FREE`, `ON_CURVE` or `FIXED`.    size : (n,) wanted edge length at each vertex, metres.
    node  : (k,) the vertices along curves.    curve : (k,) the curve of each node.
    at    : (k,) arc length at each node, as in `FeatureCurves`, metres."""

    V: Floats
    faces: NetFaces
    kind: Ints
    node: Ints
    at: Floats
    curve: Ints
    size: Floats

    @classmethod
    def from_surface(cls, surface: Surface, curves: FeatureCurves, size: float) -> Self:
        """Return the mesh of a surface, unchanged, as a `Net`. size : wanted edge length, metres."""
        kind = np.full(surface.n, FREE)
        kind[curves.vertex] = ON_CURVE
        kind[curves.fixed] = FIXED
        sizes = np.full(surface.n, size)
        return cls(surface.V, NetFaces(surface.F), kind, curves.vertex, curves.at, curves.curve, sizes)

    @property
    def n(self) -> int:
        return len(self.V)

    @property
    def F(self) -> Ints:  # noqa: N802, the field's letter
        return self.faces.F

    @property
    def edges(self) -> EdgeTable:
        return self.faces.edges

    @property
    def edge_sizes(self) -> Floats:
        """Wanted lengths (e,) of the edges, metres."""
        a, b = self.edges.ends.T
        return np.asarray((self.size[a] + self.size[b]) / 2)

    @property
    def links(self) -> Ints:
        """Indices (l,) of the nodes (vertices along curves) at which an edge along a curve starts."""
        return np.flatnonzero(self.curve[1:] == self.curve[:-1])

    @property
    def link_ends(self) -> Ints:
        """Ends (l, 2) of the edges along boundaries and creases."""
        return np.stack([self.node[self.links], self.node[self.links + 1]], axis=1)

    @property
    def link_edges(self) -> Ints:
        """Indices (l,) of the edges along boundaries and creases."""
        return np.searchsorted(self.edges.ends @ (self.n, 1), np.sort(self.link_ends, axis=1) @ (self.n, 1))

    @property
    def along_curves(self) -> Bools:
        """Mask (e,) of the edges along boundaries and creases."""
        marks = np.zeros(len(self.edges.ends), dtype=bool)
        marks[self.link_edges] = True
        return marks

    def without_unused(self) -> "Net":
        """Return the mesh without vertices that no face uses."""
        used = np.zeros(self.n, dtype=bool)
        used[self.F] = True
        if used.all():
            return self
        index = np.cumsum(used) - 1
        V, kind, size = self.V[used], self.kind[used], self.size[used]
        return replace(self, V=V, faces=NetFaces(index[self.F]), kind=kind, node=index[self.node], size=size)


def independent(touched: Ints, cost: Floats, n: int, edges: Ints | None = None) -> Bools:
    """Return a mask (c,) of the mesh operations that are cheaper than all operations at the same vertices.
    touched : (c, k) vertices that each operation changes.    n : number of vertices.
    cost    : (c,) cost of each operation; a hash decides between similar costs [Knuth 1973].
    edges   : (e, 2) edges, to compare also operations at neighbouring vertices."""
    if not len(cost):
        return np.zeros(0, dtype=bool)
    spread = np.ptp(cost)
    level = np.floor(8 * ((cost - cost.min()) / spread)) if spread else np.zeros(len(cost))
    order = np.lexsort((np.arange(len(cost)) * 2654435761 % 2**32, level))
    return leading_candidates(order, touched, n, edges)


LONGEST = 4 / 3  # Edges longer than this multiple of their wanted length are halved [Botsch and Kobbelt 2004].


def with_long_edges_halved(net: Net, curves: FeatureCurves, edge: float) -> Net:
    """Return the mesh with long edges divided in the middle, once. edge : longest wanted edge length, metres."""
    length = edge_lengths(net.V, net.edges.ends)
    deviation, positions = curves.deviation(net.at[net.links], net.at[net.links + 1])
    missing = deviation > TOLERANCE * edge
    long = length > LONGEST * net.edge_sizes
    long[net.link_edges[missing]] = True
    long = _leading(net, long, length)
    return _halve_edges(net, curves, long, np.where(missing, positions, np.nan)) if long.any() else net


def _leading(net: Net, long: Bools, length: Floats) -> Bools:
    faces = np.flatnonzero(faces_at(net.edges.of, long))
    edge = net.edges.of[faces]
    marked_length = np.where(long, length, -1.0)[edge]
    flat = lengths(area_vectors(net.V, net.F[faces])) < 0.35 * row_max(length[edge]) ** 2
    behind = long[edge] & (marked_length < (np.where(flat, 1.0, 0.7) * row_max(marked_length))[:, None])
    leading = long.copy()
    leading[edge[behind]] = False
    return leading


def _halve_edges(net: Net, curves: FeatureCurves, halves: Bools, split_positions: Floats) -> Net:
    V, F, _ = halved_edges(net.V, net.F, net.edges, halves)
    added = len(V) - net.n
    size = np.concatenate([net.size, net.edge_sizes[halves]])
    kind = np.concatenate([net.kind, np.full(added, FREE)])
    link = net.link_edges
    is_split = halves[link]
    before = net.links[is_split]
    middle = (net.at[before] + net.at[before + 1]) / 2
    positions = np.where(np.isnan(split_positions[is_split]), middle, split_positions[is_split])
    vertex = (np.cumsum(halves) - 1 + net.n)[link[is_split]]
    kind[vertex] = ON_CURVE
    V[vertex] = curves.place(positions)
    return replace(
        net,
        V=V,
        faces=NetFaces(F),
        kind=kind,
        size=size,
        node=np.insert(net.node, before + 1, vertex),
        at=np.insert(net.at, before + 1, positions),
        curve=np.insert(net.curve, before + 1, net.curve[before]),
    )


SHORTEST = 4 / 5  # Edges shorter than this share of their wanted length are collapsed [Botsch and Kobbelt 2004].


@dataclass(frozen=True, eq=False)
class _Collapses:
    """Pairs of vertices (c,) that merge: vertex `gone` into vertex `kept`, at the point `goal` (c, 3), metres."""

    kept: Ints
    gone: Ints
    goal: Floats

    def only(self, which: Bools) -> "_Collapses":
        return _Collapses(self.kept[which], self.gone[which], self.goal[which])


def with_short_edges_collapsed(net: Net, curves: FeatureCurves, edge: float, batches: int = 12) -> Net:
    """Return the mesh with short edges collapsed. edge : longest wanted edge length, metres."""
    for batch in range(batches):
        collapses, cost = _candidates(net, curves, edge, backwards=batch % 2 == 1)
        pairs = np.stack([collapses.kept, collapses.gone], axis=1)
        collapses = collapses.only(independent(pairs, cost, net.n, edges=net.edges.ends))
        collapses = collapses.only(_keeps_faces(net, collapses))
        if not len(collapses.kept):
            break
        net = _merge_vertices(net, collapses)
    return net.without_unused()


def _candidates(net: Net, curves: FeatureCurves, edge: float, backwards: bool) -> tuple[_Collapses, Floats]:
    edges = net.edges
    cost = edge_lengths(net.V, edges.ends) / net.edge_sizes
    chosen = np.flatnonzero(cost < SHORTEST)
    lower = row_min(net.kind[edges.ends[chosen]])
    chosen = chosen[(lower < FIXED) & (net.along_curves[chosen] | (lower == FREE))]
    chosen = chosen[meets_link_condition(edges, chosen, net.n)]
    a, b = edges.ends[chosen].T
    swap = (net.kind[a] < net.kind[b]) | ((net.kind[a] == net.kind[b]) & backwards)
    target, gone = np.where(swap, b, a), np.where(swap, a, b)
    fine = (net.kind[gone] == FREE) | _keeps_curves(net, curves, target, gone, edge)
    both_free = (net.kind[target] == FREE)[:, None]
    goal = np.where(both_free, (net.V[target] + net.V[gone]) / 2, net.V[target])
    return _Collapses(target, gone, goal).only(fine), cost[chosen[fine]]


def _keeps_curves(net: Net, curves: FeatureCurves, target: Ints, gone: Ints, edge: float) -> Bools:
    position = np.zeros(net.n, dtype=np.int64)
    position[net.node] = np.arange(len(net.node))
    k = np.clip(position[gone], 1, max(len(net.node) - 2, 1))
    on_curve = net.kind[gone] == ON_CURVE
    fine = np.zeros(len(gone), dtype=bool)
    k, target = k[on_curve], target[on_curve]
    before, after = net.node[k - 1], net.node[k + 1]
    deviation, _ = curves.deviation(net.at[k - 1], net.at[k + 1])
    ends = np.stack([before, after], axis=1)
    short = edge_lengths(net.V, ends) < LONGEST * net.size[ends].mean(axis=1)
    exists = np.isin(np.sort(ends, axis=1) @ (net.n, 1), np.sort(net.link_ends, axis=1) @ (net.n, 1))
    fine[on_curve] = (deviation <= TOLERANCE * edge) & short & ~exists & ((target == before) | (target == after))
    return fine


def _keeps_faces(net: Net, collapses: _Collapses) -> Bools:
    onto, collapse_of = np.arange(net.n), np.full(net.n, -1)
    onto[collapses.gone] = collapses.kept
    collapse_of[collapses.kept] = collapse_of[collapses.gone] = np.arange(len(collapses.kept))
    V = net.V.copy()
    V[collapses.kept] = collapses.goal
    face = np.flatnonzero(faces_at(net.F, collapse_of >= 0))
    before, after, which = net.F[face], onto[net.F[face]], row_max(collapse_of[net.F[face]])
    count = len(collapses.kept)
    least = _group_minima(_roundness(net.V, before), which, count)
    stays = has_three_corners(after)
    before, after, which = before[stays], after[stays], which[stays]
    old_areas, new_areas = area_vectors(net.V, before), area_vectors(V, after)
    turned = np.einsum("mi,mi->m", old_areas, new_areas) < 0.7 * lengths(old_areas) * lengths(new_areas)
    too_long = _longest(V, after) > np.maximum(LONGEST * net.size[after].mean(axis=1), _longest(net.V, before))
    fine = _group_minima(_roundness(V, after), which, count) >= np.minimum(0.2, least)
    fine[which[turned | too_long]] = False
    return np.asarray(fine)


def _group_minima(values: Floats, group: Ints, count: int) -> Floats:
    least = np.full(count, np.inf)
    np.minimum.at(least, group, values)
    return least


def _roundness(V: Floats, F: Ints) -> Floats:
    return np.asarray(lengths(area_vectors(V, F)) / _longest(V, F) ** 2)


def _longest(V: Floats, F: Ints) -> Floats:
    a, b, c = V[F.T]
    return row_max(np.stack([lengths(b - a), lengths(c - b), lengths(a - c)], axis=1))


def _merge_vertices(net: Net, collapses: _Collapses) -> Net:
    V, onto, size = net.V.copy(), np.arange(net.n), net.size.copy()
    V[collapses.kept] = collapses.goal
    onto[collapses.gone] = collapses.kept
    free = net.kind[collapses.kept] == FREE
    target, gone = collapses.kept[free], collapses.gone[free]
    size[target] = (size[target] + size[gone]) / 2
    stays = ~np.isin(net.node, collapses.gone)
    faces, node, curve = NetFaces(contracted_faces(net.F, onto)), net.node[stays], net.curve[stays]
    return replace(net, V=V, faces=faces, size=size, node=node, at=net.at[stays], curve=curve)


LEAST_ANGLE = np.radians(25)  # Radians. A flip must not reduce the smallest angle below this.


def with_edges_flipped(net: Net, by_valence: bool, rounds: int) -> Net:
    """Return the mesh with flipped edges. Edges on boundaries and creases do not flip.
    by_valence : True for about six edges at each vertex, False for Delaunay triangles."""
    angles = np.empty(0) if by_valence else _face_angles(net.V, net.F)
    for _ in range(rounds):
        edges = net.edges
        pairs = edges.pairs[~net.along_curves[edges.count == 2]]
        gain = _valence_gain(net, quads(net.F, pairs)) if by_valence else _delaunay_gain(angles, pairs)
        pairs, gain = pairs[gain > 0], gain[gain > 0]
        quad = quads(net.F, pairs)
        chosen = np.flatnonzero(has_new_diagonal(quad, edges, net.n))
        chosen = chosen[_sound(net.V, quad[chosen])]
        chosen = chosen[independent(quad[chosen], -gain[chosen], net.n)]
        if not len(chosen):
            break
        net = replace(net, faces=NetFaces(with_other_diagonals(net.F, pairs[chosen], quad[chosen])))
        if not by_valence:
            turned = pairs[chosen].ravel() // 3
            angles[turned] = _face_angles(net.V, net.F[turned])
    return net


def _valence_gain(net: Net, quad: Ints) -> Floats:
    edges = net.edges
    valence = np.bincount(edges.ends.ravel(), minlength=net.n)
    free = net.kind < FIXED
    ideal = np.where(free, 6, valence)
    ideal[on_boundary(edges, net.n) & free] = 4
    excess = valence - ideal
    decrease = np.where(free, 2 * excess - 1, 0)  # excess^2 - (excess - 1)^2
    increase = np.where(free, -2 * excess - 1, 0)
    a, b, c, d = quad.T
    return np.asarray(decrease[a] + decrease[b] + increase[c] + increase[d], dtype=np.float64)


def _delaunay_gain(angles: Floats, pairs: Ints) -> Floats:
    first_angle, second_angle = angles.ravel()[next_half_edge(pairs.T, 2)]
    return np.asarray(first_angle + second_angle - np.pi - 1e-6)


def _face_angles(V: Floats, F: Ints) -> Floats:
    return np.stack([angles_at(V, F[:, c], F[:, (c + 1) % 3], F[:, (c + 2) % 3]) for c in range(3)], axis=1)


def _sound(V: Floats, quad: Ints) -> Bools:
    a, b, c, d = quad.T
    old_faces, new_faces = ((a, b, c), (b, a, d)), ((a, d, c), (d, b, c))
    before = area_vectors(V, np.stack(old_faces[0], axis=1)) + area_vectors(V, np.stack(old_faces[1], axis=1))
    fine = np.ones(len(quad), dtype=bool)
    for face in new_faces:
        after = area_vectors(V, np.stack(face, axis=1))
        fine &= np.einsum("qi,qi->q", before, after) > 0.8 * lengths(before) * lengths(after)
    least = [
        np.minimum(*(row_min(_face_angles(V, np.stack(face, axis=1))) for face in faces))
        for faces in (old_faces, new_faces)
    ]
    return np.asarray(fine & (least[1] > np.minimum(LEAST_ANGLE, least[0])))


def angles_at(V: Floats, apex: Ints, first_end: Ints, second_end: Ints) -> Floats:
    """Return the angles (q,), radians, at vertices `apex` between the directions to `first_end` and `second_end`."""
    u, v = V[first_end] - V[apex], V[second_end] - V[apex]
    x, y, z = u.T
    r, s, t = v.T
    twice = np.sqrt((y * t - z * s) ** 2 + (z * r - x * t) ** 2 + (x * s - y * r) ** 2)
    return np.asarray(np.arctan2(twice, x * r + y * s + z * t))


def with_ears_flipped(surface: Surface) -> Surface:
    """Return the surface with the inner edge of each ear flipped.
    An ear is a flat triangle with two border edges, and an angle over 150 degrees between these edges."""
    edges, n = surface.edges, surface.n
    pairs = np.concatenate([edges.pairs, edges.pairs[:, ::-1]])
    bare = edges.boundary[edges.of].reshape(-1, 3).sum(axis=1) == 2
    quad = quads(surface.F, pairs)
    a, b, c, d = quad.T
    alike = surface.F.ravel()[pairs[:, 1]] == b  # true if both faces have the same orientation
    ear = bare[pairs[:, 0] // 3] & ~bare[pairs[:, 1] // 3] & alike & has_new_diagonal(quad, edges, n)
    ear &= angles_at(surface.V, c, a, b) > np.radians(150.0)
    for start, end in ((a, b), (b, a)):  # no new face may turn over
        ear &= angles_at(surface.V, start, end, c) + angles_at(surface.V, start, end, d) < np.pi
    chosen = np.flatnonzero(ear)
    chosen = chosen[np.unique(pairs[chosen, 1] // 3, return_index=True)[1]]  # only one flip for each inner face
    if not len(chosen):
        return surface
    return Surface(surface.V, with_other_diagonals(surface.F, pairs[chosen], quad[chosen]))


LOW = 1 / 8
"""Largest height of a low face at the border, divided by its border edge. Normals of low faces have large errors."""


def without_rim_slivers(surface: Surface, smooth: bool = False) -> Surface:
    """Return the surface without very thin faces at the border, which have wrong normals.
    smooth : at a curved border, also collapse faces lower than `LOW` times their border edge."""
    chosen, _, _, tip = _low_border_faces(surface, TOLERANCE)
    chosen = chosen[np.unique(tip, return_index=True)[1]]  # remove only one face at each vertex
    surface = Surface(surface.V, np.delete(surface.F, chosen, axis=0)) if len(chosen) else surface
    while smooth and (onto := _collapsed_tips(surface)) is not None:
        used, F = np.unique(contracted_faces(surface.F, onto), return_inverse=True)
        surface = Surface(surface.V[used], F.reshape(-1, 3))
    return surface


def _low_border_faces(surface: Surface, ratio: float) -> tuple[Ints, Ints, Ints, Ints]:
    """Return the faces (c,) at the border that are lower than `ratio` times their border edge, lowest first.
    Return also the first and second end (c,) of the border edges, and the faces' third corners (c,)."""
    V, F, edges = surface.V, surface.F, surface.edges
    bare = edges.boundary[edges.of].reshape(-1, 3)
    side = bare.argmax(axis=1)  # the border edge starts at corner `side`
    a, b, tip = (F[np.arange(len(F)), (side + k) % 3] for k in range(3))
    height = 2 * surface.areas / edge_lengths(V, np.stack([a, b], axis=1)) ** 2
    low = (height < ratio) & (bare.sum(axis=1) == 1) & ~on_boundary(edges, surface.n)[tip]
    low &= (angles_at(V, a, b, tip) < np.pi / 2) & (angles_at(V, b, a, tip) < np.pi / 2)
    faces = np.flatnonzero(low)
    faces = faces[np.argsort(height[faces], kind="stable")]
    return faces, a[faces], b[faces], tip[faces]


def _collapsed_tips(surface: Surface) -> Ints | None:
    """Collapse the tips of low border faces: return each vertex's new index (n,), or None without a collapse."""
    V, F, edges, n = surface.V, surface.F, surface.edges, surface.n
    faces, a, b, tip = _low_border_faces(surface, LOW)
    to_a, to_b = (edge_lengths(V, np.stack([tip, end], axis=1)) for end in (a, b))
    end = np.where(to_a < to_b, a, b)
    sharp = sharp_edges(surface)
    creased = np.bincount(edges.ends[sharp].ravel(), minlength=n)
    by_tilt = sharp[edges.of.reshape(-1, 3)[faces]].sum(axis=1)  # number of the low face's edges that are creases
    turn, explained = _border_turns(surface, faces, a, b, tip)
    fits = (creased[tip] <= by_tilt) & explained
    fits &= ((V[tip] > V.min(axis=0)) & (V[tip] < V.max(axis=0))).all(axis=1) | (np.ptp(V, axis=0) == 0).any()
    keys = np.sort(np.stack([tip, end], axis=1)) @ (n, 1)
    fits &= meets_link_condition(edges, np.searchsorted(edges.ends @ (n, 1), keys), n)
    candidate = np.full(n, -1)
    candidate[tip] = np.arange(len(tip))
    fits &= candidate[tip] == np.arange(len(tip))  # use only one low face at each tip
    for corner in range(3):
        changed = np.flatnonzero(candidate[F[:, corner]] >= 0)
        number, triangles = candidate[F[changed, corner]], F[changed].copy()
        triangles[:, corner] = end[number]
        stays = has_three_corners(triangles)
        triangles, number, normals = triangles[stays], number[stays], surface.normals[changed[stays]]
        area = area_vectors(V, triangles)
        height, least_cosine = np.einsum("mi,mi->m", area, normals), np.cos(np.minimum(1.5, turn[number]))
        fits[number[height < np.maximum(LOW * _longest(V, triangles) ** 2, least_cosine * lengths(area))]] = False
    tip, end = tip[fits], end[fits]
    onto, leads = np.arange(n), independent(np.stack([tip, end], axis=1), np.minimum(to_a, to_b)[fits], n, edges.ends)
    onto[tip[leads]] = end[leads]
    return onto if leads.any() else None


def _border_turns(surface: Surface, faces: Ints, a: Ints, b: Ints, tip: Ints) -> tuple[Floats, Bools]:
    """Return the angle (c,) by which the border bends at low faces, radians.
    Return also a mask (c,) of the faces with a height that this bend explains."""
    V, F, edges = surface.V, surface.F, surface.edges
    weighted = np.zeros((surface.n, 3))
    rest = np.delete(np.arange(len(F)), faces)
    for corner in F[rest].T:
        np.add.at(weighted, corner, area_vectors(V, F[rest]))
    normal = unit_vectors(weighted[tip])
    along = unit_vectors(V[b] - V[a])
    slope = np.zeros((surface.n, 3))  # sum of the directions from a border vertex to its border neighbours
    for start, stop in (edges.ends[edges.boundary].T, edges.ends[edges.boundary].T[::-1]):
        np.add.at(slope, start, unit_vectors(V[stop] - V[start]))
    slope[lengths(slope) > 2 * np.sin(np.radians(CORNER) / 2) + 1e-6] = 0.0
    turn = np.abs(np.einsum("ci,ci->c", (slope[a] + slope[b]) / 2, normal))
    foot = V[tip] - V[a]
    rise = np.abs(np.einsum("ci,ci->c", foot - np.einsum("ci,ci->c", foot, along)[:, None] * along, normal))
    base = np.linalg.norm(V[b] - V[a], axis=1)
    return np.asarray(turn), np.asarray(rise <= 2 * base * turn / 8 + 1e-9 * base)
