"""Sweep files: every mistake at once, ranges and points with known answers, constraints."""

import csv

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import PresetError
from dsfab.study.sweeps.plan import Constraint, Range, load_plan, plan_from, plan_toml, read_plan
from dsfab.study.sweeps.runs import check_points, digest, points
from tests.presets import DOME_MODES

BASE = {"preset": "dome", "vary": {"pattern.major.phase": [0.0, 0.5]}}


def test_a_file_with_everything_comes_back_the_same(tmp_path):
    path = tmp_path / "all.toml"
    path.write_text(
        """
        preset = "dome"
        sampling = "sobol:8"
        metrics = ["compliance", "kept_share"]
        constraints = ["pieces == 1", "min_width >= 8 mm"]
        keep = ["picture", "solid"]
        formats = ["stl", "glb"]
        [set]
        surface.edge = 0.8
        [vary]
        pattern.major.frequency = { from = 4.0, to = 9.0 }
        "pattern.width.rule" = ["plain", "graded"]
        "diffusion.gamma" = { from = 0.1, to = 9.0, log = true }
        [[linked]]
        pattern.major.mode = [1, 2]
        pattern.minor.mode = [5, 3]
        """
    )
    plan = load_plan(path)
    assert plan.set == {"surface.edge": 0.8}
    assert [axis.keys for axis in plan.axes] == [
        ("pattern.major.frequency",),
        ("pattern.width.rule",),
        ("diffusion.gamma",),
        ("pattern.major.mode", "pattern.minor.mode"),
    ]
    assert plan.measured_metrics == ("compliance", "kept_share", "pieces", "min_width")
    (tmp_path / "again.toml").write_text(plan_toml(plan))
    assert load_plan(tmp_path / "again.toml") == plan
    assert points(load_plan(tmp_path / "again.toml")) == points(plan)
    pairs = {(p["pattern.major.mode"], p["pattern.minor.mode"]) for p in points(plan)}
    assert pairs == {(1, 5), (2, 3)}


MISTAKES = {
    "misspelt key": ({"metrcs": ["area"]}, "unknown key metrcs; did you mean metrics?"),
    "misspelt metric": ({"metrics": ["complience"]}, "metric 'complience' is not known; did you mean compliance?"),
    "misspelt sampling": ({"sampling": "sobel:3"}, "use grid, sobol:200, lhs:200 or csv:points.csv"),
    "no points": ({"sampling": "lhs:0"}, "sampling = 'lhs:0'"),
    "falling range": ({"vary": {"a": {"from": 2, "to": 1, "count": 3}}}, "from = 2 must be smaller than to = 1"),
    "log of zero": ({"vary": {"a": {"from": 0.0, "to": 1, "log": True}}}, "log needs positive numbers"),
    "a key of ranges": (
        {"vary": {"a": {"from": 0, "to": 1, "cuont": 3}}},
        "unknown key vary.a.cuont; did you mean count",
    ),
    "endless grid": ({"vary": {"a": {"from": 0, "to": 1}}}, "vary.a needs count"),
    "no values": ({"vary": {"a": []}}, "vary.a has no values"),
    "uneven": ({"linked": [{"a": [1], "b": [1, 2]}]}, "lists of equal length, but the lengths are: a 1, b 2"),
    "twice": ({"linked": [{"pattern.major.phase": [1]}]}, "pattern.major.phase is varied twice"),
    "constraint": ({"constraints": ["pieces is 1"]}, "'pieces is 1' is not METRIC SIGN NUMBER"),
    "constraint on nothing": ({"constraints": ["beauty > 1"]}, "metric 'beauty' is not known"),
    "what to keep": ({"keep": ["pictures"]}, "keep.0 = 'pictures'"),
    "nothing varied": ({"vary": {}}, "the sweep varies no key"),
    "csv and more": ({"sampling": "csv:a.csv"}, "a csv file gives all points"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_invalid_plans_are_refused_with_their_key(what):
    change, says = MISTAKES[what]
    with pytest.raises(PresetError) as refused:
        plan_from({**BASE, **change}, "sweep x.toml")
    assert says in str(refused.value)
    assert str(refused.value).startswith("sweep x.toml: ")


def test_all_invalid_keys_of_a_plan_are_reported_at_once():
    with pytest.raises(PresetError) as refused:
        plan_from({"metrics": ["beauty"], "seeed": 1, "vary": {"a": []}})
    for says in ("preset is missing", "'beauty'", "seeed", "vary.a"):
        assert says in str(refused.value)


def test_a_file_that_cannot_be_read(tmp_path):
    (tmp_path / "bad.toml").write_text("preset = ")
    with pytest.raises(PresetError, match=r"sweep bad.toml is not valid TOML"):
        load_plan(tmp_path / "bad.toml")
    with pytest.raises(PresetError, match="cannot be read"):
        load_plan(tmp_path / "gone.toml")


def test_paths_start_at_the_files_folder(tmp_path):
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "sweep.toml").write_text('preset = "mine.toml"\nsampling = "csv:points.csv"')
    values = read_plan(tmp_path / "sweep.toml")
    assert values["preset"] == str(tmp_path / "mine.toml")
    assert values["sampling"] == f"csv:{tmp_path / 'points.csv'}"


@pytest.mark.parametrize(
    ("asked", "values"),
    [
        ({"from": 4, "to": 24, "count": 6}, [4, 8, 12, 16, 20, 24]),
        ({"from": 0, "to": 1, "count": 3}, [0.0, 0.5, 1.0]),
        ({"from": 0.0, "to": 2.0, "count": 4}, [0.0, 0.666667, 1.33333, 2.0]),
        ({"from": 1, "to": 1000, "count": 4, "log": True}, [1, 10, 100, 1000]),
        ({"from": 0.1, "to": 10, "count": 3, "log": True}, [0.1, 1.0, 10.0]),
        ({"from": 2.0, "to": 3.0, "count": 1}, [2.0]),
    ],
)
def test_ranges(asked, values):
    listed = Range(**asked).grid_values()
    assert listed == values
    assert [type(one) for one in listed] == [type(one) for one in values]


def test_every_whole_number_of_a_range_is_as_likely():
    drawn = [Range(**{"from": 3, "to": 7}).value_at(u) for u in np.linspace(0, 1, 5000, endpoint=False)]
    assert [drawn.count(k) for k in range(3, 8)] == [1000] * 5


def test_a_full_grid_is_every_combination_in_order():
    plan = plan_from({"preset": "dome", "vary": {"a": [1, 2]}, "linked": [{"b": [1, 2, 3], "c": [4, 5, 6]}]})
    assert [tuple(p.values()) for p in points(plan)] == [(a, b, b + 3) for a in (1, 2) for b in (1, 2, 3)]


def test_a_grid_too_large_is_refused():
    plan = plan_from({"preset": "dome", "vary": {k: {"from": 0.0, "to": 1.0, "count": 1001} for k in "ab"}})
    with pytest.raises(PresetError, match="1,002,001 runs"):
        points(plan)


SPANS = {"a": {"from": 0.0, "to": 2.0}, "b": {"from": 1.0, "to": 100.0, "log": True}, "c": ["x", "y"]}


@pytest.mark.parametrize("kind", ["sobol", "lhs"])
def test_samples_fill_the_space_evenly(kind):
    drawn = points(plan_from({"preset": "dome", "vary": SPANS, "sampling": f"{kind}:64"}))
    assert len(drawn) == 64
    for low in range(4):  # a quarter of the points in each quarter of each axis
        assert sum(low / 2 <= p["a"] < (low + 1) / 2 for p in drawn) == 16
        assert sum(low / 2 <= np.log10(p["b"]) < (low + 1) / 2 for p in drawn) == 16
    assert sum(p["c"] == "x" for p in drawn) == 32


def test_sobol_can_be_extended_and_the_seed_counts():
    few, more, other = (
        points(plan_from({"preset": "dome", "vary": SPANS, "sampling": f"sobol:{n}", "seed": seed}))
        for n, seed in ((11, 0), (40, 0), (11, 1))
    )
    assert more[:11] == few
    assert other != few


def test_points_from_a_table(tmp_path):
    with open(tmp_path / "points.csv", "w", newline="") as file:
        csv.writer(file).writerows(
            [
                ["in:pattern.major.phase", "out:area", "in:pattern.width.rule"],
                ["0.25", "9", "plain"],
                ["1", "9", "graded"],
            ]
        )
    plan = plan_from({"preset": "dome", "sampling": f"csv:{tmp_path / 'points.csv'}"})
    assert points(plan) == [
        {"pattern.major.phase": 0.25, "pattern.width.rule": "plain"},
        {"pattern.major.phase": 1, "pattern.width.rule": "graded"},
    ]
    (tmp_path / "points.csv").write_text("pattern.major.phase\n")
    with pytest.raises(PresetError, match="has no rows"):
        points(plan)


def test_the_same_run_twice_is_made_once():
    plan = plan_from({"preset": "dome", "vary": {"a": [1, 1], "b": [2]}})
    assert points(plan) == [{"a": 1, "b": 2}]
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1}) != digest({"a": 1, "b": 2.5})


def test_invalid_values_of_a_plan_are_refused_before_any_run():
    preset = dsfab.load_preset(DOME_MODES)
    check_points(preset, [{"pattern.major.phase": 0.5}])
    with pytest.raises(PresetError) as refused:
        check_points(preset, [{"pattern.major.frequncy": 1.0}, {"pattern.major.frequency": -1.0}])
    assert "did you mean frequency" in str(refused.value)
    assert "should be greater than" in str(refused.value)


@pytest.mark.parametrize(
    ("text", "value", "holds", "missed"),
    [
        ("pieces == 1", 1.0, True, 0.0),
        ("pieces = 1", 2.0, False, 1.0),
        ("kept_share == 0.4", 0.4003, True, 0.0),
        ("kept_share == 0.4", 0.41, False, 0.025),
        ("min_width >= 8 mm", 0.008, True, 0.0),
        ("min_width>=8mm", 0.004, False, 0.5),
        ("compliance < 1e2", 99.0, True, 0.0),
        ("compliance < 100", 100.0, False, 0.0),
        ("pieces != 1", 1.0, False, 0.0),
        ("compliance <= 5", float("nan"), False, float("inf")),
    ],
)
def test_constraints(text, value, holds, missed):
    limit = Constraint.from_text(text)
    assert limit.holds({limit.metric: value}) is holds
    assert limit.missed_by({limit.metric: value}) == pytest.approx(missed)
    assert not limit.holds({})
