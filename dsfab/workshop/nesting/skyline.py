"""A sheet while it is filled: shapes of parts in narrow columns, the skyline and the gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.workshop.parts import FlatPart, polygon_area, turning

NEAR = 1e-9
"""Rounding tolerance (m)."""


@dataclass(frozen=True, eq=False)
class PartShape:
    """Turned part: lower and upper edges (k,) in columns, half of the gap beyond its own (m).

    low : (2,) lowest corner.    size : (2,) of its box.    top : highest value of the upper edge.
    total : sum of the lower edge.    thick : largest height between both edges.
    """

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
class Raster:
    """Gap, column width and largest height of a part (m), and whether parts of members lie along the sheets only."""

    gap: float
    step: float
    tallest: float
    grain: bool = False


def raster(stock: Sequence[tuple[float, float]], gap: float, grain: bool = False) -> Raster:
    """Return the columns for stock lengths and widths (m)."""
    step = min(0.01, max(max(size) for size in stock) / 250)  # at least 250 columns on the longest sheet
    return Raster(gap, step, max(min(size) for size in stock) - 2 * gap + NEAR, grain)


def part_shapes(part: FlatPart, ask: Raster, boxes: bool) -> list[PartShape]:
    """Return a part along the sheet in both directions, and across it if it is short enough; a box needs two turns."""
    turns = (0.0, np.pi / 2) if boxes else (0.0, np.pi, np.pi / 2, -np.pi / 2)
    found = [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[:1]]
    tall = part.size[0] > ask.tallest or (ask.grain and bool(part.member))  # across the sheet
    return found + [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[1:] if not (tall and _across(turn))]


def _across(turn: float) -> bool:
    return abs(turn) == np.pi / 2


@lru_cache(maxsize=4096)
def _shape(part: FlatPart, turn: float, boxes: bool, gap: float, step: float) -> PartShape:
    """Return a turned part; the cache serves repeated nests on other stock and for hints."""
    outline = part.outline @ turning(turn)
    low, size, ask = outline.min(axis=0), np.ptp(outline, axis=0), Raster(gap, step, np.inf)
    lower, upper = _box_columns(size, ask) if boxes else _columns(outline - low, size, ask)
    return PartShape(
        part, turn, low, size, lower, upper, float(upper.max()), float(lower.sum()), float((upper - lower).max())
    )


def _count(size: Floats, ask: Raster) -> int:
    return int(np.ceil((size[0] + ask.gap) / ask.step - NEAR))


def _box_columns(size: Floats, ask: Raster) -> tuple[Floats, Floats]:
    k = _count(size, ask)
    return np.full(k, -ask.gap / 2), np.full(k, size[1] + ask.gap / 2)


def _columns(outline: Floats, size: Floats, ask: Raster) -> tuple[Floats, Floats]:
    """Return the lowest and highest value (k,) of a polygon (q, 2) in each column, half of the gap beyond it.

    Sides move by the corners of a regular polygon around the circle of half the gap.
    """
    reach = ask.gap / 2
    count = 16
    angle = np.arange(count) * 2 * np.pi / count
    circle = reach / np.cos(np.pi / count) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corner = np.arange(_count(size, ask) + 1, dtype=np.float64) * ask.step - reach
    a, b = outline, np.roll(outline, -1, axis=0)
    if polygon_area(outline) < 0:
        a, b = b, a
    below, above = a[:, 0] <= b[:, 0], a[:, 0] >= b[:, 0]
    down, up = circle[circle[:, 1] <= NEAR * reach], circle[circle[:, 1] >= -NEAR * reach]
    lower = _extreme(np.minimum, corner, *(_moved(x[below], down) for x in (a, b)))
    return lower, _extreme(np.maximum, corner, *(_moved(x[above], up) for x in (b, a)))


def _moved(points: Floats, ways: Floats) -> Floats:
    """Return points (q, 2) moved by each of the vectors (k, 2): (k q, 2)."""
    return np.asarray((points[None] + ways[:, None]).reshape(-1, 2))


def _extreme(f: np.ufunc, corner: Floats, p: Floats, q: Floats) -> Floats:
    """Return the minimum or maximum (k,) of segments p to q (s, 2), p left of q, between corners (k + 1,)."""
    found = np.full(len(corner) - 1, np.inf if f is np.minimum else -np.inf)
    wide = np.maximum(q[:, 0] - p[:, 0], 1e-15)
    i = np.clip(np.searchsorted(corner, p[:, 0], side="right") - 1, 0, len(found) - 1)
    j = np.clip(np.searchsorted(corner, q[:, 0], side="left") - 1, i, len(found) - 1)
    many = j - i + 1
    segment = np.repeat(np.arange(len(p)), many)
    column = np.repeat(i, many) + np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    (x, low), high, slim = p[segment].T, (q[:, 1] - p[:, 1])[segment], wide[segment]
    ends = (low + np.minimum(np.maximum((at[column] - x) / slim, 0), 1) * high for at in (corner[:-1], corner[1:]))
    f.at(found, column, f(*ends))
    return found


@dataclass(frozen=True, eq=False)
class NestedPart:
    """Part turned by a multiple of 90 degrees (radians), and shifted to its place on a sheet (m)."""

    part: FlatPart
    turn: float
    shift: tuple[float, float]

    @property
    def placed(self) -> FlatPart:
        """Part at its place on the sheet."""
        return self.part.moved(self.turn, np.array(self.shift))


@dataclass(eq=False)
class SheetGap:
    """Free room below a part, from a column on, between floor (k,) and ceiling (k,) (m); high : largest height."""

    begin: int
    floor: Floats
    ceiling: Floats
    high: float

    @classmethod
    def of(cls, begin: int, floor: Floats, ceiling: Floats, ask: Raster) -> "list[SheetGap]":
        """Return the runs of columns that have useful room."""
        high, least = ceiling - floor, ask.gap + 0.02  # metres: smaller gaps are forgotten
        there = np.flatnonzero(np.diff(np.concatenate([[0], high > least, [0]])))
        return [
            cls(begin + i, floor[i:j].copy(), ceiling[i:j].copy(), float(high[i:j].max()))
            for i, j in there.reshape(-1, 2).tolist()
            if (j - i) * ask.step > least
        ]


@dataclass(eq=False)
class OpenSheet:
    """Sheet while it is filled: the used height (k,) of each column (m), and the free area (m2).

    lowest  : of the skyline.    gaps : below it.
    refused : length, width and area of parts without room; larger parts are not tried again.
    """

    size: tuple[float, float]
    skyline: Floats
    left: float
    lowest: float
    refused: list[tuple[float, float, float]] = field(default_factory=list)
    parts: list[NestedPart] = field(default_factory=list)
    gaps: list[SheetGap] = field(default_factory=list)


def empty_sheet(size: tuple[float, float], ask: Raster) -> OpenSheet:
    """Return an empty sheet of a length and a width (m)."""
    columns = int(np.ceil((size[0] - ask.gap) / ask.step))  # the last column may pass the edge
    return OpenSheet(size, np.full(columns, ask.gap / 2), size[0] * size[1], ask.gap / 2)


class _Place(NamedTuple):
    """Place of a turned part: its score, lower is better; rise over the sheet's edge (m); first column."""

    score: float
    rise: float
    at: int
    shape: PartShape


def placed(sheet: OpenSheet, turns: list[PartShape], ask: Raster) -> bool:
    """Put a part on a sheet in one of its turns, and return whether it has room."""
    a, b, area = float(turns[0].size[0]), float(turns[0].size[1]), turns[0].part.area
    if sheet.left < area or any(a >= x and b >= y and area >= z for x, y, z in sheet.refused):
        return False
    short, thin = min(len(shape.lower) for shape in turns), min(shape.thick for shape in turns)
    wide = [k for k, gap in enumerate(sheet.gaps) if gap.high >= thin and len(gap.floor) >= short]
    if any(_in_gap(sheet, k, turns, ask) for k in wide):
        return True
    best = _on_skyline(sheet, turns, ask)
    if best is None:
        sheet.refused = [one for one in sheet.refused if one[0] < a or one[1] < b or one[2] < area]
        sheet.refused.append((a, b, area))
        return False
    columns = slice(best.at, best.at + len(best.shape.lower))
    below = sheet.skyline[columns].copy()
    sheet.gaps += SheetGap.of(best.at, below, best.rise + best.shape.lower, ask)
    sheet.skyline[columns] = np.maximum(below, best.rise + best.shape.upper)
    sheet.parts.append(_nested(best.shape, best.at, best.rise, ask))
    sheet.lowest = float(sheet.skyline.min())
    open_area = sheet.size[0] * (sheet.size[1] - ask.gap / 2) - ask.step * sheet.skyline.sum()
    sheet.left = float(open_area) + _room(sheet, ask)
    return True


def _on_skyline(sheet: OpenSheet, turns: list[PartShape], ask: Raster) -> _Place | None:
    best: _Place | None = None
    gap, step, top = ask.gap, ask.step, sheet.size[1] - ask.gap / 2
    known: dict[int, tuple[Floats, Floats]] = {}
    for shape in turns:
        k = len(shape.lower)
        if k > len(sheet.skyline) or sheet.lowest + shape.size[1] + gap > top + step:
            continue
        if k not in known:  # half a turn keeps the length
            found = _windows(sheet.skyline, k)
            known[k] = found, found.sum(axis=1)
        windows, sums = known[k]
        rise = (windows - shape.lower).max(axis=1)
        height = rise + shape.top
        right = gap + step * np.arange(len(windows)) + shape.size[0]
        inside = (height <= top + NEAR) & (right <= sheet.size[0] - gap + NEAR)
        if not inside.any():
            continue
        lost = (rise * k + shape.total - sums) / k
        score = np.where(inside, height + lost, np.inf)
        at = int(score.argmin())
        if np.isfinite(score[at]) and (best is None or score[at] < best.score - NEAR):
            best = _Place(float(score[at]), float(rise[at]), at, shape)
    return best


def _in_gap(sheet: OpenSheet, number: int, turns: list[PartShape], ask: Raster) -> bool:
    gap, best = sheet.gaps[number], None
    for shape in turns:
        k = len(shape.lower)
        if k > len(gap.floor) or shape.thick > gap.high:
            continue
        rise = (_windows(gap.floor, k) - shape.lower).max(axis=1)
        inside = (_windows(gap.ceiling, k) - shape.upper).min(axis=1) >= rise - NEAR
        right = ask.gap + ask.step * (gap.begin + np.arange(len(rise))) + shape.size[0]
        inside &= right <= sheet.size[0] - ask.gap + NEAR
        at = int(np.where(inside, rise, np.inf).argmin())
        if inside[at] and (best is None or rise[at] + shape.top < best.score - NEAR):
            best = _Place(float(rise[at]) + shape.top, float(rise[at]), at, shape)
    if best is None:
        return False
    columns = slice(best.at, best.at + len(best.shape.lower))
    below = gap.floor[columns].copy()
    gap.floor[columns] = np.maximum(below, best.rise + best.shape.upper)
    under = SheetGap.of(gap.begin + best.at, below, best.rise + best.shape.lower, ask)
    before = _room(sheet, ask)
    sheet.gaps[number : number + 1] = [*SheetGap.of(gap.begin, gap.floor, gap.ceiling, ask), *under]
    sheet.left += _room(sheet, ask) - before
    sheet.parts.append(_nested(best.shape, gap.begin + best.at, best.rise, ask))
    return True


def _nested(shape: PartShape, column: int, rise: float, ask: Raster) -> NestedPart:
    shift = ask.gap + column * ask.step - float(shape.low[0]), rise - float(shape.low[1])
    return NestedPart(shape.part, shape.turn, shift)


def _room(sheet: OpenSheet, ask: Raster) -> float:
    return ask.step * float(sum((gap.ceiling - gap.floor).sum() for gap in sheet.gaps))


def _windows(skyline: Floats, k: int) -> Floats:
    """Return each run (q, k) of k columns as a view; numpy's function for this takes longer than its use."""
    (step,) = skyline.strides
    return np.ndarray((len(skyline) - k + 1, k), skyline.dtype, skyline, strides=(step, step))
