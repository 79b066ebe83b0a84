"""A search: it finds a known optimum, keeps to its constraints, and plays itself again after it was stopped."""

from math import exp

import pytest

from dsfab.study.sweeps.folder import SweepFolder, best, prepare
from dsfab.study.sweeps.plan import Constraint, Plan, plan_from
from dsfab.study.sweeps.runs import FAILED, MISSED, NOT_MADE, RunRow, cost, digest, search
from tests.study.sweep_folders import Hands, measured, plan, swept

SPACE = {"a": {"from": 0.0, "to": 1.0}, "b": {"from": 0.01, "to": 100.0, "log": True}, "n": {"from": 1, "to": 6}}


def asked(**changes) -> Plan:
    values = {"preset": "dome", "vary": SPACE, "metrics": ["compliance", "pieces"]}
    return plan_from({**values, "search": {"metric": "compliance", "evaluations": 240}, **changes})


class Landscape:
    """Numbers in place of designs: the valley is at a = 0.3, b = 1, n = 4; pieces is n."""

    def __init__(self, fails=lambda changes: False):
        self.rows: dict[str, RunRow] = {}
        self.fails = fails

    def make(self, proposed):
        from math import log10

        for changes in proposed:
            if digest(changes) in self.rows:
                continue
            a, b, n = changes["a"], changes["b"], changes["n"]
            value = exp(8 * (a - 0.3) ** 2 + log10(b) ** 2 + 0.3 * (n - 4) ** 2)
            state = "failed" if self.fails(changes) else "done"
            metrics = {} if self.fails(changes) else {"compliance": value, "pieces": float(n)}
            self.rows[digest(changes)] = RunRow(len(self.rows) + 1, changes, state, metrics)
        return self.rows

    def best(self, limits=()) -> RunRow:
        return best(self.rows.values(), "compliance", limits)[0]


@pytest.mark.parametrize("seed", range(4))
def test_the_search_finds_the_minimum_within_its_number_of_runs(seed):
    land = Landscape()
    search(asked(seed=seed), land.make)
    assert len(land.rows) == 240
    assert land.best().changes["n"] == 4
    assert land.best().metrics["compliance"] < 1.02  # a tenth of that many Sobol points reach 1.3


@pytest.mark.parametrize("seed", range(3))
def test_the_search_keeps_constraints_and_skips_failures(seed):
    limits = [Constraint.from_text("pieces <= 2")]
    land = Landscape(lambda changes: changes["a"] < 0.4)
    search(asked(seed=seed, constraints=["pieces <= 2"]), land.make)
    found = land.best(limits)
    assert found.changes["n"] == 2
    assert found.changes["a"] == pytest.approx(0.4, abs=0.03)
    assert found.metrics["compliance"] == pytest.approx(exp(8 * 0.01 + 0.3 * 4), rel=0.05)


def test_the_search_maximises_metrics_where_more_is_better():
    rows = [RunRow(n, {}, "done", {"buckling": float(n), "pieces": 1.0}) for n in (1, 2)]
    assert cost(rows[1], "buckling", []) < cost(rows[0], "buckling", [])
    assert cost(rows[0], "pieces", []) == cost(rows[1], "pieces", []) == 0.0


def test_the_cost_ranks_failures_below_broken_constraints_below_values():
    one = Constraint.from_text("pieces == 1")
    good = cost(RunRow(1, {}, "done", {"compliance": 1e30, "pieces": 1.0}), "compliance", [one])
    near = cost(RunRow(2, {}, "done", {"compliance": 1e-30, "pieces": 2.0}), "compliance", [one])
    far = cost(RunRow(3, {}, "done", {"compliance": 1e-30, "pieces": 9.0}), "compliance", [one])
    failed = cost(RunRow(4, {}, "failed", {"pieces": 1.0}), "compliance", [one])
    assert good < MISSED < near < far < failed == FAILED < cost(None, "compliance", [one]) == NOT_MADE


def test_the_search_is_reproducible_and_can_be_extended():
    whole = Landscape()
    search(asked(), whole.make)
    again = Landscape()
    search(asked(search={"metric": "compliance", "evaluations": 100}), again.make)
    assert len(again.rows) == 100
    assert list(again.rows) == list(whole.rows)[:100]
    search(asked(), again.make)
    assert list(again.rows) == list(whole.rows)


def test_a_space_with_few_points_ends():
    land = Landscape()
    search(asked(vary={"a": [0.1, 0.3], "b": [1.0], "n": [3, 4]}), land.make)
    assert len(land.rows) <= 4
    assert land.best().metrics["compliance"] == pytest.approx(1.0)


@pytest.mark.slow
def test_a_search_for_real_is_stopped_and_goes_on(tmp_path):
    vary = {"pattern.major.phase": {"from": 0.0, "to": 1.0}, "pattern.minor.phase": {"from": 0.0, "to": 1.0}}
    ask = plan(vary=vary, metrics=["kept_share"], search={"metric": "kept_share", "evaluations": 30})
    assert len(swept(tmp_path / "whole", ask)) == 30

    class StopError(Exception):
        pass

    def stop(progress):
        if progress.done == 17:
            raise StopError

    (tmp_path / "broken").mkdir()
    found = prepare(ask, tmp_path / "broken")
    fleet = Hands(found.job())
    with pytest.raises(StopError):
        found.run(fleet, stop)
    fleet.close()
    assert len(swept(tmp_path / "broken", ask)) == 30 - 17
    assert measured(tmp_path / "broken") == measured(tmp_path / "whole")
    assert [row.state for row in SweepFolder.from_folder(tmp_path / "whole").rows()] == ["done"] * 30
