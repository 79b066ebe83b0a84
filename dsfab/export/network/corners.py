"""Corners of outlines, where walls meet, and the seams that end at those of them that a fillet fills."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.model import NetModel, NetWall

SMOOTH = np.cos(np.deg2rad(10.0))
"""Cosine of the turn between two walls up to which there is no corner to be rounded."""

STRAIGHT = np.cos(0.01)
"""Cosine of the angle up to which OCCT (8.0) takes a seam for what a wall's edge goes on as."""


@dataclass(frozen=True)
class FilledCorner:
    """A corner where the void is less than a half turn, and the one seam that ends there.

    seam, end : the edge, and whether that is its last end (1) or its first (0).    half : tangent of half the turn.
    beside : the edges of walls before and after the corner.    straight : that of them that the seam goes straight on
    from, if there is one.
    """

    vertex: int
    seam: int
    end: int
    half: float
    beside: tuple[int, int]
    straight: int | None


def corner_tangents(model: NetModel) -> dict[int, float]:
    """By vertex where an outline has a corner the tangent of half its turn."""
    return {vertex: half for vertex, (half, _, _) in _corners(model).items()}


def filled_corners(model: NetModel) -> list[FilledCorner]:
    """Where one seam alone ends at a corner that a fillet fills; none of a model whose edges are there twice."""
    if model.seam:
        return []
    walls = {e for wall in model.walls for e, _ in wall.steps}
    corners, at = _corners(model), dict[int, list[tuple[int, int]]]()
    for e, edge in enumerate(model.edges):
        for end, v in enumerate((edge.start, edge.end)):
            if v in corners and e not in walls:
                at.setdefault(v, []).append((e, end))
    found = list[FilledCorner]()
    for v, ((e, end), *others) in at.items():
        half, before, after = corners[v]
        one, two = _end_way(model, before, False), _end_way(model, after, True)
        across = model.vertices[v][:3] - model.vertices[v][3:]
        if not others and np.cross(one, two) @ across < 0:
            seam = _end_way(model, (e, not end), True)
            straight = [step[0] for step, w in ((before, one), (after, -two)) if seam @ w > STRAIGHT]
            beside = before[0], after[0]
            found.append(FilledCorner(v, e, end, half, beside, straight[0] if straight else None))
    return found


def _corners(model: NetModel) -> dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]:
    """By vertex where an outline has a corner the tangent of half its turn, and the edges before and after it."""
    found = dict[int, tuple[float, tuple[int, bool], tuple[int, bool]]]()
    for outline in outlines(model):
        for i, wall in enumerate(outline):
            before, after = outline[i - 1].steps[-1], wall.steps[0]
            half = half_turn(float(_end_way(model, before, False) @ _end_way(model, after, True)))
            if half > 0:
                found[model.vertex(after, True)] = half, before, after
    return found


def half_turn(cosine: float) -> float:
    """The tangent of half the turn at a corner, by which a fillet's radius is multiplied; 0 where there is none."""
    return float(np.sqrt((1 - cosine) / max(1 + cosine, 0.05))) if cosine < SMOOTH else 0.0


def outlines(model: NetModel) -> list[list[NetWall]]:
    """Walls that follow each other, each once."""
    begin = dict[int, list[NetWall]]()
    for wall in model.walls:
        begin.setdefault(model.vertex(wall.steps[0], True), []).append(wall)
    found = list[list[NetWall]]()
    for some in begin.values():
        while some:
            found.append([some.pop(0)])
            while after := begin.get(model.vertex(found[-1][-1].steps[-1], False)):
                found[-1].append(after.pop(0))
    return found


def way(wall: NetWall, model: NetModel, first: bool) -> Floats:
    """(3,) the direction of a wall where it begins, or ends."""
    return _end_way(model, wall.steps[0 if first else -1], first)


def _end_way(model: NetModel, step: tuple[int, bool], first: bool) -> Floats:
    """(3,) the direction of an edge where it begins, or ends, as it is run through."""
    P = model.poles(step)[:, :3]
    ahead = P[1] - P[0] if first else P[3] - P[2]
    return np.asarray(ahead / max(float(np.linalg.norm(ahead)), 1e-300))
