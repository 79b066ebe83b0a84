"""Exact cuts of a surface along level lines of fields that are linear on each face."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, first_few, sorted_order
from dsfab.core.errors import PatternError, SurfaceError
from dsfab.slicing.cutting.cells import (
    SNAP_FLOOR,
    TIP,
    Cells,
    cells_without_edges,
    largest_ranges,
    snap_value_pairs,
    triangulate,
)
from dsfab.slicing.cutting.corner_fields import corner_band
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import LineKind, Sheet
from dsfab.slicing.cutting.split import Snapping, Split, clean_split
from dsfab.surface import Surface, corners_of, faces_at
from dsfab.surface.fields import CornerField, DividedField, DividedSurface
from dsfab.surface.mesh import ZERO_AREA

LEVEL_GAP = 1e-6  # Levels closer to each other than this fraction of the field's range are equal.

Field = Floats | CornerField | DividedField
DividedAgain = Callable[[PolygonMesh, int, Bools], Bools]
"""Function that returns a mask (c,) of material that the next fields may divide too. Arguments: the mesh of polygons;
number k of the latest field; a mask (m,) of faces where field k has no value, and of neighbours of these faces."""


def cut(surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05) -> Sheet:
    """Return a surface, cut along the levels of several fields, with all cells, material and void.
    fields : for each field, values (n,) on the vertices, or (n, 2): z + d and z - d for stripes of half-width d;
             or a `CornerField` or `DividedField`. All divided fields share one division, before any `CornerField`.
    levels : ascending values for each field. Strip j of a field has j levels below the strip; odd strips are material.
             With values (n, 2), material has |z - level| < d.
    snap   : 0 to 0.4. A value moves onto a level that is nearer than this fraction of the local range of values.
    A cell is material if any field makes the cell material.
    The cells are in the order of the faces; the first n vertices are those of the surface.
    Raises PatternError for values that are not finite, unordered levels, a snap out of range, or cells without area."""
    return sheet_of(cut_polygons(surface, fields, levels, snap))


def sheet_of(mesh: PolygonMesh) -> Sheet:
    """Divide polygons from `cut_polygons` into triangles of a sheet. Raises PatternError for triangles without area."""
    cut_surface, cell, sides_on = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    return Sheet(cut_surface, mesh.parent[cell], mesh.family[cell], mesh.weights, mesh.stubs, sides_on, mesh.lines)


def cut_polygons(
    surface: Surface,
    fields: Sequence[Field],
    levels: Sequence[ArrayLike],
    snap: float = 0.05,
    mesh: PolygonMesh | None = None,
) -> PolygonMesh:
    """Cut a surface as `cut` does, but return polygons.
    fields : values (n,) or (n, 2).    mesh : polygons without material, to cut; default: the faces."""
    return polygons_along(surface, fields, *checked_lines(surface, fields, levels), snap, mesh=mesh)


def polygons_along(
    surface: Surface,
    fields: Sequence[Field],
    values: Sequence[Floats],
    levels: Sequence[Floats],
    snap: float,
    divided_again: DividedAgain | None = None,
    mesh: PolygonMesh | None = None,
) -> PolygonMesh:
    """Cut a surface as `cut_polygons`, with checked input. values, levels : results of `checked_lines`.
    divided_again : rule for material that later fields cut, too."""
    if not 0 <= snap <= 0.4:
        raise PatternError(f"snap = {snap} must lie between 0 and 0.4")
    divided, on_parts = _division(fields)
    mesh = mesh or PolygonMesh.from_surface(surface, divided)
    for k, (field, x, lines) in enumerate(zip(fields, values, levels, strict=True)):
        blank, sides = np.zeros(surface.m, dtype=bool), x.ndim
        edges = mesh.lines.count + np.arange(sides * len(lines)).reshape(-1, sides)
        mesh = replace(mesh, lines=mesh.lines.with_more(LineKind.LEVEL, edges.size, k))
        if isinstance(field, CornerField):
            mesh, material = corner_band(mesh, field, lines, (snap, _tip_snap(snap)), surface.size, edges)
            blank = field.blank
        else:
            y = on_parts[k] if isinstance(field, DividedField) else np.asarray(mesh.weights @ x)
            splits, material = _plain_splits(mesh, y, lines, snap, surface.size, edges)
            for side, split in enumerate(splits):
                mesh = mesh.after_split(split, edges[:, side : side + 1])
                on_parts = {j: split.with_new_values(y) for j, y in on_parts.items() if j > k}
        mesh = mesh.with_material(k, material, blank)
        if divided_again:
            near_blank = blank | adjacent_faces(surface, blank)
            mesh = replace(mesh, again=mesh.again | divided_again(mesh, k, near_blank))
    return mesh


def adjacent_faces(surface: Surface, faces: Bools) -> Bools:
    """Return a mask (m,) of the unmarked faces that share a vertex with marked faces (m,)."""
    return faces_at(surface.F, corners_of(surface.F, faces, surface.n)) & ~faces


def _division(fields: Sequence[Field]) -> tuple[DividedSurface | None, dict[int, Floats]]:
    on_parts = {k: field for k, field in enumerate(fields) if isinstance(field, DividedField)}
    if not on_parts:
        return None, {}
    divided = next(iter(on_parts.values())).divided
    if any(field.divided is not divided for field in on_parts.values()):
        raise ValueError("all fields of type DividedField must have the same value of `divided`")
    if any(isinstance(field, CornerField) for field in fields[: max(on_parts)]):
        raise ValueError("each DividedField must come before every CornerField")
    return divided, {k: field.x for k, field in on_parts.items()}


def _tip_snap(snap: float) -> float:
    return min(max(snap, LEVEL_GAP), TIP)


def _plain_splits(
    mesh: PolygonMesh, x: Floats, lines: Floats, snap: float, size: float, edges: Ints
) -> tuple[list[Split], Bools]:
    if x.ndim == 2:
        return _band(mesh, x, lines, snap, size, edges)
    split = clean_split(mesh.cells, mesh.X, x, lines, mesh.void | mesh.again, Snapping(snap, size))
    return [split], (split.strip > 0) & (split.strip % 2 == 1)


def _band(
    mesh: PolygonMesh, x: Floats, levels: Floats, snap: float, size: float, edges: Ints
) -> tuple[list[Split], Bools]:
    cells, X, void = mesh.cells, mesh.X, mesh.void | mesh.again
    if not len(levels):
        return [], np.zeros(len(void), dtype=bool)
    solid, empty = cells_without_edges(cells, x[cells.corner], levels)
    solid, active = void & solid, void & ~solid & ~empty
    a, b = cells.sides(active)
    reach = np.stack([largest_ranges(len(x), (a, b), np.abs(x[a, i] - x[b, i])) for i in (0, 1)], axis=1)
    x = snap_value_pairs(x, levels, reach, max(snap, SNAP_FLOOR))
    tip, every = Snapping(_tip_snap(snap), size), np.ones(len(levels), dtype=bool)
    upper_split = clean_split(cells, X, x[:, 0], levels, active, tip, above=~every)
    X, lower_values = upper_split.with_new_values(X), upper_split.with_new_values(x[:, 1])
    cells = upper_split.cells.with_new_lines(edges[:, :1])
    lower_split = clean_split(cells, X, lower_values, levels, active[upper_split.source], tip, above=every)
    in_stripe = upper_split.strip[lower_split.source] > lower_split.strip
    return [upper_split, lower_split], solid[upper_split.source][lower_split.source] | in_stripe


def filled_polygons(cells: Cells, X: Floats, parent: Ints) -> tuple[Surface, Ints, Ints]:
    """Divide polygons into triangles. Return also each triangle's polygon (m',), and each side's line (m', 3).
    X : (n', 3) vertices, metres.    parent : (c,) uncut face of each polygon.
    Raises PatternError for triangles without area."""
    F, cell = triangulate(cells, X)
    try:
        return Surface(X, F), cell, cells.triangle_sides(F, cell)
    except SurfaceError as refused:
        areas = 0.5 * np.linalg.norm(area_vectors(X, F), axis=1)
        bad = np.flatnonzero(areas <= ZERO_AREA * np.sum(np.ptp(X, axis=0) ** 2))
        raise PatternError(
            f"{len(bad)} of {len(F)} cells have no area (in faces {first_few(np.unique(parent[cell[bad]]))}); "
            "raise slicing.snap or the radius of discs at point contacts, or remesh these faces if they are very thin"
        ) from refused


def checked_lines(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike]
) -> tuple[list[Floats], list[Floats]]:
    """Return the values (n,) or (n, 2) of each field, and the distinct levels of each field.
    Raises PatternError for invalid fields or levels."""
    values = [_checked_field(surface, k, f) for k, f in enumerate(fields)]
    return values, [_checked_levels(k, x, lines) for k, (x, lines) in enumerate(zip(values, levels, strict=True))]


def _checked_field(surface: Surface, k: int, field: Field) -> Floats:
    if isinstance(field, DividedField):
        if (field.divided.whole.n, field.divided.whole.m) != (surface.n, surface.m):
            raise ValueError(f"field {k} divides another surface")
        return field.at_vertices
    x = field.x if isinstance(field, CornerField) else np.asarray(field, dtype=np.float64)
    if x.shape not in ((surface.n,), (surface.n, 2)):
        raise ValueError(f"field {k} must have shape ({surface.n},) or ({surface.n}, 2), got {x.shape}")
    bad = np.flatnonzero(~np.isfinite(x.reshape(surface.n, -1)).all(axis=1))
    if len(bad):
        raise PatternError(
            f"the values of field {k} are not finite at {len(bad)} of {surface.n} vertices (first: {first_few(bad)})"
        )
    return x


def _checked_levels(k: int, field: Floats, levels: ArrayLike) -> Floats:
    values = np.asarray(levels, dtype=np.float64)
    if values.ndim != 1 or not np.isfinite(values).all() or (np.diff(values) < 0).any():
        raise PatternError(f"the levels of field {k} must be finite and ascending")
    if not len(values):
        return values
    begins = np.flatnonzero(np.diff(values, prepend=-np.inf) > LEVEL_GAP * np.ptp(field))
    if field.ndim == 2:
        return np.asarray(values[begins])
    distinct: Floats = values[begins[np.diff(begins, append=len(values)) % 2 == 1]]
    return distinct


def recut_polygons(sheet: Sheet, cells: Ints) -> tuple[PolygonMesh, Ints]:
    """Return the triangles `cells` (k,) of a sheet, and neighbours, as polygons to cut again.
    Return also the triangle (c,) of each polygon.    cells : ascending."""
    surface = sheet.surface
    selected = np.zeros(surface.m, dtype=bool)
    selected[cells] = True
    cell_a, cell_b = surface.edges.pairs.T // 3
    touching = selected[cell_a] | selected[cell_b]
    selected[cell_a[touching]] = selected[cell_b[touching]] = True
    source = np.flatnonzero(selected)
    vertices, F = np.unique(surface.F[source], return_inverse=True)
    triangles, X = Cells.triangles(F.reshape(-1, 3), sheet.sides_on[source]), surface.V[vertices]
    weights, parent, family = sheet.weights[vertices], sheet.parent[source], sheet.family[source]
    mesh = PolygonMesh.from_cells(F, triangles, X, weights, parent, family)
    return replace(mesh, lines=sheet.lines), source


def with_polygons(sheet: Sheet, mesh: PolygonMesh, source: Ints) -> Sheet:
    """Return a sheet in which the polygons of `mesh` replace some triangles.
    source : (c,) for each polygon, the triangle that it replaces in part or in full."""
    surface = sheet.surface
    stay = np.ones(surface.m, dtype=bool)
    stay[source] = False
    unchanged, vertices = np.flatnonzero(stay), np.unique(surface.F[~stay])
    new_count = len(mesh.X) - len(vertices)
    number = np.concatenate([vertices, surface.n + np.arange(new_count)])
    start = np.concatenate([3 * np.arange(len(unchanged)), 3 * len(unchanged) + mesh.cells.start])
    corner = np.concatenate([surface.F[unchanged].ravel(), number[mesh.cells.corner]])
    cells = Cells(start, corner, np.concatenate([sheet.sides_on[unchanged].ravel(), mesh.cells.sides_on]))
    source_cell = np.concatenate([unchanged, source])
    order = sorted_order(source_cell)
    X = np.concatenate([surface.V, mesh.X[len(vertices) :]])
    weights = csr_array(vstack([sheet.weights, mesh.weights[len(vertices) :]], format="csr"))
    cells, parent = cells.subset(order), sheet.parent[source_cell[order]]
    family = np.concatenate([sheet.family[unchanged], mesh.family])[order]
    cut_surface, cell, sides_on = filled_polygons(cells, X, parent)
    return Sheet(cut_surface, parent[cell], family[cell], weights, 0, sides_on, mesh.lines)


def divided_field_values(sheet: Sheet, uncut: Surface, field: DividedField) -> Floats:
    """Return the values (n',) or (n', 2) of a `DividedField` (linear on parts of faces) at the vertices of a sheet."""
    divided, F = field.divided, sheet.surface.F
    values = sheet.carry(field.at_vertices)
    parts = divided.cut_parts()
    order = np.argsort(divided.parent[parts], kind="stable")
    parts = parts[order]
    parents = divided.parent[parts]
    face = np.full(sheet.surface.n, -1)
    inside = np.isin(sheet.parent, parents)
    face[F[inside]] = sheet.parent[inside][:, None]
    vertex = np.flatnonzero(face >= 0)
    coordinates = np.stack(
        [np.asarray(sheet.weights[vertex, uncut.F[face[vertex], c]]).ravel() for c in range(3)], axis=1
    )
    begin, end = (np.searchsorted(parents, face[vertex], side=side) for side in ("left", "right"))
    count = end - begin
    vertex_row = np.repeat(np.arange(len(vertex)), count)
    part = parts[np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))]
    part_coordinates = np.einsum("ki,kij->kj", coordinates[vertex_row], np.linalg.inv(divided.corners(part)))
    order = np.lexsort([-part_coordinates.min(axis=1), vertex_row])
    chosen = order[np.concatenate([[True], np.diff(vertex_row[order]) > 0])] if len(order) else order
    corners = field.x[divided.surface.F[part[chosen]]]
    values[vertex[vertex_row[chosen]]] = np.einsum("kc,kc...->k...", part_coordinates[chosen], corners)
    return values
