"""The file `design.json`: all numbers of a design in SI units."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from dsfab import __version__
from dsfab.core.errors import DsfabError
from dsfab.core.messages import table, value_with_bound
from dsfab.design import acting_on, loads_on
from dsfab.design.design import Design
from dsfab.report.design.inspection import load_facts
from dsfab.statics import Equilibrium, resultant, support_reactions
from dsfab.study import ALTERNATIVE_WORDS, losing_line, sizing_result
from dsfab.study.carrying import carrying
from dsfab.study.verdict import BUDGET, LoadedSurface, ModeIntervals, mode_intervals, whole_sheet
from dsfab.study.verdict.estimates import quantile

if TYPE_CHECKING:
    from dsfab.results import Attempt, Candidate, CaseResult, Choice, StaticsResult
    from dsfab.study import Alternative
    from dsfab.surface import LoadCase


def answer_facts(design: Design, case: "CaseResult | StaticsResult") -> dict[str, Any]:
    """Return stress, strain energy and requested results of the uncut sheet under one load, in SI units.
    Stress and energy may be missing. A list of results is empty if dsfab could not compute them."""
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


def uncut_modes(design: Design) -> ModeIntervals:
    """Return the lowest buckling factors and frequency of the uncut sheet, with error intervals."""
    questions = design.preset.statics.analyses

    def intervals() -> ModeIntervals:
        return mode_intervals(LoadedSurface.from_design(design), whole_sheet(design.surface), questions, BUDGET)

    return design.cached_result("statics", "mode_intervals", intervals)


def mode_facts(design: Design) -> dict[str, Any]:
    """Return buckling factors and lowest frequency of the uncut sheet for `design.json`; {} if not requested."""
    if not design.preset.statics.analyses.modes:
        return {}
    intervals = uncut_modes(design)
    buckling = {name: {"factor": x.value, "bound": x.finite_bound} for name, x in intervals.buckling.items()}
    facts: dict[str, Any] = {"buckling": buckling, "triangles": [level.triangles for level in intervals.levels]}
    if intervals.hertz:
        facts["frequency"] = {"hertz": intervals.hertz.value, "bound": intervals.hertz.finite_bound}
    remarks = {"assumed": intervals.assumed, "refusals": list(intervals.refusals)}
    return {"mode_intervals": facts | {key: value for key, value in remarks.items() if value}}


def mode_lines(design: Design) -> list[str]:
    """Return a line with the uncut sheet's lowest buckling factor and frequency; [] if not requested."""
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


def equilibrium_facts(design: Design, load: "LoadCase", answer: Equilibrium) -> dict[str, Any]:
    """Return compliance, largest displacement, residuals, and sums of loads and reactions under one load.
    Compliance and displacement may be missing."""
    moved = {"compliance_J": answer.compliance, "largest_displacement_m": answer.largest_displacement}
    return {
        **(moved if answer.elements.is_reported else {}),
        "imbalance": answer.imbalance,
        "residual": answer.residual,
        **balance(design, load, answer),
    }


def case_facts(design: Design) -> dict[str, Any]:
    """Return the results of the uncut sheet for each load case and combination, by name."""
    facts_by_case = {}
    for name, case in design.statics.cases.items():
        factors = {} if case.factors is None else {"factors": dict(case.factors)}
        facts = equilibrium_facts(design, case.load, case.answers.equilibrium)
        facts_by_case[name] = {**factors, **facts, **answer_facts(design, case)}
    return facts_by_case


def cut_load_facts(design: Design) -> dict[str, Any]:
    """Return `load_N`: the sum of loads (N) on the cut sheet, by load case; {} if a load acts on no material."""
    loads = {name: case.load for name, case in design.statics.cases.items()}
    try:
        on_sheet = loads_on(design.surface, design.sheet, loads)
    except DsfabError:
        return {}
    return {"load_N": {name: load.force.sum(axis=0).tolist() for name, load in on_sheet.items()}}


def balance(design: Design, load: "LoadCase", answer: Equilibrium) -> dict[str, Any]:
    """Return the sums (N) of loads and reactions, their moments (N m) about the origin, and each support's reaction."""
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


def choice_lines(choice: "Choice | None", count: int = 8) -> list[str]:
    """Return a table of the `count` best candidates for modes and phases; [] without candidates."""
    if choice is None:
        return []
    rows = [_candidate_row(rank, candidate) for rank, candidate in enumerate(choice.candidates[:count], start=1)]
    lines = [table(("", "modes", "phases", "over uncut", "kept", "pieces"), rows)]
    rest = choice.candidates[count:]
    refused = [candidate for candidate in choice.candidates if candidate.refused]
    if rest:
        lines.append(
            f"and {len(rest)} more candidates; refused candidates: {len(refused)} (design.json has all candidates)"
        )
    return lines


def _candidate_row(rank: int, candidate: "Candidate") -> tuple[str, ...]:
    modes, phases = (", ".join(f"{x:g}" for x in pair) for pair in (candidate.mode, candidate.phase))
    if candidate.refused:
        return f"{rank}", modes, phases, "refused", "", candidate.refused
    return f"{rank}", modes, phases, f"{candidate.over_uncut:.3f}", f"{candidate.kept:.1%}", f"{candidate.pieces}"


def attempt_lines(attempts: "Sequence[Attempt]") -> list[str]:
    """Return a table of the tried methods and width rules, best first; [] without a search."""
    if not attempts:
        return []
    rows = [(f"{rank}", attempt.name, *_attempt_cells(attempt)) for rank, attempt in enumerate(attempts, start=1)]
    return [table(("", "method", "over uncut", "kept", "dead ends", "slits"), rows)]


def _attempt_cells(attempt: "Attempt") -> tuple[str, ...]:
    if attempt.refused:
        return "refused", "", "", attempt.refused
    return f"{attempt.over_uncut:.3f}", f"{attempt.kept:.1%}", f"{attempt.dead_ends}", f"{attempt.slits}"


def attempt_facts(attempts: "Sequence[Attempt]") -> dict[str, Any]:
    """Return `attempts` of `design.json`: the tried methods, best first."""
    return {} if not attempts else {"attempts": [_attempt_facts(attempt) for attempt in attempts]}


def _attempt_facts(attempt: "Attempt") -> dict[str, Any]:
    if attempt.refused:
        return {"method": attempt.name, "refused": attempt.refused}
    return {
        "method": attempt.name,
        "compliance_J": attempt.compliance,
        "compliance_over_uncut": attempt.over_uncut,
        "kept_share": attempt.kept,
        "dead_ends": attempt.dead_ends,
        "slits": attempt.slits,
    }


def alternative_facts(alternatives: "Sequence[Alternative]") -> dict[str, Any]:
    """Return `alternatives`: simple structures of equal mass; and `loses_to`: a sentence on stiffer alternatives."""
    records = [alternative.record() for alternative in alternatives]
    return {"loses_to": losing_line(alternatives), "alternatives": records}


def alternative_lines(facts: Mapping[str, Any]) -> list[str]:
    """Return a line for each alternative in `design.json`."""
    return [_alternative_line(alternative) for alternative in facts.get("alternatives", ())]


def _alternative_line(alternative: Mapping[str, Any]) -> str:
    subject = f"{ALTERNATIVE_WORDS[alternative['name']]} of the same mass"
    if alternative.get("error"):
        return f"the design was not compared with {subject}, because no structure of that kind carries the loads"
    over, level = alternative["over"], alternative["level"]
    if over is None:
        return f"compared with {subject}: the design does not carry its loads (level of the checks: {level})"
    return f"the design has {over:.3g} times the compliance of {subject} (level of the checks: {level})"


def choice_facts(choice: "Choice | None") -> dict[str, Any]:
    """Return `candidates` of `design.json`: tried modes and phases, best first."""
    return {} if choice is None else {"candidates": [_candidate_facts(candidate) for candidate in choice.candidates]}


def _candidate_facts(candidate: "Candidate") -> dict[str, Any]:
    choice = {"modes": candidate.mode, "phases": candidate.phase}
    if candidate.refused:
        return {**choice, "refused": candidate.refused}
    return {
        **choice,
        "compliance_J": candidate.compliance,
        "compliance_over_uncut": candidate.over_uncut,
        "kept_share": candidate.kept,
        "whole_share": candidate.whole,
        "pieces": candidate.pieces,
    }


def design_facts(
    design: Design, seconds: dict[str, float], files: list[str], refused: list[str], export_notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the content of `design.json`. seconds : run time of each stage.    files : names of written files.
    refused : reasons for missing files."""
    sheet, uncut = design.sheet.surface, design.surface
    return {
        "name": design.preset.name,
        "preset": design.resolved_preset.model_dump(mode="json", exclude_none=True),
        "surface": {"vertices": uncut.n, "triangles": uncut.m, "area_m2": uncut.area, "mean_edge_m": uncut.mean_edge},
        **({"file": asdict(design.file)} if design.file else {}),
        "carrying": carrying(design).facts(),
        **load_facts(design),
        "statics": {
            "of": "the uncut sheet",
            **equilibrium_facts(design, design.statics.load, design.statics.answers.equilibrium),
            **answer_facts(design, design.statics),
            **mode_facts(design),
            "cases": case_facts(design),
            "followed": design.preset.followed_weights,
        },
        "modes": {"major": design.diffusion.major.lam.tolist(), "minor": design.diffusion.minor.lam.tolist()},
        **attempt_facts(design.pattern.attempts),
        **choice_facts(design.pattern.choice),
        **({"sizing": sizing.facts()} if (sizing := sizing_result(design)) else {}),
        "sheet": {
            "vertices": sheet.n,
            "triangles": sheet.m,
            "area_m2": sheet.area,
            "kept_share": sheet.area / uncut.area,
            **cut_load_facts(design),
            "pinches": design.slicing.pinches,
            "pieces": [piece._asdict() for piece in design.slicing.pieces],
        },
        "solid": _solid_facts(design),
        "thickening": {"side": design.preset.thickening.side, **asdict(design.solid.repairs)},
        "files": files,
        "refused": refused,
        "warnings": [f"{note.stage}: {note.text}" for note in design.notes] + [f"export: {x}" for x in export_notes],
        "seconds": {row: round(value, 4) for row, value in seconds.items()},
        "versions": versions(),
    }


def _solid_facts(design: Design) -> dict[str, Any]:
    solid = design.solid
    return {
        "vertices": len(solid.V),
        "triangles": len(solid.F),
        "volume_m3": solid.volume,
        "mass_kg": design.mass,
        "genus": solid.genus,
        "pieces": solid.pieces,
        "box_m": (solid.V.min(axis=0).tolist(), solid.V.max(axis=0).tolist()),
    }


def versions() -> dict[str, str]:
    """Return the versions of dsfab, Python and libraries."""
    from dsfab.core.sparse import solver_name

    libraries = ("numpy", "scipy", "libigl", "manifold3d", "trimesh", "build123d", "pyvista", "vtk")
    library_versions = {name: version(name) for name in libraries}
    return {"dsfab": __version__, "python": platform.python_version(), "solver": solver_name(), **library_versions}
