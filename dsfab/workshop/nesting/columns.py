"""A part in narrow columns across a sheet: its lower and its upper edge, both half of the gap beyond its own."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dsfab.arrays import Floats
from dsfab.workshop.parts import FlatPart, polygon_area, turning

COLUMN = 0.01
"""Metres; or the longest sheet over `MOST`, if that is less."""
MOST = 250
"""Columns of a sheet."""
KNOWN = 4096
"""Shapes of turned parts that are kept."""
AROUND = 16
"""Directions in which the outline of a part is moved by half of the gap."""
NEAR = 1e-9
"""Metres that rounding may take."""


@dataclass(frozen=True, eq=False)
class PartShape:
    """A part turned so: lower and upper edges (k,) in columns of `step`, half of the gap beyond its own; metres.

    low : its own lowest (2,) corner.    size : (2,) of its own box.
    top, total : the highest of its upper edge, and the sum of its lower one.    thick : the most between both.
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
    """The gap, the width of a column, and how tall a part may be, metres; whether members only lie along the sheets."""

    gap: float
    step: float
    tallest: float
    grain: bool = False


def raster(stock: Sequence[tuple[float, float]], gap: float, grain: bool = False) -> Raster:
    """Columns for stock of some lengths and widths, metres."""
    step = min(COLUMN, max(max(size) for size in stock) / MOST)
    return Raster(gap, step, max(min(size) for size in stock) - 2 * gap + NEAR, grain)


def part_shapes(part: FlatPart, ask: Raster, boxes: bool) -> list[PartShape]:
    """A part along the sheet and turned round, and across it where it is short enough; of a box two turns are two."""
    turns = (0.0, np.pi / 2) if boxes else (0.0, np.pi, np.pi / 2, -np.pi / 2)
    found = [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[:1]]
    tall = part.size[0] > ask.tallest or (ask.grain and bool(part.member))  # across the sheet
    return found + [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[1:] if not (tall and _across(turn))]


def _across(turn: float) -> bool:
    return abs(turn) == np.pi / 2


@lru_cache(maxsize=KNOWN)
def _shape(part: FlatPart, turn: float, boxes: bool, gap: float, step: float) -> PartShape:
    """A part turned so. Parts are nested several times: on other stock, and to see what would save sheets."""
    outline = part.outline @ turning(turn)
    low, size, ask = outline.min(axis=0), np.ptp(outline, axis=0), Raster(gap, step, np.inf)
    lower, upper = _box_columns(size, ask) if boxes else _columns(outline - low, size, ask)
    return PartShape(
        part, turn, low, size, lower, upper, float(upper.max()), float(lower.sum()), float((upper - lower).max())
    )


def _count(size: Floats, ask: Raster) -> int:
    return int(np.ceil((size[0] + ask.gap) / ask.step - NEAR))


def _box_columns(size: Floats, ask: Raster) -> tuple[Floats, Floats]:
    """(k,) each: the lower and the upper edge of a box (2,), half of the gap beyond it."""
    k = _count(size, ask)
    return np.full(k, -ask.gap / 2), np.full(k, size[1] + ask.gap / 2)


def _columns(outline: Floats, size: Floats, ask: Raster) -> tuple[Floats, Floats]:
    """(k,) each: the lowest and the highest that a polygon (q, 2) comes in columns, half of the gap beyond it.

    Its sides are moved by `AROUND` vectors around a circle, so much larger that its chords are outside of the true one.
    For the lower edge these are the sides above which the polygon is, moved downwards: others are higher, there too.
    """
    reach = ask.gap / 2
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    circle = reach / np.cos(np.pi / AROUND) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corner = np.arange(_count(size, ask) + 1, dtype=np.float64) * ask.step - reach
    a, b = outline, np.roll(outline, -1, axis=0)
    if polygon_area(outline) < 0:
        a, b = b, a
    below, above = a[:, 0] <= b[:, 0], a[:, 0] >= b[:, 0]
    down, up = circle[circle[:, 1] <= NEAR * reach], circle[circle[:, 1] >= -NEAR * reach]
    lower = _extreme(np.minimum, corner, *(_moved(x[below], down) for x in (a, b)))
    return lower, _extreme(np.maximum, corner, *(_moved(x[above], up) for x in (b, a)))


def _moved(points: Floats, ways: Floats) -> Floats:
    """(k q, 2) points (q, 2) moved by each of some vectors (k, 2)."""
    return np.asarray((points[None] + ways[:, None]).reshape(-1, 2))


def _extreme(f: np.ufunc, corner: Floats, p: Floats, q: Floats) -> Floats:
    """(k,) the minimum or the maximum in columns between corners (k + 1,) of segments from p to q (s, 2), p left."""
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
