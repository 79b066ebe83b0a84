"""The page of a node: its plate before it is folded, the bars on it, and one of them from the side."""

from collections.abc import Callable, Container, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.report.assembly.flat_parts import Page
from dsfab.report.assembly.paper import INK, PAGE, QUIET, RED, Fitted, Paper, PaperBox, usual_scale
from dsfab.units import MM_PER_M
from dsfab.workshop import CLEAR, FlatPart, PlateArm, WorkshopPlan, half_plane_clip, plate_arms

SHOWN = 1.7
"""Of the length of an arm beyond the root, so much of each bar is shown."""


def joint_pages(plan: WorkshopPlan) -> list[Page]:
    """One node in full: the plate with most arms, its bars as they lie on it, and a bar seen from the side; and one
    with a leg, if there are any."""
    assert plan.bars is not None
    joints = [joint for joint in plan.bars.found.joints if joint.node.joined]
    pages = list[Page]()
    for words, some in (
        ("How a node is put together", [joint for joint in joints if not joint.leg]),
        ("How a node stands on the ground", [joint for joint in joints if joint.leg]),
    ):
        if some:
            name = max(some, key=lambda joint: len(joint.bars)).node.id
            pages.append((f"{words}: {name}", _joint_page(plan, name)))
    return pages


def _joint_page(plan: WorkshopPlan, name: str) -> Callable[[Paper], None]:
    assert plan.bars is not None
    joint = next(one for one in plan.bars.found.joints if one.node.id == name)
    arms = plate_arms(joint, plan.bars.found, plan.bars.stock)
    parts = {part.id: part for part in plan.parts}
    last = {plan.bars.found.bars[k].bay.id: side == 1 for k, side in joint.bars}
    bars = [bar_on_plate(parts[arm.bar], arm, last[arm.bar]) for arm in arms if arm.bar in last]
    part = parts[name]
    plate, middle = part.outline, part.holes[0].at

    def draw(paper: Paper) -> None:
        room = PaperBox(PAGE.x, PAGE.y, 0.58 * PAGE.wide, PAGE.high - 8)
        every = np.concatenate([*bars, plate - middle])
        low, high = every.min(axis=0), every.max(axis=0)
        scale, said = usual_scale(min(np.array([room.wide - 12, room.high - 12]) / (high - low)))
        fitted = Fitted.into(low, high, room, scale)
        paper.text(
            (PAGE.x, PAGE.y + PAGE.high - 4), f"The plate before it is folded, and its bars, from outside, {said}", 9
        )
        paper.lines([fitted.of(bar) for bar in bars], QUIET, 0.5, closed=True)
        paper.lines([fitted.of(plate - middle)], INK, 0.8, closed=True)
        paper.lines([fitted.of(fold.line - middle) for fold in part.folds], RED, 0.6)
        for hole in part.holes:
            paper.circles(fitted.of(hole.at - middle)[None], hole.diameter * scale, INK)
        for arm in arms:
            beyond = 1.25 if arm.bar in last else 1.15
            x, y = fitted.of(arm.at(arm.root + beyond * (arm.end - arm.root), 0.0)).tolist()
            paper.text((x, y - 1), arm.bar, 9, side="middle", bold=True)
        right = PaperBox(PAGE.x + 0.62 * PAGE.wide, PAGE.y, 0.38 * PAGE.wide, PAGE.high)
        _arm_table(paper, right, arms)
        _side_view(paper, PaperBox(right.x, right.y + 20, right.wide, 120), plan, max(arms, key=_folded), last)

    return draw


def _folded(arm: PlateArm) -> float:
    return abs(arm.dip)


def bar_on_plate(part: FlatPart, arm: PlateArm, last: bool) -> Floats:
    """(k, 2) the end of a bar, its last or its first one, as it lies on a plate that is not folded yet; metres from the
    node."""
    hole = next(one for one in (reversed(part.holes) if last else part.holes))
    way = part.axis[1] - part.axis[0]
    way = way / np.linalg.norm(way) * (-1 if last else 1)
    off = part.outline - hole.at
    along = off @ way + arm.holes[0]
    aside = off @ np.array([-way[1], way[0]])
    reach = arm.root + SHOWN * (arm.end - arm.root)
    P = half_plane_clip(np.stack([along, aside], axis=1), np.array([1.0, 0.0]), reach)
    return np.array([arm.at(x, y) for x, y in P.tolist()])


def _arm_table(paper: Paper, box: PaperBox, arms: Sequence[PlateArm]) -> None:
    """Of each arm where it points to, where it is folded, and its holes."""
    x, y = box.x, box.y + box.high - 4
    places = (0.0, 48.0, 72.0, 96.0, box.wide)
    heads = ("arm of bar", "along", "fold", "fold at", "holes at, mm")
    for place, head in zip(places, heads, strict=True):
        paper.text((x + place, y), head, 8, QUIET, "right" if place else "left")
    paper.lines([np.array([[x, y - 2], [x + box.wide, y - 2]])], INK, 0.5)
    for arm in arms:
        y -= 6
        holes = ", ".join(f"{MM_PER_M * r:.1f}" for r in arm.holes)
        angles = (f"{round(float(np.degrees(angle)), 1) + 0.0:.1f}°" for angle in (arm.azimuth, arm.dip))
        turned = (*angles, f"{MM_PER_M * arm.fold:.1f}")
        paper.text((x, y), arm.bar, 8, bold=True)
        for place, words in zip(places[1:], (*turned, holes), strict=True):
            paper.text((x + place, y), words, 8, side="right")
    said = (
        "Millimetres from the middle of the hole at the node; degrees from the first arm, counter-clockwise. Folds go "
        "away from who sees the drawing where they are positive, at the lines FOLD: there the middles of the sheet "
        "meet, so take off what your own tool's radius takes. The engraved number on each arm is its fold."
    )
    for k, line in enumerate(paper.wrapped(said, box.wide, 7.5)):
        paper.text((x, y - 8 - 3.4 * k), line, 7.5, QUIET)


def _side_view(paper: Paper, box: PaperBox, plan: WorkshopPlan, arm: PlateArm, bars: Container[str]) -> None:
    """The arm of a plate from the side, to scale: the plate's middle, its fold, the bar and its bolts. A leg has no
    bar, and is drawn level, as it lies on the ground."""
    assert plan.bars is not None
    stock = plan.bars.stock
    c, s = float(np.cos(arm.dip)), float(np.sin(arm.dip))
    d, m = np.array([c, -s]), np.array([s, c])
    fold = np.array([arm.fold, -stock.lever])

    def slab(begin: Floats, way: Floats, up: Floats, long: float, low: float, high: float) -> Floats:
        ends = begin, begin + long * way
        return np.array([ends[0] + low * up, ends[1] + low * up, ends[1] + high * up, ends[0] + high * up])

    t, half = stock.plate / 2, stock.bar / 2
    flat, up = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    middle = slab(np.array([-arm.fold / 2, -stock.lever]), flat, up, 1.5 * arm.fold, -t, t)
    leg = slab(fold, d, m, arm.end - arm.fold, -t, t)
    begin = arm.root - arm.fold + CLEAR * stock.bolt
    bar = slab(fold + stock.lever * m, d, m, SHOWN * (arm.end - arm.fold), -half, half) + begin * d
    turn = np.eye(2) if arm.bar in bars else np.stack([d, m], axis=1)
    shown = [one @ turn for one in ((middle, leg, bar) if arm.bar in bars else (middle, leg))]
    every = np.concatenate(shown)
    scale, said = usual_scale(min(np.array([box.wide - 4, box.high - 16]) / np.ptp(every, axis=0)))
    fitted = Fitted.into(every.min(axis=0), every.max(axis=0), box, scale)
    words = f"Bar {arm.bar} on its arm" if arm.bar in bars else "The leg on the ground"
    paper.text((box.x, box.y + box.high + 2), f"{words}, from the side, {said}", 9)
    paper.lines([fitted.of(one) for one in shown], INK, 0.7, closed=True)
    for r in arm.holes:
        place = fold + (r - arm.fold) * d
        if arm.bar not in bars:
            paper.lines([fitted.of(np.array([place - 4 * t * m, place + 4 * t * m]) @ turn)], RED, 0.6)
            continue
        ends = np.array(
            [place - 2 * t * m - 0.5 * stock.bolt * m, place + (2 * half + 2 * t) * m + 0.5 * stock.bolt * m]
        )
        paper.lines([fitted.of(ends)], RED, 0.6)
    node = np.array([[0.0, -stock.lever - 6 * t], [0.0, half]]) @ turn
    paper.lines([fitted.of(node)], QUIET, 0.4)
    x, y = fitted.of(node[1]).tolist()
    paper.text((x, y + 1.5), "node", 7.5, QUIET, "middle")
