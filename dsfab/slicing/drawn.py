"""`Drawn`: two families of stripes on a chart, as plain arrays: what the measures of a pattern look at."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lengths, lock
from dsfab.slicing.chart import Chart
from dsfab.surface.hats import hat_gradients
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import EdgeTable, edge_table

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
