"""Pages on a structure of bars."""

from collections.abc import Callable, Container, Sequence

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.core.units import MM_PER_M
from dsfab.design import Design
from dsfab.report.assembly.flat_parts import PartsPage, sheet_figures, table_pages
from dsfab.report.assembly.overview import STEP_PICTURES, AssemblyStep
from dsfab.report.assembly.paper import INK, PAGE, QUIET, RED, DrawingTransform, Paper, PaperBox, usual_scale
from dsfab.workshop import BAR_CLEARANCE, FlatPart, PlateArm, WorkshopPlan, bar_table, half_plane_clip, plate_arms

ROWS, COLUMNS = 58, 2  # Rows and columns of bars on a page.

BAR_RULE = (
    "Assemble the bars from the supports upwards, in the order of the heights of the middles of the bars. Before you "
    "lift the first bar of a plate, bolt the plate beneath this bar. Use the arm of the plate that has the bar's name. "
    "Prop every bar that nothing holds yet, until its neighbours are bolted."
)
"""Rule for the order of `bar_steps`, printed for the builders."""
BARS_UNCHECKED = (
    "whether bolts, plates and folds are strong enough: dsfab checked the design as one sheet, but joints with one "
    "plate can bend",
    "whether the unfinished structure stands at each stage, and which props and scaffolding it needs",
    "how far bars and plates can be twisted; the radius of folds, and how much longer a plate becomes by folding",
    "effects of moisture, grain and knots; required distances of bolts from edges and ends (see the material's "
    "standard)",
    "the bearings, which hold the structure at its supports",
)
"""Risks of bars that dsfab does not check, for the last page of the book."""


def bar_figures(plan: WorkshopPlan, design: Design) -> list[tuple[str, str]]:
    """Return names and values of the key figures of a structure of bars."""
    assert plan.bars is not None
    assert plan.graph is not None
    statics, bars_found, stock = design.preset.statics, plan.bars.bar_lattice.bars, plan.bars.stock
    size = np.ptp(plan.graph.sheet.surface.V, axis=0)
    bars = [part for part in plan.parts if not part.thickness]
    plates = [part for part in plan.parts if part.thickness]
    different = {plan.parts[group[0]].id for group in plan.equal_parts}
    lengths = [bar.length for bar in bars_found]
    return [
        ("Size over all", " x ".join(f"{x:.2f}" for x in size) + " m"),
        ("Bars", f"{len(bars_found)} of {length(stock.bar)}, together {sum(lengths):,.0f} m"),
        ("Different bars", str(sum(part.id in different for part in bars))),
        ("Shortest and longest", f"{MM_PER_M * min(lengths):,.0f} and {MM_PER_M * max(lengths):,.0f} mm"),
        ("Plates", f"{len(plates)} of {length(stock.plate)}, {sum(part.id in different for part in plates)} different"),
        ("Bolts", f"{sum(len(part.holes) for part in bars)} of {length(stock.bolt)}"),
        *sheet_figures(plan),
        ("Mass of all bars", f"{sum(part.area for part in bars) * plan.thickness * statics.density:,.0f} kg"),
        ("Material of bars", statics.material or f"{statics.density:g} kg/m³, {statics.young / 1e9:g} GPa"),
    ]


def bar_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return pages with a table of all bars: nodes, length and angles."""
    rows = [bar_row(row) for row in bar_table(plan).rows]
    return table_pages("Bars", rows, (ROWS, COLUMNS), BAR_TABLE_HEADS, BAR_TABLE_PLACES, BAR_TABLE_NOTE)


BAR_TABLE_HEADS = ("bar", "from", "to", "length", "along", "dip", "along", "dip", "twist", "bow")
BAR_TABLE_PLACES = (0.0, 20.0, 46.0, 92.0, 107.0, 120.0, 136.0, 149.0, 164.0, 178.0)
BAR_TABLE_NOTE = (
    "'Length' is the cut length of the bar in millimetres. At the first and the second node, 'along' is the bar's "
    "direction, in degrees from the plate's first arm, counter-clockwise as seen from outside; 'dip' is the bar's "
    "angle below the plate. 'Twist' is the rotation between both ends in degrees, right-handed. 'Bow' is the largest "
    "distance from the bar to the curved axis in millimetres."
)


def bar_row(row: Sequence[str | int | float]) -> list[str]:
    """Return a row of the table `bar_table`, with each value as text."""
    name, start_node, end_node, _, bar_length, _, *angles, bow, _ = row
    angle_words = [f"{angle:z.1f}°" for angle in angles]
    return [str(name), str(start_node), str(end_node), f"{bar_length:,.1f}", *angle_words, f"{bow:.1f}"]


def bar_steps(plan: WorkshopPlan, up: Floats) -> tuple[AssemblyStep, ...]:
    """Return steps of assembly, lowest bars first. up : (3,) unit vector."""
    assert plan.bars is not None
    net = plan.bars.bar_lattice
    heights = np.array([float(bar.points.mean(axis=0) @ up) for bar in net.bars])
    order = heights.round(3).argsort(kind="stable").tolist()
    per_step = max(int(np.ceil(len(order) / STEP_PICTURES)), 1)
    return tuple(
        AssemblyStep(0, tuple(net.bars[k].bay.id for k in order[start : start + per_step]))
        for start in range(0, len(order), per_step)
    )


SHOWN = 1.7  # Drawn length of a bar on the page of a joint, divided by the length of the plate's arm.


def joint_pages(plan: WorkshopPlan) -> list[PartsPage]:
    """Return pages with drawings of two joints."""
    assert plan.bars is not None
    joints = [joint for joint in plan.bars.bar_lattice.joints if joint.node.joined]
    pages = list[PartsPage]()
    for words, group in (
        ("How a node is put together", [joint for joint in joints if not joint.leg]),
        ("How a node is supported on the ground", [joint for joint in joints if joint.leg]),
    ):
        if group:
            name = max(group, key=lambda joint: len(joint.bars)).node.id
            pages.append((f"{words}: {name}", _joint_page(plan, name)))
    return pages


def _joint_page(plan: WorkshopPlan, name: str) -> Callable[[Paper], None]:
    assert plan.bars is not None
    joint = next(joint_of_node for joint_of_node in plan.bars.bar_lattice.joints if joint_of_node.node.id == name)
    arms = plate_arms(joint, plan.bars.bar_lattice, plan.bars.stock)
    parts = {part.id: part for part in plan.parts}
    ends_here = {plan.bars.bar_lattice.bars[k].bay.id: side == 1 for k, side in joint.bars}
    bars = [bar_on_plate(parts[arm.bar], arm, ends_here[arm.bar]) for arm in arms if arm.bar in ends_here]
    part = parts[name]
    plate, middle = part.outline, part.holes[0].at

    def draw(paper: Paper) -> None:
        room = PaperBox(PAGE.x, PAGE.y, 0.58 * PAGE.wide, PAGE.high - 8)
        points = np.concatenate([*bars, plate - middle])
        low, high = points.min(axis=0), points.max(axis=0)
        scale, scale_name = usual_scale(min(np.array([room.wide - 12, room.high - 12]) / (high - low)))
        fitted = DrawingTransform.fit_to_box(low, high, room, scale)
        title = f"The unfolded plate and its bars, seen from outside, {scale_name}"
        paper.text((PAGE.x, PAGE.y + PAGE.high - 4), title, 9)
        paper.polylines([fitted.to_paper(bar) for bar in bars], QUIET, 0.5, closed=True)
        paper.polylines([fitted.to_paper(plate - middle)], INK, 0.8, closed=True)
        paper.polylines([fitted.to_paper(fold.line - middle) for fold in part.folds], RED, 0.6)
        for hole in part.holes:
            paper.circles(fitted.to_paper(hole.at - middle)[None], hole.diameter * scale, INK)
        for arm in arms:
            beyond = 1.25 if arm.bar in ends_here else 1.15
            x, y = fitted.to_paper(arm.point(arm.root + beyond * (arm.end - arm.root), 0.0)).tolist()
            paper.text((x, y - 1), arm.bar, 9, side="middle", bold=True)
        right = PaperBox(PAGE.x + 0.62 * PAGE.wide, PAGE.y, 0.38 * PAGE.wide, PAGE.high)
        _arm_table(paper, right, arms)
        steepest = max(arms, key=lambda arm: abs(arm.dip))
        _side_view(paper, PaperBox(right.x, right.y + 20, right.wide, 120), plan, steepest, ends_here)

    return draw


def bar_on_plate(part: FlatPart, arm: PlateArm, from_end: bool) -> Floats:
    """Return the outline (k, 2) of a bar's end on a flat plate, m from the node. from_end : True for the second end."""
    hole = next(hole_here for hole_here in (reversed(part.holes) if from_end else part.holes))
    direction = part.axis[1] - part.axis[0]
    direction = direction / np.linalg.norm(direction) * (-1 if from_end else 1)
    offset = part.outline - hole.at
    along = offset @ direction + arm.holes[0]
    aside = offset @ np.array([-direction[1], direction[0]])
    reach = arm.root + SHOWN * (arm.end - arm.root)
    P = half_plane_clip(np.stack([along, aside], axis=1), np.array([1.0, 0.0]), reach)
    return np.array([arm.point(x, y) for x, y in P.tolist()])


def _arm_table(paper: Paper, box: PaperBox, arms: Sequence[PlateArm]) -> None:
    x, y = box.x, box.y + box.high - 4
    places = (0.0, 48.0, 72.0, 96.0, box.wide)
    heads = ("arm of bar", "along", "fold", "fold at", "holes at, mm")
    for place, head in zip(places, heads, strict=True):
        paper.text((x + place, y), head, 8, QUIET, "right" if place else "left")
    paper.polylines([np.array([[x, y - 2], [x + box.wide, y - 2]])], INK, 0.5)
    for arm in arms:
        y -= 6
        holes = ", ".join(f"{MM_PER_M * r:.1f}" for r in arm.holes)
        angles = (f"{round(float(np.degrees(angle)), 1) + 0.0:.1f}°" for angle in (arm.azimuth, arm.dip))
        turned = (*angles, f"{MM_PER_M * arm.fold:.1f}")
        paper.text((x, y), arm.bar, 8, bold=True)
        for place, words in zip(places[1:], (*turned, holes), strict=True):
            paper.text((x + place, y), words, 8, side="right")
    note = (
        "Lengths are millimetres from the middle of the hole at the node; directions are degrees from the first arm, "
        "counter-clockwise. Fold the plate at the lines FOLD, away from you where the angle is positive. The places "
        "of these lines assume a sharp fold of the plate's middle plane, so allow for the radius of your tool. The "
        "angle of each fold is engraved on the arm."
    )
    for k, line in enumerate(paper.wrapped_lines(note, box.wide, 7.5)):
        paper.text((x, y - 8 - 3.4 * k), line, 7.5, QUIET)


def _side_view(paper: Paper, box: PaperBox, plan: WorkshopPlan, arm: PlateArm, bars: Container[str]) -> None:
    assert plan.bars is not None
    stock = plan.bars.stock
    c, s = float(np.cos(arm.dip)), float(np.sin(arm.dip))
    d, m = np.array([c, -s]), np.array([s, c])
    fold = np.array([arm.fold, -stock.lever])

    def slab(begin: Floats, direction: Floats, up: Floats, long: float, low: float, high: float) -> Floats:
        ends = begin, begin + long * direction
        return np.array([ends[0] + low * up, ends[1] + low * up, ends[1] + high * up, ends[0] + high * up])

    t, half = stock.plate / 2, stock.bar / 2
    flat, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    middle = slab(np.array([-arm.fold / 2, -stock.lever]), flat, up, 1.5 * arm.fold, -t, t)
    leg = slab(fold, d, m, arm.end - arm.fold, -t, t)
    begin = arm.root - arm.fold + BAR_CLEARANCE * stock.bolt
    bar = slab(fold + stock.lever * m, d, m, SHOWN * (arm.end - arm.fold), -half, half) + begin * d
    turn = np.eye(2) if arm.bar in bars else np.stack([d, m], axis=1)
    shown = [line @ turn for line in ((middle, leg, bar) if arm.bar in bars else (middle, leg))]
    points = np.concatenate(shown)
    scale, scale_name = usual_scale(min(np.array([box.wide - 4, box.high - 16]) / np.ptp(points, axis=0)))
    fitted = DrawingTransform.fit_to_box(points.min(axis=0), points.max(axis=0), box, scale)
    words = f"Bar {arm.bar} on its arm" if arm.bar in bars else "The leg of a plate, which stands on the ground"
    paper.text((box.x, box.y + box.high + 2), f"{words}, from the side, {scale_name}", 9)
    paper.polylines([fitted.to_paper(line) for line in shown], INK, 0.7, closed=True)
    for r in arm.holes:
        place = fold + (r - arm.fold) * d
        if arm.bar not in bars:
            paper.polylines([fitted.to_paper(np.array([place - 4 * t * m, place + 4 * t * m]) @ turn)], RED, 0.6)
            continue
        ends = [place - 2 * t * m - 0.5 * stock.bolt * m, place + (2 * half + 2 * t) * m + 0.5 * stock.bolt * m]
        paper.polylines([fitted.to_paper(np.array(ends))], RED, 0.6)
    node = np.array([[0.0, -stock.lever - 6 * t], [0.0, half]]) @ turn
    paper.polylines([fitted.to_paper(node)], QUIET, 0.4)
    x, y = fitted.to_paper(node[1]).tolist()
    paper.text((x, y + 1.5), "node", 7.5, QUIET, "middle")
