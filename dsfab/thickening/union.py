"""Solid of a sheet that crosses itself: the union of thickened patches."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.units import MM_PER_M
from dsfab.surface import signed_volumes
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import adjacency, corner_fans, corners_of, edge_table, pieces
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import Skin, coarsen_mesh, round_to_single

INWARD = 0.005  # Vertices at seams and patch borders move by this fraction of the way to their neighbours' mean.


@dataclass(frozen=True, eq=False)
class Overlap:
    """A part of the sheet, extended over adjacent faces of neighbouring parts.
    faces : (m,) mask of the part's faces.    V : (n, 3) vertices of the sheet, metres; moved near the part's ends.
    share : (n,) factors of the half-thickness vectors at the vertices."""

    faces: Bools
    V: Floats
    share: Floats


def overlaps(surface: Surface, colour: Ints, clashes: Ints) -> list[Overlap]:
    """Divide a sheet into overlapping parts: the faces of each colour, and adjacent faces of higher colours.
    colour  : (m,) colour number of each face.
    clashes : (k, 2) pairs of faces whose thickened solids meet; no part contains both faces of a pair."""
    neighbours = adjacency(surface.edges, surface.n)
    count = int(colour.max()) + 1
    own_vertices = [corners_of(surface.F, colour == c, surface.n) for c in range(count)]
    extensions = [_extension(surface, colour, c, own_vertices[c], clashes) for c in range(count)]
    parts = []
    for c in range(count):
        beyond = corners_of(surface.F, extensions[c], surface.n) & ~own_vertices[c]
        on_seam, open_seam = np.zeros((2, surface.n), dtype=bool)
        for lower in range(c):
            shared = own_vertices[c] & own_vertices[lower]
            open_ = shared & corners_of(surface.F, (colour == c) & ~extensions[lower], surface.n)
            on_seam, open_seam = on_seam | (shared & ~open_), open_seam | open_
        on_seam &= ~open_seam
        inside = corners_of(surface.F, colour < c, surface.n) & ~on_seam if c else np.zeros(surface.n, dtype=bool)
        V = _shrink_ends(surface, neighbours, beyond, own_vertices[c])
        V = _move_towards(V, neighbours, on_seam, inside, INWARD)
        share = np.ones(surface.n)
        step = 0.01 * (1 + 0.5 * c)
        share[(neighbours @ on_seam.astype(float) > 0) & own_vertices[c] & ~open_seam] = 1 - step
        share[on_seam] = 1 - 2 * step
        parts.append(Overlap((colour == c) | extensions[c], V, share))
    return parts


def _extension(surface: Surface, colour: Ints, c: int, own_vertices: Bools, clashes: Ints) -> Bools:
    extension = (colour > c) & own_vertices[surface.F].any(axis=1)
    part = extension | (colour == c)
    meet = clashes[part[clashes].all(axis=1)]
    extension[meet.ravel()] = False
    return np.asarray(extension)


def _shrink_ends(surface: Surface, neighbours: csr_array, beyond: Bools, own_vertices: Bools) -> Floats:
    i, j = np.concatenate([surface.edges.ends, surface.edges.ends[:, ::-1]]).T
    used = beyond[i] & own_vertices[j]
    i, j = i[used], j[used]
    order = np.lexsort([np.linalg.norm(surface.V[i] - surface.V[j], axis=1), i])
    moved, nearest = np.unique(i[order], return_index=True)
    V = surface.V.copy()
    V[moved] += 0.45 * (surface.V[j[order][nearest]] - V[moved])
    return _move_towards(V, neighbours, beyond, own_vertices, INWARD)  # keeps edges of two skins apart


def _move_towards(V: Floats, neighbours: csr_array, moves: Bools, towards: Bools, share: float) -> Floats:
    count = neighbours @ towards.astype(float)
    rows = np.flatnonzero(moves & (count > 0))
    V = V.copy()
    V[rows] += share * ((neighbours[rows] @ (V * towards[:, None])) / count[rows, None] - V[rows])
    return V


THIN = 0.8  # Factor by which each round shortens the offsets at intersecting faces.
THINNEST = 0.3  # Smallest fraction of an offset that thinning leaves.


@dataclass(frozen=True, eq=False)
class PrismUnion:
    """Solid of a sheet that crosses itself: closed mesh V (n, 3), metres, F (m, 3), and its number of pieces.
    pairs  : (k, 2) pairs of faces of this mesh that intersect.
    share  : (n',) remaining fraction of the thickness at each vertex of the sheet."""

    V: Floats
    F: Ints
    pairs: Ints
    pieces: int
    share: Floats
    places: int


def prism_union(surface: Surface, corners: Floats, skin: Skin, pairs: Ints) -> PrismUnion | None:
    """Return the solid of a sheet that crosses itself; None if division or union fails.
    corners : (m, 3, 3) half-thickness vectors at the corners of the faces, on the side of each face's normal, metres.
    pairs   : (k, 2) pairs of faces of `skin` that intersect."""
    graph, share = _dual(surface), np.ones(surface.n)
    label = pieces(surface.F, surface.edges)[1]
    meeting = skin.sources()[pairs]
    around = _touching(surface.F[meeting])
    clashes = np.empty((0, 2), dtype=np.int64)
    for round_ in range(30):
        inseparable = _stuck(meeting, around, label)
        clashes = np.unique(np.concatenate([clashes, np.sort(meeting[~inseparable], axis=1)]), axis=0)
        thin = np.unique(surface.F[meeting[inseparable & bool(round_)]])  # the first round shortens no offset
        thin = thin[share[thin] > THINNEST]
        share[thin] = np.maximum(THIN * share[thin], THINNEST)
        cut = _cut_patches(label, clashes, graph)
        if cut is None:
            return None
        label = cut
        colour, D = _patch_colours(label, clashes), corners * share[surface.F][:, :, None]
        parts = [prism_part(surface, D, overlap, skin) for overlap in overlaps(surface, colour, clashes)]
        meeting, around = (np.concatenate([getattr(part, key) for part in parts]) for key in ("found", "around"))
        if not len(meeting) or (round_ and not len(thin) and _stuck(meeting, around, label).all()):
            break
    merged = _union([(part.V, part.F) for part in parts])
    if merged is None:
        return None
    V, F, pairs = _collapse_short_edges(*merged, skin.single)
    return PrismUnion(V, F, pairs, _outer_shells(V, F), share, _crossing_count(surface, clashes, graph))


def _collapse_short_edges(V: Floats, F: Ints, single: bool) -> tuple[Floats, Ints, Ints]:
    step = float(np.spacing(np.float32(np.abs(V).max() * MM_PER_M))) / MM_PER_M
    result: tuple[Floats, Ints, Ints] | None = None
    for tolerance in (0.0, *(step * factor for factor in (1.0, 4.0, 16.0, 64.0))):
        P, S = coarsen_mesh(V, F, tolerance) if tolerance else (V, F)
        pairs = intersecting_pairs(P, S)
        if single:
            exact, pairs = len(pairs), intersecting_pairs(round_to_single(P), S)
            P = round_to_single(P) if len(pairs) <= exact else P
        if result is None or len(pairs) < len(result[2]):
            result = P, S, pairs
        if not len(pairs):
            break
    assert result is not None
    return result


def _dual(surface: Surface) -> csr_array:
    f, g = (surface.edges.pairs // 3).T
    reach = np.linalg.norm(surface.centroids[f] - surface.centroids[g], axis=1)
    reach = np.maximum(reach, np.finfo(float).tiny)
    index_pairs = np.concatenate([f, g]), np.concatenate([g, f])
    return csr_array((np.concatenate([reach, reach]), index_pairs), shape=(surface.m, surface.m))


def _stuck(face_pairs: Ints, around: Bools, label: Ints) -> Bools:
    return np.asarray(around & (label[face_pairs[:, 0]] == label[face_pairs[:, 1]]))


def _touching(F: Ints) -> Bools:
    return np.asarray((F[:, 0, :, None] == F[:, 1, None, :]).any(axis=(1, 2)))


def _cut_patches(label: Ints, clashes: Ints, graph: csr_array, patch_limit: int = 400) -> Ints | None:
    """Return the patch number (m,) of each face. The two faces of a row of `clashes` are in different patches.
    label : (m,) initial patch numbers.    Return None for more than `patch_limit` patches."""
    label = label.copy()
    count = int(label.max()) + 1
    while True:
        inside = clashes[label[clashes[:, 0]] == label[clashes[:, 1]]]
        if not len(inside):
            return label
        for patch, first_rows in zip(*np.unique(label[inside[:, 0]], return_index=True), strict=True):
            faces = np.flatnonzero(label == patch)
            ends = np.searchsorted(faces, inside[first_rows])
            away = dijkstra(graph[faces][:, faces], directed=False, indices=ends)
            label[faces[away[1] < away[0]]] = count
            count += 1
        if count > patch_limit:
            return None


def _patch_colours(label: Ints, clashes: Ints) -> Ints:
    patch, patch_of_face, size = np.unique(label, return_inverse=True, return_counts=True)
    rivals: list[set[int]] = [set() for _ in patch]
    for a, b in np.unique(patch_of_face[clashes], axis=0).tolist():
        rivals[a].add(b)
        rivals[b].add(a)
    colour = np.full(len(patch), -1)
    for k in np.argsort(-size, kind="stable").tolist():
        taken = {int(colour[r]) for r in rivals[k]}
        colour[k] = next(c for c in range(len(patch)) if c not in taken)
    return np.asarray(colour[patch_of_face])


class PrismPart(NamedTuple):
    """A thickened part of a sheet: closed mesh V (n, 3), metres, F (m, 3).
    found  : (k, 2) pairs of the sheet's faces that meet after thickening in this part.
    around : (k,) mask of the pairs with a common vertex."""

    V: Floats
    F: Ints
    found: Ints
    around: Bools


def prism_part(surface: Surface, corners: Floats, overlap: Overlap, like: Skin) -> PrismPart:
    """Return the thickened part of a sheet that `overlap` describes.
    corners : (m, 3, 3) half-thickness vectors at the corners of the sheet's faces, metres."""
    faces = np.flatnonzero(overlap.faces)
    F = corner_fans(surface.F[faces], edge_table(surface.F[faces]))
    _, first_corner = np.unique(F.ravel(), return_index=True)
    sheet_vertex = surface.F[faces].ravel()[first_corner]
    sheet = Surface(overlap.V[sheet_vertex], F)
    D = corners[faces].reshape(-1, 3)[first_corner] * overlap.share[sheet_vertex, None]
    skin = Skin.from_surface(sheet, like.shift, like.single)
    V, S = skin.vertices(sheet.V, D), skin.faces(skin.shorter_diagonals(sheet.V, D))
    face_pairs = skin.sources()[intersecting_pairs(V, S)]
    return PrismPart(V, S, faces[face_pairs], _touching(F[face_pairs]))


def _union(parts: list[tuple[Floats, Ints]]) -> tuple[Floats, Ints] | None:
    import manifold3d

    solids = [manifold3d.Manifold(manifold3d.Mesh64(np.array(V), np.array(F, dtype=np.uint64))) for V, F in parts]
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    no_error = manifold3d.Error.NoError
    if any(solid.status() != no_error for solid in (*solids, union)) or union.is_empty():
        return None
    mesh = union.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3].astype(np.float64), np.asarray(mesh.tri_verts).astype(np.int64)


def _outer_shells(V: Floats, F: Ints) -> int:
    count, label = pieces(F, edge_table(F))
    return int((signed_volumes(V, F, label, count) > 0).sum())


def _crossing_count(surface: Surface, clashes: Ints, graph: csr_array) -> int:
    involved = np.unique(clashes)
    i, j = np.searchsorted(involved, clashes).T
    across = csr_array((np.ones(len(i)), (i, j)), shape=(len(involved),) * 2)
    return int(connected_components(graph[involved][:, involved] + across, directed=False)[0])
