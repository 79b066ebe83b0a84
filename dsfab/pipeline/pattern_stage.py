"""Stage 4 as a whole: which stripes, where they run, which modes, how wide."""

from dataclasses import replace
from typing import NamedTuple

from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.even import even_step, same_stripes
from dsfab.pipeline.log import Log
from dsfab.pipeline.method import method_step
from dsfab.pipeline.patterns import pattern_step
from dsfab.pipeline.stressing import stressed_step
from dsfab.preset import Pattern, Preset
from dsfab.results import Attempt, Choice, DiffusionResult, EvenStripes, PatternResult, StaticsResult
from dsfab.sparse import give_back
from dsfab.surface import Surface


class Before(NamedTuple):
    """Evenly spaced stripes of an earlier design, on the same surface under the same stress."""

    asked: Pattern
    even: EvenStripes
    seconds: float


def pattern_stage(
    preset: Preset,
    surface: Surface,
    statics: StaticsResult,
    diffusion: DiffusionResult,
    log: Log,
    before: Before | None = None,
) -> PatternResult:
    """The stripes of a preset, with all that it leaves to be chosen.

    before : its stripes are taken where at most their widths, and what is kept besides them, have changed.
    """
    asked, even, attempts = preset, None, tuple[Attempt, ...]()
    if preset.pattern.method == "auto":
        asked, even, attempts = method_step(preset, surface, statics, diffusion, log)
    elif preset.pattern.method == "stripes":
        even = _even(preset, surface, statics, log, before)
    if even and even.steered and even.steered.told:
        log.note("pattern", even.steered.told)
    choice = choice_step(asked, surface, statics, diffusion, log) if asked.pattern.auto else None
    given = asked, surface, statics, diffusion, log, choice
    grading = stressed_step(*given, even) if asked.pattern.width.rule == "stressed" else None
    drawn = pattern_step(*given, grading, even)
    pattern = replace(drawn, asked=_chosen(preset, asked, choice), attempts=attempts)
    give_back()  # what the solvers held: whoever draws needs memory of another shape
    return pattern


def _even(preset: Preset, surface: Surface, statics: StaticsResult, log: Log, before: Before | None) -> EvenStripes:
    """Evenly spaced stripes: those from before, or new ones."""
    if before and same_stripes(before.asked, preset.pattern):
        log.seconds["stripes"] = before.seconds
        return before.even
    return even_step(preset, surface, statics, log)


def _chosen(preset: Preset, asked: Preset, choice: Choice | None) -> Pattern | None:
    """[pattern] with all that was chosen; None where nothing was to be."""
    if choice:
        return asked.settled(choice.mode, choice.phase).pattern
    return None if asked is preset else asked.pattern
