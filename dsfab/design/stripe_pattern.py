"""Stage 4: stripes, and kept regions (regions that are material in every pattern)."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple
from weakref import ref

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.derived import derived_results
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.design.slicing_and_thickening import closed_share, least_drawn_member, least_member, trial_cut, with_bridges
from dsfab.pattern import (
    DrawableFamily,
    EvenFamily,
    Layer,
    ModeFamily,
    ShareJumpError,
    Stripes,
    Widths,
    counted_share,
    frequency_for,
    kept_layers,
    mean_duty_factor,
    relative_stresses,
    solved_factor,
    stripe_layers,
)
from dsfab.preset.model import FAMILIES, Preset, Width
from dsfab.results import Choice, DiffusionResult, EvenStripes, Log, PatternResult, StressedSurface
from dsfab.slicing import PolygonMesh, Tidy, TrialCut, tidied_polygons
from dsfab.surface import LoadCase, PatternRegion, Surface, hat_gradients


class _LatestLayers(NamedTuple):
    options: tuple[float, float, Sequence[PatternRegion]]
    surface: ref[Surface]
    layers: list[Layer]


def kept_regions(preset: Preset, surface: Surface, load: LoadCase, even: EvenStripes | None = None) -> list[Layer]:
    """Return layers of the kept regions, which are material in every pattern."""
    layers, options = _cached_layers(preset, surface, load), preset.pattern
    symmetry = even.symmetry if even else None
    if symmetry is None:
        return layers
    return layers[: options.drawn_regions] + [
        layer._replace(field=symmetry.maximum(layer.field)) if isinstance(layer.field, np.ndarray) else layer
        for layer in layers[options.drawn_regions :]
    ]


def _cached_layers(preset: Preset, surface: Surface, load: LoadCase) -> list[Layer]:
    options = preset.pattern.keep, preset.pattern.rim, preset.pattern.region
    latest: _LatestLayers | None = derived_results(load).get(_LatestLayers)
    if latest and latest.options == options and latest.surface() is surface:
        return latest.layers
    layers = kept_layers(surface, load.supported | load.loaded, *options)
    derived_results(load)[_LatestLayers] = _LatestLayers(options, ref(surface), layers)
    return layers


def tidy_of(preset: Preset, analysis: StressedSurface, layers: Sequence[Layer]) -> Tidy | None:
    """Return rules for the removal of loose ends of members; None to keep loose ends."""
    if not preset.pattern.removes_loose_ends:
        return None
    names = [layer.name for layer in layers]
    astray = tuple(_astray_faces(analysis.surface, analysis.diffusion, layer) for layer in layers)
    return Tidy(
        tuple(name in FAMILIES for name in names),
        astray,
        analysis.load.supported | analysis.load.loaded,
        tuple(layer.closed for layer in layers),
    )


def _astray_faces(surface: Surface, diffusion: DiffusionResult, layer: Layer) -> Bools | None:
    if layer.name not in FAMILIES or not isinstance(layer.field, np.ndarray):
        return None
    x: Floats = layer.field if layer.field.ndim == 1 else layer.field.mean(axis=1)
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), x[surface.F])
    tensors = diffusion.tensors
    D = tensors.major if layer.name == "major" else tensors.minor
    along = np.cross(surface.normals, gradient)
    along_own, along_other = (np.einsum("mi,mij,mj->m", v, D, v) for v in (along, gradient))
    return np.asarray((along_own < along_other) & ~tensors.isotropic)


SHARE_TOLERANCE = 4e-4  # Largest error of the solid fraction.
UNREPORTED = 2 * SHARE_TOLERANCE  # dsfab reports only larger errors of the solid fraction.


class _ShareTrial(NamedTuple):
    """Trial of `corrected_pattern`: target, added and total covered fraction of the surface, and the stripes."""

    aim: float
    added: float
    total: float
    result: PatternResult


def corrected_pattern(
    width: Width,
    draw_pattern: Callable[[float, float], PatternResult],
    nearest_share: Callable[[float], float],
    added_share: Callable[[PatternResult], float],
    bridged_share: Callable[[], float],
) -> tuple[PatternResult, float]:
    """Return stripes that cover the requested fraction of the surface after finishing, and the covered fraction.
    draw_pattern  : function that draws stripes, for a fraction that finishing will add and a guess of the width factor.
    nearest_share : function that returns, of all measured fractions, the nearest to a given fraction.
    added_share   : function that returns the fraction that rounded corners and filled openings add.
    bridged_share : function that returns the fraction that bridges add."""
    requested, tolerance = width.solid_fraction, width.solid_fraction_tolerance
    trials = list[_ShareTrial]()
    bridges = 0.0

    def attempt(taken: float, guess: float = 0.0) -> _ShareTrial:
        result = draw_pattern(taken, guess)
        extra = added_share(result) + (bridged_share() if bridges else 0.0)
        trials.append(_ShareTrial(requested - taken, extra, nearest_share(requested - taken) + extra, result))
        return trials[-1]

    def converge(trial: _ShareTrial) -> _ShareTrial:
        for _ in range(3):
            if abs(trial.total - requested) <= UNREPORTED:
                break
            if any(abs(earlier.aim + trial.added - requested) < SHARE_TOLERANCE for earlier in trials):
                break  # the next trial would repeat an earlier one
            trial = attempt(trial.added, trial.result.factor)
        return trial

    latest = converge(attempt(0.0))
    if (bridges := bridged_share()) > SHARE_TOLERANCE:
        latest = trials[-1] = latest._replace(added=latest.added + bridges, total=latest.total + bridges)
        trials[:-1] = []  # earlier trials do not count bridges, so their shares are too small
        latest = converge(latest)
    for k in range(8):  # the preset's tolerance counts only after three rounds
        accepted = max(tolerance, UNREPORTED) if k >= 3 else UNREPORTED
        if min(abs(trial.total - requested) for trial in trials) <= accepted or not (
            middle := _middle_target(trials, requested)
        ):
            break
        latest = attempt(requested - middle, latest.result.factor)
    if abs(latest.total - requested) > UNREPORTED:
        latest = min(trials, key=lambda trial: abs(trial.total - requested))
    return latest.result, latest.total if abs(latest.total - requested) > UNREPORTED else requested


def _middle_target(trials: Sequence[_ShareTrial], requested: float) -> float:
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in trials for b in trials if a.total < requested < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0


COUNTED = 2  # Sample points along each side of a face, for approximate shares.
CLOSINGS = (1.0, 0.97, 1.03, 0.9, 0.8, 0.65, 0.5)
"""Factors on the approximate widths of members, in the order of trial. The scaled widths decide which openings between
members are closed as too narrow. Smaller factors close fewer openings."""
SHARE_SNAP = 0.05  # Default of slicing.snap, for cuts that only measure the share of the surface with material.


class WidthSearch(NamedTuple):
    """Options of the search for widths. share : function that returns the fraction of the surface that layers cover.
    tolerance : largest error of this fraction.    guess : expected factor on widths, or 0.
    counted   : faster, less accurate `share`, or None.    added : fraction of the surface that finishing will add."""

    share: Callable[[Sequence[Layer]], float]
    tolerance: float
    guess: float = 0.0
    counted: Callable[[Sequence[Layer]], float] | None = None
    added: float = 0.0


@dataclass
class _MeasuredShares:
    """Function that returns the fraction of the surface that layers cover. It stores the latest cut and all results."""

    preset: Preset
    given: StressedSurface
    reached: list[float] = field(default_factory=list)
    layers: Sequence[Layer] | None = None
    polygons: PolygonMesh | None = None
    trial: TrialCut | None = None

    def __call__(self, layers: Sequence[Layer]) -> float:
        self.forget()  # frees memory for the next cut
        surface = self.given.surface
        fields, levels = zip(*((layer.field, layer.levels) for layer in layers), strict=True)
        self.polygons = tidied_polygons(surface, fields, levels, SHARE_SNAP, tidy_of(self.preset, self.given, layers))
        self.layers = layers
        self.reached.append(self.polygons.material_area / surface.area)
        return self.reached[-1]

    def nearest(self, target: float) -> float:
        return min(self.reached, key=lambda one: abs(one - target))

    def added(self, pattern: PatternResult) -> float:
        self.trial = trial_cut(self.preset, self.given.surface, pattern, self.polygons)
        return self.trial.added_area / self.given.surface.area if self.trial else 0.0

    def bridged(self) -> float:
        if self.trial is None:
            return 0.0
        self.trial, share = with_bridges(self.preset, self.given.surface, self.trial)
        return share

    def forget(self) -> None:
        self.layers = self.polygons = None


def pattern_step(
    preset: Preset,
    analysis: StressedSurface,
    log: Log,
    choice: Choice | None = None,
    grading: Floats | None = None,
    even: EvenStripes | None = None,
) -> PatternResult:
    """Return the pattern: kept regions, and stripes with widths that give the requested fraction of material.
    choice  : modes and phases that were chosen for `auto`, or None.
    grading : (n, f) relative half-widths of f families of stripes.    even : evenly spaced stripes, or None."""
    options, surface = preset.pattern, analysis.surface
    with log.stage("pattern", "drawing stripes"):
        kept_layers = kept_regions(preset, surface, analysis.load, even)
        widths = member_widths(preset, surface)
        families = drawable_families(preset, analysis, widths.radius, grading, even)
        if not even:
            _note_spacings(preset, families, log)
        counted = counted_share(surface, kept_layers, COUNTED) if options.width.solid_fraction else None
        share = _MeasuredShares(preset, analysis)

        def draw(measure_added: float = 0.0, guess: float = 0.0) -> PatternResult:
            share.reached.clear()
            search = WidthSearch(share, SHARE_TOLERANCE, guess, None if guess else counted, measure_added)
            layers, factor = solved_layers(preset, surface, kept_layers, families, search)
            if share.layers is not layers:
                share.forget()
            tidy = tidy_of(preset, analysis, layers)
            pattern = pattern_result(preset, families, layers)
            return replace(pattern, factor=factor, choice=choice, even=even, tidy=tidy)

        if not (requested := options.width.solid_fraction):
            return draw()
        finished = bool(options.fillet or even or options.removes_loose_ends)
        if not (finished or options.for_workshop):
            result, total = draw(), share.nearest(requested)
        else:

            def closed(pattern: PatternResult) -> float:
                return closed_share(preset, surface, pattern, share.polygons)

            added = share.added if finished else closed
            result, total = corrected_pattern(options.width, draw, share.nearest, added, share.bridged)
            result = result.with_trial(share.trial)
        log.note("pattern", _solved_width_message(preset, widths, result.factor, total))
    return result


def sketched_step(
    preset: Preset,
    analysis: StressedSurface,
    choice: Choice | None = None,
    grading: Floats | None = None,
    even: EvenStripes | None = None,
) -> PatternResult:
    """Return the pattern with approximate widths. grading : (n, f) relative half-widths of f families of stripes."""
    surface = analysis.surface
    kept_layers = kept_regions(preset, surface, analysis.load, even)
    families = drawable_families(preset, analysis, member_widths(preset, surface).radius, grading, even)
    search = WidthSearch(counted_share(surface, kept_layers, COUNTED), 4e-3)  # 4e-3: error of sampled shares
    layers, factor = solved_layers(preset, surface, kept_layers, families, search)
    pattern = pattern_result(preset, families, layers)
    return replace(pattern, factor=factor, choice=choice, even=even, tidy=tidy_of(preset, analysis, layers))


def member_widths(preset: Preset, surface: Surface) -> Widths:
    """Return the rule for widths of members, from the options in [pattern.width]."""
    options = preset.pattern
    bounded = options.method == "stripes" and options.width.rule in ("graded", "stressed")
    return options.width.widths(np.sqrt(surface.area), least_width(preset, surface) if bounded else 0.0)


def least_width(preset: Preset, surface: Surface) -> float:
    """Return the default smallest width (m) of evenly spaced members of varying width."""
    stressed = preset.pattern.width.rule == "stressed"
    least = least_drawn_member(preset, surface) if stressed else preset.statics.thickness
    return min(least, least_member(preset.pattern, surface))


def _note_spacings(preset: Preset, families: Sequence[DrawableFamily], log: Log) -> None:
    for family in families:
        if spacing := getattr(preset.pattern, family.name).spacing:
            message = f"the spacing of {spacing:g} m means that the frequency of the {family.name} stripes is"
            log.note("pattern", f"{message} {family.stripes.frequency:.4g}")


def pattern_result(preset: Preset, families: Sequence[DrawableFamily], layers: Sequence[Layer]) -> PatternResult:
    """Return the pattern that consists of `layers`."""
    options = preset.pattern
    names, fields, levels, half_widths, _ = zip(*layers, strict=True)
    stripes = {family.name: family.stripes for family in families}
    major, minor = (stripes.get(name, getattr(options, name).stripes) for name in FAMILIES)
    modes = options.major.number, options.minor.number
    frequencies, phases = (major.frequency, minor.frequency), (major.phase, minor.phase)
    return PatternResult(names, fields, levels, half_widths, frequency=frequencies, mode=modes, phase=phases)


def solved_layers(
    preset: Preset,
    surface: Surface,
    kept_layers: Sequence[Layer],
    families: Sequence[DrawableFamily],
    search: WidthSearch,
) -> tuple[list[Layer], float]:
    """Return layers that cover the requested fraction of the surface, and the necessary factor on widths.
    Raises PatternError if no factor gives this fraction."""
    width, widths = preset.pattern.width, member_widths(preset, surface)
    factor = search.guess or (mean_duty_factor(surface, families, widths) if widths.follow_stress else 1.0)

    def layers(factor: float, closing: float = 0.0) -> list[Layer]:
        return [*kept_layers, *stripe_layers(families, widths, factor, closing)]

    share, tolerance, guess, counted, added = search
    if width.solid_fraction:
        requested = width.solid_fraction - added
        slope = 0.85 * requested if guess else 0.0  # d share / d relative width; 0.85 because members overlap
        if counted is None and not guess and any(layer.closed is not None for layer in layers(factor)):
            counted = counted_share(surface, kept_layers, COUNTED)  # approximate widths decide which openings close
        if counted is not None:
            with suppress(PatternError):  # the final search raises a better message
                factor *= solved_factor(lambda relative: counted(layers(factor * relative)), requested, SHARE_TOLERANCE)
                slope = (counted(layers(1.02 * factor)) - counted(layers(0.98 * factor))) / 0.04
        jump = width.solid_fraction_tolerance
        if preset.pattern.families != "both":  # without crossings, members can come loose, and the share jumps
            spacing = preset.pattern.drawn_families[0].distance(surface.area, surface.mean_edge)
            jump = max(jump, width.solid_fraction * spacing / float(np.sqrt(surface.area)))

        def solve(share_of: Callable[[float], float]) -> float:
            return solved_factor(share_of, requested, tolerance, slope, jump)

        try:
            return layers_with_share(layers, share, factor, solve)
        except PatternError as error:
            if added < SHARE_TOLERANCE:
                raise
            raise PatternError(
                f"{error}; round corners and filled openings add another {added:.1%} of the surface"
            ) from None
    return layers(factor), factor


def layers_with_share(
    layers: Callable[[float, float], list[Layer]],
    share: Callable[[Sequence[Layer]], float],
    factor: float,
    solve: Callable[[Callable[[float], float]], float],
) -> tuple[list[Layer], float]:
    """Return layers that cover the requested fraction of the surface, and the necessary factor on widths.
    layers : function of two factors on widths. The first scales the stripes; the second decides which openings close.
    share  : function that returns the fraction of the surface that layers cover.
    solve  : function that takes a function share(x), and returns x for the requested fraction."""
    refused, distant = list[PatternError](), list[tuple[float, float, list[Layer]]]()
    for closing in (factor * shift for shift in CLOSINGS):
        cache = _CachedLayers(layers, factor, closing)
        try:
            relative = solve(lambda x: share(cache.layers_at(x)))  # noqa: B023
        except PatternError as error:
            refused.append(error)
        else:
            distance = abs(float(np.log(max(relative, np.finfo(float).tiny) * factor / closing)))
            solution = cache.layers_at(relative)
            if distance < np.log(2.5) or all(layer.closed is None for layer in solution):
                return solution, factor * relative
            distant.append((distance, factor * relative, solution))
    if distant:
        _, nearest, solution = min(distant, key=lambda one: one[0])
        return solution, nearest
    if isinstance(refused[0], ShareJumpError):
        raise PatternError(f"{refused[0]}, or allow a larger pattern.width.solid_fraction_tolerance")
    raise refused[0]


@dataclass
class _CachedLayers:
    """The function `layers`, with a cache of the latest result."""

    layers: Callable[[float, float], list[Layer]]
    factor: float
    closing: float
    last: tuple[float, list[Layer]] = (-1.0, [])

    def layers_at(self, relative: float) -> list[Layer]:
        """Return the layers for stripe widths that are scaled by `relative * factor`."""
        if self.last[0] != relative:
            self.last = relative, self.layers(self.factor * relative, self.closing)
        return self.last[1]


def drawable_families(
    preset: Preset,
    analysis: StressedSurface,
    radius: float = 0.0,
    grading: Floats | None = None,
    even: EvenStripes | None = None,
) -> Sequence[DrawableFamily]:
    """Return the major and minor families of stripes, along the first and second principal stress.
    radius  : radius (m) of the disc over which the number of stripes per metre is averaged.
    grading : (n, f) relative half-widths of f families, for the width rule `stressed`.
    even    : evenly spaced stripes; None for modes. Raises PatternError for a mode that was not computed."""
    surface, diffusion = analysis.surface, analysis.diffusion
    options, families = preset.pattern, list[DrawableFamily]()
    stress: list[Floats | None] = [None] * len(options.family_names)
    if options.width.rule in ("graded", "stressed"):
        sizes = stripe_stresses(surface, diffusion, even)
        sizes = sizes[:, [FAMILIES.index(name) for name in options.family_names]]
        if options.width.rule == "stressed":
            sizes = sizes**options.width.q if grading is None else grading
        stress = list(sizes.T)
    if even is not None:
        return _even_families(preset, surface, even, stress)
    for name, along in zip(options.family_names, stress, strict=True):
        family, modes = getattr(options, name), getattr(diffusion, name)
        if family.number > len(modes.lam):
            raise PatternError(
                f"pattern.{name}.mode = {family.number}, but dsfab computes only {len(modes.lam)} modes "
                f"(diffusion.modes); increase diffusion.modes or choose a lower mode"
            )
        x, stripes = modes.mode(family.number), family.stripes
        if family.spacing:
            stripes = replace(stripes, frequency=frequency_for(surface, x, family.spacing))
        families.append(ModeFamily.from_mode(surface, name, stripes, x, along, radius))
    return families


def stripe_stresses(surface: Surface, diffusion: DiffusionResult, even: EvenStripes | None) -> Floats:
    """Return |stress| (n, 2) along major and minor stripes, divided by its mean. Raises PatternError if it is zero."""
    sizes = np.abs(even.forces if even is not None and even.forces is not None else diffusion.tensors.principal)
    if even is not None and even.steered:
        along = even.steered.along[:, None]
        sizes = along * sizes + (1 - along) * sizes[:, ::-1]
    relative = relative_stresses(surface, sizes)
    return even.symmetry.mean(relative) if even is not None and even.symmetry is not None else relative


def _even_families(
    preset: Preset, surface: Surface, even: EvenStripes, stress: Sequence[Floats | None]
) -> list[DrawableFamily]:
    families: list[DrawableFamily] = []
    for name, relative_stress in zip(preset.pattern.family_names, stress, strict=True):
        k, stripes = FAMILIES.index(name), Stripes(1.0, 0.0, getattr(preset.pattern, name).threshold)
        along = np.ones(surface.n) if relative_stress is None else relative_stress
        columns = even.phases[k], even.wanted[k], even.slope[:, k], even.density[:, k], along
        tidied = preset.pattern.removes_loose_ends and preset.pattern.families == "both"
        families.append(EvenFamily(name, stripes, *columns, int(k != even.first), tidied))
    return families


def _solved_width_message(preset: Preset, widths: Widths, factor: float, share: float) -> str:
    options = preset.pattern
    if widths.rule == "constant":
        became = f"members are {length(factor * widths.member)} wide"
    elif widths.rule == "plain":
        thresholds = [family.stripes.with_width_factor(factor).threshold for family in options.drawn_families]
        became = f"the thresholds of the stripes became {' and '.join(f'{threshold:.3f}' for threshold in thresholds)}"
        became = became if len(thresholds) > 1 else became.replace("thresholds", "threshold")
    else:
        became = f"the widths by the rule '{widths.rule}' were multiplied by {factor:.3g}"
    message = f"{became} for solid_fraction = {options.width.solid_fraction:.1%}"
    if abs(share - options.width.solid_fraction) <= SHARE_TOLERANCE:
        return message
    return f"{message}; {share:.2%} is the nearest possible share, because the share jumps when ends of members appear"
