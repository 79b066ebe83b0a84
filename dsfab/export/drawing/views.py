"""Plan and elevations of a sheet without hidden lines."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.export.part import Part
from dsfab.surface import StructureLine, simplified_line
from dsfab.surface.mesh import Surface

AXES = {
    "Plan": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "Front elevation": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
    "Right elevation": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
}
"""Directions of each view to the right, upwards and to the eye, by the title of the view."""


@dataclass(frozen=True, eq=False)
class DrawingView:
    """A view of a sheet.
    runs  : visible parts of lines: the line, and points (k, 2), mm.    low, high : corners of the view, mm.
    loops : outline of the region to fill, by the even-odd rule; empty if the sheet hides a part of itself."""

    title: str
    runs: tuple[tuple[StructureLine, Floats], ...]
    loops: tuple[Floats, ...]
    low: Floats
    high: Floats

    @cached_property
    def extent(self) -> Floats:
        """Width and height (2,) of the view, millimetres."""
        return self.high - self.low


def views(part: Part) -> list[DrawingView]:
    """Return the plan and the elevations of a sheet with its lines."""
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    sheet = Surface(part.V, part.F)
    drawings = []
    for title, axes in AXES.items():
        right, up, eye = np.array(axes)
        X = part.V @ np.stack([right, up], axis=1)
        used = X[part.F.ravel()]
        low, high = used.min(axis=0), used.max(axis=0)
        if (high - low).min() > 1e-6 * size:  # otherwise the view shows only a line
            drawings.append(_view(title, sheet, part.details.lines, np.stack([right, up, eye]), low, high, size))
    return drawings


def _view(
    title: str, sheet: Surface, lines: tuple[StructureLine, ...], axes: Floats, low: Floats, high: Floats, size: float
) -> DrawingView:
    facing = sheet.normals @ axes[2]
    if (facing > 0).all() or (facing < 0).all():  # no part of the sheet hides another
        loops = tuple(sheet.V[loop] @ axes[:2].T for loop in sheet.loops)
        return DrawingView(title, tuple((line, line.points @ axes[:2].T) for line in lines), loops, low, high)
    cell = float((high - low).max()) / 800
    margin = 0.01 * size  # the surface hides a point that is behind it by more than this distance
    depth = _DepthPicture.from_mesh(sheet.V @ axes.T, sheet.F, low, high, cell)
    runs = []
    for line in lines:
        points = _dense(line.points, 2 * cell) @ axes.T
        seen = ~depth.hides(points, margin)
        runs += [(line, simplified_line(run, cell / 4)) for run in _stretches(points[:, :2], seen)]
    return DrawingView(title, tuple(runs), (), low, high)


@dataclass(frozen=True, eq=False)
class _DepthPicture:
    """Depth image of a mesh. depth : (w, h) largest coordinate towards the eye in each cell; -inf in empty cells.
    low : (2,) corner of the grid.    cell : size of a cell."""

    low: Floats
    cell: float
    depth: Floats

    @classmethod
    def from_mesh(cls, X: Floats, F: Ints, low: Floats, high: Floats, cell: float) -> "_DepthPicture":
        """Return the depth image of a mesh X (n, 3), F (m, 3) between the corners `low` and `high` of a view."""
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
                cell_index = ((points[:, :2] - low) / cell).astype(np.int64) + 1
                np.maximum.at(depth, cell_index[:, 0] * shape[1] + cell_index[:, 1], points[:, 2])
        return cls(low, cell, depth.reshape(shape))

    def hides(self, points: Floats, margin: float) -> Bools:
        cell_index = ((points[:, :2] - self.low) / self.cell).astype(np.int64) + 1
        cell_index = np.clip(cell_index, 1, np.array(self.depth.shape) - 2)
        nearest = np.full(len(points), np.inf)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                nearest = np.minimum(nearest, self.depth[cell_index[:, 0] + i, cell_index[:, 1] + j])
        return np.asarray(nearest > points[:, 2] + margin)


def _dense(points: Floats, step: float) -> Floats:
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    counts = np.maximum(np.ceil(lengths / step).astype(np.int64), 1)
    segment = np.repeat(np.arange(len(counts)), counts)
    t = (np.arange(len(segment)) - (np.cumsum(counts) - counts)[segment]) / counts[segment]
    return np.concatenate([points[segment] + t[:, None] * (points[segment + 1] - points[segment]), points[-1:]])


def _stretches(points: Floats, seen: Bools) -> list[Floats]:
    hidden = np.concatenate([[-1], np.flatnonzero(~seen), [len(seen)]])
    return [points[a + 1 : b] for a, b in pairwise(hidden) if b - a > 2]


PAPER = (420.0, 297.0)  # width and height of A3 paper, millimetres
PAPER_MARGIN = 10.0  # distance from the edge of the paper to the frame, millimetres
VIEW_MARGINS = (24.0, 10.0, 12.0, 24.0)  # paper (mm) around a view for dimensions and title: left, top, right, bottom
STEPS = (1.0, 2.0, 2.5, 5.0)  # usual scales are these numbers times powers of ten


@dataclass(frozen=True, eq=False)
class PlacedView:
    """A view on paper. corner : upper left corner of the view, mm to the right of and below the paper's corner.
    scale : millimetres of the view per millimetre of paper."""

    view: DrawingView
    corner: tuple[float, float]
    scale: float

    @property
    def size(self) -> Floats:
        """Width and height (2,) of the view on paper, millimetres."""
        return np.asarray(self.view.extent / self.scale)

    def on_paper(self, points: Floats) -> Floats:
        """Transform points (k, 2) of the view to positions on paper in millimetres, y downwards."""
        x, y = ((points - self.view.low) / self.scale).T
        return np.stack([self.corner[0] + x, self.corner[1] + self.size[1] - y], axis=1)


def views_on_paper(part: Part, title: tuple[float, float]) -> tuple[float, list[PlacedView]]:
    """Return the scale (millimetres of the view per millimetre of paper), and the views on paper.
    title : width and height of the title block, mm."""
    by_name = {view.title.split()[0]: view for view in views(part)}
    rows = (("Plan", "Front", "Right"),), (("Front", "Right"), ("Plan",)), (("Plan",), ("Front",), ("Right",))
    choices = [[[by_name[k] for k in row if k in by_name] for row in layout] for layout in rows]
    scale, chosen = min(((_scale(c, title), i) for i, c in enumerate(choices)), key=lambda one: one)
    return scale, _place_rows([row for row in choices[chosen] if row], scale, title)


def _scale(rows: list[list[DrawingView]], title: tuple[float, float]) -> float:
    extents = np.concatenate([view.extent for row in rows for view in row])
    power = 10.0 ** np.floor(np.log10(extents.max() / max(PAPER)) - 1)
    while True:
        for step in STEPS:
            if _fits(rows, float(f"{step * power:.6g}"), title):
                return float(f"{step * power:.6g}")
        power *= 10


def _fits(rows: list[list[DrawingView]], scale: float, title: tuple[float, float]) -> bool:
    wide, high = PAPER[0] - 2 * PAPER_MARGIN, PAPER[1] - 2 * PAPER_MARGIN
    sizes = [_row_size(row, scale) for row in rows if row]
    if any(width > wide for width, _ in sizes):
        return False
    beside_title = sizes[-1][0] <= wide - title[0]
    return sum(height for _, height in sizes) <= (high if beside_title else high - title[1])


def _row_size(row: list[DrawingView], scale: float) -> tuple[float, float]:
    width = sum(float(view.extent[0]) / scale + VIEW_MARGINS[0] + VIEW_MARGINS[2] for view in row)
    return width, max(float(view.extent[1]) / scale for view in row) + VIEW_MARGINS[1] + VIEW_MARGINS[3]


def _place_rows(rows: list[list[DrawingView]], scale: float, title: tuple[float, float]) -> list[PlacedView]:
    sizes = [_row_size(row, scale) for row in rows]
    total = sum(height for _, height in sizes)
    beside_title = sizes[-1][0] <= PAPER[0] - 2 * PAPER_MARGIN - title[0]
    height_left = PAPER[1] - 2 * PAPER_MARGIN - (0 if beside_title and len(rows) > 1 else title[1]) - total
    gap = max(height_left / (len(rows) + 1), 0.0)
    free = min(
        (PAPER[0] - 2 * PAPER_MARGIN - width) / (len(row) + 1) for row, (width, _) in zip(rows, sizes, strict=True)
    )
    space = max(free if len(rows) == 1 else min(free, 30.0), 0.0)  # equal gaps in all rows align the views
    placed, y = list[PlacedView](), PAPER_MARGIN
    for row, (_, height) in zip(rows, sizes, strict=True):
        y, x = y + gap, PAPER_MARGIN
        for view in row:
            w, h = (view.extent / scale).tolist()
            x += space
            placed.append(PlacedView(view, (x + VIEW_MARGINS[0], y + height - VIEW_MARGINS[3] - h), scale))
            x += w + VIEW_MARGINS[0] + VIEW_MARGINS[2]
        y += height
    return placed
