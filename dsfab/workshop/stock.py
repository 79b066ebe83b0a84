"""Prices of stock sheets, and hints on saving sheets."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import count_phrase, length
from dsfab.core.units import MM_PER_M
from dsfab.preset.sections import Workshop
from dsfab.workshop.nesting import NestedSheet, stack_parts
from dsfab.workshop.parts import FlatPart


def stock_choices(options: Workshop) -> list[Workshop]:
    """Return the options, then variants without the longest stock sheets; no variants without prices."""
    lengths = sorted({size[0] for size in options.stock}, reverse=True) if options.prices else []
    choices = [options]
    for longest in lengths[1:]:
        numbers = [k for k, size in enumerate(options.stock) if size[0] <= longest]
        stock, prices = (tuple(values[k] for k in numbers) for values in (options.stock, options.prices))
        choices.append(options.model_copy(update={"stock": stock, "prices": prices}))
    return choices


def stock_cost(sheets: Sequence[NestedSheet]) -> float:
    """Return the cost of all sheets; 0 without prices."""
    return round(sum(sheet.price for sheet in sheets), 6)


def stock_words(sheets: Sequence[NestedSheet]) -> str:
    """Return sheets in words: "12 of 2.5 x 1.25 m at 45"."""
    count = Counter((sheet.size, sheet.price) for sheet in sheets)
    return ", ".join(
        f"{many} of {size_words(size)}" + (f" at {money(price)}" if price else "")
        for (size, price), many in sorted(count.items())
    )


def price_notes(sheets: Sequence[NestedSheet], alternatives: Sequence[tuple[Workshop, float]]) -> list[str]:
    """Return notes on the cost of the sheets, and on the cost with different stock sizes; empty without prices.
    alternatives : options with different stock sizes, and the cost of all sheets for these options."""
    cost = stock_cost(sheets)
    if not cost:
        return []
    notes = [f"sheets cost {money(cost)} together: {stock_words(sheets)}"]
    for options, other_cost in alternatives:
        longest = max(options.stock)
        notes.append(f"a stock with sheets up to {size_words(longest)} would cost {money(other_cost)} in total")
    return notes


def size_words(size: tuple[float, float]) -> str:
    """Return a sheet size in words: "2.5 x 1.25 m"."""
    return f"{MM_PER_M * size[0]:g} x {MM_PER_M * size[1]:g} mm" if size[0] < 1 else f"{size[0]:g} x {size[1]:g} m"


def money(amount: float) -> str:
    """Return an amount in the currency of the prices: "1,234.50", "45"."""
    return f"{amount:,.2f}".removesuffix(".00")


NARROWING_SHARES = (0.95, 0.9)  # trial widths of strips, as fractions of their true width, widest first
LEAST_SAVING = 0.04  # least saving for a hint: fraction of the number or area of sheets
StockSizes = Sequence[tuple[float, float]]


def sheet_hints(
    parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: StockSizes, gap: float, grain: bool = False
) -> list[str]:
    """Return hints on narrower strips or larger stock that need fewer sheets. stock, gap, grain : see `nest_parts`."""
    if len(parts) * len(sheets) > 20_000:
        return []
    return [*_narrower_hint(parts, sheets, stock, gap, grain), *_larger_hint(parts, sheets, stock, gap, grain)]


def narrow_strip(part: FlatPart, share: float) -> FlatPart:
    """Return a strip with its width multiplied by `share`. Parts that are no strips do not change."""
    if not _is_strip(part):
        return part
    outline = part.outline
    middle = (outline + outline[::-1]) / 2
    return replace(part, outline=middle + share * (outline - middle))


def _is_strip(part: FlatPart) -> bool:
    return len(part.axis) > 1 and len(part.outline) == 2 * len(part.axis)


def _widths(parts: Sequence[FlatPart]) -> Floats:
    rows = [np.linalg.norm(part.outline - part.outline[::-1], axis=1) for part in parts if _is_strip(part)]
    return np.array([float(np.median(row)) for row in rows])


def _narrower_hint(
    parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: StockSizes, gap: float, grain: bool
) -> Iterator[str]:
    widths = _widths(parts)
    if not len(widths):
        return
    width = float(np.median(widths))
    bolt = max((hole.diameter for part in parts for hole in part.holes), default=0.0)
    alike = np.ptp(np.quantile(widths, [0.05, 0.95])) < 0.05 * width
    step = 10.0 ** np.floor(np.log10(width)) / 20 if alike else 0.0
    for share in NARROWING_SHARES:
        new_width = step * round(share * width / step) if step else share * width
        if new_width < 3 * bolt or new_width >= width:
            return
        limit = int((1 - LEAST_SAVING) * len(sheets) + 1e-9)
        trial = _trial_nest([narrow_strip(part, new_width / width) for part in parts], stock, gap, limit, grain)
        if trial is not None:
            how = f"{length(new_width)} wide instead of {length(width)}" if alike else f"{1 - share:.0%} narrower"
            needed = count_phrase(len(trial), "sheet")
            advice = "change the keys in [pattern.width], and build the design again"
            yield f"if strips were {how}, the parts would need {needed} instead of {len(sheets)}; {advice}"
            return


def _larger_hint(
    parts: Sequence[FlatPart], sheets: Sequence[NestedSheet], stock: StockSizes, gap: float, grain: bool
) -> Iterator[str]:
    if len(stock) != 1:
        return
    ((long, wide),), larger = stock, 1.1
    for size in ((larger * long, wide), (long, larger * wide)):
        limit = int((1 - LEAST_SAVING) * len(sheets) / larger + 1e-9)
        trial = _trial_nest(parts, [size], gap, limit, grain)
        if trial is not None:
            needed = count_phrase(len(trial), "sheet")
            yield (
                f"a stock of {size[0]:.4g} x {size[1]:.4g} m sheets would need {needed} instead of {len(sheets)}, "
                f"with {1 - _sheets_area(trial) / _sheets_area(sheets):.0%} less area of material"
            )
            return


def _trial_nest(
    parts: Sequence[FlatPart], stock: StockSizes, gap: float, limit: int, grain: bool
) -> list[NestedSheet] | None:
    room = 0.95 * limit * max(a * b for a, b in stock)
    return None if sum(part.area for part in parts) > room else stack_parts(parts, stock, gap, limit, grain)


def _sheets_area(sheets: Sequence[NestedSheet]) -> float:
    return sum(sheet.size[0] * sheet.size[1] for sheet in sheets)
