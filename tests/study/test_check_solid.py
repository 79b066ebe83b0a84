"""The solid model of `dsfab check`: closed forms first, then cut designs against their shells."""

import importlib.util

import numpy as np
import pytest
from scipy.sparse import csr_array, vstack

from dsfab.core.errors import StaticsError
from dsfab.design import run
from dsfab.export import write
from dsfab.statics import Material
from dsfab.study.file_check import check_file
from dsfab.study.file_check.file_geometry import read_shipped
from dsfab.study.file_check.solid_compliance import (
    RIGID,
    Holding,
    SolidModel,
    compared_compliance,
    compliances,
    missing_packages,
    tetrahedra,
)
from tests.shipped import PLATE, box_mesh, preset, stl, verdicts

pytestmark = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("gmsh", "skfem")), reason='pip install "dsfab[solid]"'
)

pytestmark = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("gmsh", "skfem")), reason='pip install "dsfab[solid]"'
)

OUT_OF_PLANE = {"kind": "line", "at": {"pick": "side", "axis": "x", "end": "max"}, "per_metre": [0, 0, -1e3]}


def model(folder, mesh, edge, poisson=0.3):
    found = read_shipped(stl(folder / "solid.stl", *mesh))
    return SolidModel.from_tetrahedra(tetrahedra(found, edge), Material(210e9, poisson, 7850.0))


def lattice(xs, ys, z):
    return np.array([(x, y, z) for x in xs for y in ys])


def held(solid, points, axes):
    """Rigid springs on some directions of points."""
    rows = solid.interpolation(points, 1e-3)[np.flatnonzero(np.tile([axis in axes for axis in "xyz"], len(points)))]
    return Holding(csr_array(rows), np.full(rows.shape[0], RIGID * 210e9 * 0.01))


def test_the_extra_is_there():
    assert missing_packages() == ""


def test_forces_keep_their_resultant_and_moment(tmp_path):
    solid = model(tmp_path, PLATE, 0.04)
    place, force = np.array([[0.123, 0.077, 0.004], [0.31, 0.05, 0.009]]), np.array([[1.0, 2, 3], [-4, 5, 6]])
    on_nodes = (solid.interpolation(place, 1e-6).T @ force.ravel()).reshape(-1, 3)
    assert on_nodes.sum(axis=0) == pytest.approx(force.sum(axis=0))
    assert np.cross(solid.points, on_nodes).sum(axis=0) == pytest.approx(np.cross(place, force).sum(axis=0))


def test_a_bar_is_pulled_by_its_closed_form(tmp_path):
    """C = F^2 l / (E A); Poisson's ratio 0, so that a held end strains no further."""
    solid = model(tmp_path, box_mesh((0, 0, 0), (0.4, 0.04, 0.02)), 0.04, poisson=0.0)
    start = solid.points[np.isclose(solid.points[:, 0], 0.0)]
    y, z = (np.arange(16) + 0.5) / 16 * 0.04, (np.arange(8) + 0.5) / 8 * 0.02
    end = np.array([(0.4, b, c) for b in y for c in z])
    force = solid.interpolation(end, 1e-6).T @ np.tile([1e3 / len(end), 0, 0], len(end))
    found = compliances(solid, held(solid, start, "xyz"), [force])[0]
    assert found == pytest.approx(1e6 * 0.4 / (210e9 * 0.04 * 0.02), rel=5e-3)


@pytest.mark.slow
def test_a_plate_bends_by_its_closed_form(tmp_path):
    """Simply supported square plate under even pressure [Navier 1823]: C = q^2 a^6 / D times a double series."""
    a, t, q, nu = 0.4, 0.01, 1e4, 0.3
    solid = model(tmp_path, box_mesh((0, 0, 0), (a, a, t)), 2 * t)
    s = np.linspace(0, a, 41)
    rim = np.concatenate([lattice(s, (0, a), t / 2), lattice((0, a), s[1:-1], t / 2)])
    middles = (s[1:] + s[:-1]) / 2
    grid = lattice(middles, middles, t / 2)
    force = solid.interpolation(grid, 1e-6).T @ np.tile([0, 0, -q * a * a / len(grid)], len(grid))
    centre, side = np.array([[a / 2, a / 2, t / 2]]), np.array([[a / 2, 0, t / 2]])
    stands = [held(solid, rim, "z"), held(solid, centre, "xy"), held(solid, side, "x")]
    holding = Holding(
        csr_array(vstack([stand.rows for stand in stands])), np.concatenate([stand.stiffness for stand in stands])
    )
    m, n = np.meshgrid(np.arange(1, 40, 2), np.arange(1, 40, 2))
    series = (64 / np.pi**8 / (m**2 * n**2 * (m**2 + n**2) ** 2)).sum()
    D = 210e9 * t**3 / 12 / (1 - nu**2)
    assert compliances(solid, holding, [force])[0] == pytest.approx(series * q**2 * a**6 / D, rel=0.03)


def test_a_point_outside_the_solid_is_refused(tmp_path):
    solid = model(tmp_path, PLATE, 0.04)
    with pytest.raises(StaticsError, match=r"1 of 2 points of the sheet .*first at \[0.1, 0.1, 0.05\]"):
        solid.interpolation(np.array([[0.1, 0.1, 0.005], [0.1, 0.1, 0.05]]), 0.01)


def test_a_point_off_the_solid_by_half_a_tetrahedron_is_refused_however_far_it_may_lie(tmp_path):
    """The plate is 10 mm thick, and so are its tetrahedra."""
    solid = model(tmp_path, PLATE, 0.04)
    solid.interpolation(np.array([[0.1, 0.1, 0.0105]]), 1.0)
    with pytest.raises(StaticsError, match="the file's solid does not contain"):
        solid.interpolation(np.array([[0.1, 0.1, 0.015]]), 1.0)


def test_a_solid_that_is_not_held_is_refused(tmp_path):
    solid = model(tmp_path, PLATE, 0.04)
    force = solid.interpolation(np.array([[0.1, 0.1, 0.005]]), 0.01).T @ np.array([0, 0, 1.0])
    with pytest.raises(StaticsError, match="do not hold"):
        compliances(solid, held(solid, np.array([[0.2, 0.1, 0.005]]), "z"), [force])


@pytest.mark.slow
def test_a_cut_cantilever_in_its_plane_carries_as_its_shell(tmp_path):
    design = run(preset())
    checked = check_file(write(design.solid, tmp_path / "strip.stl"), design)
    assert checked.carrying.ratio == pytest.approx(1, abs=0.01)
    assert verdicts(checked)["compliance"] == "pass"


@pytest.mark.slow
def test_a_full_plate_in_bending_carries_as_its_shell(tmp_path):
    design = run(preset(per_metre=(0, 0, -1e3), keep=1.0, width=None))
    assert design.sheet.surface.area == pytest.approx(design.surface.area)
    found = compared_compliance(read_shipped(write(design.solid, tmp_path / "plate.stl")), design)
    assert found.ratio == pytest.approx(1, abs=0.01)


@pytest.mark.slow
def test_a_cut_cantilever_across_its_plane_carries_as_its_shell(tmp_path):
    design = run(preset(per_metre=(0, 0, -1e3)))
    found = compared_compliance(read_shipped(write(design.solid, tmp_path / "strip.stl")), design)
    assert found.ratio == pytest.approx(1, abs=0.03)


@pytest.mark.slow
def test_a_softer_file_fails(tmp_path):
    """The same outline, 20 % thinner: softer by a quarter in its plane."""
    design = run(preset())
    path = stl(tmp_path / "thin.stl", design.solid.V * (1, 1, 0.8), design.solid.F)
    checked = check_file(path, design)
    assert checked.carrying.ratio == pytest.approx(1.25, rel=0.03)
    assert verdicts(checked)["compliance"] == verdicts(checked)["design"] == "fail"
    assert not checked.has_passed
