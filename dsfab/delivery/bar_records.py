"""What the members of a design bear, and how much of what they can, as plain records for files, SI units."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.pipeline import Design

if TYPE_CHECKING:
    from dsfab.eurocode import Utilisation

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


def utilisation_records(design: Design) -> dict[str, Any]:
    """`utilisation`: `rows`, by bay, worst first, its `member`, `bay`, numbers and words as `export.utilisation` has
    them; `checks`, names with clauses; `standard`, `assumed`, `unchecked`, sentences; `told`, the worst of all.

    Raises StaticsError where neither the material nor a strength is known, or nothing carries the loads.
    """
    return found_records(design.member_utilisation)


def found_records(found: "Utilisation") -> dict[str, Any]:
    """The same of what was found."""
    bays, rows = found.bays, []
    for bay in found.order.tolist():
        check, case, station = found.governing(bay)
        rows.append(
            {
                "member": bays.member[bay],
                "bay": bays.name[bay],
                "utilisation": float(found.largest[bay]),
                "check": check.name,
                "clause": check.clause,
                "case": case,
                "along": float(bays.s[bay, station]),
                "width": float(bays.width[bay, station]),
                "length": float(bays.length[bay]),
                "forces": bays.forces[case][bay, station],
                "each": found.worst[bay],
            }
        )
    words = {"standard": found.standard, "assumed": found.assumed, "unchecked": found.unchecked}
    known = {"rows": rows, "checks": [str(check) for check in found.checks], "thickness": bays.thickness}
    return {"utilisation": {**words, **known, "told": [found.told]}, "columns": list(COLUMNS)}
