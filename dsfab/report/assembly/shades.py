"""What the page can colour members by, and its key figures."""

from typing import Any

import numpy as np

from dsfab.pipeline import Design
from dsfab.units import MM_PER_M
from dsfab.wording import length
from dsfab.workshop import WorkshopPlan

KILO = 1e3


def page_shades(plan: WorkshopPlan, names: list[str], judged: Design | None) -> list[dict[str, Any]]:
    """By what members are coloured: a name, a unit, and a value for each of `names`; None where there is none.

    judged : the design where its members' forces are to be shown too, which takes seconds. Raises StaticsError then
    where it has no strength, or nothing carries its loads.
    """
    assert plan.graph is not None
    members = plan.graph.by_id
    longest: dict[str, float] = {}
    for part in plan.parts:
        for name in (part.member, part.id):
            longest[name] = max(longest.get(name, 0.0), float(np.max(part.size)))
    axes = {name: members[name].length for name in names if name in members and members[name].axis}
    wide = {name: MM_PER_M * members[name].mean_width for name in axes}
    found = [
        _shade("length", "m", {**{name: longest[name] for name in names if name in longest}, **axes}, names, 2),
        _shade("width", "mm", wide, names, 0),
    ]
    if judged:
        found += _judged(judged, names)
    return [one for one in found if len({*one["values"]} - {None}) > 1]


def _judged(design: Design, names: list[str]) -> list[dict[str, Any]]:
    """What members bear: the largest normal force of any case, and how much it is of what they can bear."""
    normal = {
        name: max((float(table[np.abs(table[:, 0]).argmax(), 0]) / KILO for table in one.forces.values()), key=abs)
        for name, one in design.member_forces.items()
        if len(one.s)
    }
    full = {name: 100 * value for name, value in design.member_utilisation.by_member.items()}
    return [_shade("utilisation", "%", full, names, 1), _shade("normal force N", "kN", normal, names, 2)]


def _shade(name: str, unit: str, values: dict[str, float], names: list[str], digits: int) -> dict[str, Any]:
    return {
        "name": name,
        "unit": unit,
        "values": [round(values[one], digits) if one in values else None for one in names],
    }


def page_figures(plan: WorkshopPlan, design: Design, judged: bool) -> list[tuple[str, str]]:
    """Names and values for people."""
    statics, box = design.preset.statics, np.ptp(design.surface.V, axis=0)
    sheet = design.sheet.surface
    mass = sheet.area * statics.thickness * statics.density  # making the solid would take longer than the page
    found = [
        ("size", " x ".join(length(float(side)) for side in box)),
        ("mass", f"{mass:,.0f} kg" if mass >= 100 else f"{mass:.3g} kg"),
        ("made of", f"{statics.material or 'a material of the preset'}, {length(statics.thickness)} thick"),
        ("sheet", f"{sheet.area:.4g} m2, {sheet.area / design.surface.area:.0%} of the surface"),
    ]
    if judged:
        worst = design.member_utilisation.by_member
        name = max(worst, key=lambda one: worst[one])
        found.append(("most used", f"{name}: {worst[name]:.0%} of what it can bear"))
    return found
