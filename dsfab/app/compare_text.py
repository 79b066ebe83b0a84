"""What `dsfab compare` prints."""

from typing import TYPE_CHECKING

from dsfab.report.compliance.words import percent, within
from dsfab.study import losing_line
from dsfab.wording import bounded, length, mass, sentence, table

if TYPE_CHECKING:
    from dsfab.study import Comparison
    from dsfab.study.competitors import Competitor

HEAD = (
    "structure",
    "variant",
    "mass",
    "kept",
    "compliance",
    "level",
    "over full",
    "over design",
    "moves",
    "pieces",
    "s",
)


def comparison_text(share: float | None, result: "Comparison") -> str:
    """A table of those that carry the loads, then what is to be said in words."""
    lost = losing_line(result.alternatives)
    lines = [sentence(lost)] if lost else []
    lines += [] if share is None else [f"{share:.0%} of the material"]
    lines.append(table(HEAD, (_cells(one, result) for one in result.competitors if one.judgement)))
    for one in result.competitors:
        if one.error:
            lines.append(f"{one.name} does not carry the loads: {one.error}")
        elif one.spread:
            lines.append(_spread(one, result))
    lines += _theory(result)
    lines += [line for one in result.competitors for line in _modes(one)]
    for one in result.rivals:
        gain = result.gain(one.name)
        if one.judgement and result.design.judgement:
            best = "best " if one.spread else ""
            lines.append(f"the design is {gain:.3g} x as stiff as the {best}{one.name} structure of the same mass")
    return "\n".join(lines)


def _theory(result: "Comparison") -> list[str]:
    """By what solids may be softer, of those that were solved on finer and finer meshes."""
    judged = {one.name: one.judgement.theory for one in result.competitors if one.judgement}
    known = [f"{name} by up to {percent(theory)}" for name, theory in judged.items() if theory]
    return [f"thin-shell theory: solids are softer, {', '.join(known)}"] if known else []


def _modes(one: "Competitor") -> list[str]:
    """The lowest factor of buckling and the lowest frequency of one that was asked for them."""
    cases = list(one.judgement.cases.values()) if one.judgement else []
    pressed = [case for case in cases if case.buckling is not None]
    told = []
    if pressed:
        least = min(pressed, key=lambda case: case.buckling or 0.0)
        told.append(f"buckles at {bounded(least.buckling or 0.0, least.buckling_bound)} x the load")
    if swinging := [case for case in cases if case.frequency is not None]:
        told.append(f"swings at {bounded(swinging[0].frequency or 0.0, swinging[0].frequency_bound, 'Hz')}")
    assumed = next((f" ({case.assumed})" for case in cases if case.assumed), "")
    refused = list(dict.fromkeys(text for case in cases for text in case.refusals))
    return [f"{one.name} {' and '.join(told)}{assumed}"] * bool(told) + [f"{one.name}: {text}" for text in refused]


def _cells(one: "Competitor", result: "Comparison") -> tuple[str, ...]:
    gain = result.gain(one.name)
    moved = one.judgement.worst("displacement").value if one.judgement else float("nan")
    return (
        one.name,
        one.variant,
        mass(one.mass),
        f"{one.area_fraction:.1%}",
        within(one.compliance, one.judgement.bound if one.judgement else None, "J"),
        one.judgement.level if one.judgement else "",
        f"{one.compliance / result.full.compliance:.2f}",
        f"{gain:.2f}" if result.design.judgement else "-",
        length(moved),
        str(one.pieces),
        f"{one.seconds:.1f}",
    )


def _spread(one: "Competitor", result: "Comparison") -> str:
    spread, full = one.spread, result.full.compliance
    assert spread is not None
    return (
        f"{one.name}: {spread.carried} of {spread.tried} variants carry the loads, from {spread.best / full:.3g} to "
        f"{spread.worst / full:.3g} x the full sheet, {spread.mean / full:.3g} x in the mean"
    )
