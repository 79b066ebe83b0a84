"""Procedural surfaces: closed-form areas and their rate, good triangles, orientation, refusals."""

import inspect
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import TypeAdapter, ValidationError
from scipy.integrate import dblquad
from scipy.spatial import cKDTree

from dsfab.core.errors import SurfaceError
from dsfab.surface import FIGURES, SHAPES
from dsfab.surface.shapes.meshing import ring_faces, ring_turns, staggered_rows
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.shapes import corner_angles

CAP = (5**2 + 3**2) / (2 * 3)  # radius of the default dome
WAIST = 1.5
FLARE = WAIST * np.arccosh(6 / WAIST)

AREAS = {
    "plate": 24.0,
    "barrel_vault": 10 * 2 * 4.45 * np.arctan2(4, 4.45 - 2.5),
    "dome": 2 * np.pi * CAP * 3,
    "catenoid": np.pi * WAIST * (FLARE + WAIST / 2 * np.sinh(2 * FLARE / WAIST)),
    "cylinder": 2 * np.pi * 2 * 6,
    "sphere": 4 * np.pi * 4,
    "torus": 4 * np.pi**2 * 3 * 1.2,
    "hypar": dblquad(lambda y, x: np.sqrt(1 + (6 / 64) ** 2 * (x**2 + y**2)), -4, 4, -4, 4)[0],
    # z_x = 2 crown x / 6^2, z_y = 2 (rise - crown) y / 4^2
    "elliptic_paraboloid": dblquad(lambda y, x: np.sqrt(1 + (1.6 * x / 36) ** 2 + (0.1 * y) ** 2), -6, 6, -4, 4)[0],
}
DIRECT = [name for name in SHAPES if name not in FIGURES]
"""Figures are tested in test_surface_figures."""

TOPOLOGY = {"catenoid": (2, 0), "cylinder": (2, 0), "tower": (2, 0), "sphere": (0, 2), "torus": (0, 0)}
"""Boundary loops and Euler characteristic; all others are discs."""


def default_edge(name):
    return inspect.signature(SHAPES[name]).parameters["edge"].default


@pytest.mark.parametrize("name", AREAS)
def test_area_converges_to_the_closed_form_with_the_edge_squared(name):
    edge = default_edge(name)
    errors = [abs(SHAPES[name](edge=e).area / AREAS[name] - 1) for e in (2 * edge, edge, edge / 2)]
    assert errors[-1] < 1e-3
    if errors[-1] > 1e-12:
        assert np.log2(errors[0] / errors[2]) / 2 == pytest.approx(2, abs=0.35)


def test_pavilion_area_is_that_of_the_sphere_less_its_arches():
    """Gauss-Bonnet on the cut sphere: area / R^2 = 2 pi - (sum of the turning of its boundary)."""
    span, rise, opening, feet, foot = 14.0, 4.5, 2.8, 4, 1.6
    R = (span**2 / 4 + rise**2) / (2 * rise)
    half, low = np.pi / feet, R - rise
    end = np.array([span / 2 * np.cos(half - foot / span), span / 2 * np.sin(half - foot / span), low])
    other = end * [1, -1, 1]
    rho = np.sqrt(R**2 - (low + opening) ** 2)
    top = np.array([rho, 0, low + opening])
    normal = np.cross(end - top, other - top)
    normal /= np.linalg.norm(normal)
    normal *= -np.sign(normal @ top - normal @ [0, 0, R])  # towards the crown
    d = normal @ top
    r = np.sqrt(R**2 - d**2)
    centre = d * normal
    sweep = np.arccos((end - centre) @ (other - centre) / r**2)
    # turning along a small circle is sweep x d / R, positive when the surface is the part cut off beyond the plane
    along = sweep * d / R * feet + 2 * foot / span * feet * low / R
    t_arch = np.cross(normal, other - centre)
    t_foot = np.array([-other[1], other[0], 0])
    # a leg widens upwards, so that the boundary turns by less than a right angle at the corners of its foot
    corner = np.arccos(abs(t_arch @ t_foot) / np.linalg.norm(t_arch) / np.linalg.norm(t_foot))
    area = R**2 * (2 * np.pi - along - 2 * feet * corner)
    assert SHAPES["pavilion"](edge=0.14).area == pytest.approx(area, rel=1e-3)


@pytest.mark.parametrize("name", DIRECT)
def test_defaults_are_oriented_manifolds_of_good_triangles(name):
    s = SHAPES[name]()
    loops, euler = TOPOLOGY.get(name, (1, 1))
    assert manifold_faults(s.F, s.edges, s.n) == ()
    assert (len(s.loops), euler_characteristic(s.F, s.edges), pieces(s.F, s.edges)[0]) == (loops, euler, 1)
    assert corner_angles(s).min() > 27
    assert corner_angles(s).max() < 112
    assert s.mean_edge == pytest.approx(default_edge(name), rel=0.1)
    assert 1000 < s.n < 5000
    assert np.isin(np.arange(s.n), s.F).all()


ROOFS = ["plate", "barrel_vault", "hypar", "elliptic_paraboloid", "dome", "pavilion", "catenoid"]


@pytest.mark.parametrize("name", ROOFS)
def test_roofs_face_up(name):
    assert (SHAPES[name]().normals[:, 2] > -1e-9).all()


@pytest.mark.parametrize("name", ["cylinder", "tower", "sphere"])
def test_tubes_and_balls_face_away_from_their_axis(name):
    s = SHAPES[name]()
    assert (np.einsum("ma,ma->m", s.normals[:, :2], s.centroids[:, :2]) > -1e-9).all()
    assert (s.V[:, 2].min() >= 0) or name == "sphere"


def test_torus_encloses_its_volume_outward():
    assert SHAPES["torus"]().volume == pytest.approx(2 * np.pi**2 * 3 * 1.2**2, rel=1e-2)


@pytest.mark.parametrize("name", ["plate", "hypar", "barrel_vault", "elliptic_paraboloid", "pavilion", "dome"])
def test_meshes_mirror_onto_themselves(name):
    s = SHAPES[name]()
    mirror = [-1, -1, 1] if name == "hypar" else [1, -1, 1]
    gap, _ = cKDTree(s.V).query(s.V * mirror)
    assert gap.max() < 1e-9


def test_diagonals_do_not_all_run_one_way():
    """The mean of the edges' directions doubled (a headless mean) nearly vanishes: no way is preferred."""
    s = SHAPES["plate"]()
    d = s.V[s.edges.ends[:, 1]] - s.V[s.edges.ends[:, 0]]
    doubled = (d[:, 0] + 1j * d[:, 1]) ** 2 / (d**2).sum(axis=1)
    assert abs(doubled.mean()) < 0.02


def test_shapes_have_the_requested_sizes():
    V = SHAPES["pavilion"](span=10.0, rise=4.0, opening=2.0, feet=3, foot=1.5).V
    on_ground = V[:, 2] == 0
    assert_allclose(np.hypot(V[on_ground, 0], V[on_ground, 1]), 5)
    assert V[:, 2].max() == pytest.approx(4)
    angle = np.arctan2(V[:, 1], V[:, 0])
    arch = np.isclose(angle, np.pi / 3)
    assert V[arch, 2].min() == pytest.approx(2)
    x, y, z = SHAPES["elliptic_paraboloid"](length=6.0, width=4.0, rise=3.0, crown=2.0, edge=0.5).V.T
    assert_array_equal(z[np.abs(x * y) == 6], 0)
    assert (z[np.abs(y) == 2].max(), z[np.abs(x) == 3].max(), z.max()) == pytest.approx((2, 1, 3), abs=0.02)
    V = SHAPES["catenoid"](waist=1.0, rim=4.0).V
    assert_allclose([V[:, 2].min(), V[:, 2].max()], [0, np.arccosh(4)], atol=1e-12)
    assert_allclose(np.hypot(*V[V[:, 2] == 0, :2].T), 1)
    V = SHAPES["tower"](width=4.0, height=10.0, taper=0.5, twist=0.0).V
    assert V[V[:, 2] == 0, 0].max() == pytest.approx(2)
    assert V[V[:, 2] == 10, 0].max() == pytest.approx(1, rel=5e-3)
    V = SHAPES["hypar"](side=4.0, rise=2.0).V
    corner = np.argmin(np.linalg.norm(V[:, :2] - [2, 2], axis=1))
    assert V[corner, 2] == pytest.approx(2)


def test_the_same_call_gives_the_same_mesh():
    for make in map(SHAPES.get, DIRECT):
        one, two = make(), make()
        assert_array_equal(one.V, two.V)
        assert_array_equal(one.F, two.F)


def test_sphere_frequency_follows_the_edge():
    counts = {SHAPES["sphere"](radius=1.0, edge=e).n for e in np.geomspace(0.05, 1, 40)}
    frequency = np.sqrt((np.array(sorted(counts)) - 2) / 10)
    assert_allclose(frequency, np.round(frequency))
    assert len(counts) > 12  # every frequency, not only powers of two
    s = SHAPES["sphere"]()
    assert_allclose(np.linalg.norm(s.V, axis=1), 2)


@given(st.sampled_from(sorted(DIRECT)), st.floats(0.6, 2.5), st.floats(0.7, 1.5))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_shapes_stay_sound_over_their_range(name, coarse, stretch):
    defaults = {k: p.default for k, p in inspect.signature(SHAPES[name]).parameters.items()}
    main = next(iter(defaults))
    s = SHAPES[name](**{main: defaults[main] * stretch, "edge": defaults["edge"] * coarse})
    assert manifold_faults(s.F, s.edges, s.n) == ()
    assert corner_angles(s).min() > 20


@pytest.mark.parametrize("feet", range(3, 9))
def test_pavilions_of_any_number_of_feet_are_sound(feet):
    s = SHAPES["pavilion"](feet=feet, foot=1.0, opening=1.5)
    assert manifold_faults(s.F, s.edges, s.n) == ()
    assert corner_angles(s).min() > 19
    (loop,) = s.loops
    on_ground = s.V[loop, 2] == 0
    assert (on_ground & ~np.roll(on_ground, 1)).sum() == feet


def test_rings_of_any_counts_make_a_strip_without_gaps():
    for counts in ([1, 6, 12], [7, 7, 7], [5, 13, 4], [6, 1], [3, 30]):
        F = ring_faces(ring_turns(np.array(counts)))
        expected = sum(a * (a > 1) + b * (b > 1) for a, b in pairwise(counts))
        assert len(F) == expected
        assert (np.unique(np.sort(F, axis=1), axis=0).shape) == F.shape
        assert np.isin(np.arange(sum(counts)), F).all()


def test_staggered_rows_cover_the_unit_square():
    uv, F = staggered_rows(5, 4)
    u, v = uv[F[:, 1]] - uv[F[:, 0]], uv[F[:, 2]] - uv[F[:, 0]]
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    assert (twice > 0).all()
    assert twice.sum() / 2 == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "values", "says"),
    [
        ("plate", {"length": -1.0}, "plate: length = -1.0 must be greater than 0"),
        ("plate", {"edge": float("nan")}, "not a finite number"),
        ("plate", {"edge": 1e-5}, "use a longer edge"),
        ("dome", {"oculus": 6.0}, "oculus = 6 m is too wide"),
        ("dome", {"oculus": -0.1}, "must be at least 0"),
        ("hypar", {"rise": 100.0}, "use a lower rise"),
        ("elliptic_paraboloid", {"crown": 1.6}, "must be less than rise"),
        ("elliptic_paraboloid", {"rise": 100.0}, "use a lower rise"),
        ("torus", {"minor": 3.0}, "leaves no hole"),
        ("catenoid", {"waist": 6.0}, "must be wider"),
        ("pavilion", {"rise": 9.0}, "at most half the span"),
        ("pavilion", {"opening": 4.4}, "at most 0.9 x rise"),
        ("pavilion", {"foot": 9.0}, "closes the openings"),
        ("pavilion", {"feet": 2}, "must be at least 3"),
        ("tower", {"twist": 400.0}, "must be at most 360"),
        ("tower", {"twist": 360.0, "height": 6.0}, "twist = 360 degrees is too much"),
    ],
)
def test_impossible_parameters_are_refused_with_a_sentence(name, values, says):
    with pytest.raises(SurfaceError, match=says):
        SHAPES[name](**values)


def test_every_parameter_has_a_type_with_bounds_that_pydantic_enforces_and_a_default():
    for make in SHAPES.values():
        parameters = inspect.signature(make, eval_str=True).parameters
        assert "edge" in parameters
        for p in parameters.values():
            adapter = TypeAdapter(p.annotation)
            assert adapter.validate_python(p.default) == p.default
            with pytest.raises(ValidationError):
                adapter.validate_python(-1e9)


@pytest.mark.parametrize("value", [1e308, 1e-300])
@pytest.mark.parametrize("name", SHAPES)
def test_lengths_that_no_shape_has_are_refused_in_a_sentence(name, value):
    """Each number of each shape alone, warnings being errors."""
    refused = 0
    for one in inspect.signature(SHAPES[name]).parameters.values():
        if isinstance(one.default, float) and one.name != "twist":  # degrees, and 1e-300 of them are none
            try:
                SHAPES[name](**{one.name: value})
            except SurfaceError as error:
                refused += name in str(error)
    assert refused


def test_a_tower_turns_counter_clockwise_as_it_rises():
    """The corners of its plan, at 45 degrees on the ground, are turned by twist at the top and by half of it midway."""
    V = SHAPES["tower"](width=4.0, height=8.0, taper=1.0, twist=30.0, edge=0.1).V
    for share in (0, 0.5, 1):
        x, y, _ = V[np.isclose(V[:, 2], 8 * share)].T
        corner = np.argmax(np.hypot(x, y))
        assert np.degrees(np.arctan2(y[corner], x[corner])) % 90 == pytest.approx(45 + 30 * share, abs=1.5)
    x, y, _ = V[V[:, 2] == 8].T
    assert np.hypot(x, y).max() == pytest.approx(2 * 2**0.25, rel=1e-3)  # taper 1: |x|^4 + |y|^4 = 2^4


def test_a_tower_that_twists_too_much_for_its_height_is_refused():
    """It may move sideways by one and a half times its height: 10 m high and 4.5 m from the axis, 191 degrees."""
    SHAPES["tower"](width=9.0, height=10.0, twist=-190.0, edge=1.0)
    with pytest.raises(SurfaceError, match="192 degrees is too much"):
        SHAPES["tower"](width=9.0, height=10.0, twist=192.0, edge=1.0)
