"""Stage 3, diffusion: where material wants to run."""

from dsfab.diffusion.frame import CLEAR, reference_axes
from dsfab.diffusion.layers import layer_stress, only_bends
from dsfab.diffusion.modes import Modes, diffusion_modes, family_modes
from dsfab.diffusion.operators import diffusion_operator
from dsfab.diffusion.symmetry import Symmetry, symmetry_group, symmetry_of
from dsfab.diffusion.symmetry_search import found_symmetry
from dsfab.diffusion.tensors import DiffusionTensors, Labelling, combined_stress, diffusion_tensors, principal_stresses

__all__ = [
    "CLEAR",
    "DiffusionTensors",
    "Labelling",
    "Modes",
    "Symmetry",
    "combined_stress",
    "diffusion_modes",
    "diffusion_operator",
    "diffusion_tensors",
    "family_modes",
    "found_symmetry",
    "layer_stress",
    "only_bends",
    "principal_stresses",
    "reference_axes",
    "symmetry_group",
    "symmetry_of",
]
