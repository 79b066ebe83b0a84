"""`Net`: the mesh while it is remeshed, with the vertices on its curves, and the choice of changes made at once."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.edge_changes import winners
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.curves import FeatureCurves
from dsfab.surface.topology import EdgeTable, edge_table

FREE, ON_CURVE, FIXED = 0, 1, 2
"""Kinds of vertices: on the surface, on one of its curves, at rest."""


@dataclass(frozen=True, eq=False)
class NetFaces:
    """Faces F (m, 3) of a net, and their edges, which last as long as no face changes."""

    F: Ints

    @cached_property
    def edges(self) -> EdgeTable:
        """Every edge once."""
        return edge_table(self.F)


@dataclass(frozen=True, eq=False)
class Net:
    """Vertices V (n, 3), metres, of kind (n,), the faces between them, and the nodes on the curves.

    node  : (k,) the vertices along each curve, curve after curve.     at : (k,) their places on the curves' axis, m.
    curve : (k,) the curve of each.     size : (n,) the wanted length of edges, metres.
    """

    V: Floats
    faces: NetFaces
    kind: Ints
    node: Ints
    at: Floats
    curve: Ints
    size: Floats

    @classmethod
    def of(cls, surface: Surface, curves: FeatureCurves, size: float) -> Self:
        """The surface itself, to be remeshed to edges of one size."""
        kind = np.full(surface.n, FREE)
        kind[curves.vertex] = ON_CURVE
        kind[curves.fixed] = FIXED
        sizes = np.full(surface.n, size)
        return cls(surface.V, NetFaces(surface.F), kind, curves.vertex, curves.at, curves.curve, sizes)

    @property
    def n(self) -> int:
        """Number of vertices."""
        return len(self.V)

    @property
    def F(self) -> Ints:  # noqa: N802, the field's letter
        """(m, 3) the faces."""
        return self.faces.F

    @property
    def edges(self) -> EdgeTable:
        """Every edge of the net once."""
        return self.faces.edges

    @property
    def edge_sizes(self) -> Floats:
        """(e,) the wanted lengths of the edges, metres."""
        a, b = self.edges.ends.T
        return np.asarray((self.size[a] + self.size[b]) / 2)

    @property
    def links(self) -> Ints:
        """(l,) the nodes from which an edge along a curve leads to the next node."""
        return np.flatnonzero(self.curve[1:] == self.curve[:-1])

    @property
    def link_ends(self) -> Ints:
        """(l, 2) the vertices of the edges along curves."""
        return np.stack([self.node[self.links], self.node[self.links + 1]], axis=1)

    @property
    def link_edges(self) -> Ints:
        """(l,) which edges of the net those along curves are."""
        ends = np.sort(self.link_ends, axis=1)
        return np.searchsorted(self.edges.ends @ (self.n, 1), ends @ (self.n, 1))

    @property
    def along_curves(self) -> Bools:
        """(e,) whether an edge is along a curve."""
        marks = np.zeros(len(self.edges.ends), dtype=bool)
        marks[self.link_edges] = True
        return marks

    def without_lost(self) -> "Net":
        """The same without the vertices that no face has."""
        used = np.zeros(self.n, dtype=bool)
        used[self.F] = True
        if used.all():
            return self
        new = np.cumsum(used) - 1
        faces = NetFaces(new[self.F])
        return replace(
            self, V=self.V[used], faces=faces, kind=self.kind[used], node=new[self.node], size=self.size[used]
        )


LEVELS = 8
"""Costs are told apart in so many steps: of costs that rise along a strip only its end would come first."""

MIX = 2654435761
"""Scatters numbers in a row [Knuth 1973, multiplicative hashing]: candidates of one level come in this order."""


def independent(touched: Ints, cost: Floats, n: int, beside: Ints | None = None) -> Bools:
    """(c,) candidates of less cost than all others near them, so that no two touch the same vertex.

    touched : (c, k) vertices of each candidate.   cost : (c,), told apart in `LEVELS`.
    beside  : (e, 2) edges of the mesh: where given, no two touch neighbours either.
    """
    if not len(cost):
        return np.zeros(0, dtype=bool)
    spread = np.ptp(cost)
    level = np.floor(LEVELS * ((cost - cost.min()) / spread)) if spread else np.zeros(len(cost))
    order = np.lexsort((np.arange(len(cost)) * MIX % 2**32, level))
    return winners(order, touched, n, beside)
