"""The closed triangle mesh around a sheet: two skins, and walls ruled along the offset vectors."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import half_edges

TIE = 1e-9
"""Diagonals whose squared lengths differ by less than this share count as equal, so that rounding chooses nothing."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Connectivity of the solid around a sheet of n vertices; the sheet lies to the left of every rim edge p -> q.

    F    : (m, 3) faces of the sheet; vertex i has the copies i (upper skin) and n + i (lower skin).
    p, q : (r,) ends of the boundary edges of the sheet.

          p+ --- q+        upper skin        slash: diagonal q+ p-     backslash: diagonal p+ q-
          |       |
          p- --- q-        lower skin        seen from outside, p to the right of q
    """

    n: int
    F: Ints
    p: Ints
    q: Ints

    @classmethod
    def of(cls, surface: Surface) -> "Skin":
        """The skin of an oriented manifold sheet."""
        start, end = half_edges(surface.F)
        rim = np.flatnonzero(surface.edges.boundary[surface.edges.of.ravel()])
        return cls(surface.n, surface.F, start[rim], end[rim])

    def vertices(self, V: Floats, D: Floats) -> Floats:
        """(2 n, 3) the upper copies V + D, then the lower ones V - D."""
        return np.concatenate([V + D, V - D])

    def shorter_diagonals(self, V: Floats, D: Floats) -> Bools:
        """(r,) whether p+ q- is the shorter diagonal of a wall."""
        up, low = V + D, V - D
        back = np.einsum("ri,ri->r", up[self.p] - low[self.q], up[self.p] - low[self.q])
        slash = np.einsum("ri,ri->r", up[self.q] - low[self.p], up[self.q] - low[self.p])
        shorter: Bools = back < (1 - TIE) * slash
        return shorter

    def faces(self, backslash: Bools) -> Ints:
        """(2 m + 2 r, 3) upper faces, lower faces, first and second triangle of the walls, all facing outward."""
        p, q, n = self.p, self.q, self.n
        across = backslash[:, None]
        one = np.where(across, np.stack([q, p, q + n], axis=1), np.stack([q, p, p + n], axis=1))
        two = np.where(across, np.stack([p, p + n, q + n], axis=1), np.stack([q, p + n, q + n], axis=1))
        return np.concatenate([self.F, self.F[:, ::-1] + n, one, two])

    def walls(self, faces: Ints) -> Ints:
        """Which walls the given faces of the solid belong to, each once."""
        return np.unique((faces[faces >= 2 * len(self.F)] - 2 * len(self.F)) % max(len(self.p), 1))
