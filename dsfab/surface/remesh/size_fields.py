"""How long edges are wanted on a surface: shorter where it is curved, or where a field on it changes."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import eye_array

from dsfab.arrays import Floats, Ints, lengths, unfolded
from dsfab.surface.creases import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import adjacency

TURNING = 15.0
"""Degrees by which the surface may turn along an edge before it is wanted shorter."""

STEADY = 0.25
"""Times its root mean square: by how much a field may change along an edge before that is wanted shorter."""


class SizeField(NamedTuple):
    """The length of edges (n,), metres, that is wanted at the vertices of a surface, and linearly between them."""

    surface: Surface
    length: Floats


def curvature_sizes(surface: Surface, edge: float, finest: float) -> Floats:
    """(n,) lengths of edges over which the surface turns by `TURNING`, between `finest` and `edge`, metres.

    The largest curvature at a vertex is that of the tensor by the angles between neighbours [Cohen-Steiner and Morvan
    2003], over the faces around its neighbours. Creases do not count.
    """
    shared = _inner_edges(surface)
    ends = surface.edges.ends[shared]
    along = surface.V[ends[:, 1]] - surface.V[ends[:, 0]]
    tensor = np.einsum("e,ei,ej->eij", _bends(surface, shared) / lengths(along) / 2, along, along).reshape(-1, 9)
    mean = _mean_around(surface, ends, tensor)
    largest = np.abs(np.linalg.eigvalsh(mean.reshape(-1, 3, 3))).max(axis=1)
    turning = np.radians(TURNING)
    return np.asarray(np.clip(turning / np.maximum(largest, turning / edge), finest, edge))


def change_sizes(surface: Surface, field: Floats, edge: float, finest: float) -> Floats:
    """(n,) lengths of edges along which tensors (m, 3, 3) in the planes of the faces change by `STEADY` times their
    root mean square, between `finest` and `edge`, metres.

    Differences along edges are those of the means around their ends [as Zienkiewicz and Zhu 1987 recover stress]; the
    turn of the surface from one to the other does not count. The square of the gradient at a vertex is twice the mean
    square of such slopes around it, which lie in all directions.
    """
    at, normal, ends = _at_vertices(surface, field), surface.vertex_normals, surface.edges.ends
    a, b = ends.T
    slope = ((_carried(at[b], normal[b], normal[a]) - at[a]) ** 2).sum(axis=(1, 2))
    beside = np.bincount(surface.edges.of.ravel(), np.repeat(surface.areas / 3, 3), minlength=len(ends))
    square = _mean_around(surface, ends, (slope / surface.edge_lengths**2 * beside / 2)[:, None])[:, 0]
    usual = np.sqrt((surface.areas * (field**2).sum(axis=(1, 2))).sum() / surface.area)
    wanted = np.divide(STEADY * usual, np.sqrt(2 * square), out=np.full(surface.n, edge), where=square > 0)
    return np.asarray(np.clip(wanted, finest, edge))


def _at_vertices(surface: Surface, field: Floats) -> Floats:
    """(n, 3, 3) the means by area around each vertex of tensors (m, 3, 3), turned with the surface into its plane."""
    corner = surface.F.ravel()
    weighted = np.repeat(surface.areas[:, None, None] / 3 * field, 3, axis=0)
    carried = _carried(weighted, np.repeat(surface.normals, 3, axis=0), surface.vertex_normals[corner]).reshape(-1, 9)
    total = np.stack([np.bincount(corner, x, minlength=surface.n) for x in carried.T], axis=1)
    return np.asarray(total / np.maximum(surface.vertex_areas, np.finfo(float).tiny)[:, None]).reshape(-1, 3, 3)


def _inner_edges(surface: Surface) -> Ints:
    """(e,) edges of two faces that are no creases."""
    two = surface.edges.count == 2
    return np.asarray(np.flatnonzero(two)[~feature_edges(surface)[two]])


def _half_edges(surface: Surface, shared: Ints) -> tuple[Ints, Ints]:
    """The two half-edges (e,) of edges (e,)."""
    first = surface.edges.start[shared]
    order: Ints = surface.edges.order
    return order[first], order[first + 1]


def _mean_around(surface: Surface, ends: Ints, values: Floats) -> Floats:
    """(n, k) of values (e, k) of edges (e, 2), the sums at each vertex and its neighbours over their areas."""
    n = surface.n
    around = adjacency(surface.edges, n) + eye_array(n)
    total = np.stack([np.bincount(ends.ravel(), np.repeat(x, 2), minlength=n) for x in values.T], axis=1)
    return np.asarray((around @ total) / np.maximum(around @ surface.vertex_areas, np.finfo(float).tiny)[:, None])


def _carried(tensors: Floats, normal: Floats, onto: Floats) -> Floats:
    """(k, 3, 3) symmetric tensors in planes with unit normals (k, 3), turned into others: by rows, then by columns."""
    normal, onto = np.repeat(normal, 3, axis=0), np.repeat(onto, 3, axis=0)
    rows = unfolded(onto, normal, tensors.reshape(-1, 3)).reshape(-1, 3, 3)
    return unfolded(onto, normal, rows.transpose(0, 2, 1).reshape(-1, 3)).reshape(-1, 3, 3)


def _bends(surface: Surface, shared: Ints) -> Floats:
    """(s,) angles between the normals at edges (s,) of two faces, radians, positive where these bulge."""
    h0, h1 = _half_edges(surface, shared)
    one, two = surface.normals[h0 // 3], surface.normals[h1 // 3]
    across = surface.V[surface.F[h1 // 3, (h1 + 2) % 3]] - surface.V[surface.F.ravel()[h0]]
    angle = np.arctan2(lengths(np.cross(one, two)), np.einsum("ei,ei->e", one, two))
    return np.asarray(np.where(np.einsum("ei,ei->e", one, across) < 0, angle, -angle))
