"""The search for a pattern method: modes or even stripes, width rules, forces and spacings, cut and compared."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design.even_stripes import even_stripes, follows_membrane
from dsfab.design.log import Log
from dsfab.design.mode_search import Trial, choice_step, stressed_choice, stressed_step
from dsfab.design.pattern_measures import Drafted, measured_pattern
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.design.stripe_pattern import pattern_step
from dsfab.preset.model import Family, Preset, Slicing, Width
from dsfab.results import Attempt, Choice, EvenStripes, Note, PatternResult, StressedSurface
from dsfab.slicing import Sheet
from dsfab.surface import Surface

RULES = ("constant", "graded")
"""Width rules that the search may exchange, if one of them is requested with a solid fraction."""
SPACINGS = (0.75, 1.25)
"""Factors for spacings that the preset leaves open. In a plane, closer stripes are mostly stiffer if the mesh resolves
them: a plate with a hole at 30 % solid fraction has .86 times the compliance.
"""


@dataclass(frozen=True, eq=False)
class Way:
    """A method of drawing stripes, with its worth.

    preset  : without open choices.                      choice  : of its modes and phases, if these were `auto`.
    even    : evenly spaced stripes; None for modes.     sheet   : after the cut; None if refused.
    grading : (n, f) relative half-widths by the rule `stressed`; None by other rules.     notes : for the design.
    drawn   : its stripes, if they were drawn as built.
    """

    preset: Preset
    attempt: Attempt
    choice: Choice | None = None
    even: EvenStripes | None = None
    grading: Floats | None = None
    sheet: Sheet | None = None
    notes: tuple[Note, ...] = ()
    drawn: PatternResult | None = None


def evened_ways(preset: Preset, found: list[Way], given: StressedSurface, log: Log) -> Iterator[Way]:
    """Yield the best evenly spaced stripes and the best modes, with widths by the rule `stressed`, if the search may
    exchange width rules.

    Flat sheets gain most: other rules left 1.3 to 3.9 times the compliance of a topology optimisation, this one 1.2 to
    1.7
    times.
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


def optimal_ways(preset: Preset, found: list[Way], given: StressedSurface, log: Log) -> Iterator[Way]:
    """Yield the best evenly spaced stripes, along the forces of the stiffest sheet of varying thickness.

    They gain most if these forces differ from those of the uncut sheet: a plate with a hole has .87 times the
    compliance.
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


def spaced_ways(preset: Preset, found: list[Way], given: StressedSurface, log: Log) -> Iterator[Way]:
    """Yield the best evenly spaced stripes at other spacings, halved (if lines crowd) and not halved.

    Only if the preset leaves the spacings open and requests a solid fraction.
    """
    ways = [way for way in found if way.even and not way.attempt.refused]
    if not ways or not preset.pattern.width.solid_fraction:
        return
    best = min(ways, key=lambda way: way.attempt.rank)
    tail = best.attempt.name.partition("stripes")[2]
    for factor in SPACINGS:
        spaced, apart = _spaced(best.preset, given.surface, factor)
        for halve in (True, False) if spaced and preset.pattern.halved else (False,) * bool(spaced):
            words = f"{'halved ' * halve}stripes {apart} m apart{tail}"
            if log.progress:
                log.progress("pattern", f"trying {words}: cutting and solving")
            asked = best.preset.with_pattern(**spaced, halve=halve)
            try:
                even = even_stripes(asked, given.surface, given.statics)
            except DsfabError as error:
                yield Way(asked, Attempt(words, refused=str(error)))
                continue
            if any(even.wanted) or not halve:  # else halving drops no line, and the next candidate is the same
                yield _tried(Way(asked, Attempt(words), None, even), given, replace(log, notes=[]))


def _spaced(preset: Preset, surface: Surface, factor: float) -> tuple[dict[str, Family], str]:
    """Return families with spacings scaled by `factor` to two digits, if the preset leaves these open, and them in
    words.

    No family if stripes would be less than two edges of the mesh apart: a member and an opening need one each.
    """
    families, apart = dict[str, Family](), list[str]()
    for name in preset.pattern.family_names:
        family: Family = getattr(preset.pattern, name)
        distance = float(f"{factor * family.distance(surface.area, surface.mean_edge):.2g}")
        if not family.spacing and distance >= 2 * surface.mean_edge:
            families[name] = family.model_copy(update={"spacing": distance, "frequency": 0.0})
            apart.append(f"{distance:g}")
    return families, " and ".join(dict.fromkeys(apart))


def as_built(way: Way, given: StressedSurface) -> Way:
    """Return a candidate with its worth as built, by the elements of a trial and the defaults of [slicing]."""
    preset = way.preset.model_copy(update={"slicing": Slicing()})
    trial, log = Trial(preset, given, way.even), Log(None)
    try:
        pattern = pattern_step(preset, given, log, way.choice, way.grading, way.even)
        sliced = slicing_step(preset, given.surface, given.statics, pattern, Log(None))
        compliance = trial.compliance(sliced.sheet.surface, trial.loads_on(sliced.sheet))
    except DsfabError as error:
        return replace(way, attempt=Attempt(way.attempt.name, refused=str(error)), sheet=None)
    worth = compliance, compliance / trial.uncut, sliced.sheet.surface.area / given.surface.area
    measured = _measured(way, given, worth, pattern, sliced.cells, sliced.sheet)
    return replace(measured, notes=(*way.notes, *log.notes), drawn=pattern)


def methods(preset: Preset) -> list[tuple[str, bool]]:
    """Return the methods to try, and whether each halves crowded lines."""
    halved = [("stripes", True)] if preset.pattern.halved else []
    modes = [] if preset.pattern.steered else [("modes", preset.pattern.halve)]  # modes cannot follow guides
    return [*halved, ("stripes", False), *modes]


def first_ways(preset: Preset, given: StressedSurface, log: Log, method: str, halve: bool) -> Iterator[Way]:
    """Yield one method with each width rule."""
    words = {"modes": "modes", "stripes": "halved stripes" if halve else "stripes"}[method]
    asked = preset.with_pattern(method=method, halve=halve, weight_rounds=0)
    if method == "modes":
        asked = asked.with_pattern(forces="uncut")  # modes are only defined for the uncut sheet's forces
    if method == "modes" and preset.pattern.tidy is None and preset.pattern.families == "both":
        asked = asked.with_pattern(tidy=True)  # loose ends are removed, as in evenly spaced stripes
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
    preset, name = way.preset, way.attempt.name
    try:
        stressed = preset.pattern.width.rule == "stressed"
        grading = stressed_step(preset, given, scratch, even=way.even) if stressed else None
        result, pattern, sheet, cells = Trial(preset, given, way.even).drawn(preset, grading)
    except DsfabError as error:
        return replace(way, attempt=Attempt(name, refused=str(error)))
    worth = result.compliance, result.over_uncut, result.kept
    return replace(_measured(way, given, worth, pattern, cells, sheet), grading=grading, notes=tuple(scratch.notes))


def _measured(
    way: Way,
    given: StressedSurface,
    worth: tuple[float, float, float],
    pattern: PatternResult,
    cells: Sheet,
    sheet: Sheet,
) -> Way:
    """Return a candidate with its sheet, and the dead ends and slits of that sheet.

    worth : joules, the same over those of the uncut sheet, and share of the surface, as in an `Attempt`.
    """
    drafted = Drafted(way.preset, given.surface, given.statics, given.diffusion, pattern)
    quality = measured_pattern(drafted, symmetry=False, cells=cells, sheet=sheet)
    return replace(way, attempt=Attempt(way.attempt.name, *worth, quality.dead_ends, quality.slits), sheet=sheet)


def _exchangeable(asked: Width) -> bool:
    return asked.rule in RULES and bool(asked.solid_fraction)


def _widths(asked: Width) -> dict[str, Width]:
    """Return width rules to try, by name.

    A gentle grading, by half the power q, is among them: bars without bending are stiffest as wide as their force, but
    members with little force still carry their own weight and brace others.
    """
    if not _exchangeable(asked):
        return {asked.rule: asked}
    gentle = 0.5 * asked.q
    constant, graded = (asked.model_copy(update={"rule": rule}) for rule in RULES)
    return {"constant": constant, "graded": graded, f"graded q {gentle:g}": graded.model_copy(update={"q": gentle})}


CLOSE = 0.1
"""Candidates softer than the best by less than this share may be stiffer in truth, and are measured better.

Trials count points and round no corners, so that their solid fraction is off by up to 8 %: on a bracket modes were 3 %
worse than stripes by their trial, and 28 % better as built. Their quick elements are up to 26 % too stiff for members
one triangle wide."""


def method_step(preset: Preset, given: StressedSurface, log: Log) -> tuple[Way, tuple[Attempt, ...]]:
    """Return the best method of drawing stripes, and all attempts, best first.

    Best is: no dead ends, then no slits, then the stiffest per share of material (see `Attempt.rank`); better elements
    decide between candidates that are close. Raises PatternError if none carries the loads.
    """
    found: list[Way] = []
    for method, halve in methods(preset):
        with log.row("method"):
            found += first_ways(preset, given, log, method, halve)
    for more in (evened_ways, optimal_ways, spaced_ways):
        with log.row("method"):
            found += more(preset, found, given, log)
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


def _finalists_as_built(found: list[Way], given: StressedSurface) -> list[Way]:
    """Return the candidates, of which up to four near the best are replaced by candidates as built.

    The likeliest is built last: slicing continues from its trial cut.
    """
    *flaws, soft = min(way.attempt.rank for way in found)
    near = (*flaws, (1 + CLOSE) * soft)
    shares = [way for way in found if way.sheet and way.preset.pattern.width.solid_fraction]
    ranked = sorted(shares, key=lambda way: way.attempt.rank)
    finalists = [way for way in ranked[:4] if way.attempt.rank <= near]
    if len(finalists) < 2:
        return found
    built = {way: as_built(way, given) for way in reversed(finalists)}
    return [built.get(way, way) for way in found]


def _ranked(found: list[Way], given: StressedSurface) -> list[Way]:
    """Return candidates, best first; better elements order the best and those that are nearly as stiff, without
    more flaws.
    """
    ranked = sorted(found, key=lambda one: one.attempt.rank)
    *flaws, soft = ranked[0].attempt.rank
    close = [one for one in ranked if one.sheet and list(one.attempt.rank[:-1]) == flaws]
    close = [one for one in close if one.attempt.rank[-1] <= (1 + CLOSE) * soft]
    if len(close) > 1:
        ranked[: len(close)] = sorted(close, key=lambda one: _judged(one, given))
    return ranked


def _judged(way: Way, given: StressedSurface) -> float:
    """Return joules times share of material, to three digits as in `Attempt.rank`, by elements for reported results."""
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
