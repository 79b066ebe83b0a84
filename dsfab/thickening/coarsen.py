"""Fewer triangles for the same solid, by the edge collapses of manifold3d; how far that moved it is for the caller."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import SolidError


def coarsened(V: Floats, F: Ints, tolerance: float) -> tuple[Floats, Ints]:
    """A closed mesh V (n, 3), F (m, 3) with short edges and flat neighbours collapsed; still closed and oriented.

    tolerance : in the unit of V. manifold3d takes it for each collapse, so the sum may move 1.5 to 3 times as far.
    Raises SolidError when manifold3d does not take the mesh, or nothing is left of it.
    """
    import manifold3d

    given = manifold3d.Manifold(manifold3d.Mesh64(np.array(V), np.array(F, dtype=np.uint64)))
    simple = given.simplify(tolerance)
    mesh = simple.to_mesh64()
    faces = np.asarray(mesh.tri_verts, dtype=np.int64)
    if simple.status() != manifold3d.Error.NoError or not len(faces):
        raise SolidError(f"manifold3d does not simplify a solid of {len(F)} triangles ({simple.status().name})")
    return np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3], faces
