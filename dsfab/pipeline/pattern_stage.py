"""Stage 4 as a whole: which stripes, where they run, which modes, how wide."""

from dataclasses import replace
from typing import NamedTuple

from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.even import same_stripes
from dsfab.pipeline.log import Log
from dsfab.pipeline.method import method_step
from dsfab.pipeline.patterns import pattern_step, sketched_step
from dsfab.pipeline.regions import one_sided_words
from dsfab.pipeline.stressing import stressed_step
from dsfab.pipeline.ways import Way
from dsfab.pipeline.weight_rounds import weighed_stripes
from dsfab.preset import Family, Pattern, Preset
from dsfab.results import Attempt, EvenStripes, PatternResult, StressedSurface
from dsfab.sparse import give_back
from dsfab.surface import Surface

SOLVED = 4e3
"""Bytes for each face that the solvers of the stages before leave."""


class Before(NamedTuple):
    """Evenly spaced stripes of an earlier design, on the same surface under the same stress."""

    asked: Pattern
    even: EvenStripes
    seconds: float


class ChosenWay(NamedTuple):
    """A way to draw stripes before their widths are known, and all that was tried for it, best first."""

    way: Way
    attempts: tuple[Attempt, ...] = ()


def chosen_way(preset: Preset, given: StressedSurface, log: Log, before: Before | None = None) -> ChosenWay:
    """Where the stripes of a preset run, with all that it leaves to be chosen but the width that a share asks for.

    before : its stripes are taken where at most their widths, and what is kept besides them, have changed.
    """
    attempts = tuple[Attempt, ...]()
    if preset.pattern.weight_rounds and not preset.pattern.rounds:
        told = f"weight_rounds has no effect on method = '{preset.pattern.method}', but on evenly spaced stripes alone"
        log.note("pattern", told)
    if preset.pattern.method == "auto":
        way, attempts = method_step(preset, given, log)
    else:
        way = _asked_way(preset, given, log, before)
    if way.even and way.even.steered and way.even.steered.told:
        log.note("pattern", way.even.steered.told)
    if way.even and (told := one_sided_words(given.surface, preset.pattern.region, way.even.symmetry)):
        log.note("pattern", told)
    if way.even:
        for told in _idle_frequencies(preset.pattern, given.surface):
            log.note("pattern", told)
    return ChosenWay(way, attempts)


def pattern_stage(preset: Preset, given: StressedSurface, log: Log, chosen: ChosenWay) -> PatternResult:
    """The stripes of a preset, that way; what a search has drawn already is in the seconds of `method`."""
    way = chosen.way
    log.seconds.setdefault("pattern", 0.0)
    drawn = way.drawn or pattern_step(way.preset, given, log, way.choice, way.grading, way.even)
    asked = None if way.preset is preset else way.preset.pattern
    give_back(SOLVED * given.surface.m)  # what the solvers held: whoever draws needs memory of another shape
    return replace(drawn, asked=asked, attempts=chosen.attempts)


def sketched_pattern(given: StressedSurface, chosen: ChosenWay) -> PatternResult:
    """The stripes as wide as a count of points says, at a tenth of the time: for a picture that another one replaces.

    Off by what round corners and filled openings add. Raises PatternError where no width keeps what is asked.
    """
    way = chosen.way
    return sketched_step(way.preset, given, way.choice, way.grading, way.even)


def _idle_frequencies(ask: Pattern, surface: Surface) -> list[str]:
    """What is said of frequencies that evenly spaced stripes do not have; the default is in every complete preset."""
    idle = [(name, getattr(ask, name)) for name in ask.family_names]
    return [
        f"pattern.{name}.frequency = {family.frequency:g} has no effect on evenly spaced stripes, which are "
        f"{family.distance(surface.area, surface.mean_edge):.3g} m apart: set pattern.{name}.spacing instead"
        for name, family in idle
        if ask.method == "stripes" and family.frequency not in (0.0, Family().frequency)
    ]


def _asked_way(preset: Preset, given: StressedSurface, log: Log, before: Before | None) -> Way:
    """The way to draw that a preset asks for, with the modes, phases and widths that it leaves to be chosen."""
    even = _even(preset, given, log, before) if preset.pattern.method == "stripes" else None
    choice = choice_step(preset, given, log) if preset.pattern.auto else None
    settled = preset.settled(choice.mode, choice.phase) if choice else preset
    grading = stressed_step(settled, given, log, even) if preset.pattern.width.rule == "stressed" else None
    return Way(settled, Attempt(preset.pattern.method), choice, even, grading)


def _even(preset: Preset, given: StressedSurface, log: Log, before: Before | None) -> EvenStripes:
    """Evenly spaced stripes: those from before, or new ones."""
    if before and same_stripes(before.asked, preset.pattern):
        log.seconds["stripes"] = before.seconds
        return before.even
    with log.row("stripes"):
        return weighed_stripes(preset, given, log)
