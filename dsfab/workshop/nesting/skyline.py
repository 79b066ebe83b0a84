"""Placement of parts on a partly filled sheet."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.workshop.parts import FlatPart, polygon_area, rotation_matrix

ROUNDING = 1e-9  # tolerance for rounding errors (m)


@dataclass(frozen=True, eq=False)
class PartShape:
    """Shape of a rotated part: heights of its lower and upper edge in k narrow columns.
    turn : rotation, radians.    low, size : (2,) lowest corner and size of the rotated part's box, metres.
    lower, upper : (k,) heights of the edges, moved outwards by half of the gap between parts, metres."""

    part: FlatPart
    turn: float
    low: Floats
    size: Floats
    lower: Floats
    upper: Floats
    top: float
    total: float
    thick: float


@dataclass(frozen=True)
class ColumnGrid:
    """Division of sheets into columns of the width `step`, metres.
    gap     : distance between parts, metres.    grain : True if parts of members must lie lengthwise on sheets.
    tallest : length of the longest part that may lie across a sheet, metres."""

    gap: float
    step: float
    tallest: float
    grain: bool = False


def column_grid(stock: Sequence[tuple[float, float]], gap: float, grain: bool = False) -> ColumnGrid:
    """Return the narrow columns into which nesting divides sheets. stock : lengths and widths of sheets (m)."""
    step = min(0.01, max(max(size) for size in stock) / 250)  # column width (m), at most 1/250 of the longest sheet
    return ColumnGrid(gap, step, max(min(size) for size in stock) - 2 * gap + ROUNDING, grain)


def part_shapes(part: FlatPart, grid: ColumnGrid, boxes: bool) -> list[PartShape]:
    """Return the shapes of a part in all permitted rotations.
    boxes : true to use the bounding box of the part instead of its outline."""
    turns = (0.0, np.pi / 2) if boxes else (0.0, np.pi, np.pi / 2, -np.pi / 2)
    shapes = [_shape(part, turn, boxes, grid.gap, grid.step) for turn in turns[:1]]
    only_along = part.size[0] > grid.tallest or (grid.grain and bool(part.member))
    allowed = [turn for turn in turns[1:] if not (only_along and abs(turn) == np.pi / 2)]
    return shapes + [_shape(part, turn, boxes, grid.gap, grid.step) for turn in allowed]


@lru_cache(maxsize=4096)
def _shape(part: FlatPart, turn: float, boxes: bool, gap: float, step: float) -> PartShape:
    outline = part.outline @ rotation_matrix(turn)
    low, size, grid = outline.min(axis=0), np.ptp(outline, axis=0), ColumnGrid(gap, step, np.inf)
    if boxes:
        k = _column_count(size, grid)
        lower, upper = np.full(k, -gap / 2), np.full(k, size[1] + gap / 2)
    else:
        lower, upper = _columns(outline - low, size, grid)
    extent = float(upper.max()), float(lower.sum()), float((upper - lower).max())
    return PartShape(part, turn, low, size, lower, upper, *extent)


def _column_count(size: Floats, grid: ColumnGrid) -> int:
    return int(np.ceil((size[0] + grid.gap) / grid.step - ROUNDING))


def _columns(outline: Floats, size: Floats, grid: ColumnGrid) -> tuple[Floats, Floats]:
    reach = grid.gap / 2
    count = 16
    angle = np.arange(count) * 2 * np.pi / count
    circle = reach / np.cos(np.pi / count) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corner = np.arange(_column_count(size, grid) + 1, dtype=np.float64) * grid.step - reach
    a, b = outline, np.roll(outline, -1, axis=0)
    if polygon_area(outline) < 0:
        a, b = b, a
    below, above = a[:, 0] <= b[:, 0], a[:, 0] >= b[:, 0]
    down, up = circle[circle[:, 1] <= ROUNDING * reach], circle[circle[:, 1] >= -ROUNDING * reach]
    lower = _column_extremes(np.minimum, corner, *(_shifted_points(x[below], down) for x in (a, b)))
    return lower, _column_extremes(np.maximum, corner, *(_shifted_points(x[above], up) for x in (b, a)))


def _shifted_points(points: Floats, ways: Floats) -> Floats:
    return np.asarray((points[None] + ways[:, None]).reshape(-1, 2))


def _column_extremes(f: np.ufunc, corner: Floats, p: Floats, q: Floats) -> Floats:
    extremes = np.full(len(corner) - 1, np.inf if f is np.minimum else -np.inf)
    wide = np.maximum(q[:, 0] - p[:, 0], 1e-15)
    i = np.clip(np.searchsorted(corner, p[:, 0], side="right") - 1, 0, len(extremes) - 1)
    j = np.clip(np.searchsorted(corner, q[:, 0], side="left") - 1, i, len(extremes) - 1)
    column_counts = j - i + 1
    segment = np.repeat(np.arange(len(p)), column_counts)
    starts = np.cumsum(column_counts) - column_counts
    k = np.repeat(i - starts, column_counts) + np.arange(column_counts.sum())
    (x, low), high, slim = p[segment].T, (q[:, 1] - p[:, 1])[segment], wide[segment]
    ends = (low + np.minimum(np.maximum((edges[k] - x) / slim, 0), 1) * high for edges in (corner[:-1], corner[1:]))
    f.at(extremes, k, f(*ends))
    return extremes


@dataclass(frozen=True, eq=False)
class NestedPart:
    """Part on a sheet. turn : rotation, radians.    shift : translation (x, y) after the rotation, metres."""

    part: FlatPart
    turn: float
    shift: tuple[float, float]

    @property
    def placed_part(self) -> FlatPart:
        return self.part.moved_by(self.turn, np.array(self.shift))


@dataclass(eq=False)
class SheetGap:
    """Free space below a part. floor, ceiling : (k,) lowest and highest y in columns from `begin` on (m)."""

    begin: int
    floor: Floats
    ceiling: Floats
    high: float

    @classmethod
    def from_columns(cls, begin: int, floor: Floats, ceiling: Floats, grid: ColumnGrid) -> "list[SheetGap]":
        """Return the gaps between floor (k,) and ceiling (k,) that have room for a part."""
        high, least = ceiling - floor, grid.gap + 0.02  # least: height and width of a useful gap, metres
        bounds = np.flatnonzero(np.diff(np.concatenate([[0], high > least, [0]])))
        return [
            cls(begin + i, floor[i:j].copy(), ceiling[i:j].copy(), float(high[i:j].max()))
            for i, j in bounds.reshape(-1, 2).tolist()
            if (j - i) * grid.step > least
        ]


@dataclass(eq=False)
class OpenSheet:
    """Partly filled sheet; lengths in metres, areas in m2.
    skyline : (k,) used height of each of k columns.    refused : length, width and area of parts that did not fit."""

    size: tuple[float, float]
    skyline: Floats
    free_area: float
    lowest: float
    refused: list[tuple[float, float, float]] = field(default_factory=list)
    parts: list[NestedPart] = field(default_factory=list)
    gaps: list[SheetGap] = field(default_factory=list)


def empty_sheet(size: tuple[float, float], grid: ColumnGrid) -> OpenSheet:
    """Return an empty sheet of the size (length, width), metres."""
    columns = int(np.ceil((size[0] - grid.gap) / grid.step))  # the last column may extend beyond the sheet's edge
    return OpenSheet(size, np.full(columns, grid.gap / 2), size[0] * size[1], grid.gap / 2)


class _PartPlace(NamedTuple):
    score: float
    rise: float
    at: int
    shape: PartShape


def place_part(sheet: OpenSheet, turns: list[PartShape], grid: ColumnGrid) -> bool:
    """Place a part on a sheet if it fits; return True if it fits. turns : shapes of the part in permitted rotations."""
    a, b, area = float(turns[0].size[0]), float(turns[0].size[1]), turns[0].part.area
    if sheet.free_area < area or any(a >= x and b >= y and area >= z for x, y, z in sheet.refused):
        return False
    short, thin = min(len(shape.lower) for shape in turns), min(shape.thick for shape in turns)
    wide = [k for k, gap in enumerate(sheet.gaps) if gap.high >= thin and len(gap.floor) >= short]
    if any(_place_in_gap(sheet, k, turns, grid) for k in wide):
        return True
    place = _best_on_skyline(sheet, turns, grid)
    if place is None:
        sheet.refused = [refusal for refusal in sheet.refused if refusal[0] < a or refusal[1] < b or refusal[2] < area]
        sheet.refused.append((a, b, area))
        return False
    columns = slice(place.at, place.at + len(place.shape.lower))
    below = sheet.skyline[columns].copy()
    sheet.gaps += SheetGap.from_columns(place.at, below, place.rise + place.shape.lower, grid)
    sheet.skyline[columns] = np.maximum(below, place.rise + place.shape.upper)
    sheet.parts.append(_nested_part(place.shape, place.at, place.rise, grid))
    sheet.lowest = float(sheet.skyline.min())
    open_area = sheet.size[0] * (sheet.size[1] - grid.gap / 2) - grid.step * sheet.skyline.sum()
    sheet.free_area = float(open_area) + _gap_area(sheet, grid)
    return True


def _best_on_skyline(sheet: OpenSheet, turns: list[PartShape], grid: ColumnGrid) -> _PartPlace | None:
    place: _PartPlace | None = None
    gap, step, top = grid.gap, grid.step, sheet.size[1] - grid.gap / 2
    cached: dict[int, tuple[Floats, Floats]] = {}
    for shape in turns:
        k = len(shape.lower)
        if k > len(sheet.skyline) or sheet.lowest + shape.size[1] + gap > top + step:
            continue
        if k not in cached:  # k is the same for the shape rotated by 180 degrees
            column_runs = _column_windows(sheet.skyline, k)
            cached[k] = column_runs, column_runs.sum(axis=1)
        windows, sums = cached[k]
        rise = (windows - shape.lower).max(axis=1)
        height = rise + shape.top
        right = gap + step * np.arange(len(windows)) + shape.size[0]
        inside = (height <= top + ROUNDING) & (right <= sheet.size[0] - gap + ROUNDING)
        if not inside.any():
            continue
        lost = (rise * k + shape.total - sums) / k
        score = np.where(inside, height + lost, np.inf)
        column = int(score.argmin())
        if np.isfinite(score[column]) and (place is None or score[column] < place.score - ROUNDING):
            place = _PartPlace(float(score[column]), float(rise[column]), column, shape)
    return place


def _place_in_gap(sheet: OpenSheet, number: int, turns: list[PartShape], grid: ColumnGrid) -> bool:
    gap, place = sheet.gaps[number], None
    for shape in turns:
        k = len(shape.lower)
        if k > len(gap.floor) or shape.thick > gap.high:
            continue
        rise = (_column_windows(gap.floor, k) - shape.lower).max(axis=1)
        inside = (_column_windows(gap.ceiling, k) - shape.upper).min(axis=1) >= rise - ROUNDING
        right = grid.gap + grid.step * (gap.begin + np.arange(len(rise))) + shape.size[0]
        inside &= right <= sheet.size[0] - grid.gap + ROUNDING
        column = int(np.where(inside, rise, np.inf).argmin())
        if inside[column] and (place is None or rise[column] + shape.top < place.score - ROUNDING):
            place = _PartPlace(float(rise[column]) + shape.top, float(rise[column]), column, shape)
    if place is None:
        return False
    columns = slice(place.at, place.at + len(place.shape.lower))
    below = gap.floor[columns].copy()
    gap.floor[columns] = np.maximum(below, place.rise + place.shape.upper)
    under = SheetGap.from_columns(gap.begin + place.at, below, place.rise + place.shape.lower, grid)
    before = _gap_area(sheet, grid)
    sheet.gaps[number : number + 1] = [*SheetGap.from_columns(gap.begin, gap.floor, gap.ceiling, grid), *under]
    sheet.free_area += _gap_area(sheet, grid) - before
    sheet.parts.append(_nested_part(place.shape, gap.begin + place.at, place.rise, grid))
    return True


def _nested_part(shape: PartShape, column: int, rise: float, grid: ColumnGrid) -> NestedPart:
    shift = grid.gap + column * grid.step - float(shape.low[0]), rise - float(shape.low[1])
    return NestedPart(shape.part, shape.turn, shift)


def _gap_area(sheet: OpenSheet, grid: ColumnGrid) -> float:
    return grid.step * float(sum((gap.ceiling - gap.floor).sum() for gap in sheet.gaps))


def _column_windows(skyline: Floats, k: int) -> Floats:
    (step,) = skyline.strides
    return np.ndarray((len(skyline) - k + 1, k), skyline.dtype, skyline, strides=(step, step))
