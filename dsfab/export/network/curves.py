"""Chains as cubics, one for both skins: poles have six coordinates, outer and inner."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.export.network.graph import VOID, ChainNet
from dsfab.export.network.inner import InnerSpline
from dsfab.export.network.lifting import Lifting
from dsfab.export.smooth.edges import spread
from dsfab.export.smooth.fits import splines_through
from dsfab.export.splines import Spline, bernstein

BETWEEN = 2
"""Samples of each edge of the mesh along a chain, on the smooth skins."""


@dataclass(frozen=True, eq=False)
class SampledChain:
    """Q : (k, 6) points on the outer and on the inner skin, millimetres.    outline : whether void is beyond it."""

    Q: Floats
    outline: bool

    @cached_property
    def middle(self) -> Floats:
        """(k, 3) half way between the skins."""
        return np.asarray((self.Q[:, :3] + self.Q[:, 3:]) / 2)

    @cached_property
    def way(self) -> Floats:
        """(k,) arc lengths, millimetres."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.middle, axis=0), axis=1))])

    def direction(self, from_start: bool, reach: float) -> tuple[Floats, Floats]:
        """The way from one of its ends to what is within `reach`, millimetres, and the normal at that end."""
        if (from_start, reach) not in self._directions:
            x = min(reach / self.way[-1], 0.5)
            Q = self.at(np.array([0.0, x]) if from_start else np.array([1.0, 1 - x]))
            middle, across = (Q[:, :3] + Q[:, 3:]) / 2, Q[0, :3] - Q[0, 3:]
            self._directions[from_start, reach] = (middle[1] - middle[0], across / np.linalg.norm(across))
        return self._directions[from_start, reach]

    @cached_property
    def _directions(self) -> dict[tuple[bool, float], tuple[Floats, Floats]]:
        return {}

    def at(self, x: Floats) -> Floats:
        """(j, 6) at shares x (j,) of the length."""
        return np.stack([np.interp(x * self.way[-1], self.way, c) for c in self.Q.T], axis=1)


@dataclass(frozen=True, eq=False)
class ChainCurve:
    """breaks : (k + 1,) from 0 to 1, and between them spans : (k, 4, 6) Bezier poles, millimetres.
    off : largest distance from the chain's samples."""

    breaks: Floats
    spans: Floats
    off: float = 0.0

    @classmethod
    def of(cls, spline: Spline, off: float) -> "ChainCurve":
        """A line, a parabola or a cubic."""
        breaks = np.unique(spline.knots)
        x = (0.05 + 0.3 * np.arange(4))[None] * np.diff(breaks)[:, None] + breaks[:-1, None]
        at = spline(x.ravel()).reshape(len(breaks) - 1, 4, -1)
        spans = np.asarray(np.linalg.solve(bernstein(np.array([0.05, 0.35, 0.65, 0.95])), at), dtype=np.float64)
        spans[0, 0], spans[-1, -1] = spline.poles[0], spline.poles[-1]
        spans[1:, 0] = spans[:-1, 3]
        return cls(breaks, spans, off)

    def __call__(self, x: Floats) -> Floats:
        """(k, 6) points at parameters x (k,)."""
        span = np.clip(np.searchsorted(self.breaks, x, side="right") - 1, 0, len(self.spans) - 1)
        share = (x - self.breaks[span]) / np.diff(self.breaks)[span]
        return np.asarray(np.einsum("ka,kai->ki", bernstein(share), self.spans[span]))

    def with_break(self, x: float) -> "ChainCurve":
        """The same curve with one more break [de Casteljau]."""
        k = int(np.clip(np.searchsorted(self.breaks, x) - 1, 0, len(self.spans) - 1))
        t = (x - self.breaks[k]) / (self.breaks[k + 1] - self.breaks[k])
        rows = [self.spans[k]]
        for _ in range(3):
            rows.append((1 - t) * rows[-1][:-1] + t * rows[-1][1:])
        two = np.stack([[row[0] for row in rows], [row[-1] for row in rows[::-1]]])
        spans = np.concatenate([self.spans[:k], two, self.spans[k + 1 :]])
        return ChainCurve(np.insert(self.breaks, k + 1, x), spans, self.off)

    def reversed(self) -> "ChainCurve":
        """Run through the other way."""
        return ChainCurve(1 - self.breaks[::-1], self.spans[::-1, ::-1], self.off)


def fitted_chains(
    chains: Mapping[int, SampledChain], tolerance: float, away: Callable[[Floats], Floats]
) -> dict[int, ChainCurve]:
    """The curves of chains within a tolerance, millimetres, by number; all are fitted at once.

    What `away` says of points (k, 6) of theirs brings them onto the skins between their ends: beside their samples they
    may be by the tolerance, but a face whose edges are off it strays.
    """
    samples = [spread(chain.Q) for chain in chains.values()]
    fits = splines_through(samples, [tolerance] * len(samples), parts=2)
    curves = [ChainCurve.of(*fit) for fit in fits]
    inner = [InnerSpline.of(curve.breaks) for curve in curves]
    ways = away(np.concatenate([curve(spline.places) for curve, spline in zip(curves, inner, strict=True)]))
    each = np.split(ways, np.cumsum([len(spline.places) for spline in inner])[:-1])
    moved = [curve.spans + spline.poles @ way for curve, spline, way in zip(curves, inner, each, strict=True)]
    return {k: replace(curve, spans=spans) for k, curve, spans in zip(chains, curves, moved, strict=True)}


def sampled_chains(net: ChainNet, lifting: Lifting) -> dict[int, SampledChain]:
    """The chains of a net on the smooth skins, by number."""
    numbers = list(net.chains)
    points = [net.chains[k].points for k in numbers]
    start, end = (np.concatenate([p[some] for p in points]) for some in (slice(-1), slice(1, None)))
    one, two = net.weights[start], net.weights[end]
    parts = [csr_array(one * (1 - t) + two * t) for t in np.arange(BETWEEN) / BETWEEN]
    last = net.weights[np.array([p[-1] for p in points])]
    Q = lifting.points(csr_array(vstack([*parts, last], format="csr")))
    count = len(start)
    inner = Q[: BETWEEN * count].reshape(BETWEEN, count, 6).transpose(1, 0, 2)
    at, found = 0, dict[int, SampledChain]()
    for i, (k, p) in enumerate(zip(numbers, points, strict=True)):
        mine = inner[at : at + len(p) - 1].reshape(-1, 6)
        found[k] = SampledChain(np.concatenate([mine, Q[[BETWEEN * count + i]]]), net.chains[k].right == VOID)
        at += len(p) - 1
    return found
