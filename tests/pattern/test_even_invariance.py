"""Evenly spaced stripes turn, grow and are renumbered with the surface; and on a symmetric mesh they are symmetric."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab import load_preset
from dsfab.design import draft
from dsfab.design.stripe_pattern import kept_regions
from dsfab.surface import LoadCase, Surface
from tests.designs import sliced
from tests.pattern.loaded_cases import CASES, TURN, Case, case, difference, on_rim, supported
from tests.shapes import grid

QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


every = pytest.mark.parametrize("name", list(CASES))


@pytest.mark.slow
@every
@pytest.mark.parametrize("turn", [QUARTER, TURN])
def test_turning_the_design_turns_its_stripes(name, turn):
    given = case(name)
    surface = Surface(given.surface.V @ turn.T + [3, -2, 1], given.surface.F)
    load = LoadCase(given.load.fixed, given.load.force @ turn.T, given.load.loaded)
    assert difference(given, Case(surface, load, given.spacing)) < 1e-5


@every
@pytest.mark.parametrize("scale", [0.01, 40.0])
def test_stripes_grow_with_the_design(name, scale):
    given = case(name)
    load = LoadCase(given.load.fixed, given.load.force * scale**2, given.load.loaded)
    spacing = given.spacing[0] * scale, given.spacing[1] * scale
    assert difference(given, Case(Surface(scale * given.surface.V, given.surface.F), load, spacing)) < 1e-5


@every
def test_numbering_changes_no_stripe(name):
    given, rng = case(name), np.random.default_rng(3)
    shuffle, faces = rng.permutation(given.surface.n), rng.permutation(given.surface.m)
    F = np.roll(np.argsort(shuffle)[given.surface.F[faces]], 1, axis=1)
    load = LoadCase(given.load.fixed[shuffle], given.load.force[shuffle], given.load.loaded[shuffle])
    mixed = Case(Surface(given.surface.V[shuffle], F), load, given.spacing)
    limit = 0.01 if name == "globe" else 0.002  # at its poles the directions of both mirrors are as good
    assert difference(given, mixed, np.argsort(faces)) < limit


@every
def test_the_same_bytes_again(name):
    one, two = case(name).even, CASES[name]().even
    for a, b in zip(one.phases, two.phases, strict=True):
        assert np.array_equal(a.value, b.value)
        assert np.array_equal(a.shift, b.shift)
    assert np.array_equal(one.chart.z, two.chart.z)
    assert np.array_equal(one.slope, two.slope)


@every
def test_the_compared_patterns_have_stripes_of_the_requested_spacing(name):
    """What the tests above compare is not nothing."""
    given = case(name)
    share = given.surface.areas @ given.material / given.surface.area
    assert 0.35 < share < 0.55
    for k, spacing in enumerate(given.spacing):
        mean = given.surface.vertex_areas @ given.even.density[:, k] / given.surface.area
        assert mean == pytest.approx(1 / spacing, rel=0.25)


# --- symmetric designs on symmetric meshes


def union_jack(cells: int, height) -> Surface:
    """z = height(x, y) over a square of half side 1, in a mesh with all mirrors of the square."""
    flat = grid(2 * cells, 2 * cells, 2.0, 2.0)
    x, y = flat.V[:, 0] - 1, flat.V[:, 1] - 1
    return Surface(np.c_[5 * x, 5 * y, height(x, y)], flat.F)


def hexagon(cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y and faces of equal triangles in a hexagon of side 1."""
    every = [(i, j) for i in range(-cells, cells + 1) for j in range(-cells, cells + 1)]
    number = {place: k for k, place in enumerate(place for place in every if abs(sum(place)) <= cells)}
    a, b = np.array(list(number)).T
    steps = (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
    faces = [[number.get((i + p, j + q), -1) for p, q in step] for i, j in every for step in steps]
    return (a + b / 2) / cells, b * np.sqrt(3) / 2 / cells, np.array([f for f in faces if min(f) >= 0])


def three_mirrors() -> Case:
    """A hexagonal roof of which every other side is higher: three mirrors, turned, and thirds of a turn."""
    x, y, F = hexagon(14)
    z = 3 * (1 - x**2 - y**2) + 0.6 * (x**3 - 3 * x * y**2)
    turned = np.c_[5 * x, 5 * y, z] @ Rotation.from_euler("z", 0.3).as_matrix().T
    surface = Surface(turned, F)
    return Case(surface, supported(surface, on_rim(surface)), (0.8, 0.5))


def one_mirror() -> Case:
    """A seat with a back, wider there, held in front: the same on its left and on its right only."""
    flat = grid(24, 24, 2.0, 2.0)
    x, y = flat.V[:, 0] - 1, flat.V[:, 1] - 1
    surface = Surface(np.c_[4 * x * (1 + 0.8 * y), 5 * y, 2.5 * np.maximum(y, -0.2) ** 2 + 0.5 * (1 - x**2)], flat.F)
    return Case(surface, supported(surface, y < -1 + 1e-9), (0.7, 0.45))


@pytest.mark.parametrize(("make", "order"), [(three_mirrors, 6), (one_mirror, 2)])
def test_halved_stripes_of_a_symmetric_mesh_are_symmetric(make, order):
    """Levels, densities and material at all images are the same to rounding."""
    given = make()
    even, surface = given.even, given.surface
    symmetry = even.symmetry
    assert symmetry is not None
    assert symmetry.order == order
    assert any(wanted and 0.01 < surface.areas @ wanted[0] / surface.area < 0.99 for wanted in even.wanted)  # halved
    for T, face in zip(symmetry.maps, symmetry.faces, strict=True):
        assert T.nnz == surface.n  # the mesh has it too
        for k in (0, 1):
            z = np.cos(2 * np.pi * even.phases[k].value)
            assert T @ z == pytest.approx(z, abs=1e-9)
            assert T @ even.density[:, k] == pytest.approx(even.density[:, k], rel=1e-9)
            assert all(wanted[face] == pytest.approx(wanted, abs=1e-9) for wanted in even.wanted[k])
        assert given.material[face] == pytest.approx(given.material, abs=1e-9)


@pytest.mark.slow
def test_widths_are_symmetric_even_if_faces_have_no_images():
    """The vertices of the shipped dome have images, not all of its faces: their slopes alone differ by 2 %."""
    made = sliced(load_preset("dome"))
    even = made.pattern.even
    assert even.symmetry.order == 4
    for T in even.symmetry.maps:
        assert T.nnz == made.surface.n
        for values in (even.slope, even.density, made.pattern.half_width("minor")):
            assert T @ values == pytest.approx(values, rel=1e-9)


@pytest.mark.slow
def test_kept_regions_are_symmetric_on_a_mesh_without_mirrors():
    """Caps of the globe are picked to an edge of a mesh without its mirrors."""
    made = draft(load_preset("globe", {"surface.edge": 0.07}))
    symmetry, load = made.pattern.even.symmetry, made.statics.load
    (own,) = kept_regions(made.preset, made.surface, load)
    (kept,) = kept_regions(made.preset, made.surface, load, made.pattern.even)
    assert (kept.field >= own.field).all()
    apart = []
    for layer in (own, kept):
        inside = layer.field > layer.levels[0]
        off = [made.surface.vertex_areas @ ((T @ layer.field > layer.levels[0]) != inside) for T in symmetry.maps]
        apart.append(max(off) / made.surface.area)
    assert apart[1] < 0.35 * apart[0]


SYMMETRIC = {
    "grid dome": (lambda x, y: 3 * (1 - x**2) * (1 - y**2), (1.1, 0.8), 8),
    "vault": (lambda x, y: 2 * (1 - x**2), (1.1, 0.7), 4),
    "hypar": (lambda x, y: 1.5 * (x**2 - y**2), (1.0, 0.8), 4),
}


@pytest.mark.parametrize("name", list(SYMMETRIC))
@pytest.mark.parametrize("axis", [0, 1])
def test_stripes_of_a_symmetric_mesh_are_symmetric(name, axis):
    """Phases at images of vertices agree up to sign and period, and the material of both halves is the same."""
    height, spacing, _ = SYMMETRIC[name]
    surface = union_jack(11, height)
    held = np.abs(surface.V[:, 0]) > 5 - 1e-9 if name == "vault" else on_rim(surface)
    given = Case(surface, supported(surface, held), spacing)
    mirror = np.ones(3)
    mirror[axis] = -1
    image = np.linalg.norm(surface.V[:, None] - surface.V * mirror, axis=2).argmin(axis=1)
    for phase in given.even.phases:
        z = np.cos(2 * np.pi * phase.value)
        assert z[image] == pytest.approx(z, abs=1e-9)
    faces = np.linalg.norm(surface.centroids[:, None] - surface.centroids * mirror, axis=2).argmin(axis=1)
    assert surface.areas @ np.abs(given.material[faces] - given.material) / surface.area < 1e-9
    left = surface.centroids[:, axis] < 0
    sides = [surface.areas[half] @ given.material[half] for half in (left, ~left)]
    assert sides[0] == pytest.approx(sides[1], rel=1e-9)
