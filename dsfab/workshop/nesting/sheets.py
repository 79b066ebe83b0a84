"""All parts on sheets of the stock, in an order, in their own shapes or in their boxes."""

from collections.abc import Sequence
from dataclasses import dataclass

from dsfab.errors import PatternError
from dsfab.workshop.nesting.columns import NEAR, Raster, part_shapes, raster
from dsfab.workshop.nesting.filling import NestedPart, OpenSheet, empty_sheet, placed
from dsfab.workshop.parts import FlatPart


@dataclass(frozen=True, eq=False)
class NestedSheet:
    """A sheet of the stock, its length and width, metres, and what is cut from it."""

    size: tuple[float, float]
    parts: tuple[NestedPart, ...]

    @property
    def used(self) -> float:
        """Share of its area that becomes parts."""
        return sum(one.part.area for one in self.parts) / (self.size[0] * self.size[1])


def nested(
    parts: Sequence[FlatPart], stock: Sequence[tuple[float, float]], gap: float, grain: bool = False
) -> list[NestedSheet]:
    """All parts on sheets of the stock, lengths and widths in metres, `gap` metres apart and from the edges.

    grain : whether it runs along the sheets: parts of members lie along it then.

    Raises PatternError for a part that fits on no sheet.
    """
    ask = raster(stock, gap, grain)
    best: list[NestedSheet] | None = None
    for first in range(len(stock)):
        order = [stock[first], *(size for k, size in enumerate(stock) if k != first)]
        for boxes in (False, True):
            most = len(best) - 1 if best is not None and len(stock) == 1 else len(parts)
            if boxes and _boxes(parts, gap) > most * max((a - gap) * (b - gap) for a, b in stock) + NEAR:
                continue
            tried = _filled(parts, boxes, order, ask, most)
            if tried is not None and (best is None or _cost(tried) < _cost(best)):
                best = tried
    return best or []


def stacked(
    parts: Sequence[FlatPart], stock: Sequence[tuple[float, float]], gap: float, most: int, grain: bool = False
) -> list[NestedSheet] | None:
    """As `nested`, by piling them up alone, the first stock first: sooner, and on more sheets at times. None where they
    are more than `most`."""
    ask = raster(stock, gap, grain)
    return _filled(parts, False, stock, ask, most)


def _cost(sheets: list[NestedSheet]) -> float:
    """Square metres of stock."""
    return round(sum(sheet.size[0] * sheet.size[1] for sheet in sheets), 9)


def _boxes(parts: Sequence[FlatPart], gap: float) -> float:
    """Square metres of the boxes around parts, half of the gap larger on each side."""
    return float(sum((part.size[0] + gap) * (part.size[1] + gap) for part in parts))


def _by_box(part: FlatPart) -> tuple[float, ...]:
    """Long and bowed ones first: what is short and straight finds room between them."""
    return (-round(float(part.size[0] * part.size[1]), 4), -float(part.size[0]))


def _filled(
    parts: Sequence[FlatPart],
    boxes: bool,
    stock: Sequence[tuple[float, float]],
    ask: Raster,
    most: int,
) -> list[NestedSheet] | None:
    """Sheets filled in an order: each part on the first sheet that has room, where its upper edge is lowest. None where
    these are more than `most`, as soon as what is left has more area than there is room."""
    opened = list[OpenSheet]()
    left, largest = sum(part.area for part in parts), max(a * b for a, b in stock) + NEAR
    for part in sorted(parts, key=lambda one: (_by_box(one), one.id)):
        turns = part_shapes(part, ask, boxes)
        if not any(placed(sheet, turns, ask) for sheet in opened):
            new = next((sheet for size in stock if placed(sheet := empty_sheet(size, ask), turns, ask)), None)
            if new is None:
                a, b = turns[0].size
                way = ", along its grain" if ask.grain else ""
                raise PatternError(
                    f"part {turns[0].part.id} is {a:.3g} x {b:.3g} m and fits on no sheet of the stock with "
                    f"{ask.gap:g} m to its edges{way}; give a larger workshop.stock"
                )
            opened.append(new)
            free = sum(sheet.left for sheet in opened) + (most - len(opened)) * largest
            if len(opened) > most or left - part.area > free:
                return None
        left -= part.area
    return [NestedSheet(sheet.size, tuple(sheet.parts)) for sheet in opened]
