"""Planks as flat parts: rolled out along the normals of the surface, with slots, splices and ends.

A plank is P(s) + y N(s): a ruled surface whose own normal along the axis is -B. Rolled out it bends by kn in its plane;
built it is bent by kg across it, and twisted by tg, which makes its edges longer than its outline by tg^2 h^2 / 8.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dsfab.members import MemberGraph
from dsfab.workshop.course import StripCourse, member_course
from dsfab.workshop.crowns import courses_without_rest, curled_courses, stopped_courses
from dsfab.workshop.ground import Ground
from dsfab.workshop.planks.found import PlankParts
from dsfab.workshop.planks.outline import PlankStock
from dsfab.workshop.planks.plank import Plank
from dsfab.workshop.planks.slots import FIT, ORDER, Crossing, Slot, plank_crossings, slot_width
from dsfab.workshop.strips import is_strip


def upright(course: StripCourse, depth: float) -> StripCourse:
    """A course along the surface as that of a plank on it: its normal is -B, its left the surface's normal."""
    B = np.cross(course.N, course.T)
    half = np.full(len(course.s), depth / 2)
    return replace(course, N=-B, kg=course.kn, kn=-course.kg, left=half, right=half)


def plank_courses(graph: MemberGraph, stock: PlankStock) -> tuple[dict[str, StripCourse], dict[str, StripCourse]]:
    """Courses along the surface of all members that are planks, and those of them that stop before others, or where
    they curl up."""
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
    """The parts of all members that are planks.

    room   : lengths and widths, metres, that parts may have on the stock.
    ground : supports, along which ends are cut; None where nothing is held.
    order  : of families, from those that stand first.

    Raises PatternError where no piece fits on the stock.
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
    """Crossings that both planks reach, and the names of the others."""
    there = [
        all(
            courses[name].begin <= s <= courses[name].end or courses[name].closed
            for name, s in zip(one.members, one.at, strict=True)
        )
        for one in crossings
    ]
    pairs = list(zip(crossings, there, strict=True))
    return [one for one, here in pairs if here], [one.node for one, here in pairs if not here]
