"""Material that is kept around supports and loads, loose ends that are removed, and the correction of the share."""

from collections.abc import Callable, Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.pattern import Layer, kept_layers
from dsfab.preset.model import FAMILIES, Preset, Width
from dsfab.results import DiffusionResult, EvenStripes, PatternResult, StressedSurface
from dsfab.slicing import Tidy
from dsfab.surface import LoadCase, PatternRegion, Surface, hat_gradients


class _Kept(NamedTuple):
    """What such values of [pattern] keep of a surface."""

    asked: tuple[float, float, Sequence[PatternRegion]]
    surface: ref[Surface]
    layers: list[Layer]


_KEPT: WeakKeyDictionary[LoadCase, _Kept] = WeakKeyDictionary()
"""The last for each load that lives: all that `auto` tries keeps the same, which took a tenth of its time."""


def kept_regions(preset: Preset, surface: Surface, load: LoadCase, even: EvenStripes | None = None) -> list[Layer]:
    """What is material whatever the stripes do; of symmetric ones with the images of ragged patches, which are picked
    to one edge. Drawn regions are where they were drawn.
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
    asked, known = (preset.pattern.keep, preset.pattern.rim, preset.pattern.region), _KEPT.get(load)
    if known and known.asked == asked and known.surface() is surface:
        return known.layers
    layers = kept_layers(surface, load.held | load.loaded, *asked)
    _KEPT[load] = _Kept(asked, ref(surface), layers)
    return layers


ASTRAY = float(np.cos(np.radians(45)))
"""Stripes go astray where they run nearer to the other direction of the stress than to their own."""


def tidy_of(preset: Preset, given: StressedSurface, layers: Sequence[Layer]) -> Tidy | None:
    """What to take off of layers that are cut together, or None where the preset does not ask for it."""
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
    """(m,) faces where stripes on a mode run across their direction; evenly spaced ones never do."""
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
"""How closely pattern.width.solid_fraction is reached, as a share of the surface."""

UNSAID = 2 * SHARE_TOLERANCE
"""What it is missed by so little is not worth a word."""

CORRECTIONS = 3
"""Rounds at most in which it is corrected by what round corners and filled openings add."""

HALVINGS, SOME = 8, 3
"""Rounds at most in which it is looked for where that leads astray, since openings close: while it is not allowed, and
while it is worth a word."""


class _Try(NamedTuple):
    """Stripes that were to keep `aim` of the surface, what is added to it, what both are, and they themselves."""

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
    """Stripes that keep what is asked together with round corners and filled openings, and the share that this is.

    made    : the stripes for a share that is added to them, and a guess of their factor, 0 for none.
    nearest : the share that the last ones keep, near one.    added : what is added to them.
    bridged : what bridges add to the last ones besides. That takes long, and is mostly nothing: it is asked once those
              without it are known, and ever after where it is something.

    What is added changes little with the widths, so it is taken off what the stripes are to keep. Where it jumps,
    since openings close, that leads astray: then the answer is looked for between one that keeps less and one that
    keeps more.
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
        for _ in range(CORRECTIONS):
            if any(abs(one.aim + last.added - wanted) < SHARE_TOLERANCE for one in tries):
                break  # it is known what the next would be: where a bridge comes and goes, that of the last but one
            last = attempt(last.added, last.result.factor)
        return last

    last = settled(attempt(0.0))
    if (bridges := bridged()) > SHARE_TOLERANCE:
        last = tries[-1] = last._replace(added=last.added + bridges, total=last.total + bridges)
        tries[:-1] = []  # nothing is known of their bridges
        last = settled(last)
    for k in range(HALVINGS):
        near = max(allowed, UNSAID) if k >= SOME else UNSAID
        if min(abs(one.total - wanted) for one in tries) <= near or not (between := _between(tries, wanted)):
            break
        last = attempt(wanted - between, last.result.factor)
    if abs(last.total - wanted) > UNSAID:
        last = min(tries, key=lambda one: abs(one.total - wanted))
    return last.result, last.total if abs(last.total - wanted) > UNSAID else wanted


def _between(tries: Sequence[_Try], wanted: float) -> float:
    """What to aim at next: the middle of the nearest two tries of which one keeps too little and one too much.

    0 where there are none, or nothing new lies between them.
    """
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in tries for b in tries if a.total < wanted < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0
