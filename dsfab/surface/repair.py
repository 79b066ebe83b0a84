"""Raw scans made sheets: as `mended`, and edges of many faces split, small holes filled, all faces turned alike."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, area_vectors, closed_length, group_sums, lengths
from dsfab.surface.edge_changes import contracted, meets_link_condition, winners
from dsfab.surface.hole_filling import hole_triangles
from dsfab.surface.mend import MendedMesh, single_sheet, sound_faces, stitched_mesh
from dsfab.surface.neighbours import on_boundary
from dsfab.surface.topology import (
    EdgeTable,
    boundary_loops,
    corner_fans,
    edge_table,
    flips_to_orient,
    misoriented_edges,
    pieces,
    pinches,
)
from dsfab.wording import counted

HOLE = 0.15
"""Share of the largest side: holes whose outline is shorter are filled, about as wide as a twentieth of the side."""
MOST = 400
"""Edges of a hole that is filled at most: seconds grow with their cube."""
SPECK = 0.05
"""Share of the area of the largest piece under which other pieces are dropped."""

FINE, SEVERAL = 0.01, 3
"""A mesh whose edges are shorter in the mean than this share of its largest side, with so many small holes or edges of
more than two faces, is taken for a scan."""
NOISY, FOLDED = 0.02, 1e-3
"""So is one that is a little coarser, if more than this share of its faces is folded over: of designed meshes that were
looked at 0.02 % at most, of one with noise of 2 mm on edges of 70 mm 0.3 %."""
TILTED, LOW = 0.7, 0.5
"""So are faces that are lower than that share of the mean edge, if they look another way than those around by more than
the angle of this cosine, 45 degrees: noise tilts the low ones most, and leaves what bends there to high ones."""
ROUNDS = 50
"""Of collapsing edges of what is folded over, at most."""


def is_scan(V: Floats, F: Ints) -> bool:
    """Whether a mesh V (n, 3), F (m, 3) looks like a raw scan: fine, with small holes, or edges of many faces, or
    faces that noise folded over."""
    finite: Bools = np.asarray(np.isfinite(V).all(axis=1))
    F = F[finite[F].all(axis=1)]
    if not len(F):
        return False
    edges, side = edge_table(F), float(np.ptp(V[F].reshape(-1, 3), axis=0).max())
    mean = float(lengths(V[edges.ends[:, 1]] - V[edges.ends[:, 0]]).mean())
    if mean <= NOISY * side and not len(misoriented_edges(F, edges)) and _folded(V, F).mean() > FOLDED:
        return True
    if mean > FINE * side:
        return False
    if (edges.count > 2).sum() >= SEVERAL:
        return True
    return sum(closed_length(V[loop]) < HOLE * side for loop in boundary_loops(F, edges)) >= SEVERAL


def repaired_scan(V: Floats, F: Ints, metres: float = 1.0) -> MendedMesh:
    """The mesh V (n, 3), any unit, F (m, 3) of a scan as a sheet, each repair told with its number.

    metres : of V's unit, for what is told.

    Beyond `mended`: of an edge with three faces and more the two that go on most smoothly keep it, and the others get
    vertices of their own; so do parts that touch in a point. Faces are turned so that neighbours face the same side.
    Pieces under `SPECK` of the largest go. Holes whose outline is under `HOLE` of the largest side are filled. Faces
    that noise folded over lose their shortest edge.
    """
    mesh = single_sheet(sound_faces(V, F), metres)
    for step in (stitched_mesh, _split, _turned, _without_specks, _filled, _unfolded):
        mesh = step(mesh) if len(mesh.F) else mesh
    return mesh


def _split(mesh: MendedMesh) -> MendedMesh:
    """Edges with more than two faces, and points in which parts touch, come apart."""
    edges = edge_table(mesh.F)
    crowded = np.flatnonzero(edges.count > 2)
    kept = _smoothest(mesh.V, mesh.F, edges, crowded)
    points = 0 if len(crowded) else len(pinches(mesh.F, edges, len(mesh.V)))
    if not (len(crowded) or points):
        return mesh
    fans = corner_fans(mesh.F, edges, kept)
    _, first = np.unique(fans, return_index=True)
    V = mesh.V[mesh.F.ravel()[first]]
    what = f"{counted(len(crowded), 'edge')} of more than two faces split" if len(crowded) else ""
    what = what or f"{counted(points, 'point')} in which parts touch split"
    return MendedMesh(V, fans, (*mesh.repairs, what))


def _smoothest(V: Floats, F: Ints, edges: EdgeTable, crowded: Ints) -> Ints:
    """(k, 2) of each crowded edge (k,) the two half-edges whose faces turn least from one to the other."""
    found = []
    for edge in crowded.tolist():
        h = edges.order[edges.start[edge] : edges.start[edge + 1]]
        a, b = V[edges.ends[edge]]
        along = (b - a) / np.linalg.norm(b - a)
        away = V[F.ravel()[h - h % 3 + (h + 2) % 3]] - a
        away -= (away @ along)[:, None] * along
        away /= np.maximum(lengths(away), 1e-300)[:, None]
        cosine = away @ away.T
        np.fill_diagonal(cosine, np.inf)
        i, j = np.unravel_index(int(cosine.argmin()), cosine.shape)  # in line, they point away from each other
        found.append((h[i], h[j]))
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def _turned(mesh: MendedMesh) -> MendedMesh:
    """Faces turned the same way; as they are where that cannot be."""
    flips = flips_to_orient(mesh.F, edge_table(mesh.F))
    if flips is None or not flips.any():
        return mesh
    F = np.where(flips[:, None], mesh.F[:, ::-1], mesh.F)
    what = f"{counted(int(flips.sum()), 'face')} of {len(F):,} turned over, so that neighbours face the same side"
    return replace(mesh, F=F, repairs=(*mesh.repairs, what))


def _without_specks(mesh: MendedMesh) -> MendedMesh:
    """The pieces that are not far smaller than the largest."""
    count, piece = pieces(mesh.F, edge_table(mesh.F))
    area = np.bincount(piece, lengths(area_vectors(mesh.V, mesh.F)), minlength=count)
    small: Bools = area < SPECK * area.max()
    if not small.any():
        return mesh
    used, F = np.unique(mesh.F[~small[piece]], return_inverse=True)
    share = area[small].sum() / area.sum()
    what = f"{counted(int(small.sum()), 'small piece')} dropped, {share:.2g} of the area"
    return MendedMesh(mesh.V[used], F.reshape(-1, 3), (*mesh.repairs, what))


def _filled(mesh: MendedMesh) -> MendedMesh:
    """Small holes filled; as it is where its faces cannot be turned the same way."""
    V, F = mesh.V, mesh.F
    edges = edge_table(F)
    if flips_to_orient(F, edges) is None:
        return mesh
    fills, longest = [], HOLE * float(np.ptp(V, axis=0).max())
    for loop in boundary_loops(F, edges):
        if 3 <= len(loop) <= MOST and closed_length(V[loop]) < longest:
            around = loop[::-1]
            inside = hole_triangles(V[around], _joined(edges, around))
            fills += [around[inside]] if inside is not None else []
    if not fills:
        return mesh
    what = f"{counted(len(fills), 'hole')} filled with {sum(map(len, fills)):,} faces"
    return replace(mesh, F=np.concatenate([F, *fills]), repairs=(*mesh.repairs, what))


def _folded(V: Floats, F: Ints) -> Bools:
    """(m,) faces that look the other way than those around: no crease between two sides does."""
    return _cosines(V, F) < 0


def _cosines(V: Floats, F: Ints) -> Floats:
    """(m,) cosines between the normal of each face and the mean normal of those around it."""
    area = area_vectors(V, F)
    around = _around(V, F)[F].sum(axis=1) - 3 * area
    return np.asarray(np.einsum("ij,ij->i", around, area) / np.maximum(lengths(around) * lengths(area), 1e-300))


def _crumpled(V: Floats, F: Ints) -> Bools:
    """(m,) faces that are folded over by noise, or tilted by it."""
    side = np.stack([lengths(V[F[:, k]] - V[F[:, k - 1]]) for k in range(3)], axis=1)
    cosine, height = _cosines(V, F), lengths(area_vectors(V, F)) / side.max(axis=1)
    return np.asarray((cosine < 0) | ((cosine < TILTED) & (height < LOW * side.mean())))


def _around(V: Floats, F: Ints) -> Floats:
    """(n, 3) the sum of twice the area vectors of the faces at each vertex."""
    return group_sums(F.ravel(), np.repeat(area_vectors(V, F), 3, axis=0), len(V))


def _unfolded(mesh: MendedMesh) -> MendedMesh:
    """Without the shortest edges of faces that noise crumpled, whose ends become one, until there are none: noise is
    then less than edges are long. As it is where its faces cannot be turned the same way."""
    V, F = mesh.V, mesh.F
    if not _folded(V, F).any() or len(misoriented_edges(F, edge_table(F))):
        return mesh
    crumpled = _crumpled(V, F)
    count = int(crumpled.sum())
    for _ in range(ROUNDS):
        V, onto = _collapsed(V, F, crumpled)
        F = contracted(F, onto)
        crumpled = _crumpled(V, F)
        if (onto == np.arange(len(V))).all() or not crumpled.any():
            break
    used, F = np.unique(F, return_inverse=True)
    lost = counted(len(V) - len(used), "short edge")
    what = f"{counted(count, 'face')} folded over or tilted by noise flattened: {lost} collapsed"
    return MendedMesh(V[used], F.reshape(-1, 3), (*mesh.repairs, what))


def _collapsed(V: Floats, F: Ints, crumpled: Bools) -> tuple[Floats, Ints]:
    """Vertices (n, 3), and onto which (n,) each goes as the shortest edges of crumpled faces (m,) collapse: to the
    middle, or to the boundary. Those that would join two boundaries, or change the topology, stay, and neighbours."""
    edges, n = edge_table(F), len(V)
    rim, of = on_boundary(edges, n), edges.of[crumpled]
    length = np.full(len(edges.ends), np.inf)
    near = np.unique(of)
    near = near[meets_link_condition(edges, near, n)]
    near = near[edges.boundary[near] | ~rim[edges.ends[near]].all(axis=1)]
    length[near] = lengths(V[edges.ends[near, 1]] - V[edges.ends[near, 0]])
    chosen = np.unique(of[np.arange(len(of)), length[of].argmin(axis=1)])
    chosen = chosen[np.isfinite(length[chosen])]
    order = np.argsort(length[chosen], kind="stable")
    kept, gone = edges.ends[chosen[winners(order, edges.ends[chosen], n, edges.ends)]].T
    kept, gone = np.where(rim[gone], gone, kept), np.where(rim[gone], kept, gone)
    onto, V = np.arange(n), V.copy()
    onto[gone] = kept
    V[kept] = np.where((rim[kept] == rim[gone])[:, None], (V[kept] + V[gone]) / 2, V[kept])
    return V, onto


def _joined(edges: EdgeTable, loop: Ints) -> Bools:
    """(k, k) which points of a loop an edge of the mesh joins."""
    place = np.full(int(edges.ends.max()) + 1, -1)
    place[loop] = np.arange(len(loop))
    i, j = place[edges.ends].T
    both = (i >= 0) & (j >= 0)
    joined = np.zeros((len(loop),) * 2, dtype=bool)
    joined[i[both], j[both]] = joined[j[both], i[both]] = True
    return joined
