"""Plan and elevations: the lines of a sheet as they are seen along an axis, what lies behind the sheet left out.

What hides a point is found in a depth picture of the sheet: the sheet is sampled finer than the picture's cells, each
cell keeps the depth nearest to the eye, and a point is hidden where every cell around it is nearer by a margin.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.part import Part
from dsfab.surface import StructureLine, simplified_line
from dsfab.surface.mesh import Surface

CELLS = 800
"""Cells of the depth picture along its longer side."""
MARGIN = 0.01
"""Share of the part's size by which something must lie in front of a point to hide it."""
THIN = 1e-6
"""A view that is narrower than this share of the part's size is a line and is not drawn."""

AXES = {
    "Plan": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "Front elevation": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
    "Right elevation": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
}
"""By title, what points to the right, upwards, and to the eye: from above, from -y, from +x."""


@dataclass(frozen=True, eq=False)
class DrawingView:
    """One drawing: `runs` are visible stretches of lines, (k, 2) millimetres; `loops` the outline of a region to fill,
    even-odd, empty where the sheet covers itself."""

    title: str
    runs: tuple[tuple[StructureLine, Floats], ...]
    loops: tuple[Floats, ...]
    low: Floats
    high: Floats

    @cached_property
    def extent(self) -> Floats:
        """(2,) width and height, millimetres."""
        return self.high - self.low


def views(part: Part) -> list[DrawingView]:
    """Plan, front and right elevation of a sheet with its lines; without those in which it is seen edge-on."""
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    sheet = Surface(part.V, part.F)
    found = []
    for title, axes in AXES.items():
        right, up, eye = np.array(axes)
        X = part.V @ np.stack([right, up], axis=1)
        used = X[part.F.ravel()]
        low, high = used.min(axis=0), used.max(axis=0)
        if (high - low).min() > THIN * size:
            found.append(_view(title, sheet, part.details.lines, np.stack([right, up, eye]), low, high, size))
    return found


def _view(
    title: str, sheet: Surface, lines: tuple[StructureLine, ...], axes: Floats, low: Floats, high: Floats, size: float
) -> DrawingView:
    facing = sheet.normals @ axes[2]
    if (facing > 0).all() or (facing < 0).all():  # one layer, all of it seen
        loops = tuple(sheet.V[loop] @ axes[:2].T for loop in sheet.loops)
        return DrawingView(title, tuple((line, line.points @ axes[:2].T) for line in lines), loops, low, high)
    cell = float((high - low).max()) / CELLS
    depth = _Depth.of(sheet.V @ axes.T, sheet.F, low, high, cell)
    runs = []
    for line in lines:
        points = _dense(line.points, 2 * cell) @ axes.T
        seen = ~depth.hides(points, MARGIN * size)
        runs += [(line, simplified_line(run, cell / 4)) for run in _stretches(points[:, :2], seen)]
    return DrawingView(title, tuple(runs), (), low, high)


@dataclass(frozen=True, eq=False)
class _Depth:
    """The depth picture: (w, h) largest third coordinate in each cell, -inf where nothing is."""

    low: Floats
    cell: float
    depth: Floats

    @classmethod
    def of(cls, X: Floats, F: Ints, low: Floats, high: Floats, cell: float) -> "_Depth":
        """Every triangle is sampled on a grid of its own, no coarser than 0.7 cells."""
        shape = np.ceil((high - low) / cell).astype(np.int64) + 3
        depth = np.full(int(shape.prod()), -np.inf)
        corners = X[F]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1)[..., :2] - corners[..., :2], axis=2).max(axis=1)
        steps = np.ceil(1.25 ** np.ceil(np.log(np.maximum(sides / (0.7 * cell), 1)) / np.log(1.25))).astype(np.int64)
        for count in np.unique(steps):
            i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
            inside = i + j <= count
            a, b = i[inside] / count, j[inside] / count
            weights = np.stack([1 - a - b, a, b], axis=1)
            group = corners[steps == count]
            for part in np.array_split(group, max(1, len(group) * len(a) // 1_000_000)):
                points = (weights @ part).reshape(-1, 3)
                at = ((points[:, :2] - low) / cell).astype(np.int64) + 1
                np.maximum.at(depth, at[:, 0] * shape[1] + at[:, 1], points[:, 2])
        return cls(low, cell, depth.reshape(shape))

    def hides(self, points: Floats, margin: float) -> Bools:
        """(k,) whether all nine cells around a point (k, 3) lie in front of it by the margin."""
        at = np.clip(((points[:, :2] - self.low) / self.cell).astype(np.int64) + 1, 1, np.array(self.depth.shape) - 2)
        nearest = np.full(len(points), np.inf)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                nearest = np.minimum(nearest, self.depth[at[:, 0] + i, at[:, 1] + j])
        return np.asarray(nearest > points[:, 2] + margin)


def _dense(points: Floats, step: float) -> Floats:
    """The polyline (k, 3) with points on it no farther apart than `step`."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    counts = np.maximum(np.ceil(lengths / step).astype(np.int64), 1)
    segment = np.repeat(np.arange(len(counts)), counts)
    t = (np.arange(len(segment)) - (np.cumsum(counts) - counts)[segment]) / counts[segment]
    inner = points[segment] + t[:, None] * (points[segment + 1] - points[segment])
    return np.concatenate([inner, points[-1:]])


def _stretches(points: Floats, seen: Bools) -> list[Floats]:
    """The runs of at least two seen points."""
    at = np.concatenate([[-1], np.flatnonzero(~seen), [len(seen)]])
    return [points[a + 1 : b] for a, b in pairwise(at) if b - a > 2]
