"""Walls as curves: over the plane of their chart, and in space on both skins, with the same parameter everywhere.

An outline is a polyline with a vertex on each edge of the mesh that it crosses. Its curve stays within a share of the
thickness of it everywhere; a run that no spline follows so closely is cut in two where it is farthest off, and a
segment is its own curve in the end.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.smooth.nodes import Nodes
from dsfab.export.smooth.outline import Run
from dsfab.export.smooth.splines import Spline, evenly, spline_through, straight

TIGHTER = (1.0, 0.2, 0.04)
"""Tolerances of a run that was refused so often."""

FLAT = 0.55
"""Tolerance of outlines over their polylines, as a share of the distance that is allowed."""

OF_CHORD = 0.5
"""Share of the mesh's own chord error that is added to it: so much less does the mesh know of its outline."""

IN_SPACE = 1 / 50
"""Tolerance of the curves on the skins, as a share of the thickness."""

OF_LOOP = 0.03
"""A loop is followed at least as closely as this share of its width: the sides of a slit must not cross."""


@dataclass(frozen=True, eq=False)
class Edge:
    """A run as curves.

    start, end   : vertices of the sheet, its nodes.
    upper, lower : cubics of the same knots, or lines.
    flat         : by chart, the curve over its plane.
    gap          : largest distance between the curves in space and those on the skins, millimetres.
    wall         : whether a wall stands on it; otherwise two charts meet there.
    """

    start: int
    end: int
    upper: Spline
    lower: Spline
    flat: dict[int, Spline]
    gap: float
    wall: bool

    @cached_property
    def spans(self) -> int:
        """The power of two that makes all knots whole numbers, short to write: they are halves of halves of [0, 1]."""
        knots = np.concatenate([self.upper.knots, *(curve.knots for curve in self.flat.values())])
        return next(1 << k for k in range(30) if not np.any((1 << k) * knots % 1))


@dataclass(frozen=True)
class Allowed:
    """Millimetres: the thickness of the sheet, how far its solid may be off the mesh, and the mesh's chord error."""

    thickness: float
    distance: float
    chord: float

    def outline(self, run: Run, steep: float, level: int) -> float:
        """How far the curve of a run may be off its polyline, seen in the plane."""
        most = min(FLAT * self.distance + OF_CHORD * self.chord, OF_LOOP * run.width)
        return TIGHTER[level] * most / steep

    def in_space(self, run: Run, level: int) -> float:
        """How far the curves of a run in space may be off those on the skins."""
        return TIGHTER[level] * min(IN_SPACE * self.thickness, OF_LOOP * run.width)


class _Part(NamedTuple):
    """A part of a run of walls, its curve over the plane and the level it was fitted at."""

    run: Run
    flat: Spline
    level: int


def wall_edges(runs: list[tuple[Run, int]], k: int, nodes: Nodes, allowed: Allowed) -> list[list[Edge]]:
    """The edges of each of the runs, with the level that it was refused to, in chart k; all skins are asked at once."""
    found = [_parts(run, level, k, nodes, allowed) for run, level in runs]
    parts = [part for some in found for part in some]
    nodes.add(np.unique([v for part in parts for v in part.run.vertices[[0, -1]]]))
    x = [parameters(part.flat) for part in parts]
    on = nodes.charts[k].both(np.concatenate([part.flat(at) for part, at in zip(parts, x, strict=True)]))
    both = np.split(on, np.cumsum([len(at) for at in x])[:-1])
    edges = iter([_in_space(*of, k, nodes, allowed) for of in zip(parts, x, both, strict=True)])
    return [[next(edges) for _ in some] for some in found]


def _parts(run: Run, level: int, k: int, nodes: Nodes, allowed: Allowed) -> list[_Part]:
    """A run over the plane, divided until each part has a curve within the tolerance."""
    line = nodes.uv[k][run.vertices]
    if len(line) == 2:
        return [_Part(run, straight(line[0], line[1]), level)]
    tolerance = allowed.outline(run, float(nodes.steep[k][run.vertices].max()), level)
    x, Q = spread(line)
    flat, off = spline_through(x, Q, tolerance)
    if off <= tolerance:
        return [_Part(run, flat, level)]
    worst = x[np.linalg.norm(flat(x) - Q, axis=1).argmax()]
    length = np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))
    at = 1 + int(np.abs(length[:-1] / length[-1] - worst).argmin())
    halves = (Run(v, run.beyond, run.width) for v in (run.vertices[: at + 1], run.vertices[at:]))
    return [part for half in halves for part in _parts(half, level, k, nodes, allowed)]


def _in_space(part: _Part, x: Floats, both: Floats, k: int, nodes: Nodes, allowed: Allowed) -> Edge:
    """The curves on both skins (m, 6) at parameters x."""
    space, off = spline_through(x, both, allowed.in_space(part.run, part.level), parts=2)
    return ended(part.run, space, {k: part.flat}, off, nodes, wall=True)


def spread(line: Floats) -> tuple[Floats, Floats]:
    """Even samples of a polyline, many more than it has vertices; their number is a power of two."""
    count = 1 << int(np.ceil(np.log2(np.clip(16 * len(line), 64, 4096))))
    total = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    return evenly(line, total / count, fewest=count, most=count)


def parameters(curve: Spline) -> Floats:
    """Parameters to measure at: many in each span."""
    breaks = np.unique(curve.knots)
    each = max(24, int(np.ceil(128 / (len(breaks) - 1))))
    steps = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(each) / each
    return np.concatenate([steps.ravel(), [1.0]])


def ended(run: Run, space: Spline, flat: dict[int, Spline], off: float, nodes: Nodes, wall: bool) -> Edge:
    """The curves with their ends pulled onto the nodes."""
    start, end = int(run.vertices[0]), int(run.vertices[-1])
    both = space.poles.copy()
    wanted = np.concatenate([nodes.at[start].reshape(1, 6), nodes.at[end].reshape(1, 6)])
    moved = float(np.linalg.norm((wanted - both[[0, -1]]).reshape(2, 2, 3), axis=2).max())
    both[[0, -1]] = wanted
    upper, lower = (Spline(space.knots, both[:, i : i + 3], space.degree) for i in (0, 3))
    return Edge(start, end, upper, lower, flat, off + moved, wall)
