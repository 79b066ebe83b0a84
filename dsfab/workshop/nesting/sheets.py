"""Nesting (arrangement) of parts on sheets at low cost, and a search for fewer sheets with spyrrow."""

import importlib.util
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.export import ProgramError, last_line, temporary_folder
from dsfab.workshop.nesting import spyrrow_program
from dsfab.workshop.nesting.skyline import (
    ROUNDING,
    ColumnGrid,
    NestedPart,
    OpenSheet,
    column_grid,
    empty_sheet,
    part_shapes,
    place_part,
)
from dsfab.workshop.parts import OUTLINE_TOLERANCE, FlatPart, distances_from_outline, inside_outline

SheetSize = tuple[float, float]  # length and width of a sheet (m)


@dataclass(frozen=True, eq=False)
class NestedSheet:
    """Sheet of the stock: length and width (m), arranged parts, and price (0 if unknown)."""

    size: SheetSize
    parts: tuple[NestedPart, ...]
    price: float = 0.0

    @property
    def used_share(self) -> float:
        """Fraction of the sheet's area that becomes parts."""
        return sum(item.part.area for item in self.parts) / (self.size[0] * self.size[1])


def nest_parts(
    parts: Sequence[FlatPart], stock: Sequence[SheetSize], gap: float, grain: bool = False, prices: Sequence[float] = ()
) -> list[NestedSheet]:
    """Nest (arrange) all parts on sheets of the stock at low cost. Raises PatternError if a part fits on no sheet.
    stock  : lengths and widths of the sheets, metres.
    gap    : least distance between parts, and from the edges of sheets, metres.
    grain : true if parts of members must lie along the length of a sheet.    prices : price of a sheet of each size."""
    grid, costs = column_grid(stock, gap, grain), _costs(stock, prices)
    box_area = float(sum((part.size[0] + gap) * (part.size[1] + gap) for part in parts))
    cheapest: list[NestedSheet] | None = None
    for boxes in (False, True):
        for order in ([first, *(size for size in stock if size != first)] for first in dict.fromkeys(stock)):
            limit = len(cheapest) - 1 if cheapest is not None and len(stock) == 1 else len(parts)
            if boxes and box_area > limit * max((a - gap) * (b - gap) for a, b in stock) + ROUNDING:
                continue
            tried = _fill_sheets(parts, boxes, order, grid, limit)
            cheapest = _cheaper_nest(cheapest, tried, boxes, costs, grid)
        if len(costs) > 1:
            cheapest = _cheaper_nest(cheapest, _fill_by_value(parts, boxes, costs, grid), boxes, costs, grid)
    return [replace(sheet, price=costs[sheet.size]) for sheet in cheapest or []] if prices else cheapest or []


def _costs(stock: Sequence[SheetSize], prices: Sequence[float]) -> dict[SheetSize, float]:
    priced = zip(stock, prices or [a * b for a, b in stock], strict=True)
    return dict(sorted(priced, key=lambda size_and_price: -size_and_price[1]))


def _cheaper_nest(
    cheapest: list[NestedSheet] | None,
    tried: list[NestedSheet] | None,
    boxes: bool,
    costs: Mapping[SheetSize, float],
    grid: ColumnGrid,
) -> list[NestedSheet] | None:
    if tried is None:
        return cheapest
    tried = [_on_cheapest(sheet, boxes, costs, grid) for sheet in tried]
    return tried if cheapest is None or _cost(tried, costs) < _cost(cheapest, costs) else cheapest


def _cost(sheets: list[NestedSheet], costs: Mapping[SheetSize, float]) -> float:
    return round(sum(costs[sheet.size] for sheet in sheets), 9)


def _on_cheapest(sheet: NestedSheet, boxes: bool, costs: Mapping[SheetSize, float], grid: ColumnGrid) -> NestedSheet:
    for size in sorted(costs, key=lambda item: costs[item]):
        if costs[size] >= costs[sheet.size]:
            break
        candidate = empty_sheet(size, grid)
        if all(place_part(candidate, part_shapes(item.part, grid, boxes), grid) for item in sheet.parts):
            return NestedSheet(size, tuple(candidate.parts))
    return sheet


def _fill_by_value(
    parts: Sequence[FlatPart], boxes: bool, costs: Mapping[SheetSize, float], grid: ColumnGrid
) -> list[NestedSheet] | None:
    remaining, sheets = _largest_first(parts), list[NestedSheet]()
    while remaining:
        fullest: OpenSheet | None = None
        best_value = 0.0
        for size, cost in costs.items():
            sheet = empty_sheet(size, grid)
            if not place_part(sheet, part_shapes(remaining[0], grid, boxes), grid):
                continue
            for part in remaining[1:]:
                place_part(sheet, part_shapes(part, grid, boxes), grid)
            value = sum(item.part.area for item in sheet.parts) / cost
            if value > best_value + ROUNDING:
                fullest, best_value = sheet, value
        if fullest is None:
            return None
        taken = {item.part.id for item in fullest.parts}
        remaining = [part for part in remaining if part.id not in taken]
        sheets.append(NestedSheet(fullest.size, tuple(fullest.parts)))
    return sheets


def stack_parts(
    parts: Sequence[FlatPart], stock: Sequence[SheetSize], gap: float, limit: int, grain: bool = False
) -> list[NestedSheet] | None:
    """Nest (arrange) parts on sheets quickly; None if over `limit` sheets are necessary.
    stock : lengths and widths of the sheets, metres.    gap : least distance between parts, metres."""
    return _fill_sheets(parts, False, stock, column_grid(stock, gap, grain), limit)


def _largest_first(parts: Sequence[FlatPart]) -> list[FlatPart]:
    # long and bowed parts come first, because short parts fit between them
    keys = [(-round(float(part.size[0] * part.size[1]), 4), -float(part.size[0]), part.id) for part in parts]
    return [parts[k] for k in sorted(range(len(parts)), key=keys.__getitem__)]


def _fill_sheets(
    parts: Sequence[FlatPart], boxes: bool, stock: Sequence[SheetSize], grid: ColumnGrid, limit: int
) -> list[NestedSheet] | None:
    opened = list[OpenSheet]()
    remaining_area, largest = sum(part.area for part in parts), max(a * b for a, b in stock) + ROUNDING
    for part in _largest_first(parts):
        turns = part_shapes(part, grid, boxes)
        if not any(place_part(sheet, turns, grid) for sheet in opened):
            fitting = (sheet for size in stock if place_part(sheet := empty_sheet(size, grid), turns, grid))
            new_sheet = next(fitting, None)
            if new_sheet is None:
                a, b = turns[0].size
                grain_text = ", along its grain" if grid.grain else ""
                raise PatternError(
                    f"part {turns[0].part.id} is {a:.3g} x {b:.3g} m and fits on no sheet of the stock with a "
                    f"distance of {grid.gap:g} m to the edges{grain_text}; give a larger workshop.stock"
                )
            opened.append(new_sheet)
            free = sum(sheet.free_area for sheet in opened) + (limit - len(opened)) * largest
            if len(opened) > limit or remaining_area - part.area > free:
                return None
        remaining_area -= part.area
    return [NestedSheet(sheet.size, tuple(sheet.parts)) for sheet in opened]


def least_clearance(outlines: Sequence[Floats], size: tuple[float, float], enough: float) -> float:
    """Return the smallest distance (m) between closed polygons (k, 2), and between polygons and the sheet's edges.
    The distance is 0 if polygons overlap, and negative if a polygon extends beyond an edge.
    enough : larger distances (m) are not measured."""
    boxes = [(P.min(axis=0), P.max(axis=0)) for P in outlines]
    distances = [float(min(low.min(), (np.array(size) - high).min())) for low, high in boxes]
    for (P, (a, b)), (Q, (c, d)) in combinations(zip(outlines, boxes, strict=True), 2):
        if float(np.maximum(c - b, a - d).max()) < enough:
            distances.append(polygon_distance(P, Q))
    return min(distances, default=np.inf)


def polygon_distance(P: Floats, Q: Floats) -> float:
    """Return the distance (m) between the areas of closed polygons (p, 2) and (q, 2); 0 if they overlap or touch."""
    if inside_outline(P[:1], Q)[0] or inside_outline(Q[:1], P)[0] or _sides_cross(P, Q):
        return 0.0
    return min(float(distances_from_outline(*pair).min()) for pair in ((P, Q), (Q, P)))


def _sides_cross(P: Floats, Q: Floats) -> bool:
    a, b, c, d = P[:, None], np.roll(P, -1, axis=0)[:, None], Q[None], np.roll(Q, -1, axis=0)[None]
    return bool(((_turn(a, b, c) * _turn(a, b, d) < 0) & (_turn(c, d, a) * _turn(c, d, b) < 0)).any())


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    u, v = b - a, c - a  # return twice the triangle's area, positive for left turns
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def require_spyrrow() -> None:
    """Raise PatternError if spyrrow is not installed."""
    if importlib.util.find_spec("spyrrow") is None:
        raise PatternError(
            "workshop.nesting = 'spyrrow' needs the library spyrrow; install it with: pip install \"dsfab[nesting]\""
        )


def with_fewer_sheets(sheets: Sequence[NestedSheet], gap: float, grain: bool = False) -> list[NestedSheet]:
    """Return the same parts on fewer sheets if possible. grain : true if parts must lie along a sheet's length."""
    # the limit counts trials, not seconds: results must not depend on the machine
    remaining, tries = list(sheets), iter(range(24))
    while len(remaining) > 1:
        fewer = _without_least(remaining, gap, grain, tries)
        if fewer is None:
            break
        remaining = fewer
    return remaining


def _without_least(
    sheets: Sequence[NestedSheet], gap: float, grain: bool, tries: Iterator[int]
) -> list[NestedSheet] | None:
    least = min(sheets, key=_parts_area)
    remaining = [sheet for sheet in sheets if sheet is not least]
    for part in sorted((item.part for item in least.parts), key=lambda part: -part.area):
        for k in sorted(range(len(remaining)), key=lambda k: remaining[k].used_share)[:3]:  # emptiest sheets first
            full = _parts_area(remaining[k]) + part.area > 0.92 * remaining[k].size[0] * remaining[k].size[1]
            if full or next(tries, None) is None:
                continue
            if tried := _with_part(remaining[k], part, gap, grain):
                remaining[k] = tried
                break
        else:
            return None
    return remaining


def _parts_area(sheet: NestedSheet) -> float:
    return sum(item.part.area for item in sheet.parts)


def _with_part(sheet: NestedSheet, part: FlatPart, gap: float, grain: bool) -> NestedSheet | None:
    parts = [*(item.part for item in sheet.parts), part]
    nested_parts = _by_spyrrow(parts, sheet.size, gap, grain)
    if sorted(item.part.id for item in nested_parts) != sorted(item.id for item in parts):
        return None
    outlines = [item.placed_part.outline for item in nested_parts]
    if least_clearance(outlines, sheet.size, gap) < gap - ROUNDING:
        return None
    return replace(sheet, parts=tuple(nested_parts))


def _by_spyrrow(parts: Sequence[FlatPart], size: tuple[float, float], gap: float, grain: bool) -> list[NestedPart]:
    # with a margin, because spyrrow computes in single precision, and `contours` omit some corners
    separation = gap + 1e-5 + 2 * OUTLINE_TOLERANCE
    items = [[part.contours[0].tolist(), _allowed_turns(part, size[1] - 2 * gap, grain)] for part in parts]
    job = {"items": items, "height": size[1], "length": size[0], "gap": separation, "seed": 1}
    with temporary_folder("dsfab") as folder:
        path = Path(folder) / "job.json"
        path.write_text(json.dumps(job), encoding="utf-8")
        try:
            reply = json.loads(last_line(spyrrow_program.__file__, str(path), seconds=10.0))
            return [NestedPart(parts[k], float(np.radians(turn % 360)), (x, y)) for k, turn, x, y in reply or []]
        except (subprocess.TimeoutExpired, ProgramError, ValueError, TypeError, IndexError):
            return []


def _allowed_turns(part: FlatPart, tallest: float, grain: bool) -> list[float]:
    across = part.size[0] <= tallest and not (grain and part.member)
    return [0.0, 90.0, 180.0, 270.0] if across else [0.0, 180.0]
