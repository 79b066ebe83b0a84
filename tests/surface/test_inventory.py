"""The inventory of a file: each thing in it is taken, beside the surface or dropped, as other programs count it."""

import io
import json
import re
import struct
import zipfile

import ezdxf
import numpy as np
import pygltflib
import pytest
import trimesh
from ezdxf.units import InsertUnits
from numpy.testing import assert_allclose

from dsfab.app.hops.components import COMPONENTS
from dsfab.app.hops.protocol import HopsError, read_request
from dsfab.core.errors import SurfaceError
from dsfab.core.units import METRES_PER
from dsfab.surface import describe, read_surface
from dsfab.surface.files.drawings import closed_curves, marks_on_layers, read_dxf
from dsfab.surface.files.mesh_files import raw_mesh
from dsfab.surface.files.reading import DrawingBudget, mark
from dsfab.surface.files.rhino_and_step import read_rhino
from dsfab.surface.shapes import plate
from tests.bad_meshes import threemf
from tests.surface.named_files import read_in_this_process

rhino3dm = pytest.importorskip("rhino3dm")
ROOF = plate(length=3.0, width=2.0, edge=1.0)
AREA, N, M = ROOF.area, ROOF.n, ROOF.m
MIRROR = np.diag([-1.0, 1.0, 1.0])
FAR = np.array([466000.1, 5247000.1, 560.1])
"""Survey coordinates: single precision has steps of half a metre here."""


@pytest.fixture(autouse=True)
def within(monkeypatch):
    read_in_this_process(monkeypatch)


def content(path):
    """Counts by kind and fate."""
    counts = {}
    for thing in raw_mesh(path).record.content:
        counts[thing.kind, thing.fate] = counts.get((thing.kind, thing.fate), 0) + thing.count
    return counts


def dropped(path):
    return "; ".join(raw_mesh(path).record.dropped)


def written(path, data):
    path.write_bytes(data) if isinstance(data, bytes) else path.write_text(data)
    return path


# ---- 3DM ----


def rhino_mesh(V=ROOF.V, faces=ROOF.F):
    mesh = rhino3dm.Mesh()
    for point in V.tolist():
        mesh.Vertices.AddPoint3d(*point)
    for face in faces.tolist():
        mesh.Faces.AddFace(*face)
    return mesh


def layer(model, name, visible=True, above=None):
    entry = rhino3dm.Layer()
    entry.Name, entry.Visible = name, visible
    if above is not None:
        entry.ParentLayerId = model.Layers[above].Id
    about = rhino3dm.ObjectAttributes()
    about.LayerIndex = model.Layers.Add(entry)
    return about


def rhino_model(unit="Meters"):
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
    return model


def saved(model, path):
    assert model.Write(str(path), 7)
    return path


def with_block(model, matrix):
    """Insert a block that holds the roof; matrix : (3, 3)."""
    model.InstanceDefinitions.Add("roof", "", "", "", rhino3dm.Point3d(0, 0, 0), (rhino_mesh(),), (layer(model, "in"),))
    place = rhino3dm.Transform(1.0)
    for i in range(3):
        for j in range(3):
            setattr(place, f"M{i}{j}", float(matrix[i, j]))
    model.Objects.AddInstanceObject(rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, place))
    return model


def test_every_object_of_a_3dm_file_is_accounted_for(tmp_path):
    model = rhino_model()
    shown, off = layer(model, "roof"), layer(model, "old")
    model.Layers[off.LayerIndex].Visible = False
    inner, invisible = layer(model, "inner", True, off.LayerIndex), layer(model, "roof 2")
    invisible.Visible = False
    within_roof = layer(model, "within the roof", True, shown.LayerIndex)
    for about in (shown, within_roof, off, inner, invisible):
        model.Objects.AddMesh(rhino_mesh(), about)
    for name in ("Auflager", "support", "sketch"):
        line = rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
        model.Objects.AddCurve(line, layer(model, name))
        model.Objects.AddPoint(rhino3dm.Point3d(0, 0, 0), layer(model, name + " 2"))
    with_block(model, MIRROR)
    path = saved(model, tmp_path / "roof.3dm")
    record = raw_mesh(path).record
    assert sum(thing.count for thing in record.content) == len(rhino3dm.File3dm.Read(str(path)).Objects)
    assert record.surface_words == "3 meshes, 1 mirrored block insertion"
    for words in ("'old'", "'inner'", "'roof 2'"):
        assert f"1 hidden object on layer {words}" in record.dropped
    assert "1 curve on layer 'Auflager'; did you mean layer support?" in record.dropped
    assert "1 point on layer 'support 2'; did you mean layer support?" in record.dropped
    assert "1 point on layer 'Auflager 2'; did you mean layer support?" in record.dropped
    assert record.other_words == "1 curve, 1 point"
    assert record.mark_words == "1 curve on layer 'support'"
    assert describe(path).area == pytest.approx(3 * AREA)


def test_a_hidden_3dm_layer_marks_no_support_unless_it_is_named(tmp_path):
    model = rhino_model()
    circle = rhino3dm.Circle(rhino3dm.Point3d(0, 0, 0), 1.0).ToNurbsCurve()
    model.Objects.AddCurve(circle, layer(model, "support", visible=False))
    drawing = read_rhino(saved(model, tmp_path / "marks.3dm"), DrawingBudget())
    assert [(name, hidden) for name, _, hidden in drawing.runs] == [("support", True)]


def line_on(model, about):
    model.Objects.AddCurve(rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0)), about)


def test_a_hidden_3dm_layer_hides_no_support_on_a_layer_of_the_same_name(tmp_path):
    model = rhino_model()
    line_on(model, layer(model, "support", above=layer(model, "A").LayerIndex))
    line_on(model, layer(model, "support", above=layer(model, "B", visible=False).LayerIndex))
    path = saved(model, tmp_path / "marks.3dm")
    assert len(marks_on_layers(path, ("support",), 1.0)["support"].curves) == 1


def test_lines_in_a_hidden_block_are_no_supports(tmp_path):
    document, path = dxf(tmp_path / "marks.dxf", "support", "frozen")
    document.layers.get("frozen").freeze()
    document.blocks.new("edge").add_line((0, 0), (1, 0), dxfattribs={"layer": "support"})
    document.modelspace().add_blockref("edge", (0, 0), dxfattribs={"layer": "frozen"})
    document.saveas(path)
    model, line = rhino_model(), rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(1, 0, 0))
    model.InstanceDefinitions.Add("edge", "", "", "", rhino3dm.Point3d(0, 0, 0), (line,), (layer(model, "support"),))
    insertion = rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, rhino3dm.Transform(1.0))
    model.Objects.Add(insertion, layer(model, "off", visible=False))
    for file in (path, saved(model, tmp_path / "marks.3dm")):
        assert marks_on_layers(file, ("support",), 1.0) == {}
        with pytest.raises(SurfaceError, match="visible layers, has no curve"):
            closed_curves(file, None, "m")


def test_objects_on_many_hidden_layers_are_one_line(tmp_path):
    model = rhino_model()
    model.Objects.AddMesh(rhino_mesh())
    for k in range(6):
        model.Objects.AddMesh(rhino_mesh(), layer(model, f"off {k}", visible=False))
    assert dropped(saved(model, tmp_path / "roof.3dm")) == "6 hidden objects on 6 layers, first 'off 0'"


def test_a_file_of_hidden_meshes_only_says_so(tmp_path):
    model = rhino_model()
    model.Objects.AddMesh(rhino_mesh(), layer(model, "off", visible=False))
    with pytest.raises(SurfaceError, match="no mesh; ignored: 1 hidden object on layer 'off'"):
        raw_mesh(saved(model, tmp_path / "roof.3dm"))


# ---- DXF ----


def dxf(path, *layers, unit=6):
    document = ezdxf.new(units=unit)
    for name in layers:
        document.layers.add(name)
    return document, path


def add_roof(space, layer="0", **attributes):
    with space.add_mesh(dxfattribs={"layer": layer, **attributes}).edit_data() as data:
        data.vertices, data.faces = ROOF.V.tolist(), ROOF.F.tolist()


def test_every_entity_of_a_dxf_file_is_accounted_for(tmp_path):
    document, path = dxf(tmp_path / "roof.dxf", "off", "frozen", "shown", "supports", "load")
    document.layers.get("off").off()
    document.layers.get("frozen").freeze()
    space, block = document.modelspace(), document.blocks.new("roof")
    for name in ("shown", "off", "frozen"):
        add_roof(space, name)
    add_roof(space, "shown", invisible=1)
    add_roof(block)
    space.add_blockref("roof", (9, 0), dxfattribs={"layer": "shown", "xscale": -1})
    space.add_blockref("roof", (9, 0), dxfattribs={"layer": "off"})  # layer 0 in a block is the layer of the insertion
    space.add_blockref("roof", (9, 0), dxfattribs={"layer": "frozen"})
    space.add_line((0, 0), (1, 0), dxfattribs={"layer": "supports"})
    space.add_point((0, 0), dxfattribs={"layer": "load"})
    space.add_text("a roof")
    space.add_3dface([(0, 0, 9), (1, 0, 9), (1, 1, 9)])
    space.add_solid([(0, 0), (1, 0), (1, 1)])
    document.layout("Layout1").add_text("a title")
    document.saveas(path)
    record = raw_mesh(path).record
    count = sum(len(page) for page in document.layouts) + 2  # and the content of two insertions that are no hidden ones
    assert sum(thing.count for thing in record.content) == count
    assert content(path)["mesh", "taken"] == 2
    assert record.read == (f"DXF: {2 * N + 3} vertices, {2 * M + 1} triangles",)
    assert content(path)["hidden object", "dropped"] == 5
    assert "3 hidden objects on layer 'off'" not in record.dropped
    assert "2 hidden objects on layer 'off'" in record.dropped
    assert "1 curve on layer 'supports'; did you mean layer support?" in record.dropped
    assert "1 SOLID object" in record.dropped
    assert record.other_words == "1 TEXT object, 1 object in paper space"
    assert record.mark_words == "1 point on layer 'load'"
    assert describe(path).area == pytest.approx(2 * AREA + 0.5)


def test_an_external_reference_is_named(tmp_path):
    document, path = dxf(tmp_path / "roof.dxf")
    add_roof(document.modelspace())
    document.add_xref_def("other.dxf", "other")
    document.modelspace().add_blockref("other", (0, 0))
    document.saveas(path)
    assert dropped(path) == "1 external reference 'other', whose content is elsewhere"


def test_a_drawing_with_an_external_reference_only_names_it(tmp_path):
    document, path = dxf(tmp_path / "roof.dxf")
    document.add_xref_def("other.dxf", "other")
    document.modelspace().add_blockref("other", (0, 0))
    document.saveas(path)
    with pytest.raises(SurfaceError, match="polyface; ignored: 1 external reference 'other', whose content is else"):
        raw_mesh(path)


def test_marks_on_a_hidden_dxf_layer_are_ignored_but_a_named_layer_is_read(tmp_path):
    document, path = dxf(tmp_path / "roof.dxf", "support", "void")
    document.layers.get("support").off()
    for name in ("support", "void"):
        document.modelspace().add_circle((0, 0), 1, dxfattribs={"layer": name})
    document.saveas(path)
    assert [*marks_on_layers(path, ("support", "void"), 1.0)] == ["void"]
    assert len(closed_curves(path, None, None)) == 1
    assert len(closed_curves(path, "support", None)) == 1
    hidden = {layer: hidden for layer, _, hidden in read_dxf(path, DrawingBudget()).runs}
    assert hidden == {"support": True, "void": False}


# ---- glTF ----


def glb(path, nodes, used=(), roof=ROOF, roots=None, **more):
    """A file by pygltflib of nodes with the roof, whose y axis is up; `more` are tables of numbers (count, width)."""
    scenes = [pygltflib.Scene(nodes=[*range(len(nodes))][:roots])]
    file = pygltflib.GLTF2(scene=0, scenes=scenes, extensionsUsed=[*used])
    V = roof.V @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    tables = {"V": V.astype("<f4"), "F": roof.F.reshape(-1, 1).astype("<u4")}
    tables |= {name: np.array(rows, dtype="<f4") for name, rows in more.items()}
    data = b""
    for k, rows in enumerate(tables.values()):
        file.bufferViews.append(pygltflib.BufferView(buffer=0, byteOffset=len(data), byteLength=rows.nbytes))
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[rows.shape[1]]
        number = pygltflib.UNSIGNED_INT if rows.dtype.kind == "u" else pygltflib.FLOAT
        file.accessors.append(pygltflib.Accessor(bufferView=k, componentType=number, count=len(rows), type=kind))
        data += rows.tobytes()
    file.buffers = [pygltflib.Buffer(byteLength=len(data))]
    file.meshes = [
        pygltflib.Mesh(primitives=[pygltflib.Primitive(attributes=pygltflib.Attributes(POSITION=0), indices=1)])
    ]
    file.nodes = [pygltflib.Node(mesh=0, **node) for node in nodes]
    file.set_binary_blob(data)
    file.save_binary(str(path))
    return path


def test_instances_of_a_gltf_mesh_are_drawn_turned_and_scaled(tmp_path):
    s = float(np.sqrt(0.5))
    more = {"TRANSLATION": [[0, 0, 0], [0, 5, 0], [0, 10, 0]], "ROTATION": [[0, 0, 0, 1], [0, s, 0, s], [0, 0, 0, 1]]}
    more["SCALE"] = [[1, 1, 1], [1, 1, 1], [2, 2, 2]]
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "ROTATION": 3, "SCALE": 4}}}
    path = glb(tmp_path / "roofs.glb", [{"extensions": extension}], extension, **more)
    assert content(path) == {("mesh", "taken"): 1, ("instance", "taken"): 3}
    assert len(pygltflib.GLTF2().load(str(path)).meshes) == 1
    facts = describe(path)
    assert facts.area == pytest.approx(AREA * (1 + 1 + 4))
    assert facts.box[2] == pytest.approx(10)
    turned = read_surface(path).V
    assert_allclose(np.ptp(turned[np.abs(turned[:, 2] - 5) < 0.1], axis=0)[:2], [2, 3], atol=1e-6)


def test_hidden_and_unused_gltf_meshes_are_named(tmp_path):
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}, "children": [1]}
    path = glb(tmp_path / "roof.glb", [hidden, {}, {}], ["KHR_node_visibility"])
    file = pygltflib.GLTF2().load(str(path))
    file.scenes[0].nodes = [0, 2]
    file.meshes.append(file.meshes[0])
    file.save(str(path))
    assert content(path) == {
        ("hidden object", "dropped"): 2,
        ("mesh", "taken"): 1,
        ("mesh", "dropped"): len(file.meshes) - 1,
    }
    assert read_surface(path).area == pytest.approx(AREA)


def test_a_gltf_file_without_a_scene_is_read_whole(tmp_path):
    path = glb(tmp_path / "roof.glb", [{"children": [1]}, {"translation": [0, 5, 0]}])
    file = pygltflib.GLTF2().load(str(path))
    file.scene, file.scenes = None, []
    file.save(str(path))
    assert read_surface(path).area == pytest.approx(2 * AREA)
    assert raw_mesh(path).record.remarks == ("read: the file names no scene, so dsfab reads all objects",)


@pytest.mark.parametrize("version", ["1.0", None])
def test_gltf_1_is_named(version, tmp_path):
    tree = {"meshes": {"roof": {}}, "scenes": {}} | ({"asset": {"version": version}} if version else {})
    with pytest.raises(SurfaceError, match=r"the file has version 1\.0 of glTF, but dsfab reads version 2"):
        raw_mesh(written(tmp_path / "old.gltf", json.dumps(tree)))
    data = b"glTF" + struct.pack("<4I", 1, 28, 8, 0) + b"{}      "
    with pytest.raises(SurfaceError, match="the file has version 1"):
        raw_mesh(written(tmp_path / "old.glb", data))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("KHR_technique_webgl", ""),
        ("KHR_draco_mesh_compression", "KHR_draco_mesh_compression: export the file without compression"),
        ("ADESK_bend", "the file needs the extension ADESK_bend: export the file without this extension"),
    ],
)
def test_a_required_extension_is_read_or_the_remedy_fits(name, words, tmp_path):
    path = glb(tmp_path / "roof.glb", [{}], [name])
    file = pygltflib.GLTF2().load(str(path))
    file.extensionsRequired = [name]
    file.save(str(path))
    if words:
        with pytest.raises(SurfaceError, match=words):
            raw_mesh(path)
    else:
        assert read_surface(path).area == pytest.approx(AREA)


# ---- 3MF ----

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
SPACES = f'xmlns="{CORE}" xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"'


def mesh_text(V=ROOF.V, extra="", F=ROOF.F):
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in np.asarray(V).tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in F)
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles>{extra}</mesh>"


def model(objects, items, attributes='unit="meter"'):
    resources = "".join(f'<object id="{k}" {about}>{text}</object>' for k, (about, text) in enumerate(objects, 1))
    return f"<model {attributes} {SPACES}><resources>{resources}</resources><build>{items}</build></model>"


def archive(path, text, **more):
    data = io.BytesIO(threemf(text))
    with zipfile.ZipFile(data, "a") as packed:
        for name, content_text in more.items():
            packed.writestr(f"Metadata/{name}.config", content_text)
    return written(path, data.getvalue())


def test_every_object_of_a_3mf_file_is_accounted_for(tmp_path):
    """Meshes at their places, beams and aids of the print, as lib3mf counts them."""
    lib3mf = pytest.importorskip("lib3mf")
    beams = '<b:beamlattice radius="0.1" minlength="0.01"><b:beams><b:beam v1="0" v2="1"/></b:beams></b:beamlattice>'
    objects = [("", mesh_text()), ('type="support"', mesh_text()), ('type="other"', mesh_text())]
    objects += [("", mesh_text(extra=beams)), ("", '<components><component objectid="1"/></components>'), ("", "")]
    objects[5] = ("", mesh_text())
    items = "".join(f'<item objectid="{k}"/>' for k in (1, 2, 3, 4, 5))
    path = archive(tmp_path / "plate.3mf", model(objects, items))
    record = raw_mesh(path).record
    theirs = lib3mf.get_wrapper().CreateModel()
    theirs.QueryReader("3mf").ReadFromFile(str(path))
    counts = content(path)
    assert counts["mesh", "taken"] == 2 + theirs.GetComponentsObjects().Count()  # the component draws the first again
    assert counts["mesh", "taken"] - 1 + counts["object", "dropped"] == theirs.GetMeshObjects().Count()
    assert record.surface_words == "3 meshes"
    assert counts["beam", "dropped"] == 1
    assert "1 object of the type 'support'" in record.dropped
    assert "1 object of the type 'other'" in record.dropped
    assert "1 object without a place on the build plate" in record.dropped
    assert describe(path).area == pytest.approx(3 * AREA)


def test_a_3mf_file_may_require_the_extension_for_materials(tmp_path):
    space = 'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" requiredextensions="m"'
    text = model([("", mesh_text())], '<item objectid="1"/>', f'unit="meter" {space}')
    assert read_surface(archive(tmp_path / "roof.3mf", text)).area == pytest.approx(AREA)


def test_the_root_model_of_a_3mf_file_may_have_any_suffix(tmp_path):
    """The relationship names the part, and decides between two models [Open Packaging Conventions]."""
    kind, path = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel", tmp_path / "roof.3mf"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr(
            "_rels/.rels", f"<Relationships><Relationship Type='{kind}' Target='/3D/roof.xyz'/></Relationships>"
        )
        packed.writestr("3D/other.model", model([("", mesh_text(5 * ROOF.V))], '<item objectid="1"/>'))
        packed.writestr("3D/roof.xyz", model([("", mesh_text())], '<item objectid="1"/>'))
    assert read_surface(path).area == pytest.approx(AREA)


@pytest.mark.parametrize(
    "setting",
    [
        '<metadatagroup><metadata name="cura:{}" type="xs:boolean">{}</metadata></metadatagroup>',
        '<settings xmlns="http://cura.example/2015"><setting key="{}">{}</setting></settings>',
    ],
)
@pytest.mark.parametrize("aid", ["support_mesh", "anti_overhang_mesh", "infill_mesh", "cutting_mesh"])
def test_an_object_that_cura_marks_as_a_printing_aid_is_no_surface(tmp_path, setting, aid):
    """Cura 5 writes such settings as metadata, Cura 2 as settings; a setting that is off changes nothing."""
    other = setting.format("infill_sparse_density", "True") + setting.format(aid, "False")
    objects = [("", mesh_text() + other), ("", mesh_text(ROOF.V + 9.0) + setting.format(aid, "True"))]
    path = archive(tmp_path / "cura.3mf", model(objects, '<item objectid="1"/><item objectid="2"/>'))
    assert f"1 object of the type '{aid}'" in dropped(path)
    assert describe(path).area == pytest.approx(AREA)


def test_settings_of_an_item_are_those_of_its_object(tmp_path):
    aid = '<metadatagroup><metadata name="cura:support_mesh">\n 1\n</metadata></metadatagroup>'
    objects = [("", mesh_text(ROOF.V + 9.0)), ("", mesh_text())]
    path = archive(tmp_path / "cura.3mf", model(objects, f'<item objectid="1">{aid}</item><item objectid="2"/>'))
    assert "1 object of the type 'support_mesh'" in dropped(path)
    assert describe(path).area == pytest.approx(AREA)
    assert read_surface(path).V.min() == pytest.approx(ROOF.V.min())


def test_modifiers_of_slicers_are_ignored_and_named(tmp_path):
    two = mesh_text(np.concatenate([ROOF.V, ROOF.V + 9.0])).replace(
        "</triangles>", "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in ROOF.F + N) + "</triangles>"
    )
    volume = '<volume firstid="{}" lastid="{}"><metadata type="volume" key="volume_type" value="{}"/></volume>'
    volumes = volume.format(0, M - 1, "ModelPart") + volume.format(M, 2 * M - 1, "ParameterModifier")
    prusa = archive(
        tmp_path / "prusa.3mf",
        model([("", two)], '<item objectid="1"/>'),
        Slic3r_PE_model=f'<config><object id="1">{volumes}</object></config>',
    )
    parts = "".join(f'<component objectid="{k}"/>' for k in (1, 2))
    objects = [("", mesh_text()), ("", mesh_text(ROOF.V + 9.0)), ("", f"<components>{parts}</components>")]
    kinds = '<part id="1" subtype="normal_part"/><part id="2" subtype="modifier_part"/>'
    bambu = archive(
        tmp_path / "bambu.3mf",
        model(objects, '<item objectid="3"/><item objectid="3" printable="0"/>'),
        model_settings=f'<config><object id="3">{kinds}</object></config>',
    )
    for path in (prusa, bambu):
        assert "1 printing aid that only the slicer uses" in dropped(path)
        assert describe(path).area == pytest.approx(AREA)
    assert "1 item marked as not printable" in dropped(bambu)
    broken = archive(
        tmp_path / "odd.3mf", model([("", mesh_text())], '<item objectid="1"/>'), model_settings="<config>"
    )
    assert read_surface(broken).m == M


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            model([("", mesh_text())], '<item objectid="7"/>'),
            "the file places the object '7', but does not contain this object",
        ),
        (model([("", mesh_text())], '<item objectid="1"/>')[:-20], "the file's XML is broken or cut off in line 1"),
        (model([("", mesh_text().replace('x="', 'u="', 1))], ""), "a number or an object is missing or invalid"),
        (model([("", mesh_text())], '<item objectid="1" transform="1 0 0"/>'), "a number or an object is missing"),
        (model([("", mesh_text())], "", 'requiredextensions="s"'), "the file needs the extension s, which dsfab"),
        (
            model([("", mesh_text(extra=""))], '<item objectid="1"/>', 'unit="parsec"'),
            "is in parsec, a unit that dsfab",
        ),
    ],
)
def test_a_damaged_3mf_file_is_refused_in_words(text, words, tmp_path):
    with pytest.raises(SurfaceError, match=r"bad\.3mf") as refusal:
        raw_mesh(archive(tmp_path / "bad.3mf", text))
    assert words in str(refusal.value)


# ---- formats without parts ----


def test_faces_of_plain_formats_are_counted_as_trimesh_counts_them(tmp_path):
    scene = trimesh.Scene([trimesh.Trimesh(ROOF.V + k, ROOF.F) for k in range(2)])
    whole = trimesh.util.concatenate([*scene.geometry.values()])
    for suffix in ("obj", "ply", "off", "stl", "stl_ascii"):
        path = tmp_path / f"{suffix}.{suffix[:3]}"
        (scene if suffix == "obj" else whole).export(path, file_type=suffix)
        assert content(path)["face", "taken"] == len(whole.faces)
    assert content(tmp_path / "obj.obj")["group", "taken"] == len(scene.geometry)
    assert raw_mesh(tmp_path / "stl_ascii.stl").record.surface_words == ""
    twice = 2 * (tmp_path / "stl_ascii.stl").read_text()
    assert content(written(tmp_path / "two.stl", twice))["part", "taken"] == 2
    text = (tmp_path / "obj.obj").read_text() + "l 1 2\nl 2 3\np 1\nf 1 2\n"
    counts = content(written(tmp_path / "more.obj", text))
    assert (counts["line", "dropped"], counts["point", "dropped"], counts["face", "dropped"]) == (2, 1, 1)


def test_the_name_of_an_stl_solid_may_have_the_word_facet(tmp_path):
    loop = "outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet"
    for start in ("solid vault with facet pattern\nfacet normal 0 0 1", "solid a facet normal 0 0 1", "solid facet"):
        path = written(tmp_path / "vault.stl", f"{start} {loop}\nendsolid vault with facet pattern\n")
        assert read_surface(path).area == pytest.approx(0.5)


@pytest.mark.parametrize("count", [0, 1])
def test_only_ply_elements_with_records_are_dropped(count, tmp_path):
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{axes}element face 1\nproperty list uchar int vertex_indices\n"
    head += f"element edge {count}\nproperty int vertex1\nend_header\n"
    path = written(tmp_path / "roof.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n" + count * "0\n")
    assert dropped(path) == count * "1 record of the element 'edge'"


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_the_first_word_of_a_ply_file_may_be_upper_case(mark, tmp_path):
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"PLY\nformat ascii 1.0\nelement vertex 3\n{axes}element face 1\nproperty list uchar int vertex_indices\n"
    path = written(tmp_path / "roof.ply", f"{mark}{head}end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode())
    assert read_surface(path).area == pytest.approx(0.5)


def test_only_obj_groups_with_faces_are_counted(tmp_path):
    text = "g line\nv 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\no roof\ng tiles\nf 1 2 3\ng\ng tiles\nf 2 1 3\n  g g\nf 3 1 2\n"
    assert content(written(tmp_path / "roof.obj", text))["group", "taken"] == 2


@pytest.mark.slow
def test_faces_and_curves_of_step_files_are_counted_as_build123d_counts_them(tmp_path):
    build123d = pytest.importorskip("build123d")
    sheet = build123d.Face.make_rect(3, 2)
    box = build123d.Box(1, 1, 1).move(build123d.Location((0, 0, 5)))
    line = build123d.Edge.make_line((0, 0, 0), (1, 0, 0))
    whole = build123d.Compound(children=[sheet, box.solid(), line])
    for suffix, write in ((".step", build123d.export_step), (".brep", build123d.export_brep)):
        path = tmp_path / f"roof{suffix}"
        write(whole, str(path))
        counts = content(path)
        assert counts["face", "taken"] == len(whole.faces()) == 7
        assert counts["solid", "taken"] == len(whole.solids()) == 1
        assert counts["curve", "beside"] == 1
        assert raw_mesh(path).record.other_words == "1 curve"


def assembly_with_other_files(path, shape):
    """STEP file of a shape, of parts in two files, one of them twice, and of a document [AP 214]."""
    pytest.importorskip("build123d").export_step(shape, str(path))
    lines = [
        f"#{number}=APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('{name}',#{number + 1},#{number + 2},(#{number + 3}));\n"
        f"#{number + 1}=IDENTIFICATION_ROLE('external document id and location',$);\n"
        f"#{number + 2}=EXTERNAL_SOURCE(IDENTIFIER('{name}'));\n"
        f"#{number + 3}=DOCUMENT_FILE('{name}','','',#{number + 4},'',$);\n#{number + 4}=DOCUMENT_TYPE('geometry');\n"
        for number, name in ((90000, "wall.stp"), (90010, "wall.stp"), (90020, "arch.stp"), (90030, "plan.pdf"))
    ]
    text = path.read_text()
    end = text.rindex("ENDSEC;")
    return written(path, text[:end] + "".join(lines) + text[end:])


def test_parts_of_a_step_assembly_in_other_files_are_named(tmp_path):
    build123d = pytest.importorskip("build123d")
    path = assembly_with_other_files(tmp_path / "roof.step", build123d.Face.make_rect(3, 2))
    assert content(path)["part", "dropped"] == 2
    assert dropped(path) == "2 parts in other files: wall.stp, arch.stp"
    path = assembly_with_other_files(tmp_path / "empty.step", build123d.Edge.make_line((0, 0, 0), (1, 0, 0)))
    words = "the file has no faces; ignored: 2 parts in other files: wall.stp, arch.stp; export the assembly as one"
    with pytest.raises(SurfaceError, match=words):
        raw_mesh(path)


# ---- doubles, units, mirrors ----


def test_a_place_in_survey_coordinates_keeps_the_digits_of_the_file(tmp_path):
    moved = f'<item objectid="1" transform="1 0 0 0 1 0 0 0 1 {" ".join(map(repr, FAR.tolist()))}"/>'
    archive(tmp_path / "moved.3mf", model([("", mesh_text(ROOF.V / 3))], moved))
    read, V = raw_mesh(tmp_path / "moved.3mf").V, ROOF.V / 3 + FAR
    assert_allclose(read[np.lexsort(read.T)], V[np.lexsort(V.T)], rtol=0, atol=1e-9)


def with_mesh(mesh, unit="Meters"):
    model = rhino_model(unit)
    model.Objects.AddMesh(mesh)
    return model


def check_unit(path, unit_word, metres):
    """The file is read in its unit; without `metres` the refusal names the unit, and --unit helps."""
    if metres is not None:
        assert describe(path).box[0] == pytest.approx(3.0 * metres)
        return
    with pytest.raises(SurfaceError, match=re.escape(f"{path} is in {unit_word}")) as refusal:
        describe(path)
    assert "--unit" in str(refusal.value)
    assert describe(path, unit="ft").box[0] == pytest.approx(3.0 * 0.3048)


METRES = {"Millimeters": 1e-3, "Centimeters": 1e-2, "Decimeters": 0.1, "Meters": 1.0, "Kilometers": 1000.0}
METRES |= {"Inches": 0.0254, "Feet": 0.3048, "Yards": 0.9144, "Microns": 1e-6, "USSurveyFeet": 1200 / 3937}


@pytest.mark.parametrize("code", [*InsertUnits, 99])
def test_each_unit_of_dxf_is_read_or_refused(code, tmp_path):
    document, path = dxf(tmp_path / "roof.dxf")
    document.header["$INSUNITS"] = int(code)
    add_roof(document.modelspace())
    document.saveas(path)
    name = "" if code == 99 else code.name
    expected = 1.0 if name == "Unitless" else METRES.get(name)
    check_unit(path, name.lower() or "$INSUNITS 99", expected)


@pytest.mark.parametrize("name", [*rhino3dm.UnitSystem.__members__])
def test_each_unit_of_3dm_is_read_or_refused(name, tmp_path):
    path = saved(with_mesh(rhino_mesh(), name), tmp_path / "roof.3dm")
    expected = 1.0 if name in ("None", "Unset") else METRES.get(name)
    check_unit(path, name.lower(), expected)


@pytest.mark.parametrize(("word", "metres"), [("yards", 0.9144), ("US survey feet", 1200 / 3937), ("microns", 1e-6)])
def test_units_in_comments_and_from_grasshopper(word, metres, tmp_path):
    text = f"# File units = {word}\nv 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n"
    check_unit(written(tmp_path / "roof.obj", text), word, metres)
    values = [{"ParamName": "mesh", "InnerTree": {"0": [{"type": "", "data": json.dumps(rhino_mesh().Encode())}]}}]
    request = read_request(COMPONENTS["preview"], {"values": values, "modelunits": word.title()})
    assert METRES_PER[request.unit] == pytest.approx(metres)
    with pytest.raises(HopsError, match="the unit of the model is furlongs; set the model to one of these units: mm"):
        read_request(COMPONENTS["preview"], {"values": values, "modelunits": "Furlongs"})


@pytest.mark.parametrize("word", ["miles", "Furlongs"])
def test_an_unknown_unit_of_an_obj_file_is_refused(word, tmp_path):
    text = f"# File units = {word}\nv 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n"
    check_unit(written(tmp_path / "roof.obj", text), word.lower(), None)


@pytest.mark.parametrize("comment", ["# units: see the drawing", "# file units: as drawn", "# File units = unset"])
def test_other_words_about_units_are_no_unit(comment, tmp_path):
    text = f"{comment}\nv 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n"
    assert raw_mesh(written(tmp_path / "roof.obj", text)).unit is None


@pytest.mark.parametrize(
    ("layer_name", "hint"),
    [("Support line", "support"), ("roof voids", "void"), ("A-LAST-01", "load"), ("upload", ""), ("sketch", "")],
)
def test_a_word_in_the_name_of_a_layer_is_enough_for_a_hint(layer_name, hint):
    about = mark("curve", layer_name).about
    assert about == (f"on layer {layer_name!r}; did you mean layer {hint}?" if hint else "")


def mirrored_files(folder):
    """The roof, mirrored, in four formats; in 3MF also by a component in a mirrored item, twice, thus not at all."""
    yield saved(with_block(rhino_model(), MIRROR), folder / "roof.3dm")
    document, path = dxf(folder / "roof.dxf")
    add_roof(document.blocks.new("roof"))
    document.modelspace().add_blockref("roof", (0, 0), dxfattribs={"yscale": -1})
    document.saveas(path)
    yield path
    yield glb(folder / "roof.glb", [{"scale": [-1, 1, 1]}])
    mirror = 'transform="-1 0 0 0 1 0 0 0 1 0 0 0"'
    parts = f'<components><component objectid="1" {mirror}/></components>'
    objects = [("", mesh_text()), ("", parts)]
    yield archive(folder / "one.3mf", model(objects, f'<item objectid="1" {mirror}/>'))
    yield archive(folder / "part.3mf", model(objects, '<item objectid="2"/>'))
    yield archive(folder / "twice.3mf", model(objects, f'<item objectid="2" {mirror}/>'))


def test_a_mirrored_roof_still_looks_up(tmp_path):
    assert (ROOF.normals[:, 2] > 0).all()
    for path in mirrored_files(tmp_path):
        raw = raw_mesh(path)
        a, b, c = (raw.V[raw.F[:, k]] for k in range(3))
        assert (np.cross(b - a, c - a)[:, 2] > 0).all(), path


@pytest.mark.parametrize("inner", [1, -1])
@pytest.mark.parametrize("outer", [1, -1])
def test_a_roof_in_nested_dxf_blocks_looks_up(inner, outer, tmp_path):
    document, path = dxf(tmp_path / "roof.dxf")
    add_roof(document.blocks.new("roof"))
    document.blocks.new("house").add_blockref("roof", (0, 0), dxfattribs={"xscale": inner})
    document.modelspace().add_blockref("house", (0, 0), dxfattribs={"yscale": outer})
    document.saveas(path)
    assert (read_surface(path).normals[:, 2] > 0).all()
    assert content(path).get(("mirrored block insertion", "taken"), 0) == [inner, outer].count(-1)
