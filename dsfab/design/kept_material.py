"""Material around supports and loads, removal of loose ends, and correction of the material share."""

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
    """Return the layers that are material wherever the stripes run.
    With symmetric stripes, patches around supports and loads are united with their images, because their edges are
    ragged by up to one mesh edge. The user's regions stay unchanged."""
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
    # all trials of `auto` share these layers, which saves a tenth of their time
    latest: _LatestLayers | None = derived_results(load).get(_LatestLayers)
    if latest and latest.options == options and latest.surface() is surface:
        return latest.layers
    layers = kept_layers(surface, load.supported | load.loaded, *options)
    derived_results(load)[_LatestLayers] = _LatestLayers(options, ref(surface), layers)
    return layers


def tidy_of(preset: Preset, analysis: StressedSurface, layers: Sequence[Layer]) -> Tidy | None:
    """Return the options to remove loose ends from layers that are cut together; None if the preset keeps them."""
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
    """Return faces (m,) where stripes on a mode are nearer to the other principal direction; None without modes."""
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
UNREPORTED = 2 * SHARE_TOLERANCE  # Largest error of the solid fraction without a report.


class _ShareTrial(NamedTuple):
    """A trial: the requested share of the stripes, the share that finishing adds, their sum, and the stripes."""

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
    """Return stripes that cover the requested share of the surface after finishing (round corners, filled openings),
    and the share that they cover.

    draw_pattern  : draws stripes, for a share that finishing adds and an estimate of the width factor (0 for none).
    nearest_share : returns the measured share nearest to a target, from all shares measured for the latest stripes.
    added_share   : returns the share that finishing adds.
    bridged_share : returns the share that bridges add to the latest stripes. It takes long and is mostly 0, so it runs
                    once after the search without bridges, and in each further trial only if it was not 0.

    The added share changes little with the widths, so it is subtracted from the share of the stripes. It jumps if
    openings close; then the search bisects between two trials, below and above the requested share."""
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
                break  # the next trial would repeat an earlier one, for example if a bridge appears and vanishes again
            trial = attempt(trial.added, trial.result.factor)
        return trial

    latest = converge(attempt(0.0))
    if (bridges := bridged_share()) > SHARE_TOLERANCE:
        latest = trials[-1] = latest._replace(added=latest.added + bridges, total=latest.total + bridges)
        trials[:-1] = []  # earlier trials do not include bridges
        latest = converge(latest)
    for k in range(8):  # the last five rounds accept the preset's tolerance
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
    """Return the middle of the aims of two trials whose totals lie below and above the requested share; else 0."""
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in trials for b in trials if a.total < requested < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0
