"""Slicing goes on from the sheet that the search for widths ended with, and gives what it gives without."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.design import Design, Log, slicing_and_thickening
from dsfab.slicing import tidied_polygons, tidied_sheet
from dsfab.slicing.finishing import finish

COARSE = {"surface.edge": 0.6, "pattern.major.spacing": 2.0, "pattern.minor.spacing": 1.4, "pattern.keep": 0.8}


@pytest.fixture(scope="module")
def dome() -> dsfab.Preset:
    return dsfab.load_preset("dome", COARSE)


def drawn(preset: dsfab.Preset) -> Design:
    """A design up to its pattern, whose trial cut is at hand."""
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


def without_trial(design: Design) -> Design:
    """The same design, whose pattern has no trial cut."""
    names = ("surface", "statics", "diffusion")
    pattern = replace(design.pattern, trial=None)
    results = {name: getattr(design, name) for name in names}
    log = Log(None, notes=list(design.notes))
    return Design.from_results(design.preset, log, pattern=pattern, **results)


@pytest.mark.slow
def test_the_sheet_is_the_same_without_a_trial_cut(dome):
    design = drawn(dome)
    assert design.pattern.trial
    assert_same(design, without_trial(design))


def test_nothing_is_cut_or_rounded_again(dome, monkeypatch):
    design = drawn(dome)
    cuts = counting(monkeypatch, slicing_and_thickening, "tidied_sheet")
    finished = counting(monkeypatch, finish, "passes_before_rounding")
    assert design.slicing.sheet.surface.m
    assert cuts == finished == []
    assert design.pattern.trial is None  # its memory is needed later


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [{"slicing.snap": 0.1}, {"slicing.pinch": "split"}, {"slicing.min_opening": 0.2}], ids=str
)
def test_other_options_are_cut_anew(dome, change, monkeypatch):
    design = drawn(dsfab.load_preset("dome", COARSE | change))
    plain = without_trial(design)
    cuts = counting(monkeypatch, slicing_and_thickening, "tidied_sheet")
    assert_same(design, plain)
    assert len(cuts) == 2


def test_another_pattern_is_cut_anew(dome):
    pattern = drawn(dome).pattern
    trial, options = pattern.trial, pattern.trial.options
    assert trial.serves(replace(pattern, factor=2.0).cut_inputs, options)
    assert trial.serves(pattern.cut_inputs, options._replace(member=0.1))
    for change in ({"levels": pattern.levels[:1]}, {"tidy": None}, {"fields": pattern.fields[:1]}):
        assert not trial.serves(replace(pattern, **change).cut_inputs, options)
        assert replace(pattern, trial=None, **change).with_trial(trial).trial is None


def test_a_pickled_pattern_has_no_trial_cut(dome):
    pattern = drawn(dome).pattern
    assert pattern.trial
    assert pickle.loads(pickle.dumps(pattern)).trial is None


def test_a_share_is_found_with_as_many_cuts_as_are_measured(dome, monkeypatch):
    """The last cut that a search measures is the one that is finished."""
    cuts = counting(monkeypatch, slicing_and_thickening, "tidied_polygons")
    drawn(dome)
    assert cuts == []


def test_a_sheet_fills_the_polygons(dome):
    pattern = drawn(dome).pattern
    surface = dome.surface.build()
    polygons = tidied_polygons(surface, pattern.fields, pattern.levels, 0.05, pattern.tidy)
    sheet = tidied_sheet(surface, pattern.fields, pattern.levels, 0.05, pattern.tidy)
    area = sheet.surface.areas[sheet.material].sum()
    assert polygons.material_area == pytest.approx(area, rel=1e-12)
