"""The beam model of a design, and the standard and factors by which its members are checked."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools
from dsfab.core.errors import StaticsError
from dsfab.design.regions_and_loads import acting_on
from dsfab.preset.model import Preset
from dsfab.results import StaticsResult
from dsfab.statics import Equilibrium, SheetModel, sheet_stress, solve_cases, solve_for
from dsfab.surface import OF_LOADS, Load, LoadCase, Surface

if TYPE_CHECKING:
    from dsfab.members import MemberGraph
    from dsfab.members.eurocode import Duration, Rules, Utilisation
    from dsfab.members.frame import Frame, FrameAgreement, MemberForces


LASTS: dict[str, "Duration"] = {"permanent": "permanent", "imposed E": "long", "imposed H": "short", "wind": "short"}
"""Duration of loads by their action [EN 1995-1-1, table 2.2]; any other action, snow too, has a medium duration."""


def member_utilisation(preset: Preset, graph: "MemberGraph", forces: Mapping[str, "MemberForces"]) -> "Utilisation":
    """Return forces of members over their resistance, in the cases and combinations of the ultimate limit state.

    Raises StaticsError if neither the material nor a strength is set.
    """
    from dsfab.members.eurocode import MemberBays, utilisation

    bays = MemberBays.of(graph, forces, preset.statics.thickness)
    return utilisation(bays.some(preset.judged_in("ULS", bays.forces)), rules_of(preset, tuple(bays.forces)))


def rules_of(preset: Preset, cases: tuple[str, ...]) -> "Rules":
    """Return the Eurocode rules of a preset for cases and combinations, by their names."""
    from dsfab.members.eurocode import Rules, SteelFactors, TimberFactors

    given, ask = preset.statics, preset.eurocode
    layer = (preset.workshop.thickness or given.thickness / preset.workshop.layers) if ask.bent_in else 0.0
    return Rules(
        given.material or "",
        given.young,
        given.young / (2 * (1 + given.poisson)),
        given.strength,
        {case: _duration(preset, case) for case in cases},
        SteelFactors(ask.curve, ask.gamma_m0, ask.gamma_m1, ask.buckling_length),
        TimberFactors(ask.service_class, ask.gamma_m, ask.buckling_length, layer),
        _loads(preset, cases),
        bool(preset.surface.sums),
    )


def _loads(preset: Preset, cases: tuple[str, ...]) -> str:
    judged = preset.judged_in("ULS", cases)
    if preset.surface.sums:
        return f"Judged in {len(judged)} cases and combinations, with the factors that the preset gives them."
    return "Loads are those of the preset without partial factors: it has no combinations (surface.combinations)."


def _duration(preset: Preset, name: str) -> "Duration":
    from dsfab.members.eurocode import shortest

    sums = {one.name: one.factors for one in preset.surface.sums}
    cases = [case for case, factor in sums.get(name, {name: 1.0}).items() if factor]
    return shortest(_of_case(preset, case) for case in cases) if cases else "medium"


def _of_case(preset: Preset, case: str) -> "Duration":
    from dsfab.members.eurocode import shortest

    if case in preset.eurocode.duration:
        return preset.eurocode.duration[case]
    action = preset.surface.actions.get(case)
    kinds = {load.kind for load in preset.surface.load if load.case == case}
    acts = {action} if action else {OF_LOADS.get(kind, "") for kind in kinds}
    return shortest(LASTS.get(act, "medium") for act in acts or {""})


PERMANENT = {"self_weight", "cladding"}
"""Kinds of permanent loads."""


class ActionCase(NamedTuple):
    """Loads of one case that are one kind of action.

    case : its name in the preset.    action : permanent, snow, wind or variable.    load : on the uncut surface.
    """

    case: str
    action: str
    load: LoadCase


def action_cases(preset: Preset, surface: Surface, statics: StaticsResult) -> dict[str, ActionCase]:
    """Return the cases of a preset by name, split so that each has one kind of action.

    Frame programs combine cases by their kinds: weight in a case of snow would come and go with the snow. An entry of
    `surface.actions` holds for the whole case.
    """
    given, found = preset.surface, dict[str, ActionCase]()
    for case in (name for name, one in statics.cases.items() if one.factors is None):
        load, kinds = statics.cases[case].load, dict[str, list[Load]]()
        for one in acting_on(preset, surface).load:
            if one.case == case:
                kinds.setdefault(_said(given.actions.get(case)) or _action(one), []).append(one)
        if len(kinds) == 1:
            found[case] = ActionCase(case, next(iter(kinds)), load)
            continue
        for action, loads in kinds.items():
            found[f"{case} {action}"] = ActionCase(case, action, load.under(surface, loads, preset.statics.weight))
    return found


def _action(load: Load) -> str:
    if load.kind in PERMANENT:
        return "permanent"
    return load.kind if load.kind in ("snow", "wind") else "variable"


def _said(kind: str | None) -> str:
    """Return the action of a kind of EN 1990: snow at either altitude is snow; imposed loads and temperature are
    variable.
    """
    if kind is None or kind in ("permanent", "wind"):
        return kind or ""
    return "snow" if kind.startswith("snow") else "variable"


def beam_model(
    preset: Preset,
    sheet: Surface,
    graph: "MemberGraph",
    statics: StaticsResult,
    cases: Mapping[str, ActionCase],
    loads: Mapping[str, LoadCase],
) -> "Frame":
    """Return the beam model of a cut sheet with its members, under the loads of these cases; a split case is their sum.

    Raises StaticsError if no member has an axis.
    """
    from dsfab.members.frame import BeamMaterial, frame_of

    given = preset.statics
    material = BeamMaterial(given.young, given.poisson, given.density, given.material or "")
    sums = {one.case: {one.case: 1.0} for name, one in cases.items() if name != one.case}
    sums |= {name: dict(case.factors) for name, case in statics.cases.items() if case.factors is not None}
    apart = {
        name: {part: factors[one.case] for part, one in cases.items() if one.case in factors}
        for name, factors in sums.items()
    }
    made = frame_of(graph, sheet, loads, apart, given.thickness, material)
    return replace(made, actions={name: one.action for name, one in cases.items()})


def beam_agreement(
    preset: Preset, sheet: Surface, graph: "MemberGraph", frame: "Frame", loads: Mapping[str, LoadCase]
) -> list["FrameAgreement"]:
    """Compare beams with the sheet that they model, whose ribs twist as bars, case by case.

    Raises StaticsError if either is not held.
    """
    from dsfab.members.frame import agreement, solve_frame

    answers, model, beside = solve_frame(frame), preset.statics.sheet().on(sheet), _spread(graph, sheet.m)
    thin, barred = _thin_and_barred(model, loads)
    shares, twist = {}, {}
    for name, answer in thin.items():
        stress = sheet_stress(model, answer.elements, answer)
        energy = sheet.areas * (stress.membrane_energy + stress.bending_energy)
        shares[name] = float(energy[beside].sum() / energy.sum())
        twist[name] = barred[name].largest_displacement / answer.largest_displacement
    return agreement(frame, answers, barred, shares, twist)


def _thin_and_barred(
    model: SheetModel, loads: Mapping[str, LoadCase]
) -> tuple[Mapping[str, Equilibrium], Mapping[str, Equilibrium]]:
    """Return the answers of a sheet whose ribs twist as a thin sheet and as bars, by the same elements.

    Both are equal if the sheet is solved in its plane, and if bars cannot be solved because they are too narrow.
    """
    try:
        barred = solve_for(model, loads, "displacement", bars=True)
    except StaticsError:
        thin = solve_for(model, loads, "displacement")
        return thin, thin
    elements = next(iter(barred.values())).elements
    return (solve_cases(model, loads, elements) if elements.bending else barred), barred


def _spread(graph: "MemberGraph", count: int) -> Bools:
    """Return faces of the sheet (m,) that carry in all directions: those of discs, and those in no member with an
    axis.
    """
    found, disc = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for member in graph.members:
        within = graph.source[member.cells]
        if member.kind == "disc":
            disc[within] = True
        elif member.axis is not None:
            found[within] = False
    return found | disc
