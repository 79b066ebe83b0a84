"""Units: dsfab computes in metres, newtons and pascals."""

from dsfab.core.errors import SurfaceError

METRES_PER: dict[str, float] = {
    "mm": 1e-3, "cm": 1e-2, "dm": 1e-1, "m": 1.0, "km": 1e3, "in": 0.0254, "ft": 0.3048, "yd": 0.9144, "um": 1e-6,
    "us-ft": 1200 / 3937,  # US survey foot, for older land surveys in the United States
}  # fmt: skip
"""Length in metres of each unit that a preset or a file may name."""

_PREFIXES = ("milli", "m"), ("centi", "c"), ("deci", "d"), ("kilo", "k"), ("", "")
UNIT_WORDS: dict[str, str] = {
    **{unit: unit for unit in METRES_PER},
    **{f"{start}met{end}": f"{short}m" for start, short in _PREFIXES for end in ("er", "ers", "re", "res")},
    "inch": "in", "inches": "in", "foot": "ft", "feet": "ft", "yard": "yd", "yards": "yd", "micron": "um",
    "microns": "um", "us survey foot": "us-ft", "us survey feet": "us-ft", "ussurveyfeet": "us-ft",
}  # fmt: skip
"""Unit for each word that names it in a file, such as m for "metres"; words are in lower case."""

MM_PER_M = 1e3  # Exported files are in millimetres.
GRAVITY = 9.80665  # Standard acceleration of gravity, m/s^2 (CGPM 1901).


def metres_per(unit: str) -> float:
    """Return the length of a unit in metres. Raises SurfaceError for an unknown unit."""
    if unit not in METRES_PER:
        raise SurfaceError(f"unit = {unit!r} is not known; use one of {', '.join(METRES_PER)}")
    return METRES_PER[unit]
