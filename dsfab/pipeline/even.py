"""Evenly spaced stripes of a preset: directions, densities, phases, and where lines that crowd are left out."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import PatternError
from dsfab.pattern import (
    vertex_means,
)
from dsfab.pipeline.courses import Course, Followed, Lines, no_lines
from dsfab.pipeline.optimal import optimal_statics
from dsfab.preset import FAMILIES, Family, Pattern, Preset, Width
from dsfab.results import EvenStripes, StaticsResult
from dsfab.slicing import Halved, chart_of, halved
from dsfab.surface import Surface

FINEST = 0.5
"""Stripes are at least this share of a mean edge apart: members that are much thinner than triangles are ragged."""
HOLDS = 0.05
"""Halved stripes that are farther off their mean spacing than this share are drawn a second time."""
FAILS = 0.3
"""If they are as far off as this then, they are drawn without being halved."""
LEAST_GROWN = 0.5
"""Of what was asked a phase grows at least by this much: or the surface is too small to have two stripes around it."""


def same_stripes(old: Pattern, new: Pattern) -> bool:
    """Whether two [pattern] ask for the same middles of stripes: all is alike but widths, and what is kept besides.

    What stripes on modes alone are drawn by makes no difference either. A key that is not named here does. Where
    stripes are drawn with the weight that others leave, everything does.
    """
    if new.rounds:
        return old == new

    def middles(ask: Pattern) -> Pattern:
        both = {
            name: getattr(ask, name).model_copy(update={"threshold": 0.0, "frequency": 0.0, "mode": 1, "phase": 0.0})
            for name in FAMILIES
        }
        width = Width(solid_fraction=ask.width.solid_fraction) if ask.forces == "optimal" else Width()
        return ask.model_copy(update={"width": width, "keep": 0.0, "rim": 0.0, "tidy": None, **both})

    return middles(old) == middles(new)


def even_stripes(preset: Preset, surface: Surface, statics: StaticsResult) -> EvenStripes:
    """The families of stripes as `[pattern]` asks.

    Raises PatternError where nothing is stressed, and for spacings that the mesh is too coarse or the surface too small
    for.
    """
    ask = preset.pattern
    if ask.forces == "optimal":
        statics = optimal_statics(preset, surface, statics)
    spacings = [family.distance(surface.area, surface.mean_edge) for family in (ask.major, ask.minor)]
    shown = [FAMILIES.index(name) for name in ask.family_names]
    for k in shown:
        _refuse_impossible(FAMILIES[k], spacings[k], surface)
    followed = Followed.of(preset, surface, statics, [spacings[k] for k in shown])
    courses = {k: Course.of(followed, FAMILIES[k], ask.halved) for k in shown}
    both = [courses[k].lines(h) if k in courses else no_lines(surface, h) for k, h in enumerate(spacings)]
    for name, lines, spacing in zip(FAMILIES, both, spacings, strict=True):
        if lines.grown < LEAST_GROWN:
            raise _too_far(name, spacing, surface)
    found = _drawn_again(followed, courses, both, spacings)
    made = found.stripes(followed)
    own = ask.forces == "optimal" or ask.rounds > 0
    return replace(made, forces=followed.given.stress) if own else made


def _drawn_again(
    followed: Followed, courses: dict[int, Course], both: list[Lines], spacings: list[float]
) -> "_Divided":
    """Both families of lines, drawn anew where what is left of them is off their spacings, metres.

    Where lines are halved everywhere or nowhere that may be the one at this spacing and the other at that, and either
    is off by nearly a half: such a family is not halved.
    """
    surface, found = followed.frames.surface, _Divided.of(followed, *both)
    tries = [found]
    for most, halve in ((HOLDS, True), (FAILS, False)):
        off = _off(surface, found, spacings)
        again = [k for k, lines in enumerate(both) if lines.most > 0 and abs(off[k]) > most]
        if not again:
            break
        for k in again:  # levels follow whole openings: what they leave is known afterwards
            wider = spacings[k] * float(np.exp(off[k]))
            both[k] = courses[k].lines(wider) if halve else courses[k].unhalved.lines(spacings[k])
        tries.append(_Divided.of(followed, *both))
        found = min(tries, key=lambda one: float(np.abs(_off(surface, one, spacings)).max()))
    return found


def _off(surface: Surface, found: "_Divided", spacings: list[float]) -> Floats:
    """(2,) logarithm of the stripes per metre that are drawn, in the mean, over what was asked."""
    mean = surface.vertex_areas @ found.density / surface.area
    return np.asarray(np.log(mean * np.array(spacings)))


def _refuse_impossible(name: str, spacing: float, surface: Surface) -> None:
    """Raise PatternError for metres between stripes that no phase needs to be solved for."""
    if spacing < FINEST * surface.mean_edge:
        raise PatternError(
            f"pattern.{name}.spacing = {spacing:.4g} m is too fine for this mesh, whose edges are "
            f"{surface.mean_edge:.3g} m long on average: ask for {_digits(FINEST * surface.mean_edge)} m or more, or "
            "make the mesh finer (surface.edge or surface.refine)"
        )
    if spacing > surface.size:
        raise _too_far(name, spacing, surface)


def _too_far(name: str, spacing: float, surface: Surface) -> PatternError:
    default = Family().distance(surface.area, surface.mean_edge)
    return PatternError(
        f"pattern.{name}.spacing = {spacing:.4g} m is too far for this surface, which is {surface.size:.3g} m from "
        f"corner to corner: not even one stripe and the next fit on it; {default:.2g} m "
        f"is the default{_as_millimetres(spacing, surface)}"
    )


def _as_millimetres(spacing: float, surface: Surface) -> str:
    """A hint where as many millimetres would fit."""
    fits = FINEST * surface.mean_edge <= spacing / 1000 <= surface.size
    return f" (lengths are in metres: {spacing / 1000:.4g} for {spacing:.4g} mm)" if fits else ""


def _digits(length: float) -> str:
    """Rounded up to two digits."""
    unit = 10.0 ** (np.floor(np.log10(length)) - 1)
    return f"{np.ceil(length / unit) * unit:.2g}"


@dataclass(frozen=True, eq=False)
class _Divided:
    """Both families with their lines left out where they crowd, (n, 2) how many lines are left per metre.

    These are those of all images of a point: faces are seldom as symmetric as vertices, and widths follow them.
    """

    both: tuple[Lines, Lines]
    halved: Halved
    density: Floats

    @classmethod
    def of(cls, followed: Followed, major: Lines, minor: Lines) -> Self:
        both, surface = (major, minor), followed.frames.surface
        fields = major.phase.field, minor.phase.field
        wish, free = (major.wish, minor.wish), (major.free, minor.free)
        divided = halved(surface, fields, wish, (major.most, minor.most), free)
        scales = np.stack([divided.scale(surface, k) for k in (0, 1)], axis=1)
        left = followed.images.mean(vertex_means(surface, scales))
        return cls(both, divided, np.stack([lines.slope for lines in both], axis=1) * left)

    def stripes(self, followed: Followed) -> EvenStripes:
        """What the line goes on with."""
        surface, (major, minor) = followed.frames.surface, self.both
        slope = np.stack([major.slope, minor.slope], axis=1)
        phases = major.phase, minor.phase
        chart = chart_of(self.halved, (major.phase.field, minor.phase.field))
        wanted = self._wanted(surface, 0), self._wanted(surface, 1)
        same = followed.symmetry, followed.with_members(self.both)
        return EvenStripes(phases, wanted, slope, self.density, self.halved.first, chart, *same)

    def _wanted(self, surface: Surface, k: int) -> tuple[Floats, ...]:
        return tuple(self.halved.wanted(surface, k, level) for level in range(self.both[k].most))
