"""Solids and files of which everything is known, and a small design, for the tests of `dsfab check`."""

import numpy as np

from dsfab.preset.model import Preset
from tests import shapes

STEEL = {"young": 210e9, "poisson": 0.3, "density": 7850.0}


def box_mesh(low, high):
    """Vertices and faces of a closed box between two corners, metres."""
    surface = shapes.box(low, high)
    return surface.V, surface.F


def joined_meshes(*meshes):
    V, F, n = [], [], 0
    for points, faces in meshes:
        V.append(points)
        F.append(faces + n)
        n += len(points)
    return np.concatenate(V), np.concatenate(F)


def stl(path, V, F, metres=1e-3):
    """A text STL written here, in no way by dsfab."""
    rows = ["solid fixture"]
    for triangle in V[F] / metres:
        corners = "".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in triangle)
        rows.append(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet")
    path.write_text("\n".join([*rows, "endsolid fixture\n"]))
    return path


PLATE = box_mesh((0, 0, 0), (0.4, 0.2, 0.01))


def preset(per_metre=(0, -1e3, 0), keep=0.025, width=0.75, **changes):
    """A plate of 0.4 x 0.2 m with stripes, built in on the left, loaded on the right; coarse."""
    return Preset.model_validate(
        {
            "name": "strip",
            "surface": {
                "shape": "plate",
                "length": 0.4,
                "width": 0.2,
                "edge": 0.02,
                "support": [{"at": {"pick": "side", "axis": "x", "end": "min"}, "hold": "xyz", "clamp": True}],
                "load": [{"kind": "line", "at": {"pick": "side", "axis": "x", "end": "max"}, "per_metre": per_metre}],
            },
            "statics": {"thickness": 0.01, **STEEL, "membrane": "quadratic", "bending": "midedge"},
            "pattern": {
                "keep": keep,
                "rim": 0.02,
                "width": {"rule": "constant", "solid_fraction": width} if width else {},
                "major": {"mode": 1, "frequency": 2.0, "phase": 0.3},
                "minor": {"mode": 1, "frequency": 2.0, "phase": 0.3},
            },
        }
        | changes
    )


def verdicts(checked):
    return {finding.name: finding.verdict for finding in checked.findings}
