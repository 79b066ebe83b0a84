"""Solids as implicit functions, their smooth unions, and even triangles on their surfaces."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, edge_lengths, group_sums, lengths
from dsfab.core.errors import SurfaceError
from dsfab.surface.edge_changes import (
    contracted,
    halved,
    has_new_diagonal,
    meets_link_condition,
    quads,
    winners,
    with_other_diagonals,
)
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import check_density
from dsfab.surface.topology import EdgeTable, edge_table, manifold_faults, on_boundary, smoothing_pairs

LONGEST, SHORTEST = 4 / 3, 4 / 5
"""Edges beyond these multiples of the wanted length are split or collapsed: halves and unions are not worse."""

ROUNDS, POLISH = 5, 10
"""Rounds that change the number of vertices, then rounds that only flip towards Delaunay and relax."""

BATCHES = 10
"""Collapses of one round are made in so many batches; what is left waits for the next round."""

TURN = 0.3
"""No face may turn by more than the angle of this cosine, about 70 degrees, in one step."""


FOLDED = -0.5
"""Neighbours whose normals have a smaller cosine, about 120 degrees, are a fold that no smooth surface has."""

GROWTH = 2
"""Splitting may double the faces of a mesh that was remeshed before; more never ends, for its edges span a gap."""


class MeshChart(Protocol):
    """A smooth surface on which vertices live, by coordinates X (n, k) of its own choice."""

    def place(self, X: Floats) -> Floats:
        """(n, 3) the points, metres."""
        ...

    def moved(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """(n, k) the coordinates of the points moved by about step (n, 3), metres; border stays on the border."""
        ...


def remeshed(chart: MeshChart, X: Floats, F: Ints, edge: float) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and faces of nearly equilateral triangles about `edge` metres wide, on the surface of `chart`.

    X, F : any oriented manifold mesh of it, in the chart's coordinates; its genus and its boundaries are kept.

    Raises SurfaceError when the result is no manifold, is folded, or never ends: the edge is longer than the surface's
    details.
    """
    for round_ in range(ROUNDS):
        before = len(F)
        X, F = _split(chart, X, F, LONGEST * edge)
        if round_ and len(F) > GROWTH * before:
            raise _too_long("its edges span gaps of the surface")
        X, F = _collapsed(chart, X, F, SHORTEST * edge)
        for _ in range(2):
            X, F = _flipped(chart, X, F, by_valence=True)
            X = _relaxed(chart, X, F)
    for _ in range(POLISH):
        X, F = _flipped(chart, X, F, by_valence=False)
        X = _relaxed(chart, X, F)
    if faults := manifold_faults(F, edge_table(F), len(X)):
        raise _too_long(faults[0])
    V = chart.place(X)
    if folds := _folds(V, F):
        raise _too_long(f"its mesh is folded over at {folds} edges")
    return V, F


def _too_long(why: str) -> SurfaceError:
    """Without the length: shapes are drawn at size 1, and scaled afterwards."""
    return SurfaceError(f"the edge is too long for the shape's details ({why}); use a shorter one")


def _folds(V: Floats, F: Ints) -> int:
    """How many neighbours lie almost on each other."""
    N = _normals(V, F)[edge_table(F).pairs // 3]
    return int((np.einsum("ei,ei->e", N[:, 0], N[:, 1]) < FOLDED).sum())


def _normals(V: Floats, F: Ints) -> Floats:
    """(m, 3) unit normals of faces F (m, 3)."""
    N = area_vectors(V, F)
    return np.asarray(N / np.maximum(lengths(N), 1e-300)[:, None])


def _split(chart: MeshChart, X: Floats, F: Ints, longest: float) -> tuple[Floats, Ints]:
    """Every edge over `longest` halved, again and again; new vertices are put on the surface."""
    for _ in range(12):
        edges = edge_table(F)
        long = edge_lengths(chart.place(X), edges.ends) > longest
        if not long.any():
            break
        old = len(X)
        X, F, _ = halved(X, F, edges, long)
        new = np.arange(len(X)) >= old
        border = on_boundary(edge_table(F), len(X))
        X[new] = chart.moved(X[new], np.zeros((new.sum(), 3)), border[new])
    return X, F


def _collapsed(chart: MeshChart, X: Floats, F: Ints, shortest: float) -> tuple[Floats, Ints]:
    """Edges under `shortest` collapsed to a point, where that keeps the topology."""
    for _ in range(BATCHES):
        edges, n, V = edge_table(F), len(X), chart.place(X)
        border = on_boundary(edges, n)
        across = border[edges.ends].all(axis=1) & ~edges.boundary
        length = edge_lengths(V, edges.ends)
        short = np.flatnonzero(~across & (length < shortest))
        short = short[meets_link_condition(edges, short, n)]
        chosen = short[winners(np.argsort(length[short], kind="stable"), edges.ends[short], n, beside=edges.ends)]
        a, b = edges.ends[chosen].T
        X, F, done = _merged(chart, X, F, V, a, b, border)
        if not done:
            break
    return X, F


def _merged(
    chart: MeshChart, X: Floats, F: Ints, V: Floats, a: Ints, b: Ints, border: Bools
) -> tuple[Floats, Ints, bool]:
    """Vertices b put together with a where no face turns over; says whether there were any."""
    goal = np.where((border[a] == border[b])[:, None], (X[a] + X[b]) / 2, X[np.where(border[a], a, b)])
    goal = chart.moved(goal, np.zeros((len(a), 3)), border[a] | border[b])
    pair = np.full(len(X), -1)
    pair[a] = pair[b] = np.arange(len(a))
    moved = V.copy()
    moved[a] = moved[b] = chart.place(goal)
    of = pair[F]
    largest = of.max(axis=1)
    stays = (of >= 0).sum(axis=1) == 1
    turned = stays & (np.einsum("ma,ma->m", _normals(V, F), _normals(moved, F)) < TURN)
    fine = np.ones(len(a), dtype=bool)
    fine[largest[turned]] = False
    a, b, goal = a[fine], b[fine], goal[fine]
    X = X.copy()
    X[a] = goal
    onto = np.arange(len(X))
    onto[b] = a
    kept, F = np.unique(contracted(F, onto), return_inverse=True)
    return X[kept], F.reshape(-1, 3), bool(len(a))


def _flipped(chart: MeshChart, X: Floats, F: Ints, by_valence: bool) -> tuple[Floats, Ints]:
    """Edges turned within their two faces: towards six edges at each vertex (four on the border), or to Delaunay."""
    V = chart.place(X)
    for _ in range(8):
        edges, n = edge_table(F), len(X)
        quad = quads(F, edges.pairs)
        gain = _valence_gain(quad, edges, n) if by_valence else _delaunay_gain(V[quad])
        good = np.flatnonzero((gain > 0) & has_new_diagonal(quad, edges, n) & _stays_upright(V, quad))
        good = good[winners(np.argsort(-gain[good], kind="stable"), quad[good], n)]
        if not len(good):
            break
        F = with_other_diagonals(F, edges.pairs[good], quad[good])
    return X, F


def _valence_gain(quad: Ints, edges: EdgeTable, n: int) -> Floats:
    valence = np.bincount(edges.ends.ravel(), minlength=n)
    off = (valence - np.where(on_boundary(edges, n), 4, 6))[quad]
    change = np.array([-1, -1, 1, 1])
    return np.asarray(((off**2) - (off + change) ** 2).sum(axis=1), dtype=np.float64)


def _delaunay_gain(P: Floats) -> Floats:
    """How far the two angles opposite an edge exceed half a turn together, radians."""
    a, b, c, d = np.moveaxis(P, 1, 0)
    angles = [
        np.arctan2(np.linalg.norm(np.cross(a - p, b - p), axis=1), ((a - p) * (b - p)).sum(axis=1)) for p in (c, d)
    ]
    return np.asarray(angles[0] + angles[1] - np.pi - 1e-6)


def _stays_upright(V: Floats, quad: Ints) -> Bools:
    """(q,) whether neither face turns over where the edge is turned."""
    a, b, c, d = quad.T
    before = _normals(V, np.stack([a, b, c], axis=1)) + _normals(V, np.stack([b, a, d], axis=1))
    before /= np.maximum(lengths(before), 1e-300)[:, None]
    fine = np.ones(len(quad), dtype=bool)
    for after in ((a, d, c), (d, b, c)):
        fine &= np.einsum("qa,qa->q", before, _normals(V, np.stack(after, axis=1))) > TURN
    return fine


def _relaxed(chart: MeshChart, X: Floats, F: Ints) -> Floats:
    """Vertices moved along the surface to the mean of their neighbours; those of the border along it."""
    V, edges, n = chart.place(X), edge_table(F), len(X)
    border = on_boundary(edges, n)
    i, j = smoothing_pairs(edges, n)
    count = np.bincount(i, minlength=n)
    mean = group_sums(i, V[j], n) / count[:, None]
    N = group_sums(F.ravel(), np.repeat(area_vectors(V, F), 3, axis=0), n)
    N = N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)
    step = mean - V
    step -= N * np.einsum("na,na->n", N, step)[:, None]
    return chart.moved(X, 0.8 * step, border)


Field = Callable[[Floats], Floats]
"""Takes points (q, 3), metres; gives about the distance to a solid (q,), metres, negative inside."""

Point = Sequence[float] | Floats

GRID = 1.3
"""Cells of the grid over the edge length: coarser ones lose details, finer ones are collapsed again."""

SHRINK = 0.9
"""Remeshing for an edge length gives a mean edge this much longer."""


def _norm(Q: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("qa,qa->q", Q, Q)))


def ball(centre: Point, radius: float) -> Field:
    """A ball: a field of P (k, 3), metres, its signed distance (k,)."""
    c = np.array(centre)
    return lambda P: _norm(P - c) - radius


def ellipsoid(centre: Point, radii: Point, axes: Floats | None = None) -> Field:
    """axes : (3, 3) unit vectors of the radii, a row each; x, y and z when left out. First order in the distance."""
    c, r, R = np.array(centre), np.array(radii), np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = (P - c) @ (R.T / r)
        k, slope = _norm(Q), _norm(Q / r)
        return np.asarray(k * (k - 1) / np.maximum(slope, 1e-12))

    return field


def limb(points: Sequence[Point], radii: Sequence[float], soft: float = 0.3) -> Field:
    """A tube along a polygon whose radius runs linearly from corner to corner, with round ends.

    soft : the width over which its joints are filled, as a share of the smallest radius.
    """
    parts = [_cone(*ends) for ends in zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)]
    return blended(parts, soft * min(radii)) if len(parts) > 1 else parts[0]


def _cone(a: Point, b: Point, at_a: float, at_b: float) -> Field:
    start, along = np.array(a), np.array(b) - np.array(a)
    square = float(along @ along)

    def field(P: Floats) -> Floats:
        Q = P - start
        forward = Q @ along
        t = np.clip(forward / square, 0, 1)
        away = np.einsum("qa,qa->q", Q, Q) + t * (t * square - 2 * forward)
        return np.asarray(np.sqrt(np.maximum(away, 0)) - at_a - t * (at_b - at_a))

    return field


def box(centre: Point, halves: Point, rounding: float, axes: Floats | None = None) -> Field:
    """A box, rounded: a field of P (k, 3), metres.

    halves : half of each side, metres, with the rounding of all edges in it.    axes : (3, 3) along its sides, in
    rows.
    """
    c, h, R = np.array(centre), np.array(halves) - rounding, np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = np.abs((P - c) @ R.T) - h
        return np.asarray(_norm(np.maximum(Q, 0)) + np.minimum(Q.max(axis=1), 0) - rounding)

    return field


def smaller(a: Floats, b: Floats, k: float) -> Floats:
    """(k,) the smaller value, rounded off where they differ by less than k [polynomial smooth minimum, Quilez 2013]."""
    return np.asarray(np.minimum(a, b) - np.maximum(k - np.abs(a - b), 0) ** 2 / (4 * k))


def blended(fields: Sequence[Field], k: float) -> Field:
    """The union, its inner corners filled over a width of about k metres."""

    def field(P: Floats) -> Floats:
        value = fields[0](P)
        for other in fields[1:]:
            value = smaller(value, other(P), k)
        return value

    return field


def without(field: Field, cut: Field, k: float) -> Field:
    """The part of a solid outside of another, the edge of the cut rounded by about k metres."""
    return lambda P: -smaller(-field(P), cut(P), k)


def mirrored(field: Field, axis: int = 1) -> Field:
    """The union of a solid on the positive side of an axis with its mirror image."""

    def both(P: Floats) -> Floats:
        Q = P.copy()
        Q[:, axis] = np.abs(Q[:, axis])
        return field(Q)

    return both


@dataclass(frozen=True)
class LevelSet:
    """Where a field vanishes, as a chart: coordinates are the points themselves. The border lies at z = floor."""

    field: Field
    reach: float
    """Metres: no point is moved further at a time than half of this."""
    floor: float | None = None

    def place(self, X: Floats) -> Floats:
        """X (n, 3) itself, metres."""
        return X

    def moved(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """(n, 3) X + step after two of Newton's steps along the gradient, which is found once; those of the border
        (n,) stay on the floor."""
        P = X + step
        down = border & (self.floor is not None)
        if self.floor is not None:
            P[:, 2] = np.where(down, self.floor, np.maximum(P[:, 2], self.floor + 0.1 * self.reach))
        small = 1e-4 * self.reach
        value = self.field(P)
        slope = np.stack([(self.field(P + small * e) - value) / small for e in np.eye(3)], axis=1)
        slope[down, 2] = 0
        square = np.maximum(np.einsum("na,na->n", slope, slope), 1e-2)[:, None]
        most = 0.5 * self.reach * np.sqrt(square[:, 0])
        P -= np.clip(value, -most, most)[:, None] * slope / square
        return np.asarray(P - np.clip(self.field(P), -most, most)[:, None] * slope / square)


def skin(field: Field, low: Point, high: Point, edge: float, floor: float | None = None) -> Surface:
    """The surface on which a field vanishes, in even triangles about `edge` metres wide, normals outward.

    low, high : corners of a box around the solid, metres.
    floor     : the solid is cut at this height, and its surface open there, with the boundary in the plane.

    Raises SurfaceError for an edge so long that details are lost, or so short that the mesh would be endless.
    """
    bottom, top = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    if floor is not None:
        bottom[2] = floor
    x, y, z = size = top - bottom
    check_density(2 * float(x * y + y * z + z * x), edge)
    cells = np.maximum(np.ceil(size / (GRID * edge)), 4).astype(int)
    nodes = [np.linspace(a, b, n + 1) for a, b, n in zip(bottom, top, cells, strict=True)]
    z, y, x = np.meshgrid(nodes[2], nodes[1], nodes[0], indexing="ij")
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    value = field(grid)
    # a node on the surface itself would make triangles without area
    value = np.where(np.abs(value) < 1e-3 * edge, 1e-3 * edge, value)
    V, F, _ = igl.marching_cubes(value, grid, *(len(n) for n in nodes), 0.0)
    if Surface(V, F).volume < 0:
        F = F[:, ::-1]
    V, F = remeshed(LevelSet(field, edge, floor), V, F, SHRINK * edge)
    return Surface(V, F)
