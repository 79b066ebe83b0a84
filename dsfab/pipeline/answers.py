"""What a sheet tells besides its displacements, as [statics] asks, and notes on what to make of it."""

from scipy.sparse import csr_array

from dsfab.pipeline.log import Log
from dsfab.preset import Statics
from dsfab.statics import (
    FACETED,
    Answers,
    Elements,
    Equilibrium,
    FactorOf,
    SpreadLoad,
    facet_number,
    sheet_answers,
    sheet_stiffness,
)
from dsfab.surface import LoadCase, Surface


def answers_step(
    sheet: Statics,
    surface: Surface,
    load: LoadCase,
    spread: SpreadLoad,
    solved: Equilibrium,
    made: dict[Elements, csr_array],
    factor_of: FactorOf,
    log: Log,
) -> Answers:
    """Stress, energy, frequencies and buckling of a solved sheet.

    made : stiffnesses by their elements; others that are needed are added to it.
    """

    def stiffness(elements: Elements) -> csr_array:
        if elements not in made:
            made[elements] = sheet_stiffness(surface, sheet.material, sheet.thickness, sheet.law, elements)
        return made[elements]

    ask = sheet.ask
    if ask and log.progress:
        log.progress("statics", f"answering by {ask.elements(sheet.elements)} elements")
    with log.row("answers"):
        answers = sheet_answers(
            surface,
            sheet.material,
            sheet.thickness,
            sheet.law,
            sheet.elements,
            load,
            spread,
            solved,
            stiffness,
            ask,
            factor_of,
        )
    _note(answers, sheet, surface, log)
    return answers


def _note(answers: Answers, sheet: Statics, surface: Surface, log: Log) -> None:
    """What the answers mean for somebody who wants to build this."""
    if sheet.ask and sheet.bending == "hinge":
        log.note(
            "statics",
            f"stress, energy, frequencies and buckling are those of {answers.elements} elements on the same mesh: "
            "hinge bending is fit for directions only",
        )
    facets = facet_number(surface, sheet.thickness)
    if sheet.ask and answers.elements.bending == "hhj" and facets > FACETED:
        log.note(
            "statics",
            f"flat faces bend by themselves under pressure and weight (edge x fold / thickness = {facets:.2g}, better "
            f"under {FACETED}): the largest stress is too high by up to that share; make the mesh finer (surface.edge, "
            "or surface.refine with smooth)",
        )
    for refusal in answers.refusals:
        aside = "" if answers.elements.bending else " (it was solved in its plane, but vibrates and buckles out of it)"
        log.note("statics", refusal + aside)
    if answers.buckling is not None and not len(answers.buckling.factor):
        log.note("statics", "the load compresses no part of the uncut sheet: it does not buckle")
    elif answers.buckling is not None and answers.buckling.factor[0] < 1:
        log.note("statics", "the uncut sheet buckles before it carries the load; make it thicker or the load smaller")
    if sheet.strength and answers.stress.peak.stress > sheet.strength:
        log.note("statics", "the largest stress in the uncut sheet exceeds the strength")
