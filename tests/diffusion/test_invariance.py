"""The picture turns, grows and is renumbered with the surface, and changes by nothing but rounding."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab.design.directions import load_axes
from dsfab.diffusion import diffusion_modes, diffusion_operator, diffusion_tensors, reference_axes
from dsfab.statics import Material, SheetModel, solve_statics, stress
from dsfab.surface import LoadCase, Surface
from dsfab.surface.fields import voronoi_mass
from tests.shapes import grid, jittered, lifted, sphere

TURNS = [
    Rotation.from_euler("xyz", angles, degrees=True).as_matrix() for angles in ([0, 0, 90], [180, 0, 0], [31, -57, 123])
]


def lopsided() -> tuple[Surface, LoadCase]:
    """A vault without symmetry, held along one edge and a part of another, under its weight and a leaning force."""
    surface = lifted(lambda x, y: 0.4 * x * (1.3 - x) + 0.1 * y**2 * x, 14)
    held = (surface.V[:, 0] < 1e-9) | ((surface.V[:, 0] > 1 - 1e-9) & (surface.V[:, 1] < 0.4))
    force = np.outer(surface.vertex_areas, [0, 0, -10.0])
    loaded = np.linalg.norm(surface.V - surface.V[surface.n * 4 // 5], axis=1) < 0.15
    force[loaded] += [1.0, 2.0, -6.0]
    return surface, LoadCase(np.repeat(held[:, None], 3, axis=1), force, loaded)


def symmetric_vault() -> tuple[Surface, LoadCase]:
    """A vault with two mirrors, held at both ends and pressed: nothing tells left from right."""
    plate = grid(16, 8, 2.0, 1.0)
    V = plate.V - [1, 0.5, 0]
    plate = Surface(np.c_[V[:, :2], 0.3 * (1 - V[:, 0] ** 2)], plate.F)
    held = np.abs(plate.V[:, 0]) > 1 - 1e-9
    return plate, LoadCase(
        np.repeat(held[:, None], 3, axis=1), np.outer(plate.vertex_areas, [0, 0, -1.0]), np.zeros(plate.n, dtype=bool)
    )


def modes_of(surface: Surface, load: LoadCase, thickness: float = 0.02, k: int = 5):
    """Both families, each (n, k), and their eigenvalues, from statics on."""
    steel = Material(210e9, 0.3)
    answer = solve_statics(SheetModel(surface, steel, thickness), load)
    sigma = stress(surface, steel, answer.u)
    tensors = diffusion_tensors(surface, sigma)
    axes = load_axes(surface, load)
    found = [diffusion_modes(surface, diffusion_operator(surface, D), k, axes) for D in (tensors.major, tensors.minor)]
    return np.stack([modes.X for modes in found]), np.stack([modes.lam for modes in found])


@pytest.fixture(scope="module")
def picture():
    return modes_of(*lopsided())


@pytest.mark.parametrize("turn", TURNS)
def test_turning_the_design_turns_its_picture(picture, turn):
    surface, load = lopsided()
    turned = Surface(surface.V @ turn.T + [3, -2, 1], surface.F)
    X, lam = modes_of(turned, LoadCase(load.fixed, load.force @ turn.T, load.loaded))
    assert lam == pytest.approx(picture[1], rel=1e-7)
    assert np.abs(X - picture[0]).max() < 1e-6


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_size_of_the_surface_does_not_change_the_pattern(picture, scale):
    surface, load = lopsided()
    X, lam = modes_of(Surface(surface.V * scale, surface.F), load, 0.02 * scale)
    assert lam * scale**2 == pytest.approx(picture[1], rel=1e-7)
    assert np.abs(X - picture[0]).max() < 1e-6


def test_vertex_numbers_do_not_change_the_pattern(picture):
    surface, load = lopsided()
    rng = np.random.default_rng(3)
    shuffle = rng.permutation(surface.n)
    F = np.roll(np.argsort(shuffle)[surface.F][rng.permutation(surface.m)], 1, axis=1)
    mixed = LoadCase(load.fixed[shuffle], load.force[shuffle], load.loaded[shuffle])
    X, lam = modes_of(Surface(surface.V[shuffle], F), mixed)
    assert lam == pytest.approx(picture[1], rel=1e-7)
    assert np.abs(X - picture[0][:, shuffle]).max() < 1e-6


@pytest.mark.parametrize("turn", TURNS)
def test_a_symmetric_design_turns_with_the_surface_up_to_its_symmetry(turn):
    """Each mode is even or odd in x and in y; where it is odd, which end is positive is free."""
    vault, load = symmetric_vault()
    X, _ = modes_of(vault, load)
    Y, _ = modes_of(Surface(vault.V @ turn.T, vault.F), LoadCase(load.fixed, load.force @ turn.T, load.loaded))
    here = {tuple(p): i for i, p in enumerate(vault.V.round(6).tolist())}
    images = [[here[tuple(p)] for p in (vault.V * s).round(6).tolist()] for s in ([1, 1, 1], [-1, 1, 1], [1, -1, 1])]
    images.append([images[1][i] for i in images[2]])
    images = [np.array(image) for image in images]
    for before, after in zip(
        X.transpose(0, 2, 1).reshape(-1, vault.n), Y.transpose(0, 2, 1).reshape(-1, vault.n), strict=True
    ):
        assert min(np.abs(after[image] - before).max() for image in images) < 1e-6


def test_the_basis_of_a_repeated_eigenvalue_follows_the_load():
    """lambda = 2 on the unit sphere three times: the first mode points along the load, wherever that is."""
    ball = sphere(4)
    L = diffusion_operator(ball, diffusion_tensors(ball, np.zeros((ball.m, 3, 3))).major)
    for load, other in (([0.0, 0.6, 0.8], [1.0, 0, 0]), ([0.6, 0.0, -0.8], [0.0, 1.0, 0])):
        axes = reference_axes(ball, vectors=(np.array(load), np.array(other)))
        X = diffusion_modes(ball, L, 3, axes).X
        expected = ball.V @ np.stack([load, other, np.cross(load, other)], axis=1) * np.sqrt(3 / (4 * np.pi))
        assert np.abs(X - expected).max() < 1e-3


def test_axes_are_those_of_inertia_and_turn_with_the_surface():
    wedge = lifted(lambda x, y: 0.3 * x * (1 - x) * (1 + y))
    base = reference_axes(wedge)
    assert base @ base.T == pytest.approx(np.eye(3))
    assert np.linalg.det(base) == pytest.approx(1)
    for turn in TURNS:
        assert reference_axes(Surface(wedge.V @ turn.T, wedge.F)) == pytest.approx(base @ turn.T, abs=1e-9)
    lone = reference_axes(wedge, vectors=(np.array([0, 0, -5.0]),))
    assert lone[0] == pytest.approx([0, 0, -1])


def test_axes_see_supports_and_loads_where_the_shape_is_symmetric():
    plate = jittered(grid(12, 12, 1.0, 1.0), 0.0)
    end = (plate.V[:, 1] > 1 - 1e-9).astype(float)
    for turn in TURNS:
        axes = reference_axes(Surface(plate.V @ turn.T, plate.F), (end,))
        assert axes[0] == pytest.approx(turn[:, 1], abs=1e-9)
    assert reference_axes(sphere(2)) == pytest.approx(np.eye(3))
    assert voronoi_mass(plate) @ end > 0


@pytest.mark.parametrize("turn", TURNS)
def test_repeated_eigenvalues_turn_with_load_and_supports(turn):
    """On the sphere at r = 1 the surface says nothing: load and supports alone choose among all bases."""
    ball = sphere(3)
    pressed = ball.V @ [0.6, 0.64, 0.48] > 0.9
    held = ball.V[:, 0] < -0.8
    found = []
    for R in (np.eye(3), turn):
        surface = Surface(ball.V @ R.T, ball.F)
        force = np.where(pressed[:, None], R @ [-0.6, -0.64, -0.48], 0.0)
        axes = load_axes(surface, LoadCase(np.repeat(held[:, None], 3, axis=1), force, pressed))
        L = diffusion_operator(surface, diffusion_tensors(surface, np.zeros((surface.m, 3, 3))).major)
        found.append(diffusion_modes(surface, L, 8, axes).X)
    assert np.abs(found[1] - found[0]).max() < 1e-6


def plain_operator(surface: Surface):
    return diffusion_operator(surface, diffusion_tensors(surface, np.zeros((surface.m, 3, 3)), r=1).major)


@pytest.mark.parametrize(("longer", "along"), [(3.5e-7, 0), (7e-7, 1)])
def test_modes_of_a_plate_that_is_square_but_for_rounding_follow_the_axes(longer, along):
    """Its second side is longer by a share; eigenvalues, which go with the square, are equal within a millionth."""
    plate = grid(8, 8, 1.0, 1 + longer)
    x = (plate.V - plate.V.mean(axis=0)).T @ diffusion_modes(plate, plain_operator(plate), 1).X[:, 0]
    assert int(np.abs(x).argmax()) == along


@pytest.mark.parametrize(("taper", "sign"), [(0.007, -1), (0.014, 1)])
def test_the_sign_of_a_mode_follows_its_skew_if_that_is_clear_and_else_the_axes(taper, sign):
    """On a plate that tapers, the skew of the first mode is as large as the taper; the axes turn by 180 degrees."""
    plate = grid(12, 6, 2.0, 1.0)
    V = plate.V - [1, 0.5, 0]
    plate = Surface(np.c_[V[:, 0], V[:, 1] * (1 + taper * V[:, 0]), V[:, 2]], plate.F)
    axes = np.eye(3), np.diag([-1.0, -1.0, 1.0])
    one, two = (diffusion_modes(plate, plain_operator(plate), 1, each).X[:, 0] for each in axes)
    assert np.sign(one @ two) == sign
