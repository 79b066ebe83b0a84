"""Polygon meshes as arrays, and division of polygons into triangles."""

from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import mapbox_earcut
import numpy as np
import pythoncdt as cdt

from dsfab.core.arrays import Bools, Floats, Ints, unit_vectors

FLAT, WARPED = (float(np.cos(np.radians(angle))) for angle in (2, 10))
"""Limits of the cosine between the normals of a quad's two triangles: flat above FLAT, perhaps folded below WARPED."""
ON, BETTER = 2 * float(np.sin(np.radians(10) / 2)), 0.25
"""A quad is cut along its second diagonal if its edges to flat neighbours then bend much less. Unit normals at these
edges must differ by less than ON (10 degrees), and by less than BETTER times the difference for the first diagonal."""


def quad_triangles(V: Floats, corners: Ints, sizes: Ints, quads: Ints) -> Ints:
    """Cut faces with four corners into triangles. Return the two triangles (2 q, 3) of each face.
    quads   : (q,) numbers of these faces.    V : (n, 3) vertices.
    corners : (c,) vertex numbers of all corners, face after face.    sizes : (f,) number of corners of each face."""
    start = np.cumsum(sizes) - sizes
    Q = corners[start[quads][:, None] + np.arange(4)]
    P = V[_inside(Q, len(V))] if len(Q) and len(V) else np.zeros((len(Q), 4, 3))
    d02, d13 = P[:, 2] - P[:, 0], P[:, 3] - P[:, 1]
    area = np.cross(d02, d13)
    normals = np.stack([np.cross(P[:, j] - P[:, i], P[:, k] - P[:, i]) for i, j, k in _TRIANGLES], axis=1)
    fits = np.einsum("qti,qi->qt", normals, area) > 0
    fits02, fits13 = fits[:, :2].all(axis=1), fits[:, 2:].all(axis=1)
    shorter = np.linalg.norm(d13, axis=1) < (1 - 1e-9) * np.linalg.norm(d02, axis=1)
    use_second = np.where(fits02 == fits13, shorter, fits13)
    units = unit_vectors(normals)
    parallel = np.where(use_second, *(np.einsum("qi,qi->q", units[:, k], units[:, k + 1]) for k in (2, 0)))
    rows = np.flatnonzero(fits02 & fits13 & (parallel < WARPED))
    if len(rows):
        bent = np.zeros(len(sizes), dtype=bool)
        bent[quads] = parallel < FLAT
        neighbour_normals = _neighbour_normals(V, corners, sizes, bent, start[quads[rows]])
        bend = [_bend(units[rows][:, which], neighbour_normals) for which in _AT_SIDES]
        chosen, instead = np.where(use_second[rows], bend[::-1], bend)
        use_second[rows] ^= instead < np.minimum(ON, BETTER * chosen)
    cut = np.where(use_second[:, None], [[1, 2, 3, 1, 3, 0]], [[0, 1, 2, 0, 2, 3]])
    return np.take_along_axis(Q, cut, axis=1).reshape(-1, 3)


_TRIANGLES = (0, 1, 2), (0, 2, 3), (1, 2, 3), (1, 3, 0)  # Triangles of a quad, cut along 0-2 or 1-3.
_AT_SIDES = (0, 0, 1, 1), (3, 2, 2, 3)  # Index in `_TRIANGLES` at each side of a quad, for cuts 0-2 and 1-3.


def _inside(corners: Ints, n: int) -> Ints:
    return np.where((corners < 0) | (n <= corners), 0, corners)


def _bend(normals: Floats, neighbour_normals: Floats) -> Floats:
    has_neighbour = (neighbour_normals != 0).any(axis=2)
    return np.asarray((np.linalg.norm(normals - neighbour_normals, axis=2) * has_neighbour).max(axis=1))


def _neighbour_normals(V: Floats, corners: Ints, sizes: Ints, bent: Bools, starts: Ints) -> Floats:
    """Return the unit normal (r, 4, 3) of the neighbour at each edge of r quads; 0 if there is no flat neighbour.
    bent : (f,) mask of faces that are not flat.    starts : (r,) index of each quad's first corner in `corners`."""
    owner, h = np.repeat(np.arange(len(sizes)), sizes), np.arange(len(corners))
    start = np.cumsum(sizes) - sizes
    onward = np.where(h + 1 < (start + sizes)[owner], h + 1, start[owner])
    a, b = _inside(corners, len(V)), _inside(corners[onward], len(V))
    origin = V[a[start[owner]]]
    turned = np.cross(V[a] - origin, V[b] - origin)
    N = unit_vectors(np.stack([np.bincount(owner, x, len(sizes)) for x in turned.T], axis=1))
    _, edge, count = np.unique(np.minimum(a, b) * len(V) + np.maximum(a, b), return_inverse=True, return_counts=True)
    side = starts[:, None] + np.arange(4)
    beyond = np.bincount(edge, h)[edge[side]].astype(np.int64) - side  # the opposite half-edge
    beyond = np.where(count[edge[side]] == 2, beyond, side)
    is_flat = (beyond != side) & ~bent[owner[beyond]]
    return np.asarray((np.where(a[beyond] == a[side], -1.0, 1.0) * is_flat)[..., None] * N[owner[beyond]])


MOST_CORNERS_FOR_EARS = 12  # Most corners for ear clipping, which takes k^3 steps for k corners.
MANY = 2000  # Largest number of corners for earcut; larger polygons get Delaunay triangles, which is faster.
NOISE = 32 * float(np.finfo(np.float64).eps)
"""A corner is straight if its distance from the line through its neighbours is below NOISE x the largest coordinate."""
ORDER = cdt.VertexInsertionOrder.AUTO  # An order of insertion in which near points follow each other.
TOGETHER = 1 << 12  # Number of polygons cut together; their data fit into the processor's cache.


def small_polygon_triangles(P: Floats) -> Ints:
    """Cut q polygons with the corners P (q, k, 3) into triangles (q, k - 2, 3), and return their corner numbers.
    The number of corners k is 5 to `MOST_CORNERS_FOR_EARS`."""
    parts = [_ear_triangles(P[start : start + TOGETHER]) for start in range(0, len(P), TOGETHER)]
    return np.concatenate(parts) if parts else np.empty((0, P.shape[1] - 2, 3), dtype=np.int64)


def _ear_triangles(P: Floats) -> Ints:
    q, k, _ = P.shape
    P = P - P[:, :1]
    normal = np.cross(P, np.roll(P, -1, axis=1)).sum(axis=1)
    remaining, rows, cuts = np.tile(np.arange(k), (q, 1)), np.arange(q), []
    while remaining.shape[1] > 3:
        before, after = np.roll(remaining, 1, axis=1), np.roll(remaining, -1, axis=1)
        is_ear = _are_ears(P[rows[:, None], remaining], normal)
        length = np.linalg.norm(P[rows[:, None], before] - P[rows[:, None], after], axis=2)
        length = np.where(is_ear | ~is_ear.any(axis=1, keepdims=True), length, np.inf)
        shortest = length.argmin(axis=1)
        cuts.append(np.stack([before[rows, shortest], remaining[rows, shortest], after[rows, shortest]], axis=1))
        remaining = remaining[np.arange(remaining.shape[1]) != shortest[:, None]].reshape(q, -1)
    return np.stack([*cuts, remaining], axis=1)


def _are_ears(P: Floats, normal: Floats) -> Bools:
    k = P.shape[1]
    a, b, c = np.roll(P, 1, axis=1), P, np.roll(P, -1, axis=1)
    convex = np.einsum("qki,qi->qk", np.cross(b - a, c - b), normal) > 0
    other_corners = P[:, (np.arange(k)[:, None] + np.arange(2, k - 1)) % k]  # (q, k, k - 3, 3) corners outside the ear
    within = np.ones(other_corners.shape[:3], dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        side = np.cross((end - start)[:, :, None], other_corners - start[:, :, None])
        within &= np.einsum("qkoi,qi->qko", side, normal) >= 0
    ears: Bools = convex & ~within.any(axis=2)
    return ears


def large_polygon_triangles(P: Floats) -> Ints | None:
    """Cut a polygon with the corners P (k, 3) into triangles (k - 2, 3), and return their corner numbers.
    Return None if the polygon has no area, or crosses itself."""
    flat, noise = _in_plane(P)
    x, y = flat.T
    area = float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    if not area > 0:
        return None
    ring, runs = _without_straight(flat, noise)
    F = _with_runs(ring[_ring_cut(flat[ring])], runs)
    twice = _twice_areas(flat, F)
    sound = len(F) == len(P) - 2 and bool((twice > 0).all()) and abs(float(twice.sum()) - area) <= 1e-6 * area
    return F if sound else None


def fan(k: int) -> Ints:
    """Return the triangles (k - 2, 3) of a fan: all have the first of k corners in common."""
    return np.array([[0, b, c] for b, c in pairwise(range(1, k))], dtype=np.int64)


def _ring_cut(flat: Floats) -> Ints:
    if len(flat) <= MANY:
        return earcut_triangles(flat)
    cut, ends = cdt.Triangulation(ORDER, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0), np.arange(len(flat))
    points: Any = np.ascontiguousarray(flat)  # Any: Python before 3.12 has no type for buffers
    sides: Any = np.stack([ends, np.roll(ends, -1)], axis=1).astype(np.uint32)
    try:
        cut.insert_vertices(points)
        cut.insert_edges(sides)
    except RuntimeError:  # the outline has repeated points or crossing sides
        return earcut_triangles(flat)
    cut.erase_outer_triangles()
    return np.asarray(cut.triangles_array()["vertices"], dtype=np.int64)


def earcut_triangles(flat: Floats) -> Ints:
    """Cut a plane polygon with the corners `flat` (k, 2) into counter-clockwise triangles (t, 3)."""
    corners = mapbox_earcut.triangulate_float64(np.ascontiguousarray(flat), np.array([len(flat)], dtype=np.uint32))
    F: Ints = np.asarray(corners, dtype=np.int64).reshape(-1, 3)
    turned = _twice_areas(flat, F) < 0  # the order of the corners depends on earcut's version
    return np.where(turned[:, None], F[:, ::-1], F)


def _in_plane(P: Floats) -> tuple[Floats, float]:
    """Project a polygon P (k, 3) along its mean normal. Return scaled points (k, 2), and their rounding error."""
    size = float(np.ptp(P, axis=0).max()) or 1.0
    noise = NOISE * max(1.0, float(np.abs(P).max()) / size)
    P = (P - P.mean(axis=0)) / size
    normal = np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0)
    drop = int(np.abs(normal).argmax())
    right = np.cross(np.eye(3)[(drop + 1) % 3], normal)
    axes = np.stack([right, np.cross(normal, right)])
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    flat: Floats = P @ np.divide(axes, length, out=np.zeros_like(axes), where=length > 0).T
    return flat, noise


def _twice_areas(flat: Floats, F: Ints) -> Floats:
    a, b, c = flat[F[:, 0]], flat[F[:, 1]], flat[F[:, 2]]
    ab, ac = b - a, c - a
    twice: Floats = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    return twice


def _corner_turns(flat: Floats) -> tuple[Floats, Bools]:
    """Return each corner's distance (k,) from the line through its two neighbours, positive on the right.
    Return also a mask (k,) of corners with a turn of less than 90 degrees. flat : (k, 2) corners of a plane polygon."""
    incoming, outgoing = flat - np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0) - flat
    cut = np.linalg.norm(incoming + outgoing, axis=1)
    twice = incoming[:, 0] * outgoing[:, 1] - incoming[:, 1] * outgoing[:, 0]
    height: Floats = np.divide(twice, cut, out=np.zeros_like(cut), where=cut > 0)
    return height, np.asarray(np.einsum("ki,ki->k", incoming, outgoing) > 0)


def _without_straight(flat: Floats, noise: float) -> tuple[Ints, list[Ints]]:
    k = len(flat)
    height, onward = _corner_turns(flat)
    turning = np.flatnonzero((np.abs(height) > noise) | ~onward)
    if len(turning) < 3:
        return np.arange(k), []
    ends = np.append(turning, turning[0] + k)
    return turning, [np.arange(a, b + 1) % k for a, b in pairwise(ends.tolist()) if b > a + 1]


def _with_runs(F: Ints, runs: list[Ints]) -> Ints:
    if not runs:
        return F
    table = {edge: apex for a, b, c in F.tolist() for edge, apex in (((a, b), c), ((b, c), a), ((c, a), b))}
    added, gone = [], set()
    for run in runs:
        run_start, run_end = int(run[0]), int(run[-1])
        apex = table.get((run_start, run_end))
        if apex is None:  # the outline crosses itself
            continue
        gone.add(frozenset((run_start, run_end, apex)))
        corners = run.tolist()
        added += [(a, b, apex) for a, b in pairwise(corners)]
        table[apex, run_start], table[run_end, apex] = corners[1], corners[-2]
    result = [(a, b, c) for a, b, c in (*map(tuple, F.tolist()), *added) if frozenset((a, b, c)) not in gone]
    return np.array(result, dtype=np.int64).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons with vertices V (n, 3). sizes : (f,) number of corners of each polygon.
    corners : (c,) vertex numbers of the corners of all polygons, polygon after polygon."""

    V: Floats
    corners: Ints
    sizes: Ints

    def part(self, faces: Ints) -> "Polygons":
        """Return only the polygons with the numbers `faces` (f,). The array of vertices stays the same."""
        owner = np.repeat(np.arange(len(self.sizes)), self.sizes)
        return Polygons(self.V, self.corners[np.isin(owner, faces)], self.sizes[faces])


def polygons(V: list[list[float]], faces: list[list[int]]) -> Polygons:
    """Return the polygons with the given vertices and lists of vertex numbers."""
    return Polygons(
        np.array(V, dtype=np.float64).reshape(-1, 3),
        np.fromiter(chain.from_iterable(faces), dtype=np.int64),
        np.array([len(face) for face in faces], dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class CutPolygons:
    """Triangles that polygons were cut into: vertex numbers F (m, 3).
    owner  : (m,) number of the polygon of each triangle, ascending.
    fanned : (p,) numbers of polygons that cross themselves or have no area."""

    F: Ints
    owner: Ints
    fanned: Ints


def triangles(mesh: Polygons) -> CutPolygons:
    """Cut polygons into triangles. Polygons with fewer than three corners are dropped."""
    start = np.concatenate([[0], np.cumsum(mesh.sizes)[:-1]]).astype(np.int64)
    of3, of4 = np.flatnonzero(mesh.sizes == 3), np.flatnonzero(mesh.sizes == 4)
    cuts = [mesh.corners[start[of3][:, None] + np.arange(3)], quad_triangles(mesh.V, mesh.corners, mesh.sizes, of4)]
    owners = [of3, np.repeat(of4, 2)]
    fanned: list[int] = []
    for k in np.unique(mesh.sizes[mesh.sizes > 4]).tolist():
        faces = np.flatnonzero(mesh.sizes == k)
        corners = mesh.corners[start[faces][:, None] + np.arange(k)]
        F, crossed = _polygon_triangles(mesh.V, corners)
        cuts.append(np.take_along_axis(corners, F.reshape(len(faces), -1), axis=1).reshape(-1, 3))
        owners.append(np.repeat(faces, k - 2))
        fanned.extend(faces[crossed].tolist())
    F, owner = np.concatenate(cuts), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return CutPolygons(F[order], owner[order], np.array(sorted(fanned), dtype=np.int64))


def _polygon_triangles(V: Floats, corners: Ints) -> tuple[Ints, Bools]:
    q, k = corners.shape
    is_valid = (corners >= 0) & (corners < len(V))
    P = V[np.where(is_valid, corners, 0)] if len(V) else np.zeros((q, k, 3))
    sound = is_valid.all(axis=1) & np.isfinite(P).all(axis=(1, 2))
    F, crossed = np.tile(fan(k), (q, 1, 1)), np.zeros(q, dtype=bool)
    if k <= MOST_CORNERS_FOR_EARS:
        F[sound] = small_polygon_triangles(P[sound])
        return F, crossed
    for i in np.flatnonzero(sound).tolist():
        cut = large_polygon_triangles(P[i])
        crossed[i] = cut is None
        F[i] = F[i] if cut is None else cut
    return F, crossed
