"""The solid of a sheet: a closed, oriented triangle mesh, its connected parts, and notes on repairs."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, first_few, lock, read_only_copy
from dsfab.core.errors import SolidError
from dsfab.core.units import MM_PER_M
from dsfab.surface import signed_volume, signed_volumes, total_area
from dsfab.surface.files.other_libraries import as_compas, as_pyvista, as_trimesh
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import edge_table, euler_characteristic, half_edges, misoriented_edges, pieces
from dsfab.thickening.offset_vectors import SHIFT, Side, check_contacts, check_edges
from dsfab.thickening.repair import RepairedSkin, repair_skin
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import Skin, is_fine

if TYPE_CHECKING:
    import build123d
    import compas.datastructures
    import manifold3d
    import pyvista
    import trimesh

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Repairs:
    """Numbers that describe the repair of a solid.
    rung        : strongest method of the repair: `none`, `flipped` (wall diagonals), `thinned`, or `united` (parts of
                  a sheet that crosses itself).
    found       : number of pairs of faces that intersected before the repair.
    thinned     : number of vertices where the sheet was thinned, because the thickened sheet met itself.
    thinnest    : smallest remaining fraction of the thickness; 1 without thinning.
    thinnest_at : point with the smallest thickness, metres; None without thinning.
    pairs       : number of pairs of faces that still intersect.    pairs_at : point at the first pair, metres.
    crossings   : number of lines along which the sheet crosses itself; parts of the sheet are fused there.
    moved       : number of vertices moved at small folds.    moved_by : largest move of these vertices, metres.
    lost        : fraction of the sheet's volume that thinning removed.
    limited     : number of vertices of the uncut surface where sharp bends make the sheet thinner.
    smallest    : smallest remaining fraction of the thickness at these bends."""

    rung: Literal["none", "flipped", "thinned", "united"] = "none"
    found: int = 0
    thinned: int = 0
    thinnest: float = 1.0
    thinnest_at: Place | None = None
    pairs: int = 0
    pairs_at: Place | None = None
    crossings: int = 0
    moved: int = 0
    moved_by: float = 0.0
    lost: float = 0.0
    limited: int = 0
    smallest: float = 1.0


def repair_report(
    surface: Surface, D: Floats, repair: RepairedSkin, V: Floats, F: Ints
) -> tuple[Repairs, tuple[str, ...]]:
    """Return the repair of a sheet in numbers, and in sentences for the user.
    D : (n, 3) offset vectors before the repair. V, F : mesh of the repaired solid."""
    report, notes = Repairs(rung="flipped" if repair.found else "none", found=repair.found), []
    share = np.linalg.norm(repair.D, axis=1) / np.linalg.norm(D, axis=1)
    thin = int((share < 1 - 1e-9).sum())
    if thin:
        point, least = surface.V[share.argmin()], float(share.min())
        lost = 1 - float(surface.areas @ share[surface.F].mean(axis=1)) / float(surface.areas.sum())
        report = replace(report, rung="thinned", thinned=thin, thinnest=least, thinnest_at=_triple(point), lost=lost)
        notes.append(
            f"the thickened sheet met itself in {repair.found} pairs of faces and was thinned at {thin} of "
            f"{surface.n} vertices: the sheet lost {lost:.2%} of its volume, and keeps {least:.2f} of its thickness "
            f"near {_place(point)}"
        )
    away = np.linalg.norm(repair.V - surface.V, axis=1)
    if away.any():
        moved, largest_move = int((away > 0).sum()), float(away.max())
        report = replace(report, rung=report.rung if thin else "thinned", moved=moved, moved_by=largest_move)
        notes.append(
            f"the sheet had folds smaller than its thickness; {moved} vertices of the sheet were moved, at most by "
            f"{largest_move:.3g} m near {_place(surface.V[away.argmax()])}"
        )
    if repair.union:
        report = replace(report, rung="united", crossings=repair.union.places)
        lines = "in one place" if repair.union.places == 1 else f"in {repair.union.places} places"
        notes.append(f"the sheet crosses itself {lines}; the crossing parts of the sheet are fused")
    if len(repair.pairs):
        point = V[F[repair.pairs[0]]].mean(axis=(0, 1))
        report = replace(report, pairs=len(repair.pairs), pairs_at=_triple(point))
        notes.append(
            f"{len(repair.pairs)} pairs of faces of the solid still intersect, the first near {_place(point)}; "
            f"{_cause(repair)}"
        )
    return report, tuple(notes)


def rounding_notes(V: Floats, F: Ints) -> tuple[str, ...]:
    """Return a note on faces F (m, 3) that collapse if STL files round V (n, 3), m, to single precision; or ()."""
    a, b = half_edges(F)
    lost = np.arange(len(a))
    for column in V.T:
        single = (column * MM_PER_M).astype(np.float32)
        lost = lost[single[a[lost]] == single[b[lost]]]
    lost = np.unique(lost // 3)
    if not len(lost):
        return ()
    where = _place(V[F[lost[0]]].mean(axis=0))
    return (
        f"{len(lost)} of {len(F)} faces collapse in files of single precision (STL), the first near {where}; coarsen "
        f"the sheet there, or move the sheet to the origin",
    )


def _cause(repair: RepairedSkin) -> str:
    if repair.union:
        return "the cause is rounding at the fused parts; slicer programs for printing accept these intersections"
    if repair.crosses:
        return f"the surface crosses itself in {repair.crosses} pairs of faces"
    return "parts of the surface are closer together than the sheet is thick"


def _place(point: Floats) -> str:
    x, y, z = (float(c) for c in point)
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"


def _triple(point: Floats) -> Place:
    return float(point[0]), float(point[1]), float(point[2])


VOLUME_TOLERANCE = 1e-9  # Largest error of the volume, divided by area and size of the solid.


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid body as a closed triangle mesh.
    V : (n, 3) vertices, metres.    F : (m, 3) faces, counter-clockwise seen from outside.
    genus   : number of handles, summed over all closed boundary surfaces.
    pieces  : number of connected pieces of material; a thickened closed surface is one piece.
    notes   : sentences on changes that made the solid buildable, and on remaining faults.
    repairs : the changes and faults in numbers."""

    V: Floats
    F: Ints
    genus: int
    pieces: int
    notes: tuple[str, ...] = ()
    repairs: Repairs = field(default_factory=Repairs)

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))

    def to_trimesh(self) -> "trimesh.Trimesh":
        """Return the mesh for trimesh, metres."""
        return as_trimesh(self.V, self.F)

    def to_pyvista(self) -> "pyvista.PolyData":
        """Return the mesh for pyvista, metres."""
        return as_pyvista(self.V, self.F)

    def to_compas(self) -> "compas.datastructures.Mesh":
        """Return the mesh for COMPAS, metres; raises SurfaceError if compas is not installed."""
        return as_compas(self.V, self.F)

    def to_manifold(self) -> "manifold3d.Manifold":
        """Return the solid for Boolean operations of manifold3d, metres; raises SolidError if manifold3d rejects it."""
        import manifold3d

        solid = manifold3d.Manifold(manifold3d.Mesh64(np.array(self.V), np.array(self.F, dtype=np.uint64)))
        if solid.status() != manifold3d.Error.NoError:
            raise SolidError(f"manifold3d rejects the solid: {solid.status().name}")
        return solid

    def to_build123d(self) -> "build123d.Shape":
        """Return planar CAD faces, millimetres, as in STEP. The `to_build123d` of a design returns smooth faces."""
        from dsfab.design.output import to_build123d

        return to_build123d(self)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, cubic metres."""
        return signed_volume(self.V, self.F)

    @cached_property
    def area(self) -> float:
        """Area of the whole boundary, square metres."""
        return total_area(self.V, self.F)

    @cached_property
    def box(self) -> Floats:
        """Lowest and highest corner (2, 3) of the bounding box, metres."""
        corners: Floats = read_only_copy([self.V.min(axis=0), self.V.max(axis=0)], np.float64, (2, 3))
        return corners


def thicken(surface: Surface, D: Floats, side: Side = "mid", proven: Bools | None = None) -> Solid:
    """Return the solid between the skins V + D and V - D of a sheet. Walls along D close the solid at the boundary.
    surface : an edge-manifold sheet without parts that touch only in a point; it may be closed, one-sided or in pieces.
    D       : (n, 3) half-thickness vectors from `offsets`, metres, on the normal's side of each vertex's first face.
    side    : "out" for the skins V + 2 D and V, "in" for V and V - 2 D.
    proven  : (m,) mask of faces that need no test for intersections (see `proven_cells`).

    An exact test finds intersections. It rounds vertices as in STL files (single precision, millimetres), except in
    flat sheets and in sheets far from the origin. If unrounded vertices pass the test, the solid keeps them.

    Repair flips wall diagonals and thins the sheet locally, down to 0.3 of D. A sheet that crosses itself is divided,
    and the solids of its parts are united. `notes` and `repairs` report the changes and the remaining intersections.
    Raises SolidError if the sheet is not as above, if vectors are missing, or if manifold3d rejects the result."""
    check_edges(surface)
    check_contacts(surface)
    surface, D = _used_part(surface, D)
    single = is_fine(surface.V, D) and not surface.is_flat  # rounding the vertices of a tilted flat sheet would bend it
    skin = Skin.from_surface(surface, SHIFT[side], single)
    _check_upward(surface, skin, D)
    among = None if proven is None else ~proven[skin.sources()]
    repair = repair_skin(surface, skin, D, among)
    if skin.single and len(repair.pairs) and not repair.union:  # rounding alone may make faces intersect
        skin = replace(skin, single=False)
        exact = repair_skin(surface, skin, D, among)
        skin, repair = (skin, exact) if len(exact.pairs) < len(repair.pairs) else (replace(skin, single=True), repair)
    if repair.union:
        V, F, count = repair.union.V, repair.union.F, repair.union.pieces
        shells = pieces(F, edge_table(F))[0]
    else:
        F = skin.faces(repair.backslash)
        changed = repair.V is not surface.V or (repair.D is not D and bool((repair.D != D).any()))
        V = _vertices(skin, repair, F, None if changed else among)
        count, shells = _pieces_and_shells(surface, F)
    repairs, notes = repair_report(surface, D, repair, V, F)
    genus = shells - _euler_characteristic(F) // 2
    solid = Solid(V, F, genus, count, (*notes, *rounding_notes(V, F)), repairs)
    check_solid(solid)
    return solid


def _vertices(skin: Skin, repair: RepairedSkin, F: Ints, among: Bools | None) -> Floats:
    V = skin.vertices(repair.V, repair.D)
    if not skin.single:
        return V
    exact = replace(skin, single=False).vertices(repair.V, repair.D)
    return exact if len(intersecting_pairs(exact, F, among)) <= len(repair.pairs) else V


def check_solid(solid: Solid) -> None:
    """Raise SolidError if manifold3d rejects the solid or finds a different volume, or if the volume is not positive.
    Intersections are not tested."""
    import manifold3d

    mesh = manifold3d.Mesh64(np.array(solid.V), np.array(solid.F, dtype=np.uint64))  # writable copies
    judged = manifold3d.Manifold(mesh)
    status = judged.status()
    if status != manifold3d.Error.NoError:
        raise SolidError(
            f"the library manifold3d rejects the solid of {len(solid.F)} triangles: {status.name}; after thickening, "
            f"check the sheet for edges with one or three faces"
        )
    if not solid.volume > 0:
        raise SolidError(f"the solid's volume, {solid.volume:.3g} m3, is not positive; use a thinner or smoother sheet")
    size = float(np.linalg.norm(np.ptp(solid.box, axis=0)))
    if abs(judged.volume() - solid.volume) > VOLUME_TOLERANCE * solid.area * size:
        raise SolidError(
            f"the volume of the solid is {solid.volume:.9g} m3, but manifold3d measures {judged.volume():.9g} m3; "
            f"details of the sheet are smaller than the precision of coordinates; use a coarser mesh"
        )


def _used_part(surface: Surface, D: Floats) -> tuple[Surface, Floats]:
    D = np.asarray(D, dtype=np.float64)
    if D.shape != surface.V.shape:
        raise SolidError(f"offset vectors have shape {D.shape}; give one per vertex of the sheet: {surface.V.shape}")
    used = np.zeros(surface.n, dtype=bool)
    used[surface.F] = True
    bad = np.flatnonzero(used & ~(np.isfinite(D).all(axis=1) & D.any(axis=1)))
    if len(bad):
        raise SolidError(
            f"{len(bad)} offset vectors are zero or not finite (first: {first_few(bad)}); use vectors from `offsets`"
        )
    return (surface, D) if used.all() else (Surface(surface.V[used], (np.cumsum(used) - 1)[surface.F]), D[used])


def _euler_characteristic(F: Ints) -> int:
    return int(np.count_nonzero(np.bincount(F.ravel()))) - len(F) // 2


def _check_upward(surface: Surface, skin: Skin, D: Floats) -> None:
    """Raise SolidError for pieces with offset vectors that point to the back of the faces."""
    count, label = surface.pieces
    upward = np.zeros(surface.m)
    for corner, copy in zip(surface.F.T, skin.upper.T, strict=True):
        along = np.einsum("mi,mi->m", surface.normals, D.take(corner, axis=0))
        upward += np.where(copy >= surface.n, -along, along)
    turned = np.flatnonzero(np.bincount(label, upward * surface.areas, count) <= 0)
    if len(turned):
        raise SolidError(
            f"the offset vectors point to the back of {len(turned)} of {count} pieces of the sheet (first piece with "
            f"face {int((label == turned[0]).argmax())}); reverse these faces or the vectors"
        )


def _pieces_and_shells(surface: Surface, F: Ints) -> tuple[int, int]:
    count, label = surface.pieces
    if len(misoriented_edges(surface.F, surface.edges)):
        return count, pieces(F, edge_table(F))[0]
    open_ = np.zeros(count, dtype=bool)
    edges = surface.edges
    open_[label[edges.outline // 3]] = True
    return count, count + int((~open_).sum())


def parts(solid: Solid) -> tuple[Solid, ...]:
    """Divide a solid into its pieces, sorted from low to high, then from front to back and left to right.
    A closed surface inside a piece is a void and stays with the smallest piece around it."""
    if solid.pieces == 1:
        return (solid,)
    count, shell = pieces(solid.F, edge_table(solid.F))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corner = solid.V[solid.F]
    np.minimum.at(low, shell, corner.min(axis=1))
    np.maximum.at(high, shell, corner.max(axis=1))
    outer = signed_volumes(solid.V, solid.F, shell, count) > 0
    owner = _owners(low, high, outer)
    order = sorted(np.flatnonzero(outer).tolist(), key=lambda k: tuple(low[k, ::-1].tolist()))
    return tuple(_part(solid, owner[shell] == k) for k in order)


def _owners(low: Floats, high: Floats, outer: Bools) -> Ints:
    owner = np.arange(len(low))
    outer_shells = np.flatnonzero(outer)
    size = np.linalg.norm(high[outer_shells] - low[outer_shells], axis=1)
    for k in np.flatnonzero(~outer):
        around = (low[outer_shells] <= low[k]).all(axis=1) & (high[outer_shells] >= high[k]).all(axis=1)
        owner[k] = outer_shells[np.where(around, size, np.inf).argmin()]
    return owner


def _part(solid: Solid, faces: Bools) -> Solid:
    F = solid.F[faces]
    used = np.zeros(len(solid.V), dtype=bool)
    used[F] = True
    F = (np.cumsum(used) - 1)[F]
    table = edge_table(F)
    return Solid(solid.V[used], F, pieces(F, table)[0] - euler_characteristic(F, table) // 2, 1)
