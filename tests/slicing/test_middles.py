"""Middles and edges of stripes that faces see in signs of their own: rings on a cylinder, straight lines on a plate."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from dsfab.slicing import Chart, chart_of, cut, halve_lines
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.measures.chart import StripeChart, stripe_middles
from dsfab.slicing.measures.lines import CornerLines, chart_lines, clip_segments, edge_lines
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField
from tests.shapes import grid, jittered
from tests.slicing.staggered_tubes import staggered_tube

NAMES = ("major", "minor")


def corner_field(surface: Surface, z: np.ndarray, turned: np.ndarray, d: float = 0.0) -> CornerField:
    """z (n,), which `turned` faces (m,) see as 7 - z; with a half-width, the two edges of its stripes."""
    x = np.stack([z + d, z - d], axis=1) if d else z[:, None]
    sign = np.where(turned[:, None], -1.0, 1.0).repeat(3, axis=1)
    return CornerField(x, sign, np.where(sign < 0, 7.0, 0.0), np.zeros(surface.m, dtype=bool))


def drawn(surface: Surface, z: np.ndarray, y: np.ndarray, turned: np.ndarray, d: float = 0.2):
    """Sheet, edges and middles of stripes z and y, both of half-width d."""
    none = np.zeros_like(turned)
    wish = (np.zeros(surface.m),) * 2
    fields = corner_field(surface, z, turned), corner_field(surface, y, none)
    chart = chart_of(halve_lines(surface, fields, wish, (0, 0)))
    bands = [corner_field(surface, z, turned, d), corner_field(surface, y, none, d)]
    levels = [np.arange(-20.0, 21.0)] * 2
    sheet = cut(surface, bands, levels, 0.0).subset()
    edges = edge_lines(sheet, surface, NAMES, [CornerLines(*pair) for pair in zip(bands, levels, strict=True)])
    width = np.full(surface.n, d)
    return sheet, edges, {name: chart_lines(sheet, surface, NAMES, name, chart, width) for name in NAMES}


def test_middle_lines_of_rings_are_closed_for_any_orientation_of_phases():
    surface = staggered_tube(24, 11)
    z = surface.V[:, 2] * 2 + 0.3
    turned = surface.centroids[:, 0] > 0
    _, edges, middles = drawn(surface, z, np.full(surface.n, 0.5), turned)
    _, plain, straight = drawn(surface, z, np.full(surface.n, 0.5), np.zeros(surface.m, dtype=bool))
    assert len(middles["major"]) == 4
    assert middles["minor"] == []
    for lines, others in ((edges, plain), (middles["major"], straight["major"])):
        assert {line.is_closed for line in lines} == {True}
        lengths = [sorted(line.length for line in one) for one in (lines, others)]
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-9)
    heights = sorted(float(line.points[:, 2].mean()) for line in middles["major"])
    assert heights == pytest.approx([(k - 0.3) / 2 for k in (1, 2, 3, 4)])
    assert {line.number for line in straight["major"]} == {1, 2, 3, 4}


def test_a_number_is_that_of_most_of_the_line():
    surface = staggered_tube(24, 11)
    z = surface.V[:, 2] * 2 + 0.3
    _, _, middles = drawn(surface, z, np.full(surface.n, 0.5), surface.centroids[:, 0] > 0.7)
    assert {line.number for line in middles["major"]} == {1, 2, 3, 4}
    _, edges, middles = drawn(surface, z, np.full(surface.n, 0.5), surface.centroids[:, 0] < 0.7)
    assert {line.number for line in middles["major"]} == {6, 5, 4, 3}
    assert {line.number for line in edges if line.family == "major"} == {6, 5, 4, 3}


@pytest.mark.parametrize("turned", ["none", "right", "left", "odd"])
def test_lines_along_edges_of_the_mesh_and_its_boundary_are_drawn_once(turned):
    """2 x is 0, 1, 2 along the left boundary, along edges in the middle, and along the right boundary."""
    plate = grid(10, 6, 1.0, 1.0)
    x = plate.V[:, 0]
    right = plate.centroids[:, 0] > 0.5
    marks = {"none": right & ~right, "right": right, "left": ~right, "odd": np.arange(plate.m) % 2 == 1}[turned]
    _, _, middles = drawn(plate, 2 * x, np.full(plate.n, 0.5), marks)
    assert [line.length for line in middles["major"]] == pytest.approx([1.0] * 3)
    assert sorted(line.points[:, 0].mean() for line in middles["major"]) == pytest.approx([0.0, 0.5, 1.0])


def test_middles_end_with_the_sheet():
    plate = jittered(grid(16, 9, 2.0, 1.0))
    x, y = plate.V[:, 0], plate.V[:, 1]
    sheet, _, middles = drawn(plate, 2 * x + 0.5, 2 * y + 0.5, np.zeros(plate.m, dtype=bool))
    assert [line.length for line in middles["major"]] == pytest.approx([1.0] * 4, rel=1e-9)
    assert [line.length for line in middles["minor"]] == pytest.approx([2.0] * 2, rel=1e-9)
    fields = tuple(corner_field(plate, f, np.zeros(plate.m, dtype=bool)) for f in (2 * x + 0.5, 2 * y + 0.5))
    chart = chart_of(halve_lines(plate, fields, (np.zeros(plate.m),) * 2, (0, 0)))
    part: Sheet = sheet.subset(sheet.surface.centroids[:, 1] < 0.6)
    for line in chart_lines(part, plate, NAMES, "major", chart, np.full(plate.n, 0.2)):
        assert line.points[:, 1].min() == pytest.approx(0.0, abs=1e-9)
        assert line.points[:, 1].max() < 0.85  # the minor stripe around 0.75 is kept to 0.6 only, or not at all
    none = np.where(x < 1.1, 0.0, 0.2)  # no member there
    found = chart_lines(sheet, plate, NAMES, "major", chart, none)
    assert [round(float(line.points[:, 0].mean()), 6) for line in found] == [1.25, 1.75]


def test_a_line_that_no_member_was_drawn_along_does_not_cross_other_members():
    """Only the minor stripes were cut: of the major middles nothing is left, though the chart has them."""
    plate = grid(16, 9, 2.0, 1.0)
    fields = tuple(corner_field(plate, 2 * plate.V[:, k] + 0.5, np.zeros(plate.m, dtype=bool)) for k in (0, 1))
    chart = chart_of(halve_lines(plate, fields, (np.zeros(plate.m),) * 2, (0, 0)))
    band = corner_field(plate, 2 * plate.V[:, 1] + 0.5, np.zeros(plate.m, dtype=bool), 0.2)
    sheet = cut(plate, [-np.ones(plate.n), band], [[], np.arange(9.0)], 0.0).subset()
    assert chart_lines(sheet, plate, NAMES, "major", chart, np.full(plate.n, 0.2)) == []
    assert len(chart_lines(sheet, plate, NAMES, "minor", chart, np.full(plate.n, 0.2))) == 2


@pytest.mark.parametrize(("shift", "count"), [(0.7e-6, 5), (1.4e-6, 4)])
def test_a_middle_beside_vertices_by_a_rounding_error_runs_through_them(shift, count):
    """Vertices are beside whole numbers of the phase by `shift` periods, so that the first line may miss the plate."""
    plate = grid(4, 2, 1.0, 0.5)
    z, scale = 4 * plate.V[:, :2] + shift, np.ones((plate.n, 2))
    chart = Chart(plate, np.arange(plate.m), csr_array(np.eye(plate.n)), z, scale)
    stripes = StripeChart.from_chart(chart, np.full((plate.n, 2), 0.2), -np.ones(plate.n))
    assert stripe_middles(stripes, 0).length.sum() == pytest.approx(0.5 * count)


@pytest.mark.parametrize(("gap", "count"), [(0.7e-7, 1), (1.4e-7, 2)])
def test_a_line_goes_on_across_a_gap_that_is_a_rounding_error(gap, count):
    """A face with two quads as its sheet, .25 wide, apart by a share of a line that runs through both."""
    x, y = np.array([0, 0.25, 0.25 + gap / 2, 0.5]), np.array([0.1, 0.3])
    P = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((4, 2))], axis=-1).reshape(-1, 3)
    F = np.array([[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]])
    face = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    weights = np.c_[1 - P.sum(axis=1), P[:, :2]]
    none = np.zeros(4, dtype=int)
    sheet = Sheet(Surface(P, F), none, none, csr_array(weights))
    chart = Chart(face, none[:1], csr_array(np.eye(3)), np.zeros((3, 2)), np.ones((3, 2)))
    spans = clip_segments(chart, none[:1], np.array([[[0.8, 0, 0.2], [0.3, 0.5, 0.2]]]), none[:1], sheet, face.F)
    assert len(spans.begin) == count
    assert (spans.begin[0], spans.end[-1]) == (0, 1)


@pytest.mark.parametrize(("shift", "count"), [(0.7e-9, 3), (1.3e-9, 2)])
def test_a_line_that_misses_the_boundary_by_a_rounding_error_is_drawn_along_it(shift, count):
    """The phase is 0, 1, 2 along the left boundary, in the middle and along the right boundary, plus a shift."""
    plate = grid(10, 6, 1.0, 1.0)
    turned = np.zeros(plate.m, dtype=bool)
    sheet, _, _ = drawn(plate, 2 * plate.V[:, 0], np.full(plate.n, 0.5), turned)
    z = np.c_[2 * plate.V[:, 0] + shift, np.full(plate.n, 0.5)]
    chart = Chart(plate, np.arange(plate.m), csr_array(np.eye(plate.n)), z, np.ones((plate.n, 2)))
    lines = chart_lines(sheet, plate, NAMES, "major", chart, np.full(plate.n, 0.2))
    assert [line.length for line in lines] == pytest.approx([1.0] * count)


@pytest.mark.parametrize(("away", "vertex"), [(0.7e-9, 0), (1.3e-9, -1)])
def test_a_vertex_of_a_sheet_is_one_of_the_surface_if_only_rounding_parts_them(away, vertex):
    face = Surface([[away, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    weights = np.c_[1 - face.V.sum(axis=1), face.V[:, :2]]
    sheet = Sheet(face, np.zeros(1, dtype=int), np.zeros(1, dtype=int), csr_array(weights))
    assert sheet.same_vertex().tolist() == [vertex, 1, 2]
