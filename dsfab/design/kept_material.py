"""Regions that stay material, removal of loose ends, and correction of the share of material."""

from collections.abc import Callable, Sequence
from typing import NamedTuple
from weakref import ref

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.derived import derived_results
from dsfab.pattern import Layer, kept_layers
from dsfab.preset.model import FAMILIES, Preset, Width
from dsfab.results import DiffusionResult, EvenStripes, PatternResult, StressedSurface
from dsfab.slicing import Tidy
from dsfab.surface import LoadCase, PatternRegion, Surface, hat_gradients


class _LatestLayers(NamedTuple):
    options: tuple[float, float, Sequence[PatternRegion]]
    surface: ref[Surface]
    layers: list[Layer]


def kept_regions(preset: Preset, surface: Surface, load: LoadCase, even: EvenStripes | None = None) -> list[Layer]:
    """Return the layers that are material in all patterns.
    With symmetric stripes, the patches around supports and loads get the union of their images, because their borders
    are ragged by up to one mesh edge. The user's regions stay unchanged."""
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
    # sharing these layers saves a tenth of the time of all trials of `auto`
    latest: _LatestLayers | None = derived_results(load).get(_LatestLayers)
    if latest and latest.options == options and latest.surface() is surface:
        return latest.layers
    layers = kept_layers(surface, load.supported | load.loaded, *options)
    derived_results(load)[_LatestLayers] = _LatestLayers(options, ref(surface), layers)
    return layers


def tidy_of(preset: Preset, analysis: StressedSurface, layers: Sequence[Layer]) -> Tidy | None:
    """Return the options to remove loose ends from layers that are cut together; None if loose ends stay."""
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
    """Return a mask (m,) of faces where a stripe on a mode runs along the wrong principal direction, or None."""
    if layer.name not in FAMILIES or not isinstance(layer.field, np.ndarray):
        return None
    x: Floats = layer.field if layer.field.ndim == 1 else layer.field.mean(axis=1)
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), x[surface.F])
    tensors = diffusion.tensors
    D = tensors.major if layer.name == "major" else tensors.minor
    along = np.cross(surface.normals, gradient)
    along_own, along_other = (np.einsum("mi,mij,mj->m", v, D, v) for v in (along, gradient))
    return np.asarray((along_own < along_other) & ~tensors.isotropic)


SHARE_TOLERANCE = 4e-4  # Accuracy of pattern.width.solid_fraction, as a share of the surface.
UNREPORTED = 2 * SHARE_TOLERANCE  # Largest error of pattern.width.solid_fraction that dsfab does not report.


class _ShareTrial(NamedTuple):
    """Requested share of the stripes, share that finishing adds, their measured sum, and the stripes."""

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
    """Return stripes that cover the requested share of the surface after finishing, and the covered share.

    draw_pattern  : draws stripes, for a share that finishing adds and an estimate of the width factor (0 for none).
    nearest_share : returns the measured share nearest to a target, from all shares measured for the latest stripes.
    added_share   : returns the share that finishing adds, by round corners and filled openings.
    bridged_share : returns the share that bridges add to the latest stripes. The function is slow and mostly returns 0.
                    So it runs once after a search without bridges, and in later trials only if it did not return 0.

    The added share depends little on the widths, so the stripes get the requested share minus the added share. If
    openings close, the added share jumps; the search then bisects between a smaller and a larger total."""
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
            if any(abs(earlier.aim + trial.added - requested) < SHARE_TOLERANCE for earlier in trials):
                break  # the next trial would repeat an earlier trial
            trial = attempt(trial.added, trial.result.factor)
        return trial

    latest = converge(attempt(0.0))
    if (bridges := bridged_share()) > SHARE_TOLERANCE:
        latest = trials[-1] = latest._replace(added=latest.added + bridges, total=latest.total + bridges)
        trials[:-1] = []  # earlier trials do not include bridges
        latest = converge(latest)
    for k in range(8):  # from the fourth round on, the preset's tolerance suffices
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
    """Return the mean requested share of the nearest two trials below and above the target; 0 without such trials."""
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in trials for b in trials if a.total < requested < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0
