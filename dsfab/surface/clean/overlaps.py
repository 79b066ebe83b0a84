"""Sheets of a mesh that coincide or pass through each other, and slabs reduced to their middle surface."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, lengths, weighted_quantiles
from dsfab.core.messages import length
from dsfab.surface.mesh import nearest
from dsfab.surface.topology import EdgeTable, connected, edge_table, pieces


def crossings(F: Ints, pairs: Ints) -> Bools:
    """Return the pairs (p,) of coincident vertices (p, 2) at which sheets of faces F (m, 3) cross. They are inner
    vertices of both sheets, and the ends of such a crossing at the borders of both."""
    edges = edge_table(F)
    n = int(max(F.max(), pairs.max())) + 1
    inner = np.zeros(n, dtype=bool)
    inner[F] = True
    inner[edges.ends[edges.count != 2]] = False
    low, high = np.sort(pairs, axis=1).T
    key = edges.ends[:, 0] * n + edges.ends[:, 1]
    found = inner[low] & inner[high] & ~np.isin(low * n + high, key)
    if not found.any():
        return np.asarray(found)
    twice = _twice(F, connected(n, low, high)[1])
    found &= ~(twice[low] & twice[high])
    return np.asarray(found | _ends(edges.ends, pairs, found))


def _twice(F: Ints, became: Ints) -> Bools:
    """Return the vertices (n,) of faces that repeat others once each vertex is replaced by `became` (n,)."""
    _, same, count = np.unique(np.sort(became[F], axis=1), axis=0, return_inverse=True, return_counts=True)
    twice = np.zeros(len(became), dtype=bool)
    twice[F[(count > 1)[same.ravel()]]] = True
    return twice


def _ends(edges: Ints, pairs: Ints, found: Bools) -> Bools:
    """Return the other pairs (p,) that are neighbours of a crossing pair, along edges (e, 2) on both sides."""
    near: dict[int, set[int]] = {}
    for a, b in edges[np.isin(edges, pairs[found]).any(axis=1)].tolist():
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    other: dict[int, list[int]] = {}
    for one, both in enumerate(pairs.tolist()):
        for vertex in () if found[one] else both:
            other.setdefault(vertex, []).append(one)
    ends = np.zeros(len(pairs), dtype=bool)
    for a, b in pairs[found].tolist():
        for c in near[a]:
            for one in other.get(c, ()):
                ends[one] |= int(pairs[one].sum()) - c in near[b]
    return ends


COPY = 1 / 500
"""Gap between two sheets, as a share of the side of a square of their area, below which the second is a copy."""
NEAR = 0.08
"""The same share for two parallel sheets that are reported, and for the two faces of a slab."""
ALIKE = 0.8
"""Least ratio of the areas of the two faces of a slab, or of two parallel sheets."""
MOST = 0.1
"""Share of the area at either end of the distances that does not count, because sides are near both faces."""


_TOLD = {
    "copy": "a second sheet lies {} from the first over all of it, as a copy of one surface does; delete one, or let "
    "surface.mend = true drop it",
    "slab": "the surface is a closed slab, {} thick, and each of its two faces is built as a sheet; give its middle "
    "surface, or let surface.mend = true find it",
    "apart": "two sheets lie {} apart, one over all of the other, and both are built; delete one if they are the two "
    "faces of one thick sheet",
}
_DONE = {
    "copy": "a second copy of the sheet, {} from the first, dropped",
    "slab": "a slab, {} thick, made the sheet halfway between its two faces",
}


@dataclass(frozen=True, eq=False)
class Twins:
    """Two parallel parts of a mesh.

    keep, other : (k,), (l,) their faces. Of a slab the smaller part comes first, because sides that fold little may
    belong
                  to the other; otherwise the part that comes first in the file.
    gap         : the median distance between them, in the mesh's unit.
    kind        : copy, the same sheet again; slab, the two faces of a solid; apart, two sheets.
    piece       : (p,) all faces of the piece that a slab is.
    way         : (3,) translation from the first to the second part of an extruded slab; else empty, (0,).
    """

    keep: Ints
    other: Ints
    gap: float
    kind: str
    piece: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    way: Floats = field(default_factory=lambda: np.zeros(0))


def twins(V: Floats, F: Ints) -> tuple[Twins, ...]:
    """Return the parallel parts of the mesh V (n, 3), F (m, 3), in any unit."""
    if not len(F):
        return ()
    edges = edge_table(F)
    piece, part = pieces(F, edges)[1], _parts(V, F, edges)
    area = lengths(area_vectors(V, F)) / 2
    pairs = list(_candidates(V, F, part, np.bincount(part, area).astype(np.float64)))
    found, gone = list(_slabs(V, F, piece, part, pairs)), np.zeros(len(F), dtype=bool)
    for pair in found:
        gone[pair.piece] = True
    for a, b in pairs:
        one, two = np.flatnonzero(part == a), np.flatnonzero(part == b)
        if piece[one[0]] == piece[two[0]] or gone[one[0]] or gone[two[0]]:
            continue
        side = float(np.sqrt(area[one].sum()))
        gap = _gap(V, F[one], F[two], side)
        if gap is not None:
            found.append(Twins(one, two, gap, "copy" if gap <= COPY * side else "apart"))
            gone[two] = gap <= COPY * side
    return tuple(found)


def _slabs(V: Floats, F: Ints, piece: Ints, part: Ints, pairs: list[tuple[int, int]]) -> Iterator[Twins]:
    """Yield the closed pieces that consist of two parallel faces and their sides. Without the parts that have no
    parallel part, two parts remain."""
    area, paired = lengths(area_vectors(V, F)) / 2, np.isin(part, np.unique(pairs))
    for p in np.unique(piece[paired]):
        mine, faces = np.flatnonzero(piece == p), np.flatnonzero((piece == p) & paired)
        names, which = np.unique(part[faces], return_inverse=True)
        count = len(names)
        if count > 2:  # folded faces
            count, which = pieces(F[faces], edge_table(F[faces]))
        # the two faces of a slab are the most part of its area
        if count != 2 or edge_table(F[mine]).boundary.any() or area[faces].sum() < 0.7 * area[mine].sum():
            continue
        one, two = sorted((faces[which == 0], faces[which == 1]), key=lambda those: float(area[those].sum()))
        side = float(np.sqrt(area[two].sum()))
        if area[one].sum() < ALIKE * side**2:
            continue
        way = _way(V, F[one], F[two], side)
        gap = float(np.linalg.norm(way)) if len(way) else _gap(V, F[one], F[two], side, even=True)
        if gap is not None:
            if len(way):
                to = V[F[one]].mean(axis=1) + way
                # sides that fold little are off by a third of the gap or more
                one = one[nearest(to, V, np.ascontiguousarray(F[two])).distance < gap / 4]
            yield Twins(one, two, gap, "slab", mine, way)


def _way(V: Floats, one: Ints, two: Ints, side: float) -> Floats:
    """Return the translation (3,) that moves a part (k, 3) onto the other (l, 3); empty (0,) if it is none. An extruded
    slab is far thinner than it is high on its steep faces: 20 mm of 100 at the foot of a half barrel. The method is the
    registration of scans [Chen and Medioni 1992]: it removes the distance across the faces in rounds."""
    P, n = V[one].mean(axis=1), area_vectors(V, one)
    area = lengths(n)
    n /= np.maximum(area, 1e-300)[:, None]
    other = lengths(area_vectors(V, two))
    way = other @ V[two].mean(axis=1) / other.sum() - area @ P / area.sum()
    faces = np.ascontiguousarray(two)
    for _ in range(5):
        off = np.einsum("ki,ki->k", n, nearest(P + way, V, faces).place - P - way)
        way += np.linalg.pinv((area[:, None] * n).T @ n, rcond=1e-6, hermitian=True) @ (n.T @ (area * off))
    far = float(np.linalg.norm(way))
    ways = ((P + way, faces, area), (V[two].mean(axis=1) - way, np.ascontiguousarray(one), other))
    beside = max(float(weighted_quantiles(nearest(at, V, to).distance, w, (1 - MOST,))[0]) for at, to, w in ways)
    return way if COPY * side < far <= NEAR * side and beside <= 0.05 * far else np.zeros(0)


def _parts(V: Floats, F: Ints, edges: EdgeTable) -> Ints:
    """Return the part (m,) of each face; faces across an edge of two belong together unless they fold by 60 degrees."""
    pair = edges.pairs
    ends = V[edges.ends[edges.count == 2]]
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(lengths(along), 1e-300)[:, None]
    away = V[F.ravel()[pair - pair % 3 + (pair + 2) % 3]] - ends[:, :1]
    away -= np.einsum("eki,ei->ek", away, along)[..., None] * along[:, None]
    away /= np.maximum(np.linalg.norm(away, axis=2), 1e-300)[..., None]
    flat = np.einsum("ei,ei->e", away[:, 0], away[:, 1]) < -np.cos(np.radians(60.0))
    return connected(len(F), pair[flat, 0] // 3, pair[flat, 1] // 3)[1]


def _candidates(V: Floats, F: Ints, part: Ints, area: Floats) -> Iterator[tuple[int, int]]:
    """Yield pairs of parts over 1 % of the area with similar area and box, the first in the file before the other."""
    large = np.flatnonzero(area >= 0.01 * area.sum())
    boxes = {k: V[F[part == k]].reshape(-1, 3) for k in large}
    low = {k: P.min(axis=0) for k, P in boxes.items()}
    high = {k: P.max(axis=0) for k, P in boxes.items()}
    for i, a in enumerate(large):
        for b in large[i + 1 :]:
            reach = NEAR * np.sqrt(area[a])
            near = max(np.abs(low[a] - low[b]).max(), np.abs(high[a] - high[b]).max()) <= 2 * reach
            if near and min(area[a], area[b]) >= ALIKE * max(area[a], area[b]):
                yield int(a), int(b)


def _gap(V: Floats, one: Ints, two: Ints, side: float, even: bool = False) -> float | None:
    """Return the median distance of parts (k, 3), (l, 3) if each covers the other, else None; even: of nearly equal
    distance."""
    ways = ((one, two), (two, one))
    gaps = np.concatenate([nearest(V[a].mean(axis=1), V, np.ascontiguousarray(b)).distance for a, b in ways])
    area = np.concatenate([lengths(area_vectors(V, a)) for a, _ in ways])
    least, middle, most = weighted_quantiles(gaps, area, (MOST, 0.5, 1 - MOST))
    uneven = 2.5  # a cushion, which ends in an edge, has larger ratios
    if most > NEAR * side or (even and not (most <= uneven * middle and middle <= uneven * least)):
        return None
    return None if middle <= COPY * side < most else float(middle)


def twin_remarks(V: Floats, F: Ints) -> Iterator[str]:
    """Yield a sentence about each pair of parallel sheets of a mesh V (n, 3), metres, F (m, 3)."""
    for pair in twins(V, F):
        yield _TOLD[pair.kind].format(length(pair.gap))


def single_sheets(V: Floats, F: Ints, metres: float) -> tuple[Floats, Ints, tuple[str, ...]]:
    """Return the mesh V (n, 3), F (m, 3) with one sheet in place of copies and slabs, and a short text for each.

    metres : of the mesh's unit, for the texts.

    The first of two copies stays. Of a slab the face without its sides stays, moved halfway towards the other.
    """
    done = [pair for pair in twins(V, F) if pair.kind != "apart"]
    stays: Bools = np.ones(len(F), dtype=bool)
    V = V.copy() if done else V
    for pair in done:
        stays[pair.other] = False
        if pair.kind == "slab":
            stays[pair.piece] = False
            stays[pair.keep] = True
            used = np.unique(F[pair.keep])
            to = V[used] + pair.way if len(pair.way) else nearest(V[used], V, np.ascontiguousarray(F[pair.other])).place
            V[used] = (V[used] + to) / 2
    return V, F[stays], tuple(_DONE[pair.kind].format(length(metres * pair.gap)) for pair in done)
