"""STEP as other programs see it: a product for each piece, colours, compressed files, triangles for viewers."""

import zipfile

import pytest

from dsfab.core.errors import ExportError
from dsfab.export import step_estimates, write
from dsfab.export.cad.step import file
from dsfab.export.cad.step.worker.shapes import step_facts
from tests.export.solid_pieces import three
from tests.export.solids import solid_box, solid_torus


def test_each_piece_is_a_product_with_a_name_and_a_colour(tmp_path, inspected):
    from build123d import import_step

    path = write(three(), tmp_path / "a.step", step="faceted", name="roof")
    found = import_step(path)
    names = sorted(child.label.replace("_", " ") for child in found.children)  # build123d puts _ for spaces
    assert names == ["roof 1", "roof 2", "roof 3"]
    assert len(found.solids()) == 3
    assert len({tuple(child.color) for child in found.children}) == 3
    text = path.read_text()
    assert "'1970-01-01T00:00:00',('dsfab')" in text
    assert import_step(write(solid_box(), tmp_path / "b.step", name="one")).label == "one"


def test_compressed_step_holds_the_same_file(tmp_path, inspected):
    plain, packed = (
        write(solid_torus(), tmp_path / f"a.{suffix}", step="faceted", name="a") for suffix in ("step", "stpz")
    )
    with zipfile.ZipFile(packed) as archive:
        assert archive.namelist() == ["a.stp"]
        assert archive.read("a.stp") == plain.read_bytes()
    assert packed.stat().st_size < 0.25 * plain.stat().st_size
    assert packed.read_bytes() == write(solid_torus(), tmp_path / "a.stpz", step="faceted", name="a").read_bytes()


def test_tessellated_step_holds_the_triangles_and_names_programs_that_cannot_read_it(tmp_path, inspected):
    said, solid = [], three()
    path = write(solid, tmp_path / "a.step", step="tessellated", note=said.append)
    found = step_facts(path)
    assert found["triangles"] == len(solid.F)
    assert found["volume"] == pytest.approx(solid.volume * 1e9, rel=1e-8)
    assert said == [
        "STEP is tessellated: only programs that know AP242 tessellated geometry open this file; FreeCAD 0.20 and "
                    "gmsh do not"]  # fmt: skip
    way = {one.way: one for one in step_estimates(solid, step="tessellated")}["tessellated"]
    assert way.chosen
    assert way.size == pytest.approx(path.stat().st_size, rel=0.25)


@pytest.mark.parametrize("finding", [{"triangles": 11, "volume": 3e6}, {"triangles": 12, "volume": 4e6}])
def test_triangles_that_read_back_different_are_refused(finding, tmp_path, monkeypatch):
    monkeypatch.setattr(file, "inspection", lambda part, path: {"triangles": 12, "volume": 3e6})
    write(solid_box(), tmp_path / "a.step", step="tessellated").unlink()
    monkeypatch.setattr(file, "inspection", lambda part, path: finding)
    with pytest.raises(ExportError):
        write(solid_box(), tmp_path / "a.step", step="tessellated")
    assert not any(tmp_path.iterdir())
