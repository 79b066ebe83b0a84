"""Small faults of meshes as programs leave them, mended: crumbs, pinholes, needles without area, faces twice, teeth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, area_vectors, closed_length, complement, lengths
from dsfab.surface.crossings import crossings
from dsfab.surface.doubled import single_sheets
from dsfab.surface.places import FAR, in_reach, merged
from dsfab.surface.ragged import even_edges
from dsfab.surface.stitching import joined_at_points, stitched
from dsfab.surface.topology import boundary_loops, duplicate_faces, edge_table, flips_to_orient, pieces
from dsfab.wording import counted, length

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
    stitched, and parts that touch in a point are joined there: see `dsfab.surface.stitching`. Copies of a sheet go, and
    a slab becomes the sheet in its middle: see `dsfab.surface.doubled`. Edges along which faces were deleted lose their
    teeth: see `dsfab.surface.ragged`. What is left is as it was; vertices without a face go.
    """
    mesh = single_sheet(sound_faces(V, F), metres)
    mesh = _without(stitched_mesh(_without(mesh, _TOO_MANY)), _TOO_SMALL)
    mesh = _joined(mesh) if len(mesh.F) else mesh
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


def _joined(mesh: MendedMesh) -> MendedMesh:
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
