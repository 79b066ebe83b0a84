"""What loads and supports add up to, for `design.json` and the lines that `dsfab build` prints."""

from typing import TYPE_CHECKING, Any

from dsfab.report.design.answers import answer_facts
from dsfab.wording import force, length

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design
    from dsfab.statics import Equilibrium
    from dsfab.surface import LoadCase

THRUST = 1.02
"""Reactions whose sizes add up to more than this many times the loads' are not upright alone, which is told."""


def equilibrium_facts(design: "Design", load: "LoadCase", answer: "Equilibrium") -> dict[str, Any]:
    """Compliance, largest displacement, residuals, and the sums of loads and reactions, of one equilibrium."""
    return {
        "compliance_J": answer.compliance,
        "largest_displacement_m": answer.largest_displacement,
        "imbalance": answer.imbalance,
        "residual": answer.residual,
        **balance(design, load, answer),
    }


def case_facts(design: "Design") -> dict[str, Any]:
    """The same of each case and combination, by name."""
    told = {}
    for name, case in design.statics.cases.items():
        factors = {} if case.factors is None else {"factors": dict(case.factors)}
        facts = equilibrium_facts(design, case.load, case.equilibrium)
        told[name] = {**factors, **facts, **answer_facts(design, case)}
    return told


def cut_load_facts(design: "Design") -> dict[str, Any]:
    """`load_N`: what acts on the cut sheet, by case and combination; nothing where it finds no material."""
    from dsfab.errors import DsfabError
    from dsfab.pipeline import loads_on

    loads = {name: case.load for name, case in design.statics.cases.items()}
    try:
        on_sheet = loads_on(design.surface, design.sheet, loads)
    except DsfabError:
        return {}
    return {"load_N": {name: load.force.sum(axis=0).tolist() for name, load in on_sheet.items()}}


def balance(design: "Design", load: "LoadCase", answer: "Equilibrium") -> dict[str, Any]:
    """Sums of loads and reactions, moments about the origin, in all and support by support."""
    from dsfab.pipeline import acting_on
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


def case_lines(design: "Design") -> list[str]:
    """How stiff the uncut sheet is and who carries what: two lines for one case, else a line for each."""
    cases = design.statics.cases
    if len(cases) == 1:
        (case,) = cases.values()
        return [f"uncut sheet: {_answered(case.equilibrium)}", _carried(design, case.load, case.equilibrium)]
    followed, rule = design.preset.followed, design.preset.surface.combinations
    governing = _governing(design) if rule else {}
    made = {one.name for one in design.preset.surface.standard_sums}
    lines = [
        f"uncut sheet, {name}{'*' if name in followed else ''}: {_answered(case.equilibrium)}; "
        f"{_carried(design, case.load, case.equilibrium)}"
        for name, case in cases.items()
        if name not in made or name in governing
    ]
    if rule:
        told = "; ".join(f"{what}: {name} = {formula}" for name, (what, formula) in governing.items())
        return [*lines, f"{len(made)} combinations after {rule}, the pattern follows those of ULS together; {told}"]
    return [*lines, f"* the pattern follows {'this' if len(followed) == 1 else 'these together'}"]


def _governing(design: "Design") -> dict[str, tuple[str, str]]:
    """The combinations in which stress and displacement are largest, of the limit states that they are judged in: by
    name, what is largest, and the sum in words."""
    cases, preset = design.statics.cases, design.preset
    formulas = {one.name: one.formula for one in preset.surface.sums}
    strained = max(preset.judged_in("ULS", cases), key=lambda name: cases[name].answers.stress.peak.stress)
    moved = max(preset.judged_in("SLS", cases), key=lambda name: cases[name].equilibrium.largest_displacement)
    named = {strained: "stress is largest in", moved: "displacement in"}
    return {name: (what, formulas.get(name, name)) for name, what in named.items()}


def _answered(answer: "Equilibrium") -> str:
    return f"compliance {answer.compliance:.4g} J, moves {length(answer.largest_displacement)} at most"


def _carried(design: "Design", load: "LoadCase", answer: "Equilibrium") -> str:
    sums = balance(design, load, answer)

    def told(vector: list[float]) -> str:
        return force(_size(vector))

    parts = ", ".join(told(part["reaction_N"]) for part in sums["supports"])
    apart = sum(_size(part["reaction_N"]) for part in sums["supports"])
    thrust = ", their thrust included" if apart > THRUST * _size(sums["load_N"]) else ""
    return f"loads sum to {told(sums['load_N'])}; supports carry {parts}{thrust}"


def _size(vector: list[float]) -> float:
    return float(sum(x * x for x in vector) ** 0.5)
