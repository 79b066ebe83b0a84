"""What a sheet tells besides its displacements, as [statics] asks, and notes on what to make of it."""

from collections.abc import Sequence
from dataclasses import replace

from scipy.sparse import csr_array

from dsfab.limits import FACETS
from dsfab.pipeline.log import Log
from dsfab.pipeline.solved import SolvedSheet
from dsfab.preset import Preset, Statics
from dsfab.statics import (
    Answers,
    Ask,
    Elements,
    KeptFactor,
    SolvedCase,
    facet_number,
    sheet_answers,
    sheet_stiffness,
)
from dsfab.surface import Surface

ANSWERED = 200_000
"""Vertices up to which better elements answer what hinges were solved for. Their factor takes 17 GB at 250 000 (hinges:
3.6) and four times as much time as all else: a design of a million, which is built in 16 GB, would never end for it."""


def answers_step(preset: Preset, surface: Surface, solved: SolvedSheet, log: Log, rough: bool = False) -> list[Answers]:
    """Stress, energy, frequencies and buckling of a solved sheet, under each loading.

    rough : stress and energy alone, by the elements that solved it.
    """
    sheet = preset.statics
    model, made = sheet.sheet().on(surface), dict(solved.made)

    def stiffness(elements: Elements) -> csr_array:
        if elements not in made:
            made[elements] = sheet_stiffness(model, elements)
        return made[elements]

    again, (ask, refusals) = KeptFactor(2), (Ask(), ()) if rough else _affordable(sheet, surface, log)
    if ask and log.progress:
        log.progress("statics", f"answering by {ask.elements(sheet.elements)} elements")
    found: list[Answers] = []
    with log.row("answers"):
        for loading, answer in zip(solved.acting, solved.answers, strict=True):
            # loads do not change how the sheet swings
            asked = replace(ask, frequencies=0) if found else ask
            case = SolvedCase(loading.load, loading.spread, answer, sheet.elements, solved.factor_of, solved.plane)
            one = sheet_answers(model, case, stiffness, asked, again)
            one = replace(one, refusals=(*one.refusals, *refusals))
            found.append(replace(one, vibration=found[0].vibration) if found else one)
    told = [(loading.name, answers) for loading, answers in zip(solved.acting, found, strict=True)]
    strong = preset.judged_in("ULS", [name for name, _ in told if name])
    _note([(name, answers) for name, answers in told if name in strong], ask, sheet, surface, log)
    return found


def _affordable(sheet: Statics, surface: Surface, log: Log) -> tuple[Ask, tuple[str, ...]]:
    """What can be asked of a mesh of that size, and why no modes are looked for; the stress by hinges is told."""
    ask = sheet.ask
    if surface.n <= ANSWERED or ask.elements(sheet.elements) == sheet.elements:
        return ask, ()
    why = f"{surface.n:,} vertices are too many for the elements that they need, {ANSWERED:,} are allowed"
    log.note(
        "statics",
        f"the stress of the uncut sheet is that of {sheet.elements} elements, a rough one: {why}; build a coarser mesh "
        "(surface.edge) to have it",
    )
    return Ask(), (f"no natural frequencies, no buckling factors: {why}",) if ask.modes else ()


def _note(told: Sequence[tuple[str, Answers]], ask: Ask, sheet: Statics, surface: Surface, log: Log) -> None:
    """What the answers mean for somebody who wants to build this."""
    elements = told[0][1].elements
    if ask and ask.elements(sheet.elements) != sheet.elements:
        why = "hinge bending is fit for directions only"
        if sheet.bending != "hinge":
            why = f"{sheet.elements} is not accurate enough to be reported from"
        log.note(
            "statics",
            f"stress, energy, frequencies and buckling are those of {elements} elements on the same mesh: {why}",
        )
    facets = facet_number(surface, sheet.thickness)
    if ask and elements.bending == "hhj" and facets > FACETS:
        log.note(
            "statics",
            f"flat faces bend by themselves under pressure and weight (edge x fold / thickness = {facets:.2g}, better "
            f"under {FACETS}): the largest stress is too high by up to that share; make the mesh finer (surface.edge, "
            "or surface.refine with smooth)",
        )
    for name, answers in told:
        _note_case(f" under {name}" if len(told) > 1 else "", answers, sheet, log)


def _note_case(under: str, answers: Answers, sheet: Statics, log: Log) -> None:
    if answers.assumed:
        log.note("statics", f"frequencies and buckling{under} are those of a sheet out of its plane: {answers.assumed}")
    for refusal in answers.refusals:
        aside = "" if answers.elements.bending else " (it was solved in its plane, but vibrates and buckles out of it)"
        log.note("statics", refusal + under + aside)
    if answers.buckling is not None and not len(answers.buckling.factor):
        log.note("statics", f"the load compresses no part of the uncut sheet{under}: it does not buckle")
    elif answers.buckling is not None and answers.buckling.factor[0] < 1:
        log.note(
            "statics", f"the uncut sheet buckles{under} before it carries the load; make it thicker or the load smaller"
        )
    reliable = answers.elements.bending != "hinge"
    if sheet.strength and reliable and (share := answers.stress.peak.stress / sheet.strength) > 1:
        log.note(
            "statics",
            f"the largest stress in the uncut sheet{under} exceeds the strength, being {share:.0%} of it: a thicker "
            "sheet (statics.thickness) is stressed less, unless its own weight is most of the load",
        )
