"""Statics: rigid motions, patch tests, bars and bent strips in closed form; balance, refusals, both solvers."""

import numpy as np
import pytest

from dsfab.core import sparse
from dsfab.core.errors import StaticsError
from dsfab.statics import (
    Equilibrium,
    Material,
    SheetModel,
    bending_stiffness,
    equilibrium,
    flat_axis,
    membrane_stiffness,
    solve_statics,
    stress,
    von_mises,
)
from dsfab.statics.assembly import angle_gradients, hinges
from dsfab.statics.boundary_conditions import rigid_motions
from dsfab.surface import LoadCase, Surface
from tests.shapes import ZOO, grid, jittered, zoo
from tests.statics.load_cases import STEEL, H, case


@zoo
@pytest.mark.parametrize("matrix", ["plane_stress", "stvk", "hinge"])
def test_stiffness_is_symmetric_positive_and_blind_to_rigid_motions(name, matrix):
    surface = ZOO[name]()
    K = bending_stiffness(surface, STEEL, H) if matrix == "hinge" else membrane_stiffness(surface, STEEL, H, matrix)
    scale = np.abs(K.diagonal()).max()
    assert abs(K - K.T).max() <= 1e-12 * scale
    motions = rigid_motions(surface.V).reshape(-1, 6)
    assert np.abs(K @ motions).max() <= 1e-10 * scale
    x = np.random.default_rng(0).normal(size=K.shape[0])
    assert x @ (K @ x) > 0


def test_patch_a_linear_displacement_gives_the_same_stress_on_every_triangle():
    """Patch test [Irons 1966]: u = E x on a jittered plate, E constant, is in equilibrium and its stress exact."""
    surface = jittered(grid(9, 7, 2.0, 1.0))
    strain = np.array([[1e-3, 2e-4, 0], [2e-4, -5e-4, 0], [0, 0, 0]])
    u = surface.V @ strain
    sigma = stress(surface, STEEL, u)
    E, nu = STEEL.young, STEEL.poisson
    xx = E / (1 - nu**2) * (strain[0, 0] + nu * strain[1, 1])
    xy = E / (1 + nu) * strain[0, 1]
    assert np.allclose(sigma[:, 0, 0], xx, rtol=1e-10)
    assert np.allclose(sigma[:, 0, 1], xy, rtol=1e-10)
    assert np.abs(sigma[:, 2]).max() <= 1e-9 * xx
    inner = np.setdiff1d(np.arange(surface.n), surface.edges.ends[surface.edges.boundary])
    residual = (membrane_stiffness(surface, STEEL, H) @ u.ravel()).reshape(-1, 3)[inner]
    assert np.abs(residual).max() <= 1e-9 * E * H * 1e-3


@pytest.mark.parametrize("law", ["plane_stress", "stvk"])
def test_uniaxial_bar_lengthens_by_the_closed_form(law):
    """sigma = F / (w h); strain = sigma / E in plane stress, sigma (1 - nu^2) / E in plane strain (the `stvk` law)."""
    length, width, force = 3.0, 0.5, 1e5
    surface = jittered(grid(24, 4, length, width))
    left, right = surface.V[:, 0] < 1e-9, surface.V[:, 0] > length - 1e-9
    corner = left & (surface.V[:, 1] < 1e-9)
    # consistent end load: half a share at the two corners of the loaded edge
    load = case(surface, [(left, "x"), (corner, "y")])
    share = np.where(right, 1.0, 0.0)
    share[right & ((surface.V[:, 1] < 1e-9) | (surface.V[:, 1] > width - 1e-9))] = 0.5
    f = np.outer(share / share.sum(), [force, 0, 0])
    answer = solve_statics(SheetModel(surface, STEEL, H, law), LoadCase(load.fixed, f, right))
    modulus = STEEL.young if law == "plane_stress" else STEEL.young / (1 - STEEL.poisson**2)
    expected = force * length / (modulus * width * H)
    assert answer.u[right, 0] == pytest.approx(expected, rel=1e-9)
    assert answer.compliance == pytest.approx(force * expected, rel=1e-9)
    sigma = stress(surface, STEEL, answer.u, law)
    assert von_mises(sigma) == pytest.approx(force / (width * H), rel=1e-8)
    assert answer.reaction.sum(axis=0) == pytest.approx([-force, 0, 0], abs=1e-6 * force)


def test_hinge_angle_gradient_is_the_derivative_of_the_angle():
    surface = ZOO["saddle"]()
    hinge = hinges(surface)
    gradients, _ = angle_gradients(surface, hinge)

    def angle(V):
        p = V[hinge]
        edge = p[:, 1] - p[:, 0]
        n2, n3 = np.cross(edge, p[:, 2] - p[:, 0]), np.cross(p[:, 3] - p[:, 0], edge)
        unit = edge / np.linalg.norm(edge, axis=1, keepdims=True)
        return -np.arctan2(np.einsum("ij,ij->i", np.cross(n2, n3), unit), np.einsum("ij,ij->i", n2, n3))

    step = 1e-6 * np.random.default_rng(1).normal(size=surface.V.shape)
    numeric = (angle(surface.V + step) - angle(surface.V - step)) / 2
    analytic = np.einsum("ikc,ikc->i", gradients, step[hinge])
    assert np.abs(numeric - analytic).max() <= 1e-6 * np.abs(analytic).max()


@pytest.mark.parametrize(("staggered", "axis"), [(False, 0), (False, 1), (True, 1)])
def test_hinge_energy_of_cylindrical_bending_misses_only_half_a_row_at_the_free_edges(staggered, axis):
    """w = x^2 / 2: the plate's energy is D / 2 a square metre; hinges at `rows` rows give exactly 1 - 1/rows of it."""
    for rows in (8, 16, 32):
        surface = grid(rows * 7 // 8 if staggered else rows, rows, 1.0, 1.0, staggered)
        u = np.zeros((surface.n, 3))
        u[:, 2] = surface.V[:, axis] ** 2 / 2
        energy = u.ravel() @ (bending_stiffness(surface, STEEL, H) @ u.ravel()) / 2
        assert energy / (STEEL.bending_stiffness(H) * surface.area / 2) == pytest.approx(1 - 1 / rows, rel=1e-8)


def test_flat_sheets_loaded_in_their_plane_are_solved_in_the_plane():
    surface = grid(8, 4, 2.0, 1.0)
    left, right = surface.V[:, 0] < 1e-9, surface.V[:, 0] > 2 - 1e-9
    in_plane = case(surface, [(left, "xy")], [(right, (0, -1e3, 0))])
    across = case(surface, [(left, "xyz")], [(right, (0, 0, -1e3))])
    assert flat_axis(surface, in_plane) == 2
    assert flat_axis(surface, across) is None
    assert np.all(solve_statics(SheetModel(surface, STEEL, H), in_plane).u[:, 2] == 0)


@pytest.mark.parametrize("solver", ["PARDISO", "SuperLU"])
def test_reactions_balance_loads_with_either_solver(solver, monkeypatch):
    if solver == "PARDISO":
        pytest.importorskip("pypardiso", reason="the optional solver is not installed")
    monkeypatch.setattr(sparse, "solver_name", lambda: solver)
    surface = ZOO["dome"]()
    base = surface.V[:, 2] < 1e-9
    top = surface.V[:, 2] > 0.9 * surface.V[:, 2].max()
    answer = solve_statics(SheetModel(surface, STEEL, H), case(surface, [(base, "xyz")], [(top, (300, -200, -1e4))]))
    assert answer.imbalance < 1e-9
    assert answer.reaction.sum(axis=0) == pytest.approx([-300, 200, 1e4], rel=1e-8)
    assert np.all(answer.reaction[~base] == 0)
    assert answer.compliance > 0
    assert answer.largest_displacement == pytest.approx(np.linalg.norm(answer.u, axis=1).max())


def test_both_solvers_agree_and_each_repeats_itself_bit_for_bit(monkeypatch):
    pytest.importorskip("pypardiso", reason="the optional solver is not installed")
    surface = ZOO["dome"]()
    load = case(surface, [(surface.V[:, 2] < 1e-9, "xyz")], [(surface.V[:, 2] > 0.9, (0, 0, -1e4))])
    u = {}
    for solver in ("PARDISO", "SuperLU"):
        monkeypatch.setattr(sparse, "solver_name", lambda name=solver: name)
        u[solver] = solve_statics(SheetModel(surface, STEEL, H), load).u
        assert np.array_equal(u[solver], solve_statics(SheetModel(surface, STEEL, H), load).u)
    assert np.abs(u["PARDISO"] - u["SuperLU"]).max() <= 1e-9 * np.abs(u["PARDISO"]).max()


def test_statics_are_linear_and_scale_with_the_sheet():
    """Doubling the load doubles u; a membrane problem at twice the thickness moves half as much."""
    surface = jittered(grid(10, 5, 2.0, 1.0))
    left, right = surface.V[:, 0] < 1e-9, surface.V[:, 0] > 2 - 1e-9
    once = solve_statics(SheetModel(surface, STEEL, H), case(surface, [(left, "xy")], [(right, (1, 2, 0))]))
    twice = solve_statics(SheetModel(surface, STEEL, H), case(surface, [(left, "xy")], [(right, (2, 4, 0))]))
    thick = solve_statics(SheetModel(surface, STEEL, 2 * H), case(surface, [(left, "xy")], [(right, (1, 2, 0))]))
    assert np.allclose(twice.u, 2 * once.u, rtol=1e-9)
    assert np.allclose(thick.u, once.u / 2, rtol=1e-9, atol=1e-9 * np.abs(once.u).max())


@pytest.mark.parametrize(
    ("fixed", "says"),
    [
        ([], "no vertex of the surface is supported"),
        ([("corner", "xyz")], "turn about"),
        ([("left", "x")], "move along"),
        ([("left", "yz")], "move along x"),
        ([("corner", "xyz"), ("far corner", "xyz")], "turn about"),
    ],
)
def test_mechanisms_are_refused_by_name(fixed, says):
    surface = ZOO["saddle"]()
    low = surface.V[:, 0] <= surface.V[:, 0].min() + 1e-9
    spots = {
        "corner": np.arange(surface.n) == surface.V[:, :2].sum(axis=1).argmin(),
        "far corner": np.arange(surface.n) == surface.V[:, :2].sum(axis=1).argmax(),
        "left": low,
    }
    load = case(surface, [(spots[where], axes) for where, axes in fixed], [(~low, (0, 0, -1.0))])
    with pytest.raises(StaticsError, match=says):
        solve_statics(SheetModel(surface, STEEL, H), load)


def test_a_piece_without_support_is_refused_with_its_place():
    one = grid(3, 3, 1.0, 1.0)
    two = Surface(np.concatenate([one.V, one.V + [5, 0, 0]]), np.concatenate([one.F, one.F + one.n]))
    load = case(two, [(two.V[:, 0] < 1e-9, "xyz")], [(two.V[:, 0] > 5.9, (0, 0, -1.0))])
    with pytest.raises(StaticsError, match=r"1 of 2 pieces of the surface touch no support.*5\.5"):
        solve_statics(SheetModel(two, STEEL, H), load)


def test_a_load_on_a_vertex_without_faces_is_refused():
    one = grid(3, 3, 1.0, 1.0)
    surface = Surface(np.concatenate([one.V, [[9, 9, 9]]]), one.F)
    lonely = np.arange(surface.n) == surface.n - 1
    load = case(surface, [(surface.V[:, 0] < 0.4, "xyz")], [(lonely, (0, 0, -1.0))])
    with pytest.raises(StaticsError, match="1 loaded vertices belong to no face"):
        solve_statics(SheetModel(surface, STEEL, H), load)


def test_two_strips_that_meet_in_one_point_are_a_mechanism_and_not_a_large_number():
    one = grid(3, 3, 1.0, 1.0)
    moved = one.F + one.n
    moved[moved == one.n] = one.n - 1  # the second grid's first corner is the first grid's last
    surface = Surface(np.concatenate([one.V, one.V + [1, 1, 0]]), moved := np.concatenate([one.F, moved]))
    load = case(surface, [(surface.V[:, 0] < 1e-9, "xyz")], [(surface.V[:, 0] > 1.9, (0, 0, -1.0))])
    with pytest.raises(StaticsError, match="pieces of the surface touch no support"):
        solve_statics(SheetModel(surface, STEEL, H), load)


@pytest.mark.parametrize(
    ("values", "says"),
    [((0, 0.3, 1), "young"), ((1e9, 0.5, 1), "poisson"), ((1e9, -1, 1), "poisson"), ((1, 0, -1), "density")],
)
def test_impossible_materials_are_refused(values, says):
    with pytest.raises(StaticsError, match=says):
        Material(*values)


def test_equilibrium_refuses_a_solution_that_does_not_balance():
    surface = grid(3, 3, 1.0, 1.0)
    K = membrane_stiffness(surface, STEEL, H)
    K.data = K.data * (1 + 0.2 * np.random.default_rng(0).normal(size=K.data.shape))  # not a stiffness any more
    K = K @ K.T
    load = case(surface, [(surface.V[:, 0] < 1e-9, "xy")], [(surface.V[:, 0] > 0.9, (1.0, 0, 0))])
    with pytest.raises(StaticsError, match="loads and reactions differ"):
        equilibrium(surface, K, load)


def test_equilibrium_is_frozen():
    answer = Equilibrium(np.zeros((4, 3)), np.zeros((4, 3)), 0.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        answer.u[0] = 1


def test_a_material_is_isotropic_to_the_last_bit():
    """No shear from stretching, nor the reverse; a plate has E h^3 / (12 (1 - nu^2)) = 10.92 x 8 / 10.92."""
    for law in ("plane_stress", "stvk"):
        C = Material(2.1e11, 0.3).membrane(law)
        assert not C[[0, 1, 2, 2], [2, 2, 0, 1]].any()
    assert Material(10.92, 0.3).bending_stiffness(2.0) == pytest.approx(8, rel=1e-14)
