"""Stage 2, statics: how the surface carries its loads."""

from collections.abc import Mapping

from scipy.sparse import csr_array

from dsfab.core.errors import StaticsError
from dsfab.statics.assembly import matrix_sum
from dsfab.statics.bending import bending_stiffness
from dsfab.statics.bending_moments import facet_number
from dsfab.statics.boundary_conditions import SpreadLoad, spread_load, with_springs
from dsfab.statics.elements import (
    PAPER,
    REPORTED,
    USES,
    Aid,
    Bending,
    Elements,
    Membrane,
    Quantity,
    Use,
    elements_of,
    flatness,
    needle_message,
    tolerance_of,
)
from dsfab.statics.factorisation import Factor, FactorCache, FactorFunction, stiffness_factor
from dsfab.statics.internal_forces import CONVENTION, SectionForces, ShearRecovery, section_forces
from dsfab.statics.membrane import membrane_stiffness
from dsfab.statics.model import Law, Material, SheetMaterial, SheetModel
from dsfab.statics.modes import Buckling, ModeSupports, Vibration, buckling, frequencies, mode_supports
from dsfab.statics.reactions import (
    LoadEntry,
    Resultant,
    SupportEntry,
    load_entries,
    resultant,
    support_entries,
    support_reactions,
)
from dsfab.statics.requested_results import Answers, ResultRequest, SolvedCase, sheet_answers
from dsfab.statics.solve import Equilibrium, equilibria, equilibrium, flat_axis
from dsfab.statics.stiffness import FaceStiffness, sheet_stiffness
from dsfab.statics.stress import (
    LAYERS,
    Layer,
    Peak,
    Principal,
    SheetStress,
    membrane_strains,
    membrane_stresses,
    plane_von_mises,
    sheet_stress,
    stress,
    von_mises,
)
from dsfab.statics.torsion import RibShape, rib_shape, torsion_loss, torsion_share
from dsfab.statics.variable_thickness import optimality_step, varying_thickness
from dsfab.surface.loads.load_case import LoadCase

__all__ = [
    "CONVENTION", "LAYERS", "PAPER", "REPORTED", "USES", "Aid", "Answers", "Bending", "Buckling", "Elements",
    "Equilibrium", "FaceStiffness", "Factor", "FactorCache", "FactorFunction", "Law", "Layer", "LoadEntry",
    "Material", "Membrane", "ModeSupports", "Peak", "Principal", "Quantity", "ResultRequest", "Resultant",
    "RibShape", "SectionForces", "ShearRecovery", "SheetMaterial", "SheetModel", "SheetStress", "SolvedCase",
    "SpreadLoad", "SupportEntry", "Use", "Vibration", "bending_stiffness", "buckling", "elements_of", "equilibria",
    "equilibrium", "facet_number", "flat_axis", "flatness", "frequencies", "load_entries", "matrix_sum",
    "membrane_stiffness", "membrane_strains", "membrane_stresses", "mode_supports", "needle_message",
    "optimality_step", "plane_von_mises", "resultant", "rib_shape", "section_forces", "sheet_answers",
    "sheet_stiffness", "sheet_stress", "solve_cases", "solve_for", "solve_statics", "spread_load",
    "stiffness_factor", "stress", "support_entries", "support_reactions", "tolerance_of", "torsion_loss",
    "torsion_share", "varying_thickness", "von_mises", "with_springs",
]  # fmt: skip


def solve_statics(
    sheet: SheetModel, load: LoadCase, elements: Elements = PAPER, spread: SpreadLoad | None = None
) -> Equilibrium:
    """Return displacements, reactions and compliance of a thin elastic sheet (paper, section 3.1).
    A flat sheet loaded in its plane is solved in 2D, without bending.    spread : see `equilibrium`.
    Raises StaticsError for mechanisms and for loads that act on nothing."""
    spreads = None if spread is None else {"load": spread}
    return solve_cases(sheet, {"load": load}, elements, spreads)["load"]


def solve_for(
    sheet: SheetModel, loads: Mapping[str, LoadCase], use: Quantity | Aid, bars: bool = False
) -> dict[str, Equilibrium]:
    """Return `solve_cases` by the elements of a use, with ribs that twist as `bars` or as a thin sheet.

    Needles among faces, which a cut may leave, may stop the more accurate elements. Then elements that tolerate needles
    solve the sheet (see `Equilibrium.elements`). Raises StaticsError as `solve_cases`."""
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
    """Return `solve_statics` for several load cases on the same supports, by name, from one factorisation.

    spreads      : by case, see `equilibrium`; for all cases, or None.
    combinations : by name, the factor of each case; they follow the cases in the result.
    bars         : whether ribs that bend twist as rectangular bars, see `torsion_loss`.
    Raises StaticsError as `solve_statics`, for cases on different supports, and for combinations of unknown cases."""
    sums = dict(combinations or {})
    for name, factors in sums.items():
        if unknown := [case for case in factors if case not in loads]:
            raise StaticsError(f"combination {name} has a factor for {unknown[0]!r}; the cases are {', '.join(loads)}")
    if flat_axis(sheet.surface, *loads.values()) is not None:
        elements = elements.in_plane
    K = sheet_stiffness(sheet, elements)
    if bars and elements.bending:
        K = csr_array(K + torsion_loss(sheet, elements, rib_shape(sheet.surface)))
    spread_loads = None if spreads is None else [spreads[name] for name in loads]
    table = [[factors.get(case, 0.0) for case in loads] for factors in sums.values()]
    clamped_loads = [sheet.with_clamped_edges(load) for load in loads.values()]
    answers = equilibria(sheet.surface, K, clamped_loads, elements, spread_loads, table)
    return dict(zip((*loads, *sums), answers, strict=True))
