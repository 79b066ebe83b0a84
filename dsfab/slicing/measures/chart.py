"""`Chart`: a divided surface with one value of two phases per vertex, its families and their middle lines."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, grouped, lengths, lock, sorted_order
from dsfab.slicing.cutting.corner_fields import Seen
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.halving import Halved
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField, hat_gradients
from dsfab.surface.topology import EdgeTable, edge_table

SLICING_SAME = 2.0**-30
"""Phases that differ by less, in periods, are those of one vertex."""


@dataclass(frozen=True, eq=False)
class Chart:
    """A surface cut open where phases do not fit together; stripes are where a phase is near a whole number.

    surface : the same sheet on vertices of its own (n', m').    parent : (m',) face of the uncut surface (n, m).
    weights : (n', n) barycentric weights on the uncut vertices.
    z       : (n', 2) phases of both families in periods of the lines that are drawn there.
    scale   : (n', 2) periods of that in a period of the finest lines; 0 where there is no phase.
    """

    surface: Surface
    parent: Ints
    weights: csr_array
    z: Floats
    scale: Floats

    def __post_init__(self) -> None:
        lock(self, "z", np.float64, (self.surface.n, 2))
        lock(self, "scale", np.float64, (self.surface.n, 2))

    def carry(self, x: Floats) -> Floats:
        """Values (n, ...) at the uncut vertices, interpolated to this sheet's (n', ...)."""
        return np.asarray(self.weights @ x)


def chart_of(halved: Halved, phases: tuple[CornerField, CornerField] | None = None) -> Chart:
    """The chart of a surface that was divided where stripes are halved.

    phases : the fields (n, 1) that were halved, as they were: lines are drawn where they are cut, not where they were
             moved to so that openings end well; left out, they are drawn there.
    """
    mesh, phases = halved.mesh, phases or halved.phases
    surface, cell = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    slot = _slots(mesh, surface.F, cell)
    z, scale = np.empty((2, 3 * surface.m, 2))
    for k, phase in enumerate(phases):
        seen = Seen.of(mesh, phase)
        scale[:, k] = np.where(seen.blank, 0.0, 0.5 ** halved.level[mesh.cells.owner, k])[slot]
        z[:, k] = np.where(seen.blank, 0.5, seen.slots(0))[slot] * np.where(scale[:, k] > 0, scale[:, k], 1.0)
    flat = surface.F.ravel()
    first, of = _alike(flat, np.rint(np.concatenate([z, scale], axis=1) / SLICING_SAME))
    own = Surface(surface.V[flat[first]], of.reshape(-1, 3))
    return Chart(own, mesh.parent[cell], mesh.weights[flat[first]], z[first], scale[first])


def _alike(key: Ints, rows: Floats) -> tuple[Ints, Ints]:
    """The first of all things (k,) that have the same key and row (k, r) of whole numbers, and the group of each.

    Nearly all with one key are alike: only those that differ from the first of it are sorted by their rows.
    """
    order, begins, of = grouped(key)
    lead = order[begins][of]
    other = np.flatnonzero((rows != rows[lead]).any(axis=1))
    lead = lead.copy()
    if len(other):
        table = np.column_stack([key[other], rows[other]])
        _, at, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
        lead[other] = other[at][group.ravel()]
    leads = np.flatnonzero(lead == np.arange(len(key)))
    place = np.empty(len(key), dtype=np.int64)
    place[leads] = np.arange(len(leads))
    return leads, place[lead]


def _slots(mesh: PolygonMesh, F: Ints, cell: Ints) -> Ints:
    """(3 m',) the slot of each corner of triangles F (m', 3) in their polygons (m',)."""
    n = len(mesh.X)
    key = mesh.cells.owner * n + mesh.cells.corner
    order = sorted_order(key)
    wanted = (cell[:, None] * n + F).ravel()
    return np.asarray(order[np.searchsorted(key[order], wanted)])


ON = 1e-6
"""Phases this near to a whole number, in periods, are on the middle of a stripe."""
FLAT = 1e-9
"""Faces on which a phase grows by less than this over the size of the surface, in periods, have no spacing."""
POINTS = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6
"""(4, 3) where faces are looked at: the centroids of four triangles that a face divides into, nearly."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """Stripes where |z - k| < d, k a whole number, and what is kept besides.

    surface : n vertices, m faces; vertices at one place are one, where the surface is cut open.
    z       : (n, 2) phases of both families, whole numbers at the middles of stripes.
    d       : (n, 2) half-widths, in periods.
    known   : (m, 2) faces that have a phase; in the others no stripe is drawn.
    kept    : (n,) positive in what is kept besides the stripes.
    """

    surface: Surface
    z: Floats
    d: Floats
    known: Bools
    kept: Floats

    def __post_init__(self) -> None:
        n, m = self.surface.n, self.surface.m
        lock(self, "z", np.float64, (n, 2))
        lock(self, "d", np.float64, (n, 2))
        lock(self, "known", np.bool_, (m, 2))
        lock(self, "kept", np.float64, (n,))

    @classmethod
    def of(cls, chart: Chart, d: Floats, kept: Floats) -> Self:
        """On a chart; half-widths (n, 2) and what is kept (n,) are those of the uncut vertices."""
        known = np.asarray((chart.scale[chart.surface.F] > 0).all(axis=1))
        whole = np.rint(chart.z)
        z = np.where(np.abs(chart.z - whole) < ON, whole, chart.z)
        return cls(chart.surface, z, np.clip(chart.carry(d), 0.0, 0.5), known, chart.carry(kept))

    @cached_property
    def place(self) -> Ints:
        """(n,) the place of each vertex: the same number for all that are at one place."""
        order = np.lexsort(self.surface.V.T)
        apart = (np.diff(self.surface.V[order], axis=0) != 0).any(axis=1)
        place = np.empty(self.surface.n, dtype=np.int64)
        place[order] = np.concatenate([[0], np.cumsum(apart)])
        return place

    @cached_property
    def table(self) -> EdgeTable:
        """The edges between places."""
        return edge_table(self.place[self.surface.F])

    def corners(self, x: Floats) -> Floats:
        """(3, m) values (n,) at the corners of the faces."""
        return np.asarray(x[self._corner])

    def steep(self, k: int) -> Bools:
        """(m,) faces on which the phase of family k grows."""
        return self.known[:, k] & (self.slope[k] * self.surface.size > FLAT)

    @cached_property
    def _corner(self) -> Ints:
        return np.ascontiguousarray(self.surface.F.T)

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """(m, 3) each, of both phases on the faces, per metre."""
        hats = np.ascontiguousarray(hat_gradients(self.surface).transpose(1, 0, 2))
        one, two = (sum(g * z[:, None] for g, z in zip(hats, self.corners(x), strict=True)) for x in self.z.T)
        return np.asarray(one), np.asarray(two)

    @cached_property
    def slope(self) -> tuple[Floats, Floats]:
        """(m,) each, stripes per metre; never 0."""
        one, two = (np.maximum(lengths(g), np.finfo(float).tiny) for g in self.gradients)
        return one, two

    def inside(self, k: int, face: Ints, at: Floats) -> Bools:
        """(q,) whether points at barycentric coordinates (q, 3) of faces (q,) lie in stripes of family k."""
        corner = self.surface.F[face]
        z, d = (np.einsum("qc,qc->q", x[corner, k], at) for x in (self.z, self.d))
        return np.asarray((np.abs(z - np.rint(z)) <= d + ON * (d > 0)) & self.known[face, k])

    def is_kept(self, face: Ints, at: Floats) -> Bools:
        """(q,) whether points lie in what is kept besides the stripes."""
        return np.asarray(np.einsum("qc,qc->q", self.kept[self.surface.F[face]], at) > 0)

    @cached_property
    def void(self) -> Floats:
        """(m,) share of each face that is not material, from four points."""
        solid = self._kept_points.copy()
        for k in (0, 1):
            z, d = (POINTS @ self.corners(x[:, k]) for x in (self.z, self.d))
            solid |= (np.abs(z - np.rint(z)) < d) & self.known[:, k]
        return np.asarray(1 - solid.mean(axis=0))

    def member(self, k: int) -> tuple[Floats, Floats]:
        """(m,) widths of the members of family k on the faces, metres, and the area that they take there, m2."""
        z, d = (POINTS @ self.corners(x[:, k]) for x in (self.z, self.d))
        share = ((np.abs(z - np.rint(z)) < d) & self.known[:, k]).mean(axis=0)
        return 2 * d.mean(axis=0) / self.slope[k], self.surface.areas * share

    @cached_property
    def free(self) -> Floats:
        """(m,) share of each face outside of what is kept besides the stripes."""
        return np.asarray(1 - self._kept_points.mean(axis=0))

    @cached_property
    def _kept_points(self) -> Bools:
        return np.asarray(POINTS @ self.corners(self.kept) > 0)


MIDDLES_SAME = 1e-5
"""Pieces that end at places of an edge that are this near, as a share of it, hang together."""


@dataclass(frozen=True, eq=False)
class Middles:
    """The middles of family k.

    face : (s,) of each piece.    at : (s, 2, 3) barycentric coordinates of its ends.    node : (s, 2) where it ends.
    copy : (s,) pieces along an edge of which an earlier one is the same.    edge : (j,) whether nodes are on the
    boundary of the surface.
    """

    drawn: Drawn
    k: int
    face: Ints
    at: Floats
    node: Ints
    copy: Bools
    edge: Bools

    @cached_property
    def points(self) -> Floats:
        """(s, 2, 3) ends, metres."""
        surface = self.drawn.surface
        return np.asarray(np.einsum("sec,scx->sex", self.at, surface.V[surface.F[self.face]]))

    @cached_property
    def length(self) -> Floats:
        """(s,) metres; half of it for each of the two pieces along an edge."""
        metres = np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1)
        key = self.node.min(axis=1) * len(self.edge) + self.node.max(axis=1)
        group = grouped(key)[2]
        return np.asarray(metres / np.bincount(group)[group])

    @cached_property
    def degree(self) -> Ints:
        """(j,) how many pieces end at each node."""
        return np.bincount(self.node[~self.copy].ravel(), minlength=len(self.edge))

    def at_nodes(self, marked: Bools) -> Bools:
        """(j,) nodes at which one of the ends (s, 2) is marked."""
        found = np.zeros(len(self.edge), dtype=bool)
        found[self.node[marked]] = True
        return found

    @cached_property
    def met(self) -> Bools:
        """(s, 2) ends that lie in a member of the other family, or in what is kept besides the stripes."""
        face, at = np.repeat(self.face, 2), self.at.reshape(-1, 3)
        inside = self.drawn.inside(1 - self.k, face, at) | self.drawn.is_kept(face, at)
        return np.asarray(inside.reshape(-1, 2))

    @cached_property
    def place(self) -> Floats:
        """(j, 3) where the nodes are, metres."""
        found = np.empty((len(self.edge), 3))
        found[self.node] = self.points
        return found


class _Pieces(NamedTuple):
    """Faces (s,), numbers of lines (s,), and the slots (s, 2) of faces at which pieces end: 0 to 2 a corner, 3 to 5 the
    edge from corner slot - 3."""

    face: Ints
    line: Ints
    slot: Ints


def middles(drawn: Drawn, k: int) -> Middles:
    """The middles of the members of family k: none where half-widths are 0."""
    F = drawn.surface.F
    pieces = _pieces(drawn, k)
    z = drawn.z[F[pieces.face], k] - pieces.line[:, None]
    at = np.stack([_barycentric(z, pieces.slot[:, e]) for e in (0, 1)], axis=1)
    node, on_edge = _nodes(drawn, pieces, at)
    low, high = node.min(axis=1), node.max(axis=1)
    _, begins, group = grouped(low * (int(node.max(initial=0)) + 1) + high)
    first = np.full(len(begins), len(low))
    np.minimum.at(first, group, np.arange(len(low)))
    return Middles(drawn, k, pieces.face, at, node, first[group] != np.arange(len(low)), on_edge)


def _pieces(drawn: Drawn, k: int) -> _Pieces:
    z, d = drawn.corners(drawn.z[:, k]), drawn.corners(drawn.d[:, k]).max(axis=0)
    least, most = z.min(axis=0), z.max(axis=0)
    low, high = np.ceil(least).astype(np.int64), np.floor(most).astype(np.int64)
    count = np.where(drawn.known[:, k] & (d > 0) & (most - least > ON), np.maximum(high - low + 1, 0), 0)
    face = np.repeat(np.arange(len(count)), count)
    line = low[face] + np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    side = np.sign(z[:, face] - line).T
    meets = np.concatenate([side == 0, side * np.roll(side, -1, axis=1) < 0], axis=1)
    two = meets.sum(axis=1) == 2
    slot = np.nonzero(meets[two])[1].reshape(-1, 2)
    return _Pieces(face[two], line[two], slot)


def _barycentric(z: Floats, slot: Ints) -> Floats:
    """(s, 3) coordinates of the ends at slots (s,) of pieces z = 0, z (s, 3) at the corners."""
    row, here, on_edge = np.arange(len(z)), slot % 3, slot >= 3
    there = (here + 1) % 3
    a, b = z[row, here], z[row, there]
    t = np.where(on_edge, a / np.where(on_edge, a - b, 1.0), 0.0)
    found = np.zeros((len(z), 3))
    found[row, here] = 1 - t
    found[row, there] = t
    return found


def _nodes(drawn: Drawn, pieces: _Pieces, at: Floats) -> tuple[Ints, Bools]:
    """(s, 2) the node of each end, and (j,) whether nodes are on the boundary of the surface.

    Ends are compared by where they are on an edge; those at vertices come before all of them.
    """
    table, F = drawn.table, drawn.surface.F
    face, slot, weight = np.repeat(pieces.face, 2), pieces.slot.ravel(), at.reshape(-1, 3)
    corner, on_edge, row = slot % 3, slot >= 3, np.arange(len(slot))
    vertex, edge = drawn.place[F[face, corner]], table.of[face, corner]
    t = weight[row, (corner + 1) % 3]
    t = np.where(vertex == table.ends[edge, 0], t, 1 - t)
    key = np.where(on_edge, edge + len(F) * 3, vertex)
    order = np.lexsort((np.where(on_edge, t, 0.0), key))
    apart = (np.diff(key[order]) != 0) | (np.diff(np.where(on_edge, t, 0.0)[order]) > MIDDLES_SAME)
    node = np.empty(len(slot), dtype=np.int64)
    node[order] = np.concatenate([[0], np.cumsum(apart)]) if len(slot) else np.empty(0, dtype=np.int64)
    rim = np.zeros(drawn.surface.n, dtype=bool)
    rim[table.ends[table.boundary]] = True
    outside = np.zeros(int(node.max(initial=-1)) + 1, dtype=bool)
    outside[node] = np.where(on_edge, table.boundary[edge], rim[vertex])
    return node.reshape(-1, 2), outside
