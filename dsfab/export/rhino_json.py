"""Meshes and curves as Rhino's programs send them to each other: JSON around an openNURBS archive.

In single precision, as Rhino keeps a mesh, and in any unit: what is sent says none. By rhino3dm (extra `rhino`).
"""

import json
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.rhino import ready, rhino_arrays, rhino_mesh, rhino_polyline


def mesh_json(V: Floats, F: Ints) -> str:
    """A mesh of vertices (n, 3) and triangles (m, 3); raises ExportError where rhino3dm is not installed."""
    ready()
    return json.dumps(rhino_mesh(V, F).Encode())


def polyline_json(points: Floats) -> str:
    """A polyline through points (k, 3), or (k, 2) in the plane z = 0; raises ExportError likewise."""
    ready()
    full = np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points
    return json.dumps(rhino_polyline(full).Encode())


def mesh_arrays(text: str) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (m, 3) of a mesh as it was sent; a quad becomes two along its shorter diagonal.

    Raises ExportError for what is no mesh.
    """
    mesh = _decoded(text)
    if type(mesh).__name__ != "Mesh":
        raise ExportError(f"a mesh is wanted, not {type(mesh).__name__}; turn it into a mesh in Grasshopper first")
    V, corners = rhino_arrays(mesh)
    return V, _triangles(V, corners)


def _triangles(V: Floats, corners: Ints) -> Ints:
    """openNURBS holds a triangle as a quad with its last corner twice."""
    if not len(corners):
        return np.zeros((0, 3), dtype=np.int64)
    quad = corners[:, 2] != corners[:, 3]
    a, b, c, d = (V[corners[:, k]] for k in range(4))
    straight = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    first = np.where((quad & ~straight)[:, None], corners[:, [0, 1, 3]], corners[:, :3])
    second = np.where(straight[:, None], corners[:, [0, 2, 3]], corners[:, [1, 2, 3]])
    return np.concatenate([first, second[quad]])


def _decoded(text: str) -> Any:
    ready()
    import rhino3dm

    try:
        thing = rhino3dm.CommonObject.Decode(json.loads(text))
    except Exception:  # whatever the library makes of it
        thing = None
    if thing is None:
        raise ExportError("the geometry that was sent is not readable as Rhino's JSON")
    return thing
