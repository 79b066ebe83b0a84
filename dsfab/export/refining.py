"""Cubic splines along many polylines at once, the spans of each halved until it is near enough.

All lines go through one system of equations in each round: most have ten points, and calls would take the time.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.splines import LeastSquares, hats_within

SAMPLES_PER_SPAN = 6
"""Fewest samples of the polyline for each span of a spline; with fewer, splines swing between them."""

KNOT_DIGITS = 4
"""Decimals of knots, which are millimetres along the polyline."""

DENSER = 4
"""Times as many points as samples are asked how far the spline is off."""

AT_ONCE = 5_000
"""Samples of the lines that go together: their hats and points stay in a processor's own memory."""

THIRDS = np.arange(4) / 3
POWERS = np.linalg.inv(THIRDS[:, None] ** np.arange(4))
"""Of a cubic's values at thirds of a span: the factors of 1, x, x^2 and x^3, x from 0 to 1."""

Refined = tuple[Floats, Floats, int, float]
"""Knots, poles, degree, and the largest distance."""


@dataclass(frozen=True, eq=False)
class SampledLine:
    """A polyline (k, d), the lengths along it (k,), its rounded whole length, and how many samples are taken of it.

    smooth : it is closed, and its spline leaves as it arrives.
    """

    line: Floats
    length: Floats
    total: float
    count: int
    smooth: bool

    @classmethod
    def of(cls, line: Floats, smooth: bool) -> Self:
        """With as many samples as the first try takes."""
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        total = float(np.round(length[-1], KNOT_DIGITS))
        return cls(line, length, total, max(8 * len(line), 16 * SAMPLES_PER_SPAN), smooth)

    @property
    def bow(self) -> float:
        """The farthest that it is off the line between its ends, at the same share of the length."""
        share, first, last = self.length / self.length[-1], self.line[0], self.line[-1]
        return float(np.linalg.norm(self.line - first - share[:, None] * (last - first), axis=1).max())

    @cached_property
    def at(self) -> Floats:
        """(count + 1,) lengths at which its samples are."""
        return np.asarray(np.arange(self.count + 1) / self.count * self.total)

    @cached_property
    def samples(self) -> Floats:
        """(count + 1, d) points of it."""
        return np.stack(self._on(np.arange(self.count + 1) / self.count), axis=1)

    @cached_property
    def asked(self) -> tuple[Floats, list[Floats]]:
        """(q,) ascending lengths at which the spline is asked, many and those of the vertices; and d times (q,), the
        polyline's points there."""
        finer = DENSER * self.count
        share = np.union1d(np.arange(finer + 1) / finer, self.length / self.length[-1])
        return share * self.total, self._on(share)

    @property
    def breaks(self) -> Floats:
        """Where spans begin and end at first."""
        return np.array([0.0, self.total / 2, self.total] if self.smooth else [0.0, self.total])

    def _on(self, share: Floats) -> list[Floats]:
        return [np.interp(share * self.length[-1], self.length, column) for column in self.line.T]


def refined(runs: Sequence[SampledLine], tolerance: float) -> list[Refined | None]:
    """For each line the spline from its samples, its spans halved until it is near enough; None if that takes more
    samples."""
    found: list[Refined | None] = [None] * len(runs)
    for batch in _batches(runs):
        breaks = {k: runs[k].breaks for k in batch}
        while breaks:
            rows = _Rows([runs[k] for k in breaks], [np.round(at, KNOT_DIGITS) for at in breaks.values()])
            poles, left = rows.poles(), dict[int, Floats]()
            for k, at, (first, last), off in zip(breaks, rows.breaks, rows.ends, rows.off(poles), strict=True):
                run, worst = runs[k], float(off.max())
                if worst <= tolerance:
                    knots = np.concatenate([[0.0] * 3, at, [run.total] * 3])
                    found[k] = knots, poles[first:last], 3, worst
                    continue
                bad = np.flatnonzero(off > tolerance)
                if not ((at[1:] - at[:-1])[bad] < 2 * SAMPLES_PER_SPAN * run.total / run.count).any():
                    left[k] = np.sort(np.concatenate([at, (at[bad] + at[bad + 1]) / 2]))
            breaks = left
    return found


def _batches(runs: Sequence[SampledLine]) -> Iterator[list[int]]:
    """Numbers of lines that go together."""
    batch, size = list[int](), 0
    for k, run in enumerate(runs):
        if batch and (size + run.count > AT_ONCE or run.line.shape[1] != runs[batch[0]].line.shape[1]):
            yield batch
            batch, size = [], 0
        batch.append(k)
        size += run.count
    if batch:
        yield batch


class _Rows:
    """Lines one after another: their splines have these breaks."""

    def __init__(self, runs: list[SampledLine], breaks: list[Floats]) -> None:
        self.runs, self.breaks = runs, breaks
        self.knots = np.concatenate(
            [part for run, at in zip(runs, breaks, strict=True) for part in ([0.0] * 3, at, [run.total] * 3)]
        )
        size = np.array([len(at) for at in breaks])
        self.first_knot = np.concatenate([[0], np.cumsum(size + 6)])
        self.first_pole = np.concatenate([[0], np.cumsum(size + 2)])
        self.ends = list(zip(self.first_pole[:-1].tolist(), self.first_pole[1:].tolist(), strict=True))

    def _spans(self, at: Sequence[Floats]) -> Ints:
        """How many of ascending lengths along each line are in each span, line after line."""
        found = list[Ints]()
        for x, own in zip(at, self.breaks, strict=True):
            many = x.searchsorted(own[1:])
            many[-1] = len(x)
            many[1:] -= many[:-1].copy()
            found.append(many)
        return np.concatenate(found)

    def _hats(self, x: Floats, many: Ints) -> tuple[Floats, Ints]:
        """(4, k) the hats at lengths x (k,), so many to each span, and the first of these among all poles (k,)."""
        spans = np.array([len(at) - 1 for at in self.breaks])
        row, own = np.repeat(np.arange(len(spans)), spans), np.arange(spans.sum())
        own -= np.repeat(np.cumsum(spans) - spans, spans)
        values, _ = hats_within(x, self.knots, np.repeat(own + 3 + self.first_knot[row], many))
        return values, np.repeat(own + self.first_pole[row], many)

    def poles(self) -> Floats:
        """(n, d) of the cubic splines nearest to the samples, whose ends are the first and the last of these.

        Smooth ones: the derivatives at both ends are one unknown vector d: pole 1 is pole 0 + a d, the last but one is
        the last - b d, with a and b a third of the first and the last span.
        """
        at = [run.at for run in self.runs]
        values, first = self._hats(np.concatenate(at), self._spans(at))
        points = np.concatenate([run.samples for run in self.runs])
        n = int(self.first_pole[-1])
        start, tangent, ends = np.zeros((n, points.shape[1])), np.zeros((n, 1)), list[int]()
        for run, own, (low, high) in zip(self.runs, self.breaks, self.ends, strict=True):
            many = 2 if run.smooth else 1
            ends += [*range(low, low + many), *range(high - many, high)]
            start[low : low + many], start[high - many : high] = run.samples[0], run.samples[-1]
            if run.smooth:
                tangent[[low + 1, high - 2], 0] = (own[1] - own[0]) / 3, -(own[-1] - own[-2]) / 3
        system = LeastSquares.of(values, first, self.first_pole[:-1], n, np.array(ends))
        poles = system.poles(points, start)
        return self._smoothed(system, poles, points, tangent) if tangent.any() else poles

    def _smoothed(self, system: LeastSquares, poles: Floats, points: Floats, tangent: Floats) -> Floats:
        """d joins the first poles with the last ones, outside of the band: it is taken out of the others, and solved
        for."""
        free = tangent - system.solved(system.sums(system.at_samples(tangent)))
        along, off = system.at_samples(free), points - system.at_samples(poles)
        poles, end = poles.copy(), np.cumsum([run.count + 1 for run in self.runs])
        for run, (low, high), last in zip(self.runs, self.ends, end.tolist(), strict=True):
            if run.smooth:
                own = along[last - run.count - 1 : last]
                poles[low:high] += free[low:high] @ (own.T @ off[last - run.count - 1 : last]) / (own.T @ own)
        return poles

    def off(self, poles: Floats) -> list[Floats]:
        """For each line and each of its spans how far it is off, at most."""
        begin, wide = (
            np.concatenate([at[:-1] for at in self.breaks]),
            np.concatenate([at[1:] - at[:-1] for at in self.breaks]),
        )
        four = (begin[:, None] + wide[:, None] * THIRDS).ravel()
        values, first = self._hats(four, np.full(len(wide), len(THIRDS)))
        there = sum(values[i][:, None] * poles[first + i] for i in range(4))
        powers = np.einsum("ij,sjd->dis", POWERS, there.reshape(len(wide), 4, -1))
        at = [run.asked[0] for run in self.runs]
        many = self._spans(at)
        x = (np.concatenate(at) - np.repeat(begin, many)) / np.repeat(wide, many)
        square = np.zeros(len(x))
        for axis, power in enumerate(powers):
            points = np.concatenate([run.asked[1][axis] for run in self.runs])
            one, two, three, four = (np.repeat(row, many) for row in power)
            square += (((four * x + three) * x + two) * x + one - points) ** 2
        worst = np.sqrt(np.maximum.reduceat(square, np.cumsum(many) - many))
        return np.split(worst, np.cumsum([len(own) - 1 for own in self.breaks])[:-1])
