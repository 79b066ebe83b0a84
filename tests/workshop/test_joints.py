"""Joints of what is longer than the stock: fingers and scarfs of flat sheets, scarfs of strips and planks."""

from functools import cache

import numpy as np
import pytest
from shapely import Polygon, unary_union

from dsfab.core.errors import PatternError
from dsfab.design import Design
from dsfab.members import member_graph
from dsfab.preset.file import load_preset, with_overrides
from dsfab.surface import Surface
from dsfab.workshop import Layering, workshop_plan
from dsfab.workshop.planks import PlankStock, plank_plan
from dsfab.workshop.plates import SheetJoint, sheet_parts
from dsfab.workshop.strips import strip_parts
from tests.analytic import SURFACES
from tests.designs import sliced


def ribbed(ribs):
    """A sheet of 3 x 1.5 m with the openings that a function of places (m, 2) has, of triangles 50 mm wide."""
    i, j = np.meshgrid(np.arange(60), np.arange(30), indexing="ij")
    a = (i * 31 + j).ravel()
    F = np.concatenate([np.stack([a, a + 31, a + 32], axis=1), np.stack([a, a + 32, a + 1], axis=1)])
    x, y = np.meshgrid(np.linspace(0, 3, 61), np.linspace(0, 1.5, 31), indexing="ij")
    V = np.stack([x.ravel(), y.ravel(), np.zeros(61 * 31)], axis=1)
    F = F[~ribs(V[F].mean(axis=1)[:, :2])]
    used, F = np.unique(F, return_inverse=True)
    return Surface(V[used], F.reshape(-1, 3))


def whole(xy):
    return np.zeros(len(xy), dtype=bool)


def square_windows(xy):
    """Squares of .25 m with ribs of .1 m between them."""
    return ((xy + 0.05) % 0.35 > 0.1).all(axis=1)


def leaning(xy):
    """Ribs that run nearly along the joint at x = 1.5, and a few across."""
    inside = np.abs(xy[:, 0] - 1.5) < 1.4
    return inside & ((xy[:, 0] + 0.08 * xy[:, 1] + 0.05) % 0.4 > 0.12) & ((xy[:, 1] + 0.1) % 0.5 > 0.15)


def spur(xy):
    """One opening, and a spur in it that comes from the right and ends on the joint at x = 1.5."""
    x, y = xy.T
    return (np.abs(x - 1.45) < 0.25) & (np.abs(y - 0.75) < 0.3) & ~((x > 1.45) & (np.abs(y - 0.75) < 0.05))


def beyond(xy):
    """An opening beside the joint at x = 1.5, and a spur in it that comes from the right and ends at x = 1.4."""
    x, y = xy.T
    return (np.abs(x - 1.4) < 0.3) & (np.abs(y - 0.75) < 0.3) & ~((x > 1.4) & (np.abs(y - 0.75) < 0.05))


def polygons(parts):
    return [Polygon(part.outline, part.slots) for part in parts]


@pytest.mark.slow
@pytest.mark.parametrize("ribs", [whole, square_windows, leaning])
@pytest.mark.parametrize("room", [[(1.7, 1.6)], [(1.3, 0.9)]])
def test_pieces_with_fingers_are_the_sheet_without_gap_or_overlap(ribs, room):
    sheet, joint = ribbed(ribs), SheetJoint("fingers", 0.02)
    assert joint.reach == pytest.approx(0.08)
    found = sheet_parts(sheet, room, joint)
    pieces = polygons(found.pieces)
    assert all(one.is_valid for one in pieces)
    assert sum(one.area for one in pieces) == pytest.approx(sheet.area, rel=1e-9)
    assert unary_union([one.buffer(1e-9) for one in pieces]).area == pytest.approx(sheet.area, rel=1e-6)
    assert all(max(part.size) <= max(room[0]) and min(part.size) <= min(room[0]) for part in found.pieces)
    assert not any(one.area < 0.003 for one in pieces)  # no bit of a finger is left alone
    if ribs is whole:  # the edge between two pieces goes to and fro: longer than the straight one by its fingers
        straight = sum(one.length for one in polygons(sheet_parts(sheet, room).pieces))
        assert sum(one.length for one in pieces) > straight + 2 * 30 * 0.08


def test_a_sheet_is_divided_again_if_a_piece_with_its_spurs_fits_on_no_stock():
    """Both halves have room with their fingers, 1.54 m; that with the spur is 1.6 m long."""
    joint = SheetJoint("fingers", 0.02)
    assert sheet_parts(ribbed(whole), [(1.58, 1.55)], joint).counts == (2, 1)
    assert sheet_parts(ribbed(beyond), [(1.61, 1.55)], joint).counts == (2, 1)
    found = sheet_parts(ribbed(beyond), [(1.58, 1.55)], joint)
    assert found.counts == (3, 1)
    assert max(max(part.size) for part in found.pieces) <= 1.58
    assert sum(one.area for one in polygons(found.pieces)) == pytest.approx(ribbed(beyond).area, rel=1e-9)


@pytest.mark.parametrize("ribs", [whole, leaning, spur])
def test_pieces_with_scarfs_lie_on_each_other_by_eight_thicknesses(ribs):
    sheet, joint = ribbed(ribs), SheetJoint("scarf", 0.02)
    found = sheet_parts(sheet, [(1.7, 1.6)], joint)
    one, other = (
        unary_union([p for p, part in zip(polygons(found.pieces), found.pieces, strict=True) if part.id[:2] == name])
        for name in ("S1", "S2")
    )
    assert one.union(other).area == pytest.approx(sheet.area, rel=1e-6)
    both = one.intersection(other)
    x0, _, x1, _ = both.bounds
    assert (x0, x1) == (pytest.approx(1.42), pytest.approx(1.58))
    lines = {
        name: {round(m[0, 0], 6) for part in found.pieces if part.id[:2] == name for m in part.marks}
        for name in ("S1", "S2")
    }
    assert 1.42 in lines["S1"]
    assert 1.58 in lines["S2"]
    if ribs is whole:
        assert both.area == pytest.approx(0.16 * 1.5)
    if ribs is not leaning:
        assert len(found.pieces) == 2  # none lies on the other piece alone


def test_joints_too_long_for_the_stock_are_refused():
    """It divided a sheet into a million pieces."""
    with pytest.raises(
        PatternError, match="80 mm long, too long for sheets of the stock, which have room for parts of 100 mm"
    ):
        sheet_parts(ribbed(whole), [(0.1, 0.1)], SheetJoint("fingers", 0.02))


@cache
def graph_of(name):
    given = SURFACES[name](0.4)
    return member_graph(given.surface, given.sheet(), given.pattern)


def laps_of(pieces):
    """Metres that each piece overlaps the next one of its member by, on the axis; and both parts."""
    for one in pieces:
        name, dot, k = one.id.rpartition(".")
        after = next((two for two in pieces if dot and two.id == f"{name}.{int(k) + 1}"), None)
        if after is not None:
            yield one.span[1] - after.span[0], one, after


def assert_scarfed(pieces, wide, lap):
    found = list(laps_of(pieces))
    assert len(found) > 5
    for overlap, one, after in found:
        assert overlap == pytest.approx(lap)
        for part, end in ((one, part_end(one, -1)), (after, part_end(after, 0))):
            lines = [
                m for m in part.marks if len(m) == 2 and np.linalg.norm(m[1] - m[0]) == pytest.approx(wide, rel=0.1)
            ]
            away = [np.linalg.norm(line.mean(axis=0) - end) for line in lines]
            assert min(away) == pytest.approx(lap, abs=wide / 10)


def part_end(part, k):
    return part.axis[k]


@pytest.mark.slow
def test_strips_and_planks_are_scarfed_by_eight_thicknesses():
    graph = graph_of("cylinder")
    strips = strip_parts(graph, Layering(0.018, 2, 0.012), [(2.484, 1.234)], "scarf")
    assert not strips.covers
    assert_scarfed(strips.pieces, 0.12, 8 * 0.018)
    assert all(max(part.size) < 2.49 for part in strips.pieces)
    stock = PlankStock(0.018, 0.12, 0.012, "scarf", (0.02, 0.008))
    planks = plank_plan(graph, np.tile([0.0, 0.0, 1.0], (graph.sheet.surface.n, 1)), stock, [(2.484, 1.234)], 0.0)
    assert not planks.planks.covers
    assert_scarfed(planks.planks.pieces, 0.12, 8 * 0.018)
    assert any("pieces overlap by 144 mm and are bevelled 1 to 8" in line for line in planks.lines)


def test_fingers_are_for_flat_sheets():
    vault = sliced(load_preset("barrel_vault", {"surface.edge": 0.5}))
    asked = Design.from_preset(with_overrides(vault.preset, {"workshop.splice": "fingers"}), vault).until("slicing")
    with pytest.raises(PatternError, match="'fingers' is for flat sheets, not for members"):
        workshop_plan(asked)
    asked = Design.from_preset(with_overrides(vault.preset, {"workshop.splice": "scarf"}), vault).until("slicing")
    assert any("40 mm and are" in note or "bevelled 1 to 8" in note for note in workshop_plan(asked).notes)
