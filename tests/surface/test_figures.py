"""Stand-ins of the paper's surfaces: topology, even triangles, the field they lie on, Boy's formula, refusals."""

import inspect
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dsfab.core.arrays import edge_lengths
from dsfab.core.errors import SurfaceError
from dsfab.surface import FIGURES, SHAPES
from dsfab.surface.shapes.figures import BoyChart, twisted_solid
from dsfab.surface.shapes.implicit import (
    LevelSet,
    ball,
    ellipsoid,
    limb,
    mirror_union,
    remeshed_chart,
    rounded_box,
    skin,
    smooth_difference,
    smooth_minimum,
    smooth_union,
)
from dsfab.surface.shapes.meshing import ring_faces, ring_turns
from dsfab.surface.topology import edge_table, euler_characteristic, manifold_faults, pieces
from tests.shapes import corner_angles

TOPOLOGY = {
    "camel_head": (1, 1),
    "boys_surface": (1, 1),
    "duck_ring": (0, 0),
    "climbing_hold": (0, 0),
    "twisty_tower": (0, -4),
}
"""Boundary loops and Euler characteristic; all others are closed, of genus 0."""


LONG = ("pirate", "turkey", "bridge", "twisty_tower")
"""Half of the time of all figures, by the same means as the others."""


@cache
def made(name):
    return SHAPES[name]()


every_figure = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in FIGURES]
)


@pytest.mark.slow
@every_figure
def test_figures_have_the_topology_of_the_papers_meshes(name):
    s = made(name)
    assert manifold_faults(s.F, s.edges, s.n) == ()
    assert pieces(s.F, s.edges)[0] == 1
    assert (len(s.loops), euler_characteristic(s.F, s.edges)) == TOPOLOGY.get(name, (0, 2))
    assert s.volume > 0 or not s.is_closed


@every_figure
def test_figures_have_even_triangles_of_the_requested_edge(name):
    s = made(name)
    smallest = corner_angles(s).min(axis=1)
    assert smallest.min() > 20
    assert np.quantile(smallest, 0.01) > 35
    assert np.median(smallest) > 50
    asked = inspect.signature(SHAPES[name]).parameters["edge"].default
    assert s.mean_edge == pytest.approx(asked, rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mouse", "duck_ring", "boys_surface"])
def test_the_same_call_gives_the_same_figure(name):
    again = SHAPES[name]()
    assert_array_equal(again.V, made(name).V)
    assert_array_equal(again.F, made(name).F)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size"), [("mouse", "length"), ("climbing_hold", "width"), ("boys_surface", "height")]
)
def test_figures_scale_with_their_size(name, size):
    defaults = {k: p.default for k, p in inspect.signature(SHAPES[name]).parameters.items()}
    twice = SHAPES[name](**{size: 2 * defaults[size], "edge": 2 * defaults["edge"]})
    assert twice.n == made(name).n
    assert_allclose(twice.V, 2 * made(name).V, rtol=1e-6, atol=1e-6 * twice.size)


def test_a_skin_lies_on_its_field_and_has_its_area():
    s = skin(ball((0.1, 0.2, 0.3), 1.0), (-1.2, -1.2, -1.2), (1.4, 1.4, 1.5), 0.1)
    assert_allclose(np.linalg.norm(s.V - [0.1, 0.2, 0.3], axis=1), 1, atol=1e-6)
    assert s.area == pytest.approx(4 * np.pi, rel=5e-3)
    assert s.volume == pytest.approx(4 / 3 * np.pi, rel=1e-2)


def test_a_skin_cut_at_a_floor_is_open_there_and_flat():
    s = skin(ball((0, 0, 0), 1.0), (-1.2, -1.2, -1.2), (1.2, 1.2, 1.2), 0.1, floor=-0.5)
    (loop,) = s.loops
    assert_allclose(s.V[loop, 2], -0.5, atol=1e-12)
    assert_allclose(np.hypot(*s.V[loop, :2].T), np.sqrt(0.75), atol=1e-4)
    assert s.area == pytest.approx(2 * np.pi * 1.5, rel=5e-3)
    assert_array_equal(np.flatnonzero(s.V[:, 2] < -0.5 + 1e-12), np.sort(loop))


def test_fields_are_distances_near_the_surface():
    P = np.array([[0.0, 0.0, 2.0], [3.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert_allclose(ball((0, 0, 0), 1.0)(P), [1, 2, -0.5])
    assert_allclose(limb([(0, 0, 0), (2, 0, 0)], [0.5, 0.25])(P), [1.5, 0.75, -0.5 + 0.0625])
    assert_allclose(rounded_box((0, 0, 0), (1, 1, 1), 0.2)(P), [1, 2, -0.5])
    assert_allclose(ellipsoid((0, 0, 0), (1, 1, 2))(P)[:2], [0, 2], atol=1e-12)


def test_blends_fill_corners_and_leave_the_rest():
    a, b = np.array([1.0, 1.0, 0.0]), np.array([1.0, 3.0, 0.05])
    assert_allclose(smooth_minimum(a, b, 0.4), [1 - 0.1, 1.0, 0.0 - 0.35**2 / 1.6])
    left, right = ball((-1, 0, 0), 0.5), ball((1, 0, 0), 0.5)
    P = np.array([[-1.4, 0, 0], [1.4, 0, 0], [0, 0, 0]])
    assert_allclose(mirror_union(right, axis=0)(P), np.minimum(left(P), right(P)))
    assert_allclose(smooth_union([left, right], 0.1)(P), [-0.1, -0.1, 0.5 - 0.025])
    assert_allclose(smooth_difference(left, right, 0.1)(P)[:2], [-0.1, 1.9])
    assert (smooth_difference(ball((0, 0, 0), 1.0), ball((0, 0, 0), 0.5), 0.01)(P[2:]) > 0).all()


def test_remeshing_mends_slivers_and_keeps_a_torus_a_torus():
    """A torus in long thin triangles, on the field of the torus."""
    t, p = (x.ravel() for x in np.meshgrid(np.arange(60) / 60, np.arange(9) / 9, indexing="ij"))
    c, s = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    r = 1 + 0.4 * np.cos(2 * np.pi * p)
    V = np.stack([r * c, r * s, 0.4 * np.sin(2 * np.pi * p)], axis=1)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(60), np.arange(9), indexing="ij"))
    at = lambda i, j: (i % 60) * 9 + j % 9  # noqa: E731
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    F = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    field = lambda P: np.hypot(np.hypot(P[:, 0], P[:, 1]) - 1, P[:, 2]) - 0.4  # noqa: E731
    V, F = remeshed_chart(LevelSet(field, 0.15), V, F, 0.15)
    assert euler_characteristic(F, edge_table(F)) == 0
    assert np.abs(field(V)).max() < 1e-4
    length = np.linalg.norm(V[F] - np.roll(V[F], 1, axis=1), axis=2)
    assert 0.5 < length.min() / length.mean() < length.max() / length.mean() < 1.6


def test_boys_surface_glues_opposite_points_and_has_a_threefold_axis_and_its_peak():
    disc = BoyChart(3.0)
    angle = np.linspace(0, 2 * np.pi, 50)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert_allclose(disc.place(rim), disc.place(-rim), atol=1e-12)
    w = 0.6 * rim
    turn = lambda X, a: X @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])  # noqa: E731
    there, here = disc.place(turn(w, 2 * np.pi / 3)), disc.place(w)
    assert_allclose(there[:, 2], here[:, 2], atol=1e-12)
    assert_allclose(np.hypot(*there[:, :2].T), np.hypot(*here[:, :2].T), atol=1e-12)
    assert_allclose(disc.place(np.zeros((1, 2))), [[0, 0, 3.0]], atol=1e-12)


def test_boys_surface_is_conformal_and_stands_on_the_ground():
    disc, small = BoyChart(1.0), 1e-6
    turns = ring_turns(np.array([1, 6, 12, 18]))
    angle = 2 * np.pi * np.concatenate(turns)
    X = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.repeat([0.0, 0.3, 0.6, 0.9], [1, 6, 12, 18])[:, None]
    assert len(ring_faces(turns)) == 54
    J = np.stack([(disc.place(X + small * e) - disc.place(X - small * e)) / (2 * small) for e in np.eye(2)], axis=2)
    metric = np.swapaxes(J, 1, 2) @ J
    assert_allclose(metric[:, 0, 1] / metric[:, 0, 0], 0, atol=1e-6)
    assert_allclose(metric[:, 1, 1] / metric[:, 0, 0], 1, atol=1e-6)
    z = made("boys_surface").V[:, 2]
    assert z.min() == pytest.approx(0, abs=0.01)
    assert z.max() == pytest.approx(3, abs=0.01)


def test_the_camel_stands_on_its_neck_and_faces_forward():
    s = made("camel_head")
    assert_allclose(s.V[s.loops[0], 2], 0, atol=1e-12)
    assert s.V[:, 2].max() == pytest.approx(1, abs=0.02)
    nose = s.V[s.V[:, 0].argmax()]
    assert abs(nose[1]) < 0.15
    assert 0.2 < nose[2] < 0.6


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("pirate", {"edge": 1e-5}, "use a longer edge"),
        ("boys_surface", {"edge": 1e-4}, "use a longer edge"),
        ("bridge", {"rise": 0.5}, "must be at most 0.25"),
        ("twisty_tower", {"twist": 400.0}, "must be at most 180"),
        ("mouse", {"length": 0.0}, "must be greater than 0"),
    ],
)
def test_impossible_figures_are_refused_with_a_sentence(name, values, says):
    with pytest.raises(SurfaceError, match=says):
        SHAPES[name](**values)


@pytest.mark.parametrize("coarser", [4.0, 5.1, 6.5, 8.0])
def test_the_camel_has_even_triangles_at_any_coarseness(coarser):
    """Its lips are 0.03 m apart, its ears 0.12 m thick: edges of 0.06 to 0.12 m leave out what they cannot show."""
    s = SHAPES["camel_head"](edge=coarser * 0.0149)
    assert (len(s.loops), euler_characteristic(s.F, s.edges)) == (1, 1)
    assert corner_angles(s).min() > 25
    length = edge_lengths(s.V, s.edges.ends)
    assert length.min() / length.max() > 0.33
    assert s.mean_edge == pytest.approx(coarser * 0.0149, rel=0.06)


@pytest.mark.parametrize(("edge", "why"), [(0.03, "span gaps"), (0.05, "folded over at")])
def test_an_edge_too_long_for_lips_is_refused(edge, why):
    """Lips that are 0.03 m apart were joined, split and joined until memory ended."""
    upper, lower = (rounded_box((0, 0, z), (0.5, 0.3, 0.1), 0.02) for z in (0.115, -0.115))
    with pytest.raises(SurfaceError, match=why):
        skin(smooth_union([upper, lower], 0.01), (-0.7, -0.5, -0.4), (0.7, 0.5, 0.4), edge)


def test_a_twisted_solid_turns_counter_clockwise_as_it_rises():
    """A line at (1, 0) becomes the helix (cos, sin) of `turn` z: the other way round, no invariant told."""
    z = np.linspace(0, 1, 7)
    for turn in (-0.4, 0.0, 1.3):
        helix = np.stack([np.cos(turn * z), np.sin(turn * z), z], axis=1)
        away = twisted_solid(lambda P: np.linalg.norm(P - np.stack([np.ones(7), np.zeros(7), z], axis=1), axis=1), turn)
        np.testing.assert_allclose(away(helix), 0, atol=1e-12)


def test_the_twisty_tower_stands_turned_by_its_height():
    """The long side of its plan, near the foot and near the top, lies at twist times the height."""
    V = SHAPES["twisty_tower"](height=10.0, twist=60.0, edge=0.45).V
    for low, high in ((0.3, 1.2), (8.8, 9.7)):
        P = V[(V[:, 2] > low) & (V[:, 2] < high)]
        x, y = (P[:, :2] - P[:, :2].mean(axis=0)).T
        axis = np.degrees(np.arctan2(2 * (x @ y), x @ x - y @ y) / 2)
        assert axis == pytest.approx(6 * (low + high) / 2, abs=4)
