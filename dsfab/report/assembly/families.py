"""Pages of families: every member in order, with its pieces and the nodes along it."""

from collections.abc import Callable

import numpy as np

from dsfab.members import Member
from dsfab.report.assembly.paper import HAIR, INK, PAGE, QUIET, RED, Paper
from dsfab.units import MM_PER_M
from dsfab.workshop import WorkshopPlan

ROW = 24.0
"""Millimetres of paper for a member."""
NAMES = 44.0
"""Millimetres for its name, to the left of its line."""
APART = 2.1
"""Millimetres between the names of two nodes, at least: of others the tick alone is drawn."""
SPLICED = (
    "Above each line the member that crosses there, below it millimetres along the middle surface from the beginning; "
    "red: splices. Bays of a layer are those of its drawing."
)
BARRED = (
    "Above each line the member that crosses there, below it millimetres along the curved axis from the beginning; "
    "red: the number of each bar, 3 for A07.3. Lengths of bars are those of their drawings."
)
HALVED = (
    "Above each line the member that crosses there, below it millimetres along the axis from the beginning; red: "
    "splices. Slots are open above where the other plank is put on, and below where this one is put on the other."
)
PANELS = (
    "Above each line the member that crosses there, below it millimetres from the beginning, of the model; red: where "
    "panels begin, at the edge of what goes through or at a splice."
)
FAMILIES = {"major": "Family A", "minor": "Family B", "rim": "Edges", "keep": "Around supports and loads"}
PER_PAGE = int(PAGE.high // ROW)


def family_pages(plan: WorkshopPlan) -> list[tuple[str, Callable[[Paper], None]]]:
    """Titles and what is drawn: the members of one family at one scale, in order."""
    assert plan.graph is not None
    found = []
    built = {part.member for part in plan.parts}
    for family in dict.fromkeys(member.family for member in plan.graph.members):
        members = [one for one in plan.graph.members if one.family == family and one.id in built]
        longest = max((member.length for member in members), default=0.0)
        for k in range(0, len(members), PER_PAGE):
            some = members[k : k + PER_PAGE]
            title = f"{FAMILIES.get(family, family.title())}: {some[0].id} to {some[-1].id}"
            found.append((title, _page(plan, some, (PAGE.wide - NAMES - 6) / max(longest, 1e-9))))
    return found


def _page(plan: WorkshopPlan, members: list[Member], scale: float) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        for k, member in enumerate(members):
            _row(paper, plan, member, PAGE.y + PAGE.high - (k + 1) * ROW, scale)
        paper.text(
            (PAGE.x, PAGE.y - 4),
            _said(plan),
            7,
            QUIET,
        )

    return draw


def _said(plan: WorkshopPlan) -> str:
    if plan.route == "panels":
        return PANELS
    return BARRED if plan.bars else HALVED if plan.planks else SPLICED


def _row(paper: Paper, plan: WorkshopPlan, member: Member, y: float, scale: float) -> None:
    """A member as a straight line with its nodes."""
    parts = [part for part in plan.parts if part.member == member.id]
    pieces = [part for part in parts if ".c" not in part.id]
    size = f"{MM_PER_M * member.length:,.0f} x {MM_PER_M * member.mean_width:.0f} mm" if member.axis else "plate"
    paper.text((PAGE.x, y + 13), member.id, 12, bold=True)
    paper.text((PAGE.x, y + 9), size, 7)
    covers = len(parts) - len(pieces)
    words = _count(len(pieces), "bar" if plan.bars else "piece") + (f", {_count(covers, 'cover')}" if covers else "")
    paper.text((PAGE.x, y + 5.5), words, 7, QUIET)
    if pieces and plan.layering:
        paper.text((PAGE.x, y + 2), f"layer at {MM_PER_M * pieces[0].layer:+.0f} mm", 7, QUIET)
    paper.lines([np.array([[PAGE.x, y - 0.5], [PAGE.x + PAGE.wide, y - 0.5]])], HAIR, 0.3)
    if member.axis is None:
        return
    left, middle = PAGE.x + NAMES, y + 11.0
    paper.lines([np.array([[left, middle], [left + scale * member.length, middle]])], INK, 1.6)
    _nodes(paper, plan, member, (left, middle), scale)
    for part in pieces:
        if plan.bars and scale * (part.span[1] - part.span[0]) > APART:
            paper.text(
                (left + scale * sum(part.span) / 2, middle + 1.2), part.id.rpartition(".")[2], 5.2, RED, "middle"
            )
        elif 0 < part.span[0] < member.length and not plan.bars:
            x = left + scale * part.span[0]
            paper.lines([np.array([[x, middle - 2.2], [x, middle + 2.2]])], RED, 1.2)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _nodes(paper: Paper, plan: WorkshopPlan, member: Member, at: tuple[float, float], scale: float) -> None:
    assert plan.graph is not None
    (left, middle), last = at, -np.inf
    for node in plan.graph.along[member.id]:
        k = node.members.index(member.id)
        x = left + scale * node.at[k]
        paper.lines([np.array([[x, middle - 1.4], [x, middle + 1.4]])], INK, 0.4)
        if x - last >= APART:
            paper.upright((x, middle + 2.4), node.members[1 - k], 5.2)
            paper.upright((x, middle - 10.2), f"{MM_PER_M * node.at[k]:,.0f}", 5.2, QUIET)
            last = x
