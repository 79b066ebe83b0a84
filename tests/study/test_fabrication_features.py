"""Smallest members, gaps and walls: closed forms on plates, other roads to the same number, laws of scale."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from dsfab.pattern.widths import slopes
from dsfab.slicing import cut
from dsfab.slicing.measures.widths import Features, below_limit, features, kept_cells
from dsfab.study.file_check.file_geometry import clearances
from dsfab.surface import Surface
from dsfab.surface.topology import pieces
from dsfab.thickening import Solid, offsets, thicken
from dsfab.thickening.wall_thickness import thinnest_wall
from tests.shapes import grid, jittered, lifted, sphere


def measured(surface: Surface, fields, levels, names=("major", "minor"), snap=0.0) -> Features:
    sheet = cut(surface, fields, levels, snap)
    return features(sheet, sheet.material, names)


def jittered_plate(cells: int = 16) -> Surface:
    return jittered(grid(2 * cells, cells, 2.0, 1.0))


# --- closed forms


def test_parallel_stripes_have_their_widths_and_gaps():
    lines = np.array([0.2, 0.3, 0.37, 0.52, 0.9, 1.3])
    found = measured(jittered_plate(), [jittered_plate().V[:, 0]], [lines])
    assert found.member.size == pytest.approx(0.1, rel=1e-12)
    assert found.gap.size == pytest.approx(0.07, rel=1e-12)
    assert 0.2 - 1e-12 <= found.member.place[0] <= 0.3 + 1e-12
    assert 0.3 - 1e-12 <= found.gap.place[0] <= 0.37 + 1e-12
    assert (found.member.what, found.gap.what) == ("a major stripe", "a gap")


@pytest.mark.parametrize("angle", [25, 40, 65])
def test_oblique_stripes_too(angle):
    turn = np.radians(angle)
    x = jittered_plate().V @ [np.cos(turn), np.sin(turn), 0]
    low, high = x.min(), x.max()
    middles = np.arange(low + 0.2, high - 0.1, 0.25)  # no piece of a stripe alone in a corner
    levels = np.sort(np.concatenate([middles - 0.04, middles + 0.04]))
    found = measured(jittered_plate(), [x], [levels])
    assert found.member.size == pytest.approx(0.08, rel=1e-9)
    assert found.gap.size == pytest.approx(0.17, rel=1e-9)


def test_the_narrower_of_two_crossing_families_is_found():
    surface = jittered_plate()
    found = measured(surface, [surface.V[:, 0], surface.V[:, 1]], [[0.3, 0.5, 1.2, 1.4], [0.2, 0.26, 0.6, 0.75]])
    assert found.member.size == pytest.approx(0.06, rel=1e-12)
    assert found.member.what == "a minor stripe"
    assert found.gap.size == pytest.approx(0.34, rel=1e-12)  # 0.26 to 0.6; the border of the plate is no wall of a gap


@pytest.mark.parametrize("cells", [20, 40, 80])
def test_a_neck_between_two_round_holes(cells):
    """Fields are linear over faces: the holes are polygons, and the neck is wider by the square of their edges."""
    surface = jittered(grid(2 * cells, cells, 2.0, 1.0))
    x, y = surface.V[:, 0], surface.V[:, 1]
    distance = np.minimum(np.hypot(x - 0.67, y - 0.5), np.hypot(x - 1.33, y - 0.5))
    found = measured(surface, [distance], [[0.3]])
    assert found.member.size == pytest.approx(0.06, abs=2 * (1 / cells) ** 2)
    assert found.member.place == pytest.approx([1.0, 0.5, 0.0], abs=0.08)


def test_a_ring_is_as_wide_as_its_radii_differ():
    surface = jittered(grid(40, 40, 2.0, 2.0))
    distance = np.hypot(*(surface.V[:, :2] - 1).T)
    found = measured(surface, [-distance], [[-0.8, -0.45]], ["keep"])
    assert found.member.size == pytest.approx(0.35, rel=0.02)
    assert found.gap.size == pytest.approx(0.9, rel=0.02)  # the hole in its middle
    assert found.member.what == "a kept region"


def test_tips_and_corners_are_not_members():
    """Walls at 10 degrees: to a tip inside the plate, of which nothing is told; cut off by the border, they count."""
    surface = grid(32, 16, 2.0, 1.0)
    x, y = surface.V[:, 0], surface.V[:, 1]

    def wedge(end: float) -> Features:
        return measured(surface, [np.abs(y - 0.5) - (end - x) * np.tan(np.radians(5))], [[-10.0, 0.0]])

    assert wedge(3.0).member.size == pytest.approx(2 * np.tan(np.radians(5)), rel=0.05)
    assert len(wedge(1.5).widths) == 0
    oblique = x * np.sin(np.radians(50)) - y * np.cos(np.radians(50))
    assert measured(surface, [oblique], [[0.1, 0.5]]).member.size == pytest.approx(0.4, rel=1e-9)


def test_a_needle_between_two_edges_counts_with_its_circle():
    """Two walls of one edge each, 1 degree apart: not zero, as the way across is at their common end; unless tips
    are asked for."""
    wide = np.tan(np.radians(0.5))
    V = [[0, 0, 0], [1, -wide, 0], [1, wide, 0], [0.5, -1, 0], [0.5, 1, 0], [2, 0, 0], [-1, 0, 0]]
    F = [[0, 1, 2], [0, 3, 1], [0, 2, 4], [1, 3, 5], [1, 5, 2], [2, 5, 4], [0, 6, 3], [0, 4, 6]]
    sheet = cut(Surface(V, F), [np.zeros(7)], [[]])
    gap = features(sheet, np.arange(8) > 0, []).gap
    assert gap.size == pytest.approx(4 * wide / (2 * wide + 2 * np.hypot(1, wide)), rel=1e-9)
    assert features(sheet, np.arange(8) > 0, [], tips=True).gap.size < 0.002 * wide


def test_a_waist_between_wider_ends_is_a_member():
    """Its walls converge as those of a tip do, and part again."""
    surface = grid(32, 16, 2.0, 1.0)
    x, y = surface.V[:, 0], surface.V[:, 1]
    waist = measured(surface, [np.abs(y - 0.5) - 0.05 - 0.1 * np.abs(x - 1)], [[-10.0, 0.0]])
    assert waist.member.size == pytest.approx(0.1, rel=0.03)
    assert waist.member.place == pytest.approx([1.0, 0.5, 0.0], abs=0.08)


def test_the_size_of_a_triangular_opening_is_its_incircle():
    """No line across it meets a parallel wall; 4 area / perimeter is twice the inradius."""
    side = 0.2
    corners = np.array([[0, 0], [side, 0], [side / 2, side * np.sqrt(0.75)]])
    V = np.r_[corners, 5 * (corners - corners.mean(axis=0)) + corners.mean(axis=0)]
    F = [[0, 1, 2], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]]
    surface = Surface(np.c_[V, np.zeros(6)], F)
    sheet = cut(surface, [np.zeros(6)], [[]])
    found = features(sheet, np.arange(7) > 0, [])
    assert found.gap.size == pytest.approx(side / np.sqrt(3), rel=1e-12)
    assert found.gap.what == "an opening"


def test_shares_of_widths_follow_the_length_of_the_walls():
    surface = grid(20, 10, 2.0, 1.0)
    found = measured(surface, [surface.V[:, 0]], [[0.2, 0.3, 0.8, 1.2]])
    assert found.quantiles([0.0, 1.0]) == pytest.approx([0.1, 1.0])  # across, and from end to end
    limits, share = found.histogram()
    assert share.sum() == pytest.approx(1)
    assert len(limits) == len(share) + 1
    thin = found.weight[np.isclose(found.widths, 0.1)].sum()
    assert thin == pytest.approx(2.0, rel=1e-9)  # two walls of a metre


@pytest.mark.parametrize("limit", [0.009, 0.1, 0.13, 0.4, 5.0])
def test_a_bin_ends_at_the_least_width(limit):
    """What is under the limit, 1.2 times it or just as wide is in bins that are wholly on its side."""
    surface = grid(20, 10, 2.0, 1.0)
    found = measured(surface, [surface.V[:, 0]], [[0.2, 0.3, 0.8, 1.2]])  # members of 0.1 and 0.4 m, and ends of 1 m
    limits, share = found.histogram(limit)
    assert share.sum() == pytest.approx(1)
    assert limits[0] == 0
    assert np.all(np.diff(limits) > 0)
    assert len(share) == len(limits) - 1 <= 61
    assert limits[-1] <= 3.1 * found.quantiles([0.5])[0]
    under = found.weight[found.widths < limit * (1 - 1e-6)].sum() / found.weight.sum()
    assert share[limits[1:] <= limit].sum() == pytest.approx(under if limit < limits[-1] else 1)


# --- the same by other roads


def test_the_width_is_that_of_the_formula_where_a_mode_bends():
    """A band |z - k| < d is 2 d / |grad z| wide, face by face."""
    surface = lifted(lambda x, y: 0.3 * np.sin(3 * x) * y, cells=40)
    z = 4 * surface.V[:, 0] + 0.6 * surface.V[:, 1] ** 2
    found = measured(surface, [z], [[0.8, 1.2, 1.8, 2.2, 2.8, 3.2]])
    slope = slopes(surface, z)
    formula = 0.4 / slope
    assert found.quantiles([0.02, 0.98]) == pytest.approx(np.quantile(formula, [0.02, 0.98]), rel=0.06)
    assert found.member.size == pytest.approx(formula.min(), rel=0.08)


@pytest.mark.parametrize("seed", range(3))
def test_the_narrowest_neck_by_sampled_walls(seed):
    """Round holes at random: the least distance between points of the walls of two different holes, by a tree."""
    random = np.random.default_rng(seed)
    surface = jittered(grid(50, 50, 1.0, 1.0), seed=seed)
    centres = np.stack(np.meshgrid([0.2, 0.5, 0.8], [0.2, 0.5, 0.8]), -1).reshape(-1, 2)
    centres = centres + random.uniform(-0.04, 0.04, centres.shape)
    radius = random.uniform(0.07, 0.1, len(centres))
    holes = (np.linalg.norm(surface.V[:, None, :2] - centres, axis=2) - radius).min(axis=1)
    sheet = cut(surface, [holes], [[0.0]], 0)
    kept = sheet.subset().surface
    ends = kept.V[kept.edges.ends[kept.edges.boundary]][:, :, :2]
    points = np.concatenate([(1 - t) * ends[:, 0] + t * ends[:, 1] for t in np.linspace(0, 1, 9)])
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    whose = np.where(inner, np.linalg.norm(points[:, None] - centres, axis=2).argmin(axis=1), -1)
    least = min(
        cKDTree(points[whose == a]).query(points[whose == b])[0].min() for a in range(-1, 9) for b in range(a + 1, 9)
    )
    assert features(sheet, sheet.material, []).member.size == pytest.approx(least, rel=0.01)


# --- laws


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_features_scale_and_turn_with_the_surface(scale):
    surface = lifted(lambda x, y: 0.4 * x * y, cells=20)
    z = surface.V[:, 0] + 0.3 * surface.V[:, 1] ** 2
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    levels = [[0.2, 0.3, 0.6, 0.75]]
    one = measured(surface, [z], levels)
    two = measured(Surface(scale * surface.V @ turn.T, surface.F), [z], levels)
    for name in ("member", "gap", "edge"):
        a, b = getattr(one, name), getattr(two, name)
        assert b.size == pytest.approx(scale * a.size, rel=1e-6)
        assert b.mesh == pytest.approx(scale * a.mesh, rel=1e-6)
    assert two.member.place == pytest.approx(scale * turn @ one.member.place, abs=1e-6 * scale)


def test_a_closed_sheet_has_gaps_but_no_walls_of_its_own():
    ball = sphere(4)
    found = measured(ball, [ball.V[:, 2]], [[-0.1, 0.1]])
    arc = 2 * np.arcsin(0.1)
    assert found.member.size == pytest.approx(arc, rel=0.01)  # along the sphere, not through it
    whole = features(cut(ball, [ball.V[:, 2]], [[]]), np.ones(ball.m, dtype=bool), [])
    assert (whole.member, whole.gap, len(whole.widths)) == (None, None, 0)
    assert len(whole.quantiles([0.5])) == len(whole.histogram()[0]) == 0


def test_lines_run_over_a_sheet_with_one_side():
    """A Moebius strip: neighbours across the seam face opposite sides."""
    cells, width = 60, 0.3
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, cells, endpoint=False), np.linspace(-width, width, 7), indexing="ij")
    V = np.stack([(1 + v * np.cos(u / 2)) * np.cos(u), (1 + v * np.cos(u / 2)) * np.sin(u), v * np.sin(u / 2)], -1)
    i, j = np.meshgrid(np.arange(cells), np.arange(6), indexing="ij")
    a, d = (i * 7 + j).ravel(), (i * 7 + j + 1).ravel()
    last = (i == cells - 1).ravel()
    b = np.where(last, 6 - j.ravel(), a + 7)
    c = np.where(last, 5 - j.ravel(), d + 7)
    strip = Surface(V.reshape(-1, 3), np.r_[np.c_[a, b, c], np.c_[a, c, d]])
    whole = features(cut(strip, [np.zeros(strip.n)], [[]]), np.ones(strip.m, dtype=bool), [])
    assert whole.quantiles([0.01, 0.99]) == pytest.approx([2 * width] * 2, rel=0.02)


def test_cells_of_dropped_pieces_are_not_kept():
    surface = grid(20, 10, 2.0, 1.0)
    sheet = cut(surface, [surface.V[:, 0]], [[0.1, 0.3, 0.8, 1.3, 1.5, 1.6]], 0)
    part = sheet.subset()
    count, label = pieces(part.surface.F, part.surface.edges)
    assert count == 3
    assert (kept_cells(sheet, part) == sheet.material).all()
    few = part.subset(label == 1)
    kept = kept_cells(sheet, few)
    assert sheet.surface.areas[kept].sum() == pytest.approx(few.surface.area, rel=1e-12)
    assert (np.sort(sheet.surface.centroids[kept], axis=0) == np.sort(few.surface.centroids, axis=0)).all()


# --- walls of solids


def test_the_wall_of_a_plate_is_its_thickness():
    surface = jittered_plate()
    solid = thicken(surface, offsets(surface, 0.03).D)
    assert thinnest_wall(solid).thickness == pytest.approx(0.03, rel=1e-9)


def test_the_wall_is_thinnest_where_the_sheet_was_thinned():
    surface = jittered_plate()
    D = np.array(offsets(surface, 0.03).D)
    at = int(np.linalg.norm(surface.V - [1.0, 0.5, 0], axis=1).argmin())
    D[at] *= 0.5
    wall = thinnest_wall(thicken(surface, D))
    assert wall.thickness == pytest.approx(0.015, rel=0.04)
    assert wall.place[:2] == pytest.approx(surface.V[at, :2], abs=1e-9)


def test_the_wall_of_a_shell_follows_its_radii():
    ball = sphere(4)
    wall = thinnest_wall(thicken(ball, offsets(ball, 0.1).D))
    assert wall.thickness == pytest.approx(0.1, rel=0.01)


def test_a_solid_without_opposite_faces_has_no_wall():
    corner = Solid([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], 0, 1)
    assert thinnest_wall(corner) is None


def blade() -> tuple[np.ndarray, np.ndarray]:
    """A plate 0.1 m thick, ground to an edge of 11 degrees on one side, and fine at that: its section along y."""
    profile = [(0, 0), (1, 0), (1.4, 0.04), (1.5, 0.05), (1.4, 0.06), (1, 0.1), (0, 0.1)]
    n, y = len(profile), np.linspace(0, 1, 9)
    V = np.array([(x, at, z) for at in y for x, z in profile])
    side = [(k, (k + 1) % n) for k in range(n)]
    F = [
        f
        for j in range(8)
        for a, b in side
        for f in ((j * n + b, j * n + a, j * n + n + a), (j * n + b, j * n + n + a, j * n + n + b))
    ]
    caps = [(0, k, k + 1) for k in range(1, n - 1)] + [(8 * n, 8 * n + k + 1, 8 * n + k) for k in range(1, n - 1)]
    return V, np.array(F + caps)


def test_an_edge_as_of_a_blade_is_no_wall():
    V, F = blade()
    assert trimesh.Trimesh(V, F, process=False).volume == pytest.approx(0.125)
    assert thinnest_wall(Solid(V, F, 0, 1)).thickness == pytest.approx(0.1, rel=1e-9)
    assert clearances(V, F).wall.size == pytest.approx(0.1, rel=0.01)  # the bevel, near where it begins


def test_the_wall_of_a_very_small_solid_is_found_too():
    """Its triangles are smaller than libigl's rays see at that size."""
    plate = grid(2, 2, 4e-4, 4e-4)
    solid = thicken(plate, np.tile([0.0, 0.0, 5e-5], (plate.n, 1)))
    assert thinnest_wall(solid).thickness == pytest.approx(1e-4, rel=1e-9)


def test_a_width_within_rounding_of_the_limit_passes():
    assert below_limit(np.array([0.1, 0.1 - 1e-8, 0.1 - 1e-6]), 0.1).tolist() == [False, False, True]
