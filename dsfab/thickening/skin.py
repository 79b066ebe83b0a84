"""The closed triangle mesh around a sheet."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import SolidError
from dsfab.core.units import MM_PER_M
from dsfab.surface.mesh import Surface
from dsfab.surface.orientation import corner_sides


def round_to_single(V: Floats) -> Floats:
    """Round V (n, 3), metres, to single precision in millimetres."""
    single: Floats = (V * MM_PER_M).astype(np.float32).astype(np.float64) / MM_PER_M
    return single


def is_fine(V: Floats, D: Floats) -> bool:
    """Return True if single precision suffices for a sheet V (n, 3) with half-thickness vectors D (n, 3), metres."""
    step = np.spacing(np.float32(np.abs(V).max() * MM_PER_M)) / MM_PER_M
    return bool(step <= 1e-3 * np.median(np.linalg.norm(D, axis=1)))


def rounding_step(V: Floats, D: Floats) -> float:
    """Return an upper bound (m) of the error when points V + 2 D (n, 3) are rounded to single precision."""
    largest = (np.abs(V).max() + 2 * np.abs(D).max()) * MM_PER_M
    return float(np.spacing(np.float32(largest)) / MM_PER_M)


def coarsen_mesh(V: Floats, F: Ints, tolerance: float) -> tuple[Floats, Ints]:
    """Collapse short edges and merge coplanar faces of a closed mesh V (n, 3), F (m, 3). Raises SolidError.
    tolerance : largest move in one collapse. Several collapses can move a point up to 3 times as far."""
    import manifold3d

    solid = manifold3d.Manifold(manifold3d.Mesh64(np.array(V), np.array(F, dtype=np.uint64)))
    simple = solid.simplify(tolerance)
    mesh = simple.to_mesh64()
    faces = np.asarray(mesh.tri_verts, dtype=np.int64)
    if simple.status() != manifold3d.Error.NoError or not len(faces):
        raise SolidError(f"manifold3d cannot simplify a solid of {len(F)} triangles ({simple.status().name})")
    return np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3], faces


def closed_skin(surface: Surface, D: Floats, shift: int = 0) -> tuple[Floats, Ints]:
    """Return vertices (2 n, 3), metres, and triangles (k, 3) of the closed mesh around a sheet.
    D     : (n, 3) half-thickness vectors, metres.
    shift : 0 for a sheet in the middle of the solid, 1 for a solid on the side of D, -1 for the opposite side."""
    skin = Skin.from_surface(surface, shift)
    return skin.vertices(surface.V, D), skin.faces(skin.shorter_diagonals(surface.V, D))


@dataclass(frozen=True, eq=False)
class Skin:
    """Faces of the closed mesh around a sheet of n vertices. The sheet lies left of every boundary edge p -> q.
    Vertex i has copy i on the upper side of the first face at vertex i, and copy n + i on the opposite side.
    upper, lower : (m, 3) copies of each face's corners: on the side of the face's normal, on the opposite side.
    p, q   : (2, r) copies of the boundary edges' ends: on the side of the normal, on the opposite side.
    rim    : (r,) the faces of the boundary edges.    single : True if the vertices are rounded to single precision.
    shift  : 0 for skins V + D and V - D, 1 for V + 2 D and V, -1 for V and V - 2 D.

          p+ --- q+        upper skin        slash: diagonal q+ p-     backslash: diagonal p+ q-
          |       |
          p- --- q-        lower skin        wall at a boundary edge, seen from outside"""

    n: int
    upper: Ints
    lower: Ints
    p: Ints
    q: Ints
    rim: Ints
    shift: int = 0
    single: bool = False

    @classmethod
    def from_surface(cls, surface: Surface, shift: int = 0, single: bool = False) -> "Skin":
        """Return the skin of a manifold sheet."""
        F, n = surface.F, surface.n
        turned = corner_sides(F, surface.edges) < 0
        copies = np.stack([F + n * turned, F + n * ~turned])
        rim = surface.edges.boundary[surface.edges.of.ravel()]
        ends = copies.reshape(2, -1)[:, rim], np.roll(copies, -1, axis=2).reshape(2, -1)[:, rim]
        return cls(n, copies[0], copies[1], *ends, np.flatnonzero(rim) // 3, shift, single)

    def vertices(self, V: Floats, D: Floats) -> Floats:
        """Return the vertices (2 n, 3) of the closed mesh, metres: n copies on the side of D, then n copies opposite.
        V, D : (n, 3) vertices and half-thickness vectors, metres."""
        copies = np.concatenate([V + (self.shift + 1) * D, V + (self.shift - 1) * D])
        return round_to_single(copies) if self.single else copies

    def shorter_diagonals(self, V: Floats, D: Floats) -> Bools:
        """Return a mask (r,) of the walls in which the diagonal `backslash` is shorter than the diagonal `slash`."""
        P = self.vertices(V, D)
        back, slash = P[self.p[0]] - P[self.q[1]], P[self.q[0]] - P[self.p[1]]
        shorter: Bools = np.einsum("ri,ri->r", back, back) < (1 - 1e-9) * np.einsum("ri,ri->r", slash, slash)
        return shorter

    def faces(self, backslash: Bools) -> Ints:
        """Return outward faces (2 m + 2 r, 3): upper faces, lower faces, first and second triangles of the walls.
        backslash : (r,) mask of the walls with this diagonal."""
        (p, below_p), (q, below_q) = self.p, self.q
        across = backslash[:, None]
        first_triangle = np.where(across, np.stack([q, p, below_q], axis=1), np.stack([q, p, below_p], axis=1))
        second = np.where(across, np.stack([p, below_p, below_q], axis=1), np.stack([q, below_p, below_q], axis=1))
        return np.concatenate([self.upper, self.lower[:, ::-1], first_triangle, second])

    def walls(self, faces: Ints) -> Ints:
        """Return the numbers (k,) of the walls that contain faces of the list `faces` (f,)."""
        skins = 2 * len(self.upper)
        return np.unique((faces[faces >= skins] - skins) % max(self.p.shape[1], 1))

    def sources(self) -> Ints:
        """Return the number (2 m + 2 r,) of the sheet's face from which each face of the solid is made."""
        every = np.arange(len(self.upper))
        return np.concatenate([every, every, self.rim, self.rim])
