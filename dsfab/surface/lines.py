"""Lines on a surface: the level lines of a field, exact for a field that is linear over each face.

A vertex on a level counts as above it, so a level crosses two sides of a face or none: lines never branch, and they end
on the boundary only. What crosses an edge is a node, known by the edge and the level:

        high                 A face whose corners have the values low <= mid <= high has a chord for every level with
        / \\                  low < level <= high, from its longest side (low to high) to the side from low to mid, or
    ---o---o--- level        from mid to high where the level is above mid.
      /     \\
    low ---- mid
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.surface.mesh import Surface

Kind = Literal["edge", "centre"]


@dataclass(frozen=True, eq=False)
class StructureLine:
    """A polyline on a surface, with what it is.

    kind   : "edge", where material ends, or "centre", along the middle of a member.
    family : what it belongs to: "major", "minor", "keep", "rim"; or "boundary" where material ends with the surface.
    number : of the stripe in its family, the integer k of its middle z = k; 0 for other families.
    part   : 1, 2, ... among the lines of the same kind, family and number.
    points : (k, 3) metres; the last is the first again if the line is closed.
    length : metres, of the line on the mesh, before any simplification.
    """

    kind: Kind
    family: str
    number: int
    part: int
    points: Floats
    length: float

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 3))

    @cached_property
    def closed(self) -> bool:
        """Whether it ends where it begins."""
        return len(self.points) > 2 and bool((self.points[0] == self.points[-1]).all())

    @property
    def layer(self) -> str:
        """`edges-major`, `centre-minor`, `boundary` ...: where a drawing program puts it."""
        return (
            self.family
            if self.family == "boundary"
            else f"{'edges' if self.kind == 'edge' else 'centre'}-{self.family}"
        )

    @property
    def id(self) -> str:
        """Its name, the same whenever the same design is drawn: `centre-major-3.1`."""
        return f"{self.layer}-{self.number}.{self.part}"


class Track(NamedTuple):
    """A level line: points (k, 3) in metres, its level's index, and for each of its k - 1 chords the face it is in."""

    points: Floats
    level: int
    faces: Ints


def polyline_length(points: Floats) -> float:
    """Length of the polyline through (k, 3) points."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def level_lines(surface: Surface, x: Floats, levels: Floats, within: Bools | None = None) -> list[Track]:
    """The lines on which a field x (n,), linear over each face, has one of the levels (l,), ascending.

    within : (m,) faces to draw in; lines end where these do. All faces when left out.
    The chords are exact; where a level passes through a vertex, no chord without length is left.
    """
    nodes = _nodes(surface, x, levels)
    if nodes.level.size == 0:
        return []
    face, one, two = _chords(surface, x, levels, nodes)
    if within is not None:
        kept = within[face]
        face, one, two = face[kept], one[kept], two[kept]
    found = []
    for order, chord in chains(one, two, len(nodes.level)):
        points = nodes.points[order]
        moved = (np.diff(points, axis=0) != 0).any(axis=1)
        if moved.any():
            points = points[np.concatenate([[True], moved])]
            found.append(Track(points, int(nodes.level[order[0]]), face[chord][moved]))
    return found


class _Nodes(NamedTuple):
    """Where levels cross edges: those of edge e are offset[e] + 0, 1, ... for the levels begin[e], begin[e] + 1, ..."""

    offset: Ints
    begin: Ints
    level: Ints
    points: Floats


def _nodes(surface: Surface, x: Floats, levels: Floats) -> _Nodes:
    ends = surface.edges.ends
    below = np.searchsorted(levels, x, side="right")  # a vertex on a level is above it
    begin, end = below[ends].min(axis=1), below[ends].max(axis=1)
    offset = np.concatenate([[0], np.cumsum(end - begin)])
    edge = np.repeat(np.arange(len(ends)), end - begin)
    level = begin[edge] + np.arange(offset[-1]) - offset[edge]
    p, q = ends[edge].T
    t = ((levels[level] - x[p]) / (x[q] - x[p]))[:, None] if len(edge) else np.zeros((0, 1))
    t = np.clip(t, 0.0, 1.0)
    return _Nodes(
        offset[:-1], begin, level, np.where(t == 1, surface.V[q], surface.V[p] + t * (surface.V[q] - surface.V[p]))
    )


def _chords(surface: Surface, x: Floats, levels: Floats, nodes: _Nodes) -> tuple[Ints, Ints, Ints]:
    """The face and the two nodes of every chord."""
    below = np.searchsorted(levels, x[surface.F], side="right")
    rank = np.argsort(below, axis=1, kind="stable")
    low, mid, high = np.take_along_axis(below, rank, axis=1).T
    face = np.repeat(np.arange(surface.m), high - low)
    level = low[face] + np.arange(len(face)) - (np.cumsum(high - low) - (high - low))[face]
    lowest, middle, highest = rank[face].T
    longest = _side(lowest, highest)
    other = np.where(level < mid[face], _side(lowest, middle), _side(middle, highest))
    edge = surface.edges.of[face]
    at = np.arange(len(face))
    e, f = edge[at, longest], edge[at, other]
    return face, nodes.offset[e] + level - nodes.begin[e], nodes.offset[f] + level - nodes.begin[f]


def _side(i: Ints, j: Ints) -> Ints:
    """The side between two corners of a triangle: side c runs from corner c to the next."""
    return np.where((i + 1) % 3 == j, i, j)


def chains(one: Ints, two: Ints, count: int) -> list[tuple[Ints, Ints]]:
    """Links one (k,) - two (k,) between `count` nodes, at most two at each, as chains: their nodes, and their links,
    (c,).

    Open chains first, each from its end with the lower number; of closed ones the first node is named twice.
    """
    node = np.concatenate([one, two])
    order = np.argsort(node, kind="stable")
    degree = np.bincount(node, minlength=count)
    start = np.cumsum(degree) - degree
    link = np.full((count, 2), -1)
    for k in range(2):
        has = degree > k
        link[has, k] = order[start[has] + k] % len(one)
    sum_of_ends, links = (one + two).tolist(), link.tolist()
    used = bytearray(len(one))
    found = []
    for begin in [*np.flatnonzero(degree == 1).tolist(), *np.flatnonzero(degree == 2).tolist()]:
        nodes, passed, at = [begin], list[int](), begin
        while True:
            a, b = links[at]
            step = a if a >= 0 and not used[a] else b
            if step < 0 or used[step]:
                break
            used[step] = True
            at = sum_of_ends[step] - at
            nodes.append(at)
            passed.append(step)
        if passed:
            found.append((np.array(nodes), np.array(passed)))
    return found


def simplified_line(points: Floats, tolerance: float) -> Floats:
    """The polyline (k, d) with fewer of its own points: none that is left out is farther than `tolerance` from it.

    The ends stay; of a closed polyline also the point farthest from its beginning [Douglas, Peucker 1973].
    """
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    if len(points) > 3 and (points[0] == points[-1]).all():
        far = int(np.linalg.norm(points - points[0], axis=1).argmax())
        keep[far] = True
        spans = [(0, far), (far, len(points) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        off = _from_segment(points[a + 1 : b], points[a], points[b])
        worst = int(off.argmax())
        if off[worst] > tolerance:
            middle = a + 1 + worst
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return points[keep]


def _from_segment(points: Floats, a: Floats, b: Floats) -> Floats:
    """(k,) distances of points from the segment from a to b."""
    along = b - a
    squared = float(along @ along)
    away = points - a
    if squared:  # np.clip and np.linalg.norm would take longer than all else here
        away -= np.minimum(np.maximum(away @ along / squared, 0.0), 1.0)[:, None] * along
    return np.asarray(np.sqrt((away * away).sum(axis=1)))
