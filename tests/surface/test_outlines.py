"""Pickers by an outline: polygons in plan, closed curves of drawings, strokes of a brush."""

import shutil
import uuid
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import dsfab
from dsfab.core.errors import PresetError, SurfaceError
from dsfab.surface import Ball, Box, Brush, ClosedCurves, PlanPolygon, Side, Surface
from dsfab.surface.files.reading import DrawingBudget
from dsfab.surface.files.rhino_and_step import read_rhino
from dsfab.surface.loads.outline_cuts import with_outline
from dsfab.surface.loads.outlines import depth_in, enclosed_area, extent_of, self_crossing
from dsfab.surface.loads.pickers import pierced_faces
from tests.presets import DOME_MODES
from tests.shapes import grid, sphere, stacked
from tests.surface.outline_drawings import DOOR, drawing, star

L_SHAPE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0))
PLATE = grid(20, 20, 1.0, 1.0)  # of 1 x 1


# ------------------------------------------------------------------------------------------------- polygons in a plane


def test_depths_in_an_l_shape_are_those_of_the_nearest_side():
    points = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [-1.0, -1.0], [0.5, 1.9], [1.0, 1.0]])
    wanted = [0.5, 0.5, -0.5, -np.sqrt(2), 0.1, 0.0]
    assert np.allclose(depth_in([np.array(L_SHAPE)], points), wanted, atol=1e-12)


def test_a_polygon_in_another_is_an_island():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    found = depth_in([4 * square, 1 + 2 * square], np.array([[0.5, 0.5], [2.0, 2.0], [9.0, 9.0]]))
    assert found[0] == 0.5
    assert (found[1:] < 0).all()


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), corners=st.integers(3, 30))
def test_the_points_within_a_polygon_cover_its_area(seed, corners):
    P = star(seed, corners)
    assert self_crossing(P) is None
    lattice = np.stack(np.meshgrid(*2 * [np.linspace(-1.31, 1.31, 161)]), axis=-1).reshape(-1, 2)
    depth = depth_in([P], lattice)
    assert (depth > 0).mean() * 2.62**2 == pytest.approx(enclosed_area(P), abs=0.08)
    assert np.allclose(depth_in([P[::-1]], lattice), depth, atol=1e-12)
    assert (np.abs(np.diff(depth.reshape(161, 161), axis=1)) <= 2.62 / 160 + 1e-9).all()


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), corners=st.integers(4, 12))
def test_two_corners_that_change_places_make_a_polygon_cross_itself(seed, corners):
    turn = 2 * np.pi * np.arange(corners) / corners
    P = np.c_[np.cos(turn), np.sin(turn)]
    k = seed % corners
    P[[k, (k + 1) % corners]] = P[[(k + 1) % corners, k]]
    assert self_crossing(P) is not None


# ------------------------------------------------------------------------------------------------------- in plan


def test_a_plan_polygon_picks_the_vertices_above_and_below_it():
    x, y, _ = PLATE.V.T
    picked = PlanPolygon(((0.2, 0.2), (0.8, 0.2), (0.8, 0.5), (0.2, 0.5))).vertices(PLATE)
    assert np.array_equal(picked, (x > 0.199) & (x < 0.801) & (y > 0.199) & (y < 0.501))


def test_heights_pick_the_upper_one_of_two_shells():
    ball, square = sphere(3), ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    every, upper = (PlanPolygon(square, low=low).vertices(ball) for low in (None, 0.0))
    assert np.array_equal(upper, every & (ball.V[:, 2] > 0))
    assert every.sum() > upper.sum() > 0
    assert np.array_equal(PlanPolygon(square, high=0.0).vertices(ball), every & (ball.V[:, 2] <= 1e-6))


@pytest.mark.parametrize(
    ("polygon", "what"),
    [
        (((0, 0), (1, 0)), "polygon has 2 different corners; give three or more"),
        (((0, 0), (1, 0), (1, 0), (0, 0)), "polygon has 2 different corners"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), r"side 0 and side 2 .* meet at \(0.5, 0.5\)"),
        (((0, 0), (1, 0), (2, 0)), "no area|touches itself"),
    ],
)
def test_polygons_that_are_none_are_refused(polygon, what):
    with pytest.raises(SurfaceError, match=what):
        PlanPolygon(polygon)


def test_mistakes_in_a_preset_name_their_key():
    bad = {"surface.support": [{"at": {"pick": "plan", "polygon": [[0, 0], [1, 0]]}}]}
    with pytest.raises(PresetError, match=r"surface\.support\.0\.at: polygon has 2 different corners"):
        dsfab.load_preset(DOME_MODES, bad)
    bad = {"surface.support": [{"at": {"pick": "plan", "polygon": [[0, 0], [1, 0], [1, 1]], "lowest": 1}}]}
    with pytest.raises(PresetError, match=r"unknown key surface\.support\.0\.at\.lowest; did you mean low\?"):
        dsfab.load_preset(DOME_MODES, bad)


def test_a_polygon_beside_the_surface_says_how_far():
    with pytest.raises(SurfaceError, match="picks no vertex; the nearest vertex is 4 m out of reach"):
        PlanPolygon(((5, 0), (6, 0), (6, 1), (5, 1))).vertices(PLATE)


# ------------------------------------------------------------------------------------------------------- the brush


def test_a_brush_picks_vertices_near_its_points_and_strokes():
    """Three dots of two strokes: the first two are joined, the third is further off than two radii."""
    stroke = Brush(((0.2, 0.2, 0.0), (0.35, 0.2, 0.0), (0.8, 0.8, 0.0)), 0.1)
    on_the_way = np.clip(PLATE.V, (0.2, 0.2, 0), (0.35, 0.2, 0))
    away = np.min([np.linalg.norm(PLATE.V - p, axis=1) for p in (on_the_way, (0.8, 0.8, 0.0))], axis=0)
    assert np.array_equal(stroke.vertices(PLATE), away <= 0.1 + 1e-6 * PLATE.size)
    assert Brush(((0.8, 0.8, 0.0),) * 2, 0.1).vertices(PLATE).sum() == (away[PLATE.V[:, 1] > 0.5] <= 0.1 + 1e-6).sum()


@pytest.mark.slow
@given(st.floats(0.05, 0.2), st.floats(-1.5, 1.5), st.floats(0.5, 2.5))
@settings(max_examples=25, deadline=None)
def test_the_outline_of_a_stroke_has_no_scallops(radius, turn, bend):
    """Dots a third of the radius apart, as the editor paints them, straight and along an arc: what is cut ends a radius
    from the stroke, within 0.6 % of it. Balls alone would be 1.4 % off."""
    way = np.linspace(-0.4, 0.4, int(0.8 / (radius / 3)) + 2)
    for x, y in ((way, 0 * way), (np.sin(bend * way) / bend, (1 - np.cos(bend * way)) / bend)):
        P = np.stack([x, y], axis=1) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        plate = Surface(PLATE.V * 2 - (1, 1, 0), PLATE.F)
        extent = Brush(tuple((x, y, 0.0) for x, y in P.tolist()), radius).extent(plate)
        made = with_outline(plate, extent, np.zeros(plate.n, dtype=bool)).surface
        within = (extent.depth(made.centroids) > 0)[made.edges.pairs // 3]
        ends = made.V[made.edges.ends[made.edges.count == 2][within[:, 0] != within[:, 1]]]
        shown = np.concatenate([ends[:, 0], ends.mean(axis=1)])[:, :2]
        every = np.linspace(0, len(P) - 1, 2001)
        stroke = np.stack([np.interp(every, np.arange(len(P)), c) for c in P.T], axis=1)
        away = cKDTree(stroke).query(shown)[0]
        assert np.abs(away - radius).max() < 6e-3 * radius


# ------------------------------------------------------------------------------------------------------- drawings


def test_every_closed_curve_of_a_dxf_has_its_area(tmp_path):
    document = drawing(tmp_path)
    space, pi = document.modelspace(), np.pi
    space.add_circle((500, 500), 200, dxfattribs={"layer": "circle"})
    space.add_ellipse((500, 500), (300, 0), 0.5, dxfattribs={"layer": "ellipse"})
    space.add_lwpolyline([(0, 0, 0, 0, 1), (400, 0, 0, 0, 0), (400, 400), (0, 400)], close=True,
                         dxfattribs={"layer": "bulge"})  # fmt: skip
    space.add_polyline3d([(0, 0, 5), (300, 0, 5), (300, 200, 5)], close=True, dxfattribs={"layer": "3d"})
    for a, b in (((0, 0), (300, 0)), ((300, 400), (300, 0)), ((300, 400), (0, 400)), ((0, 0), (0, 400))):
        space.add_line(a, b, dxfattribs={"layer": "lines"})
    space.add_arc((0, 0), 100, 0, 180, dxfattribs={"layer": "arcs"})
    space.add_line((-100, 0), (100, 0), dxfattribs={"layer": "arcs"})
    turn = 2 * pi * np.arange(24) / 24
    spline = space.add_spline(dxfattribs={"layer": "spline"})
    spline.set_closed([(400 * np.cos(t), 400 * np.sin(t), 0) for t in turn], degree=3)
    space.add_text("a door", dxfattribs={"layer": "circle"})
    document.saveas(tmp_path / "all.dxf")
    # a B-spline lies within its control polygon: radius times (2 + cos h) / 3
    inner = 400 * (2 + np.cos(turn[1])) / 3
    areas = {
        "circle": pi * 200**2, "ellipse": pi * 300 * 150, "bulge": 400**2 + pi * 200**2 / 2, "3d": 30_000,
        "lines": 120_000, "arcs": pi * 100**2 / 2, "spline": pi * inner**2,
    }  # fmt: skip
    for layer, area in areas.items():
        (loop,) = ClosedCurves(tmp_path / "all.dxf", layer).loops()
        assert enclosed_area(loop[:, :2]) == pytest.approx(1e-6 * area, rel=2e-3), layer
    assert len(ClosedCurves(tmp_path / "all.dxf").loops()) == len(areas)
    in_cm = ClosedCurves(tmp_path / "all.dxf", "circle", "cm").loops()[0]
    assert enclosed_area(in_cm[:, :2]) == pytest.approx(1e-4 * pi * 200**2, rel=1e-3)


def test_a_curve_in_a_block_is_where_the_block_is(tmp_path):
    document = drawing(tmp_path)
    block = document.blocks.new("oculus")
    block.add_circle((0, 0), 100, dxfattribs={"layer": "oculus"})
    document.modelspace().add_blockref("oculus", (500, 700))
    document.saveas(tmp_path / "block.dxf")
    (loop,) = ClosedCurves(tmp_path / "block.dxf", "oculus").loops()
    assert np.allclose(loop.mean(axis=0), (0.5, 0.7, 0), atol=1e-3)


@pytest.mark.slow
def test_curves_of_a_3dm_file_are_read_from_the_named_layer(tmp_path):
    rhino3dm = pytest.importorskip("rhino3dm")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Centimeters
    for name in ("door", "oculus"):
        layer = rhino3dm.Layer()
        layer.Name = name
        model.Layers.Add(layer)
    attributes = rhino3dm.ObjectAttributes()
    attributes.LayerIndex = 1
    model.Objects.AddCircle(rhino3dm.Circle(rhino3dm.Point3d(50, 50, 0), 20), attributes)
    attributes.LayerIndex = 0
    corners = [rhino3dm.Point3d(*p) for p in ((0, 0, 0), (90, 0, 0), (90, 0, 210), (0, 0, 210), (0, 0, 0))]
    model.Objects.AddPolyline(rhino3dm.Polyline(corners), attributes)
    assert model.Write(str(tmp_path / "m.3dm"), 7)
    (circle,), (door,) = (ClosedCurves(tmp_path / "m.3dm", name).loops() for name in ("oculus", "door"))
    assert enclosed_area(circle[:, :2]) == pytest.approx(np.pi * 0.04, rel=1e-3)
    assert np.allclose(door, [(0, 0, 0), (0.9, 0, 0), (0.9, 0, 2.1), (0, 0, 2.1)])
    with pytest.raises(SurfaceError, match=r"no layer 'dor'; did you mean door\?"):
        ClosedCurves(tmp_path / "m.3dm", "dor").loops()


def with_blocks(path: Path, depth: int) -> Path:
    """A 3DM drawing of one square, 1 m wide, in a block, in blocks of two of the one before, the last one once."""
    rhino3dm = pytest.importorskip("rhino3dm")
    model, plain, origin = rhino3dm.File3dm(), rhino3dm.ObjectAttributes(), rhino3dm.Point3d(0, 0, 0)
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    corners = [rhino3dm.Point3d(*p) for p in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0))]
    things = (rhino3dm.Polyline(corners).ToPolylineCurve(),)
    move = rhino3dm.Transform.Translation
    for level in range(depth):
        number = model.InstanceDefinitions.Add(f"{level}", "", "", "", origin, things, (plain,) * len(things))
        block = model.InstanceDefinitions[number].Id
        places = (move(0, 0, 0), move(3.0 * 2**level, 0, 0))
        things = tuple(rhino3dm.InstanceReference(block, place) for place in places)
    turned = rhino3dm.Transform.Rotation(np.pi / 2, rhino3dm.Vector3d(0, 0, 1), origin)
    both = rhino3dm.Transform.Multiply(move(0, 10, 0), turned)
    model.Objects.Add(rhino3dm.InstanceReference(block, both), plain)
    assert model.Write(str(path), 7)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("depth", [1, 2, 4])
def test_curves_of_3dm_blocks_appear_only_at_their_insertions(depth, tmp_path):
    loops = ClosedCurves(with_blocks(tmp_path / "a.3dm", depth)).loops()
    left = sorted(float(loop[:, 1].min()) for loop in loops)  # what went along x goes along y, from 10
    assert left == pytest.approx([10 + 3 * k for k in range(2 ** (depth - 1))])
    for loop in loops:
        assert np.allclose(np.ptp(loop, axis=0), (1, 1, 0))
        assert np.allclose((loop[:, 0].min(), loop[:, 0].max()), (-1, 0))


def test_blocks_of_a_3dm_file_within_blocks_are_bounded(tmp_path):
    with pytest.raises(SurfaceError, match="blocks are nested more than 16 deep"):
        ClosedCurves(with_blocks(tmp_path / "deep.3dm", 18)).loops()
    many = with_blocks(tmp_path / "many.3dm", 7)  # 1 + 2 + .. + 64 insertions, and 64 squares
    assert len(read_rhino(many, DrawingBudget(entities=191)).runs) == 64
    with pytest.raises(SurfaceError, match="191 entities, but 190 is the limit; put the outlines"):
        read_rhino(many, DrawingBudget(entities=190))


def test_a_missing_block_of_a_3dm_file_is_reported(tmp_path):
    rhino3dm = pytest.importorskip("rhino3dm")
    model, nobody = rhino3dm.File3dm(), uuid.uuid4()
    model.Objects.Add(rhino3dm.InstanceReference(nobody, rhino3dm.Transform.Identity()), rhino3dm.ObjectAttributes())
    assert model.Write(str(tmp_path / "linked.3dm"), 7)
    with pytest.raises(SurfaceError, match="the file inserts a block but lacks its content; explode or embed it"):
        ClosedCurves(tmp_path / "linked.3dm").loops()


def test_without_rhino3dm_a_3dm_drawing_names_the_package_to_install(tmp_path, monkeypatch):
    (tmp_path / "x.3dm").write_bytes(b"0")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(SurfaceError, match=r'pip install "dsfab\[rhino\]"'):
        ClosedCurves(tmp_path / "x.3dm").loops()


def bad_drawings(folder: Path) -> dict[str, tuple[ClosedCurves, str]]:
    document = drawing(folder)
    document.modelspace().add_lwpolyline([(0, 0), (300, 0), (300, 400)], dxfattribs={"layer": "open"})
    document.modelspace().add_text("no curve", dxfattribs={"layer": "text"})
    document.modelspace().add_lwpolyline([(0, 0), (1, 1), (1, 0), (0, 1)], close=True, dxfattribs={"layer": "eight"})
    document.saveas(folder / "bad.dxf")
    drawing(folder, unit=0).saveas(folder / "unitless.dxf")
    (folder / "broken.dxf").write_text("this is no DXF")
    return {
        "open": (
            ClosedCurves(folder / "bad.dxf", "open"),
            r"layer 'open', .*\(300, 400, 0\) are 500 apart.*close the curve",
        ),
        "text": (ClosedCurves(folder / "bad.dxf", "Defpoints"), "layer 'Defpoints', has no curve"),
        "eight": (ClosedCurves(folder / "bad.dxf", "eight"), "curve 0, seen along its normal, crosses"),
        "no layer": (ClosedCurves(folder / "bad.dxf", "opne"), "no layer 'opne'; did you mean open.* its layers are"),
        "no file": (ClosedCurves(folder / "none.dxf"), "none.dxf cannot be read: No such file"),
        "no unit": (ClosedCurves(folder / "unitless.dxf"), 'does not say its unit; give unit = "mm"'),
        "broken": (ClosedCurves(folder / "broken.dxf"), "cannot be read as DXF"),
        "suffix": (ClosedCurves(folder / "door.png"), "give a .dxf or a .3dm file"),
        "unit": (ClosedCurves(folder / "bad.dxf", "eight", "ell"), "unit = 'ell' is not known"),
    }


@pytest.mark.parametrize(
    "name", ["open", "text", "eight", "no layer", "no file", "no unit", "broken", "suffix", "unit"]
)
def test_drawings_that_cannot_be_used_say_why(tmp_path, name):
    picker, what = bad_drawings(tmp_path)[name]
    with pytest.raises(SurfaceError, match=what) as refused:
        picker.vertices(PLATE)
    assert "\n" not in str(refused.value)


def test_a_file_or_curves_but_not_both():
    for keys in ({}, {"file": Path("a.dxf"), "curves": (((0, 0, 0), (1, 0, 0), (1, 1, 0)),)}):
        with pytest.raises(SurfaceError, match="either file"):
            ClosedCurves(**keys)
    with pytest.raises(SurfaceError, match="layer and unit need a file"):
        ClosedCurves(curves=(((0, 0, 0), (1, 0, 0), (1, 1, 0)),), layer="door")


def test_a_door_drawn_in_elevation_is_in_the_wall_that_is_nearest():
    ball = sphere(4)
    picked = DOOR.vertices(ball)
    x, y, z = ball.V.T
    seen = (np.abs(x) <= 0.3) & (z >= -0.5) & (z <= 0.4)
    assert np.array_equal(picked, seen & (y < 0))
    through = ClosedCurves(curves=DOOR.curves, depth=4.0).vertices(ball)
    assert np.array_equal(through, seen)


def test_a_horizontal_curve_is_seen_from_above():
    ball, ring = sphere(4), np.linspace(0, 2 * np.pi, 60, endpoint=False)
    curve = tuple((0.5 * np.cos(t), 0.5 * np.sin(t), -7.0) for t in ring)
    picked = ClosedCurves(curves=(curve,)).vertices(ball)
    assert np.array_equal(picked, np.hypot(*ball.V.T[:2]) < 0.5 * np.cos(np.pi / 60) + 1e-6) or picked.sum() > 20
    assert (ball.V[picked, 2] > 0).any()
    assert (ball.V[picked, 2] < 0).any()


def test_curves_of_a_drawing_go_into_the_preset_that_is_saved(tmp_path):
    document = drawing(tmp_path)
    document.modelspace().add_circle((0, 0), 2500, dxfattribs={"layer": "top"})
    document.saveas(tmp_path / "top.dxf")
    shutil.copy(DOME_MODES, tmp_path / "p.toml")
    load = [{"kind": "pressure", "pressure": 500.0, "at": {"pick": "curve", "file": "top.dxf"}}]
    preset = dsfab.load_preset(tmp_path / "p.toml", {"surface.load": load})
    assert preset.surface.load[0].at.file == tmp_path / "top.dxf"
    held = preset.self_contained()
    assert held.surface.load[0].at.file is None
    surface = preset.surface.build()
    assert np.array_equal(held.surface.load[0].at.vertices(surface), preset.surface.load[0].at.vertices(surface))
    assert held.self_contained() is held


# ------------------------------------------------------------------------------------------------ extents in space


def test_the_depth_in_an_extent_grows_by_no_more_than_the_way():
    rng = np.random.default_rng(0)
    P, step = rng.normal(size=(500, 3)), 0.01 * rng.normal(size=(500, 3))
    for at in (Ball((0, 0, 0), 0.7), Box((-0.5, -0.2, -1), (0.5, 0.3, 1)), Side("z", "max", 0.3), DOOR,
               PlanPolygon(L_SHAPE, -0.3, 0.4), Brush(((0, 0, 0), (1, 0, 0)), 0.4)):  # fmt: skip
        extent = extent_of(at, sphere(3))
        one, two = extent.depth(P), extent.depth(P + step)
        assert (np.abs(two - one) <= np.linalg.norm(step, axis=1) + 1e-12).all()
        assert (one > 0).any() or at is DOOR
        assert (one < 0).any()


def test_the_depth_in_a_box_is_to_its_nearest_wall():
    box = extent_of(Box((0, 0, 0), (2, 2, 4)), PLATE)
    found = box.depth(np.array([[1, 1, 2], [1, 1, 3.9], [1, 1, 5], [3, 3, 2], [0, 1, 1]]))
    assert np.allclose(found, [1, 0.1, -1, -np.sqrt(2), 0])
    assert box.creases.shape == (12, 2, 3)
    assert np.allclose(np.sort(np.linalg.norm(np.diff(box.creases, axis=1)[:, 0], axis=1)), [2] * 8 + [4] * 4)


def test_a_line_pierces_both_sides_of_a_ball():
    ball = sphere(4)
    faces, t = pierced_faces(ball, np.array([0.1, 0.2, -2.0]), np.array([0.1, 0.2, 2.0]))
    z = np.sqrt(1 - 0.05)
    assert np.allclose(-2 + 4 * t, [-z, z], atol=0.01)
    assert isinstance(ball, Surface)
    assert (ball.normals[faces][:, 2] * [-1, 1] > 0).all()


def test_a_narrow_gap_between_two_strokes_stays_open():
    """The gap is a tenth of a stroke's radius, and the mesh is much coarser."""
    radius, gap = 0.6, 0.06
    bend, x = radius + gap / 2, np.linspace(1, 3, 11)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)
    way = [*((s, -bend) for s in x), *zip(3 + bend * np.cos(turn), bend * np.sin(turn), strict=True)]
    way += [(s, bend) for s in x[::-1]]
    coarse = grid(7, 7, 8.0, 6.0)
    coarse = Surface(coarse.V - (1, 3.03, 0), coarse.F)
    extent = Brush(tuple((float(x), float(y), 0.0) for x, y in way), radius).extent(coarse)
    made = with_outline(coarse, extent, np.zeros(coarse.n, dtype=bool)).surface
    area = made.areas[extent.depth(made.centroids) > 0].sum()
    assert area == pytest.approx((4 + np.pi * bend) * 2 * radius + np.pi * radius**2, rel=5e-3)


@pytest.mark.parametrize(("degrees", "layers"), [(0.8, 2), (1.3, 1)])
def test_a_curve_is_seen_from_above_if_it_is_level_within_a_degree(degrees, layers):
    """A tilted curve is seen along its normal, and picks only the nearer of two roofs."""
    roofs, rise = stacked(PLATE, 0.5), np.tan(np.radians(degrees))
    curve = tuple((x, y, 2.0 + rise * x) for x, y in ((0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)))
    picked = ClosedCurves(curves=(curve,)).vertices(roofs)
    assert len(np.unique(np.round(roofs.V[picked, 2], 6))) == layers
