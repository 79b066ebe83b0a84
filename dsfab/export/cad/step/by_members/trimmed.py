"""Trimmed faces for regions without four sides: Bezier surfaces over a mean plane."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import lstsq

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members.model import NetModel
from dsfab.export.cad.step.by_members.patches import (
    FaceLimits,
    differences,
    height_rows,
    largest_excess,
    places,
    points_inside,
    raised_poles,
)
from dsfab.export.cad.step.by_members.regions import ChainLoop
from dsfab.export.splines import bernstein, polyline_length


@dataclass(frozen=True, eq=False)
class FaceDomain:
    """Parallelogram in a plane around the edges of a face. axes : (3, 3) two axes of the plane, and its normal.
    origin : (3,) point of the plane.    sides : (2, 2) directions of the sides.    low, high : (2,) extent along sides.
    uv, z  : (k, 2) parameters and (k,) heights of points, inner points first.    inside : number of inner points."""

    origin: Floats
    axes: Floats
    sides: Floats
    low: Floats
    high: Floats
    uv: Floats
    z: Floats
    inside: int

    @classmethod
    def from_edges(cls, points: Floats, edges: Floats, axes: Floats, sides: Floats) -> "FaceDomain":
        """Return the parallelogram around edge points (j, 3), and drop inner points (k, 3) outside of it."""
        origin, across = edges.mean(axis=0), np.linalg.inv(sides)
        inside, around = (points - origin) @ axes.T, (edges - origin) @ axes.T
        inner_places, ends = inside[:, :2] @ across, around[:, :2] @ across
        low, high = ends.min(axis=0) - 1, ends.max(axis=0) + 1
        within = ((inner_places > low) & (inner_places < high)).all(axis=1)
        uv = (np.concatenate([inner_places[within], ends]) - low) / (high - low)
        z = np.concatenate([inside[within, 2], around[:, 2]])
        return cls(origin, axes, sides, low, high, uv, z, int(within.sum()))

    def poles_at(self, z: Floats) -> Floats:
        """Return a grid of poles (p + 1, p + 1, 3) over the parallelogram at heights z (p + 1, p + 1)."""
        u, v = (np.linspace(self.low[i], self.high[i], len(z)) for i in (0, 1))
        plane = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=2) @ self.sides
        return np.asarray(self.origin + np.concatenate([plane, z[..., None]], axis=2) @ self.axes)

    def least_beyond(self, ways: Floats, box: Floats) -> Floats:
        """Choose two of the directions `ways` (k, 2) for the sides of the parallelogram, in right-handed order.
        With these sides, the surface's corners have the smallest distance outside of `box` (2, 3)."""
        least_sine = 1 / 4  # least sine of the angle between two sides; at smaller angles, bent surfaces have folds
        places_in_plane = (self.low + self.uv * (self.high - self.low)) @ self.sides
        heights = lstsq(_quadric(places_in_plane), self.z, check_finite=False)[0]
        long = np.linalg.norm(ways, axis=1)[:, None]
        ways = ways[long[:, 0] > 0] / long[long > 0][:, None]  # a closed edge has no chord
        turned = np.stack([-ways[:, 1], ways[:, 0]])
        leftwards = places_in_plane @ turned
        ends = np.stack([leftwards.min(axis=0), leftwards.max(axis=0)])  # (2, k) limits across each direction
        i, j = np.triu_indices(len(ways), 1)
        sine = (ways @ turned)[j, i]
        i, j = np.where(sine > 0, (i, j), (j, i))  # right-handed axes make the surface face outwards
        i, j, sine = (x[np.abs(sine) >= least_sine] for x in (i, j, np.abs(sine)))
        if not len(i):
            return self.sides
        along = ways[i] * (-ends[::-1, j] / sine)[..., None]  # (2, pairs, 2)
        corners = along[:, None] + ways[j] * (ends[:, i] / sine)[..., None]
        z = _quadric(corners.reshape(-1, 2)) @ heights
        placed = np.concatenate([corners.reshape(-1, 2), z[:, None]], axis=1) @ self.axes + self.origin
        out = _outside(placed, box).reshape(4, len(i), 3).max(axis=(0, 2), initial=0.0)
        best_pair = int(out.argmin())
        return ways[[i[best_pair], j[best_pair]]]


def _quadric(plane_points: Floats) -> Floats:
    x, y = plane_points.T
    return np.stack([np.ones(len(plane_points)), x, y, x * x, x * y, y * y], axis=1)


def distance_outside(points: Floats, box: Floats) -> float:
    """Return the largest distance of points (..., 3) outside of a box (2, 3)."""
    return float(_outside(points, box).max(initial=0.0))


def _outside(points: Floats, box: Floats) -> Floats:
    return np.asarray(np.maximum(box[0] - points, points - box[1]))


SPLIT = 0.045
"""Widest gap (mm) between a face and its edge where OCCT can cut the edge, measured at 23 points of the edge.
OCCT measures each part of a cut edge at 23 new points, and allows gaps up to 0.05 mm (`BOPAlgo_Builder::PostTreat`)."""

EDGE_WEIGHTS = (100.0, 10.0)
"""Weights of edge points in trial fits of a face. Inner points have weight 1. Last trials use the smaller weight."""

SMOOTH_WEIGHTS = (1e-1, 1e-2)
"""Weights of second differences of pole movements in trial fits. Later trials use the smaller weight."""

BASE_DEGREE = 2  # degree of the surface to which corrections of higher degree are added

USUAL_TRIALS = tuple((EDGE_WEIGHTS[0], SMOOTH_WEIGHTS[0], degree) for degree in (2, 3, 4, 5, 6, 7, 8, 9))
"""Trial fits of a face: weight of edges, weight of second differences, degree. The first fit within limits is used."""

FURTHER_TRIALS = (
    *((EDGE_WEIGHTS[0], SMOOTH_WEIGHTS[1], degree) for degree in (7, 9, 11, 13, 15)),
    *((EDGE_WEIGHTS[1], SMOOTH_WEIGHTS[1], degree) for degree in (3, 4, 5, 6, 7, 8, 9)),
)
"""Trial fits after `USUAL_TRIALS`, until the gap of one fit is below `SPLIT`."""

TURNED = np.array([[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in np.radians(np.arange(0, 90, 5))])
"""Axes (t, 2, 2) of rectangles around a region. The rectangle with the smallest area is used."""

HELD_PLACES = (1 - np.cos(np.pi * np.arange(6) / 5)) / 2
"""Parameters of an edge at the points that a fitted surface contains. Elsewhere, distances are below 5e-8 mm."""

LEAST_NORMAL_COSINE = 0.35  # smallest cosine between mean normal and normals of a region


@dataclass(frozen=True, eq=False)
class TrimmedFace:
    """Faces of a region, one on each skin of the sheet.
    loops : loops of edges, the outer loop first.    outer, inner : poles (p + 1, p + 1, 3), mm.
    axes  : (3, 3) for each surface: two axes of the plane, and the direction of heights.
    gap   : widest gap at the edges, mm.    off : largest distance of inner points from the surfaces, mm.
    exact : True if edges lie on the surfaces.    astray : distance from the mesh minus its limit, mm, or -inf."""

    loops: list[ChainLoop]
    outer: Floats
    inner: Floats
    axes: tuple[Floats, Floats]
    gap: float
    off: float
    exact: bool = False
    astray: float = -np.inf

    @property
    def skins(self) -> tuple[tuple[Floats, Floats, slice], ...]:
        """For each skin: the surface's poles and axes, and the columns of this skin in points (k, 6)."""
        return (self.outer, self.axes[0], slice(3)), (self.inner, self.axes[1], slice(3, 6))

    def gaps(self, points: Floats) -> Floats:
        """Return heights (k, 2), mm, of points (k, 6) on edges above the outer and inner surface."""
        return np.stack([_heights_over(poles, axes, points[:, s]) for poles, axes, s in self.skins], axis=1)


def trimmed_face(
    model: NetModel, loops: list[ChainLoop], points: Floats, limits: FaceLimits, part: bool = False
) -> TrimmedFace:
    """Return the trimmed face of a region, with a surface on each skin. Raises ExportError if one surface cannot fit.
    points : (k, 6) inner points on both skins, mm.    part : True if some points may be outside of the region."""
    lines = [loop_samples(model, loop) for loop in loops]
    edges = np.concatenate(lines)
    if part:
        points = points[inside_outlines(points, lines)]
    allowed = np.concatenate([points, edges])
    mean = middle_normal(allowed)
    if (_skin_normals(allowed) @ mean).min() < LEAST_NORMAL_COSINE:
        raise ExportError("a region of the sheet bends too much for a single spline surface")
    axes = axes_of(mean)
    area = [signed_area(line[:, :3] @ axes[:2].T) for line in lines]
    order = sorted(range(len(loops)), key=lambda i: -area[i])
    if sum(a > 0 for a in area) != 1:
        raise ExportError("a region of the sheet does not have exactly one outer outline")
    ways = np.stack([P[3] - P[0] for loop in loops for P in map(model.poles, loop)])
    surfaces = [height_surface(points[s], edges[s], ways[s], axes, limits) for s in (np.s_[:, :3], np.s_[:, 3:])]
    (outer, A, *outer_distances), (inner, B, *inner_distances) = surfaces
    gap, distance = np.maximum(outer_distances, inner_distances).tolist()
    astray = largest_excess(((outer, A), (inner, B)), [np.split(x, 2, axis=1) for x in lines], limits.beyond_mesh)
    return TrimmedFace([loops[i] for i in order], outer, inner, (A, B), gap, distance, astray=astray)


def inside_outlines(points: Floats, lines: list[Floats]) -> Bools:
    """Return a mask (k,) that is True for points (k, 6) of the sheet inside closed lines (., 6)."""
    mean = middle_normal(np.concatenate(lines))
    plane = axes_of(mean)[:2].T
    is_inside = points_inside(points[:, :3] @ plane, [line[:, :3] @ plane for line in lines])
    return np.asarray(is_inside & (_skin_normals(points) @ mean > LEAST_NORMAL_COSINE))


def inside_of(line: Floats) -> Floats:
    """Return sample points (k, d) inside an outline (n, d)."""
    shares, middle = np.array([0.3, 0.5, 0.7, 0.85, 0.95]), line.mean(axis=0)  # fractions from middle to outline
    return np.asarray((middle + shares[:, None, None] * (line - middle)).reshape(-1, line.shape[1]))


def loop_samples(model: NetModel, loop: ChainLoop) -> Floats:
    """Return points (k, 6) on both skins along a loop of edges, mm."""
    fewest, step_share = 12, 1 / 160  # fewest steps along an edge; usual step, as a fraction of the loop's length
    poles = [model.poles(step) for step in loop]
    long = np.array([polyline_length(P[:, :3]) for P in poles])
    steps = np.maximum(fewest, np.ceil(long / (step_share * max(long.sum(), 1e-300)))).astype(int)
    return np.concatenate([_sample_matrix(n) @ P for n, P in zip(steps.tolist(), poles, strict=True)])


@cache
def _sample_matrix(n: int) -> Floats:
    return bernstein((1 - np.cos(np.pi * np.arange(n) / n)) / 2)


def _skin_normals(points: Floats) -> Floats:
    vectors = points[:, :3] - points[:, 3:]
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def middle_normal(points: Floats) -> Floats:
    """Return the mean normal (3,) of the sheet at points (k, 6) on both skins."""
    mean = _skin_normals(points).mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def axes_of(normal: Floats) -> Floats:
    """Return right-handed orthogonal unit axes (3, 3); the last axis is `normal`."""
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(normal, along), normal])


def signed_area(P: Floats) -> float:
    """Return the area inside a closed line (k, 2); positive if the line is counter-clockwise."""
    x, y = P.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def height_surface(
    points: Floats, edges: Floats, ways: Floats, axes: Floats, limits: FaceLimits
) -> tuple[Floats, Floats, float, float]:
    """Fit a surface to inner points (k, 3) and edge points (j, 3).
    Return the surface's poles and axes, and its largest distances (mm) from edge points and from inner points."""
    axes = _along_smallest_rectangle(edges - edges.mean(axis=0), axes)
    over = FaceDomain.from_edges(points, edges, axes, np.eye(2))
    poles, gap, inner_distance = _fit_domain(over, limits)
    if (out := distance_outside(poles, limits.box)) > 0:
        skew = over.least_beyond(ways @ axes[:2].T, limits.box)
        skew_fit = _fit_domain(FaceDomain.from_edges(points, edges, axes, skew), limits)
        is_close = skew_fit[1] <= max(gap, limits.gap) and skew_fit[2] <= max(inner_distance, limits.off)
        if is_close and distance_outside(skew_fit[0], limits.box) < out:
            poles, gap, inner_distance = skew_fit
    return poles, axes, gap, inner_distance


def _fit_domain(over: FaceDomain, limits: FaceLimits) -> tuple[Floats, float, float]:
    high = 2.0  # the degree rises if a pole is above or below all points by more than 2 * `limits.off`
    z, gap, inner_distance = _best(over, limits)
    if len(z) == BASE_DEGREE + 1 and max(z.max() - over.z.max(), over.z.min() - z.min()) > high * limits.off:
        z = raised_poles(z, BASE_DEGREE + 1)
    return over.poles_at(z), gap, inner_distance


def _heights_over(poles: Floats, axes: Floats, points: Floats) -> Floats:
    rows = height_rows(places(poles, axes, points), len(poles) - 1)
    return np.asarray(points @ axes[2] - rows @ (poles @ axes[2]).ravel())


def misfit(points: Floats, line: Floats, degree: int) -> Floats:
    """Return the distances (k,), mm, of a closed line (k, 6) from surfaces fitted to the skins; inf without a fit.
    points : (j, 6) inner points."""
    return np.maximum(*misfits(points, line, degree))


def misfits(points: Floats, line: Floats, degree: int) -> Iterator[Floats]:
    """Yield the distances (k,) of a line from the surface fitted to the outer skin, then to the inner skin, mm."""
    points = points[inside_outlines(points, [line])]
    allowed = np.concatenate([points, line])
    mean = middle_normal(allowed)
    axes = axes_of(mean)
    seen = (_skin_normals(allowed) @ mean).min() >= LEAST_NORMAL_COSINE and signed_area(line[:, :3] @ axes[:2].T) > 0
    for s in (0, 3):
        yield _misfit(points[:, s : s + 3], line[:, s : s + 3], axes, degree) if seen else np.full(len(line), np.inf)


def _misfit(points: Floats, line: Floats, axes: Floats, degree: int) -> Floats:
    axes = _along_smallest_rectangle(line - line.mean(axis=0), axes)
    over = FaceDomain.from_edges(points, line, axes, np.eye(2))
    A, weight = height_rows(over.uv, degree), np.repeat([1.0, EDGE_WEIGHTS[0]], [over.inside, len(line)])
    poles = _heights(A, over.z, weight, SMOOTH_WEIGHTS[0], raised_poles(_base_poles(over), degree))
    return np.asarray(np.abs(A @ poles.ravel() - over.z)[over.inside :])


def _along_smallest_rectangle(line: Floats, axes: Floats) -> Floats:
    least_gain = 3 / 4  # axes rotate only if the area of the new rectangle is below this fraction of the old area
    turned = TURNED @ axes[:2]
    area = np.ptp(line @ turned.transpose(0, 2, 1), axis=1).prod(axis=1)
    smallest = int(np.argmin(area))
    return np.concatenate([turned[smallest], axes[2:]]) if area[smallest] < least_gain * area[0] else axes


def _base_poles(over: FaceDomain) -> Floats:
    rows, none = height_rows(over.uv, BASE_DEGREE), np.zeros((BASE_DEGREE + 1, BASE_DEGREE + 1))
    return _heights(rows, over.z, np.ones(len(over.z)), SMOOTH_WEIGHTS[1], none)


def _best(over: FaceDomain, limits: FaceLimits) -> tuple[Floats, float, float]:
    z, inside, base = over.z, over.inside, _base_poles(over)
    fits, splittable = list[tuple[Floats, float, float]](), list[tuple[Floats, float, float]]()
    for i, (edge, smooth, degree) in enumerate((*USUAL_TRIALS, *FURTHER_TRIALS)):
        if splittable and i >= len(USUAL_TRIALS):
            break
        A = height_rows(over.uv, degree)
        poles = _heights(A, z, np.repeat([1.0, edge], (inside, len(z) - inside)), smooth, raised_poles(base, degree))
        residuals = np.abs(A @ poles.ravel() - z)
        fits.append((poles, float(residuals[inside:].max()), float(residuals[:inside].max(initial=0.0))))
        if fits[-1][2] <= limits.off and fits[-1][1] <= SPLIT:
            splittable.append(fits[-1])
            if fits[-1][1] <= limits.gap:
                return fits[-1]
    return min(splittable, key=lambda fit: fit[2]) if splittable else min(fits, key=lambda fit: fit[1] + fit[2])


def _heights(A: Floats, z: Floats, weight: Floats, smooth: float, base: Floats) -> Floats:
    rows = np.concatenate([weight[:, None] * A, smooth * differences(len(base))])
    right = np.zeros(len(rows))
    right[: len(z)] = weight * (z - A @ base.ravel())
    correction = lstsq(rows, right, lapack_driver="gelsy", check_finite=False)[0]  # scipy takes half of numpy's time
    return np.asarray(base + correction.reshape(base.shape))
