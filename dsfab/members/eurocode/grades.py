"""Strengths of steel and timber grades, and load durations with k_mod (EN 1995-1-1)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

MPA = 1e6


@dataclass(frozen=True)
class SteelGrade:
    """A steel grade. yields : pairs of a thickness (m) and the yield strength up to it (Pa), thin plates first."""

    name: str
    yields: tuple[tuple[float, float], ...]
    source: str

    def fy(self, thickness: float) -> float:
        """Return the yield strength (Pa) of a plate with a thickness (m)."""
        return next((value for limit, value in self.yields if thickness <= limit * (1 + 1e-9)), self.yields[-1][1])

    def covers(self, thickness: float) -> bool:
        """Return True if the grade has a yield strength at this thickness (m)."""
        return thickness <= self.yields[-1][0] * (1 + 1e-9)


def _steel(name: str, megapascals: tuple[float, ...], product: str) -> SteelGrade:
    yields = zip(PLATES, (x * MPA for x in megapascals), strict=True)
    return SteelGrade(
        name, tuple(yields), f"EN 1993-1-1, table 3.1 for plates up to 80 mm; {product} for thicker plates"
    )


PLATES = (0.04, 0.08, 0.1, 0.15, 0.2)
"""Largest thickness (m) for each yield strength. Up to 80 mm, EN 1993-1-1 gives the strengths, above EN 10025."""
STEEL = {
    grade.name: grade
    for grade in (
        _steel("S235", (235, 215, 215, 195, 185), "EN 10025-2, table 6"),
        _steel("S275", (275, 255, 235, 225, 215), "EN 10025-2, table 6"),
        _steel("S355", (355, 335, 315, 295, 285), "EN 10025-2, table 6"),
        _steel("S460", (460, 430, 400, 380, 370), "EN 10025-3, table 4"),
    )
}
"""Structural steel grades by name. S460 is S460N."""

Product = Literal["solid timber", "glulam", "LVL"]


@dataclass(frozen=True)
class TimberGrade:
    """A timber grade. Strengths along the grain, Pa: bending `fm`, tension `ft`, compression `fc`, shear `fv`.
    ft90     : tension across the grain; 0 if the standard has none.    size : exponent s of the size effect of LVL.
    E05, G05 : 5 % quantiles of the moduli, Pa.    fm_flat, fv_flat : strengths in flatwise bending, Pa."""

    name: str
    product: Product
    fm: float
    ft: float
    fc: float
    fv: float
    E05: float
    G05: float
    fm_flat: float
    fv_flat: float
    size: float
    source: str
    ft90: float = 0.0


def _solid(name: str, fm: float, ft: float, fc: float, fv: float, E05: float, G05: float) -> TimberGrade:
    source = "EN 338:2016, table 1; G05 = E05 / 16"
    strengths = fm * MPA, ft * MPA, fc * MPA, fv * MPA
    return TimberGrade(
        name, "solid timber", *strengths, E05 * MPA, G05 * MPA, fm * MPA, fv * MPA, 0.0, source, 0.4 * MPA
    )


def _glulam(name: str, fm: float, ft: float, fc: float, E05: float) -> TimberGrade:
    strengths = fm * MPA, ft * MPA, fc * MPA, 3.5 * MPA
    source = "EN 14080:2013, table 5"
    return TimberGrade(name, "glulam", *strengths, E05 * MPA, 540 * MPA, fm * MPA, 3.5 * MPA, 0.0, source, 0.5 * MPA)


TIMBER = {
    grade.name: grade
    for grade in (
        _solid("C24", 24, 14.5, 21, 4.0, 7400, 462),
        _solid("C30", 30, 19, 24, 4.0, 8000, 500),
        _glulam("GL24h", 24, 19.2, 24, 9600),
        _glulam("GL28h", 28, 22.3, 28, 10500),
        _glulam("GL32h", 32, 25.6, 32, 11800),
        TimberGrade(
            *("LVL 48 P", "LVL"),
            *(44 * MPA, 35 * MPA, 29 * MPA, 4.2 * MPA, 11600 * MPA, 400 * MPA, 48 * MPA, 2.3 * MPA, 0.15),
            "EN 14374, values from the manufacturers' bulletin on strength classes (2019); compression strength for "
            "service class 2",
        ),
    )
}
"""Timber grades by name."""

Duration = Literal["permanent", "long", "medium", "short", "instantaneous"]
DURATIONS: tuple[Duration, ...] = get_args(Duration)
"""Classes of load duration, from longest to shortest [EN 1995-1-1, table 2.1]."""

ServiceClass = Literal[1, 2, 3]

K_MOD: dict[ServiceClass, tuple[float, ...]] = {
    1: (0.6, 0.7, 0.8, 0.9, 1.1),
    2: (0.6, 0.7, 0.8, 0.9, 1.1),
    3: (0.5, 0.55, 0.65, 0.7, 0.9),
}
"""Factors k_mod of timber products [EN 1995-1-1, table 3.1], by service class, in the order of `DURATIONS`."""


def k_mod(duration: Duration, service_class: ServiceClass) -> float:
    """Return the factor on strengths for a load duration and a service class (moisture) [EN 1995-1-1, table 3.1]."""
    return K_MOD[service_class][DURATIONS.index(duration)]


def shortest(durations: Iterable[Duration]) -> Duration:
    """Return the shortest of the load durations [EN 1995-1-1, 3.1.3 (2)]."""
    return max(durations, key=DURATIONS.index)
