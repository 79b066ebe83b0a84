"""`search`: instead of sampling, let an optimiser choose the next runs; they are made and kept like any others.

Differential evolution [Storn, Price 1997] in SciPy, a generation at a time, so that all workers are busy. Its state is
nowhere written down: it always proposes the same points from the same answers, so a search that was stopped is played
again from the runs that are recorded, and goes on where there is none.
"""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite, log
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from dsfab.arrays import Floats
from dsfab.study.sweeps.constraints import Constraint
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.plan import Plan
from dsfab.study.sweeps.sampling import digest, point_on_axes
from dsfab.study.sweeps.store import RunRow

FEWEST, PER_AXIS = 12, 4
"""Points of a generation: four for each axis, at least twelve. They do not depend on how long it runs, so that a search
can be extended."""

MISSED, FAILED, NOT_MADE = 1e3, 1e6, 1e9
"""Costs from which on runs miss constraints, have failed, or were not made: each is worse than all before it, and among
those that miss, the nearer is the better [Deb 2000]."""

SHRUNK = 1e-9
"""A population whose costs differ by less than this share has nothing more to find."""

Make = Callable[[Sequence[Mapping[str, Any]]], Mapping[str, RunRow]]
"""Makes runs that are not there yet, and returns all runs there are by their digest."""


def search(plan: Plan, make: Make) -> None:
    """Look for the best of `plan.search.metric` under the constraints, in as many runs as it allows."""
    _Search(plan, make).run()


def cost(row: RunRow | None, metric: str, limits: Sequence[Constraint]) -> float:
    """What is minimised: the logarithm of the metric (its negative where more is better), or a cost above `MISSED`."""
    if row is None:
        return NOT_MADE
    value = row.metrics.get(metric, float("nan"))
    if row.state != "done" or not isfinite(value):
        return FAILED
    missed = sum(limit.missed_by(row.metrics) for limit in limits)
    if not all(limit.holds(row.metrics) for limit in limits):
        return MISSED + min(missed, MISSED)
    sign = -1.0 if ABOUT[metric].better == "more" else 1.0
    return sign * (log(value) if value > 0 else value - MISSED / 2)


class _Search:
    def __init__(self, plan: Plan, make: Make) -> None:
        assert plan.search is not None
        self.ask, self.axes, self.limits, self.seed = plan.search, plan.axes, plan.limits, plan.seed
        self.make = make
        self.made: set[str] = set()

    def run(self) -> None:
        count = max(FEWEST, PER_AXIS * len(self.axes))
        evolve: Any = differential_evolution  # its stubs know neither vectorized functions nor callbacks that end it
        evolve(
            self._costs,
            [(0.0, 1.0)] * len(self.axes),
            strategy="best1bin",
            maxiter=100 * self.ask.evaluations,
            init=_spread(count, len(self.axes), self.seed),
            tol=0,
            atol=SHRUNK,
            mutation=(0.4, 0.9),
            recombination=0.8,
            callback=self._enough,
            polish=False,
            vectorized=True,
            updating="deferred",
            rng=np.random.default_rng(self.seed),
        )

    def _costs(self, u: Floats) -> Floats:
        """(S,) costs of a generation u (k, S); beyond the number of runs that is allowed, none is made."""
        asked = [point_on_axes(self.axes, np.clip(column, 0.0, 1.0)) for column in u.T]
        names = [digest(changes) for changes in asked]
        fresh = list(dict.fromkeys(name for name in names if name not in self.made))
        allowed = set(fresh[: self.ask.evaluations - len(self.made)]) | self.made
        wanted = {name: changes for name, changes in zip(names, asked, strict=True) if name in allowed}
        rows = self.make(list(wanted.values()))
        self.made.update(wanted)
        found = [rows.get(name) if name in wanted else None for name in names]
        return np.array([cost(row, self.ask.metric, self.limits) for row in found])

    def _enough(self, *_: Any, **__: Any) -> bool:
        return len(self.made) >= self.ask.evaluations


def _spread(count: int, dimensions: int, seed: int) -> Floats:
    """(count, dimensions) Sobol points."""
    from scipy.stats import qmc

    sampler = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
    return np.asarray(sampler.random_base2((count - 1).bit_length())[:count])
