"""Pairs of curves of degree 2 or 3. The curves of a pair lie on the two skins of the sheet."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Floats
from dsfab.export.cad.step.by_members.regions import VOID, ChainNet
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.shared.skins import SmoothLimits
from dsfab.export.splines import Spline, arc_lengths, basis, bernstein, even_samples, splines_through

READ_PLACES = np.array([0.05, 0.35, 0.65, 0.95])  # the points of a cubic at these parameters determine its poles

READ_MATRIX = bernstein(READ_PLACES)
POLE_MATRIX = np.linalg.inv(READ_MATRIX)


@dataclass(frozen=True, eq=False)
class InnerSpline:
    """Cubic splines on k spans between parameters `breaks` (k + 1,); the splines are zero at the two ends.
    places : (k + 1,) interpolation parameters, means of three knots [de Boor 1978, chapter XIII].
    poles  : (k, 4, k + 1) Bezier poles of each span, for each spline that is 1 at one of the places and 0 elsewhere."""

    breaks: Floats
    places: Floats
    poles: Floats

    @classmethod
    def from_breaks(cls, breaks: Floats) -> "InnerSpline":
        """Return the splines for `breaks`: the parameters, from 0 to 1, at which spans begin and end."""
        return _inner_spline(breaks.tobytes())

    @cached_property
    def hats(self) -> Floats:
        """Weights (k + 1, k, 4) of the Bezier poles that give the curve's points at `places`."""
        count = len(self.places) - 1
        span = np.clip(np.searchsorted(self.breaks, self.places, side="right") - 1, 0, count - 1)
        hats = np.zeros((count + 1, count, 4))
        share = (self.places - self.breaks[span]) / np.diff(self.breaks)[span]
        hats[np.arange(count + 1), span] = bernstein(share)
        return hats


@lru_cache(maxsize=1024)
def _inner_spline(break_bytes: bytes) -> InnerSpline:
    breaks: Floats = np.frombuffer(break_bytes)
    knots = np.concatenate([[0.0] * 3, breaks, [1.0] * 3])
    places = (knots[2:-4] + knots[3:-3] + knots[4:-2]) / 3
    inside = (np.diff(breaks)[:, None] * READ_PLACES + breaks[:-1, None]).ravel()
    values = np.linalg.solve(_rows(places, knots).T, _rows(inside, knots).T).T
    poles = np.linalg.solve(READ_MATRIX, values.reshape(len(breaks) - 1, 4, -1))
    poles[0, 0] = poles[-1, -1] = 0
    return InnerSpline(breaks, places, np.asarray(poles))


def _rows(x: Floats, knots: Floats) -> Floats:
    first_pole, values = basis(x, knots)
    rows = np.zeros((len(x), len(knots) - 4))
    np.put_along_axis(rows, first_pole[:, None] + np.arange(4), values, axis=1)
    return rows[:, 1:-1]


SAMPLES_PER_EDGE = 2  # number of samples on each skin of the sheet, for each mesh edge of a chain


@dataclass(frozen=True, eq=False)
class SampledChain:
    """Samples of a chain (row of mesh edges). Q : (k, 6) points on the outer and inner skin, three columns each, mm.
    outline : True if no region is on the right of the chain.    chord : smallest chord error of the mesh, mm."""

    Q: Floats
    outline: bool
    chord: float = 0.0

    @cached_property
    def middle(self) -> Floats:
        """Points (k, 3) half way between the skins, mm."""
        return np.asarray((self.Q[:, :3] + self.Q[:, 3:]) / 2)

    @cached_property
    def lengths(self) -> Floats:
        """Arc lengths (k,) from the start of the chain to the samples, mm."""
        return arc_lengths(self.middle)

    def direction(self, from_start: bool, reach: float) -> tuple[Floats, Floats]:
        """Return the vector (3,) from an end of the chain to the point `reach` mm away, and the end's normal (3,)."""
        if (from_start, reach) not in self._directions:
            x = min(reach / self.lengths[-1], 0.5)
            Q, target = self.Q[0 if from_start else -1], self.point(x if from_start else 1 - x)
            vector, across = (target[:3] + target[3:]) / 2 - (Q[:3] + Q[3:]) / 2, Q[:3] - Q[3:]
            self._directions[from_start, reach] = (vector, across / np.linalg.norm(across))
        return self._directions[from_start, reach]

    @cached_property
    def _directions(self) -> dict[tuple[bool, float], tuple[Floats, Floats]]:
        return {}

    def point(self, x: float) -> Floats:
        """Return the points (6,) on the outer and inner skin at a fraction x < 1 of the chain's length."""
        s, to = self.lengths, x * self.lengths[-1]
        i = int(s.searchsorted(to, side="right"))
        return np.asarray((self.Q[i] - self.Q[i - 1]) / (s[i] - s[i - 1]) * (to - s[i - 1]) + self.Q[i - 1])


@dataclass(frozen=True, eq=False)
class ChainCurve:
    """Two cubic curves along a chain (row of mesh edges), on the outer and inner skin.
    breaks : (k + 1,) parameters where spans end, from 0 to 1.    spans : (k, 4, 6) Bezier poles of the spans, mm.
    off    : largest distance of the chain from the curves, mm."""

    breaks: Floats
    spans: Floats
    off: float = 0.0

    @classmethod
    def from_spline(cls, spline: Spline, distance: float) -> "ChainCurve":
        """Convert a spline of degree 1 to 3 to cubics. distance : largest distance of samples from the spline, mm."""
        breaks = np.unique(spline.knots)
        x = READ_PLACES[None] * np.diff(breaks)[:, None] + breaks[:-1, None]
        values = spline(x.ravel()).reshape(len(breaks) - 1, 4, -1)
        spans = np.asarray(np.linalg.solve(READ_MATRIX, values), dtype=np.float64)
        spans[0, 0], spans[-1, -1] = spline.poles[0], spline.poles[-1]
        spans[1:, 0] = spans[:-1, 3]
        return cls(breaks, spans, distance)

    def __call__(self, x: Floats) -> Floats:
        """Return the points (k, 6) of the outer and the inner curve at parameters x (k,)."""
        span = np.clip(np.searchsorted(self.breaks, x, side="right") - 1, 0, len(self.spans) - 1)
        share = (x - self.breaks[span]) / np.diff(self.breaks)[span]
        return np.asarray(np.einsum("ka,kai->ki", bernstein(share), self.spans[span]))

    def stops(self, low: float, high: float) -> Floats:
        """Return ascending parameters (k,): `low`, the breaks between `low` and `high`, and `high`."""
        return np.concatenate([[low], self.breaks[(self.breaks > low) & (self.breaks < high)], [high]])

    def with_ends(self, start: Floats, end: Floats) -> "ChainCurve":
        """Return a copy whose ends are moved to the points `start` and `end` (6,)."""
        x = self.breaks[:-1, None] + np.diff(self.breaks)[:, None] * np.arange(4) / 3
        ways = start - self.spans[0, 0], end - self.spans[-1, -1]
        spans = self.spans + (1 - x)[..., None] * ways[0] + x[..., None] * ways[1]
        spans[0, 0], spans[-1, -1] = start, end
        return replace(self, spans=spans)

    def backwards(self) -> "ChainCurve":
        return ChainCurve(1 - self.breaks[::-1], self.spans[::-1, ::-1], self.off)


def parts_of(poles: Floats, start: Floats, end: Floats) -> Floats:
    """Return the Bezier poles (k, 4, d) of the parts of k cubics from parameter `start` (k,) to `end` (k,)."""
    inside = start[:, None] + (end - start)[:, None] * READ_PLACES
    rows = bernstein(inside.ravel()).reshape(len(poles), 4, 4)
    return np.asarray(POLE_MATRIX @ rows @ poles)


def curves_through(lines: Sequence[Floats], tolerances: Sequence[float]) -> list[ChainCurve]:
    """Fit a curve to each line of points (k, 6), mm. tolerances : largest distance (mm) of each line from its curve."""
    fits = splines_through([even_samples(line) for line in lines], tolerances, parts=2)
    return [ChainCurve.from_spline(*fit) for fit in fits]


def on_skins(curves: Sequence[ChainCurve], vectors_to_skins: Callable[[Floats], Floats]) -> list[ChainCurve]:
    """Move curves onto the skins of the sheet. vectors_to_skins : returns vectors from points (k, 6) to the skins."""
    if not curves:
        return []
    inner = [InnerSpline.from_breaks(f.breaks) for f in curves]
    all_vectors = vectors_to_skins(np.concatenate([f(spline.places) for f, spline in zip(curves, inner, strict=True)]))
    curve_vectors = np.split(all_vectors, np.cumsum([len(spline.places) for spline in inner])[:-1])
    return [
        replace(f, spans=f.spans + spline.poles @ vectors)
        for f, spline, vectors in zip(curves, inner, curve_vectors, strict=True)
    ]


def sampled_chains(net: ChainNet, lifting: Lifting, limits: SmoothLimits) -> dict[int, SampledChain]:
    """Return sample points of each chain (row of mesh edges) in a net, by number of the chain."""
    numbers = list(net.chains)
    points = [net.chains[k].points for k in numbers]
    start, end = (np.concatenate([p[part] for p in points]) for part in (slice(-1), slice(1, None)))
    start_weights, end_weights = net.weights[start], net.weights[end]
    shares = np.arange(SAMPLES_PER_EDGE) / SAMPLES_PER_EDGE
    parts = [csr_array(start_weights * (1 - t) + end_weights * t) for t in shares]
    last_points = net.weights[np.array([p[-1] for p in points])]
    Q = lifting.points(csr_array(vstack([*parts, last_points], format="csr")))
    count, chord = len(start), limits.allowed_distances(Q[: len(start), :3]) - limits.distance
    inner = Q[: SAMPLES_PER_EDGE * count].reshape(SAMPLES_PER_EDGE, count, 6).transpose(1, 0, 2)
    position, result = 0, dict[int, SampledChain]()
    for i, (k, p) in enumerate(zip(numbers, points, strict=True)):
        inner_points = inner[position : position + len(p) - 1].reshape(-1, 6)
        Qk = np.concatenate([inner_points, Q[[SAMPLES_PER_EDGE * count + i]]])
        result[k] = SampledChain(Qk, net.chains[k].right == VOID, float(chord[position : position + len(p) - 1].min()))
        position += len(p) - 1
    return result


PARABOLA_SHARE = 1 / 10  # allowed distance from parabola to cubic, divided by the allowed distance from solid to mesh
ZERO_DIFFERENCE = 1e-8  # mm; smaller third differences of a cubic's poles are rounding errors

BOW_FACTOR = np.sqrt(3) / 36
"""Largest distance of a cubic from the parabola of `as_parabolas`, divided by the third difference of the poles."""


def curves_as_parabolas(curves: Sequence[ChainCurve], distance: float, box: Floats) -> list[ChainCurve]:
    """Replace nearly parabolic curves by parabolas. distance : allowed distance of the solid from the mesh, mm.
    box : (2, 3) lowest and highest corner of the box around the skins, mm."""
    wide, tolerance = box + distance * np.array([[-1.0], [1.0]]), PARABOLA_SHARE * distance
    simple = [_are_parabolas(curve.spans, tolerance, wide) for curve in curves]
    return [replace(c, spans=as_parabolas(c.spans, 1)) if yes else c for c, yes in zip(curves, simple, strict=True)]


def as_parabolas(P: Floats, axis: int) -> Floats:
    """Replace cubics by parabolas with the same ends, and with 4 poles. axis : array axis of the poles."""
    P = P.swapaxes(0, axis)
    third = _third(P) / 6
    return np.stack([P[0], P[1] - third, P[2] + third, P[3]]).swapaxes(0, axis)


def patches_as_parabolas(P: Floats, distance: float) -> Floats:
    """Lower the degree of patches with poles P (ku, kv, 4, 4, 6) to 2 in directions whose sides are parabolas.
    distance : allowed distance of the solid from the mesh, mm."""
    for axis, sides in ((2, P[:, [0, -1], :, [0, -1]]), (3, P[[0, -1], :, [0, -1]])):
        if np.abs(_third(sides.swapaxes(0, -2))).max() < ZERO_DIFFERENCE:
            Q = as_parabolas(P, axis)
            if np.abs(Q - P).max() <= PARABOLA_SHARE * distance:
                P = Q
    return P


def fewest_poles(P: Floats, axis: int) -> Floats:
    """Return poles P with 3 instead of 4 poles along an array axis if all cubics are parabolas; otherwise P."""
    P = P.swapaxes(0, axis)
    if len(P) == 4 and np.abs(_third(P)).max() < ZERO_DIFFERENCE:
        P = np.stack([P[0], _middle_pole(P), P[3]])
    return P.swapaxes(0, axis)


def _third(P: Floats) -> Floats:
    return np.asarray(P[3] - P[0] - 3 * (P[2] - P[1]))


def _middle_pole(P: Floats) -> Floats:
    return np.asarray((3 * (P[1] + P[2]) - (P[0] + P[3])) / 4)


def _are_parabolas(spans: Floats, tolerance: float, box: Floats) -> bool:
    """Return True if parabolas can replace the cubics with poles `spans` (k, 4, 6). tolerance : mm."""
    turn, turn_out = np.tan(np.deg2rad([0.5, 0.25]))  # largest rotation of end tangents: total, and out of the skin
    P = spans.reshape(-1, 4, 2, 3).swapaxes(0, 1)
    outer = _middle_pole(P)
    if (outer < box[0]).any() or (outer > box[1]).any():
        return False
    across = (P[:, :, 0] - P[:, :, 1]).sum(axis=0)[:, None]
    across = across / np.linalg.norm(across, axis=2, keepdims=True)
    third = _third(P)
    difference, out = np.linalg.norm(third, axis=2), np.abs((third * across).sum(axis=2))
    handle = 3 * np.linalg.norm(P[[1, 3]] - P[[0, 2]], axis=3).min(axis=0)
    is_smooth = (difference / 2 <= turn * handle) & (out / 2 <= turn_out * handle)
    return bool((is_smooth & (BOW_FACTOR * difference <= tolerance)).all())
