"""What was tried for modes and phases that are `auto`, as lines to read and as facts to store."""

from typing import TYPE_CHECKING, Any

from dsfab.app.report import table

if TYPE_CHECKING:
    from dsfab.design import Candidate, Choice

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
