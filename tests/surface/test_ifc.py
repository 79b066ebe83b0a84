"""IFC files as surfaces: elements, units, places and hidden things, in files by ifcopenshell and by dsfab itself."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab.core.errors import SurfaceError
from dsfab.export import write
from dsfab.preset.proposal import propose
from dsfab.preset.proposal.reading import possible_axes
from dsfab.surface import Surface, read_surface, total_area
from dsfab.surface.files import ifc
from dsfab.surface.files.mesh_files import raw_mesh
from tests.export.solids import solid_box
from tests.surface.named_files import ROOF, ifc_element, ifc_model, read_in_this_process


@pytest.fixture(autouse=True)
def within(monkeypatch):
    read_in_this_process(monkeypatch)


ifcopenshell = pytest.importorskip("ifcopenshell")
FAR = (466000.1, 5247000.1, 560.1)
"""Survey coordinates, metres."""
BOX_FACES = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def slab(length=4.0, width=3.0, thickness=0.2, low=(0.0, 0.0, 0.0)):
    """V and quads of a box."""
    plan = np.array([(0, 0, 0), (length, 0, 0), (length, width, 0), (0, width, 0)])
    return np.concatenate([plan, plan + [0, 0, thickness]]) + low, BOX_FACES


def roof_file(path, place=(0.0, 0.0, 0.0), **unit):
    model, body, (top, _) = ifc_model(**unit)
    ifc_element(model, body, top, "IfcShadingDevice", "Sail", (ROOF.V, ROOF.F), place)
    model.write(str(path))
    return path


def test_every_product_of_an_ifc_file_is_accounted_for(tmp_path):
    from ifcopenshell.api import aggregate, feature, layer, root

    model, body, (top, _) = ifc_model()
    deck = ifc_element(model, body, top, "IfcSlab", "Deck", slab())
    ifc_element(model, body, top, "IfcPlate", "Glass", (ROOF.V + [0, 0, 5], ROOF.F))
    hole = ifc_element(model, body, None, "IfcOpeningElement", "Hole", slab(1, 1, 1, (1, 1, -0.5)))
    feature.add_feature(model, feature=hole, element=deck)
    space = ifc_element(model, body, None, "IfcSpace", "Room", slab(4, 3, 3))
    aggregate.assign_object(model, products=[space], relating_object=top)
    ifc_element(model, body, top, "IfcAnnotation", "Note", (ROOF.V, ROOF.F))
    ifc_element(model, body, top, "IfcVirtualElement", "Border", slab())
    root.create_entity(model, ifc_class="IfcBeam", name="without a shape")
    roof = root.create_entity(model, ifc_class="IfcRoof", name="of parts")
    aggregate.assign_object(model, products=[deck], relating_object=roof)
    for name, keys in (("old", {"LayerOn": False}), ("frozen", {"LayerOn": True, "LayerFrozen": True})):
        wall = ifc_element(model, body, top, "IfcWall", name, slab(low=(0, 0, 9)))
        shown = model.create_entity("IfcPresentationLayerWithStyle", Name=name, AssignedItems=(), **keys)
        layer.assign_layer(model, items=[*wall.Representation.Representations], layer=shown)
    model.write(str(path := tmp_path / "roof.ifc"))
    record = raw_mesh(path).record
    assert sorted(record.surface_words.split(", ")) == ["1 IfcPlate element", "1 IfcSlab element"]
    things = ("IfcOpeningElement", "IfcSpace", "IfcAnnotation", "IfcVirtualElement")
    assert sorted(record.other_words.split(", ")) == sorted(f"1 {kind} object" for kind in things)
    assert sorted(record.dropped) == [
        "1 IfcBeam element without a shape",
        "1 hidden object on layer 'frozen'",
        "1 hidden object on layer 'old'",
    ]
    containers = ("IfcBuilding", "IfcBuildingStorey", "IfcRoof")
    products = [product for product in model.by_type("IfcProduct") if product.is_a() not in containers]
    assert sum(thing.count for thing in record.content) == len(products) == 9
    whole = raw_mesh(path)
    opened = 2 * (4 * 3 - 1) + 14 * 0.2 + 4 * 0.2
    assert total_area(whole.V, whole.F) == pytest.approx(ROOF.area + opened)
    assert read_surface(path, mend=True, only=["of parts"]).area == pytest.approx(4 * 3 - 1)


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        ({"prefix": "MILLI"}, 1e-3),
        ({"prefix": None}, 1.0),
        ({"prefix": "CENTI"}, 1e-2),
        ({"unit": "foot"}, 0.3048),
        ({"unit": "inch"}, 0.0254),
    ],
)
def test_the_unit_of_the_project_counts(unit, metres, tmp_path):
    path = roof_file(tmp_path / "roof.ifc", **unit)
    raw = raw_mesh(path)
    assert raw.metres == metres
    assert np.ptp(raw.V, axis=0)[0] == pytest.approx(3.0 / metres)
    assert read_surface(path).area == pytest.approx(ROOF.area)


@pytest.mark.parametrize(("unit", "words"), [(None, "no stated unit"), ("METRE", "decametre")])
def test_a_file_without_a_usual_unit_needs_the_option(unit, words, tmp_path):
    path = roof_file(tmp_path / "roof.ifc", unit=unit, prefix="DECA" if unit else None)
    with pytest.raises(SurfaceError, match=f"roof.ifc is in {words}, a unit .* write the unit with --unit"):
        raw_mesh(path)
    assert read_surface(path, "m").area > 0


def test_z_is_up_in_ifc_files():
    standing = Surface(ROOF.V[:, [0, 2, 1]], ROOF.F)
    assert possible_axes(standing, ".ifc") == {"z": 1.0}


def test_slabs_become_their_middle_surfaces(tmp_path):
    model, body, (top, _) = ifc_model(prefix="MILLI")
    for k in range(2):
        ifc_element(model, body, top, "IfcSlab", f"bay {k}", slab(low=(4 * k, 0, 1)))
    model.write(str(path := tmp_path / "deck.ifc"))
    proposal = propose(path)
    surface = proposal.preset.surface.base_surface()
    assert surface.area == pytest.approx(2 * 4 * 3)
    assert_allclose(surface.V[:, 2], 1.1)
    assert "a slab, 200 mm thick, was reduced to its middle surface" in "\n".join(proposal.lines)
    assert proposal.preset.surface.up == "z"


@pytest.mark.parametrize(("body_name", "count"), [("Body", 1), ("Facetation", 1), ("FootPrint", 0)])
def test_only_the_body_of_an_element_is_its_shape(body_name, count, tmp_path):
    from ifcopenshell.api import context, geometry

    model, body, (top, _) = ifc_model()
    deck = ifc_element(model, body, top, "IfcSlab", "Deck", slab())
    ifc_element(model, body, top, "IfcSlab", "Other", slab(low=(0, 0, 1)))
    (shape,) = deck.Representation.Representations
    shape.RepresentationIdentifier = body_name
    for name in ("Box", "Reference", "FootPrint", "Clearance"):
        other = context.add_context(
            model, context_type="Model", context_identifier=name, target_view="PLAN_VIEW", parent=body.ParentContext
        )
        V, faces = slab(low=(0, 0, 7))
        shape = geometry.add_mesh_representation(model, context=other, vertices=[V.tolist()], faces=[faces])
        geometry.assign_representation(model, product=deck, representation=shape)
    model.write(str(path := tmp_path / "roof.ifc"))
    raw = raw_mesh(path)
    assert np.ptp(raw.V[:, 2]) == pytest.approx(0.2 + count)
    assert raw.record.surface_words == ("2 IfcSlab elements" if count else "1 IfcSlab element")
    assert raw.record.dropped == (() if count else ("1 IfcSlab element without faces",))


def test_a_mirrored_instance_keeps_its_upper_side(tmp_path):
    """Its triangles are turned, as in glTF and DXF files."""
    model, body, (storey, _) = ifc_model()
    roof = ifc_element(model, body, storey, "IfcRoof", "Roof", (ROOF.V, ROOF.F))
    origin = model.create_entity("IfcCartesianPoint", (0.0, 0.0, 0.0))
    shape = roof.Representation.Representations[0]
    source = model.create_entity("IfcRepresentationMap", model.create_entity("IfcAxis2Placement3D", origin), shape)
    x, y, z = (
        model.create_entity("IfcDirection", axis) for axis in ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    turned = model.create_entity("IfcCartesianTransformationOperator3D", x, y, origin, 1.0, z)
    item = model.create_entity("IfcMappedItem", source, turned)
    roof.Representation.Representations = [
        model.create_entity("IfcShapeRepresentation", body, "Body", "MappedRepresentation", [item])
    ]
    model.write(str(tmp_path / "mirrored.ifc"))
    raw = raw_mesh(tmp_path / "mirrored.ifc")
    mirrored = Surface(raw.V, raw.F)
    assert mirrored.V[:, 0].max() == pytest.approx(-ROOF.V[:, 0].min(), abs=1e-6)
    assert (mirrored.normals[:, 2] * np.sign(ROOF.normals[0, 2]) > 0.99).all()


def test_a_roof_in_survey_coordinates_is_the_same_roof(tmp_path):
    """The place, and in the second file the vertices, are far away; only digits beyond those of a double are lost."""
    here, placed = (roof_file(tmp_path / f"{k}.ifc", place) for k, place in enumerate(((0.0, 0.0, 0.0), FAR)))
    model, body, (top, _) = ifc_model(prefix="MILLI")
    ifc_element(model, body, top, "IfcRoof", "Roof", (ROOF.V + FAR, ROOF.F))
    model.write(str(drawn := tmp_path / "drawn.ifc"))
    near = read_surface(here)
    for path in (placed, drawn):
        surface = read_surface(path)
        assert np.array_equal(surface.F, near.F)
        assert_allclose(surface.V - FAR, near.V, rtol=0, atol=4e-9)


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4X3"])
def test_other_versions_of_ifc_are_read(schema, tmp_path):
    model, body, (top, _) = ifc_model(schema=schema)
    ifc_element(model, body, top, "IfcSlab", "Deck", slab())
    model.write(str(path := tmp_path / "roof.ifc"))
    assert read_surface(path).area == pytest.approx(2 * 4 * 3 + 14 * 0.2)


def test_the_ifc_files_of_dsfab_are_read(tmp_path):
    box = solid_box()
    path = write(box, tmp_path / "box.ifc")
    assert read_surface(path).area == pytest.approx(total_area(box.V, box.F))


def test_without_ifcopenshell_the_message_names_the_extra(tmp_path, monkeypatch):
    path = roof_file(tmp_path / "roof.ifc")
    monkeypatch.setattr(ifc.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        SurfaceError, match=r'files need the library ifcopenshell; install it with: pip install "dsfab\[ifc'
    ):
        raw_mesh(path)


@pytest.mark.parametrize("suffix", ["ifczip", "ifcxml", "dae", "fbx"])
def test_files_of_other_programs_need_another_export(suffix, tmp_path):
    with pytest.raises(SurfaceError, match=f"suffix '.{suffix}', which dsfab does not read; export the surface as"):
        raw_mesh(tmp_path / f"roof.{suffix}")


def test_an_unreadable_ifc_file_is_refused_in_one_sentence(tmp_path):
    path, bad = roof_file(tmp_path / "roof.ifc"), tmp_path / "bad.ifc"
    for data in (b"a roof", path.read_bytes()[:-30], b""):
        bad.write_bytes(data)
        with pytest.raises(SurfaceError, match=r"bad\.ifc (cannot be read as IFC \(the last line|is empty)"):
            raw_mesh(bad)
    bad.write_bytes(path.read_bytes().replace(b"FILE_SCHEMA(('IFC4'))", b"FILE_SCHEMA(('IFC9'))"))
    with pytest.raises(SurfaceError, match=r"bad\.ifc cannot be read as IFC \(the file is damaged, or has a version"):
        raw_mesh(bad)
    model, _, _ = ifc_model()
    model.create_entity("IfcBeam", GlobalId=ifcopenshell.guid.new())
    model.write(str(bad))
    with pytest.raises(SurfaceError, match="no element with faces; ignored: 1 IfcBeam element without a shape; export"):
        raw_mesh(bad)
