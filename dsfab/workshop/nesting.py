"""Parts on stock sheets: strips of like bend lie in each other, piled up on the skyline of what is there already.

A part is known by its lower and its upper edge in narrow columns, both widened by half of the gap all around: wherever
two such shapes do not overlap, the parts are a gap apart. The columns take the extreme values within them, so that they
never take less room than there is. The same parts by their boxes are tried too, and each size of stock first: the
fewest square metres win, so boxes never need fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import PatternError
from dsfab.workshop.parts import FlatPart, turning

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
class NestedPart:
    """A part, turned by 0 or half a turn, or a quarter more, and shifted to its place on a sheet, metres."""

    part: FlatPart
    turn: float
    shift: tuple[float, float]

    @property
    def placed(self) -> FlatPart:
        """The part where it is on its sheet."""
        return self.part.moved(self.turn, np.array(self.shift))


@dataclass(frozen=True, eq=False)
class NestedSheet:
    """A sheet of the stock, its length and width, metres, and what is cut from it."""

    size: tuple[float, float]
    parts: tuple[NestedPart, ...]

    @property
    def used(self) -> float:
        """Share of its area that becomes parts."""
        return sum(one.part.area for one in self.parts) / (self.size[0] * self.size[1])


@dataclass(frozen=True, eq=False)
class _Shape:
    """A part turned so: lower and upper edges (k,) in columns of `step`, half of the gap beyond its own; metres.

    low : its own lowest (2,) corner.    size : (2,) of its own box.
    top, total : the highest of its upper edge, and the sum of its lower one.
    """

    part: FlatPart
    turn: float
    low: Floats
    size: Floats
    lower: Floats
    upper: Floats
    top: float
    total: float


@dataclass(frozen=True)
class _Raster:
    """The gap, the width of a column, and how tall a part may be, metres."""

    gap: float
    step: float
    tallest: float


@dataclass(eq=False)
class _Open:
    """A sheet that is being filled: the height (k,) up to which each column is taken, and the area that is left.

    lowest  : of the skyline.
    refused : length, width and area of parts that found no room: larger ones are not tried again.
    """

    size: tuple[float, float]
    skyline: Floats
    left: float
    lowest: float
    refused: list[tuple[float, float, float]] = field(default_factory=list)
    parts: list[NestedPart] = field(default_factory=list)


def nested(parts: Sequence[FlatPart], stock: Sequence[tuple[float, float]], gap: float) -> list[NestedSheet]:
    """All parts on sheets of the stock, lengths and widths in metres, `gap` metres apart and from the edges.

    Raises PatternError for a part that fits on no sheet.
    """
    ask = _raster(stock, gap)
    best: list[NestedSheet] | None = None
    shapes = {boxes: [_shapes(part, ask, boxes) for part in parts] for boxes in (False, True)}
    for first in range(len(stock)):
        order = [stock[first], *(size for k, size in enumerate(stock) if k != first)]
        for boxes in (False, True):
            tried = _filled(shapes[boxes], order, ask, len(parts))
            if tried is not None and (best is None or _cost(tried) < _cost(best)):
                best = tried
    return best or []


def stacked(
    parts: Sequence[FlatPart], stock: Sequence[tuple[float, float]], gap: float, most: int
) -> list[NestedSheet] | None:
    """As `nested`, by piling them up alone, the first stock first: sooner, and on more sheets at times. None where they
    are more than `most`."""
    ask = _raster(stock, gap)
    return _filled([_shapes(part, ask, False) for part in parts], stock, ask, most)


def _raster(stock: Sequence[tuple[float, float]], gap: float) -> _Raster:
    step = min(COLUMN, max(max(size) for size in stock) / MOST)
    return _Raster(gap, step, max(min(size) for size in stock) - 2 * gap + NEAR)


def _cost(sheets: list[NestedSheet]) -> float:
    """Square metres of stock."""
    return round(sum(sheet.size[0] * sheet.size[1] for sheet in sheets), 9)


def _by_length(shape: _Shape) -> tuple[float, ...]:
    return (-round(float(shape.size[0]), 1), -round(float(shape.size[1]), 3), -float(shape.size[0]))


def _filled(
    shapes: list[list[_Shape]],
    stock: Sequence[tuple[float, float]],
    ask: _Raster,
    most: int,
) -> list[NestedSheet] | None:
    """Sheets filled in an order: each part on the first sheet that has room, where its upper edge is lowest. None where
    these are more than `most`."""
    opened = list[_Open]()
    for turns in sorted(shapes, key=lambda some: (_by_length(some[0]), some[0].part.id)):
        if not any(_placed(sheet, turns, ask) for sheet in opened):
            new = next((sheet for size in stock if _placed(sheet := _empty(size, ask), turns, ask)), None)
            if new is None:
                a, b = turns[0].size
                raise PatternError(
                    f"part {turns[0].part.id} is {a:.3g} x {b:.3g} m and fits on no sheet of the stock with "
                    f"{ask.gap:g} m to its edges; give a larger workshop.stock"
                )
            opened.append(new)
            if len(opened) > most:
                return None
    return [NestedSheet(sheet.size, tuple(sheet.parts)) for sheet in opened]


def _empty(size: tuple[float, float], ask: _Raster) -> _Open:
    columns = int(np.ceil((size[0] - ask.gap) / ask.step))  # the last one may be beyond the edge, where no part is put
    return _Open(size, np.full(columns, ask.gap / 2), size[0] * size[1], ask.gap / 2)


def _placed(sheet: _Open, turns: list[_Shape], ask: _Raster) -> bool:
    """Whether a part found room on a sheet, in one of its turns; there it is then."""
    best: tuple[float, float, int, _Shape] | None = None
    gap, step, top = ask.gap, ask.step, sheet.size[1] - ask.gap / 2
    a, b, area = float(turns[0].size[0]), float(turns[0].size[1]), turns[0].part.area
    if sheet.left < area or any(a >= x and b >= y and area >= z for x, y, z in sheet.refused):
        return False
    for shape in turns:
        k = len(shape.lower)
        if k > len(sheet.skyline) or sheet.lowest + shape.size[1] + gap > top + step:
            continue
        windows = _windows(sheet.skyline, k)
        rise = (windows - shape.lower).max(axis=1)
        height = rise + shape.top
        right = gap + step * np.arange(len(windows)) + shape.size[0]
        inside = (height <= top + NEAR) & (right <= sheet.size[0] - gap + NEAR)
        if not inside.any():
            continue
        lost = (rise * k + shape.total - windows.sum(axis=1)) / k
        score = np.where(inside, height + lost, np.inf)
        at = int(score.argmin())
        if np.isfinite(score[at]) and (best is None or score[at] < best[0] - NEAR):
            best = float(score[at]), float(rise[at]), at, shape
    if best is None:
        sheet.refused.append((a, b, area))
        return False
    _, rise_at, at, shape = best
    columns = slice(at, at + len(shape.lower))
    sheet.skyline[columns] = np.maximum(sheet.skyline[columns], rise_at + shape.upper)
    left = gap / 2 + at * step + gap / 2
    shift = left - float(shape.low[0]), rise_at - float(shape.low[1])
    sheet.lowest = float(sheet.skyline.min())
    sheet.left = float(sheet.size[0] * top - step * sheet.skyline.sum())
    sheet.parts.append(NestedPart(shape.part, shape.turn, shift))
    return True


def _windows(skyline: Floats, k: int) -> Floats:
    """(q, k) each run of k columns, a view: numpy's own function for that takes longer than what is done with it."""
    (step,) = skyline.strides
    return np.ndarray((len(skyline) - k + 1, k), skyline.dtype, skyline, strides=(step, step))


def _shapes(part: FlatPart, ask: _Raster, boxes: bool) -> list[_Shape]:
    """A part along the sheet and turned round, and across it where it is short enough; of a box two turns are two."""
    turns = (0.0, np.pi / 2) if boxes else (0.0, np.pi, np.pi / 2, -np.pi / 2)
    found = [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[:1]]
    tall = part.size[0] > ask.tallest  # across the sheet
    return found + [_shape(part, turn, boxes, ask.gap, ask.step) for turn in turns[1:] if not (tall and _across(turn))]


def _across(turn: float) -> bool:
    return abs(turn) == np.pi / 2


@lru_cache(maxsize=KNOWN)
def _shape(part: FlatPart, turn: float, boxes: bool, gap: float, step: float) -> _Shape:
    """A part turned so. Parts are nested several times: on other stock, and to see what would save sheets."""
    outline = part.outline @ turning(turn)
    low, size, ask = outline.min(axis=0), np.ptp(outline, axis=0), _Raster(gap, step, np.inf)
    lower, upper = _box_columns(size, ask) if boxes else _columns(outline - low, size, ask)
    return _Shape(part, turn, low, size, lower, upper, float(upper.max()), float(lower.sum()))


def _count(size: Floats, ask: _Raster) -> int:
    return int(np.ceil((size[0] + ask.gap) / ask.step - NEAR))


def _box_columns(size: Floats, ask: _Raster) -> tuple[Floats, Floats]:
    """(k,) each: the lower and the upper edge of a box (2,), half of the gap beyond it."""
    k = _count(size, ask)
    return np.full(k, -ask.gap / 2), np.full(k, size[1] + ask.gap / 2)


def _columns(outline: Floats, size: Floats, ask: _Raster) -> tuple[Floats, Floats]:
    """(k,) each: the lowest and the highest that a polygon (q, 2) comes in columns, half of the gap beyond it.

    Its sides are moved by `AROUND` vectors around a circle, so much larger that its chords are outside of the true one.
    """
    reach = ask.gap / 2
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    circle = reach / np.cos(np.pi / AROUND) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    count = _count(size, ask)
    lower, upper = np.full(count, np.inf), np.full(count, -np.inf)
    a, b = outline, np.roll(outline, -1, axis=0)
    p, q = (np.asarray((x[None] + circle[:, None]).reshape(-1, 2), dtype=np.float64) for x in (a, b))
    ahead = p[:, :1] <= q[:, :1]
    corner = np.arange(count + 1, dtype=np.float64) * ask.step - reach
    _span(lower, upper, corner, np.where(ahead, p, q), np.where(ahead, q, p))
    return lower, upper


def _span(lower: Floats, upper: Floats, corner: Floats, p: Floats, q: Floats) -> None:
    """Widen lower and upper edges (k,) of columns between corners (k + 1,) by segments from p to q (s, 2), p left."""
    wide = np.maximum(q[:, 0] - p[:, 0], 1e-15)
    i = np.clip(np.searchsorted(corner, p[:, 0], side="right") - 1, 0, len(lower) - 1)
    j = np.clip(np.searchsorted(corner, q[:, 0], side="left") - 1, i, len(lower) - 1)
    many = j - i + 1
    segment = np.repeat(np.arange(len(p)), many)
    column = np.repeat(i, many) + np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    for x in (corner[column], corner[column + 1]):
        t = np.clip((x - p[segment, 0]) / wide[segment], 0, 1)
        y = p[segment, 1] + t * (q[segment, 1] - p[segment, 1])
        np.minimum.at(lower, column, y)
        np.maximum.at(upper, column, y)
