"""Triangles of the solids in a STEP file, as build123d (OCCT) reads it: a program of its own, like `step_check`.

    python -P step_mesh.py FILE.step OUT.npz [DEFLECTION]

writes V (n, 3) millimetres, F (m, 3) seen from outside, and one line of JSON: {"solids": 1, "volume": 1000.0,
"deflection": 0.1}: mm3, and how many millimetres its triangles may be off curved faces, as told or `ACROSS`.
Vertices of neighbouring faces stand at the same place and are not made one. It imports nothing from dsfab.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

ACROSS = 1e-4
"""Largest distance of a triangle from a curved face unless told, as a share of the diagonal of the bounding box."""

ANGLE = 0.2
"""Largest turn from one triangle to the next, radians."""


def tessellated(path: Path, deflection: float = 0.0) -> tuple[Any, Any, dict[str, float]]:
    """Vertices, triangles, the number and the volume of the solids, and the deflection."""
    from build123d import import_step
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    shape = import_step(path)
    solids, deflection = shape.solids(), deflection or ACROSS * shape.bounding_box().diagonal
    V, F, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for solid in solids:
        BRepMesh_IncrementalMesh(solid.wrapped, deflection, False, ANGLE, False)
        for face in solid.faces():
            points, corners = _triangles(face.wrapped)
            V.append(points)
            F.append(corners + count)
            count += len(points)
    volume = float(sum(abs(solid.volume) for solid in solids))
    return np.concatenate(V), np.concatenate(F), {"solids": len(solids), "volume": volume, "deflection": deflection}


def _triangles(face: Any) -> tuple[Any, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location

    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    move = place.Transformation()
    nodes = (mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1))
    V = np.array([(p.X(), p.Y(), p.Z()) for p in nodes])
    F = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3) - 1
    return V, F[:, ::-1] if face.Orientation() == TopAbs_REVERSED else F


if __name__ == "__main__":
    V, F, found = tessellated(Path(sys.argv[1]), *map(float, sys.argv[3:]))
    np.savez(sys.argv[2], V=V, F=F)
    sys.stdout.write(json.dumps(found) + "\n")
