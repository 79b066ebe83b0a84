"""Spline surfaces for both skins of each chart (part of the sheet)."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import solveh_banded

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups, lock
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.shared.skins import DenseSurface, cubic_midpoints, dense_surface, end_means
from dsfab.export.part import Curved
from dsfab.export.splines import basis, hats
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corners_of, edge_table, faces_at


@dataclass(frozen=True, eq=False)
class SplinePatch:
    """Bicubic B-spline surface: clamped knots u (p + 4,) and v (q + 4,), poles (p, q, d)."""

    u: Floats
    v: Floats
    poles: Floats

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None,))
        lock(self, "v", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None, None))

    def __call__(self, uv: Floats) -> Floats:
        """Return the surface points (k, d) at parameters uv (k, 2)."""
        (i, a), (j, b) = basis(uv[:, 0], self.u), basis(uv[:, 1], self.v)
        return self._along_v(b, self._across_u(a, self._local_poles(i, j)))

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the surface points (k, d) at parameters uv (k, 2), and their derivatives by u and by v."""
        (i, a, da), (j, b, db) = hats(uv[:, 0], self.u), hats(uv[:, 1], self.v)
        local_poles = self._local_poles(i, j)
        across_u, du = self._across_u(a, local_poles), self._across_u(da, local_poles)
        return self._along_v(b, across_u), self._along_v(b, du), self._along_v(db, across_u)

    def _local_poles(self, i: Ints, j: Ints) -> Floats:
        _, q, d = self.poles.shape
        numbers = (i * q + j)[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return np.asarray(self.poles.reshape(-1, d).take(numbers, axis=0).reshape(-1, 4, 4, d))

    @staticmethod
    def _across_u(hat: Floats, around: Floats) -> Floats:
        k, *_, d = around.shape
        return np.asarray(np.einsum("ka,kax->kx", hat, around.reshape(k, 4, -1)).reshape(k, 4, d))

    @staticmethod
    def _along_v(hat: Floats, rows: Floats) -> Floats:
        return np.asarray(np.einsum("kb,kbd->kd", hat, rows))

    def coordinates(self, begin: int, end: int) -> "SplinePatch":
        """Return the patch with only the coordinates `begin` to `end` - 1 of each pole."""
        return SplinePatch(self.u, self.v, self.poles[:, :, begin:end])

    def nearest(self, points: Floats, uv: Floats, rounds: int = 8) -> Floats:
        """Return the parameters (k, 2) of the surface points nearest to `points` (k, d). uv : (k, 2) first guesses."""
        step_limit = 1e-8  # a smaller step / surface size ends the search
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        uv, going = np.clip(uv, low, high), np.arange(len(uv))
        for _ in range(rounds):
            point, a, b = self.slopes(uv[going])
            r = points[going] - point
            aa, ab, bb, ra, rb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b), (r, a), (r, b)))
            det = np.maximum(aa * bb - ab * ab, 1e-300)
            step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
            uv[going] = np.clip(uv[going] + step, low, high)
            going = going[np.abs(step).max(axis=1) >= step_limit * (high - low).max()]
            if not len(going):
                break
        return uv


SMOOTHING = 1e-5  # weight of second differences of the poles in the fit; distances from points have weights up to 1
FEWEST_POLES, MOST_POLES = 6, 48  # smallest and largest number of poles of a fit in one direction
FEW_POLES = 24  # largest number of poles in one direction before a chart is divided; OCCT is slow with more
FIRST_POLES = 8.0  # number of poles of the first attempt: the geometric mean of the numbers along u and v


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """Surface that was fitted to points. off : largest distance (mm) from the points to which the tolerance applies.
    size    : geometric mean of the wanted numbers of poles in both directions.
    starved : True if the number of points limited the number of poles."""

    patch: SplinePatch
    off: float
    size: float
    starved: bool


def fitted_surface(
    uv: Floats,
    Q: Floats,
    inside: Bools,
    weight: Floats,
    tolerance: float,
    first_poles: float = FIRST_POLES,
    most_poles: int = MOST_POLES,
) -> SurfaceFit:
    """Fit a surface with few poles to points on both skins.
    uv, Q       : (k, 2) points in a plane, and (k, 6) points on upper and lower skin, mm.
    inside      : (k,) True for points to which the tolerance (mm) applies.    weight : (k,) weights in the fit.
    first_poles : first number of poles, geometric mean of both directions.    most_poles : limit for each direction."""
    points_per_pole = 2.5  # with fewer points, surfaces have waves between the points and gaps at seams
    extent = np.ptp(uv, axis=0)
    aspect = np.sqrt(np.clip(extent[0] / extent[1], 0.1, 10.0))
    pole_limit = np.sqrt(len(uv) / points_per_pole)
    n, inside_numbers = min(first_poles, pole_limit), np.flatnonzero(inside)
    while True:
        count = [int(np.clip(np.rint(x), FEWEST_POLES, most_poles)) for x in (n * aspect, n / aspect)]
        patch, points = patch_through(uv, Q, weight, (count[0], count[1]), SMOOTHING)
        distance = float(np.linalg.norm((points[inside_numbers] - Q[inside_numbers]).reshape(-1, 2, 3), axis=2).max())
        if distance <= tolerance or n >= min(pole_limit, most_poles):
            return SurfaceFit(patch, distance, float(n), bool(distance > tolerance and n < most_poles))
        growth = float(np.clip(1.05 * (distance / tolerance) ** 0.25, 1.15, 2.0))
        n = min(growth * n, max(pole_limit, n), float(most_poles))


def patch_through(
    uv: Floats, Q: Floats, weight: Floats, count: tuple[int, int], smoothing: float
) -> tuple[SplinePatch, Floats]:
    """Fit a bicubic surface with `count` = (p, q) poles to points Q (k, d) at parameters uv (k, 2).
    Return the surface and its points at uv. smoothing : weight of second differences of the poles."""
    low, high = uv.min(axis=0), uv.max(axis=0)
    pad = 0.01 * (high - low)
    u, v = (
        np.concatenate([[a] * 3, np.linspace(a, b, n - 2), [b] * 3])
        for a, b, n in zip(low - pad, high + pad, count, strict=True)
    )
    p, q = count
    cells = _Cells.from_knots(uv, u, v)
    band, right = cells.normal(weight, Q, p, q)
    rows, rough = _roughness(p, q)
    band[rows] += smoothing * len(uv) / (p * q) * rough
    poles = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    return SplinePatch(u, v, poles.reshape(p, q, -1)), cells.sums(poles)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Sample points, sorted by the cell of the knot grid that contains them, with the B-spline basis there."""

    order: Ints
    start: Ints
    poles: Ints
    hats: Floats

    @classmethod
    def from_knots(cls, uv: Floats, u: Floats, v: Floats) -> "_Cells":
        (i, a), (j, b) = basis(uv[:, 0], u), basis(uv[:, 1], v)
        q = len(v) - 4
        order, start, _ = equal_key_groups(i * q + j)
        poles = (i * q + j)[order[start], None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return cls(order, start, poles, np.einsum("ka,kb->kab", a[order], b[order]).reshape(-1, 16))

    @property
    def parts(self) -> Iterator[slice]:
        return (slice(a, b) for a, b in pairwise([*self.start.tolist(), len(self.order)]))

    def normal(self, weight: Floats, Q: Floats, p: int, q: int) -> tuple[Floats, Floats]:
        """Return the normal equations for p x q poles: lower band (3 q + 4, p q) of the matrix, right side (p q, d)."""
        weighted = (weight[self.order, None] * self.hats).T
        hats_and_points = np.concatenate([self.hats, Q[self.order]], axis=1)
        sums = np.stack([weighted[:, part] @ hats_and_points[part] for part in self.parts])
        row, column = np.tril_indices(16)
        place = (self.poles[:, row] - self.poles[:, column]) * p * q + self.poles[:, column]
        band = np.bincount(place.ravel(), sums[:, row, column].ravel(), (3 * q + 4) * p * q).astype(np.float64)
        right = [np.bincount(self.poles.ravel(), x.ravel(), p * q) for x in np.moveaxis(sums[:, :, 16:], 2, 0)]
        return band.reshape(3 * q + 4, p * q), np.stack(right, axis=1)

    def sums(self, poles: Floats) -> Floats:
        """Return the surface points (k, d) at the samples for poles (p q, d)."""
        points = np.empty((len(self.order), poles.shape[1]))
        for part, cell_poles in zip(self.parts, self.poles, strict=True):
            points[self.order[part]] = self.hats[part] @ poles[cell_poles]
        return points


@lru_cache(maxsize=256)
def _roughness(p: int, q: int) -> tuple[Ints, Floats]:
    steps = ((0, 0), (0, 1), (0, 2), (1, -1), (1, 0), (1, 1), (2, 0))
    (*u,), (*v,) = ([_gram(n, order) for order in range(3)] for n in (p, q))
    terms = ((1.0, u[2], v[0]), (1.0, u[0], v[2]), (2.0, u[1], v[1]))
    rows = [sum(w * np.outer(_diagonal(a, di), _diagonal(b, dj)).ravel() for w, a, b in terms) for di, dj in steps]
    return np.array([di * q + dj for di, dj in steps]), np.array(rows)


def _gram(n: int, order: int) -> Floats:
    D = np.diff(np.eye(n), order, axis=0)
    return D.T @ D


def _diagonal(table: Floats, below: int) -> Floats:
    entries, none = np.diagonal(table, -below), np.zeros(abs(below))
    return np.concatenate([entries, none] if below > 0 else [none, entries])


OUTSIDE, BOUNDARY = 0.2, 0.5
"""Weights in a chart's fit: OUTSIDE for points of neighbour charts, so that skins meet; BOUNDARY at sheet boundaries.
Boundary points have inexact normals. The tolerance does not apply to points outside a chart or on the boundary."""

FOLDED = 0.01
"""Largest fraction of a chart's faces that face away from its axis. Division of coarse meshes flips a few faces."""


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points to which the spline surfaces of a chart are fitted, millimetres.
    origin, axes : plane of the chart.    steepest : cosine of the angle between the plane and its steepest faces.
    uv, Q  : (k, 2) points in the plane, and (k, 6) points on both skins.
    inside : (k,) True for points to which the tolerance applies.    weight : (k,) weight in the fit.
    chord  : 90th percentile of the mesh's chord errors."""

    origin: Floats
    axes: Floats
    steepest: float
    uv: Floats
    Q: Floats
    inside: Bools
    weight: Floats
    chord: float


def points_of(dense: DenseSurface, near_faces: Bools, in_chart: Bools) -> SkinPoints:
    """Collect the points of a chart and of a ring of faces around the chart.
    near_faces : (m,) True for undivided faces near the chart.    in_chart : (n,) True for the chart's vertices."""
    faces = np.flatnonzero(near_faces[dense.parent])
    used, F = np.unique(dense.surface.F[faces], return_inverse=True)
    F = F.reshape(-1, 3)
    touched = faces_at(F, in_chart[used])
    if not touched.any():
        raise ExportError("a chart (a part of the sheet for one spline surface) is smaller than a triangle of the mesh")
    core = corners_of(F, touched, len(used))
    around = faces_at(F, corners_of(F, faces_at(F, core), len(used)))
    V, normals = dense.points[used], dense.surface.normals[faces]
    axes = _axes(V[core], (dense.surface.areas[faces, None] * normals)[touched].sum(axis=0))
    steepest = float(np.quantile(normals[touched] @ axes[2], FOLDED))
    if steepest <= 0:
        raise ExportError("the sheet bends too sharply for smooth spline surfaces")
    ring = around & (normals @ axes[2] > 0.5 * steepest)
    ring_vertices, F = np.unique(F[ring], return_inverse=True)
    ends = edge_table(F.reshape(-1, 3)).ends
    V, core, used = V[ring_vertices], core[ring_vertices], used[ring_vertices]
    origin, P, d = V.mean(axis=0), dense.middle[used], dense.half_vectors[used]
    M = cubic_midpoints(P, d, ends)
    chord = np.linalg.norm(M - end_means(P, ends), axis=1)
    uv = np.concatenate([V - origin, M - origin]) @ axes[:2].T
    P, d = np.concatenate([P, M]), np.concatenate([d, mean_half_vectors(d, ends)])
    is_core, inside = (np.concatenate([x, x[ends].all(axis=1)]) for x in (core, core & ~dense.boundary[used]))
    inside = inside if inside.any() else is_core
    weight = np.where(inside, 1.0, np.where(is_core, BOUNDARY, OUTSIDE))
    Q = np.concatenate([P + d, P - d], axis=1)
    return SkinPoints(origin, axes, steepest, uv, Q, inside, weight, float(np.percentile(chord, 90)))


def mean_half_vectors(d: Floats, ends: Ints) -> Floats:
    """Return means (e, 3) of the vectors d (n, 3) at the two ends (e, 2) of edges, scaled to the mean length."""
    middle, length = end_means(d, ends), end_means(np.linalg.norm(d, axis=1), ends)
    return np.asarray(middle * (length / np.maximum(np.linalg.norm(middle, axis=1), 1e-300))[:, None])


def _axes(V: Floats, across: Floats) -> Floats:
    across = across / max(float(np.linalg.norm(across)), 1e-300)
    flat = V - V.mean(axis=0)
    flat = flat - np.outer(flat @ across, across)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    along = along * np.sign(along[np.abs(along).argmax()])
    along = along - across * (along @ across)
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(across, along), across])


HALVED = 4  # largest number of divisions of a chart

STEEPEST = np.cos(np.deg2rad(80.0))  # smallest cosine between normals and axis of a chart; steeper charts are divided


@dataclass(frozen=True, eq=False)
class SkinChart:
    """Plane of a chart (part of the sheet), and both skins as surfaces over the plane, millimetres.
    origin, axes : (3,) point of the plane, and (3, 3) axes: two axes in the plane, and its normal.
    upper, lower, middle : surfaces of the two skins, and the surface half way between the skins.
    steepest     : smallest cosine of the angle between face and plane, without the steepest 1 % of the faces.
    off          : largest distance of the skins from the inner points to which they were fitted."""

    origin: Floats
    axes: Floats
    upper: SplinePatch
    lower: SplinePatch
    middle: SplinePatch
    tolerance: float
    steepest: float
    off: float

    @cached_property
    def skins(self) -> SplinePatch:
        """Both skins as a surface in six dimensions: three coordinates of the upper, then three of the lower skin."""
        return SplinePatch(self.upper.u, self.upper.v, np.concatenate([self.upper.poles, self.lower.poles], axis=2))

    def projected(self, points: Floats) -> Floats:
        """Return the projections (k, 2) of points (k, 3) onto the plane."""
        return np.asarray((points - self.origin) @ self.axes[:2].T)


class ChartAtlas:
    """Charts (parts) of a surface, with spline surfaces that are fitted on demand.
    fields : (n, c) values on the vertices. Chart k is the part where field k is largest.
    charts, failed : fitted charts, and reasons for failed fits, by chart number."""

    def __init__(self, surface: Surface, curved: Curved, fields: Floats, tolerance: float) -> None:
        self.surface, self.fields, self.tolerance = surface, fields, tolerance
        self.charts, self.failed = dict[int, SkinChart](), dict[int, str]()
        self._levels = [dense_surface(surface, curved)]
        self._best = [fields.argmax(axis=1)]

    def make(
        self, numbers: Iterable[int], halve: bool = True, hopeless: Callable[[int], bool] = lambda _: False
    ) -> None:
        """Fit spline surfaces to the charts with the given numbers.    halve : True if charts may be divided.
        hopeless : function of a failed chart's number. It returns True to stop."""
        useless = 3  # a chart fails only above 3 times the tolerance, because OCCT checks all pieces later
        fewest = 12  # a chart with fewer vertices is not divided
        todo = [(int(k), 0) for k in numbers if k not in self.charts and k not in self.failed]
        while todo:
            k, turn = todo.pop()
            may = halve and turn < HALVED and np.count_nonzero(self._best[0] == k) >= fewest
            halves = [(k, turn + 1), (self.fields.shape[1], turn + 1)]
            leaning = self._lean_field(k)
            if may and leaning is not None:
                self._divide(k, leaning)
                todo += halves
                continue
            try:
                chart = self.chart(k, FIRST_POLES * (2 if turn else 1), FEW_POLES if may and not turn else MOST_POLES)
                if may and chart.off > chart.tolerance:
                    self._divide(k, (self._levels[0].points - chart.origin) @ chart.axes[0])
                    todo += halves
                    continue
                if chart.off > useless * chart.tolerance:
                    raise ExportError(
                        f"no spline surface fits part {k + 1} of {self.fields.shape[1]} of the sheet within "
                        f"{chart.tolerance:.2g} mm; the fitted surface is {chart.off:.2g} mm from the sheet"
                    )
                self.charts[k] = chart
            except ExportError as error:
                self.failed[k] = str(error)
                if hopeless(k):
                    return

    def _lean_field(self, k: int) -> Floats | None:
        """Return a field (n,) for halving chart k if the chart is too steep; None for a flatter chart."""
        touched = faces_at(self.surface.F, self._best[0] == k)
        N = self.surface.normals[touched]
        mean = self.surface.areas[touched] @ N
        cosine = N @ mean / max(float(np.linalg.norm(mean)), 1e-300)
        if not len(N) or np.quantile(cosine, FOLDED) >= STEEPEST:
            return None
        steepest_normal = N[cosine.argmin()]
        return np.asarray(self._levels[0].normals @ (N[(N @ steepest_normal).argmin()] - steepest_normal))

    def _divide(self, k: int, along: Floats) -> None:
        part_width = 0.25  # width of the transition strip between the two halves of a chart / width of the chart
        inside = self._best[0] == k
        low, high = along[inside].min(), along[inside].max()
        steep = np.clip((along - (low + high) / 2) / (part_width * (high - low) / 2), -1, 1)
        field = self.fields[:, k]
        fields = np.column_stack([self.fields, field - np.maximum(-steep, 0)])
        fields[:, k] = field - np.maximum(steep, 0)
        self.fields = fields
        for level, winner in enumerate(self._best):
            fresh = self._carry_to_level(level, fields[:, [k, -1]])
            winner[(winner == k) & (fresh[:, 1] > fresh[:, 0])] = fields.shape[1] - 1

    def _carry_to_level(self, level: int, fields: Floats) -> Floats:
        for below in self._levels[:level]:
            fields = below.carry(fields)
        return fields

    def chart(self, k: int, first_poles: float, most_poles: int) -> SkinChart:
        """Return chart k with fitted spline surfaces.
        first_poles, most_poles : first and largest number of poles in each direction."""
        of_chord = 0.3  # the tolerance includes this fraction of the mesh's chord error
        most_divisions = 2  # a coarse mesh is refined at most twice
        F = self.surface.F
        near_faces = faces_at(F, self._best[0] == k)
        for _ in range(2):
            near_faces = faces_at(F, corners_of(F, near_faces, self.surface.n))
        for level in range(most_divisions + 1):
            if level == len(self._levels):
                self._levels.append(self._levels[-1].finer)
                self._best.append(self._carry_to_level(level, self.fields).argmax(axis=1))
            points = points_of(self._levels[level], near_faces, self._best[level] == k)
            if level < most_divisions and points.chord > self.tolerance:
                continue
            tolerance = self.tolerance + of_chord * points.chord
            fit = fitted_surface(points.uv, points.Q, points.inside, points.weight, tolerance, first_poles, most_poles)
            if not fit.starved:
                break
            first_poles = fit.size
        lower, upper = fit.patch.coordinates(3, 6), fit.patch.coordinates(0, 3)
        mean = SplinePatch(upper.u, upper.v, (upper.poles + lower.poles) / 2)
        return SkinChart(points.origin, points.axes, upper, lower, mean, tolerance, points.steepest, fit.off)
