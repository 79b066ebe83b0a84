"""Flat strips bent back into space: by lengths on the flat part along the member's axis, to see whether they fit."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.workshop.course import member_course
from dsfab.workshop.development import Development
from dsfab.workshop.layering import END
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.plan import WorkshopPlan


@dataclass(frozen=True, eq=False)
class RefoldedStrip:
    """A part by its name and its member's: right and left edges (k, 2, 3), station by station, with unit normals
    (k, 3), and the middles of its holes (h, 3), metres, with the names of their bolts (h,)."""

    id: str
    member: str
    edges: Floats
    normals: Floats
    holes: Floats
    bolts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RefoldedPlan:
    """All strips of a plan in space, and how far their holes are off the lines of their bolts at nodes, metres (h,)."""

    strips: tuple[RefoldedStrip, ...]
    off: Floats


def refolded(plan: WorkshopPlan) -> RefoldedPlan:
    """The strips of a plan at full size; nothing of a flat sheet, and no plate: these are stretched, not bent."""
    graph, layering = plan.graph, plan.layering
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


def _beside(axis: Floats, along: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Of places (h, 2) the lengths (h,) along a line (k, 2) with lengths (k,), and metres to the left of it (h,)."""
    way = np.diff(axis, axis=0)
    long = np.linalg.norm(way, axis=1)
    off = places[:, None] - axis[None, :-1]
    t = np.clip(np.einsum("hki,ki->hk", off, way) / long**2, 0, 1)
    away = np.linalg.norm(off - t[..., None] * way, axis=2)
    k, row = away.argmin(axis=1), np.arange(len(places))
    left = (way[k, 0] * off[row, k, 1] - way[k, 1] * off[row, k, 0]) / long[k]
    return along[k] + t[row, k] * long[k], left
