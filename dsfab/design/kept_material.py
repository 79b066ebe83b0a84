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
    """Layers for values of [pattern] on a surface."""

    options: tuple[float, float, Sequence[PatternRegion]]
    surface: ref[Surface]
    layers: list[Layer]


def kept_regions(preset: Preset, surface: Surface, load: LoadCase, even: EvenStripes | None = None) -> list[Layer]:
    """Return the layers that are material whatever the stripes are.

    With symmetric stripes, ragged patches (vertices picked to one edge) are united with their images. Regions of the
    user stay where the user put them.
    """
    layers, ask = _kept_as_asked(preset, surface, load), preset.pattern
    symmetry = even.symmetry if even else None
    if symmetry is None:
        return layers
    return layers[: ask.drawn_regions] + [
        layer._replace(field=symmetry.most(layer.field)) if isinstance(layer.field, np.ndarray) else layer
        for layer in layers[ask.drawn_regions :]
    ]


def _kept_as_asked(preset: Preset, surface: Surface, load: LoadCase) -> list[Layer]:
    options = preset.pattern.keep, preset.pattern.rim, preset.pattern.region
    # all trials of `auto` share the latest layers of a load, which saves a tenth of their time
    latest: _LatestLayers | None = derived_results(load).get(_LatestLayers)
    if latest and latest.options == options and latest.surface() is surface:
        return latest.layers
    layers = kept_layers(surface, load.held | load.loaded, *options)
    derived_results(load)[_LatestLayers] = _LatestLayers(options, ref(surface), layers)
    return layers


def tidy_of(preset: Preset, given: StressedSurface, layers: Sequence[Layer]) -> Tidy | None:
    """Return the ends to remove from layers that are cut together, or None if the preset does not request it."""
    if not preset.pattern.tidied:
        return None
    names = [layer.name for layer in layers]
    astray = tuple(_astray(given.surface, given.diffusion, layer) for layer in layers)
    return Tidy(
        tuple(name in FAMILIES for name in names),
        astray,
        given.load.held | given.load.loaded,
        tuple(layer.closed for layer in layers),
    )


def _astray(surface: Surface, diffusion: DiffusionResult, layer: Layer) -> Bools | None:
    """Return faces (m,) where stripes on a mode run nearer to the other direction of the stress; None if they
    cannot.
    """
    if layer.name not in FAMILIES or not isinstance(layer.field, np.ndarray):
        return None
    x: Floats = layer.field if layer.field.ndim == 1 else layer.field.mean(axis=1)
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), x[surface.F])
    tensors = diffusion.tensors
    D = tensors.major if layer.name == "major" else tensors.minor
    along = np.cross(surface.normals, gradient)
    own, other = (np.einsum("mi,mij,mj->m", v, D, v) for v in (along, gradient))
    return np.asarray((own < other) & ~tensors.isotropic)


SHARE_TOLERANCE = 4e-4
"""Accuracy of pattern.width.solid_fraction, as a share of the surface."""

UNSAID = 2 * SHARE_TOLERANCE
"""A smaller miss of the solid fraction is not reported."""


class _Try(NamedTuple):
    """A trial: the share that stripes should keep, the share added to it, the sum that both reach, and the stripes."""

    aim: float
    added: float
    total: float
    result: PatternResult


def corrected(
    width: Width,
    made: Callable[[float, float], PatternResult],
    nearest: Callable[[float], float],
    added: Callable[[PatternResult], float],
    bridged: Callable[[], float],
) -> tuple[PatternResult, float]:
    """Return stripes that keep the requested share together with round corners and filled openings, and the share
    reached.

    draw_pattern  : makes stripes for a share added to them, and a guess of their factor, 0 for none.
    nearest_share : the share near a target that the latest stripes keep.    added_share : the share added to them.
    bridged_share : the share that bridges add to the latest stripes. It takes long and is mostly 0: it is computed once
                    after the search without it, and in each further trial only if it is not 0.

    The added share changes little with the widths, so it is subtracted from the share of the stripes. It jumps if
    openings close; then the search bisects between a trial that keeps less and one that keeps more.
    """
    wanted, allowed = width.solid_fraction, width.solid_fraction_tolerance
    tries = list[_Try]()
    bridges = 0.0

    def attempt(taken: float, guess: float = 0.0) -> _Try:
        result = made(taken, guess)
        more = added(result) + (bridged() if bridges else 0.0)
        tries.append(_Try(wanted - taken, more, nearest(wanted - taken) + more, result))
        return tries[-1]

    def settled(last: _Try) -> _Try:
        for _ in range(3):
            if any(abs(one.aim + last.added - wanted) < SHARE_TOLERANCE for one in tries):
                break  # the next trial would repeat an earlier one, for example if a bridge comes and goes
            last = attempt(last.added, last.result.factor)
        return last

    last = settled(attempt(0.0))
    if (bridges := bridged()) > SHARE_TOLERANCE:
        last = tries[-1] = last._replace(added=last.added + bridges, total=last.total + bridges)
        tries[:-1] = []  # their bridges were not measured
        last = settled(last)
    for k in range(8):  # the last five rounds accept the tolerance of the preset
        near = max(allowed, UNSAID) if k >= 3 else UNSAID
        if min(abs(one.total - wanted) for one in tries) <= near or not (between := _between(tries, wanted)):
            break
        last = attempt(wanted - between, last.result.factor)
    if abs(last.total - wanted) > UNSAID:
        last = min(tries, key=lambda one: abs(one.total - wanted))
    return last.result, last.total if abs(last.total - wanted) > UNSAID else wanted


def _between(tries: Sequence[_Try], wanted: float) -> float:
    """Return the next share to aim at: the middle of the nearest two trials around the requested share; 0 without
    any.
    """
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in tries for b in tries if a.total < wanted < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0
