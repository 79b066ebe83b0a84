"""Stage 2, statics: equilibrium, stress and forces of a surface under its loads."""

from collections.abc import Mapping

from dsfab.core.errors import StaticsError
from dsfab.statics.assembly import matrix_sum
from dsfab.statics.bending import bending_stiffness
from dsfab.statics.bending_moments import facet_number
from dsfab.statics.boundary_conditions import SpreadLoad, spread_load
from dsfab.statics.elements import (
    PAPER,
    REPORTED,
    USES,
    Aid,
    Bending,
    Elements,
    Membrane,
    Quantity,
    elements_of,
    needle_message,
    tolerance_of,
)
from dsfab.statics.factorisation import Factor, FactorCache, FactorFunction, stiffness_factor
from dsfab.statics.internal_forces import CONVENTION, SectionForces, ShearRecovery, section_forces
from dsfab.statics.membrane import membrane_stiffness
from dsfab.statics.model import Law, Material, SheetMaterial, SheetModel
from dsfab.statics.modes import (
    Buckling,
    ModeSupports,
    buckling,
    frequencies,
    lowest_buckling,
    mass_of_loads,
    mode_supports,
)
from dsfab.statics.reactions import SupportEntry, load_entries, resultant, support_entries, support_reactions
from dsfab.statics.requested_results import Answers, ResultRequest, SolvedCase, sheet_answers
from dsfab.statics.solve import Equilibrium, equilibria, equilibrium, flat_axis
from dsfab.statics.stiffness import FaceStiffness, sheet_stiffness
from dsfab.statics.stress import (
    LAYERS,
    SheetStress,
    membrane_strains,
    membrane_stresses,
    plane_von_mises,
    sheet_stress,
    stress,
    von_mises,
)
from dsfab.statics.torsion import rib_shape, torsion_share, with_barlike_ribs
from dsfab.statics.variable_thickness import optimality_step, varying_thickness
from dsfab.surface.loads.load_case import LoadCase

__all__ = [
    "CONVENTION", "LAYERS", "PAPER", "REPORTED", "USES", "Aid", "Answers", "Bending", "Buckling", "Elements",
    "Equilibrium", "FaceStiffness", "Factor", "FactorCache", "FactorFunction", "Law", "Material", "Membrane",
    "ModeSupports", "Quantity", "ResultRequest", "SectionForces", "ShearRecovery", "SheetMaterial", "SheetModel",
    "SheetStress", "SolvedCase", "SpreadLoad", "SupportEntry", "bending_stiffness", "buckling", "elements_of",
    "equilibria", "equilibrium", "facet_number", "flat_axis", "frequencies", "load_entries", "lowest_buckling",
    "mass_of_loads", "matrix_sum", "membrane_stiffness", "membrane_strains", "membrane_stresses", "mode_supports",
    "needle_message", "optimality_step", "plane_von_mises", "resultant", "rib_shape", "section_forces",
    "sheet_answers", "sheet_stiffness", "sheet_stress", "solve_cases", "solve_for", "solve_statics", "spread_load",
    "stiffness_factor", "stress", "support_entries", "support_reactions", "tolerance_of", "torsion_share",
    "varying_thickness", "von_mises", "with_barlike_ribs",
]  # fmt: skip


def solve_statics(
    sheet: SheetModel, load: LoadCase, elements: Elements = PAPER, spread: SpreadLoad | None = None
) -> Equilibrium:
    """Return displacements, reactions and compliance of a thin elastic sheet [Madan, Jacobson and Levin, section 3.1].
    spread : part of the load that acts on faces and edges.    Raises StaticsError for mechanisms."""
    spreads = None if spread is None else {"load": spread}
    return solve_cases(sheet, {"load": load}, elements, spreads)["load"]


def solve_for(
    sheet: SheetModel, loads: Mapping[str, LoadCase], use: Quantity | Aid, bars: bool = False
) -> dict[str, Equilibrium]:
    """Solve load cases with elements that suit a purpose. Return the equilibria by name of the case.
    use  : the purpose, a key of `USES`.    bars : True if ribs twist like rectangular bars.
    Raises StaticsError as `solve_cases`."""
    elements = elements_of(use)
    try:
        return solve_cases(sheet, loads, elements, bars=bars)
    except StaticsError:
        if elements.bending != "hhj" or not needle_message(sheet.surface):
            raise
        return solve_cases(sheet, loads, elements_of("needles"), bars=bars)


def solve_cases(
    sheet: SheetModel,
    loads: Mapping[str, LoadCase],
    elements: Elements = PAPER,
    spreads: Mapping[str, SpreadLoad] | None = None,
    combinations: Mapping[str, Mapping[str, float]] | None = None,
    bars: bool = False,
) -> dict[str, Equilibrium]:
    """Solve load cases that have the same supports. Return the equilibria of cases and combinations by name.
    spreads      : part of each case's load on faces and edges, by name of the case.
    combinations : factor of each case, by name of the combination, then by name of the case.
    bars         : True if ribs twist like rectangular bars.
    Raises StaticsError, also for cases on different supports and for combinations of unknown cases."""
    sums = dict(combinations or {})
    for name, factors in sums.items():
        if unknown := [case for case in factors if case not in loads]:
            raise StaticsError(f"combination {name} has a factor for {unknown[0]!r}; the cases are {', '.join(loads)}")
    if flat_axis(sheet.surface, *loads.values()) is not None:
        elements = elements.in_plane
    K = sheet_stiffness(with_barlike_ribs(sheet) if bars and elements.bending else sheet, elements)
    spread_loads = None if spreads is None else [spreads[name] for name in loads]
    table = [[factors.get(case, 0.0) for case in loads] for factors in sums.values()]
    clamped_loads = [sheet.with_clamped_edges(load) for load in loads.values()]
    answers = equilibria(sheet.surface, K, clamped_loads, elements, spread_loads, table)
    return dict(zip((*loads, *sums), answers, strict=True))
