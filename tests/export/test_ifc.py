"""IFC4: ifcopenshell finds valid elements with their triangles, material, thickness and mass, in millimetres."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export import FORMATS, Details, write
from dsfab.export.cad import ifc
from tests.export.ifc_files import amounts, faults, ifcopenshell
from tests.export.solid_pieces import three
from tests.export.solids import solid_box, solid_torus

STEEL = Details(measures={"thickness": 0.05, "density": 7850.0, "young": 210e9, "poisson": 0.3}, material="S235")


def test_a_file_of_three_pieces_is_valid_and_measured(tmp_path):
    solid = three()
    path = write(solid, tmp_path / "a.ifc", name="roof “2”", details=STEEL)
    assert faults(path) == []
    model = ifcopenshell.open(str(path))
    elements = model.by_type("IfcPlate")
    assert model.schema == "IFC4"
    assert not model.by_type("IfcBuildingElementProxy")
    (roof,) = model.by_type("IfcRoof")
    assert set(roof.IsDecomposedBy[0].RelatedObjects) == set(elements)
    assert roof.ContainedInStructure[0].RelatingStructure.Name == "Building"
    assert not any(one.ContainedInStructure for one in elements)  # the whole is there, its parts are in the whole
    assert {one.ObjectPlacement.PlacementRelTo for one in elements} == {roof.ObjectPlacement}
    assert [one.Name for one in elements] == ["roof “2” 1", "roof “2” 2", "roof “2” 3"]
    assert sum(amounts(one)["NetVolume"] for one in elements) == pytest.approx(solid.volume)
    assert sum(amounts(one)["NetWeight"] for one in elements) == pytest.approx(solid.volume * 7850)
    assert {amounts(one)["Thickness"] for one in elements} == {50.0}
    assert {amounts(one)["Width"] for one in elements} == {50.0}
    assert {one.HasAssociations[0].RelatingMaterial.Name for one in elements} == {"S235"}
    told = {one.Name: one.NominalValue.wrappedValue for one in model.by_type("IfcPropertySingleValue")}
    assert told == {"MassDensity": 7850.0, "YoungModulus": 210e9, "PoissonRatio": 0.3, "Thickness": 50.0}
    assert len({one.GlobalId for one in model.by_type("IfcRoot")}) == len(model.by_type("IfcRoot"))


def test_the_geometry_kernel_of_ifcopenshell_places_the_box_correctly(tmp_path):
    geom = pytest.importorskip("ifcopenshell.geom")
    model = ifcopenshell.open(
        str(write(solid_box(corner=(1.0, -2.0, 0.5)), tmp_path / "a.ifc"))
    )  # keep it: elements do not
    shape = geom.create_shape(geom.settings(), model.by_type("IfcPlate")[0])
    points = np.array(shape.geometry.verts).reshape(-1, 3)  # metres
    assert points.min(axis=0) == pytest.approx([1.0, -2.0, 0.5])
    assert points.max(axis=0) == pytest.approx([1.2, -1.7, 0.55])


def test_a_survey_finds_the_site(tmp_path):
    """Coordinates are about an origin of their own; the file says where that is, east, north and up."""
    from ifcopenshell.util.geolocation import auto_xyz2enh

    site = (452_341.0, 5_567_120.0, 212.5)
    path = write(solid_box(), tmp_path / "a.ifc", details=replace(STEEL, origin=site))
    assert faults(path) == []
    model = ifcopenshell.open(str(path))
    assert auto_xyz2enh(model, 1500.0, -250.0, 2000.0) == pytest.approx((452_342.5, 5_567_119.75, 214.5), abs=1e-6)
    here = ifcopenshell.open(str(write(solid_box(), tmp_path / "b.ifc", details=STEEL)))
    assert not here.by_type("IfcCoordinateOperation")


def test_unknown_quantities_are_omitted(tmp_path):
    model = ifcopenshell.open(str(write(solid_box(), tmp_path / "a.ifc")))
    assert not model.by_type("IfcMaterial")
    assert set(amounts(model.by_type("IfcPlate")[0])) == {"NetVolume", "NetSurfaceArea"}


def test_the_same_solid_gives_the_same_bytes(tmp_path):
    one, two = (write(solid_torus(), tmp_path / f"{k}.ifc", name="a", details=STEEL).read_bytes() for k in "ab")
    assert one == two


@pytest.mark.parametrize(
    ("old", "new"),
    [(b".MILLI.", b"$"), (b"(200.,", b"(900.,"), (b"IFCTRIANGULATEDFACESET", b"IFCTRIANGLES")],
    ids=["metres", "dented", "no faces"],
)
def test_a_spoilt_file_is_not_kept(old, new, tmp_path, monkeypatch):
    form = FORMATS[".ifc"]
    spoilt = replace(form, encode=lambda part: (chunk.replace(old, new) for chunk in form.encode(part)))
    monkeypatch.setitem(FORMATS, ".ifc", spoilt)
    with pytest.raises(ExportError):
        write(solid_box(), tmp_path / "a.ifc")
    assert not any(tmp_path.iterdir())


def test_without_ifcopenshell_the_error_names_the_package_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(ifc.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ExportError, match=r'pip install "dsfab\[ifc\]"'):
        write(solid_box(), tmp_path / "a.ifc")
