"""Search for the best pattern method."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design.even_stripes import even_stripes, follows_membrane
from dsfab.design.mode_search import Trial, choice_step, stressed_choice, stressed_step
from dsfab.design.pattern_measures import DesignDraft, measured_pattern, roles_of_families
from dsfab.design.slicing_and_thickening import filled_plate, slicing_step, trial_cut
from dsfab.design.stripe_pattern import pattern_step
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Family, Preset, Slicing, Width
from dsfab.results import (
    Attempt,
    Choice,
    EvenStripes,
    FilledOpenings,
    Log,
    Note,
    PatternResult,
    Progress,
    StressedSurface,
)
from dsfab.slicing import Sheet
from dsfab.surface import Surface

EXCHANGEABLE_RULES = ("constant", "graded")  # Width rules that the search may replace, if a solid fraction is set.
SPACINGS = (0.75, 1.25)  # The search also tries the default spacing of stripes times these factors.


@dataclass(frozen=True, eq=False)
class MethodCandidate:
    """A candidate of the search: a pattern method with options, and results of its trial.
    preset  : preset with chosen values in place of `auto`.    attempt : name and measured values of the trial.
    choice  : tried modes and phases, best first, or None.    even : evenly spaced stripes, or None.
    sheet   : cut sheet; None before the trial, or if the trial failed.
    grading : (n, f) relative half-widths of f families of stripes at n vertices, or None."""

    preset: Preset
    attempt: Attempt
    choice: Choice | None = None
    even: EvenStripes | None = None
    grading: Floats | None = None
    sheet: Sheet | None = None
    notes: tuple[Note, ...] = ()
    drawn: PatternResult | None = None


def _stiffest(candidates: list[MethodCandidate]) -> MethodCandidate | None:
    usable = [candidate for candidate in candidates if not candidate.attempt.refused]
    return min(usable, key=lambda candidate: candidate.attempt.rank, default=None)


def stressed_candidates(
    preset: Preset, candidates: list[MethodCandidate], analysis: StressedSurface, log: Log
) -> Iterator[MethodCandidate]:
    """Yield the best evenly spaced candidate and the best candidate from modes, with the width rule `stressed`."""
    if not _exchangeable(preset.pattern.width):
        return
    for method in ("stripes", "modes"):
        stiffest = _stiffest([candidate for candidate in candidates if candidate.preset.pattern.method == method])
        if not stiffest:
            continue
        words = stiffest.attempt.name.partition(",")[0]
        log.report("pattern", f"trying {words} with the width rule 'stressed': cutting and solving")
        width = preset.pattern.width.model_copy(update={"rule": "stressed"})
        variant_preset = stiffest.preset.with_pattern(width=width)
        scratch, choice = replace(log, notes=[]), stiffest.choice
        if choice:
            choice = stressed_choice(variant_preset, analysis, scratch, choice)
            variant_preset = variant_preset.with_modes(choice.mode, choice.phase)
        variant = MethodCandidate(variant_preset, Attempt(f"{words}, stressed"), choice, stiffest.even)
        yield _with_worth(variant, analysis, scratch)


def optimal_force_candidates(
    preset: Preset, candidates: list[MethodCandidate], analysis: StressedSurface, log: Log
) -> Iterator[MethodCandidate]:
    """Yield the best evenly spaced candidate, drawn again along the membrane forces of the stiffest sheet."""
    options = preset.pattern
    stiffest = _stiffest([candidate for candidate in candidates if candidate.even])
    if not stiffest or not _exchangeable(options.width) or options.is_steered:
        return
    if not follows_membrane(preset, analysis.surface, analysis.statics):
        return
    words = f"{stiffest.attempt.name.partition(',')[0]} along optimal forces"
    log.report("pattern", f"trying {words}: cutting and solving")
    width = options.width.model_copy(update={"rule": "stressed"})
    variant_preset, scratch = stiffest.preset.with_pattern(width=width, forces="optimal"), replace(log, notes=[])
    try:
        even = even_stripes(variant_preset, analysis.surface, analysis.statics)
    except DsfabError as error:
        yield MethodCandidate(variant_preset, Attempt(words, refused=str(error)))
        return
    yield _with_worth(MethodCandidate(variant_preset, Attempt(f"{words}, stressed"), None, even), analysis, scratch)


def respaced_candidates(
    preset: Preset, candidates: list[MethodCandidate], analysis: StressedSurface, log: Log
) -> Iterator[MethodCandidate]:
    """Yield variants of the best evenly spaced candidate with larger and smaller distances of stripes."""
    stiffest = _stiffest([candidate for candidate in candidates if candidate.even])
    if not stiffest or not preset.pattern.width.solid_fraction:
        return
    tail = stiffest.attempt.name.partition("stripes")[2]
    for factor in SPACINGS:
        spaced, distances = _respaced_families(stiffest.preset, analysis.surface, factor)
        for halve in (True, False) if spaced and preset.pattern.may_halve else (False,) * bool(spaced):
            words = f"{'halved ' * halve}stripes {distances} m apart{tail}"
            log.report("pattern", f"trying {words}: cutting and solving")
            variant_preset = stiffest.preset.with_pattern(**spaced, halve=halve)
            try:
                even = even_stripes(variant_preset, analysis.surface, analysis.statics)
            except DsfabError as error:
                yield MethodCandidate(variant_preset, Attempt(words, refused=str(error)))
                continue
            if any(even.wanted) or not halve:  # if no stripe ends early, `halve` changes nothing
                variant = MethodCandidate(variant_preset, Attempt(words), None, even)
                yield _with_worth(variant, analysis, replace(log, notes=[]))


def _respaced_families(preset: Preset, surface: Surface, factor: float) -> tuple[dict[str, Family], str]:
    families, distances = dict[str, Family](), list[str]()
    for name in preset.pattern.family_names:
        family: Family = getattr(preset.pattern, name)
        distance = float(f"{factor * family.distance(surface.area, surface.mean_edge):.2g}")
        if not family.spacing and distance >= 2 * surface.mean_edge:
            families[name] = family.model_copy(update={"spacing": distance, "frequency": 0.0})
            distances.append(f"{distance:g}")
    return families, " and ".join(dict.fromkeys(distances))


def candidate_as_built(candidate: MethodCandidate, analysis: StressedSurface) -> MethodCandidate:
    """Cut and solve a candidate in the same way as a build; return the candidate with measured results."""
    preset = candidate.preset.model_copy(update={"slicing": Slicing()})
    trial, log = Trial(preset, analysis, candidate.even), Log(None)
    try:
        options = candidate.choice, candidate.grading, candidate.even
        pattern = candidate.drawn or pattern_step(preset, analysis, log, *options)
        sliced = slicing_step(preset, analysis.surface, analysis.statics, pattern, Log(None))
        compliance = trial.compliance(sliced.sheet.surface, trial.loads_on(sliced.sheet))
    except DsfabError as error:
        return replace(candidate, attempt=Attempt(candidate.attempt.name, refused=str(error)), sheet=None)
    worth = compliance, compliance / trial.uncut, sliced.sheet.surface.area / analysis.surface.area
    measured = _with_quality(candidate, analysis, worth, pattern, sliced.cells, sliced.sheet)
    if sliced.plate and preset.pattern.crowding == "avoid":
        measured = replace(measured, attempt=measured.attempt._replace(plate=sliced.plate.openings))
    return replace(measured, notes=(*candidate.notes, *log.notes), drawn=replace(pattern, trial=None))


def uncrowded_candidate(
    candidate: MethodCandidate, analysis: StressedSurface, draw: Callable[[Preset], MethodCandidate], progress: Progress
) -> MethodCandidate:
    """Return `candidate`, or a better variant if filled openings of `candidate` form a plate (area without openings).
    draw : function that returns a candidate with the stripes of a preset, without widths."""
    surface, options, pattern = analysis.surface, candidate.preset.pattern, candidate.drawn
    trial = pattern and (pattern.trial or trial_cut(candidate.preset, surface, pattern))
    cells = trial and (trial.cells, trial.latest.cells)
    plate = pattern and cells and filled_plate(options, surface, analysis.load, pattern, cells)
    if not (pattern and plate):
        return candidate
    candidates = [candidate_as_built(candidate, analysis)]
    draft = DesignDraft(candidate.preset, surface, analysis.statics, analysis.diffusion, pattern)
    for changes in uncrowded_changes(draft, plate):
        words = ", ".join(f"pattern.{key} = {value!r}" for key, value in changes.items())
        progress("pattern", f"openings form a plate: trying {words}")
        preset = with_overrides(candidate.preset, {f"pattern.{key}": value for key, value in changes.items()})
        try:
            candidates.append(candidate_as_built(replace(draw(preset), attempt=Attempt(words)), analysis))
        except DsfabError as error:
            candidates.append(MethodCandidate(preset, Attempt(words, refused=str(error))))
    selected = min(candidates, key=lambda candidate: candidate.attempt.rank)
    listed = "; ".join(_attempt_description(candidate.attempt) for candidate in candidates)
    outcome = f"dsfab took {selected.attempt.name} instead"
    if selected is candidates[0]:
        selected, outcome = candidate, "no other pattern has fewer flaws, and no pattern with equal flaws is stiffer"
    note = Note(
        "pattern",
        f"{plate.message}: {outcome}; compliance of each tried pattern, divided by that of the uncut sheet: {listed}",
    )
    return replace(selected, preset=selected.preset.with_pattern(crowding="note"), notes=(*selected.notes, note))


def uncrowded_changes(design: DesignDraft, plate: FilledOpenings) -> Iterator[dict[str, object]]:
    """Yield up to four changes of [pattern], values by key, that may prevent `plate`: an area of filled openings."""
    options, surface, load = design.preset.pattern, design.surface, design.statics.load
    spacings = {name: getattr(options, name).distance(surface.area, surface.mean_edge) for name in options.family_names}
    distance = np.linalg.norm(surface.V[load.supported | load.loaded] - plate.place, axis=1).min(initial=np.inf)
    radius = max(spacings.values()) * np.sqrt(plate.openings / np.pi)
    if distance < options.keep + radius + max(spacings.values()):
        yield {"keep": float(f"{max(options.keep, distance) + radius:.2g}")}
    yield {f"{name}.spacing": float(f"{SPACINGS[1] * spacing:.2g}") for name, spacing in spacings.items()}
    arches = [role.key for role in roles_of_families(design) if role.shape == "arches"]
    if options.families != "both" or (options.rim and arches):
        yield {"families": arches[0] if options.families == "both" else "both"}
    if not options.is_steered:
        yield {"rotate": 45.0}


def methods(preset: Preset) -> list[tuple[str, bool]]:
    """Return the pattern methods to try, as pairs (name, halve). With `halve`, every second stripe may end."""
    halved = [("stripes", True)] if preset.pattern.may_halve else []
    modes = [] if preset.pattern.is_steered else [("modes", preset.pattern.halve)]  # modes cannot follow guides
    return [*halved, ("stripes", False), *modes]


def method_candidates(
    preset: Preset, analysis: StressedSurface, log: Log, method: str, halve: bool
) -> Iterator[MethodCandidate]:
    """Yield a candidate for each width rule. method : "stripes" or "modes".    halve : every second stripe may end."""
    title = {"modes": "modes", "stripes": "halved stripes" if halve else "stripes"}[method]
    variant_preset = preset.with_pattern(method=method, halve=halve, weight_rounds=0)
    if method == "modes":
        variant_preset = variant_preset.with_pattern(forces="uncut")
    if method == "modes" and preset.pattern.tidy is None and preset.pattern.families == "both":
        variant_preset = variant_preset.with_pattern(tidy=True)  # stripes on eigenmodes have loose ends
    log.report("pattern", f"trying {title}: cutting and solving")
    scratch = replace(log, notes=[])
    try:
        even = even_stripes(variant_preset, analysis.surface, analysis.statics) if method == "stripes" else None
        choice = choice_step(variant_preset, analysis, scratch) if variant_preset.pattern.auto else None
    except DsfabError as error:
        yield MethodCandidate(variant_preset, Attempt(title, refused=str(error)))
        return
    variant_preset = variant_preset.with_modes(choice.mode, choice.phase) if choice else variant_preset
    for rule, width in _width_variants(preset.pattern.width).items():
        variant = MethodCandidate(variant_preset.with_pattern(width=width), Attempt(f"{title}, {rule}"), choice, even)
        yield _with_worth(variant, analysis, replace(log, notes=list(scratch.notes)))


def _with_worth(candidate: MethodCandidate, analysis: StressedSurface, scratch: Log) -> MethodCandidate:
    preset, name = candidate.preset, candidate.attempt.name
    try:
        stressed = preset.pattern.width.rule == "stressed"
        grading = stressed_step(preset, analysis, scratch, even=candidate.even) if stressed else None
        result, pattern, sheet, cells = Trial(preset, analysis, candidate.even).result(preset, grading)
    except DsfabError as error:
        return replace(candidate, attempt=Attempt(name, refused=str(error)))
    worth = result.compliance, result.over_uncut, result.kept
    measured = _with_quality(candidate, analysis, worth, pattern, cells, sheet)
    return replace(measured, grading=grading, notes=tuple(scratch.notes))


def _with_quality(
    candidate: MethodCandidate,
    analysis: StressedSurface,
    worth: tuple[float, float, float],
    pattern: PatternResult,
    cells: Sheet,
    sheet: Sheet,
) -> MethodCandidate:
    drafted = DesignDraft(candidate.preset, analysis.surface, analysis.statics, analysis.diffusion, pattern)
    quality = measured_pattern(drafted, symmetry=False, cells=cells, sheet=sheet)
    attempt = Attempt(candidate.attempt.name, *worth, quality.dead_ends, quality.slits)
    return replace(candidate, attempt=attempt, sheet=sheet)


def _exchangeable(width: Width) -> bool:
    return width.rule in EXCHANGEABLE_RULES and bool(width.solid_fraction)


def _width_variants(width: Width) -> dict[str, Width]:
    if not _exchangeable(width):
        return {width.rule: width}
    gentle = 0.5 * width.q
    constant, graded = (width.model_copy(update={"rule": rule}) for rule in EXCHANGEABLE_RULES)
    return {"constant": constant, "graded": graded, f"graded q {gentle:g}": graded.model_copy(update={"q": gentle})}


NEAR_BEST = 0.1  # Candidates with a compliance up to 10 % above the smallest are built, and solved again accurately.


def method_step(preset: Preset, analysis: StressedSurface, log: Log) -> tuple[MethodCandidate, tuple[Attempt, ...]]:
    """Return the best candidate for the pattern method `auto`, and the results of all trials, best first.
    Raises PatternError if no candidate carries its loads."""
    candidates: list[MethodCandidate] = []
    for method, halve in methods(preset):
        with log.row("method"):
            candidates += method_candidates(preset, analysis, log, method, halve)
    for more_candidates in (stressed_candidates, optimal_force_candidates, respaced_candidates):
        with log.row("method"):
            candidates += more_candidates(preset, candidates, analysis, log)
    with log.row("method"):
        candidates = _finalists_as_built(candidates, analysis)
        ranked = _ranking(candidates, analysis)
    stiffest = ranked[0]
    if stiffest.attempt.refused:
        raise PatternError(
            f"pattern.method = 'auto' found no stripes that carry the loads; reason for the first method: "
            f"{candidates[0].attempt.refused}"
        )
    log.notes.extend(stiffest.notes)
    listed = "; ".join(_attempt_description(candidate.attempt) for candidate in candidates)
    log.note(
        "pattern",
        f"pattern.method = 'auto' chose {stiffest.attempt.name}; compliance of each method, divided "
        f"by that of the uncut sheet: {listed}",
    )
    return stiffest, tuple(candidate.attempt for candidate in ranked)


def _finalists_as_built(candidates: list[MethodCandidate], analysis: StressedSurface) -> list[MethodCandidate]:
    *flaws, soft = min(candidate.attempt.rank for candidate in candidates)
    limit = (*flaws, (1 + NEAR_BEST) * soft)
    shares = [other for other in candidates if other.sheet and other.preset.pattern.width.solid_fraction]
    ranked = sorted(shares, key=lambda candidate: candidate.attempt.rank)
    finalists = [candidate for candidate in ranked[:4] if candidate.attempt.rank <= limit]
    if len(finalists) < 2:
        return candidates
    built = {candidate: candidate_as_built(candidate, analysis) for candidate in reversed(finalists)}
    return [built.get(candidate, candidate) for candidate in candidates]


def _ranking(candidates: list[MethodCandidate], analysis: StressedSurface) -> list[MethodCandidate]:
    ranked = sorted(candidates, key=lambda candidate: candidate.attempt.rank)
    *flaws, soft = ranked[0].attempt.rank
    near_best = [candidate for candidate in ranked if candidate.sheet and list(candidate.attempt.rank[:-1]) == flaws]
    near_best = [candidate for candidate in near_best if candidate.attempt.rank[-1] <= (1 + NEAR_BEST) * soft]
    if len(near_best) > 1:
        ranked[: len(near_best)] = sorted(near_best, key=lambda candidate: _accurate_softness(candidate, analysis))
    return ranked


def _accurate_softness(candidate: MethodCandidate, analysis: StressedSurface) -> float:
    assert candidate.sheet is not None
    trial = Trial(candidate.preset, analysis, candidate.even)
    compliance = trial.compliance(candidate.sheet.surface, trial.loads_on(candidate.sheet), "compliance_once")
    return float(f"{compliance * candidate.attempt.kept:.3g}")


def _attempt_description(attempt: Attempt) -> str:
    if attempt.refused:
        return f"{attempt.name} refused"
    counted = {"dead end": attempt.dead_ends, "slit": attempt.slits, "filled opening": attempt.plate}
    flaws = " and ".join(f"{count} {what}{'s' if count > 1 else ''}" for what, count in counted.items() if count)
    return f"{attempt.name} {attempt.over_uncut:.3g} x{f' with {flaws}' if flaws else ''}"
