"""Regions that a person draws: a surface is cut along their outlines; they are solid, void, or have a solid band."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

import dsfab
from dsfab.app.editor.drafts import draft_model
from dsfab.core.errors import DsfabError, PatternError, PresetError, SurfaceError
from dsfab.design import draft
from dsfab.design.buildability import objections
from dsfab.design.regions_and_loads import one_sided_message
from dsfab.pattern.kept_regions import outline_edges, region_bands
from dsfab.render.striped_mesh import distances
from dsfab.report.design.inspection import load_facts
from dsfab.slicing import cut
from dsfab.study.fabrication import fabrication
from dsfab.surface import (
    Ball,
    Boundary,
    Box,
    ClosedCurves,
    Facing,
    PatternRegion,
    PlanPolygon,
    Side,
    Surface,
    refined_surface,
    with_regions,
)
from dsfab.surface.loads.outline_cuts import LINE_TOLERANCE, with_outline
from dsfab.surface.loads.outlines import depth_in, enclosed_area, extent_of
from dsfab.surface.topology import manifold_faults
from tests.presets import DOME_MODES
from tests.shapes import grid, jittered, lifted, smallest_angle, sphere
from tests.surface.outline_drawings import DOOR, star

PLATE = jittered(grid(16, 12, 8.0, 6.0))
SQUARE = ((2.1, 2.2), (4.3, 2.2), (4.3, 4.4), (2.1, 4.4))
WALL = {
    "surface": {
        "shape": "plate",
        "length": 8.0,
        "width": 6.0,
        "edge": 0.35,
        "support": [{"at": {"pick": "side", "axis": "y", "end": "min"}}],
        "load": [{"kind": "self_weight", "direction": [0, -1, 0]}],
    },
    "statics": {"thickness": 0.06},
}
OCULUS = {"do": "void", "at": {"pick": "ball", "center": [0.6, 0.3, 0.0], "radius": 0.8}, "name": "oculus"}
RING = {"do": "rim", "width": 0.3, "at": {"pick": "ball", "center": [0.6, 0.3, 0.0], "radius": 1.7}}
BAND = {"do": "keep", "at": {"pick": "plan", "polygon": [[-9, -1.6], [9, -1.2], [9, -0.8], [-9, -1.2]]}}


def wall(*regions: dict, **pattern: object) -> dsfab.Preset:
    """A wall under its own weight with regions."""
    return dsfab.Preset(**WALL, pattern={"method": "stripes", "rim": 0.15, **pattern, "region": list(regions)})


def outlined(surface: Surface, at: object) -> Surface:
    return with_outline(surface, extent_of(at, surface), np.zeros(surface.n, dtype=bool)).surface


def on_outline(surface: Surface, faces: np.ndarray) -> np.ndarray:
    """(k, 3) points on the edges between some faces and others."""
    a, b = surface.V[surface.edges.ends[outline_edges(surface, faces)]].transpose(1, 0, 2)
    return np.concatenate([a + t * (b - a) for t in (0.0, 0.25, 0.5, 0.75)])


# ------------------------------------------------------------------------------------------------------- the cut mesh


@pytest.mark.parametrize("surface", [PLATE, grid(1, 1, 8.0, 6.0), grid(80, 60, 8.0, 6.0)], ids=["usual", "two", "fine"])
def test_a_round_void_takes_the_area_of_a_circle(surface):
    void = PatternRegion(Ball((4.0, 3.0, 0.0), 1.1), "void")
    left, taken, _, _ = with_regions(surface, [void])
    circle = np.pi * 1.1**2
    assert taken[0] == pytest.approx(circle, rel=2 * LINE_TOLERANCE)
    assert left.area == pytest.approx(48 - circle, rel=2 * LINE_TOLERANCE)
    assert len(left.loops) == 2
    away = np.linalg.norm(left.V[left.loops[1]] - (4, 3, 0), axis=1)
    assert np.abs(away - 1.1).max() <= LINE_TOLERANCE * 1.1 + 1e-9


@pytest.mark.parametrize("surface", [PLATE, grid(1, 1, 8.0, 6.0), grid(80, 60, 8.0, 6.0)], ids=["usual", "two", "fine"])
def test_a_polygon_is_cut_to_the_last_digit(surface):
    cut_surface = outlined(surface, PlanPolygon(SQUARE))
    inside = PatternRegion(PlanPolygon(SQUARE), "keep").faces(cut_surface)
    assert cut_surface.areas[inside].sum() == pytest.approx(2.2**2, rel=1e-12)
    assert cut_surface.area == pytest.approx(48, rel=1e-12)
    assert np.abs(depth_in([np.array(SQUARE)], on_outline(cut_surface, inside)[:, :2])).max() < 1e-9
    for corner in SQUARE:
        assert np.linalg.norm(cut_surface.V[:, :2] - corner, axis=1).min() < 1e-9


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 100_000), corners=st.integers(3, 12), cells=st.integers(1, 24))
def test_any_polygon_is_cut_out_of_any_mesh(seed, corners, cells):
    P = star(seed, corners) * (0.4 + seed % 5 / 5) + (2.0 + seed % 3 / 7, 2.1)
    surface = grid(cells, cells, 4.0, 4.0) if seed % 2 or cells == 1 else jittered(grid(cells, cells, 4.0, 4.0))
    found = outlined(surface, PlanPolygon(tuple(map(tuple, P))))
    inside = depth_in([P], found.centroids[:, :2]) > 0
    assert not manifold_faults(found.F, found.edges, found.n)
    assert found.area == pytest.approx(16, rel=1e-12)
    assert (found.normals[:, 2] > 0).all()
    inner = np.abs(P - 2).max() < 2
    if inner:
        assert found.areas[inside].sum() == pytest.approx(enclosed_area(P), rel=1e-2)
        width = 2 * enclosed_area(P) / np.linalg.norm(P - np.roll(P, 1, axis=0), axis=1).sum()
        off = np.abs(depth_in([P], on_outline(found, inside)[:, :2]))
        assert np.quantile(off, 0.9) <= LINE_TOLERANCE * width + 1e-9
    assert np.quantile(found.areas, 0.01) > 0


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), radius=st.floats(0.15, 1.5), x=st.floats(-0.5, 1.5), y=st.floats(-0.5, 1.5))
def test_balls_are_cut_out_of_bumpy_sheets(seed, radius, x, y):
    rng = np.random.default_rng(seed)
    a, b = 0.15 * rng.random(2)
    surface = lifted(lambda u, v: a * np.sin(4 * u) + b * np.cos(5 * v))
    extent = extent_of(Ball((x, y, 0.1), radius), surface)
    made = with_outline(surface, extent, np.zeros(surface.n, dtype=bool)).surface
    inside = extent.depth(made.centroids) > 0
    assert not manifold_faults(made.F, made.edges, made.n)
    assert made.area == pytest.approx(surface.area, rel=2e-3)
    assert len(made.loops) == 1
    if outline_edges(made, inside).any():
        off = np.abs(extent.depth(on_outline(made, inside))) / radius
        assert np.quantile(off, 0.8) <= 1.01 * LINE_TOLERANCE
        assert off.max() <= 0.03  # where it leaves the surface at a flat angle


@pytest.mark.parametrize(
    "at", [Ball((4, 3, 0), 1.1), PlanPolygon(SQUARE), Box((1, 1, -1), (3, 7, 1)), Side("x", "min", 1.3)]
)
def test_cutting_leaves_no_needles(at):
    for seed in range(6):
        assert smallest_angle(outlined(jittered(grid(16, 12, 8.0, 6.0), seed=seed), at)) > 4


def test_vertices_that_stay_keep_their_numbers():
    found = outlined(PLATE, PlanPolygon(SQUARE))
    moved = np.linalg.norm(found.V[: PLATE.n] - PLATE.V, axis=1)
    assert (moved > 0).mean() < 0.2
    assert moved.max() < 0.3 * PLATE.edge_lengths.max()


def test_an_outline_does_not_move_the_boundary():
    across = PlanPolygon(((-1, 1.0), (3.0, 1.1), (3.0, 2.0), (-1, 2.1)))
    found = outlined(PLATE, across)
    rim = found.V[found.loops[0]]
    assert np.abs(np.minimum.reduce([rim[:, 0], rim[:, 1], 8 - rim[:, 0], 6 - rim[:, 1]])).max() < 1e-9
    assert found.area == pytest.approx(48, rel=1e-12)


def test_an_outline_does_not_move_creases():
    """A prism's edges are not rounded by vertices that move off them."""
    roof = Surface(
        [[0, 0, 0], [4, 0, 0], [4, 2, 2], [0, 2, 2], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]]
    )
    fine = refined_surface(roof, 0.5)
    for at in (Side("y", "min", 2.04), Ball((2.03, 2.02, 2.0), 0.9)):
        found = outlined(fine, at)
        assert np.abs(found.V[:, 2] - (2 - np.abs(found.V[:, 1] - 2))).max() < 1e-9
        assert found.area == pytest.approx(fine.area, rel=1e-12)


def test_a_door_leaves_the_back_wall_alone():
    ball = sphere(4, 5.0)
    door = ClosedCurves(curves=tuple(tuple((5 * x, 5 * y, 5 * z) for x, y, z in curve) for curve in DOOR.curves))
    left, taken, _, _ = with_regions(ball, [PatternRegion(door, "void")])
    assert len(left.loops) == 1
    hole = left.V[left.loops[0]]
    assert (hole[:, 1] < 0).all()
    assert np.abs(depth_in([np.array([(-1.5, -2.5), (1.5, -2.5), (1.5, 2), (-1.5, 2)])], hole[:, [0, 2]])).max() < 1e-9
    # the area of a unit sphere over a rectangle in elevation, by a fine lattice
    x, z = np.meshgrid(np.linspace(-0.3, 0.3, 801), np.linspace(-0.5, 0.4, 801))
    exact = 25 * 0.54 * (1 / np.sqrt(1 - x**2 - z**2)).mean()
    assert taken[0] == pytest.approx(exact, rel=5e-3)


def test_voids_may_overlap_and_touch_in_a_point():
    one, two = (PatternRegion(PlanPolygon(square), "void") for square in (SQUARE, tuple(np.add(SQUARE, 1.1).tolist())))
    left, taken, _, _ = with_regions(PLATE, [one, two])
    assert left.area == pytest.approx(48 - 2 * 2.2**2 + 1.1**2, rel=1e-9)
    assert taken == pytest.approx([2.2**2, 2.2**2 - 1.1**2])
    two = PatternRegion(PlanPolygon(tuple(np.add(SQUARE, 2.2 - 1e-12).tolist())[:3]), "void")
    left = with_regions(PLATE, [one, two]).surface
    assert not manifold_faults(left.F, left.edges, left.n)


def test_a_region_of_vertices_ends_halfway_to_their_neighbours():
    ball = sphere(5)
    left, taken, _, _ = with_regions(ball, [PatternRegion(Facing((0, 0, 1), 40.0), "void")])
    assert len(left.loops) == 1
    assert taken[0] == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(40))), rel=0.05)


# ------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("region", "what"),
    [
        (PatternRegion(Ball((40, 0, 0), 1.0), "void", name="door"), r"region\.0 \(door\): .* 31 m from its nearest"),
        (PatternRegion(Ball((4, 3, 0), 100.0), "void"), r"pattern\.region\.0: the void removes the rest"),
        (PatternRegion(Ball((4, 3, 9), 1.0), "keep"), "misses the surface"),
        (PatternRegion(Facing((0, 0, -1), 5.0), "void"), r"pattern\.region\.0: pick = 'facing'.* picks no vertex"),
    ],
)
def test_regions_that_are_nowhere_or_everything_say_so(region, what):
    with pytest.raises(SurfaceError, match=what):
        with_regions(PLATE, [region])


@pytest.mark.parametrize(
    ("regions", "what"),
    [
        ([{**OCULUS, "at": {"pick": "side", "axis": "y", "end": "min", "depth": 1.0}}],
         r"all vertices of surface\.support\.0 are inside the void pattern\.region\.0 \(oculus\)"),
        ([{**OCULUS, "at": {"pick": "box", "min": [-9, 0, -1], "max": [9, 1, 1]}}],
         r"the void pattern\.region\.0 \(oculus\) separates 1 of 2 pieces .* \(16 m2\) is around \(.*, 2, 0\) m"),
        ([OCULUS, {"do": "keep", "at": OCULUS["at"]}], r"pattern\.region\.1: the region misses the surface"),
    ],
)  # fmt: skip
def test_voids_that_take_the_supports_say_so(regions, what):
    with pytest.raises(DsfabError, match=what):
        draft(wall(*regions))


@pytest.mark.parametrize(
    ("region", "what"),
    [
        ({**OCULUS, "width": 0.2}, r"pattern\.region\.0: width is for do = 'rim'"),
        ({"do": "rim", "at": {"pick": "boundary"}}, r"pattern\.region\.0: do = 'rim' needs an outline"),
        ({"do": "hole", "at": {"pick": "all"}}, r"pattern\.region\.0\.do = 'hole'.*keep, void or rim|'keep', 'void'"),
        ({"at": {"pick": "all"}}, r"pattern\.region\.0\.do is missing"),
        ({**OCULUS, "radius": 1}, r"unknown key pattern\.region\.0\.radius"),
    ],
)
def test_mistakes_in_a_region_name_their_key(region, what):
    with pytest.raises(PresetError, match=what):
        wall(region)


def test_a_void_and_numbers_of_vertices_do_not_go_together():
    keep = {"do": "keep", "at": {"pick": "vertices", "indices": [0, 1, 2]}}
    with pytest.raises(PresetError, match=r"pattern\.region\.1\.at: .*the void pattern\.region\.0 \(oculus\)"):
        wall(OCULUS, keep)
    wall(RING, keep)


# ------------------------------------------------------------------------------------------------- supports and loads


DOME = {"surface.edge": 0.6}
TOP = {"do": "void", "at": {"pick": "ball", "center": [0, 0, 4], "radius": 1.0}, "name": "oculus"}
FLOOR = {
    "do": "void",
    "name": "door",
    "at": {"pick": "curve", "curves": [[[-0.8, -12, -1], [0.8, -12, -1], [0.8, -12, 2.2], [-0.8, -12, 2.2]]]},
}


@pytest.mark.parametrize("void", [TOP, FLOOR], ids=["oculus", "door"])
def test_a_void_adds_no_supports_at_its_edge(void):
    """Neither the edge of an oculus nor the jambs of a door are boundary that was supported."""
    load = [{"kind": "self_weight"}]
    preset = dsfab.load_preset(DOME_MODES, {**DOME, "pattern.region": [void], "surface.load": load})
    assert preset.surface.support[0].at == Boundary()
    held = draft(preset).load.supported
    V = draft(preset).surface.V[held]
    assert held.any()
    assert np.abs(V[:, 2]).max() < 1e-9
    assert np.abs(np.hypot(*V[:, :2].T) - 6).max() < 0.02
    if void is FLOOR:
        door = (V[:, 1] < 0) & (np.abs(V[:, 0]) < 0.9)
        assert np.abs(V[door, 0]) == pytest.approx(0.8)


def test_vertex_numbers_refer_to_the_mesh_of_the_user():
    mesh = grid(16, 12, 8.0, 6.0)
    bottom = np.flatnonzero(mesh.V[:, 1] == 0)
    void = {"do": "void", "at": {"pick": "ball", "center": [0, 0, 0], "radius": 1.0}}
    made = draft(
        dsfab.Preset(
            surface=mesh,
            supports=[dsfab.Support(dsfab.Vertices(tuple(bottom.tolist())))],
            loads=[dsfab.SelfWeight((0, -1, 0))],
            statics={"thickness": 0.05},
            pattern={"region": [void]},
        )
    )
    held = made.surface.V[made.load.supported]
    assert len(held) in (len(bottom) - 2, len(bottom) - 1)
    assert not held[:, 1].any()
    assert held[:, 0].min() >= 1 - 1e-9


def test_a_load_that_a_void_takes_away_says_so():
    with pytest.raises(SurfaceError, match=r"all vertices of surface\.load\.1 are inside .* void pattern\.region\.0"):
        draft(dsfab.load_preset(DOME_MODES, {**DOME, "pattern.region": [TOP]}))


def test_reports_list_only_supports_outside_of_voids():
    from dsfab.report.design.facts import balance

    load = [{"kind": "self_weight"}]
    design = draft(dsfab.load_preset(DOME_MODES, {**DOME, "pattern.region": [TOP], "surface.load": load}))
    told = balance(design, design.load, design.statics.equilibrium)
    assert told["supports"][0]["reaction_N"] == pytest.approx(told["reaction_N"], abs=1.0)
    assert -told["load_N"][2] == pytest.approx(told["reaction_N"][2], rel=1e-6)


def test_support_tables_use_the_supports_of_the_surface_without_void():
    """The edge of an oculus is in no table and touches no piece as if it were held."""
    load = [{"kind": "self_weight"}]
    design = dsfab.run(dsfab.load_preset(DOME_MODES, {**DOME, "pattern.region": [TOP], "surface.load": load}))
    (ring,) = load_facts(design)["supports"]
    assert ring["vertices"] == design.load.supported.sum()
    assert ring["along_m"] == pytest.approx(2 * np.pi * 6, rel=0.01)
    (piece,) = fabrication(design).pieces
    assert piece.supports == (1,)


def test_objections_are_to_the_vertices_that_were_numbered_before_the_void():
    mesh = dsfab.load_preset(DOME_MODES, DOME).surface.build()
    ring = np.flatnonzero(np.abs(mesh.V[:, 2]) < 1e-9)
    feet = [{"at": {"pick": "vertices", "indices": [int(ring[k])]}} for k in (0, len(ring) // 3, 2 * len(ring) // 3)]
    given = {**DOME, "pattern.region": [TOP], "surface.load": [{"kind": "self_weight"}], "surface.support": feet}
    preset = dsfab.load_preset(DOME_MODES, given)
    made = draft(preset)
    said = [one.text for one in objections(preset, made.surface, made.statics.cases) if "holds only" in one.text]
    assert len(said) == 3
    assert all(", 0) m, and carries" in text for text in said)


# ------------------------------------------------------------------------------------------------------- statics


def holed_plate(edge: float) -> Surface:
    """The wall with its oculus, meshed by a Delaunay triangulation of its own."""
    x, y = np.meshgrid(np.linspace(-4, 4, round(8 / edge) + 1), np.linspace(-3, 3, round(6 / edge) + 1))
    square = np.c_[x.ravel(), y.ravel()]
    turn = np.linspace(0, 2 * np.pi, round(2 * np.pi * 0.8 / edge * 2), endpoint=False)
    circle = np.array([0.6, 0.3]) + 0.8 * np.c_[np.cos(turn), np.sin(turn)]
    away = np.hypot(*(square - (0.6, 0.3)).T)
    points = np.concatenate([square[away > 0.8 + 0.4 * edge], circle])
    F = Delaunay(points).simplices
    F = F[np.hypot(*(points[F].mean(axis=1) - (0.6, 0.3)).T) > 0.8 * np.cos(np.pi / len(turn)) - 1e-9]
    return Surface(np.c_[points, np.zeros(len(points))], F)


def test_statics_with_a_void_are_those_of_a_plate_meshed_with_the_hole():
    fine = {**WALL, "surface": {**WALL["surface"], "edge": 0.12}}
    ours = draft(dsfab.Preset(**fine, pattern={"region": [OCULUS]}))
    keys = {"supports": WALL["surface"]["support"], "loads": WALL["surface"]["load"], "statics": WALL["statics"]}
    theirs = draft(dsfab.Preset(surface=holed_plate(0.12), **keys))
    full = draft(dsfab.Preset(**fine))
    assert ours.surface.area == pytest.approx(48 - np.pi * 0.64, rel=1e-3)
    one, two = ours.statics.equilibrium, theirs.statics.equilibrium
    assert one.compliance == pytest.approx(two.compliance, rel=2e-3)
    assert one.largest_displacement == pytest.approx(two.largest_displacement, rel=5e-3)
    assert abs(full.statics.equilibrium.compliance / one.compliance - 1) > 0.01
    weight = 7850 * 9.80665 * 0.06 * ours.surface.area
    assert ours.load.force.sum(axis=0) == pytest.approx([0, -weight, 0], rel=1e-9, abs=1e-6)


# ------------------------------------------------------------------------------------------------------- the sheet


def kept_only(surface: Surface, regions: list[PatternRegion], rim: float = 0.0):
    """The sheet of regions alone, of a surface that is cut along them."""
    from dsfab.pattern import kept_layers

    made = with_regions(surface, regions).surface
    layers = kept_layers(made, np.zeros(made.n, dtype=bool), 0.0, rim, [one for one in regions if one.do != "void"])
    return cut(made, [layer.field for layer in layers], [layer.levels for layer in layers], 0.05).subset()


def test_a_solid_region_has_its_area_and_its_straight_edges():
    sheet = kept_only(PLATE, [PatternRegion(PlanPolygon(SQUARE), "keep")])
    assert sheet.surface.area == pytest.approx(2.2**2, rel=1e-9)
    edge = sheet.surface.V[sheet.surface.loops[0]][:, :2]
    assert np.abs(depth_in([np.array(SQUARE)], edge)).max() < 1e-9


def test_a_band_goes_round_on_the_inside_of_its_outline():
    region = PatternRegion(PlanPolygon(SQUARE), "rim", 0.25)
    sheet = kept_only(PLATE, [region])
    assert sheet.surface.area == pytest.approx(2.2**2 - 1.7**2, rel=0.02)
    outer, inner = (sheet.surface.V[loop][:, :2] for loop in sheet.surface.loops)
    assert np.abs(depth_in([np.array(SQUARE)], outer)).max() < 1e-9
    assert np.abs(depth_in([np.array(SQUARE)], inner) - 0.25).max() < 0.03 * 0.25 + 0.01
    ring = kept_only(PLATE, [PatternRegion(Ball((4, 3, 0), 1.5), "rim", 0.4)])
    assert ring.surface.area == pytest.approx(np.pi * (1.5**2 - 1.1**2), rel=0.01)


def test_a_band_has_the_same_area_on_cut_and_on_uncut_faces():
    made = with_regions(PLATE, [PatternRegion(PlanPolygon(SQUARE), "rim", 0.5)]).surface
    (band,) = region_bands(made, [PatternRegion(PlanPolygon(SQUARE), "rim", 0.5)], 0.0)
    layer = band.layer(-np.abs(depth_in([np.array(SQUARE)], made.V[:, :2])))
    sheet = cut(made, [layer.field], [layer.levels], 0.0).subset()
    assert sheet.surface.area == pytest.approx(2.2**2 - 1.2**2, rel=0.05)
    assert np.abs(depth_in([np.array(SQUARE)], sheet.surface.V[sheet.surface.loops[0]][:, :2])).max() < 1e-9


def test_a_band_is_measured_along_the_surface():
    """Around the pole of a sphere: between two polar angles."""
    ball = sphere(5, 2.0)
    region = PatternRegion(
        PlanPolygon(tuple((np.cos(t), np.sin(t)) for t in np.linspace(0, 2 * np.pi, 120)[:-1]), 0.0), "rim", 0.3
    )
    sheet = kept_only(ball, [region])
    inner = np.arcsin(0.5) - 0.15
    assert sheet.surface.area == pytest.approx(8 * np.pi * (np.cos(inner) - np.cos(np.arcsin(0.5))), rel=0.02)


def test_regions_that_overlap_are_united():
    regions = [PatternRegion(PlanPolygon(tuple(np.add(SQUARE, k * 1.1).tolist())), "keep") for k in (0, 1)]
    assert kept_only(PLATE, regions).surface.area == pytest.approx(2 * 2.2**2 - 1.1**2, rel=1e-6)


def test_a_rim_region_without_width_takes_the_width_of_the_rim():
    region = PatternRegion(PlanPolygon(SQUARE), "rim")
    made = with_regions(PLATE, [region]).surface
    assert region_bands(made, [region], 0.2)[0].width == 0.2
    assert region_bands(made, [region], 0.0)[0].width == pytest.approx(2.2 / 8)


def test_a_band_without_an_edge_on_the_surface_says_so():
    with pytest.raises(PatternError, match=r"the outline of pattern\.region\.0 does not cross the surface"):
        region_bands(PLATE, [PatternRegion(Ball((4, 3, 0), 100.0), "rim")], 0.2)


# ------------------------------------------------------------------------------------------------------- whole designs

MODES = {"method": "modes", "major": {"frequency": 4.0}, "minor": {"frequency": 4.0}}
WAYS = {
    "stripes": {},
    "constant": {"width": {"rule": "constant", "solid_fraction": 0.45}},
    "graded": {"width": {"rule": "graded", "solid_fraction": 0.45}, "keep": 0.3},
    "modes": MODES,
    "modes, graded": {**MODES, "width": {"rule": "graded", "solid_fraction": 0.45}},
    "modes, tidied": {**MODES, "tidy": True, "fillet": 0.03},
    "plain share": {"width": {"solid_fraction": 0.45}},
    "one family": {"families": "major"},
}


@pytest.fixture(scope="module")
def drafted():
    return draft(wall(OCULUS, RING, BAND))


@pytest.mark.slow
@pytest.mark.parametrize("way", list(WAYS))
def test_every_pattern_knows_its_regions(way, drafted):
    preset = wall(OCULUS, RING, BAND, **WAYS[way])
    assert preset.surface == drafted.preset.surface
    before = {name: getattr(drafted, name) for name in ("surface", "statics", "diffusion")}
    design = dsfab.Design.from_results(preset, **before).until("thickening")
    sheet, surface = design.sheet, design.surface
    centre = np.linalg.norm(sheet.surface.centroids - (0.6, 0.3, 0), axis=1)
    assert centre.min() > 0.8 * (1 - 2 * LINE_TOLERANCE) - 0.02
    material = np.bincount(sheet.parent, sheet.surface.areas, surface.m)
    for region in design.preset.pattern.region[1:]:
        inside = region.faces(surface)
        solid = (
            inside
            if region.do == "keep"
            else inside & (np.linalg.norm(surface.V - (0.6, 0.3, 0), axis=1)[surface.F].min(axis=1) > 1.41)
        )
        assert solid.any()
        assert np.allclose(material[solid], surface.areas[solid], rtol=1e-6), region.do
    if wanted := design.preset.pattern.width.solid_fraction:
        assert sheet.surface.area / surface.area == pytest.approx(wanted, abs=6e-3)
    assert design.solid.pieces == 1 or way == "one family"


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    [
        {"method": "auto", "major": {"spacing": 1.0}, "minor": {"spacing": 1.0}},
        {"width": {"rule": "stressed", "solid_fraction": 0.45, "steps": 4}, "workshop": True},
    ],
)
def test_searches_know_their_regions(more):
    preset = wall(OCULUS, BAND, **{"width": {"rule": "constant", "solid_fraction": 0.45}, **more})
    design = dsfab.Design.from_preset(preset).until("slicing")
    inside = design.preset.pattern.region[1].faces(design.surface)
    material = np.bincount(design.sheet.parent, design.sheet.surface.areas, design.surface.m)
    assert np.allclose(material[inside], design.surface.areas[inside], rtol=1e-6)
    assert design.sheet.surface.area / design.surface.area == pytest.approx(0.45, abs=6e-3)


@pytest.mark.slow
def test_revising_begins_where_a_region_is_cut():
    one = dsfab.run(wall(OCULUS, RING))
    two = dsfab.revise(one, wall(OCULUS, {**RING, "width": 0.4, "name": "ring"}))
    assert two.statics is one.statics
    assert two.sheet.surface.area > one.sheet.surface.area
    three = dsfab.revise(one, wall({**OCULUS, "do": "keep"}, RING))
    fresh = dsfab.run(three.preset)
    assert three.surface.area > one.surface.area
    assert np.array_equal(three.solid.V, fresh.solid.V)
    four = dsfab.revise(one, wall())
    assert four.surface.m < one.surface.m


@pytest.mark.slow
def test_a_folder_holds_its_regions(tmp_path):
    import ezdxf

    document = ezdxf.new()
    document.header["$INSUNITS"] = 6
    document.modelspace().add_circle((0.6, 0.3), 0.8)
    document.saveas(tmp_path / "oculus.dxf")
    given = {"do": "void", "at": {"pick": "curve", "file": str(tmp_path / "oculus.dxf")}}
    preset = dsfab.Preset(**WALL, pattern=wall(given, BAND).pattern, export={"formats": ["stl"]})
    design = dsfab.run(preset)
    design.save(tmp_path / "out", picture=False)
    (tmp_path / "oculus.dxf").unlink()
    read = dsfab.load_preset(tmp_path / "out" / "preset.toml")
    assert read.pattern.region[0].at.file is None
    again = dsfab.run(read)
    assert np.array_equal(again.solid.V, design.solid.V)
    assert np.array_equal(again.solid.F, design.solid.F)


def test_an_asymmetric_region_gives_a_note():
    design = dsfab.run(wall(RING))
    assert any(
        "stripes are equal at 4 symmetric places, but these regions are equal at fewer places: pattern.region.0 at "
        "2" in n.text
        for n in design.notes
    )
    middle = {**RING, "at": {"pick": "ball", "center": [0, 0.3, 0], "radius": 1.7}}
    assert not any("symmetric places" in note.text for note in dsfab.run(wall(middle)).notes)
    assert one_sided_message(design.surface, design.preset.pattern.region, None) == ""


def test_a_void_gives_a_note_with_its_area():
    notes = [note.text for note in draft(wall(OCULUS)).notes]
    assert "pattern.region.0 (oculus) is void: 2.01 m2 of 48 m2" in notes


def test_the_preview_ends_regions_at_their_drawn_outline(drafted):
    near, _ = distances(drafted)
    inside = drafted.preset.pattern.region[2].faces(drafted.surface)
    deep = np.ones(drafted.surface.n, dtype=bool)
    deep[drafted.surface.F[~inside]] = False
    assert deep.any()
    assert (near[deep] < -1e30).all()
    shore = np.zeros(drafted.surface.n, dtype=bool)
    shore[drafted.surface.F[inside]] = True
    far = np.linalg.norm(drafted.surface.V[:, :2] - (0.6, 0.3), axis=1) > 2
    edge = near[shore & ~deep & far]
    assert ((edge >= 0) & (edge < 1e-2 * near.max())).all()


def test_the_editor_begins_with_regions(drafted):
    facts, arrays = draft_model(drafted)
    assert np.isfinite(arrays["kept"]).all()
    assert (arrays["kept"][:, 0] < 0).any()
    assert facts
