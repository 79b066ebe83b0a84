"""Built members as bodies in space: refolded strips, bars and planks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.export import MemberShape
from dsfab.members import MemberGraph
from dsfab.surface import signed_volume
from dsfab.workshop.bars import BarPlan, bar_body
from dsfab.workshop.development import Development, StripCourse, member_course
from dsfab.workshop.layers import END
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.planks import PlankPlan, plank_courses, upright


@dataclass(frozen=True, eq=False)
class RefoldedStrip:
    """Part of a member in space, station by station.

    edges : (k, 2, 3) right and left edge (m).    normals : (k, 3) unit normals of its face.
    holes : (h, 3) middles of holes, or of slot bottoms (m).    bolts : (h,) names of bolts or nodes.
    """

    id: str
    member: str
    edges: Floats
    normals: Floats
    holes: Floats
    bolts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RefoldedPlan:
    """Strips or planks of a plan in space, and the deviations (h,) of their joints (m).

    A deviation is the distance of a hole from its bolt's line, or of the two slots at a node.
    """

    strips: tuple[RefoldedStrip, ...]
    off: Floats


@lru_cache(maxsize=2)
def refolded(plan: WorkshopPlan) -> RefoldedPlan:
    """Return the strips or planks of a full-size plan in space; flat sheets and plates have none."""
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
    """Return a plank from its outline with slots: the lowest and highest point at each place along it."""
    layer = Development(course, part.layer)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(part.axis, axis=0), axis=1))])
    along += float(np.interp(part.span[0], course.s, layer.length))
    at, y = _beside(part.axis, along, part.outline, beyond=True)
    first = int((y > y.max() / 2).argmax())
    right, left = (at[:first], y[:first]), (at[first:][::-1], y[first:][::-1])
    chains = [_with_ends(right, left), _with_ends(left, right)]
    # walls of slots are 1e-7 m long, so that the plank has one depth at every place
    steps = [np.maximum.accumulate(x) + 1e-7 * np.arange(len(x)) for x, _ in chains]
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
    """Return an edge (lengths, distances to the left) with the farther ends of the opposite edge, at oblique cuts."""
    (at, y), (to, z) = one, other
    before, after = slice(0, int(to[0] < at[0])), slice(len(to) - int(to[-1] > at[-1]), len(to))
    return np.concatenate([to[before], at, to[after]]), np.concatenate([z[before], y, z[after]])


def _beside(axis: Floats, along: Floats, places: Floats, beyond: bool = False) -> tuple[Floats, Floats]:
    """Return lengths along a line (k, 2) and distances to its left, (h,), for places (h, 2)."""
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


def built_shapes(plan: WorkshopPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    """Return the built members of a plan, in the order of the design's shapes (m).

    shapes : as in `dsfab.design.output`: vertices of the upper skin, then of the lower skin.
    shift  : height of the middle between both skins over the surface, in half thicknesses.
    Strips, planks and cover plates are bent back from flat parts; plates have the stock's thickness. Bars have no
    mitres.
    """
    if plan.bars:
        return _bars(plan.bars, shapes, shift)
    built = {part.member for part in plan.parts}
    strips: dict[str, list[RefoldedStrip]] = {}
    for strip in refolded(plan).strips:
        strips.setdefault(strip.member, []).append(strip)
    found = []
    for shape in shapes:
        if shape.id in strips:
            V, F = _joined([strip_body(strip, plan.thickness) for strip in strips[shape.id]])
            found.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in built:
            layering, own = plan.layering, next(part.layer for part in plan.parts if part.member == shape.id)
            height = layering.height(layering.plates) if layering else own
            found.append(replace(shape, V=_moved(shape.V, plan.thickness, height, shift), plate=True))
    return tuple(found)


def _bars(plan: BarPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    bodies: dict[str, list[tuple[Floats, Ints]]] = {}
    for bar in plan.found.bars:
        bodies.setdefault(bar.bay.member, []).append(bar_body(bar, plan.stock))
    discs = {part.member: part.layer for part in plan.parts if part.member and not len(part.axis)}
    found = []
    for shape in shapes:
        if shape.id in bodies:
            V, F = _joined(bodies[shape.id])
            found.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in discs:
            found.append(replace(shape, V=_moved(shape.V, plan.stock.bar, discs[shape.id], shift), plate=True))
    return tuple(found)


def strip_body(strip: RefoldedStrip, thickness: float) -> tuple[Floats, Ints]:
    """Return vertices (4 k, 3) in metres and triangles of a strip: four corners at each of its k stations."""
    up = thickness / 2 * strip.normals
    right, left = strip.edges[:, 0], strip.edges[:, 1]
    V = np.stack([right - up, right + up, left + up, left - up], axis=1).reshape(-1, 3)
    k = np.arange(len(up) - 1)[:, None]
    a = 4 * k + np.arange(4)
    b = 4 * k + np.roll(np.arange(4), -1)
    quads = np.stack([a, b, b + 4, a + 4], axis=-1).reshape(-1, 4)
    ends = np.array([[3, 2, 1, 0], np.arange(4) + 4 * (len(up) - 1)])
    quads = np.concatenate([quads, ends])
    F = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return V, F if signed_volume(V, F) > 0 else F[:, ::-1]


def _joined(bodies: Sequence[tuple[Floats, Ints]]) -> tuple[Floats, Ints]:
    first = np.cumsum([0, *(len(V) for V, _ in bodies)])
    faces = [F + start for (_, F), start in zip(bodies, first, strict=False)]
    return np.concatenate([V for V, _ in bodies]), np.concatenate(faces)


def _moved(V: Floats, thickness: float, height: float, shift: int) -> Floats:
    upper, lower = V.reshape(2, -1, 3)
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    n = half / np.linalg.norm(half, axis=1)[:, None]
    middle = middle - shift * half + height * n
    return np.concatenate([middle + thickness / 2 * n, middle - thickness / 2 * n])
