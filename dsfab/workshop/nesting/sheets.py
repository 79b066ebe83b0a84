"""All parts on sheets of the stock, in an order, in their own shapes or in their boxes, for the least cost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dsfab.errors import PatternError
from dsfab.workshop.nesting.columns import NEAR, Raster, part_shapes, raster
from dsfab.workshop.nesting.filling import NestedPart, OpenSheet, empty_sheet, placed
from dsfab.workshop.parts import FlatPart

Size = tuple[float, float]
"""Length and width of a sheet, metres."""


@dataclass(frozen=True, eq=False)
class NestedSheet:
    """A sheet of the stock, its length and width, metres, and what is cut from it; its price, 0 where there is none."""

    size: Size
    parts: tuple[NestedPart, ...]
    price: float = 0.0

    @property
    def used(self) -> float:
        """Share of its area that becomes parts."""
        return sum(one.part.area for one in self.parts) / (self.size[0] * self.size[1])


def nested(
    parts: Sequence[FlatPart], stock: Sequence[Size], gap: float, grain: bool = False, prices: Sequence[float] = ()
) -> list[NestedSheet]:
    """All parts on sheets of the stock, lengths and widths in metres, `gap` metres apart and from the edges.

    grain  : whether it runs along the sheets: parts of members lie along it then.
    prices : of a sheet of each size. The cheapest nest of those that are tried is taken, without prices the one of the
             least area: each size is taken first once; with several, sheet by sheet the one of which most is used for
             its price, and then for each sheet a cheaper one that has room for the same parts.

    Raises PatternError for a part that fits on no sheet.
    """
    ask, costs = raster(stock, gap, grain), _costs(stock, prices)
    best: list[NestedSheet] | None = None
    for boxes in (False, True):
        for order in _orders(stock):
            most = len(best) - 1 if best is not None and len(stock) == 1 else len(parts)
            if boxes and _boxes(parts, gap) > most * max((a - gap) * (b - gap) for a, b in stock) + NEAR:
                continue
            tried = _filled(parts, boxes, order, ask, most)
            best = _cheaper(best, tried, boxes, costs, ask)
        if len(costs) > 1:
            best = _cheaper(best, _by_value(parts, boxes, costs, ask), boxes, costs, ask)
    return [replace(sheet, price=costs[sheet.size]) for sheet in best or []] if prices else best or []


def _orders(stock: Sequence[Size]) -> list[list[Size]]:
    """The stock with each of its sizes first."""
    return [[first, *(size for size in stock if size != first)] for first in dict.fromkeys(stock)]


def _costs(stock: Sequence[Size], prices: Sequence[float]) -> dict[Size, float]:
    """What a sheet of each size costs: its price, of several the least; without prices its square metres."""
    priced = zip(stock, prices or [a * b for a, b in stock], strict=True)
    return dict(sorted(priced, key=lambda one: -one[1]))


def _cheaper(
    best: list[NestedSheet] | None,
    tried: list[NestedSheet] | None,
    boxes: bool,
    costs: Mapping[Size, float],
    ask: Raster,
) -> list[NestedSheet] | None:
    """What was tried, each sheet on the cheapest size that it has room on, if it costs less than the best so far."""
    if tried is None:
        return best
    tried = [_on_cheapest(sheet, boxes, costs, ask) for sheet in tried]
    return tried if best is None or _cost(tried, costs) < _cost(best, costs) else best


def _cost(sheets: list[NestedSheet], costs: Mapping[Size, float]) -> float:
    return round(sum(costs[sheet.size] for sheet in sheets), 9)


def _on_cheapest(sheet: NestedSheet, boxes: bool, costs: Mapping[Size, float], ask: Raster) -> NestedSheet:
    """The parts of a sheet on one of another size that costs less, if there is one with room for all of them."""
    for size in sorted(costs, key=lambda one: costs[one]):
        if costs[size] >= costs[sheet.size]:
            break
        other = empty_sheet(size, ask)
        if all(placed(other, part_shapes(one.part, ask, boxes), ask) for one in sheet.parts):
            return NestedSheet(size, tuple(other.parts))
    return sheet


def _by_value(
    parts: Sequence[FlatPart], boxes: bool, costs: Mapping[Size, float], ask: Raster
) -> list[NestedSheet] | None:
    """Sheets filled one after another, each of the size that takes most area of what is left for its cost. None where
    a part fits on none."""
    left, found = _in_order(parts), list[NestedSheet]()
    while left:
        best: OpenSheet | None = None
        most = 0.0
        for size, cost in costs.items():
            sheet = empty_sheet(size, ask)
            if not placed(sheet, part_shapes(left[0], ask, boxes), ask):
                continue
            for part in left[1:]:
                placed(sheet, part_shapes(part, ask, boxes), ask)
            value = sum(one.part.area for one in sheet.parts) / cost
            if value > most + NEAR:
                best, most = sheet, value
        if best is None:
            return None
        taken = {one.part.id for one in best.parts}
        left = [part for part in left if part.id not in taken]
        found.append(NestedSheet(best.size, tuple(best.parts)))
    return found


def stacked(
    parts: Sequence[FlatPart], stock: Sequence[Size], gap: float, most: int, grain: bool = False
) -> list[NestedSheet] | None:
    """As `nested`, by piling them up alone, the first stock first: sooner, and on more sheets at times. None where they
    are more than `most`."""
    ask = raster(stock, gap, grain)
    return _filled(parts, False, stock, ask, most)


def _boxes(parts: Sequence[FlatPart], gap: float) -> float:
    """Square metres of the boxes around parts, half of the gap larger on each side."""
    return float(sum((part.size[0] + gap) * (part.size[1] + gap) for part in parts))


def _by_box(part: FlatPart) -> tuple[float, ...]:
    """Long and bowed ones first: what is short and straight finds room between them."""
    return (-round(float(part.size[0] * part.size[1]), 4), -float(part.size[0]))


def _in_order(parts: Sequence[FlatPart]) -> list[FlatPart]:
    return sorted(parts, key=lambda one: (_by_box(one), one.id))


def _filled(
    parts: Sequence[FlatPart],
    boxes: bool,
    stock: Sequence[Size],
    ask: Raster,
    most: int,
) -> list[NestedSheet] | None:
    """Sheets filled in an order: each part on the first sheet that has room, where its upper edge is lowest. None where
    these are more than `most`, as soon as what is left has more area than there is room."""
    opened = list[OpenSheet]()
    left, largest = sum(part.area for part in parts), max(a * b for a, b in stock) + NEAR
    for part in _in_order(parts):
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
