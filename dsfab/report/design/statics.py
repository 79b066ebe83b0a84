"""Statics of the uncut sheet and its balance of forces: numbers for `design.json`, lines for people."""

from typing import TYPE_CHECKING, Any

from dsfab.core.messages import value_with_bound
from dsfab.study.verdict.estimates import quantile

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.results import CaseResult, StaticsResult
    from dsfab.statics import Equilibrium
    from dsfab.study.verdict import ModeIntervals
    from dsfab.surface import LoadCase


def answer_facts(design: "Design", case: "CaseResult | StaticsResult") -> dict[str, Any]:
    """Return stress, energy and requested results of the uncut sheet under one load, in SI units.
    `answered_by` names the elements; elements that are fit for directions only give no stress and no energy.
    Frequencies and buckling factors appear only on request; a list without results is empty."""
    answers, questions, areas = case.answers, design.preset.statics.analyses, design.surface.areas
    stress, facts = answers.stress, dict[str, Any](answered_by=str(answers.elements))
    if answers.elements.is_reported:
        facts |= {
            "largest_von_mises_Pa": stress.peak.stress,
            "largest_von_mises_at": {
                "point_m": design.surface.centroids[stress.peak.face].tolist(),
                "face": stress.peak.face,
                "layer": stress.peak.layer,
            },
            "von_mises_99_Pa": quantile(stress.largest, areas),
            "membrane_energy_J": float(stress.membrane_energy @ areas),
            "bending_energy_J": float(stress.bending_energy @ areas),
        }
    if questions.strength:
        facts["strength_Pa"], facts["utilisation"] = questions.strength, stress.peak.stress / questions.strength
        facts["utilisation_99"] = facts["von_mises_99_Pa"] / questions.strength
    if questions.frequencies:
        facts["frequencies_hz"] = answers.vibration.hertz.tolist() if answers.vibration else []
    if questions.buckling:
        facts["buckling_factors"] = answers.buckling.factor.tolist() if answers.buckling else []
    return facts


def uncut_modes(design: "Design") -> "ModeIntervals":
    """Return the lowest buckling factors and frequency of the uncut sheet, with error intervals from finer meshes.
    The design keeps the result."""
    from dsfab.study.verdict import BUDGET, LoadedSurface, mode_intervals, whole_sheet

    questions = design.preset.statics.analyses

    def intervals() -> "ModeIntervals":
        return mode_intervals(LoadedSurface.from_design(design), whole_sheet(design.surface), questions, BUDGET)

    return design.cached_result("statics", "mode_intervals", intervals)


def mode_facts(design: "Design") -> dict[str, Any]:
    """Return the key `mode_intervals` of `design.json`, with relative error bounds; empty without a request."""
    if not design.preset.statics.analyses.modes:
        return {}
    intervals = uncut_modes(design)
    buckling = {name: {"factor": x.value, "bound": x.finite_bound} for name, x in intervals.buckling.items()}
    facts: dict[str, Any] = {"buckling": buckling, "triangles": [level.triangles for level in intervals.levels]}
    if intervals.hertz:
        facts["frequency"] = {"hertz": intervals.hertz.value, "bound": intervals.hertz.finite_bound}
    remarks = {"assumed": intervals.assumed, "refusals": list(intervals.refusals)}
    return {"mode_intervals": facts | {key: value for key, value in remarks.items() if value}}


def mode_lines(design: "Design") -> list[str]:
    """Return a line on the lowest buckling factor and the lowest frequency, for the case that buckles first."""
    if not design.preset.statics.analyses.modes:
        return []
    intervals, words = uncut_modes(design), []
    if intervals.buckling:
        name, lowest = min(intervals.buckling.items(), key=lambda item: item[1].value)
        under = f", {name}" if len(intervals.buckling) > 1 else ""
        words.append(f"lowest factor of buckling {value_with_bound(lowest.value, lowest.finite_bound)}{under}")
    if intervals.hertz:
        words.append(f"lowest frequency {value_with_bound(intervals.hertz.value, intervals.hertz.finite_bound, 'Hz')}")
    if not words:
        return []
    assumed = f"; {intervals.assumed}" if intervals.assumed else ""
    return [f"uncut sheet, {len(intervals.levels)} meshes: {' and '.join(words)}{assumed}"]


def equilibrium_facts(design: "Design", load: "LoadCase", answer: "Equilibrium") -> dict[str, Any]:
    """Return compliance, largest displacement, residuals, and sums of loads and reactions of one equilibrium.
    Elements that are fit for directions only give neither compliance nor displacement."""
    moved = {"compliance_J": answer.compliance, "largest_displacement_m": answer.largest_displacement}
    return {
        **(moved if answer.elements.is_reported else {}),
        "imbalance": answer.imbalance,
        "residual": answer.residual,
        **balance(design, load, answer),
    }


def case_facts(design: "Design") -> dict[str, Any]:
    """Return the facts of each case and combination, by name."""
    facts_by_case = {}
    for name, case in design.statics.cases.items():
        factors = {} if case.factors is None else {"factors": dict(case.factors)}
        facts = equilibrium_facts(design, case.load, case.answers.equilibrium)
        facts_by_case[name] = {**factors, **facts, **answer_facts(design, case)}
    return facts_by_case


def cut_load_facts(design: "Design") -> dict[str, Any]:
    """Return `load_N`: the load in newtons on the cut sheet, by case; empty if a load meets no material."""
    from dsfab.core.errors import DsfabError
    from dsfab.design import loads_on

    loads = {name: case.load for name, case in design.statics.cases.items()}
    try:
        on_sheet = loads_on(design.surface, design.sheet, loads)
    except DsfabError:
        return {}
    return {"load_N": {name: load.force.sum(axis=0).tolist() for name, load in on_sheet.items()}}


def balance(design: "Design", load: "LoadCase", answer: "Equilibrium") -> dict[str, Any]:
    """Return the sums of loads and reactions, and their moments about the origin, in total and for each support."""
    from dsfab.design import acting_on
    from dsfab.statics import resultant, support_reactions

    surface, supports = design.surface, acting_on(design.preset, design.surface).support
    loads, reaction = resultant(surface, load.force), resultant(surface, answer.reaction, answer.torque)
    carried = zip(supports, support_reactions(surface, supports, answer), strict=True)
    return {
        "load_N": loads.force.tolist(),
        "load_moment_Nm": loads.moment.tolist(),
        "reaction_N": reaction.force.tolist(),
        "reaction_moment_Nm": reaction.moment.tolist(),
        "supports": [
            {
                "hold": support.hold,
                **({"spring_N_per_m": list(support.spring)} if support.spring else {}),
                **({"clamp": True} if support.clamp else {}),
                "reaction_N": part.force.tolist(),
                "moment_Nm": part.moment.tolist(),
            }
            for support, part in carried
        ],
    }
