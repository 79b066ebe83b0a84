"""Pages of bars: how they meet on a plate, all of them as a table, and the order in which they go up."""

from collections.abc import Callable, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.pipeline import Design
from dsfab.report.assembly.flat_parts import Page, sheet_figures
from dsfab.report.assembly.paper import INK, PAGE, QUIET, Paper
from dsfab.report.assembly.sequence import AssemblyStep
from dsfab.units import MM_PER_M
from dsfab.wording import length
from dsfab.workshop import WorkshopPlan, bar_table

ROWS, COLUMNS = 58, 2
"""Bars on a page."""
STEPS = 12
"""Pictures of steps."""
BAR_RULE = (
    "Bars go up from the supports upwards, by the height of their middle. Each plate is bolted beneath the first of "
    "its bars on the ground, the arm with a bar's name to that bar. What nothing holds yet needs props until the bars "
    "beside it are there."
)
"""What `bar_steps` does, for those who build by it."""
BARS_UNCHECKED = (
    "the statics of bolts, plates and folds: the design was judged as one sheet, and bars on one plate each bend there",
    "the statics while it is being put up; props and scaffolding",
    "how far bars and plates can be twisted; the radius of folds, and what a sheet gains by folding",
    "moisture, grain and knots; edge and end distances of bolts after the material's standard",
    "bearings: what holds the structure at its supports",
)
"""What nobody looked at, for the last page."""


def bar_figures(plan: WorkshopPlan, design: Design) -> list[tuple[str, str]]:
    """What stands beside the structure on the cover."""
    assert plan.bars is not None
    assert plan.graph is not None
    statics, found, stock = design.preset.statics, plan.bars.found.bars, plan.bars.stock
    size = np.ptp(plan.graph.sheet.surface.V, axis=0)
    bars = [part for part in plan.parts if not part.thickness]
    plates = [part for part in plan.parts if part.thickness]
    different = {plan.parts[some[0]].id for some in plan.same}
    long = [bar.length for bar in found]
    return [
        ("Size over all", " x ".join(f"{x:.2f}" for x in size) + " m"),
        ("Bars", f"{len(found)} of {length(stock.bar)}, together {sum(long):,.0f} m"),
        ("Different bars", str(sum(part.id in different for part in bars))),
        ("Shortest and longest", f"{MM_PER_M * min(long):,.0f} and {MM_PER_M * max(long):,.0f} mm"),
        ("Plates", f"{len(plates)} of {length(stock.plate)}, {sum(part.id in different for part in plates)} different"),
        ("Bolts", f"{sum(len(part.holes) for part in bars)} of {length(stock.bolt)}"),
        *sheet_figures(plan),
        ("Mass of all bars", f"{sum(part.area for part in bars) * plan.thickness * statics.density:,.0f} kg"),
        ("Material of bars", statics.material or f"{statics.density:g} kg/m³, {statics.young / 1e9:g} GPa"),
    ]


def bar_pages(plan: WorkshopPlan) -> list[Page]:
    """All bars: their nodes, lengths and angles."""
    rows = bar_table(plan).rows
    per_page = ROWS * COLUMNS
    return [
        (f"Bars {some[0][0]} to {some[-1][0]}", _bar_page(some))
        for some in (rows[k : k + per_page] for k in range(0, len(rows), per_page))
    ]


HEADS = ("bar", "from", "to", "length", "along", "dip", "along", "dip", "twist", "bow")
PLACES = (0.0, 20.0, 46.0, 92.0, 107.0, 120.0, 136.0, 149.0, 164.0, 178.0)
SAID = (
    "Length: of the bar as it is cut, millimetres. At its first, then at its second node: along, degrees from the "
    "first arm of the plate, counter-clockwise from outside; dip, degrees below the plate. Twist: degrees from one end "
    "to the other, right-handed. Bow: millimetres to the curved axis."
)


def _bar_page(rows: Sequence[Sequence[str | int | float]]) -> Callable[[Paper], None]:
    def draw(paper: Paper) -> None:
        step = PAGE.high / (ROWS + 1)
        for k in range(0, len(rows), ROWS):
            x, top = PAGE.x + k // ROWS * PAGE.wide / COLUMNS, PAGE.y + PAGE.high - step
            for place, head in zip(PLACES, HEADS, strict=True):
                paper.text((x + place, top), head, 6.5, QUIET, "left" if place < 50 else "right")
            paper.lines([np.array([[x, top - 1], [x + PLACES[-1], top - 1]])], INK, 0.5)
            for row, one in enumerate(rows[k : k + ROWS], 1):
                _bar_row(paper, (x, top - row * step), one)
        for k, line in enumerate(paper.wrapped(SAID, PAGE.wide, 7)):
            paper.text((PAGE.x, PAGE.y - 4 - 2.8 * k), line, 7, QUIET)

    return draw


def _bar_row(paper: Paper, at: tuple[float, float], row: Sequence[str | int | float]) -> None:
    name, one, two, _, long, _, *angles, bow, _ = row
    paper.text(at, str(name), 6.5, bold=True)
    shown = [str(one), str(two), f"{long:,.1f}", *(f"{angle:z.1f}°" for angle in angles), f"{bow:.1f}"]
    for place, words in zip(PLACES[1:], shown, strict=True):
        paper.text((at[0] + place, at[1]), words, 6.5, side="left" if place < 50 else "right")


def bar_steps(plan: WorkshopPlan, up: Floats) -> tuple[AssemblyStep, ...]:
    """Bars by the height of their middle, as many in each step; `BAR_RULE` says so. Plates are there with the first."""
    assert plan.bars is not None
    found = plan.bars.found
    heights = np.array([float(bar.points.mean(axis=0) @ up) for bar in found.bars])
    order = heights.round(3).argsort(kind="stable").tolist()
    together = max(int(np.ceil(len(order) / STEPS)), 1)
    return tuple(
        AssemblyStep(0, tuple(found.bars[k].bay.id for k in order[first : first + together]))
        for first in range(0, len(order), together)
    )
