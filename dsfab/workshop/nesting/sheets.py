"""Parts nested on sheets for the least cost, and sheets emptied into others by spyrrow.

Spyrrow packs a strip as short as possible, in a process of its own. The least used sheet is emptied into others part by
part; `least_clearance` checks each result, and without one the old nest stays.
"""

import importlib.util
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import PatternError
from dsfab.export import ProgramError, last_line, temporary_folder
from dsfab.workshop.nesting import spyrrow_program
from dsfab.workshop.nesting.skyline import NEAR, NestedPart, OpenSheet, Raster, empty_sheet, part_shapes, placed, raster
from dsfab.workshop.parts import TOLERANCE, FlatPart

Size = tuple[float, float]
"""Length and width of a sheet (m)."""


@dataclass(frozen=True, eq=False)
class NestedSheet:
    """Sheet of the stock with its size (m), its parts, and its price; 0 without a price."""

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
    """Nest all parts on sheets of the stock, `gap` metres apart and from the edges.

    stock  : lengths and widths (m).    grain : whether parts of members lie along the sheets only.
    prices : of a sheet of each size. The cheapest trial wins, or without prices the least area. Trials take each size
             first, or for each sheet the size with most used area for its price; then cheaper sizes replace sheets.

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
    return [[first, *(size for size in stock if size != first)] for first in dict.fromkeys(stock)]


def _costs(stock: Sequence[Size], prices: Sequence[float]) -> dict[Size, float]:
    priced = zip(stock, prices or [a * b for a, b in stock], strict=True)
    return dict(sorted(priced, key=lambda one: -one[1]))


def _cheaper(
    best: list[NestedSheet] | None,
    tried: list[NestedSheet] | None,
    boxes: bool,
    costs: Mapping[Size, float],
    ask: Raster,
) -> list[NestedSheet] | None:
    if tried is None:
        return best
    tried = [_on_cheapest(sheet, boxes, costs, ask) for sheet in tried]
    return tried if best is None or _cost(tried, costs) < _cost(best, costs) else best


def _cost(sheets: list[NestedSheet], costs: Mapping[Size, float]) -> float:
    return round(sum(costs[sheet.size] for sheet in sheets), 9)


def _on_cheapest(sheet: NestedSheet, boxes: bool, costs: Mapping[Size, float], ask: Raster) -> NestedSheet:
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
    """Fill sheets in turn, each of the size with most part area for its cost; None if a part fits on none."""
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
    """Nest parts by piling alone, faster than `nested`; None for more than `limit` sheets."""
    ask = raster(stock, gap, grain)
    return _filled(parts, False, stock, ask, most)


def _boxes(parts: Sequence[FlatPart], gap: float) -> float:
    return float(sum((part.size[0] + gap) * (part.size[1] + gap) for part in parts))


def _by_box(part: FlatPart) -> tuple[float, ...]:
    """Return the sort key that puts long and bowed parts first, because short parts fit between them."""
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
    """Fill sheets: each part goes on the first sheet with room; None for more than `limit` sheets."""
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


def least_clearance(outlines: Sequence[Floats], size: tuple[float, float], enough: float) -> float:
    """Return the least distance between closed polygons (k, 2), and from them to the edges of their sheet (m).

    It is 0 for overlaps, and negative beyond an edge.
    size : of the sheet (m).    enough : pairs whose boxes are farther apart are not measured (m).
    """
    boxes = [(P.min(axis=0), P.max(axis=0)) for P in outlines]
    found = [float(min(low.min(), (np.array(size) - high).min())) for low, high in boxes]
    for (P, (a, b)), (Q, (c, d)) in combinations(zip(outlines, boxes, strict=True), 2):
        if float(np.maximum(c - b, a - d).max()) < enough:
            found.append(polygon_distance(P, Q))
    return min(found, default=np.inf)


def polygon_distance(P: Floats, Q: Floats) -> float:
    """Return the distance of two closed polygons (p, 2) and (q, 2) as areas (m); 0 if they overlap or touch."""
    if _inside(P[:1], Q)[0] or _inside(Q[:1], P)[0] or _cross(P, Q):
        return 0.0
    return min(_from_sides(P, Q), _from_sides(Q, P))


def _from_sides(points: Floats, polygon: Floats) -> float:
    a, side = polygon, np.roll(polygon, -1, axis=0) - polygon
    way = points[:, None] - a
    t = np.clip((way * side).sum(axis=2) / np.maximum((side**2).sum(axis=1), 1e-30), 0, 1)
    return float(np.linalg.norm(way - t[..., None] * side, axis=2).min())


def _inside(points: Floats, polygon: Floats) -> Bools:
    """Return (p,) whether points (p, 2) are inside a polygon: a ray crosses its sides an odd number of times."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray((spans & (x < at)).sum(axis=1) % 2 == 1)


def _cross(P: Floats, Q: Floats) -> bool:
    a, b, c, d = P[:, None], np.roll(P, -1, axis=0)[:, None], Q[None], np.roll(Q, -1, axis=0)[None]
    return bool(((_turn(a, b, c) * _turn(a, b, d) < 0) & (_turn(c, d, a) * _turn(c, d, b) < 0)).any())


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return twice the area of the triangles a, b, c, positive if they turn to the left."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def require_spyrrow() -> None:
    """Raise PatternError if spyrrow is not installed."""
    if importlib.util.find_spec("spyrrow") is None:
        raise PatternError(
            "workshop.nesting = 'spyrrow' needs the library spyrrow; install it with: pip install \"dsfab[nesting]\""
        )


def emptied(sheets: Sequence[NestedSheet], gap: float, grain: bool = False) -> list[NestedSheet]:
    """Return the same parts on as many sheets or fewer; grain : parts of members lie along the sheets only."""
    # trials are counted, because a limit in seconds would give other sheets on other machines
    found, tries = list(sheets), iter(range(24))
    while len(found) > 1:
        fewer = _without_least(found, gap, grain, tries)
        if fewer is None:
            break
        found = fewer
    return found


def _without_least(
    sheets: Sequence[NestedSheet], gap: float, grain: bool, tries: Iterator[int]
) -> list[NestedSheet] | None:
    """Return all parts without the least used sheet; None if a part finds no room or trials run out."""
    least = min(sheets, key=_area)
    others = [sheet for sheet in sheets if sheet is not least]
    for part in sorted((one.part for one in least.parts), key=lambda part: -part.area):
        for k in sorted(range(len(others)), key=lambda k: others[k].used)[:3]:  # most room first
            full = _area(others[k]) + part.area > 0.92 * others[k].size[0] * others[k].size[1]
            if full or next(tries, None) is None:
                continue
            if tried := _with_part(others[k], part, gap, grain):
                others[k] = tried
                break
        else:
            return None
    return others


def _area(sheet: NestedSheet) -> float:
    return sum(one.part.area for one in sheet.parts)


def _with_part(sheet: NestedSheet, part: FlatPart, gap: float, grain: bool) -> NestedSheet | None:
    parts = [*(one.part for one in sheet.parts), part]
    placed = _by_spyrrow(parts, sheet.size, gap, grain)
    if sorted(one.part.id for one in placed) != sorted(one.id for one in parts):
        return None
    outlines = [one.placed.outline for one in placed]
    if least_clearance(outlines, sheet.size, gap) < gap - NEAR:
        return None
    return replace(sheet, parts=tuple(placed))


def _by_spyrrow(parts: Sequence[FlatPart], size: tuple[float, float], gap: float, grain: bool) -> list[NestedPart]:
    # spyrrow computes in single precision, and `contours` leave out corners within `OUTLINE_TOLERANCE` of a line
    apart = gap + 1e-5 + 2 * TOLERANCE
    job = {
        "items": [[part.contours[0].tolist(), _turns(part, size[1] - 2 * gap, grain)] for part in parts],
        "height": size[1],
        "length": size[0],  # spyrrow keeps the gap to the edges
        "gap": apart,
        "seed": 1,
    }
    with temporary_folder("dsfab") as folder:
        path = Path(folder) / "job.json"
        path.write_text(json.dumps(job), encoding="utf-8")
        try:
            said = json.loads(last_line(spyrrow_program.__file__, str(path), seconds=10.0))
            return [NestedPart(parts[k], float(np.radians(turn % 360)), (x, y)) for k, turn, x, y in said or []]
        except (subprocess.TimeoutExpired, ProgramError, ValueError, TypeError, IndexError):
            return []


def _turns(part: FlatPart, tallest: float, grain: bool) -> list[float]:
    across = part.size[0] <= tallest and not (grain and part.member)
    return [0.0, 90.0, 180.0, 270.0] if across else [0.0, 180.0]
