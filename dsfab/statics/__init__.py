"""Stage 2, statics: how the surface carries the load."""

from dsfab.statics.bending import bending_stiffness
from dsfab.statics.material import Law, Material
from dsfab.statics.membrane import membrane_stiffness
from dsfab.statics.solve import Equilibrium, equilibrium, flat_axis
from dsfab.statics.stress import stress, von_mises
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

__all__ = [
    "Equilibrium",
    "Law",
    "Material",
    "bending_stiffness",
    "equilibrium",
    "flat_axis",
    "membrane_stiffness",
    "solve_statics",
    "stress",
    "von_mises",
]


def solve_statics(
    surface: Surface, material: Material, load: LoadCase, thickness: float, law: Law = "plane_stress"
) -> Equilibrium:
    """Displacements, reactions and compliance of a thin elastic sheet (paper, section 3.1).

    thickness : metres. Flat sheets loaded in their plane are solved in 2D, without bending.

    Raises StaticsError for mechanisms and for loads that act on nothing.
    """
    K = membrane_stiffness(surface, material, thickness, law)
    if flat_axis(surface, load) is None:
        K = K + bending_stiffness(surface, material, thickness)
    return equilibrium(surface, K, load)
