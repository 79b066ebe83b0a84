"""Answers at other thicknesses from one factorisation, compared with a full solve at each thickness."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab.core.units import GRAVITY
from dsfab.statics import SheetModel, buckling, mode_supports, sheet_stress, solve_for
from dsfab.statics.elements import elements_of
from dsfab.statics.thickness_basis import ACCURATE, ThicknessBasis, ThicknessStiffness
from dsfab.surface import Boundary, Box, Force, LoadCase, SelfWeight, Side, Snow, Support, Surface
from tests.shapes import grid, lifted, subsurface
from tests.statics.supports import STEEL

SOLVED = 0.03
"""The solved thickness, in metres."""
WITHIN, MODES_WITHIN = 0.012, 0.018
"""Accepted relative errors of answers, and of buckling factors."""


def with_openings(surface: Surface) -> Surface:
    """A sheet with square openings, side by side in both directions."""
    x, y = (np.floor(surface.centroids[:, k] * 5).astype(int) for k in (0, 1))
    return subsurface(surface, ~((x % 2 == 1) & (y % 2 == 1)))


def loaded(surface: Surface, supports: list[Support], *lists: list) -> tuple[SheetModel, dict[str, LoadCase]]:
    """A steel sheet with one load case for each list of loads."""
    sheet = SheetModel(surface, STEEL, SOLVED)
    weight = STEEL.density * sheet.thickness * GRAVITY
    return sheet, {str(k): LoadCase.build(surface, supports, loads, weight) for k, loads in enumerate(lists)}


def vault() -> tuple[SheetModel, dict[str, LoadCase]]:
    """A cut vault, built in at one side and on springs at the other, under its weight, under snow, and under both."""
    surface = with_openings(lifted(lambda x, y: 0.25 * x * (3.0 - x), cells=15, length=3.0))
    supports = [Support(Side("x", "min"), clamp=True), Support(Side("x", "max"), hold="yz", spring=(3e7, 0.0, 0.0))]
    weight, snow = SelfWeight(), Snow(8e4)
    return loaded(
        surface, supports, [weight], [weight, snow], [Snow(2e5), Force(Box((1, 1, -9), (2, 2, 9)), (4e5, 0, 0))]
    )


def plate() -> tuple[SheetModel, dict[str, LoadCase]]:
    """A cut plate that bends under its weight and a force."""
    surface = with_openings(grid(15, 15, 3.0, 3.0))
    force = Force(Side("x", "max"), (0.0, 0.0, -5e3))
    return loaded(surface, [Support(Side("x", "min"), clamp=True)], [SelfWeight()], [SelfWeight(), force])


def wall() -> tuple[SheetModel, dict[str, LoadCase]]:
    """A cut plate that is pressed in its plane, from its free side towards its built-in side."""
    surface = with_openings(grid(15, 15, 3.0, 3.0))
    loads = [SelfWeight((-1.0, 0.0, 0.0)), Force(Side("x", "max"), (-5e5, 0.0, 0.0))]
    return loaded(surface, [Support(Side("x", "min"), clamp=True)], loads)


@pytest.mark.parametrize("structure", [vault, plate, wall], ids=lambda structure: structure.__name__)
def test_one_factorisation_gives_answers_and_buckling_factors_from_half_to_twice_the_thickness(structure):
    sheet, loads = structure()
    basis = ThicknessBasis.from_sheet(sheet, loads, [*loads])
    for thickness in np.geomspace(SOLVED / ACCURATE, SOLVED * ACCURATE, 5):
        thick, loads_there = replace(sheet, thickness=thickness), basis.loads_at(thickness)
        answers, factors = basis.answers(thickness), basis.buckling_factors(thickness)
        for name, full in solve_for(thick, loads_there, "displacement").items():
            answer, load = answers[name], loads_there[name]
            assert_allclose(answer.largest_displacement, full.largest_displacement, rtol=WITHIN)
            assert_allclose(answer.compliance, full.compliance, rtol=WITHIN)
            assert_allclose(answer.reaction.sum(axis=0), full.reaction.sum(axis=0), atol=WITHIN * abs(load.force).sum())
            stresses = [sheet_stress(thick, state.elements, state).largest.max() for state in (answer, full)]
            assert_allclose(stresses[0], stresses[1], rtol=WITHIN)
            lowest = buckling(thick, mode_supports(sheet.surface, load).load, full, 1).factor
            assert_allclose(factors[name], lowest[0] if len(lowest) else np.inf, rtol=MODES_WITHIN)


def test_rounding_makes_the_stiffness_of_a_basis_singular_at_no_thickness():
    """At the solved thickness it is the identity; at all others its eigenvalues are between t and t^3 times that."""
    sheet, loads = vault()
    basis = ThicknessBasis.from_sheet(sheet, loads, [*loads])
    for membrane, bending, springs in (basis.reduced, basis.modes):
        stiffness = SOLVED * membrane + SOLVED**3 * bending + springs
        assert_allclose(stiffness, np.eye(len(stiffness)), atol=1e-5)


@pytest.mark.parametrize(("share", "count"), [(5e-10, 2), (2e-11, 1)])
def test_a_basis_has_no_vector_that_differs_from_another_by_less_than_a_ten_billionth(share, count):
    sheet, loads = plate()
    stiffness = ThicknessStiffness.from_sheet(sheet, [*loads.values()], elements_of("displacement"))
    vectors = np.random.default_rng(0).normal(size=(2, len(stiffness.is_held))) * ~stiffness.is_held
    vectors[1] = vectors[0] + share * vectors[1]
    assert stiffness.basis(vectors.T, sheet.thickness).shape[1] == count


@pytest.mark.parametrize("ratio", [1 / ACCURATE, ACCURATE])
def test_buckling_factors_are_right_where_modes_change_their_order(ratio):
    """One mode would not be enough for this flat cap: its factor would be 10 or 16 % too large."""
    cap = lifted(lambda x, y: x * (3.0 - x) * y * (3.0 - y) / 45, cells=8, length=3.0)
    sheet, loads = loaded(cap, [Support(Boundary())], [Snow(1e5)])
    basis = ThicknessBasis.from_sheet(sheet, loads, [*loads])
    thickness = ratio * SOLVED
    load, found = basis.loads_at(thickness)["0"], basis.buckling_factors(thickness)["0"]
    thick = replace(sheet, thickness=thickness)
    full = solve_for(thick, {"0": load}, "displacement")["0"]
    lowest = buckling(thick, mode_supports(cap, load).load, full, 1).factor[0]
    assert_allclose(found, lowest, rtol=MODES_WITHIN)
