"""Least-squares curves with adaptive knots, many at once.

Each is fitted to a few hundred samples, and one by one most of the time goes into the calls: many at once, as `rows` of
samples, take a third of it.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.smooth.rows import RowSpans, SplineRows
from dsfab.export.splines import LeastSquares, Spline, hats_within, straight

SAMPLES_PER_SPAN = 6
"""Fewest samples for each span of a curve; with fewer, curves swing between them."""

ROUNDS = 14
"""How often the spans of a curve are halved: a span is at least 2^-14 of it."""

AT_ONCE = 20_000
"""Samples that are fitted at once, about: what is made of them stays in the processor's cache."""

Fitted = tuple[Spline, float]
"""A curve, and its largest distance from its samples."""


def splines_through(
    samples: Sequence[tuple[Floats, Floats]], tolerances: Sequence[float], parts: int = 1
) -> list[Fitted]:
    """Lines, parabolas or cubics, of few halved spans, within tolerances of points Q (k, d) at x (k,) in [0, 1].

    x rises from 0 to 1; d is the same for all. The ends of a curve are its first and its last point. parts : the d
    coordinates are those of so many points, whose distances count one by one. Returns the largest distance found, too;
    over the tolerance where samples are too few to go on.
    """
    found = dict[int, Fitted]()
    for some in _batches([len(x) for x, _ in samples]):
        x, Q = (np.concatenate(column) for column in zip(*(samples[c] for c in some), strict=True))
        count = np.array([len(samples[c][0]) for c in some])
        rows = SplineRows.of(np.array(some), count, x, Q, np.array([tolerances[c] for c in some]), parts)
        rows = _lines(rows, found)
        if len(rows.number):
            rows = _parabolas(rows, found)
        if len(rows.number):
            _cubics(rows, found)
    return [found[c] for c in range(len(samples))]


def _batches(counts: list[int]) -> Iterator[range]:
    """Consecutive curves that have about `AT_ONCE` samples together."""
    start = total = 0
    for c, count in enumerate(counts):
        total += count
        if total >= AT_ONCE or c == len(counts) - 1:
            yield range(start, c + 1)
            start, total = c + 1, 0


def _lines(rows: SplineRows, found: dict[int, Fitted]) -> SplineRows:
    """Add the curves that may be lines; the others."""
    off = rows.most(rows.away(rows.line))
    good = off <= 0.5 * rows.tolerance
    for r in np.flatnonzero(good):
        found[int(rows.number[r])] = straight(rows.Q[rows.first[r]], rows.Q[rows.last[r]]), float(off[r])
    return rows.some(~good)


def _parabolas(rows: SplineRows, found: dict[int, Fitted]) -> SplineRows:
    """Add the curves that may be parabolas; the others."""
    line, bow = rows.line, 2 * rows.x * (1 - rows.x)
    bend = np.add.reduceat(bow[:, None] * (rows.Q - line), rows.first) / np.add.reduceat(bow * bow, rows.first)[:, None]
    off = rows.most(rows.away(line + bow[:, None] * bend[rows.row]))
    good = off <= rows.tolerance
    knots = np.array([0.0] * 3 + [1.0] * 3)
    for r in np.flatnonzero(good):
        start, end = rows.Q[rows.first[r]], rows.Q[rows.last[r]]
        poles = np.stack([start, (start + end) / 2 + bend[r], end])
        found[int(rows.number[r])] = Spline(knots, poles, 2), float(off[r])
    return rows.some(~good)


def _cubics(rows: SplineRows, found: dict[int, Fitted]) -> None:
    """Add cubics; the spans that are off are halved until none is, or has too few samples."""
    spans = RowSpans(np.zeros(len(rows.number)), np.ones(len(rows.number)), np.arange(len(rows.number)), rows.row)
    for turn in range(ROUNDS):
        poles, away = _least_squares(rows, spans)
        off, many = rows.most(away), np.bincount(spans.of, minlength=len(spans.row))
        worst, used = np.zeros(len(many)), many > 0
        worst[used] = np.maximum.reduceat(away, (np.cumsum(many) - many)[used])
        bad = (worst > rows.tolerance[spans.row]) & (many >= 2 * SAMPLES_PER_SPAN) & (turn < ROUNDS - 1)
        going = np.zeros(len(off), dtype=bool)
        going[spans.row[bad]] = True
        knots, end = spans.knots, np.cumsum(spans.count)
        start = end - spans.count
        for r in np.flatnonzero(~going):
            t, own = knots[start[r] + 7 * r : end[r] + 7 * r + 7], poles[start[r] + 3 * r : end[r] + 3 * r + 3]
            found[int(rows.number[r])] = Spline(t, own, 3), float(off[r])
        if not going.any():
            return
        rows, spans = rows.some(going), spans.halved(bad, going, rows)


def _least_squares(rows: SplineRows, spans: RowSpans) -> tuple[Floats, Floats]:
    """Poles (s + 3 r, d) of the cubics nearest to the samples with their ends fixed, and how far each sample is off."""
    values, _ = hats_within(rows.x, spans.knots, spans.of + 7 * rows.row + 3)
    first, size = spans.of + 3 * rows.row, spans.count + 3
    begin, n = np.cumsum(size) - size, int(size.sum())
    ends = np.concatenate([begin, begin + size - 1])
    start = np.zeros((n, rows.Q.shape[1]))
    start[ends] = rows.Q[np.concatenate([rows.first, rows.last])]
    system = LeastSquares.of(values, first, begin, n, ends)
    poles = system.poles(rows.Q, start)
    return poles, rows.away(system.at_samples(poles))
