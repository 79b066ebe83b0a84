"""Supports, loads and pickers: totals in closed form, what is picked, what is refused, and TOML through pydantic."""

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import TypeAdapter, ValidationError

from dsfab.core.errors import SurfaceError
from dsfab.surface import (
    FIGURES,
    SHAPES,
    All,
    Ball,
    Boundary,
    Box,
    Facing,
    Force,
    Load,
    LoadCase,
    Nearest,
    Picker,
    Pressure,
    SelfWeight,
    Side,
    Snow,
    Support,
    Surface,
    Vertices,
)
from dsfab.surface.shapes import cylinder, dome, plate, sphere


@pytest.mark.parametrize(
    ("slope", "factor"), [(0, 0.8), (15, 0.8), (30, 0.8), (40, 0.8 * 20 / 30), (45, 0.4), (55, 0.8 * 5 / 30), (60, 0.0)]
)
def test_snow_with_a_shape_factor_follows_the_table_of_the_code(slope, factor):
    """A plate at a slope carries mu_1 s_k on its plan [EN 1991-1-3, table 5.2], and a vertical wall none."""
    a, flat = np.radians(slope), plate(length=2.0, width=3.0, edge=0.5)
    x, y, _ = flat.V.T
    roof = Surface(np.stack([x * np.cos(a), y, x * np.sin(a)], axis=1), flat.F)
    if factor == 0:
        with pytest.raises(SurfaceError, match="steeper than 60 degrees"):
            Snow(1000.0, shape="mu1").forces(roof, 0.0)
        return
    total = Snow(1000.0, shape="mu1").forces(roof, 0.0).sum(axis=0)
    assert_allclose(total, [0, 0, -1000 * factor * 6 * np.cos(a)], atol=1e-6)
    assert_allclose(total, factor * Snow(1000.0, kind="imposed").forces(roof, 0.0).sum(axis=0), atol=1e-6)


FEET = Support(Side("z", "min"))
ZOO = {name: make(edge=2.5 * make().mean_edge) for name, make in SHAPES.items() if name not in FIGURES}


def build(surface, *loads, supports=None, weight=0.0):
    return LoadCase.build(surface, supports or [Support(Vertices((0,)))], loads, weight)


@pytest.mark.parametrize("name", ZOO)
def test_pressure_sums_to_minus_pressure_times_the_vector_area(name):
    """On a closed surface that is zero; on an open one it depends on the boundary alone (1/2 sum of p x q)."""
    s = ZOO[name]
    total = build(s, Pressure(1500.0)).force.sum(axis=0)
    loops = [s.V[loop] for loop in s.loops]
    vector_area = sum((0.5 * np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0) for P in loops), np.zeros(3))
    assert_allclose(total, -1500 * vector_area, atol=1e-12 * 1500 * s.area)


def test_pressure_on_a_cap_is_pressure_times_the_area_of_its_shadow():
    s = dome(edge=0.8)
    rim = s.V[s.loops[0]]
    shadow = 0.5 * np.sum(rim[:, 0] * np.roll(rim[:, 1], -1) - rim[:, 1] * np.roll(rim[:, 0], -1))
    total = build(s, Pressure(200.0)).force.sum(axis=0)
    assert_allclose(total, [0, 0, -200 * shadow], rtol=1e-12, atol=1e-9)
    assert shadow == pytest.approx(np.pi * 25, rel=2e-2)


def test_pressure_has_no_moment_on_a_closed_surface():
    s = sphere(edge=0.7)
    force = build(s, Pressure(1e4)).force
    assert_allclose(np.cross(s.V, force).sum(axis=0), 0, atol=1e-9)


def test_pressure_stays_on_faces_with_all_corners_picked():
    s = plate(length=4.0, width=2.0, edge=0.5)
    half = Box((-2, -1, -1), (0.0, 1, 1))
    force = build(s, Pressure(3.0, half)).force
    faces = s.faces_of(half.vertices(s))
    assert 0 < faces.sum() < s.m
    assert_allclose(force.sum(axis=0), [0, 0, -3 * s.areas[faces].sum()])
    assert not force[~np.isin(np.arange(s.n), s.F[faces])].any()


@pytest.mark.parametrize("name", ZOO)
def test_self_weight_sums_to_weight_times_area_downwards(name):
    s = ZOO[name]
    case = build(s, SelfWeight(), weight=250.0)
    assert_allclose(case.force.sum(axis=0), [0, 0, -250 * s.area], rtol=1e-12, atol=1e-9)
    assert (case.force[:, 2] < 0).all()
    assert not case.loaded.any()
    tilted = build(s, SelfWeight((3.0, 0.0, -4.0)), weight=250.0).force.sum(axis=0)
    assert_allclose(tilted, 250 * s.area * np.array([0.6, 0, -0.8]), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("name", ZOO)
def test_force_keeps_its_total_and_spreads_by_vertex_area(name):
    s = ZOO[name]
    where = Side("z", "max", depth=0.4)
    case = build(s, Force(where, (10.0, -20.0, -700.0)), supports=(Support(Vertices((s.n - 1,))),))
    assert_allclose(case.force.sum(axis=0), [10, -20, -700], rtol=1e-12)
    picked = where.vertices(s)
    assert_array_equal(case.loaded, picked)
    assert_array_equal(case.force.any(axis=1), picked)
    per_area = case.force[picked, 2] / s.vertex_areas[picked]
    assert np.ptp(per_area) < 1e-9 * abs(per_area[0])


def test_a_force_on_one_vertex_is_a_point_force():
    s = plate(edge=1.0)
    case = build(s, Force(Nearest(((0.0, 0.0, 0.0),)), (0, 0, -5e3)))
    assert (case.force[:, 2] != 0).sum() == 1
    assert case.force[case.loaded][0, 2] == -5e3


def test_loads_and_supports_add_up_and_loaded_marks_forces_only():
    s = dome(edge=1.0)
    loads = (SelfWeight(), Pressure(100.0), Force(Ball((0, 0, 3), 0.5), (0, 0, -1e3)))
    case = LoadCase.build(s, [FEET], loads, weight=200.0)
    assert_allclose(case.force, sum(build(s, load, supports=[FEET], weight=200.0).force for load in loads))
    assert_array_equal(case.loaded, Ball((0, 0, 3), 0.5).vertices(s))
    both = LoadCase.build(s, [FEET, Support(Vertices((0,)), "x")], loads, weight=200.0)
    assert_array_equal(both.fixed[0], [True, False, False])
    assert_array_equal(both.supported, case.supported | (np.arange(s.n) == 0))


@pytest.mark.parametrize("hold", ["xyz", "xy", "xz", "yz", "x", "y", "z"])
def test_each_support_holds_only_its_directions(hold):
    s = plate(edge=1.0)
    case = build(s, SelfWeight((1.0, 1.0, 1.0)), supports=[Support(Side("x", "min"), hold)], weight=1.0)
    at = np.isclose(s.V[:, 0], -3)
    assert_array_equal(case.fixed, at[:, None] & [axis in hold for axis in "xyz"])
    assert_array_equal(case.supported, at)


def test_each_picker_picks_its_vertices():
    s = plate(length=6.0, width=4.0, edge=0.5)
    x, y, _ = s.V.T
    assert All().vertices(s).all()
    assert_array_equal(Box((-1, -1, -1), (1, 1, 1)).vertices(s), (abs(x) <= 1 + 1e-9) & (abs(y) <= 1 + 1e-9))
    assert_array_equal(Ball((0, 0, 0), 1.23).vertices(s), np.hypot(x, y) <= 1.23)
    assert_array_equal(Side("x", "max").vertices(s), np.isclose(x, 3))
    assert_array_equal(Side("y", "min", depth=0.9).vertices(s), y <= -2 + 0.9)
    near = Nearest(((-3.1, -2.1, 0), (3.0, 2.0, 1.0))).vertices(s)
    assert_allclose(s.V[near], [[-3, -2, 0], [3, 2, 0]])
    assert_array_equal(Boundary().vertices(s), np.isclose(abs(x), 3) | np.isclose(abs(y), 2))
    assert_array_equal(np.flatnonzero(Vertices((4, 2, 4)).vertices(s)), [2, 4])


def test_boundary_loops_are_picked_longest_first():
    s = dome(edge=0.6, oculus=1.0)
    radius = np.hypot(s.V[:, 0], s.V[:, 1])
    assert_array_equal(Boundary(0).vertices(s), np.isclose(radius, 5))
    assert_array_equal(Boundary(1).vertices(s), np.isclose(radius, 1))
    assert_array_equal(Boundary().vertices(s), np.isclose(radius, 5) | np.isclose(radius, 1))


def test_facing_compares_vertex_normals():
    s = sphere(radius=1.0, edge=0.15)
    off = np.degrees(np.arccos(np.clip(s.V[:, 2], -1, 1)))  # of an exact sphere's normals
    picked = Facing((0, 0, 2.0), 40.0).vertices(s)
    assert picked[off < 39.5].all()
    assert not picked[off > 40.5].any()
    assert Facing((0, 0, 1), 180.0).vertices(s).all()
    assert Facing((0, 0, -1), 0.0).vertices(s).sum() == 1


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_sides_do_not_depend_on_the_size(scale):
    s = plate(edge=0.5)
    rng = np.random.default_rng(0)
    noisy = Surface((s.V + 1e-9 * rng.standard_normal(s.V.shape)) * scale, s.F)
    assert_array_equal(Side("x", "min").vertices(noisy), np.isclose(s.V[:, 0], -3))


@pytest.mark.parametrize(
    ("picker", "says"),
    [
        (Box((9, 9, 9), (10, 10, 10)), r"pick = 'box' with min = \(9, 9, 9\), .*nearest vertex is .* m out of reach"),
        (Box((1, 0, 0), (0, 1, 1)), "has min beyond max"),
        (
            Ball((0, 0, 10), 1.0),
            r"pick = 'ball' .*nearest vertex is 9 m out of reach .*box is \(-3, -2, 0\) to \(3, 2, 0\)",
        ),
        (Nearest(()), "pick = 'nearest' .*picks no vertex"),
        (Boundary(1), "has 1 boundary loops, so use loop = 0 to 0"),
        (Facing((1, 0, 0), 10.0), "the nearest normal is 90 degrees away"),
        (Facing((0, 0, 0)), "needs a direction that is not zero"),
        (Vertices((0, 10_000)), r"names 1 vertex \(first: 10000\) that the surface lacks"),
        (Vertices(()), "picks no vertex"),
    ],
)
def test_an_empty_pick_is_refused_with_its_values_and_the_distance(picker, says):
    with pytest.raises(SurfaceError, match=says):
        picker.vertices(plate(edge=1.0))


def test_a_closed_surface_has_no_boundary_to_pick():
    with pytest.raises(SurfaceError, match="the surface is closed"):
        Boundary().vertices(sphere(edge=1.0))


@pytest.mark.parametrize(
    ("supports", "loads", "weight", "says"),
    [
        ([], [Pressure(1.0)], 0.0, "has no support"),
        ([FEET], [], 0.0, "has no load"),
        ([FEET], [SelfWeight()], 0.0, "needs a sheet with weight"),
        ([FEET], [SelfWeight((0.0, 0.0, 0.0))], 1.0, "needs a direction"),
        ([FEET], [Pressure(0.0)], 0.0, "kind 'pressure' is zero"),
        ([FEET], [Pressure(1.0, Vertices((0,)))], 0.0, "is on no face"),
        ([FEET], [Pressure(float("inf"))], 0.0, "not a finite number"),
        ([FEET], [Force(All(), (0, 0, 0))], 0.0, "kind 'force' is zero"),
        ([FEET], [Force(Side("z", "min"), (0, 0, -1.0))], 0.0, "all loads act on fixed vertices"),
        (
            [FEET],
            [Force(Side("z", "max"), (0, 0, -1.0)), Force(Side("z", "max"), (0, 0, 1.0))],
            0.0,
            "cancel each other",
        ),
    ],
)
def test_impossible_load_cases_are_refused(supports, loads, weight, says):
    with pytest.raises(SurfaceError, match=says), np.errstate(invalid="ignore"):
        LoadCase.build(cylinder(edge=1.0), supports, loads, weight)


def test_a_force_on_vertices_without_faces_is_refused():
    s = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
    with pytest.raises(SurfaceError, match="vertices without faces"):
        build(s, Force(Vertices((3,)), (0, 0, -1.0)))


TOML = """
[[support]]
at = { pick = "side", axis = "z", end = "min" }
[[support]]
at = { pick = "nearest", points = [[0, 0, 3]] }
hold = "xy"
[[load]]
kind = "force"
at = { pick = "ball", center = [0, 0, 3], radius = 0.5 }
force = [0, 0, -1000]
[[load]]
kind = "pressure"
pressure = 500
[[load]]
kind = "self_weight"
"""


def test_supports_and_loads_come_from_toml():
    table = tomllib.loads(TOML)
    supports = TypeAdapter(list[Support]).validate_python(table["support"])
    loads = TypeAdapter(list[Load]).validate_python(table["load"])
    assert supports == [FEET, Support(Nearest(((0, 0, 3),)), "xy")]
    assert loads == [Force(Ball((0, 0, 3), 0.5), (0, 0, -1000)), Pressure(500.0), SelfWeight()]
    assert LoadCase.build(dome(edge=1.0), supports, loads, 100.0).supported.sum() > 1


@pytest.mark.parametrize(
    ("kind", "table", "says"),
    [
        (Picker, {"pick": "side", "axis": "z", "end": "min", "dept": 1}, "dept"),
        (Picker, {"pick": "blob"}, "'box'"),
        (Picker, {"axis": "z", "end": "min"}, "discriminator"),
        (Picker, {"pick": "side", "axis": "w", "end": "min"}, "'x', 'y' or 'z'"),
        (Picker, {"pick": "side", "axis": "z", "end": "min", "depth": -1}, "greater than or equal to 0"),
        (Picker, {"pick": "ball", "center": [0, 0], "radius": 1}, "center"),
        (Picker, {"pick": "ball", "center": [0, 0, 0], "radius": 0}, "greater than 0"),
        (Picker, {"pick": "ball", "center": [0, float("nan"), 0], "radius": 1}, "finite number"),
        (Picker, {"pick": "nearest", "points": []}, "at least 1 item"),
        (Picker, {"pick": "vertices", "indices": [-1]}, "greater than or equal to 0"),
        (Picker, {"pick": "boundary", "loop": "longest"}, "loop"),
        (Picker, {"pick": "facing", "direction": [0, 0, 1], "angle": 190}, "less than or equal to 180"),
        (Support, {"at": {"pick": "all"}, "hold": "zyx"}, "'xyz'"),
        (Support, {"at": {"pick": "all"}, "fix": "xyz"}, "fix"),
        (Load, {"kind": "force", "at": {"pick": "all"}}, "force"),
        (Load, {"kind": "gale"}, "'pressure'"),
        (Load, {"kind": "pressure", "pressure": float("inf")}, "finite number"),
        (Load, {"kind": "self_weight", "factor": 2}, "factor"),
    ],
)
def test_wrong_tables_are_refused_by_pydantic_with_the_key(kind, table, says):
    with pytest.raises(ValidationError, match=says):
        TypeAdapter(kind).validate_python(table)


@pytest.mark.parametrize(("letters", "fits"), [(40, True), (41, False)])
def test_a_name_has_up_to_forty_letters_so_that_it_fits_a_column(letters, fits):
    text = {"at": {"pick": "all"}, "name": letters * "a"}
    if fits:
        assert TypeAdapter(Support).validate_python(text).name == letters * "a"
        return
    with pytest.raises(ValidationError, match="must be up to 40 letters"):
        TypeAdapter(Support).validate_python(text)
