"""The beam model of a design, and how far it answers as the cut sheet does."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Bools
from dsfab.errors import StaticsError
from dsfab.preset import Preset
from dsfab.results import StaticsResult
from dsfab.statics import Equilibrium, SheetModel, sheet_stress, solve_cases, solve_for
from dsfab.surface import LoadCase, Surface

if TYPE_CHECKING:
    from dsfab.frame import Frame, FrameAgreement
    from dsfab.members import MemberGraph


def beam_model(
    preset: Preset, sheet: Surface, graph: "MemberGraph", statics: StaticsResult, loads: Mapping[str, LoadCase]
) -> "Frame":
    """Of a cut sheet with its members, under the loads of its cases.

    Raises StaticsError where there are no members with an axis.
    """
    from dsfab.frame import BeamMaterial, frame_of

    given = preset.statics
    material = BeamMaterial(given.young, given.poisson, given.density, given.material or "")
    cases = {name: load for name, load in loads.items() if statics.cases[name].factors is None}
    sums = {name: dict(case.factors) for name, case in statics.cases.items() if case.factors is not None}
    return frame_of(graph, sheet, cases, sums, given.thickness, material)


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
