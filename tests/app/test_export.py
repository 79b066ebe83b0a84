"""`dsfab export` as people use it and mistype it."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dsfab.app.cli import main
from dsfab.design import design as stages
from dsfab.export import require_writable_file
from dsfab.preset.file import load_preset
from dsfab.study.check_model import uncut_model
from tests.app.command_line import refused, run
from tests.calculix import ccx, needs_ccx, solved
from tests.presets import BARREL_VAULT_MODES, DOME_MODES

DOME = ["--set", "surface.edge=0.9"]
VAULT = ["--set", "surface.edge=0.5", "--set", "statics.thickness=0.3"]
CANTILEVER = ["--set", "surface.edge=0.1"]


def header(path: Path) -> str:
    return "\n".join(line for line in path.read_text().splitlines() if line.startswith("**"))


@pytest.mark.slow
@needs_ccx
@pytest.mark.parametrize(
    ("arguments", "within"),
    [
        ([BARREL_VAULT_MODES, *VAULT], 0.03),
        (["cantilever", *CANTILEVER], 1e-3),
        (["cantilever", *CANTILEVER, "--sheet", "cut"], 1e-3),
    ],
)
def test_the_calculix_file_runs_and_gives_the_figures_of_its_header(arguments, within, capsys, tmp_path):
    path = tmp_path / "model.inp"
    code, said, _ = run(capsys, "export", *arguments, "--to", "calculix", "-o", str(path))
    assert code == 0
    assert f"cd {tmp_path} && ccx model" in said
    top = header(path)
    count = int(top.split(" nodes, written")[0].split()[-1])
    (found,) = solved(path, count)
    words = top.split()
    assert float(words[words.index("energy") + 1]) == pytest.approx(found.energy, rel=within)
    corner = int(words[words.index("corner,") + 2].rstrip(","))
    moved = np.linalg.norm(found.u[corner - 1])
    assert float(words[words.index("displacement") + 1]) == pytest.approx(moved, rel=within)
    # middles of edges may move further than every corner
    assert moved > 0.95 * np.linalg.norm(found.u, axis=1).max()
    line = next(line for line in top.splitlines() if line.startswith("** reaction"))
    told = [float(number) for number in line[line.index("(") + 1 : line.index(")")].split(",")]
    assert found.reaction["SUPPORT_1"] == pytest.approx(told, abs=1e-4 * np.abs(told).max())
    assert "UNITS: lengths in metres" in top


def test_supports_of_a_preset_are_sets_of_their_own(capsys, tmp_path):
    path, preset = tmp_path / "two.inp", tmp_path / "two.toml"
    preset.write_text(
        'name = "two"\n[surface]\nshape = "plate"\nlength = 2.0\nwidth = 1.0\nedge = 0.3\n'
        '[[surface.support]]\nat = { pick = "side", axis = "x", end = "min" }\nhold = "xyz"\n'
        '[[surface.support]]\nat = { pick = "side", axis = "x", end = "max" }\nhold = "z"\n'
        '[[surface.load]]\nkind = "self_weight"\n[statics]\nthickness = 0.05\n'
    )
    assert run(capsys, "export", str(preset), "--to", "calculix", "-o", str(path))[0] == 0
    lines = path.read_text().splitlines()
    assert [line for line in lines if line.startswith("SUPPORT_")] == [
        "SUPPORT_1, 1, 1", "SUPPORT_1, 2, 2", "SUPPORT_1, 3, 3", "SUPPORT_2, 3, 3",
    ]  # fmt: skip
    assert "** SUPPORT_2 holds z at" in header(path)
    assert "TYPE=S6" in path.read_text()


def test_cut_curved_sheets_are_written_with_a_warning(capsys, tmp_path):
    path = tmp_path / "cut.inp"
    code, said, _ = run(capsys, "export", DOME_MODES, *DOME, "--to", "calculix", "--sheet", "cut", "-o", str(path))
    assert code == 0
    assert "warning: S6 shells are unreliable on cut curved sheets" in said
    assert "WARNING: S6 shells are unreliable" in header(path)
    assert "WARNING" not in header(tmp_path / "cut.inp").replace("WARNING: S6", "")


def test_a_preset_goes_to_the_folder_of_its_build(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, said, err = run(capsys, "export", DOME_MODES, *DOME, "--to", "calculix", "--quiet")
    assert (code, said, err) == (0, "", "")
    assert [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*")] == ["outputs/dome_modes/dome_modes.inp"]


def test_a_built_folder_is_exported_again_in_another_format(capsys, tmp_path):
    built = tmp_path / "built"
    assert run(capsys, "build", DOME_MODES, *DOME, "--format", "stl", "--no-picture", "-o", str(built))[0] == 0
    assert run(capsys, "export", str(built), "--to", "obj")[0] == 0
    facts = json.loads((built / "design.json").read_text())
    volume = trimesh.load(built / "dome_modes.obj").volume / 1e9
    assert volume == pytest.approx(facts["solid"]["volume_m3"], rel=1e-3)
    assert run(capsys, "export", str(built), "--to", "stl", "-o", str(tmp_path / "again.stl"))[0] == 0
    assert (tmp_path / "again.stl").read_bytes() == (built / "dome_modes.stl").read_bytes()
    assert run(capsys, "export", str(built), "--to", "calculix")[0] == 0
    assert "TYPE=S6" in (built / "dome_modes.inp").read_text()


@pytest.mark.parametrize(("sheet", "share"), [("uncut", 1.0), ("cut", None)])
def test_sheets_in_place_of_the_solid(sheet, share, capsys, tmp_path):
    path = tmp_path / "sheet.ply"
    assert run(capsys, "export", DOME_MODES, *DOME, "--sheet", sheet, "-o", str(path))[0] == 0
    mesh = trimesh.load(path)
    assert not mesh.is_watertight
    assert 100e6 * 0.3 < mesh.area < 180e6
    assert (mesh.area > 120e6) == (share == 1.0)


@pytest.mark.parametrize(
    ("formats", "words"),
    [
        ("stl,pdf", "dsfab export does not write 'pdf'; `dsfab compare` and `dsfab report` write reports as PDF"),
        ("steep", "'steep' is not a format; did you mean step? use one of"),
        ("stl,calculix", "a build does not write the format 'calculix'; use dsfab export --to calculix"),
    ],
)
def test_a_build_tells_wrong_formats_once_as_an_export_does(formats, words, capsys):
    told = refused(capsys, "build", "dome", "-f", formats)
    assert words in told
    assert told.count("members.json") <= 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["dome"], "the command names no format; add --to with one of calculix, stl"),
        (["dome", "--to", "calculx"], "'calculx' is not a format; did you mean calculix?"),
        (["dome", "--to", "xyz"], "'xyz' is not a format; use one of calculix, stl"),
        (["dome", "--to", "dwg"], "dsfab export does not write 'dwg'; write dxf, which programs for DWG can read"),
        (["dome", "--to", "pdf"], "dsfab export does not write 'pdf'; `dsfab compare` and `dsfab report`"),
        (["dome", "-o", "part.dwg"], "dsfab export does not write 'dwg'"),
        (["dome", "--to", "calculix", "-o", "dome.stl"], "-o dome.stl does not end in .inp; --to calculix"),
        (["dome", "--to", "3mf", "--sheet", "cut"], "a .3mf file holds only solids; leave out --sheet"),
        (["domme", "--to", "calculix"], "did you mean dome?"),
        (["empty", "--to", "stl"], "empty has no preset.toml, so dsfab did not build it"),
        (["roof", "--to", "calculix"], "preset roof needs your mesh: add --mesh FILE"),
        ([DOME_MODES, "--to", "calculix", "--set", "surface.support.0.hold='z'"], "the supports do not prevent this"),
        (["dome", "--to", "calculix", "--set", "statics.thickness=0"], "statics.thickness"),
        ([DOME_MODES, *DOME, "--to", "calculix", "-o", "file/dome.inp"], "a file already has the name of this folder"),
    ],
)  # fmt: skip
def test_invalid_export_options_are_refused_in_one_sentence(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("a file")
    assert words in refused(capsys, "export", *arguments)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["empty", "file"]


def test_wrong_words_for_the_sheet_are_wrong_usage(capsys):
    assert main(["export", DOME_MODES, "--to", "calculix", "--sheet", "half"]) == 2
    assert "uncut" in capsys.readouterr().err


CASES = """
name = "cases"
[surface]
shape = "plate"
length = 2.0
width = 1.0
edge = 0.12
[[surface.support]]
at = { pick = "side", axis = "x", end = "min" }
clamp = true
[[surface.support]]
at = { pick = "side", axis = "x", end = "max" }
spring = [0.0, 0.0, 2e5]
[[surface.load]]
kind = "self_weight"
case = "dead"
[[surface.load]]
kind = "pressure"
pressure = 2e3
case = "snow"
[[surface.combination]]
name = "uls"
factors = { dead = 1.35, snow = 1.5 }
[statics]
thickness = 0.05
bending = "midedge"
"""


@needs_ccx
def test_cases_combinations_springs_and_clamped_edges_go_along(tmp_path):
    """A plate built in at one end, on springs at the other: every step moves and stores energy as ours."""
    preset = tmp_path / "cases.toml"
    preset.write_text(CASES)
    check = uncut_model(load_preset(preset))
    assert list(check.answers) == list(check.model.steps) == ["dead", "snow", "uls"]
    found = ccx(check.model, tmp_path)
    for theirs, (name, ours) in zip(found, check.answers.items(), strict=True):
        springs = np.sum(check.model.springs[: len(ours.u)] * ours.u**2)
        assert theirs.energy == pytest.approx((ours.compliance - springs) / 2, rel=0.01), name
        assert theirs.u[: len(ours.u), 2] == pytest.approx(ours.u[:, 2], abs=0.01 * np.abs(ours.u[:, 2]).max())
    top = "\n".join(check.model.notes)
    assert "support 2 has springs with a total stiffness of (0, 0, 200000) N/m" in top
    assert "support 1 is clamped" in top
    assert "SUPPORT_2" not in top


COMMANDS = {
    "export": ["export", DOME_MODES, "--to", "stl", "-o", "IN/a.stl"],
    "export of a model": ["export", DOME_MODES, "--to", "calculix", "-o", "IN/deep/a.inp"],
    "export of a folder's name": ["export", DOME_MODES, "--to", "stl", "-o", "FOLDER"],
    "workshop": ["workshop", DOME_MODES, "-o", "IN/parts"],
    "explore": ["explore", DOME_MODES, "--vary", "diffusion.r=1,10", "-o", "IN/sheet"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_an_impossible_format_is_refused_before_any_work(capsys, tmp_path, monkeypatch, command):
    def worked(*_):
        raise AssertionError("it worked first")

    monkeypatch.setattr(stages, "surface_step", worked)
    monkeypatch.setattr("dsfab.study.check_model.surface_step", worked, raising=False)
    (tmp_path / "in").write_text("a file, and no folder")
    (tmp_path / "a.stl").mkdir()
    places = {"IN": str(tmp_path / "in"), "FOLDER": str(tmp_path / "a.stl")}
    *words, where = COMMANDS[command]
    told = refused(capsys, *words, where.replace("IN", places["IN"]).replace("FOLDER", places["FOLDER"]))
    assert str(tmp_path) in told
    assert "choose another" in told
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.stl", "in"]


def test_a_file_in_folders_that_are_still_to_be_made_may_be_written(tmp_path):
    require_writable_file(tmp_path / "new" / "deep" / "a.stl")
    require_writable_file(tmp_path / "a.stl")
    assert list(tmp_path.iterdir()) == []
