"""Sheets of a mesh that coincide or pass through each other, and slabs reduced to their middle surface."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, lengths, weighted_quantiles
from dsfab.core.messages import length
from dsfab.surface.mesh import nearest
from dsfab.surface.topology import EdgeTable, connected, edge_table, pieces


def crossings(F: Ints, pairs: Ints) -> Bools:
    """(p,) which pairs (p, 2) of vertices at one place lie where sheets of faces F (m, 3) cross.

    They are inner vertices of both, and the ends of such a crossing at the edges of both.
    """
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
    """(n,) vertices of faces that repeat others once vertices are what they `became` (n,)."""
    _, same, count = np.unique(np.sort(became[F], axis=1), axis=0, return_inverse=True, return_counts=True)
    twice = np.zeros(len(became), dtype=bool)
    twice[F[(count > 1)[same.ravel()]]] = True
    return twice


def _ends(edges: Ints, pairs: Ints, found: Bools) -> Bools:
    """(p,) which of the other pairs are neighbours, along edges (e, 2) on both sides, of one that was found."""
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
"""Gap over the side of a square of a sheet's area under which one sheet over another is a copy: none builds both."""
NEAR = 0.08
"""The same up to which two sheets, one over all of the other, are told, and two faces of a closed piece are a slab."""
FOLD = 60.0
"""Degrees between neighbouring faces from which the sides of a slab part its two faces; folds of these may, too."""
ALIKE = 0.8
"""Share of the larger one's area that the smaller of two such faces has at least."""
COVER = 0.7
"""Share of the area of a closed piece that a slab's two faces are at least."""
EVEN = 2.5
"""A slab is about as thick nearly everywhere: its largest distance over the median, and that over the least; a cushion
ends in an edge."""
MOVED = 0.05
"""Share of its way by which a face that was moved, as an extruded sheet is, may lie beside the other one."""
ASIDE = 0.25
"""The same from which a face of it is one of its sides, which hang on it where they fold little: their middles lie a
third of that way off at least."""
FITS = 5
"""Rounds in which that way is found."""
MOST = 0.1
"""Share of the area at either end of the distances that does not count: sides are near both faces."""
LARGE = 0.01
"""Share of all area under which a part is not looked at."""


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
    """Two parts of a mesh that lie one over the other.

    keep, other : (k,), (l,) their faces; of a slab the smaller part first, for its sides may hang on the other where
                  they fold little, else the one that comes first in the file.
    gap         : the median distance between them, in the mesh's unit.
    kind        : copy, a second time the same sheet; slab, the two faces of a solid; apart, two sheets.
    piece       : (p,) all faces of the piece that a slab is.
    way         : (3,) from the one to the other where a slab is a sheet extruded along it; else nothing, (0,).
    """

    keep: Ints
    other: Ints
    gap: float
    kind: str
    piece: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    way: Floats = field(default_factory=lambda: np.zeros(0))


def twins(V: Floats, F: Ints) -> tuple[Twins, ...]:
    """The parts of the mesh V (n, 3), F (m, 3), any unit, that lie one over all of the other."""
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
    """The closed pieces that are two faces and sides: what is left without parts that have none beside them is two."""
    area, paired = lengths(area_vectors(V, F)) / 2, np.isin(part, np.unique(pairs))
    for p in np.unique(piece[paired]):
        mine, faces = np.flatnonzero(piece == p), np.flatnonzero((piece == p) & paired)
        names, which = np.unique(part[faces], return_inverse=True)
        count = len(names)
        if count > 2:  # folded faces; of two, sides that fold little hang on one and touch the other
            count, which = pieces(F[faces], edge_table(F[faces]))
        if count != 2 or edge_table(F[mine]).boundary.any() or area[faces].sum() < COVER * area[mine].sum():
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
                one = one[nearest(to, V, np.ascontiguousarray(F[two])).distance < ASIDE * gap]
            yield Twins(one, two, gap, "slab", mine, way)


def _way(V: Floats, one: Ints, two: Ints, side: float) -> Floats:
    """(3,) by which a part (k, 3) was moved to be the other (l, 3), as a sheet is that was extruded; (0,) where it was
    not. On steep faces of such a slab it is far thinner than it is high: 20 mm of 100 at the foot of a half barrel.

    Found as for the registration of scans [Chen and Medioni 1992]: what lies beside it across its faces is taken away.
    """
    P, n = V[one].mean(axis=1), area_vectors(V, one)
    area = lengths(n)
    n /= np.maximum(area, 1e-300)[:, None]
    other = lengths(area_vectors(V, two))
    way = other @ V[two].mean(axis=1) / other.sum() - area @ P / area.sum()
    faces = np.ascontiguousarray(two)
    for _ in range(FITS):
        off = np.einsum("ki,ki->k", n, nearest(P + way, V, faces).place - P - way)
        way += np.linalg.pinv((area[:, None] * n).T @ n, rcond=1e-6, hermitian=True) @ (n.T @ (area * off))
    far = float(np.linalg.norm(way))
    ways = ((P + way, faces, area), (V[two].mean(axis=1) - way, np.ascontiguousarray(one), other))
    beside = max(float(weighted_quantiles(nearest(at, V, to).distance, w, (1 - MOST,))[0]) for at, to, w in ways)
    return way if COPY * side < far <= NEAR * side and beside <= MOVED * far else np.zeros(0)


def _parts(V: Floats, F: Ints, edges: EdgeTable) -> Ints:
    """(m,) the part of each face: neighbours across an edge of two faces are in one, unless it folds sharply there."""
    pair = edges.pairs
    ends = V[edges.ends[edges.count == 2]]
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(lengths(along), 1e-300)[:, None]
    away = V[F.ravel()[pair - pair % 3 + (pair + 2) % 3]] - ends[:, :1]
    away -= np.einsum("eki,ei->ek", away, along)[..., None] * along[:, None]
    away /= np.maximum(np.linalg.norm(away, axis=2), 1e-300)[..., None]
    flat = np.einsum("ei,ei->e", away[:, 0], away[:, 1]) < -np.cos(np.radians(FOLD))
    return connected(len(F), pair[flat, 0] // 3, pair[flat, 1] // 3)[1]


def _candidates(V: Floats, F: Ints, part: Ints, area: Floats) -> Iterator[tuple[int, int]]:
    """Pairs of large parts of about the same area and box, the one that comes first in the file before the other."""
    large = np.flatnonzero(area >= LARGE * area.sum())
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
    """The median distance of two parts (k, 3), (l, 3) where each lies over all of the other; even: about the same."""
    ways = ((one, two), (two, one))
    gaps = np.concatenate([nearest(V[a].mean(axis=1), V, np.ascontiguousarray(b)).distance for a, b in ways])
    area = np.concatenate([lengths(area_vectors(V, a)) for a, _ in ways])
    least, middle, most = weighted_quantiles(gaps, area, (MOST, 0.5, 1 - MOST))
    if most > NEAR * side or (even and not (most <= EVEN * middle and middle <= EVEN * least)):
        return None
    return None if middle <= COPY * side < most else float(middle)


def twin_remarks(V: Floats, F: Ints) -> Iterator[str]:
    """What is to be told of the sheets of a mesh V (n, 3), metres, F (m, 3) that are there twice, a sentence each."""
    for pair in twins(V, F):
        yield _TOLD[pair.kind].format(length(pair.gap))


def single_sheets(V: Floats, F: Ints, metres: float) -> tuple[Floats, Ints, tuple[str, ...]]:
    """The mesh V (n, 3), F (m, 3) with one sheet where copies and slabs were, and a few words for each.

    metres : of the mesh's unit, for the words.

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
