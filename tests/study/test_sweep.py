"""Sweeps: every combination, in order, as single builds give it, with shared stages made once and failures recorded."""

from types import SimpleNamespace

import pytest

import dsfab
from dsfab.core.errors import PresetError, StaticsError
from dsfab.design.design import Design
from dsfab.study.sweeps import BASIC, METRICS
from dsfab.study.sweeps.metrics import cut_equilibria
from dsfab.study.verdict import check
from tests.presets import DOME_MODES

COARSE_KEYS = {"surface.edge": 1.2, "pattern.keep": 0.5}
COARSE = dsfab.load_preset(DOME_MODES, COARSE_KEYS)
PRESET = COARSE


def test_a_sweep_is_every_combination_in_the_order_given():
    vary = {"pattern.major.frequency": [5.0, 7.0], "diffusion.r": [10.0, 100.0, 30.0]}
    runs = dsfab.sweep(PRESET, vary, ["kept_share"])
    assert [tuple(run.changes.values()) for run in runs] == [(f, r) for f in (5.0, 7.0) for r in (10.0, 100.0, 30.0)]
    assert not any(run.error for run in runs)
    assert len({run.metrics["kept_share"] for run in runs}) == 6


@pytest.mark.slow
def test_a_swept_design_is_the_one_that_is_built_alone():
    kept = {}
    vary = {"pattern.minor.threshold": [0.0, 0.5], "diffusion.gamma": [1.0, 5.0]}
    runs = dsfab.sweep(PRESET, vary, keep=lambda changes, design: kept.update({tuple(changes.values()): design}))
    for run in runs:
        alone = dsfab.run(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "pattern.keep": 0.5, **run.changes}))
        assert run.metrics == {name: METRICS[name](alone) for name in BASIC}
        assert (kept[tuple(run.changes.values())].solid.V == alone.solid.V).all()


@pytest.mark.slow
def test_statics_and_modes_are_solved_once_for_all_patterns():
    designs = []
    vary = {"pattern.major.phase": [0.0, 0.2, 0.4], "diffusion.r": [10.0, 100.0]}
    dsfab.sweep(PRESET, vary, ["area"], keep=lambda _, design: designs.append(design))
    assert len({id(design.surface) for design in designs}) == 1
    assert len({id(design.statics) for design in designs}) == 1
    assert len({id(design.diffusion) for design in designs}) == 2
    assert len({id(design.pattern) for design in designs}) == 6


def test_a_design_that_cannot_be_built_is_recorded_and_the_sweep_continues():
    vary = {"pattern.major.mode": [1, 40, 2]}
    first, broken, last = dsfab.sweep(PRESET, vary, ["area"])
    assert "pattern.major.mode = 40" in broken.error
    assert broken.metrics == {}
    assert first.metrics["area"] > 0 < last.metrics["area"]


def test_metrics_can_be_functions():
    (run,) = dsfab.sweep(PRESET, {"pattern.major.phase": [0.1]}, {"holes": lambda design: design.solid.genus})
    assert run.metrics["holes"] >= 1


@pytest.mark.parametrize(
    ("vary", "metrics", "says"),
    [
        ({"pattern.major.frequncy": [1]}, ["area"], "did you mean frequency"),
        ({"pattern.major.frequency": [1, -1]}, ["area"], "should be greater than"),
        ({"pattern.major.frequency": [1]}, ["beauty"], "metric 'beauty' is not known; use area"),
    ],
)
def test_invalid_options_are_refused_before_any_design(vary, metrics, says, monkeypatch):
    monkeypatch.setattr("dsfab.study.sweeps.draft", None)
    with pytest.raises(PresetError, match=says):
        dsfab.sweep(PRESET, vary, metrics)


def test_a_metric_runs_only_the_stages_that_it_needs(monkeypatch):
    monkeypatch.setattr("dsfab.design.design.thickening_step", None)
    (run,) = dsfab.sweep(PRESET, {"pattern.major.phase": [0.1]}, ["area", "pieces", "min_width", "compliance"])
    assert run.error == ""
    assert len(run.metrics) == 4
    with pytest.raises(TypeError):
        dsfab.sweep(PRESET, {"pattern.major.phase": [0.1]}, ["mass"])


LONG = ("verdict", "over_")
"""Beginnings of the names of metrics that need other designs to compare with."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * name.startswith(LONG)) for name in METRICS]
)
def test_metrics_of_a_partial_design_equal_those_of_the_whole_design(name, whole, in_the_making):
    assert METRICS[name](in_the_making) == METRICS[name](whole)


@pytest.fixture(scope="module")
def whole():
    return dsfab.run(COARSE)


@pytest.fixture(scope="module")
def in_the_making():
    return Design.from_preset(
        COARSE, Design.from_preset(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "pattern.keep": 0.6}))
    )


def test_compliance_is_that_of_the_comparison(whole):
    from dsfab.study.comparison import comparison

    assert METRICS["compliance"](whole) == comparison(whole, against=()).design.compliance


def test_the_ersatz_compliance_of_a_full_sheet_is_its_compliance():
    from dsfab.statics import Elements, SheetModel, solve_cases

    full = dsfab.load_preset(
        DOME_MODES, {**COARSE_KEYS, "pattern.width": {"rule": "plain"}, "pattern.major.threshold": -1.0}
    )
    made, statics = Design.from_preset(full), full.statics
    loads = {"": made.load}
    whole = solve_cases(
        SheetModel(made.surface, statics.elastic, statics.thickness, statics.law),
        loads,
        elements=Elements("constant", "midedge"),
    )
    assert METRICS["ersatz"](made) == pytest.approx(whole[""].compliance, rel=1e-6)
    assert (
        METRICS["ersatz"](Design.from_preset(COARSE)) > 1.1 * whole[""].compliance
    )  # though it weighs two fifths of that


@pytest.mark.slow
def test_the_verdict_is_that_of_the_check(whole):
    found = check(whole)
    assert METRICS["verdict"](whole) == pytest.approx(found.value)
    assert METRICS["verdict_bound"](whole) == pytest.approx(found.bound)


def test_a_failed_verdict_is_recorded_with_its_reason(whole, monkeypatch):
    failed = SimpleNamespace(status="fail", reason="a load finds no material")
    monkeypatch.setattr("dsfab.study.sweeps.metrics.verdict", lambda made: failed)
    with pytest.raises(StaticsError, match="finds no material"):
        METRICS["verdict"](whole)


def test_members_of_constant_width_have_that_width():
    """Stripes of constant width in metres: min_width finds it again."""
    wide = {"surface.edge": 0.4, "pattern.width": {"rule": "constant", "member": 0.25}, "pattern.keep": 0.5}
    made = Design.from_preset(dsfab.load_preset(DOME_MODES, wide))
    assert METRICS["min_width"](made) == pytest.approx(0.25, rel=0.1)


def test_the_sheets_mass_is_nearly_that_of_the_solid(whole):
    assert METRICS["sheet_mass"](whole) == pytest.approx(METRICS["mass"](whole), rel=0.02)


def test_runs_share_the_stages_before_the_first_varied_key():
    thinner = Design.from_preset(
        dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "pattern.keep": 0.5, "export.step_faces": 9})
    )
    solid = thinner.solid
    after = Design.from_preset(thinner.preset, thinner)
    assert after.solid is solid
    assert Design.from_preset(PRESET, after).slicing is thinner.slicing
    other = dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "pattern.keep": 0.5, "slicing.snap": 0.1})
    assert not Design.from_preset(other, after).has("slicing")


def test_stripes_by_spacing_equal_stripes_by_the_same_frequency():
    asked = {**COARSE_KEYS, "pattern.major.frequency": 0.0, "pattern.major.spacing": 0.8}
    spaced = Design.from_preset(dsfab.load_preset(DOME_MODES, asked))
    frequency = spaced.pattern.frequency[0]
    same = Design.from_preset(dsfab.load_preset(DOME_MODES, {**COARSE_KEYS, "pattern.major.frequency": frequency}))
    assert METRICS["min_width"](spaced) == pytest.approx(METRICS["min_width"](same))


@pytest.mark.slow
def test_several_load_cases_count_as_in_the_comparison():
    from dsfab.study.comparison import comparison

    force = {"kind": "force", "at": {"pick": "nearest", "points": [[0.0, 0.0, 4.0]]}}
    loads = [{**force, "case": "down", "force": [0.0, 0.0, -5e4]}, {**force, "case": "aside", "force": [4e4, 0.0, 0.0]}]
    made = Design.from_preset(dsfab.load_preset(DOME_MODES, {**COARSE_KEYS, "surface.load": loads}))
    found = cut_equilibria(made, "displacement")
    assert set(found) == {"down", "aside"}
    assert METRICS["compliance"](made) == comparison(made, against=()).design.compliance
    assert METRICS["displacement"](made) == max(
        answer.largest_displacement for answer in cut_equilibria(made, "displacement").values()
    )
