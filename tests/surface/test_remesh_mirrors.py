"""Remeshing on one side of a surface's mirrors: the others are its images, and what has no mirror is made at once."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dsfab.surface import SizeField, Surface, generated_group, mirror, remeshed_surface, round_axis
from dsfab.surface.remesh.mirrors import Chamber, Mirrors
from dsfab.surface.remesh.smoothing import NearestOnSurface
from tests.shapes import grid, jittered, smallest_angle, sphere
from tests.surface.needles import check_kept, cone_of_needles

DIAGONAL = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
X, Y, _ = np.eye(3)


def centred_roof(height, length: float = 2.0, cells: int = 16, jitter: float = 0.0) -> Surface:
    """z = height(x, y) over a rectangle of 2 m width about the origin; jitter moves inner vertices on it."""
    flat = jittered(grid(cells, cells, length, 2.0), jitter)
    x, y = (flat.V[:, :2] - [length / 2, 1]).T
    return Surface(np.c_[x, y, height(x, y)], flat.F)


VAULT = centred_roof(lambda x, y: 0.5 * (1 - y**2) * (1 + 0.2 * x**2), length=3.0)
SADDLE = centred_roof(lambda x, y: 0.4 * x * y)
UMBRELLA = centred_roof(lambda x, y: np.maximum(np.abs(x), np.abs(y)) * 0.5)
SCATTERED = centred_roof(lambda x, y: 0.4 * (1 - x**2 - y**2), jitter=0.2)


def off(surface: Surface, normal: np.ndarray, centre: np.ndarray) -> float:
    """The largest distance of the vertices' images from the vertices, metres."""
    return float(cKDTree(surface.V).query((surface.V - centre) @ mirror(normal) + centre)[0].max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "normals", "sides"),
    [(VAULT, [X, Y], 4), (SADDLE, [DIAGONAL], 4), (UMBRELLA, [X, Y, DIAGONAL], 8), (SCATTERED, [X, DIAGONAL], 8)],
)
@pytest.mark.parametrize("smooth", [True, False])
def test_a_mesh_of_a_symmetric_surface_is_symmetric(old, normals, sides, smooth):
    """Also where the file's own is not, as with one diagonal in each square or with scattered vertices."""
    edge = 0.1
    mirrors = Mirrors.from_surface(NearestOnSurface(old), edge, smooth)
    assert mirrors is not None
    assert len(mirrors.group) == sides
    new = remeshed_surface(old, edge, smooth=smooth)
    exact = 1e-9 if smooth else 0.05 * edge  # on facets, which are no images of each other
    assert max(off(new, normal, mirrors.centre) for normal in normals) < exact
    assert new.V.max(axis=0) == pytest.approx(old.V.max(axis=0), abs=edge / 50)
    if not smooth and old is not SCATTERED:  # whose top is beside its middle
        check_kept(old, new, edge)


def test_creases_and_borders_of_mirrored_sides_stay():
    check_kept(UMBRELLA, remeshed_surface(UMBRELLA, 0.1), 0.1)
    closed = sphere(3)
    new = remeshed_surface(closed, 0.12, smooth=True)
    assert new.is_closed
    assert np.linalg.norm(new.V, axis=1) == pytest.approx(1, abs=2e-3)


def with_hole(plate: Surface, face: int) -> Surface:
    """A small hole in one face, near to its first corner, where no image of a vertex or of a centroid lies."""
    corners = plate.V[plate.F[face]]
    inner = corners[0] + 0.3 * (corners.mean(axis=0) - corners[0]) + 0.1 * (corners - corners.mean(axis=0))
    (a, b, c), (p, q, r) = plate.F[face], plate.n + np.arange(3)
    around = [[a, b, q], [a, q, p], [b, c, r], [b, r, q], [c, a, p], [c, p, r]]  # inner = p, q, r beside a, b, c
    return Surface(np.r_[plate.V, inner], np.r_[np.delete(plate.F, face, axis=0), around])


def test_a_leaning_or_one_sidedly_holed_surface_has_no_mirror():
    bent = UMBRELLA.V.copy()
    bent[:, 2] += 0.02 * UMBRELLA.V[:, 0] + 0.05 * UMBRELLA.V[:, 0] ** 2 * UMBRELLA.V[:, 1]
    assert Mirrors.from_surface(NearestOnSurface(Surface(bent, UMBRELLA.F)), 0.1, smooth=False) is None
    plate = grid(4, 3, 2.0, 1.3)
    assert Mirrors.from_surface(NearestOnSurface(plate), 0.1, smooth=False) is not None
    assert Mirrors.from_surface(NearestOnSurface(with_hole(plate, 2)), 0.1, smooth=False) is None


def test_lengths_that_are_given_may_differ_from_side_to_side():
    x = VAULT.V[:, 0]
    new = remeshed_surface(VAULT, 0.15, sizes=[SizeField(VAULT, np.where(x < 0, 0.15, 0.08))])
    left, right = ((side * new.V[:, 0] > 0).sum() for side in (-1, 1))
    assert right > 1.5 * left


def test_a_round_surface_has_two_mirrors():
    dome = Mirrors.from_surface(NearestOnSurface(cone_of_needles(64)), 0.5, smooth=False)
    assert dome is not None
    assert len(dome.group) == 4
    assert abs(dome.normals[0] @ dome.normals[1]) < 1e-9


@pytest.mark.parametrize(("half_width", "halves"), [(1.3, False), (1.6, True)])
def test_mirrors_halve_the_angle_of_a_tip_only_if_twenty_degrees_remain(half_width, halves):
    tip = Surface([[0, 0, 0], [4, -half_width, 0], [4, half_width, 0]], [[0, 1, 2]])
    assert Mirrors.from_surface(NearestOnSurface(tip), 0.12, smooth=False) is not None
    assert (smallest_angle(remeshed_surface(tip, 0.12)) < 25) == halves


def test_a_side_is_cut_out_along_the_planes():
    mirrors = Mirrors.from_surface(NearestOnSurface(SADDLE), 0.1, smooth=False)
    chamber = Chamber.from_mirrors(SADDLE, mirrors, 0.1)
    assert 4 * chamber.piece.area == pytest.approx(SADDLE.area, rel=1e-3)
    whole, of = chamber.all_sides(chamber.piece.V, chamber.piece.F)
    assert whole.area == pytest.approx(4 * chamber.piece.area)
    assert len(whole.loops) == 1
    assert of.max() == chamber.piece.n - 1
    assert (whole.normals[:, 2] > 0).all()
    assert chamber.all_sides(chamber.piece.V + [0.02, 0.01, 0], chamber.piece.F) is None  # a gap along the planes


def turn(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_a_group_may_be_as_large_as_that_of_an_icosahedron_and_twice_as_large():
    golden = (1 + 5**0.5) / 2
    normals = [[1, 0, 0], [0, 1, 0], [0, 0, 1], np.array([golden, 1, 1 / golden]) / 2]
    assert len(generated_group([mirror(np.array(normal)) for normal in normals])) == 120
    assert len(generated_group([turn(360 / 240)])) == 240
    with pytest.raises(OverflowError):
        generated_group([turn(360 / 300)])


@pytest.mark.parametrize(("share", "is_round"), [(0.004, True), (0.007, False)])
def test_a_plate_is_round_if_its_sides_differ_by_less_than_half_a_hundredth(share, is_round):
    """Moments of inertia, which go with the square of a side, then differ by a hundredth."""
    axis = round_axis(grid(6, 6, 1.0, 1.0 + share), np.eye(3))
    assert axis is None if not is_round else axis.tolist() == [0, 0, 1]
