"""Numbers as a report says them: with a unit, and no more digits than are known."""

import math
from collections.abc import Sequence

from dsfab.wording import length as length_words

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))


def unit_for(size: float, unit: str) -> tuple[float, str]:
    """What to divide values of this size by, and the unit with its prefix."""
    size = abs(size)
    factor, prefix = next(((f, p) for f, p in PREFIXES if size >= 0.9995 * f), (1.0, "") if not size else PREFIXES[-1])
    return factor, prefix + unit


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """'12.3 kN'; 'n/a' for what is not known."""
    if value is None or not math.isfinite(value):
        return "n/a"
    factor, name = unit_for(value, unit)
    return f"{digits_of(value / factor, digits)} {name}"


def digits_of(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent: '0.0123', '12.3', '12 300'."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "n/a"
    value = float(f"{value:.{digits - 1}e}")  # 9.996 has become 10.00 before its digits are counted
    after = max(0, digits - 1 - math.floor(math.log10(abs(value)) + 1e-12))
    return f"{value:,.{after}f}".replace(",", " ")


def within(value: float, bound: float | None, unit: str) -> str:
    """'59.9 J ± 1.8 %': as many digits as the bound leaves."""
    if not math.isfinite(value):
        return "n/a"
    if bound is None or not math.isfinite(bound):
        return f"{quantity(value, unit)} (bound unknown)"
    return f"{quantity(value, unit, 4 if bound < 0.005 else 3)} ± {percent(bound)}"


def share_of(part: float) -> str:
    """'41.3 %', of the surface."""
    return f"{100 * part:.1f} %"


def percent(share: float) -> str:
    """'1.8 %', '0.3 %', '12 %'."""
    return f"{100 * share:.2g} %" if abs(share) < 0.1 else f"{100 * share:.0f} %"


def times(low: float, middle: float, high: float) -> str:
    """'1.92 (1.87 to 1.97)'."""
    return f"{digits_of(middle)} ({digits_of(low)} to {digits_of(high)})"


def point(place: Sequence[float]) -> str:
    """'(1.20, 0.00, 3.98) m'."""
    return f"({', '.join(f'{x + 0.0:.2f}' for x in place)}) m"


def length(metres: float | None) -> str:
    """'0.31 mm', '2.4 m'."""
    return "n/a" if metres is None or not math.isfinite(metres) else length_words(metres)


def enumeration(words: Sequence[str]) -> str:
    """'a, b and c'."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def nice(value: float) -> float:
    """The next of 1, 2, 2.5 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(power * step for step in (1.0, 2.0, 2.5, 5.0, 10.0) if power * step >= value * (1 - 1e-9)))
