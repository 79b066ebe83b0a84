"""The beam model of a design, and the Eurocode rules for its members."""

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
from dsfab.surface import ACTION_OF_LOAD, LoadCase, Surface, action_kind, case_names, loads_by_action

if TYPE_CHECKING:
    from dsfab.members import MemberGraph
    from dsfab.members.eurocode import Duration, Rules, Utilisation
    from dsfab.members.frame import Frame, FrameAgreement, MemberForces

LOAD_DURATIONS: dict[str, "Duration"] = {
    "permanent": "permanent",
    "imposed E": "long",
    "imposed H": "short",
    "wind": "short",
}
"""Duration class of loads by kind of action [EN 1995-1-1, table 2.2]. Snow and unlisted actions are medium-term."""


def member_utilisation(preset: Preset, graph: "MemberGraph", forces: Mapping[str, "MemberForces"]) -> "Utilisation":
    """Return utilisation: forces in members, divided by the resistance. graph : members and nodes.
    Raises StaticsError if the preset has neither a material nor a strength."""
    from dsfab.members.eurocode import MemberBays, utilisation

    bays = MemberBays.from_forces(graph, forces, preset.statics.thickness)
    rules = eurocode_rules(preset, tuple(bays.forces))
    return utilisation(bays.with_cases(preset.judged_in("ULS", bays.forces)), rules)


def eurocode_rules(preset: Preset, cases: tuple[str, ...]) -> "Rules":
    """Return the values for Eurocode checks of a preset. cases : names of load cases and combinations."""
    from dsfab.members.eurocode import Rules, SteelFactors, TimberFactors

    section, options = preset.statics, preset.eurocode
    layer = (preset.workshop.thickness or section.thickness / preset.workshop.layers) if options.bent_in else 0.0
    material = section.material or "", section.young, section.young / (2 * (1 + section.poisson)), section.strength
    durations = {case: _duration(preset, case) for case in cases}
    steel = SteelFactors(options.curve, options.gamma_m0, options.gamma_m1, options.buckling_length)
    timber = TimberFactors(options.service_class, options.gamma_m, options.buckling_length, layer)
    return Rules(*material, durations, steel, timber, _load_description(preset, cases), bool(preset.surface.sums))


def _load_description(preset: Preset, cases: tuple[str, ...]) -> str:
    judged = preset.judged_in("ULS", cases)
    if preset.surface.sums:
        return (
            f"Members are checked in {len(judged)} load cases and combinations, with the partial factors in the preset."
        )
    return "Loads have no partial factors, because the preset has no combinations (surface.combinations)."


def _duration(preset: Preset, name: str) -> "Duration":
    from dsfab.members.eurocode import shortest

    sums = {combination.name: combination.factors for combination in preset.surface.sums}
    cases = [case for case, factor in sums.get(name, {name: 1.0}).items() if factor]
    return shortest(_case_duration(preset, case) for case in cases) if cases else "medium"


def _case_duration(preset: Preset, case: str) -> "Duration":
    from dsfab.members.eurocode import shortest

    if case in preset.eurocode.duration:
        return preset.eurocode.duration[case]
    action = preset.surface.actions.get(case)
    kinds = {load.kind for load in preset.surface.load if load.case == case}
    acts = {action} if action else {ACTION_OF_LOAD.get(kind, "") for kind in kinds}
    return shortest(LOAD_DURATIONS.get(act, "medium") for act in acts or {""})


class ActionCase(NamedTuple):
    """Loads of the load case `case` that have the same kind of action: permanent, snow, wind or variable."""

    case: str
    action: str
    load: LoadCase


def action_cases(preset: Preset, surface: Surface, statics: StaticsResult) -> dict[str, ActionCase]:
    """Return the load cases of a preset by name. A case with several kinds of action is divided, one part per kind."""
    acting, actions = acting_on(preset, surface).load, preset.surface.actions
    cases = {name: entry.load for name, entry in statics.cases.items() if entry.factors is None}
    separate, result = loads_by_action(acting, actions), dict[str, ActionCase]()
    for case, load in cases.items():
        of_case = [item for item, origin in zip(separate, acting, strict=True) if origin.case == case]
        for name in case_names(of_case):
            loads = [item for item in of_case if item.case == name]
            kind = action_kind(replace(loads[0], case=case), actions)
            part = load if name == case else load.with_loads(surface, loads, preset.statics.area_weight)
            result[name.replace(":", "")] = ActionCase(case, _action_class(kind), part)
    return result


def _action_class(kind: str | None) -> str:
    if kind in ("permanent", "wind"):
        return kind
    return "snow" if kind in ("snow", "snow high") else "variable"


def beam_model(
    preset: Preset,
    sheet: Surface,
    graph: "MemberGraph",
    statics: StaticsResult,
    cases: Mapping[str, ActionCase],
    loads: Mapping[str, LoadCase],
) -> "Frame":
    """Return the beam model of a cut sheet with its members.
    cases : results of `action_cases`, by name.    loads : these loads on the cut sheet, by the same names.
    Raises StaticsError if no member has an axis."""
    from dsfab.members.frame import BeamMaterial, frame_of

    section = preset.statics
    material = BeamMaterial(section.young, section.poisson, section.density, section.material or "")
    sums = {part.case: {part.case: 1.0} for name, part in cases.items() if name != part.case}
    sums |= {name: dict(factors) for name, factors in statics.combinations.items()}
    combinations = {
        name: {part_name: factors[part.case] for part_name, part in cases.items() if part.case in factors}
        for name, factors in sums.items()
    }
    frame = frame_of(graph, sheet, loads, combinations, section.thickness, material)
    return replace(frame, actions={name: part.action for name, part in cases.items()})


def beam_agreement(
    preset: Preset, sheet: Surface, graph: "MemberGraph", frame: "Frame", loads: Mapping[str, LoadCase]
) -> list["FrameAgreement"]:
    """Compare compliance and displacement of the beam model `frame` with the cut sheet, under each load.
    Raises StaticsError if the supports do not hold the beams or the sheet."""
    from dsfab.members.frame import agreement, solve_frame

    answers, spread_faces = solve_frame(frame), _spread_faces(graph, sheet.m)
    model = preset.statics.sheet().model_for(sheet)
    as_sheet, as_bars = _sheet_and_bar_answers(model, loads)
    shares, twist = {}, {}
    for name, answer in as_sheet.items():
        stress = sheet_stress(model, answer.elements, answer)
        energy = sheet.areas * (stress.membrane_energy + stress.bending_energy)
        shares[name] = float(energy[spread_faces].sum() / energy.sum())
        twist[name] = as_bars[name].largest_displacement / answer.largest_displacement
    return agreement(frame, answers, as_bars, shares, twist)


def _sheet_and_bar_answers(
    model: SheetModel, loads: Mapping[str, LoadCase]
) -> tuple[Mapping[str, Equilibrium], Mapping[str, Equilibrium]]:
    """Return two sets of results by load: ribs with the torsional stiffness of sheets, then of bars."""
    try:
        as_bars = solve_for(model, loads, "displacement", bars=True)
    except StaticsError:
        as_sheet = solve_for(model, loads, "displacement")
        return as_sheet, as_sheet
    elements = next(iter(as_bars.values())).elements
    return (solve_cases(model, loads, elements) if elements.bending else as_bars), as_bars


def _spread_faces(graph: "MemberGraph", count: int) -> Bools:
    outside_members, disc = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for member in graph.members:
        within = graph.source[member.cells]
        if member.kind == "disc":
            disc[within] = True
        elif member.axis is not None:
            outside_members[within] = False
    return outside_members | disc
