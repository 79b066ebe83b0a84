"""Stripes as phases on a surface, and the middle lines of stripes."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups, lengths, lock, lock_floats, sorted_order
from dsfab.core.limits import SAME_PHASE
from dsfab.slicing.cutting.corner_fields import PolygonField
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.halving import LineHalving
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField, hat_gradients
from dsfab.surface.topology import EdgeTable, edge_table


@dataclass(frozen=True, eq=False)
class Chart:
    """Phases of two families of stripes on a surface. A phase is a whole number on the middle of each stripe.
    surface : n' vertices, m' faces, cut open where phases do not match.
    parent  : (m',) face of the uncut surface.    weights : (n', n) barycentric weights on the uncut vertices.
    z       : (n', 2) phases of the major and the minor family.
    scale   : (n', 2) fraction of a family's stripes that remain after halving; 0 without a phase."""

    surface: Surface
    parent: Ints
    weights: csr_array
    z: Floats
    scale: Floats

    def __post_init__(self) -> None:
        lock_floats(self, z=(self.surface.n, 2), scale=(self.surface.n, 2))

    def carry(self, x: Floats) -> Floats:
        """Return values (n', ...) on this chart, from x (n, ...) on the uncut surface."""
        return np.asarray(self.weights @ x)


def chart_of(halved: LineHalving, phases: tuple[CornerField, CornerField] | None = None) -> Chart:
    """Return the phases of the stripes that remain after `halve_lines`.
    phases : phases of the two families before halving, default `halved.phases`."""
    mesh, phases = halved.mesh, phases or halved.phases
    surface, cell, _ = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    slot = _corner_slots(mesh, surface.F, cell)
    z, scale = np.empty((2, 3 * surface.m, 2))
    for k, phase in enumerate(phases):
        seen = PolygonField.from_field(mesh, phase)
        scale[:, k] = np.where(seen.blank, 0.0, 0.5 ** halved.level[mesh.cells.owner, k])[slot]
        z[:, k] = np.where(seen.blank, 0.5, seen.slot_values(0))[slot] * np.where(scale[:, k] > 0, scale[:, k], 1.0)
    flat = surface.F.ravel()
    first_corner, vertex = equal_row_groups(flat, np.rint(np.concatenate([z, scale], axis=1) / SAME_PHASE))
    chart_surface = Surface(surface.V[flat[first_corner]], vertex.reshape(-1, 3))
    weights = mesh.weights[flat[first_corner]]
    return Chart(chart_surface, mesh.parent[cell], weights, z[first_corner], scale[first_corner])


def equal_row_groups(key: Ints, rows: Floats) -> tuple[Ints, Ints]:
    """Group equal rows (k, r) with equal keys (k,). Return each group's first row (g,), and the group of each row."""
    order, begins, group_of = equal_key_groups(key)
    lead = order[begins][group_of]
    different = np.flatnonzero((rows != rows[lead]).any(axis=1))  # rows unequal to the first row with the same key
    lead = lead.copy()
    if len(different):
        table = np.column_stack([key[different], rows[different]])
        _, first_row, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
        lead[different] = different[first_row][group.ravel()]
    leads = np.flatnonzero(lead == np.arange(len(key)))
    place = np.empty(len(key), dtype=np.int64)
    place[leads] = np.arange(len(leads))
    return leads, place[lead]


def _corner_slots(mesh: PolygonMesh, F: Ints, cell: Ints) -> Ints:
    n = len(mesh.X)
    key = mesh.cells.owner * n + mesh.cells.corner
    order = sorted_order(key)
    corner_key = (cell[:, None] * n + F).ravel()
    return np.asarray(order[np.searchsorted(key[order], corner_key)])


ON = 1e-6  # Largest difference between a whole number and the phase on a middle line.
POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6
"""(4, 3) sample points of a face: about the centroids of four equal triangles in the face."""


@dataclass(frozen=True, eq=False)
class StripeChart:
    """Stripes of two families (major, minor) on a surface, and other material.
    surface : n vertices, m faces.    z : (n, 2) phases of the two families, whole numbers at the middles of stripes.
    d       : (n, 2) half widths: in a stripe, the phase is within d of a whole number.
    known   : (m, 2) True for faces with a phase.    kept : (n,) positive in material other than stripes."""

    surface: Surface
    z: Floats
    d: Floats
    known: Bools
    kept: Floats

    def __post_init__(self) -> None:
        n, m = self.surface.n, self.surface.m
        lock_floats(self, z=(n, 2), d=(n, 2))
        lock(self, "known", np.bool_, (m, 2))
        lock(self, "kept", np.float64, (n,))

    @classmethod
    def from_chart(cls, chart: Chart, d: Floats, kept_values: Floats) -> Self:
        """Return stripes with the phases of a chart.
        d : (n, 2) half width / distance between stripes.    kept_values : (n,) positive in other material."""
        has_phase = np.asarray((chart.scale[chart.surface.F] > 0).all(axis=1))
        nearest_whole = np.rint(chart.z)
        z = np.where(np.abs(chart.z - nearest_whole) < ON, nearest_whole, chart.z)
        return cls(chart.surface, z, np.clip(chart.carry(d), 0.0, 0.5), has_phase, chart.carry(kept_values))

    @cached_property
    def place(self) -> Ints:
        """(n,) a number for the position of each vertex; equal for vertices at the same position."""
        order = np.lexsort(self.surface.V.T)
        apart = (np.diff(self.surface.V[order], axis=0) != 0).any(axis=1)
        place = np.empty(self.surface.n, dtype=np.int64)
        place[order] = np.concatenate([[0], np.cumsum(apart)])
        return place

    @cached_property
    def table(self) -> EdgeTable:
        """Edges of the surface. The two sides of a cut count as the same edges."""
        return edge_table(self.place[self.surface.F])

    def corners(self, x: Floats) -> Floats:
        """Return values (3, m) at the corners of faces, from values x (n,) at the vertices."""
        return np.asarray(x[self._corner])

    def steep(self, k: int) -> Bools:
        """Return a mask (m,) of faces on which the phase of family k is known and not constant."""
        return self.known[:, k] & (self.slope[k] * self.surface.size > 1e-9)

    @cached_property
    def _corner(self) -> Ints:
        return np.ascontiguousarray(self.surface.F.T)

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """Gradients (m, 3) of the major and the minor phase, per metre."""
        hats = np.ascontiguousarray(hat_gradients(self.surface).transpose(1, 0, 2))
        major, minor = (sum(g * z[:, None] for g, z in zip(hats, self.corners(x), strict=True)) for x in self.z.T)
        return np.asarray(major), np.asarray(minor)

    @cached_property
    def slope(self) -> tuple[Floats, Floats]:
        """Stripes per metre (m,) for the major and the minor family; never 0."""
        major, minor = (np.maximum(lengths(g), np.finfo(float).tiny) for g in self.gradients)
        return major, minor

    def inside(self, k: int, face: Ints, coordinates: Floats) -> Bools:
        """Return a mask (q,) of points in stripes of family k. coordinates : (q, 3) barycentric in faces (q,)."""
        corner = self.surface.F[face]
        z, d = (np.einsum("qc,qc->q", x[corner, k], coordinates) for x in (self.z, self.d))
        return np.asarray((np.abs(z - np.rint(z)) <= d + ON * (d > 0)) & self.known[face, k])

    def is_kept(self, face: Ints, coordinates: Floats) -> Bools:
        """Return a mask (q,) of points in material other than stripes."""
        return np.asarray(np.einsum("qc,qc->q", self.kept[self.surface.F[face]], coordinates) > 0)

    @cached_property
    def void(self) -> Floats:
        """(m,) estimated fraction of each face without material."""
        solid = self._kept_points.copy()
        for k in (0, 1):
            z, d = (POINTS @ self.corners(x[:, k]) for x in (self.z, self.d))
            solid |= (np.abs(z - np.rint(z)) < d) & self.known[:, k]
        return np.asarray(1 - solid.mean(axis=0))

    def member_widths(self, k: int) -> tuple[Floats, Floats]:
        """Return the width (m,), metres, of family k's members in each face, and the area (m,), m2."""
        z, d = (POINTS @ self.corners(x[:, k]) for x in (self.z, self.d))
        share = ((np.abs(z - np.rint(z)) < d) & self.known[:, k]).mean(axis=0)
        return 2 * d.mean(axis=0) / self.slope[k], self.surface.areas * share

    @cached_property
    def free(self) -> Floats:
        """(m,) estimated fraction of each face without kept material."""
        return np.asarray(1 - self._kept_points.mean(axis=0))

    @cached_property
    def _kept_points(self) -> Bools:
        return np.asarray(POINTS @ self.corners(self.kept) > 0)


@dataclass(frozen=True, eq=False)
class StripeMiddles:
    """Middle lines of the members of family k, as s pieces that meet at j nodes.
    face : (s,) face of each piece.    at : (s, 2, 3) barycentric coordinates of the piece's ends.
    node : (s, 2) nodes at the ends of each piece.    edge : (j,) True for nodes on the boundary of the surface.
    copy : (s,) True for a piece on an edge, if an earlier face has the same piece."""

    drawn: StripeChart
    k: int
    face: Ints
    at: Floats
    node: Ints
    copy: Bools
    edge: Bools

    @cached_property
    def points(self) -> Floats:
        """(s, 2, 3) ends of each piece, metres."""
        surface = self.drawn.surface
        return np.asarray(np.einsum("sec,scx->sex", self.at, surface.V[surface.F[self.face]]))

    @cached_property
    def length(self) -> Floats:
        """(s,) length of each piece, metres; half for a piece on an edge of two faces."""
        metres = np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1)
        key = self.node.min(axis=1) * len(self.edge) + self.node.max(axis=1)
        group = equal_key_groups(key)[2]
        return np.asarray(metres / np.bincount(group)[group])

    @cached_property
    def degree(self) -> Ints:
        """(j,) number of pieces that end at each node."""
        return np.bincount(self.node[~self.copy].ravel(), minlength=len(self.edge))

    def at_nodes(self, marked: Bools) -> Bools:
        """Return a mask (j,) of the nodes at marked ends of pieces. marked : (s, 2) mask of each piece's ends."""
        result = np.zeros(len(self.edge), dtype=bool)
        result[self.node[marked]] = True
        return result

    @cached_property
    def ends_in_material(self) -> Bools:
        """(s, 2) mask of the pieces' ends that lie in crossing members or in kept material."""
        face, coordinates = np.repeat(self.face, 2), self.at.reshape(-1, 3)
        inside = self.drawn.inside(1 - self.k, face, coordinates) | self.drawn.is_kept(face, coordinates)
        return np.asarray(inside.reshape(-1, 2))

    @cached_property
    def place(self) -> Floats:
        """(j, 3) positions of the nodes, metres."""
        places = np.empty((len(self.edge), 3))
        places[self.node] = self.points
        return places


class _Pieces(NamedTuple):
    """Pieces (s,) of middle lines. slot : (s, 2) place of each end in the face: corners 0 to 2, edges 3 to 5."""

    face: Ints
    line: Ints
    slot: Ints


def stripe_middles(chart: StripeChart, k: int) -> StripeMiddles:
    """Return the middle lines of the members of family k (0: major, 1: minor)."""
    F = chart.surface.F
    pieces = _pieces(chart, k)
    z = chart.z[F[pieces.face], k] - pieces.line[:, None]
    coordinates = np.stack([_barycentric(z, pieces.slot[:, e]) for e in (0, 1)], axis=1)
    node, on_edge = _nodes(chart, pieces, coordinates)
    low, high = node.min(axis=1), node.max(axis=1)
    _, begins, group = equal_key_groups(low * (int(node.max(initial=0)) + 1) + high)
    first_piece = np.full(len(begins), len(low))
    np.minimum.at(first_piece, group, np.arange(len(low)))
    return StripeMiddles(chart, k, pieces.face, coordinates, node, first_piece[group] != np.arange(len(low)), on_edge)


def _pieces(chart: StripeChart, k: int) -> _Pieces:
    z, d = chart.corners(chart.z[:, k]), chart.corners(chart.d[:, k]).max(axis=0)
    lowest, highest = z.min(axis=0), z.max(axis=0)
    low, high = np.ceil(lowest).astype(np.int64), np.floor(highest).astype(np.int64)
    count = np.where(chart.known[:, k] & (d > 0) & (highest - lowest > ON), np.maximum(high - low + 1, 0), 0)
    face = np.repeat(np.arange(len(count)), count)
    line = low[face] + np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    side = np.sign(z[:, face] - line).T
    meets = np.concatenate([side == 0, side * np.roll(side, -1, axis=1) < 0], axis=1)
    two = meets.sum(axis=1) == 2
    slot = np.nonzero(meets[two])[1].reshape(-1, 2)
    return _Pieces(face[two], line[two], slot)


def _barycentric(z: Floats, slot: Ints) -> Floats:
    row, corner, on_edge = np.arange(len(z)), slot % 3, slot >= 3
    next_corner = (corner + 1) % 3
    a, b = z[row, corner], z[row, next_corner]
    t = np.where(on_edge, a / np.where(on_edge, a - b, 1.0), 0.0)
    coordinates = np.zeros((len(z), 3))
    coordinates[row, corner] = 1 - t
    coordinates[row, next_corner] = t
    return coordinates


def _nodes(chart: StripeChart, pieces: _Pieces, coordinates: Floats) -> tuple[Ints, Bools]:
    table, F = chart.table, chart.surface.F
    face, slot, weight = np.repeat(pieces.face, 2), pieces.slot.ravel(), coordinates.reshape(-1, 3)
    corner, on_edge, row = slot % 3, slot >= 3, np.arange(len(slot))
    vertex, edge = chart.place[F[face, corner]], table.of[face, corner]
    t = weight[row, (corner + 1) % 3]
    t = np.where(vertex == table.ends[edge, 0], t, 1 - t)
    key = np.where(on_edge, edge + len(F) * 3, vertex)
    order = np.lexsort((np.where(on_edge, t, 0.0), key))
    differs = (np.diff(key[order]) != 0) | (np.diff(np.where(on_edge, t, 0.0)[order]) > 1e-5)
    node = np.empty(len(slot), dtype=np.int64)
    node[order] = np.concatenate([[0], np.cumsum(differs)]) if len(slot) else np.empty(0, dtype=np.int64)
    rim = np.zeros(chart.surface.n, dtype=bool)
    rim[table.ends[table.boundary]] = True
    outside = np.zeros(int(node.max(initial=-1)) + 1, dtype=bool)
    outside[node] = np.where(on_edge, table.boundary[edge], rim[vertex])
    return node.reshape(-1, 2), outside
