"""The verdict on a design, in words."""

from collections.abc import Iterator, Mapping, Sequence
from math import hypot
from typing import TYPE_CHECKING, Any

from dsfab.core.messages import length, load_factor, mass, point_words, table

if TYPE_CHECKING:
    from dsfab.study.carrying import Carrying

USUAL_SPAN_SHARE = 300  # a movement > 1/300 of the span is reported [EN 1990, annex A1.4: by agreement, usually 300]
SHOWN_SUPPORTS = 6  # number of supports in a short table of reactions
LEVEL = 1e-3  # a horizontal force below this share of the reaction is a rounding error
OPPOSED = 0.1
"""Horizontal forces at a support count as opposite if resultant / sum of magnitudes is below OPPOSED."""


def verdict_line(name: str, carrying: "Carrying") -> str:
    """Return a line of text that says if the design `name` carries its loads, with reasons."""
    if carrying.outcome == "not judged":
        return f"{name} is not judged: {'; '.join(carrying.remarks)}"
    if carrying.faults:
        return f"{name} DOES NOT CARRY its loads: {'; '.join(carrying.faults)}"
    return f"{name} carries its loads"


def cure_line(carrying: "Carrying", is_sized: bool = False) -> str:
    """Return advice for a design that does not carry its loads; else ''.
    is_sized : True if dsfab has already tried every thickness in stock."""
    if not carrying.faults:
        return ""
    if is_sized:
        return "no thickness of the available sheets suffices: add supports (--stand) or height, or reduce loads"
    return (
        f"make the sheet thicker (--set statics.thickness={1.25 * carrying.thickness:.2g}), keep more material "
        "(--set pattern.width.solid_fraction=...), or change the supports"
    )


def figure_lines(carrying: "Carrying") -> Iterator[str]:
    """Yield a line of text for each key figure: utilisation, movement, buckling, mass."""
    use, moved = carrying.use, carrying.movement
    several = len({row.case for row in carrying.reactions}) > 1
    if use:
        under = f", {use.case}" if several else ""
        yield f"  most used   {use.member} at {point_words(use.place)}: {use.value:.0%} ({use.check}){under}"
    if moved:
        under = f", {moved.case}" if several else ""
        share = f"1/{1 / moved.share:.0f}" if moved.share > 0 else "0"
        words = f"{length(moved.value)} at {point_words(moved.place)}, {share} of the span {length(moved.span)}"
        yield f"  movement    {words} ({moved.about}){under}"
    if carrying.buckling is not None:
        under = f", {carrying.buckling_case}" if several else ""
        yield f"  buckling    at {load_factor(carrying.buckling)} times the load{under}, without imperfections"
    yield f"  mass        {mass(carrying.mass)}, {length(carrying.thickness)} thick"


def carrying_notes(carrying: "Carrying") -> Iterator[str]:
    """Yield notes on a large movement, and remarks on the results."""
    moved = carrying.movement
    if moved and moved.share > 1 / USUAL_SPAN_SHARE:
        yield f"the largest displacement is 1/{1 / moved.share:.0f} of the span; usual limit: 1/{USUAL_SPAN_SHARE}"
    if carrying.outcome != "not judged":
        yield from carrying.remarks


def reaction_lines(reactions: Sequence[Mapping[str, Any]], every: bool = False) -> list[str]:
    """Return a table of the reactions (kN), from `carrying.reactions` of `design.json`.
    every : True for all supports in all cases."""
    rows, several = list(reactions), len({row["case"] for row in reactions}) > 1
    if not every:
        largest: dict[str, Mapping[str, Any]] = {}
        for row in rows:
            if _size(row) >= _size(largest.get(row["support"], row)):
                largest[row["support"]] = row
        rows = list(largest.values())
    rest = max(0, len(rows) - SHOWN_SUPPORTS) if not every else 0
    if rest:
        rows = sorted(rows, key=_size, reverse=True)[:SHOWN_SUPPORTS]
    if not rows:
        return []
    head = ("support pushes", *(("case",) if several else ()), "V up, kN", "H, kN", "H towards")
    lines = table(head, [_reaction_row(row, several) for row in rows]).split("\n")
    return [*lines, f"and {rest} more supports: see design.json"] if rest else lines


def _reaction_row(row: Mapping[str, Any], several: bool) -> tuple[str, ...]:
    size, thrust = row["horizontal"], row["thrust"]
    words = _kilonewtons(size), f"{row['direction']:.0f} deg"
    if thrust <= LEVEL * _size(row):
        words = "0", "-"
    elif size < OPPOSED * thrust:
        words = _kilonewtons(thrust), "opposite ways"
    return row["support"], *((row["case"],) if several else ()), _kilonewtons(row["vertical"]), *words


def _kilonewtons(newtons: float) -> str:
    return f"{newtons / 1e3:.3g}" if abs(newtons) < 999.5e3 else f"{newtons / 1e3:.0f}"


def _size(row: Mapping[str, Any]) -> float:
    return hypot(row["vertical"], row["thrust"])
