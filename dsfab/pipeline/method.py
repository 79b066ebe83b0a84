"""`[pattern] method = "auto"`: modes or evenly spaced stripes, halved or not, by one of four width rules.

Which is the stiffest depends on the surface: evenly spaced stripes on most shells, modes on some plates. So each is cut
and solved, as for modes that are `auto`, and its dead ends and slits are counted on what was cut. The best few are then
drawn as they would be built, and judged by better elements.
"""

from dsfab.errors import PatternError
from dsfab.pipeline.log import Log
from dsfab.pipeline.trial import Trial
from dsfab.pipeline.ways import Way, as_built, evened_ways, first_ways, methods, optimal_ways, spaced_ways
from dsfab.preset import Preset
from dsfab.results import Attempt, StressedSurface

CLOSE, MOST = 0.1, 4
"""What is softer than the best by less than this share may be stiffer in truth: so many at most are drawn as they would
be built, where a share of material is asked, and all solved with better elements. Trials count points and round
nothing, and keep up to 8 % more or less material once ends are cut off and slits are filled: on a bracket modes were
worth 3 % less than stripes by their trial, and 28 % more as built with the share that was asked for. And their quick
elements take members that are one triangle wide for up to 26 % stiffer than they are, more than thick ones."""


def method_step(preset: Preset, given: StressedSurface, log: Log) -> tuple[Way, tuple[Attempt, ...]]:
    """The best way to draw the stripes, and all that was tried, best first: without dead ends, then without slits, then
    the stiffest per share of material (see `Attempt.rank`); where that is close, by better elements.

    Raises PatternError when none carries the loads.
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
    """The ways, those that may be the best as they would be built: with round corners, and the share that is asked.

    The likeliest is the last: what is cut for it is at hand when it is sliced.
    """
    *flaws, soft = min(way.attempt.rank for way in found)
    near = (*flaws, (1 + CLOSE) * soft)
    shares = [way for way in found if way.sheet and way.preset.pattern.width.solid_fraction]
    ranked = sorted(shares, key=lambda way: way.attempt.rank)
    finalists = [way for way in ranked[:MOST] if way.attempt.rank <= near]
    if len(finalists) < 2:
        return found
    built = {way: as_built(way, given) for way in reversed(finalists)}
    return [built.get(way, way) for way in found]


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
