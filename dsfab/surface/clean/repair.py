"""Repair of a mesh: small faults mended, and raw scans turned into clean sheets."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, closed_length, complement, group_sums, lengths
from dsfab.core.messages import counted, length
from dsfab.surface.clean.borders import even_edges, hole_triangles
from dsfab.surface.clean.overlaps import crossings, single_sheets
from dsfab.surface.clean.seams import FAR, in_reach, joined_at_points, merged, stitched
from dsfab.surface.edge_changes import contracted, meets_link_condition, winners
from dsfab.surface.topology import (
    EdgeTable,
    boundary_loops,
    corner_fans,
    duplicate_faces,
    edge_table,
    flips_to_orient,
    misoriented_edges,
    on_boundary,
    pieces,
    pinches,
)

WELD = 5e-5
"""Share of the largest side within which vertices become one."""
CRUMB = 0.01
"""Share of the area under which a loose piece is dropped."""
FLAT = 1e-9
"""A face whose height is a smaller share of its longest edge has no area."""
PINHOLE = 1e-3
"""Share of the largest side under which the outline of a hole is closed by a fan of faces."""

MANY = 0.2
"""Share of faces beyond which those without area are doubted: some of the mesh may be a thousand times too small."""
_NO_AREA = "without area"
_DOUBT = ", many of all: is a part of it in another unit?"

_ASTRAY = f"with corners more than {FAR:,.0f} times as far away as the others"


@dataclass(frozen=True, eq=False)
class MendedMesh:
    """A mesh and what was done to it.

    V : (n, 3) vertices. F : (m, 3) triangles. repairs : a few words each, none where nothing had to be done.
    """

    V: Floats
    F: Ints
    repairs: tuple[str, ...] = ()

    def with_faces(self, keep: Ints, which: str) -> "MendedMesh":
        """The mesh with these (k,) faces alone; the others are told as `which`."""
        lost = len(self.F) - len(keep)
        if not lost:
            return self
        doubt = _DOUBT if which == _NO_AREA and lost > MANY * len(self.F) else ""
        words = f"{counted(lost, 'face')} {which} dropped{doubt}"
        return replace(self, F=self.F[keep], repairs=(*self.repairs, words))


Fault = tuple[Callable[[Floats, Ints], Ints], str]
"""What chooses the faces that stay, and how the others are told."""


def mended(V: Floats, F: Ints, metres: float = 1.0) -> MendedMesh:
    """The mesh V (n, 3), any unit, F (m, 3) without what no architect means.

    metres : of that unit, for what is told.

    Vertices closer than `WELD` of the largest side become one, but for those where sheets cross. Faces without area or
    with an earlier face's corners go, and so do the later ones of three and more on an edge, pieces under `CRUMB` of
    the area, and pinholes with outlines under `PINHOLE` of the side. Seams of patches that were divided apart are
    stitched, and parts that touch in a point are joined there: see `dsfab.surface.clean.seams`. Copies of a sheet
    go, and
    a slab becomes the sheet in its middle: see `dsfab.surface.clean.overlaps`. Edges along which faces were deleted
    lose their
    teeth: see `dsfab.surface.clean.borders`. What is left is as it was; vertices without a face go.
    """
    mesh = single_sheet(sound_faces(V, F), metres)
    mesh = _without(stitched_mesh(_without(mesh, _TOO_MANY)), _TOO_SMALL)
    mesh = _mend_joined(mesh) if len(mesh.F) else mesh
    return _compact(_without_teeth(_without_pinholes(mesh), metres) if len(mesh.F) else mesh)


def sound_faces(V: Floats, F: Ints) -> MendedMesh:
    """The mesh V (n, 3), any unit, F (m, 3) with vertices that all but touch made one, without faces of no area, of
    corners that are no numbers or far from all others, and those that repeat others."""
    finite: Bools = np.asarray(np.isfinite(V).all(axis=1))
    mesh = MendedMesh(V, F).with_faces(np.flatnonzero(finite[F].all(axis=1)), "with corners that are no numbers")
    mesh = mesh.with_faces(np.flatnonzero(in_reach(V)[mesh.F].all(axis=1)), _ASTRAY)
    mesh = _without(_welded(_compact(mesh)), _UNSOUND)
    once = _unrepeated(mesh.V, mesh.F)
    twice = 2 * len(once) <= len(mesh.F)
    return _compact(mesh.with_faces(once, "that repeat others, for the sheet is there twice," if twice else _REPEATED))


def single_sheet(mesh: MendedMesh, metres: float) -> MendedMesh:
    """The mesh with one sheet where two copies or the two faces of a slab were; `metres` of its unit, for the words."""
    V, F, told = single_sheets(mesh.V, mesh.F, metres)
    return _compact(MendedMesh(V, F, (*mesh.repairs, *told))) if told else mesh


def _without(mesh: MendedMesh, faults: tuple[Fault, ...]) -> MendedMesh:
    for faces, which in faults:
        if len(mesh.F):
            mesh = mesh.with_faces(faces(mesh.V, mesh.F), which)
    return mesh


def _compact(mesh: MendedMesh) -> MendedMesh:
    used, F = np.unique(mesh.F, return_inverse=True)
    return replace(mesh, V=mesh.V[used], F=F.reshape(-1, 3))


def _welded(mesh: MendedMesh) -> MendedMesh:
    V, became = merged(mesh.V, WELD, partial(crossings, mesh.F))
    fewer = len(mesh.V) - len(V)
    if not fewer:
        return mesh
    words = f"{counted(fewer, 'vertex')} welded to others within {WELD:g} of the largest side"
    return MendedMesh(V, became[mesh.F], (*mesh.repairs, words))


def stitched_mesh(mesh: MendedMesh) -> MendedMesh:
    """The mesh with vertices that lie on edges of other faces made corners of these."""
    if not len(mesh.F):
        return mesh
    F, joined = stitched(mesh.V, mesh.F, WELD * float(np.ptp(mesh.V, axis=0).max()))
    if not joined:
        return mesh
    words = f"{counted(joined, 'vertex')} on open seams joined to the edges beside"
    return replace(mesh, F=F, repairs=(*mesh.repairs, words))


def _mend_joined(mesh: MendedMesh) -> MendedMesh:
    """The mesh with a face more where parts touch in a point."""
    F, count = joined_at_points(mesh.V, mesh.F)
    words = f"parts that touch in a point joined by a face at {counted(count, 'place')}"
    return replace(mesh, F=F, repairs=(*mesh.repairs, words)) if count else mesh


def _with_area(V: Floats, F: Ints) -> Ints:
    """(k,) faces whose smallest height is more than nothing of their longest edge."""
    P = V[F]
    longest = lengths(P - np.roll(P, 1, axis=1)).max(axis=1, initial=0)
    twice = lengths(area_vectors(V, F))
    return np.flatnonzero(twice > FLAT * longest**2)


def _unrepeated(_: Floats, F: Ints) -> Ints:
    """(k,) faces without those that join the corners of an earlier one; and without this, too, where two others go on
    at one of its edges: it lay flat between them and its twin, as in the corners of a cushion sewn of two sheets."""
    twins = duplicate_faces(F)
    once = complement(twins, len(F))
    if not len(twins):
        return once
    _, same, times = np.unique(np.sort(F, axis=1), axis=0, return_inverse=True, return_counts=True)
    twin = (times > 1)[same.ravel()][once]
    edges = edge_table(F[once])
    others = np.bincount(edges.of[~twin].ravel(), minlength=len(edges.count))
    between: Bools = ((others == 2) & (edges.count > 2))[edges.of].any(axis=1)
    return once[~(twin & between)]


def _on_edges_of_two(_: Floats, F: Ints) -> Ints:
    """(k,) faces that are not the third or a later one on an edge."""
    edges = edge_table(F)
    edge = edges.of.ravel()[edges.order]
    place = np.arange(len(edge)) - edges.start[edge]
    return complement(np.unique(edges.order[place >= 2] // 3), len(F))


def _in_large_pieces(V: Floats, F: Ints) -> Ints:
    """(k,) faces of pieces that are more than crumbs."""
    count, piece = pieces(F, edge_table(F))
    area = lengths(area_vectors(V, F))
    of_piece = np.bincount(piece, area, minlength=count)
    return np.flatnonzero(of_piece[piece] >= CRUMB * area.sum())


_UNSOUND: tuple[Fault, ...] = ((_with_area, _NO_AREA),)
_REPEATED = "that repeat others"
_TOO_MANY: tuple[Fault, ...] = ((_on_edges_of_two, "on edges with two others, as of a rib,"),)
_TOO_SMALL: tuple[Fault, ...] = ((_in_large_pieces, "in crumbs"),)


def _without_pinholes(mesh: MendedMesh) -> MendedMesh:
    """The mesh with small holes closed by fans; as it is where its faces cannot be turned the same way."""
    V, F = mesh.V, mesh.F
    flips = flips_to_orient(F, edge_table(F))
    if flips is None:
        return mesh
    F = np.where(flips[:, None], F[:, ::-1], F)
    longest = PINHOLE * np.ptp(V, axis=0).max()
    fans = [
        np.stack([np.full(len(loop) - 2, loop[0]), loop[2:], loop[1:-1]], axis=1)
        for loop in boundary_loops(F, edge_table(F))
        if len(loop) >= 3 and closed_length(V[loop]) < longest
    ]
    if not fans:
        return mesh
    return MendedMesh(V, np.concatenate([F, *fans]), (*mesh.repairs, f"{counted(len(fans), 'pinhole')} closed"))


def _without_teeth(mesh: MendedMesh, metres: float) -> MendedMesh:
    """The mesh with its ragged edges made even; `metres` of its unit, for the words."""
    even = even_edges(mesh.V, mesh.F)
    words = f"ragged edges made even, {counted(even.moved, 'vertex')} by up to {length(metres * even.most)}"
    return MendedMesh(even.V, even.F, (*mesh.repairs, words)) if even.moved else mesh


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
