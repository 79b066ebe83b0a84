"""Plane curves through polylines: lines where they are straight, cubic splines elsewhere, within a tolerance.

A spline is fitted in the least-squares sense at points spread evenly along the polyline, with its ends fixed; spans
where the largest distance exceeds the tolerance are halved until none does. Raw vertices would not do: they are
uneven, and fits through them overshoot between.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.export.refining import KNOT_DIGITS, SampledLine, refined
from dsfab.export.splines import Spline

SHARP = np.deg2rad(30.0)
"""An outline that turns by more than this at a vertex has a corner there."""

MOST_SAMPLES = 50_000
"""Samples of one polyline; a tolerance that would need more is not met by a spline."""

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


@dataclass(frozen=True, eq=False)
class Polyline:
    """What a curve goes along: points (k, 2) or (k, 3), and the most samples that it may take.

    smooth : it is closed, and its curve leaves as it arrives.
    """

    points: Floats
    smooth: bool = False
    most: int = MOST_SAMPLES


def fitted(line: Floats, tolerance: float, smooth: bool = False) -> Curve | None:
    """One curve along the polyline (k, 2) or (k, 3), or None where that would take too many samples."""
    return all_fitted([Polyline(line, smooth)], tolerance)[0]


def all_fitted(lines: Sequence[Polyline], tolerance: float) -> list[Curve | None]:
    """One curve along each polyline, or None where that would take more samples than it may. Thousands of lines at
    once take a sixth of the time that they take one by one."""
    found: list[Curve | None] = [None] * len(lines)
    open_runs = dict[int, SampledLine]()
    for k, line in enumerate(lines):
        run = SampledLine.of(line.points, line.smooth)
        if not run.total > 0:
            continue
        off = np.inf if line.smooth else run.bow
        if off <= tolerance:
            found[k] = Curve(np.array([0, 0, run.total, run.total]), line.points[[0, -1]], 1, off)
        elif run.count <= line.most:
            open_runs[k] = run
    while open_runs:
        made = refined(list(open_runs.values()), tolerance)
        missed = dict[int, SampledLine]()
        for (k, run), one in zip(open_runs.items(), made, strict=True):
            if one is not None:
                found[k] = Curve(*one)
            elif 4 * run.count <= lines[k].most:
                missed[k] = replace(run, count=4 * run.count)
        open_runs = missed
    return found


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
