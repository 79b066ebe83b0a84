"""Members as objects with names on layers: found by the readers of each format, as bodies of their own."""

import csv
from dataclasses import replace

import ezdxf
import numpy as np
import pytest
import trimesh

from dsfab.app.cli import main
from dsfab.core.errors import ExportError
from dsfab.design.output import body_details, write
from dsfab.export import FORMATS
from dsfab.preset.file import load_preset
from dsfab.surface import signed_volume, total_area
from dsfab.workshop import drawing_files, workshop_plan
from tests.designs import sliced
from tests.export.ifc_files import amounts, faults

BODIES = [suffix for suffix, form in FORMATS.items() if getattr(form, "content", "") == "shapes"]


@pytest.fixture(scope="module")
def design():
    return sliced(load_preset("barrel_vault", {"surface.edge": 0.8}))


@pytest.fixture(scope="module")
def details(design):
    return body_details(design)


@pytest.fixture(scope="module")
def written(design, details, tmp_path_factory):
    folder = tmp_path_factory.mktemp("members")
    return {suffix: write(design.sheet, folder / f"vault{suffix}", details=details) for suffix in BODIES}


def layer_of(member):
    return member.family or member.kind


def test_a_body_is_as_thick_as_the_sheet_over_all_cells_of_its_member(design, details):
    """On a cylinder two skins have together twice the area of the middle, to (t / 2R)^2 and what facets do."""
    t = design.preset.statics.thickness
    for shape, member in zip(details.shapes, design.members.members, strict=True):
        assert (shape.id, shape.layer) == (member.id, layer_of(member))
        assert signed_volume(shape.V, shape.F) == pytest.approx(member.area * t, rel=1e-3)
        skins = shape.F[: 2 * len(member.cells)]
        assert total_area(shape.V, skins) == pytest.approx(2 * member.area, rel=2e-3)
        assert np.array_equal(shape.axis, member.axis.P if member.axis else np.zeros((0, 3)))
    shared = sum(node.area for node in design.members.nodes)
    whole = sum(member.area for member in design.members.members)
    assert whole - design.sheet.surface.area == pytest.approx(shared, rel=0.02)


def test_rhino_has_a_mesh_and_an_axis_by_each_name_on_layers_by_family(design, written):
    rhino3dm = pytest.importorskip("rhino3dm")
    model = rhino3dm.File3dm.Read(str(written[".members.3dm"]))
    layers = [layer.Name for layer in model.Layers]
    meshes, axes, points = {}, {}, {}
    for thing in model.Objects:
        kind, about = thing.Geometry.ObjectType, thing.Attributes
        where = {rhino3dm.ObjectType.Mesh: meshes, rhino3dm.ObjectType.Curve: axes, rhino3dm.ObjectType.Point: points}
        where[kind][about.Name] = (thing.Geometry, layers[about.LayerIndex], dict(about.GetUserStrings()))
    members = design.members.by_id
    assert list(meshes) == list(members)
    assert list(axes) == [name for name, member in members.items() if member.axis]
    assert {"major", "minor", "major axes", "minor axes", "nodes"} <= set(layers)
    for name, (mesh, layer, facts) in meshes.items():
        assert mesh.IsClosed
        assert layer == layer_of(members[name])
        assert float(facts["length_mm"]) == pytest.approx(1000 * members[name].length, abs=0.06)
    for name, (curve, layer, _) in axes.items():
        begin, P = curve.PointAtStart, 1000 * members[name].axis.P[0]
        assert pytest.approx(P, abs=1e-3) == [begin.X, begin.Y, begin.Z]
        assert layer == f"{layer_of(members[name])} axes"
    assert list(points) == [node.id for node in design.members.nodes]


def test_ifc_has_an_element_for_each_member_with_its_quantities(design, written):
    ifcopenshell = pytest.importorskip("ifcopenshell")
    path, statics = written[".members.ifc"], design.preset.statics
    assert faults(path) == []
    model = ifcopenshell.open(str(path))
    elements = [*model.by_type("IfcMember"), *model.by_type("IfcPlate")]
    members = design.members.by_id
    assert sorted(one.Name for one in elements) == sorted(members)
    for one in elements:
        member, found = members[one.Name], amounts(one)
        assert found["GrossVolume"] == pytest.approx(member.area * statics.thickness, rel=1e-3)
        assert found["GrossWeight"] == pytest.approx(found["GrossVolume"] * statics.density)
        assert found["NetArea"] / found["GrossArea"] == pytest.approx(found["NetVolume"] / found["GrossVolume"])
        assert found["NetVolume"] <= found["GrossVolume"] * (1 + 1e-9)
        assert found["NetWeight"] == pytest.approx(found["NetVolume"] * statics.density)
        assert found["Thickness"] == pytest.approx(1000 * statics.thickness)
        assert found["Width"] == pytest.approx(1000 * member.mean_width, abs=0.1)
        assert one.is_a("IfcPlate") or found["Length"] == pytest.approx(1000 * member.length, abs=0.1)
        assert one.is_a("IfcPlate") == (member.kind in ("disc", "plate", "fill"))
        (made_of,) = [x.RelatingMaterial for x in one.HasAssociations]
        assert made_of.Name == (statics.material or "material")
    every = [amounts(one) for one in elements]
    assert sum(one["NetVolume"] for one in every) == pytest.approx(design.solid.volume, rel=2e-3)
    assert sum(one["NetArea"] for one in every) == pytest.approx(design.sheet.surface.area, rel=1e-6)
    assert sum(one["GrossVolume"] for one in every) > 1.05 * design.solid.volume
    by_name = {one.Name: found for one, found in zip(elements, every, strict=True)}
    less = {name for name, found in by_name.items() if found["NetArea"] < found["GrossArea"]}
    told = {name: found[key] for name, found in by_name.items() if (key := "Crossings counted with") in found}
    assert less == set(told)
    for name, others in told.items():
        assert all(members[one].mean_width >= members[name].mean_width for one in others.split(", "))
    layers = {x.Name: len(x.AssignedItems) for x in model.by_type("IfcPresentationLayerAssignment")}
    assert layers == {name: [layer_of(m) for m in members.values()].count(name) for name in layers}
    assert sum(layers.values()) == len(members)


def test_ifc_reads_back_with_a_plate_between_two_members(design, details, tmp_path):
    """Its reader gives elements kind after kind, not in the order in which they were written."""
    shapes = tuple(replace(shape, plate=k == 1) for k, shape in enumerate(details.shapes))
    path = write(design.sheet, tmp_path / "vault.members.ifc", details=replace(details, shapes=shapes))
    assert faults(path) == []


def test_glb_has_a_node_by_each_name_below_its_layer(design, written):
    scene = trimesh.load_scene(written[".members.glb"])
    above = scene.graph.transforms.parents
    for name, member in design.members.by_id.items():
        assert (above[name], above[above[name]]) == (layer_of(member), "vault")
        mesh = scene.geometry[scene.graph[name][1]]
        assert mesh.is_watertight
        low, high = mesh.bounds[:, [0, 2, 1]] * [1, -1, 1]
        middle = design.members.sheet.surface.centroids[member.cells].mean(axis=0)
        assert (np.minimum(low, high) - 1e-4 <= middle).all()
        assert (middle <= np.maximum(low, high) + 1e-4).all()


def test_dxf_has_a_group_by_each_name_with_its_axis_outline_and_name(design, written):
    document = ezdxf.readfile(written[".members.dxf"])
    groups = {name: list(group) for name, group in document.groups}
    assert set(groups) == set(design.members.by_id)
    for name, member in design.members.by_id.items():
        layers = {entity.dxf.layer for entity in groups[name]}
        layer = layer_of(member).upper()
        assert layers == {f"{layer}-EDGES", f"{layer}-NAMES"} | ({f"{layer}-AXES"} if member.axis else set())
        assert [x.dxf.text for x in groups[name] if x.dxftype() == "TEXT"] == [name]
        assert {entity.get_xdata("DSFAB")[0].value for entity in groups[name]} == {name}
    points = {x.get_xdata("DSFAB")[0].value: x.dxf.location for x in document.query("POINT")}
    for node in design.members.nodes:
        assert list(points[node.id]) == pytest.approx(1000 * node.point, abs=1e-3)


@pytest.mark.parametrize(
    "suffix", [pytest.param(x, marks=[pytest.mark.slow] * (x in (".members.3dm", ".members.dxf"))) for x in BODIES]
)
def test_the_same_members_give_the_same_bytes_and_a_lost_one_is_refused(
    design, details, written, suffix, tmp_path, monkeypatch
):
    again = write(design.sheet, tmp_path / f"vault{suffix}", details=details)
    assert again.read_bytes() == written[suffix].read_bytes()
    form = FORMATS[suffix]

    def fewer(part):
        return form.encode(replace(part, details=replace(part.details, shapes=part.details.shapes[1:])))

    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=fewer))
    with pytest.raises(ExportError, match="reads back with"):
        write(design.sheet, tmp_path / f"b{suffix}", details=details)
    with pytest.raises(ExportError, match="only a design has members"):
        write(design.sheet, tmp_path / f"b{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [f"vault{suffix}"]


@pytest.mark.slow
def test_the_drawings_of_a_member_are_the_drawings_of_its_parts(design):
    """A part that is cut several times has one drawing."""
    plan = workshop_plan(design)
    files = drawing_files(plan)
    assert set(files) == {part.member for part in plan.parts}
    for group in plan.equal_parts:
        file = f"{plan.parts[group[0]].id.replace(' ', '_')}.dxf"
        assert all(file in files[plan.parts[k].member] for k in group)


@pytest.mark.slow
def test_the_workshop_names_drawings_in_its_ifc_file(tmp_path, capsys):
    ifcopenshell = pytest.importorskip("ifcopenshell")
    words = ["workshop", "barrel_vault", "--set", "surface.edge=0.5", "--ifc", "-o", str(tmp_path)]
    assert main(words) == 0
    assert "members.ifc" in capsys.readouterr().out
    assert faults(tmp_path / "members.ifc") == []
    model = ifcopenshell.open(str(tmp_path / "members.ifc"))  # keep it: elements do not
    with open(tmp_path / "cutlist.csv", encoding="utf-8", newline="") as file:
        area = sum(float(row["area_m2"]) * int(row["count"]) for row in csv.DictReader(file))
    found = [amounts(one) for one in (*model.by_type("IfcMember"), *model.by_type("IfcPlate"))]
    (thickness,) = {one["Thickness"] for one in found}
    assert sum(one["NetVolume"] for one in found) == pytest.approx(area * thickness / 1000, rel=1e-3)
    for one in model.by_type("IfcMember"):
        drawings = [x.RelatingDocument for x in one.HasAssociations if x.is_a("IfcRelAssociatesDocument")]
        assert drawings
        assert all((tmp_path / drawing.Location).is_file() for drawing in drawings)
    assert main([*words, "--model", "1:50"]) == 1
    assert "leave out --ifc or --model" in capsys.readouterr().err
    assert main(["workshop", "cantilever", "--set", "surface.edge=0.1", "--ifc", "-o", str(tmp_path / "flat")]) == 1
    assert "--to members.ifc" in capsys.readouterr().err
    assert not (tmp_path / "flat").exists()
