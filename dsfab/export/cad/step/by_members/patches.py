"""Bezier patches of four-sided regions (Coons patches), surfaces as heights over a plane, and limits of faces."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from scipy.special import comb

from dsfab.core.arrays import Bools, Floats, cross
from dsfab.export.cad.step.by_members.curves import InnerSpline, patches_as_parabolas
from dsfab.export.splines import bernstein


def places(poles: Floats, axes: Floats, points: Floats) -> Floats:
    """Project points (k, 3) onto a surface along `axes[2]`, and return the surface's parameters (k, 2) there.
    poles : (p + 1, p + 1, 3); seen along `axes[2]`, they are a regular grid in a parallelogram."""
    (a, b), (c, _) = poles[:: len(poles) - 1, :: len(poles) - 1] @ axes[:2].T
    return np.asarray(np.linalg.solve(np.stack([c - a, b - a], axis=1), (points @ axes[:2].T - a).T).T)


def height_rows(uv: Floats, degree: int) -> Floats:
    """Return the weights (k, (degree + 1)^2) of a Bezier surface's poles at parameters uv (k, 2) between 0 and 1."""
    products = np.einsum("ka,kb->kab", _powers(uv[:, 0], degree), _powers(uv[:, 1], degree))
    return np.asarray(products.reshape(len(uv), -1))


def rows_at(uv: Floats) -> Callable[[int], Floats]:
    """Return the function `degree -> height_rows(uv, degree)` with a cache. uv : (k, 2) parameters."""
    return cache(partial(height_rows, uv))


def raised_poles(poles: Floats, degree: int) -> Floats:
    """Return the poles (degree + 1, degree + 1) that describe the same Bezier surface with a higher degree."""
    while (n := len(poles)) <= degree:
        poles = _degree_matrix(n) @ poles @ _degree_matrix(n).T
    return poles


@cache
def _degree_matrix(n: int) -> Floats:
    share = np.arange(n + 1)[:, None] / n
    return np.asarray(share * np.eye(n + 1, n, -1) + (1 - share) * np.eye(n + 1, n))


def _powers(x: Floats, degree: int) -> Floats:
    i = np.arange(degree + 1)
    return np.asarray(_binomials(degree) * x[:, None] ** i * (1 - x[:, None]) ** (degree - i))


@cache
def _binomials(degree: int) -> Floats:
    return np.asarray(comb(degree, np.arange(degree + 1)))


@cache
def differences(count: int) -> Floats:
    """Return the matrix (2 (k - 2) k, k^2) that maps poles (k, k) to their second differences; k is `count`."""
    second = np.diff(np.eye(count), n=2, axis=0)
    return np.concatenate([np.kron(second, np.eye(count)), np.kron(np.eye(count), second)])


PLACES = (np.stack(np.meshgrid(*[np.arange(24)] * 2, indexing="ij"), axis=2).reshape(-1, 2) + 0.5) / 24
"""Sample parameters (k, 2) of a surface, in a 24 x 24 grid. A 12 x 12 grid can miss a bulge in a corner."""

ROWS = rows_at(PLACES)


@dataclass(frozen=True, eq=False)
class FaceLimits:
    """Limits of faces, millimetres. gap : largest gap between trimmed faces and their edges.
    off : largest distance of a face from points inside its region.    box : (2, 3) box that must contain all poles.
    beyond_mesh : function of points (k, 3); returns distance from the mesh minus limit (k,). None: no limit."""

    gap: float
    off: float
    box: Floats
    beyond_mesh: Callable[[Floats], Floats] | None = None


def largest_excess(
    surfaces: Sequence[tuple[Floats, Floats]],
    lines: Sequence[Sequence[Floats]],
    beyond_mesh: Callable[[Floats], Floats] | None,
) -> float:
    """Return the largest value of `beyond_mesh` (mm) at sample points of surfaces; -inf if `beyond_mesh` is None.
    surfaces : poles and axes of each surface.    lines : for each outline, points (., 3) on each surface."""
    if beyond_mesh is None:
        return -np.inf
    inside = [places_inside(*skin, outlines) for skin, outlines in zip(surfaces, zip(*lines, strict=True), strict=True)]
    return float(beyond_mesh(np.concatenate(inside)).max(initial=-np.inf))


def places_inside(poles: Floats, axes: Floats, lines: Sequence[Floats]) -> Floats:
    """Return the sample points (k, 3) of a surface that are inside closed lines (., 3), seen along `axes[2]`."""
    points = ROWS(len(poles) - 1) @ poles.reshape(-1, 3)
    return np.asarray(points[points_inside(points @ axes[:2].T, [line @ axes[:2].T for line in lines])])


def points_inside(points: Floats, lines: Sequence[Floats]) -> Bools:
    """Return a mask (k,) that is True for points (k, 2) inside an odd number of closed lines (., 2)."""
    x, y = points.T
    is_inside = np.zeros(len(points), dtype=bool)
    for line in lines:
        (ax, ay), (bx, by) = line.T, np.roll(line, -1, axis=0).T
        slope = (bx - ax) / np.where(by != ay, by - ay, 1.0)
        above = ay > y[:, None]
        # only segments that cross the horizontal line through a point need the exact test
        i, j = np.nonzero(above != np.roll(above, -1, axis=1))
        is_left = x[i] < ax[j] + (y[i] - ay[j]) * slope[j]
        is_inside ^= np.bincount(i[is_left], minlength=len(points)) % 2 == 1
    return is_inside


def coons(bottom_poles: Floats, right_poles: Floats, top_poles: Floats, left_poles: Floats) -> Floats:
    """Return the poles (ku, kv, 4, 4, d) of Coons patches inside a region with four sides.
    bottom_poles, top_poles : (ku, 4, d) from left to right.    left_poles, right_poles : (kv, 4, d) upwards."""
    b, t = bottom_poles[:, None, :, None, :], top_poles[:, None, :, None, :]
    lt, rt = left_poles[None, :, None, :, :], right_poles[None, :, None, :, :]
    u = _shares(bottom_poles, top_poles)[:, None, :, None, None]
    v = _shares(left_poles, right_poles)[None, :, None, :, None]
    a, c, e, f = bottom_poles[0, 0], bottom_poles[-1, -1], top_poles[0, 0], top_poles[-1, -1]
    corners = (1 - u) * (1 - v) * a + u * (1 - v) * c + (1 - u) * v * e + u * v * f
    P: Floats = np.asarray((1 - v) * b + v * t + (1 - u) * lt + u * rt - corners)
    P[:, 0, :, 0], P[:, -1, :, -1] = bottom_poles, top_poles
    P[0, :, 0], P[-1, :, -1] = left_poles, right_poles
    return P


def patches_on_skins(grids: Sequence[Floats], vectors_to_skins: Callable[[Floats], Floats]) -> list[Floats]:
    """Move the inner poles of each region's patches (ku, kv, 4, 4, d), so that the patches lie on the skins.
    vectors_to_skins : function of points (k, d); returns the vectors to the skins."""
    sides = [((P[:, 0, :, 0], P[:, -1, :, -1]), (P[0, :, 0], P[-1, :, -1])) for P in grids]
    splines = [[InnerSpline.from_breaks(_break_shares(*pair)) for pair in pairs] for pairs in sides]
    place_points = list[Floats]()
    for P, (u, v) in zip(grids, splines, strict=True):
        along = np.tensordot(u.hats, P, axes=([1, 2], [0, 2]))
        place_points.append(np.tensordot(v.hats, along, axes=([1, 2], [1, 2])))
    all_vectors = vectors_to_skins(np.concatenate([points.reshape(-1, points.shape[2]) for points in place_points]))
    ends = np.cumsum([points.shape[0] * points.shape[1] for points in place_points])
    result = list[Floats]()
    for P, (u, v), points, vectors in zip(grids, splines, place_points, np.split(all_vectors, ends[:-1]), strict=True):
        along = np.tensordot(u.poles, vectors.reshape(points.shape), axes=([2], [1]))
        result.append(P + np.tensordot(v.poles, along, axes=([2], [2])).transpose(2, 0, 3, 1, 4))
    return result


def _shares(side: Floats, opposite: Floats) -> Floats:
    break_shares = _break_shares(side, opposite)
    return np.asarray(break_shares[:-1, None] + np.diff(break_shares)[:, None] * np.arange(4) / 3)


def _break_shares(side_spans: Floats, opposite_spans: Floats) -> Floats:
    shares = np.zeros(len(side_spans) + 1)
    for side in (side_spans, opposite_spans):
        long = np.cumsum(np.linalg.norm(side[:, -1, :3] - side[:, 0, :3], axis=1))
        shares[1:] += long / long[-1] / 2
    return shares


def least_jacobian(P: Floats) -> float:
    """Return the lowest ratio of a patch's smallest Jacobian to its largest Jacobian. P : (..., 4, 4, 3) poles."""
    P, x = P.reshape(-1, 4, 4, 3), np.linspace(0, 1, 5)
    B, C = bernstein(x), np.stack([(1 - x) ** 2, 2 * x * (1 - x), x**2], axis=1)
    du = np.einsum("xa,yb,kabi->kxyi", C, B, np.diff(P, axis=1))
    dv = np.einsum("xa,yb,kabi->kxyi", B, C, np.diff(P, axis=2))
    N = cross(du.reshape(-1, 3), dv.reshape(-1, 3)).reshape(du.shape)
    along = np.einsum("kxyi,ki->kxy", N, N.mean(axis=(1, 2)))
    return float((along.min(axis=(1, 2)) / along.max(axis=(1, 2))).min())


class PatchBuilder:
    """Function that builds Bezier patches on the skins for four-sided regions.
    away   : function of rows (k, 6) of two points, one near each skin; returns the vectors (k, 6) to the skins."""

    def __init__(self, away: Callable[[Floats], Floats], limits: FaceLimits) -> None:
        self.away, self.limits = away, limits
        self.known = dict[int, tuple[list[bytes], Floats | None]]()

    def __call__(self, regions: Sequence[int], sides: Sequence[Sequence[Floats]]) -> list[Floats | None]:
        """Return the poles (ku, kv, 4, 4, 6) of each region's patches; None if patches are folded or exceed a limit.
        sides : poles of the bottom, right, top and left side of each region."""
        poles = [[side.tobytes() for side in four] for four in sides]
        changed = [i for i, region in enumerate(regions) if self.known.get(region, ((),))[0] != poles[i]]
        for i, P in zip(changed, self._build([sides[i] for i in changed]), strict=True):
            self.known[regions[i]] = poles[i], P
        return [self.known[region][1] for region in regions]

    def _build(self, sides: Sequence[Sequence[Floats]]) -> list[Floats | None]:
        if not sides:
            return []
        cubic = patches_on_skins([coons(*four) for four in sides], self.away)
        patches = [patches_as_parabolas(P, self.limits.off) for P in cubic]
        too_far = (stray_distances(patches, self.away) > self.limits.off) | (patch_excess(patches, self.limits) > 0)
        least_ratio = 0.1  # a patch with a smaller relative Jacobian counts as folded
        jacobians = (least_jacobian(np.concatenate([P[..., :3], P[..., 3:]])) for P in patches)
        rows = zip(patches, too_far, jacobians, strict=True)
        return [None if is_far or jacobian < least_ratio else P for P, is_far, jacobian in rows]


def stray_distances(patches: Sequence[Floats], away: Callable[[Floats], Floats]) -> Floats:
    """Return, for each of k regions, the largest distance (k,) of a patch's middle from the skins, mm."""
    half = bernstein(np.array([0.5]))[0]
    middles = [np.einsum("a,b,uvabi->uvi", half, half, P).reshape(-1, 6) for P in patches]
    distances = np.linalg.norm(away(np.concatenate(middles)).reshape(-1, 2, 3), axis=2).max(axis=1)
    return np.maximum.reduceat(distances, np.cumsum([0, *map(len, middles)])[:-1])


def patch_excess(patches: Sequence[Floats], limits: FaceLimits) -> Floats:
    """Return, for each of k regions, the largest distance of a patch from the mesh minus its limit (k,), mm.
    The values are -inf without a limit."""
    if not patches or limits.beyond_mesh is None:
        return np.full(len(patches), -np.inf)
    poles, B = [P.reshape(-1, 4, 4, 6) for P in patches], bernstein(np.linspace(0, 1, 7))
    points = np.einsum("xa,yb,kabi->kxyi", B, B, np.concatenate(poles))
    beyond = limits.beyond_mesh(points.reshape(-1, 3)).reshape(len(points), -1).max(axis=1)
    return np.maximum.reduceat(beyond, np.cumsum([0, *map(len, poles)])[:-1])
