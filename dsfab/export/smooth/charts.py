"""Both skins over each chart: spline surfaces through V + D and V - D, fitted over the plane that sees the chart."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.smooth.source import Curved
from dsfab.export.smooth.splines import Patch, patch_through
from dsfab.surface.mesh import Surface
from dsfab.units import MM_PER_M

MOST_POLES = 48
"""Poles of a skin in the longer direction; a chart that asks for more is divided."""

SMOOTHING = 1e-5
"""Weight of the differences of poles against the distances from the points."""

OUTSIDE, BOUNDARY = 0.2, 0.5
"""Weights of the points around a chart, which hold the skins where seams are drawn, and of those on the boundary, whose
normals lean to one side. The tolerance is not asked of either."""
FOLDED = 0.01
"""Share of a chart's faces that may look away: finer meshes of coarse ones fold at a corner of their boundary now and
then. The distance of the fit from all points is asked for in any case."""

USELESS = 3
"""A chart that is off by so many tolerances is not worth asking OCCT about. One that is off by less may be, since the
solid is measured in the end, and few of its pieces are where the chart is worst."""

DIVISIONS = 2
"""Coarse meshes are divided so often for the fit, by points on cubics between the vertices: charts then agree at seams.
Nothing is known between the vertices of a coarse mesh, but two skins must say the same there."""

OF_CHORD = 0.3
"""Share of the mesh's own chord error that counts to the tolerance: between its vertices it says no more."""


@dataclass(frozen=True, eq=False)
class Chart:
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


def charts_of(surface: Surface, curved: Curved, fields: Floats, tolerance: float) -> list[Chart]:
    """A chart for each field; raises ExportError where no spline surface comes near `tolerance` millimetres."""
    D = curved.D
    for _ in range(DIVISIONS):
        chord, ends = float(np.percentile(_sags(surface), 90)), surface.edges.ends
        if MM_PER_M * chord <= tolerance:
            break
        surface = _finer(surface)
        D, fields = (np.concatenate([x, x[ends].mean(axis=1)]) for x in (D, fields))
    best = fields.argmax(axis=1)
    D, V = MM_PER_M * _upright(surface, D), MM_PER_M * surface.V
    middle = V + curved.shift * D
    made = []
    for k in range(fields.shape[1]):
        touched = (best[surface.F] == k).any(axis=1)
        chart = _chart(surface, V, middle, D, touched, tolerance)
        if chart.off > USELESS * chart.tolerance:
            raise ExportError(
                f"no spline surface follows chart {k + 1} of {fields.shape[1]} of the sheet "
                f"within {chart.tolerance:.2g} mm ({chart.off:.2g} mm)"
            )
        made.append(chart)
    return made


def excess(surface: Surface) -> float:
    """By what share a smooth surface through the vertices is larger than its triangles: their volume is less by that.

    Area goes with the square of the edges, so when each triangle is divided in four a third of the difference is left.
    """
    return max(_finer(surface).area / surface.area - 1, 0.0) * 4 / 3


def _normals(surface: Surface) -> Floats:
    """Of the vertices: the means of their faces', weighted with the angles there."""
    return np.asarray(igl.per_vertex_normals(surface.V, surface.F, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE))


def chord_errors(surface: Surface) -> Floats:
    """(n,) how far the triangles around each vertex lie below the smooth surface through their corners, metres.

    In their middles, where it is a third more than in the middles of their edges: h^2 / 6R and h^2 / 8R of triangles
    with three edges h on a sphere with radius R.
    """
    found = np.zeros(surface.n)
    for ends in surface.edges.ends.T:
        np.maximum.at(found, ends, 4 / 3 * _sags(surface))
    return found


def _sags(surface: Surface) -> Floats:
    """How far edges lie below the smooth surface, at their middles."""
    ends = surface.edges.ends
    away = _between(surface.V, _normals(surface), ends) - surface.V[ends].mean(axis=1)
    return np.asarray(np.linalg.norm(away, axis=1))


def _finer(surface: Surface) -> Surface:
    """Each triangle in four, with points on cubics half way along the edges after the other points."""
    V, n, ends = surface.V, surface.n, surface.edges.ends
    M = np.concatenate([V, _between(V, _normals(surface), ends)])
    a, b, c = surface.F.T
    key = ends.min(axis=1) * n + ends.max(axis=1)
    order = np.argsort(key)
    ab, bc, ca = (
        n + order[np.searchsorted(key[order], np.minimum(p, q) * n + np.maximum(p, q))]
        for p, q in ((a, b), (b, c), (c, a))
    )
    four = np.concatenate(
        [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    )
    return Surface(M, four)


def _upright(surface: Surface, D: Floats) -> Floats:
    """Vectors to the same skins along the mean normals of the vertices, weighted with the angles of their faces.

    Those that a face sees best lean a little this way and that: on a skin that is its vertices' noise, not its shape.
    """
    N = _normals(surface)
    N = N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)
    return np.asarray(N * np.einsum("ni,ni->n", N, D)[:, None])


def _chart(surface: Surface, V: Floats, middle: Floats, D: Floats, faces: Bools, tolerance: float) -> Chart:
    F = surface.F
    core = _marked(F, faces, len(V))
    near = _marked(F, np.asarray(core[F].any(axis=1)), len(V))
    around = near[F].any(axis=1)
    axes = _axes(V, surface.areas[:, None] * surface.normals, faces, core)
    steepest = float(np.quantile(surface.normals[faces] @ axes[2], FOLDED))
    if steepest <= 0:
        raise ExportError("the sheet bends too sharply for charts")
    ring = around & (surface.normals @ axes[2] > 0.5 * steepest)
    used = np.unique(F[ring])
    local = np.full(len(V), -1)
    local[used] = np.arange(len(used))
    ends = np.unique(np.sort(local[F[ring]][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    origin = V[used].mean(axis=0)
    P, d = middle[used], D[used]
    between = _between(P, d, ends)
    chord = np.linalg.norm(between - P[ends].mean(axis=1), axis=1)
    tolerance += OF_CHORD * float(np.percentile(chord, 90))
    P, d = np.concatenate([P, between]), np.concatenate([d, d[ends].mean(axis=1)])
    at_vertices = (V[used] - origin) @ axes[:2].T
    uv = np.concatenate([at_vertices, (P[len(used) :] - origin) @ axes[:2].T])
    trusted = core & ~_marked(surface.edges.ends, surface.edges.boundary, len(V))
    mine, inside = (np.concatenate([x[used], x[used][ends].all(axis=1)]) for x in (core, trusted))
    weight = np.where(inside, 1.0, np.where(mine, BOUNDARY, OUTSIDE))
    patch, off = _fitted(uv, np.concatenate([P + d, P - d], axis=1), inside, weight, tolerance)
    lower, upper = patch.only(3, 6), patch.only(0, 3)
    mean = Patch(patch.u, patch.v, (upper.poles + lower.poles) / 2)
    return Chart(origin, axes, upper, lower, mean, tolerance, steepest, off)


def _marked(F: Ints, faces: Bools, n: int) -> Bools:
    """(n,) the corners of the marked faces."""
    marks = np.zeros(n, dtype=bool)
    marks[F[faces]] = True
    return marks


def _axes(V: Floats, vectors: Floats, faces: Bools, core: Bools) -> Floats:
    """(3, 3) right-handed: the longest direction in the plane, the one beside it, and the mean normal."""
    across = vectors[faces].sum(axis=0)
    across /= max(float(np.linalg.norm(across)), 1e-300)
    flat = V[core] - V[core].mean(axis=0)
    flat = flat - np.outer(flat @ across, across)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    along = along * np.sign(along[np.abs(along).argmax()])
    along = along - across * (along @ across)
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(across, along), across])


def _between(P: Floats, d: Floats, ends: Ints) -> Floats:
    """Points half way along edges, on the cubic whose ends are normal to d: fits then do not wave between vertices."""
    N = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
    chord = P[ends[:, 1]] - P[ends[:, 0]]
    slopes = [chord - N[e] * np.einsum("ki,ki->k", chord, N[e])[:, None] for e in ends.T]
    return np.asarray(P[ends].mean(axis=1) + (slopes[0] - slopes[1]) / 8)


def _fitted(uv: Floats, Q: Floats, inside: Bools, weight: Floats, tolerance: float) -> tuple[Patch, float]:
    """The surface with the fewest poles within the tolerance of what is inside; and its largest distance there."""
    extent = np.ptp(uv, axis=0)
    aspect = np.sqrt(np.clip(extent[0] / extent[1], 0.1, 10.0))
    n = 8.0
    while True:
        count = (int(np.clip(np.rint(n * aspect), 6, MOST_POLES)), int(np.clip(np.rint(n / aspect), 6, MOST_POLES)))
        patch = patch_through(uv, Q, weight, count, SMOOTHING)
        found = patch(uv[inside]) - Q[inside]
        off = float(np.linalg.norm(found.reshape(-1, 2, 3), axis=2).max())
        if off <= tolerance or n >= MOST_POLES or count[0] * count[1] > 0.6 * len(uv):
            return patch, off
        n *= 1.25
