"""Flat strips bent back into space: by lengths on the flat part along the member's axis, to see whether they fit."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import MemberGraph
from dsfab.workshop.course import StripCourse, member_course
from dsfab.workshop.development import Development
from dsfab.workshop.layering import END
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.planks import PlankPlan, plank_courses, upright

WALL = 1e-7
"""Metres along a plank: the walls of its slots are that long, so that it has one depth at every place."""


@dataclass(frozen=True, eq=False)
class RefoldedStrip:
    """A part by its name and its member's: right and left edges (k, 2, 3), station by station, with unit normals
    (k, 3) of its face, and the middles of its holes, or of the bottoms of its slots, (h, 3), metres, with the names of
    their bolts, or nodes, (h,)."""

    id: str
    member: str
    edges: Floats
    normals: Floats
    holes: Floats
    bolts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RefoldedPlan:
    """All strips or planks of a plan in space, and how far their holes are off the lines of their bolts at nodes, or
    the slots of two planks beside each other, metres (h,)."""

    strips: tuple[RefoldedStrip, ...]
    off: Floats


@lru_cache(maxsize=2)
def refolded(plan: WorkshopPlan) -> RefoldedPlan:
    """The strips of a plan at full size; nothing of a flat sheet, and no plate: these are stretched, not bent."""
    graph, layering = plan.graph, plan.layering
    if plan.planks and graph:
        return _refolded_planks(plan.planks, graph)
    if graph is None or layering is None or plan.model:
        return RefoldedPlan((), np.empty(0))
    courses = {}
    strips, off = list[RefoldedStrip](), list[float]()
    lines = {node.id: (node.point, node.normal) for node in graph.nodes}
    for part in plan.parts:
        if not len(part.axis):
            continue
        if part.member not in courses:
            member = graph.by_id[part.member]
            courses[part.member] = member_course(graph, member, END * layering.bolt, 2 * layering.half_cover)
        strip = _refolded(part, Development(courses[part.member], part.layer))
        strips.append(strip)
        for bolt, hole in zip(strip.bolts, strip.holes, strict=True):
            if bolt in lines:
                point, normal = lines[bolt]
                away = hole - point
                off.append(float(np.linalg.norm(away - (away @ normal) * normal)))
    return RefoldedPlan(tuple(strips), np.array(off))


def _refolded(part: FlatPart, layer: Development) -> RefoldedStrip:
    course = layer.course
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(part.axis, axis=0), axis=1))])
    along += float(np.interp(part.span[0], course.s, layer.length))
    outline = part.outline.reshape(2, len(part.axis), 2)
    right, left = outline[0], outline[1, ::-1]
    s = np.interp(along, layer.length, course.s)
    P, _, B, N = layer.frame(s)
    y = np.stack([-np.linalg.norm(right - part.axis, axis=1), np.linalg.norm(left - part.axis, axis=1)], axis=1)
    holes = np.array([hole.at for hole in part.holes]).reshape(-1, 2)
    at, aside = _beside(part.axis, along, holes)
    Q, _, C, _ = layer.frame(np.interp(at, layer.length, course.s))
    edges = P[:, None] + y[..., None] * B[:, None]
    return RefoldedStrip(
        part.id, part.member, edges, N, Q + aside[:, None] * C, tuple(hole.bolt for hole in part.holes)
    )


def _refolded_planks(plan: PlankPlan, graph: MemberGraph) -> RefoldedPlan:
    """Planks and cover plates; slots are known by the nearest node of their member."""
    courses = plank_courses(graph, plan.stock)[0]
    planks = list[RefoldedStrip]()
    sides: dict[str, list[Floats]] = {}
    for part in plan.parts:
        if len(part.axis):
            nodes = graph.along[part.member]
            plank = _plank(part, upright(courses[part.member], plan.stock.depth))
            points = np.array([node.point for node in nodes]).reshape(-1, 3)
            nearest = [int(np.linalg.norm(points - place, axis=1).argmin()) for place in plank.holes]
            planks.append(replace(plank, bolts=tuple(nodes[k].id for k in nearest)))
            for k, place in zip(nearest, plank.holes, strict=True):
                sides.setdefault(nodes[k].id, []).append(place)
    off = list[float]()
    for one in plan.found.crossings.found:
        places = sides.get(one.node, [])
        if len(places) == 2:
            away = places[1] - places[0]
            off.append(float(np.linalg.norm(away - (away @ one.normal) * one.normal)))
    return RefoldedPlan(tuple(planks), np.array(off))


def _plank(part: FlatPart, course: StripCourse) -> RefoldedStrip:
    """A plank, its outline with slots: at every place along it the lowest and the highest that it has."""
    layer = Development(course, part.layer)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(part.axis, axis=0), axis=1))])
    along += float(np.interp(part.span[0], course.s, layer.length))
    at, y = _beside(part.axis, along, part.outline, beyond=True)
    first = int((y > y.max() / 2).argmax())
    right, left = (at[:first], y[:first]), (at[first:][::-1], y[first:][::-1])
    chains = [_with_ends(right, left), _with_ends(left, right)]
    steps = [np.maximum.accumulate(x) + WALL * np.arange(len(x)) for x, _ in chains]
    every = np.unique(np.concatenate([*steps, along]))
    sides = [np.interp(every, x, side) for x, (_, side) in zip(steps, chains, strict=True)]
    P, _, up, normal = layer.frame(np.interp(every, layer.length, course.s))
    edges = np.stack([P + side[:, None] * up for side in sides], axis=1)
    low = np.abs(y) < y.max() / 2
    bottoms = np.flatnonzero(low & np.roll(low, -1))  # a slot's two inner corners follow each other
    middles = (part.outline[bottoms] + np.roll(part.outline, -1, axis=0)[bottoms]) / 2
    at, y = _beside(part.axis, along, middles)
    P, _, up, _ = layer.frame(np.interp(at, layer.length, course.s))
    return RefoldedStrip(part.id, part.member, edges, normal, P + y[:, None] * up, ())


def _with_ends(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """An edge, lengths along and metres to the left (k,) each, with the ends of the other edge where these are farther
    out: there the part ends obliquely."""
    (at, y), (to, z) = one, other
    before, after = slice(0, int(to[0] < at[0])), slice(len(to) - int(to[-1] > at[-1]), len(to))
    return np.concatenate([to[before], at, to[after]]), np.concatenate([z[before], y, z[after]])


def _beside(axis: Floats, along: Floats, places: Floats, beyond: bool = False) -> tuple[Floats, Floats]:
    """Of places (h, 2) the lengths (h,) along a line (k, 2) with lengths (k,), and metres to the left of it (h,);
    `beyond` its ends too, where it goes on straight."""
    way = np.diff(axis, axis=0)
    long = np.linalg.norm(way, axis=1)
    off = places[:, None] - axis[None, :-1]
    t = np.einsum("hki,ki->hk", off, way) / long**2
    low, high = np.zeros(len(way)), np.ones(len(way))
    if beyond:
        low[0], high[-1] = -np.inf, np.inf
    t = np.clip(t, low, high)
    away = np.linalg.norm(off - t[..., None] * way, axis=2)
    k, row = away.argmin(axis=1), np.arange(len(places))
    left = (way[k, 0] * off[row, k, 1] - way[k, 1] * off[row, k, 0]) / long[k]
    return along[k] + t[row, k] * long[k], left
