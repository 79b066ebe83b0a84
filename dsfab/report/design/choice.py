"""What was tried for a method, modes and phases that are `auto`, as lines to read and as facts to store."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dsfab.study import ALTERNATIVE_WORDS, losing_line
from dsfab.wording import table

if TYPE_CHECKING:
    from dsfab.results import Attempt, Candidate, Choice
    from dsfab.study import Alternative

SHOWN = 8
"""Lines of the table that a build prints; `design.json` has them all."""


def choice_lines(choice: "Choice | None") -> list[str]:
    """A table of the best candidates, best first; empty where nothing was chosen."""
    if choice is None:
        return []
    rows = [_row(rank, candidate) for rank, candidate in enumerate(choice.candidates[:SHOWN], start=1)]
    lines = [table(("", "modes", "phases", "over uncut", "kept", "pieces"), rows)]
    rest = choice.candidates[SHOWN:]
    refused = [candidate for candidate in choice.candidates if candidate.refused]
    if rest:
        lines.append(f"and {len(rest)} more, {len(refused)} of all refused (design.json has them)")
    return lines


def _row(rank: int, candidate: "Candidate") -> tuple[str, ...]:
    modes, phases = (", ".join(f"{x:g}" for x in pair) for pair in (candidate.mode, candidate.phase))
    if candidate.refused:
        return f"{rank}", modes, phases, "refused", "", candidate.refused
    return f"{rank}", modes, phases, f"{candidate.over_uncut:.3f}", f"{candidate.kept:.1%}", f"{candidate.pieces}"


def attempt_lines(attempts: "Sequence[Attempt]") -> list[str]:
    """A table of methods and width rules, best first; empty where none were tried."""
    if not attempts:
        return []
    rows = [(f"{rank}", one.name, *_figures(one)) for rank, one in enumerate(attempts, start=1)]
    return [table(("", "method", "over uncut", "kept", "dead ends", "slits"), rows)]


def _figures(one: "Attempt") -> tuple[str, ...]:
    if one.refused:
        return "refused", "", "", one.refused
    return f"{one.over_uncut:.3f}", f"{one.kept:.1%}", f"{one.dead_ends}", f"{one.slits}"


def attempt_facts(attempts: "Sequence[Attempt]") -> dict[str, Any]:
    """`attempts` of `design.json`, best first; numbers that a refused one does not have are left out."""
    if not attempts:
        return {}
    return {"attempts": [_attempt_facts(one) for one in attempts]}


def _attempt_facts(one: "Attempt") -> dict[str, Any]:
    if one.refused:
        return {"method": one.name, "refused": one.refused}
    return {
        "method": one.name,
        "compliance_J": one.compliance,
        "compliance_over_uncut": one.over_uncut,
        "kept_share": one.kept,
        "dead_ends": one.dead_ends,
        "slits": one.slits,
    }


def alternative_facts(found: "Sequence[Alternative]") -> dict[str, Any]:
    """`loses_to` of `design.json`, a sentence or '', and `alternatives`, the numbers behind it."""
    return {"loses_to": losing_line(found), "alternatives": [one.record() for one in found]}


def alternative_lines(facts: Mapping[str, Any]) -> list[str]:
    """A line for each alternative that was judged, from what `design.json` says."""
    return [_beside(one) for one in facts.get("alternatives", ())]


def _beside(one: Mapping[str, Any]) -> str:
    which = f"{ALTERNATIVE_WORDS[one['name']]} of the same mass"
    if one.get("error"):
        return f"beside {which}: there is none that carries the loads"
    told = "does not carry its loads" if one["over"] is None else f"has {one['over']:.3g} x its compliance"
    return f"beside {which}: the design {told} ({one['level']})"


def choice_facts(choice: "Choice | None") -> dict[str, Any]:
    """`candidates` of `design.json`, best first; numbers that a refused one does not have are left out."""
    if choice is None:
        return {}
    return {"candidates": [_facts(candidate) for candidate in choice.candidates]}


def _facts(candidate: "Candidate") -> dict[str, Any]:
    given = {"modes": candidate.mode, "phases": candidate.phase}
    if candidate.refused:
        return {**given, "refused": candidate.refused}
    return {
        **given,
        "compliance_J": candidate.compliance,
        "compliance_over_uncut": candidate.over_uncut,
        "kept_share": candidate.kept,
        "whole_share": candidate.whole,
        "pieces": candidate.pieces,
    }
