"""Order of assembly, and the pages that show its steps."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.members import Member, MemberGraph
from dsfab.report.assembly.axonometry import Axonometry, MemberFaces
from dsfab.report.assembly.overview import draw_structure
from dsfab.report.assembly.paper import PAGE, QUIET, Paper, PaperBox
from dsfab.workshop import Layering, WorkshopPlan, is_strip, layer_numbers

STEP_PICTURES = 12  # Approximate number of steps, each with a picture.

LAYER_RULE = (
    "The lower layer goes up before the one above it: at every node the upper member is bolted on the lower one. "
    "Within a layer members go up from the supports upwards: by the height of their lowest point, those of one height "
    "in the order of their names. Members that nothing holds yet need props until the next layer is bolted on."
)
"""Order of assembly of `assembly_steps`, for the builders."""


@dataclass(frozen=True)
class AssemblyStep:
    """A step of assembly: names of its members, and the number of layers above these members."""

    layer: int
    members: tuple[str, ...]


def assembly_steps(graph: MemberGraph, layering: Layering, up: Floats) -> tuple[AssemblyStep, ...]:
    """Return the steps in the order of `LAYER_RULE`; a member appears once for each layer. up : (3,) unit vector."""
    return _ordered_steps(graph, up, partial(layer_numbers, layering))


PLANK_RULE = (
    "Planks with slots from above stand first, propped: {first}. Then those that are put on them: {then}, each piece "
    "along the middle of the normals at its slots. Within a family members go up by the height of their lowest point, "
    "those of one height in the order of their names. Splices are closed when both pieces sit."
)
"""Order of assembly of `plank_steps`, for the builders."""
FAMILY_WORDS = {"major": "family A", "minor": "family B", "rim": "edges", "keep": "those around supports and loads"}


def plank_rule(plan: WorkshopPlan) -> str:
    """Return `PLANK_RULE` with the names of the plan's families."""
    assert plan.graph is not None
    assert plan.planks is not None
    families = {member.family for member in plan.graph.members if is_strip(member)}
    first_family, *next_families = [FAMILY_WORDS[family] for family in plan.planks.planks.order if family in families]
    return PLANK_RULE.format(first=first_family, then=", then ".join(next_families))


def plank_steps(plan: WorkshopPlan, up: Floats) -> tuple[AssemblyStep, ...]:
    """Return the steps of a plan of planks: lower families come first, plates last. up : (3,) unit vector."""
    assert plan.graph is not None
    assert plan.planks is not None
    built, order = {part.member for part in plan.parts}, plan.planks.planks.order

    def numbers(member: Member) -> tuple[int, ...]:
        if member.id not in built:
            return ()
        return (len(order) - 1 - order.index(member.family) if is_strip(member) else -1,)

    return _ordered_steps(plan.graph, up, numbers)


def _ordered_steps(
    graph: MemberGraph, up: Floats, numbers: Callable[[Member], tuple[int, ...]]
) -> tuple[AssemblyStep, ...]:
    surface = graph.sheet.surface
    z = surface.V @ up
    heights = {member.id: float(z[surface.F[member.cells]].min()) for member in graph.members}
    span = max(max(heights.values()) - min(heights.values()), 1e-9)
    level = 0.02  # members within this share of the height are sorted by name
    entries = [
        (number, round(heights[member.id] / span / level), k, member.id)
        for k, member in enumerate(graph.members)
        for number in numbers(member)
    ]
    entries.sort(key=lambda entry: (-entry[0], *entry[1:]))
    per_step = max(int(np.ceil(len(entries) / STEP_PICTURES)), 1)
    steps = []
    for number, group in groupby(entries, key=lambda entry: entry[0]):
        names = [name for *_, name in group]
        steps += [AssemblyStep(number, tuple(names[k : k + per_step])) for k in range(0, len(names), per_step)]
    return tuple(steps)


ACROSS, DOWN = 3, 2  # Columns and rows of steps on a page.
STANDING_COLOUR = (0.82, 0.81, 0.79)  # Colour of members that earlier steps have assembled.


def step_pages(
    steps: tuple[AssemblyStep, ...], faces: list[MemberFaces], up: Floats, rule: str
) -> list[tuple[str, Callable[[Paper], None]]]:
    """Return pages with the rule and a picture of each step: new members in colour, earlier members in grey."""
    pages, per_page = [], ACROSS * DOWN
    for k in range(0, len(steps), per_page):
        title = f"Assembly: steps {k + 1} to {min(k + per_page, len(steps))} of {len(steps)}"
        pages.append((title, _steps_page(steps, k, faces, (up, rule))))
    return pages


def _steps_page(
    steps: tuple[AssemblyStep, ...], first_step: int, faces: list[MemberFaces], view_and_rule: tuple[Floats, str]
) -> Callable[[Paper], None]:
    up, rule = view_and_rule
    view = Axonometry.from_angles(up)
    extent = np.concatenate([view.projected(face.quads).reshape(-1, 2) for face in faces])

    def draw(paper: Paper) -> None:
        top = PAGE.y + PAGE.high
        for k, line in enumerate(paper.wrapped_lines(rule, PAGE.wide, 8)):
            paper.text((PAGE.x, top - 3 - 3.8 * k), line, 8, QUIET)
        room = PaperBox(PAGE.x, PAGE.y, PAGE.wide, PAGE.high - 13)
        step_numbers = range(first_step, min(first_step + ACROSS * DOWN, len(steps)))
        for k, cell in zip(step_numbers, room.cells(ACROSS, DOWN, 8.0), strict=False):
            _draw_step(paper, steps, k, faces, cell, (view, extent))

    return draw


def _draw_step(
    paper: Paper,
    steps: tuple[AssemblyStep, ...],
    k: int,
    faces: list[MemberFaces],
    cell: PaperBox,
    view_and_extent: tuple[Axonometry, Floats],
) -> None:
    (view, extent), count = view_and_extent, 3  # a picture has three lines of names
    added = set(steps[k].members)
    standing = {name for step in steps[:k] for name in step.members} - added
    visible = [face for face in faces if face.id in added or face.id in standing]
    foot = 5.0 + 3.4 * count
    picture = PaperBox(cell.x, cell.y + foot, cell.wide, cell.high - foot)
    draw_structure(paper, visible, view, picture, dict.fromkeys(standing, STANDING_COLOUR), extent)
    paper.text((cell.x, cell.y + foot - 3), f"{k + 1}", 12, bold=True)
    lines = paper.wrapped_lines(", ".join(steps[k].members), cell.wide - 10, 8)
    if len(lines) > count:
        lines = [*lines[: count - 1], f"... to {steps[k].members[-1]}"]
    for row, line in enumerate(lines):
        paper.text((cell.x + 8, cell.y + foot - 3 - 3.4 * row), line, 8)
