"""What turning and collapsing of edges decides by integers, against small meshes and against every pair looked at."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from dsfab.core.arrays import area_vectors, edge_lengths, face_angles, polygon_perimeter, unit_vectors
from dsfab.surface import Surface
from dsfab.surface.edge_changes import (
    contracted_faces,
    has_new_diagonal,
    leading_candidates,
    meets_link_condition,
    quads,
    with_flipped_edges,
    with_other_diagonals,
)
from dsfab.surface.shapes import torus
from dsfab.surface.topology import edge_table, euler_characteristic, manifold_faults

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
TETRAHEDRON = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
OCTAHEDRON = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]])


def tube_of_triangles(levels):
    """A tube of triangular rings, open at both ends."""
    below = [(3 * z + k, 3 * z + (k + 1) % 3) for z in range(levels - 1) for k in range(3)]
    return np.array([f for a, b in below for f in ((a, b, b + 3), (a, b + 3, a + 3))])


def test_the_diagonal_of_a_square_is_turned_and_turned_back():
    pairs = edge_table(SQUARE).pairs
    quad = quads(SQUARE, pairs)
    assert set(quad[0, :2].tolist()) == {0, 2}
    assert set(quad[0, 2:].tolist()) == {1, 3}
    turned = with_other_diagonals(SQUARE, pairs, quad)
    assert edge_table(turned).ends.tolist() == [[0, 1], [0, 3], [1, 2], [1, 3], [2, 3]]
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert area_vectors(corners, turned).tolist() == [[0, 0, 1]] * 2
    pairs = edge_table(turned).pairs
    back = with_other_diagonals(turned, pairs, quads(turned, pairs))
    assert_array_equal(np.sort(np.sort(back, axis=1), axis=0), np.sort(np.sort(SQUARE, axis=1), axis=0))


@pytest.mark.parametrize(("F", "new"), [(SQUARE, True), (TETRAHEDRON, False), (OCTAHEDRON, True)])
def test_a_diagonal_that_is_an_edge_already_is_not_new(F, new):
    edges = edge_table(F)
    assert (has_new_diagonal(quads(F, edges.pairs), edges, F.max() + 1) == new).all()


def test_the_link_condition_refuses_a_collapse_that_pinches_a_tube():
    F = tube_of_triangles(4)
    edges = edge_table(F)
    fine = meets_link_condition(edges, np.arange(len(edges.ends)), F.max() + 1)
    ring = edges.ends[:, 0] // 3 == edges.ends[:, 1] // 3
    assert_array_equal(fine, ~ring)  # the third vertex of a ring is no corner of a face at its edges


def test_collapsing_an_edge_that_may_be_keeps_the_topology():
    F = torus(edge=0.6).F
    edges, n = edge_table(F), int(F.max()) + 1
    fine = np.flatnonzero(meets_link_condition(edges, np.arange(len(edges.ends)), n))
    assert len(fine) > 20
    for a, b in edges.ends[fine[:20]]:
        onto = np.arange(n)
        onto[b] = a
        fewer = contracted_faces(F, onto)
        assert len(fewer) == len(F) - 2
        assert euler_characteristic(fewer, edge_table(fewer)) == euler_characteristic(F, edges)
        assert not manifold_faults(fewer, edge_table(fewer), n)


@given(seed=st.integers(0, 10_000), near=st.booleans())
@settings(max_examples=30, deadline=None)
def test_the_winning_edges_come_before_all_their_neighbours(seed, near):
    F = torus(edge=0.6).F
    edges, n, random = edge_table(F).ends, int(F.max()) + 1, np.random.default_rng(seed)
    touched = edges[random.permutation(len(edges))[: random.integers(0, 40)]]
    order = random.permutation(len(touched))
    won = leading_candidates(order, touched, n, edges=edges if near else None)
    around = [set(edge.tolist()) for edge in touched]
    if near:
        around = [set(edges[np.isin(edges, list(one)).any(axis=1)].ravel().tolist()) for one in around]
    place = np.argsort(order)
    for i, one in enumerate(touched.tolist()):
        beaten = any(place[j] < place[i] and set(one) & around[j] for j in range(len(touched)))
        assert won[i] == (not beaten)


def test_lengths_and_areas_of_a_known_triangle():
    V = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])
    assert edge_lengths(V, np.array([[0, 1], [1, 2], [2, 0]])).tolist() == [3, 5, 4]
    assert area_vectors(V, np.array([[0, 1, 2], [0, 2, 1]])).tolist() == [[0, 0, 12], [0, 0, -12]]
    assert polygon_perimeter(V) == 12
    assert_allclose(np.degrees(face_angles(V, np.array([[0, 1, 2]])))[0], [90, 53.130102, 36.869898])
    assert face_angles(V, np.array([[0, 1, 1]])).tolist() == [[0, 0, 0]]


def test_unit_vectors_have_length_1_except_zero_vectors():
    x = np.array([[[3.0, 0, 4], [0, 0, 0]], [[0, -1e-100, 0], [0, 0, 1e-3]]])
    assert_allclose(unit_vectors(x), [[[0.6, 0, 0.8], [0, 0, 0]], [[0, -1, 0], [0, 0, 1]]])


@pytest.mark.parametrize(("gain", "flips"), [(0.8, False), (1.2, True)])
def test_an_edge_flips_if_the_smallest_angle_gains_more_than_a_degree(gain, flips):
    """The long diagonal of a rhombus halves its acute angle, 90 degrees less the gain; the short one its other."""
    long = 1 / np.tan(np.radians(45 - gain / 2))
    rhombus = Surface(np.array([[-long, 0, 0], [0, -1, 0], [long, 0, 0], [0, 1, 0]]), SQUARE)
    new = with_flipped_edges(rhombus, np.ones(4, dtype=bool), np.empty((0, 2), dtype=int), 0.0)
    assert ([1, 3] in new.edges.ends.tolist()) == flips
