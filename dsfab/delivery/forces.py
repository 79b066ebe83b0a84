"""Section forces of a design's cut sheet as columns of numbers for files, SI units in their names."""

from typing import Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.pipeline import Design
from dsfab.statics import CONVENTION, SectionForces


def force_records(design: Design) -> dict[str, Any]:
    """`convention`, lines of text; `faces`, columns (m,) or (m, 3) of each face; `cases`, by name, the columns of each
    load case and combination.

    Raises StaticsError where the cut sheet does not carry its loads.
    """
    found = design.section_forces
    surface, first = design.sheet.surface, next(iter(found.values()))
    faces = {
        "centre [m]": surface.centroids,
        "area [m2]": surface.areas,
        "local x [1]": first.frame[:, 0],
        "local y [1]": first.frame[:, 1],
        "normal [1]": surface.normals,
    }
    return {
        "convention": list(CONVENTION),
        "faces": faces,
        "cases": {name: _columns(forces) for name, forces in found.items()},
    }


def _columns(forces: SectionForces) -> dict[str, Floats]:
    found: dict[str, Floats] = {}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        for index, axes in enumerate(("x", "y", "xy")):
            found[f"{name}_{axes} [{unit}]"] = getattr(forces, name)[:, index]
    found |= {f"q_{axis} [N/m]": np.asarray(forces.q[:, index]) for index, axis in enumerate("xy")}
    for name, unit in (("n", "N/m"), ("m", "N m/m")):
        values, angle, direction = forces.principal(name)
        found |= {f"{name}_{index} [{unit}]": np.asarray(values[:, index - 1]) for index in (1, 2)}
        found[f"{name}_1 from local x [degrees]"] = angle
        found[f"{name}_1 direction [1]"] = direction
    return found
