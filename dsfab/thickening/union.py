"""Union of patches of a sheet that crosses itself, each thickened alone, with overlaps at their seams."""

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
from dsfab.thickening.skin import Skin, coarsened, rounded

STEP = 0.01
"""By this share of the offset a part is thinner one vertex away from a seam, and by twice of it on the seam; half as
much again for every colour."""

INWARD = 0.005
"""Share of the way to its neighbours in A by which a vertex of B on the seam is moved, and the ends of A aside."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """A part: its faces (m,), those of its neighbours included, its vertices (n, 3), and the share (n,) of the offsets.

    tips : (n,) vertices where it ends in its neighbours.
    """

    faces: Bools
    V: Floats
    share: Floats


def overlaps(surface: Surface, colour: Ints, clashes: Ints) -> list[Overlap]:
    """The parts of each colour (m,), of which lower ones run on into higher ones, but not where they would meet.

    clashes : (k, 2) faces of the sheet that meet others once they are thick.
    """
    near = adjacency(surface.edges, surface.n)
    count = int(colour.max()) + 1
    own = [corners_of(surface.F, colour == c, surface.n) for c in range(count)]
    more = [_extension(surface, colour, c, own[c], clashes) for c in range(count)]
    parts = []
    for c in range(count):
        beyond = corners_of(surface.F, more[c], surface.n) & ~own[c]
        on_seam, open_seam = np.zeros((2, surface.n), dtype=bool)
        for lower in range(c):
            shared = own[c] & own[lower]
            open_ = shared & corners_of(surface.F, (colour == c) & ~more[lower], surface.n)
            on_seam, open_seam = on_seam | (shared & ~open_), open_seam | open_
        on_seam &= ~open_seam
        inside = corners_of(surface.F, colour < c, surface.n) & ~on_seam if c else np.zeros(surface.n, dtype=bool)
        V = _drawn_in(surface, near, beyond, own[c])
        V = _moved(V, near, on_seam, inside, INWARD)
        share = np.ones(surface.n)
        step = STEP * (1 + 0.5 * c)
        share[(near @ on_seam.astype(float) > 0) & own[c] & ~open_seam] = 1 - step
        share[on_seam] = 1 - 2 * step
        parts.append(Overlap((colour == c) | more[c], V, share))
    return parts


def _extension(surface: Surface, colour: Ints, c: int, own: Bools, clashes: Ints) -> Bools:
    """(m,) the faces of higher colours with an `own` vertex of colour c, but those that meet another of the part."""
    more = (colour > c) & own[surface.F].any(axis=1)
    part = more | (colour == c)
    meet = clashes[part[clashes].all(axis=1)]
    more[meet.ravel()] = False
    return np.asarray(more)


def _drawn_in(surface: Surface, near: csr_array, beyond: Bools, own: Bools) -> Floats:
    """Vertices with those `beyond` drawn in by about half along their shortest edge to an `own` one.

    Nearly along it: on the edge itself the end of the part would meet the skins of its neighbour edge on edge.
    """
    i, j = np.concatenate([surface.edges.ends, surface.edges.ends[:, ::-1]]).T
    used = beyond[i] & own[j]
    i, j = i[used], j[used]
    order = np.lexsort([np.linalg.norm(surface.V[i] - surface.V[j], axis=1), i])
    at, nearest = np.unique(i[order], return_index=True)
    V = surface.V.copy()
    V[at] += 0.45 * (surface.V[j[order][nearest]] - V[at])
    return _moved(V, near, beyond, own, INWARD)


def _moved(V: Floats, near: csr_array, which: Bools, towards: Bools, share: float) -> Floats:
    """V with the marked vertices moved a share of the way to the mean of their neighbours in `towards`, if any."""
    count = near @ towards.astype(float)
    at = np.flatnonzero(which & (count > 0))
    V = V.copy()
    V[at] += share * ((near[at] @ (V * towards[:, None])) / count[at, None] - V[at])
    return V


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
