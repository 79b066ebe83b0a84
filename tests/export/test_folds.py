"""Planar STEP of folded sheets: facets as planes that meet in their folds; OCCT's word on them (slow)."""

import json
from dataclasses import replace
from functools import partial

import igl
import numpy as np
import pytest

from dsfab.design.output.files import curved_sheet
from dsfab.export import StepOptions, write
from dsfab.export.cad.step.folded_sheets import flat_facets, folded_shape, folded_sheet, planar_file
from dsfab.export.cad.step.strategies import attempts
from dsfab.export.cad.step.worker import program
from dsfab.export.cad.step.worker.shapes import parts, read
from dsfab.export.subprocesses import run_program
from dsfab.slicing import cut
from dsfab.surface import SHAPES, Surface
from dsfab.thickening import offsets, thicken
from tests.export.folded_sheets import SLOPE, T, folded_part, openings, ridged_roof


def pyramid() -> Surface:
    """Five facets of other slopes: their planes do not meet in a point once they are shifted."""
    base = np.array([[1.0, 0, 0], [0.2, 1, 0.1], [-0.9, 0.4, 0], [-0.7, -0.8, 0.3], [0.4, -1, 0]])
    F = np.stack([np.zeros(5), 1 + np.arange(5), 1 + (np.arange(5) + 1) % 5], axis=1).astype(np.int64)
    V, F = igl.upsample(np.concatenate([[[0, 0, 0.6]], base]), F, 3)
    return Surface(V, F)


def test_two_strips_are_planes_that_meet_in_a_mitred_ridge():
    surface = ridged_roof()
    part, _, _ = folded_part(surface, openings(surface))
    sheet = folded_sheet(part)
    assert (sheet.count, len(sheet.outline.regions)) == (2, 2)
    ridge = np.flatnonzero(np.isclose(sheet.outline.V[:, 1], 1000))
    height = 1000 * (SLOPE + np.array([1, -1]) * T / 2 * np.hypot(1, SLOPE))
    np.testing.assert_allclose(sheet.points[ridge, :, 2], np.tile(height, (len(ridge), 1)), atol=1e-6)
    text = "".join(planar_file(part).texts)
    walls = 4 + 2 * 3 + 6  # of the opening in a strip, of the one across, of the outline
    assert text.count("=PLANE(") == text.count("=ADVANCED_FACE(") == walls + 4
    assert "B_SPLINE" not in text
    assert text.count("=ORIENTED_EDGE(") == 2 * text.count("=EDGE_CURVE(")


def test_edges_of_oblique_facets_lie_on_their_planes_within_the_limit_of_occt(tmp_path):
    """On a turned roof of 8 m with 6 decimals they were 1e-6 mm off, and what shortens an edge found it too far off."""
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    turned = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    surface = ridged_roof()
    surface = Surface(4 * surface.V @ turned * np.linalg.det(turned), surface.F)
    part, _, _ = folded_part(surface, openings(ridged_roof()))
    path = tmp_path / "roof.step"
    path.write_text("".join(planar_file(part).texts), encoding="ascii")
    edges = parts(read(path), "EDGE")
    assert max(BRep_Tool.Tolerance_s(TopoDS.Edge(edge)) for edge in edges) <= 1e-7


def off_planes(sheet) -> float:
    """The largest distance of a vertex from a plane of its facets, millimetres."""
    found = []
    for k, facet in sheet.facets.items():
        corners = sheet.points[np.unique(sheet.outline.F[sheet.outline.chart == k])]
        found.append(np.abs(np.einsum("ksi,si->ks", corners - facet.origin, facet.axes[:, 2])).max())
    return max(found)


def test_vertices_that_a_file_rounded_are_put_into_their_planes():
    exact = ridged_roof()
    surface = Surface(np.round(exact.V @ np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1 / 7]]).T, 6), exact.F)
    part, _, _ = folded_part(surface, openings(exact))
    sheet = folded_sheet(part)
    assert sheet.count == 2
    assert off_planes(sheet) < 1e-5


def test_a_corner_of_too_many_planes_keeps_its_facets():
    surface = pyramid()
    part, _, _ = folded_part(surface, np.zeros(surface.m, dtype=bool))
    sheet = folded_sheet(part)
    top = int(np.linalg.norm(sheet.outline.V - [0, 0, 600], axis=1).argmin())
    around = (top == sheet.outline.F).any(axis=1)
    assert sheet.count == 5
    assert (np.bincount(sheet.outline.chart)[sheet.outline.chart[around]] == 1).all()
    assert off_planes(sheet) < 1e-5
    assert len(folded_shape(sheet, 1.0).walls) >= 5


def test_curved_and_plane_sheets_are_not_folded():
    for name in ("plate", "hypar"):
        surface = SHAPES[name]() if name == "plate" else SHAPES[name](edge=0.8)
        part, _, _ = folded_part(surface, np.zeros(surface.m, dtype=bool))
        assert folded_sheet(part) is None


@pytest.mark.parametrize(("slope", "first"), [(SLOPE, "planar"), (0.1, "smooth")])
def test_only_creases_are_taken_for_folds_unasked(slope, first):
    """A cylinder's mesh has flat strips, too."""
    surface = ridged_roof(slope=slope)
    part, _, _ = folded_part(surface, openings(surface))
    assert folded_sheet(part).count == 2
    assert flat_facets(part).has_creases == (first == "planar")
    assert next(attempts(replace(part, step="auto"))).step == first
    assert next(attempts(part)).step == "planar"


def test_a_curved_sheet_is_refused_before_its_outlines_are_computed(monkeypatch):
    """Mitring and outlines of each triangle of a dome took seven seconds, and were not asked for."""
    surface = ridged_roof(slope=0.1)
    part, _, _ = folded_part(surface, openings(surface))
    monkeypatch.setattr("dsfab.export.cad.step.folded_sheets.sheet_of", lambda *_: pytest.fail("outlines were found"))
    assert next(attempts(replace(part, step="auto"))).step == "smooth"


@pytest.mark.slow
def test_a_roof_with_openings_is_written_cut_and_measured(tmp_path):
    surface = ridged_roof()
    void = openings(surface)
    _, solid, curved = folded_part(surface, void)
    said, path = list[str](), tmp_path / "roof.step"
    write(solid, path, step=StepOptions("auto", curved=partial(lambda: curved)), note=said.append)
    assert said[0].startswith("STEP is planar, 2 flat facets mitred at their folds")
    found = json.loads(run_program(program.__file__, "use", str(path), "4", seconds=300))
    assert (found["faces"], found["valid"], found["sound"], found["boxed"]) == (20, True, 4, True)
    assert (found["closed"], found["again"]) == (True, True)
    assert found["fillets"] >= 4
    assert found["volume"] == pytest.approx(1e9 * T * surface.areas[~void].sum(), rel=1e-6)


@pytest.mark.slow
def test_openings_in_facets_have_the_plain_rule_right(tmp_path):
    """Nearly square ones: with edges of 6 spans, which are uneven, the volume by that rule was .3 % wrong."""
    surface = ridged_roof(16)
    off = np.abs(surface.V[:, None, :2] - np.array([[0.5, 0.5], [1.4, 1.5]])) / 0.3
    away = ((off**6).sum(axis=2)).min(axis=1) ** (1 / 6) - 1
    sheet = cut(surface, [away], [np.array([0.0])]).subset()
    solid = thicken(sheet.surface, sheet.carry(offsets(surface, T).D))
    ask = StepOptions("planar", tolerance=0.5, curved=lambda: curved_sheet(surface, sheet, T))
    write(solid, tmp_path / "roof.step", step=ask)
    found = json.loads(run_program(program.__file__, "use", str(tmp_path / "roof.step"), "1", seconds=300))
    assert (found["solids"], found["valid"], found["sound"], found["again"]) == (1, True, 1, True)
    assert found["plain"] == pytest.approx(found["volume"], rel=1e-4)
    assert found["volume"] == pytest.approx(1e9 * solid.volume, rel=1e-3)
