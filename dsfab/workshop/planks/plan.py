"""The parts of a structure of planks, rolled out along the normals of the surface.

A plank is P(s) + y N(s), a ruled surface with normal -B on the axis. Rolled out it bends by kn in its plane; built it
is
bent by kg across it and twisted by tg, which makes its edges longer than drawn by tg^2 h^2 / 8.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length, some_names, stopping
from dsfab.members import MemberGraph
from dsfab.workshop.development import StripCourse, member_course
from dsfab.workshop.ground import Ground
from dsfab.workshop.layers import courses_without_rest, curled_courses, stopped_courses
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.planks.plank import Plank, PlankStock
from dsfab.workshop.planks.slots import (
    FIT,
    ORDER,
    SHARPEST,
    SLIDE,
    Crossing,
    PlankParts,
    Slot,
    plank_crossings,
    slot_width,
)
from dsfab.workshop.plates import is_plate, plate_parts
from dsfab.workshop.splices import scarf_line
from dsfab.workshop.strips import is_strip


def upright(course: StripCourse, depth: float) -> StripCourse:
    """Return a course along the surface as that of a plank: its normal is -B, and its left the surface normal."""
    B = np.cross(course.N, course.T)
    half = np.full(len(course.s), depth / 2)
    return replace(course, N=-B, kg=course.kn, kn=-course.kg, left=half, right=half)


def plank_courses(graph: MemberGraph, stock: PlankStock) -> tuple[dict[str, StripCourse], dict[str, StripCourse]]:
    """Return courses of all planks along the surface, and those that stop before others or before a curl."""
    members = [member for member in graph.members if is_strip(member)]
    more = 2 * (stock.reach + stock.depth + stock.past)
    courses = {one.id: member_course(graph, one, stock.past, more) for one in members}
    joined = {frozenset(node.members) for node in graph.nodes if node.kind != "grazing"}
    stopped = curled_courses(courses, members)
    for family in dict.fromkeys(member.family for member in members):
        mine = {one.id: _thin(courses[one.id], stock.thickness) for one in members if one.family == family}
        nodes = {
            name: sorted(mine[name].wrapped(node.at[node.members.index(name)]) for node in graph.along[name])
            for name in mine
        }
        stopped |= stopped_courses(mine, nodes, joined, stock.past)
    return courses | stopped, stopped


def _thin(course: StripCourse, thickness: float) -> StripCourse:
    half = np.full(len(course.s), thickness / 2)
    return replace(course, left=half, right=half)


def plank_parts(
    graph: MemberGraph,
    stock: PlankStock,
    room: list[tuple[float, float]],
    ground: Ground | None = None,
    order: Sequence[str] = ORDER,
) -> PlankParts:
    """Return the parts of all members that are planks.

    room   : lengths and widths (m) that parts may have on the stock.
    ground : base plane whose supports level the ends; None without supports.
    order  : families, from the lowest planks to the uppermost.

    Raises PatternError if no piece fits on the stock.
    """
    courses, stopped = plank_courses(graph, stock)
    gone = courses_without_rest(stopped, dict.fromkeys(stopped, stock.depth))
    courses = {name: course for name, course in courses.items() if name not in gone}
    found = PlankParts(
        tuple(order),
        crossings=plank_crossings(graph, courses, order),
        stopped=sorted(set(stopped) - gone),
        gone=sorted(gone),
    )
    found.crossings.found, missed = _reached(found.crossings.found, courses)
    found.left = sorted({*missed, *(node.id for name in gone for node in graph.along[name])})
    planks = [Plank(graph.by_id[name], upright(course, stock.depth), stock) for name, course in courses.items()]
    by_name = {plank.member.id: plank for plank in planks}
    for plank in planks:
        plank.divide(found.crossings.found, room, ground, found)
    for one in found.crossings.found:
        lower, upper = (by_name[name] for name in one.members)
        leans = one.leans(way) if (way := upper.way_at(one.at[1])) is not None else (0.0, 0.0)
        half = slot_width(stock.thickness, one.angle) / 2 + FIT
        lower.slots.append(Slot(one.node, one.at[0], (one.rise - FIT) / 2, half, leans[0], above=True))
        upper.slots.append(Slot(one.node, one.at[1], (FIT - one.rise) / 2, half, leans[1], above=False))
    for plank in planks:
        plank.into(found)
    return found


def _reached(crossings: list[Crossing], courses: Mapping[str, StripCourse]) -> tuple[list[Crossing], list[str]]:
    there = [
        all(
            courses[name].begin <= s <= courses[name].end or courses[name].closed
            for name, s in zip(one.members, one.at, strict=True)
        )
        for one in crossings
    ]
    pairs = list(zip(crossings, there, strict=True))
    return [one for one, here in pairs if here], [one.node for one, here in pairs if not here]


@dataclass(frozen=True, eq=False)
class PlankPlan:
    """Planks, their stock, and all parts: planks, cover plates, and plates on the planks.

    limit : strain at the material's strength; 0 if the preset has none.
    """

    found: PlankParts
    stock: PlankStock
    parts: tuple[FlatPart, ...]
    limit: float

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences on what can be built and what cannot."""
        return (*_bent(self), *_halved(self), *_put_on(self), *_left_out(self))

    @property
    def hindrance(self) -> str:
        """Obstacle to building, in numbers, as planks "would ..."; "" for none."""
        found, worst = self.found, max(self.found.bends.values(), default=0.0)
        if worst > self.limit:
            return f"would be bent across themselves to {worst:.2%}, of {self.limit:.2%} allowed"
        if found.crossings.sharp:
            return f"would meet at under {SHARPEST:g} degrees at {some_names(found.crossings.sharp)}, without slots"
        if found.crowded:
            return f"would have slots without wood between them: {some_names(found.crowded)}"
        if found.stuck:
            name, angle = max(found.stuck.items(), key=itemgetter(1))
            return (
                f"would not slide together: slots of {len(found.stuck)} of them turn from each other by up to "
                f"{np.degrees(angle):.0f} degrees from the middle ({name})"
            )
        return ""

    @property
    def merit(self) -> str:
        """Bending, crossings and slots of a possible plan, in numbers."""
        found, stock = self.found, self.stock
        bend, lean = (max(some.values(), default=0.0) for some in (found.bends, found.steep))
        said = (
            f"planks {length(stock.depth)} deep and {length(stock.thickness)} thick are bent to {bend:.2%}, of "
            f"{self.limit:.2%} allowed"
        )
        if found.crossings.found:
            angle = min(one.angle for one in found.crossings.found)
            said += (
                f", cross at {np.degrees(angle):.0f} degrees or more, and their slots open by up to "
                f"{np.degrees(lean):.1f} degrees to be put on"
            )
        return said


def plank_plan(
    graph: MemberGraph,
    normals: Floats,
    stock: PlankStock,
    room: list[tuple[float, float]],
    limit: float,
    ground: Ground | None = None,
    order: Sequence[str] = ORDER,
) -> PlankPlan:
    """Return the planks of a graph, and its plates on them without holes.

    normals : (n, 3) at the vertices of the graph's sheet.    limit : strain.
    order   : families, from the lowest planks to the uppermost.

    Raises PatternError if no piece fits on the stock.
    """
    found = plank_parts(graph, stock, room, ground, order)
    discs = [member for member in graph.members if is_plate(member)]
    over = (stock.depth + stock.thickness) / 2
    plates = [replace(plate, holes=()) for plate in plate_parts(graph, discs, normals, over, stock.bolt)]
    return PlankPlan(found, stock, (*found.pieces, *found.covers, *plates), limit)


def _bent(plan: PlankPlan) -> Iterator[str]:
    found, stock = plan.found, plan.stock
    if not found.bends:
        return
    order = sorted(found.bends, key=lambda one: -found.bends[one])
    worst, over = found.bends[order[0]], [name for name in order if found.bends[name] > plan.limit]
    size = f"upright planks, {length(stock.depth)} deep and {length(stock.thickness)} thick,"
    how = f"are bent across themselves to a strain of {worst:.2%} ({order[0]} most)"
    if not plan.limit:
        yield f"{len(order)} {size} {how}; name a material or set statics.strength to have that judged"
    elif over:
        yield (
            f"NOT POSSIBLE: {len(over)} of {len(order)} {size} {how}, {worst / plan.limit:.1f} times the "
            f"{plan.limit:.2%} at which the strength is reached ({some_names(over)}): set workshop.thickness to "
            f"{_rounded_down(stock.thickness * plan.limit / worst)} or less, or draw a pattern that bends less there"
        )
    else:
        yield f"{len(order)} {size} {how}, of {plan.limit:.2%} allowed"
    twisted = max(found.longer, key=lambda one: found.longer[one])
    longest, least = found.longer[twisted], 5e-5  # metres: nobody measures less
    yield (
        f"the surface twists planks: their edges are {f'up to {length(longest)}' if longest > least else 'not'} longer "
        "in the structure than on the drawing" + (f" ({twisted})" if longest > least else "")
    )


def _halved(plan: PlankPlan) -> Iterator[str]:
    found, stock = plan.found, plan.stock
    crossings = found.crossings
    if crossings.found:
        sharpest = min(crossings.found, key=lambda one: one.angle)
        yield (
            f"{len(crossings.found)} nodes with a slot in both planks, cut square to the face; the widest are "
            f"{length(slot_width(stock.thickness, sharpest.angle))}, where planks cross at "
            f"{np.degrees(sharpest.angle):.0f} degrees ({sharpest.node})"
        )
    if crossings.sharp:
        yield (
            f"NOT JOINED: at {some_names(crossings.sharp)} planks meet at under {SHARPEST:g} degrees "
            "and have no slots: notch or screw them there"
        )
    if found.crowded:
        yield (
            f"NOT POSSIBLE: slots are nearer to each other than wood is left between them, and were left out: "
            f"{some_names(found.crowded)}; set workshop.thickness smaller, or a larger spacing"
        )


def _put_on(plan: PlankPlan) -> Iterator[str]:
    found = plan.found
    steep = {name: angle for name, angle in found.steep.items() if name not in found.stuck and angle > 0}
    if steep:
        worst = max(steep, key=lambda one: steep[one])
        yield (
            f"planks with slots from below are put on along one direction, and their slots open for it by up to "
            f"{np.degrees(steep[worst]):.1f} degrees ({worst}); planks are spliced where it would be more than "
            f"{np.degrees(SLIDE):.0f}"
        )
    if found.stuck:
        worst = max(found.stuck, key=lambda one: found.stuck[one])
        yield (
            f"NOT TO SLIDE TOGETHER: slots of {some_names(list(found.stuck))} turn from each other, by up to "
            f"{np.degrees(found.stuck[worst]):.0f} degrees from the middle ({worst}): give smaller bolts or thinner "
            "planks, so that they can be spliced more often, or take strips or bars"
        )


def _left_out(plan: PlankPlan) -> Iterator[str]:
    found = plan.found
    if plan.stock.lap and found.splices:
        yield scarf_line(found.splices, plan.stock.lap)
    if found.near:
        yield f"{found.near} of {found.splices} splices are nearer to a node than they should be"
    if found.level:
        yield f"{found.level} ends at supports are cut along the ground"
    if found.stopped:
        yield (
            f"{some_names(found.stopped)} {stopping(len(found.stopped))} others of their family or curl up"
            + (f"; {some_names(found.left)} are without them" if found.left else "")
        )
    if found.gone:
        yield f"NOT BUILT, as others of their family stand where they would be: {some_names(found.gone)}"
    plates = [part for part in plan.parts if part.member and not len(part.axis)]
    if plates:
        yield f"plates lie on the planks, without holes, and are to be screwed on: {some_names([x.id for x in plates])}"


def _rounded_down(metres: float) -> str:
    power = 10.0 ** (np.floor(np.log10(metres)) - 1)
    return f"{np.floor(metres / power) * power:.2g}"
