"""What is material whatever the stripes do: around supports and loads, along edges, and in drawn regions."""

from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np

from dsfab.pattern import Layer, kept_layers
from dsfab.preset import Preset
from dsfab.results import EvenStripes
from dsfab.surface import LoadCase, PatternRegion, Surface


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
