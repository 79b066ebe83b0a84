"""Sheets that cross themselves: cut into patches that do not, each thickened by itself, and the solids united.

    \\  /        Faces whose prisms meet go to different patches, patches with such faces to different colours; the
     \\/         patches of one colour are one closed mesh. The cuts between patches vanish in the union, for both sides
     /\\         have the same wall there.
    /  \\
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import Surface, signed_volumes
from dsfab.surface.topology import corner_fans, edge_table, pieces
from dsfab.thickening.coarsen import coarsened
from dsfab.thickening.intersect import intersecting_pairs
from dsfab.thickening.rounding import rounded
from dsfab.thickening.seams import Overlap, overlaps
from dsfab.thickening.skin import Skin
from dsfab.units import MM_PER_M

PATCHES = 400
"""With more patches than this the sheet is no sheet that crosses itself along lines: it is not united."""

ROUNDS = 30
"""Rounds of finding faces that meet within a colour, and separating them or, if they touch in the sheet, thinning."""

COLLAPSES = (1.0, 4.0, 16.0, 64.0)
"""Edges of a union up to so many steps of single precision are collapsed, if faces meet in it."""

THIN = 0.8
"""What offsets are multiplied by where faces meet, per round."""

THINNEST = 0.3
"""Share of the given offset below which nothing is thinned."""


@dataclass(frozen=True, eq=False)
class United:
    """A closed mesh V (n, 3), F (m, 3), the pairs of faces in it that still intersect (k, 2), and its pieces.

    share  : (n',) of the given offset that was left at each vertex of the sheet.
    places : how many separate lines the sheet crosses itself along.
    """

    V: Floats
    F: Ints
    pairs: Ints
    pieces: int
    share: Floats
    places: int


def united_prisms(surface: Surface, corners: Floats, skin: Skin, pairs: Ints) -> United | None:
    """The union of the prisms over a sheet, of whose solid the faces in `pairs` (k, 2) intersect.

    corners : (m, 3, 3) offset vectors at the corners of the faces, seen from each. None where it would take too many
    patches, or manifold3d does not take one of the parts.

    No cut parts faces that meet and have a common vertex: there the sheet bends too tightly, and is made thinner.
    """
    graph, share = _dual(surface), np.ones(surface.n)
    label = pieces(surface.F, surface.edges)[1]
    found = skin.sources()[pairs]
    around = _touching(surface.F[found])
    clashes = np.empty((0, 2), dtype=np.int64)
    for round_ in range(ROUNDS):
        stuck = _stuck(found, around, label)
        clashes = np.unique(np.concatenate([clashes, np.sort(found[~stuck], axis=1)]), axis=0)
        thin = np.unique(surface.F[found[stuck]]) if round_ else np.empty(0, dtype=np.int64)  # first without thinning
        thin = thin[share[thin] > THINNEST]
        share[thin] = np.maximum(THIN * share[thin], THINNEST)
        cut = _separated(label, clashes, graph)
        if cut is None:
            return None
        label = cut
        colour, D = _coloured(label, clashes), corners * share[surface.F][:, :, None]
        parts = [_part(surface, D, overlap, skin) for overlap in overlaps(surface, colour, clashes)]
        found, around = (np.concatenate([getattr(part, key) for part in parts]) for key in ("found", "around"))
        if not len(found) or (round_ and not len(thin) and _stuck(found, around, label).all()):
            break
    merged = _union([(part.V, part.F) for part in parts])
    if merged is None:
        return None
    V, F, pairs = _settled(*merged, skin.single)
    return United(V, F, pairs, _outer_shells(V, F), share, _places(surface, clashes, graph))


def _settled(V: Floats, F: Ints, single: bool) -> tuple[Floats, Ints, Ints]:
    """A union with as few pairs that intersect as edges shorter than rounding leaves of it, and these pairs.

    Where two surfaces cross near a vertex their line has points closer together than single precision holds apart.
    """
    step = float(np.spacing(np.float32(np.abs(V).max() * MM_PER_M))) / MM_PER_M
    best: tuple[Floats, Ints, Ints] | None = None
    for tolerance in (0.0, *(step * factor for factor in COLLAPSES)):
        P, S = coarsened(V, F, tolerance) if tolerance else (V, F)
        pairs = intersecting_pairs(P, S)
        if single:
            exact, pairs = len(pairs), intersecting_pairs(rounded(P), S)
            P = rounded(P) if len(pairs) <= exact else P
        if best is None or len(pairs) < len(best[2]):
            best = P, S, pairs
        if not len(pairs):
            break
    assert best is not None
    return best


def _dual(surface: Surface) -> csr_array:
    """(m, m) distances between the middles of neighbours, metres."""
    f, g = (surface.edges.pairs // 3).T
    reach = np.linalg.norm(surface.centroids[f] - surface.centroids[g], axis=1)
    reach = np.maximum(reach, np.finfo(float).tiny)
    both = np.concatenate([f, g]), np.concatenate([g, f])
    return csr_array((np.concatenate([reach, reach]), both), shape=(surface.m, surface.m))


def _stuck(found: Ints, around: Bools, label: Ints) -> Bools:
    """(k,) the pairs of faces of one patch that lie around a common vertex: no cut parts them.

    Where a part only touches itself in a vertex, for the face between is in no patch of it, faces do not lie around
    that: they can be parted.
    """
    return np.asarray(around & (label[found[:, 0]] == label[found[:, 1]]))


def _touching(F: Ints) -> Bools:
    """(k,) pairs of faces (k, 2, 3) with a common vertex."""
    return np.asarray((F[:, 0, :, None] == F[:, 1, None, :]).any(axis=(1, 2)))


def _separated(label: Ints, clashes: Ints, graph: csr_array) -> Ints | None:
    """Patches (m,) cut until no two faces that clash are in one: halfway between the two; None beyond PATCHES."""
    label = label.copy()
    count = int(label.max()) + 1
    while True:
        inside = clashes[label[clashes[:, 0]] == label[clashes[:, 1]]]
        if not len(inside):
            return label
        for patch, at in zip(*np.unique(label[inside[:, 0]], return_index=True), strict=True):
            faces = np.flatnonzero(label == patch)
            ends = np.searchsorted(faces, inside[at])
            away = dijkstra(graph[faces][:, faces], directed=False, indices=ends)
            label[faces[away[1] < away[0]]] = count
            count += 1
        if count > PATCHES:
            return None


def _coloured(label: Ints, clashes: Ints) -> Ints:
    """(m,) colours of the faces so that patches that clash differ; the largest patches choose first."""
    patch, of, size = np.unique(label, return_inverse=True, return_counts=True)
    rivals: list[set[int]] = [set() for _ in patch]
    for a, b in np.unique(of[clashes], axis=0).tolist():
        rivals[a].add(b)
        rivals[b].add(a)
    colour = np.full(len(patch), -1)
    for k in np.argsort(-size, kind="stable").tolist():
        taken = {int(colour[r]) for r in rivals[k]}
        colour[k] = next(c for c in range(len(patch)) if c not in taken)
    return np.asarray(colour[of])


class _Part(NamedTuple):
    """A closed mesh V (n, 3), F (m, 3), the pairs of sheet faces (k, 2) whose prisms meet in it, and which of these lie
    around a common vertex of it (k,)."""

    V: Floats
    F: Ints
    found: Ints
    around: Bools


def _part(surface: Surface, corners: Floats, overlap: Overlap, like: Skin) -> _Part:
    """The closed mesh over the faces of a part.

    Patches that meet in a vertex get it twice, so that each is closed by itself.
    """
    faces = np.flatnonzero(overlap.faces)
    F = corner_fans(surface.F[faces], edge_table(surface.F[faces]))
    _, first = np.unique(F.ravel(), return_index=True)
    old = surface.F[faces].ravel()[first]
    sheet = Surface(overlap.V[old], F)
    D = corners[faces].reshape(-1, 3)[first] * overlap.share[old, None]
    skin = Skin.of(sheet, like.shift, like.single)
    V, S = skin.vertices(sheet.V, D), skin.faces(skin.shorter_diagonals(sheet.V, D))
    found = skin.sources()[intersecting_pairs(V, S)]
    return _Part(V, S, faces[found], _touching(F[found]))


def _union(parts: list[tuple[Floats, Ints]]) -> tuple[Floats, Ints] | None:
    """One closed mesh around all parts, None when manifold3d does not take one of them."""
    import manifold3d

    solids = [manifold3d.Manifold(manifold3d.Mesh64(np.array(V), np.array(F, dtype=np.uint64))) for V, F in parts]
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    good = manifold3d.Error.NoError
    if any(solid.status() != good for solid in (*solids, whole)) or whole.is_empty():
        return None
    mesh = whole.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3].astype(np.float64), np.asarray(mesh.tri_verts).astype(np.int64)


def _outer_shells(V: Floats, F: Ints) -> int:
    """How many closed surfaces of the mesh are outer ones; the others are voids."""
    count, label = pieces(F, edge_table(F))
    return int((signed_volumes(V, F, label, count) > 0).sum())


def _places(surface: Surface, clashes: Ints, graph: csr_array) -> int:
    """How many clusters the faces that clash form, over neighbours and across the crossings."""
    involved = np.unique(clashes)
    i, j = np.searchsorted(involved, clashes).T
    across = csr_array((np.ones(len(i)), (i, j)), shape=(len(involved),) * 2)
    return int(connected_components(graph[involved][:, involved] + across, directed=False)[0])
