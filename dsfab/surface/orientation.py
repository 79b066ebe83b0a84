"""Orientation of a surface: the axis that points up, and the two sides of a sheet."""

from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import EdgeTable, half_edges, link_components, misoriented_edges, next_half_edge

Up = Literal["x", "y", "z", "-x", "-y", "-z"]  # Axis of the file's coordinates that points to the sky.

_TURNS: dict[Up, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "z": ((0, 1, 2), (1, 1, 1)),
    "-z": ((0, 1, 2), (1, -1, -1)),
    "y": ((0, 2, 1), (1, -1, 1)),
    "-y": ((0, 2, 1), (1, 1, -1)),
    "x": ((1, 2, 0), (1, 1, 1)),
    "-x": ((2, 1, 0), (1, 1, -1)),
}
"""For each axis that may point up: the file's axes that become x, y and z, and their signs. All maps are rotations."""


def upright_vertices(V: Floats, up: Up) -> Floats:
    """Rotate vertices V (n, 3) so that the axis `up` becomes z; with y up (glTF), (x, y, z) becomes (x, -z, y)."""
    axes, signs = _TURNS[up]
    return V if up == "z" else np.asarray(V[:, list(axes)] * np.array(signs, dtype=float) + 0.0)


def corner_sides(F: Ints, edges: EdgeTable) -> Ints:
    """Return -1 at corners (m, 3) of faces that are flipped relative to the vertex's first face, 1 at all others."""
    if not len(misoriented_edges(F, edges)):
        return np.ones_like(F)
    h0, h1 = edges.pairs.T
    a, _ = half_edges(F)
    clash = (a[h0] == a[h1]).astype(np.int64)
    at_start, at_end = np.where(clash, h1, next_half_edge(h1)), np.where(clash, next_half_edge(h1), h1)
    i = 2 * np.concatenate([h0, next_half_edge(h0)])
    j, turn = 2 * np.concatenate([at_start, at_end]), np.tile(clash, 2)
    i, j = np.concatenate([i, i + 1]), np.concatenate([j + turn, j + 1 - turn])
    side = link_components(6 * len(F), i, j)[1].reshape(-1, 2)
    fan, reference = np.unique(side.min(axis=1), return_index=True)  # fan: a label for each fan of faces
    reference_corner = reference[np.searchsorted(fan, side.min(axis=1))]
    sides: Ints = np.where(side[:, 0] == side[reference_corner, 0], 1, -1).reshape(-1, 3)
    return sides


def one_sided_pieces(F: Ints, edges: EdgeTable) -> Bools:
    """Return a mask (m,) of the faces of one-sided pieces of a mesh, for example of a Moebius strip."""
    m = len(F)
    if not len(misoriented_edges(F, edges)):
        return np.zeros(m, dtype=bool)
    f, g, clash = _neighbours(F, edges)
    i, j = np.concatenate([f, f + m]), np.concatenate([g + clash * m, g + m - clash * m])
    copy = link_components(2 * m, i, j)[1]
    return np.asarray(copy[:m] == copy[m:])


def flips_along_tree(F: Ints, edges: EdgeTable) -> Bools:
    """Return a mask (m,) of the faces to flip so that neighbouring faces have the same orientation.
    In a Moebius strip, neighbouring faces still differ along a seam."""
    f, g, clash = _neighbours(F, edges)
    m = len(F)
    steps = coo_array((np.concatenate([clash, clash]) + 1, (np.r_[f, g], np.r_[g, f])), shape=(m, m)).tocsr()
    label = link_components(m, f, g)[1]
    flips = np.zeros(m, dtype=bool)
    for root in np.unique(label, return_index=True)[1]:
        order, before = breadth_first_order(steps, root, directed=False)
        turns = np.asarray(steps[before[order[1:]], order[1:]]).ravel() > 1
        for face, turn in zip(order[1:].tolist(), turns.tolist(), strict=True):
            flips[face] = flips[before[face]] ^ turn
    return flips


def require_two_sides(surface: Surface, faces: Bools, what: str) -> None:
    """Raise SurfaceError if marked faces (m,) belong to a one-sided piece. what : first words of the message."""
    wrong = int((one_sided_pieces(surface.F, surface.edges) & faces).sum())
    if wrong:
        raise SurfaceError(
            f"{what} needs faces with an outside, but {wrong} of these faces are on a one-sided surface, such as a "
            f"Moebius strip; use forces with a direction, or pick other faces"
        )


def _neighbours(F: Ints, edges: EdgeTable) -> tuple[Ints, Ints, Ints]:
    h0, h1 = edges.pairs.T
    a, _ = half_edges(F)
    return h0 // 3, h1 // 3, (a[h0] == a[h1]).astype(np.int64)
