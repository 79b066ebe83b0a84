"""What a build tells about the uncut sheet besides its displacements: numbers for `design.json`, lines for people."""

from typing import TYPE_CHECKING, Any

from dsfab.render.colouring import stress_label
from dsfab.study.verdict.stresses import quantile
from dsfab.wording import bounded

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design
    from dsfab.results import CaseResult, StaticsResult
    from dsfab.statics import Answers
    from dsfab.study.verdict import ModeIntervals


def answer_facts(design: "Design", case: "CaseResult | StaticsResult") -> dict[str, Any]:
    """Stress, energy, and what else was asked of the uncut sheet under one load; SI units.

    `answered_by` names the elements, and the compliance and the displacement are given again where they differ from
    those of the statics. Lists are left out where nothing was asked; they are empty where nothing was found.
    """
    answers, ask, areas = case.answers, design.preset.statics.ask, design.surface.areas
    stress = answers.stress
    facts: dict[str, Any] = {
        "answered_by": str(answers.elements),
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
    if answers.equilibrium is not case.equilibrium:
        facts["answered_compliance_J"] = answers.equilibrium.compliance
        facts["answered_largest_displacement_m"] = answers.equilibrium.largest_displacement
    if ask.strength:
        facts["strength_Pa"], facts["utilisation"] = ask.strength, stress.peak.stress / ask.strength
        facts["utilisation_99"] = facts["von_mises_99_Pa"] / ask.strength
    if ask.frequencies:
        facts["frequencies_hz"] = answers.vibration.hertz.tolist() if answers.vibration else []
    if ask.buckling:
        facts["buckling_factors"] = answers.buckling.factor.tolist() if answers.buckling else []
    return facts


def uncut_modes(design: "Design") -> "ModeIntervals":
    """The lowest factor of buckling of each case and the lowest frequency of the uncut sheet, by its mesh and finer
    ones; found once for a design that asks for them."""
    from dsfab.study.verdict import BUDGET, LoadedSurface, mode_intervals, whole_sheet

    ask = design.preset.statics.ask
    return design.once(
        "statics",
        "mode_intervals",
        lambda: mode_intervals(LoadedSurface.of(design), whole_sheet(design.surface), ask, BUDGET),
    )


def mode_facts(design: "Design") -> dict[str, Any]:
    """`mode_intervals` of `design.json`: values with half widths of their intervals, relative; nothing if not asked."""
    if not design.preset.statics.ask.modes:
        return {}
    found = uncut_modes(design)
    facts: dict[str, Any] = {
        "buckling": {name: {"factor": one.value, "bound": one.known} for name, one in found.buckling.items()},
        "triangles": [level.triangles for level in found.levels],
    }
    if found.hertz:
        facts["frequency"] = {"hertz": found.hertz.value, "bound": found.hertz.known}
    told = {"assumed": found.assumed, "refusals": list(found.refusals)}
    return {"mode_intervals": facts | {key: value for key, value in told.items() if value}}


def mode_lines(design: "Design") -> list[str]:
    """The same for people, of the case that buckles first."""
    if not design.preset.statics.ask.modes:
        return []
    found, told = uncut_modes(design), []
    if found.buckling:
        name, least = min(found.buckling.items(), key=lambda one: one[1].value)
        under = f", {name}" if len(found.buckling) > 1 else ""
        told.append(f"lowest factor of buckling {bounded(least.value, least.known)}{under}")
    if found.hertz:
        told.append(f"lowest frequency {bounded(found.hertz.value, found.hertz.known, 'Hz')}")
    if not told:
        return []
    assumed = f"; {found.assumed}" if found.assumed else ""
    return [f"uncut sheet, {len(found.levels)} meshes: {' and '.join(told)}{assumed}"]


def answer_lines(design: "Design") -> list[str]:
    """The same for people, of the case or combination where it is worst; `hinge` stress is left to `design.json`."""
    cases = design.statics.cases
    told = {name: cases[name].answers for name in design.preset.judged_in("ULS", cases)}
    under = {name: f", {name}" if len(cases) > 1 else "" for name in told}
    lines = []
    worst = max(told, key=lambda name: told[name].stress.peak.stress)
    if told[worst].elements.bending != "hinge":
        lines.append(_stress_line(design, told[worst], under[worst]))
    factors = {name: a.buckling.factor for name, a in told.items() if a.buckling is not None and len(a.buckling.factor)}
    if factors:
        worst = min(factors, key=lambda name: float(factors[name][0]))
        listed = ", ".join(f"{factor:.3g}" for factor in factors[worst])
        lines.append(
            f"uncut sheet{under[worst]}: buckles at {listed} x the load (linear, perfect shape; real shells at a fifth "
            "to a half)"
        )
    if (vibration := told[worst].vibration) is not None:
        hertz = ", ".join(f"{value:.3g}" for value in vibration.hertz)
        several = len(vibration.hertz) > 1
        lines.append(f"uncut sheet: lowest {'frequencies' if several else 'frequency'} {hertz} Hz")
    return [*lines, *mode_lines(design)]


def _stress_line(design: "Design", answers: "Answers", under: str) -> str:
    peak, strength = answers.stress.peak, design.preset.statics.strength
    where = ", ".join(f"{x:.3g}" for x in design.surface.centroids[peak.face] + 0.0)
    layer = {"top": "on the top", "middle": "in the middle", "bottom": "on the bottom"}[peak.layer]
    share = f", {peak.stress / strength:.0%} of the strength" if strength else ""
    usual = quantile(answers.stress.largest, design.surface.areas)
    part = f" ({usual / strength:.0%})" if strength else ""
    return (
        f"uncut sheet{under}: largest stress {stress_label(peak.stress)} {layer} at ({where}) m{share}, no number at "
        f"corners, supports and forces: finer meshes raise it; on 99 % of the area {stress_label(usual)}{part}"
    )
