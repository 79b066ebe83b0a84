"""`Surface` and its topology: measures against closed forms, faults against meshes that have them."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.core.errors import SurfaceError
from dsfab.surface import Surface, nearest_places, signed_volume, signed_volumes, total_area
from dsfab.surface.shapes import dome, plate, sphere, torus
from dsfab.surface.topology import (
    boundary_loops,
    duplicate_faces,
    edge_table,
    euler_characteristic,
    flips_to_orient,
    half_edges,
    link_components,
    manifold_faults,
    misoriented_edges,
    next_half_edge,
    pieces,
    pinches,
)

SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])
BOW_TIE = np.array([[0, 1, 2], [2, 3, 4]])
MOEBIUS = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 0, 4], [4, 0, 1]])
"""Five triangles, the Moebius strip with the fewest vertices."""


def faults(F, n):
    return manifold_faults(F, edge_table(F), n)


def test_a_rectangle_has_its_measures():
    s = Surface(SQUARE, TWO)
    assert (s.n, s.m) == (4, 2)
    assert s.area == pytest.approx(2)
    assert s.size == pytest.approx(np.sqrt(5))
    assert s.mean_edge == pytest.approx((2 + 1 + 2 + 1 + np.sqrt(5)) / 5)
    assert s.is_flat
    assert not s.is_closed
    assert_allclose(s.normals, [[0, 0, 1]] * 2)
    assert_allclose(s.vertex_normals, [[0, 0, 1]] * 4)
    assert_allclose(s.vertex_areas, np.array([2, 1, 2, 1]) / 3)
    assert_allclose(s.centroids, [[4 / 3, 1 / 3, 0], [2 / 3, 2 / 3, 0]])
    assert_array_equal(s.faces_of(np.array([True, True, True, False])), [True, False])


def test_half_edges_run_around_their_faces():
    F = torus(edge=0.5).F
    begins, ends = half_edges(F)
    h = np.arange(3 * len(F))
    assert_array_equal(begins[next_half_edge(h)], ends)
    assert_array_equal(next_half_edge(h) // 3, h // 3)
    assert_array_equal(next_half_edge(next_half_edge(h)), next_half_edge(h, 2))
    assert_array_equal(next_half_edge(h, 3), h)
    assert_array_equal(next_half_edge(h, 0), h)


def test_volume_is_signed_and_does_not_depend_on_the_place():
    s = sphere(radius=1.0, edge=0.1)
    assert s.volume == pytest.approx(4 / 3 * np.pi, rel=5e-3)
    moved = Surface(s.V + np.array([1e4, 0, 0]), s.F[:, ::-1])
    assert moved.volume == pytest.approx(-s.volume, rel=1e-9)
    assert s.is_closed
    assert not s.is_flat


def test_arrays_are_copies_and_locked():
    V = SQUARE.copy()
    s = Surface(V, TWO)
    V[0] = 9
    assert s.V[0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        s.V[0] = 1


@pytest.mark.parametrize(
    ("V", "F", "says"),
    [
        (SQUARE, np.empty((0, 3)), "no faces"),
        (np.where(SQUARE == 2, np.nan, SQUARE), TWO, r"2 of 4 vertices are not finite numbers \(first: 1, 2\)"),
        (SQUARE, [[0, 1, 4]], r"1 face names vertex numbers outside 0..3"),
        (SQUARE, [[0, 1, -1]], r"1 face names vertex numbers outside 0..3"),
        (SQUARE, [[0, 1, 2], [0, 1, 1]], r"1 of 2 faces have no area \(first: 1\)"),
    ],
)
def test_impossible_arrays_are_refused(V, F, says):
    with pytest.raises(SurfaceError, match=says):
        Surface(V, F)


@pytest.mark.parametrize(
    ("surface", "loops", "euler"),
    [
        (plate(edge=0.5), 1, 1),
        (dome(edge=0.8), 1, 1),
        (dome(edge=0.8, oculus=1.0), 2, 0),
        (sphere(edge=0.8), 0, 2),
        (torus(edge=0.6), 0, 0),
    ],
)
def test_loops_and_euler_characteristic_tell_the_topology(surface, loops, euler):
    assert len(surface.loops) == loops
    assert euler_characteristic(surface.F, surface.edges) == euler
    assert pieces(surface.F, surface.edges)[0] == 1
    assert manifold_faults(surface.F, surface.edges, surface.n) == ()


def test_boundary_loops_keep_the_surface_on_their_left():
    s = plate(edge=0.5)
    (loop,) = s.loops
    x, y = s.V[loop, :2].T
    shoelace = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert shoelace == pytest.approx(24)
    assert len(loop) == s.edges.boundary.sum()


def test_loops_of_a_surface_are_sorted_by_length_not_by_vertices():
    ring = dome(edge=0.4, oculus=1.5)
    lengths = [np.linalg.norm(ring.V[a] - np.roll(ring.V[a], -1, axis=0), axis=1).sum() for a in ring.loops]
    assert lengths[0] == pytest.approx(2 * np.pi * 5, rel=1e-2)
    assert lengths[1] == pytest.approx(2 * np.pi * 1.5, rel=2e-2)
    # a long triangle and a short hexagonal fan
    V = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [20, 0, 0], [21, 0, 0], [21, 1, 0], [20, 1, 0]]
    two = Surface(np.array(V, dtype=float), [[0, 1, 2], [3, 4, 5], [3, 5, 6]])
    assert [sorted(loop.tolist()) for loop in two.loops] == [[0, 1, 2], [3, 4, 5, 6]]
    assert len(boundary_loops(two.F, two.edges)[0]) == 4


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 11)] * 3), min_size=1, max_size=60), st.integers(0, 3))
def test_edges_are_in_ascending_order_and_their_half_edges_too(faces, gap):
    """Also of repeated and crumpled faces, and with vertices that none has: numpy's own unique rows and stable sort."""
    F = np.array(faces) * (1 + gap)
    table, (a, b) = edge_table(F), half_edges(F)
    ends, of = np.unique(np.sort(np.stack([a, b], axis=1), axis=1), axis=0, return_inverse=True)
    assert_array_equal(table.ends, ends)
    assert_array_equal(table.of.ravel(), of.ravel())
    assert_array_equal(table.order, np.argsort(of.ravel(), kind="stable"))
    assert_array_equal(table.count, np.bincount(of.ravel()))


def test_loops_at_a_pinch_stay_with_their_fan():
    loops = boundary_loops(BOW_TIE, edge_table(BOW_TIE))
    assert sorted(sorted(loop.tolist()) for loop in loops) == [[0, 1, 2], [2, 3, 4]]


def test_pinches_are_found_on_open_and_closed_surfaces():
    assert_array_equal(pinches(BOW_TIE, edge_table(BOW_TIE), 5), [2])
    tetra = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    two = np.concatenate([tetra, np.where(tetra == 0, 0, tetra + 3)])
    assert_array_equal(pinches(two, edge_table(two), 7), [0])
    assert len(pinches(tetra, edge_table(tetra), 4)) == 0


def test_turned_faces_are_no_pinches():
    s = plate(edge=0.5)
    F = s.F.copy()
    F[::3] = F[::3, ::-1]
    assert len(pinches(F, edge_table(F), s.n)) == 0


def test_pieces_are_counted_by_edges_and_largest_first():
    F = np.array([[0, 1, 2], [2, 3, 4], [2, 4, 5]])
    count, label = pieces(F, edge_table(F))
    assert count == 2
    assert_array_equal(label, [1, 0, 0])


def test_orientation_turns_the_smaller_part():
    s = plate(edge=0.5)
    turned = s.F.copy()
    turned[[3, 7, 20]] = turned[[3, 7, 20], ::-1]
    edges = edge_table(turned)
    assert len(misoriented_edges(turned, edges)) > 0
    flips = flips_to_orient(turned, edges)
    assert_array_equal(np.flatnonzero(flips), [3, 7, 20])
    assert not flips_to_orient(s.F, s.edges).any()


def test_a_moebius_strip_cannot_be_oriented():
    assert flips_to_orient(MOEBIUS, edge_table(MOEBIUS)) is None
    assert any("not orientable" in sentence for sentence in faults(MOEBIUS, 5))


@pytest.mark.parametrize(
    ("F", "n", "says"),
    [
        ([[0, 1, 2], [0, 2, 3], [0, 2, 4]], 5, "1 edge has more than two faces (first: 0-2)"),
        ([[0, 1, 2], [0, 2, 3], [2, 0, 1]], 4, "1 face repeats an earlier face (first: 2)"),
        ([[0, 1, 2], [0, 3, 2]], 4, "1 edge has two faces of opposite orientation (first: 0-2)"),
        (BOW_TIE, 5, "parts touch in a point at 1 vertex (first: 2)"),
    ],
)
def test_each_fault_is_reported_with_its_count_and_place(F, n, says):
    found = faults(np.array(F), n)
    assert says in found


def test_duplicates_are_found_in_either_orientation():
    F = np.array([[0, 1, 2], [1, 2, 3], [2, 1, 0], [2, 3, 1]])
    assert_array_equal(duplicate_faces(F), [2, 3])


def test_volumes_of_shells_are_signed_and_add_up_far_from_the_origin():
    """A box of 1 x 2 x 3, one of half the size inside as a void, and a vertex far out that no face uses."""
    whole = trimesh.creation.box((1.0, 2.0, 3.0))
    outer = Surface(np.array(whole.vertices), np.array(whole.faces))
    V = np.concatenate([outer.V, 0.5 * outer.V, [[1e9, 0.0, 0.0]]])
    F = np.concatenate([outer.F, outer.F[:, ::-1] + outer.n])
    shell = np.repeat([0, 1], outer.m)
    assert_allclose(signed_volumes(V, F, shell, 2), [6, -0.75], rtol=1e-12)
    assert signed_volume(V, F) == pytest.approx(5.25, rel=1e-12)
    assert total_area(V, F) == pytest.approx(22 * 1.25, rel=1e-12)
    assert signed_volume(V[:-1] + 1e6, F) == pytest.approx(5.25, rel=1e-8)
    assert signed_volume(V, F[:, ::-1]) == pytest.approx(-5.25, rel=1e-12)
    assert signed_volume(V, F[:0]) == total_area(V, F[:0]) == 0


def test_nearest_places_on_triangles_edges_and_vertices():
    V, F = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]])
    points = np.array([[0.2, 0.2, 3.0], [2.0, 0.0, 0.0]])
    found = nearest_places(points, V, F)
    assert_allclose(found.distance, [3, 1])
    assert_allclose(found.place, [[0.2, 0.2, 0.0], [1.0, 0.0, 0.0]])
    assert found.simplex.tolist() == [0, 0]
    assert_allclose(nearest_places(points, V, np.array([[0, 1]])).squared, [9.04, 1])
    assert nearest_places(points, V, np.array([[0], [1], [2]])).simplex.tolist() == [0, 1]
    assert [len(part) for part in nearest_places(points[:0], V, F)] == [0, 0, 0]


@pytest.mark.parametrize("scale", [3e38, 1e10, 1e-12])
def test_sizes_that_no_surface_has_are_refused_before_anything_overflows(scale):
    with pytest.raises(SurfaceError, match="check the unit and the coordinates"):
        Surface(scale * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), [[0, 1, 2]])
    with pytest.raises(SurfaceError, match="check the unit and the coordinates"):
        Surface(3e38 + np.array([[0, 0, 0], [1e30, 0, 0], [0, 1e30, 0.0]]), [[0, 1, 2]])


def test_a_small_tetrahedron_far_out_keeps_its_digits():
    """Legs of 1, 2, 3 mm, 10 km away: 1 cubic and 1 + 1.5 + 3 + 3.5 square millimetres, but for its rounded corners."""
    V = 1e4 + 1e-3 * np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
    F = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert signed_volume(V, F) == pytest.approx(1e-9, rel=1e-8)
    assert total_area(V, F) == pytest.approx(9e-6, rel=1e-8)


@pytest.mark.parametrize("count", [0, 1, 2, 30, 3000])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 2.0])
def test_pieces_equal_the_connected_components_of_scipy(count, share):
    rng = np.random.default_rng(count)
    links = rng.integers(0, max(count, 1), (2, int(share * count)))
    long = rng.permutation(count)[: count // 2]  # and a path through half of the things
    i, j = np.concatenate([links, [long[:-1], long[1:]]], axis=1)
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(count, count))
    parts, label = connected_components(graph, directed=False)
    found = link_components(count, i, j)
    assert found[0] == parts
    assert_array_equal(found[1], label)


@pytest.mark.parametrize(("share", "collapsed"), [(0.7e-20, True), (1.4e-20, False)])
def test_a_face_counts_as_collapsed_below_a_rounding_error_of_the_area(share, collapsed):
    """A third face has the area of this share of 5 m2, the squared diagonal of the square."""
    V = [*SQUARE, [2, 0, 2 * 5 * share]]
    if not collapsed:
        assert Surface(V, [*TWO, [1, 2, 4]]).m == 3
        return
    with pytest.raises(SurfaceError, match="1 of 3 faces"):
        Surface(V, [*TWO, [1, 2, 4]])
