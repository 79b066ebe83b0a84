"""What the members of a design bear, as plain records for files, SI units."""

from typing import Any

import numpy as np

from dsfab.pipeline import Design

COLUMNS = ("N [N]", "Vy [N]", "Vz [N]", "Mt [N m]", "My [N m]", "Mz [N m]")


def bar_records(design: Design) -> dict[str, Any]:
    """`bars`, by member its `bay` (k,), the place `s` (k,) along its axis, and `forces` (k, 6) by case and combination,
    and the `least` and the `greatest` of all; `columns`, the names of the six.

    Raises StaticsError where the cut sheet does not carry its loads.
    """
    bars = {}
    for name, one in design.member_forces.items():
        least, greatest = np.moveaxis(one.envelope, -1, 0)
        several = {"least": least, "greatest": greatest} if len(one.forces) > 1 else {}
        bars[name] = {"bay": list(one.bay), "s": one.s, "forces": {**one.forces, **several}}
    return {"bars": bars, "columns": list(COLUMNS)}
