"""Remeshing: even triangles on the same surface; boundaries, creases, corners, plan and topology stay."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dsfab
from dsfab.core.errors import DsfabError, SurfaceError
from dsfab.surface import Surface, read_surface, refined_surface, remeshed_surface
from dsfab.surface.edge_changes import feature_edges
from dsfab.surface.remesh import smoothing
from dsfab.surface.remesh.edges import without_rim_slivers
from dsfab.surface.remesh.features import design_features
from dsfab.thickening import offsets
from tests.canopy import canopy
from tests.meshes import mesh_file
from tests.shapes import ZOO, annulus, folded, grid, jittered, smallest_angle, sphere, zoo
from tests.surface.needles import check_kept, cone_of_needles, farthest, samples

ROOT = Path(__file__).resolve().parents[2]


# --- closed forms


@pytest.mark.parametrize("edge", [0.4, 0.13, 0.03])
def test_a_plate_keeps_its_area_and_its_plane(edge):
    plate = jittered(grid(12, 12, 1.0, 1.0))
    new = remeshed_surface(plate, edge)
    assert new.area == pytest.approx(1, abs=1e-12)
    assert np.abs(new.V[:, 2]).max() <= 1e-15
    assert (new.normals[:, 2] > 0.999).all()
    assert smallest_angle(new) > 25
    assert new.mean_edge == pytest.approx(edge, rel=0.15)
    check_kept(plate, new, edge)


@pytest.mark.parametrize("edge", [0.3, 0.05])
def test_a_folded_plate_keeps_its_crease(edge):
    plate = folded(90)
    new = remeshed_surface(plate, edge)
    assert new.area == pytest.approx(2, abs=1e-12)
    crease = feature_edges(new) & ~new.edges.boundary
    assert new.edge_lengths[crease].sum() == pytest.approx(1, abs=1e-12)
    assert np.abs(samples(new, crease)[:, [0, 2]] - [0, 0]).max() < 1e-12
    assert smallest_angle(new) > 25
    check_kept(plate, new, edge)


def test_a_ring_keeps_its_two_loops_and_shrinks_by_its_chords_alone():
    ring, edge = annulus(64, 10), 0.15
    new = remeshed_surface(ring, edge)
    assert len(new.loops) == 2
    assert new.area == pytest.approx(ring.area, rel=0.01)
    check_kept(ring, new, edge)


def test_a_smooth_sphere_is_rounder_than_its_facets():
    """Radius and area are those of the sphere through the vertices: 9 and 10 times nearer than on facets."""
    ball, edge = sphere(3), 0.06
    flat, smooth = remeshed_surface(ball, edge), remeshed_surface(ball, edge, smooth=True)
    off = [np.abs(np.linalg.norm(s.V, axis=1) - 1).max() for s in (flat, smooth)]
    assert off[1] < off[0] / 9
    assert off[1] < 0.0016
    assert 4 * np.pi - smooth.area < (4 * np.pi - flat.area) / 7


# --- laws over odd shapes


@pytest.mark.slow
@zoo
@pytest.mark.parametrize("share", [2.0, 0.5])
def test_the_zoo_is_kept(name, share):
    old = ZOO[name]()
    edge = share * old.mean_edge
    new = remeshed_surface(old, edge)
    check_kept(old, new, edge)
    assert smallest_angle(new) > 20 or name == "obtuse"  # whose corners are sharp


@pytest.mark.parametrize("smooth", [False, True])
def test_the_same_surface_gives_the_same_mesh(smooth):
    one, two = (remeshed_surface(canopy(0.5), 0.4, 0.1, smooth) for _ in range(2))
    assert np.array_equal(one.V, two.V)
    assert np.array_equal(one.F, two.F)


@pytest.mark.slow
@settings(max_examples=12, deadline=None, derandomize=True)
@given(power=st.integers(-12, 12), angle=st.floats(0, 6.3), edge=st.floats(0.35, 1.2))
def test_size_and_turn_make_no_difference(power, angle, edge):
    """A mesh that is twice as large, to the bit; one that is turned about its height, in what is measured."""
    roof, scale = canopy(0.8), 2.0**power
    new = remeshed_surface(roof, edge)
    scaled = remeshed_surface(Surface(scale * roof.V, roof.F), scale * edge)
    assert np.array_equal(scaled.V, scale * new.V)
    assert np.array_equal(scaled.F, new.F)
    c, s = np.cos(angle), np.sin(angle)
    turned = Surface(roof.V @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), roof.F)
    check_kept(turned, remeshed_surface(turned, edge), edge)


@pytest.mark.slow
def test_another_process_makes_the_same_bytes():
    code = (
        "import hashlib; from tests.canopy import canopy; from dsfab.surface import remeshed_surface; "
        "s = remeshed_surface(canopy(0.8), 0.5, 0.2, True); "
        "print(hashlib.sha256(s.V.tobytes() + s.F.tobytes()).hexdigest())"
    )
    runs = [
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert runs[0] == runs[1]


def vault_of_needles(count: int) -> Surface:
    """A vault of needles from end to end, as CAD programs give it."""
    flat = grid(count, 1, 8.0, 10.0)
    x, y, _ = flat.V.T
    return Surface(np.c_[x, y, 2.5 * np.sin(np.pi * x / 8)], flat.F)


@pytest.mark.slow
@pytest.mark.parametrize("needles", [vault_of_needles(60), vault_of_needles(500), cone_of_needles(300)])
def test_needles_become_even_triangles(needles):
    edge = needles.size / 40
    new = remeshed_surface(needles, edge)
    assert smallest_angle(new) > 20
    assert new.m < 1.3 * needles.area / (np.sqrt(3) / 4 * edge**2)
    check_kept(needles, new, edge)


@pytest.mark.parametrize(("fold", "degrees"), [(0.0, 14), (0.4, 7)])
def test_edges_near_a_tip_keep_their_length(fold, degrees):
    """A tip of 14 degrees, flat or creased along its middle: edges shrank to a fortieth and a seventieth of those asked
    for. They are as long as its angle is wide at the length of an edge, and their last row is as wide at theirs."""
    half, edge = 4 * np.tan(np.radians(7)), 0.2
    tip = Surface([[0, 0, 0], [4, -half, 0], [4, half, 0], [4, 0, fold]], [[0, 1, 3], [0, 3, 2]])
    new = remeshed_surface(tip, edge)
    check_kept(tip, new, edge)
    assert new.edge_lengths.min() > 1.25 * np.tan(np.radians(degrees)) ** 2 * edge
    assert smallest_angle(new) > degrees


@pytest.mark.slow
@pytest.mark.parametrize("way", [1, -1], ids=["outside", "inside"])
def test_an_ear_at_a_round_border_is_no_crease(way):
    """A square grid on a dome: a corner of the grid is a level triangle between three points of the border."""
    square = grid(9, 9, 2.0, 2.0)
    x, y = square.V[:, :2].T - 1
    u, v = x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)
    round_dome = Surface(np.column_stack([u, v, 0.5 * (1 - u**2 - v**2)]), square.F[:, ::way])
    new = remeshed_surface(round_dome, 0.05, smooth=True)
    turn = np.einsum("mci,mi->mc", new.vertex_normals[new.F], new.normals)
    assert np.degrees(np.arccos(turn.min())) < 15
    assert new.V[new.edges.ends[new.edges.boundary].ravel(), 2] == pytest.approx(0, abs=1e-12)


def test_slivers_at_the_border_of_a_curved_sheet_do_not_stay():
    """Triangulations of points have them. Nothing collapsed them, because their normals are rounding."""
    plate = grid(12, 8, 12.0, 8.0)
    x, y, _ = plate.V.T
    V = np.stack([x, y, 0.3 * np.cos(x) * np.cos(y)], axis=1)
    rim = plate.F[(y[plate.F] == 0).sum(axis=1) == 2]
    corner = [face[y[face] == 0] for face in rim]
    tip = np.array([V[ends].mean(axis=0) + (0, 5e-4, 0.005) for ends in corner])
    whole = [face for face in plate.F if (y[face] == 0).sum() < 2]
    for k, face in enumerate(rim):  # each face at the border y = 0 becomes three around a point beside the border
        whole += [[face[j], face[(j + 1) % 3], plate.n + k] for j in range(3)]
    mesh = remeshed_surface(Surface(np.concatenate([V, tip]), np.array(whole)), 0.45)
    assert smallest_angle(mesh) > 15


@pytest.mark.parametrize("height", [0.02, 0.04, 0.08])
def test_a_low_triangle_at_a_curved_border_does_not_tilt_the_sheet(height):
    """Its third corner lies on the curve, 31 mm above the chord of its border edge, and 20 to 80 mm beside it: the
    triangle stands up by 57 to 21 degrees, and a thick sheet met itself there."""
    arch = grid(8, 6, 8.0, 6.0)
    V = np.stack([arch.V[:, 0], arch.V[:, 1], -((arch.V[:, 0] - 4) ** 2) / 8], axis=1)
    a = np.flatnonzero((V[:, 1] == 0) & (V[:, 0] == 3))[0]
    b = np.flatnonzero((V[:, 1] == 0) & (V[:, 0] == 4))[0]
    face = np.flatnonzero(np.isin(arch.F, [a, b]).sum(axis=1) == 2)
    (rim,) = (k for k in face if (V[arch.F[k], 1] == 0).sum() == 2)
    tip, corners = arch.n, arch.F[rim]
    split = [[corners[j], corners[(j + 1) % 3], tip] for j in range(3)]
    F = np.concatenate([np.delete(arch.F, rim, axis=0), split])
    new = remeshed_surface(Surface(np.concatenate([V, [[3.5, height, -0.03125]]]), F), 0.4, smooth=True)
    exact = np.stack([(new.centroids[:, 0] - 4) / 4, 0 * new.areas, 1 + 0 * new.areas], axis=1)
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    tilt = np.degrees(np.arccos(np.abs((exact * new.normals).sum(axis=1)).clip(0, 1)))
    assert tilt.max() < 10
    assert offsets(new, 0.2, "mid").smallest == 1


@pytest.mark.parametrize("rise", [0.3, 1.0])
def test_a_low_hip_roof_is_no_error_of_its_border(rise):
    """A hip of 10 x 20 m whose ends are low faces: its border is straight, so nothing explains their height."""
    x, y = 10.0, 20.0
    V = np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0], [x / 2, 0.5, rise], [x / 2, y - 0.5, rise]])
    F = np.array([[0, 1, 4], [2, 3, 5], [1, 2, 5], [1, 5, 4], [3, 0, 4], [3, 4, 5]])
    for smooth in (False, True):
        new = remeshed_surface(Surface(V, F), 0.5, smooth=smooth)
        assert new.V[:, 2].max() == pytest.approx(rise, rel=0.05)
    assert without_rim_slivers(Surface(V, F), smooth=True).m == 6


def test_corners_of_a_polygonal_border_do_not_explain_a_low_face():
    """A tent over a hexagon whose corners lie high and low in turn: its border is straight between them."""
    angle = 0.1 + np.arange(6) * np.pi / 3
    rim = np.stack([3 * np.cos(angle), 3 * np.sin(angle), np.where(np.arange(6) % 2, 0.3, 0.0)], axis=1)
    tip = 0.96 * (rim[0] + rim[1]) / 2 + (0, 0, 0.1)
    faces = [[k, (k + 1) % 6, 6] for k in range(1, 6)] + [[0, 1, 7], [1, 6, 7], [6, 0, 7]]
    tent = Surface(np.concatenate([rim, [[0.0, 0, 1.0], tip]]), np.array(faces))
    assert without_rim_slivers(tent, smooth=True).m == tent.m


def test_low_triangles_in_a_row_at_a_curved_border_all_go():
    n = 60
    x = np.linspace(0, 6, n + 1)
    row = [np.stack([x, 0 * x + y, -(x**2) / 8], axis=1) for y in (0.0, 0.1)]
    middle = (x[:-1] + x[1:]) / 2
    tips = np.stack([middle, 0.003 + 4e-5 * np.arange(n), -(middle**2) / 8], axis=1)
    a, b, c, d, t = (np.arange(n) + k for k in (0, 1, n + 1, n + 2, 2 * n + 2))
    F = np.concatenate([np.stack(f, axis=1) for f in ((a, b, t), (b, d, t), (t, d, c), (a, t, c))])
    sheet = Surface(np.concatenate([*row, tips]), F)
    assert without_rim_slivers(sheet).m == sheet.m
    assert without_rim_slivers(sheet, smooth=True).m <= sheet.m - 2 * (n - 2)  # a corner of the border explains nothing


def test_low_even_triangles_at_a_fine_round_border_stay():
    """A ring with edges of 16 mm, in rows of 8 mm, gets edges of .45 m: a border without faces is a saw."""
    ring = annulus(200, 20, 0.5, 0.66)
    new = remeshed_surface(ring, 0.45)
    perimeters = [mesh.edge_lengths[mesh.edges.boundary].sum() for mesh in (ring, new)]
    assert perimeters[1] == pytest.approx(perimeters[0], rel=0.01)


def test_noise_makes_no_creases_and_coarsens():
    """A plate of 7 200 triangles with noise of a fifth of its edges: 3 555 edges are sharp by chance."""
    rough = jittered(grid(60, 60, 1.0, 1.0), 0.0)
    lift = 0.2 * rough.mean_edge * np.random.default_rng(0).normal(size=rough.n)
    rough = Surface(np.c_[rough.V[:, :2], lift], rough.F)
    inner = ~rough.edges.boundary
    edge = 5 * rough.mean_edge
    assert (feature_edges(rough) & inner).sum() > 3000
    assert (design_features(rough, edge) & inner).sum() < 10  # at the boundary, which is as rough
    assert remeshed_surface(rough, edge).m < rough.m / 5
    assert (design_features(folded(90), 0.5) & ~folded(90).edges.boundary).sum() == 8


def test_a_noisy_scan_has_no_creases():
    """A plate of 33 800 triangles with noise of a tenth of its edges; new edges are a half and the whole of these."""
    rough = grid(130, 130, 1.0, 1.0)
    lift = 0.1 * rough.mean_edge * np.random.default_rng(1).normal(size=rough.n)
    rough = Surface(np.c_[rough.V[:, :2], lift], rough.F)
    sharp = feature_edges(rough) & ~rough.edges.boundary
    assert sharp.sum() > 3000
    for edge in (rough.mean_edge, 0.5 * rough.mean_edge):
        assert (design_features(rough, edge) & sharp).sum() < 10


def test_a_small_step_of_a_drawn_plate_stays_though_its_faces_are_long():
    """Two terraces of 4 m with a step of 0.1 m between, of six quads: the step is a 25th of a face."""
    x, z = np.array([0, 4, 4, 8.0]), np.array([0, 0, 0.1, 0.1])
    V = np.array([[x[i], y, z[i]] for y in (0.0, 3.0, 6.0) for i in range(4)])
    quads = [(r * 4 + i, r * 4 + i + 1, r * 4 + i + 5, r * 4 + i + 4) for r in range(2) for i in range(3)]
    step = Surface(V, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])
    for edge in (0.5, 0.1, 0.02):
        assert (design_features(step, edge) & ~step.edges.boundary).sum() == 4


MESHES = ["Botanic", "BubbleShell", "barrel_vault", "bob", "canopy_quad", "halftunnel", "hypar"]
MESHES += ["monkey_saddle_control", "roof_with_opening", "shell_tube", "torus"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "share"), [*((name, 80) for name in MESHES), ("bob", 160), ("hypar", 160)])
def test_real_meshes_are_kept(name, share):
    old = read_surface(mesh_file(f"{name}.obj"))
    edge = old.size / share
    new = remeshed_surface(old, edge)
    check_kept(old, new, edge)
    assert smallest_angle(new) > 20


# --- smooth refining


def test_smooth_refining_keeps_boundaries_and_creases():
    roof = canopy(0.5)
    finer = refined_surface(roof, 0.2, smooth=True)
    assert np.ptp(finer.V, axis=0)[:2] == pytest.approx(np.ptp(roof.V, axis=0)[:2], abs=1e-12)
    assert farthest(samples(finer, finer.edges.boundary), roof, roof.edges.boundary) < 1e-12
    assert farthest(samples(roof, roof.edges.boundary), finer, finer.edges.boundary) < 1e-12
    sharp = refined_surface(folded(90), 0.05, smooth=True)
    assert sharp.area == pytest.approx(2, abs=1e-12)


# --- refusals


@pytest.mark.parametrize(
    ("edge", "finest", "says"),
    [
        (0.0, 0.0, "must be a positive length in metres"),
        (np.nan, 0.0, "must be a positive length in metres"),
        (0.1, 0.2, "the finest edge length, 0.2 m, must lie between 0 and the edge length, 0.1 m"),
        (9.0, 0.0, "edges of 9 m are longer than the surface, whose size is 3.46 m"),
        (1e-5, 0.0, "edges of 1e-05 m takes over 4,000,000 triangles"),
    ],
)
def test_impossible_lengths_are_refused(edge, finest, says):
    with pytest.raises(SurfaceError, match=says):
        remeshed_surface(sphere(3), edge, finest)


def test_a_finest_edge_that_takes_too_many_triangles_is_refused(monkeypatch):
    monkeypatch.setattr("dsfab.surface.remesh.remeshing.MOST_TRIANGLES", 300)
    ball = Surface(0.1 * sphere(3).V, sphere(3).F)
    assert remeshed_surface(ball, 0.1).m < 300
    with pytest.raises(SurfaceError, match=r"edges of 0\.01 m takes over 300 triangles on a surface 0\.346 m large"):
        remeshed_surface(ball, 0.1, 0.01)


def test_three_faces_at_an_edge_are_refused():
    fan = Surface([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    with pytest.raises(SurfaceError, match=r"1 edge has more than two faces \(first: 0-1\); split the surface there"):
        remeshed_surface(fan, 0.4)
    twice = Surface(fan.V, [[0, 1, 2], [0, 2, 1]])
    with pytest.raises(SurfaceError, match=r"1 face repeats an earlier face \(first: 1\); remove the repeated"):
        remeshed_surface(twice, 0.4)


# --- presets


def preset(**surface: object) -> dsfab.Preset:
    return dsfab.Preset(
        surface={"mesh": canopy(0.8), **surface},
        supports=[dsfab.Support(dsfab.Boundary())],
        loads=[dsfab.SelfWeight()],
        statics={"thickness": 0.05},
    )


def test_a_preset_remeshes_its_mesh_and_keeps_its_keys(tmp_path):
    made = preset(edge=0.5, finest=0.2, smooth=True)
    surface = made.surface.build()
    expected = remeshed_surface(canopy(0.8), 0.5, 0.2, smooth=True)
    assert np.array_equal(surface.V, expected.V)
    assert np.array_equal(surface.F, expected.F)
    assert preset().surface.build().m == canopy(0.8).m
    dsfab.Design(made).surface  # noqa: B018
    dsfab.write(canopy(0.8), tmp_path / "roof.obj")
    text = dsfab.load_preset("roof", {"surface.edge": 0.5, "surface.unit": "mm"}, mesh=tmp_path / "roof.obj")
    assert text.surface.edge == 0.5
    assert text.surface.build().mean_edge == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"edge": 0.5, "refine": 0.2}, "surface: give either edge .* or refine .*, not both"),
        ({"finest": 0.2}, "surface: finest needs the key edge"),
        ({"edge": 0.2, "finest": 0.5}, "surface: finest = 0.5 must not be larger than edge = 0.2"),
        ({"edge": -1}, "surface.edge = -1: should be greater than or equal to 0"),
    ],
)
def test_keys_that_do_not_go_together_are_refused(keys, says):
    with pytest.raises(DsfabError, match=says):
        preset(**keys)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_surface_has_one_tree_of_boxes(monkeypatch, smooth):
    """Of a sphere a side is made anew too, with a tree of its own."""
    made = []

    class Counted:
        def __init__(self):
            self.inner = tree()

        def init(self, V, F):
            made.append(len(F))
            self.inner.init(V, F)

        def __getattr__(self, name):
            return getattr(self.inner, name)

    tree = smoothing.igl.AABB
    monkeypatch.setattr(smoothing.igl, "AABB", Counted)
    for surface in (jittered(grid(8, 6, 1.0, 0.8), 0.3), sphere(2)):
        made.clear()
        remeshed_surface(surface, 0.3, smooth=smooth)
        assert made.count(surface.m) == 1


@pytest.mark.parametrize(("millions", "begins"), [(3.6, True), (4.4, False)])
def test_a_mesh_of_over_four_million_triangles_is_refused_before_it_begins(millions, begins, monkeypatch):
    def begin(surface, smooth):
        raise InterruptedError

    monkeypatch.setattr("dsfab.surface.remesh.remeshing.without_rim_slivers", begin)
    edge = np.sqrt(4 / np.sqrt(3) / (1e6 * millions))  # of equal triangles on one square metre
    with pytest.raises(InterruptedError if begins else SurfaceError):
        remeshed_surface(grid(2, 2, 1.0, 1.0), edge)
