"""Parts of a file that the user selects by name: files of programs that are not ours, in every format with names."""

import pytest

from dsfab.core.errors import SurfaceError
from dsfab.preset.file import load_preset
from dsfab.surface import describe, read_surface
from dsfab.surface.files.drawings import marks_on_layers
from dsfab.surface.files.mesh_files import raw_mesh
from tests.app.command_line import refused, run
from tests.surface.named_files import (
    PARTS,
    ROOF,
    WALLS,
    dxf_file,
    ifc_file,
    read_in_this_process,
    rhino_file,
    scene_file,
    step_file,
    threemf_file,
)

FILES = {
    "roof.3dm": rhino_file,
    "roof.dxf": dxf_file,
    "roof.obj": scene_file,
    "roof.glb": scene_file,
    "roof.3mf": threemf_file,
    "roof.step": step_file,
    "roof.ifc": ifc_file,
}


@pytest.fixture(autouse=True)
def within(monkeypatch):
    read_in_this_process(monkeypatch)


def names_offered(path, name):
    with pytest.raises(SurfaceError, match=f"no visible part has the name '{name}'; the names are ") as refusal:
        raw_mesh(path, only=[name])
    assert str(refusal.value).startswith(f"{path}: ")
    return str(refusal.value).partition("the names are ")[2].partition(": choose one name with --only")[0]


@pytest.mark.parametrize("name", FILES)
def test_only_the_named_part_is_read_and_the_others_are_counted(name, tmp_path):
    path = FILES[name](tmp_path / name)
    whole = raw_mesh(path)
    assert len(whole.F) == (ROOF.m + WALLS.m if name != "roof.step" else 4)
    assert not any("unselected" in text for text in whole.record.dropped)
    assert read_surface(path, only=["Roof"]).area == pytest.approx(ROOF.area)
    assert read_surface(path, only=["Walls"]).area == pytest.approx(WALLS.area)
    other = "IfcWall" if name == "roof.ifc" else "Walls"
    assert raw_mesh(path, only=["Roof"]).record.dropped == (f"1 unselected part of '{other}'",)
    assert read_surface(path, only=["Roof", "Walls"]).area == pytest.approx(ROOF.area + WALLS.area)


@pytest.mark.parametrize("name", FILES)
def test_an_unknown_name_is_refused_with_the_nearest_names_first(name, tmp_path):
    path = FILES[name](tmp_path / name)
    assert names_offered(path, "Rooof").split(", ")[0] in ("Roof", "Roof mesh")
    assert names_offered(path, "Wals").split(", ")[0] in ("Walls", "IfcWall")
    assert read_surface(path, only=["ROOF"]).area == pytest.approx(ROOF.area)


@pytest.mark.parametrize(
    ("name", "write", "words"),
    [
        ("layer.3dm", lambda path: rhino_file(path, layers=[("Top", None), ("Roof", 0), ("Walls", None)]), "Top"),
        ("path.3dm", lambda path: rhino_file(path, layers=[("Top", None), ("Roof", 0), ("Walls", 0)]), "Top::Roof"),
        ("outer.3dm", lambda path: rhino_file(path, layers=[("Top", None), ("Roof", None), ("Roof", 0)]), "Roof"),
        ("object.3dm", rhino_file, "Roof object"),
        ("block.3dm", lambda path: rhino_file(path, block="bay"), "bay"),
        ("block.dxf", lambda path: dxf_file(path, block="bay"), "bay"),
        ("insertion.dxf", lambda path: dxf_file(path, block="bay"), "blocks"),
        ("node.glb", lambda path: scene_file(path, above="shell"), "shell"),
        ("mesh.glb", scene_file, "Roof mesh"),
        ("object.3mf", lambda path: threemf_file(path, above="shell"), "shell"),
        ("item.3mf", lambda path: threemf_file(path, above="shell"), "number 0"),
        ("assembly.step", lambda path: step_file(path, above="shell"), "shell"),
        ("storey.ifc", ifc_file, "Top"),
        ("class.ifc", ifc_file, "IfcRoof"),
    ],
)
def test_a_name_also_selects_the_parts_inside(name, write, words, tmp_path):
    path = write(tmp_path / name)
    assert describe(path).area == pytest.approx(ROOF.area + WALLS.area)
    surface = read_surface(path, only=[words])
    assert surface.area == pytest.approx(ROOF.area)
    assert surface.V[:, 2].min() == pytest.approx(0.7 if name == "assembly.step" else 0)


def nested_3dm(path, *things):
    """3DM: on the layers Top, Roof and Top::Roof, `things` are pairs of a geometry and the number of a layer."""
    rhino3dm = pytest.importorskip("rhino3dm")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    for name, above in (("Top", None), ("Roof", None), ("Roof", 0)):
        entry = rhino3dm.Layer()
        entry.Name = name
        if above is not None:
            entry.ParentLayerId = model.Layers[above].Id
        model.Layers.Add(entry)
    mesh = rhino3dm.Mesh()
    for point in ROOF.V.tolist():
        mesh.Vertices.AddPoint3d(*point)
    for face in ROOF.F.tolist():
        mesh.Faces.AddFace(*face)
    model.InstanceDefinitions.Add("bay", "", "", "", rhino3dm.Point3d(0, 0, 0), (mesh,), (on_layer(0),))
    block = rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, rhino3dm.Transform(1.0))
    line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    add = {"mesh": (model.Objects.AddMesh, mesh), "line": (model.Objects.AddCurve, line)}
    for thing, number in things:
        if thing == "block":
            model.Objects.AddInstanceObject(block, on_layer(number))
        else:
            add[thing][0](add[thing][1], on_layer(number))
    assert model.Write(str(path), 7)
    return path


def on_layer(number):
    about = pytest.importorskip("rhino3dm").ObjectAttributes()
    about.LayerIndex = number
    return about


@pytest.mark.parametrize(
    ("things", "left_out"),
    [
        ([("line", 1), ("mesh", 2)], 0),  # a layer with a line only is no rival
        ([("mesh", 1), ("mesh", 2)], 1),
        ([("mesh", 1), ("block", 2)], 1),
        ([("block", 1), ("mesh", 2)], 1),
    ],
)
def test_a_layer_of_a_3dm_file_is_the_outermost_of_its_name_that_holds_surfaces(things, left_out, tmp_path):
    record = raw_mesh(nested_3dm(tmp_path / "roof.3dm", *things), only=["Roof"]).record
    assert sum("unselected part" in text for text in record.dropped) == left_out


def test_groups_and_objects_of_an_obj_file_have_names(tmp_path):
    path = tmp_path / "roof.obj"
    triangle = "f 1 2 3\n"
    path.write_text(
        f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n{triangle}o hall\ng roof tiles\n{triangle}f 2 3 4\n"
        f"g wall\nf 2 4 3\no green yard\n{triangle}g roof\nf 3 4 1\n"
    )
    faces = {"hall": 3, "roof": 3, "tiles": 2, "roof tiles": 2, "wall": 2, "green yard": 2}
    assert {name: len(raw_mesh(path, only=[name]).F) for name in faces} == faces
    assert names_offered(path, "yard").startswith("green yard, ")  # an object has one name
    record = raw_mesh(path, only=["tiles"]).record
    assert record.surface_words == "2 faces, 1 group"
    assert record.dropped == (
        "1 unselected part without a name",
        "1 unselected part of 'wall'",
        "1 unselected part of 'green yard'",
        "1 unselected part of 'roof'",
    )


def test_names_that_differ_only_in_case_must_be_written_exactly(tmp_path):
    path = scene_file(tmp_path / "roof.obj", [("Roof", *PARTS[0][1:]), ("ROOF", *PARTS[1][1:])])
    assert read_surface(path, only=["Roof"]).area == pytest.approx(ROOF.area)
    assert read_surface(path, only=["ROOF"]).area == pytest.approx(WALLS.area)
    with pytest.raises(
        SurfaceError, match="the name 'roof' may mean 'Roof' or 'ROOF'; write one of these names exactly"
    ):
        raw_mesh(path, only=["roof"])


def test_unselected_parts_with_many_names_are_one_line(tmp_path):
    parts = [(f"part {k}", ROOF.V + [0, 0, k], ROOF.F) for k in range(9)]
    path = dxf_file(tmp_path / "roof.dxf", parts)
    assert raw_mesh(path, only=["part 4"]).record.dropped == ("8 unselected parts of 8 names, first 'part 0'",)
    assert names_offered(path, "part") == ", ".join(f"part {k}" for k in range(8)) + " and 1 more"


@pytest.mark.parametrize("suffix", ["stl", "ply", "off", "brep"])
def test_a_format_without_names_says_so(suffix, tmp_path):
    path = tmp_path / f"roof.{suffix}"
    path.write_bytes(b"a roof")
    with pytest.raises(SurfaceError, match=rf"{suffix.upper()} files have no names of parts; leave out --only"):
        raw_mesh(path, only=["Roof"])


def test_a_file_without_any_name_says_so(tmp_path):
    path = tmp_path / "roof.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(
        SurfaceError, match="no visible part has the name 'Roof'; the parts have no names: leave out --only"
    ):
        raw_mesh(path, only=["Roof"])


def test_unnamed_parts_of_an_assembly_lend_no_name_of_a_library(tmp_path):
    path = step_file(tmp_path / "roof.step", names=("", ""))
    assert "=>" not in names_offered(path, "Rof")


def test_marks_are_read_beside_the_selected_layer(tmp_path):
    import ezdxf

    document = ezdxf.readfile(dxf_file(tmp_path / "plain.dxf"))
    document.modelspace().add_line((0, 0), (0, 2), dxfattribs={"layer": "support"})
    document.saveas(path := tmp_path / "site.dxf")
    record = raw_mesh(path, only=["Roof"]).record
    assert (record.surface_words, record.mark_words) == ("1 mesh", "1 curve on layer 'support'")
    assert [*marks_on_layers(path, ("support",), 1.0)] == ["support"]


def test_the_commands_take_names_and_the_preset_keeps_them(capsys, tmp_path):
    path, preset = dxf_file(tmp_path / "site.dxf"), tmp_path / "roof.toml"
    code, out, _ = run(capsys, "inspect", str(path), "--only", "roof")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert code == 0
    assert "dropped 1 unselected part of 'Walls'" in lines
    assert f"mesh {ROOF.n} vertices, {ROOF.m} triangles" in out.replace("         ", " ")
    assert run(capsys, "new", str(path), "--only", "roof", "--stand", "ends", "-o", str(preset))[0] == 0
    assert 'only = ["roof"]' in preset.read_text()
    surface = load_preset(preset).surface
    assert surface.only == ("roof",)
    assert surface.base_surface().area == pytest.approx(ROOF.area)
    for command in (("inspect", str(path)), ("new", str(path)), ("build", str(path)), ("build", str(preset))):
        assert "no visible part has the name 'Rof'; the names are Roof, " in refused(capsys, *command, "--only", "Rof")
    both = load_preset(preset, {"surface.only": ["Roof", "Walls"]}).surface
    assert both.base_surface().area == pytest.approx(ROOF.area + WALLS.area)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["roof.3dm", "roof.step", "roof.ifc"])
def test_names_reach_the_separate_process(name, tmp_path, monkeypatch):
    monkeypatch.undo()
    path = FILES[name](tmp_path / name)
    assert read_surface(path, only=["Roof"]).area == pytest.approx(ROOF.area)
    assert "Roof" in names_offered(path, "-Rooof")
