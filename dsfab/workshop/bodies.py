"""Bodies of built members in space: strips, planks and straight bars."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.export import MemberShape
from dsfab.members import MemberGraph
from dsfab.surface import signed_volume
from dsfab.workshop.bars import BarPlan, bar_body
from dsfab.workshop.development import Development, StripCourse, member_course
from dsfab.workshop.layers import END_DISTANCE
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.planks import PlankPlan, plank_courses, upright_course


@dataclass(frozen=True, eq=False)
class RefoldedStrip:
    """Strip or plank in its built shape in space, at k stations along its length.
    edges   : (k, 2, 3) points of the right and of the left edge, metres.
    normals : (k, 3) unit normals of the strip's face.
    holes   : (h, 3) middles of the holes of a strip, or of the slot bottoms of a plank, metres.
    bolts   : (h,) names of the bolts in the holes, or of the nodes of the slots."""

    id: str
    member: str
    edges: Floats
    normals: Floats
    holes: Floats
    bolts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RefoldedPlan:
    """Strips or planks of a plan in their built shape.
    deviations : (h,) distances of bolt holes and slots from their exact positions at the joints, metres."""

    strips: tuple[RefoldedStrip, ...]
    deviations: Floats


@lru_cache(maxsize=2)
def refolded_plan(plan: WorkshopPlan) -> RefoldedPlan:
    """Return the strips or planks of a plan in their built shape."""
    graph, layering = plan.graph, plan.layering
    if plan.planks and graph:
        return _refolded_planks(plan.planks, graph)
    if graph is None or layering is None or plan.model:
        return RefoldedPlan((), np.empty(0))
    courses = {}
    strips, deviations = list[RefoldedStrip](), list[float]()
    lines = {node.id: (node.point, node.normal) for node in graph.nodes}
    for part in plan.parts:
        if not len(part.axis):
            continue
        if part.member not in courses:
            m = graph.by_id[part.member]
            courses[part.member] = member_course(graph, m, END_DISTANCE * layering.bolt, 2 * layering.half_cover_length)
        strip = _refolded_strip(part, Development(courses[part.member], part.layer))
        strips.append(strip)
        for bolt, hole in zip(strip.bolts, strip.holes, strict=True):
            if bolt in lines:
                point, normal = lines[bolt]
                away = hole - point
                deviations.append(float(np.linalg.norm(away - (away @ normal) * normal)))
    return RefoldedPlan(tuple(strips), np.array(deviations))


def _refolded_strip(part: FlatPart, layer: Development) -> RefoldedStrip:
    course = layer.course
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(part.axis, axis=0), axis=1))])
    along += float(np.interp(part.span[0], course.s, layer.length))
    outline = part.outline.reshape(2, len(part.axis), 2)
    right_rim, left_rim = outline[0], outline[1, ::-1]
    P, _, B, N = layer.frame(np.interp(along, layer.length, course.s))
    y = np.stack([-np.linalg.norm(right_rim - part.axis, axis=1), np.linalg.norm(left_rim - part.axis, axis=1)], axis=1)
    holes = np.array([hole.at for hole in part.holes]).reshape(-1, 2)
    places, aside = _line_coordinates(part.axis, along, holes)
    Q, _, C, _ = layer.frame(np.interp(places, layer.length, course.s))
    edges = P[:, None] + y[..., None] * B[:, None]
    bolts = tuple(hole.bolt for hole in part.holes)
    return RefoldedStrip(part.id, part.member, edges, N, Q + aside[:, None] * C, bolts)


def _refolded_planks(plan: PlankPlan, graph: MemberGraph) -> RefoldedPlan:
    courses = plank_courses(graph, plan.stock)[0]
    planks = list[RefoldedStrip]()
    sides: dict[str, list[Floats]] = {}
    for part in plan.parts:
        if len(part.axis):
            nodes = graph.nodes_along[part.member]
            plank = _refolded_plank(part, upright_course(courses[part.member], plan.stock.depth))
            points = np.array([node.point for node in nodes]).reshape(-1, 3)
            nearest = [int(np.linalg.norm(points - place, axis=1).argmin()) for place in plank.holes]
            planks.append(replace(plank, bolts=tuple(nodes[k].id for k in nearest)))
            for k, place in zip(nearest, plank.holes, strict=True):
                sides.setdefault(nodes[k].id, []).append(place)
    deviations = list[float]()
    for crossing in plan.planks.crossings.crossings:
        places = sides.get(crossing.node, [])
        if len(places) == 2:
            away = places[1] - places[0]
            deviations.append(float(np.linalg.norm(away - (away @ crossing.normal) * crossing.normal)))
    return RefoldedPlan(tuple(planks), np.array(deviations))


def _refolded_plank(part: FlatPart, course: StripCourse) -> RefoldedStrip:
    layer = Development(course, part.layer)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(part.axis, axis=0), axis=1))])
    along += float(np.interp(part.span[0], course.s, layer.length))
    places, y = _line_coordinates(part.axis, along, part.outline, beyond=True)
    left_start = int((y > y.max() / 2).argmax())
    right_edge, left_edge = (places[:left_start], y[:left_start]), (places[left_start:][::-1], y[left_start:][::-1])
    chains = [_with_ends(right_edge, left_edge), _with_ends(left_edge, right_edge)]
    # interpolation needs different positions for the two depths at a slot's upright side
    steps = [np.maximum.accumulate(x) + 1e-7 * np.arange(len(x)) for x, _ in chains]
    every = np.unique(np.concatenate([*steps, along]))
    sides = [np.interp(every, x, side) for x, (_, side) in zip(steps, chains, strict=True)]
    P, _, up, normal = layer.frame(np.interp(every, layer.length, course.s))
    edges = np.stack([P + side[:, None] * up for side in sides], axis=1)
    low = np.abs(y) < y.max() / 2
    bottoms = np.flatnonzero(low & np.roll(low, -1))  # the two inner corners of a slot are neighbours
    middles = (part.outline[bottoms] + np.roll(part.outline, -1, axis=0)[bottoms]) / 2
    places, y = _line_coordinates(part.axis, along, middles)
    P, _, up, _ = layer.frame(np.interp(places, layer.length, course.s))
    return RefoldedStrip(part.id, part.member, edges, normal, P + y[:, None] * up, ())


def _with_ends(edge: tuple[Floats, Floats], opposite: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    (places, y), (opposite_places, z) = edge, opposite
    before, after = int(opposite_places[0] < places[0]), len(z) - int(opposite_places[-1] > places[-1])
    lengths = np.concatenate([opposite_places[:before], places, opposite_places[after:]])
    return lengths, np.concatenate([z[:before], y, z[after:]])


def _line_coordinates(axis: Floats, along: Floats, places: Floats, beyond: bool = False) -> tuple[Floats, Floats]:
    segments = np.diff(axis, axis=0)
    lengths = np.linalg.norm(segments, axis=1)
    offsets = places[:, None] - axis[None, :-1]
    t = np.einsum("hki,ki->hk", offsets, segments) / lengths**2
    low, high = np.zeros(len(segments)), np.ones(len(segments))
    if beyond:
        low[0], high[-1] = -np.inf, np.inf
    t = np.clip(t, low, high)
    away = np.linalg.norm(offsets - t[..., None] * segments, axis=2)
    k, row = away.argmin(axis=1), np.arange(len(places))
    to_left = (segments[k, 0] * offsets[row, k, 1] - segments[k, 1] * offsets[row, k, 0]) / lengths[k]
    return along[k] + t[row, k] * lengths[k], to_left


def built_shapes(plan: WorkshopPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    """Return the members of a plan as built, in the order of `shapes`; lengths in metres.
    shapes : members of the design; vertices of the upper skin first, then of the lower skin.
    shift  : distance of the sheet's middle above the surface, divided by half the thickness."""
    if plan.bars:
        return _bar_shapes(plan.bars, shapes, shift)
    built = {part.member for part in plan.parts}
    strips: dict[str, list[RefoldedStrip]] = {}
    for strip in refolded_plan(plan).strips:
        strips.setdefault(strip.member, []).append(strip)
    result = []
    for shape in shapes:
        if shape.id in strips:
            V, F = concatenated_mesh([strip_body(strip, plan.thickness) for strip in strips[shape.id]])
            result.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in built:
            layering, part_layer = plan.layering, next(part.layer for part in plan.parts if part.member == shape.id)
            height = layering.layer_height(layering.plate_layer) if layering else part_layer
            result.append(replace(shape, V=_moved_skins(shape.V, plan.thickness, height, shift), plate=True))
    return tuple(result)


def _bar_shapes(plan: BarPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    bodies: dict[str, list[tuple[Floats, Ints]]] = {}
    for bar in plan.bar_lattice.bars:
        bodies.setdefault(bar.bay.member, []).append(bar_body(bar, plan.stock))
    discs = {part.member: part.layer for part in plan.parts if part.member and not len(part.axis)}
    result = []
    for shape in shapes:
        if shape.id in bodies:
            V, F = concatenated_mesh(bodies[shape.id])
            result.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in discs:
            result.append(replace(shape, V=_moved_skins(shape.V, plan.stock.bar, discs[shape.id], shift), plate=True))
    return tuple(result)


def strip_body(strip: RefoldedStrip, thickness: float) -> tuple[Floats, Ints]:
    """Return vertices (4 k, 3) in metres and triangles of a strip."""
    up = thickness / 2 * strip.normals
    right_edge, left_edge = strip.edges[:, 0], strip.edges[:, 1]
    V = np.stack([right_edge - up, right_edge + up, left_edge + up, left_edge - up], axis=1).reshape(-1, 3)
    k = np.arange(len(up) - 1)[:, None]
    a = 4 * k + np.arange(4)
    b = 4 * k + np.roll(np.arange(4), -1)
    quads = np.stack([a, b, b + 4, a + 4], axis=-1).reshape(-1, 4)
    ends = np.array([[3, 2, 1, 0], np.arange(4) + 4 * (len(up) - 1)])
    quads = np.concatenate([quads, ends])
    F = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return V, F if signed_volume(V, F) > 0 else F[:, ::-1]


def _moved_skins(V: Floats, thickness: float, height: float, shift: int) -> Floats:
    upper, lower = V.reshape(2, -1, 3)
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    n = half / np.linalg.norm(half, axis=1)[:, None]
    middle = middle - shift * half + height * n
    return np.concatenate([middle + thickness / 2 * n, middle - thickness / 2 * n])
