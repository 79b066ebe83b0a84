"""The hybrid membrane: its stresses, its rank on any triangle, beside the quadratic one, and what it reports."""

import numpy as np
import pytest

from dsfab.statics import (
    Elements,
    Material,
    SheetModel,
    SpreadLoad,
    elements_of,
    membrane,
    membrane_stiffness,
    membrane_strains,
    membrane_stresses,
    sheet_stress,
    solve_statics,
    stress,
)
from dsfab.statics.membrane import AIRY, hybrid_rigidity
from dsfab.surface import Surface
from dsfab.verification import TESTS
from tests.shapes import grid, jittered
from tests.statics.load_cases import STEEL, H, case

BEST, SIX_NODES = elements_of("displacement"), elements_of("six_nodes")

HYBRID, QUADRATIC = Elements("hybrid", None), Elements("quadratic", None)
C = STEEL.membrane("plane_stress")


def triangles(*shapes: tuple[float, float], turn: float = 0.3) -> Surface:
    """Triangles (0, 0), (1, 0), (x, y), each for itself, turned in their plane."""
    corners = np.array([[(0, 0), (1, 0), shape] for shape in shapes], dtype=float).reshape(-1, 2)
    c, s = np.cos(turn), np.sin(turn)
    V = np.pad(corners @ np.array([[c, s], [-s, c]]), ((0, 0), (0, 1)))
    return Surface(V, np.arange(len(V)).reshape(-1, 3))


EQUILATERAL, RIGHT = (0.5, 3**0.5 / 2), (0.0, 1.0)
SHAPES = [EQUILATERAL, RIGHT, (0.5, 0.05), (1.7, 0.4), (-0.8, 0.3), (0.1, 2.0)]


def weakest(surface: Surface) -> float:
    """The smallest energy over that of the quadratic triangle, over all strains of all faces; the largest is at most 1.

    D of the quadratic triangle: A (I + J) / 12 times C.
    """
    root = np.linalg.inv(np.linalg.cholesky(np.kron((np.eye(3) + 1) / 12, C)))
    ratio = root @ (hybrid_rigidity(surface, C) / surface.areas[:, None, None]) @ root.T
    values = np.linalg.eigvalsh(ratio)
    assert values.max() <= 1 + 1e-6
    return float(values.min())


def test_every_stress_is_in_equilibrium_and_compatible():
    h = 0.5  # differences of quadratics are exact

    def at(x: float, y: float) -> np.ndarray:
        return np.einsum("p,pik->ik", [x**a * y**b for a, b in membrane.MONOMIALS], membrane.STRESSES)

    x, y = 0.7, -0.4
    dx, dy = (at(x + h, y) - at(x - h, y)) / (2 * h), (at(x, y + h) - at(x, y - h)) / (2 * h)
    assert np.abs(dx[0] + dy[2]).max() <= 1e-12
    assert np.abs(dx[2] + dy[1]).max() <= 1e-12
    trace = lambda *p: at(*p)[:2].sum(axis=0)  # noqa: E731
    laplacian = trace(x + h, y) + trace(x - h, y) + trace(x, y + h) + trace(x, y - h) - 4 * trace(x, y)
    assert np.abs(laplacian).max() <= 1e-12
    assert np.linalg.matrix_rank(membrane.STRESSES.reshape(18, -1)) == len(AIRY) == 11


def test_the_hybrid_triangle_is_softer_than_the_quadratic_one_and_never_singular(monkeypatch):
    assert weakest(triangles(EQUILATERAL, RIGHT)) > 0.15
    assert weakest(triangles(*SHAPES)) > 0.1
    # one pair of quartic stresses would do on most triangles, and lets the right isosceles one collapse
    pair = (*AIRY[:7], AIRY[7], {(3, 1): 1, (1, 3): 1})
    monkeypatch.setattr(membrane, "STRESSES", membrane.airy_stresses(pair))
    assert weakest(triangles(RIGHT)) == pytest.approx(0, abs=1e-9)


def test_the_hybrid_triangle_with_linear_stresses_is_the_quadratic_triangle(monkeypatch):
    linear = np.zeros((6, 3, 9))
    for k in range(9):
        linear[k // 3, k % 3, k] = 1
    monkeypatch.setattr(membrane, "STRESSES", linear)
    surface = triangles(*SHAPES)
    mass = np.kron((np.eye(3) + 1) / 12, C) * surface.areas[:, None, None]
    assert np.abs(hybrid_rigidity(surface, C) - mass).max() <= 1e-10 * np.abs(mass).max()


def test_numbering_and_place_change_nothing_and_needles_stay_finite():
    surface = triangles(*SHAPES)
    turned = Surface(surface.V + [3.0, -2.0, 5.0], np.roll(surface.F, 1, axis=1))
    one, two = (membrane_stiffness(s, STEEL, H, elements=HYBRID).toarray() for s in (surface, turned))
    assert np.abs(one - two).max() <= 1e-9 * np.abs(one).max()
    for thin in (1e-3, 1e-6):
        needle = triangles((0.4, thin), (1.2, thin))
        soft, stiff = (membrane_stiffness(needle, STEEL, H, elements=e).diagonal() for e in (HYBRID, QUADRATIC))
        assert np.isfinite(soft).all()
        assert (soft <= stiff * (1 + 1e-6)).all()
        assert (soft >= -1e-12 * stiff.max()).all()


def test_stress_and_energy_are_those_of_the_solution():
    surface = jittered(grid(9, 5, 2.0, 1.0))
    left, right = surface.V[:, 0] < 1e-9, surface.V[:, 0] > 2 - 1e-9
    pulled = 1e4 * right[surface.edges.ends].all(axis=1)[:, None] * np.array([0.3, 1.0, 0.0])
    spread = SpreadLoad.broadcast(surface, edge=pulled)
    load = case(surface, [(left, "xyz")], [(right, (0, 0, 0))])
    load = type(load)(load.fixed, spread.vertex_forces(surface), right)
    answer = solve_statics(SheetModel(surface, STEEL, H), load, Elements("hybrid", "hhj"), spread)
    assert answer.elements == HYBRID
    found = sheet_stress(SheetModel(surface, STEEL, H), HYBRID, answer)
    assert 2 * (found.energy @ surface.areas) == pytest.approx(answer.compliance, rel=1e-9)
    mean = stress(surface, STEEL, answer.u, bubbles=answer.bubbles)
    assert np.abs(found.tensor("middle") - mean).max() <= 1e-9 * np.abs(mean).max()
    # the stress proper is another than the quadratic triangle would have with these displacements
    strain = membrane_strains(surface, answer)
    own, other = (membrane_stresses(surface, STEEL, "plane_stress", e, strain) for e in (HYBRID, QUADRATIC))
    assert np.abs(own - other).max() > 0.02 * np.abs(own).max()
    assert np.abs((own - other).mean(axis=1)).max() <= 1e-9 * np.abs(own).max()


@pytest.mark.parametrize(
    ("name", "mesh", "quadratic", "ours"),
    [
        ("straight_beam_in_plane_trapezoids", "diagonal", 0.964, 0.989),
        ("straight_beam_in_plane_parallelograms", "diagonal", 0.952, 0.986),
        ("straight_beam_in_plane_parallelograms", "union_jack", 0.963, 0.987),
    ],
)
def test_distorted_beams_one_cell_wide_keep_a_third_of_the_quadratic_triangles_error(name, mesh, quadratic, ours):
    """What the quadratic triangle misses is the best that its displacements can do (published for such a triangle with
    six nodes: 0.972 and 0.962); equilibrium inside wins most of it back with the same unknowns."""
    problem = TESTS[name].problem(1, mesh)
    found = [problem.solve(pair) / TESTS[name].reference for pair in (SIX_NODES, BEST)]
    assert found == pytest.approx([quadratic, ours], abs=1e-3)
    assert problem.unknowns(SIX_NODES) == problem.unknowns(BEST)


def test_the_hybrid_triangle_does_not_lock_for_incompressible_sheets():
    """Plane strain at a Poisson's ratio near a half: bent in its plane, the deflection hardly falls behind."""
    surface = jittered(grid(12, 2, 6.0, 1.0))
    left, right = surface.V[:, 0] < 1e-9, surface.V[:, 0] > 6 - 1e-9
    moves = {}
    for poisson in (0.3, 0.4999):
        material = Material(1e9 * (1 - poisson**2), poisson)  # the same bending stiffness in plane strain
        load = case(surface, [(left, "xyz")], [(right, (0, 1e3, 0))])
        moves[poisson] = (
            solve_statics(SheetModel(surface, material, 0.1, "stvk"), load, Elements("hybrid", "hinge"))
            .u[right, 1]
            .mean()
        )
    assert moves[0.4999] == pytest.approx(moves[0.3], rel=0.06)
