"""What a build tells about the uncut sheet besides its displacements: numbers for `design.json`, lines for people."""

from typing import TYPE_CHECKING, Any

from dsfab.app.colouring import stress_label

if TYPE_CHECKING:
    from dsfab.design import Design
    from dsfab.statics import Answers


def answer_facts(design: "Design") -> dict[str, Any]:
    """Stress, energy, and what else was asked of the uncut sheet; SI units.

    `answered_by` names the elements, and the compliance and the displacement are given again where they differ from
    those of the statics. Lists are left out where nothing was asked; they are empty where nothing was found.
    """
    answers, ask, areas = design.statics.answers, design.preset.statics.ask, design.surface.areas
    stress = answers.stress
    facts: dict[str, Any] = {
        "answered_by": str(answers.elements),
        "largest_von_mises_Pa": stress.peak.stress,
        "largest_von_mises_at": {
            "point_m": design.surface.centroids[stress.peak.face].tolist(),
            "face": stress.peak.face,
            "layer": stress.peak.layer,
        },
        "membrane_energy_J": float(stress.membrane_energy @ areas),
        "bending_energy_J": float(stress.bending_energy @ areas),
    }
    if answers.equilibrium is not design.statics.equilibrium:
        facts["answered_compliance_J"] = answers.equilibrium.compliance
        facts["answered_largest_displacement_m"] = answers.equilibrium.largest_displacement
    if ask.strength:
        facts["strength_Pa"], facts["utilisation"] = ask.strength, stress.peak.stress / ask.strength
    if ask.frequencies:
        facts["frequencies_hz"] = answers.vibration.hertz.tolist() if answers.vibration else []
    if ask.buckling:
        facts["buckling_factors"] = answers.buckling.factor.tolist() if answers.buckling else []
    return facts


def answer_lines(design: "Design") -> list[str]:
    """The same for people; stress by `hinge` elements is left to `design.json`."""
    answers = design.statics.answers
    lines = []
    if answers.elements.bending != "hinge":
        lines.append(_stress_line(design, answers))
    if answers.buckling is not None and len(answers.buckling.factor):
        factors = ", ".join(f"{factor:.3g}" for factor in answers.buckling.factor)
        lines.append(
            f"uncut sheet: buckles at {factors} x the load (linear, perfect shape; real shells at a fifth to a half)"
        )
    if answers.vibration is not None:
        hertz = ", ".join(f"{value:.3g}" for value in answers.vibration.hertz)
        several = len(answers.vibration.hertz) > 1
        lines.append(f"uncut sheet: lowest {'frequencies' if several else 'frequency'} {hertz} Hz")
    return lines


def _stress_line(design: "Design", answers: "Answers") -> str:
    peak, strength = answers.stress.peak, design.preset.statics.strength
    where = ", ".join(f"{x:.3g}" for x in design.surface.centroids[peak.face] + 0.0)
    layer = {"top": "on the top", "middle": "in the middle", "bottom": "on the bottom"}[peak.layer]
    share = f", {peak.stress / strength:.0%} of the strength" if strength else ""
    return f"uncut sheet: largest stress {stress_label(peak.stress)} {layer} at ({where}) m{share}"
