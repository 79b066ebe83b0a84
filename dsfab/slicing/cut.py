"""`cut`: a surface cut exactly along level lines of fields that are linear over its faces.

Inside a face the level lines of a linear field are parallel straight lines at known values: all are cut at once, any
number of them per face, without subdividing first. New vertices are made once per edge: no gap and no T-junction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array, vstack

from dsfab.arrays import Bools, Floats, Ints, first
from dsfab.errors import PatternError, SurfaceError
from dsfab.slicing.cells import Cells
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.slicing.snap import SNAP_FLOOR, TIP, nearest, settled, snapped, snapped_together
from dsfab.slicing.split import Split, split_cells
from dsfab.slicing.triangulate import triangulate
from dsfab.surface import Surface
from dsfab.surface.mesh import ZERO_AREA

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

    fields : values on the vertices, linear over each face; any unit. (n,) each, or (n, 2) for stripes whose width
             varies over a face: two fields z + d and z - d, levels at the middles of the stripes.
    levels : ascending values for each field. Strip j of a field has j levels below it; odd strips are material, the
             union over the fields is. Two equal levels (see `LEVEL_GAP`) enclose nothing and are left out.
             Of two fields, material is where the first has more levels below it than the second: |z - level| < d.
    snap   : fraction of a vertex's largest edge range (0 to 0.4). A value closer to a level than that is moved onto it
             first, which moves a line by at most this fraction of an edge and avoids slivers. 0 is for exact areas; a
             floor of `SNAP_FLOOR` always holds, and where a cell would still have no area its corners are moved too.

    A cell that is material by an earlier field is not cut by later ones. A face that lies on a level wholly is void.
    Returns the cells in the order of their parent faces; the first n vertices are the uncut ones.
    Raises PatternError for values that are not finite, levels out of order, a snap out of range, or cells that have no
    area whatever is moved.
    """
    done = _divided(surface, fields, levels, snap)
    cut_surface, cell = filled(done.cells, done.X, done.parent)
    return Sheet(cut_surface, done.parent[cell], done.family[cell], done.weights)


def material_area(surface: Surface, fields: Sequence[Floats], levels: Sequence[ArrayLike], snap: float = 0.05) -> float:
    """Area of the material of `cut` with the same arguments, square metres, without filling the cells."""
    done = _divided(surface, fields, levels, snap)
    return float(done.cells.areas(done.X)[0][done.family != VOID].sum())


@dataclass(frozen=True, eq=False)
class _Divided:
    """Convex cells on vertices X (n', 3), their faces and families (c',), and the weights of the vertices."""

    cells: Cells
    X: Floats
    weights: csr_array
    parent: Ints
    family: Ints


def _divided(surface: Surface, fields: Sequence[Floats], levels: Sequence[ArrayLike], snap: float) -> _Divided:
    values = [_checked_field(surface, k, f) for k, f in enumerate(fields)]
    steps = [_checked_levels(k, f, wanted) for k, (f, wanted) in enumerate(zip(values, levels, strict=True))]
    if not 0 <= snap <= 0.4:
        raise PatternError(f"snap = {snap} must lie between 0 and 0.4")
    cells, X, weights = Cells.triangles(surface.F), surface.V, csr_array(eye_array(surface.n))
    parent, family = np.arange(surface.m), np.full(surface.m, VOID)
    for k, (field, lines) in enumerate(zip(values, steps, strict=True)):
        x, void = np.asarray(weights @ field), family == VOID
        if x.ndim == 1:
            split = clean_split(cells, X, x, lines, void, snap, surface.size)
            splits, material = [split], (split.strip > 0) & (split.strip % 2 == 1)
        else:
            splits, material = _band(cells, X, x, lines, void, snap, surface.size)
        for split in splits:
            cells, X, weights = split.cells, split.extended(X), extended_weights(weights, split)
            parent, family = parent[split.source], family[split.source]
        family[material] = k
    return _Divided(cells, X, weights, parent, family)


def _band(
    cells: Cells, X: Floats, x: Floats, levels: Floats, void: Bools, snap: float, size: float
) -> tuple[list[Split], Bools]:
    """Two splits of the void cells, by x[:, 0] and by x[:, 1], and which of the resulting cells they make material.

    Where x[:, 0] - x[:, 1] stays over the gap of the levels, or under zero, nothing is cut.

            x[:, 0] = level . ' material
        . '        ' .                      The two lines of a stripe meet where it ends in a tip: there the second
          void         x[:, 1] = level      split finds the vertex of the first one on its level.
    """
    if not len(levels):
        return [], np.zeros(len(void), dtype=bool)
    solid, empty = settled(cells, x, levels)
    solid, active = void & solid, void & ~solid & ~empty
    x = snapped_together(x, levels, cells.sides(active), max(snap, SNAP_FLOOR))
    tip, every = min(max(snap, LEVEL_GAP), TIP), np.ones(len(levels), dtype=bool)
    one = clean_split(cells, X, x[:, 0], levels, active, tip, size, above=~every)
    X, second = one.extended(X), one.extended(x[:, 1])
    two = clean_split(one.cells, X, second, levels, active[one.source], tip, size, above=every)
    more = one.strip[two.source] > two.strip
    return [one, two], solid[one.source][two.source] | more


def clean_split(
    cells: Cells,
    X: Floats,
    x: Floats,
    levels: Floats,
    active: Bools,
    snap: float,
    size: float,
    hold: Ints | None = None,
    above: Bools | None = None,
) -> Split:
    """`split_cells` of field x after snapping; no new cell is without area (see `CELL_AREA`, `FLATNESS`).

    hold : vertices whose value is never moved. Values move onto levels only, never across one, so that the cut stays a
    cut of convex polygons by chords that do not cross.    above : see `split_cells`.
    """
    if not len(levels) or not active.any():
        nothing = np.empty(0, dtype=np.int64)
        return Split(cells, np.arange(len(cells.sizes)), np.where(active, 0, -1), nothing, nothing, np.empty(0))
    free = np.ones(len(x), dtype=bool)
    free[[] if hold is None else hold] = False
    x = snapped(x, levels, cells.sides(active), max(snap, SNAP_FLOOR), free)
    for _ in range(ROUNDS):
        split = split_cells(cells, x, levels, active, above)
        corners = _collapsed_corners(split, split.extended(X), size)
        corners = corners[corners < len(x)]
        stray = corners[(x[corners] != nearest(x[corners], levels)) & free[corners]]
        if not len(stray):
            break
        x[stray] = nearest(x[stray], levels)
    return split


def extended_weights(weights: csr_array, split: Split) -> csr_array:
    """Rows for the new vertices of a split below those of the old ones: at most three entries, all of one face."""
    return csr_array(vstack([weights, split.blend(weights.shape[0]) @ weights], format="csr"))


def filled(cells: Cells, X: Floats, parent: Ints) -> tuple[Surface, Ints]:
    """The polygons filled with triangles, and the polygon (m',) of each triangle, ascending.

    Raises PatternError when triangles without area are left; it names their parent faces (c,).
    """
    F, cell = triangulate(cells, X)
    try:
        return Surface(X, F), cell
    except SurfaceError as refused:
        a, b, c = (X[F[:, i]] for i in range(3))
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        bad = np.flatnonzero(areas <= ZERO_AREA * np.sum(np.ptp(X, axis=0) ** 2))
        raise PatternError(
            f"{len(bad)} of {len(F)} cells have no area (in faces {first(np.unique(parent[cell[bad]]))}); "
            "raise snap or the pinch radius, or remesh these faces if they are slivers themselves"
        ) from refused


def _checked_field(surface: Surface, k: int, field: Floats) -> Floats:
    x = np.asarray(field, dtype=np.float64)
    if x.shape not in ((surface.n,), (surface.n, 2)):
        raise ValueError(f"field {k} must have shape ({surface.n},) or ({surface.n}, 2), got {x.shape}")
    bad = np.flatnonzero(~np.isfinite(x.reshape(surface.n, -1)).all(axis=1))
    if len(bad):
        raise PatternError(f"field {k} is not finite at {len(bad)} of {surface.n} vertices (first: {first(bad)})")
    return x


def _checked_levels(k: int, field: Floats, levels: ArrayLike) -> Floats:
    """The levels without equal ones: of a group of equal levels one stays if they are odd in number, else none.

    For two fields one of each group stays.
    """
    wanted = np.asarray(levels, dtype=np.float64)
    if wanted.ndim != 1 or not np.isfinite(wanted).all() or (np.diff(wanted) < 0).any():
        raise PatternError(f"the levels of field {k} must be finite and ascending")
    if not len(wanted):
        return wanted
    begins = np.flatnonzero(np.diff(wanted, prepend=-np.inf) > LEVEL_GAP * np.ptp(field))
    if field.ndim == 2:
        return np.asarray(wanted[begins])
    distinct: Floats = wanted[begins[np.diff(begins, append=len(wanted)) % 2 == 1]]
    return distinct


def _collapsed_corners(split: Split, X: Floats, size: float) -> Ints:
    """Vertices of the cells that a split made without area; polygons that it left whole do not count."""
    divided = np.flatnonzero(np.bincount(split.source)[split.source] > 1)
    if not len(divided):
        return divided
    cells = split.cells.some(divided)
    area, squared_reach = cells.areas(X)
    bad = area <= np.maximum(CELL_AREA * size**2, FLATNESS * squared_reach)
    return np.unique(cells.corner[bad[cells.owner]])
