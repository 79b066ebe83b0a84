"""The closed triangle mesh around a sheet: two skins (one, if the sheet has one side), and walls along the offsets."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.cover import corner_sides
from dsfab.surface.mesh import Surface
from dsfab.thickening.rounding import rounded

TIE = 1e-9
"""Diagonals whose squared lengths differ by less than this share count as equal, so that rounding chooses nothing."""


def closed_skin(surface: Surface, D: Floats, shift: int = 0) -> tuple[Floats, Ints]:
    """Vertices (2 n, 3), metres, and triangles (m, 3) of the closed mesh around a manifold sheet with half-thickness
    vectors D (n, 3) as it is: neither proven nor repaired where it crosses itself. `shift` as `Skin` has it."""
    skin = Skin.of(surface, shift)
    return skin.vertices(surface.V, D), skin.faces(skin.shorter_diagonals(surface.V, D))


@dataclass(frozen=True, eq=False)
class Skin:
    """Connectivity of the solid around a sheet of n vertices; the sheet lies to the left of every rim edge p -> q.

    Vertex i has the copies i, on the side that the first face around it points to, and n + i on the other one.
    upper : (m, 3) copies of the corners on the side of each face, lower : (m, 3) those on its other side.
    p, q  : (2, r) copies of the ends of the boundary edges, on the side of their face and on its other side.
    rim   : (r,) the faces of the boundary edges.
    shift : 0 for skins V + D and V - D, 1 for V + 2 D and V, -1 for V and V - 2 D.
    single : whether vertices are `rounded`, from the first test to the last.

          p+ --- q+        upper skin        slash: diagonal q+ p-     backslash: diagonal p+ q-
          |       |
          p- --- q-        lower skin        seen from outside, p to the right of q
    """

    n: int
    upper: Ints
    lower: Ints
    p: Ints
    q: Ints
    rim: Ints
    shift: int = 0
    single: bool = False

    @classmethod
    def of(cls, surface: Surface, shift: int = 0, single: bool = False) -> "Skin":
        """The skin of a manifold sheet; its faces need not point to the same side."""
        F, n = surface.F, surface.n
        turned = corner_sides(F, surface.edges) < 0
        both = np.stack([F + n * turned, F + n * ~turned])
        rim = surface.edges.boundary[surface.edges.of.ravel()]
        ends = both.reshape(2, -1)[:, rim], np.roll(both, -1, axis=2).reshape(2, -1)[:, rim]
        return cls(n, both[0], both[1], *ends, np.flatnonzero(rim) // 3, shift, single)

    def vertices(self, V: Floats, D: Floats) -> Floats:
        """(2 n, 3) the copies on the side that D points to, then the other ones."""
        both = np.concatenate([V + (self.shift + 1) * D, V + (self.shift - 1) * D])
        return rounded(both) if self.single else both

    def shorter_diagonals(self, V: Floats, D: Floats) -> Bools:
        """(r,) whether p+ q- is the shorter diagonal of a wall."""
        P = self.vertices(V, D)
        back, slash = P[self.p[0]] - P[self.q[1]], P[self.q[0]] - P[self.p[1]]
        shorter: Bools = np.einsum("ri,ri->r", back, back) < (1 - TIE) * np.einsum("ri,ri->r", slash, slash)
        return shorter

    def faces(self, backslash: Bools) -> Ints:
        """(2 m + 2 r, 3) upper faces, lower faces, first and second triangle of the walls, all facing outward."""
        (p, below_p), (q, below_q) = self.p, self.q
        across = backslash[:, None]
        one = np.where(across, np.stack([q, p, below_q], axis=1), np.stack([q, p, below_p], axis=1))
        two = np.where(across, np.stack([p, below_p, below_q], axis=1), np.stack([q, below_p, below_q], axis=1))
        return np.concatenate([self.upper, self.lower[:, ::-1], one, two])

    def walls(self, faces: Ints) -> Ints:
        """(k,) which walls the given faces (f,) of the solid belong to, each once."""
        skins = 2 * len(self.upper)
        return np.unique((faces[faces >= skins] - skins) % max(self.p.shape[1], 1))

    def sources(self) -> Ints:
        """(2 m + 2 r,) the face of the sheet that each face of the solid lies over or beside."""
        every = np.arange(len(self.upper))
        return np.concatenate([every, every, self.rim, self.rim])
