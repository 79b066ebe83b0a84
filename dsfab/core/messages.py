"""Numbers with units, lists and tables as text."""

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in plain text; only the first column is aligned to the left."""
    lines = [list(head), *(list(row) for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def names_and_count(names: Sequence[str], shown: int = 5) -> str:
    """Return the first `shown` names, and the number of further names, as text."""
    return ", ".join(names[:shown]) + (f" and {len(names) - shown} more" if len(names) > shown else "")


def count_phrase(number: int, thing: str, verb: str = "") -> str:
    """Return a number with noun and verb, such as '1 edge has'. thing : singular noun.    verb : plural verb."""
    if number == 1:
        return f"1 {thing} {'has' if verb == 'have' else verb + 's'}" if verb else f"1 {thing}"
    plural = {"vertex": "vertices"}.get(thing, thing + ("es" if thing.endswith("sh") else "s"))
    return f"{number:,} {plural} {verb}".rstrip()


def coordinates(point: Sequence[float]) -> str:
    """Return the coordinates of a point as text: '(452 341, 5 567 120, 0)'."""
    return f"({', '.join(f'{x:,.10g}'.replace(',', ' ') for x in point)})"


def point_words(point: Iterable[float]) -> str:
    """Return a point (metres) as text: '(1.5, 0, 0.333) m'."""
    return f"({', '.join(f'{x + 0.0:.3g}' for x in point)}) m"


def sentence(words: str) -> str:
    """Return the text with a capital letter and a full stop."""
    return f"{words[0].upper()}{words[1:]}."


def byte_size(count: float) -> str:
    """Return a number of bytes as text: '4.2 MB'."""
    for unit in ("B", "KB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


def mass(kilograms: float) -> str:
    """Return a mass as text: '830 g', '12.4 kg', '3.1 t'."""
    if kilograms < 1:
        return f"{1000 * kilograms:.3g} g"
    return f"{kilograms:.3g} kg" if kilograms < 1000 else f"{kilograms / 1000:.3g} t"


def length(metres: float) -> str:
    """Return a length as text: '0.31 mm', '2.4 m', '8 km'."""
    if abs(metres) >= 999.5:
        return f"{metres / 1000:.3g} km"
    return f"{1000 * metres:.3g} mm" if abs(metres) < 1 else f"{metres:.3g} m"


MEANINGFUL_FACTOR = 1000.0  # Largest load factor in reports; larger factors come from rounding or tiny compression.


def load_factor(factor: float) -> str:
    """Return a factor on a load as text: '3.14', 'over 1000'."""
    return f"{factor:.3g}" if factor <= MEANINGFUL_FACTOR else f"over {MEANINGFUL_FACTOR:.0f}"


def duration(seconds: float) -> str:
    """Return a duration as text: '2.7 s', '40 s', '12 min', '3.5 h'."""
    if seconds < 99.5:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def force(newtons: float) -> str:
    """Return a force as text: '830 N', '12.4 kN', '3.1 MN'."""
    for unit, scale in (("N", 1.0), ("kN", 1e3)):
        if abs(newtons) < 999.5 * scale:
            return f"{newtons / scale:.3g} {unit}"
    return f"{newtons / 1e6:.3g} MN"


def value_with_bound(value: float, bound: float | None, unit: str = "") -> str:
    """Return a value with its relative error bound: '2.34 ± 1.8 %'. bound : None if unknown."""
    unit = f" {unit}" if unit else ""
    if bound is None:
        return f"{value:.3g}{unit} (one mesh, bound unknown)"
    share = f"{100 * bound:.2g}" if bound < 0.1 else f"{100 * bound:.0f}"
    return f"{value:.{4 if bound < 0.005 else 3}g}{unit} ± {share} %"


def direction_phrase(direction: Sequence[float]) -> str:
    """Return the direction of a nonzero vector as text: 'down', '+x' or '(0.6, 0, -0.8)'."""
    norm = sum(x * x for x in direction) ** 0.5
    unit = [x / norm for x in direction]
    largest = max(range(3), key=lambda k: abs(unit[k]))
    if abs(unit[largest]) < 0.99985:  # over one degree from every axis
        return f"({', '.join(f'{round(x, 2) + 0.0:.2g}' for x in unit)})"
    up = unit[largest] > 0
    return ("up" if up else "down") if largest == 2 else f"{'+' if up else '-'}{'xyz'[largest]}"
