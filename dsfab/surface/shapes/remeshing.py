"""Even triangles on a smooth surface: the remeshing of Botsch and Kobbelt (2004), in whole arrays.

Edges are split, collapsed and flipped many at once: those that win among all that touch the same vertices, so that no
two share a face. The order is by length or gain, then by index: the same input gives the same mesh.
"""

from typing import Protocol

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import SurfaceError
from dsfab.surface.neighbours import adjacency, on_boundary, smoothing_pairs
from dsfab.surface.refine import halved
from dsfab.surface.topology import EdgeTable, edge_table, manifold_faults, next_half_edge

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
    N = _normals(V[F])[edge_table(F).pairs // 3]
    return int((np.einsum("ei,ei->e", N[:, 0], N[:, 1]) < FOLDED).sum())


def _lengths(V: Floats, ends: Ints) -> Floats:
    return np.asarray(np.linalg.norm(V[ends[:, 1]] - V[ends[:, 0]], axis=1))


def _normals(P: Floats) -> Floats:
    """(..., 3) unit normals of triangles (..., 3 corners, 3)."""
    N = np.cross(P[..., 1, :] - P[..., 0, :], P[..., 2, :] - P[..., 0, :])
    return np.asarray(N / np.maximum(np.linalg.norm(N, axis=-1, keepdims=True), 1e-300))


def _split(chart: MeshChart, X: Floats, F: Ints, longest: float) -> tuple[Floats, Ints]:
    """Every edge over `longest` halved, again and again; new vertices are put on the surface."""
    for _ in range(12):
        edges = edge_table(F)
        long = _lengths(chart.place(X), edges.ends) > longest
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
        a, b = edges.ends.T
        short = np.flatnonzero(_collapsible(edges, n, border) & (_lengths(V, edges.ends) < shortest))
        chosen = short[_winners(edges.ends[short], edges.ends, _lengths(V, edges.ends[short]), n, reach=1)]
        X, F, done = _merged(chart, X, F, V, a[chosen], b[chosen], border)
        if not done:
            break
    return X, F


def _collapsible(edges: EdgeTable, n: int, border: Bools) -> Bools:
    """(e,) edges whose ends share no neighbours but the corners opposite [link condition: Dey et al. 1999]."""
    a, b = edges.ends.T
    A = adjacency(edges, n)
    common = np.asarray(A[a].multiply(A[b]).sum(axis=1)).ravel()
    across = border[a] & border[b] & ~edges.boundary
    return np.asarray((common == edges.count) & ~across)


def _winners(touched: Ints, ends: Ints, cost: Floats, n: int, reach: int = 0) -> Bools:
    """(c,) the candidates that are cheaper than all others near them: no two of them touch the same vertices.

    touched : (c, k) vertices of each candidate; reach 1 counts the vertices next to them too, along edges `ends`.
    """
    rank = np.empty(len(cost), dtype=np.int64)
    rank[np.argsort(cost, kind="stable")] = np.arange(len(cost))
    best = np.full(n, len(cost))
    np.minimum.at(best, touched.ravel(), np.repeat(rank, touched.shape[1]))
    for _ in range(reach):
        near = best.copy()
        np.minimum.at(near, ends.ravel(), best[ends[:, ::-1]].ravel())
        best = near
    return np.asarray((best[touched] >= rank[:, None]).all(axis=1))


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
    turned = stays & (np.einsum("ma,ma->m", _normals(V[F]), _normals(moved[F])) < TURN)
    fine = np.ones(len(a), dtype=bool)
    fine[largest[turned]] = False
    a, b, goal = a[fine], b[fine], goal[fine]
    X = X.copy()
    X[a] = goal
    onto = np.arange(len(X))
    onto[b] = a
    F = onto[F]
    F = F[(np.roll(F, 1, axis=1) != F).all(axis=1)]
    kept, F = np.unique(F, return_inverse=True)
    return X[kept], F.reshape(-1, 3), bool(len(a))


def _flipped(chart: MeshChart, X: Floats, F: Ints, by_valence: bool) -> tuple[Floats, Ints]:
    """Edges turned within their two faces: towards six edges at each vertex (four on the border), or to Delaunay.

             c                    c
           /   \\                / | \\
          a --- b      ->      a  |  b
           \\   /                \\ | /
             d                    d
    """
    V = chart.place(X)
    F = F.copy()
    for _ in range(8):
        edges, n = edge_table(F), len(X)
        h0, h1 = edges.pairs.T
        corner = F.ravel()
        quad = corner[np.stack([h0, next_half_edge(h0), next_half_edge(h0, 2), next_half_edge(h1, 2)], axis=1)]
        gain = _valence_gain(quad, edges, n) if by_valence else _delaunay_gain(V[quad])
        good = np.flatnonzero((gain > 0) & _can_flip(V, quad, edges, n))
        good = good[_winners(quad[good], edges.ends, -gain[good], n)]
        if not len(good):
            break
        a, b, c, d = quad[good].T
        F[h0[good] // 3] = np.stack([a, d, c], axis=1)
        F[h1[good] // 3] = np.stack([d, b, c], axis=1)
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


def _can_flip(V: Floats, quad: Ints, edges: EdgeTable, n: int) -> Bools:
    """(q,) whether the other diagonal is new and neither face turns over."""
    a, b, c, d = quad.T
    keys = edges.ends[:, 0] * n + edges.ends[:, 1]
    wanted = np.minimum(c, d) * n + np.maximum(c, d)
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    before = _normals(V[np.stack([a, b, c], axis=1)]) + _normals(V[np.stack([b, a, d], axis=1)])
    before /= np.maximum(np.linalg.norm(before, axis=1, keepdims=True), 1e-300)
    fine = keys[at] != wanted
    for after in ((a, d, c), (d, b, c)):
        fine &= np.einsum("qa,qa->q", before, _normals(V[np.stack(after, axis=1)])) > TURN
    return np.asarray(fine)


def _relaxed(chart: MeshChart, X: Floats, F: Ints) -> Floats:
    """Vertices moved along the surface to the mean of their neighbours; those of the border along it."""
    V, edges, n = chart.place(X), edge_table(F), len(X)
    border = on_boundary(edges, n)
    i, j = smoothing_pairs(edges, n)
    count = np.bincount(i, minlength=n)
    mean = np.stack([np.bincount(i, V[j, k], minlength=n) for k in range(3)], axis=1) / count[:, None]
    P = V[F]
    cross = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
    N = np.stack([np.bincount(F.ravel(), np.repeat(cross[:, k], 3), minlength=n) for k in range(3)], axis=1)
    N = N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)
    step = mean - V
    step -= N * np.einsum("na,na->n", N, step)[:, None]
    return chart.moved(X, 0.8 * step, border)
