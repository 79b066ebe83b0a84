"""Regions without four sides: one Bezier surface over their mean plane, trimmed by their edges, with a measured gap."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import lstsq
from scipy.special import comb

from dsfab.arrays import Bools, Floats
from dsfab.errors import ExportError
from dsfab.export.network.graph import Loop
from dsfab.export.network.model import NetModel
from dsfab.export.splines import bernstein

DEGREES = (3, 4, 5, 6, 7, 8, 9)
"""Tried in this order until the gap is as narrow as wanted."""

BOUNDARY = (100.0, 10.0)
"""Weights of points of the edges, against 1 of points inside. With 30, one cut of eight through the vault missed its
volume by 1.1e-5; without points inside, faces bulged by a hundred millimetres. The second where the first does not
close the gap: in the bill of a duck of 1 m the gap stays .2 mm, and the inside is .4 mm off instead of 2.8."""

SMOOTH = 1e-2
"""Weight of second differences of poles, which hold what no point does."""

EDGE_SAMPLES = np.linspace(0, 1, 9)

SEEN = 0.35
"""Least cosine between the mean plane's normal and those of a region."""


@dataclass(frozen=True, eq=False)
class TrimmedFace:
    """A region's faces: loops of edges, the outer one first; poles (p + 1, p + 1, 3) of both surfaces, millimetres;
    gap : widest between them and the edges.    off : largest distance from points inside, along the mean normal."""

    loops: list[Loop]
    outer: Floats
    inner: Floats
    gap: float
    off: float


def trimmed_face(model: NetModel, loops: list[Loop], points: Floats, wanted: float, part: bool = False) -> TrimmedFace:
    """The faces of a region with points (k, 6) inside; raises ExportError where no plane sees it as one outline.

    part : whether the points are those of a larger region that it was cut off from, which may bend away.
    """
    lines = [_samples(model, loop) for loop in loops]
    edges = np.concatenate(lines)
    if part:
        points = points[_surrounded(points, lines)]
    allowed = np.concatenate([points, edges])
    mean = middle_normal(allowed)
    if (_across(allowed) @ mean).min() < SEEN:
        raise ExportError("a region without four sides bends too much for one surface")
    axes = axes_of(mean)
    area = [signed_area(line[:, :3] @ axes[:2].T) for line in lines]
    order = sorted(range(len(loops)), key=lambda i: -area[i])
    if sum(a > 0 for a in area) != 1:
        raise ExportError("a region without four sides has no single outline")
    surfaces = [_surface(points[:, s : s + 3], edges[:, s : s + 3], axes, wanted) for s in (0, 3)]
    (outer, *one), (inner, *two) = surfaces
    return TrimmedFace([loops[i] for i in order], outer, inner, *np.maximum(one, two).tolist())


def _surrounded(points: Floats, lines: list[Floats]) -> Bools:
    """(k,) which points (k, 6) closed lines (., 6) go around, on the side of the sheet where these are."""
    mean = middle_normal(np.concatenate(lines))
    x, y = axes_of(mean)[:2] @ points[:, :3].T
    found = np.zeros(len(points), dtype=bool)
    for line in lines:
        a = line[:, :3] @ axes_of(mean)[:2].T
        for (ax, ay), (bx, by) in zip(a, np.roll(a, -1, axis=0), strict=True):
            found ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay if by != ay else 1.0))
    return np.asarray(found & (_across(points) @ mean > SEEN))


def _samples(model: NetModel, loop: Loop) -> Floats:
    """(k, 6) points along a loop."""
    B = bernstein(EDGE_SAMPLES[:-1])
    return np.concatenate([B @ model.edges[e].poles[:: 1 if ahead else -1] for e, ahead in loop])


def _across(points: Floats) -> Floats:
    """(k, 3) unit vectors from the inner skin to the outer at points (k, 6)."""
    way = points[:, :3] - points[:, 3:]
    return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


def middle_normal(points: Floats) -> Floats:
    """(3,) of both skins, over points (k, 6) of them."""
    mean = _across(points).mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def axes_of(normal: Floats) -> Floats:
    """(3, 3) right-handed, the normal last."""
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(normal, along), normal])


def signed_area(P: Floats) -> float:
    """Of a closed line in the plane (k, 2), positive counter-clockwise."""
    x, y = P.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _surface(points: Floats, edges: Floats, axes: Floats, wanted: float) -> tuple[Floats, float, float]:
    """Poles of the surface nearest to points inside and, more so, on the edges; how far the latter and the former are
    off.

    Where none closes the gap as wanted, high degrees wave between the points for next to nothing: that is taken which
    is least off both together.
    """
    origin = edges.mean(axis=0)
    inside, around = (points - origin) @ axes.T, (edges - origin) @ axes.T
    low, high = around[:, :2].min(axis=0) - 1, around[:, :2].max(axis=0) + 1
    inside = inside[((inside[:, :2] > low) & (inside[:, :2] < high)).all(axis=1)]
    both, fits = np.concatenate([inside, around]), list[tuple[Floats, float, float]]()
    for edge, degree in product(BOUNDARY, DEGREES):
        weight = np.repeat([1.0, edge], (len(inside), len(around)))
        fits.append(_heights((both[:, :2] - low) / (high - low), both[:, 2], weight, degree))
        if fits[-1][1] <= wanted:
            break
    z, gap, off = fits[-1] if fits[-1][1] <= wanted else min(fits, key=lambda fit: fit[1] + fit[2])
    x, y = (np.linspace(low[i], high[i], len(z)) for i in (0, 1))
    local = np.stack(np.broadcast_arrays(x[:, None], y[None], z), axis=2)
    return np.asarray(origin + local @ axes), gap, off


def _heights(uv: Floats, z: Floats, weight: Floats, degree: int) -> tuple[Floats, float, float]:
    """(degree + 1, degree + 1) poles of heights z (k,) over a square, and how far off they are at edges, whose weight
    is over 1, and inside."""
    A = np.einsum("ka,kb->kab", _powers(uv[:, 0], degree), _powers(uv[:, 1], degree)).reshape(len(uv), -1)
    stiff = SMOOTH * _differences(degree + 1)
    rows, right = np.concatenate([weight[:, None] * A, stiff]), np.append(weight * z, np.zeros(len(stiff)))
    poles = lstsq(rows, right, lapack_driver="gelsy", check_finite=False)[0]  # in half the time of numpy's
    off = np.abs(A @ poles - z)
    return poles.reshape(degree + 1, -1), float(off[weight > 1].max()), float(off[weight == 1].max(initial=0.0))


def _powers(x: Floats, degree: int) -> Floats:
    """(k, degree + 1) Bernstein polynomials at x (k,)."""
    i = np.arange(degree + 1)
    return np.asarray(comb(degree, i) * x[:, None] ** i * (1 - x[:, None]) ** (degree - i))


def _differences(count: int) -> Floats:
    """Second differences of a square of poles, along both directions."""
    second = np.diff(np.eye(count), n=2, axis=0)
    return np.concatenate([np.kron(second, np.eye(count)), np.kron(np.eye(count), second)])
