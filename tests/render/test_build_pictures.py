"""Pictures for clients: supports of every kind become parts of a building on its ground, beside something to scale."""

from dataclasses import dataclass

import numpy as np
import pytest

from dsfab.render.build_pictures import ClientPicture
from dsfab.render.picture import Look
from dsfab.render.surroundings import HEADROOM, building_supports
from dsfab.render.view import parallel_view, plan_and_elevation, plane_extents
from dsfab.surface import LoadCase, Surface
from dsfab.surface.shapes import dome
from dsfab.thickening import offsets, thicken
from tests.shapes import annulus, grid, subsurface, tube

Z = np.array([0.0, 0.0, 1.0])
THICK = 0.1


def moved(surface: Surface, lift) -> Surface:
    """With the heights lift(x, y) added."""
    return Surface(surface.V + np.outer(lift(*surface.V[:, :2].T), Z), surface.F)


def slab(height: float = 0.0, length: float = 10.0, width: float = 8.0) -> Surface:
    """A flat rectangle around the origin."""
    flat = grid(20, 16, length, width)
    return Surface(flat.V + [-length / 2, -width / 2, height], flat.F)


def corners(surface: Surface) -> np.ndarray:
    x, y = np.abs(surface.V[:, :2] - surface.V[:, :2].mean(axis=0)).T
    return (x > x.max() - 0.01) & (y > y.max() - 0.01)


def ends(surface: Surface, axis: int, *sides: int) -> np.ndarray:
    x = surface.V[:, axis]
    return np.logical_or.reduce([x == (x.max() if side > 0 else x.min()) for side in sides])


def in_loops(surface: Surface, chosen: slice) -> np.ndarray:
    return np.isin(np.arange(surface.n), np.concatenate(surface.loops[chosen]))


def hill(height: float, at: float) -> Surface:
    """A sheet with four square holes, on slopes that rise (or fall) to the holes, at a height."""
    sheet = slab()
    x, y = np.abs(sheet.centroids[:, :2]).T
    sheet = subsurface(sheet, ~((np.abs(x - 2.75) < 0.25) & (np.abs(y - 2.25) < 0.25)))
    return moved(sheet, lambda x, y: at + height * np.exp(-np.hypot(np.abs(x) - 2.75, np.abs(y) - 2.25)))


def loaded(surface: Surface, held: np.ndarray) -> LoadCase:
    force = -1e3 * np.outer(surface.vertex_areas, Z)
    return LoadCase(np.repeat(held[:, None], 3, axis=1), force, np.zeros(surface.n, dtype=bool))


def picture(surface: Surface, held: np.ndarray, thick: float = THICK, **options) -> ClientPicture:
    solid = thicken(surface, offsets(surface, thick).D)
    return ClientPicture(solid.V, solid.F, thick / 2, surface, loaded(surface, held), "a test", **options)


@dataclass
class Case:
    """A surface with its supports, the kinds that they become, and how many."""

    surface: Surface
    held: np.ndarray
    kinds: dict[str, int]


def cases() -> dict[str, Case]:
    ball, roof, barrel = dome(span=12.0, rise=4.0, edge=0.9), slab(3.5), moved(slab(), lambda x, y: 4 - y**2 / 4)
    sail = moved(slab(4.0), lambda x, y: x * y / 10)
    ramp, wall = (
        moved(slab(0.0, 12.0, 2.0), lambda x, y: 1.5 + x / 4),
        Surface(slab(0.0, 6, 3).V[:, [0, 2, 1]], slab().F),
    )
    ring, heads, lugs, tower = annulus(48, 5, 10.0, 20.0), hill(-1.0, 5.0), hill(1.0, 5.0), tube(24, 12, 3.0, 20.0)
    ring = moved(ring, lambda x, y: 9 + 0 * x)
    return {
        "dome on its ring": Case(ball, in_loops(ball, slice(1)), {"wall": 1}),
        "barrel vault on springing lines": Case(barrel, ends(barrel, 1, -1, 1), {"wall": 2}),
        "canopy on feet": Case(roof, corners(roof), {"column": 4}),
        "hall on column heads": Case(heads, in_loops(heads, slice(1, None)), {"column": 4}),
        "ceiling on lugs": Case(lugs, in_loops(lugs, slice(1, None)), {"hanger": 4}),
        "ring roof": Case(ring, in_loops(ring, slice(1)), {"wall": 1}),
        "ramp on landings": Case(ramp, ends(ramp, 0, -1, 1), {"wall": 2}),
        "wall": Case(wall, ends(wall, 2, -1), {"wall": 1}),
        "tower": Case(tower, ends(tower, 2, -1), {"wall": 1}),
        "floor slab on walls": Case(roof, in_loops(roof, slice(1)), {"wall": 1}),
        "sail on masts": Case(sail, corners(sail), {"column": 4}),
        "bracket": Case(roof, ends(roof, 0, -1), {"abutment": 1}),
    }


CASES = cases()


@pytest.mark.parametrize("name", CASES)
def test_each_kind_of_surface_has_its_parts_of_a_building_and_a_person_on_the_ground(name):
    case = CASES[name]
    kinds = [support.kind for support in building_supports(case.surface, loaded(case.surface, case.held), Z)]
    assert {kind: kinds.count(kind) for kind in kinds} == case.kinds
    stage = picture(case.surface, case.held).stage
    solid, parts, person = (body.V for body in stage.bodies)
    assert person[:, 2].min() == pytest.approx(stage.level)
    assert np.ptp(person[:, 2]) == pytest.approx(1.75)
    if not {"hanger", "abutment"} & set(kinds):
        assert parts[:, 2].min() == pytest.approx(stage.level)  # parts reach the ground
    assert stage.level <= solid[:, 2].min()
    # the person stands beside all of it, to the right of the eye
    right = np.cross(Z, -stage.view.forward)
    assert (person @ right).min() > max((V @ right).max() for V in (solid, parts))
    # the whole building is in the picture
    x, y, _ = stage.view.page_coordinates(np.concatenate([solid, parts, person])).T
    assert np.abs(x).max() <= 1600 / 1056
    assert np.abs(y).max() <= 1


def test_columns_end_at_the_underside_of_a_slab_and_do_not_enter_it():
    case = CASES["canopy on feet"]
    stage = picture(case.surface, case.held).stage
    columns = stage.bodies[1].V
    assert stage.level == 0.0  # the slab is drawn at 3.5 m
    assert (columns[:, 2].min(), columns[:, 2].max()) == pytest.approx((0.0, 3.5 - THICK / 2))


@pytest.mark.parametrize(("height", "level"), [(0.0, -0.05), (2.0, 1.95), (2.4, 0.0), (50.0, 49.95)])
def test_the_ground_is_at_height_0_only_below_headroom(height, level):
    """A slab at 0 stays on its footings, which are 0.15 m high, and one on a hill of 50 m has no columns of 50 m."""
    slab_at = slab(height)
    stage = picture(slab_at, corners(slab_at)).stage
    assert level - stage.level == pytest.approx(0.0 if level == 0 else 0.15, abs=0.02)


def test_a_hung_ceiling_has_rods_upwards_and_headroom_below():
    for low, level in ((4.0, 0.0), (1.0, 1.0 - THICK / 2 - HEADROOM)):
        ceiling = hill(1.0, low)
        low_point = ceiling.V[:, 2].min()
        stage = picture(ceiling, in_loops(ceiling, slice(1, None))).stage
        assert stage.level == pytest.approx(0.0 if level == 0 else low_point - THICK / 2 - HEADROOM)
        assert stage.bodies[1].V[:, 2].min() > ceiling.V[:, 2].max() - 0.5


def test_masts_of_a_sail_stand_outside_it():
    case = CASES["sail on masts"]
    parts = [s for s in building_supports(case.surface, loaded(case.surface, case.held), Z) if s.outwards.any()]
    high = [s for s in parts if case.surface.V[s.vertices, 2].mean() > 4]
    assert len(high) == 2
    for support in high:
        assert (support.outwards @ case.surface.V[support.vertices[0]] > 0).all()  # away from the middle


def test_a_slab_on_soil_and_a_plane_of_symmetry_have_no_parts():
    flat = slab(1.0)
    assert not building_supports(flat, loaded(flat, np.ones(flat.n, dtype=bool)), Z)
    both = loaded(flat, ends(flat, 0, -1, 1))
    fixed = both.fixed.copy()
    fixed[flat.V[:, 0] > 0, 1:] = False  # holds along x only
    half = LoadCase(fixed, both.force, both.loaded)
    assert [support.kind for support in building_supports(flat, half, Z)] == ["wall"]


def test_a_long_edge_that_is_high_rests_on_columns_and_a_low_one_on_a_wall():
    """Faces of a wall are as high as its edge; below a beam there are gaps."""
    for height, is_wall in ((3.5, True), (9.0, False)):
        roof = slab(height)
        parts = picture(roof, in_loops(roof, slice(1))).stage.bodies[1]
        low = parts.V[parts.V[:, 2] < 0.01]
        gaps = np.diff(np.sort(low[np.abs(low[:, 1] - low[:, 1].max()) < 0.2, 0]))
        assert (gaps.max() < 0.6) == is_wall


@pytest.mark.parametrize(("scale", "words"), [(0.02, "pencil"), (1.0, "person"), (12.0, "person")])
def test_a_model_lies_beside_a_pencil_and_a_hall_has_a_person_of_the_same_height(scale, words):
    model = Surface(scale * slab(3.5).V, slab().F)
    figure = picture(model, corners(model), 0.01 * scale).stage.bodies[-1].V
    length = np.linalg.norm(np.ptp(figure, axis=0))
    assert length == pytest.approx(0.175 if words == "pencil" else 1.75, rel=0.06)


def test_the_picture_has_the_asked_size_and_plan_and_elevation_share_its_scale():
    """In both, the slab of 10 x 8 m is as wide as its scale says."""
    case = CASES["canopy on feet"]
    data = picture(case.surface, case.held, 0.5, look=Look((300, 400)))
    image = data.render()
    assert image.shape == (400, 300, 3)
    terracotta = (image[:, :, 0].astype(int) - image[:, :, 2]) > 40
    below = terracotta[264:]
    plan, elevation = below[:, :150], below[:, 150:]
    wide = [np.ptp(np.flatnonzero(panel.any(axis=0))) for panel in (plan, elevation)]
    assert wide[0] == pytest.approx(wide[1], abs=2)
    deep = np.ptp(np.flatnonzero(plan.any(axis=1)))
    assert deep / wide[0] == pytest.approx(0.8, abs=0.03)


def test_a_turned_roof_is_square_to_its_plan():
    """The elevation looks at the long side of the smallest rectangle."""
    turn = np.radians(30)
    V = slab(3.5).V @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    plan, elevation = plan_and_elevation(V, Z)
    np.testing.assert_allclose(plane_extents(V, plan), [10, 8], rtol=1e-3)
    np.testing.assert_allclose(plane_extents(V, elevation), [10, 0], atol=1e-2)


def test_low_feet_on_one_side_of_a_stand_are_columns_and_no_abutment():
    """Its roof rises from the feet, all of which are behind it."""
    stand = moved(slab(), lambda x, y: 0.5 * (x + 5))
    parts = building_supports(stand, loaded(stand, corners(stand) & (stand.V[:, 0] < 0)), Z)
    assert [part.kind for part in parts] == ["column", "column"]


@pytest.mark.parametrize(("share", "kind"), [(0.2, "wall"), (0.3, "abutment")])
def test_a_sheet_that_cantilevers_from_its_low_quarter_rests_on_a_wall(share, kind):
    """It falls from its support to the middle, and then rises to its free end."""
    sheet = moved(slab(), lambda x, y: np.interp(x, [-5, 0, 5], [2 * share, 0, 2]))
    (part,) = building_supports(sheet, loaded(sheet, ends(sheet, 0, -1)), Z)
    assert part.kind == kind


@pytest.mark.parametrize(("lean", "is_beside"), [(0.8, True), (1.3, False)])
def test_a_part_stands_beside_an_edge_that_is_steeper_than_three_to_one(lean, is_beside):
    """The ends of a wall of 3 m lean outwards in its plane."""
    wall = CASES["wall"].surface
    V = wall.V + np.outer(lean * np.sign(wall.V[:, 0]) * (wall.V[:, 2] + 1.5) / 3, [1, 0, 0])
    leaning = Surface(V, wall.F)
    held = np.abs(wall.V[:, 0]) == wall.V[:, 0].max()
    parts = building_supports(leaning, loaded(leaning, held), Z)
    assert [part.outwards.any() for part in parts] == [is_beside] * 2


def test_in_a_plan_a_high_and_a_low_edge_have_the_same_length():
    plan, _ = plan_and_elevation(slab().V, Z)
    box = np.concatenate([slab(0.0).V, slab(10.0).V])
    x, _, _ = parallel_view(box, plan, (300, 300), 20.0).page_coordinates(box).T
    low, high = np.ptp(x[: slab().n]), np.ptp(x[slab().n :])
    assert low == pytest.approx(high, rel=0.01)


@pytest.mark.parametrize(("rise", "kind"), [(0.02, "column"), (1.0, "hanger")])
def test_a_nearly_flat_ceiling_stands_on_columns(rise, kind):
    """It hangs only where it clearly falls away from its supports."""
    ceiling = hill(rise, 4.0)
    parts = building_supports(ceiling, loaded(ceiling, in_loops(ceiling, slice(1, None))), Z)
    assert {part.kind for part in parts} == {kind}


def test_posts_beside_upright_edges_of_a_wall_are_as_high_as_the_wall():
    wall = CASES["wall"].surface
    stage = picture(wall, ends(wall, 0, -1, 1)).stage
    posts = stage.bodies[1].V
    assert posts[:, 2].max() == pytest.approx(1.5)  # as wide as the sheet is thick, and beside it
    assert np.abs(posts[:, 0]).min() >= 3.0


def test_a_wall_below_an_inner_ring_leaves_its_middle_open():
    """The ring has no boundary edge; its parts follow the edges between its vertices."""
    roof = annulus(48, 20, 0.5, 10.0)
    roof = moved(roof, lambda x, y: 3 + 0 * x)
    radius = np.linalg.norm(roof.V[:, :2], axis=1)
    ring = np.isclose(radius, radius[np.argmin(np.abs(radius - 6))])
    assert [part.kind for part in building_supports(roof, loaded(roof, ring), Z)] == ["wall"]
    parts = picture(roof, ring).stage.bodies[1].V
    assert np.linalg.norm(parts[:, :2], axis=1) == pytest.approx(radius[ring][0], abs=0.3)
