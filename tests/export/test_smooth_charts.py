"""Charts of smooth STEP: divided where no spline follows them, on points dense enough, beside those that fail."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.design.output.files import curved_sheet, largest_fields
from dsfab.export import StepOptions, write
from dsfab.export.cad.step.shared.sheet_outline import WALL, sheet_of
from dsfab.export.cad.step.shared.skins import SmoothLimits
from dsfab.export.cad.step.smooth import build, charts
from dsfab.export.cad.step.smooth import charts as points
from dsfab.export.cad.step.smooth.build import SmoothPlan
from dsfab.export.cad.step.smooth.charts import ChartAtlas, fitted_surface
from dsfab.export.cad.step.smooth.edges import run_key
from dsfab.export.part import DividedSheet, part_of
from dsfab.slicing import Sheet, cut
from dsfab.surface import Surface
from dsfab.thickening import offsets, thicken
from tests.shapes import grid, sphere

THICKNESS = 0.04


def bumped() -> Surface:
    """A plate of 3 x 1 m with a bump at one end."""
    flat = grid(48, 16, 3.0, 1.0)
    away = np.linalg.norm(flat.V[:, :2] - [2.4, 0.5], axis=1)
    return Surface(flat.V + np.c_[np.zeros((flat.n, 2)), 0.15 * np.exp(-((away / 0.3) ** 2))], flat.F)


def all_of(surface: Surface) -> Sheet:
    return cut(surface, [surface.V[:, 0]], [np.array([-2.0])]).subset()


def test_a_chart_without_a_fit_is_divided_and_other_borders_stay(monkeypatch):
    for name in ("FEW_POLES", "MOST_POLES"):
        monkeypatch.setattr(charts, name, 9)
    surface = bumped()
    x = surface.V[:, 0]
    fields = np.c_[1.0 - x, x - 1.0]
    atlas = ChartAtlas(surface, curved_sheet(surface, all_of(surface), THICKNESS), fields, 0.6)
    atlas.make([0, 1])
    assert not atlas.failed
    assert sorted(atlas.charts) == list(range(atlas.fields.shape[1]))
    assert len(atlas.charts) > 2
    assert all(chart.off <= chart.tolerance for chart in atlas.charts.values())
    assert atlas.fields[:, 0] == pytest.approx(fields[:, 0])
    assert atlas.fields[:, 1:].max(axis=1) == pytest.approx(fields[:, 1])


def test_a_chart_that_no_plane_sees_is_divided():
    surface = sphere(3)
    atlas = ChartAtlas(surface, curved_sheet(surface, all_of(surface), THICKNESS), np.ones((surface.n, 1)), 1.0)
    atlas.make([0])
    assert not atlas.failed
    assert len(atlas.charts) == atlas.fields.shape[1]
    assert 4 <= len(atlas.charts) <= 12
    assert min(chart.steepest for chart in atlas.charts.values()) > charts.STEEPEST


def test_a_fit_keeps_its_tolerance_between_its_points_or_adds_points():
    """With as many poles as points a surface meets the points, and waves between them."""
    rng = np.random.default_rng(0)
    height = lambda p: 0.5 * np.exp(-((p**2).sum(axis=1)) / 0.02)  # noqa: E731
    skins = lambda p: np.c_[p, height(p), p, height(p) - 0.01]  # noqa: E731
    others = rng.uniform(-0.95, 0.95, (5000, 2))
    for count, starved in ((400, True), (6000, False)):
        uv = rng.uniform(-1, 1, (count, 2))
        fit = fitted_surface(uv, skins(uv), np.ones(count, dtype=bool), np.ones(count), 2e-3)
        assert fit.starved == starved
    assert fit.off <= 2e-3
    assert np.abs(fit.patch(others) - skins(others)).max() < 3 * 2e-3


def test_thickness_half_way_along_edges_is_that_of_the_ends():
    d = np.array([[0.0, 0, 2], [0, np.sqrt(8), np.sqrt(8)]])
    assert np.linalg.norm(points.mean_half_vectors(d, np.array([[0, 1]]))) == pytest.approx(3)


def test_the_chord_error_that_counts_is_that_of_the_triangle_where_a_point_is():
    """The vertex nearest to the point is no corner of it."""
    V = np.array([[0.0, 0, 0], [10, 0, 0], [5, 0.3, 0], [5, -3, 0]])
    F = np.array([[0, 1, 2], [1, 0, 3]])
    limits = SmoothLimits(20.0, 1.0, V, F, np.array([0.25, 2.0]), np.zeros(2))
    assert limits.allowed_distances(np.array([[5.0, -0.1, 0], [5, 0.2, 0.1]])) == pytest.approx([3.0, 1.25])


def test_a_much_larger_tolerance_at_the_coarsest_faces_gives_a_note():
    """A file 7 mm off was said to be allowed 2 mm and usually 1."""
    V, F = np.zeros((3, 3)), np.zeros((20, 3), dtype=np.int64)
    chord = np.append(np.full(19, 0.3), 9.0)
    told = SmoothLimits(20.0, 1.0, V, F, chord, np.zeros(20)).summary
    assert (
        told == "allowed distance: 1 mm plus the chord error of the mesh, usually under 0.3 mm, up to 9 mm at coarse "
        "triangles"
    )
    even = SmoothLimits(20.0, 1.0, V, F, np.full(20, 0.3), np.zeros(20)).summary
    assert even == "allowed distance: 1 mm plus the chord error of the mesh, usually under 0.3 mm"


def test_a_face_between_three_borders_joins_a_neighbouring_chart():
    """Chart 3 is largest at no corner of face 1, nor is it near."""
    F = np.array([[0, 1, 2], [1, 3, 2]])
    fields = np.array([[1.0, 0, 0, -9], [0.6, 0.6, 0, -9], [0.6, 0, 0.6, -9], [0, 0.7, 0.5, -9]])
    assert largest_fields(fields, F, np.array([0, 3])).tolist() == [0, 1]
    assert largest_fields(fields, F, np.array([0, 2])).tolist() == [0, 2]


def test_an_outline_that_touches_itself_is_split_at_that_vertex():
    """Chart 1 is two squares that meet in a corner: the outline of chart 0 around them comes by there twice."""
    flat = grid(4, 4, 4.0, 4.0)
    cell = np.floor(flat.centroids[:, :2]).tolist()
    chart = np.array([int(at in ([1, 1], [2, 2])) for at in cell])
    boundary = np.flatnonzero(flat.edges.boundary[flat.edges.of.ravel()])
    given = DividedSheet(flat.V, flat.F, np.zeros((flat.n, 3)), chart, boundary, np.full(len(boundary), -1))
    regions = sheet_of(given, 0).regions
    assert sorted((region.chart, len(region.loops)) for region in regions) == [(0, 3), (1, 1), (1, 1)]
    for region in regions:
        for loop in region.loops:
            visited = np.concatenate([run.vertices[:-1] for run in loop])
            assert len(np.unique(visited)) == len(visited)
    seams = [
        {
            run_key(run)[0]
            for region in regions
            if region.chart == k
            for loop in region.loops
            for run in loop
            if run.beyond == 1 - k
        }
        for k in (0, 1)
    ]
    assert seams[0] == seams[1]
    assert len(seams[0]) == 4


def test_wall_runs_end_at_the_vertices_of_seams():
    """Chart 1 is a square, a corner of which touches the longest side of an opening with three: two outlines of chart 0
    pass that vertex, and curves that only came near it would cross."""
    flat = grid(4, 4, 4.0, 4.0)
    x, y = np.floor(flat.centroids[:, :2]).T
    there, chart = (x != 2) | (y != 2), ((x == 1) & (y == 1)).astype(np.int64)
    at = int(np.flatnonzero((flat.V[:, :2] == 2).all(axis=1))[0])
    V = flat.V.copy()
    V[at, :2] = 2.5
    kept = Surface(V, flat.F[there])
    boundary = np.flatnonzero(kept.edges.boundary[kept.edges.of.ravel()])
    given = DividedSheet(V, kept.F, np.zeros((flat.n, 3)), chart[there], boundary, np.full(len(boundary), -1))
    runs = [run for region in sheet_of(given, 0).regions for loop in region.loops for run in loop]
    touching = [run for run in runs if at in run.vertices]
    assert sorted(run.beyond == WALL for run in touching) == [False] * 4 + [True] * 2
    assert all(at in run.vertices[[0, -1]] for run in touching)


@pytest.mark.slow
def test_a_chart_that_fails_costs_its_pieces_only(tmp_path, inspected_pieces, monkeypatch):
    """A fold at x = 1.5 in one of two pieces."""
    monkeypatch.setattr(build, "LAYOUTS", build.LAYOUTS[:1])
    monkeypatch.setattr(charts, "HALVED", 2)
    flat = grid(16, 6, 2.0, 1.0)
    surface = Surface(flat.V + np.c_[np.zeros((flat.n, 2)), np.abs(flat.V[:, 0] - 1.5)], flat.F)
    sheet = cut(surface, [np.abs(surface.V[:, 0] - 1.2) - 0.1], [np.array([0.0])]).subset()
    solid = thicken(sheet.surface, sheet.carry_corners(offsets(surface, THICKNESS).at_corners(surface.F), surface.F))
    said: list[str] = []
    curved = partial(curved_sheet, surface, sheet, THICKNESS)
    write(solid, tmp_path / "a.step", step=StepOptions("smooth", curved=curved), note=said.append)
    assert "1 of 2 pieces" in said[0]
    assert "no spline surface fits part" in said[0]


@pytest.mark.parametrize(("middle", "needed"), [(1.5, True), (0.5, False)])
def test_a_failed_chart_of_the_only_solid_stops_the_layout(monkeypatch, middle, needed):
    """Of eight charts one fails, at x = 1.5: where the solid is there, those after it are not fitted."""
    flat = grid(16, 6, 2.0, 1.0)
    surface = Surface(flat.V + np.c_[np.zeros((flat.n, 2)), 0.2 * flat.V[:, 0] ** 2], flat.F)
    sheet = cut(surface, [0.2 - np.abs(surface.V[:, 0] - middle)], [np.array([0.0])]).subset()
    solid = thicken(sheet.surface, sheet.carry_corners(offsets(surface, THICKNESS).at_corners(surface.F), surface.F))
    part = replace(part_of(solid, "a"), curved=partial(curved_sheet, surface, sheet, THICKNESS))
    fields = -np.abs(surface.V[:, :1] - np.linspace(0.125, 1.875, 8))
    made, honest = list[int](), ChartAtlas.chart

    def disliked(self, k, *how):
        made.append(k)
        if abs(surface.V[self.fields.argmax(axis=1) == k, 0].mean() - 1.5) < 0.2:
            raise ExportError("it is disliked")
        return honest(self, k, *how)

    monkeypatch.setattr(ChartAtlas, "chart", disliked)
    monkeypatch.setattr(SmoothPlan, "unfinished_vertices", lambda *_: np.arange(surface.n))
    if needed:
        with pytest.raises(ExportError, match="it is disliked"):
            SmoothPlan(part).build(fields)
    else:
        assert not SmoothPlan(part).build(fields).model.pieces[0].refused
    assert (len(made) < 8) == needed
