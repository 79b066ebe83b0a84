"""Mirrors and turns that are found by themselves: of plane figures, then what turns and what breaks them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab.design.directions import load_axes
from dsfab.diffusion import largest_symmetry, symmetry
from dsfab.surface import LoadCase, Surface
from dsfab.surface.edge_changes import refined_surface
from dsfab.surface.shapes import dome
from tests.shapes import fan, grid, jittered, l_shape, quartered, subsurface

TURN = Rotation.from_euler("xyz", [31, -57, 123], degrees=True).as_matrix()


def pressed(surface: Surface, hold: np.ndarray | None = None) -> LoadCase:
    """Held along its rim, or where told, under loads across the plane z = 0."""
    held = np.zeros(surface.n, bool)
    held[surface.edges.ends[surface.edges.boundary]] = True
    held = held if hold is None else hold
    force = np.outer(surface.vertex_areas, [0.0, 0.0, -1.0])
    return LoadCase(np.repeat(held[:, None], 3, axis=1), force, np.zeros(surface.n, bool))


def refined_fan(corners: np.ndarray, times: int = 3) -> Surface:
    """The triangles from the origin to the sides of a polygon, cut into four so many times."""
    surface = fan(corners)
    for _ in range(times):
        surface = quartered(surface)
    return surface


def polygon(k: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(k) / k + 0.3
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def pinwheel(arms: int = 4) -> Surface:
    """Corners that turn into each other and have no mirror."""
    angle = 2 * np.pi * np.arange(3 * arms) / (3 * arms)
    radius = np.tile([1.0, 2.2, 1.3], arms)
    return refined_fan(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def irregular() -> Surface:
    return refined_fan(np.array([[2.0, 0.1], [0.8, 1.5], [-0.7, 1.1], [-1.6, -0.4], [0.4, -1.2]]))


def paraboloid() -> Surface:
    flat = refined_fan(polygon(6), 4)
    return Surface(np.c_[flat.V[:, :2], 0.4 * (1 - (flat.V[:, :2] ** 2).sum(axis=1))], flat.F)


FIGURES = {
    "rectangle": (lambda: jittered(grid(12, 8, 3.0, 2.0), 0.1), 4, 2),
    "square": (lambda: jittered(grid(12, 12, 2.0, 2.0), 0.1), 8, 4),
    "hexagon": (paraboloid, 12, 6),
    "triangle": (lambda: refined_fan(polygon(3), 4), 6, 3),
    "pinwheel": (pinwheel, 4, 0),
    "three-armed pinwheel": (lambda: pinwheel(3), 3, 0),
    "L": (lambda: l_shape(), 2, 1),
}
"""Surface, elements of its group, and mirrors among them."""


def group(surface: Surface, *loads: LoadCase) -> np.ndarray:
    loads = loads or (pressed(surface),)
    found = largest_symmetry(surface, load_axes(surface, loads[0]), loads)
    return np.eye(3)[None] if found is None else found.R


def same_group(one: np.ndarray, two: np.ndarray) -> bool:
    return len(one) == len(two) and all(np.abs(two - R).max(axis=(1, 2)).min() < 1e-6 for R in one)


@pytest.mark.parametrize("name", list(FIGURES))
def test_plane_figures_have_the_groups_of_the_textbook(name):
    build, order, mirrors = FIGURES[name]
    R = group(build())
    assert len(R) == order
    assert (np.linalg.det(R) < 0).sum() == mirrors
    assert np.abs(R[:, :, 2] - [0, 0, 1]).max() < 1e-6  # loads across the plane: none turns it over
    products = np.einsum("aij,bjk->abik", R, R).reshape(-1, 3, 3)
    assert all(np.abs(R - p).max(axis=(1, 2)).min() < 1e-6 for p in products)


def test_a_plate_in_its_own_plane_is_its_own_mirror_image():
    """With loads in the plane, z = 0 is a mirror as well: of each element there are two. It changes nothing there."""
    plate = grid(12, 8, 3.0, 2.0)
    pull = np.zeros((plate.n, 3))
    for x, sign in ((0.0, -1.0), (3.0, 1.0)):
        pull[np.abs(plate.V[:, 0] - x) < 1e-9, 0] = sign
    free = np.zeros(plate.n, bool)
    assert len(group(plate, LoadCase(np.repeat(free[:, None], 3, axis=1), pull, free))) == 8
    square = grid(12, 12, 2.0, 2.0)
    free = np.zeros(square.n, bool)
    pull = square.V - [1, 1, 0]
    assert len(group(square, LoadCase(np.repeat(free[:, None], 3, axis=1), pull, free))) == 16


def test_an_irregular_surface_has_no_symmetry():
    surface = irregular()
    assert largest_symmetry(surface, load_axes(surface, pressed(surface)), [pressed(surface)]) is None


def test_of_a_round_surface_two_mirrors_are_taken():
    surface = dome(12.0, 4.0, 0.0, 0.6)
    R = group(surface)
    assert len(R) == 4
    assert (np.linalg.det(R) < 0).sum() == 2


def test_maps_are_those_of_the_group():
    surface = FIGURES["square"][0]()
    found = largest_symmetry(surface, load_axes(surface, pressed(surface)), [pressed(surface)])
    centre = surface.areas @ surface.centroids / surface.area
    for R, T in zip(found.R, found.maps, strict=True):
        assert np.abs(T @ surface.V - ((surface.V - centre) @ R.T + centre)).max() < 0.01 * surface.mean_edge


# --- what breaks it


def test_supports_reduce_the_symmetry():
    surface = grid(12, 8, 3.0, 2.0)
    assert len(group(surface, pressed(surface, surface.V[:, 0] < 1e-9))) == 2
    corner = (surface.V[:, 0] < 1e-9) & (surface.V[:, 1] < 0.6)
    assert len(group(surface, pressed(surface, corner))) == 1


def test_loads_reduce_the_symmetry():
    surface = grid(12, 12, 2.0, 2.0)
    whole = pressed(surface)
    for at, order in (((1.5, 1.0), 2), ((1.5, 1.5), 2), ((1.5, 1.2), 1), ((1.0, 1.0), 8)):
        near = np.linalg.norm(surface.V[:, :2] - at, axis=1) < 0.2
        load = LoadCase(whole.fixed, np.outer(near, [0, 0, -1.0]), near)
        assert len(group(surface, load)) == order
    assert len(group(surface, whole, LoadCase(whole.fixed, whole.force + [1e-2, 0, 0], whole.loaded))) == 2


def test_displaced_loads_of_equal_moments_reduce_the_symmetry():
    """Two forces on a diagonal have the resultant and the first moments of two on the other: seen at the full look."""
    surface = grid(12, 12, 2.0, 2.0)
    near = (np.linalg.norm(surface.V[:, :2] - 0.5, axis=1) < 0.2) | (
        np.linalg.norm(surface.V[:, :2] - 1.5, axis=1) < 0.2
    )
    R = group(surface, LoadCase(pressed(surface).fixed, np.outer(near, [0, 0, -1.0]), near))
    assert len(R) == 4
    assert (np.linalg.det(R) < 0).sum() == 2


def test_a_missing_piece_of_the_surface_reduces_the_symmetry():
    surface = grid(24, 16, 3.0, 2.0)
    bitten = subsurface(surface, np.linalg.norm(surface.centroids[:, :2] - [0.5, 0.5], axis=1) > 0.25)
    assert len(group(bitten, pressed(bitten, np.abs(bitten.V[:, 0] - 1.5) > 1.5 - 1e-9))) == 1


# --- invariance


@pytest.mark.parametrize("name", list(FIGURES))
def test_turned_scaled_and_renumbered_figures_have_the_turned_group(name):
    surface = FIGURES[name][0]()
    load, rng = pressed(surface), np.random.default_rng(1)
    shuffle = rng.permutation(surface.n)
    F = np.argsort(shuffle)[surface.F[rng.permutation(surface.m)]]
    turned = Surface(40 * surface.V[shuffle] @ TURN.T + [3, -2, 1], F)
    there = LoadCase(load.fixed[shuffle], load.force[shuffle] @ TURN.T, load.loaded[shuffle])
    assert same_group(group(turned, there), TURN @ group(surface) @ TURN.T)


def irregular_dome() -> Surface:
    """A cap of a sphere of radius 6.5 m in triangles without any symmetry, on an even rim."""
    flat = dome(12.0, 4.0, 0.0, 0.6)
    flat = jittered(Surface(flat.V * [1, 1, 0], flat.F), 0.15)
    return Surface(flat.V + np.outer(np.sqrt(6.5**2 - (flat.V**2).sum(axis=1)) - 2.5, [0, 0, 1]), flat.F)


def test_the_mirrors_of_a_dome_do_not_depend_on_numbers():
    """It is round, so any two would do: of all of them those that suit the mesh best."""
    surface = irregular_dome()
    R = group(surface)
    assert len(R) == 4
    for seed in range(4):
        shuffle = np.random.default_rng(seed).permutation(surface.n)
        assert same_group(group(Surface(surface.V[shuffle], np.argsort(shuffle)[surface.F])), R)


def test_four_times_the_points_are_looked_for_about_four_times_as_often(monkeypatch):
    """A quadratic search would look for 16 times as many images on the surface."""
    looked, tree_of = [0, 0], symmetry.face_tree
    for k, edge in enumerate((0.04, 0.02)):
        surface = refined_surface(grid(20, 20, 2.0, 2.0), edge, False)
        load = pressed(surface)
        axes = load_axes(surface, load)
        tree = tree_of(surface)

        def nearest(V, F, points, k=k, tree=tree):
            looked[k] += len(points)
            return tree.squared_distance(V, F, points)

        monkeypatch.setattr(symmetry, "face_tree", lambda _, found=nearest: SimpleNamespace(squared_distance=found))
        assert largest_symmetry(surface, axes, [load]).order == 8
    assert surface.n > 8_000
    assert 0 < looked[1] < 5 * looked[0]


def test_a_plane_is_refused_after_a_look_at_about_a_hundred_points(monkeypatch):
    """The plate has 2,500 points; without the sample all of them are looked for at each plane and turn that fails."""
    plate, looked = grid(49, 49, 2.0, 1.3), []

    def noted(surface, tree, points, find=symmetry.largest_distance):
        looked.append(len(points))
        return find(surface, tree, points)

    monkeypatch.setattr(symmetry, "largest_distance", noted)
    leaning = Surface(plate.V @ Rotation.from_euler("z", 20, degrees=True).as_matrix().T, plate.F)
    assert largest_symmetry(leaning, np.eye(3), []).order == 4  # mirrored in its own plane and turned by half a turn
    assert 50 < max(looked) < 200
