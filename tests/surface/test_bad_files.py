"""Files that are bad on purpose: a sentence, or the surface that the file says, in little time and memory."""

import logging
import resource
import time
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from dsfab.core.errors import SurfaceError
from dsfab.surface import read_surface, surface_in_file
from dsfab.surface.files import polygons as polygon_cuts
from dsfab.surface.files.obj_and_off import read_obj, read_off
from dsfab.surface.files.polygons import large_polygon_triangles, small_polygon_triangles
from dsfab.surface.files.reading import Budget
from tests.bad_meshes import (
    FORMATS,
    GOOD,
    BadFile,
    F,
    V,
    bombs,
    gltf,
    gltf_numbers,
    marked,
    obj,
    odd_faces,
    ply_text,
    polygons,
    trailing,
    written,
)
from tests.fuzz.oracles import as_trimesh_reads
from tests.hangs import ended_if_it_hangs

PYTHON = ("list index", "Error", "NoneType", "literal", "to unpack", "' object", "Traceback", "argument", "codec")
"""Words that no person should read."""


def outcome(path):
    """What was read and the record; or the sentence, in one line. It warns of nothing and does not hang."""
    with ended_if_it_hangs(), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = surface_in_file(path)
        except SurfaceError as error:
            text = str(error)
            assert path.name in text
            assert "\n" not in text
            assert not [word for word in PYTHON if word in text], text
            found = text
    return found


def same_surface(a, b):
    """The same triangles in space, to the digits of a file."""

    def corners(s):
        P = np.round(s.V[s.F], 5)
        return sorted(tuple(map(tuple, np.roll(p, -np.lexsort(p.T[::-1])[0], axis=0).tolist())) for p in P)

    return a.m == b.m and corners(a) == corners(b)


@pytest.mark.parametrize("name", FORMATS)
def test_the_good_file_of_each_format_is_read_without_a_word(name, tmp_path):
    found = outcome(written(BadFile(name, FORMATS[name](), len(F)), tmp_path))
    assert same_surface(found.surface, GOOD)
    assert found.record.remarks == ()
    thing = "faces" if name.endswith(("obj", "off", "ply")) else "triangles"
    assert found.record.read[0].endswith(f"{len(V)} vertices, {len(F)} {thing}")


def cases():
    yield from (*marked(), *trailing(), *odd_faces(), *bombs())


@pytest.mark.parametrize("file", [*cases()], ids=lambda file: file.name)
def test_a_bad_file_is_read_as_it_claims_or_refused(file, tmp_path):
    found = outcome(written(file, tmp_path))
    if file.faces is None:
        assert isinstance(found, str), found.record
        return
    assert not isinstance(found, str), found
    assert same_surface(found.surface, GOOD)
    assert any(file.says in remark for remark in found.record.remarks) if file.says else not found.record.remarks


def test_bombs_take_no_memory(tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for file in bombs():
        outcome(written(file, tmp_path))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000  # kilobytes


def cut_off(name, lengths, folder):
    """A file that ends too soon is never another surface in silence; only OBJ has lines after which nobody can know."""
    data = FORMATS[name]()
    for length in lengths:
        found = outcome(written(BadFile(name, data[:length], None), folder))
        if isinstance(found, str) or same_surface(found.surface, GOOD):
            continue
        whole_lines = name == "plain.obj" and b"\n" in data[length - 1 : length + 1]
        assert found.record.remarks or whole_lines, (length, found.surface.F)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_is_cut_off_is_never_another_surface_in_silence(name, tmp_path):
    size = len(FORMATS[name]())
    cut_off(name, {*range(1, size, size // 20), *range(size - 25, size)}, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_is_cut_off_at_any_byte_is_never_another_surface_in_silence(name, tmp_path):
    cut_off(name, range(1, len(FORMATS[name]())), tmp_path)


@pytest.mark.parametrize(
    ("name", "last", "cut"),
    [
        ("obj", "f 1 2 3", False),  # nothing has 30 or more vertices
        ("obj", "f 2 3 1", True),  # of 10 to 19
        ("obj", "f 2 3", True),
        ("obj", "f 4 3 2 1 5", True),
        ("obj", "f 3 4 5 9 8 7", False),
        ("obj", "f 1/1 2/1 3/3", False),
        ("obj", "f 1/1 2/1 3/2", True),
        ("obj", "f 1/1 2/1 3", True),
        ("obj", "f 1//1 2//1 3//", True),
        ("obj", "f 1//1 2//1 3//²", True),
        ("obj", f"f 1//1 2//1 3//{'9' * 5000}", False),
        ("obj", "v 0 0 0", True),
        ("obj", "# f 1 2", False),
        ("off", "3 1 2 3", False),
        ("off", "3 2 3 1", True),
        ("off", "3 2 3 1 255", False),
    ],
)
def test_a_truncated_last_line_is_reported(name, last, cut, tmp_path):
    points = [f"{x} {x * x} 0" for x in range(12)]
    if name == "off":
        text = "\n".join(["OFF", "12 1 0", *points, last])
    else:
        six = "f 1 2 3 4 5 6\n" * (len(last.split()) == 6)
        text = "\n".join([*(f"v {point}" for point in points), "vt 0 0\n" * 29 + "vn 0 0 1", six + last])
    read = read_obj if name == "obj" else read_off
    assert any("last line is incomplete" in one for one in read(text.encode(), Budget()).doubts) == cut
    assert not read(text.encode() + b"\n", Budget()).doubts


def test_gltf_takes_its_numbers_from_beside(tmp_path):
    (tmp_path / "of the roof.bin").write_bytes(gltf_numbers())
    path = written(BadFile("roof.gltf", gltf("of%20the%20roof.bin"), len(F)), tmp_path)
    assert same_surface(outcome(path).surface, GOOD)
    (tmp_path / "of the roof.bin").write_bytes(gltf_numbers()[:-1])
    assert "cut off" in outcome(path)


def test_a_mesh_over_the_limit_is_refused_before_reading(tmp_path):
    path = written(BadFile("plain.obj", obj(), len(F)), tmp_path)
    with pytest.raises(SurfaceError, match=r"has \d+ triangles, but 5 is the limit; .*--max-triangles"):
        read_surface(path, max_triangles=5)
    assert read_surface(path, max_triangles=len(F)).m == len(F)
    many = ply_text().replace(b"end_header", b"element foo 1000000000000\nproperty float a\nend_header")
    foo = written(BadFile("foo.ply", many, None), tmp_path)
    assert "has 1,000,000,000,000 records of the element 'foo', but 12,000,000 is the limit" in outcome(foo)
    sparse = tmp_path / "large.stl"
    with sparse.open("wb") as file:
        file.truncate(3 * 10**9)  # no byte of it is on the disk
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(SurfaceError, match=r"3,000,000,000 bytes, but 2,000,000,000 is the limit"):
        read_surface(sparse)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000  # kilobytes
    with pytest.raises(SurfaceError, match="took more than 240 s"):
        Budget(started=time.monotonic() - 241).require_time()


def test_halves_with_exact_twin_edges_are_joined(tmp_path):
    """Two boxes' halves meet in every free edge; two plates side by side do not."""
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    halves = np.concatenate([cube, cube]), np.concatenate([quads[:3], quads[3:] + 8])
    found = outcome(written(BadFile("cube.obj", obj(*halves), 12), tmp_path))
    assert (found.surface.n, found.surface.is_closed, found.surface.volume) == (8, True, pytest.approx(1))
    assert "merged with other vertices" in found.record.repaired[0]
    two = np.concatenate([V, V + [3, 0, 0]]), np.concatenate([F, F + len(V)])
    apart = outcome(written(BadFile("plates.obj", obj(*two), 2 * len(F)), tmp_path))
    assert (apart.surface.n, apart.record.repaired) == (2 * len(V), ())  # a joint may be meant: other edges are free
    soup = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    assert outcome(written(BadFile("soup.obj", obj(*soup), len(F)), tmp_path)).surface.n == len(V)


def test_a_line_goes_on_after_a_backslash_where_that_is_clear(tmp_path):
    """Found by the fuzzer: a number in two parts was two numbers, and a comment that ends with a path ate a vertex."""
    good = obj()
    for text in (good.replace(b" ", b" \\\n"), good.replace(b" ", b"\\\n "), b"# C:\\roofs\\\n" + good):
        found = outcome(written(BadFile("continued.obj", text, len(F)), tmp_path))
        assert same_surface(found.surface, GOOD)
        assert not found.record.remarks
    told = outcome(written(BadFile("divided.obj", b"# one\n" + good.replace(b"-0.5", b"-0.\\\n5"), None), tmp_path))
    assert "line 3 ends with a backslash, but the words" in told


def test_a_soup_is_joined_also_where_a_face_or_a_vertex_is_dropped(tmp_path):
    """Found by the fuzzer: what was read, written and read again was joined then."""
    soup = obj(V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3))
    for more in (b"f 99999\n", b"f 1 2\n", b"v nan nan nan\n"):
        found = outcome(written(BadFile("soup.obj", soup + more, len(F)), tmp_path))
        assert (found.surface.n, found.surface.m) == (len(V), len(F)), more
        assert len(found.record.remarks) >= 2 - (more[:1] == b"v")


@given(st.integers(13, 400), st.integers(0, 10**6), st.booleans(), st.sampled_from([12, 2000]))
@settings(max_examples=80, deadline=None, derandomize=True)
def test_large_polygons_keep_every_corner_their_area_and_their_edges(k, seed, straight, many):
    """In any plane: k - 2 triangles with area, each side of the outline on one of them, all other edges on two.

    many : corners above which they are Delaunay's and not earcut's.
    """
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, k))
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.4, 1, k)[:, None]
    if straight:  # corners in the middle of sides, off by what rounding makes
        t = rng.uniform(0.2, 0.8, k)[:, None]
        flat = np.stack([flat, (1 - t) * flat + t * np.roll(flat, -1, axis=0)], axis=1).reshape(-1, 2)
    tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    P = 5 + np.c_[flat, np.zeros(len(flat))] @ tilt.T
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(polygon_cuts, "MANY", many)
        T = large_polygon_triangles(P)
    if np.diff(np.r_[angle, angle[0] + 2 * np.pi]).max() >= np.pi:  # then the star does not see its own centre
        return
    assert T is not None
    sides = P[T[:, 1]] - P[T[:, 0]], P[T[:, 2]] - P[T[:, 0]]
    areas = np.linalg.norm(np.cross(*sides), axis=1) / 2
    x, y = flat.T
    assert areas.sum() == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)), rel=1e-9)
    assert areas.min() > 0
    edges = {tuple(edge) for edge in np.concatenate([T[:, [0, 1]], T[:, [1, 2]], T[:, [2, 0]]]).tolist()}
    assert len(edges) == 3 * len(T)
    outline = {(i, (i + 1) % len(P)) for i in range(len(P))}
    assert {(a, b) for a, b in edges if (b, a) not in edges} == outline


def test_a_comb_of_thousands_of_teeth_is_cut_and_one_with_a_bridge_to_a_hole(monkeypatch):
    """A bridge is two sides in one place: nothing that Delaunay's triangles take."""
    teeth = 1500
    comb = np.array([[0, 0], [teeth, 0], *((teeth - i / 2, 9.0 if i % 2 else 1.0) for i in range(2 * teeth + 1))])
    ring = np.array([[0, 0], [9, 0], [9, 9], [0, 9], [0, 0], [3, 3], [3, 6], [6, 6], [6, 3], [3, 3]])
    asked = []
    cut = polygon_cuts.earcut_triangles
    monkeypatch.setattr(polygon_cuts, "earcut_triangles", lambda flat: asked.append(1) or cut(flat))
    for flat, area, earcut in ((comb, teeth * 5.0, 0), (ring, 72.0, 1)):
        monkeypatch.setattr(polygon_cuts, "MANY", 8)
        T = large_polygon_triangles(np.c_[flat, np.zeros(len(flat))])
        assert T is not None
        assert len(T) == len(flat) - 2
        a, b, c = (flat[T[:, i]] for i in range(3))
        twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        assert twice.min() > 0
        assert twice.sum() / 2 == pytest.approx(area)
        assert len(asked) == earcut


def test_small_polygons_are_cut_alone_as_together():
    rng = np.random.default_rng(3)
    for k in range(5, 13):
        a = 2 * np.pi * (np.arange(k) + rng.uniform(-0.3, 0.3, (40, k))) / k
        r = rng.uniform(0.5, 2, (40, k))
        P = np.stack([r * np.cos(a), r * np.sin(a), rng.uniform(-0.2, 0.2, (40, k))], axis=2)
        alone = np.concatenate([small_polygon_triangles(one[None]) for one in P])
        assert_array_equal(small_polygon_triangles(P), alone)
        assert_allclose(np.sort(alone.reshape(40, -1), axis=1).min(axis=1), 0)


def test_a_polygon_that_crosses_itself_becomes_a_fan_with_a_note(tmp_path):
    a = 2 * np.pi * np.arange(40) / 40
    eight = np.stack([np.cos(a), np.sin(2 * a) * (1 + 0.3 * np.cos(a)), 0 * a], axis=1)
    assert large_polygon_triangles(eight) is None
    found = outcome(written(BadFile("eight.obj", obj(eight, [range(40)]), 38), tmp_path))
    told = found if isinstance(found, str) else found.record.remarks[0]
    assert "cross themselves" in told or "no area" in told


def test_polygons_of_many_corners_are_cut_in_no_time(tmp_path):
    for file, area in polygons((5, 12, 13, 200, 2001)):
        assert outcome(written(file, tmp_path)).surface.area == pytest.approx(area, rel=1e-6), file.name


@pytest.mark.slow
def test_a_hundred_thousand_corners_are_cut_without_ears(tmp_path, monkeypatch):
    """Delaunay's triangles take n log n steps. To cut ears takes up to n^2."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest, cut = [0], polygon_cuts.earcut_triangles

    def noted(flat):
        largest.append(len(flat))
        return cut(flat)

    monkeypatch.setattr(polygon_cuts, "earcut_triangles", noted)
    for file, area in polygons((20_000, 100_000), starry=False):
        assert outcome(written(file, tmp_path)).surface.area == pytest.approx(area, rel=1e-5), file.name
    assert max(largest) <= polygon_cuts.MANY
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000  # kilobytes


def triangles_in_space(V, T):
    return sorted(sorted(map(tuple, P.tolist())) for P in np.round(V[T], 4) + 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_any_bit_may_be_wrong(name, tmp_path):
    """Every seventh bit of each file, turned over: a sentence, a remark, or what the file now says to trimesh too."""
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    data, compared = bytearray(FORMATS[name]()), 0
    for bit in range(0, 8 * len(data), 7):
        data[bit // 8] ^= 1 << bit % 8
        path = written(BadFile(name, bytes(data), None), tmp_path)
        data[bit // 8] ^= 1 << bit % 8
        found = outcome(path)
        if isinstance(found, str) or found.record.remarks or (other := as_trimesh_reads(path)) is None:
            continue
        compared += 1
        assert triangles_in_space(found.surface.V, found.surface.F) == triangles_in_space(*other), bit
    assert compared > 20 or name == "plain.3mf"  # a check sum refuses these


def test_commas_in_numbers_are_named(tmp_path):
    """As programs write numbers that follow the language of the desk: 'export it again' alone does not help."""
    (tmp_path / "roof.obj").write_text("v 0 0 0\nv 1,5 0 0,25\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SurfaceError, match=r"line 2 .* numbers have decimal commas instead of decimal points"):
        read_surface(tmp_path / "roof.obj")
    (tmp_path / "roof.obj").write_text("v 0 0 0\nv 1 0 oops\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SurfaceError, match=r"line 2 cannot be read: 'v 1 0 oops'\)"):
        read_surface(tmp_path / "roof.obj")


@pytest.mark.parametrize(("corners", "by_earcut"), [(1200, True), (3000, False)])
def test_polygons_of_over_two_thousand_corners_are_cut_by_delaunay(corners, by_earcut, monkeypatch):
    """Earcut is faster for few corners and takes up to n^2 steps for many."""
    asked = []
    cut = polygon_cuts.earcut_triangles
    monkeypatch.setattr(polygon_cuts, "earcut_triangles", lambda flat: asked.append(1) or cut(flat))
    angle = 2 * np.pi * np.arange(corners) / corners
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1) * (2 + np.arange(corners)[:, None] % 2)
    assert len(large_polygon_triangles(np.c_[flat, 0 * angle])) == corners - 2
    assert bool(asked) == by_earcut


@pytest.mark.parametrize(("kilobytes", "is_read"), [(900, True), (1100, False)])
def test_the_header_of_a_ply_file_has_at_most_a_million_bytes(kilobytes, is_read, tmp_path):
    lines = 10 * kilobytes * (b"comment ".ljust(99, b".") + b"\n")
    file = BadFile("long.ply", ply_text().replace(b"end_header", lines + b"end_header"), None)
    found = outcome(written(file, tmp_path))
    assert isinstance(found, str) != is_read
