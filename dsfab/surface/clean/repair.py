"""Repair of a mesh: removal of small faults, and clean sheets from raw scans."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, complement, group_sums, lengths, polygon_perimeter
from dsfab.core.messages import count_phrase, length
from dsfab.surface.clean.borders import even_edges, hole_triangles
from dsfab.surface.clean.overlaps import crossing_pairs, overlapping_faces, single_sheets
from dsfab.surface.clean.seams import (
    ASTRAY_RATIO,
    WELD,
    faces_with_area,
    in_reach,
    joined_at_points,
    merged_vertices,
    stitched_faces,
)
from dsfab.surface.edge_changes import contracted_faces, leading_candidates, meets_link_condition
from dsfab.surface.topology import (
    EdgeTable,
    boundary_loops,
    corner_fans,
    edge_table,
    flips_to_orient,
    misoriented_edges,
    on_boundary,
    pieces,
    pinches,
)

CRUMB = 0.01  # The repair removes loose pieces smaller than this fraction of the mesh's area.
PINHOLE = 1e-3  # The repair closes holes with outlines shorter than this times the mesh's largest dimension.
_NO_AREA = "dsfab dropped {} without area"
_DOUBT = "; these faces are a large part of the mesh: check that all parts have the same unit"
_ASTRAY = f"dsfab dropped {{}} with corners over {ASTRAY_RATIO:,.0f} times as far from the mesh's middle as other faces"


@dataclass(frozen=True, eq=False)
class MendedMesh:
    """A repaired mesh: vertices V (n, 3), triangles F (m, 3), and a message for each repair (`repairs`)."""

    V: Floats
    F: Ints
    repairs: tuple[str, ...] = ()

    def with_faces(self, keep: Ints, repair: str) -> "MendedMesh":
        """Return the mesh of the faces `keep` (k,). repair : message, in which {} is the number of removed faces."""
        lost = len(self.F) - len(keep)
        if not lost:
            return self
        doubt = _DOUBT if repair == _NO_AREA and lost > 0.2 * len(self.F) else ""
        words = repair.format(count_phrase(lost, "face")) + doubt
        return replace(self, F=self.F[keep], repairs=(*self.repairs, words))


def mended_mesh(V: Floats, F: Ints, metres: float = 1.0) -> MendedMesh:
    """Return the mesh V (n, 3), F (m, 3), in any unit, with small faults repaired.
    metres : length of the mesh's unit in metres.
    Vertices with equal positions are merged. Repeated faces, second copies of sheets and small pieces are removed.
    A thin solid is replaced by its middle surface. Open seams and small holes are closed."""
    mesh = single_sheet(sound_faces(V, F), metres)
    mesh = stitched_mesh(
        _without(mesh, _on_edges_of_two, "dsfab dropped {} on edges that already have two faces (perhaps a rib)")
    )
    mesh = _without(mesh, _in_large_pieces, "dsfab dropped {} in tiny loose pieces")
    mesh = _join_at_points(mesh) if len(mesh.F) else mesh
    return _compact(_without_teeth(_without_pinholes(mesh), metres) if len(mesh.F) else mesh)


def sound_faces(V: Floats, F: Ints) -> MendedMesh:
    """Return the mesh V (n, 3), F (m, 3) without unusable faces. Vertices with equal positions are merged.
    Unusable faces have no area, lie on other faces, or have corners that are not finite or far away."""
    finite = np.flatnonzero(np.asarray(np.isfinite(V).all(axis=1))[F].all(axis=1))
    mesh = MendedMesh(V, F).with_faces(finite, "dsfab dropped {} with corners that are not numbers")
    mesh = mesh.with_faces(np.flatnonzero(in_reach(V)[mesh.F].all(axis=1)), _ASTRAY)
    mesh = _without(_weld(_compact(mesh)), faces_with_area, _NO_AREA)
    if not len(mesh.F):
        return mesh
    once = _single_faces(mesh.V, mesh.F)
    copy, repeated = "dsfab dropped {} of a second copy of the sheet", "dsfab dropped {} on top of other faces"
    return _compact(mesh.with_faces(once, copy if 2 * len(once) <= len(mesh.F) else repeated))


def single_sheet(mesh: MendedMesh, metres: float) -> MendedMesh:
    """Return the mesh with a single copy of each sheet. metres : length of the mesh's unit in metres."""
    V, F, texts = single_sheets(mesh.V, mesh.F, metres)
    return _compact(MendedMesh(V, F, (*mesh.repairs, *texts))) if texts else mesh


def _without(mesh: MendedMesh, sound: Callable[[Floats, Ints], Ints], repair: str) -> MendedMesh:
    return mesh.with_faces(sound(mesh.V, mesh.F), repair) if len(mesh.F) else mesh


def _compact(mesh: MendedMesh) -> MendedMesh:
    used, F = np.unique(mesh.F, return_inverse=True)
    return replace(mesh, V=mesh.V[used], F=F.reshape(-1, 3))


def _weld(mesh: MendedMesh) -> MendedMesh:
    V, became = merged_vertices(mesh.V, WELD, partial(crossing_pairs, mesh.F))
    fewer = len(mesh.V) - len(V)
    if not fewer:
        return mesh
    words = (
        f"{count_phrase(fewer, 'vertex')} merged with neighbouring vertices, within {WELD:g} times the largest side "
        f"of the mesh"
    )
    return MendedMesh(V, became[mesh.F], (*mesh.repairs, words))


def stitched_mesh(mesh: MendedMesh) -> MendedMesh:
    """Return the mesh with open seams between its patches closed."""
    if not len(mesh.F):
        return mesh
    F, joined = stitched_faces(mesh.V, mesh.F, WELD * float(np.ptp(mesh.V, axis=0).max()))
    if not joined:
        return mesh
    words = f"{count_phrase(joined, 'vertex')} on open seams joined to the edges on the other side of the seam"
    return replace(mesh, F=F, repairs=(*mesh.repairs, words))


def _join_at_points(mesh: MendedMesh) -> MendedMesh:
    F, count = joined_at_points(mesh.V, mesh.F)
    words = f"parts that touch in a point: joined by a face at {count_phrase(count, 'place')}"
    return replace(mesh, F=F, repairs=(*mesh.repairs, words)) if count else mesh


def _single_faces(V: Floats, F: Ints) -> Ints:
    once = complement(overlapping_faces(V, F).whole, len(F))
    if len(once) == len(F):
        return once
    _, group, times = np.unique(np.sort(F, axis=1), axis=0, return_inverse=True, return_counts=True)
    twin = (times > 1)[group.ravel()][once]
    edges = edge_table(F[once])
    neighbours = np.bincount(edges.of[~twin].ravel(), minlength=len(edges.count))
    between: Bools = ((neighbours == 2) & (edges.count > 2))[edges.of].any(axis=1)
    return once[~(twin & between)]


def _on_edges_of_two(_: Floats, F: Ints) -> Ints:
    edges = edge_table(F)
    edge = edges.of.ravel()[edges.order]
    place = np.arange(len(edge)) - edges.start[edge]
    return complement(np.unique(edges.order[place >= 2] // 3), len(F))


def _in_large_pieces(V: Floats, F: Ints) -> Ints:
    count, piece = pieces(F, edge_table(F))
    area = lengths(area_vectors(V, F))
    return np.flatnonzero(np.bincount(piece, area, minlength=count)[piece] >= CRUMB * area.sum())


def _without_pinholes(mesh: MendedMesh) -> MendedMesh:
    V, F = mesh.V, mesh.F
    flips = flips_to_orient(F, edge_table(F))
    if flips is None:
        return mesh
    F = np.where(flips[:, None], F[:, ::-1], F)
    longest = PINHOLE * np.ptp(V, axis=0).max()
    fans = [
        np.stack([np.full(len(loop) - 2, loop[0]), loop[2:], loop[1:-1]], axis=1)
        for loop in boundary_loops(F, edge_table(F))
        if len(loop) >= 3 and polygon_perimeter(V[loop]) < longest
    ]
    if not fans:
        return mesh
    return MendedMesh(V, np.concatenate([F, *fans]), (*mesh.repairs, f"{count_phrase(len(fans), 'pinhole')} closed"))


def _without_teeth(mesh: MendedMesh, metres: float) -> MendedMesh:
    even = even_edges(mesh.V, mesh.F)
    largest_move = length(metres * even.most)
    words = f"ragged edges straightened: {count_phrase(even.moved, 'vertex')} moved by up to {largest_move}"
    return MendedMesh(even.V, even.F, (*mesh.repairs, words)) if even.moved else mesh


HOLE = 0.15  # Holes of a scan are filled if their outline is shorter than this times the scan's largest dimension.
SPECK = 0.05  # Pieces of a scan are removed if their area is below this times the largest piece's area.
FINE, SEVERAL = 0.01, 3
"""A mesh is a raw scan under two conditions. Its mean edge is at most FINE times its largest dimension.
It has at least SEVERAL small holes, or at least SEVERAL edges with more than two faces."""
NOISY, FOLDED = 0.02, 1e-3
"""A mesh is a noisy scan under two conditions. Its mean edge is at most NOISY times its largest dimension.
The fraction of faces turned against their neighbours is above FOLDED: it is 0.0002 in designs, 0.003 in noisy scans."""
TILTED, LOW = 0.7, 0.5
"""A face is tilted by noise under two conditions. The cosine between its normal and its neighbours' mean normal is
below TILTED. Its height is below LOW times the mesh's mean edge; higher faces may belong to a real bend."""


def is_scan(V: Floats, F: Ints) -> bool:
    """Return True if a mesh V (n, 3), F (m, 3) looks like a raw 3D scan."""
    F = F[in_reach(V)[F].all(axis=1)]
    if not len(F):
        return False
    edges, side = edge_table(F), float(np.ptp(V[F].reshape(-1, 3), axis=0).max())
    if (edges.count > 2).sum() >= SEVERAL:
        F = F[complement(overlapping_faces(V, F).whole, len(F))]  # copied faces do not indicate a raw scan
        edges = edge_table(F)
    mean = float(lengths(V[edges.ends[:, 1]] - V[edges.ends[:, 0]]).mean())
    if mean <= NOISY * side and not len(misoriented_edges(F, edges)) and _folded_faces(V, F).mean() > FOLDED:
        return True
    if mean > FINE * side:
        return False
    if (edges.count > 2).sum() >= SEVERAL:
        return True
    return sum(polygon_perimeter(V[loop]) < HOLE * side for loop in boundary_loops(F, edges)) >= SEVERAL


def repaired_scan(V: Floats, F: Ints, metres: float = 1.0) -> MendedMesh:
    """Return the mesh V (n, 3), F (m, 3) of a 3D scan, in any unit, as a clean sheet.
    metres : length of the mesh's unit in metres.
    Small pieces are removed, small holes are filled, and folds from noise are flattened."""
    mesh = single_sheet(sound_faces(V, F), metres)
    for step in (stitched_mesh, _split_junctions, _orient_faces, _without_specks, _fill_holes, _flatten_folds):
        mesh = step(mesh) if len(mesh.F) else mesh
    return mesh


def _split_junctions(mesh: MendedMesh) -> MendedMesh:
    edges = edge_table(mesh.F)
    crowded = np.flatnonzero(edges.count > 2)
    joined_pairs = _smoothest(mesh.V, mesh.F, edges, crowded)
    points = 0 if len(crowded) else len(pinches(mesh.F, edges, len(mesh.V)))
    if not (len(crowded) or points):
        return mesh
    fans = corner_fans(mesh.F, edges, joined_pairs)
    _, first_corners = np.unique(fans, return_index=True)
    V = mesh.V[mesh.F.ravel()[first_corners]]
    what = f"faces separated at {count_phrase(len(crowded), 'edge')} with more than two faces" if len(crowded) else ""
    what = what or f"{count_phrase(points, 'point')} between touching parts split"
    return MendedMesh(V, fans, (*mesh.repairs, what))


def _smoothest(V: Floats, F: Ints, edges: EdgeTable, crowded: Ints) -> Ints:
    smoothest_pairs = []
    for edge in crowded.tolist():
        h = edges.order[edges.start[edge] : edges.start[edge + 1]]
        a, b = V[edges.ends[edge]]
        along = (b - a) / np.linalg.norm(b - a)
        away = V[F.ravel()[h - h % 3 + (h + 2) % 3]] - a
        away -= (away @ along)[:, None] * along
        away /= np.maximum(lengths(away), 1e-300)[:, None]
        cosine = away @ away.T
        np.fill_diagonal(cosine, np.inf)
        i, j = np.unravel_index(int(cosine.argmin()), cosine.shape)  # the two faces that bend least at the edge
        smoothest_pairs.append((h[i], h[j]))
    return np.array(smoothest_pairs, dtype=np.int64).reshape(-1, 2)


def _orient_faces(mesh: MendedMesh) -> MendedMesh:
    flips = flips_to_orient(mesh.F, edge_table(mesh.F))
    if flips is None or not flips.any():
        return mesh
    F = np.where(flips[:, None], mesh.F[:, ::-1], mesh.F)
    what = f"{count_phrase(int(flips.sum()), 'face')} of {len(F):,} turned over, so that neighbours face the same side"
    return replace(mesh, F=F, repairs=(*mesh.repairs, what))


def _without_specks(mesh: MendedMesh) -> MendedMesh:
    count, piece = pieces(mesh.F, edge_table(mesh.F))
    area = np.bincount(piece, lengths(area_vectors(mesh.V, mesh.F)), minlength=count)
    small: Bools = area < SPECK * area.max()
    if not small.any():
        return mesh
    share = area[small].sum() / area.sum()
    what = f"{count_phrase(int(small.sum()), 'small piece')} dropped, {share:.2g} of the area"
    return _compact(replace(mesh, F=mesh.F[~small[piece]], repairs=(*mesh.repairs, what)))


def _fill_holes(mesh: MendedMesh) -> MendedMesh:
    V, F = mesh.V, mesh.F
    edges = edge_table(F)
    if flips_to_orient(F, edges) is None:
        return mesh
    fills, longest = [], HOLE * float(np.ptp(V, axis=0).max())
    for loop in boundary_loops(F, edges):
        if 3 <= len(loop) <= 400 and polygon_perimeter(V[loop]) < longest:
            around = loop[::-1]
            inside = hole_triangles(V[around], _joined_pairs(edges, around))
            fills += [around[inside]] if inside is not None else []
    if not fills:
        return mesh
    what = f"{count_phrase(len(fills), 'hole')} filled with {sum(map(len, fills)):,} faces"
    return replace(mesh, F=np.concatenate([F, *fills]), repairs=(*mesh.repairs, what))


def _folded_faces(V: Floats, F: Ints) -> Bools:
    return _cosines(V, F) < 0


def _cosines(V: Floats, F: Ints) -> Floats:
    area = area_vectors(V, F)
    around = group_sums(F.ravel(), np.repeat(area, 3, axis=0), len(V))[F].sum(axis=1) - 3 * area
    return np.asarray(np.einsum("ij,ij->i", around, area) / np.maximum(lengths(around) * lengths(area), 1e-300))


def _crumpled_faces(V: Floats, F: Ints) -> Bools:
    side = np.stack([lengths(V[F[:, k]] - V[F[:, k - 1]]) for k in range(3)], axis=1)
    cosine, height = _cosines(V, F), lengths(area_vectors(V, F)) / side.max(axis=1)
    return np.asarray((cosine < 0) | ((cosine < TILTED) & (height < LOW * side.mean())))


def _flatten_folds(mesh: MendedMesh) -> MendedMesh:
    V, F = mesh.V, mesh.F
    if not _folded_faces(V, F).any() or len(misoriented_edges(F, edge_table(F))):
        return mesh
    crumpled = _crumpled_faces(V, F)
    count = int(crumpled.sum())
    for _ in range(50):
        V, onto = _collapse_edges(V, F, crumpled)
        F = contracted_faces(F, onto)
        crumpled = _crumpled_faces(V, F)
        if (onto == np.arange(len(V))).all() or not crumpled.any():
            break
    used, F = np.unique(F, return_inverse=True)
    lost = count_phrase(len(V) - len(used), "short edge")
    what = f"{lost} collapsed; this flattens {count_phrase(count, 'face')} that noise in the mesh had folded or tilted"
    return MendedMesh(V[used], F.reshape(-1, 3), (*mesh.repairs, what))


def _collapse_edges(V: Floats, F: Ints, crumpled: Bools) -> tuple[Floats, Ints]:
    """Collapse short edges of `crumpled` faces (m,). Return vertices, and their new numbers (n,) after the collapse."""
    edges, n = edge_table(F), len(V)
    rim, face_edges = on_boundary(edges, n), edges.of[crumpled]
    length = np.full(len(edges.ends), np.inf)
    candidates = np.unique(face_edges)
    candidates = candidates[meets_link_condition(edges, candidates, n)]
    candidates = candidates[edges.boundary[candidates] | ~rim[edges.ends[candidates]].all(axis=1)]
    length[candidates] = lengths(V[edges.ends[candidates, 1]] - V[edges.ends[candidates, 0]])
    chosen = np.unique(face_edges[np.arange(len(face_edges)), length[face_edges].argmin(axis=1)])
    chosen = chosen[np.isfinite(length[chosen])]
    order = np.argsort(length[chosen], kind="stable")
    targets, gone = edges.ends[chosen[leading_candidates(order, edges.ends[chosen], n, edges.ends)]].T
    targets, gone = np.where(rim[gone], gone, targets), np.where(rim[gone], targets, gone)
    onto, V = np.arange(n), V.copy()
    onto[gone] = targets
    V[targets] = np.where((rim[targets] == rim[gone])[:, None], (V[targets] + V[gone]) / 2, V[targets])
    return V, onto


def _joined_pairs(edges: EdgeTable, loop: Ints) -> Bools:
    place = np.full(int(edges.ends.max()) + 1, -1)
    place[loop] = np.arange(len(loop))
    i, j = place[edges.ends].T
    inside = (i >= 0) & (j >= 0)
    joined = np.zeros((len(loop),) * 2, dtype=bool)
    joined[i[inside], j[inside]] = joined[j[inside], i[inside]] = True
    return joined
