"""Wanted edge lengths: by curvature, by a field, and near curves."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import eye_array

from dsfab.core.arrays import Floats, Ints, edge_lengths, lengths, unfolded
from dsfab.surface.edge_changes import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.edges import FIXED, FREE, Net
from dsfab.surface.remesh.features import TOLERANCE, FeatureCurves
from dsfab.surface.topology import adjacency

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


GRADE = 0.3
"""Metres by which the wanted length grows in a metre: neighbours differ by less than 1.3 times."""

LEAST = 1 / 20
"""Of the edge: no bend of a curve and no narrow place asks for shorter edges."""

NARROW = 1.25
"""Times the width between two curves: edges wanted there, so that one row of triangles fills it."""

LADDER = 0.85 ** np.arange(19)
"""Shares of the edge that are tried as chords of a curve."""


def with_sizes(net: Net, chords: Floats, curves: FeatureCurves, base: Floats | float) -> Net:
    """The net with its wanted lengths: `base` (n,) or one for all, metres, no longer than the chords (p,) of its curves
    allow, and graded."""
    size = np.broadcast_to(np.asarray(base, dtype=np.float64), (net.n,)).copy()
    edge = float(size.max())
    least = LEAST * edge
    if len(net.node):
        k = np.clip(np.searchsorted(curves.at, net.at), 0, len(chords) - 1)
        np.minimum.at(size, net.node, np.maximum(np.minimum(chords[k], chords[np.maximum(k - 1, 0)]), least))
    for vertex, width, slope in _narrow(net):
        wide = width > TOLERANCE * edge  # less is a sliver
        row = NARROW * np.maximum(width, edge * slope)[wide]
        np.minimum.at(size, vertex[wide], np.maximum(row, least))
    return replace(net, size=graded_sizes(net.V, net.edges.ends, size))


def graded_sizes(V: Floats, ends: Ints, size: Floats) -> Floats:
    """(n,) sizes, metres, that differ along no edge (e, 2) by more than `GRADE` times its length: the largest below
    those given."""
    length = GRADE * edge_lengths(V, ends)
    a, b = ends.T
    while True:
        lower = size.copy()
        np.minimum.at(lower, a, size[b] + length)
        np.minimum.at(lower, b, size[a] + length)
        if np.array_equal(lower, size):
            return size
        size = lower


def _narrow(net: Net) -> list[tuple[Ints, Floats, Floats]]:
    """Vertices (k,) of kinds that do not leave their curves, how wide (k,) the surface is there, metres, and its slope
    (k,) as in `_slopes`.

    That is an edge from curve to curve, the height of a face between them, or an edge between corners. The face in the
    angle of a corner is left out: it is narrow at any size.
    """
    held, edges, along = net.kind > FREE, net.edges, net.along_curves
    length = edge_lengths(net.V, edges.ends)
    on = along[edges.of]
    ear = (on.sum(axis=1) >= 2)[:, None] & ~on
    beside_ear = np.zeros(len(along), dtype=bool)
    beside_ear[edges.of[ear]] = True
    bridge = np.flatnonzero(held[edges.ends].all(axis=1) & ~along & ~beside_ear)
    rigid = np.flatnonzero(along & (net.kind[edges.ends].min(axis=1) == FIXED))
    between = held[net.F].all(axis=1) & (on.sum(axis=1) == 1)
    face, corner = np.nonzero(on & between[:, None])
    base, apex = (net.F[face, corner], net.F[face, (corner + 1) % 3]), net.F[face, (corner + 2) % 3]
    P, A, B = net.V[apex], net.V[base[0]], net.V[base[1]]
    height = np.linalg.norm(np.cross(B - A, P - A), axis=1) / np.linalg.norm(B - A, axis=1)
    one, other = edges.ends[bridge].T
    across = np.append(_slopes(net, one, other, length[bridge]), np.zeros(len(rigid)))
    upward = np.maximum(_slopes(net, base[0], apex, height), _slopes(net, base[1], apex, height))
    both = np.concatenate([bridge, rigid])
    return [
        (edges.ends[both].ravel(), np.repeat(length[both], 2), np.repeat(across, 2)),
        (net.F[face].ravel(), np.repeat(height, 3), np.repeat(upward, 3)),
    ]


def _slopes(net: Net, one: Ints, other: Ints, width: Floats) -> Floats:
    """(k,) how fast the surface widens from the corner in which the curves of vertices one and other (k,) meet: their
    width (k,), metres, over their way to it along the curves; 0 where they meet in none.

        corner <   ---- at a slope of .3 it is .3 edges wide at an edge's length from its corner: edges as short fill
                        it from there on, and shorter ones nearer to the corner would go on and on
    """
    corner, way = _corners(net)
    slope = np.zeros(len(one))
    for i in range(2):
        for j in range(2):
            met = (corner[one, i] == corner[other, j]) & (corner[one, i] >= 0)
            far = np.maximum(way[one, i], way[other, j])
            slope[met] = np.maximum(slope[met], width[met] / np.maximum(far[met], TOLERANCE * width[met]))
    return slope


def _corners(net: Net) -> tuple[Ints, Floats]:
    """(n, 2) the vertices at the two ends of each vertex's curve, -1 off the curves, and the way (n, 2) to them along
    it, metres; of a corner itself, twice itself."""
    corner, way = np.full((net.n, 2), -1), np.zeros((net.n, 2))
    ends = np.searchsorted(net.curve, net.curve), np.searchsorted(net.curve, net.curve, side="right") - 1
    for i, end in enumerate(ends):
        corner[net.node, i] = net.node[end]
        way[net.node, i] = np.abs(net.at - net.at[end])
    fixed = net.kind == FIXED
    corner[fixed], way[fixed] = np.flatnonzero(fixed)[:, None], 0
    return corner, way


def chord_lengths(curves: FeatureCurves, edge: float) -> Floats:
    """(p,) at each point of the curves, how long a chord about it may be, metres: `edge`, or less where that would
    leave the curve by more than half of the tolerance."""
    longest = np.full(len(curves.at), edge * LADDER[-1])
    open_ = np.arange(len(curves.at))
    last = np.append(np.diff(curves.curve) > 0, True) if len(curves.at) else np.zeros(0, dtype=bool)
    ends = curves.at[last]
    starts = curves.at[np.append(0, np.flatnonzero(last)[:-1] + 1)] if len(ends) else ends
    for share in LADDER:
        half, of = share * edge / 2, curves.curve[open_]
        a = np.maximum(curves.at[open_] - half, starts[of])
        b = np.minimum(curves.at[open_] + half, ends[of])
        fine = curves.deviation(a, b)[0] <= TOLERANCE * edge * 0.8
        longest[open_[fine]] = share * edge
        open_ = open_[~fine]
    return longest
