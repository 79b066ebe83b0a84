"""Prices of stock sheets, and hints that save sheets."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.core.units import MM_PER_M
from dsfab.preset.sections import Workshop
from dsfab.workshop.nesting import NestedSheet, stacked
from dsfab.workshop.parts import FlatPart


def stock_choices(ask: Workshop) -> list[Workshop]:
    """Return the section, and with prices also without its longest sizes: parts for long sheets fit no short ones."""
    lengths = sorted({size[0] for size in ask.stock}, reverse=True) if ask.prices else []
    found = [ask]
    for longest in lengths[1:]:
        kept = [k for k, size in enumerate(ask.stock) if size[0] <= longest]
        some = {"stock": tuple(ask.stock[k] for k in kept), "prices": tuple(ask.prices[k] for k in kept)}
        found.append(ask.model_copy(update=some))
    return found


def stock_cost(sheets: Sequence[NestedSheet]) -> float:
    """Return the cost of all sheets; 0 without prices."""
    return round(sum(sheet.price for sheet in sheets), 6)


def stock_words(sheets: Sequence[NestedSheet]) -> str:
    """Return "12 of 2.5 x 1.25 m at 45, 3 of 3 x 1.5 m at 62"; without prices sizes only."""
    count = Counter((sheet.size, sheet.price) for sheet in sheets)
    return ", ".join(
        f"{many} of {size_words(size)}" + (f" at {money(price)}" if price else "")
        for (size, price), many in sorted(count.items())
    )


def price_notes(sheets: Sequence[NestedSheet], left: Sequence[tuple[Workshop, float]]) -> list[str]:
    """Return notes on the cost of sheets, and of alternative stock; none without prices."""
    cost = stock_cost(sheets)
    if not cost:
        return []
    notes = [f"sheets cost {money(cost)} together: {stock_words(sheets)}"]
    for ask, other in left:
        longest = max(ask.stock)
        notes.append(f"parts cut for sheets up to {size_words(longest)} would need sheets for {money(other)}")
    return notes


def size_words(size: tuple[float, float]) -> str:
    """Return "2.5 x 1.25 m" or "420 x 297 mm"."""
    if size[0] < 1:
        return f"{MM_PER_M * size[0]:g} x {MM_PER_M * size[1]:g} mm"
    return f"{size[0]:g} x {size[1]:g} m"


def money(amount: float) -> str:
    """Return an amount in the currency of the prices: "1,234.50", "45"."""
    return f"{amount:,.2f}".removesuffix(".00")


NARROWER = (0.95, 0.9)
"""Shares of the strips' width to try, the widest first."""
WORTH = 0.04
"""Least share of the sheets, or of their area, that a hint saves."""
Stock = Sequence[tuple[float, float]]


class _Asked(NamedTuple):
    gap: float
    grain: bool


def sheet_hints(
    parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: Stock, gap: float, grain: bool = False
) -> list[str]:
    """Return sentences on narrower strips or larger stock that would need fewer sheets.

    stock : lengths and widths (m).    gap : metres.    grain : as for `nested`.
    Each number comes from a trial nest. Large plans have no hints, because nesting takes too long.
    """
    if len(parts) * len(sheets) > 20_000:  # nesting again would take too long
        return []
    ask = _Asked(gap, grain)
    return [*_narrower(parts, sheets, stock, ask), *_larger(parts, sheets, stock, ask)]


def narrowed(part: FlatPart, share: float) -> FlatPart:
    """Return a strip with a share of its width about its axis; holes and other parts stay as they are."""
    if not _is_strip(part):
        return part
    outline = part.outline
    middle = (outline + outline[::-1]) / 2
    return replace(part, outline=middle + share * (outline - middle))


def _is_strip(part: FlatPart) -> bool:
    """Return whether the outline runs along an axis and back, station by station."""
    return len(part.axis) > 1 and len(part.outline) == 2 * len(part.axis)


def _widths(parts: Sequence[FlatPart]) -> Floats:
    rows = [np.linalg.norm(part.outline - part.outline[::-1], axis=1) for part in parts if _is_strip(part)]
    return np.array([float(np.median(row)) for row in rows])


def _narrower(parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: Stock, ask: _Asked) -> Iterator[str]:
    widths = _widths(parts)
    if not len(widths):
        return
    wide = float(np.median(widths))
    bolt = max((hole.diameter for part in parts for hole in part.holes), default=0.0)
    alike = np.ptp(np.quantile(widths, [0.05, 0.95])) < 0.05 * wide
    step = 10.0 ** np.floor(np.log10(wide)) / 20 if alike else 0.0
    for share in NARROWER:
        new = step * round(share * wide / step) if step else share * wide
        if new < 3 * bolt or new >= wide:
            return
        most = int((1 - WORTH) * len(sheets) + 1e-9)
        tried = _tried([narrowed(part, new / wide) for part in parts], stock, ask, most)
        if tried is not None:
            how = f"{length(new)} wide instead of {length(wide)}" if alike else f"{1 - share:.0%} narrower"
            yield f"strips {how} would need {_fewer(tried, sheets)}; see [pattern.width], and judge the design again"
            return


def _larger(parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: Stock, ask: _Asked) -> Iterator[str]:
    """Yield a hint on longer, or else wider, stock that has less area in total; for a single stock size only."""
    if len(stock) != 1:
        return
    ((long, wide),), larger = stock, 1.1
    for size in ((larger * long, wide), (long, larger * wide)):
        most = int((1 - WORTH) * len(sheets) / larger + 1e-9)
        tried = _tried(parts, [size], ask, most)
        if tried is not None:
            yield (
                f"stock of {size[0]:.4g} x {size[1]:.4g} m would need {_fewer(tried, sheets)}, "
                f"{1 - _area(tried) / _area(sheets):.0%} less of it"
            )
            return


def _tried(parts: Sequence[FlatPart], stock: Stock, ask: _Asked, most: int) -> list[NestedSheet] | None:
    room = 0.95 * most * max(a * b for a, b in stock)
    if sum(part.area for part in parts) > room:
        return None
    return stacked(parts, stock, ask.gap, most, ask.grain)


def _fewer(tried: Sequence[NestedSheet], sheets: Sequence[NestedSheet]) -> str:
    return f"{len(tried)} sheet{'' if len(tried) == 1 else 's'} instead of {len(sheets)}"


def _area(sheets: Sequence[NestedSheet]) -> float:
    return sum(sheet.size[0] * sheet.size[1] for sheet in sheets)
