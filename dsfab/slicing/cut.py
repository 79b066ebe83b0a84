"""`cut`: a surface cut exactly along level lines of fields that are linear over its faces.

Inside a face the level lines of a linear field are parallel straight lines at known values: all are cut at once, any
number of them per face, without subdividing first. New vertices are made once per edge: no gap and no T-junction.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array, vstack

from dsfab.arrays import Bools, Floats, Ints, first
from dsfab.errors import PatternError
from dsfab.slicing.cells import Cells, Split, split_cells
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.slicing.triangulate import triangulate
from dsfab.surface import Surface
from dsfab.surface.mesh import ZERO_AREA

SNAP_FLOOR = 1e-9
"""Least snap fraction, applied also at snap = 0: lines nearer to a vertex go through it."""
ROUNDING = 8
"""Values within this many units in the last place of the largest value are on a level, however flat the field."""
LEVEL_GAP = 1e-6
"""Levels closer than this share of the field's range count as equal: thinner stripes are neither made nor left out."""
CELL_AREA = 1e3 * ZERO_AREA
"""A cell under this share of the squared size is not made (a margin over what `Surface` refuses)."""
FLATNESS = 1e-12
"""Nor is one whose area is under this share of its squared diameter: its corners lie on one line."""
ROUNDS = 12
"""How often vertices of cells that would have no area are moved before it is given up."""


def cut(surface: Surface, fields: Sequence[Floats], levels: Sequence[ArrayLike], snap: float = 0.05) -> Sheet:
    """All cells of a surface cut along the given levels of several fields, material and void together.

    fields : (n,) each, values on the vertices, linear over each face; any unit.
    levels : ascending values for each field. Strip j of a field has j levels below it; odd strips are material, the
             union over the fields is. Two equal levels (see `LEVEL_GAP`) enclose nothing and are left out.
    snap   : fraction of a vertex's largest edge range (0 to 0.4). A value closer to a level than that is moved onto it
             first, which moves a line by at most this fraction of an edge and avoids slivers. 0 is for exact areas; a
             floor of `SNAP_FLOOR` always holds, and where a cell would still have no area its corners are moved too.

    A cell that is material by an earlier field is not cut by later ones. A face that lies on a level wholly is void.
    Returns the cells in the order of their parent faces; the first n vertices are the uncut ones.
    Raises PatternError for values that are not finite, levels out of order, a snap out of range, or cells that have no
    area whatever is moved.
    """
    values = [_checked_field(surface, k, f) for k, f in enumerate(fields)]
    steps = [_checked_levels(k, f, wanted) for k, (f, wanted) in enumerate(zip(values, levels, strict=True))]
    if not 0 <= snap <= 0.4:
        raise PatternError(f"snap = {snap} must lie between 0 and 0.4")
    cells, X, weights = Cells.triangles(surface.F), surface.V, csr_array(eye_array(surface.n))
    parent, family = np.arange(surface.m), np.full(surface.m, VOID)
    for k, (field, lines) in enumerate(zip(values, steps, strict=True)):
        x = np.asarray(weights @ field)
        split = clean_split(cells, X, x, lines, family == VOID, snap, surface.size)
        cells, X, weights = split.cells, split.extended(X), extended_weights(weights, split)
        parent, family = parent[split.source], family[split.source]
        family[(split.strip > 0) & (split.strip % 2 == 1)] = k
    cut_surface, cell = filled(cells, X, parent)
    return Sheet(cut_surface, parent[cell], family[cell], weights)


def clean_split(
    cells: Cells,
    X: Floats,
    x: Floats,
    levels: Floats,
    active: Bools,
    snap: float,
    size: float,
    hold: Ints | None = None,
) -> Split:
    """`split_cells` of field x after snapping; no new cell is without area (see `CELL_AREA`, `FLATNESS`).

    hold : vertices whose value is never moved. Values move onto levels only, never across one, so that the cut stays a
    cut of convex polygons by chords that do not cross.
    """
    if not len(levels) or not active.any():
        nothing = np.empty(0, dtype=np.int64)
        return Split(cells, np.arange(len(cells.sizes)), np.where(active, 0, -1), nothing, nothing, np.empty(0))
    free = np.ones(len(x), dtype=bool)
    free[[] if hold is None else hold] = False
    x = _snapped(x, levels, cells.sides(active), max(snap, SNAP_FLOOR), free)
    for _ in range(ROUNDS):
        split = split_cells(cells, x, levels, active)
        corners = _collapsed_corners(split, split.extended(X), size)
        corners = corners[corners < len(x)]
        stray = corners[(x[corners] != _nearest(x[corners], levels)) & free[corners]]
        if not len(stray):
            break
        x[stray] = _nearest(x[stray], levels)
    return split


def extended_weights(weights: csr_array, split: Split) -> csr_array:
    """Rows for the new vertices of a split below those of the old ones: at most three entries, all of one face."""
    return csr_array(vstack([weights, split.blend(weights.shape[0]) @ weights], format="csr"))


def filled(cells: Cells, X: Floats, parent: Ints) -> tuple[Surface, Ints]:
    """The polygons filled with triangles, and the polygon (m',) of each triangle, ascending.

    Raises PatternError when triangles without area are left; it names their parent faces (c,).
    """
    F, cell = triangulate(cells, X)
    a, b, c = (X[F[:, i]] for i in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    bad = np.flatnonzero(areas <= ZERO_AREA * np.sum(np.ptp(X, axis=0) ** 2))
    if len(bad):
        raise PatternError(
            f"{len(bad)} of {len(F)} cells have no area (in faces {first(np.unique(parent[cell[bad]]))}); "
            "raise snap or the pinch radius, or remesh these faces if they are slivers themselves"
        )
    return Surface(X, F), cell


def _checked_field(surface: Surface, k: int, field: Floats) -> Floats:
    x = np.asarray(field, dtype=np.float64)
    if x.shape != (surface.n,):
        raise ValueError(f"field {k} must have shape ({surface.n},), got {x.shape}")
    bad = np.flatnonzero(~np.isfinite(x))
    if len(bad):
        raise PatternError(f"field {k} is not finite at {len(bad)} of {surface.n} vertices (first: {first(bad)})")
    return x


def _checked_levels(k: int, field: Floats, levels: ArrayLike) -> Floats:
    """The levels without equal ones: of a group of equal levels one stays if they are odd in number, else none."""
    wanted = np.asarray(levels, dtype=np.float64)
    if wanted.ndim != 1 or not np.isfinite(wanted).all() or (np.diff(wanted) < 0).any():
        raise PatternError(f"the levels of field {k} must be finite and ascending")
    if not len(wanted):
        return wanted
    begins = np.flatnonzero(np.diff(wanted, prepend=-np.inf) > LEVEL_GAP * np.ptp(field))
    distinct: Floats = wanted[begins[np.diff(begins, append=len(wanted)) % 2 == 1]]
    return distinct


def _nearest(x: Floats, levels: Floats) -> Floats:
    at = np.searchsorted(levels, x)
    below, above = levels[np.maximum(at - 1, 0)], levels[np.minimum(at, len(levels) - 1)]
    nearest: Floats = np.where(np.abs(x - below) < np.abs(above - x), below, above)
    return nearest


def _snapped(x: Floats, levels: Floats, sides: tuple[Ints, Ints], fraction: float, free: Bools) -> Floats:
    """A copy of x with free values within `fraction` of their edges' largest range of a level moved onto it."""
    reach = np.zeros(len(x))
    difference = np.abs(x[sides[0]] - x[sides[1]])
    for end in sides:
        np.maximum.at(reach, end, difference)
    nearest = _nearest(x, levels)
    rounding = ROUNDING * np.spacing(np.abs(x).max())  # a constant field that an earlier cut has interpolated
    moved: Floats = np.where(free & (np.abs(x - nearest) <= fraction * reach + rounding), nearest, x)
    return moved


def _collapsed_corners(split: Split, X: Floats, size: float) -> Ints:
    """Vertices of the cells that a split made without area; polygons that it left whole do not count."""
    parts = np.bincount(split.source)[split.source]
    area, squared_reach = split.cells.areas(X)
    bad = (parts > 1) & (area <= np.maximum(CELL_AREA * size**2, FLATNESS * squared_reach))
    return np.unique(split.cells.corner[bad[split.cells.owner]])
