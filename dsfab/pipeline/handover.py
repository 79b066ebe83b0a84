"""The load case of a cut sheet: what the uncut surface carried, handed to the material that is left."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats
from dsfab.errors import StaticsError
from dsfab.pipeline.tributary import Tributary
from dsfab.slicing import Sheet
from dsfab.slicing.sheet import ON_SIMPLEX
from dsfab.surface import LoadCase, LoadParts, Surface

REACH = 0.1
"""Concentrated loads are handed over this share of the surface's size at most: further away, nothing carries them."""


LOST = 0.01
"""Pieces that are dropped may carry this share of a concentrated load at most."""


ATTACH = "set pattern.rim, raise pattern.keep, or change a phase or a mode"
"""What helps then."""


def lost_load(surface: Surface, drawn: Sheet, sheet: Sheet, loads: Iterable[LoadCase]) -> str:
    """What is lost with pieces that reach no support, as a clause; empty when they carry no concentrated load.

    A load whose own material was cut away is handed to what lies next to it (`sheet_load`). One that still stands on
    material, but on a piece that is not held, is carried by nothing, however close the rest is.

    drawn : all material, the loose pieces included.    sheet : what is kept of it.
    loads : of which the first that is lost is told.
    """
    dropped = (drawn.same_vertex() >= 0) & (sheet.same_vertex() < 0)
    for load in loads:
        size = np.linalg.norm(load.point, axis=1) * load.loaded
        if (lost := size[dropped].sum()) > LOST * size.sum():
            place = surface.V[dropped][size[dropped].argmax()].round(3).tolist()
            return f"the load at {place} m ({lost:.3g} N) stands on a piece that reaches no support"
    return ""


def sheet_loads(surface: Surface, drawn: Sheet, sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, LoadCase]:
    """The `sheet_load` of each; raises StaticsError as it does, and for a load that is lost (see `lost_load`)."""
    if lost := lost_load(surface, drawn, sheet, loads.values()):
        raise StaticsError(f"{lost}; {ATTACH}")
    return loads_on(surface, sheet, loads)


def loads_on(surface: Surface, sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, LoadCase]:
    """The `sheet_load` of each; who carries what lies on coverings is found once."""
    covered = any(load.parts is not None and load.parts.covered.any() for load in loads.values())
    tributary = Tributary.of(surface, sheet) if covered else None
    return {name: sheet_load(surface, sheet, load, tributary) for name, load in loads.items()}


def sheet_load(surface: Surface, sheet: Sheet, load: LoadCase, tributary: Tributary | None = None) -> LoadCase:
    """The supports and loads of the uncut surface on a kept sheet of it, see `sheet_supports`.

    A concentrated force on a vertex that the sheet still has stays there; any other goes to the nearest vertex of the
    sheet, so that resultants are kept exactly and moments up to the distance moved. The sheet weighs what is left of
    it, and what acts on material alone acts there; what lies on a covering goes to the material that is nearest (see
    `Tributary`), with resultant and moment. `parts` are those of the sheet's own vertices and cells.

    tributary : of this sheet, where it is known.

    Raises StaticsError as `sheet_supports` does, and when a concentrated force finds no material near it.
    """
    held = sheet_supports(surface, sheet, load)
    point = _moved(surface, sheet, load.point)
    if load.parts is None:
        return replace(held, force=point)
    covered = np.zeros((sheet.surface.m, 3))
    if load.parts.covered.any():
        tributary = tributary or Tributary.of(surface, sheet)
        material = np.bincount(sheet.parent, sheet.surface.areas, surface.m)
        covered = (tributary.forces(load.parts.covered) / np.where(material > 0, material, 1.0)[:, None])[sheet.parent]
    parts = LoadParts(point, load.parts.weight[sheet.parent], load.parts.bare[sheet.parent], covered)
    return held.with_parts(sheet.surface, parts)


def sheet_supports(surface: Surface, sheet: Sheet, load: LoadCase) -> LoadCase:
    """The supports of the uncut surface on a kept sheet of it, without a load.

    They hold what is left of them: springs keep the share of their stiffness that was on vertices which the sheet still
    has, and edges do not turn that lie within such an edge of the uncut surface.

    Raises StaticsError when no supported vertex is left.
    """
    fixed, same = sheet.between(surface, load.fixed, _given(load.fixed_edges)), sheet.same_vertex()
    kept = np.flatnonzero(same >= 0)
    spring = np.zeros((sheet.surface.n, 3))
    np.add.at(spring, same[kept], load.spring[kept])
    if not (fixed.any() or spring.any()):
        raise StaticsError("no supported vertex is left on the sheet; set pattern.keep to protect the supports")
    clamped = _within(surface, sheet, load.clamped) if load.clamped.any() else load.clamped[:0]
    return LoadCase(fixed, np.zeros_like(spring), sheet.between(surface, load.loaded), spring, clamped)


def _moved(surface: Surface, sheet: Sheet, force: Floats) -> Floats:
    """(n', 3) newtons on a sheet, of forces (n, 3) on the vertices of the uncut surface."""
    same, acting = sheet.same_vertex(), np.flatnonzero((force != 0).any(axis=1))
    at = same[acting]
    lost = at < 0
    if lost.any():
        found = cKDTree(sheet.surface.V).query(surface.V[acting[lost]])
        moved, at[lost] = np.asarray(found[0]), np.asarray(found[1])
        if moved.max() > REACH * surface.size:
            place = surface.V[acting[lost][moved.argmax()]].round(3).tolist()
            raise StaticsError(
                f"the load at {place} m finds no material within {moved.max():.3g} m; set pattern.keep to protect loads"
            )
    there = np.zeros((sheet.surface.n, 3))
    np.add.at(there, at, force[acting])
    return there


def held_vertices(surface: Surface, sheet: Sheet, load: LoadCase) -> Bools:
    """(n',) vertices of a sheet that have a support of the uncut surface, springs among them."""
    edges = _given(load.fixed_edges)
    return sheet.between(surface, load.held, None if edges is None else np.asarray(edges.any(axis=1)))


def _given(edges: Bools) -> Bools | None:
    """Held edges; None where a load case leaves it to its vertices."""
    return edges if len(edges) else None


def _within(surface: Surface, sheet: Sheet, marked: Bools) -> Bools:
    """(e',) edges of the sheet that lie within marked edges (e,) of the uncut surface."""
    ends = sheet.surface.edges.ends
    both = csr_array(sheet.weights[ends[:, 0]] + sheet.weights[ends[:, 1]])
    both.data[both.data < 1 - ON_SIMPLEX] = 0.0
    both.eliminate_zeros()
    both.sort_indices()
    on_edge = np.flatnonzero(np.diff(both.indptr) == 2)
    first = both.indptr[on_edge]
    key = both.indices[first].astype(np.int64) * surface.n + both.indices[first + 1]
    sought = np.sort(surface.edges.ends[marked], axis=1)
    found = np.zeros(len(ends), dtype=bool)
    found[on_edge[np.isin(key, sought[:, 0] * surface.n + sought[:, 1])]] = True
    return found
