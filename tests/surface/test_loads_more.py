"""Line loads, snow and wind: totals in closed form, what they are on, that edge unknowns feel them, what is refused."""

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import TypeAdapter

from dsfab.core.errors import SurfaceError
from dsfab.statics import Elements, Material, SheetModel, elements_of, solve_statics, spread_load
from dsfab.surface import (
    All,
    Ball,
    Boundary,
    Box,
    Facing,
    Force,
    Line,
    Load,
    LoadCase,
    Pressure,
    Side,
    Snow,
    Support,
    Surface,
    Vertices,
    Wind,
    faces_without_upper_side,
)
from dsfab.surface.loads.load_case import outward_normals
from dsfab.surface.shapes import cylinder, dome, plate, sphere
from tests.shapes import arch, box, grid, jittered, joined, tube

BEST = elements_of("displacement")

HELD = [Support(Vertices((0,)))]
STEEL = Material(210e9, 0.3)


def total(surface, *loads):
    return LoadCase.build(surface, HELD, loads).force.sum(axis=0)


def inside_out(surface):
    """The same with all faces turned over."""
    return Surface(surface.V, surface.F[:, ::-1])


def centred_box(length: float, width: float, height: float) -> Surface:
    """A closed box of twelve triangles around the origin, normals outwards."""
    half = np.array([length, width, height]) / 2
    return box(-half, half)


@pytest.mark.parametrize("turn", [lambda s: s, inside_out])
def test_snow_sums_to_its_pressure_times_the_plan_area(turn):
    """The plan of a cap is the polygon of its rim, whichever way its normals point."""
    s = turn(dome(edge=0.8))
    rim = s.V[s.loops[0]]
    plan = abs(0.5 * np.sum(rim[:, 0] * np.roll(rim[:, 1], -1) - rim[:, 1] * np.roll(rim[:, 0], -1)))
    assert plan == pytest.approx(np.pi * 25, rel=2e-2)
    assert_allclose(total(s, Snow(900.0)), [0, 0, -900 * plan], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("turn", [lambda s: s, inside_out])
def test_snow_lies_on_the_upper_half_of_a_closed_surface(turn):
    s = turn(sphere(radius=2.0, edge=0.25))
    force = LoadCase.build(s, HELD, [Snow(900.0)]).force
    assert force[:, 2].sum() == pytest.approx(-900 * np.pi * 4, rel=1e-2)
    assert not force[s.V[:, 2] < s.V[:, 2].mean() - 0.5].any()
    b = turn(centred_box(3.0, 2.0, 1.0))
    assert_allclose(total(b, Snow(900.0)), [0, 0, -900 * 6], atol=1e-9)


def test_slanting_snow_is_on_the_shadow_along_its_direction():
    s = plate(length=4.0, width=2.0, edge=0.5)
    assert_allclose(total(s, Snow(50.0, (3.0, 0.0, -4.0))), 50 * 8 * 0.8 * np.array([0.6, 0, -0.8]), atol=1e-9)
    half = Box((-2, -1, -1), (0, 1, 1))
    share = s.areas[s.faces_of(half.vertices(s))].sum()
    assert_allclose(total(s, Snow(50.0, at=half)), [0, 0, -50 * share], atol=1e-9)


@pytest.mark.parametrize("turn", [lambda s: s, inside_out])
def test_wind_presses_the_windward_wall_and_sucks_at_the_leeward_wall(turn):
    """A box across the wind: 0.8 q and 0.5 q on the two walls [EN 1991-1-4, zones D and E], nothing along it."""
    b, q = turn(centred_box(3.0, 2.0, 5.0)), 600.0
    for face, c in (((-1, 0, 0), -0.8), ((1, 0, 0), 0.5)):
        wall = np.isclose(b.centroids[:, 0], 1.5 * face[0])
        traction = Wind(q, (1.0, 0, 0)).traction(b)
        assert_allclose(traction[wall], np.tile(c * q * np.array(face), (2, 1)), atol=1e-9)
    assert_allclose(total(b, Wind(q, (2.0, 0, 0))), [1.3 * q * 10, 0, 0], atol=1e-9)
    slant = total(b, Wind(q, (1.0, -1.0, 0.0)))
    assert_allclose(slant, 1.3 * q / np.sqrt(2) * np.array([2 * 5, -3 * 5, 0]), atol=1e-9)
    only_suction = total(b, Wind(q, (1.0, 0, 0), windward=0.0, leeward=0.3))
    assert_allclose(only_suction, [0.3 * q * 10, 0, 0], atol=1e-9)


def test_the_outside_of_a_roof_is_its_upper_side_whichever_way_its_faces_turn():
    """Vertical force of wind across a half cylinder: -q (0.8 - 0.5) R L / 2, from the integral of sin cos."""
    roof = arch(3.0, 90.0, along=32, across=8)
    wind = Wind(600.0, (1.0, 0, 0))
    expected = total(roof, wind)
    assert_allclose(total(inside_out(roof), wind), expected, atol=1e-9)
    assert expected[2] == pytest.approx(-0.3 * 600 * 8 * 3 / 2, rel=5e-3)
    two = joined(roof, inside_out(Surface(roof.V + [20.0, 0, 0], roof.F)))
    assert_allclose(total(two, wind), 2 * expected, atol=1e-6)
    assert not faces_without_upper_side(two).any()


@pytest.mark.parametrize("flare", [-0.2, 0.0, 0.2])
def test_the_outside_of_an_open_tower_is_the_side_of_its_faces_whether_it_widens_or_narrows(flare):
    """Wind along x: 0.8 q and 0.5 q on half of the perimeter; the lean of the wall takes little."""
    tower = tube(64, 8, 3.0, 8.0)
    tower = Surface(tower.V * np.where([True, True, False], 1 + flare * tower.V[:, 2:] / 8, 1.0), tower.F)
    pressed, sucked = (
        Wind(600.0, (1.0, 0, 0), *c).traction(tower)[:, 0] @ tower.areas for c in ((0.8, 0.0), (0.0, 0.5))
    )
    assert pressed / sucked == pytest.approx(1.6, rel=1e-6)
    beside = joined(tower, inside_out(centred_box(3.0, 2.0, 5.0)))
    box_faces = np.arange(beside.m) >= tower.m
    assert_array_equal(faces_without_upper_side(beside), ~box_faces)
    assert_allclose(outward_normals(beside)[box_faces], -beside.normals[box_faces])


def test_wind_on_a_sphere_is_the_integral_of_the_squared_cosine():
    """q (0.8 + 0.5) times the integral of cos^2 over a hemisphere, 2 pi R^2 / 3; flat facets approach it as h^2."""
    d, exact = np.array([0.6, 0.8, 0.0]), 1.3 * 400 * 2 * np.pi / 3
    error = [np.linalg.norm(total(sphere(radius=1.0, edge=h), Wind(400.0, tuple(d))) - exact * d) for h in (0.4, 0.1)]
    assert error[1] < 5e-3 * exact
    assert error[0] > 8 * error[1]


def test_a_line_load_sums_to_its_share_per_metre_times_the_length():
    s = jittered(grid(8, 5, 2.0, 1.0))
    case = LoadCase.build(s, HELD, [Line(Side("x", "max"), (10.0, 0.0, -300.0))])
    assert_allclose(case.force.sum(axis=0), [10, 0, -300], rtol=1e-12)
    end = np.isclose(s.V[:, 0], 2)
    corner = end & (np.isclose(s.V[:, 1], 0) | np.isclose(s.V[:, 1], 1))
    assert_allclose(case.force[corner, 2], -300 / 10)
    assert_allclose(case.force[end & ~corner, 2], -300 / 5)
    assert_array_equal(case.loaded, end)


def test_a_line_load_on_boundary_loops_skips_inner_edges():
    """On a ring one face wide every edge has both ends picked; only the free ones are the line."""
    s = dome(edge=0.9, oculus=3.9)
    length = [np.linalg.norm(s.V[loop] - np.roll(s.V[loop], -1, axis=0), axis=1).sum() for loop in s.loops]
    assert_allclose(total(s, Line(Boundary(1), (0, 0, -7.0)))[2], -7 * length[1], rtol=1e-12)
    assert_allclose(total(s, Line(All(), (0, 0, -7.0)))[2], -7 * sum(length), rtol=1e-12)


def test_a_line_load_runs_along_a_path_within_the_sheet():
    s = grid(8, 4, 2.0, 1.0)
    ridge = Box((1.0, 0, 0), (1.0, 1.0, 0))
    case = LoadCase.build(s, HELD, [Line(ridge, (0, 0, -40.0), edges="all")])
    assert_allclose(case.force.sum(axis=0), [0, 0, -40], rtol=1e-12)
    assert_array_equal(case.loaded, np.isclose(s.V[:, 0], 1.0))
    with pytest.raises(SurfaceError, match=r"is on no free edge.*edges = 'all'"):
        LoadCase.build(s, HELD, [Line(ridge, (0, 0, -40.0))])


@pytest.mark.parametrize(
    "load", [Snow(800.0, (0.2, 0, -1.0)), Wind(500.0, (1.0, 0.5, 0.0)), Line(Boundary(), (3.0, -2.0, 9.0))], ids=str
)
@pytest.mark.parametrize("name", ["dome", "cylinder", "box"])
def test_a_spread_load_gives_the_same_vertex_forces(name, load):
    s = {"dome": dome(edge=1.0), "cylinder": cylinder(edge=1.0), "box": centred_box(1.0, 2.0, 3.0)}[name]
    if isinstance(load, Line) and s.is_closed:
        load = Line(All(), load.per_metre, "all")
    spread = spread_load(s, [load])
    assert_allclose(spread.vertex_forces(s), LoadCase.build(s, HELD, [load]).force, atol=1e-9)
    twice = spread_load(s, [load, load, Force(Vertices((1,)), (0, 0, 1.0))])
    assert_allclose(twice.bubble_forces(s, BEST), 2 * spread.bubble_forces(s, BEST), atol=1e-9)


def test_snow_and_wind_across_a_flat_sheet_are_pressures_on_edge_unknowns_too():
    s = jittered(grid(6, 4, 2.0, 1.0))
    want = spread_load(s, [Pressure(1000.0)]).bubble_forces(s, BEST)
    assert np.abs(want).max() > 0
    for load in (Snow(1000.0), Wind(2000.0, (0, 0, 1.0)), Wind(1250.0, (0, 0, -1.0))):
        sign = -1 if load.direction[2] > 0 else 1
        assert_allclose(spread_load(s, [load]).bubble_forces(s, BEST), sign * want, atol=1e-9)


def test_a_line_load_pulls_quadratic_elements_into_uniform_strain():
    """Half of an edge's load to its ends and two thirds on its bubble: the patch test holds only with both."""
    s, h = jittered(grid(6, 4, 2.0, 1.0)), 0.01
    supports = [Support(Side("x", "min"), "x"), Support(Vertices((0,)), "xy")]
    loads = [Line(Side("x", "max"), (1e5, 0.0, 0.0))]
    case = LoadCase.build(s, supports, loads)
    answer = solve_statics(SheetModel(s, STEEL, h), case, Elements("quadratic", "hhj"), spread_load(s, loads))
    strain = 1e5 / h / STEEL.young
    assert_allclose(answer.u[:, 0], strain * s.V[:, 0], atol=1e-9 * strain)
    assert_allclose(answer.bubbles, 0, atol=1e-9 * strain)
    without = solve_statics(SheetModel(s, STEEL, h), case, Elements("quadratic", "hhj"))
    assert np.abs(without.bubbles).max() > 1e-3 * strain


def test_a_cantilever_under_a_line_and_under_snow_bends_as_a_beam():
    """P L^3 / (3 E I) and q L^4 / (8 E I) of a strip with nu = 0."""
    s, h, material = grid(12, 2, 2.0, 0.2), 0.01, Material(210e9, 0.0)
    root, tip = np.isclose(s.V[:, 0], 0), np.isclose(s.V[:, 0], 2)
    clamped = root[s.edges.ends].all(axis=1)
    EI = material.young * h**3 / 12
    for load, exact in ((Line(Side("x", "max"), (0, 0, -30.0)), 30 * 8 / 3 / EI), (Snow(20.0), 20 * 16 / 8 / EI)):
        case = LoadCase.build(s, [Support(Side("x", "min"))], [load])
        answer = solve_statics(SheetModel(s, material, h, clamped=clamped), case, BEST, spread_load(s, [load]))
        assert_allclose(-answer.u[tip, 2].mean(), exact, rtol=2e-3)


def _pair(elements: Elements):
    return elements.membrane, elements.bending


@pytest.mark.parametrize(
    ("load", "says"),
    [
        (Snow(0.0), "kind 'snow' needs a positive pressure"),
        (Snow(-5.0), "kind 'snow' needs a positive pressure in pascals, not -5"),
        (Snow(1.0, (0, 0, 0)), "needs a direction"),
        (Snow(1.0, (1.0, 0, 0)), "misses every picked face"),
        (Snow(1.0, at=Vertices((0,))), "kind 'snow' is on no face"),
        (Wind(0.0, (1.0, 0, 0)), "kind 'wind' needs a positive pressure"),
        (Wind(1.0, (1.0, 0, 0)), "is parallel to every picked face"),
        (Wind(1.0, (0, 0, 1.0), 0.8, 0.0), "has no coefficients"),
        (Wind(1.0, (0, 0, 1.0), at=Vertices((0,))), "kind 'wind' is on no face"),
        (Line(All(), (0, 0, 0)), "kind 'line' is zero"),
        (Line(Vertices((0,)), (0, 0, 1.0)), "is on no free edge"),
        (Line(Ball((0, 0, 0), 0.1), (0, 0, 1.0), "all"), "is on no edge"),
    ],
)
def test_loads_on_nothing_and_loads_of_nothing_are_refused(load, says):
    with pytest.raises(SurfaceError, match=says):
        LoadCase.build(plate(edge=1.0), HELD, [load])


TOML = """
[[load]]
kind = "snow"
pressure = 900
[[load]]
kind = "wind"
pressure = 600
direction = [1, 0, 0]
leeward = 0.3
at = { pick = "facing", direction = [0, 0, 1], angle = 60 }
[[load]]
kind = "line"
at = { pick = "boundary", loop = 1 }
per_metre = [0, 0, -5000]
"""


def test_the_kinds_come_from_toml():
    loads = TypeAdapter(list[Load]).validate_python(tomllib.loads(TOML)["load"])
    assert loads == [
        Snow(900.0),
        Wind(600.0, (1, 0, 0), leeward=0.3, at=Facing((0, 0, 1), 60.0)),
        Line(Boundary(1), (0, 0, -5000.0)),
    ]
