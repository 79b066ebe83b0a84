"""Snow and wind on roofs by EN 1991-1-3 and EN 1991-1-4: sums by hand, for six shapes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab.core.errors import SurfaceError
from dsfab.surface import Box, LoadCase, Snow, Support, Surface, Vertices, Wind, refined_surface
from dsfab.surface.shapes import plate
from tests.shapes import arch, box, grid, joined, moebius

HELD = [Support(Vertices((0,)))]
Q, LENGTH = 600.0, 8.0


def total(surface, load):
    return LoadCase.build(surface, HELD, [load]).force.sum(axis=0)


def pitched(left, right, length=10.0):
    """A roof of two slopes (degrees, positive upwards along x) that meet in the middle."""
    flat = grid(20, 8, length, LENGTH)
    x = flat.V[:, 0] - length / 2
    rise = np.where(x < 0, np.tan(np.radians(left)), np.tan(np.radians(right))) * x
    return Surface(np.stack([x, flat.V[:, 1], rise], axis=1), flat.F)


def bent(height, length=10.0, width=LENGTH):
    """A roof over a rectangle; its height is a function of x and y."""
    flat = grid(40, 40, length, width)
    x, y = flat.V[:, 0] - length / 2, flat.V[:, 1] - width / 2
    return Surface(np.stack([x, y, height(x, y)], axis=1), flat.F)


def pyramid(degrees, half=5.0):
    """A roof with four equal slopes over a square."""
    return bent(lambda x, y: -np.tan(np.radians(degrees)) * np.maximum(np.abs(x), np.abs(y)), 2 * half, 2 * half)


def upright():
    flat = grid(4, 4, 1.0, 1.0)
    return Surface(flat.V[:, [0, 2, 1]], flat.F)


@pytest.mark.parametrize(("half_angle", "eaves", "windward"), [(90.0, 0.0, 0.8), (60.0, 0.0, 1.6 * 0.2887)])
@pytest.mark.parametrize("faces_down", [False, True])
def test_a_vault_across_the_wind_has_four_equal_parts_of_its_arc(half_angle, eaves, windward, faces_down):
    """By hand, figure 7.11: c = A, B, B, C on quarters of the arc; the force of a part is -q c L times its chord,
    turned by a right angle."""
    radius, depth = 5.0, 10.0 * np.sin(np.radians(half_angle))
    f = 5.0 * (1 - np.cos(np.radians(half_angle))) / depth
    roof = arch(radius, half_angle)
    roof = Surface(roof.V, roof.F[:, ::-1]) if faces_down else roof
    ends = np.radians(half_angle) * np.linspace(-1, 1, 5)
    x, z = radius * np.sin(ends), radius * np.cos(ends)
    expected = sum(
        -Q * c * LENGTH * np.array([-(z[k + 1] - z[k]), 0, x[k + 1] - x[k]])
        for k, c in enumerate((windward, -0.7 - f, -0.7 - f, -0.4))
    )
    force = total(roof, Wind(Q, (1.0, 0, 0), shape="vault", eaves=eaves))
    assert_allclose(force, expected, rtol=1e-2, atol=1.0)
    assert force[2] > 0  # row 3 of the former faults: the vault was pressed down
    back = total(roof, Wind(Q, (-1.0, 0, 0), shape="vault", eaves=eaves))
    assert_allclose(back, expected * [-1, 1, 1], rtol=1e-2, atol=1.0)


def test_a_vault_on_walls_has_the_coefficients_of_a_published_example():
    """d = 9.6 m, f = 2.51 m, h = 3.2 m: A +0.25 (0.42 on the ground, 0.16 high up), B -0.96, C -0.40; read from figure
    7.11 by civil-engineering-design.com, 'Wind action evaluation on vaulted roofs', 2021."""
    radius = (4.8**2 + 2.51**2) / (2 * 2.51)
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    unturned = arch(radius, np.degrees(np.arcsin(4.8 / radius)))
    roof, d = Surface(unturned.V @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), unturned.F), (c, s, 0.0)
    for eaves, a in ((0.0, 0.42), (3.2, 0.25), (4.8, 0.16), (9.0, 0.16)):
        traction = Wind(1.0, d, shape="vault", eaves=eaves).traction(roof)
        c = -np.einsum("mi,mi->m", traction, np.where(roof.normals[:, 2:] > 0, roof.normals, -roof.normals))
        order = np.argsort(roof.centroids @ d)
        assert_allclose(c[order][[0, roof.m // 2, -1]], [a, -0.96, -0.40], atol=0.006)
    flat = arch(40.0, 20.0)
    lifted = Wind(1.0, (1.0, 0, 0), shape="vault", eaves=20.0).traction(flat)[np.argmin(flat.centroids[:, 0])]
    assert lifted[2] > 0  # f is below 0.2, and the eaves are high: suction on the windward part, too
    assert np.linalg.norm(lifted) == pytest.approx(1.2)


CANOPIES = {
    "flat": (plate(length=10.0, width=8.0, edge=1.0), 0.3, -0.55),  # two slopes of 0 degrees, between -5 and 5
    "one slope": (pitched(20, 20), 0.8, -1.3),  # table 7.6, 20 degrees
    "ridge": (pitched(15, -15), 0.4, -0.8),  # table 7.7, ridge of 15 degrees; table 7.6 at 0 has less
    "trough": (pitched(-20, 20), 0.7, -0.7),  # table 7.7, trough of -20 degrees
    "steep ridge": (pitched(30, -30), 0.9, -1.0),
    "arch": (arch(20.0, 25.0), 0.4, -0.75),  # a mean slope of 12.5 degrees counts as a ridge
    "long arch": (arch(20.0, 25.0, length=80.0, across=40), 0.4, -0.75),
    "trough along x": (bent(lambda x, y: 0.1 * np.abs(y)), 0.314, -0.514),  # 5.7 degrees
    "saddle": (bent(lambda x, y: 0.05 * (x**2 - y**2)), 0.66, -0.83),  # trough of 19, ridge of 16 degrees
    "waves": (bent(lambda x, y: 0.08 * np.sin(4 * x)), 0.42, -0.72),  # ridges and troughs of 11.5 degrees
    "pyramid": (pyramid(29.9), 0.9, -1.0),  # all four faces have this slope
}


@pytest.mark.parametrize("name", CANOPIES)
def test_an_open_canopy_is_pressed_and_lifted_by_its_force_coefficients(name):
    """Vertical force: -q c times the plan area, for every face has the same net pressure. The tables hold for wind from
    all sides."""
    roof, down, up = CANOPIES[name]
    plan = float(np.abs(roof.areas @ roof.normals[:, 2]))
    for turned in (roof, Surface(roof.V, roof.F[:, ::-1])):
        for shape, c in (("canopy down", down), ("canopy up", up)):
            for direction in ((1.0, 0, 0), (0, 1.0, 0), (1.0, -2.0, 0)):
                force = total(turned, Wind(Q, direction, shape=shape))
                assert force[2] == pytest.approx(-Q * c * plan, rel=0.02)


@pytest.mark.parametrize(
    ("roof", "down", "up"),
    [(pitched(15, -15), 0.4, -0.8), (pitched(20, 20), 1.6, -2.6), (pitched(0, 0), 0.4, -1.0)],
    ids=["two slopes", "one slope", "flat"],
)
def test_wind_on_half_of_a_canopy_loads_one_slope_or_acts_at_a_quarter_of_the_depth(roof, down, up):
    """Figure 7.17: the coefficient on one of two slopes. Figure 7.16: all of the force at d/4, so twice on one half."""
    half = float(np.abs(roof.areas @ roof.normals[:, 2])) / 2
    for shape, c in (("canopy down half", down), ("canopy up half", up)):
        for side in (1.0, -1.0):
            forces = LoadCase.build(roof, HELD, [Wind(Q, (side, 0, 0), shape=shape)]).force
            assert forces[:, 2].sum() == pytest.approx(-Q * c * half, rel=1e-6)
            assert forces[:, 2] @ roof.V[:, 0] / forces[:, 2].sum() == pytest.approx(-2.5 * side, rel=0.03)


@pytest.mark.parametrize(("eaves", "e"), [(1.5, 3.0), (3.0, 6.0), (40.0, 8.0)])
def test_a_flat_roof_on_walls_has_the_suction_of_its_zones(eaves, e):
    """Areas of zones F, G, H and I by hand, figure 7.6, for wind along x on 10 m x 8 m: e = min(8 m, 2 h)."""
    flat = grid(200, 160, 10.0, 8.0)
    corners, strip, behind = 2 * e / 4 * e / 10, 8.0 * e / 10, 8.0 * e / 2
    for shape, inner in (("flat up", -0.2), ("flat down", 0.2)):
        force = total(flat, Wind(Q, (1.0, 0, 0), shape=shape, eaves=eaves))
        c = [-1.8 * corners, -1.2 * (strip - corners), -0.7 * (behind - strip), inner * (80.0 - behind)]
        assert force[2] == pytest.approx(-Q * sum(c), rel=0.01)


def test_high_vaults_with_a_rise_of_a_quarter_have_two_values():
    """Figure 7.11, f between 0.2 and 0.3 with eaves above half of the depth: pressure 8/3 (f - .2), or suction."""
    radius = (5.0**2 + 2.5**2) / 5.0
    roof = arch(radius, np.degrees(np.arcsin(5.0 / radius)))
    windward = np.argmin(roof.centroids[:, 0])
    for shape, c in (("vault", 8 / 3 * 0.05), ("vault up", -1.2)):
        traction = Wind(1.0, (1.0, 0, 0), shape=shape, eaves=9.0).traction(roof)[windward]
        outside = roof.normals[windward] * np.sign(roof.normals[windward, 2])
        assert -traction @ outside == pytest.approx(c, rel=1e-3)


@pytest.mark.parametrize("shape", ["vault", "canopy up", "canopy up half"])
def test_a_picked_part_of_a_roof_has_the_zones_of_the_roof(shape):
    roof = arch(20.0, 25.0)
    picked = Box((-4.0, -1.0, -50.0), (9.0, 9.0, 50.0))
    part = roof.faces_of(picked.vertices(roof))
    expected = np.where(part[:, None], Wind(Q, (1.0, 0, 0), shape=shape).traction(roof), 0.0)
    assert_allclose(Wind(Q, (1.0, 0, 0), shape=shape, at=picked).traction(roof), expected)
    assert expected.any()


def test_a_vault_with_a_sloping_axis_has_the_rise_of_its_section():
    level = arch(20.0, 25.0)
    sloping = Surface(level.V + np.outer(0.2 * level.V[:, 1], [0, 0, 1.0]), level.F)
    for load in (Wind(Q, (1.0, 0, 0), shape="vault"), Snow(Q, shape="drifted")):
        loads = [np.linalg.norm(load.traction(roof), axis=1) / Q for roof in (level, sloping)]
        assert loads[1].max() == pytest.approx(loads[0].max(), rel=0.03)


def test_snow_that_drifts_over_an_arch_lies_in_two_triangles():
    """s_k L b mu_3 3/8 by hand: triangles of height mu_3 and mu_3 / 2 on half of the plan each; mu_3 = 0.2 + 10 h/b."""
    roof = arch(20.0, 30.0)
    b, h = 20.0, 20.0 * (1 - np.cos(np.radians(30)))
    mu3 = 0.2 + 10 * h / b
    for drift, side in (((1.0, 0, 0), 1), ((-2.0, 0, 0), -1)):
        load = Snow(900.0, shape="drifted", drift=drift)
        assert total(roof, load)[2] == pytest.approx(-900 * LENGTH * b * mu3 * 3 / 8, rel=0.01)
        on_face = -load.traction(roof)[:, 2] / np.abs(roof.normals[:, 2]) / 900
        towards = side * roof.centroids[:, 0] > 0
        assert on_face[towards].max() == pytest.approx(mu3, rel=0.03)
        assert on_face[~towards].max() == pytest.approx(mu3 / 2, rel=0.03)
    high = arch(5.0, 90.0)  # mu_3 is at most 2, and no snow lies beyond 60 degrees
    load = Snow(900.0, shape="drifted")
    assert total(high, load)[2] == pytest.approx(-900 * LENGTH * 10 * np.sin(np.pi / 3) * 2.0 * 3 / 8, rel=0.01)
    slope = np.degrees(np.arccos(np.abs(high.normals[:, 2])))
    assert not load.traction(high)[slope > 60].any()


@pytest.mark.parametrize(
    "load",
    [Wind(Q, (1.0, 0, 0), shape="vault"), Wind(Q, (1.0, 0, 0), shape="canopy up"), Snow(Q, shape="drifted")],
    ids=["vault", "canopy", "snow"],
)
def test_each_connected_roof_has_its_own_zones(load):
    roof = arch(20.0, 25.0)
    beside = Surface(roof.V + [30.0, 0, 3.0], roof.F)
    assert_allclose(total(joined(roof, beside), load), 2 * total(roof, load), rtol=1e-9, atol=1e-6)


def test_half_of_the_snow_is_cleared_from_the_slope_that_rises_along_the_drift():
    roof = pitched(20, -45)
    half = LENGTH * 5.0
    for drift, left, right in (((1.0, 0, 0), 0.4, 0.4), ((-1.0, 0, 0), 0.8, 0.2)):
        force = total(roof, Snow(1000.0, shape="half", drift=drift))
        assert_allclose(force, [0, 0, -1000 * half * (left + right)], rtol=1e-9, atol=1e-6)


def test_a_level_ridge_keeps_its_snow_though_its_slopes_are_rounded():
    roof = pitched(20, -20)
    tilted = Surface(roof.V + np.outer(1e-12 * roof.V[:, 1], [0, 0, 1.0]), roof.F)
    for drift in ((0, 1.0, 0), (0, -1.0, 0)):
        assert_allclose(total(tilted, Snow(1000.0, shape="half", drift=drift))[2], -0.8 * 1000 * 80.0, rtol=1e-6)


@pytest.mark.parametrize("turn", [0.0, 37.0])
def test_the_walls_of_a_building_have_pressure_and_suction_beside_their_roof(turn):
    """A tower of 4 m x 4 m x 20 m: 0.8 and 0.5 on its walls, and zones of its roof with e = 4 m, by hand."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    tower = refined_surface(box((-2.0, -2.0, 0.0), (2.0, 2.0, 20.0)), 0.2)
    tower = Surface(tower.V @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), tower.F)
    force = total(tower, Wind(Q, (c, s, 0.0), shape="flat up", eaves=20.0))
    assert force[:2] @ (c, s) == pytest.approx(1.3 * Q * 80.0)
    assert force[2] == pytest.approx(Q * (1.8 * 0.8 + 1.2 * 0.8 + 0.7 * 6.4 + 0.2 * 8.0), rel=0.08)


def test_a_wall_beside_a_roof_is_no_roof_though_it_leans():
    wall = Surface(upright().V + np.outer(0.2 * upright().V[:, 2], [0, 1.0, 0]), upright().F)
    roof = Surface(plate(edge=0.5).V + [0, 0, 5.0], plate(edge=0.5).F)
    for load in (
        Wind(Q, (0, 1.0, 0), shape="flat up", eaves=5.0),
        Wind(Q, (0, 1.0, 0), shape="canopy up", windward=1.2),
    ):
        both = load.traction(joined(roof, wall))
        assert_allclose(both[: roof.m], load.traction(roof))
        assert_allclose(both[roof.m :], Wind(Q, (0, 1.0, 0), windward=load.windward).traction(wall))


@pytest.mark.parametrize(
    ("load", "roof", "words"),
    [
        (Wind(Q, (0, 0, -1.0), shape="vault"), arch(5.0, 60.0), "its direction is not horizontal"),
        (Wind(Q, (0, 1.0, 0), shape="canopy up"), upright(), "no picked face looks upwards"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), plate(edge=1.0), "no arch along|rise / depth is 0.00 along the wind"),
        (Wind(Q, (1.0, 0, 0), shape="canopy up"), pitched(40, 40), "its slope is 40 degrees"),
        (Wind(Q, (1.0, 0, 0), shape="canopy up"), pitched(-35, 35), "its slope is -35 degrees"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), pitched(-15, 15), "shape 'vault': the roof is no arch"),
        (Snow(Q, shape="drifted"), pitched(-15, 15), "shape 'drifted': the roof is no arch"),
        (Wind(Q, (0, 1.0, 0), shape="vault"), arch(5.0, 60.0), "turn the direction across the roof"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), pitched(20, -20), "the roof is no arch"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), bent(lambda x, y: np.minimum(0.5 * (x + 5), (5 - x) / 3)), "no arch"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), pyramid(35.0), "the roof is no arch"),
        (Wind(Q, (1.0, 0, 0), shape="vault"), bent(lambda x, y: np.abs(np.sin(0.9 * x))), "the roof is no arch"),
        (Wind(Q, (1.0, 0, 0), shape="canopy up"), pyramid(38.0), "its slope is 38 degrees"),
        (Wind(Q, (0, 1.0, 0), shape="flat up", eaves=3.0), pitched(45, -45), "it slopes by 45 degrees"),
        (Wind(Q, (1.0, 0, 0), shape="canopy up"), bent(lambda x, y: 0.5 * np.sin(4 * x)), "its slope is -5"),
        (Wind(Q, (1.0, 0, 0), shape="canopy up"), bent(lambda x, y: 0.2 * x * y), "its slope is -"),
        (Wind(Q, (1.0, 0, 0), shape="flat up", eaves=3.0), pitched(8, -8), "it slopes by 8 degrees"),
        (Wind(Q, (1.0, 0, 0), shape="flat up"), pitched(0, 0), "eaves is 0; give eaves"),
        (Wind(Q, (1.0, 0, 0), eaves=3.0), upright(), "without a shape does not use eaves"),
        (Wind(Q, (1.0, 0, -0.2), shape="canopy up"), pitched(0, 0), "its direction is not horizontal"),
        (Snow(Q, shape="mu1", drift=(0, 1.0, 0)), pitched(0, 0), "remove drift"),
        (Snow(Q, shape="mu1", kind="imposed"), pitched(0, 0), "a load of kind 'imposed' has no shape"),
        (Snow(Q, shape="half"), moebius(), "with shape 'half'"),
        (Snow(Q, shape="drifted", drift=(0, 0, 1.0)), arch(5.0, 60.0), "its direction is not horizontal"),
    ],
)
def test_a_roof_that_the_standard_does_not_cover_is_refused_with_a_way_out(load, roof, words):
    with pytest.raises(SurfaceError, match=words):
        load.traction(roof)
