"""Pictures: framed whole, lit by the law, marked by what is there, the same twice, and refused in one sentence."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_erosion

from dsfab.core.errors import DsfabError, ExportError
from dsfab.render import light, marks, opengl
from dsfab.render.drawing import Annotations, edge_strengths, page_view, person, set_stage
from dsfab.render.lettering import PAPER, length_label, round_length
from dsfab.render.marks import tree
from dsfab.render.picture import Look, picture, write_png
from dsfab.render.scene import Body, Scene
from dsfab.render.view import VIEW_DEGREES, best_side, fit_view, named_side, up_axis
from dsfab.surface import LoadCase, Surface
from dsfab.surface.shapes import cylinder, dome, plate, sphere, tower

SIZE = (320, 240)
Z, Y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def thick(surface: Surface, thickness: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A crude closed solid: the surface moved both ways along its normals, with walls along its boundary."""
    off = thickness / 2 * surface.vertex_normals
    half = np.concatenate([surface.F[:, [0, 1]], surface.F[:, [1, 2]], surface.F[:, [2, 0]]])
    there = set(map(tuple, half.tolist()))
    rim = np.array([(a, b) for a, b in half.tolist() if (b, a) not in there], dtype=np.int64).reshape(-1, 2)
    n, (a, b) = surface.n, rim.T
    walls = np.concatenate([np.stack([a, a + n, b + n], axis=1), np.stack([a, b + n, b], axis=1)])
    return np.concatenate([surface.V + off, surface.V - off]), np.concatenate(
        [surface.F, surface.F[:, ::-1] + n, walls]
    )


def weighed(surface: Surface, held: np.ndarray, direction: np.ndarray = -Z) -> LoadCase:
    """Its weight, 1000 N/m2, on the marked supports."""
    force = 1000 * surface.vertex_areas[:, None] * direction
    return LoadCase(np.repeat(held[:, None], 3, axis=1), force, np.zeros(surface.n, dtype=bool))


def low(surface: Surface, axis: int = 2) -> np.ndarray:
    return surface.V[:, axis] < surface.V[:, axis].min() + 1e-6


def members(image: np.ndarray) -> np.ndarray:
    """Terracotta pixels: red well above blue. Paper, shadows, words, loads and supports are not."""
    return image[:, :, 0].astype(int) - image[:, :, 2] > 25


def near(image: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Number of pixels of nearly this colour above the strip of words, where the legend repeats it."""
    above = image[: int(0.84 * len(image))].astype(int)
    return int((np.abs(above - np.array(colour)).max(axis=2) < 30).sum())


def mask_extent(mask: np.ndarray) -> tuple[int, int, int, int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(rows[0]), int(rows[-1]), int(columns[0]), int(columns[-1])


SHAPES = {
    "dome": lambda: thick(dome(span=12.0, rise=4.0, oculus=3.0, edge=0.8)),
    "tower": lambda: thick(tower(width=9.0, height=30.0, taper=0.5, twist=90.0, edge=1.5), 0.3),
    "sphere of 20 mm": lambda: thick(sphere(radius=0.01, edge=0.002), 0.0005),
    "slab": lambda: thick(plate(length=8.0, width=5.0, edge=0.5), 0.2),
    "wall": lambda: _wall(),
    "far from the origin": lambda: _moved(thick(cylinder(radius=2.0, height=3.0, edge=0.5)), 5e4),
}


def _wall() -> tuple[np.ndarray, np.ndarray]:
    V, F = thick(plate(length=4.0, width=2.0, edge=0.25), 0.1)
    return V[:, [0, 2, 1]] * [1, -1, 1], F


def _moved(solid: tuple[np.ndarray, np.ndarray], far: float) -> tuple[np.ndarray, np.ndarray]:
    return solid[0] + far, solid[1]


@pytest.mark.parametrize("name", SHAPES)
def test_a_structure_fills_the_picture_and_is_not_clipped(name: str) -> None:
    image = picture(*SHAPES[name](), look=Look(SIZE))
    assert image.shape == (240, 320, 3)
    assert image.dtype == np.uint8
    top, bottom, left, right = mask_extent(members(image))
    assert top > 0
    assert left > 0
    assert right < 319
    assert bottom < 0.87 * 240  # above the words
    fill = max((bottom - top) / 240, (right - left) / 320)
    assert 0.5 < fill < 0.98
    assert members(image).mean() > 0.03


@pytest.mark.parametrize("name", SHAPES)
def test_a_scale_of_colours_lies_below_the_structure(name: str) -> None:
    """The names of its ends reach up to 8 of the 46 letters that a page is high."""
    V, F = SHAPES[name]()
    body, up = Body(V, F, np.array(PAPER.members, dtype=np.uint8)), np.array([0.0, 0.0, 1.0])
    for height, side in ((1200, "iso"), (600, "front")):
        view = page_view([body], named_side(V, up, side), (800, height), scale=True)
        assert view.page_coordinates(V)[:, 1].min() > -1 + 2 * 8 / 46


def test_a_ball_is_lit_from_the_upper_left() -> None:
    image = picture(*SHAPES["sphere of 20 mm"](), look=Look(SIZE))
    top, bottom, left, right = mask_extent(members(image))
    across, down = (right - left) // 4, (bottom - top) // 4
    lit = image[top + down : top + 2 * down, left + across : left + 2 * across].mean()
    dark = image[bottom - 2 * down : bottom - down, right - 2 * across : right - across].mean()
    assert lit > dark + 20


def test_the_paper_is_light_and_a_shadow_lies_under_a_dome() -> None:
    violet = replace(PAPER, person=(140, 40, 220))  # no grey
    image = picture(*thick(dome(span=12.0, rise=4.0, oculus=3.0, edge=0.8)), look=Look(SIZE, palette=violet)).astype(
        int
    )
    corner = image[:20, :20].reshape(-1, 3)
    assert (corner >= np.array(PAPER.paper) - 1).all()
    grey = (np.ptp(image, axis=2) < 25) & (abs(image.mean(axis=2) - 175) < 50)  # darker is a soffit
    assert binary_erosion(grey[: int(0.84 * 240)]).sum() > 100  # more than the smooth edges of dark members


def test_loads_and_supports_appear_in_their_colours_on_request() -> None:
    surface = dome(span=12.0, rise=4.0, oculus=0.0, edge=0.8)
    V, F = thick(surface)
    load = weighed(surface, low(surface))
    without, with_load = picture(V, F, look=Look(SIZE)), picture(V, F, surface=surface, load=load, look=Look(SIZE))
    assert near(without, PAPER.load) == 0
    assert near(without, PAPER.support) == 0
    assert near(with_load, PAPER.load) > 30
    assert near(with_load, PAPER.support) > 30


def test_a_load_on_held_vertices_only_is_not_drawn() -> None:
    surface = plate(length=2.0, width=1.0, edge=0.25)
    everywhere = LoadCase(np.ones((surface.n, 3)), np.ones((surface.n, 3)), np.zeros(surface.n))
    vertices, faces = marks.load_arrows(surface, everywhere, 2.0, 0.01, Z, Z)
    assert len(vertices) == len(faces) == 0


def test_a_few_arrows_stand_for_the_sum_of_hundreds_of_loads() -> None:
    surface = dome(span=12.0, rise=4.0, oculus=0.0, edge=0.3)
    load = weighed(surface, low(surface))
    free = ~load.supported
    pulls = marks.gathered_forces(surface.V, load.force, free, marks.SPREAD_LOAD_SPACING, 1.0, surface.size)
    assert free.sum() > 1000
    assert 8 < len(pulls.at) <= marks.SPREAD_LOAD_SPACING.most
    np.testing.assert_allclose(pulls.pull.sum(axis=0), load.force[free].sum(axis=0), rtol=1e-9, atol=1e-6)
    apart = np.linalg.norm(surface.V[pulls.at][:, None] - surface.V[pulls.at][None], axis=2) + 99 * np.eye(
        len(pulls.at)
    )
    assert apart.min() > 0.05 * surface.size


@pytest.mark.parametrize("turned", [False, True])
def test_a_pressing_arrow_ends_on_the_skin_and_a_pulling_arrow_begins_on_it(turned: bool) -> None:
    """Above the sheet, also if its faces look down, as those of files may: arrows hung under a stadium's roof."""
    surface = plate(length=2.0, width=1.0, edge=0.1)
    surface = Surface(surface.V, surface.F[:, ::-1]) if turned else surface
    middle = np.linalg.norm(surface.V - surface.V.mean(axis=0), axis=1).argmin()
    for sense in (-1.0, 1.0):
        force = np.zeros((surface.n, 3))
        force[middle, 2] = sense
        load = LoadCase(np.zeros((surface.n, 3)), force, force[:, 2] != 0)
        heights = marks.load_arrows(surface, load, 2.0, 0.05, Z, Z)[0][:, 2] - surface.V[middle, 2]
        assert heights.min() == pytest.approx(1.1 * 0.05)
        assert heights.max() == pytest.approx(1.1 * 0.05 + marks.LONGEST_POINT * 2.0)


def test_supports_point_away_from_the_structure() -> None:
    surface = plate(length=2.0, width=1.0, edge=0.1)
    left = low(surface, 0)
    rim = np.isin(np.arange(surface.n), surface.loops[0])
    np.testing.assert_array_equal(marks.support_side(surface, weighed(surface, left), surface.size, Z), [-1, 0, 0])
    np.testing.assert_array_equal(marks.support_side(surface, weighed(surface, rim), surface.size, Z), [0, 0, -1])
    both = left | (surface.V[:, 0] == surface.V[:, 0].max()) & (np.abs(surface.V[:, 1]) < 0.06)  # fewer on the right
    np.testing.assert_array_equal(marks.support_side(surface, weighed(surface, both), surface.size, Z), [0, 0, -1])
    cones, _ = marks.support_cones(surface, weighed(surface, left), surface.size, Z, 0.0)
    assert cones[:, 0].max() == pytest.approx(surface.V[:, 0].min())
    assert cones[:, 0].min() == pytest.approx(surface.V[:, 0].min() - marks.CONE_HEIGHT * surface.size)


def test_a_person_is_1_75_metres_tall() -> None:
    V, F = person(np.array([3.0, 2.0, 1.0]), np.array([1.0, 0, 0]), Z)
    assert np.ptp(V[:, 2]) == pytest.approx(1.75)
    assert V[:, 2].min() == pytest.approx(1.0)
    assert 0.4 < np.ptp(V[:, 0]) < 0.7
    assert F.max() < len(V)


def test_a_drawn_tree_has_the_asked_height_and_stands_on_its_foot() -> None:
    """And keeps left of the structure, which a person would stand right of."""
    V, F = tree(np.array([3.0, 2.0, 1.0]), Y, 6.0)
    assert (V[:, 1].min(), V[:, 1].max()) == pytest.approx((2.0, 8.0))
    assert V[np.argmin(V[:, 1]), [0, 2]] == pytest.approx([3.0, 1.0], abs=0.2)
    assert np.ptp(V[:, [0, 2]], axis=0) == pytest.approx([3.6, 3.6], abs=0.9)
    assert F.max() < len(V)
    ball = sphere(radius=4.0, edge=0.8)
    side, load = best_side(ball.V, Z), weighed(ball, low(ball))
    body = Body(ball.V, ball.F, PAPER.colour_bytes("person"))
    made = [
        set_stage(body, side, Z, 0.1, Annotations(ball, load, layers=(one,)), PAPER, SIZE) for one in ("tree", "person")
    ]
    tree_at, person_at = (float((stage.bodies[-1].V @ np.cross(Z, side.towards)).mean()) for stage in made)
    assert tree_at < -4 < 3 < person_at


def test_a_person_stands_beside_a_roof_whose_supports_are_drawn_taller() -> None:
    """Of 90 m: nothing of the roof is as low as a person on the ground, the feet of its supports."""
    roof = dome(span=90.0, rise=8.0, edge=5.0)
    side, load = best_side(roof.V, Z), weighed(roof, low(roof))
    stage = set_stage(
        Body(roof.V, roof.F, PAPER.colour_bytes("person")), side, Z, 0.3, Annotations(roof, load), PAPER, SIZE
    )
    somebody, right = stage.bodies[-1].V, np.cross(Z, side.towards)
    assert somebody[:, 2].min() == stage.level
    assert somebody[:, 2].max() < roof.V[:, 2].min()
    assert (somebody @ right).min() > (roof.V @ right).max()


@pytest.mark.parametrize(("radius", "drawn"), [(0.3, False), (2.0, True)])
def test_a_person_is_drawn_beside_structures_of_building_size(radius: float, drawn: bool) -> None:
    solid = thick(sphere(radius=radius, edge=radius / 5), radius / 20)
    violet = replace(PAPER, person=(140, 40, 220))
    image = picture(*solid, look=Look(SIZE, palette=violet)).astype(int)
    assert ((image[:, :, 2] - image[:, :, 1] > 80).sum() > 100) == drawn


def test_the_up_axis_is_z_unless_the_weight_acts_along_y() -> None:
    ball = sphere(radius=1.0, edge=0.3)
    np.testing.assert_array_equal(up_axis(ball.V, None, None), Z)
    np.testing.assert_array_equal(up_axis(ball.V, ball, weighed(ball, low(ball))), Z)
    feet = ball.V[:, 1] < -0.8
    np.testing.assert_array_equal(up_axis(ball.V, ball, weighed(ball, feet, -Y)), Y)
    np.testing.assert_array_equal(up_axis(ball.V, ball, weighed(ball, low(ball), -Y)), Z)  # wind along y
    wall = plate(length=2.0, width=1.0, edge=0.2)
    left = low(wall, 0)
    np.testing.assert_array_equal(up_axis(wall.V, wall, weighed(wall, left, -Y)), Y)
    np.testing.assert_array_equal(up_axis(wall.V, wall, weighed(wall, left)), Z)
    upright = Surface(wall.V[:, [0, 2, 1]], wall.F)
    np.testing.assert_array_equal(up_axis(upright.V, upright, weighed(upright, left, -Y)), Z)  # wind on a wall


def test_a_plate_loaded_in_its_plane_is_seen_face_on_and_a_dome_from_above() -> None:
    flat = best_side(plate(length=2.0, width=1.0, edge=0.2).V, Y)
    assert flat.front
    assert flat.towards @ Z > 0.98
    round_ = best_side(dome(span=12.0, rise=4.0, oculus=0.0, edge=0.8).V, Z)
    assert not round_.front
    assert 15 < np.degrees(np.arcsin(round_.towards @ Z)) < 30
    high = best_side(tower(width=9.0, height=30.0, taper=0.5, twist=90.0, edge=1.5).V, Z)
    assert np.degrees(np.arcsin(high.towards @ Z)) < 10


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.floats(1e-3, 1e3), st.floats(0.5, 2.0))
def test_a_framed_cloud_of_points_fills_its_box(seed: int, scale: float, aspect: float) -> None:
    random = np.random.default_rng(seed)
    points = scale * (random.normal(size=(50, 3)) * random.uniform(0.2, 1, 3) + random.normal(size=3))
    wanted = (-0.8 * aspect, 0.8 * aspect, -0.7, 0.9)
    x, y, depth = fit_view(points, best_side(points, Z), wanted).page_coordinates(points).T
    assert depth.min() > 0
    fill = max(np.ptp(x) / (1.6 * aspect), np.ptp(y) / 1.6)
    assert fill == pytest.approx(1, abs=2e-3)
    assert x.min() + x.max() == pytest.approx(0, abs=2e-3)
    assert y.min() + y.max() == pytest.approx(0.2, abs=2e-3)


def test_light_on_a_free_point_is_the_closed_form_and_none_gets_into_a_closed_box() -> None:
    """The top of a ball sees every lamp above it (`Lamps.open_light`); inside the ball only `AMBIENT` is left."""
    opengl.require_rendering()
    ball = sphere(radius=0.9, edge=0.1)
    view = fit_view(ball.V, best_side(ball.V, Z), (-1.0, 1.0, -0.8, 0.8))
    all_lamps = light.lamps(view, Z)
    top, inside = np.array([[0.0, 0.0, 0.93]]), np.zeros((1, 3))
    points = np.concatenate([top, inside]).T.astype(np.float32)
    up = np.repeat(Z[:, None], 2, axis=1).astype(np.float32)
    with Scene([Body(ball.V, ball.F, PAPER.colour_bytes("load"), casts=True)], np.zeros(3), 1.0) as scene:
        lit = light.lamp_light(scene, all_lamps, points, up)
        shared = light.lamp_light(scene, all_lamps, points[:, [0, 0]], up, paired=2)
    np.testing.assert_allclose(lit[:, 0], all_lamps.open_light(Z), rtol=1e-5)
    np.testing.assert_allclose(lit[:, 1], [0.0, light.AMBIENT], atol=1e-6)
    assert sum(all_lamps.open_light(Z)) > 0.8
    assert shared[1, 0] != pytest.approx(shared[1, 1], rel=1e-4)  # each asks half of the lamps
    np.testing.assert_allclose(shared.mean(axis=1), all_lamps.open_light(Z), rtol=1e-5)


def test_backs_are_left_away_only_of_a_closed_skin_that_faces_outward() -> None:
    """So that a lamp sees the same with them and without: a sheet, or a skin inside out, shows its backs."""
    ball = sphere(radius=0.9, edge=0.3)
    encloses = [Body(ball.V, F, PAPER.colour_bytes("load")).encloses for F in (ball.F, ball.F[:, ::-1], ball.F[1:])]
    assert encloses == [True, False, False]


def test_the_drawn_outline_and_depth_of_a_ball_agree_with_geometry() -> None:
    """Depth of the nearest point = distance - radius; outline = tan(asin(r / d)) of the half angle."""
    opengl.require_rendering()
    ball = sphere(radius=1.0, edge=0.05)
    view = fit_view(ball.V, best_side(ball.V, Z), (-0.8, 0.8, -0.8, 0.8))
    distance = float(np.linalg.norm(view.eye))
    with Scene([Body(ball.V, ball.F, PAPER.colour_bytes("load"))], np.zeros(3), 2.0) as scene:
        seen = scene.pixels(view, 200, 200)
    assert 2.0 * seen.depth.min() == pytest.approx(distance - 1, rel=1e-3)
    rows = np.flatnonzero(np.isfinite(seen.depth).any(axis=1))
    outline = np.tan(np.arcsin(1 / distance)) / np.tan(np.radians(VIEW_DEGREES / 2))
    assert (rows[-1] - rows[0] + 1) / 200 == pytest.approx(outline, abs=0.02)
    assert (seen.colour[np.isfinite(seen.depth)] == PAPER.colour_bytes("load")).all()


def test_edges_are_drawn_where_faces_meet_and_not_along_a_slope() -> None:
    from dsfab.render.scene import Pixels

    up, side = np.array([127, 127, 255], dtype=np.uint8), np.array([255, 127, 127], dtype=np.uint8)
    slope = np.tile(np.linspace(2, 3, 20, dtype=np.float32), (20, 1))
    level = np.broadcast_to(up, (20, 20, 3))
    assert edge_strengths(Pixels(slope, level, level), 0.01).max() == 0
    stepped = slope + np.where(np.arange(20) < 10, 0, 1).astype(np.float32)
    lines = edge_strengths(Pixels(stepped, level, level), 0.01)
    assert (lines[:, 9] == 1).all()
    assert lines[:, [*range(9), *range(10, 20)]].max() == 0
    assert (edge_strengths(Pixels(stepped[:, ::-1], level, level), 0.01) == lines[:, ::-1]).all()
    folded = np.where((np.arange(20) < 10)[None, :, None], up, side) * np.ones((20, 1, 1), dtype=np.uint8)
    assert (edge_strengths(Pixels(slope, folded, folded), 0.01).max(axis=1) == 1).all()


@pytest.mark.parametrize(("longest", "length"), [(0.99, 0.5), (1.0, 1.0), (4.9, 2.0), (37.0, 20.0), (0.0034, 0.002)])
def test_scale_bars_are_1_2_5_times_a_power_of_ten(longest: float, length: float) -> None:
    assert round_length(longest) == pytest.approx(length)


def test_scale_bars_are_labelled_in_metres_or_millimetres() -> None:
    assert [length_label(x) for x in (20.0, 0.5, 0.1, 0.05, 0.002)] == ["20 m", "0.5 m", "0.1 m", "50 mm", "2 mm"]


def test_a_caption_is_written_and_a_long_one_is_cut_before_the_scale_bar() -> None:
    V, F = SHAPES["slab"]()
    plain = picture(V, F, look=Look(SIZE))
    strip = slice(int(0.9 * 240), 240)
    for words in ("dome - 12.0 m span", "x" * 500):
        changed = (picture(V, F, caption=words, look=Look(SIZE)) != plain).any(axis=2)
        assert changed[strip].any()
        assert not changed[: int(0.9 * 240)].any()
        assert np.flatnonzero(changed.any(axis=0)).max() < 280


@pytest.mark.slow
def test_families_have_their_tints() -> None:
    V, F = thick(sphere(radius=1.0, edge=0.3), 0.05)
    everywhere = np.ones(len(F), dtype=int)
    pictures = [picture(V, F, family=k * everywhere, look=Look(SIZE)).astype(int) for k in (-1, 0, 1, 2)]
    plain, major, minor, kept = (image[members(image)].mean(axis=0) for image in pictures)
    np.testing.assert_array_equal(plain, major)  # by default all members look like the first family
    assert minor[1] > major[1] + 15 > kept[1] + 30
    half = picture(V, F, family=np.where(V[F].mean(axis=1)[:, 2] > 0, 1, 2), look=Look(SIZE)).astype(int)
    assert np.abs(half[40:70] - pictures[2][40:70]).max() < 3
    assert np.abs(half[150:180] - pictures[3][150:180]).max() < 3
    with pytest.raises(ValueError, match="families"):
        picture(V, F, family=everywhere + 7, look=Look(SIZE))


def test_the_same_structure_gives_the_same_file_and_pillow_reads_the_picture_back(tmp_path: Path) -> None:
    from PIL import Image

    V, F = SHAPES["dome"]()
    one, two = (
        write_png(picture(V, F, caption="dome", look=Look(SIZE)), tmp_path / name) for name in ("1.png", "2.png")
    )
    assert one == tmp_path / "1.png"
    assert one.read_bytes() == two.read_bytes()
    with Image.open(one) as image:
        assert image.format == "PNG"
        np.testing.assert_array_equal(np.asarray(image), picture(V, F, caption="dome", look=Look(SIZE)))


def test_a_failing_write_leaves_nothing_and_keeps_the_old_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    V, F = SHAPES["slab"]()
    with pytest.raises(ExportError, match="could not be written"):
        write_png(picture(V, F, look=Look(SIZE)), tmp_path / "nowhere" / "preview.png")
    old = tmp_path / "preview.png"
    old.write_bytes(b"old")

    def half(self: Image.Image, path: Path, **_: object) -> None:
        Path(path).write_bytes(b"half a pict")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", half)
    with pytest.raises(ExportError, match="full"):
        write_png(picture(V, F, look=Look(SIZE)), old)
    assert [path.name for path in tmp_path.iterdir()] == ["preview.png"]
    assert old.read_bytes() == b"old"


def test_the_window_is_closed_when_drawing_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []

    def fails(self: Scene, *_: object) -> None:
        opened.append(self.window)
        raise RuntimeError("the driver gave up")

    monkeypatch.setattr(Scene, "pixels", fails)
    with pytest.raises(RuntimeError, match="gave up"):
        picture(*SHAPES["slab"](), look=Look(SIZE))
    assert len(opened) == 1
    assert opened[0].closed


def test_nothing_to_draw_is_refused() -> None:
    with pytest.raises(DsfabError, match="no faces"):
        picture(np.zeros((3, 3)), np.zeros((0, 3), dtype=int))


@pytest.fixture
def asked_anew(monkeypatch: pytest.MonkeyPatch, untested_windows: None) -> pytest.MonkeyPatch:
    """A process that has not asked yet and has no VTK_DEFAULT_OPENGL_WINDOW; what it sets is forgotten."""
    monkeypatch.setenv(opengl.WINDOW, "")
    return monkeypatch


@pytest.mark.parametrize("crash", ["import os; os.abort()", "raise SystemExit(3)"])
def test_a_machine_without_opengl_names_the_packages_to_install(asked_anew: pytest.MonkeyPatch, crash: str) -> None:
    asked_anew.setattr(sys, "platform", "linux")
    asked_anew.setattr(opengl, "PROBE", crash)
    with pytest.raises(DsfabError, match="libegl1 and libgl1-mesa-dri") as caught:
        picture(*SHAPES["slab"](), look=Look(SIZE))
    assert str(caught.value).count(".") == 0  # one sentence
    assert all(name in str(caught.value) for name in ("Debian or Ubuntu", "Fedora", "macOS", "Windows", "--no-preview"))
    assert "libosmesa6" in str(caught.value)


def test_a_probe_that_hangs_or_cannot_start_is_a_failure(asked_anew: pytest.MonkeyPatch) -> None:
    asked_anew.setattr(opengl, "SECONDS", 0.2)
    asked_anew.setattr(opengl, "PROBE", "import time; time.sleep(60)")
    with pytest.raises(DsfabError, match="cannot be drawn"):
        opengl.require_rendering()
    opengl.forget_windows()
    asked_anew.setattr(sys, "executable", "no-such-program")
    with pytest.raises(DsfabError, match="cannot be drawn"):
        opengl.require_rendering()


def test_windows_are_tried_once_and_the_working_window_is_kept(asked_anew: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import os

    log = tmp_path / "asked"
    only_osmesa = (
        f"import os; name = os.environ['{opengl.WINDOW}']; open({str(log)!r}, 'a').write(name + '\\n'); "
        "raise SystemExit(0 if name == 'vtkOSOpenGLRenderWindow' else 1)"
    )
    asked_anew.setattr(sys, "platform", "linux")
    asked_anew.delenv("DISPLAY", raising=False)
    asked_anew.setattr(opengl, "PROBE", only_osmesa)
    opengl.probe_ahead()
    opengl.probe_ahead()
    opengl.require_rendering()
    assert os.environ[opengl.WINDOW] == "vtkOSOpenGLRenderWindow"
    opengl.require_rendering()
    assert log.read_text().split() == ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]


def test_a_screen_and_other_systems_keep_the_window_of_vtk(asked_anew: pytest.MonkeyPatch) -> None:
    asked_anew.setattr(sys, "platform", "darwin")
    assert opengl.window_kinds("") == ("",)
    asked_anew.setattr(sys, "platform", "linux")
    asked_anew.setenv("DISPLAY", ":0")
    assert opengl.window_kinds("")[0] == ""
    assert opengl.window_kinds("vtkEGLRenderWindow") == ("vtkEGLRenderWindow",)  # a user's word is kept


def test_a_window_chosen_by_the_user_that_fails_is_named(asked_anew: pytest.MonkeyPatch) -> None:
    asked_anew.setenv(opengl.WINDOW, "vtkNoSuchWindow")
    asked_anew.setattr(opengl, "PROBE", "raise SystemExit(1)")
    with pytest.raises(DsfabError, match="vtkNoSuchWindow"):
        opengl.require_rendering()
