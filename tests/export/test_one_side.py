"""Surfaces with one side only in STEP by members: cut open, and closed again in the file."""

import re
from collections import Counter
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

import dsfab
from dsfab.core.errors import ExportError
from dsfab.design.output.files import curved_sheet, opened_surface
from dsfab.export.cad.step.by_members.build import member_file
from dsfab.export.cad.step.by_members.draft import member_draft
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.cad.step.strategies import prepare
from dsfab.export.part import StripedSheet, part_of
from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening import offsets, thicken
from tests.shapes import moebius, projective_plane, with_mixed_sides

T = 0.05


def sheet_of(surface: Surface, kept: np.ndarray) -> Sheet:
    """Some faces of a surface."""
    used, F = np.unique(surface.F[kept], return_inverse=True)
    rows = csr_array(eye_array(surface.n, format="csr")[used])
    return Sheet(Surface(surface.V[used], F.reshape(-1, 3)), np.flatnonzero(kept), np.zeros(kept.sum(), int), rows)


def ladder(around: int = 60) -> tuple[Surface, np.ndarray, np.ndarray]:
    """A strip whose faces are turned over at random, which of them are kept, and their stripes: two members along it,
    and one across at every fifth of its columns."""
    strip = with_mixed_sides(moebius(around, 4, 0.8))[0]
    column, row = np.divmod(np.tile(np.arange(4 * around), 2), 4)
    along, across = np.isin(row, (0, 3)), column % 5 == 2
    return strip, along | across, along + 2 * across


def part_with_ladder():
    """Its part by members."""
    surface, kept, label = ladder()
    sheet = sheet_of(surface, kept)
    opening = opened_surface(surface, sheet)
    assert opening
    whole, seam = opening.sheet(sheet)
    striped = StripedSheet(whole.surface.F, whole.weights, label[kept], np.zeros(int(kept.sum()), dtype=bool), seam)
    curved = replace(curved_sheet(surface, sheet, T), striped=lambda: striped)
    _, first = np.unique(sheet.surface.F, return_index=True)
    corners = offsets(surface, T).at_corners(surface.F)[kept]
    solid = thicken(sheet.surface, corners.reshape(-1, 3)[first])
    return replace(prepare(part_of(solid, "ladder", 10**6)), curved=lambda: curved, step="members"), solid


@pytest.mark.parametrize("given", [moebius(), projective_plane(2)], ids=["strip", "closed"])
def test_a_surface_with_one_side_is_cut_open(given):
    """Its faces agree then, and lie where they lay; what is at one place on both sides has opposite offsets."""
    surface = with_mixed_sides(given)[0]
    whole = sheet_of(surface, np.ones(surface.m, dtype=bool))
    opening = opened_surface(surface, whole)
    assert opening
    assert len(misoriented_edges(opening.surface.F, opening.surface.edges)) == 0
    np.testing.assert_allclose(opening.surface.centroids, surface.centroids, atol=1e-12)
    a, b = opening.twins.T
    np.testing.assert_array_equal(opening.surface.V[a], opening.surface.V[b])
    curved = curved_sheet(surface, whole, 0.01)
    np.testing.assert_array_equal(curved.D[a], -curved.D[b])
    assert (np.einsum("mi,mci->mc", opening.surface.normals, curved.D[opening.surface.F]) > 0).all()
    sheet, seam = opening.sheet(whole)
    np.testing.assert_allclose(sheet.weights @ opening.surface.V, sheet.surface.V, atol=1e-12)
    start = sheet.surface.V[sheet.surface.F.ravel()[seam]]
    np.testing.assert_array_equal(start[:, 0], start[:, 1])
    assert opened_surface(Surface(sheet.surface.V, sheet.surface.F), sheet) is None


def test_a_seam_is_short_and_runs_where_little_is_kept():
    """Of a strip with one opening, at a quarter of its way or at three, it takes the way through that."""
    surface, _, _ = ladder()
    assert len(misoriented_edges(surface.F, surface.edges)) > 100
    column, row = np.divmod(np.tile(np.arange(4 * 60), 2), 4)
    for first in (12, 42):
        sheet = sheet_of(surface, (column < first) | (column >= first + 6) | np.isin(row, (0, 3)))
        opening = opened_surface(surface, sheet)
        assert opening
        assert len(misoriented_edges(opening.given.F, opening.given.edges)) == 4
        assert len(opening.sheet(sheet)[1]) == 2


def uses_of_edges(text: str) -> Counter[tuple[str, str]]:
    """How often each edge is run through, by its number and direction."""
    return Counter(re.findall(r"=ORIENTED_EDGE\('',\*,\*,#(\d+),\.([TF])\.\)", text))


def test_members_of_a_strip_with_one_side_close():
    """Every edge of the file is run through once each way: no wall is where the strip was cut open."""
    part, _ = part_with_ladder()
    text = member_draft(part, SolidPlan(part)).text
    uses = uses_of_edges(text)
    edges = set(re.findall(r"#(\d+)=EDGE_CURVE", text))
    assert set(uses) == {(e, way) for e in edges for way in "TF"}
    assert set(uses.values()) == {1}


def test_a_strip_with_one_side_has_no_two_smooth_skins():
    part, _ = part_with_ladder()
    with pytest.raises(ExportError, match="is one-sided"):
        smooth_file(replace(part, step="smooth"))


def test_the_file_of_a_one_sided_strip_is_compared_with_the_strip_cut_open(monkeypatch):
    part, _ = part_with_ladder()
    distance = import_module("dsfab.study.file_check.file_geometry")
    monkeypatch.setattr(distance, "curved_design", lambda design: part.curved())
    design = SimpleNamespace(preset=dsfab.load_preset("dome"), surface=ladder()[0])
    allowed = distance.Allowance.from_design(SimpleNamespace(reader="OCCT", deflection=1e-4), design)
    assert allowed.limits
    assert allowed.limits.thickness == pytest.approx(1000 * T, rel=0.02)


@pytest.mark.slow
def test_occt_accepts_and_cuts_a_one_sided_strip():
    part, solid = part_with_ladder()
    made = member_file(replace(part, hurry=0))
    assert made.solids == 1
    assert made.volume == pytest.approx(1e9 * solid.volume, rel=0.01)
    assert made.used.startswith("OCCT made 8 of 8")
