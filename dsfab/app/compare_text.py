"""What `dsfab compare` prints."""

from typing import TYPE_CHECKING

from dsfab.report.compliance.words import within
from dsfab.study.alternatives import losing_line
from dsfab.wording import length, mass, sentence, table

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
    for one in result.rivals:
        gain = result.gain(one.name)
        if one.judgement and result.design.judgement:
            best = "best " if one.spread else ""
            lines.append(f"the design is {gain:.3g} x as stiff as the {best}{one.name} structure of the same mass")
    return "\n".join(lines)


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
