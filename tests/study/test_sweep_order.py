"""Who makes which run: stages are made once for all that share them, however many workers there are."""

from itertools import pairwise
from types import SimpleNamespace

import pytest

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps import scheduler
from dsfab.study.sweeps.scheduler import Progress, Rows, conduct
from dsfab.study.variations import signature, stage_order


def variant_grid(surfaces: int, gammas: int, phases: int) -> list[dict]:
    return [
        {"pattern.major.phase": p, "diffusion.gamma": g, "surface.edge": s}
        for p in range(phases)
        for g in range(gammas)
        for s in range(surfaces)
    ]


def solves(runs: list[dict], order: list[int]) -> int:
    """How often a worker that makes runs in this order solves for equilibrium: when the surface changes."""
    return sum(i == 0 or runs[a]["surface.edge"] != runs[order[i - 1]]["surface.edge"] for i, a in enumerate(order))


def test_early_stages_vary_slowest():
    runs = variant_grid(3, 4, 5)
    order = stage_order(runs)
    assert sorted(order) == list(range(60))
    assert solves(runs, order) == 3
    pairs = [(runs[i]["surface.edge"], runs[i]["diffusion.gamma"]) for i in order]
    assert sum(a != b for a, b in pairwise(pairs)) == 11


def test_the_signature_tells_stages_apart():
    one, other = signature({"diffusion.r": 1, "pattern.rim": 2}), signature({"pattern.rim": 3, "diffusion.r": 1})
    assert one[:3] == other[:3]
    assert one[3] != other[3]


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
@pytest.mark.parametrize("shape", [(1, 1, 40), (8, 1, 5), (40, 1, 1), (4, 5, 2)])
def test_every_run_is_taken_once_and_few_are_solved_twice(workers, shape):
    runs = variant_grid(*shape)
    rows = Rows(range(len(runs)), runs)
    taken: dict[str, list[int]] = {f"w{i}": [] for i in range(workers)}
    while len(rows):
        for worker, row in taken.items():
            if (number := rows.take(worker)) is not None:
                row.append(number)
    assert sorted(n for row in taken.values() for n in row) == list(range(len(runs)))
    assert sum(solves(runs, row) for row in taken.values() if row) <= shape[0] + (workers if workers > 1 else 0)
    assert max(map(len, taken.values())) - min(map(len, taken.values())) <= 1  # nobody is idle


def test_lost_runs_and_rows_of_lost_workers_go_to_other_workers():
    runs = variant_grid(1, 1, 6)
    rows = Rows(range(1, 7), runs)
    first = rows.take("a")
    rows.give_back("a", first)
    assert len(rows) == 6
    assert rows.take("b") == first
    rest = [rows.take("b") for _ in range(5)]
    assert sorted([first, *rest]) == [1, 2, 3, 4, 5, 6]
    assert rows.take("b") is None


def test_a_sweep_without_workers_waits_ten_minutes_and_then_ends(monkeypatch):
    """By a clock that only sleep moves on, by a minute at a time."""
    slept = []
    clock = SimpleNamespace(monotonic=lambda: 60.0 * len(slept), sleep=slept.append)
    monkeypatch.setattr(scheduler, "time", clock)
    crew = SimpleNamespace(workers=list)
    with pytest.raises(DsfabError, match="start workers of Dask and give the command again"):
        conduct(None, crew, {1: {}}, None, progress=Progress(1, 0, 0))
    assert 9 <= len(slept) <= 12
