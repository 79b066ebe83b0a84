"""Surfaces out of CAD programs: 3DM by rhino3dm, STEP and BREP by OCCT, DXF by ezdxf, glTF by trimesh; wrong ones."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dsfab.app.cli import main
from dsfab.core.errors import SurfaceError
from dsfab.preset.proposal import propose
from dsfab.surface import describe, read_surface
from dsfab.surface.files import drawings, separate_process
from dsfab.surface.files.mesh_files import raw_mesh
from dsfab.surface.files.reading import DrawingBudget
from dsfab.surface.files.rhino_and_step import read_rhino
from tests.shapes import grid
from tests.surface.named_files import read_in_this_process, step_file

build123d = pytest.importorskip("build123d")
rhino3dm = pytest.importorskip("rhino3dm")
APART = pytest.mark.slow
"""Each file that is read in a process of its own takes a second."""


@pytest.fixture
def within(monkeypatch):
    read_in_this_process(monkeypatch)
    monkeypatch.setattr(drawings, "read_rhino_in_process", read_rhino)


def rhino_mesh(V, faces):
    """With triangles and quads."""
    mesh = rhino3dm.Mesh()
    for point in np.asarray(V, dtype=float).tolist():
        mesh.Vertices.Add(*point)
    for face in faces:
        mesh.Faces.AddFace(*face)
    return mesh


def on_layer(model, name):
    """Attributes of what lies on a layer, which is made if it is not there."""
    known = {layer.Name: layer.Index for layer in model.Layers}
    attributes = rhino3dm.ObjectAttributes()
    attributes.LayerIndex = known[name] if name in known else model.Layers.AddLayer(name, (0, 0, 0, 255))
    return attributes


def quad_roof(size=1.0):
    """4 x 3 m in 48 quads, a parabola .8 m high."""
    x, y = np.meshgrid(np.linspace(0, 4, 9), np.linspace(0, 3, 7), indexing="ij")
    V = size * np.stack([x, y, 0.8 * (1 - (x / 2 - 1) ** 2)], axis=-1).reshape(-1, 3)
    faces = [(7 * i + j, 7 * i + j + 7, 7 * i + j + 8, 7 * i + j + 1) for i in range(8) for j in range(6)]
    return V, faces


def saved(model, path):
    assert model.Write(str(path), 7)
    return path


def rhino_file(path, *meshes, unit=None):
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = unit or rhino3dm.UnitSystem.Meters
    for mesh in meshes:
        model.Objects.AddMesh(mesh)
    return saved(model, path)


def test_meshes_of_rhino_in_its_unit(tmp_path, within):
    """Quads cut in two; two meshes that share an edge are one sheet; triangles and quads beside each other."""
    V, faces = quad_roof(1000.0)
    left, right = faces[:24], faces[24:]
    path = rhino_file(
        tmp_path / "roof.3dm", rhino_mesh(V, left), rhino_mesh(V, right), unit=rhino3dm.UnitSystem.Millimeters
    )
    surface = read_surface(path)
    assert (surface.m, surface.n, surface.pieces[0]) == (96, 63, 1)
    assert np.ptp(surface.V, axis=0) == pytest.approx([4, 3, 0.8], rel=1e-6)
    assert describe(path).unit == "mm"
    mixed = read_surface(rhino_file(tmp_path / "mixed.3dm", rhino_mesh(V, [faces[0], (9, 16, 17)])))
    assert mixed.m == 3


def test_meshes_of_blocks_are_placed_at_their_insertions(tmp_path, within):
    V, faces = quad_roof()
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    model.InstanceDefinitions.Add(
        "bay", "", "", "", rhino3dm.Point3d(0, 0, 0), (rhino_mesh(V, faces),), (rhino3dm.ObjectAttributes(),)
    )
    block = model.InstanceDefinitions[0]
    for step in range(2):
        moved = rhino3dm.Transform.Translation(4.0 * step, 0, 0)
        model.Objects.AddInstanceObject(rhino3dm.InstanceReference(block.Id, moved))
    surface = read_surface(saved(model, tmp_path / "bays.3dm"))
    assert surface.pieces[0] == 1
    assert np.ptp(surface.V, axis=0) == pytest.approx([8, 3, 0.8], rel=1e-6)


def test_rhino_surfaces_without_a_mesh_are_refused_with_advice(tmp_path, within):
    sphere = rhino3dm.Sphere(rhino3dm.Point3d(0, 0, 0), 2.0).ToBrep()
    model = rhino3dm.File3dm()
    model.Objects.AddBrep(sphere)
    alone = saved(model, tmp_path / "alone.3dm")
    with pytest.raises(
        SurfaceError, match=r"alone.3dm: the file has 1 surface without a mesh; make a mesh in Rhino \(Mesh\)"
    ):
        read_surface(alone)
    model.Objects.AddMesh(rhino_mesh(*quad_roof()))
    assert "1 surface saved without its mesh" in raw_mesh(saved(model, tmp_path / "both.3dm")).record.dropped
    empty = saved(rhino3dm.File3dm(), tmp_path / "empty.3dm")
    with pytest.raises(SurfaceError, match=r"empty.3dm: the file has no mesh; make a mesh in Rhino"):
        read_surface(empty)


@pytest.mark.parametrize("suffix", [".step", ".stp", ".brep"])
def test_faces_of_a_cad_file_are_one_sheet(tmp_path, suffix, within):
    """A quarter of a cylinder and a plane that meet in a line, 10 m long: area within a thousandth, one piece."""
    arc = build123d.Edge.make_circle(3000, start_angle=0, end_angle=90)
    line = build123d.Edge.make_line((3000, 0, 0), (3000, -2000, 0))
    shell = build123d.Shell(build123d.Face.extrude(each, (0, 0, 10000)) for each in (arc, line))
    assert len(shell.faces()) == 2
    path = tmp_path / f"canopy{suffix}"
    {".brep": build123d.export_brep}.get(suffix, build123d.export_step)(shell, path)
    surface = read_surface(path, None if suffix != ".brep" else "mm")
    assert surface.pieces[0] == 1
    assert len(surface.loops) == 1
    assert surface.area == pytest.approx(10 * (3 * np.pi / 2 + 2), rel=1e-3)
    radius = np.hypot(surface.V[:, 0], surface.V[:, 1])[surface.V[:, 1] > 1e-6]
    assert radius == pytest.approx(3, rel=1e-6)


def hide_parts(path, lengths):
    """Add the entity INVISIBILITY for the parts of these lengths (mm) to a STEP file, as OCCT writes it."""
    from OCP.STEPCAFControl import STEPCAFControl_Reader, STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDF import TDF_ChildIterator
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document, reader = TDocStd_Document(TCollection_ExtendedString("XCAF")), STEPCAFControl_Reader()
    reader.ReadFile(str(path))
    reader.Transfer(document)
    labels = TDF_ChildIterator(XCAFDoc_DocumentTool.ShapesLabel_s(document.Main()))
    while labels.More():
        shape = build123d.Shape.cast(XCAFDoc_ShapeTool.GetShape_s(labels.Value()))
        if not XCAFDoc_ShapeTool.IsAssembly_s(labels.Value()) and round(shape.bounding_box().size.X) in lengths:
            XCAFDoc_DocumentTool.ColorTool_s(document.Main()).SetVisibility(labels.Value(), False)
        labels.Next()
    writer = STEPCAFControl_Writer()
    writer.Transfer(document)
    writer.Write(str(path))
    return path


def test_invisible_parts_of_a_step_file_are_ignored_and_counted(tmp_path, within):
    path = hide_parts(step_file(tmp_path / "roof.step", above="shell"), (5000,))
    assert "INVISIBILITY" in path.read_text()
    raw = raw_mesh(path)
    assert raw.record.dropped == ("1 hidden object",)
    assert read_surface(path).area == pytest.approx(3 * 2)
    assert read_surface(path).V[:, 2].min() == pytest.approx(0.7)
    assert read_surface(path, only=["shell"]).area == pytest.approx(3 * 2)
    with pytest.raises(SurfaceError, match="no visible part has the name 'Walls'; the names are "):
        raw_mesh(path, only=["Walls"])


def test_a_step_file_with_invisible_parts_only_is_refused(tmp_path, within):
    path = hide_parts(step_file(tmp_path / "roof.step"), (3000, 5000))
    with pytest.raises(SurfaceError, match="it has no shapes; ignored: 2 hidden objects"):
        raw_mesh(path)


def test_meshes_of_dxf(tmp_path):
    """3DFACE, MESH, a polyface and a block of them: each the same roof."""
    import ezdxf
    from ezdxf.render import MeshBuilder

    V, faces = quad_roof(1000.0)
    builder = MeshBuilder()
    builder.add_mesh(vertices=V.tolist(), faces=faces)
    for kind in ("mesh", "polyface", "3dfaces", "block"):
        document = ezdxf.new(units=4)
        space = document.modelspace()
        into = document.blocks.new("bay") if kind == "block" else space
        render = {"mesh": builder.render_mesh, "polyface": builder.render_polyface}
        render.get(kind, builder.render_3dfaces)(into)
        if kind == "block":
            space.add_blockref("bay", (0, 0))
        space.add_point((1, 2, 3))
        document.saveas(tmp_path / f"{kind}.dxf")
        surface = read_surface(tmp_path / f"{kind}.dxf")
        assert (surface.m, surface.n) == (96, 63)
        assert np.ptp(surface.V, axis=0) == pytest.approx([4, 3, 0.8], rel=1e-6)


def test_faces_of_a_dxf_are_cut_together_and_damaged_numbers_recovered(tmp_path, monkeypatch):
    """One by one they took 0.3 ms each, two thirds of the seconds of 114,000; and sound files need no recovery."""
    import ezdxf
    from ezdxf import recover

    document = ezdxf.new(units=6)
    for x in range(3):
        corners = [(x, 0, 0), (x + 1, 0, 0), (x + 1, 1, 0), (x, 1, 0)]
        document.modelspace().add_3dface(corners[: 4 - x % 2])
    document.saveas(tmp_path / "sound.dxf")
    text = (tmp_path / "sound.dxf").read_text()
    at = text.index("AcDbFace")
    damaged = text[:at] + text[at:].replace(" 10\n0.0\n 20\n0.0\n", " 20\n0.0\n 10\n0.0abc\n", 1)
    assert damaged != text
    (tmp_path / "damaged.dxf").write_text(damaged)
    counts = {"cuts": 0, "recoveries": 0}

    def counted(key, do):
        def call(*given):
            counts[key] += 1
            return do(*given)

        return call

    monkeypatch.setattr(drawings, "triangles", counted("cuts", drawings.triangles))
    monkeypatch.setattr(recover, "readfile", counted("recoveries", recover.readfile))
    for number, name in enumerate(("sound", "damaged")):
        raw = raw_mesh(tmp_path / f"{name}.dxf")
        assert (raw.F.shape, raw.V.shape, raw.unit) == ((5, 3), (8, 3), "m")
        assert counts == {"cuts": number + 1, "recoveries": number}


def test_a_gltf_file_with_a_separate_buffer_is_read(tmp_path):
    s = grid(4, 3, 4.0, 3.0)
    upright = np.stack([s.V[:, 0], s.V[:, 2], -s.V[:, 1]], axis=1)
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.Trimesh(upright, s.F))).items():
        (tmp_path / name).write_bytes(data)
    surface = read_surface(tmp_path / "model.gltf")
    assert surface.m == s.m
    assert np.ptp(surface.V, axis=0) == pytest.approx([4, 3, 0], abs=1e-6)


def dxf_of_lines(path):
    import ezdxf

    document = ezdxf.new()
    document.modelspace().add_line((0, 0), (1, 1))
    document.saveas(path)


def step_of_a_line(path):
    build123d.export_step(build123d.Edge.make_line((0, 0, 0), (1, 0, 0)), path)


WRONG = {
    "cut off 3dm": ("x.3dm", b"3D Geometry File Format        7", "x.3dm cannot be read as 3DM"),
    "no 3dm": ("x.3dm", b"a roof", "x.3dm cannot be read as 3DM"),
    "cut off step": (
        "x.step",
        b"ISO-10303-21;\nHEADER;\n",
        "x.step cannot be read as STEP .the file is not a STEP file with",
    ),
    "no step": ("x.stp", b"a roof", "x.stp cannot be read as STP"),
    "no brep": ("x.brep", b"DBRep_DrawableShape\n", "x.brep cannot be read as BREP"),
    "a line": ("x.step", step_of_a_line, "it has no faces, only curves or points"),
    "cut off dxf": ("x.dxf", b"  0\nSECTION\n", "the last word EOF is missing"),
    "lines": ("x.dxf", dxf_of_lines, "x.dxf: the file has no mesh: no 3DFACE, MESH or polyface; export the surface"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_file_without_a_surface_is_refused_in_one_sentence(tmp_path, what, within):
    name, content, said = WRONG[what]
    path = tmp_path / name
    if callable(content):
        content(path)
    else:
        path.write_bytes(content)
    with pytest.raises(SurfaceError, match=said):
        read_surface(path)


@APART
def test_foreign_readers_run_in_a_process_whose_crash_is_reported(tmp_path, monkeypatch):
    """The same files by the program; one that breaks it, and one that takes too long."""
    V, faces = quad_roof()
    rhino = rhino_file(tmp_path / "roof.3dm", rhino_mesh(V, faces))
    step = tmp_path / "plane.step"
    build123d.export_step(build123d.Face.make_rect(4000, 3000), step)
    assert read_surface(rhino).area == pytest.approx(read_surface(step).area, rel=0.2)
    (tmp_path / "bad.step").write_bytes(b"a roof")
    with pytest.raises(SurfaceError, match=r"bad.step cannot be read as STEP .the file is not a STEP file with shapes"):
        read_surface(tmp_path / "bad.step")
    monkeypatch.setattr(separate_process, "PROGRAM", "raise SystemExit(1)")
    with pytest.raises(
        SurfaceError,
        match=r"plane.step cannot be read as STEP .the file is damaged, or needs more than 4 GiB of memory: OCCT",
    ):
        read_surface(step)
    endless = "from dsfab.surface.files.separate_process import _limit; _limit(1, 1 << 32)\nwhile True: 1"
    monkeypatch.setattr(separate_process, "PROGRAM", endless)
    with pytest.raises(SurfaceError, match=r"plane.step: OCCT needs more than 60 s of processor time for the file"):
        read_surface(step)
    with pytest.raises(SurfaceError, match=r"Rhino's library needs more than 3 s of processor time for the file"):
        separate_process.read_rhino_in_process(rhino, DrawingBudget())
    monkeypatch.setattr(separate_process, "PROGRAM", "import time; time.sleep(30)")
    monkeypatch.setitem(separate_process.SECONDS, "cad", -239.9)
    with pytest.raises(SurfaceError, match="reading the file took more than 240 s; export the model as a mesh"):
        read_surface(step)


def site(path, marks, unit=None):
    """A roof in Rhino with points and curves on layers: (layer, rows), a curve where there is more than one row."""
    V, faces = quad_roof()
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = unit or rhino3dm.UnitSystem.Meters
    model.Objects.AddMesh(rhino_mesh(V, faces))
    for layer, rows in marks:
        points = [rhino3dm.Point3d(*row) for row in rows]
        if len(rows) == 1:
            model.Objects.AddPoint(points[0], on_layer(model, layer))
        else:
            model.Objects.AddPolyline(rhino3dm.Polyline(points), on_layer(model, layer))
    return saved(model, path)


SQUARE = [(1.5, 1, 3), (2.5, 1, 3), (2.5, 2, 3), (1.5, 2, 3), (1.5, 1, 3)]
MARKS = [
    ("Support", [(0, 0, 0), (0, 3, 0)]),
    ("Support", [(4, 0, 0)]),
    ("Support", [(4, 3, 0)]),
    ("load", [(2, 0, 0.8)]),
    ("load", [(1, 1, 2), (3, 1, 2), (3, 2, 2), (1, 2, 2), (1, 1, 2)]),
    ("void", SQUARE),
    ("keep", [(1, 0.2, 0.6), (1, 2.8, 0.6)]),
    ("drawing", [(0, 0, 9)]),
]


def test_layers_of_a_3dm_file_become_supports_and_loads(tmp_path, within):
    """Points and curves on four layers become pickers; what is on others stays a drawing."""
    proposal = propose(site(tmp_path / "site.3dm", MARKS))
    preset, text = proposal.preset, "\n".join(proposal.lines)
    first, second = preset.surface.support
    surface = preset.surface.build()
    held = first.at.vertices(surface) | second.at.vertices(surface)
    assert np.isclose(surface.V[first.at.vertices(surface)][:, 0].min(), 4, atol=1e-6)  # points, then curves
    assert np.isclose(surface.V[second.at.vertices(surface)][:, 0].max(), 0, atol=1e-6)
    assert np.ptp(surface.V[second.at.vertices(surface)][:, 1]) == pytest.approx(3)
    assert held.sum() < 0.2 * surface.n
    forces = [load.force for load in preset.surface.load if load.kind == "force"]
    assert forces == [(0, 0, -1000), (0, 0, -2000)]  # a point, and 2 m2
    assert [region.do for region in preset.pattern.region] == ["keep", "void"]
    assert "layer Support  2 points, 1 line; change surface.support" in text
    assert "1 kPa within each curve; change surface.load" in text
    assert "stands on" in text
    assert "support as drawn" in text
    again = tomllib.loads(proposal.text(Path("site.3dm")))
    assert again["pattern"]["region"][1]["at"] == {"pick": "curve", "file": "site.3dm", "layer": "void", "unit": "m"}


def test_marks_in_millimetres_are_scaled_and_open_marks_are_ignored(tmp_path, within):
    rows = [(layer, [tuple(1000 * x for x in row) for row in rows]) for layer, rows in [*MARKS, ("void", [(1, 1, 0)])]]
    path = site(tmp_path / "site.3dm", rows, rhino3dm.UnitSystem.Millimeters)
    with pytest.raises(SurfaceError, match="marks on layer 'support', but z does not point up; turn"):
        propose(path, up="y")
    assert "1 of these points and lines enclose no area and are ignored" in "\n".join(propose(path).lines)


@pytest.mark.parametrize("away", [0.0, 452_345.0], ids=["here", "in coordinates of a survey"])
def test_dxf_has_layers_too(tmp_path, away):
    import ezdxf
    from ezdxf.render import MeshBuilder

    document = ezdxf.new(units=6)
    V, faces = quad_roof()
    builder = MeshBuilder()
    builder.add_mesh(vertices=(V + [away, 0, 0]).tolist(), faces=faces)
    builder.render_mesh(document.modelspace())
    for x in (0, 4):
        document.modelspace().add_line((x + away, 0, 0), (x + away, 3, 0), dxfattribs={"layer": "SUPPORT"})
    document.modelspace().add_circle((2 + away, 1.5, 5), 0.5, dxfattribs={"layer": "void"})
    document.saveas(tmp_path / "site.dxf")
    preset = propose(tmp_path / "site.dxf").preset
    assert preset.surface.origin == (away, 0, 0)
    surface = preset.surface.build()
    assert len(preset.surface.support) == 2
    ends = [surface.V[one.at.vertices(surface)][:, 0].mean() for one in preset.surface.support]
    assert ends == pytest.approx([0, 4], abs=1e-6)
    (void,) = preset.pattern.region
    assert void.do == "void"
    opening = (
        surface.centroids[void.at.faces(surface)] if hasattr(void.at, "faces") else surface.V[void.at.vertices(surface)]
    )
    assert len(opening)
    assert opening[:, :2].mean(axis=0) == pytest.approx([2, 1.5], abs=0.2)


@pytest.mark.slow
def test_build_takes_all_from_one_file(tmp_path, monkeypatch, capsys, unjudged):
    """The opening is there, and what lies on which layer is told."""
    monkeypatch.chdir(tmp_path)
    site(tmp_path / "site.3dm", MARKS)
    few = ["--set=surface.edge=0.4", "--set=pattern.major.spacing=0.6", "--set=pattern.minor.spacing=0.6"]
    few += ["--set=statics.thickness=0.1"]  # a given thickness is not searched for
    assert main(["build", "site.3dm", "-o", "out", "--no-picture", "--format", "stl", *few]) == 0
    said = capsys.readouterr().out
    assert "layer void" in said
    solid = trimesh.load(tmp_path / "out" / "site.stl")
    assert solid.is_watertight
    inside = np.abs(solid.vertices[:, :2] / 1000 - (2, 1.5)).max(axis=1) < 0.45
    assert not inside.any()
