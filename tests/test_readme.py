"""The README is true: its commands run, its Python runs, its preset loads, its pictures exist."""

import re
import shlex
import tomllib
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.app.cli import main
from dsfab.materials import MATERIALS
from dsfab.proposal import propose
from dsfab.statics import USES
from dsfab.study.verdict.rules import QUICK
from dsfab.study.verification import TESTS
from dsfab.surface.shapes import barrel_vault
from tests.own_meshes import canopy_mm

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The code blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


WAITS = "dsfab edit"
"""It waits for a browser: `test_ctrl_c_ends_it_cleanly` in test_app_editor.py runs it."""

COMMANDS = [
    line
    for block in blocks("sh")
    for line in block.splitlines()
    if line.startswith("dsfab ") and not line.startswith(WAITS)
]
LONG = ("dsfab build my_roof", "dsfab bench", "dsfab verify", "dsfab compare", "dsfab workshop")
"""Commands that take long, each of which has shorter tests of its own; the first build is always run."""

SETUP = [line for block in blocks("sh") for line in block.splitlines() if ".venv/bin/" in line]


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder with a roof of one's own in it, in millimetres."""
    hall = barrel_vault(edge=1.2)
    trimesh.Trimesh(hall.V * 1000, hall.F, process=False).export(tmp_path / "my_roof.obj")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "line", [pytest.param(line, marks=[pytest.mark.slow] * line.startswith(LONG)) for line in COMMANDS]
)
def test_every_command_runs_as_written(line, desk, capsys):
    words = shlex.split(line, comments=True)
    assert main(words[1:]) == 0, capsys.readouterr().err
    if "build" in words:
        folder = Path(words[words.index("-o") + 1]) if "-o" in words else Path("outputs") / Path(words[2]).stem
        made = {path.suffix for path in folder.iterdir()}
        assert {".stl", ".3mf", ".step", ".png", ".toml", ".json", ".ply"} <= made


def test_there_are_five_commands_to_begin_with():
    first = README.partition("## Five commands")[2].partition("```sh\n")[2].partition("```")[0]
    assert len(first.splitlines()) == 5
    assert set(first.splitlines()) <= set(COMMANDS)


def test_the_two_set_up_commands_differ_in_what_they_install_and_run_only():
    """They themselves are run by `.ci/run`, in a fresh clone; here their parts are checked."""
    build, test = SETUP
    assert build.split(" && ")[0] == test.split(" && ")[0] == "python3 -m venv .venv"
    assert build.endswith(".venv/bin/dsfab build presets/dome.toml")
    assert test.endswith(".venv/bin/pytest")
    assert (ROOT / "presets" / "dome.toml").is_file()


def test_ci_finds_the_commands_it_runs():
    for marker in ("system-packages", "build", "test"):
        after = README.partition(f"<!-- {marker} -->\n```sh\n")[2]
        assert after.splitlines()[0], marker


def test_the_python_example_runs(desk):
    code, _ = blocks("python")
    names: dict[str, object] = {}
    exec(code, names)
    assert names["finer"].surface is names["design"].surface
    assert (desk / "dome.step").stat().st_size > 1000
    assert names["roof"].m == len(names["mesh"].faces)


@pytest.mark.slow
def test_a_mesh_in_memory_becomes_a_file_as_the_readme_says(desk):
    _, code = blocks("python")
    names: dict[str, object] = {}
    exec(code, names)
    assert names["design"].surface.n == names["mesh"].n_points
    assert names["design"].sheet.surface.area / names["design"].surface.area == pytest.approx(0.45, abs=0.005)
    assert "MANIFOLD_SOLID_BREP" in (desk / "roof.step").read_text(encoding="ascii")
    assert names["others"].gain("isotropic") > 3


def test_the_table_of_materials_is_that_of_dsfab():
    rows = README.partition("<!-- materials -->")[2].partition("\n\n")[0].strip().splitlines()[2:]
    found = {row.split("|")[1].strip(" `"): [float(cell) for cell in row.split("|")[2:7]] for row in rows}
    units = (1e9, 1.0, 1.0, 1e6, 1e-6)
    assert list(found) == list(MATERIALS)
    for name, numbers in found.items():
        values = (*MATERIALS[name].values.values(), MATERIALS[name].expansion)
        assert [x * unit for x, unit in zip(numbers, units, strict=True)] == pytest.approx(values, rel=1e-12)


def test_the_preset_of_the_readme_builds(tmp_path):
    text, combined, steered, drawn, workshop = blocks("toml")
    (tmp_path / "canopy.toml").write_text(text, encoding="utf-8")
    design = dsfab.run(dsfab.load_preset(tmp_path / "canopy.toml"))
    assert len(design.slicing.pieces) == 1
    assert design.preset.name == "canopy"
    people = {"kind": "force", "at": {"pick": "all"}, "force": [0, 0, -1000.0], "case": "people"}
    given = {f"surface.{key}": value for key, value in tomllib.loads(combined)["surface"].items()}
    loads = [*tomllib.loads(text)["surface"]["load"], people]
    sums = dsfab.load_preset(tmp_path / "canopy.toml", {"surface.load": loads, **given}).surface.sums
    assert "1.35 dead + 1.6 people + 0.96 snow" in [one.formula for one in sums]
    more = {f"pattern.{key}": value for key, value in tomllib.loads(steered)["pattern"].items()}
    guided = dsfab.revise(design, dsfab.load_preset(tmp_path / "canopy.toml", more))
    assert len(guided.preset.pattern.guide) == 2
    cut = {f"workshop.{key}": value for key, value in tomllib.loads(workshop)["workshop"].items()}
    assert dsfab.load_preset(tmp_path / "canopy.toml", cut).workshop.thickness == 0.012
    assert any("guides break the rest" in note.text for note in guided.notes)
    assert len(guided.slicing.pieces) == 1

    document = ezdxf.new()
    document.header["$INSUNITS"] = 6
    document.modelspace().add_circle((-2.0, -0.5), 0.6, dxfattribs={"layer": "slab"})
    document.saveas(tmp_path / "canopy.dxf")
    (tmp_path / "drawn.toml").write_text(f"{text}\n{drawn}", encoding="utf-8")
    void, rim, slab = (preset := dsfab.load_preset(tmp_path / "drawn.toml")).pattern.region
    holed = dsfab.run(preset)
    assert len(holed.surface.loops) == len(design.surface.loops) + 1
    assert design.surface.area - holed.surface.area == pytest.approx(np.pi * void.at.radius**2, rel=0.1)
    assert holed.surface.areas[slab.faces(holed.surface)].sum() == pytest.approx(np.pi * 0.6**2, rel=0.2)
    assert rim.width == 0.25
    assert holed.sheet.surface.area / holed.surface.area == pytest.approx(0.45, abs=0.006)


def test_its_table_of_elements_is_that_of_the_code():
    rows = re.findall(r"^\| ([^|`]+) \| `(\w+)` \+ `(\w+)` \| (\S+) % \|$", README, flags=re.MULTILINE)
    told = [(about, f"{membrane}+{bending}", float(percent) / 100) for about, membrane, bending, percent in rows]
    assert told == [(use.about, str(use.pair), use.tolerance) for use in USES.values() if use.tolerance is not None]
    assert f"solves {len(TESTS)} structures" in README
    typical, most = QUICK
    assert f"typically within {100 * typical:g} % of the compliance, nine in ten within {100 * most:g} %" in README


def test_pictures_and_files_that_it_names_exist():
    for target in re.findall(r"!\[.*?\]\((.*?)\)", README):
        assert (ROOT / target).stat().st_size > 10_000, target
    for name in ("CHANGELOG.md", "LICENSE", "presets/", "tests/test_architecture.py"):
        assert f"`{name}`" in README
        assert (ROOT / name).exists()


def test_the_decisions_that_it_shows_are_those_for_the_canopy(tmp_path):
    shown = next(block for block in blocks("text") if block.startswith("unit"))
    assert shown.strip().splitlines() == list(propose(canopy_mm(tmp_path)).lines)
