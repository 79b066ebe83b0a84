"""Stage 3: tensors that follow the stress, and their modes."""

from dsfab.diffusion.modes import CLEAR_MOMENT, Modes, diffusion_modes, family_modes, reference_axes
from dsfab.diffusion.symmetry import Symmetry, largest_symmetry, symmetry_group, symmetry_of
from dsfab.diffusion.tensors import (
    DiffusionTensors,
    Labelling,
    combined_stress,
    diffusion_operator,
    diffusion_tensors,
    layer_stress,
    only_bends,
    principal_stresses,
)

__all__ = [
    "CLEAR_MOMENT", "DiffusionTensors", "Labelling", "Modes", "Symmetry", "combined_stress", "diffusion_modes",
    "diffusion_operator", "diffusion_tensors", "family_modes", "largest_symmetry", "layer_stress", "only_bends",
    "principal_stresses", "reference_axes", "symmetry_group", "symmetry_of",
]  # fmt: skip
