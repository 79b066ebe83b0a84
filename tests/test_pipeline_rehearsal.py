"""Slicing goes on from the sheet that the search for widths ended with, and gives what it gives without."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.design import Design, finishing, slicing_and_thickening
from dsfab.slicing import cut, cut_polygons
from dsfab.surface.fields import DividedField

COARSE = {"surface.edge": 0.6, "pattern.major.spacing": 2.0, "pattern.minor.spacing": 1.4, "pattern.keep": 0.8}


@pytest.fixture(scope="module")
def dome() -> dsfab.Preset:
    return dsfab.load_preset("dome", COARSE)


def drawn(preset: dsfab.Preset) -> Design:
    """A design up to its pattern, whose rehearsal is at hand."""
    return Design.from_preset(preset).until("pattern")


def counting(monkeypatch, module, name: str) -> list[str]:
    """A list that grows with every call of a function of a module."""
    original, calls = getattr(module, name), []

    def counted(*arguments, **options):
        calls.append(name)
        return original(*arguments, **options)

    monkeypatch.setattr(module, name, counted)
    return calls


def assert_same(one: Design, other: Design) -> None:
    """The same sheets, bit for bit, and the same notes."""
    for a, b in ((one.slicing.cells, other.slicing.cells), (one.slicing.sheet, other.slicing.sheet)):
        assert np.array_equal(a.surface.V, b.surface.V)
        assert np.array_equal(a.surface.F, b.surface.F)
        assert np.array_equal(a.family, b.family)
    assert one.notes == other.notes


@pytest.mark.slow
def test_the_sheet_is_the_same_without_a_rehearsal(dome):
    rehearsed, plain = drawn(dome), drawn(dome)
    assert finishing._TRIAL_CUTS.pop(plain.surface)
    assert_same(rehearsed, plain)


def test_nothing_is_cut_or_rounded_again(dome, monkeypatch):
    design = drawn(dome)
    cuts, rounded = (
        counting(monkeypatch, slicing_and_thickening, "cut"),
        counting(monkeypatch, finishing, "unrounded_cells"),
    )
    assert design.slicing.sheet.surface.m
    assert cuts == rounded == []
    assert design.surface not in finishing._TRIAL_CUTS


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [{"slicing.snap": 0.1}, {"slicing.pinch": "split"}, {"slicing.min_opening": 0.2}], ids=str
)
def test_other_terms_are_cut_anew(dome, change, monkeypatch):
    other = dsfab.load_preset("dome", COARSE | change)
    rehearsed, plain = drawn(other), drawn(other)
    del finishing._TRIAL_CUTS[plain.surface]
    cuts = counting(monkeypatch, slicing_and_thickening, "cut")
    assert_same(rehearsed, plain)
    assert cuts == ["cut", "cut"]


def test_another_pattern_on_the_same_surface_is_cut_anew(dome):
    design = drawn(dome)
    rehearsal = finishing._TRIAL_CUTS[design.surface]
    assert rehearsal.matches(replace(design.pattern, factor=2.0), rehearsal.terms)
    assert not rehearsal.matches(replace(design.pattern, levels=design.pattern.levels[:1]), rehearsal.terms)
    assert not rehearsal.matches(replace(design.pattern, tidy=None), rehearsal.terms)
    assert not rehearsal.matches(replace(design.pattern, fields=design.pattern.fields[:1]), rehearsal.terms)


def test_a_rehearsal_lets_its_surface_go(dome):
    """Also where what is kept lies on parts of its faces, and so holds the surface."""
    design = drawn(dome)
    assert any(isinstance(field, DividedField) for field in design.pattern.fields)
    surface = weakref.ref(design.surface)
    assert surface() in finishing._TRIAL_CUTS
    del design
    gc.collect()
    assert surface() is None


def test_a_share_is_found_with_as_many_cuts_as_are_measured(dome, monkeypatch):
    """The last cut that a search measures is the one that is finished."""
    cuts = counting(monkeypatch, finishing, "cut_polygons")
    drawn(dome)
    assert cuts == []


def test_cut_fills_the_polygons(dome):
    pattern = drawn(dome).pattern
    surface = dome.surface.build()
    polygons = cut_polygons(surface, pattern.fields, pattern.levels, 0.05, pattern.tidy)
    sheet = cut(surface, pattern.fields, pattern.levels, 0.05, pattern.tidy)
    area = sheet.surface.areas[sheet.material].sum()
    assert polygons.material_area == pytest.approx(area, rel=1e-12)
