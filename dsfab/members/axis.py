"""`MemberAxis`: a smooth curve along the middle of a member, its frame on the surface and its three curvatures.

A penalised cubic spline [Eilers, Marx 1996] is fitted to the line on the mesh, and another to the surface's normals
along it. Its knots are as far apart as some widths of the member: with knots as near as the mesh is wide, curvatures
would be those of its facets, however fine it is.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, lock, locked, unit_vectors
from dsfab.members.middle_lines import MiddleLine

KNOTS, COARSE = 4.0, 2.0
"""Knots are so many widths of the member apart, or so many edges of the mesh if these are longer."""
PER_KNOT = 8
"""Stations from knot to knot."""
SAMPLES = 4
"""Points of the line that are fitted, for each station."""
LEAST = 16
"""Stations of a short axis."""
PENALTY = 1e-3
"""Weight of third differences of the coefficients, over that of the points."""
CLOSE = 0.05
"""Where the spline is farther from the line on the mesh than this share of an edge, it gets twice as many knots, and
again, until they are an edge apart. On meshes that are finer than the member is wide the share is less by that ratio: a
mesh is off its smooth surface by the square of its edges."""
DEGREE = 3


@dataclass(frozen=True, eq=False)
class MemberAxis:
    """Stations along a curve on a surface; all lengths in metres, all curvatures per metre.

    s : (k,) arc length from 0.    P : (k, 3) points.    T : (k, 3) unit tangents.    N : (k, 3) unit normals.
    kg : (k,) bends in the surface, to the left if positive: T' . B with B = N x T.
    kn : (k,) bends with the surface, towards N if positive: T' . N.    tg : (k,) twists with it: -N' . B.
    closed  : whether the last station is the first one again.
    traced  : (k,) length of the line on the mesh up to there.    strayed : the farthest that the two are apart.
    """

    s: Floats
    P: Floats
    T: Floats
    N: Floats
    kg: Floats
    kn: Floats
    tg: Floats
    closed: bool
    traced: Floats
    strayed: float

    def __post_init__(self) -> None:
        for name in ("s", "kg", "kn", "tg", "traced"):
            lock(self, name, np.float64, (len(self.s),))
        for name in ("P", "T", "N"):
            lock(self, name, np.float64, (len(self.s), 3))

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.s[-1])

    @cached_property
    def B(self) -> Floats:  # noqa: N802 - its name in the field
        """(k, 3) unit vectors to the left in the surface, N x T."""
        return locked(np.cross(self.N, self.T), np.float64, (None, 3))

    def at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents and normals (q, 3) each at arc lengths (q,), between the stations."""
        P, T, N = (np.stack([np.interp(s, self.s, x) for x in y.T], axis=-1) for y in (self.P, self.T, self.N))
        return P, unit_vectors(T), unit_vectors(N)

    def station(self, traced: float) -> float:
        """Arc length where the line on the mesh is so long."""
        return float(np.interp(traced, self.traced, self.s))


def fitted_axis(line: MiddleLine, width: float, edge: float) -> MemberAxis:
    """The axis along a line (k, 3) of a member with a width, metres, on a mesh with an edge, metres."""
    step = max(KNOTS * width, COARSE * edge)
    axis, close = _fitted(line, step), CLOSE * edge * edge / max(edge, width)
    while axis.strayed > close and step >= 2 * edge:
        step /= 2
        axis = _fitted(line, step)
    return axis


def _fitted(line: MiddleLine, step: float) -> MemberAxis:
    L = line.length
    spans = max(4 if line.closed else 1, round(L / step))
    count = max(LEAST, PER_KNOT * spans)
    sampled = np.linspace(0, L, SAMPLES * count + 1)
    given = np.concatenate([line.points, line.normals], axis=1)
    given = np.stack([np.interp(sampled, line.s, column) for column in given.T], axis=1)
    both = _spline(sampled, given, L / spans, spans, line.closed)
    x = np.linspace(0, L, count + 1)
    (P, n), (d1, dn), (d2, _) = (np.split(both(x, order), 2, axis=1) for order in range(3))
    speed = np.linalg.norm(d1, axis=1)
    T = d1 / speed[:, None]
    N = unit_vectors(n - np.einsum("ki,ki->k", n, T)[:, None] * T)
    B = np.cross(N, T)
    bent = d2 / speed[:, None] ** 2
    kg, kn = np.einsum("ki,ki->k", bent, B), np.einsum("ki,ki->k", bent, N)
    tg = -np.einsum("ki,ki->k", dn, B) / (np.linalg.norm(n, axis=1) * speed)
    s = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(x))])
    strayed = float(np.linalg.norm((both(sampled) - given)[:, :3], axis=1).max())
    return MemberAxis(s, P, T, N, kg, kn, tg, line.closed, x, strayed)


def _spline(x: Floats, y: Floats, step: float, spans: int, closed: bool) -> BSpline:
    """The penalised spline through values y (q, d) at x (q,), 0 to spans x step, with knots a step apart."""
    t = step * np.arange(-DEGREE, spans + DEGREE + 1)
    design = csr_array(BSpline.design_matrix(np.clip(x, 0, step * spans), t, DEGREE))
    count = design.shape[1]
    free = spans if closed else count  # of a closed one the last three coefficients are the first three again
    fold = csr_array((np.ones(count), (np.arange(count), np.arange(count) % free)), shape=(count, free))
    design = csr_array(design @ fold)
    bend = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(count - 3, count)) @ fold
    weight = PENALTY * len(x) / count
    c = splu(csc_array(design.T @ design + weight * (bend.T @ bend))).solve(np.asarray(design.T @ y))
    return BSpline(t, np.asarray(fold @ c), DEGREE)
