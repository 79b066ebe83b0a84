"""Large displacements by CalculiX: a toggle that snaps through, a column that buckles; skipped where it is missing."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from math import pi

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.app.check_nonlinear import nonlinear_facts, nonlinear_lines
from dsfab.app.cli import main
from dsfab.app.terminal import signals_as_interrupts
from dsfab.core.errors import StaticsError
from dsfab.statics import Material
from dsfab.study.calculix import CcxFiles, LoadPath, load_path, lowest_buckling, run_ccx, solid_model
from dsfab.study.nonlinear import (
    NonlinearCheck,
    last_point,
    limit_of,
    nonlinear_check,
    softest_range,
    solid_check,
    without_fillets,
)
from dsfab.surface import LoadCase, Surface
from tests.calculix import needs_ccx
from tests.designs import sliced
from tests.shapes import grid
from tests.statics.supports import hold


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


def bowl(cells, sign) -> tuple[Surface, LoadCase]:
    """A square of 8 x 8 m that hangs 1.5 m down (sign 1) or stands up (-1), on a pinned edge, pressed by 1 kPa."""
    flat = grid(cells, cells, 8.0, 8.0)
    x, y = flat.V[:, 0] - 4, flat.V[:, 1] - 4
    s = Surface(np.stack([x, y, sign * 1.5 * (x**2 + y**2) / 32], axis=1), flat.F)
    rim = np.isin(np.arange(s.n), s.edges.ends[s.edges.boundary])
    force = s.vertex_areas[:, None] * [0, 0, -1000.0]
    return s, pressed(s, hold(s, (rim, "xyz")), force, np.zeros(s.n, dtype=bool))


def checked(given, thickness, material, imperfection, case="load"):
    s, load = given
    model = solid_model(s, up(s), thickness, material, load)
    return solid_check(model, case, imperfection, 120.0, lambda *words: None)


def path(load, u, whole=True) -> LoadPath:
    """Of one node that moves along z."""
    return LoadPath(np.array(load), np.array(u)[:, None, None] * np.array([0, 0, 1.0]), whole)


def test_a_snapping_path_fails_before_its_jump():
    load = np.linspace(0, 1, 11)
    moves = np.array([1, 1, 1, 1.2, 1.5, 3, 40, 1, 1, 1])
    assert limit_of(path(load, np.r_[0, np.cumsum(moves)])) == (6, True)
    assert softest_range(path(load, np.r_[0, np.cumsum(moves)])) == pytest.approx((0.5, 0.8))


def test_a_softening_path_fails_at_a_hundredth_of_its_stiffness():
    load = np.linspace(0, 0.99, 100)
    assert limit_of(path(load, 1 / (1 - load) - 1)) == (90, True)


def test_a_stiff_path_bears_its_load_and_a_path_that_ends_early_fails():
    load = np.linspace(0, 1, 11)
    assert limit_of(path(load, load)) == (10, False)
    assert limit_of(path(load, load, whole=False)) == (10, True)
    assert softest_range(path(load, load)) is None
    fine = np.r_[load[:9], 0.805, 0.81]
    assert softest_range(path(fine, np.r_[load[:9], 1.5, 2.5])) is None
    jolt = np.array([1, 1, 6, 1, 1, 1, 1, 1, 1, 1.0])  # no snap: under ten times the first step
    assert limit_of(path(load, np.r_[0, np.cumsum(jolt)])) == (10, False)


def test_a_path_ends_after_a_snap_or_without_equilibrium():
    load = np.linspace(0, 1, 11)
    moves = np.array([1, 1, 1, 1.2, 1.5, 3, 40, 1, 1, 1])
    assert last_point(path(load, np.r_[0, np.cumsum(moves)])) == 7  # with the snap, as long as it goes on
    assert last_point(path(load, load)) is None
    soft = replace(path(load, load**3 + load, whole=False), failed=((6, 0.1), (7, 0.03), (10, 0.02)))
    assert last_point(soft) == 10  # a step of 3 % is still a long one
    assert last_point(replace(soft, failed=((6, 0.1), (7, 0.03)))) is None
    assert last_point(replace(path(load, load), failed=((10, 0.02),))) is None  # as stiff as at first
    ended = replace(soft, failed=((8, 0.01), (9, 0.01))).until(8)
    assert (ended.load[-1], limit_of(ended)) == (pytest.approx(0.8), (8, True))


def test_a_path_that_runs_out_of_time_is_not_called_a_failure():
    load = np.linspace(0, 1, 11)
    assert limit_of(replace(path(load, load, whole=False), late=True)) == (10, False)
    found = NonlinearCheck("wind", 3.0, 1.5, False, 0.01, 0.002, load, load, 400, minutes=2.0)
    assert found.sentence.startswith("wind: the sheet was solved up to 1.5 times its load, with large displacements")
    assert (
        "stopped at the time limit of 2 minutes (--minutes): the sheet may bear more. By linear theory the sheet "
        "buckles at 3" in found.sentence
    )
    assert "gives way" not in found.sentence


STA = """SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
     1          6     1     5  0.600000E+00  0.600000E+00  0.100000E+00
     1          7     1U    7  0.600000E+00  0.600000E+00  0.100000E+00
     2         12     2U   16  0.167188E+01  0.671875E+00  0.234375E-02
"""
DAT = """
 displacements (vx,vy,vz) for set WATCHED and time  0.1000000E+00

         2  1.000000E-03  0.000000E+00 -2.000000E-03
         1  0.000000E+00  0.000000E+00  0.000000E+00

 displacements (vx,vy,vz) for set WATCHED and time  0.2000000E+00

         2  3.000000E-03  0.000000E+00 -5.0"""


def test_result_files_of_calculix_are_read_during_the_run():
    files = CcxFiles("", DAT, STA, False)
    assert files.failures() == [(0.6, 0.1), (1.67188, 0.00234375)]
    (time, table), (_, half) = files.tables()
    assert time == 0.1
    assert table == pytest.approx(np.array([[2, 1e-3, 0, -2e-3], [1, 0, 0, 0]]))
    assert len(half) == 0  # a number that is cut off is another number
    assert CcxFiles("", "", STA, False).tables() == []


@pytest.fixture
def endless(tmp_path, monkeypatch):
    """A program that goes by the name of CalculiX, says one step of a path and never ends; its process' number."""
    number, temporary = tmp_path / "number", tmp_path / "temporary"
    temporary.mkdir()
    program = tmp_path / "ccx"
    program.write_text(
        f"#!/bin/sh\necho $$ > {number}\ncat > solid.dat <<'END'\n{DAT}\nEND\ncat > solid.sta <<'END'\n{STA}END\n"
        "exec sleep 60\n",
        encoding="ascii",
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    yield number
    assert not list(temporary.iterdir())
    with pytest.raises(ProcessLookupError):
        os.kill(int(number.read_text()), 0)


@pytest.mark.skipif(os.name == "nt", reason="shell script")
def test_a_path_is_kept_when_time_is_over(endless):
    s, load = column(2)
    model = solid_model(s, up(s), 0.01, Material(210e9, 0.0), load)
    found = load_path(model, model.solid.nodes, (50.0,), np.array([0, 1]), 0.8)
    assert found.load == pytest.approx([0, 5])
    assert found.u[1] == pytest.approx(np.array([[0, 0, 0], [1e-3, 0, -2e-3]]))
    assert (found.late, found.whole, limit_of(found)) == (True, False, (1, False))
    with pytest.raises(StaticsError, match=r"did not end within .* minutes; make the mesh coarser"):
        load_path(model, model.solid.nodes, (50.0,), np.arange(3), 0.05)  # not even one step of all that is watched


@pytest.mark.skipif(os.name == "nt", reason="shell script")
def test_a_signal_ends_the_program_and_its_files(endless):
    def interrupted(files: CcxFiles) -> bool:
        os.kill(os.getpid(), signal.SIGTERM)
        return False

    with pytest.raises(KeyboardInterrupt), signals_as_interrupts():
        run_ccx([""], 60.0, interrupted)


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


COARSE = {"surface.edge": 0.8, "pattern.major.spacing": 2.0, "pattern.minor.spacing": 2.0}
"""A dome of few members."""


@pytest.mark.slow
def test_the_check_has_a_mesh_of_its_own():
    """Without fillets, out of longer triangles where asked; a length that is none is refused."""
    design = sliced(dsfab.load_preset("dome", COARSE))
    assert without_fillets(design, 0.0, lambda *words: None) is design
    sharp = without_fillets(design, None, lambda *words: None)
    assert sharp.surface is design.surface
    assert sharp.sheet.surface.m < 0.8 * design.sheet.surface.m
    assert sharp.sheet.surface.area == pytest.approx(design.sheet.surface.area, rel=0.01)
    longer = without_fillets(design, 1.2, lambda *words: None)
    assert (longer.preset.surface.edge, longer.preset.pattern.fillet) == (1.2, 0.0)
    assert without_fillets(sharp, 0.5, lambda *words: None) is sharp  # never finer
    for minutes in (0.0, -3.0, float("nan")):
        with pytest.raises(StaticsError, match=r"minutes is not positive; give --minutes 60"):
            nonlinear_check(design, minutes=minutes)
    for wrong in (-1.0, float("nan"), 1e3):
        with pytest.raises(StaticsError, match=r"the edge length .* m is negative or longer than the surface"):
            without_fillets(design, wrong, lambda *words: None)


FEW = {"surface.edge": 2.0, "pattern.major.spacing": 5.0, "pattern.minor.spacing": 5.0, "pattern.keep": 0.0}
ROUGH = [word for key, value in FEW.items() for word in ("--set", f"{key}={value}")]
"""A dome of 400 triangles."""


@pytest.mark.slow
@needs_ccx
def test_a_dome_gives_way_far_below_its_linear_factor(capsys):
    """Spherical shells are known for it [Koiter 1945]."""
    assert main(["check", "dome", "--nonlinear", "--check-edge", "2.5", "--json", *ROUGH]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["gives_way"]
    assert found["stopped_after_minutes"] is None
    assert 0.2 < found["limit_factor"] / found["linear_factor"] < 0.95
    load, u = np.array(found["path"]["factor"]), np.array(found["path"]["largest_displacement_m"])
    assert load[-1] == found["limit_factor"]  # and no step beyond: it would halve them in vain
    assert (u[-1] - u[-2]) / (load[-1] - load[-2]) > 2 * u[1] / load[1]
    assert found["edge_m"] == pytest.approx(2.5, rel=0.2)
    assert found["imperfection_m"] == pytest.approx(0.04, rel=1e-3)
    assert found["wedges"] < 500


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals and a shell script")
def test_an_interrupted_command_leaves_no_files_or_processes(endless):
    """Neither files nor CalculiX: `endless` looks for both. The other signal is sent in a test above."""
    words = [sys.executable, "-m", "dsfab", "check", "dome", "--nonlinear", "--check-edge", "2.5", *ROUGH]
    run = subprocess.Popen(
        words, env={**os.environ, "TMPDIR": tempfile.gettempdir()}, stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + 60
    while not (endless.exists() and endless.read_text()) and time.monotonic() < end:
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    assert "stopped; no file is half written" in run.communicate(timeout=60)[1]
    assert run.returncode == 130


def test_springs_are_refused_in_a_sentence():
    s, load = column(4)
    soft = replace(load, spring=np.ones((s.n, 3)))
    with pytest.raises(StaticsError, match="the nonlinear check cannot use springs at supports"):
        solid_model(s, up(s), 0.01, Material(210e9, 0.0), soft)


def test_without_calculix_the_error_names_the_program_before_any_work(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    assert main(["check", "dome", "--nonlinear"]) == 1
    assert "the program ccx is not on the path; install CalculiX" in capsys.readouterr().err


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


@pytest.mark.slow
@needs_ccx
@pytest.mark.parametrize(("cells", "reversed_share"), [(8, 0.0), (8, -0.1), (12, 1.0)])
def test_a_bowl_in_tension_does_not_buckle(cells, reversed_share):
    """CalculiX gives negative factors, of the reversed load, and positive ones that count no real buckling. A patch of
    the bowl may even carry a tenth of its load upwards."""
    s, load = bowl(cells, 1.0)
    x, y = s.V[:, 0], s.V[:, 1]
    patch = (x > 0) & (y > 0) & (x < 2) & (y < 2)
    load = replace(load, force=np.where(patch, reversed_share, 1.0)[:, None] * load.force)
    found = checked((s, load), 0.05, Material(11e9, 0.3), 0.01, "snow")
    wedges = f"CalculiX, {s.m} quadratic wedges"
    assert found.sentence == f"snow: by linear theory, the sheet does not buckle under this load ({wedges})"
    assert list(nonlinear_lines(found)) == [found.sentence]
    assert nonlinear_facts(found)["limit_factor"] is None


@pytest.mark.slow
@needs_ccx
def test_a_bowl_turned_over_buckles_at_a_factor_that_more_factors_confirm():
    """If CalculiX is asked for one factor, it gives 303 [findings/calculix_one_buckling_factor.sh]."""
    s, load = bowl(16, -1.0)
    assert lowest_buckling(solid_model(s, up(s), 0.05, Material(11e9, 0.3), load), 120.0)[0] == pytest.approx(
        274, rel=1e-3
    )


@pytest.mark.slow
@needs_ccx
def test_the_lowest_positive_factor_counts_beside_smaller_negative_ones():
    """A column is pressed, and a second one pulled by a hundred times its load [Euler]."""
    one, _ = column(12)
    s = Surface(np.concatenate([one.V, one.V + [0, 1.0, 0]]), np.concatenate([one.F, one.F + one.n]))
    root, tip, pulled = s.V[:, 0] < 1e-9, s.V[:, 0] > 1 - 1e-9, s.V[:, 1] > 0.5
    force = (tip * np.where(pulled, 50.0, -0.5))[:, None] * np.array([1.0, 0, 0])
    model = solid_model(s, up(s), 0.01, Material(210e9, 0.0), pressed(s, hold(s, (root, "xyz")), force, root))
    factor, mode = lowest_buckling(model, 120.0)
    assert factor == pytest.approx(pi**2 * 210e9 * 0.1 * 0.01**3 / 12 / 4, rel=0.02)
    moved = np.linalg.norm(mode, axis=1)
    assert moved[model.solid.nodes[:, 1] > 0.5].max() < 1e-3 * moved.max()


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
def test_a_toggle_snaps_through_at_the_published_load(tmp_path, capsys):
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
    assert "the imperfection of 100 m is negative or larger than the design" in capsys.readouterr().err
