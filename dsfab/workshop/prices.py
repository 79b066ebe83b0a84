"""What the stock costs: for which of its sizes parts are cut, so that all sheets together are cheapest, and how that is
said."""

from collections import Counter
from collections.abc import Sequence

from dsfab.preset_workshop import Workshop
from dsfab.units import MM_PER_M
from dsfab.workshop.nesting import NestedSheet


def stock_choices(ask: Workshop) -> list[Workshop]:
    """The section as it is, and, where its stock has prices, without the longest sizes of it, one after another.

    What is longer than the stock is spliced, so that parts for long sheets have no room on short ones that are cheaper.
    """
    lengths = sorted({size[0] for size in ask.stock}, reverse=True) if ask.prices else []
    found = [ask]
    for longest in lengths[1:]:
        kept = [k for k, size in enumerate(ask.stock) if size[0] <= longest]
        some = {"stock": tuple(ask.stock[k] for k in kept), "prices": tuple(ask.prices[k] for k in kept)}
        found.append(ask.model_copy(update=some))
    return found


def stock_cost(sheets: Sequence[NestedSheet]) -> float:
    """What sheets cost together; 0 where they have no prices."""
    return round(sum(sheet.price for sheet in sheets), 6)


def stock_words(sheets: Sequence[NestedSheet]) -> str:
    """'12 of 2.5 x 1.25 m at 45, 3 of 3 x 1.5 m at 62'; without prices where there are none."""
    count = Counter((sheet.size, sheet.price) for sheet in sheets)
    return ", ".join(
        f"{many} of {size_words(size)}" + (f" at {money(price)}" if price else "")
        for (size, price), many in sorted(count.items())
    )


def price_notes(sheets: Sequence[NestedSheet], left: Sequence[tuple[Workshop, float]]) -> list[str]:
    """What is said of the cost of sheets; nothing where they have no prices.

    left : other choices of stock for which parts were cut, and what these would cost.
    """
    cost = stock_cost(sheets)
    if not cost:
        return []
    notes = [f"sheets cost {money(cost)} together: {stock_words(sheets)}"]
    for ask, other in left:
        longest = max(ask.stock)
        notes.append(f"parts cut for sheets up to {size_words(longest)} would need sheets for {money(other)}")
    return notes


def size_words(size: tuple[float, float]) -> str:
    """'2.5 x 1.25 m', '420 x 297 mm'."""
    if size[0] < 1:
        return f"{MM_PER_M * size[0]:g} x {MM_PER_M * size[1]:g} mm"
    return f"{size[0]:g} x {size[1]:g} m"


def money(amount: float) -> str:
    """'1,234.50', '45': in the currency of the prices."""
    return f"{amount:,.2f}".removesuffix(".00")
