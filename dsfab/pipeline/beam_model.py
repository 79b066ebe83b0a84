"""The beam model of a design, and how far it answers as the cut sheet does."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Bools
from dsfab.preset import Preset
from dsfab.results import StaticsResult
from dsfab.statics import sheet_stress, solve_for
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
    """The beams against the sheet that they stand for, case by case; raises StaticsError where one is not held."""
    from dsfab.frame import agreement, solve_frame

    answers, model = solve_frame(frame), preset.statics.sheet().on(sheet)
    solved, beside = solve_for(model, loads, "displacement"), _spread(graph, sheet.m)
    shares = {}
    for name, answer in solved.items():
        stress = sheet_stress(model, answer.elements, answer)
        energy = sheet.areas * (stress.membrane_energy + stress.bending_energy)
        shares[name] = float(energy[beside].sum() / energy.sum())
    return agreement(frame, answers, solved, shares)


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
