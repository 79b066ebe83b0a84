"""The beam model as text for OpenSees and for CalculiX: what these programs, or PyNite, find of the file alone."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.app.build import Files
from dsfab.app.cli import main
from dsfab.app.export import format_suffix
from dsfab.core.errors import ExportError
from dsfab.export import FORMATS, Details, write
from dsfab.export.part import part_of
from dsfab.members.frame import solve_frame
from dsfab.surface.shapes import plate
from tests.calculix import needs_ccx, solved
from tests.export.saf_members import ACTIONS, crooked, written
from tests.opensees import needs_opensees, run

CASES = ("dead", "snow", "crowd", "ULS 1", "lifted")


def moves(found, ours) -> float:
    """The largest displacement over that of ours, for a case."""
    return float(np.linalg.norm(found[:, :3], axis=1).max() / np.linalg.norm(ours.u[:, :3], axis=1).max())


@needs_opensees
def test_opensees_finds_the_same(tmp_path):
    """With shear: the same beams, the same numbers."""
    made = crooked()
    found, ours = run(written(made, tmp_path / "crooked.tcl")), solve_frame(made)
    for name in CASES:
        assert found[name].u == pytest.approx(ours[name].u, abs=1e-9 * np.abs(ours[name].u).max())
        assert found[name].reaction[[0, 4]] == pytest.approx(ours[name].reaction[[0, 4]], abs=1e-6)


@needs_ccx
def test_calculix_runs_the_beams(tmp_path):
    """As solids that are joined by rigid knots: reactions are exact, displacements up to 8 % smaller."""
    fixed = np.array([[k in (0, 4) or (k, way) == (2, 1) for way in range(3)] + [False] * 3 for k in range(6)])
    made = replace(crooked(), spring=np.zeros((6, 6)), fixed=fixed)  # totals at clamped nodes have moments in them
    ours = solve_frame(made)
    steps = solved(written(made, tmp_path / "crooked.beams.inp"), 6)
    for name, step in zip(CASES, steps, strict=True):
        load = made.all_loads[name][~fixed.any(axis=1), :3].sum(axis=0)  # the total has what lies on held nodes
        assert step.reaction["HELD"] == pytest.approx(-load, abs=0.1)  # of kilonewtons
        assert 0.9 < moves(step.u, ours[name]) < 1.0


@needs_ccx
def test_springs_hold_for_calculix_too(tmp_path):
    """A spring that is stiffer by far than the structure keeps its node."""
    stiff = replace(crooked(), spring=1e6 * crooked().spring)
    (*_, last) = solved(written(stiff, tmp_path / "crooked.beams.inp"), 6)
    assert abs(last.u[5, 2]) < 1e-3 * np.abs(last.u).max()


@pytest.mark.parametrize("suffix", [".tcl", ".beams.inp"])
def test_the_same_design_gives_the_same_bytes_and_another_is_refused(tmp_path, monkeypatch, suffix):
    one, two = (written(crooked(), tmp_path / f"x{suffix}").read_bytes() for _ in range(2))
    assert one == two
    form = FORMATS[suffix]
    few = replace(crooked(), points=crooked().points + 1e-3)
    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=lambda part: iter([one])))
    with pytest.raises(
        ExportError, match="the nodes of 'crooked' have other coordinates when the file is read back; write saf"
    ):
        written(few, tmp_path / f"y{suffix}")
    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=lambda part: iter([one[: len(one) // 2]])))
    with pytest.raises(ExportError, match="reads back with"):
        written(crooked(), tmp_path / f"y{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [f"x{suffix}"]


def test_names_of_nodes_and_cases_cannot_break_the_script(tmp_path):
    odd = {"a {b}; exit \\": crooked().loads["dead"]}
    made = replace(crooked(), loads=odd, combinations={}, nodes=("x\\", "{", "}", "a;b", "[exit]", "\n"))
    lines = written(made, tmp_path / "x.tcl").read_text(encoding="ascii").splitlines()
    assert "solve {a b exit}" in lines
    assert "node 1 0 0 0 ;# x" in lines
    assert not any(line.endswith("\\") for line in lines)


def test_a_sheet_alone_has_no_beam_model_and_people_say_opensees(tmp_path, capsys):
    for suffix in (".tcl", ".beams.inp", ".saf.xlsx"):
        with pytest.raises(ExportError, match="'x' has no beam model; only a design has a beam model"):
            write(plate(1, 1, 1), tmp_path / f"x{suffix}")
    assert format_suffix("opensees") == format_suffix("tcl") == ".tcl"
    assert format_suffix("beams.inp") == ".beams.inp"
    assert Files(format_="opensees").preset_overrides() == ('export.formats=["tcl"]',)
    assert Files(format_="STP, step, saf").preset_overrides() == ('export.formats=["step", "saf.xlsx"]',)
    assert main(["export", "barrel_vault", "--to", "opensee"]) != 0
    assert "did you mean opensees?" in capsys.readouterr().err


@pytest.mark.slow
@needs_ccx
def test_a_vault_is_solved_again_by_calculix(tmp_path):
    """Reactions hold what lies on the sheet; displacements within 5 % of the frame's."""
    design = dsfab.Design.from_preset(dsfab.load_preset("barrel_vault", {"surface.edge": 0.5}))
    frame, ours = design.frame, solve_frame(design.frame)["load"]
    load = design.cut_loads["load"].force.sum(axis=0)
    steps = solved(design.write(tmp_path / "vault.beams.inp"), len(frame.points))
    found = dict(zip(frame.all_loads, steps, strict=True))
    step, parts = found["load"], [found[name] for name in found if name != "load"]  # of each kind of action
    assert sum(part.reaction["HELD"] for part in parts) == pytest.approx(
        step.reaction["HELD"], abs=1e-3 * np.linalg.norm(load)
    )
    assert step.reaction["HELD"] == pytest.approx(-load, abs=1e-3 * np.linalg.norm(load))
    assert moves(step.u, ours) == pytest.approx(1, abs=0.05)


@pytest.mark.slow
@needs_opensees
def test_a_vault_is_solved_again_by_opensees(tmp_path):
    """Reactions hold what lies on the sheet to .1 %; displacements and reactions are those of the frame."""
    design = dsfab.Design.from_preset(dsfab.load_preset("barrel_vault", {"surface.edge": 0.5}))
    ours = solve_frame(design.frame)["load"]
    load = design.cut_loads["load"].force.sum(axis=0)
    theirs = run(design.write(tmp_path / "vault.tcl"))["load"]
    assert theirs.reaction[:, :3].sum(axis=0) == pytest.approx(-load, abs=1e-3 * np.linalg.norm(load))
    assert theirs.u == pytest.approx(ours.u, abs=1e-6 * np.abs(ours.u).max())
    held = design.frame.fixed.any(axis=1)
    assert theirs.reaction[held] == pytest.approx(ours.reaction[held], abs=1e-6 * np.abs(ours.reaction).max())


@pytest.mark.parametrize(("share", "is_equal"), [(5e-10, True), (2e-9, False)])
@pytest.mark.parametrize("suffix", [".tcl", ".beams.inp", ".saf.xlsx"])
def test_nodes_that_read_back_within_a_billionth_of_the_largest_coordinate_are_equal(tmp_path, suffix, share, is_equal):
    form, frame = FORMATS[suffix], replace(crooked(), actions=ACTIONS)
    path = written(frame, tmp_path / f"crooked{suffix}")
    moved = replace(frame, points=frame.points + share * np.abs(frame.points).max())
    part = replace(part_of(plate(1, 1, 1), "crooked"), details=Details(frame=moved))
    with nullcontext() if is_equal else pytest.raises(ExportError, match="have other coordinates"):
        form.check(part, path)
