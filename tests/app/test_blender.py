"""The add-on for Blender: run there for real where bpy is installed (Python of `DSFAB_BPY`, else this one).

Without bpy a stand-in takes its place. It is no proof that Blender takes the add-on: only that its words are those of
`dsfab build`, and that it needs nothing that Blender lacks."""

import ast
import importlib.util
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import trimesh

from dsfab.app.cli import app, main
from dsfab.surface.shapes import barrel_vault

BPY = os.environ.get("DSFAB_BPY") or (sys.executable if importlib.util.find_spec("bpy") else "")
needs_bpy = pytest.mark.skipif(not BPY, reason="Blender's bpy is not installed, nor named by DSFAB_BPY")


@pytest.fixture
def addon(tmp_path, monkeypatch):
    """The written add-on on a stand-in of bpy, whose properties are nothing."""
    bpy, mathutils = ModuleType("bpy"), ModuleType("mathutils")
    kinds = ("AddonPreferences", "PropertyGroup", "Operator", "Panel", "Object", "Collection", "LayerCollection")
    kinds += ("Context", "Event")
    bpy.types = SimpleNamespace(**{kind: type(kind, (), {}) for kind in kinds})
    bpy.props = SimpleNamespace(StringProperty=lambda **words: str)
    bpy.path = SimpleNamespace(abspath=lambda path: path)
    mathutils.Matrix = None
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "mathutils", mathutils)
    assert main(["blender", "-o", str(tmp_path / "dsfab_blender.py")]) == 0
    spec = importlib.util.spec_from_file_location("dsfab_blender", tmp_path / "dsfab_blender.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_add_on_calls_dsfab_build_with_the_given_settings(addon):
    settings = SimpleNamespace(preset="dome", changes="statics.material=S235 'description=a b'")
    python, *words = addon.command(addon.PYTHON, Path("roof.obj"), settings, Path("out"))
    assert python == addon.PYTHON == sys.executable
    assert words[:2] == ["-m", "dsfab"]
    taken = app.parse_args(words[2:], exit_on_error=False, print_error=False)[1].arguments
    assert taken["preset"] == "dome"
    assert taken["source"].set_ == ("statics.material=S235", "description=a b")
    assert (taken["source"].mesh, taken["source"].unit, taken["source"].up) == (Path("roof.obj"), "m", "z")
    assert taken["files"].format_ == "glb,members.glb"
    assert not taken["pictures"].picture
    alone = addon.command("", Path("roof.obj"), SimpleNamespace(preset="", changes=""), Path("out"))
    assert alone[4] == "roof.obj"
    assert "--mesh" not in alone
    with pytest.raises(addon.BuildError, match=r"No closing quotation; write KEY=VALUE"):
        addon.command("", Path("roof.obj"), SimpleNamespace(preset="", changes='"'), Path("out"))


def test_the_add_on_reduces_an_error_of_dsfab_to_one_sentence(addon):
    assert addon.failure_sentence(1, "a warning\ndsfab: statics.thickness = -1: no\n") == "statics.thickness = -1: no"
    assert addon.failure_sentence(1, "python: No module named dsfab") == (
        "this Python has no dsfab; name another Python in the preferences of the add-on"
    )
    assert addon.failure_sentence(-9, "") == "dsfab ended with -9: no word"


def test_the_add_on_imports_only_python_and_blender(tmp_path):
    main(["blender", "-o", str(tmp_path / "a.py")])
    tree = ast.parse((tmp_path / "a.py").read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert names - sys.stdlib_module_names == {"bpy", "mathutils"}


def test_the_add_on_is_written_once_and_only_to_a_python_file(tmp_path, capsys):
    words = ["blender", "-o", str(tmp_path / "a.py")]
    assert main(words) == 0
    assert main(words) == 1
    assert "exists already" in capsys.readouterr().err
    assert main([*words, "--force"]) == 0
    assert main(["blender", "-o", str(tmp_path / "a.zip")]) == 1
    assert "does not end in .py" in capsys.readouterr().err


IN_BLENDER = """
import json, sys
import bpy, bmesh
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_install(filepath=sys.argv[1])
bpy.ops.preferences.addon_enable(module="dsfab_blender")
V, F = json.loads(sys.argv[2])
mesh = bpy.data.meshes.new("Hall")
mesh.from_pydata(V, [], F)
hall = bpy.data.objects.new("Hall", mesh)
bpy.context.scene.collection.objects.link(hall)
hall.location = (500, 0, 0)
bpy.context.scene.unit_settings.scale_length = 0.01
bpy.context.view_layer.objects.active = hall
settings = bpy.context.scene.dsfab
settings.preset = "barrel_vault"
said = []
for changes in ("statics.thickness=-1", sys.argv[3], sys.argv[3]):
    settings.changes = changes
    try:
        said.append(list(bpy.ops.dsfab.build()))
    except RuntimeError as error:
        said.append(str(error))
solid = bpy.data.objects["Hall solid"]
found = bmesh.new()
found.from_mesh(solid.data)
bodies = bpy.data.collections["Hall members"].objects
print("FOUND", json.dumps({
    "said": said, "closed": all(edge.is_manifold for edge in found.edges), "volume": found.calc_volume(),
    "low": list(solid.bound_box[0]), "high": list(solid.bound_box[6]), "hidden": hall.hide_get(),
    "members": sorted(one.name for one in bodies), "objects": len(bpy.data.objects),
    "solids": [one.name for one in bpy.data.collections["Hall structure"].objects],
}))
"""


@pytest.mark.slow
@needs_bpy
def test_blender_builds_the_active_object(tmp_path):
    """In a scene of centimetres, twice: closed, as large as in dsfab's STL and where it is, each member by its name."""
    given = barrel_vault(edge=1.0)
    changes = {"pattern.minor.spacing": "2.5", "pattern.fillet": "0", "statics.check": "false"}
    sets = [f"{key}={value}" for key, value in changes.items()]
    trimesh.Trimesh(given.V + [5, 0, 0], given.F, process=False).export(tmp_path / "hall.obj")
    words = ["build", "barrel_vault", "--mesh", str(tmp_path / "hall.obj"), "--unit", "m", "--up", "z", "--no-preview"]
    words += ["-f", "stl,members.json", "-o", str(tmp_path / "out"), "-q", *(w for one in sets for w in ("--set", one))]
    assert main(words) == 0
    solid = trimesh.load(next((tmp_path / "out").glob("*.stl")))
    members = json.loads(next((tmp_path / "out").glob("*.members.json")).read_text(encoding="utf-8"))["members"]
    assert main(["blender", "-o", str(tmp_path / "dsfab_blender.py")]) == 0
    (tmp_path / "run.py").write_text(IN_BLENDER, encoding="utf-8")
    mesh = json.dumps([(given.V * 100).tolist(), given.F.tolist()])
    words = [BPY, str(tmp_path / "run.py"), str(tmp_path / "dsfab_blender.py"), mesh, shlex.join(sets)]
    own = {**os.environ, "HOME": str(tmp_path), "BLENDER_USER_SCRIPTS": str(tmp_path / "scripts")}
    done = subprocess.run(words, capture_output=True, text=True, env=own, cwd=tmp_path, check=False)
    assert "FOUND" in done.stdout, done.stdout[-500:] + done.stderr[-2000:]
    found = json.loads(done.stdout.partition("FOUND ")[2].splitlines()[0])
    assert "statics.thickness = -1: should be greater than 0" in found["said"][0]
    assert found["said"][1:] == [["FINISHED"], ["FINISHED"]]
    assert found["closed"]
    assert found["volume"] == pytest.approx(solid.volume / 1e3, rel=1e-3)  # mm3, cm3
    assert [found["low"], found["high"]] == [pytest.approx(row, rel=1e-3, abs=0.1) for row in solid.bounds / 10]
    assert found["members"] == sorted(one["id"] for one in members)
    assert found["solids"] == ["Hall solid"]
    assert found["objects"] == 2 + len(members)  # the hall, its solid; nothing of the first build
    assert found["hidden"]
