"""Spline surfaces of both skins over each chart, by least squares with few poles."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import solveh_banded

from dsfab.core.arrays import Bools, Floats, Ints, grouped, lock
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.shared.skins import Dense, between, dense, halfway
from dsfab.export.part import Curved
from dsfab.export.splines import basis, hats
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corners_of, edge_table, faces_at

CLOSE = 1e-8
"""Nearest points are found to this share of a surface's size: a tenth of a micrometre on ten metres."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A bicubic B-spline surface: clamped knots u (p + 4,) and v (q + 4,), poles (p, q, d)."""

    u: Floats
    v: Floats
    poles: Floats

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None,))
        lock(self, "v", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None, None))

    def __call__(self, uv: Floats) -> Floats:
        """(k, d) points at uv (k, 2)."""
        (i, a), (j, b) = basis(uv[:, 0], self.u), basis(uv[:, 1], self.v)
        return self._along_v(b, self._across_u(a, self._around(i, j)))

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, and derivatives by u and by v, (k, d) each."""
        (i, a, da), (j, b, db) = hats(uv[:, 0], self.u), hats(uv[:, 1], self.v)
        around = self._around(i, j)
        at, du = self._across_u(a, around), self._across_u(da, around)
        return self._along_v(b, at), self._along_v(b, du), self._along_v(db, at)

    def _around(self, i: Ints, j: Ints) -> Floats:
        """(k, 4, 4, d) the poles from (i, j) on."""
        _, q, d = self.poles.shape
        at = (i * q + j)[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return np.asarray(self.poles.reshape(-1, d).take(at, axis=0).reshape(-1, 4, 4, d))

    @staticmethod
    def _across_u(hat: Floats, around: Floats) -> Floats:
        """(k, 4, d) sums over the first direction, weighted with hats (k, 4)."""
        k, *_, d = around.shape
        return np.asarray(np.einsum("ka,kax->kx", hat, around.reshape(k, 4, -1)).reshape(k, 4, d))

    @staticmethod
    def _along_v(hat: Floats, rows: Floats) -> Floats:
        return np.asarray(np.einsum("kb,kbd->kd", hat, rows))

    def only(self, first: int, last: int) -> "Patch":
        """The surface of some of the coordinates."""
        return Patch(self.u, self.v, self.poles[:, :, first:last])

    def nearest(self, points: Floats, uv: Floats, rounds: int = 8) -> Floats:
        """(k, 2) parameters of the surface's points nearest to `points` (k, 3), by Gauss-Newton from uv."""
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        uv, going = np.clip(uv, low, high), np.arange(len(uv))
        for _ in range(rounds):
            at, a, b = self.slopes(uv[going])
            r = points[going] - at
            aa, ab, bb, ra, rb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b), (r, a), (r, b)))
            det = np.maximum(aa * bb - ab * ab, 1e-300)
            step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
            uv[going] = np.clip(uv[going] + step, low, high)
            going = going[np.abs(step).max(axis=1) >= CLOSE * (high - low).max()]
            if not len(going):
                break
        return uv


SMOOTHING = 1e-5
"""Weight of the differences of poles against the distances from the points."""

FEWEST_POLES, MOST_POLES = 6, 48
"""Poles of a fit in one direction."""

FIRST = 8.0
"""Poles of the first attempt, in the geometric mean of both directions."""

POINTS_PER_POLE = 2.5
"""Fewest points of a fit for each pole: with fewer, surfaces wave between the points, and two of them gape at a seam
by more than either is off its points."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A surface through points.

    off     : its largest distance from those that count.
    size    : its poles, the geometric mean of both directions, but for limits.
    starved : whether more poles would have been tried on more points.
    """

    patch: Patch
    off: float
    size: float
    starved: bool


def fitted(
    uv: Floats,
    Q: Floats,
    inside: Bools,
    weight: Floats,
    tolerance: float,
    first: float = FIRST,
    most_poles: int = MOST_POLES,
) -> Fit:
    """The surface with few poles within the tolerance of what is inside, Q (k, 6) two points each.

    first, most_poles : poles to begin and to end with, the geometric mean of both directions, and in one of them.
    The distance of a cubic surface goes with the fourth power of its spans: that says how many poles to try next.
    """
    extent = np.ptp(uv, axis=0)
    aspect = np.sqrt(np.clip(extent[0] / extent[1], 0.1, 10.0))
    most = np.sqrt(len(uv) / POINTS_PER_POLE)
    n, here = min(first, most), np.flatnonzero(inside)
    while True:
        count = [int(np.clip(np.rint(x), FEWEST_POLES, most_poles)) for x in (n * aspect, n / aspect)]
        patch, found = _through(uv, Q, weight, (count[0], count[1]), SMOOTHING)
        away = np.linalg.norm((found[here] - Q[here]).reshape(-1, 2, 3), axis=2)
        off = float(away.max())
        if off <= tolerance or n >= min(most, most_poles):
            return Fit(patch, off, float(n), bool(off > tolerance and n < most_poles))
        n = min(n * float(np.clip(1.05 * (off / tolerance) ** 0.25, 1.15, 2.0)), max(most, n), float(most_poles))


def patch_through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> Patch:
    """The bicubic surface of p x q poles nearest to points Q (k, d) at uv (k, 2), in the least-squares sense.

    weight (k,) of the points.
    smoothing : weight of the second differences of the poles, so that poles without points have a place, too.
    """
    return _through(uv, Q, weight, count, smoothing)[0]


def _through(uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float) -> tuple[Patch, Floats]:
    """The surface of `patch_through`, and its points (k, d) at uv."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    pad = 0.01 * (high - low)
    u, v = (
        np.concatenate([[a] * 3, np.linspace(a, b, n - 2), [b] * 3])
        for a, b, n in zip(low - pad, high + pad, count, strict=True)
    )
    p, q = count
    cells = _Cells.of(uv, u, v)
    band, right = cells.normal(weight, Q, p, q)
    rows, rough = _roughness(p, q)
    band[rows] += smoothing * len(uv) / (p * q) * rough
    poles = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    return Patch(u, v, poles.reshape(p, q, -1)), cells.sums(poles)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Points by the cells of the knots that they are in, and the hats of the 16 poles around them.

    Points of one cell have the same poles: a product of matrices for each cell takes a quarter of the time of sums over
    all points.

    order : (k,) the points, cell after cell; start : of each cell there.
    poles : (c, 16) the numbers of each cell's; hats (k, 16) of the points in that order.
    """

    order: Ints
    start: Ints
    poles: Ints
    hats: Floats

    @classmethod
    def of(cls, uv: Floats, u: Floats, v: Floats) -> "_Cells":
        (i, a), (j, b) = basis(uv[:, 0], u), basis(uv[:, 1], v)
        q = len(v) - 4
        order, start, _ = grouped(i * q + j)
        first = (i * q + j)[order[start]]
        poles = first[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return cls(order, start, poles, np.einsum("ka,kb->kab", a[order], b[order]).reshape(-1, 16))

    @property
    def parts(self) -> Iterator[slice]:
        """The points of each cell."""
        return (slice(a, b) for a, b in pairwise([*self.start.tolist(), len(self.order)]))

    def normal(self, weight: Floats, Q: Floats, p: int, q: int) -> tuple[Floats, Floats]:
        """Normal equations: the lower band (3 q + 4, p q) of the matrix, and the right side."""
        left = (weight[self.order, None] * self.hats).T
        both = np.concatenate([self.hats, Q[self.order]], axis=1)
        sums = np.stack([left[:, one] @ both[one] for one in self.parts])
        row, column = np.tril_indices(16)
        place = (self.poles[:, row] - self.poles[:, column]) * p * q + self.poles[:, column]
        band = np.bincount(place.ravel(), sums[:, row, column].ravel(), (3 * q + 4) * p * q).astype(np.float64)
        sides = np.moveaxis(sums[:, :, 16:], 2, 0)
        right = [np.bincount(self.poles.ravel(), side.ravel(), p * q) for side in sides]
        return band.reshape(3 * q + 4, p * q), np.stack(right, axis=1)

    def sums(self, poles: Floats) -> Floats:
        """(k, d) the points of the surface with poles (p q, d)."""
        found = np.empty((len(self.order), poles.shape[1]))
        for one, some in zip(self.parts, self.poles, strict=True):
            found[self.order[one]] = self.hats[one] @ poles[some]
        return found


@lru_cache(maxsize=256)
def _roughness(p: int, q: int) -> tuple[Ints, Floats]:
    """The squared second differences of p x q poles: rows below the diagonal, and these rows of the lower band."""
    steps = ((0, 0), (0, 1), (0, 2), (1, -1), (1, 0), (1, 1), (2, 0))
    (*u,), (*v,) = ([_gram(n, order) for order in range(3)] for n in (p, q))
    terms = ((1.0, u[2], v[0]), (1.0, u[0], v[2]), (2.0, u[1], v[1]))
    rows = [sum(w * np.outer(_diagonal(a, di), _diagonal(b, dj)).ravel() for w, a, b in terms) for di, dj in steps]
    return np.array([di * q + dj for di, dj in steps]), np.array(rows)


def _gram(n: int, order: int) -> Floats:
    """(n, n) the matrix of the squared differences of n poles."""
    D = np.diff(np.eye(n), order, axis=0)
    return D.T @ D


def _diagonal(table: Floats, below: int) -> Floats:
    """(n,) by columns, the entries so many rows below the diagonal, and zeros where there are none."""
    entries, none = np.diagonal(table, -below), np.zeros(abs(below))
    return np.concatenate([entries, none] if below > 0 else [none, entries])


OUTSIDE, BOUNDARY = 0.2, 0.5
"""Weights of the points around a chart, which hold the skins where seams are drawn, and of those on the boundary, whose
normals lean to one side. The tolerance is not asked of either."""

FOLDED = 0.01
"""Share of a chart's faces that may look away: finer meshes of coarse ones fold at a corner of their boundary now and
then. The distance of the fit from all points is asked for in any case."""


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """What a chart is fitted to, millimetres.

    origin, axes, steepest : see `Chart`.
    uv, Q  : (k, 2) and (k, 6) over the plane, and on both skins.
    inside : (k,) whether the tolerance is asked there; weight (k,).
    chord  : how far the edges between the points lie below the surface, but for a tenth of them.
    """

    origin: Floats
    axes: Floats
    steepest: float
    uv: Floats
    Q: Floats
    inside: Bools
    weight: Floats
    chord: float


def points_of(dense: Dense, near: Bools, mine: Bools) -> SkinPoints:
    """Of a chart and a ring around it. near : (faces of the mesh,); mine : (n,) vertices of the chart."""
    faces = np.flatnonzero(near[dense.parent])
    used, F = np.unique(dense.surface.F[faces], return_inverse=True)
    F = F.reshape(-1, 3)
    touched = faces_at(F, mine[used])
    if not touched.any():
        raise ExportError("a chart of the sheet is smaller than a face")
    core = corners_of(F, touched, len(used))
    around = faces_at(F, corners_of(F, faces_at(F, core), len(used)))
    V, normals = dense.points[used], dense.surface.normals[faces]
    axes = _axes(V[core], (dense.surface.areas[faces, None] * normals)[touched].sum(axis=0))
    steepest = float(np.quantile(normals[touched] @ axes[2], FOLDED))
    if steepest <= 0:
        raise ExportError("the sheet bends too sharply for charts")
    ring = around & (normals @ axes[2] > 0.5 * steepest)
    some, F = np.unique(F[ring], return_inverse=True)
    ends = edge_table(F.reshape(-1, 3)).ends
    V, core, used = V[some], core[some], used[some]
    origin, P, d = V.mean(axis=0), dense.middle[used], dense.across[used]
    M = between(P, d, ends)
    chord = np.linalg.norm(M - halfway(P, ends), axis=1)
    uv = np.concatenate([V - origin, M - origin]) @ axes[:2].T
    P, d = np.concatenate([P, M]), np.concatenate([d, _mean(d, ends)])
    own, inside = (np.concatenate([x, x[ends].all(axis=1)]) for x in (core, core & ~dense.boundary[used]))
    inside = inside if inside.any() else own
    weight = np.where(inside, 1.0, np.where(own, BOUNDARY, OUTSIDE))
    Q = np.concatenate([P + d, P - d], axis=1)
    return SkinPoints(origin, axes, steepest, uv, Q, inside, weight, float(np.percentile(chord, 90)))


def _mean(d: Floats, ends: Ints) -> Floats:
    """Half way along edges: their ends' mean direction, and mean length."""
    middle, length = halfway(d, ends), halfway(np.linalg.norm(d, axis=1), ends)
    return np.asarray(middle * (length / np.maximum(np.linalg.norm(middle, axis=1), 1e-300))[:, None])


def _axes(V: Floats, across: Floats) -> Floats:
    """(3, 3) right-handed: the longest direction in the plane, the one beside it, and the given one."""
    across = across / max(float(np.linalg.norm(across)), 1e-300)
    flat = V - V.mean(axis=0)
    flat = flat - np.outer(flat @ across, across)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    along = along * np.sign(along[np.abs(along).argmax()])
    along = along - across * (along @ across)
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(across, along), across])


USELESS = 3
"""A chart that is off by so many tolerances is not worth asking OCCT about. One that is off by less may be, since the
solid is measured in the end, and few of its pieces are where the chart is worst."""

DIVISIONS = 2
"""Coarse meshes are divided so often for the fit, by points on cubics between the vertices: charts then agree at seams.
Nothing is known between the vertices of a coarse mesh, but two skins must say the same there."""

HALVED, FEWEST = 4, 12
"""How often a chart is divided, at most, and the vertices of the mesh that it must have for it."""

FEW_POLES = 24
"""A chart that needs more poles in one direction is divided once: OCCT looks through all poles of a surface for each
point that it projects, and the halves need fewer together. Without it the tower took a third more time."""

STEEPEST = np.cos(np.deg2rad(80.0))
"""A chart that leans more is divided between where it does and where it looks the other way."""

STEEP = 0.25
"""The fields of both halves of a chart part within this share of its half length: a border between others is as steep.
"""

OF_CHORD = 0.3
"""Share of the mesh's own chord error that counts to the tolerance: between its vertices it says no more."""


@dataclass(frozen=True, eq=False)
class SkinChart:
    """A plane and the skins over it. Lengths in millimetres.

    origin, axes : (3,) and (3, 3): two in the plane, and the one across it, where the normals point to.
    upper, lower, middle : surfaces of the skins, and between them, over the plane.
    tolerance    : what was asked of the fit: more where the mesh is coarse.
    steepest     : cosine of the largest angle between the plane and a face, but for a few.
    off          : largest distance of a skin from the points it was fitted to.
    """

    origin: Floats
    axes: Floats
    upper: Patch
    lower: Patch
    middle: Patch
    tolerance: float
    steepest: float
    off: float

    @cached_property
    def both(self) -> Patch:
        """Both skins as one surface of six coordinates, those of the upper one first."""
        return Patch(self.upper.u, self.upper.v, np.concatenate([self.upper.poles, self.lower.poles], axis=2))

    def over(self, points: Floats) -> Floats:
        """(k, 2) where points (k, 3) are seen in the plane."""
        return np.asarray((points - self.origin) @ self.axes[:2].T)


class Atlas:
    """The charts of a surface, made when they are asked for.

    fields : (n, c) on the vertices, chart k is where field k is largest; there are more once charts were divided.
    charts : by number; those that no spline follows are missing, and `failed` says why.
    """

    def __init__(self, surface: Surface, curved: Curved, fields: Floats, tolerance: float) -> None:
        self.surface, self.fields, self.tolerance = surface, fields, tolerance
        self.charts, self.failed = dict[int, SkinChart](), dict[int, str]()
        self._levels = [dense(surface, curved)]
        self._best = [fields.argmax(axis=1)]

    def make(
        self, numbers: Iterable[int], halve: bool = True, hopeless: Callable[[int], bool] = lambda _: False
    ) -> None:
        """The charts of these numbers (tolerance in millimetres), and those that they are divided into.

        hopeless : whether the others are of no use without a chart that failed; it ends there then.
        """
        todo = [(int(k), 0) for k in numbers if k not in self.charts and k not in self.failed]
        while todo:
            k, turn = todo.pop()
            may = halve and turn < HALVED and np.count_nonzero(self._best[0] == k) >= FEWEST
            halves = [(k, turn + 1), (self.fields.shape[1], turn + 1)]
            leaning = self._leaning(k)
            if may and leaning is not None:
                self._divide(k, leaning)
                todo += halves
                continue
            try:
                chart = self._chart(k, FIRST * (2 if turn else 1), FEW_POLES if may and not turn else MOST_POLES)
            except ExportError as error:
                self.failed[k] = str(error)
                if hopeless(k):
                    return
                continue
            if may and chart.off > chart.tolerance:
                self._divide(k, (self._levels[0].points - chart.origin) @ chart.axes[0])
                todo += halves
            elif chart.off > USELESS * chart.tolerance:
                self.failed[k] = (
                    f"no spline surface follows chart {k + 1} of {self.fields.shape[1]} of the sheet "
                    f"within {chart.tolerance:.2g} mm ({chart.off:.2g} mm)"
                )
                if hopeless(k):
                    return
            else:
                self.charts[k] = chart

    def _leaning(self, k: int) -> Floats | None:
        """(n,) from where chart k leans most to where it looks the other way; nothing when a plane sees it well."""
        touched = faces_at(self.surface.F, self._best[0] == k)
        N = self.surface.normals[touched]
        mean = self.surface.areas[touched] @ N
        cosine = N @ mean / max(float(np.linalg.norm(mean)), 1e-300)
        if not len(N) or np.quantile(cosine, FOLDED) >= STEEPEST:
            return None
        first = N[cosine.argmin()]
        return np.asarray(self._levels[0].normals @ (N[(N @ first).argmin()] - first))

    def _divide(self, k: int, along: Floats) -> None:
        """Chart k, and a new one where a field (n,) is beyond its middle between the ends of the chart."""
        inside = self._best[0] == k
        low, high = along[inside].min(), along[inside].max()
        steep = np.clip((along - (low + high) / 2) / (STEEP * (high - low) / 2), -1, 1)
        old = self.fields[:, k]
        fields = np.column_stack([self.fields, old - np.maximum(-steep, 0)])
        fields[:, k] = old - np.maximum(steep, 0)
        self.fields = fields
        for level, best in enumerate(self._best):
            fresh = self._carried(level, fields[:, [k, -1]])
            best[(best == k) & (fresh[:, 1] > fresh[:, 0])] = fields.shape[1] - 1

    def _carried(self, level: int, fields: Floats) -> Floats:
        for below in self._levels[:level]:
            fields = below.carry(fields)
        return fields

    def _chart(self, k: int, first: float, most: int) -> SkinChart:
        """Chart k, on points that are dense enough for its curvature and for its poles; see `fitted`."""
        F = self.surface.F
        near = faces_at(F, self._best[0] == k)
        for _ in range(2):
            near = faces_at(F, corners_of(F, near, self.surface.n))
        for level in range(DIVISIONS + 1):
            if level == len(self._levels):
                self._levels.append(self._levels[-1].finer)
                self._best.append(self._carried(level, self.fields).argmax(axis=1))
            points = points_of(self._levels[level], near, self._best[level] == k)
            if level < DIVISIONS and points.chord > self.tolerance:
                continue
            tolerance = self.tolerance + OF_CHORD * points.chord
            fit = fitted(points.uv, points.Q, points.inside, points.weight, tolerance, first, most)
            if not fit.starved:
                break
            first = fit.size
        return _charted(points, fit, tolerance)


def _charted(points: SkinPoints, fit: Fit, tolerance: float) -> SkinChart:
    lower, upper = fit.patch.only(3, 6), fit.patch.only(0, 3)
    mean = Patch(upper.u, upper.v, (upper.poles + lower.poles) / 2)
    return SkinChart(points.origin, points.axes, upper, lower, mean, tolerance, points.steepest, fit.off)
