"""Mesh files: round trips through trimesh and lib3mf, bad files each with its sentence, facts about any mesh."""

import os
import struct
import warnings
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from dsfab.core.errors import SurfaceError
from dsfab.surface import Surface, describe, read_surface
from dsfab.surface.files.polygons import polygons, triangles
from dsfab.surface.files.reader import flip_remark
from dsfab.surface.shapes import cylinder, dome, plate, sphere
from dsfab.surface.topology import manifold_faults
from tests.surface.named_files import own_locale

MESHES = Path(os.environ.get("DSFAB_MESHES", Path(__file__).parents[3] / "shared" / "meshes"))
real = pytest.mark.skipif(not MESHES.is_dir(), reason="no folder of real meshes; set DSFAB_MESHES")

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY_HEAD = """ply
format {} 1.0
comment quads and triangles
element vertex 5
property float x
property float y
property float z
property uchar red
element face {}
property list uchar int vertex_indices
end_header
"""
FIVE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]])


def obj(tmp_path, text, name="mesh.obj"):
    path = tmp_path / name
    path.write_text(text)
    return path


def as_obj(tmp_path, V, F):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(V).tolist()]
    return obj(tmp_path, "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (np.asarray(F) + 1).tolist()]))


def saved(surface, tmp_path, suffix):
    path = tmp_path / f"mesh.{suffix}"
    trimesh.Trimesh(surface.V, surface.F, process=False).export(path)
    return path


def same_triangles(a, b, atol):
    """The same triangles in space, whatever the order of vertices and faces."""

    def corners(s):
        P = np.round(s.V[s.F] / atol) * atol
        first = np.lexsort(P.transpose(2, 0, 1)[::-1], axis=-1)[:, 0]
        P = P[np.arange(s.m)[:, None], (first[:, None] + np.arange(3)) % 3].reshape(s.m, 9)
        return P[np.lexsort(P.T[::-1])]

    assert a.m == b.m
    assert_allclose(corners(a), corners(b), atol=2 * atol)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off"])
@pytest.mark.parametrize("make", [sphere, dome, cylinder])
def test_meshes_that_trimesh_writes_read_back_equal(make, suffix, tmp_path):
    surface = make(edge=0.7)
    read = read_surface(saved(surface, tmp_path, suffix))
    assert read.n == surface.n
    same_triangles(read, surface, 1e-5)
    assert manifold_faults(read.F, read.edges, read.n) == ()


def test_glb_is_metres_with_y_up_and_becomes_z_up(tmp_path):
    surface = dome(edge=0.7)
    y_up = Surface(surface.V[:, [0, 2, 1]] * [1, 1, -1], surface.F)
    path = saved(y_up, tmp_path, "glb")
    read = read_surface(path)
    assert read.n == surface.n
    same_triangles(read, surface, 1e-5)
    assert not np.signbit(read.V[read.V == 0]).any()  # files that are written of it have no -0
    assert describe(path).unit == "m"
    assert read_surface(path, unit="mm").size == pytest.approx(read.size / 1000)


@pytest.fixture(name="own_locale")
def restored_locale():
    with own_locale():
        yield


@pytest.mark.usefixtures("own_locale")
@pytest.mark.parametrize(
    ("unit", "metres"), [("MilliMeter", 1e-3), ("Inch", 0.0254), ("MicroMeter", 1e-6), ("Meter", 1)]
)
def test_3mf_knows_its_unit_and_places_its_objects(unit, metres, tmp_path):
    surface = sphere(edge=0.8)
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(getattr(lib3mf.ModelUnit, unit))
    mesh = model.AddMeshObject()
    vertices, faces = [], []
    for x in surface.V:
        vertices.append(lib3mf.Position())
        vertices[-1].Coordinates[:] = [float(c) for c in x]
    for f in surface.F:
        faces.append(lib3mf.Triangle())
        faces[-1].Indices[:] = [int(i) for i in f]
    mesh.SetGeometry(vertices, faces)
    model.AddBuildItem(mesh, wrapper.GetTranslationTransform(0, 0, 0))
    model.AddBuildItem(mesh, wrapper.GetTranslationTransform(10, 0, 0))
    path = tmp_path / "two.3mf"
    model.QueryWriter("3mf").WriteToFile(str(path))
    read = read_surface(path)
    assert (read.n, read.m) == (2 * surface.n, 2 * surface.m)
    assert_allclose(np.ptp(read.V, axis=0), metres * (np.ptp(surface.V, axis=0) + np.array([10, 0, 0])), rtol=1e-5)
    assert describe(path).pieces == 2
    assert read_surface(path, unit="m").size == pytest.approx(read.size / metres)


@pytest.mark.parametrize(("unit", "metres"), [(None, 1), ("m", 1), ("mm", 1e-3), ("ft", 0.3048)])
def test_the_unit_scales_to_metres(unit, metres, tmp_path):
    path = obj(tmp_path, TRIANGLE + "f 1 2 3\n")
    assert read_surface(path, unit=unit).area == pytest.approx(metres**2 / 2)


def test_an_unknown_unit_is_refused(tmp_path):
    with pytest.raises(SurfaceError, match="unit = 'furlong' is not known"):
        read_surface(obj(tmp_path, TRIANGLE + "f 1 2 3\n"), unit="furlong")


def test_obj_corners_may_be_negative_textured_continued_and_commented(tmp_path):
    text = "# c\no thing\nv 0 0 0 1.0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1\n"
    text += "v 0 1 0\nl 1 2\nf -4 -2 \\\n -1 # two\n"
    s = read_surface(obj(tmp_path, text))
    assert_array_equal(s.F, [[0, 1, 2], [0, 2, 3]])
    assert s.area == pytest.approx(1)


def test_vertices_without_faces_are_dropped_even_bad_ones(tmp_path):
    s = read_surface(obj(tmp_path, "v nan 0 0\n" + TRIANGLE + "v 9 9 9\nf 2 3 4\n"))
    assert s.n == 3
    assert s.size == pytest.approx(np.sqrt(2))


def test_quads_are_cut_along_the_shorter_diagonal(tmp_path):
    text = "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 1 0\nf 1 2 3 4\n"  # diagonals 1-3: sqrt 10, 2-4: sqrt 2
    s = read_surface(obj(tmp_path, text))
    assert np.isin([1, 3], s.F[0]).all()
    assert np.isin([1, 3], s.F[1]).all()
    assert s.area == pytest.approx(2)
    rolled = read_surface(obj(tmp_path, text.replace("f 1 2 3 4", "f 2 3 4 1")))
    assert {tuple(sorted(f)) for f in rolled.F.tolist()} == {tuple(sorted(f)) for f in s.F.tolist()}


def test_an_arrow_shaped_quad_is_cut_inside(tmp_path):
    text = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nf 1 2 3 4\n"  # the dent is at vertex 3; 2-4 runs outside
    s = read_surface(obj(tmp_path, text))
    assert s.area == pytest.approx(4)
    assert_allclose(s.normals, [[0, 0, 1]] * 2)


def test_a_dented_quad_is_cut_inside_even_if_the_other_diagonal_is_shorter(tmp_path):
    s = read_surface(obj(tmp_path, "v -6 0 0\nv 0 -1 0\nv -1 0 0\nv 0 1 0\nf 1 2 3 4\n"))
    assert s.area == pytest.approx(5)
    assert_allclose(s.normals, [[0, 0, 1]] * 2)


def test_an_ear_with_a_corner_inside_is_not_clipped():
    V = [[0, 0, 0], [2, 0, 0], [9, 0.5, 0], [9, 2, 0], [0.9, 0.9, 0], [2, 9, 0], [0.5, 9, 0], [0, 2, 0]]
    F = triangles(polygons(V, [list(range(8))])).F
    x, y, _ = np.array(V).T
    assert Surface(V, F).area == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@given(st.integers(5, 12), st.integers(0, 10_000))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_star_shaped_polygons_keep_their_area_and_orientation(k, seed):
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(k) + rng.uniform(-0.3, 0.3, k)) / k
    r = rng.uniform(0.5, 2, k)
    V = np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], axis=1)
    cut = triangles(polygons(V.tolist(), [list(range(k))]))
    F, owner = cut.F, cut.owner
    x, y = V[:, 0], V[:, 1]
    s = Surface(V, F)
    assert len(owner) == k - 2
    assert s.area == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert (s.normals[:, 2] > 0).all()


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
@pytest.mark.parametrize(
    ("faces", "area"),
    [
        ([[0, 1, 2, 3], [1, 4, 2]], 1.5),
        ([[1, 4, 2], [0, 1, 2, 3]], 1.5),
        ([[0, 1, 2], [0, 2, 3]], 1.0),
        ([[0, 1, 2, 3]], 1.0),
    ],
)
def test_ply_of_every_kind_is_read(order, faces, area, tmp_path):
    kind = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = PLY_HEAD.format(kind, len(faces)).encode()
    if order == "ascii":
        rows = [f"{x} {y} {z} 7" for x, y, z in FIVE] + [" ".join(map(str, [len(f), *f])) for f in faces]
        body = "\n".join(rows).encode() + b"\n"
    else:
        body = b"".join(struct.pack(order + "3fB", *x, 7) for x in FIVE)
        body += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
    path = tmp_path / "mesh.ply"
    path.write_bytes(head + body)
    s = read_surface(path)
    assert s.area == pytest.approx(area)
    assert s.m == sum(len(f) - 2 for f in faces)
    assert (s.normals[:, 2] > 0).all()


def test_off_with_colours_comments_and_polygons_is_read(tmp_path):
    text = "COFF # colours\n\n5 2 0\n" + "\n".join(f"{x} {y} {z} 1 0 0 1" for x, y, z in FIVE)
    path = obj(tmp_path, text + "\n4 0 1 2 3 255 0 0\n3 1 4 2\n", "mesh.off")
    assert read_surface(path).area == pytest.approx(1.5)
    same_line = obj(tmp_path, "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "line.off")
    assert read_surface(same_line).area == pytest.approx(0.5)


def test_stl_corners_are_merged_exactly_and_only_exactly(tmp_path):
    path = saved(plate(edge=1.0), tmp_path, "stl")
    assert read_surface(path).n == plate(edge=1.0).n
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1e-6, 0, 0], [0, -1, 0], [1, 0, 0]])
    path = saved(Surface(V, [[0, 1, 2], [3, 4, 5]]), tmp_path, "stl")
    assert read_surface(path).n == 5


def test_a_closed_surface_inside_out_with_stray_faces_ends_outward(tmp_path):
    good = sphere(edge=0.6)
    F = good.F[:, ::-1].copy()
    F[5:25] = F[5:25, ::-1]
    read = read_surface(as_obj(tmp_path, good.V, F))
    assert manifold_faults(read.F, read.edges, read.n) == ()
    assert read.volume == pytest.approx(good.volume)


def test_an_inside_out_mesh_is_not_reported_as_inconsistent():
    good = sphere(edge=0.8)
    some = np.concatenate([good.F[:3, ::-1], good.F[3:]])
    assert flip_remark(good.F[:, ::-1], good.F) == (
        f"{good.m} faces of {good.m} turned over, so that they face outward",
    )
    assert flip_remark(some, good.F) == (f"3 faces of {good.m} turned over, so that neighbours are oriented alike",)
    assert flip_remark(good.F, good.F) == ()


def test_closed_pieces_that_are_inside_out_are_turned_each_for_itself(tmp_path):
    ball, tube = sphere(edge=0.8), cylinder(edge=1.0)
    V = np.concatenate([ball.V, ball.V + np.array([9, 0, 0]), tube.V + np.array([20, 0, 0])])
    F = np.concatenate([ball.F[:, ::-1], ball.F + ball.n, tube.F[:, ::-1] + 2 * ball.n])
    read = read_surface(as_obj(tmp_path, V, F))
    for k, centre in enumerate(([0, 0, 0], [9, 0, 0])):
        mine = slice(k * ball.m, (k + 1) * ball.m)
        assert (np.einsum("ma,ma->m", read.normals[mine], read.centroids[mine] - centre) > 0).all()
    # an open tube has no outside: it stays as it is
    assert_array_equal(read.F[2 * ball.m :], F[2 * ball.m :])


BAD = {
    "no faces": ("mesh.obj", TRIANGLE, "has 3 vertices and no faces"),
    "garbage obj": ("mesh.obj", "hello\nworld\n", "has 0 vertices and no faces"),
    "obj number": ("mesh.obj", "v 0 0 zero\n", r"line 1 cannot be read: 'v 0 0 zero'"),
    "obj short vertex": ("mesh.obj", "v 0 0\n", "line 1 cannot be read"),
    "obj far index": ("mesh.obj", TRIANGLE + "f 1 2 7\n", "1 face names vertices outside the file's 3 vertices"),
    "obj semicolon": (
        "mesh.obj",
        TRIANGLE.replace("v ", "v;", 1) + "f 1 2 3\n",
        r"outside .* of unknown kind \(first: line 1: 'v;",
    ),
    "lines alone": ("mesh.obj", TRIANGLE + "l 1 2 3\n", "no faces; ignored: 1 line; give"),
    "obj index zero": ("mesh.obj", TRIANGLE + "f 0 1 2\n", "1 face names vertices outside"),
    "nan": ("mesh.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 of 3 vertices are not finite"),
    "infinite": ("mesh.obj", "v 1e999 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 of 3 vertices are not finite"),
    "collapsed": ("mesh.obj", TRIANGLE + "v 2 0 0\nf 1 2 3\nf 1 2 4\n", r"1 of 2 faces have no area \(first: 1\)"),
    "repeated corner": ("mesh.obj", TRIANGLE + "f 1 2 3\nf 1 2 2\n", "1 of 2 faces have no area"),
    "twice": ("mesh.obj", TRIANGLE + "f 1 2 3\nf 3 1 2\n", r"repeats an earlier face \(first: 1; the mesh has 2"),
    "turned twice": ("mesh.obj", TRIANGLE + "f 1 2 3\nf 3 2 1\n", "1 face repeats an earlier face"),
    "three at an edge": (
        "mesh.obj",
        TRIANGLE + "v 0 -1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n",
        r"1 edge has more than two faces \(first: 0-1\)",
    ),
    "not off": ("mesh.off", "3 1 0\n0 0 0\n", "cannot be read as OFF .*the first word of the file is not OFF"),
    "short off": ("mesh.off", "OFF\n3 1 0\n0 0 0\n", "the file announces 3 vertices, but has only 1"),
    "empty off": ("mesh.off", "OFF\n", "cannot be read as OFF"),
    "not ply": ("mesh.ply", "solid\n", "cannot be read as PLY .*no PLY header"),
    "odd ply": ("mesh.ply", PLY_HEAD.format("ebcdic", 1), "the format 'ebcdic' in the file's header is not"),
    "short ply": (
        "mesh.ply",
        PLY_HEAD.format("ascii", 1) + "0 0 0 7\n1 0\n",
        "ends before the last of the 5 records of the element 'vertex'",
    ),
    "ply word": ("mesh.ply", PLY_HEAD.format("ascii", 1) + "0 0 zero 7\n", "'vertex' has a word that is not a number"),
    "cut ply": ("mesh.ply", PLY_HEAD.format("binary_little_endian", 1) + "abc", "cannot be read as PLY"),
    "garbage stl": ("mesh.stl", "this is no mesh at all, really not" * 9, "mesh.stl"),
    "garbage glb": ("mesh.glb", "abcdefgh", "the file has no glTF header"),
    "cut glb": ("mesh.glb", "glTF\x02\x00\x00\x00\x10", "cannot be read as GLB"),
    "garbage 3mf": ("mesh.3mf", "no zip here", "cannot be read as 3MF"),
    "empty file": ("mesh.stl", "", "is empty"),
    "unknown suffix": ("mesh.oj", "x", r"suffix '.oj', which dsfab does not read; did you mean .obj\?"),
    "far suffix": ("mesh.docx", "x", "use one of .obj, .ply, .stl, .off, .glb, .gltf, .3mf"),
    "no suffix": ("mesh", "x", "suffix '', which"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_in_one_sentence_with_its_name(case, tmp_path, capfd):
    name, text, says = BAD[case]
    path = obj(tmp_path, text, name)
    with pytest.raises(SurfaceError, match=says) as refusal:
        read_surface(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.__cause__ is None
    assert capfd.readouterr() == ("", "")


def test_a_foreign_reader_is_silent_and_its_words_reach_nobody(tmp_path, monkeypatch, caplog):
    def loud(*args, **kwargs):
        warnings.warn("noise", stacklevel=1)
        raise IndexError("list index out of range")

    monkeypatch.setattr("dsfab.surface.files.mesh_files.read_stl", loud)
    with pytest.raises(
        SurfaceError, match=r"cannot be read as STL \(the file is damaged, or its kind .*\); export the file again"
    ):
        read_surface(obj(tmp_path, "solid\n", "mesh.stl"))
    assert "noise" not in caplog.text


def test_missing_files_and_folders_are_refused(tmp_path):
    obj(tmp_path, TRIANGLE, "vault.obj")
    with pytest.raises(SurfaceError, match=r"does not exist; did you mean vault.obj\?"):
        read_surface(tmp_path / "valt.obj")
    with pytest.raises(SurfaceError, match="does not exist; check the path"):
        read_surface(tmp_path / "none" / "mesh.obj")
    with pytest.raises(SurfaceError, match="is a folder"):
        read_surface(tmp_path)


@pytest.mark.parametrize("suffix", ["stl", "glb", "ply"])
def test_binary_files_cut_off_anywhere_are_refused_or_read(suffix, tmp_path, capfd):
    data = saved(sphere(edge=1.5), tmp_path, suffix).read_bytes()
    path = tmp_path / f"cut.{suffix}"
    for length in np.linspace(1, len(data) - 1, 23).astype(int):
        path.write_bytes(data[:length])
        with pytest.raises(SurfaceError, match=r"cut\." + suffix):
            read_surface(path)
    assert capfd.readouterr() == ("", "")


@given(st.binary(min_size=1, max_size=200), st.sampled_from(["obj", "ply", "stl", "off", "glb"]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_noise_is_never_a_traceback_of_another_library(tmp_path_factory, data, suffix):
    path = tmp_path_factory.mktemp("noise") / f"mesh.{suffix}"
    path.write_bytes(data)
    with pytest.raises(SurfaceError):
        read_surface(path)


def test_facts_of_a_good_closed_mesh(tmp_path):
    ball = sphere(radius=15.0, edge=4.0)
    facts = describe(as_obj(tmp_path, ball.V, ball.F))
    assert facts.manifold
    assert facts.closed
    assert (facts.vertices, facts.faces, facts.polygons, facts.pieces) == (ball.n, ball.m, ball.m, 1)
    assert (facts.euler, facts.genus, facts.boundary_loops) == (2, 0, 0)
    assert facts.volume == pytest.approx(ball.volume)
    assert facts.area == pytest.approx(ball.area)
    assert facts.mean_edge == pytest.approx(ball.mean_edge)
    assert facts.box[2] == pytest.approx(30)
    assert facts.low[2] == pytest.approx(-15)
    assert 50 < facts.smallest_angle < 60
    assert (facts.unit, facts.unit_guess, facts.unit_said) == ("m", "m", False)
    in_mm = describe(as_obj(tmp_path, 1000 * ball.V, ball.F), unit="mm")
    assert in_mm.unit_guess == "mm"
    assert in_mm.box[2] == pytest.approx(30)


def test_facts_of_an_open_mesh_tell_its_loops(tmp_path):
    tube = cylinder(radius=1.0, height=2.0, edge=0.2)
    F = tube.F.copy()
    F[3] = F[3, ::-1]
    facts = describe(as_obj(tmp_path, tube.V, F))
    assert facts.boundary_lengths == pytest.approx([2 * np.pi] * 2, rel=1e-2)
    assert facts.misoriented_edges == 3 - tube.edges.boundary[tube.edges.of[3]].sum()
    assert not facts.manifold
    assert facts.genus is None
    assert facts.volume is None
    assert describe(as_obj(tmp_path, tube.V, tube.F)).genus == 0


def test_the_facts_of_a_refused_mesh_are_available(tmp_path):
    text = TRIANGLE + "v 0 -1 0\nv 0 0 1\nv nan 0 0\nv 5 5 5\nv 6 5 5\n"
    text += "f 1 2 3\nf 2 1 4\nf 1 2 5\nf 1 2 5\nf 1 3 6\nf 1 2 2\nf 5 7 8\n"
    path = obj(tmp_path, text)
    facts = describe(path)
    with pytest.raises(SurfaceError):
        read_surface(path)
    assert facts.faces == 7
    assert facts.nonfinite_vertices == 1
    assert facts.duplicate_faces == 1
    assert facts.degenerate_faces == 1
    assert facts.non_manifold_edges >= 1
    assert not facts.closed
    assert facts.volume is None
    assert any("more than two faces" in fault for fault in facts.faults)
    assert facts.smallest_angle > 0
    with pytest.raises(SurfaceError, match="no face has three finite corners"):
        describe(obj(tmp_path, "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"))


def test_facts_count_pinches_and_pieces(tmp_path):
    facts = describe(obj(tmp_path, TRIANGLE + "v -1 0 0\nv 0 -1 0\nf 1 2 3\nf 1 4 5\n"))
    assert (facts.pinches, facts.pieces, facts.boundary_loops) == (1, 2, 2)
    assert "parts touch in a point at 1 vertex" in facts.faults[0]


REAL = {  # vertices, triangles, polygons, loops, genus: the table beside the meshes
    "bob": (5344, 10688, 10688, 0, 1),
    "spot": (2930, 5856, 5856, 0, 0),
    "torus": (2304, 4608, 4608, 0, 1),
    "barrel_vault": (441, 800, 400, 1, 0),
    "hypar": (81, 128, 64, 1, 0),
    "shell_tube": (200, 342, 171, 1, 0),
    "roof_with_opening": (309, 563, 563, 2, 0),
    "BubbleShell": (1530, 2861, 2861, 5, 0),
    "camelhead": (11381, 22704, 22704, 1, 0),
    "halftunnel": (831, 1568, 784, 3, 0),
}


@real
@pytest.mark.parametrize("name", REAL)
def test_real_meshes_read_with_their_known_numbers(name):
    facts = describe(MESHES / f"{name}.obj")
    assert (facts.vertices, facts.faces, facts.polygons, facts.boundary_loops, facts.genus) == REAL[name]
    assert facts.manifold
    surface = read_surface(MESHES / f"{name}.obj")
    assert surface.area == pytest.approx(facts.area)


@real
@pytest.mark.parametrize("name", ["hypar", "canopy_quad", "shell_tube", "halftunnel"])
def test_no_quad_of_a_real_mesh_is_cut_along_its_longer_diagonal(name):
    path = MESHES / f"{name}.obj"
    V = np.array([line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")], dtype=float)
    lines = [line.split()[1:] for line in path.read_text().splitlines() if line.startswith("f ")]
    Q = np.array([[int(c.split("/")[0]) - 1 for c in q] for q in lines if len(q) == 4])
    surface = read_surface(path)
    edges = {tuple(e) for e in surface.edges.ends.tolist()}
    assert surface.n == len(V)
    for q in Q:
        one, two = (np.linalg.norm(V[q[i]] - V[q[i + 2]]) for i in (0, 1))
        cut = tuple(sorted(q[[0, 2]])) in edges
        if abs(one - two) > 1e-3 * one:
            assert cut == (one < two)
