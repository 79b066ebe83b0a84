"""Many things of one kind, each made in a process of its own, told in their order."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from typing import TypeVar

from dsfab.errors import DsfabError
from dsfab.study.sweeps.local import cores, end_with_parent, free_memory, quiet_start

One = TypeVar("One")
Made = TypeVar("Made")

MEMORY = 3e9
"""Bytes that one process may be expected to take."""


def fitting_processes(count: int) -> int:
    """How many processes are worth while for `count` things: one for each core that has enough memory."""
    free = free_memory()
    return max(1, min(count, cores(), int(free / MEMORY) if free else cores()))


def made_in_processes(
    job: Callable[[One], Made], given: Sequence[One], workers: int, work: Callable[[One], float] | None = None
) -> Iterator[Made]:
    """job(one) of each thing given, in their order, by so many processes of one thread each; by this one for 1.

    work : about how long each takes, in any unit: what takes longest is begun first, so that all processes end about
           together.

    Raises DsfabError where a process ended before its time. Where the caller stops listening, all of them end.
    """
    if workers == 1:
        yield from map(job, given)
        return
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=end_with_parent)
    try:
        with quiet_start():
            first = sorted(range(len(given)), key=lambda k: -work(given[k]) if work else 0.0)
            results = {k: pool.submit(job, given[k]) for k in first}
        for k in range(len(given)):
            yield results[k].result()
    except BrokenExecutor as error:
        raise DsfabError("a process ended before its time, perhaps for want of memory; try --workers 1") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
