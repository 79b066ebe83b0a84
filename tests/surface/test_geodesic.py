"""Distances along a surface: closed forms where it unfolds, another program elsewhere, and laws on any mesh."""

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from dsfab.surface import Surface
from dsfab.surface.geodesic import Origins, geodesic_distances
from tests.shapes import ZOO, jittered, l_shape, zoo
from tests.surface.prisms import prism


def origins(surface: Surface, vertices=(), edges=None) -> Origins:
    """Vertices by number, and marked edges with their ends."""
    marked = np.isin(np.arange(surface.n), vertices)
    edges = np.zeros(len(surface.edges.ends), dtype=bool) if edges is None else edges
    marked[surface.edges.ends[edges]] = True
    return Origins(marked, edges, np.zeros(surface.m, dtype=bool))


def rim(surface: Surface) -> Origins:
    return origins(surface, edges=surface.edges.boundary)


def middles(surface: Surface) -> np.ndarray:
    return surface.V[surface.edges.ends].mean(axis=1)


def flat(points: np.ndarray) -> Surface:
    return Surface(np.c_[points, np.zeros(len(points))], Delaunay(points).simplices)


def scattered(count: int, seed: int) -> np.ndarray:
    """Points of the unit square and its corners."""
    return np.concatenate([np.random.default_rng(seed).random((count, 2)), [[0, 0], [1, 0], [0, 1], [1, 1]]])


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 60), st.integers(0, 10**6), st.floats(0.01, 0.6))
def test_geodesic_distances_on_a_plane_are_straight_on_any_mesh(count, seed, reach):
    surface = flat(scattered(count, seed))
    for P, k in ((surface.V, 0), (middles(surface), 1)):
        x, y, _ = P.T
        edge = np.minimum.reduce([x, y, 1 - x, 1 - y])
        assert geodesic_distances(surface, rim(surface))[k] == pytest.approx(edge, abs=1e-12)
        point = np.linalg.norm(P - surface.V[-1], axis=1)
        assert geodesic_distances(surface, origins(surface, [surface.n - 1]))[k] == pytest.approx(point, abs=1e-12)
    within = geodesic_distances(surface, rim(surface), reach)
    x, y, _ = surface.V.T
    edge = np.minimum.reduce([x, y, 1 - x, 1 - y])
    at = surface.F[within.reached]
    assert within.vertex[at] == pytest.approx(edge[at], abs=1e-12)
    assert within.reached[(edge[surface.F] < reach - 1e-12).any(axis=1)].all()
    assert (within.vertex >= edge - 1e-12).all()


def test_edges_send_out_strips_and_their_ends_fans():
    surface = flat(scattered(80, 3))
    a, b = surface.edges.ends[17]
    edges = np.arange(len(surface.edges.ends)) == 17
    found = geodesic_distances(surface, origins(surface, edges=edges))
    squared = igl.point_mesh_squared_distance(surface.V, surface.V, np.array([[a, b]]))[0]
    assert found.vertex == pytest.approx(np.sqrt(squared), abs=1e-12)
    assert found.middle[17] == 0


def test_paths_bend_around_a_corner_of_the_boundary():
    """An L: from the end of one arm to the other, over the inner corner."""
    surface = jittered(l_shape(10), 0.3, 4)
    corner, start = np.array([1.0, 1.0, 0.0]), int(np.argmin(((surface.V - [2, 0.0, 0]) ** 2).sum(axis=1)))
    found = geodesic_distances(surface, origins(surface, [start]))
    P, Q = surface.V, surface.V[start]
    t = (1 - Q[0]) / np.minimum(P[:, 0] - Q[0], -1e-9)  # where the straight way passes x = 1
    hidden = (P[:, 0] < 1 + 1e-9) & (Q[1] + t * (P[:, 1] - Q[1]) > 1 + 1e-9)
    assert hidden.sum() > 10
    around = np.linalg.norm(Q - corner) + np.linalg.norm(P - corner, axis=1)
    straight = np.linalg.norm(P - Q, axis=1)
    assert found.vertex == pytest.approx(np.where(hidden, around, straight), abs=1e-9)


def test_distances_on_a_prism_equal_distances_in_the_unrolled_plane():
    surface, sides = prism(12, 6, 3.0), 12
    place = np.arange(surface.n) // 7
    turn = np.minimum(place, sides - place)  # the shorter way round
    z = surface.V[:, 2]
    unrolled = np.hypot(turn * 2 * np.sin(np.pi / sides), z - z[3])
    assert geodesic_distances(surface, origins(surface, [3])).vertex == pytest.approx(unrolled, abs=1e-12)
    assert geodesic_distances(surface, rim(surface)).vertex == pytest.approx(np.minimum(z, 3 - z), abs=1e-12)


@pytest.mark.slow
def test_paths_follow_the_edge_of_a_large_hole():
    """Around a circle with more vertices than Python has room for calls within calls."""
    sides = 1050
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    a = np.arange(sides)
    b = (a + 1) % sides
    F = np.concatenate([np.c_[a, a + sides, b], np.c_[b, a + sides, b + sides]])
    surface = Surface(np.concatenate([ring, 1.002 * ring]), F)
    found = geodesic_distances(surface, origins(surface, [0])).vertex
    steps = np.minimum(a, sides - a)
    assert found[:sides] == pytest.approx(steps * 2 * np.sin(np.pi / sides), rel=1e-9)
    near = geodesic_distances(surface, origins(surface, [0]), 0.1)
    assert near.vertex[:20] == pytest.approx(found[:20], abs=1e-12)
    assert near.reached.sum() < sides / 10


@pytest.mark.parametrize("name", [name for name in ZOO if name not in ("moebius", "two pieces")])
def test_another_program_finds_the_same_from_points(name):
    surface = ZOO[name]()
    none, every = np.empty(0, dtype=np.int64), np.arange(surface.n)
    for start in ([0], [surface.n // 2], [3, surface.n - 2]):
        theirs = igl.exact_geodesic(surface.V, surface.F, np.array(start), none, every, none)
        ours = geodesic_distances(surface, origins(surface, start)).vertex
        assert ours == pytest.approx(theirs, abs=1e-9 * surface.size)


def test_on_rough_ground_too():
    """A third of the vertices have more than a full turn of faces around them: paths bend there."""
    points = scattered(400, 1)
    V = np.c_[points, 0.1 * np.random.default_rng(2).random(len(points))]
    surface = Surface(V, Delaunay(points).simplices)
    none = np.empty(0, dtype=np.int64)
    theirs = igl.exact_geodesic(V, surface.F, np.array([7]), none, np.arange(surface.n), none)
    assert geodesic_distances(surface, origins(surface, [7])).vertex == pytest.approx(theirs, abs=1e-10)


@zoo
def test_laws_on_any_mesh(name):
    surface = ZOO[name]()
    ends = surface.edges.ends
    size = np.linalg.norm(np.diff(surface.V[ends], axis=1)[:, 0], axis=1)
    some = origins(surface, [1], edges=np.arange(len(ends)) % 97 == 5)
    vertex, middle, reached = geodesic_distances(surface, some)
    known = np.isfinite(vertex)
    assert (vertex[some.vertices] == 0).all()
    assert (middle[some.edges] == 0).all()
    slack = 1e-9 * surface.size
    at = known[ends].all(axis=1)
    assert (np.abs(np.diff(vertex[ends[at]], axis=1)[:, 0]) <= size[at] + slack).all()
    assert (np.abs(vertex[ends[at]] - middle[at, None]) <= size[at, None] / 2 + slack).all()
    assert (reached == known[surface.F].all(axis=1)).all()
    where = (ends[some.edges], np.array([[1]]))
    straight = np.min(
        [igl.point_mesh_squared_distance(surface.V / surface.size, surface.V / surface.size, x)[0] for x in where],
        axis=0,
    )
    assert (vertex >= np.sqrt(straight) * surface.size - slack).all()


@zoo
def test_numbers_of_vertices_and_faces_do_not_matter(name):
    surface = ZOO[name]()
    rng = np.random.default_rng(5)
    new, order = rng.permutation(surface.n), rng.permutation(surface.m)
    V = np.empty_like(surface.V)
    V[new] = surface.V
    F = np.roll(new[surface.F][order], 1, axis=1)
    F[::2] = F[::2, ::-1]  # nor which way they are turned
    one = geodesic_distances(surface, origins(surface, [2])).vertex
    other = geodesic_distances(Surface(V, F), origins(surface, [new[2]])).vertex
    assert other[new] == pytest.approx(one, abs=1e-10 * surface.size)


def test_distances_reach_all_sheets_at_a_common_edge():
    V = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -0.5, 0.8], [0.5, -0.5, -0.8]])
    surface = Surface(V, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    found = geodesic_distances(surface, origins(surface, [2])).vertex
    down = 1 + np.hypot(0.5, 0.8)  # over the common edge, straight down
    assert found == pytest.approx([np.hypot(0.5, 1), np.hypot(0.5, 1), 0, down, down])


def test_distances_to_a_separate_piece_are_infinite():
    surface = ZOO["two pieces"]()
    found = geodesic_distances(surface, origins(surface, [0]))
    assert np.isfinite(found.vertex[: surface.n // 2]).all()
    assert np.isinf(found.vertex[surface.n // 2 :]).all()
    nothing = geodesic_distances(surface, origins(surface))
    assert np.isinf(nothing.vertex).all()
    assert not nothing.reached.any()
