"""A sheet that is being filled: parts lie on the skyline of what is there already, or in gaps that are left below."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.workshop.nesting.columns import NEAR, PartShape, Raster
from dsfab.workshop.parts import FlatPart

LOW = 0.02
"""Metres; what is left below a part is forgotten where it is lower or shorter than that."""


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


@dataclass(eq=False)
class SheetGap:
    """Room that is left below a part: from a column on, between a floor (k,) and a ceiling (k,); metres.

    high : the most between both.
    """

    begin: int
    floor: Floats
    ceiling: Floats
    high: float

    @classmethod
    def of(cls, begin: int, floor: Floats, ceiling: Floats, ask: Raster) -> "list[SheetGap]":
        """Those stretches of columns in which there is room for anything worth while."""
        high = ceiling - floor
        there = np.flatnonzero(np.diff(np.concatenate([[0], high > ask.gap + LOW, [0]])))
        return [
            cls(begin + i, floor[i:j].copy(), ceiling[i:j].copy(), float(high[i:j].max()))
            for i, j in there.reshape(-1, 2).tolist()
            if (j - i) * ask.step > ask.gap + LOW
        ]


@dataclass(eq=False)
class OpenSheet:
    """A sheet that is being filled: the height (k,) up to which each column is taken, and the area that is left.

    lowest  : of the skyline.    gaps : below it.
    refused : length, width and area of parts that found no room: larger ones are not tried again.
    """

    size: tuple[float, float]
    skyline: Floats
    left: float
    lowest: float
    refused: list[tuple[float, float, float]] = field(default_factory=list)
    parts: list[NestedPart] = field(default_factory=list)
    gaps: list[SheetGap] = field(default_factory=list)


def empty_sheet(size: tuple[float, float], ask: Raster) -> OpenSheet:
    """A sheet of a length and a width, metres, with nothing on it."""
    columns = int(np.ceil((size[0] - ask.gap) / ask.step))  # the last one may be beyond the edge, where no part is put
    return OpenSheet(size, np.full(columns, ask.gap / 2), size[0] * size[1], ask.gap / 2)


class _Place(NamedTuple):
    """Where a part in one of its turns has room: the better the lower its score; its rise over the sheet's edge,
    metres, and its first column."""

    score: float
    rise: float
    at: int
    shape: PartShape


def placed(sheet: OpenSheet, turns: list[PartShape], ask: Raster) -> bool:
    """Whether a part found room on a sheet, in one of its turns; there it is then."""
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
    """Where the upper edge of a part is lowest, and least is lost below it; None where it has no room."""
    best: _Place | None = None
    gap, step, top = ask.gap, ask.step, sheet.size[1] - ask.gap / 2
    known: dict[int, tuple[Floats, Floats]] = {}
    for shape in turns:
        k = len(shape.lower)
        if k > len(sheet.skyline) or sheet.lowest + shape.size[1] + gap > top + step:
            continue
        if k not in known:  # turned by half a turn it is as long
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
    """Whether a part found room in a gap, in one of its turns; there it is then, as low as can be."""
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
    """Square metres of the gaps."""
    return ask.step * float(sum((gap.ceiling - gap.floor).sum() for gap in sheet.gaps))


def _windows(skyline: Floats, k: int) -> Floats:
    """(q, k) each run of k columns, a view: numpy's own function for that takes longer than what is done with it."""
    (step,) = skyline.strides
    return np.ndarray((len(skyline) - k + 1, k), skyline.dtype, skyline, strides=(step, step))
