"""The beam model of a design, and how far it answers as the cut sheet does."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dsfab.arrays import Bools
from dsfab.errors import StaticsError
from dsfab.pipeline.regions import acting_on
from dsfab.preset import Preset
from dsfab.results import StaticsResult
from dsfab.statics import Equilibrium, SheetModel, sheet_stress, solve_cases, solve_for
from dsfab.surface import Load, LoadCase, Surface

if TYPE_CHECKING:
    from dsfab.frame import Frame, FrameAgreement
    from dsfab.members import MemberGraph


PERMANENT = {"self_weight", "cladding"}
"""Kinds of loads that are always there."""


class ActionCase(NamedTuple):
    """Loads of one case that are one kind of action.

    case : its name in the preset.    action : permanent, snow, wind or variable.    load : on the uncut surface.
    """

    case: str
    action: str
    load: LoadCase


def action_cases(preset: Preset, surface: Surface, statics: StaticsResult) -> dict[str, ActionCase]:
    """The cases of a preset by name, each of one kind of action: one that holds several is taken apart.

    Programs for frames combine cases by their kinds: weight that is in a case of snow would come and go with it. What
    `surface.actions` says of a case holds for all of it.
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
    """Of the kinds of EN 1990: snow of either height is snow, what people and heat do varies."""
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
    """Of a cut sheet with its members, under the loads on it of these cases; one that was taken apart is their sum.

    Raises StaticsError where there are no members with an axis.
    """
    from dsfab.frame import BeamMaterial, frame_of

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
    """The beams against the sheet that they stand for, its ribs twisting as bars, case by case.

    Raises StaticsError where one is not held.
    """
    from dsfab.frame import agreement, solve_frame

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
    """The answers of a sheet whose ribs twist as a thin sheet and as bars, by the same elements: alike in its plane,
    and where bars can not be solved, since they are next to nothing wide."""
    try:
        barred = solve_for(model, loads, "displacement", bars=True)
    except StaticsError:
        thin = solve_for(model, loads, "displacement")
        return thin, thin
    elements = next(iter(barred.values())).elements
    return (solve_cases(model, loads, elements) if elements.bending else barred), barred


def _spread(graph: "MemberGraph", count: int) -> Bools:
    """(m,) faces of the sheet that carry to all sides: those of discs, also where a member runs into one, and those in
    no member along an axis."""
    found, disc = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for member in graph.members:
        within = graph.source[member.cells]
        if member.kind == "disc":
            disc[within] = True
        elif member.axis is not None:
            found[within] = False
    return found | disc
