"""Requested results of a solved sheet: stress, frequencies and buckling."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from scipy.sparse import csr_array

from dsfab.core.errors import StaticsError
from dsfab.statics.boundary_conditions import SpreadLoad, all_clamped
from dsfab.statics.elements import REPORTED, Elements, elements_of
from dsfab.statics.factorisation import FactorCache, FactorFunction, stiffness_factor
from dsfab.statics.model import SheetModel
from dsfab.statics.modes import Buckling, Vibration, buckling, frequencies, mode_supports
from dsfab.statics.solve import Equilibrium, equilibrium, flat_axis
from dsfab.statics.stress import SheetStress, sheet_stress
from dsfab.surface.loads.load_case import LoadCase

Result = TypeVar("Result")


@dataclass(frozen=True)
class ResultRequest:
    """Further results to compute for a sheet: numbers of natural frequencies and of buckling load factors.
    strength : strength to compare the stress with, Pa; 0 for no comparison."""

    strength: float = 0.0
    frequencies: int = 0
    buckling: int = 0

    def __bool__(self) -> bool:
        return bool(self.strength or self.modes)

    @property
    def modes(self) -> int:
        """Sum of the numbers of requested vibration modes and buckling modes."""
        return self.frequencies + self.buckling

    def elements_for(self, elements: Elements) -> Elements:
        """Return `elements`, or more accurate elements if the requested results need more."""
        return elements_of("stress") if self and elements not in REPORTED else elements

    def factor_for(self, elements: Elements) -> FactorFunction:
        """Return the function that factorises the stiffness matrix; it keeps a factorisation that modes can use."""
        return FactorCache() if self.modes and self.elements_for(elements) == elements else stiffness_factor


@dataclass(frozen=True, eq=False)
class Answers:
    """Results of a sheet under one load. vibration, buckling : None if not requested or not computed.
    refusals : reasons why requested results are missing.
    assumed  : message about supports that the program assumes for modes; '' if it assumes none."""

    elements: Elements
    equilibrium: Equilibrium
    stress: SheetStress
    vibration: Vibration | None = None
    buckling: Buckling | None = None
    refusals: tuple[str, ...] = ()
    assumed: str = ""


@dataclass(frozen=True, eq=False)
class SolvedCase:
    """A load case and its solution.
    spread : distributed load on faces and edges.    factor_of : function that factorised the stiffness matrix.
    plane  : True if the sheet was solved only in its plane; None to find out from its shape and loads."""

    load: LoadCase
    spread: SpreadLoad
    equilibrium: Equilibrium
    elements: Elements
    factor_of: FactorFunction = stiffness_factor
    plane: bool | None = None


def sheet_answers(
    sheet: SheetModel,
    case: SolvedCase,
    stiffness: Callable[[Elements], csr_array],
    requested: ResultRequest,
    other_factors: FactorFunction | None = None,
) -> Answers:
    """Return the stress and the strain energy of a solved sheet, and the requested results.
    stiffness     : function that returns the stiffness matrix for given elements.
    other_factors : function that factorises further stiffness matrices.
    Raises StaticsError if more accurate elements cannot solve the sheet."""
    load, solved, factor_of, surface = case.load, case.equilibrium, case.factor_of, sheet.surface
    plane = flat_axis(surface, load) is not None if case.plane is None else case.plane
    other_factors = other_factors or FactorCache(2)
    full_elements = requested.elements_for(case.elements)
    elements = full_elements.in_plane if plane else full_elements
    if full_elements != case.elements:
        factor_of = other_factors
        solved = equilibrium(surface, stiffness(elements), load, elements, spread=case.spread, factor_of=factor_of)
    stress = sheet_stress(sheet, elements, solved)
    if not requested.modes:
        return Answers(elements, solved, stress)
    refusals: list[str] = []
    standing = mode_supports(surface, load, plane)
    model = replace(sheet, clamped=all_clamped(standing.load))
    shared: dict[str, Any] = {"elements": full_elements, "K": stiffness(full_elements)}
    shared["factor_of"] = other_factors if plane else factor_of
    vibration = factors = None
    if requested.frequencies:
        keywords = {**shared, "spring": load.spring}
        search_frequencies = partial(frequencies, model, standing.load.fixed, requested.frequencies, **keywords)
        vibration = _result_or_refusal(search_frequencies, "no natural frequencies", refusals)
    if requested.buckling:
        search = partial(buckling, sheet, standing.load, solved, requested.buckling, **shared)
        factors = _result_or_refusal(search, "no buckling factors", refusals)
    return Answers(elements, solved, stress, vibration, factors, tuple(refusals), standing.told)


def _result_or_refusal(find: Callable[[], Result], missing: str, refusals: list[str]) -> Result | None:
    try:
        return find()
    except StaticsError as error:
        refusals.append(f"{missing}: {error}")
        return None
