"""Program that fills a closed triangle mesh with tetrahedra by gmsh.

    python -P gmsh_program.py IN.npz OUT.npz

IN contains the longest edge length `edge`, and either vertices V (n, 3) and faces F (m, 3) or the STEP path `step`.
OUT gets nodes X (p, 3) and tetrahedra T (k, 4).
The program imports nothing from dsfab, because the licence of gmsh is GPL-2 or later."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

TRIANGLE, TETRAHEDRON = 2, 4  # gmsh's numbers for the element types


def tetrahedra(mesh_data: Any) -> tuple[Any, Any]:
    """Return nodes (p, 3) and tetrahedra (k, 4) that fill the solid in `mesh_data`, the contents of IN."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    if "step" in mesh_data:
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.model.occ.importShapes(str(mesh_data["step"]))
        gmsh.model.occ.synchronize()
    else:
        _add_mesh(gmsh.model, mesh_data["V"], mesh_data["F"])
    gmsh.option.setNumber("Mesh.Algorithm3D", 1)  # Delaunay, which keeps the surface triangles
    gmsh.option.setNumber("Mesh.MeshSizeMax", float(mesh_data["edge"]))
    gmsh.model.mesh.generate(3)
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, corners = gmsh.model.mesh.getElementsByType(TETRAHEDRON)
    gmsh.finalize()
    order = np.argsort(tags)
    T = order[np.searchsorted(tags, corners, sorter=order)].reshape(-1, 4)
    used, T = np.unique(T, return_inverse=True)
    return points.reshape(-1, 3)[used], T.reshape(-1, 4)


def _add_mesh(model: Any, V: Any, F: Any) -> None:
    model.addDiscreteEntity(2, 1)
    model.mesh.addNodes(2, 1, np.arange(1, len(V) + 1), V.ravel())
    model.mesh.addElementsByType(1, TRIANGLE, [], (F + 1).ravel())
    model.geo.addVolume([model.geo.addSurfaceLoop([1])], 1)
    model.geo.synchronize()


if __name__ == "__main__":
    with np.load(sys.argv[1]) as given:
        X, T = tetrahedra(given)
    np.savez(Path(sys.argv[2]), X=X, T=T)
