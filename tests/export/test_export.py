"""Export of meshes: other readers find the same thing in millimetres; a failure leaves nothing behind."""

import errno
import os
import re
import struct
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dsfab.core.errors import DsfabError, ExportError
from dsfab.export import FORMATS, Written, formats, write, writing
from dsfab.export.part import in_single_precision, open_edges, part_of
from dsfab.surface import Surface
from dsfab.thickening import Solid
from tests.export.solids import SIZE, needle, solid_box, solid_torus
from tests.shapes import grid, sphere

TRIMESH = (".stl", ".ply", ".obj", ".off", ".glb")


def loaded(path: Path) -> trimesh.Trimesh:
    """trimesh with vertices merged; a GLB is brought back to millimetres and z upwards."""
    mesh = trimesh.load_mesh(path)
    if path.suffix == ".glb":
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
        mesh.apply_scale(1000)
    return mesh


@pytest.mark.parametrize("suffix", TRIMESH)
@pytest.mark.parametrize("solid", [solid_box(corner=(1.0, -2.0, 0.5)), solid_torus()], ids=["box", "torus"])
def test_trimesh_finds_the_solid_in_millimetres(tmp_path, suffix, solid):
    mesh = loaded(write(solid, tmp_path / f"part{suffix}"))
    assert len(mesh.faces) == len(solid.F)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(solid.volume * 1e9, rel=1e-5)
    assert mesh.bounds == pytest.approx(solid.box * 1000, rel=1e-6, abs=1e-4)


def test_lib3mf_finds_the_solid_in_millimetres(tmp_path):
    import lib3mf

    solid = solid_box(corner=(1.0, -2.0, 0.5))
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(write(solid, tmp_path / "part.3mf", name="roof <1> & “2”")))
    meshes = model.GetMeshObjects()
    assert (reader.GetWarningCount(), meshes.Count(), model.GetBuildItems().Count()) == (0, 1, 1)
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    meshes.MoveNext()
    mesh = meshes.GetCurrentMeshObject()
    V = np.array([p.Coordinates[:] for p in mesh.GetVertices()])
    assert pytest.approx(solid.V * 1000, rel=1e-6) == V
    assert [t.Indices[:] for t in mesh.GetTriangleIndices()] == solid.F.tolist()
    assert mesh.IsManifoldAndOriented()
    assert mesh.GetName() == "roof <1> & “2”"


def test_units_are_written_where_the_format_has_room(tmp_path):
    heads = {suffix: write(solid_box(), tmp_path / f"a{suffix}").read_bytes()[:300] for suffix in TRIMESH}
    assert b"unit: millimetre" in heads[".stl"][:80]
    assert not heads[".stl"].startswith(b"solid")
    assert b"\ncomment unit: millimetre\n" in heads[".ply"]
    assert b"# unit: millimetre\n" in heads[".obj"]
    assert b"# unit: millimetre\n" in heads[".off"]
    assert b'"extras":{"unit":"metre"}' in heads[".glb"]


def test_stl_is_as_long_as_its_count_says_and_normals_face_outwards(tmp_path):
    data = write(solid_torus(), tmp_path / "a.stl").read_bytes()
    assert struct.unpack("<I", data[80:84])[0] == 576
    assert len(data) == 84 + 50 * 576
    normal, a, b, c = np.frombuffer(data[84 : 84 + 48], dtype="<f4").reshape(4, 3)
    assert normal @ np.cross(b - a, c - a) == pytest.approx(np.linalg.norm(np.cross(b - a, c - a)), rel=1e-5)


@pytest.mark.parametrize("suffix", [suffix for suffix, form in FORMATS.items() if isinstance(form, formats.MeshFormat)])
def test_the_same_solid_gives_the_same_bytes_on_another_day(tmp_path, monkeypatch, inspected, suffix):
    first = write(solid_torus(8, 6), tmp_path / f"a{suffix}").read_bytes()
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 86_400)
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(now + 86_400))
    (tmp_path / "b").mkdir()
    assert write(solid_torus(8, 6), tmp_path / "b" / f"a{suffix}").read_bytes() == first


@pytest.mark.parametrize("suffix", TRIMESH)
def test_an_open_sheet_keeps_its_area(tmp_path, suffix):
    mesh = loaded(write(grid(4, 3, 2.0, 1.5), tmp_path / f"sheet{suffix}"))
    assert mesh.area == pytest.approx(3e6, rel=1e-6)
    assert mesh.extents == pytest.approx([2000, 1500, 0], abs=1e-3)
    assert len(mesh.faces) == 24


@pytest.mark.parametrize("suffix", [".3mf", ".step", ".stp"])
def test_an_open_sheet_is_refused_by_formats_for_solids(tmp_path, suffix):
    with pytest.raises(ExportError, match=f"a {suffix} file needs a closed solid.* thicken the sheet first"):
        write(grid(2, 2, 1.0, 1.0), tmp_path / f"sheet{suffix}")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "said"), [("a.stepp", "did you mean .step?"), ("a.glt", "did you mean .glb?"), ("a", "no suffix")]
)
def test_an_unknown_suffix_names_the_nearest(tmp_path, name, said):
    with pytest.raises(ExportError) as caught:
        write(solid_box(), tmp_path / name)
    assert said in str(caught.value)
    assert ".stl, .3mf, .step" in str(caught.value)


def test_capitals_in_a_suffix_and_a_path_as_text_are_welcome(tmp_path):
    path = write(solid_box(), str(tmp_path / "PART.STL"))
    assert path == tmp_path / "PART.STL"
    assert trimesh.load_mesh(path).is_watertight


def broken_disk(failure: BaseException):
    """`open` for a disk that fails on the second piece written."""

    def opened(path, mode):
        file = open(path, mode)  # noqa: SIM115

        class Full:
            written = 0

            def __enter__(self):
                return self

            def __exit__(self, *_):
                file.close()

            def write(self, data):
                self.written += 1
                if self.written > 1:
                    raise failure
                return file.write(data[:10])

        return Full()

    return opened


@pytest.mark.parametrize("older", [b"older file", None])
@pytest.mark.parametrize(
    ("failure", "raised", "said"),
    [
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
            ExportError,
            "could not be written: the disk is full; free some space",
        ),
        (OSError(errno.EIO, os.strerror(errno.EIO)), ExportError, "choose another folder or name"),
        (KeyboardInterrupt(), KeyboardInterrupt, ""),
    ],
    ids=["full", "broken", "interrupt"],
)
def test_a_failed_write_leaves_the_folder_unchanged(tmp_path, monkeypatch, failure, raised, said, older):
    path = tmp_path / "part.stl"
    if older:
        path.write_bytes(older)
    monkeypatch.setattr(writing, "open", broken_disk(failure), raising=False)
    with pytest.raises(raised) as caught:
        write(solid_box(), path)
    assert said in str(caught.value)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == ([older] if older else [])


@pytest.mark.parametrize(
    ("suffix", "how", "holds"),
    [("stl", {}, "12 triangles, volume error"), ("step", {"step": "planar"}, "6 faces, volume error"),
     ("step", {"step": "tessellated"}, "12 triangles, volume error"), ("brep", {}, "6 faces, volume error")],
)  # fmt: skip
def test_the_report_gives_path_size_and_volume_error_of_each_file(tmp_path, inspected, suffix, how, holds):
    done: list[Written] = []
    path = write(solid_box(), tmp_path / f"a.{suffix}", report=done.append, **how)
    assert (done[0].path, done[0].size) == (path, path.stat().st_size)
    assert done[0].seconds > 0
    assert abs(done[0].found.off) < 1e-6
    said = rf"{suffix}: {path.stat().st_size / 1e6:.3g} MB, {holds} (0|\de-\d\d), [\d.]+ s"
    assert re.fullmatch(said, done[0].summary), done[0].summary


def test_a_failed_last_step_leaves_the_older_file(tmp_path, monkeypatch):
    path = tmp_path / "part.ply"
    path.write_bytes(b"older file")

    def refused(source, target):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(writing.os, "replace", refused)
    with pytest.raises(ExportError, match="no permission to write in this folder; choose another folder"):
        write(solid_box(), path)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"older file"]


def test_impossible_targets_are_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(formats, "write_chunks", lambda *_: pytest.fail("the work was begun"))
    (tmp_path / "folder.step").mkdir()
    for name, said in (
        ("folder.step", "a folder already has this name"),
        ("missing/a.step", "the folder does not exist"),
    ):
        with pytest.raises(ExportError, match=said):
            write(solid_box(), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.step"]


def test_impossible_targets_are_refused_in_a_sentence(tmp_path):
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "file").touch()
    before = sorted(tmp_path.rglob("*"))
    for path, said in [
        (tmp_path / "missing" / "a.stl", "the folder does not exist; create it first"),
        (tmp_path / "file" / "a.stl", "a file already has the name of this folder"),
        (tmp_path / "folder.stl", "a folder already has this name"),
    ]:
        with pytest.raises(ExportError, match=said) as caught:
            write(solid_box(), path)
        assert str(path) in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_the_file_behind_a_link_is_replaced_and_the_link_stays(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "a.stl").touch()
    (tmp_path / "link.stl").symlink_to(tmp_path / "real" / "a.stl")
    write(solid_box(), tmp_path / "link.stl")
    assert (tmp_path / "link.stl").is_symlink()
    assert (tmp_path / "real" / "a.stl").stat().st_size == 84 + 12 * 50


SPOILT = {
    "a triangle is missing": (lambda p: replace(p, F=p.F[1:]), "reads back with 11 triangles instead of 12"),
    "a triangle is turned": (lambda p: replace(p, F=np.r_[p.F[:1, ::-1], p.F[1:]]), "open at 3 edges"),
    "in metres": (lambda p: replace(p, V=p.V / 1000), "the bounding box"),
    "moved": (lambda p: replace(p, V=p.V + [5, 0, 0]), "differs by 5 mm when the file is read back"),
    "dented": (lambda p: replace(p, V=np.r_[p.V[:1] + 4, p.V[1:]]), "volume"),
}


@pytest.mark.parametrize("suffix", [".stl", ".3mf", ".ply", ".obj", ".off", ".glb"])
@pytest.mark.parametrize("fault", SPOILT)
def test_a_file_that_reads_back_differently_is_removed(tmp_path, monkeypatch, suffix, fault):
    spoil, said = SPOILT[fault]
    form = FORMATS[suffix]
    spoilt = replace(form, encode=lambda part: form.encode(spoil(part)))
    monkeypatch.setitem(FORMATS, suffix, spoilt)
    with pytest.raises(ExportError, match=r"read(s)? back|lib3mf") as caught:
        write(solid_box(), tmp_path / f"part{suffix}")
    assert said in str(caught.value)
    assert not any(tmp_path.iterdir())


def test_a_sheet_that_reads_back_torn_is_not_kept(tmp_path, monkeypatch):
    form = FORMATS[".ply"]

    def torn(part):
        F = part.F.copy()
        F[0, 0] = len(part.V)
        return form.encode(replace(part, V=np.r_[part.V, part.V[part.F[0, :1]]], F=F))

    monkeypatch.setitem(FORMATS, ".ply", replace(form, encode=torn))
    with pytest.raises(ExportError, match="reads back with 10 vertices instead of 9"):
        write(grid(2, 2, 1.0, 1.0), tmp_path / "sheet.ply")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("folder", ["files", "t\u00f4les"])
@pytest.mark.parametrize("suffix", [".stl", ".ply"])
@pytest.mark.parametrize("left", [None, 0, 80, -3])
def test_a_file_of_which_the_end_is_missing_is_not_kept(tmp_path, monkeypatch, suffix, left, folder):
    """libigl says nothing of a PLY file that ends within its last face; trimesh reads names beyond ASCII."""
    form, sheet, here = FORMATS[suffix], solid_box() if suffix == ".stl" else grid(2, 2, 1.0, 1.0), tmp_path / folder
    here.mkdir()
    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=lambda part: [b"".join(form.encode(part))[:left]]))
    if left is None:
        assert write(sheet, here / f"sheet{suffix}").exists()
        return
    with pytest.raises(ExportError):
        write(sheet, here / f"sheet{suffix}")
    assert not any(here.iterdir())


def test_vertices_that_rounding_makes_equal_are_merged_and_the_file_stays_closed(tmp_path):
    solid = needle(gap=1e-10, corner=5.0)
    assert open_edges(solid.F) == 0
    assert len(solid.F) == 14
    for suffix in (".stl", ".3mf", ".glb"):
        path = write(solid, tmp_path / f"a{suffix}")
        if suffix != ".3mf":
            mesh = trimesh.load_mesh(path, process=False)
            assert len(mesh.faces) == 12
            assert mesh.area_faces.min() > 0
    assert len(loaded(write(solid, tmp_path / "a.ply")).faces) == 14
    assert len(in_single_precision(part_of(needle(1e-3, 5.0), "a", 0)).F) == 14


def test_a_shape_that_rounding_destroys_is_refused(tmp_path):
    tiny = solid_box(size=SIZE * 1e-4, corner=(5000.0, 0.0, 0.0))
    for suffix in (".stl", ".3mf", ".glb"):
        with pytest.raises(
            ExportError, match=r"single precision, 8 vertices of .* coincide after rounding \(first: 0, 1, "
        ):
            write(tiny, tmp_path / f"a{suffix}")
    assert loaded(write(tiny, tmp_path / "a.ply")).volume == pytest.approx(tiny.volume * 1e9, rel=1e-3)


def test_solids_without_an_inside_are_refused(tmp_path):
    solid = solid_box()
    with pytest.raises(ExportError, match="'lid' is open at 3 edges"):
        write(Solid(solid.V, solid.F[1:], 0, 1), tmp_path / "lid.ply")
    with pytest.raises(ExportError, match="not positive"):
        write(Solid(solid.V, solid.F[:, ::-1], 0, 1), tmp_path / "a.ply")
    with pytest.raises(ExportError, match="has no faces"):
        write(Solid(solid.V, np.empty((0, 3), dtype=int), 0, 0), tmp_path / "a.ply")
    with pytest.raises(ExportError, match=r"'a' has coordinates that are not finite numbers at 1 vertex \(first: 7\)"):
        write(Solid(np.r_[solid.V[:7], [[np.nan, 0, 0]]], solid.F, 0, 1), tmp_path / "a.ply")
    assert issubclass(ExportError, DsfabError)


def test_solids_far_apart_that_touch_in_an_edge_can_be_stl(tmp_path):
    """Two boxes that share the line x = y = 1: STL has no indices, so four triangles meet there, and that is closed."""
    one, two = solid_box(size=np.ones(3)), solid_box(size=np.ones(3), corner=(1.0, 1.0, 0.0))
    both = Solid(np.r_[one.V, two.V], np.r_[one.F, two.F + 8], genus=0, pieces=2)
    assert trimesh.load_mesh(write(both, tmp_path / "a.stl")).volume == pytest.approx(2e9)


def test_a_closed_surface_is_a_sheet_too(tmp_path):
    ball = sphere(2)
    assert isinstance(ball, Surface)
    assert loaded(write(ball, tmp_path / "a.obj")).volume == pytest.approx(ball.volume * 1e9, rel=1e-6)
