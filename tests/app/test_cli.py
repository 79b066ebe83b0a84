"""The command line as people use it and mistype it: files, exit codes, one sentence, nothing left behind."""

import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import ezdxf
import pytest
import trimesh

import dsfab
from dsfab.app import bench as bench_module
from dsfab.app.check import Expected
from dsfab.app.cli import main
from dsfab.app.options import Source
from dsfab.core.errors import DsfabError, PresetError
from dsfab.core.toml_files import shipped_presets
from dsfab.export import FORMATS
from dsfab.preset.file import load_preset
from dsfab.preset.proposal import propose
from dsfab.surface.files import mesh_files
from tests.app.command_line import refused, run
from tests.presets import DOME_MODES, GLOBE_MODES, ROOF_MODES

SLOW = (".step", ".stp", ".stpz", ".brep")
QUICK = ["--set", "surface.edge=0.9", "--format", "stl,ply", "--no-picture"]


def test_build_writes_all_files_and_prints_a_summary(capsys, tmp_path):
    folder = tmp_path / "out"
    code, out, err = run(capsys, "build", "dome", *QUICK, "--verbose", "-o", str(folder))
    assert code == 0
    assert out.startswith("dome carries its loads\n")
    assert sorted(path.name for path in folder.iterdir()) == [
        "design.json", "design.npz", "dome.ply", "dome.stl", "preset.toml", "sheet.ply",
    ]  # fmt: skip
    assert "1 piece" in out
    stages = list(dict.fromkeys(line.split()[0] for line in err.splitlines()))
    assert stages[:6] == ["surface", "statics", "diffusion", "pattern", "slicing", "thickening"]
    facts = json.loads((folder / "design.json").read_text())
    mesh = trimesh.load(folder / "dome.stl")
    assert mesh.is_volume
    assert mesh.volume / 1e9 == pytest.approx(facts["solid"]["volume_m3"], rel=1e-3)
    assert facts["solid"]["mass_kg"] == pytest.approx(facts["solid"]["volume_m3"] * 7850)
    assert facts["solid"]["pieces"] == len(facts["sheet"]["pieces"]) == 1
    assert facts["statics"]["compliance_J"] > 0
    assert sum(facts["statics"]["load_N"]) == pytest.approx(-sum(facts["statics"]["reaction_N"]), rel=1e-6)
    assert {"dsfab", "numpy", "python"} <= set(facts["versions"])
    assert {"membrane", "bending", "statics", "modes", "slicing", "thickening", "export"} <= set(facts["seconds"])
    assert facts["files"] == ["dome.stl", "dome.ply"]


def test_the_written_preset_builds_the_same_bytes(capsys, tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    assert run(capsys, "build", DOME_MODES, *QUICK, "-o", str(first))[0] == 0
    assert run(capsys, "build", str(first / "preset.toml"), "--no-picture", "-o", str(second))[0] == 0
    for name in ("dome_modes.stl", "dome_modes.ply", "sheet.ply"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_a_build_replaces_the_former_build_and_keeps_files_of_the_user(capsys, tmp_path):
    folder = tmp_path / "out"
    assert run(capsys, "build", DOME_MODES, *QUICK, "-o", str(folder))[0] == 0
    assert run(capsys, "export", str(folder), "--to", "obj")[0] == 0
    (folder / "notes.txt").write_text("mine")
    assert run(capsys, "build", DOME_MODES, *QUICK[:2], "--no-picture", "--format", "off", "-o", str(folder))[0] == 0
    written = {"dome_modes.off", "sheet.ply", "design.npz", "preset.toml"}
    assert {path.name for path in folder.iterdir()} == {*written, "design.json", "notes.txt", "dome_modes.obj"}
    told = json.loads((folder / "design.json").read_text())["manifest"]
    assert {name: (one["bytes"], one["sha256"]) for name, one in told.items()} == {
        name: ((folder / name).stat().st_size, hashlib.sha256((folder / name).read_bytes()).hexdigest())
        for name in written
    }


@pytest.mark.slow
def test_the_same_preset_gives_the_same_bytes_in_another_process(capsys, tmp_path):
    """Where sets of words are in another order."""
    here, there = tmp_path / "here", tmp_path / "there"
    formats = [suffix[1:] for suffix in FORMATS if suffix not in (*SLOW, ".3dm")]  # slow, and has a test of its own
    asked = ["--set", "surface.edge=1.2", "--set", "pattern.keep=0.6"]
    asked += ["--set", "statics.strength=235e6"]  # without one no utilisation is known
    asked += ["--set", "pattern.major.frequency=3", "--set", "pattern.minor.frequency=3"]  # lines take long
    asked += ["--no-picture", "--format", ",".join(formats)]
    assert run(capsys, "build", DOME_MODES, *asked, "-o", str(here))[0] == 0
    command = [sys.executable, "-m", "dsfab.app.cli", "build", DOME_MODES, *asked, "-o", str(there), "--quiet"]
    other = {**os.environ, "PYTHONHASHSEED": "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=other)
    assert done.stdout == done.stderr == ""
    for suffix in formats:
        name = f"dome_modes.{suffix}"
        assert (here / name).read_bytes() == (there / name).read_bytes(), suffix


def test_presets_are_listed_with_a_sentence_each(capsys):
    code, out, _ = run(capsys, "presets")
    assert code == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert names == sorted(names)
    assert {"dome", "globe", "sphere", "barrel_vault", "cantilever", "tower", "bob", "figurine"} <= set(names)
    assert all(len(line.split()) > 5 for line in out.splitlines())


def test_materials_are_listed_with_their_values_and_sources(capsys):
    code, out, _ = run(capsys, "materials")
    assert code == 0
    assert out.count("source: ") == out.count("strength: ") == 16
    (line,) = [line for line in out.splitlines() if line.startswith("GL24h ")]
    assert line.split(None, 1)[1] == (
        "young 11.5 GPa, poisson 0.3, density 420 kg/m3, strength 12.3 MPa, expansion 5e-6/K"
    )
    assert "19.2 MPa x 0.8 / 1.25" in out
    assert "EN 14080" in out


def test_inspect_prints_the_size_and_the_topology_of_a_mesh(capsys, tmp_path):
    file = tmp_path / "box.stl"
    trimesh.creation.box((2000, 1000, 500)).export(file)
    code, out, _ = run(capsys, "inspect", str(file), "--unit", "mm")
    assert code == 0
    for words in ("2 m x 1 m x 500 mm", "closed", "12 triangles", "1 m3", "yes, and oriented"):
        assert words in out


def test_inspect_lists_sizes_in_several_units_if_a_file_names_no_unit(capsys, tmp_path):
    V = "v 0 0 0\nv 315 0 0\nv 315 236 0\nv 0 236 118\nf 1 2 3\nf 1 3 4\n"
    (tmp_path / "room.obj").write_text(V)
    _, out, _ = run(capsys, "inspect", str(tmp_path / "room.obj"))
    assert propose(tmp_path / "room.obj").preset.surface.unit == "cm"
    assert "likely unit  cm; --unit mm: 315 mm x 236 mm x 118 mm; --unit m: 315 m x 236 m x 118 m; " in out
    assert "; --unit in: 8 m x 5.99 m x 3 m; --unit ft: 96 m x 71.9 m x 36 m\n" in out
    (tmp_path / "room.obj").write_text("# File units = feet\n" + V)
    _, out, _ = run(capsys, "inspect", str(tmp_path / "room.obj"))
    assert "(read as ft)" in out
    assert "likely unit  ft, as the file says\n" in out
    tips = "v 0 0 0\nv 9 0 9\nv -9 9 9\nv -9 -9 9\nv 9 0 -9\nv -9 9 -9\nv -9 -9 -9\n".replace("9", "9000")
    tips += "f 1 2 3\nf 1 3 4\nf 1 4 2\nf 1 6 5\nf 1 7 6\nf 1 5 7\n"
    (tmp_path / "room.obj").write_text(tips)
    code, out, _ = run(capsys, "inspect", str(tmp_path / "room.obj"))
    assert (code, "likely unit  mm; " in out, "(read as mm)" in out) == (1, True, True)  # dsfab build refuses the file


def test_inspect_measures_the_surface_without_doubled_faces(capsys, tmp_path):
    (tmp_path / "quad.obj").write_text("v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3\nf 1 3 4\nf 1 2 4\nf 2 3 4\n")
    _, out, _ = run(capsys, "inspect", str(tmp_path / "quad.obj"))
    assert "2 faces of a second copy of the sheet; the surface then has 2 triangles, 81 m2 and 1 boundary loop" in out


def test_inspect_reads_a_file_once_and_explains_why_it_is_no_manifold(capsys, tmp_path, monkeypatch):
    read, one = [], mesh_files.readable
    monkeypatch.setattr(mesh_files, "readable", lambda *given: read.append(given) or one(*given))
    file = tmp_path / "fan.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n")
    code, out, _ = run(capsys, "inspect", str(file))
    assert code == 0
    assert "manifold  no" in " ".join(out.split("\n")).replace("   ", "  ") or "no" in out
    assert "because" in out
    assert len(read) == 1


def test_inspect_exits_with_1_for_a_mesh_that_build_refuses_and_lists_repairs(capsys, tmp_path):
    good, far = tmp_path / "good.obj", tmp_path / "far.obj"
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 1 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 1 4 5\nf 1 2\n"
    good.write_text(text)
    code, out, _ = run(capsys, "inspect", str(good))
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0
    assert "read OBJ: 5 vertices, 5 faces" in lines
    assert "dropped 1 face with fewer than three corners" in lines
    assert "build takes it; 1 face of 4 turned over, so that neighbours are oriented alike" in lines
    far.write_text(text.replace("2 0 0", "3e38 0 0").replace("2 2 0", "3e38 3e38 0"))
    code, out, _ = run(capsys, "inspect", str(far))
    assert code == 1
    assert "build refuses it: the surface is 3e+35 m large" in " ".join(out.split())
    assert run(capsys, "inspect", str(far), "--report")[0] == 0
    assert "--max-triangles" in refused(capsys, "inspect", str(good), "--max-triangles", "2")
    assert "--max-triangles" in refused(capsys, "build", str(good), "--max-triangles", "2")
    assert "--max-triangles" in refused(capsys, "new", str(good), "--max-triangles", "2")


def test_a_mistake_of_ours_is_a_sentence_a_file_and_code_70(capsys, tmp_path, monkeypatch):
    def broken():
        raise KeyError("vertex")

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("dsfab.core.toml_files.shipped_presets", broken)
    line = refused(capsys, "presets", code=70)
    (log,) = tmp_path.iterdir()
    assert (
        line
        == f"dsfab: dsfab made a mistake, and nothing was written; please report the mistake, with the details in {log}"
    )
    text = log.read_text()
    assert "arguments: ['presets']" in text
    assert "KeyError: 'vertex'" in text
    monkeypatch.setattr("tempfile.mkstemp", lambda **_: (_ for _ in ()).throw(PermissionError()))
    assert refused(capsys, "presets", code=70).endswith("(KeyError; the file with the details could not be written)")


@pytest.mark.slow
def test_bench_prints_json_with_the_agreed_keys(capsys):
    arguments = ["bench", DOME_MODES, "--set", "surface.edge=1.2", "--repeat", "1", "--set", "export.formats=['stl']"]
    code, out, err = run(capsys, *arguments, "--json")
    assert (code, err) == (0, "")
    (row,) = json.loads(out)
    assert list(row) == ["preset", "vertices", "triangles", *bench_module.TIMING_COLUMNS, "peak_mb", "compliance"]
    assert row["stripes"] is None  # they are on modes
    assert all(row[key] >= 0 for key in bench_module.TIMING_COLUMNS if key != "stripes")
    assert row["total"] >= sum(row[key] for key in ("membrane", "statics", "modes", "slicing"))
    assert row["peak_mb"] > 50
    evenly = (
        "--set",
        "pattern.method='stripes'",
        "--set",
        "pattern.major.spacing=2",
        "--set",
        "pattern.minor.spacing=2",
    )
    code, out, _ = run(capsys, *arguments, *evenly, "--json")
    assert code == 0
    assert 0 < json.loads(out)[0]["stripes"] < json.loads(out)[0]["total"]


@pytest.mark.slow
def test_bench_scaling_runs_one_preset_at_several_sizes(capsys, monkeypatch):
    monkeypatch.setattr(bench_module, "SCALING", (300, 600))
    code, out, _ = run(
        capsys, "bench", DOME_MODES, "--scaling", "--repeat", "1", "--json", "--set", "export.formats=[]"
    )
    assert code == 0
    rows = json.loads(out)
    assert [row["vertices"] for row in rows] == pytest.approx([300, 600], rel=0.1)
    canopy = Path(__file__).parents[2] / "docs" / "examples" / "canopy.toml"  # its surface is a file
    code, _, err = run(capsys, "bench", str(canopy), "--scaling")
    assert code == 1
    assert "surface.edge" in err
    assert "has no surface.edge" in err


@pytest.mark.slow
def test_bench_prints_a_table_and_says_not_applicable_where_a_flat_sheet_does_not_bend(capsys):
    quick = ["--set", "surface.edge=0.1", "--repeat", "1", "--set", "export.formats=['stl']"]
    code, out, _ = run(capsys, "bench", "cantilever", *quick)
    assert code == 0
    head, row = (line.split() for line in out.splitlines()[:2])
    assert head[:9] == ["preset", "|V|", "|T|", "Membrane", "Bending", "Statics", "Stress", "Diffusion", "Modes"]
    assert row[0] == "cantilever"
    assert row[4] == "n/a"


@pytest.mark.slow
def test_compare_prints_and_writes_competitors_and_gain(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["compare", "cantilever", "--set", "surface.edge=0.15", "--against", "thinner,grid", "--frequency"]
    arguments.append("--no-report")
    code, out, _ = run(capsys, *arguments)
    assert code == 0
    first, *lines = out.splitlines()
    assert first.startswith("This design loses: a uniformly thinner sheet")
    assert [line.split()[0] for line in lines[:5]] == ["structure", "full", "design", "thinner", "grid"]
    assert "x as stiff as the best grid structure" in out
    folder = tmp_path / "outputs" / "cantilever" / "compliance"
    assert sorted(path.name for path in folder.iterdir()) == ["results.csv", "results.json"]
    told = json.loads((folder / "results.json").read_text())
    rows = {row["name"]: row for row in told["competitors"]}
    assert rows["design"]["compliance_J"] > rows["full"]["compliance_J"]
    assert rows["thinner"]["mass_kg"] == pytest.approx(rows["design"]["mass_kg"])
    assert "full swings at" in out
    assert "prevent movements out of the sheet's plane" in out
    assert told["preset"].startswith('name = "cantilever"')
    with open(folder / "results.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["name"] for row in table] == list(rows)
    assert float(table[1]["compliance_J"]) == rows["design"]["compliance_J"]


@pytest.mark.slow
def test_compare_at_several_volumes_draws_a_chart(capsys, tmp_path):
    arguments = ["compare", "cantilever", "--set", "surface.edge=0.1", "--against", "thinner", "--volumes", "0.5:0.7:2"]
    code, out, err = run(capsys, *arguments, "--no-report", "--json", "-o", str(tmp_path / "c"))
    assert (code, err) == (0, "")
    rows = json.loads(out)["competitors"]
    assert [(row["volume"], row["name"]) for row in rows] == [
        (share, name) for share in (None, 0.5, 0.7) for name in ("full", "design", "thinner")
    ]
    assert [row["level"] for row in rows[3:]] == 2 * ["full", "quick", "full"]  # whole sheets have coarse meshes
    assert rows[3]["compliance_J"] == rows[6]["compliance_J"]
    shared = [row for row in rows if row["volume"] and row["name"] != "full"]
    assert all(row["mass_kg"] == pytest.approx(row["volume"] * 157, rel=1e-3) for row in shared)
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == [
        "chart.png",
        "chart.svg",
        "results.csv",
        "results.json",
    ]
    assert "whole sheet, thinner" in (tmp_path / "c" / "chart.svg").read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["build", "domme"], "did you mean dome?"),
        (["build", "dome", "--set", "pattern.major.frequncy=3"], "did you mean frequency?"),
        (["build", "dome", "--set", "pattern.major.frequency"], "is not KEY=VALUE"),
        (["build", "dome", "--mesh", "missing.obj"], "missing.obj"),
        (["build", "figurine"], "preset figurine needs your mesh: add --mesh FILE"),
        (["build", "dome", "--format", "steep"], "did you mean step?"),
        (["build", "dome", "--format", "dwg"], "dsfab export does not write 'dwg'; write dxf"),
        (["build", DOME_MODES, "--set", "pattern.major.mode=40", *QUICK], "pattern.major.mode = 40"),
        (["inspect", "missing.stl"], "missing.stl"),
        (["bench", "nowhere"], "preset 'nowhere' not found"),
        (["compare", "dome", "--against", "simpp"], "did you mean simp?"),
        (["compare", "dome", "--volumes", "0.2:1.2:3"], "write for instance 0.2:0.8:7"),
        (["compare", "dome", "--volumes", "half"], "write for instance 0.2:0.8:7"),
    ],
)
def test_refused_input_ends_with_code_1_and_one_sentence(capsys, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    assert says in refused(capsys, *arguments)
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


@pytest.mark.parametrize(
    "arguments",
    [["bild", "dome"], ["build"], ["build", "dome", "--colour", "red"], ["bench", "dome", "--repeat", "many"]],
)
def test_wrong_usage_ends_with_code_2(capsys, arguments):
    assert "--help" in refused(capsys, *arguments, code=2)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("build dome -f stl -f step", "option -f appears more than once; give it once, with commas: -f stl,step"),
        ("build dome -o a -o b", "option -o appears more than once; give it once"),
    ],
)
def test_a_repeated_option_is_refused_with_the_correct_spelling(capsys, words, says):
    assert main(words.split()) == 2
    assert capsys.readouterr().err == f"dsfab: {says}\n"


def test_help_and_version(capsys):
    code, out, _ = run(capsys, "--help")
    assert code == 0
    for name in ("bench", "build", "compare", "inspect", "materials", "presets", "verify"):
        (line,) = [line for line in out.splitlines() if f"│ {name} " in line]
        assert len(line.strip("│ ").split()) > 4, "each command says what it does"
    code, out, _ = run(capsys, "--version")
    assert (code, out.strip()) == (0, dsfab.__version__)
    code, out, _ = run(capsys, "build", "--help")
    assert code == 0
    for option in ("--set", "--mesh", "--format", "--quiet", "-o"):
        assert option in out


def test_a_folder_that_cannot_be_written_is_refused(capsys, tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert "cannot write to" in refused(capsys, "build", DOME_MODES, *QUICK, "-o", str(tmp_path / "file"))
    assert (tmp_path / "file").read_text() == "in the way"


def test_a_full_disk_leaves_the_older_files_and_nothing_else(capsys, tmp_path, monkeypatch):
    folder = tmp_path / "out"
    assert run(capsys, "build", DOME_MODES, *QUICK, "-o", str(folder))[0] == 0
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    assert "No space left on device" in refused(capsys, "build", DOME_MODES, *QUICK, "-o", str(folder))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_full_disk_in_a_new_folder_leaves_no_folder(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    said = refused(capsys, "build", DOME_MODES, *QUICK, "-o", str(tmp_path / "a" / "b"))
    assert "the disk is full; free some space" in said
    assert "partial" not in said, "the place that the user named, not ours"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_stops_a_build_with_one_line_and_leaves_no_files(tmp_path):
    command = [
        sys.executable,
        "-m",
        "dsfab.app.cli",
        "build",
        GLOBE_MODES,
        "--set",
        "surface.edge=0.015",
        "--no-picture",
        "--verbose",
    ]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    begun = process.stderr.readline()  # it works, however long it took to start
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert begun.startswith("surface")
    assert process.returncode == 130
    assert "stopped; no file is half written" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_unit_is_refused_with_the_list_of_units(capsys, tmp_path):
    file = tmp_path / "box.stl"
    trimesh.creation.box((2, 1, 1)).export(file)
    assert "unit = 'furlong' is not known; use one of mm, cm" in refused(
        capsys, "inspect", str(file), "--unit", "furlong"
    )
    assert "furlong" in refused(capsys, "build", ROOF_MODES, "--mesh", str(file), "--unit", "furlong", "--no-picture")


def test_a_mesh_in_millimetres_is_scaled(capsys, tmp_path):
    file = tmp_path / "cap.obj"
    cap = load_preset(DOME_MODES, {"surface.edge": 0.8}).surface.build()
    trimesh.Trimesh(cap.V * 1000, cap.F, process=False).export(file)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes() + b"\nv 1 2 3\nf 1 2\n")
    small = ["--set", "pattern.keep=0.3", *QUICK[2:]]
    code, said, _ = run(
        capsys, "build", ROOF_MODES, "--mesh", str(file), "--unit", "mm", *small, "-o", str(tmp_path / "o")
    )
    assert code == 0
    facts = json.loads((tmp_path / "o" / "design.json").read_text())
    assert facts["file"] == {
        "read": [f"OBJ: {cap.n + 1} vertices, {cap.m + 1} faces", "UTF-8 with a byte order mark"],
        "repaired": [],
        "dropped": ["1 face with fewer than three corners", "1 vertex without a face"],
        "content": [
            {"kind": "face", "fate": "taken", "about": "", "count": cap.m},
            {"kind": "face", "fate": "dropped", "about": "with fewer than three corners", "count": 1},
        ],
    }
    assert "  cap.obj, dropped: 1 vertex without a face" in said
    assert facts["surface"]["area_m2"] == pytest.approx(cap.area, rel=1e-5)


# --- a mesh that is missing, and folders


@pytest.mark.parametrize(
    "words",
    [
        ("build", "roof"),
        ("build", str(shipped_presets()["roof"]), "--set", "statics.thickness=0.1"),
        ("preview", "roof"),
        ("export", "roof", "--to", "stl"),
        ("inspect", "roof"),
        ("edit", "roof"),
        ("compare", "roof"),
        ("explore", "roof", "--vary", "pattern.major.spacing=1,2"),
        ("bench", "roof"),
        ("sweep", "roof", "--vary", "pattern.major.spacing=1,2"),
    ],
)
def test_a_preset_that_waits_for_a_mesh_says_so(capsys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    said = refused(capsys, *words)
    assert said.endswith("preset roof needs your mesh: add --mesh FILE, and --unit mm if the file is in millimetres")
    assert not list(tmp_path.iterdir())


def test_a_missing_mesh_is_refused_with_its_path(capsys, tmp_path):
    missed = str(tmp_path / "nowhere.obj")
    assert "nowhere.obj does not exist" in refused(capsys, "build", "roof", "--mesh", missed)
    assert "nowhere.obj does not exist" in refused(capsys, "build", "roof", "--set", f"surface.file={missed}")


@pytest.mark.parametrize("words", [("new", "{}", "-o", "{name}.toml"), ("inspect", "{name}.obj"), ("build", "{name}")])
def test_a_name_of_300_letters_is_refused_in_one_sentence(capsys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((8, 6, 3)).export("roof.obj")
    said = refused(capsys, *(word.format("roof.obj", name="a" * 300) for word in words))
    assert said.endswith(f"{'a' * 40}... is too long; choose a shorter name")


def test_cases_have_names_in_letters_of_any_language(capsys):
    for name in ("Schnee ü", "雪", "нагрузка.1"):
        assert (
            load_preset("dome", {"surface.load": [{"kind": "self_weight", "case": name}]}).surface.load[0].case == name
        )
    said = refused(capsys, "build", "dome", "--set", 'surface.load=[{kind = "self_weight", case = "snow+1"}]')
    assert "'snow+1': use letters, digits, spaces and the marks _ . - after a letter or digit" in said


def test_inspect_prints_the_inventory_of_a_file(capsys, tmp_path):
    document = ezdxf.new(units=6)
    document.layers.add("old").freeze()
    for layer in ("0", "old"):
        for x in (0, 4):
            corners = [(x, 0, 0), (x + 4, 0, 0), (x + 4, 6, 2), (x, 6, 2)]
            document.modelspace().add_3dface(corners, dxfattribs={"layer": layer})
    document.modelspace().add_line((0, 0), (1, 0))
    document.modelspace().add_line((0, 0), (8, 0), dxfattribs={"layer": "supports"})
    document.modelspace().add_line((0, 0), (8, 0), dxfattribs={"layer": "support"})
    document.saveas(file := tmp_path / "roof.dxf")
    _, said, _ = run(capsys, "inspect", str(file))
    rows = [line.split(None, 1) for line in said.splitlines()]
    assert ["beside", "1 curve: no surface"] in rows
    assert ["marks", "1 curve on layer 'support'"] in rows
    assert ["dropped", "2 hidden objects on layer 'old'"] in rows
    assert ["dropped", "1 curve on layer 'supports'; did you mean layer support?"] in rows
    _, said, _ = run(capsys, "new", str(file), "-o", str(tmp_path / "roof.toml"))
    assert "beside the surface: 1 curve" in said
    assert "2 hidden objects on layer 'old'" in said


FEW = ("--set", "surface.edge=2")


def test_a_folder_named_like_a_preset_shadows_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dome").mkdir()
    for name in ("preset.toml", "sweep.toml", "design.json"):
        (tmp_path / "dome" / name).write_text("rubbish")
    assert run(capsys, "export", "dome", *FEW, "--to", "ply", "--sheet", "uncut", "-q")[0] == 0
    assert (tmp_path / "outputs" / "dome" / "dome.ply").is_file()
    assert not (tmp_path / "dome" / "dome.ply").exists()
    assert load_preset("dome").name == "dome"

    def asked(source, name, **_):
        raise PresetError(f"asked for {name}")

    with monkeypatch.context() as patched:
        patched.setattr(Source, "read_preset", asked)
        assert "asked for dome" in refused(capsys, "inspect", "dome")
    assert "no design.json" in refused(capsys, "inspect", "./dome")
    assert "preset.toml is not valid TOML" in refused(capsys, "export", "./dome", "--to", "stl")
    assert "unknown key nothing" in refused(capsys, "sweep", "dome", "--vary", "nothing=1,2")
    assert "sweep.toml" in refused(capsys, "sweep", "dome")
    assert Expected().read_preset("dome").name == "dome"


@pytest.mark.parametrize(("coarser", "says"), [("7.5", "no screen"), ("8.5", "is not a number from 1 to 8")])
def test_figures_are_made_with_edges_up_to_eight_times_as_long(coarser, says, capsys, monkeypatch):
    def without_screen():
        raise DsfabError("no screen")

    monkeypatch.setattr("dsfab.render.opengl.require_rendering", without_screen)
    assert main(["reproduce", "bob", "--coarser", coarser]) != 0
    assert says in capsys.readouterr().err
