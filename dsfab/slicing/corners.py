"""Where the outline of a sheet passes from the edge of one family to that of another."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.surface import Surface
from dsfab.surface.topology import half_edges


class Labels(NamedTuple):
    """Boundary edges of a kept sheet: half-edge, first and last vertex, and family (k,) each; `VOID` (-1) for those on
    the boundary of the uncut surface."""

    half_edge: Ints
    start: Ints
    end: Ints
    family: Ints


def outline_labels(sheet: Sheet, uncut: Surface) -> Labels:
    """The edges of the outline of a kept sheet, cut from the surface `uncut`.

    The edge of a cell belongs to the family that made the cell material, or to the boundary of the uncut surface where
    it lies on it.
    """
    table = sheet.surface.edges
    h = table.order[table.start[:-1][table.boundary]]
    a, b = (ends[h] for ends in half_edges(sheet.surface.F))
    return Labels(h, a, b, np.where(_on_boundary(sheet, uncut, a, b), VOID, sheet.family[h // 3]))


def outline_corners(sheet: Sheet, uncut: Surface) -> Floats:
    """Vertices (k, 3) of the boundary of a kept sheet where two curves meet, metres, at whatever angle.

    `uncut` is the surface that `sheet` was cut from.
    """
    _, a, b, family = outline_labels(sheet, uncut)
    low, high = np.full(sheet.surface.n, np.iinfo(np.int64).max), np.full(sheet.surface.n, np.iinfo(np.int64).min)
    for end in (a, b):
        np.minimum.at(low, end, family)
        np.maximum.at(high, end, family)
    return np.asarray(sheet.surface.V[low < high])


def _on_boundary(sheet: Sheet, uncut: Surface, a: Ints, b: Ints) -> Bools:
    """(k,) whether the edges a - b lie on the uncut boundary: together they stand on two vertices, a boundary edge."""
    stand = csr_array(sheet.weights[a] + sheet.weights[b])
    stand.eliminate_zeros()
    stand.sort_indices()
    first = stand.indptr[:-1]
    two = np.diff(stand.indptr) == 2
    i, j = stand.indices[first[two]].astype(np.int64), stand.indices[first[two] + 1].astype(np.int64)
    ends = uncut.edges.ends[uncut.edges.boundary]
    on = np.zeros(len(a), dtype=bool)
    on[two] = np.isin(i * uncut.n + j, ends[:, 0] * uncut.n + ends[:, 1])
    return on
