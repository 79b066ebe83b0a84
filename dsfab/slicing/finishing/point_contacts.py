"""Pinches: vertices where material meets in a single point. No solid is possible; join the parts or split them.

    material . void         join: a disc around the pinch      split: the disc becomes void
    . . . .  x . . . .            becomes material
     void    . material

The full sheet, material and void together, is cut along the disc, so that the cells around it still fit.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, first_few
from dsfab.core.errors import PatternError
from dsfab.slicing.cutting.cells import Cells
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.polygon_mesh import weights_after_split
from dsfab.slicing.cutting.sheet import VOID, LineKind, Sheet
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.surface.topology import edge_table, pieces

Rule = Literal["join", "split"]

DISC_ROUNDS = 3
"""Most rounds of discs, because a disc can make a new pinch where its rim meets another stripe."""
CORNER_ROUNDS = 2
"""Most rounds of corner cuts after the discs, which make no new pinch; the second is for neighbours of earlier
pinches."""


@dataclass(frozen=True, eq=False)
class PinchResult:
    """A sheet without pinches.

    sheet       : all cells, material and void.
    count       : number of discs and corner cuts; 0 leaves the sheet as it was.
    area_change : material area after less before, square metres: positive for "join", negative for "split".
    """

    sheet: Sheet
    count: int
    area_change: float


def resolve_pinches(sheet: Sheet, radius: float, rule: Rule = "join") -> PinchResult:
    """Make discs of `radius` metres around all pinches of the material into material ("join") or void ("split").

    Up to three rounds of discs, then corners cut at min(radius, 0.4 edge) around the remaining pinches. Joined cells
    take the family of the first material cell at their pinch. Pinches on the surface's boundary count too.

    Raises PatternError without material, before or after; for an impossible `radius` or `rule`; and for remaining
    pinches ("join" cannot mend a place where the surface touches itself in a vertex)."""
    if not (np.isfinite(radius) and radius > 0):
        raise PatternError(f"the pinch radius {radius} must be a positive length in metres")
    if rule not in ("join", "split"):
        raise PatternError(f"the pinch rule {rule!r} must be 'join' or 'split'")
    before, count = _material_area(sheet), 0
    pinches = pinched_vertices(sheet)
    for turn in range(DISC_ROUNDS + CORNER_ROUNDS):
        if not len(pinches):
            break
        sheet, discs = _resolve_once(sheet, pinches, radius, rule, corners=turn >= DISC_ROUNDS)
        pinches, count = pinched_vertices(sheet), count + discs
    if len(pinches):
        raise PatternError(
            f"material still meets in a single point at {len(pinches)} vertices (first: {first_few(pinches)}); "
            "use the other pinch rule, another radius, or another phase"
        )
    return PinchResult(sheet, count, _material_area(sheet) - before)


def _resolve_once(sheet: Sheet, pinches: Ints, radius: float, rule: Rule, corners: bool) -> tuple[Sheet, int]:
    """The sheet with a disc or a corner cut at each of the pinches (k,), and their number."""
    count = 0
    for turn, group in enumerate(_groups_without_edges(pinches, _links(sheet, pinches))):
        if turn:  # a disc of an earlier group may have removed some pinches
            group = np.intersect1d(group, pinched_vertices(sheet))
        if len(group):
            distance = _corner_distance(sheet, group, radius) if corners else _distance_to_pinches(sheet, group)
            sheet, count = _with_discs(sheet, group, distance, radius, rule), count + len(group)
    return sheet, count


def _material_area(sheet: Sheet) -> float:
    if not sheet.material.any():
        raise PatternError(
            "no material is left after slicing; lower the threshold, raise the frequency, or keep a rim or a disc"
        )
    return float(sheet.surface.areas[sheet.material].sum())


def pinched_vertices(sheet: Sheet) -> Ints:
    """(k,) vertices of a sheet around which the material has more than one edge-connected fan of cells."""
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
    """The pinches in groups without common edges, because on a common edge the linear distance would be zero."""
    groups = []
    while len(pinches):
        later = np.unique(ends[np.isin(ends, pinches).all(axis=1), 1])
        groups.append(np.setdiff1d(pinches, later))
        pinches = np.intersect1d(pinches, later)
    return groups


def _distance_to_pinches(sheet: Sheet, pinches: Ints) -> Floats:
    V = sheet.surface.V
    return np.asarray(cKDTree(V[pinches]).query(V)[0])


def _corner_distance(sheet: Sheet, pinches: Ints, radius: float) -> Floats:
    """(n',) a field whose level `radius` cuts edges from a pinch at min(radius, 0.4 edge); cuts of both ends never
    meet.
    """
    surface = sheet.surface
    x = np.full(surface.n, radius / 0.4)
    pinch = np.zeros(surface.n, dtype=bool)
    pinch[pinches] = True
    for p, q in (surface.edges.ends.T, surface.edges.ends[:, ::-1].T):
        starts_at_pinch = pinch[p]
        np.maximum.at(
            x, q[starts_at_pinch], np.linalg.norm(surface.V[p[starts_at_pinch]] - surface.V[q[starts_at_pinch]], axis=1)
        )
    x[pinches] = 0
    return x


def _with_discs(sheet: Sheet, pinches: Ints, distance: Floats, radius: float, rule: Rule) -> Sheet:
    V, F = sheet.surface.V, sheet.surface.F
    touched = np.asarray((distance[F] < radius).any(axis=1))
    level = np.array([radius])
    cells, disc = Cells.triangles(F, sheet.sides_on), np.full((1, 1), sheet.lines.count)
    split = clean_split(cells, V, distance, level, touched, Snapping(0.1, sheet.surface.size, pinches))
    cells = split.cells.with_new_lines(disc)
    surface, cell, sides_on = filled_polygons(cells, split.with_new_values(V), sheet.parent[split.source])
    before = split.source[cell]
    inside = _connected_to_pinches(surface.F, split.strip[cell] == 0, pinches)
    family = sheet.family[before]
    if rule == "split":
        family[inside] = VOID
    else:
        fill = inside & (family == VOID)
        nearest = cKDTree(V[pinches]).query(surface.centroids[fill])[1]
        family[fill] = _first_family(sheet, pinches)[nearest]
    weights, lines = weights_after_split(sheet.weights, split), sheet.lines.with_more(LineKind.DISC, 1)
    return Sheet(surface, sheet.parent[before], family, weights, 0, sides_on, lines)


def _connected_to_pinches(F: Ints, inside: Bools, pinches: Ints) -> Bools:
    """(m',) the inside cells that are edge-connected to a pinch, without other parts of the surface nearby."""
    inside_faces = F[inside]
    count, piece = pieces(inside_faces, edge_table(inside_faces))
    reached = np.zeros(count, dtype=bool)
    reached[piece[np.isin(inside_faces, pinches).any(axis=1)]] = True
    result = inside.copy()
    result[inside] = reached[piece]
    return result


def _first_family(sheet: Sheet, vertices: Ints) -> Ints:
    marked = np.zeros(sheet.surface.n, dtype=bool)
    marked[vertices] = True
    candidates = np.flatnonzero(sheet.material & marked[sheet.surface.F].any(axis=1))
    corner, where = np.unique(sheet.surface.F[candidates].ravel(), return_index=True)
    return np.asarray(sheet.family[candidates[where[np.searchsorted(corner, vertices)] // 3]])
