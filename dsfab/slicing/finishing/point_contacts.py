"""Pinches: vertices where material meets in a single point. Pinches are joined or split.

material . void         join: a disc around the pinch      split: the disc becomes void
. . . .  x . . . .            becomes material
 void    . material"""

from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, first_few
from dsfab.core.errors import PatternError
from dsfab.core.messages import count_phrase
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import VOID, LineKind, Sheet
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.surface.topology import edge_table

Rule = Literal["join", "split"]

DISC_ROUNDS = 3  # Maximum number of rounds that put discs around point contacts. A disc can create a new contact.
CORNER_ROUNDS = 2  # Maximum number of rounds that change only corners of cells, and create no point contact.


class PinchResult(NamedTuple):
    """A sheet without point contacts of material. pinches : number of repaired point contacts."""

    sheet: Sheet
    pinches: int


def resolve_pinches(sheet: Sheet, radius: float, rule: Rule = "join") -> PinchResult:
    """Fill ("join") or cut out ("split") discs of `radius` metres around point contacts of material.
    Raises PatternError for invalid input, for remaining point contacts, and if no material is left."""
    if not (np.isfinite(radius) and radius > 0):
        raise PatternError(f"the radius {radius} for repairs at point contacts must be a positive length in metres")
    if rule not in ("join", "split"):
        raise PatternError(f"slicing.pinch = {rule!r} must be 'join' or 'split'")
    _require_material(sheet)
    pinches, count = pinched_vertices(sheet), 0
    for turn in range(DISC_ROUNDS + CORNER_ROUNDS):
        if not len(pinches):
            break
        sheet, discs = _resolve_once(sheet, pinches, radius, rule, corners=turn >= DISC_ROUNDS)
        pinches, count = pinched_vertices(sheet), count + discs
    if len(pinches):
        raise PatternError(
            f"material still meets in a single point at {count_phrase(len(pinches), 'vertex')} "
            f"(first: {first_few(pinches)}); change slicing.pinch, the sheet's thickness, or the stripes' phase"
        )
    _require_material(sheet)
    return PinchResult(sheet, count)


def _resolve_once(sheet: Sheet, pinches: Ints, radius: float, rule: Rule, corners: bool) -> tuple[Sheet, int]:
    count = 0
    for turn, group in enumerate(_groups_without_edges(pinches, _links(sheet, pinches))):
        if turn:  # discs around earlier groups may have removed point contacts of this group
            group = np.intersect1d(group, pinched_vertices(sheet))
        if len(group):
            V = sheet.surface.V
            distance = _corner_distance(sheet, group, radius) if corners else np.asarray(cKDTree(V[group]).query(V)[0])
            sheet, count = _with_discs(sheet, group, distance, radius, rule), count + len(group)
    return sheet, count


def _require_material(sheet: Sheet) -> None:
    if not sheet.material.any():
        raise PatternError(
            "no material is left after slicing; lower the threshold or raise the frequency of the stripes, or keep "
            "material with pattern.rim or pattern.keep"
        )


def pinched_vertices(sheet: Sheet) -> Ints:
    """Return the vertices (k,) of a sheet where parts of the material meet without a common edge."""
    if not sheet.material.any():
        return np.empty(0, dtype=np.int64)
    pinched = sheet.subset().surface.pinches
    if not len(pinched):
        return pinched
    used = np.zeros(sheet.surface.n, dtype=bool)
    used[sheet.surface.F[sheet.material]] = True
    return np.flatnonzero(used)[pinched]


def _links(sheet: Sheet, vertices: Ints) -> Ints:
    marked = np.zeros(sheet.surface.n, dtype=bool)
    marked[vertices] = True
    p, q, r = marked[sheet.surface.F].T
    candidates = sheet.surface.F[np.flatnonzero((p & q) | (q & r) | (r & p))]
    ends = edge_table(candidates).ends if len(candidates) else np.empty((0, 2), dtype=np.int64)
    return np.asarray(ends[marked[ends].all(axis=1)])


def _groups_without_edges(pinches: Ints, ends: Ints) -> list[Ints]:
    """Divide point contacts into groups, so that no edge joins two contacts of a group. ends : (k, 2) the edges."""
    groups = []
    while len(pinches):
        later = np.unique(ends[np.isin(ends, pinches).all(axis=1), 1])
        groups.append(np.setdiff1d(pinches, later))
        pinches = np.intersect1d(pinches, later)
    return groups


def _corner_distance(sheet: Sheet, pinches: Ints, radius: float) -> Floats:
    """Return a field (n',) that is 0 at pinches (point contacts of material).
    On edges at a pinch, the field reaches `radius` at the distance min(radius, 0.4 edge length)."""
    V, ends = sheet.surface.V, sheet.surface.edges.ends
    x = np.full(len(V), radius / 0.4)
    for p, q in (ends.T, ends[:, ::-1].T):
        p, q = p[np.isin(p, pinches)], q[np.isin(p, pinches)]
        np.maximum.at(x, q, np.linalg.norm(V[p] - V[q], axis=1))
    x[pinches] = 0
    return x


def _with_discs(sheet: Sheet, pinches: Ints, distance: Floats, radius: float, rule: Rule) -> Sheet:
    mesh, touched = PolygonMesh.from_sheet(sheet), np.asarray((distance[sheet.surface.F] < radius).any(axis=1))
    snapping = Snapping(0.1, sheet.surface.size, pinches)
    split = clean_split(mesh.cells, mesh.X, distance, np.array([radius]), touched, snapping)
    disc, lines = np.full((1, 1), mesh.lines.count), mesh.lines.with_more(LineKind.DISC, 1)
    mesh = mesh.after_split(split, disc)
    surface, cell, sides_on = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    inside, family = _connected_to_pinches(mesh, split.strip == 0, pinches)[cell], mesh.family[cell]
    if rule == "split":
        family[inside] = VOID
    else:
        fill = inside & (family == VOID)
        nearest = cKDTree(mesh.X[pinches]).query(surface.centroids[fill])[1]
        family[fill] = _first_family(sheet, pinches)[nearest]
    return Sheet(surface, mesh.parent[cell], family, mesh.weights, 0, sides_on, lines)


def _connected_to_pinches(mesh: PolygonMesh, inside: Bools, pinches: Ints) -> Bools:
    part, owner = mesh.part_labels(inside), mesh.cells.owner
    return inside & np.isin(part, part[owner[inside[owner] & np.isin(mesh.cells.corner, pinches)]])


def _first_family(sheet: Sheet, vertices: Ints) -> Ints:
    marked = np.zeros(sheet.surface.n, dtype=bool)
    marked[vertices] = True
    candidates = np.flatnonzero(sheet.material & marked[sheet.surface.F].any(axis=1))
    corner, where = np.unique(sheet.surface.F[candidates].ravel(), return_index=True)
    return np.asarray(sheet.family[candidates[where[np.searchsorted(corner, vertices)] // 3]])
