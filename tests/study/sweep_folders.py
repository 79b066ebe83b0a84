"""Folders of sweeps and workers that end as asked."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from dsfab.study.sweeps.folder import SweepFolder, only_coordinator, prepare, sweep_folder
from dsfab.study.sweeps.plan import Plan, plan_from
from dsfab.study.sweeps.runs import RunRow
from dsfab.study.sweeps.workers import Outcome, execute
from tests.presets import DOME_MODES

PHASES = [0.0, 0.2, 0.4, 0.6]


def plan(**changes) -> Plan:
    """A sweep whose runs take a few hundredths of a second each."""
    coarse = {"surface.edge": 1.2, "pattern.keep": 0, "pattern.width": {}}
    values = {
        "preset": DOME_MODES,
        "set": coarse,
        "vary": {"diffusion.r": [10.0, 30.0], "pattern.major.phase": PHASES},
        "metrics": ["kept_share", "pieces"],
        "keep": ["preset"],
    }
    return plan_from({**values, **changes})


class Hands:
    """A crew of threads in this process; `fate` may kill a worker: raise when it is given a run."""

    def __init__(self, job, count=2, fate=lambda number: None):
        self.job, self.fate, self.begun = job, fate, []
        self.pools = {f"hand {i}": ThreadPoolExecutor(1) for i in range(count)}

    def workers(self):
        return list(self.pools)

    def submit(self, worker, number, changes) -> "Future[Outcome]":
        self.begun.append(number)
        return self.pools[worker].submit(self._make, number, changes)

    def _make(self, number, changes):
        self.fate(number)
        return execute(self.job, number, changes)

    def lost(self, worker):
        return ""

    def learn(self, outcome):
        pass

    def close(self):
        for pool in self.pools.values():
            pool.shutdown()


def swept(folder: Path, asked: Plan, fate=lambda number: None, extend=False, retry=("killed",)) -> list[int]:
    """Make a sweep with a crew of threads; returns the numbers of the runs that were begun."""
    with only_coordinator(sweep_folder(folder)):
        found = prepare(asked, folder, extend)
        crew = Hands(found.job(), fate=fate)
        try:
            found.run(crew, retry=retry)
        finally:
            crew.close()
    return sorted(crew.begun)


def measured(folder: Path) -> dict[int, tuple]:
    """What is known of each run, without its seconds."""
    return {
        row.number: (row.state, tuple(row.changes.items()), tuple(row.metrics.items()), row.error, row.files)
        for row in SweepFolder.from_folder(folder).rows()
    }


def deadly(*numbers: int):
    """A fate that kills whoever makes one of these runs."""

    def fate(number):
        if number in numbers:
            raise OSError("killed")

    return fate


def row(number: int, state="done", **metrics) -> RunRow:
    return RunRow(number, {"pattern.major.phase": number / 10}, state, metrics)
