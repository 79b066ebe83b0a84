"""The cut sheet as the page draws it once sliders rest: what tidying leaves of stripes, with its round corners.

While a slider moves the page draws stripes by itself, on a mesh that it has (see payload.py). What it colours that mesh
by it can carry over: every vertex here says where on it it lies.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import unit_vectors
from dsfab.pipeline import Design
from dsfab.render.striped_mesh import StripedMesh
from dsfab.slicing import Sheet
from dsfab.surface import nearest, weights_at

TINTS = ("major", "minor")
"""Families that have colours of their own; what else is kept shares the one after these."""


def settled(made: Design, sheet: Sheet) -> dict[str, NDArray[Any]]:
    """Arrays of a sheet of k vertices, one for each family that meets there, and m faces.

    V : (k, 3) metres from the middle of the surface.    F : (m, 3).    E : (e, 2) sides of its outlines.
    tint : (k,) 0 major, 1 minor, 2 what else is kept.    normals : (k, 3) unit, of the uncut surface.
    corners, shares : (k, 3) each, vertices of the mesh that stripes are drawn on, and barycentric weights there.
    """
    surface, drawn = sheet.surface, StripedMesh.of(made).surface
    tints = np.array([TINTS.index(name) if name in TINTS else len(TINTS) for name in made.pattern.names])
    tint = np.repeat(tints[sheet.family], 3)
    pairs, F = np.unique(surface.F.ravel() * (len(TINTS) + 1) + tint, return_inverse=True)
    vertex = pairs // (len(TINTS) + 1)
    V = surface.V[vertex]
    there = nearest(V, drawn.V, drawn.F)
    corners = drawn.F[there.simplex]
    normals = sheet.carry_corners(made.surface.vertex_normals[made.surface.F], made.surface.F)[vertex]
    middle = (made.surface.V.min(axis=0) + made.surface.V.max(axis=0)) / 2
    outline = surface.edges.ends[surface.edges.count == 1]
    return {
        "V": V - middle,
        "F": F.reshape(-1, 3),
        "E": np.searchsorted(vertex, outline),
        "tint": (pairs % (len(TINTS) + 1)).astype(float),
        "normals": unit_vectors(normals),
        "corners": corners,
        "shares": np.clip(weights_at(there.place, drawn.V, corners), 0.0, 1.0),
    }
