"""Stage 4: the pattern of a preset, with rounds in which the weight of the sheet follows the stripes."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.core.sparse import give_back
from dsfab.design.directions import followed_stress
from dsfab.design.even_stripes import even_stripes, same_stripes
from dsfab.design.log import Log
from dsfab.design.method_search import Way, method_step
from dsfab.design.mode_search import choice_step, stressed_step
from dsfab.design.regions_and_loads import Loading, loadings, one_sided_words
from dsfab.design.stripe_pattern import SHARE_SNAP, pattern_step, sketched_step
from dsfab.design.surface_and_statics import statics_step
from dsfab.diffusion import principal_stresses
from dsfab.preset.model import Family, Pattern, Preset
from dsfab.results import Attempt, EvenStripes, PatternResult, StaticsResult, StressedSurface
from dsfab.slicing import cut_polygons
from dsfab.surface import LoadParts, Surface


def weighed_stripes(preset: Preset, given: StressedSurface, log: Log) -> EvenStripes:
    """Return evenly spaced stripes after the rounds of weight that [pattern] requests. Raises PatternError as
    `even_stripes`.
    """
    if log.progress:
        log.progress("pattern", "finding evenly spaced stripes along the stress")
    surface, statics = given.surface, given.statics
    even = even_stripes(preset.with_pattern(weight_rounds=0), surface, statics)
    rounds = preset.pattern.rounds
    if rounds and not _weighs(preset, statics):
        log.note("pattern", f"weight_rounds = {rounds} changes nothing: no load is the sheet's own weight")
        return even
    lighter: StaticsResult | None = None
    for _ in range(rounds):
        try:
            share = drawn_share(preset, given, even)
        except PatternError as error:
            log.note("pattern", f"directions were not sought {'again' if lighter is None else 'twice'}: {error}")
            break
        lighter = weighed_statics(preset, surface, statics, share)
        even = even_stripes(preset, surface, lighter)
    if lighter is not None:
        turn, most = turned(surface, *(followed_stress(preset, surface, one) for one in (statics, lighter)))
        log.note(
            "pattern",
            f"directions were sought with {share @ surface.areas / surface.area:.0%} of the uncut sheet's weight, face "
            f"by face what stripes leave: they turned by {turn:.2g} degrees on average, by at most {most:.2g} on 95 % "
            "of the surface",
        )
    return even


def _weighs(preset: Preset, statics: StaticsResult) -> bool:
    parts = [load.parts for load in statics.loads(preset.followed).values()]
    return any(one is not None and bool(one.weight.any()) for one in parts)


def drawn_share(preset: Preset, given: StressedSurface, even: EvenStripes) -> Floats:
    """Return the share of each face (m,) that stripes and kept regions cover, the same at all images.

    Widths are those of a sketch, without round corners and filled openings.
    """
    surface, drawn = given.surface, sketched_step(preset, given, even=even)
    polygons = cut_polygons(surface, drawn.fields, drawn.levels, SHARE_SNAP, drawn.tidy)
    area = polygons.cells.areas(polygons.X)[0] * ~polygons.void
    share = np.minimum(np.bincount(polygons.parent, area, surface.m) / surface.areas, 1.0)
    return share[even.symmetry.faces].mean(axis=0) if even.symmetry else share


def weighed_statics(preset: Preset, surface: Surface, statics: StaticsResult, share: Floats) -> StaticsResult:
    """Return `statics` with a share (m,) of each face's weight in the cases that the pattern follows; stiffness is
    unchanged.
    """
    layered = any(case.layered is not None for case in statics.cases.values())
    follow = "layers" if layered else "membrane"  # as the first round decided with the full weight
    plain = preset.statics.model_copy(update={"frequencies": 0, "buckling": 0, "stress": follow})
    acting = [_lighter(one, surface, share) for one in loadings(preset, surface)]
    found = statics_step(preset.model_copy(update={"statics": plain}), surface, Log(None), acting).cases
    return replace(statics, cases={**statics.cases, **{name: found[name] for name in preset.followed}})


def _lighter(one: Loading, surface: Surface, share: Floats) -> Loading:
    whole = one.load.parts
    if whole is None:
        return one
    left: LoadParts = whole.on_share(weight=share)
    spread = replace(one.spread, face=one.spread.face + left.weight - whole.weight)
    return replace(one, load=one.load.with_parts(surface, left), spread=spread)


def turned(surface: Surface, before: Floats, after: Floats) -> tuple[float, float]:
    """Return degrees between the principal directions of stresses (m, 3, 3): a mean, and the 95 % quantile by area.

    The mean is weighted by area and by the difference of the principal stresses `before`. The quantile covers the area
    with clear directions.
    """
    (stress, first), (_, second) = (principal_stresses(surface, sigma) for sigma in (before, after))
    one, other = first[:, 0], second[:, 0]
    across, along = np.linalg.norm(np.cross(one, other), axis=1), np.abs(np.einsum("mi,mi->m", one, other))
    angle, apart = np.degrees(np.arctan2(across, along)), (stress[:, 0] - stress[:, 1]) / 2
    size = surface.areas * apart
    # clear: half the difference of the principal stresses exceeds a tenth of the stress
    clear = np.flatnonzero(apart > 0.1 * np.linalg.norm(before, axis=(1, 2)))
    order = clear[np.argsort(angle[clear])]
    grown = np.cumsum(surface.areas[order])
    if not len(grown):
        return 0.0, 0.0
    return float(angle @ size / size.sum()), float(angle[order][np.searchsorted(grown, 0.95 * grown[-1])])


class Before(NamedTuple):
    """Evenly spaced stripes of an earlier design, on the same surface under the same stress."""

    asked: Pattern
    even: EvenStripes
    seconds: float


class ChosenWay(NamedTuple):
    """The chosen method of drawing stripes, before their widths are known, and all attempts of the search, best
    first.
    """

    way: Way
    attempts: tuple[Attempt, ...] = ()


def chosen_way(preset: Preset, given: StressedSurface, log: Log, before: Before | None = None) -> ChosenWay:
    """Choose the method, modes, phases and forces of the stripes: all but the width that a share of material
    determines.

    before : its stripes are reused if at most widths and kept regions have changed.
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
    """Return the stripes by the chosen method; stripes that a search drew count in the seconds of `method`."""
    way = chosen.way
    log.seconds.setdefault("pattern", 0.0)
    drawn = way.drawn or pattern_step(way.preset, given, log, way.choice, way.grading, way.even)
    asked = None if way.preset is preset else way.preset.pattern
    give_back(4e3 * given.surface.m)  # bytes that the solvers hold: drawing needs blocks of other sizes
    return replace(drawn, asked=asked, attempts=chosen.attempts)


def sketched_pattern(given: StressedSurface, chosen: ChosenWay) -> PatternResult:
    """Return stripes with widths by a count of points, in a tenth of the time, for a picture that another one replaces.

    Round corners and filled openings are missing. Raises PatternError if no width gives the requested share.
    """
    way = chosen.way
    return sketched_step(way.preset, given, way.choice, way.grading, way.even)


def _idle_frequencies(ask: Pattern, surface: Surface) -> list[str]:
    """Return notes on frequencies that evenly spaced stripes ignore; every complete preset has the default."""
    idle = [(name, getattr(ask, name)) for name in ask.family_names]
    return [
        f"pattern.{name}.frequency = {family.frequency:g} has no effect on evenly spaced stripes, which are "
        f"{family.distance(surface.area, surface.mean_edge):.3g} m apart: set pattern.{name}.spacing instead"
        for name, family in idle
        if ask.method == "stripes" and family.frequency not in (0.0, Family().frequency)
    ]


def _asked_way(preset: Preset, given: StressedSurface, log: Log, before: Before | None) -> Way:
    """Return the requested method, with the modes, phases and widths that the preset leaves open."""
    even = _even(preset, given, log, before) if preset.pattern.method == "stripes" else None
    choice = choice_step(preset, given, log) if preset.pattern.auto else None
    settled = preset.settled(choice.mode, choice.phase) if choice else preset
    grading = stressed_step(settled, given, log, even) if preset.pattern.width.rule == "stressed" else None
    return Way(settled, Attempt(preset.pattern.method), choice, even, grading)


def _even(preset: Preset, given: StressedSurface, log: Log, before: Before | None) -> EvenStripes:
    if before and same_stripes(before.asked, preset.pattern):
        log.seconds["stripes"] = before.seconds
        return before.even
    with log.row("stripes"):
        return weighed_stripes(preset, given, log)
