"""Solids as implicit functions, and meshes of nearly equilateral triangles on their surfaces."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, edge_lengths, group_sums, lengths
from dsfab.core.errors import SurfaceError
from dsfab.surface.edge_changes import (
    contracted_faces,
    halved_edges,
    has_new_diagonal,
    leading_candidates,
    meets_link_condition,
    quads,
    with_other_diagonals,
)
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import check_density
from dsfab.surface.topology import EdgeTable, edge_table, manifold_faults, on_boundary, smoothing_neighbours

LONGEST, SHORTEST = 4 / 3, 4 / 5  # Edges over 4/3 of the wanted length are halved, edges under 4/5 collapse.
ROUNDS, POLISH = 5, 10  # 5 rounds add and remove vertices; then 10 rounds only flip edges and move vertices.
LEAST_TURN_COSINE = 0.3  # Cosine of the largest rotation of a face in one step, about 70 degrees.
FOLDED = -0.5  # Largest cosine of the angle between the normals of two faces in a fold (120 degrees).


class MeshChart(Protocol):
    """A smooth surface. X (n, k) are coordinates of n points of this surface."""

    def place(self, X: Floats) -> Floats:
        """Return the points (n, 3), metres, of the surface at coordinates X (n, k)."""
        ...

    def move(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """Return the coordinates (n, k) of points moved by about `step` (n, 3), metres.
        border : (n,) mask of points that stay on the border."""
        ...


def remeshed_chart(chart: MeshChart, X: Floats, F: Ints, edge: float) -> tuple[Floats, Ints]:
    """Mesh a smooth surface with nearly equilateral triangles. Return vertices (n, 3), metres, and faces (m', 3).
    edge : wanted edge length, metres. Raises SurfaceError if `edge` is too long for the surface's details.
    X, F : first mesh, an oriented manifold: (k, c) vertices in the chart's coordinates, and (m, 3) faces."""
    for round_ in range(ROUNDS):
        before = len(F)
        X, F = _split(chart, X, F, LONGEST * edge)
        if round_ and len(F) > 2 * before:
            raise _too_long("edges of the mesh span gaps of the surface")
        X, F = _collapse_edges(chart, X, F, SHORTEST * edge)
        for _ in range(2):
            X, F = _flip_edges(chart, X, F, by_valence=True)
            X = _relax(chart, X, F)
    for _ in range(POLISH):
        X, F = _flip_edges(chart, X, F, by_valence=False)
        X = _relax(chart, X, F)
    if faults := manifold_faults(F, edge_table(F), len(X)):
        raise _too_long(faults[0])
    V = chart.place(X)
    if folds := _folds(V, F):
        raise _too_long(f"the mesh is folded over at {folds} edges")
    return V, F


def _too_long(why: str) -> SurfaceError:
    # the message omits the length, because shapes are scaled later
    return SurfaceError(f"the edge length is too large for the details of the shape ({why}); use a shorter edge")


def _folds(V: Floats, F: Ints) -> int:
    N = _normals(V, F)[edge_table(F).pairs // 3]
    return int((np.einsum("ei,ei->e", N[:, 0], N[:, 1]) < FOLDED).sum())


def _normals(V: Floats, F: Ints) -> Floats:
    N = area_vectors(V, F)
    return np.asarray(N / np.maximum(lengths(N), 1e-300)[:, None])


def _split(chart: MeshChart, X: Floats, F: Ints, longest: float) -> tuple[Floats, Ints]:
    for _ in range(12):
        edges = edge_table(F)
        long = edge_lengths(chart.place(X), edges.ends) > longest
        if not long.any():
            break
        old_count = len(X)
        X, F, _ = halved_edges(X, F, edges, long)
        is_new = np.arange(len(X)) >= old_count
        X[is_new] = chart.move(X[is_new], np.zeros((is_new.sum(), 3)), on_boundary(edge_table(F), len(X))[is_new])
    return X, F


def _collapse_edges(chart: MeshChart, X: Floats, F: Ints, shortest: float) -> tuple[Floats, Ints]:
    for _ in range(10):
        edges, n, V = edge_table(F), len(X), chart.place(X)
        border = on_boundary(edges, n)
        across = border[edges.ends].all(axis=1) & ~edges.boundary
        length = edge_lengths(V, edges.ends)
        short = np.flatnonzero(~across & (length < shortest))
        short = short[meets_link_condition(edges, short, n)]
        order = np.argsort(length[short], kind="stable")
        chosen = short[leading_candidates(order, edges.ends[short], n, edges=edges.ends)]
        a, b = edges.ends[chosen].T
        X, F, changed = _merge_vertices(chart, X, F, V, a, b, border)
        if not changed:
            break
    return X, F


def _merge_vertices(
    chart: MeshChart, X: Floats, F: Ints, V: Floats, a: Ints, b: Ints, border: Bools
) -> tuple[Floats, Ints, bool]:
    goal = np.where((border[a] == border[b])[:, None], (X[a] + X[b]) / 2, X[np.where(border[a], a, b)])
    goal = chart.move(goal, np.zeros((len(a), 3)), border[a] | border[b])
    pair = np.full(len(X), -1)
    pair[a] = pair[b] = np.arange(len(a))
    moved = V.copy()
    moved[a] = moved[b] = chart.place(goal)
    pair_of = pair[F]
    largest = pair_of.max(axis=1)
    stays = (pair_of >= 0).sum(axis=1) == 1
    turned = stays & (np.einsum("ma,ma->m", _normals(V, F), _normals(moved, F)) < LEAST_TURN_COSINE)
    fine = np.ones(len(a), dtype=bool)
    fine[largest[turned]] = False
    a, b, goal = a[fine], b[fine], goal[fine]
    X = X.copy()
    X[a] = goal
    onto = np.arange(len(X))
    onto[b] = a
    used, F = np.unique(contracted_faces(F, onto), return_inverse=True)
    return X[used], F.reshape(-1, 3), bool(len(a))


def _flip_edges(chart: MeshChart, X: Floats, F: Ints, by_valence: bool) -> tuple[Floats, Ints]:
    V = chart.place(X)
    for _ in range(8):
        edges, n = edge_table(F), len(X)
        quad = quads(F, edges.pairs)
        gain = _valence_gain(quad, edges, n) if by_valence else _delaunay_gain(V[quad])
        chosen = np.flatnonzero((gain > 0) & has_new_diagonal(quad, edges, n) & _stays_upright(V, quad))
        chosen = chosen[leading_candidates(np.argsort(-gain[chosen], kind="stable"), quad[chosen], n)]
        if not len(chosen):
            break
        F = with_other_diagonals(F, edges.pairs[chosen], quad[chosen])
    return X, F


def _valence_gain(quad: Ints, edges: EdgeTable, n: int) -> Floats:
    excess = (np.bincount(edges.ends.ravel(), minlength=n) - np.where(on_boundary(edges, n), 4, 6))[quad]
    change = np.array([-1, -1, 1, 1])
    return np.asarray(((excess**2) - (excess + change) ** 2).sum(axis=1), dtype=np.float64)


def _delaunay_gain(P: Floats) -> Floats:
    a, b, c, d = np.moveaxis(P, 1, 0)
    angles = [
        np.arctan2(np.linalg.norm(np.cross(a - p, b - p), axis=1), ((a - p) * (b - p)).sum(axis=1)) for p in (c, d)
    ]
    return np.asarray(angles[0] + angles[1] - np.pi - 1e-6)


def _stays_upright(V: Floats, quad: Ints) -> Bools:
    a, b, c, d = quad.T
    before = _normals(V, np.stack([a, b, c], axis=1)) + _normals(V, np.stack([b, a, d], axis=1))
    before /= np.maximum(lengths(before), 1e-300)[:, None]
    fine = np.ones(len(quad), dtype=bool)
    for after in ((a, d, c), (d, b, c)):
        fine &= np.einsum("qa,qa->q", before, _normals(V, np.stack(after, axis=1))) > LEAST_TURN_COSINE
    return fine


def _relax(chart: MeshChart, X: Floats, F: Ints) -> Floats:
    V, edges, n = chart.place(X), edge_table(F), len(X)
    border = on_boundary(edges, n)
    i, j = smoothing_neighbours(edges, n)
    mean = group_sums(i, V[j], n) / np.bincount(i, minlength=n)[:, None]
    N = group_sums(F.ravel(), np.repeat(area_vectors(V, F), 3, axis=0), n)
    N = N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)
    step = mean - V
    step -= N * np.einsum("na,na->n", N, step)[:, None]
    return chart.move(X, 0.8 * step, border)


Field = Callable[[Floats], Floats]  # Points (q, 3) -> approximate distances (q,) from a solid, m; negative inside.
Point = Sequence[float] | Floats
EDGE_CORRECTION = 0.9  # Factor of the wanted length, because remeshing makes edges too long.


def _norm(Q: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("qa,qa->q", Q, Q)))


def ball(centre: Point, radius: float) -> Field:
    """Return the signed distance from a ball as a function of points (q, 3), metres."""
    c = np.array(centre)
    return lambda P: _norm(P - c) - radius


def ellipsoid(centre: Point, radii: Point, axes: Floats | None = None) -> Field:
    """Return the approximate signed distance from an ellipsoid as a function of points (q, 3), metres.
    axes : (3, 3) unit directions of the radii, in rows; by default x, y, z."""
    c, r, R = np.array(centre), np.array(radii), np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = (P - c) @ (R.T / r)
        k, slope = _norm(Q), _norm(Q / r)
        return np.asarray(k * (k - 1) / np.maximum(slope, 1e-12))

    return field


def limb(points: Sequence[Point], radii: Sequence[float], soft: float = 0.3) -> Field:
    """Return the approximate signed distance from a tube with round ends as a function of points (q, 3).
    points, radii : corners of the middle line, radius at each corner.    soft : width of fillets / smallest radius."""
    parts = [_cone(*ends) for ends in zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)]
    return smooth_union(parts, soft * min(radii)) if len(parts) > 1 else parts[0]


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


def rounded_box(centre: Point, halves: Point, rounding: float, axes: Floats | None = None) -> Field:
    """Return the signed distance from a box with rounded edges as a function of points (q, 3), metres.
    halves : half of each side length.    rounding : radius of the edges.
    axes   : (3, 3) unit directions of the sides, in rows; by default x, y, z."""
    c, h, R = np.array(centre), np.array(halves) - rounding, np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = np.abs((P - c) @ R.T) - h
        return np.asarray(_norm(np.maximum(Q, 0)) + np.minimum(Q.max(axis=1), 0) - rounding)

    return field


def smooth_minimum(a: Floats, b: Floats, k: float) -> Floats:
    """Return a smooth minimum (n,) of a and b (n,) [Quilez 2013]."""
    return np.asarray(np.minimum(a, b) - np.maximum(k - np.abs(a - b), 0) ** 2 / (4 * k))


def smooth_union(fields: Sequence[Field], k: float) -> Field:
    """Unite solids (functions from points (q, 3) to signed distances (q,)) with fillets about k metres wide."""

    def field(P: Floats) -> Floats:
        value = fields[0](P)
        for part in fields[1:]:
            value = smooth_minimum(value, part(P), k)
        return value

    return field


def smooth_difference(field: Field, cut: Field, k: float) -> Field:
    """Return the solid `field` without the solid `cut`; the new edge is rounded by about k metres.
    Solids are functions of points (q, 3) that return signed distances (q,)."""
    return lambda P: -smooth_minimum(-field(P), cut(P), k)


def mirror_union(field: Field, axis: int = 1) -> Field:
    """Return the union of a solid's half on the positive side of `axis` and the mirror image of this half.
    Solids are functions of points (q, 3) that return signed distances (q,)."""

    def field_of_both(P: Floats) -> Floats:
        Q = P.copy()
        Q[:, axis] = np.abs(Q[:, axis])
        return field(Q)

    return field_of_both


@dataclass(frozen=True)
class LevelSet:
    """The surface on which a function of x, y, z (`field`) is zero. A border is at z = floor."""

    field: Field
    reach: float
    """Length, metres; a step moves points by at most half of `reach`."""
    floor: float | None = None

    def place(self, X: Floats) -> Floats:
        """Return the points X (n, 3), metres, unchanged."""
        return X

    def move(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """Return X + step (n, 3), m, moved onto the surface. border : (n,) mask of points that stay at z = floor."""
        P = X + step
        down = border & (self.floor is not None)
        if self.floor is not None:
            P[:, 2] = np.where(down, self.floor, np.maximum(P[:, 2], self.floor + 0.1 * self.reach))
        small = 1e-4 * self.reach
        value = self.field(P)
        slope = np.stack([(self.field(P + small * e) - value) / small for e in np.eye(3)], axis=1)
        slope[down, 2] = 0
        square = np.maximum(np.einsum("na,na->n", slope, slope), 1e-2)[:, None]
        limit = 0.5 * self.reach * np.sqrt(square[:, 0])
        P -= np.clip(value, -limit, limit)[:, None] * slope / square
        return np.asarray(P - np.clip(self.field(P), -limit, limit)[:, None] * slope / square)


def skin(field: Field, low: Point, high: Point, edge: float, floor: float | None = None) -> Surface:
    """Return the surface of a solid as a mesh of nearly equilateral triangles with edges of about `edge` metres.
    field     : approximate signed distance from the solid, metres, a function of points (q, 3).
    low, high : corners of a box around the solid, metres.
    floor     : height (m) of the border; None for a closed surface. Raises SurfaceError for a wrong `edge`."""
    bottom, top = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    if floor is not None:
        bottom[2] = floor
    x, y, z = size = top - bottom
    check_density(2 * float(x * y + y * z + z * x), edge)
    # coarser cells lose details; finer cells only give edges that collapse again
    cells = np.maximum(np.ceil(size / (1.3 * edge)), 4).astype(int)
    nodes = [np.linspace(a, b, n + 1) for a, b, n in zip(bottom, top, cells, strict=True)]
    z, y, x = np.meshgrid(nodes[2], nodes[1], nodes[0], indexing="ij")
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    value = field(grid)
    # a grid node on the surface itself would create triangles without area
    value = np.where(np.abs(value) < 1e-3 * edge, 1e-3 * edge, value)
    V, F, _ = igl.marching_cubes(value, grid, *(len(n) for n in nodes), 0.0)
    if Surface(V, F).volume < 0:
        F = F[:, ::-1]
    V, F = remeshed_chart(LevelSet(field, edge, floor), V, F, EDGE_CORRECTION * edge)
    return Surface(V, F)
