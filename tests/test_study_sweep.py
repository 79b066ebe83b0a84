"""Sweeps: every combination, in order, as single builds give it, with shared stages made once and failures recorded."""

import pytest

import dsfab
from dsfab.errors import PresetError
from dsfab.study import METRICS

PRESET = dsfab.load_preset("dome", {"surface.edge": 0.8, "pattern.keep": 0.5})


def test_a_sweep_is_every_combination_in_the_order_given():
    vary = {"pattern.major.frequency": [5.0, 7.0], "diffusion.r": [10.0, 100.0, 30.0]}
    runs = dsfab.sweep(PRESET, vary, ["kept_share"])
    assert [tuple(run.changes.values()) for run in runs] == [(f, r) for f in (5.0, 7.0) for r in (10.0, 100.0, 30.0)]
    assert not any(run.error for run in runs)
    assert len({run.metrics["kept_share"] for run in runs}) == 6


def test_a_swept_design_is_the_one_that_is_built_alone():
    kept = {}
    vary = {"pattern.minor.threshold": [0.0, 0.5], "diffusion.gamma": [1.0, 5.0]}
    runs = dsfab.sweep(PRESET, vary, keep=lambda changes, design: kept.update({tuple(changes.values()): design}))
    for run in runs:
        alone = dsfab.run(dsfab.load_preset("dome", {"surface.edge": 0.8, "pattern.keep": 0.5, **run.changes}))
        assert run.metrics == {name: metric(alone) for name, metric in METRICS.items()}
        assert (kept[tuple(run.changes.values())].solid.V == alone.solid.V).all()


def test_statics_and_modes_are_solved_once_for_all_patterns():
    designs = []
    vary = {"pattern.major.phase": [0.0, 0.2, 0.4], "diffusion.r": [10.0, 100.0]}
    dsfab.sweep(PRESET, vary, ["area"], keep=lambda _, design: designs.append(design))
    assert len({id(design.surface) for design in designs}) == 1
    assert len({id(design.statics) for design in designs}) == 1
    assert len({id(design.diffusion) for design in designs}) == 2
    assert len({id(design.pattern) for design in designs}) == 6


def test_a_design_that_cannot_be_built_is_recorded_and_stops_nothing():
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
        ({"pattern.major.frequency": [1, -1]}, ["area"], "should be greater than 0"),
        ({"pattern.major.frequency": [1]}, ["beauty"], "metric 'beauty' is not known; use area"),
    ],
)
def test_mistakes_are_told_before_anything_is_built(vary, metrics, says, monkeypatch):
    monkeypatch.setattr("dsfab.study.sweeps.run", None)
    with pytest.raises(PresetError, match=says):
        dsfab.sweep(PRESET, vary, metrics)
