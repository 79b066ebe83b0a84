"""Stage 4: the pattern of a preset."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.core.sparse import release_freed_memory
from dsfab.design.directions import followed_stress
from dsfab.design.even_stripes import even_stripes, same_stripes
from dsfab.design.method_search import MethodCandidate, method_step, uncrowded_candidate
from dsfab.design.mode_search import choice_step, stressed_step
from dsfab.design.pattern_measures import DesignDraft, one_family_message, roles_of_families
from dsfab.design.regions_and_loads import Loading, loadings, one_sided_message
from dsfab.design.stripe_pattern import SHARE_SNAP, pattern_step, sketched_step
from dsfab.design.surface_and_statics import statics_step
from dsfab.diffusion import principal_stresses
from dsfab.preset.model import Family, Pattern, Preset
from dsfab.results import Attempt, EvenStripes, Log, PatternResult, StaticsResult, StressedSurface
from dsfab.slicing import tidied_polygons
from dsfab.surface import LoadParts, Surface


def stripes_under_own_weight(preset: Preset, analysis: StressedSurface, log: Log) -> EvenStripes:
    """Return evenly spaced stripes along the stress; the load includes the stripes' weight, not the uncut sheet's."""
    log.report("pattern", "finding evenly spaced stripes along the stress")
    surface, statics = analysis.surface, analysis.statics
    even = even_stripes(preset.with_pattern(weight_rounds=0), surface, statics)
    rounds = preset.pattern.rounds
    if rounds and not _follows_own_weight(preset, statics):
        log.note(
            "pattern", f"weight_rounds = {rounds} has no effect, because the sheet's own weight is not among the loads"
        )
        return even
    lighter: StaticsResult | None = None
    for _ in range(rounds):
        try:
            share = drawn_share(preset, analysis, even)
        except PatternError as error:
            count = "a second time" if lighter is None else "a third time"
            log.note("pattern", f"directions were not computed {count}: {error}")
            break
        lighter = statics_with_weight_share(preset, surface, statics, share)
        even = even_stripes(preset, surface, lighter)
    if lighter is not None:
        stresses = (followed_stress(preset, surface, result) for result in (statics, lighter))
        mean_turn, largest_turn = direction_change(surface, *stresses)
        log.note(
            "pattern",
            f"directions of stripes follow the stress under the weight of the stripes "
            f"({share @ surface.areas / surface.area:.0%} of the uncut sheet's weight). Directions turned by "
            f"{mean_turn:.2g} degrees on average, and by at most {largest_turn:.2g} degrees on 95 % of the surface",
        )
    return even


def _follows_own_weight(preset: Preset, statics: StaticsResult) -> bool:
    parts = [load.parts for load in statics.loads(preset.followed_weights).values()]
    return any(part is not None and bool(part.weight.any()) for part in parts)


def drawn_share(preset: Preset, analysis: StressedSurface, even: EvenStripes) -> Floats:
    """Return the approximate fraction (m,) of each face that stripes cover with material."""
    surface, sketch = analysis.surface, sketched_step(preset, analysis, even=even)
    polygons = tidied_polygons(surface, sketch.fields, sketch.levels, SHARE_SNAP, sketch.tidy)
    area = polygons.cells.areas(polygons.X)[0] * ~polygons.void
    share = np.minimum(np.bincount(polygons.parent, area, surface.m) / surface.areas, 1.0)
    return share[even.symmetry.faces].mean(axis=0) if even.symmetry else share


def statics_with_weight_share(preset: Preset, surface: Surface, statics: StaticsResult, share: Floats) -> StaticsResult:
    """Solve the statics again with only a fraction of each face's weight. share : (m,) fractions."""
    layered = any(case.layered is not None for case in statics.cases.values())
    follow = "layers" if layered else "membrane"  # keeps the kind of stress that `statics` contains
    section = preset.statics.model_copy(update={"frequencies": 0, "buckling": 0, "stress": follow})
    acting = [_lighter_loading(loading, surface, share) for loading in loadings(preset, surface)]
    lighter_cases = statics_step(preset.model_copy(update={"statics": section}), surface, Log(None), acting).cases
    return replace(statics, cases={**statics.cases, **{name: lighter_cases[name] for name in preset.followed_weights}})


def _lighter_loading(loading: Loading, surface: Surface, share: Floats) -> Loading:
    parts = loading.load.parts
    if parts is None:
        return loading
    lighter_parts: LoadParts = parts.on_share(weight=share)
    spread = replace(loading.spread, face=loading.spread.face + lighter_parts.weight - parts.weight)
    return replace(loading, load=loading.load.with_parts(surface, lighter_parts), spread=spread)


def direction_change(surface: Surface, before: Floats, after: Floats) -> tuple[float, float]:
    """Return the mean and the 95 % quantile of the angle (degrees) between the principal directions of two stresses.
    before, after : (m, 3, 3) stress on each face."""
    (stress, directions), (_, directions_after) = (principal_stresses(surface, sigma) for sigma in (before, after))
    axis_before, axis_after = directions[:, 0], directions_after[:, 0]
    across = np.linalg.norm(np.cross(axis_before, axis_after), axis=1)
    angle = np.degrees(np.arctan2(across, np.abs(np.einsum("mi,mi->m", axis_before, axis_after))))
    half_difference = (stress[:, 0] - stress[:, 1]) / 2
    size = surface.areas * half_difference
    # clear directions need different principal stresses
    clear = np.flatnonzero(half_difference > 0.1 * np.linalg.norm(before, axis=(1, 2)))
    clear_by_angle = clear[np.argsort(angle[clear])]
    cumulated_area = np.cumsum(surface.areas[clear_by_angle])
    if not len(cumulated_area):
        return 0.0, 0.0
    quantile = angle[clear_by_angle][np.searchsorted(cumulated_area, 0.95 * cumulated_area[-1])]
    return float(angle @ size / size.sum()), float(quantile)


class EarlierStripes(NamedTuple):
    """Evenly spaced stripes of an earlier design. asked : the [pattern] options of the earlier design."""

    asked: Pattern
    even: EvenStripes
    seconds: float


class ChosenMethod(NamedTuple):
    """Chosen pattern method. way : the method with its stripes.    attempts : results of a search, best first."""

    way: MethodCandidate
    attempts: tuple[Attempt, ...] = ()


def chosen_method(
    preset: Preset, analysis: StressedSurface, log: Log, earlier: EarlierStripes | None = None
) -> ChosenMethod:
    """Choose the method of the pattern, and the positions of the stripes without their widths."""
    attempts = tuple[Attempt, ...]()
    if preset.pattern.weight_rounds and not preset.pattern.rounds:
        log.note(
            "pattern", f"weight_rounds has no effect on method = '{preset.pattern.method}'; it needs method = 'stripes'"
        )
    if preset.pattern.method == "auto":
        candidate, attempts = method_step(preset, analysis, log)
    else:
        candidate = _requested_method(preset, analysis, log, earlier)
    if even := candidate.even:
        steering_note = even.steered.told if even.steered else ""
        one_sided = one_sided_message(analysis.surface, preset.pattern.region, even.symmetry)
        for message in filter(None, (steering_note, one_sided, *_idle_frequencies(preset.pattern, analysis.surface))):
            log.note("pattern", message)
    return ChosenMethod(candidate, attempts)


def pattern_stage(preset: Preset, analysis: StressedSurface, log: Log, chosen: ChosenMethod) -> PatternResult:
    """Return the pattern of the chosen method: stripes with widths."""
    candidate, before = chosen.way, len(log.notes)
    log.seconds.setdefault("pattern", 0.0)
    pattern = candidate.drawn or pattern_step(
        candidate.preset, analysis, log, candidate.choice, candidate.grading, candidate.even
    )
    if candidate.preset.pattern.crowding == "avoid" and candidate.even:
        draw = partial(_requested_method, analysis=analysis, log=Log(None), earlier=None)
        candidate = replace(candidate, drawn=pattern, notes=tuple(log.notes[before:]))
        with log.row("method"):
            candidate = uncrowded_candidate(candidate, analysis, draw, log.report)
        pattern, log.notes[before:] = candidate.drawn or pattern, candidate.notes
    draft = DesignDraft(candidate.preset, analysis.surface, analysis.statics, analysis.diffusion, pattern)
    if message := one_family_message(roles_of_families(draft), candidate.preset.pattern.families):
        log.note("pattern", message)
    resolved_options = None if candidate.preset is preset else candidate.preset.pattern
    release_freed_memory(4e3 * analysis.surface.m)  # expected number of freed bytes
    return replace(pattern, asked=resolved_options, attempts=chosen.attempts)


def sketched_pattern(analysis: StressedSurface, chosen: ChosenMethod) -> PatternResult:
    """Return stripes with approximate widths. Raises PatternError if no width gives the requested share of material."""
    candidate = chosen.way
    return sketched_step(candidate.preset, analysis, candidate.choice, candidate.grading, candidate.even)


def _idle_frequencies(options: Pattern, surface: Surface) -> list[str]:
    families = [(name, getattr(options, name)) for name in options.family_names]
    return [
        f"pattern.{name}.frequency = {family.frequency:g} has no effect on evenly spaced stripes, which are "
        f"{family.distance(surface.area, surface.mean_edge):.3g} m apart: set pattern.{name}.spacing instead"
        for name, family in families
        if options.method == "stripes" and family.frequency not in (0.0, Family().frequency)
    ]


def _requested_method(
    preset: Preset, analysis: StressedSurface, log: Log, earlier: EarlierStripes | None
) -> MethodCandidate:
    even = _even_stripes(preset, analysis, log, earlier) if preset.pattern.method == "stripes" else None
    choice = choice_step(preset, analysis, log) if preset.pattern.auto else None
    resolved = preset.with_modes(choice.mode, choice.phase) if choice else preset
    grading = stressed_step(resolved, analysis, log, even) if preset.pattern.width.rule == "stressed" else None
    return MethodCandidate(resolved, Attempt(preset.pattern.method), choice, even, grading)


def _even_stripes(preset: Preset, analysis: StressedSurface, log: Log, earlier: EarlierStripes | None) -> EvenStripes:
    if earlier and same_stripes(earlier.asked, preset.pattern):
        log.seconds["stripes"] = earlier.seconds
        return earlier.even
    with log.row("stripes"):
        return stripes_under_own_weight(preset, analysis, log)
