"""3DM, BREP and VTU: what rhino3dm, OCCT and VTK find in them; and which part of a design goes into which format."""

import importlib.util
import json
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from dsfab import load_preset, run
from dsfab.app.cli import main
from dsfab.core.errors import DsfabError, ExportError
from dsfab.design.output.archive import design_fields, design_lines
from dsfab.design.output.files import deliverable
from dsfab.export import FORMATS, Details, write
from dsfab.export.cad.rhino import without_times
from dsfab.export.cad.step.worker.shapes import step_facts
from dsfab.export.readback import COLOURS
from dsfab.surface.fields import StructureLine
from tests.export.solids import solid_box
from tests.export.striped_solids import ARCHED, FLAT
from tests.presets import DOME_MODES
from tests.shapes import grid

SMALL = {"surface.edge": 0.12, "export.formats": ["stl"]}


@pytest.fixture(scope="module")
def design():
    return run(load_preset("cantilever", SMALL))


@pytest.fixture(scope="module")
def dome():
    return run(load_preset(DOME_MODES, {"surface.edge": 0.9}))


def test_rhino3dm_finds_the_mesh_and_the_curves_on_named_layers(tmp_path):
    rhino3dm = pytest.importorskip("rhino3dm")
    details = ARCHED[1]
    model = rhino3dm.File3dm.Read(str(write(solid_box(), tmp_path / "a.3dm", details=details, name="arch")))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    layers = {layer.Index: layer for layer in model.Layers}
    assert {layer.Name for layer in layers.values()} == {"sheet", *(line.layer for line in details.lines)}
    assert next(x.Color for x in layers.values() if x.Name == "centre-major") == (*COLOURS["major"], 255)
    mesh, *curves = list(model.Objects)
    assert (mesh.Attributes.Name, layers[mesh.Attributes.LayerIndex].Name) == ("arch", "sheet")
    assert mesh.Geometry.IsClosed
    corner = mesh.Geometry.GetBoundingBox().Max
    assert pytest.approx((200, 300, 50)) == (corner.X, corner.Y, corner.Z)
    assert len(curves) == len(details.lines)
    for line, curve in zip(details.lines, curves, strict=True):
        assert curve.Attributes.Name == line.id
        assert layers[curve.Attributes.LayerIndex].Name == line.layer
        ends = [(p.X, p.Y, p.Z) for p in (curve.Geometry.PointAtStart, curve.Geometry.PointAtEnd)]
        assert np.array(ends) == pytest.approx(1000 * line.points[[0, -1]], abs=1e-9)
        assert curve.Geometry.IsClosed == line.is_closed
        assert float(curve.Attributes.GetUserString("length_mm")) == pytest.approx(1000 * line.length, abs=1e-3)


@pytest.mark.slow
def test_a_3dm_file_has_the_same_bytes_each_time(tmp_path):
    """Another second, another folder, another process (the library makes up ids, and wrote time and path)."""
    rhino3dm = pytest.importorskip("rhino3dm")
    (tmp_path / "elsewhere").mkdir()
    code = (
        "import sys; from dsfab.export import write; from tests.export.solids import solid_box\n"
        "from tests.export.striped_solids import ARCHED\n"
        "write(solid_box(), sys.argv[1], details=ARCHED[1], name='arch')"
    )
    subprocess.run(
        [sys.executable, "-c", code, tmp_path / "elsewhere" / "b.3dm"], check=True, cwd=Path(__file__).parents[2]
    )
    time.sleep(1.1)
    content = write(solid_box(), tmp_path / "a.3dm", details=ARCHED[1], name="arch").read_bytes()
    assert content == (tmp_path / "elsewhere" / "b.3dm").read_bytes()
    assert "elsewhere".encode("utf-16-le") not in content
    model = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm"))
    ids = [str(item.Attributes.Id) for item in model.Objects] + [str(layer.Id) for layer in model.Layers]
    assert len(set(ids)) == len(ids) == 1 + len(ARCHED[1].lines) + len(model.Layers)
    assert (model.Created.year, model.LastEdited.year) == (1980, 1980)
    other = rhino3dm.File3dm.Read(str(write(solid_box(), tmp_path / "a.3dm", details=ARCHED[1], name="other")))
    assert {str(item.Attributes.Id) for item in other.Objects}.isdisjoint(ids), "two designs may meet in one model"


def test_the_times_in_a_3dm_archive_are_removed_and_its_checksum_is_valid():
    """Names of who made and changed it are kept, whatever their length."""
    names = [text.encode("utf-16-le") for text in ("Ada\0", "")]
    parts = [len(name) // 2 for name in names]
    body = b"\x10" + b"".join(
        count.to_bytes(4, "little") + name + bytes(range(32)) for count, name in zip(parts, names, strict=True)
    )
    body += (7).to_bytes(4, "little")
    history = struct.pack("<Iq", 0x20008021, len(body) + 4) + body + b"CRC!"
    inside = struct.pack("<Iq", 0xA0000026, 5) + struct.pack("<Iq", 0x20008024, 2) + b"xy" + history
    archive = b"3D".ljust(32) + struct.pack("<Iq", 1, 3) + b"abc" + struct.pack("<Iq", 0x10000014, len(inside)) + inside
    found = without_times(archive + b"rest")
    at = archive.index(body)
    assert found[:at] == archive[:at]
    assert found[at + len(body) + 4 :] == b"rest"
    changed = found[at : at + len(body)]
    assert found[at + len(body) :][:4] == zlib.crc32(changed).to_bytes(4, "little")
    assert changed == body.replace(bytes(range(32)), struct.pack("<8i", 0, 0, 0, 1, 0, 80, 2, 0))
    with pytest.raises(ExportError, match="a layout that dsfab does not know"):
        without_times(archive[:60])


def test_a_3dm_file_that_lost_a_triangle_or_a_curve_is_not_kept(tmp_path, monkeypatch):
    pytest.importorskip("rhino3dm")
    from dataclasses import replace

    form, details = FORMATS[".3dm"], FLAT[1]
    for spoil, said in (
        (lambda p: replace(p, F=p.F[1:]), "reads back with 11 triangles instead of 12"),
        (lambda p: replace(p, details=Details(p.details.lines[1:])), "lines instead of"),
        (lambda p: replace(p, details=p.details.scaled_by(1.01)), "mm in the file instead of"),
    ):
        monkeypatch.setitem(FORMATS, ".3dm", replace(form, encode=lambda part, s=spoil: form.encode(s(part))))
        with pytest.raises(ExportError, match=said):
            write(solid_box(), tmp_path / "a.3dm", details=details)
    assert not any(tmp_path.iterdir())


def test_without_rhino3dm_the_error_names_the_package_before_any_work(tmp_path, monkeypatch, capsys):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == "rhino3dm" else found(name, *a))
    said = '.3dm files need the library rhino3dm; install it with: pip install "dsfab[rhino]"'
    with pytest.raises(ExportError) as caught:
        write(solid_box(), tmp_path / "a.3dm")
    assert str(caught.value) == said
    for command in (["export", DOME_MODES, "--to", "3dm"], ["build", "dome", "--format", "stl,3dm"]):
        assert main([*command, "-o", str(tmp_path / "a.3dm")]) == 1
        out, err = capsys.readouterr()
        assert (out, err) == ("", f"dsfab: {said}\n")
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_occt_finds_the_solid_of_a_brep_file(tmp_path, inspected, design):
    from build123d import import_brep

    shape = import_brep(write(solid_box(), tmp_path / "a.brep"))
    assert (len(shape.solids()), len(shape.faces()), shape.is_valid) == (1, 6, True)
    assert shape.volume == pytest.approx(0.2 * 0.3 * 0.05 * 1e9)
    told: list[str] = []
    thing, how = deliverable(design, ".brep")
    plate = step_facts(write(thing, tmp_path / "plate.brep", note=told.append, **how))
    assert plate["volume"] == pytest.approx(1e9 * design.solid.volume, rel=1e-3)
    assert told == [f"BREP is planar, its outline within {1000 * 0.01 / 40:.3g} mm of the mesh"]


def test_a_brep_file_of_another_solid_is_not_kept(tmp_path, inspected, monkeypatch):
    from dataclasses import replace

    form = FORMATS[".brep"]
    monkeypatch.setitem(FORMATS, ".brep", replace(form, encode=lambda part: form.encode(replace(part, V=1.1 * part.V))))
    with pytest.raises(ExportError, match="reads back with volume"):
        write(solid_box(), tmp_path / "a.brep")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("which", ["design", "dome"])
def test_vtk_finds_every_field_on_the_uncut_surface_in_metres(which, request, tmp_path):
    import pyvista

    made = request.getfixturevalue(which)
    thing, how = deliverable(made, ".vtu")
    grid_ = pyvista.read(write(thing, tmp_path / "a.vtu", **how))
    assert np.asarray(grid_.points) == pytest.approx(made.surface.V, rel=1e-12, abs=1e-12)
    assert (grid_.cells.reshape(-1, 4)[:, 1:] == made.surface.F).all()
    assert set(grid_.celltypes) == {pyvista.CellType.TRIANGLE}
    assert list(grid_.field_data["unit"]) == ["metre"]
    fields = design_fields(made)
    assert set(grid_.point_data) | set(grid_.cell_data) == set(fields)
    for name, values in fields.items():
        there = grid_.point_data if len(values) == made.surface.n else grid_.cell_data
        assert np.asarray(there[name]).reshape(values.shape) == pytest.approx(values, rel=0, abs=0)
    assert grid_.point_data["displacement [m]"] == pytest.approx(made.statics.equilibrium.u)
    assert grid_.cell_data["stress [Pa]"].shape == (made.surface.m, 9)
    assert {"major phase [1]", "minor half-width [1]", "keep distance [m]", "major mode 1 [1]"} <= set(grid_.point_data)


def test_a_field_that_fits_neither_vertices_nor_faces_is_refused(tmp_path):
    with pytest.raises(ExportError, match=r"the field 'u \[m\]' has 7 rows, but 'a' has 9 vertices and 8 faces"):
        write(grid(2, 2, 1, 1), tmp_path / "a.vtu", details=Details(values={"u [m]": np.zeros(7)}))
    form = FORMATS[".vtu"]
    assert form.content == "fields"


def test_a_vtu_file_with_other_values_is_not_kept(tmp_path, monkeypatch):
    from dataclasses import replace

    form, plate = FORMATS[".vtu"], grid(2, 2, 1, 1)
    zeros = Details(values={"T [K]": np.zeros(plate.n)})
    spoilt = replace(form, encode=lambda part: form.encode(replace(part, details=zeros)))
    monkeypatch.setitem(FORMATS, ".vtu", spoilt)
    with pytest.raises(ExportError, match=r"the field 'T \[K\]' of 'a' differs when the file is read back"):
        write(plate, tmp_path / "a.vtu", details=Details(values={"T [K]": np.arange(9.0)}))
    assert not any(tmp_path.iterdir())


def test_stresses_of_every_case_have_a_name():
    cases = {
        "surface.load": [
            {"kind": "self_weight", "case": "dead"},
            {"kind": "pressure", "pressure": 500.0, "case": "snow"},
        ]
    }
    fields = design_fields(run(load_preset(DOME_MODES, {"surface.edge": 1.2, **cases})))
    assert {"displacement dead [m]", "displacement snow [m]", "stress snow [Pa]"} <= set(fields)
    assert "displacement [m]" not in fields


@pytest.mark.parametrize("which", ["design", "dome"])
def test_the_lines_of_a_design_lie_on_or_inside_its_outline(which, request):
    made = request.getfixturevalue(which)
    lines, sheet = design_lines(made), made.sheet.surface
    ends = sheet.V[sheet.edges.ends[sheet.edges.boundary]]
    outline = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert sum(line.length for line in lines if line.kind == "edge") == pytest.approx(outline)
    assert {line.family for line in lines} >= {"major", "minor", "boundary"}
    few = design_lines(made, 0.01)
    assert [line.id for line in few] == [line.id for line in lines]
    assert [line.length for line in few] == [line.length for line in lines]
    assert sum(len(line.points) for line in few) < 0.8 * sum(len(line.points) for line in lines)


@pytest.mark.parametrize("rule", ["plain", "graded"])
def test_edges_and_middles_are_where_the_wave_says(rule):
    """Material is p(frequency x + phase) > threshold: the wave is 1 on middles and the threshold on plain edges."""
    changes = {"pattern.width": {"rule": rule}, "pattern.major": {"mode": 1, "frequency": 3.0, "phase": 0.3}}
    made = run(load_preset("cantilever", {**SMALL, **changes, "slicing.snap": 0.0}))
    z = made.sheet.carry(3.0 * made.diffusion.major.mode(1) + 0.3)
    near = {tuple(v): value for v, value in zip(made.sheet.surface.V.round(9).tolist(), z, strict=True)}
    for line in design_lines(made):
        if line.layer == "edges-major":
            off = np.abs(np.array([near[tuple(point)] for point in line.points.round(9).tolist()]) - line.number)
            assert off.max() < 0.5 + 1e-9
            if rule == "plain":
                assert off == pytest.approx(0.25, abs=1e-6)
        if line.layer == "centre-major":
            closest = np.linalg.norm(made.sheet.surface.V - line.points[len(line.points) // 2], axis=1).argsort()[:6]
            assert np.abs(z[closest] - line.number).min() < 0.3


def test_a_family_that_covers_everything_or_nothing_has_no_middles():
    for threshold, left in ((1.0, {"centre-major"}), (-1.0, {"centre-major"}), (0.5, {"centre-major", "centre-minor"})):
        changes = {"pattern.minor.threshold": threshold, "pattern.width": {"rule": "plain"}}
        lines = design_lines(run(load_preset("cantilever", {**SMALL, **changes})))
        assert {line.layer for line in lines if line.kind == "centre"} == left


def test_each_format_receives_its_own_object(design):
    with pytest.raises(DsfabError, match="dsfab cannot check the members"):
        deliverable(design, ".member_utilisation.csv")
    for suffix, form in FORMATS.items():
        content = getattr(form, "content", "solid")
        if content == "utilisation":  # of a design with a strength: study/test_archive.py
            continue
        thing, how = deliverable(design, suffix)
        expected = {"solid": design.solid, "solid and lines": design.solid, "fields": design.surface}
        assert thing is expected.get(content, design.sheet.surface), suffix
        details = how.get("details", Details())
        assert bool(details.lines) == (content in ("lines", "solid and lines"))
        assert bool(details.values) == (content == "fields")
        assert bool(details.members) == (content in ("members", "shapes"))
        assert bool(details.section_forces) == (content == "section_forces")
        assert bool(details.member_forces) == (content == "member_forces")
        assert bool(details.frame) == (content == "frame")
        assert bool(details.shapes) == (content == "shapes")
        if details.lines:
            assert isinstance(details.lines[0], StructureLine)
            assert details.tolerance == design.preset.statics.thickness / 40


@pytest.mark.slow
def test_build_and_export_write_all_line_formats(tmp_path, capsys):
    small = ("--set", "surface.edge=0.12")
    folder = tmp_path / "built"
    formats = "dxf,svg,csv,json,off,vtu"
    assert main(["build", "cantilever", *small, "--format", formats, "--no-picture", "-q", "-o", str(folder)]) == 0
    names = [f"cantilever.{suffix}" for suffix in formats.split(",")]
    assert json.loads((folder / "design.json").read_text())["files"] == names
    assert all((folder / name).stat().st_size > 1000 for name in names)
    before = (folder / "cantilever.dxf").read_bytes()
    assert main(["export", str(folder), "--to", "dxf", "-q", "-o", str(tmp_path / "again.dxf")]) == 0
    assert (tmp_path / "again.dxf").read_bytes() == before
    for words in (["--to", "dxf", "--sheet", "cut"], ["--to", "vtu", "--sheet", "uncut"]):
        assert main(["export", "cantilever", *small, *words, "-o", str(tmp_path / f"b.{words[1]}")]) == 1
        assert f"--sheet has no effect on a .{words[1]} file" in capsys.readouterr().err


def test_every_format_is_named_in_the_help_and_known_to_presets(capsys):
    from typing import get_args

    from dsfab.preset.model import FormatName

    assert {"." + name for name in get_args(FormatName)} == set(FORMATS) - {".stp"}
    assert main(["export", "--help"]) == 0
    said = capsys.readouterr().out
    assert all(suffix[1:] in said for suffix in FORMATS if suffix != ".stp")
    assert "calculix" in said
