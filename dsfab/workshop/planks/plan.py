"""The parts of a structure of planks.

A plank is the ruled surface P(s) + y N(s), with axis P and surface normal N. The flat part follows a curve of
curvature kn. In the structure, the plank bends by kg out of its plane and twists by tg."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length, names_and_count
from dsfab.members import MemberGraph
from dsfab.workshop.development import StripCourse, member_course
from dsfab.workshop.ground import BasePlane
from dsfab.workshop.layers import courses_without_curls, shortened_courses, vanished_courses
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.planks import slots
from dsfab.workshop.planks.plank import Plank, PlankStock
from dsfab.workshop.plates import is_plate, plate_parts
from dsfab.workshop.splices import scarf_line
from dsfab.workshop.strips import is_strip


def upright_course(course: StripCourse, depth: float) -> StripCourse:
    """Return the course (stations on the axis) of an upright plank, from the course of a strip flat on the surface.
    depth : width of the plank, metres."""
    B = np.cross(course.N, course.T)
    half = np.full(len(course.s), depth / 2)
    return replace(course, N=-B, kg=course.kn, kn=-course.kg, left=half, right=half)


def plank_courses(graph: MemberGraph, stock: PlankStock) -> tuple[dict[str, StripCourse], dict[str, StripCourse]]:
    """Return the courses (built parts of axes) of all planks, then only the courses shorter than their members."""
    members = [m for m in graph.members if is_strip(m)]
    extra_length = 2 * (stock.splice_reach + stock.depth + stock.overhang)
    courses = {m.id: member_course(graph, m, stock.overhang, extra_length) for m in members}
    joined = {frozenset(node.members) for node in graph.nodes if node.kind != "grazing"}
    stopped = courses_without_curls(courses, members)
    for family in dict.fromkeys(m.family for m in members):
        family_courses = {m.id: _thin_course(courses[m.id], stock.thickness) for m in members if m.family == family}
        nodes = {
            name: sorted(course.wrapped_station(n.at[n.members.index(name)]) for n in graph.nodes_along[name])
            for name, course in family_courses.items()
        }
        stopped |= shortened_courses(family_courses, nodes, joined, stock.overhang)
    return courses | stopped, stopped


def _thin_course(course: StripCourse, thickness: float) -> StripCourse:
    half = np.full(len(course.s), thickness / 2)
    return replace(course, left=half, right=half)


def plank_parts(
    graph: MemberGraph,
    stock: PlankStock,
    room: list[tuple[float, float]],
    ground: BasePlane | None = None,
    order: Sequence[str] = slots.STANDING_ORDER,
) -> slots.PlankParts:
    """Return the flat parts of all planks.
    room : lengths and widths of the stock, metres.    ground : plane of the ground; None without supports.
    order  : families, from the lowest planks to the uppermost. Raises PatternError if no piece fits on the stock."""
    courses, stopped = plank_courses(graph, stock)
    vanished = vanished_courses(stopped, dict.fromkeys(stopped, stock.depth))
    courses = {name: course for name, course in courses.items() if name not in vanished}
    parts = slots.PlankParts(
        tuple(order),
        crossings=slots.plank_crossings(graph, courses, order),
        shortened=sorted(set(stopped) - vanished),
        vanished=sorted(vanished),
    )
    parts.crossings.crossings, missed = _reachable_crossings(parts.crossings.crossings, courses)
    parts.missed_nodes = sorted({*missed, *(node.id for name in vanished for node in graph.nodes_along[name])})
    planks = [Plank(graph.by_id[name], upright_course(course, stock.depth), stock) for name, course in courses.items()]
    by_name = {plank.member.id: plank for plank in planks}
    for plank in planks:
        plank.divide(parts.crossings.crossings, room, ground, parts)
    for x in parts.crossings.crossings:
        lower, upper = (by_name[name] for name in x.members)
        leans = x.slot_leans(direction) if (direction := upper.direction_at(x.at[1])) is not None else (0.0, 0.0)
        half = slots.slot_width(stock.thickness, x.angle) / 2 + slots.SLOT_CLEARANCE
        y = (x.rise - slots.SLOT_CLEARANCE) / 2
        lower.slots.append(slots.Slot(x.node, x.at[0], y, half, leans[0], above=True))
        upper.slots.append(slots.Slot(x.node, x.at[1], -y, half, leans[1], above=False))
    for plank in planks:
        plank.add_parts(parts)
    return parts


def _reachable_crossings(
    crossings: list[slots.Crossing], courses: Mapping[str, StripCourse]
) -> tuple[list[slots.Crossing], list[str]]:
    reached, missed = list[slots.Crossing](), list[str]()
    for crossing in crossings:
        places = [(courses[name], s) for name, s in zip(crossing.members, crossing.at, strict=True)]
        if all(course.begin <= s <= course.end or course.closed for course, s in places):
            reached.append(crossing)
        else:
            missed.append(crossing.node)
    return reached, missed


@dataclass(frozen=True, eq=False)
class PlankPlan:
    """A structure of planks, and all its parts.
    limit : strain at which the material reaches its strength; 0 if unknown."""

    planks: slots.PlankParts
    stock: PlankStock
    parts: tuple[FlatPart, ...]
    limit: float

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences for the builder."""
        return (*_bending_lines(self), *_crossing_lines(self), *_sliding_lines(self), *_omission_lines(self))

    @property
    def obstacle(self) -> str:
        """Reason why planks are impossible, as a sentence; "" if planks are possible."""
        planks, worst = self.planks, max(self.planks.bends.values(), default=0.0)
        if worst > self.limit:
            return f"upright planks would bend out of their plane to a strain of {worst:.2%} (limit: {self.limit:.2%})"
        if planks.crossings.sharp_nodes:
            nodes = names_and_count(planks.crossings.sharp_nodes)
            return (
                f"upright planks would meet at angles below {slots.LEAST_DEGREES:g} degrees at {nodes}, which is too "
                f"sharp for slots"
            )
        if planks.crowded:
            return (
                f"upright planks would have neighbouring slots without wood between these slots: "
                f"{names_and_count(planks.crowded)}"
            )
        if planks.stuck:
            name, angle = max(planks.stuck.items(), key=itemgetter(1))
            return (
                f"upright planks would not slide together: in {len(planks.stuck)} planks, slots differ by up to "
                f"{np.degrees(angle):.0f} degrees from the mean direction of the slots of their piece ({name})"
            )
        return ""

    @property
    def summary(self) -> str:
        """Sentence on bending, crossings and slots."""
        planks, stock = self.planks, self.stock
        bend, lean = (max(angles.values(), default=0.0) for angles in (planks.bends, planks.slide_angles))
        text = (
            f"planks {length(stock.depth)} deep and {length(stock.thickness)} thick are bent to a strain of {bend:.2%} "
            f"(allowed: {self.limit:.2%})"
        )
        if planks.crossings.crossings:
            angle = min(crossing.angle for crossing in planks.crossings.crossings)
            text += (
                f"; planks cross at {np.degrees(angle):.0f} degrees or more, and their slots widen by up to "
                f"{np.degrees(lean):.1f} degrees for assembly"
            )
        return text


def plank_plan(
    graph: MemberGraph,
    normals: Floats,
    stock: PlankStock,
    room: list[tuple[float, float]],
    limit: float,
    ground: BasePlane | None = None,
    order: Sequence[str] = slots.STANDING_ORDER,
) -> PlankPlan:
    """Return the planks of a graph, and its plates.
    normals : (n, 3) at the vertices of the graph's sheet.    order : families, from the lowest planks to the uppermost.
    room : lengths and widths of the stock, metres.    limit : strain at the material's strength.
    Raises PatternError if no piece fits on the stock."""
    planks = plank_parts(graph, stock, room, ground, order)
    discs = [member for member in graph.members if is_plate(member)]
    over = (stock.depth + stock.thickness) / 2
    plates = [replace(plate, holes=()) for plate in plate_parts(graph, discs, normals, over, stock.bolt)]
    return PlankPlan(planks, stock, (*planks.pieces, *planks.covers, *plates), limit)


def _bending_lines(plan: PlankPlan) -> Iterator[str]:
    planks, stock = plan.planks, plan.stock
    if not planks.bends:
        return
    order = sorted(planks.bends, key=lambda name: -planks.bends[name])
    worst, over = planks.bends[order[0]], [name for name in order if planks.bends[name] > plan.limit]
    size = f"upright planks, {length(stock.depth)} deep and {length(stock.thickness)} thick,"
    how = f"are bent out of their plane to a strain of up to {worst:.2%} (largest in {order[0]})"
    if not plan.limit:
        yield f"{len(order)} {size} {how}; name a material or set statics.strength for a limit"
    elif over:
        yield (
            f"NOT POSSIBLE: {len(over)} of {len(order)} {size} {how}, {worst / plan.limit:.1f} times the allowed "
            f"strain of {plan.limit:.2%} ({names_and_count(over)}): set workshop.thickness to "
            f"{_rounded_down(stock.thickness * plan.limit / worst)} or less, or draw a pattern that bends planks less"
        )
    else:
        yield f"{len(order)} {size} {how}, of {plan.limit:.2%} allowed"
    twisted = max(planks.longer, key=lambda name: planks.longer[name])
    longest, least = planks.longer[twisted], 5e-5  # metres: smaller elongations cannot be measured
    yield (
        f"the structure twists the planks: edges of planks become "
        f"{f'up to {length(longest)}' if longest > least else 'not'} longer than on the "
        f"drawing" + (f" ({twisted})" if longest > least else "")
    )


def _crossing_lines(plan: PlankPlan) -> Iterator[str]:
    planks, stock = plan.planks, plan.stock
    crossings = planks.crossings
    if crossings.crossings:
        sharpest = min(crossings.crossings, key=lambda crossing: crossing.angle)
        yield (
            f"{len(crossings.crossings)} nodes have a slot in both planks, at right angles to the plank's face; the "
            f"widest slots are {length(slots.slot_width(stock.thickness, sharpest.angle))}, where planks cross at "
            f"{np.degrees(sharpest.angle):.0f} degrees ({sharpest.node})"
        )
    if crossings.sharp_nodes:
        yield (
            f"NOT JOINED: at {names_and_count(crossings.sharp_nodes)}, planks meet at angles below "
            f"{slots.LEAST_DEGREES:g} degrees and have no slots: notch or screw these planks"
        )
    if planks.crowded:
        yield (
            "NOT POSSIBLE: these slots are omitted, because no wood would remain between neighbouring slots: "
            f"{names_and_count(planks.crowded)}; set a smaller workshop.thickness, or a larger spacing"
        )


def _sliding_lines(plan: PlankPlan) -> Iterator[str]:
    planks = plan.planks
    steep = {name: angle for name, angle in planks.slide_angles.items() if name not in planks.stuck and angle > 0}
    if steep:
        worst = max(steep, key=lambda name: steep[name])
        yield (
            f"pieces with slots in lower edges slide onto other planks in one direction, so dsfab widened slots by up "
            f"to {np.degrees(steep[worst]):.1f} degrees (at {worst}); splices of planks keep this angle below "
            f"{np.degrees(slots.SLIDE_ANGLE):.0f} degrees"
        )
    if planks.stuck:
        worst = max(planks.stuck, key=lambda name: planks.stuck[name])
        yield (
            f"NOT POSSIBLE to slide together: {names_and_count(list(planks.stuck))}; slots of a piece differ by up to "
            f"{np.degrees(planks.stuck[worst]):.0f} degrees from their mean direction ({worst}): use smaller bolts or "
            f"thinner planks to make room for more splices, or choose the route strips or bars"
        )


def _omission_lines(plan: PlankPlan) -> Iterator[str]:
    planks = plan.planks
    if plan.stock.lap and planks.splice_count:
        yield scarf_line(planks.splice_count, plan.stock.lap)
    if planks.splices_near_nodes:
        yield f"{planks.splices_near_nodes} of {planks.splice_count} splices are too close to a node"
    if planks.level_ends:
        yield f"{planks.level_ends} ends of planks at supports are cut parallel to the ground"
    if planks.shortened:
        names, nodes = names_and_count(planks.shortened), names_and_count(planks.missed_nodes)
        singular = f"{names} stops before its ends, because it would meet another plank of the same family or curl up"
        plural = f"{names} stop before their ends, because they would meet planks of the same family or curl up"
        missed = f"; this leaves nodes unreached: {nodes}" if nodes else ""
        yield f"{singular if len(planks.shortened) == 1 else plural}{missed}"
    if planks.vanished:
        yield f"NOT BUILT, because other planks of the same family are in the way: {names_and_count(planks.vanished)}"
    plates = [part for part in plan.parts if part.member and not len(part.axis)]
    if plates:
        names = names_and_count([plate.id for plate in plates])
        yield f"plates without holes lie on the planks; screw these plates on: {names}"


def _rounded_down(metres: float) -> str:
    power = 10.0 ** (np.floor(np.log10(metres)) - 1)
    return f"{np.floor(metres / power) * power:.2g}"
