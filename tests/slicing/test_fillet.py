"""Rounded corners of openings: areas in closed form, arcs that touch, nothing else changed."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import dsfab
from dsfab.core.errors import PatternError
from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.slicing.finishing.opening_corners import CHORD
from dsfab.slicing.measures.widths import features
from dsfab.statics.elements import heights
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, manifold_faults
from tests.presets import BARREL_VAULT_MODES
from tests.shapes import ZOO, grid, jittered, sphere
from tests.slicing.laws import check_laws, material_area
from tests.slicing.striped_balls import openings, striped_ball

STRAY = 1 / 20
"""Share of the radius that a rounded corner may be off its arc."""


def check_added(uncut: Surface, before: Sheet, after: Sheet) -> None:
    """Material is added only; the surface, its topology and that of the material stay."""
    check_laws(uncut, after)
    assert manifold_faults(after.surface.F, after.surface.edges, after.surface.n) == ()
    one, two = before.subset().surface, after.subset().surface
    assert manifold_faults(two.F, two.edges, two.n) == ()
    assert euler_characteristic(one.F, one.edges) == euler_characteristic(two.F, two.edges)
    assert material_area(after) >= material_area(before)
    assert len(one.loops) == len(two.loops)


@pytest.mark.parametrize("cells", [5, 17, 40])
@pytest.mark.parametrize("radius", [0.01, 0.04])
def test_a_fillet_adds_the_area_of_a_corner_minus_a_quarter_disc(cells, radius):
    plate = grid(cells, cells, 1.0, 1.0)
    sheet = openings(plate)
    done, found = rounded_corners(sheet, radius)
    count = len(found)
    assert count == 4 * 9
    assert found == pytest.approx(np.full(count, radius))
    gain = (material_area(done) - material_area(sheet)) / count
    chords = radius**2 * (1 - 1.5 * np.sin(np.pi / 6))  # three chords of 30 degrees
    assert gain == pytest.approx(chords, rel=5e-3)
    assert radius**2 * (1 - np.pi / 4) < gain < radius**2 * (1 - np.pi / 4 + STRAY * np.pi / 2)
    check_added(plate, sheet, done)


def test_new_walls_are_on_their_arcs():
    radius = 0.04
    sheet = openings(grid(17, 17, 1.0, 1.0))
    kept = rounded_corners(sheet, radius)[0].subset().surface
    rim = kept.edges.ends[kept.edges.boundary]
    middle = 3 * kept.V[rim].mean(axis=1)[:, :2] % 1 - 0.5  # openings on one another, their middle in 0
    corner = 0.3 - 3 * radius
    near = (np.abs(middle) > corner + 1e-9).all(axis=1) & (np.abs(middle) < 0.3 + 1e-9).all(axis=1)
    off = np.abs(np.linalg.norm(np.abs(middle[near]) - corner, axis=1) / 3 - radius)
    assert near.sum() >= 3 * 4 * 9
    assert off.max() < STRAY * radius


def test_a_radius_without_room_becomes_smaller():
    plate = grid(17, 17, 1.0, 1.0)
    sheet = openings(plate)
    done, found = rounded_corners(sheet, 1.0)
    opening = 9 * 0.2**2 - (material_area(done) - material_area(sheet))
    assert len(found) == 36
    assert (found < 0.2).all()  # half of an opening's side
    assert 0.95 < opening / (9 * np.pi * 0.1**2) < 1.01  # nearly discs
    check_added(plate, sheet, done)


def wedge_sheet(plate: Surface, half_angle: float, tip: float, length: float = 0.6, centre: float = 0.5) -> Sheet:
    """A unit plate with a wedge along y = `centre` as its opening, `tip` metres wide where it is narrowest."""
    x, y = plate.V[:, :2].T
    wide = np.abs(y - centre) - tip / 2 - (x - 0.2) * np.tan(half_angle)
    return cut(plate, [x, -x, wide], [[0.2 + length], [-0.2], [0.0]], snap=0)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [6.5, 12.0, 25.0])
@pytest.mark.parametrize("tip", [0.01, 0.03, 0.06])
def test_a_blunt_tip_is_rounded_by_one_disc_beyond_its_corners(degrees, tip):
    """Its corners share a wall that has no room for two arcs; the disc stops where the wedge is as wide as it is."""
    half, radius, plate = np.radians(degrees), 0.05, grid(40, 40, 1.0, 1.0)
    sheet = wedge_sheet(plate, half, tip)
    done, found = rounded_corners(sheet, radius)
    assert found == pytest.approx(np.full(3, radius))
    turn = np.pi - 2 * half  # of the arc; chords of it are within the disc
    chords = np.ceil(turn / CHORD)
    beyond = radius**2 / np.tan(half) - tip**2 / (4 * np.tan(half))
    at_the_tip = beyond - radius**2 * chords * np.sin(turn / chords) / 2
    wide = np.pi / 2 + half
    chords = np.ceil(wide / CHORD)
    at_the_base = 2 * radius**2 * (np.tan(wide / 2) - chords * np.sin(wide / chords) / 2)
    assert material_area(done) - material_area(sheet) == pytest.approx(at_the_tip + at_the_base, rel=0.02)
    check_added(plate, sheet, done)


def test_a_pointed_tip_without_a_corner_of_its_own_is_rounded():
    """A tip that is drawn as many walls of small turns is one as well: its radius is under half of the one asked."""
    plate = grid(60, 60, 1.0, 1.0)
    x, y = plate.V[:, :2].T
    ellipse = cut(plate, [((x - 0.5) / 0.35) ** 2 + ((y - 0.5) / 0.12) ** 2], [[1.0]], snap=0)  # tips of 0.041 m
    done, found = rounded_corners(ellipse, 0.1)
    assert found == pytest.approx([0.1, 0.1])
    rim = done.subset().surface
    inner = rim.V[rim.edges.ends[rim.edges.boundary & ~plate_edge(rim)]]
    assert np.abs(inner[..., 0] - 0.5).max() < 0.35 - 0.01
    check_added(plate, ellipse, done)


def test_a_fillet_smaller_than_a_round_slot_changes_nothing():
    plate = grid(150, 150, 1.0, 1.0)
    x, y = plate.V[:, :2].T
    sheet = cut(plate, [np.hypot(np.clip(np.abs(x - 0.5) - 0.2, 0, None), y - 0.5)], [[0.04]], snap=0)
    done, found = rounded_corners(sheet, 0.03)
    assert not len(found)
    assert done is sheet


@pytest.mark.parametrize("half", [0.01, 0.03, 0.045])
def test_behind_a_neck_an_opening_goes_on(half):
    """Two squares and a passage between them that is too narrow for the disc: each square keeps its own corners."""
    plate = grid(40, 40, 1.0, 1.0)
    x, y = np.abs(plate.V[:, :2].T - 0.5)
    squares = np.maximum(np.abs(x - 0.25) - 0.15, y - 0.15)
    sheet = cut(plate, [np.minimum(squares, np.maximum(x - 0.2, y - half))], [[0.0]], snap=0)
    done, found = rounded_corners(sheet, 0.05)
    assert found == pytest.approx(np.full(8, 0.05))
    assert material_area(done) - material_area(sheet) == pytest.approx(8 * 0.05**2 * 0.25, rel=0.01)
    check_added(plate, sheet, done)


def plate_edge(surface: Surface) -> np.ndarray:
    """The edges on the edge of a unit plate."""
    ends = surface.V[surface.edges.ends][..., :2]
    return (np.abs(ends - 0.5) > 0.5 - 1e-9).any(axis=2).all(axis=1)


def test_narrowest_place_of_a_rounded_wedge_is_as_wide_as_the_disc():
    sheet = wedge_sheet(grid(40, 40, 1.0, 1.0), np.radians(9), 0.012)
    done, _ = rounded_corners(sheet, 0.05)
    gap = features(done, done.material, [""] * 4).gap
    assert gap.size > 2 * 0.05 * np.cos(CHORD / 2)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(angle=st.floats(2, 40), tip=st.floats(1e-3, 0.15), radius=st.floats(5e-3, 0.2), seed=st.integers(0, 1000))
def test_laws_on_random_wedges(angle, tip, radius, seed):
    plate = jittered(grid(23, 23, 1.0, 1.0), seed=seed)
    sheet = resolve_pinches(wedge_sheet(plate, np.radians(angle), tip, 0.4), 1e-3).sheet
    check_added(plate, sheet, rounded_corners(sheet, radius)[0])


def test_nothing_to_round():
    plate = grid(8, 8, 1.0, 1.0)
    solid = cut(plate, [plate.V[:, 0]], [[-1.0]])
    done, found = rounded_corners(solid, 0.1)
    assert done is solid
    assert not len(found)
    fine = grid(80, 80, 1.0, 1.0)
    distance = np.linalg.norm(fine.V - [0.5, 0.5, 0], axis=1)
    round_hole = cut(fine, [distance], [[0.3]])
    assert not len(rounded_corners(round_hole, 0.02)[1])
    for radius in (0.0, -1.0, np.nan):
        with pytest.raises(PatternError, match="fillets"):
            rounded_corners(solid, radius)


def test_open_voids_are_rounded_at_their_inner_corners_only():
    """A slit from the edge: two corners at its end, none where it meets the edge of the plate."""
    plate = grid(20, 20, 1.0, 1.0)
    x, y = plate.V[:, :2].T
    sheet = cut(plate, [x, np.abs(y - 0.5)], [[0.61], [0.1]], snap=0)
    done, found = rounded_corners(sheet, 0.05)
    assert len(found) == 2
    assert material_area(done) - material_area(sheet) == pytest.approx(2 * 0.05**2 * 0.25, rel=0.01)
    check_added(plate, sheet, done)


def test_fillets_take_the_neighbouring_family_and_carry_fields():
    plate = grid(11, 11, 1.0, 1.0)
    sheet = openings(plate)
    done, _ = rounded_corners(sheet, 0.03)
    assert set(done.family[done.material].tolist()) == {0, 1}
    assert np.allclose(done.carry(plate.V), done.surface.V, atol=1e-12)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    cells=st.integers(4, 24),
    count=st.integers(1, 6),
    half=st.floats(0.05, 0.45),
    radius=st.floats(1e-3, 0.3),
    seed=st.integers(0, 1000),
)
def test_laws_on_random_grids(cells, count, half, radius, seed):
    plate = jittered(grid(cells, cells, 1.0, 1.0), seed=seed)
    sheet = resolve_pinches(openings(plate, count, half, snap=0.05), 1e-3).sheet
    done, _ = rounded_corners(sheet, radius)
    check_added(plate, sheet, done)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@example(frequency=5.5, level=0.0, radius=0.28125, seed=66)  # two arcs met in a point
@given(frequency=st.floats(2, 9), level=st.floats(-0.6, 0.6), radius=st.floats(0.005, 0.3), seed=st.integers(0, 100))
def test_laws_on_a_ball_with_curved_stripes(frequency, level, radius, seed):
    ball, sheet = striped_ball(frequency, level, seed)
    done, _ = rounded_corners(sheet, radius)
    check_added(ball, sheet, done)


def test_chords_are_short_enough():
    assert 1 - np.cos(CHORD / 2) < STRAY


def test_a_design_has_its_fillets_in_sheet_and_solid():
    preset = dsfab.load_preset(BARREL_VAULT_MODES, {"pattern.fillet": 0.0})
    rounded = preset.model_copy(update={"pattern": preset.pattern.model_copy(update={"fillet": 0.03})})
    sharp = dsfab.run(preset)
    said: list[str] = []
    design = dsfab.revise(sharp, rounded, lambda *told: said.append(str(told)))
    assert design.slicing.sheet.surface.area > sharp.slicing.sheet.surface.area
    assert design.solid.volume > sharp.solid.volume
    assert design.solid.genus == sharp.solid.genus
    assert design.solid.repairs.pairs == 0
    assert any("corners of openings were rounded with a radius of 30 mm" in note for note in said + [str(design.notes)])


@pytest.mark.parametrize("name", sorted(ZOO))
def test_laws_over_the_zoo(name):
    surface = ZOO[name]()
    one, two = surface.V @ [1.0, 0.4, 0.2], surface.V @ [-0.3, 1.0, 0.5]
    levels = [np.quantile(x, [0.1, 0.3, 0.45, 0.6, 0.75, 0.9]) for x in (one, two)]
    sheet = resolve_pinches(cut(surface, [one, two], levels), 0.2 * surface.mean_edge).sheet
    done, _ = rounded_corners(sheet, 0.3 * surface.mean_edge)
    check_laws(surface, done)
    kept = done.subset().surface
    assert kept.pinches.size == 0
    assert euler_characteristic(kept.F, kept.edges) == euler_characteristic(
        sheet.subset().surface.F, sheet.subset().surface.edges
    )


def test_nothing_is_filled_along_a_fold():
    """A lens with a sharp edge: in the plane of a corner void lies behind void. One arc filled six times radius**2."""
    ball, turned = sphere(2), sphere(2).V @ np.linalg.qr(np.random.default_rng(26).normal(size=(3, 3)))[0]
    lens = Surface(ball.V * [1, 1, 0.1], ball.F)
    one, two = np.sin(3.7 * turned[:, 0]), np.sin(3.7 * turned[:, 1] + 2 * turned[:, 2] ** 2)
    sheet = resolve_pinches(cut(lens, [one, two], [[-0.3], [0.0]]), 0.01).sheet
    radius = 0.3 * lens.mean_edge
    done, found = rounded_corners(sheet, radius)
    assert len(found) > 10
    assert material_area(done) - material_area(sheet) < 0.4 * radius**2 * len(found)
    check_added(lens, sheet, done)


@pytest.mark.parametrize(
    ("radius", "told"),
    [
        (
            0.03,
            r"\d+ corners of openings were rounded with a radius of 30 mm, or with a smaller radius where the "
            r"opening is .*",
        ),
        (3.0, r"\d+ corners of openings were rounded; half of the radii are below \d+ mm, because .* = 3 m.*"),
        (
            3000.0,
            r"dsfab rounded no corner of an opening, because no corner has space for a radius of 3 km "
            r"\(pattern.fillet\)",
        ),
    ],
)
def test_a_build_reports_the_fillet_radius_that_it_reached(radius, told):
    """Millimetres for metres are seen: nothing is rounded, and that is said."""
    made = dsfab.run(dsfab.load_preset(BARREL_VAULT_MODES, {"surface.edge": 0.5, "pattern.fillet": radius}))
    assert any(re.fullmatch(told, note.text) for note in made.notes)


def square_hole(plate: Surface, half: float, island: float = 0.0) -> Sheet:
    """A unit plate with a square opening about its middle, and in this a square of material."""
    away = np.abs(plate.V[:, :2] - 0.5).max(axis=1)
    return cut(plate, [away, -away], [[half], [-island]], snap=0)


def test_an_arc_that_would_reach_an_island_shrinks_until_it_is_clear():
    """The island's corner is .05 m from both walls: an arc with chords is clear of it below .16 m or so."""
    plate = grid(20, 20, 1.0, 1.0)
    sheet = square_hole(plate, 0.3, 0.25)
    done, found = rounded_corners(sheet, 0.24)
    assert len(found) == 4
    assert (found > 0.7 * 0.16).all()
    assert (found < 0.17).all()
    check_added(plate, sheet, done)


@pytest.mark.parametrize(("share", "is_sliver"), [(1.5e-3, False), (2.6e-3, True)])
def test_a_fillet_runs_through_vertices_that_are_very_near_so_that_it_makes_no_slivers(share, is_sliver):
    """A vertex lies beyond the middle of an arc's middle chord, of 30 degrees, by a share of the radius."""
    plate, radius = grid(20, 20, 1.0, 1.0), 0.1
    place = np.full(2, 0.7 - radius) + radius * (np.cos(np.radians(15)) + share) / np.sqrt(2)
    V = plate.V.copy()
    V[np.linalg.norm(V[:, :2] - place, axis=1).argmin(), :2] = place
    done, found = rounded_corners(square_hole(Surface(V, plate.F), 0.2), radius)
    assert found == pytest.approx([radius] * 4)
    assert (heights(done.surface).min() < 0.01 * radius) == is_sliver
