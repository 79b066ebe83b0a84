"""Stage 3, diffusion: where material wants to run."""

from dsfab.diffusion.modes import Modes, diffusion_modes
from dsfab.diffusion.operators import diffusion_operator
from dsfab.diffusion.tensors import DiffusionTensors, Labelling, combined_stress, diffusion_tensors

__all__ = [
    "DiffusionTensors",
    "Labelling",
    "Modes",
    "combined_stress",
    "diffusion_modes",
    "diffusion_operator",
    "diffusion_tensors",
]
