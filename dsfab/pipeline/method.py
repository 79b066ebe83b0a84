"""`[pattern] method = "auto"`: modes or evenly spaced stripes, halved or not, by one of three width rules.

Which is the stiffest depends on the surface: evenly spaced stripes on most shells, modes on some plates. So each is cut
and solved, as for modes that are `auto`, and its dead ends and slits are counted on what was cut.
"""

from dataclasses import replace
from typing import NamedTuple

from dsfab.errors import DsfabError, PatternError
from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.even import even_stripes
from dsfab.pipeline.log import Log
from dsfab.pipeline.measures import measured_pattern
from dsfab.pipeline.stressing import stressed_step
from dsfab.pipeline.trial import Trial
from dsfab.preset import Preset, Width
from dsfab.results import Attempt, DiffusionResult, EvenStripes, StaticsResult
from dsfab.surface import Surface

RULES = ("constant", "graded")
"""Width rules of which the better one is taken, where one of them is asked for with a share of the surface to keep."""
GENTLE = 0.5
"""Widths are graded by this power of what is asked, too. Were stripes bars that nothing bends, the stiffest would be as
wide as their force is large; members that carry little in the plane still carry their own weight and brace others."""


class _Drawn(NamedTuple):
    """A way to draw the stripes, where evenly spaced ones run (None for modes), and what it is worth."""

    preset: Preset
    even: EvenStripes | None
    attempt: Attempt


def method_step(
    preset: Preset, surface: Surface, statics: StaticsResult, diffusion: DiffusionResult, log: Log
) -> tuple[Preset, EvenStripes | None, tuple[Attempt, ...]]:
    """The preset with the method, halving and width rule that are the best; its evenly spaced stripes, or None for
    modes; and all that was tried, best first: without dead ends, then without slits, then the stiffest per share of
    material (see `Attempt.rank`).

    Raises PatternError when none carries the loads.
    """
    found: list[_Drawn] = []
    for method, halve in _methods(preset):
        with log.row("method"):
            found += _tried(preset, surface, statics, diffusion, log, method, halve)
    ranked = sorted(found, key=lambda one: one.attempt.rank)
    best = ranked[0]
    if best.attempt.refused:
        raise PatternError(f"no method draws stripes that carry the loads; the first: {found[0].attempt.refused}")
    told = "; ".join(_told(one.attempt) for one in found)
    log.note("pattern", f"method auto took {best.attempt.name}: of compliances over that of the uncut sheet, {told}")
    return best.preset, best.even, tuple(one.attempt for one in ranked)


def _told(attempt: Attempt) -> str:
    if attempt.refused:
        return f"{attempt.name} refused"
    counted = {"dead end": attempt.dead_ends, "slit": attempt.slits}
    flaws = " and ".join(f"{count} {what}{'s' if count > 1 else ''}" for what, count in counted.items() if count)
    return f"{attempt.name} {attempt.over_uncut:.3g} x{f' with {flaws}' if flaws else ''}"


def _methods(preset: Preset) -> list[tuple[str, bool]]:
    halved = [("stripes", True)] if preset.pattern.halved else []
    modes = [] if preset.pattern.steered else [("modes", preset.pattern.halve)]  # they follow nothing but the stress
    return [*halved, ("stripes", False), *modes]


def _tried(
    preset: Preset,
    surface: Surface,
    statics: StaticsResult,
    diffusion: DiffusionResult,
    log: Log,
    method: str,
    halve: bool,
) -> list[_Drawn]:
    """One method by each width rule."""
    words = {"modes": "modes", "stripes": "halved stripes" if halve else "stripes"}[method]
    asked = preset.with_pattern(method=method, halve=halve)
    if method == "modes" and preset.pattern.tidy is None and preset.pattern.families == "both":
        asked = asked.with_pattern(tidy=True)  # what ends in the air is taken off, as of evenly spaced ones
    if log.progress:
        log.progress("pattern", f"trying {words}: cutting and solving")
    try:
        even = even_stripes(asked, surface, statics) if method == "stripes" else None
        if asked.pattern.auto:
            chosen = choice_step(asked, surface, statics, diffusion, log)
            asked = asked.settled(chosen.mode, chosen.phase)
    except DsfabError as error:
        return [_Drawn(asked, None, Attempt(words, refused=str(error)))]
    found = []
    for rule, width in _widths(preset.pattern.width).items():
        variant = asked.with_pattern(width=width)
        attempt = _attempt(f"{words}, {rule}", variant, surface, statics, diffusion, log, even)
        found.append(_Drawn(variant, even, attempt))
    return found


def _attempt(
    name: str,
    preset: Preset,
    surface: Surface,
    statics: StaticsResult,
    diffusion: DiffusionResult,
    log: Log,
    even: EvenStripes | None,
) -> Attempt:
    """What a preset without anything `auto` is worth."""

    given = preset, surface, statics, diffusion
    try:
        grading = None
        if preset.pattern.width.rule == "stressed":
            grading = stressed_step(*given, replace(log, notes=[]), even=even)
        candidate, pattern, sheet = Trial(*given, even).drawn(preset, grading)
    except DsfabError as error:
        return Attempt(name, refused=str(error))
    from dsfab.pipeline.design import Design  # it is made of this, among others

    stages = {"surface": surface, "statics": statics, "diffusion": diffusion, "pattern": pattern}
    tentative = Design.known(preset, **stages)
    quality = measured_pattern(tentative, symmetry=False, sheet=sheet)
    worth = candidate.compliance, candidate.over_uncut, candidate.kept
    return Attempt(name, *worth, quality.dead_ends, quality.slits)


def _widths(asked: Width) -> dict[str, Width]:
    """Rules to try, by name."""
    if asked.rule not in RULES or not asked.solid_fraction:
        return {asked.rule: asked}
    gentle = GENTLE * asked.q
    constant, graded = (asked.model_copy(update={"rule": rule}) for rule in RULES)
    return {"constant": constant, "graded": graded, f"graded q {gentle:g}": graded.model_copy(update={"q": gentle})}
