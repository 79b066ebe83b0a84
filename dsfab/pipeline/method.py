"""`[pattern] method = "auto"`: modes or evenly spaced stripes, halved or not, by one of four width rules.

Which is the stiffest depends on the surface: evenly spaced stripes on most shells, modes on some plates. So each is cut
and solved, as for modes that are `auto`, and its dead ends and slits are counted on what was cut.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from dsfab.arrays import Floats
from dsfab.errors import DsfabError, PatternError
from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.even import even_stripes
from dsfab.pipeline.geometry import slicing_step
from dsfab.pipeline.log import Log
from dsfab.pipeline.measures import Drafted, measured_pattern
from dsfab.pipeline.optimal import follows_membrane
from dsfab.pipeline.patterns import pattern_step
from dsfab.pipeline.stressing import stressed_choice, stressed_step
from dsfab.pipeline.trial import Trial
from dsfab.preset import Preset, Width
from dsfab.results import Attempt, Choice, EvenStripes, Note, StressedSurface
from dsfab.slicing import Sheet

RULES = ("constant", "graded")
"""Width rules of which the better one is taken, where one of them is asked for with a share of the surface to keep."""
GENTLE = 0.5
"""Widths are graded by this power of what is asked, too. Were stripes bars that nothing bends, the stiffest would be as
wide as their force is large; members that carry little in the plane still carry their own weight and brace others."""
CLOSE = 0.02
"""What is softer than the best by less than this share may be stiffer in truth: trials solve with quick elements."""
NEAR, MOST = 0.1, 4
"""What is softer by less than this share is drawn as it would be built, so many at most. Trials count points and round
nothing, and keep up to 8 % more or less material once ends are cut off and slits are filled: on a bracket modes were
worth 3 % less than stripes by their trial, and 28 % more as built with the share that was asked for."""


@dataclass(frozen=True, eq=False)
class Way:
    """A way to draw the stripes, and what it is worth.

    preset  : with nothing left to be chosen.            choice  : of its modes and phases, where these were `auto`.
    even    : where evenly spaced stripes run; None for modes.        sheet : what it was cut to; None when refused.
    grading : (n, f) relative half-widths by the rule `stressed`; None by others.           notes : for who takes it.
    """

    preset: Preset
    attempt: Attempt
    choice: Choice | None = None
    even: EvenStripes | None = None
    grading: Floats | None = None
    sheet: Sheet | None = None
    notes: tuple[Note, ...] = ()


def method_step(preset: Preset, given: StressedSurface, log: Log) -> tuple[Way, tuple[Attempt, ...]]:
    """The best way to draw the stripes, and all that was tried, best first: without dead ends, then without slits, then
    the stiffest per share of material (see `Attempt.rank`); where that is close, by better elements.

    Raises PatternError when none carries the loads.
    """
    found: list[Way] = []
    for method, halve in _methods(preset):
        with log.row("method"):
            found += _ways(preset, given, log, method, halve)
    with log.row("method"):
        found += _evened_ways(preset, found, given, log)
    with log.row("method"):
        found += _optimal_ways(preset, found, given, log)
    with log.row("method"):
        found = _finalists_as_built(found, given)
        ranked = _ranked(found, given)
    best = ranked[0]
    if best.attempt.refused:
        raise PatternError(f"no method draws stripes that carry the loads; the first: {found[0].attempt.refused}")
    log.notes.extend(best.notes)
    listed = "; ".join(_described(one.attempt) for one in found)
    log.note("pattern", f"method auto took {best.attempt.name}: of compliances over that of the uncut sheet, {listed}")
    return best, tuple(one.attempt for one in ranked)


def _evened_ways(preset: Preset, found: list[Way], given: StressedSurface, log: Log) -> Iterator[Way]:
    """The best of the evenly spaced stripes and the best of the modes, with widths by the rule `stressed`: where the
    preset asks for a width that others may be exchanged for.

    In flat sheets it is worth most: there the other rules left 1.3 to 3.9 times the compliance of what topology
    optimisation finds, and this one 1.2 to 1.7 times.
    """
    if not _exchangeable(preset.pattern.width):
        return
    for method in ("stripes", "modes"):
        ways = [way for way in found if way.preset.pattern.method == method and not way.attempt.refused]
        if not ways:
            continue
        best = min(ways, key=lambda way: way.attempt.rank)
        words = best.attempt.name.partition(",")[0]
        if log.progress:
            log.progress("pattern", f"trying {words}, stressed: cutting and solving")
        asked = best.preset.with_pattern(width=preset.pattern.width.model_copy(update={"rule": "stressed"}))
        scratch, choice = replace(log, notes=[]), best.choice
        if choice:
            choice = stressed_choice(asked, given, scratch, choice)
            asked = asked.settled(choice.mode, choice.phase)
        variant = Way(asked, Attempt(f"{words}, stressed"), choice, best.even)
        yield _tried(variant, given, scratch)


def _optimal_ways(preset: Preset, found: list[Way], given: StressedSurface, log: Log) -> Iterator[Way]:
    """The best of the evenly spaced stripes, along the forces of the stiffest sheet of varying thickness instead.

    Where these are not those of the uncut sheet it is worth most: a plate with a hole has .87 times the compliance.
    """
    ask = preset.pattern
    ways = [way for way in found if way.even and not way.attempt.refused]
    if (
        not ways
        or not _exchangeable(ask.width)
        or ask.steered
        or not follows_membrane(preset, given.surface, given.statics)
    ):
        return
    best = min(ways, key=lambda way: way.attempt.rank)
    words = f"{best.attempt.name.partition(',')[0]} along optimal forces"
    if log.progress:
        log.progress("pattern", f"trying {words}: cutting and solving")
    width = ask.width.model_copy(update={"rule": "stressed"})
    asked, scratch = best.preset.with_pattern(width=width, forces="optimal"), replace(log, notes=[])
    try:
        even = even_stripes(asked, given.surface, given.statics)
    except DsfabError as error:
        yield Way(asked, Attempt(words, refused=str(error)))
        return
    yield _tried(Way(asked, Attempt(f"{words}, stressed"), None, even), given, scratch)


def _finalists_as_built(found: list[Way], given: StressedSurface) -> list[Way]:
    """The ways, those that may be the best as they would be built: with round corners, and the share that is asked."""
    *flaws, soft = min(way.attempt.rank for way in found)
    near = (*flaws, (1 + NEAR) * soft)
    shares = [way for way in found if way.sheet and way.preset.pattern.width.solid_fraction]
    ranked = sorted(shares, key=lambda way: way.attempt.rank)
    finalists = [way for way in ranked[:MOST] if way.attempt.rank <= near]
    return [_as_built(way, given) if len(finalists) > 1 and way in finalists else way for way in found]


def _as_built(way: Way, given: StressedSurface) -> Way:
    """A way with what it is worth as it would be built, by the elements of a trial."""
    preset, name = way.preset, way.attempt.name
    trial, log = Trial(preset, given, way.even), Log(None)
    try:
        pattern = pattern_step(preset, given, log, way.choice, way.grading, way.even)
        sliced = slicing_step(preset, given.surface, given.statics, pattern, log)
        compliance = trial.compliance(sliced.sheet.surface, trial.loads_on(sliced.sheet))
    except DsfabError as error:
        return replace(way, attempt=Attempt(name, refused=str(error)), sheet=None)
    drafted = Drafted(preset, given.surface, given.statics, given.diffusion, pattern)
    quality = measured_pattern(drafted, symmetry=False, cells=sliced.cells, sheet=sliced.sheet)
    kept = sliced.sheet.surface.area / given.surface.area
    attempt = Attempt(name, compliance, compliance / trial.uncut, kept, quality.dead_ends, quality.slits)
    return replace(way, attempt=attempt, sheet=sliced.sheet)


def _ranked(found: list[Way], given: StressedSurface) -> list[Way]:
    """Best first. The best, and what is as free of flaws and nearly as stiff, is put in order by better elements."""
    ranked = sorted(found, key=lambda one: one.attempt.rank)
    *flaws, soft = ranked[0].attempt.rank
    close = [one for one in ranked if one.sheet and list(one.attempt.rank[:-1]) == flaws]
    close = [one for one in close if one.attempt.rank[-1] <= (1 + CLOSE) * soft]
    if len(close) > 1:
        ranked[: len(close)] = sorted(close, key=lambda one: _judged(one, given))
    return ranked


def _judged(way: Way, given: StressedSurface) -> float:
    """Joules times share of material, by the elements of what is reported; to three digits as in `Attempt.rank`."""
    assert way.sheet is not None
    trial = Trial(way.preset, given, way.even)
    compliance = trial.compliance(way.sheet.surface, trial.loads_on(way.sheet), "compliance_once")
    return float(f"{compliance * way.attempt.kept:.3g}")


def _described(attempt: Attempt) -> str:
    if attempt.refused:
        return f"{attempt.name} refused"
    counted = {"dead end": attempt.dead_ends, "slit": attempt.slits}
    flaws = " and ".join(f"{count} {what}{'s' if count > 1 else ''}" for what, count in counted.items() if count)
    return f"{attempt.name} {attempt.over_uncut:.3g} x{f' with {flaws}' if flaws else ''}"


def _methods(preset: Preset) -> list[tuple[str, bool]]:
    halved = [("stripes", True)] if preset.pattern.halved else []
    modes = [] if preset.pattern.steered else [("modes", preset.pattern.halve)]  # they follow nothing but the stress
    return [*halved, ("stripes", False), *modes]


def _ways(preset: Preset, given: StressedSurface, log: Log, method: str, halve: bool) -> Iterator[Way]:
    """One method by each width rule."""
    words = {"modes": "modes", "stripes": "halved stripes" if halve else "stripes"}[method]
    asked = preset.with_pattern(method=method, halve=halve, weight_rounds=0)
    if method == "modes":
        asked = asked.with_pattern(forces="uncut")  # no others say where modes run
    if method == "modes" and preset.pattern.tidy is None and preset.pattern.families == "both":
        asked = asked.with_pattern(tidy=True)  # what ends in the air is taken off, as of evenly spaced ones
    if log.progress:
        log.progress("pattern", f"trying {words}: cutting and solving")
    scratch = replace(log, notes=[])
    try:
        even = even_stripes(asked, given.surface, given.statics) if method == "stripes" else None
        choice = choice_step(asked, given, scratch) if asked.pattern.auto else None
    except DsfabError as error:
        yield Way(asked, Attempt(words, refused=str(error)))
        return
    asked = asked.settled(choice.mode, choice.phase) if choice else asked
    for rule, width in _widths(preset.pattern.width).items():
        variant = Way(asked.with_pattern(width=width), Attempt(f"{words}, {rule}"), choice, even)
        yield _tried(variant, given, replace(log, notes=list(scratch.notes)))


def _tried(way: Way, given: StressedSurface, scratch: Log) -> Way:
    """A way with what it is worth."""
    preset, name = way.preset, way.attempt.name
    try:
        stressed = preset.pattern.width.rule == "stressed"
        grading = stressed_step(preset, given, scratch, even=way.even) if stressed else None
        candidate, pattern, sheet, cells = Trial(preset, given, way.even).drawn(preset, grading)
    except DsfabError as error:
        return replace(way, attempt=Attempt(name, refused=str(error)))
    drafted = Drafted(preset, given.surface, given.statics, given.diffusion, pattern)
    quality = measured_pattern(drafted, symmetry=False, cells=cells)
    worth = candidate.compliance, candidate.over_uncut, candidate.kept
    attempt = Attempt(name, *worth, quality.dead_ends, quality.slits)
    return replace(way, attempt=attempt, grading=grading, sheet=sheet, notes=tuple(scratch.notes))


def _exchangeable(asked: Width) -> bool:
    """Whether other rules may take the place of the one that is asked for."""
    return asked.rule in RULES and bool(asked.solid_fraction)


def _widths(asked: Width) -> dict[str, Width]:
    """Rules to try, by name."""
    if not _exchangeable(asked):
        return {asked.rule: asked}
    gentle = GENTLE * asked.q
    constant, graded = (asked.model_copy(update={"rule": rule}) for rule in RULES)
    return {"constant": constant, "graded": graded, f"graded q {gentle:g}": graded.model_copy(update={"q": gentle})}
