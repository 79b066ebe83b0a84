"""Large displacements by CalculiX: a toggle that snaps through, a column that buckles; skipped where it is missing."""

import json
from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh

from dsfab.app.cli import main
from dsfab.errors import StaticsError
from dsfab.statics import Material
from dsfab.study.nonlinear import limit_of, solid_check, solid_model
from dsfab.study.nonlinear.calculix import LoadPath
from dsfab.study.nonlinear.limit import softest
from dsfab.surface import LoadCase, Surface
from tests.calculix import needs_ccx
from tests.test_statics_modes import hold
from tests.zoo import grid


def up(surface: Surface) -> np.ndarray:
    """(n, 3) the normals of vertices, upwards."""
    found = np.zeros((surface.n, 3))
    for corner in surface.F.T:
        np.add.at(found, corner, surface.normals * np.sign(surface.normals[:, 2:]))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def pressed(surface, fixed, force, clamped) -> LoadCase:
    """Clamped at edges between marked vertices."""
    edges = clamped[surface.edges.ends].all(axis=1) & surface.edges.boundary
    return LoadCase(fixed, force, np.zeros(surface.n, dtype=bool), clamped=edges)


def toggle(cells=24) -> tuple[Surface, LoadCase]:
    """Two straight bars of .753 x .243 in between fixed ends, 25.886 in apart, their joint .386 in above; a pound
    presses on it [Williams 1964]."""
    flat = grid(cells, 1, 2 * 12.943, 0.753)
    x = flat.V[:, 0]
    height = 0.386 * (1 - np.abs(x / 12.943 - 1))
    s = Surface(np.stack([x, flat.V[:, 1], height], axis=1), flat.F)
    ends, top = (x < 1e-9) | (x > 25.885999), np.abs(x - 12.943) < 1e-9
    force = top[:, None] * np.array([0, 0, -1.0]) / top.sum()
    return s, pressed(s, hold(s, (ends, "xyz")), force, ends)


def column(cells=24) -> tuple[Surface, LoadCase]:
    """A strip of 1 x .1 m, 10 mm thick, clamped at one end and pressed at the other by a newton."""
    s = grid(cells, 1, 1.0, 0.1)
    root, tip = s.V[:, 0] < 1e-9, s.V[:, 0] > 1 - 1e-9
    force = tip[:, None] * np.array([-1.0, 0, 0]) / tip.sum()
    return s, pressed(s, hold(s, (root, "xyz")), force, root)


def checked(given, thickness, material, imperfection, case="load"):
    s, load = given
    model = solid_model(s, up(s), thickness, material, load)
    return solid_check(model, case, imperfection, 120.0, lambda *words: None)


def path(load, u, whole=True) -> LoadPath:
    """Of one node that moves along z."""
    return LoadPath(np.array(load), np.array(u)[:, None, None] * np.array([0, 0, 1.0]), whole)


def test_what_snaps_gives_way_before_the_jump():
    load = np.linspace(0, 1, 11)
    moves = np.array([1, 1, 1, 1.2, 1.5, 3, 40, 1, 1, 1])
    assert limit_of(path(load, np.r_[0, np.cumsum(moves)])) == (6, True)
    assert softest(path(load, np.r_[0, np.cumsum(moves)])) == pytest.approx((0.5, 0.8))


def test_what_softens_without_end_gives_way_at_a_hundredth_of_its_stiffness():
    load = np.linspace(0, 0.99, 100)
    assert limit_of(path(load, 1 / (1 - load) - 1)) == (90, True)


def test_what_stays_stiff_bears_more_and_what_ends_early_gives_way():
    load = np.linspace(0, 1, 11)
    assert limit_of(path(load, load)) == (10, False)
    assert limit_of(path(load, load, whole=False)) == (10, True)
    assert softest(path(load, load)) is None
    fine = np.r_[load[:9], 0.805, 0.81]
    assert softest(path(fine, np.r_[load[:9], 1.5, 2.5])) is None
    jolt = np.array([1, 1, 6, 1, 1, 1, 1, 1, 1, 1.0])  # no snap: under ten times the first step
    assert limit_of(path(load, np.r_[0, np.cumsum(jolt)])) == (10, False)


def test_forces_and_supports_of_the_sheet_are_those_of_the_solid():
    s, load = column(4)
    model = solid_model(s, up(s), 0.01, Material(210e9, 0.0), load)
    assert model.force.sum(axis=0) == pytest.approx([-1, 0, 0])
    root = model.solid.nodes[:, 0] < 1e-9
    assert {tuple(row) for row in model.fixed.tolist()} == {(k, way) for k in np.flatnonzero(root) for way in range(3)}
    assert not len(model.opposite)
    hinged = solid_model(s, up(s), 0.01, Material(210e9, 0.0), replace(load, clamped=np.zeros(0, dtype=bool)))
    assert len(hinged.fixed) == 2 * 3
    assert hinged.solid.nodes[hinged.fixed[:, 0], 2] == pytest.approx(0)  # in the middle of the thickness
    assert len(hinged.opposite) == 3 * 3  # two corners and the edge between them
    low, top = hinged.solid.nodes[hinged.opposite[:, 0]], hinged.solid.nodes[hinged.opposite[:, 1]]
    assert np.abs(top - low) == pytest.approx(np.tile([0, 0, 0.01], (9, 1)))


def test_springs_are_refused_in_a_sentence():
    s, load = column(4)
    soft = replace(load, spring=np.ones((s.n, 3)))
    with pytest.raises(StaticsError, match="springs of supports are not in the nonlinear check"):
        solid_model(s, up(s), 0.01, Material(210e9, 0.0), soft)


def test_without_calculix_it_says_how_to_get_it_before_any_work(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    assert main(["check", "dome", "--nonlinear"]) == 1
    assert "its program ccx is not on the path; install it" in capsys.readouterr().err


@pytest.mark.slow
@needs_ccx
def test_a_column_buckles_at_its_euler_load():
    """pi^2 E I / (2 L)^2; with an imperfection of a 300th it moves far before, and no more load can be had."""
    found = checked(column(), 0.01, Material(210e9, 0.0), 1 / 300)
    euler = pi**2 * 210e9 * 0.1 * 0.01**3 / 12 / 4
    assert found.linear == pytest.approx(euler, rel=5e-3)
    assert found.given_way
    assert 0.88 < found.limit / found.linear <= 1.02
    assert found.triangles == 48


TOGGLE = """
[surface]
file = "toggle.obj"
unit = "m"
[[surface.support]]
at = {{ pick = "side", axis = "z", end = "min" }}
hold = "xyz"
clamp = true
[[surface.load]]
kind = "force"
at = {{ pick = "side", axis = "z", end = "max" }}
force = [0.0, 0.0, {pounds}]
[statics]
thickness = 0.243
young = 10.3e6
poisson = 0.0
check = false
bending = "hhj"
[pattern]
method = "modes"
major = {{ threshold = -1.0 }}
"""


@pytest.mark.slow
@needs_ccx
def test_a_toggle_snaps_through_where_it_is_published_to(tmp_path, capsys):
    """34 pounds [Williams 1964; Wood and Zienkiewicz 1977: 33.8 to 34.1], a third of what linear theory says."""
    s, _ = toggle()
    trimesh.Trimesh(s.V, s.F, process=False).export(tmp_path / "toggle.obj")
    (tmp_path / "toggle.toml").write_text(TOGGLE.format(pounds=-10.0), encoding="utf-8")
    words = ["check", str(tmp_path / "toggle.toml"), "--nonlinear", "--imperfection", "1e-6"]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["limit_factor"] == pytest.approx(3.4, rel=0.03)
    assert found["gives_way"]
    assert found["linear_factor"] > 2 * found["limit_factor"]
    assert found["displacement_m"] == pytest.approx(0.031, rel=0.05)
    assert main([*words, "--case", "wind"]) == 1
    assert "'wind' is no load case of this design; use one of load" in capsys.readouterr().err
    assert main([*words[:-1], "100"]) == 1
    assert "an imperfection of 100 m is none of this design" in capsys.readouterr().err
