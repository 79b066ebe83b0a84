"""Plane curves through polylines: lines where they are straight, cubic splines elsewhere, within a tolerance.

A spline is fitted in the least-squares sense at points spread evenly along the polyline, with its ends fixed; spans
where the largest distance exceeds the tolerance are halved until none does. Raw vertices would not do: they are
uneven, and fits through them overshoot between.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.export.splines import LeastSquares, Spline, hats

SHARP = np.deg2rad(30.0)
"""An outline that turns by more than this at a vertex has a corner there."""

SAMPLES_PER_SPAN = 6
"""Fewest samples of the polyline for each span of a spline; with fewer, splines swing between them."""

MOST_SAMPLES = 50_000
"""Samples of one polyline; a tolerance that would need more is not met by a spline."""

KNOT_DIGITS = 4
"""Decimals of knots, which are millimetres along the polyline."""

SPANS = 4
"""Spans of an edge of a plane face. The plain rule for volumes, which most programs take, has a few points on each
edge, however many spans that has: openings with edges of 6 to 40 spans made a plate's volume .1 to .5 % wrong. With at
most 4 it is right to 6e-5."""


@dataclass(frozen=True, eq=False)
class Curve(Spline):
    """A line or a cubic in the plane or in space; knots and poles in millimetres.

    deviation : largest distance between points of the curve and of the polyline at the same share of the length.
    """

    deviation: float

    @property
    def straight(self) -> bool:
        """Whether it is a line."""
        return self.degree == 1


def curves_through(loop: Floats, corner: Bools, tolerance: float) -> list[Curve] | None:
    """The closed polyline `loop` (k, 2) as a chain of at least two curves, or None where a spline misses the tolerance.

    corner : (k,) vertices where one curve ends and the next begins; sharp turns are added to them. A loop with one
             corner or none has a curve that is cut in two, smoothly: it closes where the loop starts.
    """
    at = np.flatnonzero(corner | (np.abs(turning(loop)) > SHARP))
    if len(at) > 1:
        ends = [*at.tolist(), int(at[0]) + len(loop)]
        chain = [fitted(loop[np.arange(a, b + 1) % len(loop)], tolerance) for a, b in pairwise(ends)]
        found = [curve for curve in chain if curve is not None]
        return found if len(found) == len(chain) else None
    start = int(at[0]) if len(at) else 0
    whole = fitted(loop[(start + np.arange(len(loop) + 1)) % len(loop)], tolerance, smooth=not len(at))
    return None if whole is None else halves(whole)


def turning(loop: Floats) -> Floats:
    """(k,) angle by which a closed polyline (k, 2) turns at its vertices, counter-clockwise positive."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(across, np.einsum("ki,ki->k", before, after)))


def fitted(line: Floats, tolerance: float, smooth: bool = False, most: int = MOST_SAMPLES) -> Curve | None:
    """One curve along the polyline (k, 2) or (k, 3), or None where that would take more than `most` samples.

    smooth: a closed polyline's curve leaves as it arrives.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    total = float(np.round(length[-1], KNOT_DIGITS))
    if not total > 0:
        return None
    if not smooth:
        share = length / length[-1]
        off = float(np.linalg.norm(line - line[0] - share[:, None] * (line[-1] - line[0]), axis=1).max())
        if off <= tolerance:  # between vertices the difference is linear, so this is the largest
            return Curve(np.array([0, 0, total, total]), line[[0, -1]], 1, off)
    count = max(8 * len(line), 16 * SAMPLES_PER_SPAN)
    while count <= most:
        curve = _refined(line, length, total, count, tolerance, smooth)
        if curve is not None:
            return curve
        count *= 4
    return None


def _refined(line: Floats, length: Floats, total: float, count: int, tolerance: float, smooth: bool) -> Curve | None:
    """The spline from so many samples, its spans halved until it is near enough; None if that takes more samples."""
    from scipy.interpolate import BSpline

    even = np.arange(count + 1) / count
    samples = _on(line, length, even)
    share = np.union1d(np.arange(4 * count + 1) / (4 * count), length / length[-1])
    points = _on(line, length, share)
    breaks = np.array([0.0, total / 2, total]) if smooth else np.array([0.0, total])
    while True:
        breaks = np.round(breaks, KNOT_DIGITS)
        knots = np.concatenate([[0.0] * 3, breaks, [total] * 3])
        poles = _least_squares(even * total, samples, knots, smooth)
        off = np.linalg.norm(BSpline(knots, poles, 3)(share * total) - points, axis=1)
        if off.max() <= tolerance:
            return Curve(knots, poles, 3, float(off.max()))
        span = np.clip(np.searchsorted(breaks, share * total, side="right") - 1, 0, len(breaks) - 2)
        bad = np.unique(span[off > tolerance])
        if (np.diff(breaks)[bad] < 2 * SAMPLES_PER_SPAN * total / count).any():
            return None
        breaks = np.sort(np.concatenate([breaks, (breaks[bad] + breaks[bad + 1]) / 2]))


def halves(curve: Curve) -> list[Curve]:
    """A spline cut near the middle of its parameters: the same points, in two curves."""
    return _cut(curve, float(np.round((curve.knots[0] + curve.knots[-1]) / 2, KNOT_DIGITS)))


def of_few_spans(curve: Curve) -> list[Curve]:
    """A curve cut at its knots into curves of at most `SPANS` spans: the same points."""
    breaks, found = np.unique(curve.knots), [curve]
    count = -(-(len(breaks) - 1) // SPANS)
    for at in np.round(np.arange(1, count) * (len(breaks) - 1) / count).astype(int):
        found += _cut(found.pop(), float(breaks[at]))
    return found


def _cut(curve: Curve, at: float) -> list[Curve]:
    """What is before a parameter, and what is after it."""
    from scipy.interpolate import BSpline

    spline = BSpline(curve.knots, curve.poles, curve.degree)
    for _ in range(curve.degree - int(np.count_nonzero(curve.knots == at))):
        spline = spline.insert_knot(at)
    first = int(np.searchsorted(spline.t, at))
    end = first + curve.degree
    before = np.concatenate([spline.t[:end], [at]])
    after = np.concatenate([[at], spline.t[first:]])
    poles = spline.c[: len(spline.t) - curve.degree - 1]
    return [
        Curve(before, poles[:first], curve.degree, curve.deviation),
        Curve(after, poles[first - 1 :], curve.degree, curve.deviation),
    ]


def _on(line: Floats, length: Floats, share: Floats) -> Floats:
    """Points of the polyline at shares of its length."""
    return np.stack([np.interp(share * length[-1], length, column) for column in line.T], axis=1)


def _least_squares(x: Floats, points: Floats, knots: Floats, smooth: bool) -> Floats:
    """Poles (p, 2) of the cubic spline nearest to `points` at x, whose ends are the first and the last of them.

    smooth : the derivatives at both ends are one unknown vector d: pole 1 is pole 0 + a d, the last but one is
             the last - b d, with a and b a third of the first and the last span.
    """
    first, values, _ = hats(x, knots)
    n = len(knots) - 4
    held = np.array([0, 1, n - 2, n - 1] if smooth else [0, n - 1])
    start = np.zeros((n, points.shape[1]))
    start[held] = np.repeat(points[[0, -1]], len(held) // 2, axis=0)
    system = LeastSquares.of(values.T, first, np.zeros(1, dtype=np.int64), n, held)
    poles = system.poles(points, start)
    if not smooth:
        return poles
    # d joins the first poles with the last ones, outside of the band: it is taken out of the others, and solved for
    tangent = np.zeros((n, 1))
    tangent[[1, -2], 0] = (knots[4] - knots[3]) / 3, -(knots[-4] - knots[-5]) / 3
    free = tangent - system.solved(system.hats.T @ (system.hats @ tangent))
    along = system.hats @ free
    return np.asarray(poles + free @ (along.T @ (points - system.hats @ poles)) / (along.T @ along))
