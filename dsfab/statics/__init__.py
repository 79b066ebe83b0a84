"""Stage 2, statics: how the surface carries the load."""

from dsfab.arrays import Bools
from dsfab.statics.answers import Answers, Ask, sheet_answers
from dsfab.statics.balance import Resultant, resultant, support_reactions
from dsfab.statics.bending import bending_stiffness
from dsfab.statics.curvature import FACETED, facet_number
from dsfab.statics.elements import PAPER, VERDICT, Bending, Elements, Membrane
from dsfab.statics.layers import LAYERS, Layer, Peak, Principal, SheetStress, plane_von_mises, sheet_stress
from dsfab.statics.material import Law, Material
from dsfab.statics.membrane import membrane_stiffness
from dsfab.statics.modes import Buckling, Vibration, buckling, frequencies, sheet_stiffness
from dsfab.statics.solve import Equilibrium, FactorOf, KeptFactor, equilibrium, factored, flat_axis
from dsfab.statics.spread import SpreadLoad, spread_load
from dsfab.statics.stress import stress, von_mises
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

__all__ = [
    "FACETED",
    "LAYERS",
    "PAPER",
    "VERDICT",
    "Answers",
    "Ask",
    "Bending",
    "Buckling",
    "Elements",
    "Equilibrium",
    "FactorOf",
    "KeptFactor",
    "Law",
    "Layer",
    "Material",
    "Membrane",
    "Peak",
    "Principal",
    "Resultant",
    "SheetStress",
    "SpreadLoad",
    "Vibration",
    "bending_stiffness",
    "buckling",
    "equilibrium",
    "facet_number",
    "factored",
    "flat_axis",
    "frequencies",
    "membrane_stiffness",
    "plane_von_mises",
    "resultant",
    "sheet_answers",
    "sheet_stiffness",
    "sheet_stress",
    "solve_statics",
    "spread_load",
    "stress",
    "support_reactions",
    "von_mises",
]


def solve_statics(
    surface: Surface,
    material: Material,
    load: LoadCase,
    thickness: float,
    law: Law = "plane_stress",
    membrane: Membrane = "constant",
    bending: Bending = "hinge",
    clamped: Bools | None = None,
    spread: SpreadLoad | None = None,
) -> Equilibrium:
    """Displacements, reactions and compliance of a thin elastic sheet (paper, section 3.1).

    thickness         : metres. Flat sheets loaded in their plane are solved in 2D, without bending.
    membrane, bending : the elements, see `Elements`.
    clamped, spread   : see `equilibrium`.

    Raises StaticsError for mechanisms and for loads that act on nothing.
    """
    elements = Elements(membrane, bending)
    if flat_axis(surface, load) is not None:
        elements = elements.in_plane
    K = membrane_stiffness(surface, material, thickness, law, elements)
    if elements.bending:
        K = K + bending_stiffness(surface, material, thickness, elements)
    return equilibrium(surface, K, load, elements, clamped, spread)
