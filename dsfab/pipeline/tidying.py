"""What `cut` takes off where stripes lead nowhere: loose ends, and bands of modes that turn back."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.pattern import Layer
from dsfab.preset import FAMILIES, Preset
from dsfab.results import DiffusionResult, StressedSurface
from dsfab.slicing import Tidy
from dsfab.surface import Surface, hat_gradients

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
