"""Repair of a mesh with sheets (connected layers of faces) that coincide or cross."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from heapq import heappop, heappush

import igl
import numpy as np

from dsfab.core.arrays import (
    Bools,
    Floats,
    Ints,
    area_vectors,
    distinct,
    first_few,
    lengths,
    unit_vectors,
    weighted_quantiles,
)
from dsfab.core.messages import length
from dsfab.surface.clean.seams import SAG, WELD, faces_with_area, in_reach, merged_vertices
from dsfab.surface.mesh import bounding_box, nearest_places
from dsfab.surface.topology import EdgeTable, corners_of, edge_table, link_components, pieces


def crossing_pairs(F: Ints, pairs: Ints) -> Bools:
    """Return a mask (p,) of vertex pairs that lie on a line where two sheets of a mesh F (m, 3) cross.
    pairs : (p, 2) numbers of vertices with the same position."""
    edges = edge_table(F)
    n = int(max(F.max(), pairs.max())) + 1
    inner = np.zeros(n, dtype=bool)
    inner[F] = True
    inner[edges.ends[edges.count != 2]] = False
    low, high = np.sort(pairs, axis=1).T
    is_crossing = inner[low] & inner[high] & ~np.isin(low * n + high, edges.ends[:, 0] * n + edges.ends[:, 1])
    if not is_crossing.any():
        return np.asarray(is_crossing)
    twice = _on_repeated_faces(F, link_components(n, low, high)[1])
    is_crossing &= ~(twice[low] & twice[high])
    return np.asarray(is_crossing | _crossing_ends(edges.ends, pairs, is_crossing))


def _on_repeated_faces(F: Ints, became: Ints) -> Bools:
    faces = became[F]
    _, group, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    edges, is_twice = edge_table(faces), (count > 1)[group.ravel()]
    owner, edge = edges.order // 3, edges.of.ravel()[edges.order]
    for step in range(1, int(edges.count.max())):
        other = (edge[step:] == edge[:-step]) & ~(is_twice[owner[step:]] & is_twice[owner[:-step]])
        pairs = np.stack([owner[:-step][other], owner[step:][other]])
        is_twice[pairs[:, _of_one_quad(faces, *pairs)]] = True
    return corners_of(F, is_twice, len(became))


def _crossing_ends(edges: Ints, pairs: Ints, is_crossing: Bools) -> Bools:
    neighbours: dict[int, set[int]] = {}
    for a, b in edges[np.isin(edges, pairs[is_crossing]).any(axis=1)].tolist():
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    pairs_at: dict[int, list[int]] = {}
    for pair, pair_vertices in enumerate(pairs.tolist()):
        for vertex in () if is_crossing[pair] else pair_vertices:
            pairs_at.setdefault(vertex, []).append(pair)
    ends = np.zeros(len(pairs), dtype=bool)
    for a, b in pairs[is_crossing].tolist():
        for c in neighbours[a]:
            for pair in pairs_at.get(c, ()):
                ends[pair] |= int(pairs[pair].sum()) - c in neighbours[b]
    return ends


SAMPLES = np.array(
    [[0.36, 0.33, 0.31], [0.8, 0.11, 0.09], [0.1, 0.79, 0.11], [0.09, 0.12, 0.79]]
    + [[0.48, 0.43, 0.09], [0.1, 0.47, 0.43], [0.44, 0.08, 0.48]]
)
"""Barycentric coordinates (7, 3) of sample points in a face: near its middle, its three corners and its three edges.
The weights are uneven, so that no sample point lies on an edge that divides a square into halves or quarters."""


@dataclass(frozen=True, eq=False)
class OverlappingFaces:
    """Numbers of faces that other faces cover: `whole` (k,) over their whole area, `part` (l,) over a part of it."""

    whole: Ints
    part: Ints


def overlapping_faces(V: Floats, F: Ints) -> OverlappingFaces:
    """Return the faces of a mesh V (n, 3), F (m, 3) that other faces cover [Jacobson et al. 2018, libigl]."""
    edges = edge_table(F)
    rim, side = np.nonzero(edges.boundary[edges.of])
    m, (low, high) = len(F), bounding_box(V, F)
    V = np.ascontiguousarray((V - (low + high) / 2) / max(float((high - low).max()), 1e-300))
    F, tree = np.ascontiguousarray(F), igl.AABB()
    tree.init(V, F)
    middles = np.zeros(m, dtype=np.int64)
    first_covers = _covers(tree, V, F, np.concatenate([np.arange(m), rim]), np.concatenate([middles, 4 + side]))
    if not len(first_covers):
        return OverlappingFaces(rim[:0], rim[:0])
    around = np.flatnonzero(corners_of(F, np.isin(np.arange(m), first_covers[:, [0, 2]]), len(V))[F].any(axis=1))
    covers = _covers(tree, V, F, np.repeat(around, len(SAMPLES)), np.tile(np.arange(len(SAMPLES)), len(around)))
    stays = _one_sheet(V, F, edges, covers)
    added = ~stays & ~_is_covered(covers, stays)
    stays = (stays & ~_is_covered(covers, added)) | added
    removed = np.flatnonzero(~stays)
    is_tied = _tied_faces(edges, covers, removed)
    stays[removed[is_tied]] = True
    face, _, cover = covers[stays[covers[:, 0]] & stays[covers[:, 2]]].T
    folds = np.flatnonzero((edges.of[face][:, :, None] == edges.of[cover][:, None, :]).any(axis=(1, 2)))
    return OverlappingFaces(removed[~is_tied], distinct(np.delete(face, folds)))


def _covers(tree: igl.AABB, V: Floats, F: Ints, faces: Ints, samples: Ints) -> Ints:
    """Return index triples (k, 3): a face, a sample point (row of `SAMPLES`), and another face that covers the point.
    faces, samples : (r,) pairs of a face and a sample point to test."""
    P = V[F]
    normal = unit_vectors(area_vectors(V, F))
    reach = np.maximum(SAG * lengths(P - np.roll(P, 1, axis=1)).max(axis=1), WELD)[faces]
    starts = np.einsum("kc,kci->ki", SAMPLES[samples], P[faces]) - reach[:, None] * normal[faces]
    # rays are long, because libigl misses faces with area x ray length below 5e-7
    rays = tree.intersect_ray(V, F, starts, normal[faces] / WELD**2)
    # every ray hits the face from which it starts
    hits = np.array([(k, *hit[:2]) for k, ray in enumerate(rays) if len(ray) > 1 for hit in ray]).reshape(-1, 3)
    row, cover = hits[:, :2].astype(np.int64).T
    distance = np.abs(hits[:, 2] / WELD**2 - reach[row])
    is_near = (cover != faces[row]) & (distance <= reach[row])
    row, cover = row[is_near], cover[is_near]
    face = faces[row]
    height = np.abs(np.einsum("kci,ki->kc", P[cover] - P[face, :1], normal[face])).max(axis=1, initial=0)
    back = np.abs(np.einsum("kci,ki->kc", P[face] - P[cover, :1], normal[cover])).max(axis=1, initial=0)
    counts = np.minimum(height, back) <= WELD
    if not counts.all():
        counts |= _of_one_quad(merged_vertices(V, WELD)[1][F], face, cover)
    return np.asarray(np.stack([face, samples[row], cover], axis=1)[counts])


def _of_one_quad(F: Ints, face: Ints, cover: Ints) -> Bools:
    is_equal = F[face][:, :, None] == F[cover][:, None, :]
    is_shared, is_shared_there = is_equal.any(axis=2), is_equal.any(axis=1)
    result: Bools = (is_shared.sum(axis=1) == 2) & (is_shared_there.sum(axis=1) == 2)
    if result.any():
        candidates = F[corners_of(F[face], result, int(F.max()) + 1)[F].sum(axis=1) >= 2]
        triples = set(map(tuple, np.sort(candidates, axis=1).tolist()))
        ends = np.stack([F[face][~is_shared & result[:, None]], F[cover][~is_shared_there & result[:, None]]], axis=1)
        common = F[face][is_shared & result[:, None]].reshape(-1, 2)
        thirds = (np.sort(np.c_[ends, common[:, k]], axis=1).tolist() for k in (0, 1))
        result[result] = [tuple(a) in triples and tuple(b) in triples for a, b in zip(*thirds, strict=True)]
    return result


def _one_sheet(V: Floats, F: Ints, edges: EdgeTable, covers: Ints) -> Bools:
    overlaps, chosen = dict[int, set[int]](), list[int]()
    for face, cover in np.stack(np.divmod(distinct(covers[:, 0] * len(F) + covers[:, 2]), len(F)), axis=1).tolist():
        overlaps.setdefault(face, set()).add(cover)
        overlaps.setdefault(cover, set()).add(face)
    owners, start, undecided = (edges.order // 3).tolist(), edges.start.tolist(), set(overlaps)
    sides = zip(overlaps, edges.of[list(overlaps)].tolist(), strict=True)
    neighbours = {face: {owner for k in three for owner in owners[start[k] : start[k + 1]]} for face, three in sides}
    longest = lengths(V[edges.ends[:, 1]] - V[edges.ends[:, 0]])[edges.of].max(axis=1).round(9).tolist()
    for seed in sorted(overlaps, key=lambda face: (neighbours[face] <= overlaps.keys(), longest[face], face)):
        waiting = [(longest[seed], seed)]
        while waiting:
            _, face = heappop(waiting)
            if face in undecided:
                undecided -= {face, *overlaps[face]}
                chosen.append(face)
                for k in neighbours[face] & undecided:
                    heappush(waiting, (longest[k], k))
    stays = np.ones(len(F), dtype=bool)
    stays[list(overlaps)] = False
    stays[chosen] = True
    return stays


def _tied_faces(edges: EdgeTable, covers: Ints, faces: Ints) -> Bools:
    """Return a mask of `faces`. It marks connected groups of faces that would leave an open edge if removed."""
    m, remaining = len(edges.of), np.full(len(edges.ends), -1)
    remaining_faces = np.delete(np.arange(m), faces)
    remaining[edges.of[remaining_faces]] = remaining_faces[:, None]
    keys = faces[:, None] * m + remaining[edges.of[faces]]
    covered = np.isin(keys, np.concatenate([covers[:, 0] * m + covers[:, 2], covers[:, 2] * m + covers[:, 0]]))
    alone = np.bincount(edges.of[remaining_faces].ravel(), minlength=len(edges.ends))[edges.of[faces]] == 1
    order = np.argsort(edges.of[faces].ravel(), kind="stable")
    joined = np.flatnonzero(np.diff(edges.of[faces].ravel()[order]) == 0)
    label = link_components(len(faces), order[joined] // 3, order[joined + 1] // 3)[1]
    return np.isin(label, label[(alone & ~covered).any(axis=1)])


def _is_covered(covers: Ints, by: Bools) -> Bools:
    face, sample, _ = covers[by[covers[:, 2]]].T
    covered_samples = np.bincount(distinct(face * len(SAMPLES) + sample) // len(SAMPLES), minlength=len(by))
    return np.asarray(covered_samples == len(SAMPLES))


COPY_GAP = 1 / 500  # Largest distance between two copies of a sheet, divided by the square root of its area.
PARALLEL_GAP = 0.08  # Largest distance between parallel sheets, divided by the square root of their area.
LEAST_AREA_RATIO = 0.8  # Smallest ratio of the areas of two parallel sheets, smaller to larger.
IGNORED_SHARE = 0.1  # Comparisons use the 10 % and 90 % quantiles of distances, weighted by area.

_REMARKS = {
    "copy": "the surface has two sheets at a distance of only {}, probably two copies of one sheet; delete one of the "
    "sheets, or set surface.mend = true",
    "slab": "the surface is a closed slab, {} thick, so dsfab would build each of its two faces as a sheet; give its "
    "middle surface, or set surface.mend = true",
    "apart": "the surface has two parallel sheets, {} apart, and dsfab builds both sheets; delete one sheet if both "
    "are faces of one thick slab",
}
_REPAIRS = {
    "copy": "a second copy of the sheet, {} from the first copy, was dropped",
    "slab": "a slab, {} thick, was reduced to its middle surface",
}


@dataclass(frozen=True, eq=False)
class ParallelParts:
    """Two parallel parts of a mesh.
    keep, other : (k,) face numbers of the part that stays, and (l,) face numbers of the part that a repair removes.
    gap   : median distance between the parts, mesh's unit.    piece : (p,) numbers of all faces of the slab, or empty.
    kind  : "copy": two coincident sheets; "slab": top and bottom of a thin solid; "apart": two separate sheets.
    way   : (3,) translation from `keep` to `other` if the slab is extruded; else empty, (0,)."""

    keep: Ints
    other: Ints
    gap: float
    kind: str
    piece: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    way: Floats = field(default_factory=lambda: np.zeros(0))


def parallel_parts(V: Floats, F: Ints) -> tuple[ParallelParts, ...]:
    """Return the pairs of parallel parts of a mesh V (n, 3), F (m, 3)."""
    if not len(F):
        return ()
    edges = edge_table(F)
    piece, part = pieces(F, edges)[1], _parts(V, F, edges)
    area = lengths(area_vectors(V, F)) / 2
    pairs = list(_candidate_pairs(V, F, part, np.bincount(part, area).astype(np.float64)))
    parallels, gone = list(_slabs(V, F, piece, part, pairs)), np.zeros(len(F), dtype=bool)
    for pair in parallels:
        gone[pair.piece] = True
    for a, b in pairs:
        first_part, second_part = np.flatnonzero(part == a), np.flatnonzero(part == b)
        if gone[first_part[0]] or gone[second_part[0]]:
            continue
        side = float(np.sqrt(area[first_part].sum()))
        gap = _gap(V, F[first_part], F[second_part], side)
        is_copy = gap is not None and gap <= COPY_GAP * side
        if gap is not None and (is_copy or piece[first_part[0]] != piece[second_part[0]]):
            parallels.append(ParallelParts(first_part, second_part, gap, "copy" if is_copy else "apart"))
            gone[second_part] = is_copy
    return tuple(parallels)


def _slabs(V: Floats, F: Ints, piece: Ints, part: Ints, pairs: list[tuple[int, int]]) -> Iterator[ParallelParts]:
    area, paired = lengths(area_vectors(V, F)) / 2, np.isin(part, np.unique(pairs))
    for p in np.unique(piece[paired]):
        piece_faces, faces = np.flatnonzero(piece == p), np.flatnonzero((piece == p) & paired)
        names, which = np.unique(part[faces], return_inverse=True)
        count = len(names)
        if count > 2:  # folds divide each of the slab's two faces into several parts
            count, which = pieces(F[faces], edge_table(F[faces]))
        # the two large faces make up most of a slab's area
        if count != 2 or edge_table(F[piece_faces]).boundary.any() or area[faces].sum() < 0.7 * area[piece_faces].sum():
            continue
        first_part, second_part = sorted(
            (faces[which == 0], faces[which == 1]), key=lambda those: float(area[those].sum())
        )
        side = float(np.sqrt(area[second_part].sum()))
        if area[first_part].sum() < LEAST_AREA_RATIO * side**2:
            continue
        translation = _translation(V, F[first_part], F[second_part], side)
        moved = len(translation) > 0
        gap = float(np.linalg.norm(translation)) if moved else _gap(V, F[first_part], F[second_part], side, even=True)
        if gap is not None:
            if moved:
                to = V[F[first_part]].mean(axis=1) + translation
                # remove faces at the rim: after the translation, these faces are far from `second_part`
                first_part = first_part[nearest_places(to, V, np.ascontiguousarray(F[second_part])).distance < gap / 4]
            yield ParallelParts(first_part, second_part, gap, "slab", piece_faces, translation)


def _translation(V: Floats, first_part: Ints, second_part: Ints, side: float) -> Floats:
    """Return the translation (3,) that moves the first part of a mesh onto the second part; (0,) if none fits.
    The parts are faces (k, 3). side : square root of the part's area [Chen and Medioni 1992]."""
    P, n = V[first_part].mean(axis=1), area_vectors(V, first_part)
    area = lengths(n)
    n /= np.maximum(area, 1e-300)[:, None]
    second_areas = lengths(area_vectors(V, second_part))
    translation = second_areas @ V[second_part].mean(axis=1) / second_areas.sum() - area @ P / area.sum()
    faces = np.ascontiguousarray(second_part)
    for _ in range(5):
        offsets = np.einsum("ki,ki->k", n, nearest_places(P + translation, V, faces).place - P - translation)
        translation += np.linalg.pinv((area[:, None] * n).T @ n, rcond=1e-6, hermitian=True) @ (n.T @ (area * offsets))
    distance = float(np.linalg.norm(translation))
    directions = (
        (P + translation, faces, area),
        (V[second_part].mean(axis=1) - translation, np.ascontiguousarray(first_part), second_areas),
    )
    misfit = max(
        float(weighted_quantiles(nearest_places(places, V, to).distance, w, (1 - IGNORED_SHARE,))[0])
        for places, to, w in directions
    )
    return (
        translation if COPY_GAP * side < distance <= PARALLEL_GAP * side and misfit <= 0.05 * distance else np.zeros(0)
    )


def _parts(V: Floats, F: Ints, edges: EdgeTable) -> Ints:
    pair = edges.pairs
    ends = V[edges.ends[edges.count == 2]]
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(lengths(along), 1e-300)[:, None]
    away = V[F.ravel()[pair - pair % 3 + (pair + 2) % 3]] - ends[:, :1]
    away -= np.einsum("eki,ei->ek", away, along)[..., None] * along[:, None]
    away /= np.maximum(np.linalg.norm(away, axis=2), 1e-300)[..., None]
    flat = np.einsum("ei,ei->e", away[:, 0], away[:, 1]) < -np.cos(np.radians(60.0))
    return link_components(len(F), pair[flat, 0] // 3, pair[flat, 1] // 3)[1]


def _candidate_pairs(V: Floats, F: Ints, part: Ints, area: Floats) -> Iterator[tuple[int, int]]:
    large = np.flatnonzero(area >= 0.01 * area.sum())
    boxes = {k: V[F[part == k]].reshape(-1, 3) for k in large}
    low = {k: P.min(axis=0) for k, P in boxes.items()}
    high = {k: P.max(axis=0) for k, P in boxes.items()}
    for i, a in enumerate(large):
        for b in large[i + 1 :]:
            reach = PARALLEL_GAP * np.sqrt(area[a])
            is_near = max(np.abs(low[a] - low[b]).max(), np.abs(high[a] - high[b]).max()) <= 2 * reach
            if is_near and min(area[a], area[b]) >= LEAST_AREA_RATIO * max(area[a], area[b]):
                yield int(a), int(b)


def _gap(V: Floats, first_part: Ints, second_part: Ints, side: float, even: bool = False) -> float | None:
    """Return the median distance between two parts of a mesh; None if the parts are not parallel.
    The parts are faces (k, 3). side : square root of a part's area.    even : True for a stricter test."""
    ways = ((first_part, second_part), (second_part, first_part))
    gaps = np.concatenate([nearest_places(V[a].mean(axis=1), V, np.ascontiguousarray(b)).distance for a, b in ways])
    area = np.concatenate([lengths(area_vectors(V, a)) for a, _ in ways])
    least, middle, largest = weighted_quantiles(gaps, area, (IGNORED_SHARE, 0.5, 1 - IGNORED_SHARE))
    uneven = 2.5  # limit for a slab: largest / median distance, and median / smallest distance
    if largest > PARALLEL_GAP * side or (even and not (largest <= uneven * middle and middle <= uneven * least)):
        return None
    return None if middle <= COPY_GAP * side < largest else float(middle)


def parallel_remarks(V: Floats, F: Ints) -> Iterator[str]:
    """Yield warnings about parallel sheets and overlapping faces of a mesh V (n, 3), metres, F (m, 3)."""
    pairs = parallel_parts(V, F)
    for pair in pairs:
        yield _REMARKS[pair.kind].format(length(pair.gap))
    copies = [faces for pair in pairs if pair.kind == "copy" for faces in (pair.keep, pair.other)]
    yield from overlap_remarks(V, F, np.concatenate([np.zeros(0, dtype=np.int64), *copies]))


def overlap_remarks(V: Floats, F: Ints, reported: Ints) -> Iterator[str]:
    """Yield warnings about overlapping faces of a mesh V (n, 3), F (m, 3), except the face numbers `reported` (k,)."""
    sound = np.flatnonzero(in_reach(V)[F].all(axis=1))
    used, near = np.unique(F[sound], return_inverse=True)
    V, became = merged_vertices(V[used], WELD, partial(crossing_pairs, near.reshape(-1, 3)))
    near = became[near.reshape(-1, 3)]
    with_area = faces_with_area(V, near)
    if not len(with_area):
        return
    sound, overlapping = sound[with_area], overlapping_faces(V, near[with_area])
    remedies = "remove these faces, or set surface.mend = true", "cut these faces where they meet other faces"
    for faces, partly, remedy in zip((overlapping.whole, overlapping.part), ("", "partly "), remedies, strict=True):
        faces = np.setdiff1d(sound[faces], reported)
        if len(faces):
            yield (
                f"{len(faces)} of {len(F):,} faces lie {partly}on other faces in the same plane (first: "
                f"{first_few(faces)}), so the sheet is double at these faces; {remedy}"
            )


def single_sheets(V: Floats, F: Ints, metres: float) -> tuple[Floats, Ints, tuple[str, ...]]:
    """Remove second copies of sheets from a mesh V (n, 3), F (m, 3), and replace thin solids by their middle surfaces.
    Return vertices, faces, and a message for each repair. metres : length of the mesh's unit in metres."""
    doubled = [pair for pair in parallel_parts(V, F) if pair.kind != "apart"]
    stays: Bools = np.ones(len(F), dtype=bool)
    V = V.copy() if doubled else V
    for pair in doubled:
        stays[pair.other] = False
        if pair.kind == "slab":
            stays[pair.piece] = False
            stays[pair.keep] = True
            used = np.unique(F[pair.keep])
            to = (
                V[used] + pair.way
                if len(pair.way)
                else nearest_places(V[used], V, np.ascontiguousarray(F[pair.other])).place
            )
            V[used] = (V[used] + to) / 2
    return V, F[stays], tuple(_REPAIRS[pair.kind].format(length(metres * pair.gap)) for pair in doubled)
