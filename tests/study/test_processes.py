"""Things made in processes of their own come in their order; one that ends before its time is told."""

import math
import os
import time

import pytest

from dsfab.core.errors import DsfabError
from dsfab.study import fitting_processes, map_in_processes
from dsfab.study.sweeps import workers


def test_one_worker_runs_in_this_process():
    own = map_in_processes(lambda k: (k, os.getpid()), [3, 1], workers=1)  # a lambda reaches no other process
    assert list(own) == [(3, os.getpid()), (1, os.getpid())]


@pytest.mark.slow
def test_results_come_in_the_order_of_the_inputs():
    assert list(map_in_processes(math.factorial, [5, 3, 4], workers=2)) == [120, 6, 24]
    (pid,) = set(map_in_processes(os.getpgid, [os.getpid()], workers=2))
    assert pid == os.getpgid(os.getpid())


def begun(one):
    """Its number, where and when it was begun; it takes a moment."""
    at = time.monotonic()
    time.sleep(0.2)
    return one, os.getpid(), at


@pytest.mark.slow
def test_the_longest_work_begins_first():
    told = list(map_in_processes(begun, [1, 5, 3, 4, 2], workers=2, work=float))
    assert [one for one, *_ in told] == [1, 5, 3, 4, 2]
    for process in {where for _, where, _ in told}:  # on a busy machine one has two done before the other has one
        mine = [one for one, where, _ in sorted(told, key=lambda each: each[2]) if where == process]
        assert mine == sorted(mine, reverse=True)


@pytest.mark.slow
def test_a_process_that_dies_is_reported():
    with pytest.raises(DsfabError, match="--workers 1"):
        list(map_in_processes(os._exit, [1, 1], workers=2))


@pytest.mark.parametrize(
    ("count", "cores", "free", "expected"),
    [(17, 2, 20e9, 2), (1, 8, 20e9, 1), (17, 8, 7e9, 2), (17, 8, 1e9, 1), (17, 4, 0, 4)],
)
def test_the_number_of_processes_follows_cores_and_memory(monkeypatch, count, cores, free, expected):
    monkeypatch.setattr(workers, "cores", lambda: cores)
    monkeypatch.setattr(workers, "free_memory", lambda: int(free))
    assert fitting_processes(count) == expected
