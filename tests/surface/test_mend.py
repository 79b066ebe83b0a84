"""Small faults of meshes: what mending takes away, what it leaves as it is, and the pickers that hold on any mesh."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from dsfab.core.arrays import distances_from_segments
from dsfab.core.errors import SurfaceError
from dsfab.preset.file import load_preset
from dsfab.surface import (
    Ball,
    Box,
    Nearest,
    Side,
    Surface,
    mended_mesh,
    nearest_places,
    parallel_remarks,
    read_surface,
    topology,
)
from dsfab.surface.clean import seams
from dsfab.surface.clean.overlaps import single_sheets
from dsfab.surface.clean.repair import WELD
from dsfab.surface.clean.seams import SAG, merged_vertices, near_vertices
from dsfab.surface.files.reader import describe
from dsfab.surface.mesh import signed_volume
from dsfab.surface.shapes import dome, plate, sphere
from dsfab.surface.topology import boundary_loops, edge_table, manifold_faults, pieces, pinches
from tests.own_meshes import figure, gyroid, voronoi_shell
from tests.shapes import grid

ROOF = dome(edge=0.9)
PLATE = plate(edge=0.3)
HYPAR = Surface(PLATE.V + np.outer(PLATE.V[:, 0] * PLATE.V[:, 1] / PLATE.size, [0, 0, 1]), PLATE.F)


def area(V, F):
    return float(np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1).sum() / 2)


@pytest.mark.parametrize("surface", [ROOF, plate(edge=0.4), sphere(edge=0.5)])
def test_a_sound_mesh_is_unchanged(surface):
    mesh = mended_mesh(surface.V, surface.F)
    assert mesh.repairs == ()
    assert_array_equal(mesh.V, surface.V)
    assert_array_equal(mesh.F, surface.F)


def test_a_cushion_sewn_of_two_sheets_is_closed_at_its_corners():
    """A face in two of its corners is there twice, front and back: a neighbour went for it, and holes were its feet."""
    flat = grid(11, 11, 4.0, 4.0)
    x, y = (flat.V - flat.V.mean(axis=0))[:, :2].T
    rise = np.c_[0 * x, 0 * y, 0.2 * (4 - x**2) * (4 - y**2)]
    V, F = np.vstack([flat.V + rise, flat.V - 0.5 * rise]), np.vstack([flat.F, flat.n + flat.F[:, ::-1]])
    mesh = mended_mesh(V, F)
    assert mesh.repairs[-1] == "dsfab dropped 4 faces on top of other faces"
    assert manifold_faults(mesh.F, edge_table(mesh.F), len(mesh.V)) == ()
    cushion = Surface(mesh.V, mesh.F)
    assert cushion.is_closed
    assert cushion.volume == pytest.approx(signed_volume(V, F), rel=1e-9)
    assert area(mesh.V, mesh.F) == pytest.approx(area(V, F) - 4 * area(V, F[:1]), rel=0.01)


def test_a_face_twice_within_a_sheet_is_dropped_once():
    mesh = mended_mesh(ROOF.V, np.vstack([ROOF.F, ROOF.F[5:6, ::-1]]))
    assert len(mesh.F) == ROOF.m
    assert mesh.repairs == ("dsfab dropped 1 face on top of other faces",)


@given(st.integers(0, 10**6), st.floats(1e-3, 1e4))
@settings(max_examples=20, deadline=None)
def test_seams_of_any_size_are_welded(seed, size):
    """Every face with corners of its own, shaken by a millionth of the size: one sheet again."""
    rng = np.random.default_rng(seed)
    V = ROOF.V[ROOF.F.ravel()] * size
    V += rng.uniform(-1e-6, 1e-6, V.shape) * np.ptp(V, axis=0).max()
    mesh = mended_mesh(V, np.arange(len(V)).reshape(-1, 3))
    assert len(mesh.V) == ROOF.n
    assert manifold_faults(mesh.F, edge_table(mesh.F), len(mesh.V)) == ()
    assert "merged with neighbouring" in mesh.repairs[0]


def test_a_corner_that_marching_cubes_cut_off_is_whole_again(tmp_path):
    """Two vertices 0.14 mm apart at corners of a patch of 6 m: with needles between them statics cannot be solved."""
    patch = read_surface(gyroid(tmp_path), "m")
    assert patch.edge_lengths.min() < 3e-5 * patch.size
    mesh = mended_mesh(patch.V, patch.F)
    assert Surface(mesh.V, mesh.F).edge_lengths.min() > 1.5e-4 * patch.size


def crossing_itself():
    """A tube whose section is an eight: its two sheets have 11 vertices each at the places where they cross."""
    around = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    x, z = np.sin(around), np.round(np.sin(2 * around), 12) / 2
    V = np.array([[round(a, 12), y, b] for y in np.linspace(0, 3, 11) for a, b in zip(x, z, strict=True)])
    k = np.arange(11 * 32).reshape(11, 32)
    a, b, c, d = (one.ravel() for one in (k[:-1], k[1:], np.roll(k, -1, 1)[1:], np.roll(k, -1, 1)[:-1]))
    return V, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def test_a_sheet_that_crosses_itself_stays_whole():
    V, F = crossing_itself()
    assert len(merged_vertices(V)[0]) == len(V) - 11
    mesh = mended_mesh(V, F)
    assert mesh.repairs == ()
    assert_array_equal(mesh.F, F)


def test_crossing_sheets_stay_apart_and_a_wall_on_a_sheet_is_sewn():
    flat = grid(6, 6, 2.0, 2.0)
    upright = flat.V[:, [1, 2, 0]] + [0, 1, -1]
    both = mended_mesh(np.concatenate([flat.V, upright]), np.concatenate([flat.F, flat.F + flat.n]))
    assert both.repairs == ()
    assert pieces(both.F, edge_table(both.F))[0] == 2
    wall = mended_mesh(np.concatenate([flat.V, upright + [0, 0, 1]]), np.concatenate([flat.F, flat.F + flat.n]))
    near = "within 5e-05 times the largest side of the mesh"
    assert wall.repairs[0] == f"7 vertices merged with neighbouring vertices, {near}"
    twice = mended_mesh(np.concatenate([flat.V, flat.V]), np.concatenate([flat.F, flat.F + flat.n]))
    assert len(twice.F) == flat.m


def test_a_finely_divided_outline_is_not_welded_to_a_point():
    """Links go on from one vertex to the next: a disc of 200 000 corners became one vertex, and was refused."""
    turn = 2 * np.pi * np.arange(200_000) / 200_000
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    kept, became = merged_vertices(ring, WELD)
    assert np.linalg.norm(kept[became] - ring, axis=1).max() <= WELD * 2
    assert cKDTree(kept).query(kept, k=2)[0][:, 1].min() > WELD * 2 * (1 - 1e-9)
    assert 25_000 < len(kept) < 100_000


def test_crumbs_repeats_and_faces_without_area_go():
    n = ROOF.n
    V = np.vstack([ROOF.V, ROOF.V[:3] * 0.01 + [0, 0, 9], [[np.nan, 0, 0]]])
    a, b, _ = ROOF.F[0]
    F = np.vstack([ROOF.F, ROOF.F[5][::-1], [n, n + 1, n + 2], [a, b, b], [a, b, n + 3]])
    mesh = mended_mesh(V, F)
    assert_array_equal(mesh.V, ROOF.V)
    assert_array_equal(mesh.F, ROOF.F)
    assert len(mesh.repairs) == 4, mesh.repairs


def test_a_fin_on_an_inner_edge_goes():
    """The third face on an edge is the one that comes last."""
    edges = ROOF.edges
    a, b = edges.ends[np.flatnonzero(~edges.boundary)[0]]
    V = np.vstack([ROOF.V, ROOF.V[a] + [0, 0, 1]])
    mesh = mended_mesh(V, np.vstack([ROOF.F, [a, b, ROOF.n]]))
    assert_array_equal(mesh.F, ROOF.F)
    assert "dsfab dropped 1 face on edges that already have two faces (perhaps a rib)" in mesh.repairs


def test_a_part_in_another_unit_is_doubted():
    """Half of a bridge was in metres, the other in millimetres: it shrank to a point, which nobody was told."""
    far = ROOF.V[:, 0] > np.median(ROOF.V[:, 0])
    told = " ".join(mended_mesh(np.where(far[:, None], ROOF.V / 1e6, ROOF.V), ROOF.F).repairs)
    assert "check that all parts have the same unit" in told
    once = np.vstack([ROOF.F, [[0, 1, 0]]])
    assert "the same unit" not in " ".join(mended_mesh(ROOF.V, once).repairs)


def test_pinholes_are_closed_and_doors_are_not():
    ball = sphere(edge=0.4)
    tiny = ball.V.copy()
    corners = ball.F[0]
    tiny[corners] = tiny[corners].mean(axis=0) + 1e-3 * (tiny[corners] - tiny[corners].mean(axis=0))
    holed = mended_mesh(tiny, ball.F[1:])
    assert holed.repairs == ("1 pinhole closed",)
    closed = Surface(holed.V, holed.F)
    assert closed.is_closed
    assert closed.volume == pytest.approx(Surface(tiny, ball.F).volume, rel=1e-6)
    assert mended_mesh(ball.V, ball.F[1:]).repairs == ()


def patches(near, far, bend=0.6, gap=0.0):
    """Two patches of a barrel of 4 by 4 m side by side, with so many strips across at their seam, and a gap there."""
    V, F = [], []
    for strips, (x0, x1) in ((near, (0.0, 2.0)), (far, (2.0 + gap, 4.0))):
        one = grid(3, strips, x1 - x0, 4.0)
        turn = bend * (one.V[:, 1] / 2 - 1)
        F.append(one.F + sum(map(len, V)))
        V.append(np.stack([x0 + one.V[:, 0], 2 / bend * np.sin(turn), 2 / bend * np.cos(turn)], axis=1))
    return np.vstack(V), np.vstack(F)


@pytest.mark.parametrize(("near", "far", "bend"), [(4, 12, 0.6), (5, 8, 0.6), (3, 40, 1e-6), (7, 5, 1e-6)])
def test_patches_that_were_divided_apart_are_one_sheet(near, far, bend):
    """Seams are shared at their ends only, or at a few vertices; on a barrel they gape as its chords do."""
    V, F = patches(near, far, bend)
    mesh = mended_mesh(V, F)
    edges = edge_table(mesh.F)
    assert manifold_faults(mesh.F, edges, len(mesh.V)) == ()
    assert pieces(mesh.F, edges)[0] == 1
    (rim,) = boundary_loops(mesh.F, edges)
    assert len(rim) == near + far + 12
    assert "on open seams" in mesh.repairs[-1]
    assert area(mesh.V, mesh.F) == pytest.approx(area(V, F), rel=2e-3)


@pytest.mark.parametrize("gap", [0.004, 0.1])
def test_a_joint_between_panels_stays_open(gap):
    """Narrower than chords gape, but the panels share no vertex: it is meant."""
    mesh = mended_mesh(*patches(4, 12, gap=gap))
    assert mesh.repairs == ()
    assert pieces(mesh.F, edge_table(mesh.F))[0] == 2


@pytest.mark.parametrize("turned", [False, True])
def test_parts_that_touch_in_a_point_are_joined_there(turned):
    """Two openings with a common corner in a plate, and two plates that share a corner, one of them turned over."""
    one = grid(6, 6, 3.0, 3.0)
    side = one.centroids - 1.5
    middle = np.flatnonzero((np.abs(side[:, :2]) < 0.5).all(axis=1) & (side[:, 0] * side[:, 1] > 0))
    other = one.F + one.n
    other = np.where(other == one.n, one.n - 1, other)[:, :: -1 if turned else 1]
    holed, two = np.delete(one.F, middle, axis=0), np.vstack([one.F, other])
    apart = np.vstack([one.V, one.V + [3, 3, 0]])
    for V, F in ((one.V, holed), (apart, two)):
        before, mesh = edge_table(F), mended_mesh(V, F)
        edges = edge_table(mesh.F)
        assert len(pinches(F, before, len(V))) == 1
        assert len(pinches(mesh.F, edges, len(mesh.V))) == 0
        assert edges.count.max() == 2
        assert len(mesh.F) == len(F) + 1
        assert "touch in a point: joined" in mesh.repairs[-1]


def test_a_narrow_opening_and_needles_at_a_border_are_no_seams():
    """A slit of 3.6 by .04 m pointed at its ends, without a vertex on one side; a needle on an edge; a tip like one."""
    slit = [[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0], [0.2, 1, 0], [3.8, 1, 0], [2, 1.04, 0]]
    around = [[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 4, 6], [3, 0, 4]]
    needles = [[0, 0, 0], [4, 0, 0], [2, 1e-4, 0], [2, 2, 0]], [[0, 1, 2], [0, 2, 3], [2, 1, 3]]
    tip = (
        [[0, 0, 0], [-1, 7e-5, 0], [1, 1.4e-4, 0], [4, 0, 0], [-2, 3, 0]],
        [[0, 3, 1], [1, 3, 2], [0, 1, 4], [1, 2, 4]],
    )
    for V, F in ((slit, around), needles, tip):
        mesh = mended_mesh(np.array(V, dtype=float), np.array(F))
        if V is tip[0]:  # its third face lies on the last
            assert mesh.repairs == ("dsfab dropped 1 face on top of other faces",)
            F = [*F[:2], F[3]]
        else:
            assert mesh.repairs == ()
        assert_array_equal(mesh.F, F)


def test_files_of_common_programs_become_sound_sheets(tmp_path):
    """A contour's needles and crumbs, and a boolean's slivers: one sound piece each, of the same area."""
    for make in (gyroid, voronoi_shell, figure):
        path = make(tmp_path)
        raw, whole = read_surface(path), read_surface(path, mend=True)
        assert whole.pieces[0] == 1
        assert whole.area == pytest.approx(raw.area, rel=2e-6)
        assert manifold_faults(whole.F, whole.edges, whole.n) == ()


@pytest.mark.parametrize("broken", [1e30, -1e7, np.nan])
def test_a_stray_vertex_is_removed_with_its_faces_only(broken):
    """One number of 10^30 made all others one vertex: 'nothing is left', with no word of it."""
    flat = grid(12, 12, 6.0, 6.0)
    V = flat.V.copy()
    V[45, 1] = broken
    mesh = mended_mesh(V, flat.F)
    assert len(mesh.F) == flat.m - int((flat.F == 45).any(axis=1).sum()) < flat.m
    assert len(mesh.V) == flat.n - 1
    assert len(mesh.repairs) == 1
    assert ("not numbers" if np.isnan(broken) else "1,000 times as far from") in mesh.repairs[0]
    assert mended_mesh(V[:, [1, 0, 2]] * [1, 400, 1], flat.F[(flat.F != 45).all(axis=1)]).repairs == ()


def test_the_unit_is_guessed_without_a_vertex_astray(tmp_path):
    path = tmp_path / "roof.obj"
    V = 6.0 * np.eye(3)[[0, 1, 2, 0, 1, 2]] * np.array([1, 1, 1, 2, 2, 2])[:, None]
    V[0, 0] = 1e9
    path.write_text("".join("v {} {} {}\n".format(*v) for v in V) + "f 1 2 3\nf 4 5 6\nf 4 2 3\nf 4 5 3\n")
    assert describe(path).unit_guess == "m"


def test_nothing_but_faults_is_refused(tmp_path):
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    with pytest.raises(SurfaceError, match=r"line\.obj: the repair removed all faces: dsfab dropped 1 face without"):
        read_surface(path, mend=True)


@given(st.floats(0.1, 50), st.tuples(*[st.floats(-5, 5)] * 3))
@settings(max_examples=20, deadline=None)
def test_relative_pickers_pick_the_same_wherever_and_however_large(scale, move):
    """Shares of the box do not change when the surface is moved, scaled, or stretched along an axis."""
    pickers = [
        Box((0, 0, 0), (0.3, 1, 0.5), relative=True),
        Ball((0.5, 0.5, 1.0), 0.2, relative=True),
        Side("z", "min", 0.1, relative=True),
        Nearest(((0.13, 0.87, 0.2), (0.9, 0.8, 1)), relative=True),
    ]
    other = Surface(ROOF.V * scale + move, ROOF.F)
    for picker in pickers:
        assert_array_equal(picker.vertices(other), picker.vertices(ROOF))


def test_relative_is_a_share_of_the_box():
    surface = plate(edge=0.25)
    low, high = surface.V.min(axis=0), surface.V.max(axis=0)
    side = high - low
    relative = Box((0.25, 0, 0), (0.75, 1, 1), relative=True)
    metres = Box(tuple(low + side * [0.25, 0, 0]), tuple(low + side * [0.75, 1, 1]))
    assert_array_equal(relative.vertices(surface), metres.vertices(surface))
    radius = Ball((0, 0, 0), 0.25, relative=True)
    away = np.linalg.norm(surface.V - low, axis=1)
    assert_allclose(radius.vertices(surface), away <= 0.25 * surface.size * (1 + 1e-9))


def test_boxes_of_free_edges_leave_the_inside_alone():
    everything = (-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)
    picked = Box(*everything, boundary=True).vertices(ROOF)
    assert_array_equal(np.flatnonzero(picked), np.sort(ROOF.loops[0]))
    with pytest.raises(SurfaceError, match="picks no vertex"):
        Box(*everything, boundary=True).vertices(sphere(edge=0.5))


def test_a_preset_of_shares_holds_for_another_mesh(tmp_path):
    (tmp_path / "a.toml").write_text(
        """
        [surface]
        file = "none.obj"
        [[surface.support]]
        at = { pick = "side", axis = "z", end = "min", depth = 0.05, relative = true }
        [[surface.load]]
        kind = "force"
        force = [0, 0, -1]
        at = { pick = "ball", center = [0.5, 0.5, 1], radius = 0.1, relative = true }
        [statics]
        thickness = 0.01
        """
    )
    for scale in (1, 30):
        lines = [f"v {x} {y} {z}" for x, y, z in ROOF.V * scale] + [f"f {a} {b} {c}" for a, b, c in ROOF.F + 1]
        (tmp_path / "mesh.obj").write_text("\n".join(lines))
        preset = load_preset(tmp_path / "a.toml", mesh=tmp_path / "mesh.obj")
        surface = preset.surface.build()
        assert preset.surface.support[0].at.vertices(surface).sum() == len(ROOF.loops[0])
        assert preset.surface.load[0].at.vertices(surface).any()


def thick_shell(surface, thick):
    """The closed solid of a surface (n vertices) and of it `thick` metres beneath, along the vertices' normals."""
    normals = np.zeros((surface.n, 3))
    for corner in surface.F.T:
        np.add.at(normals, corner, surface.normals * surface.areas[:, None])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    n, F = surface.n, surface.F
    start = np.concatenate(list(surface.loops))
    end = np.concatenate([np.roll(loop, -1) for loop in surface.loops])
    sides = [np.stack([end, start, start + n], 1), np.stack([end, start + n, end + n], 1)]
    return np.vstack([surface.V, surface.V - thick * normals]), np.vstack([F, F[:, ::-1] + n, *sides])


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_a_second_copy_of_a_sheet_goes(size):
    """Front and back as CAD programs export them, 2 mm apart: each was built, on eight feet."""
    V = np.vstack([ROOF.V, ROOF.V - [0, 0, 2e-3]]) * size
    mesh = mended_mesh(V, np.vstack([ROOF.F, ROOF.F[:, ::-1] + ROOF.n]), 1 / size)
    assert len(mesh.F) == ROOF.m
    assert_array_equal(mesh.V, ROOF.V * size)
    assert mesh.repairs[0].startswith("a second copy of the sheet, 1.")
    assert mesh.repairs[0].endswith("mm from the first copy, was dropped")


def test_a_sheet_that_a_file_repeats_is_dropped_with_a_note():
    mesh = mended_mesh(np.vstack([ROOF.V, ROOF.V]), np.vstack([ROOF.F, ROOF.F + ROOF.n]))
    assert len(mesh.F) == ROOF.m
    assert "of a second copy of the sheet" in mesh.repairs[-1]


def folds():
    """A roof of 8 m x 6 m with four folds of 84 degrees."""
    flat = grid(24, 12, 8.0, 6.0)
    at = (flat.V[:, 0] - flat.V[:, 0].min()) / 8 * 2
    return Surface(np.column_stack([flat.V[:, :2], 1.8 * np.abs(2 * (at % 1) - 1)]), flat.F)


def test_of_many_copies_the_first_stays():
    V = np.vstack([ROOF.V - [0, 0, 1e-3 * k] for k in range(3)])
    mesh = mended_mesh(V, np.vstack([ROOF.F + k * ROOF.n for k in range(3)]))
    assert_array_equal(mesh.V, ROOF.V)
    assert len(mesh.repairs) == 2


@pytest.mark.parametrize("surface", [ROOF, plate(edge=0.2), HYPAR, folds()], ids=["dome", "plate", "hypar", "folded"])
def test_a_slab_becomes_the_sheet_in_its_middle(surface):
    """Its two faces and its sides were taken for a closed figure, which stood on its lowest parts."""
    thick = 0.03 * np.sqrt(surface.area)
    V, F = thick_shell(surface, thick)
    mesh = mended_mesh(V, F)
    middle = Surface(mesh.V, mesh.F)
    assert middle.m == surface.m
    assert len(middle.loops) == 1
    off = nearest_places(mesh.V, surface.V, surface.F).distance
    assert np.median(off) == pytest.approx(thick / 2, rel=0.05)
    assert off.max() < 0.8 * thick
    assert "thick, was reduced to its middle surface" in mesh.repairs[0]


def half_cylinder():
    """Half a cylinder of 4 m radius, 6 m long: its edges stand upright."""
    flat = grid(24, 12, np.pi, 6.0)
    at = flat.V[:, 0] - flat.V[:, 0].min()
    return Surface(np.column_stack([-4 * np.cos(at), flat.V[:, 1], 4 * np.sin(at)]), flat.F)


HALF = dome(rise=4.9, span=10.0, edge=0.9)


@pytest.mark.parametrize("way", [(0.0, 0.0, 0.2), (0.0, 0.15, -0.15)], ids=["up", "askew"])
@pytest.mark.parametrize(
    "surface", [half_cylinder(), HYPAR, dome(rise=4.9, span=10.0, edge=0.9)], ids=["barrel", "hypar", "half"]
)
def test_an_extruded_slab_becomes_the_sheet_in_its_middle(surface, way):
    """It is next to nothing thick where it stands upright: a half barrel was taken for a closed figure."""
    _, F = thick_shell(surface, 1.0)
    mesh = mended_mesh(np.vstack([surface.V + way, surface.V]), F)
    assert area(mesh.V, mesh.F) == pytest.approx(surface.area, rel=0.01)
    off = nearest_places(mesh.V, surface.V + np.divide(way, 2), surface.F).distance
    assert np.quantile(off, 0.98) < 0.02 * np.linalg.norm(way)
    assert "thick, was reduced to its middle surface" in mesh.repairs[0]


def cushion():
    """Two sheets of one edge, .25 m apart in the middle of 4 m: an air cushion."""
    surface = grid(24, 24, 4.0, 4.0)
    x, y = (surface.V[:, :2] - surface.V[:, :2].min(axis=0)).T / np.ptp(surface.V[:, :2], axis=0)[:, None]
    rise = 0.5 * surface.size / 4 * x * (1 - x) * 4 * y * (1 - y)
    V = np.vstack([surface.V + np.outer(rise, [0, 0, 1]), surface.V - np.outer(rise, [0, 0, 1])])
    return V, np.vstack([surface.F, surface.F[:, ::-1] + surface.n])


def two_roofs():
    return np.vstack([ROOF.V, ROOF.V + [0, 0, 0.4]]), np.vstack([ROOF.F, ROOF.F + ROOF.n])


@pytest.mark.parametrize(
    "mesh",
    [cushion(), two_roofs(), thick_shell(plate(edge=0.2), 0.4), (sphere(edge=0.5).V, sphere(edge=0.5).F)],
    ids=["cushion", "two roofs", "box", "sphere"],
)
def test_a_mesh_that_is_neither_copy_nor_slab_stays(mesh):
    assert single_sheets(*mesh, 1.0)[2] == ()


def test_parallel_sheets_give_a_remark_and_stay():
    assert [text.partition(";")[0] for text in parallel_remarks(*two_roofs())] == [
        "the surface has two parallel sheets, 294 mm apart, and dsfab builds both sheets"
    ]
    assert list(parallel_remarks(ROOF.V, ROOF.F)) == []
    assert "surface.mend = true" in next(parallel_remarks(*thick_shell(ROOF, 0.2)))


def comb(spikes: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a comb 1 m wide with spikes about 1 m long, and the ends of its edges, one closed loop."""
    x = np.arange(2 * spikes) / (2 * spikes)
    y = np.where(np.arange(2 * spikes) % 2, 1 + 0.2 * np.sin(np.arange(2 * spikes)), 0.0)
    V = np.stack([np.append(x, [1.0, 0.0]), np.append(y, [-0.5, -0.5]), np.zeros(2 * spikes + 2)], axis=1)
    i = np.arange(len(V))
    return V, np.stack([i, np.roll(i, -1)], axis=1)


@pytest.mark.parametrize("open_", [False, True])
def test_vertices_on_long_edges_are_found_in_a_crowd(open_):
    """As each vertex asked about each edge: within a length of closed loops, within a share of edges of other lines."""
    V, ends = comb(40)
    ends = ends[:-1] if open_ else ends
    edge, vertex = near_vertices(V, ends, 0.03)
    found = set(zip(edge.tolist(), vertex.tolist(), strict=True))
    a, b = V[ends].transpose(1, 0, 2)
    far = distances_from_segments(V[:, None], a, b)
    share = np.einsum("vei,ei->ve", V[:, None] - a, b - a) / (np.linalg.norm(b - a, axis=1) ** 2)
    most = np.maximum(SAG * np.linalg.norm(b - a, axis=1), 0.03) if open_ else 0.03
    on = (far <= most) & (share > 0) & (share < 1)
    on[ends.T, np.arange(len(ends))] = False
    assert on.any()
    assert {(int(e), int(v)) for v, e in np.argwhere(on)} <= found


def test_a_comb_of_spikes_asks_about_few_vertices_an_edge():
    """Of 2 000 spikes nearly all corners are nearer to the middle of each edge than its ends are."""
    V, ends = comb(2000)
    edge, _ = near_vertices(V, ends, 1e-5)
    assert len(edge) < 50 * len(ends)


def test_a_comb_of_spikes_counts_no_crowds(monkeypatch):
    """The ball around the middle of an edge has all corners in it: to count them for each edge goes as their square."""
    met = []

    class Tree(seams.cKDTree):
        def query_ball_point(self, *asked, return_length=False):
            lists = super().query_ball_point(*asked)
            met.append(sum(map(len, lists)))
            return np.array([len(each) for each in lists]) if return_length else lists

    monkeypatch.setattr(seams, "cKDTree", Tree)
    V, ends = comb(400)
    edge, _ = near_vertices(V, ends, 0.02)
    assert len(edge) > len(ends)  # so wide that the shortest pieces are asked for all that is around them
    assert sum(met) < 50 * len(ends)


def test_walks_around_a_fan_of_thousands_are_not_gone_to_their_end(monkeypatch):
    """What is left of them is told by parts that hang together: there is no pinch, and with a second fan there is."""
    k = np.arange(1, 150)
    fan = np.stack([np.zeros_like(k), k, k + 1], axis=1)
    n = 1 + int(fan.max())
    hanging, link = [], topology.link_components
    monkeypatch.setattr(topology, "link_components", lambda *given: hanging.append(1) or link(*given))
    for some, asked in ((fan[:70], 0), (fan, 1)):
        assert not len(pinches(some, edge_table(some), n))
        assert len(hanging) == asked
    two = np.concatenate([fan, np.where(fan > 0, fan + n, 0)])
    assert pinches(two, edge_table(two), 2 * n).tolist() == [0]
