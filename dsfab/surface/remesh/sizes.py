"""Wanted edge lengths of a new mesh."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import eye_array

from dsfab.core.arrays import Floats, Ints, edge_lengths, lengths, transported_vectors
from dsfab.surface.edge_changes import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.edges import FIXED, FREE, Net
from dsfab.surface.remesh.features import TOLERANCE, FeatureCurves
from dsfab.surface.topology import adjacency

TURN_PER_EDGE = 15.0  # Largest wanted rotation of the normal along an edge, degrees.
CHANGE_PER_EDGE = 0.25  # Largest change of a field along an edge, divided by the field's root mean square.


class SizeField(NamedTuple):
    """Wanted edge lengths (n,), metres, at the vertices of a surface."""

    surface: Surface
    length: Floats


def curvature_sizes(surface: Surface, edge: float, finest: float) -> Floats:
    """Return edge lengths (n,), metres, along which the normal rotates by 15 degrees [Cohen-Steiner and Morvan 2003].
    All lengths lie between `finest` and `edge`."""
    two = surface.edges.count == 2
    shared = np.flatnonzero(two)[~feature_edges(surface)[two]]
    ends = surface.edges.ends[shared]
    along = surface.V[ends[:, 1]] - surface.V[ends[:, 0]]
    tensor = np.einsum("e,ei,ej->eij", _bends(surface, shared) / lengths(along) / 2, along, along).reshape(-1, 9)
    largest = np.abs(np.linalg.eigvalsh(_mean_around(surface, ends, tensor).reshape(-1, 3, 3))).max(axis=1)
    turning = np.radians(TURN_PER_EDGE)
    return np.asarray(np.clip(turning / np.maximum(largest, turning / edge), finest, edge))


def change_sizes(surface: Surface, field: Floats, edge: float, finest: float) -> Floats:
    """Return edge lengths (n,), metres, along which a tensor field changes by a quarter of its root mean square.
    All lengths lie between `finest` and `edge`.    field : (m, 3, 3) tensors [Zienkiewicz and Zhu 1987]."""
    vertex_tensors, normal, ends = _at_vertices(surface, field), surface.vertex_normals, surface.edges.ends
    a, b = ends.T
    slope = ((_transported_tensors(vertex_tensors[b], normal[b], normal[a]) - vertex_tensors[a]) ** 2).sum(axis=(1, 2))
    edge_areas = np.bincount(surface.edges.of.ravel(), np.repeat(surface.areas / 3, 3), minlength=len(ends))
    square = _mean_around(surface, ends, (slope / surface.edge_lengths**2 * edge_areas / 2)[:, None])[:, 0]
    usual = np.sqrt((surface.areas * (field**2).sum(axis=(1, 2))).sum() / surface.area)
    sizes = np.divide(CHANGE_PER_EDGE * usual, np.sqrt(2 * square), out=np.full(surface.n, edge), where=square > 0)
    return np.asarray(np.clip(sizes, finest, edge))


def _at_vertices(surface: Surface, field: Floats) -> Floats:
    corner = surface.F.ravel()
    weighted = np.repeat(surface.areas[:, None, None] / 3 * field, 3, axis=0)
    normals = np.repeat(surface.normals, 3, axis=0)
    carried = _transported_tensors(weighted, normals, surface.vertex_normals[corner]).reshape(-1, 9)
    total = np.stack([np.bincount(corner, x, minlength=surface.n) for x in carried.T], axis=1)
    return np.asarray(total / np.maximum(surface.vertex_areas, np.finfo(float).tiny)[:, None]).reshape(-1, 3, 3)


def _mean_around(surface: Surface, ends: Ints, values: Floats) -> Floats:
    n = surface.n
    around = adjacency(surface.edges, n) + eye_array(n)
    total = np.stack([np.bincount(ends.ravel(), np.repeat(x, 2), minlength=n) for x in values.T], axis=1)
    return np.asarray((around @ total) / np.maximum(around @ surface.vertex_areas, np.finfo(float).tiny)[:, None])


def _transported_tensors(tensors: Floats, normal: Floats, onto: Floats) -> Floats:
    """Rotate symmetric tensors (k, 3, 3) from planes with unit normals (k, 3) into planes with normals `onto`."""
    normal, onto = np.repeat(normal, 3, axis=0), np.repeat(onto, 3, axis=0)
    rows = transported_vectors(onto, normal, tensors.reshape(-1, 3)).reshape(-1, 3, 3)
    return transported_vectors(onto, normal, rows.transpose(0, 2, 1).reshape(-1, 3)).reshape(-1, 3, 3)


def _bends(surface: Surface, shared: Ints) -> Floats:
    """Return the angles (s,) between the two faces at each edge (s,), radians, positive at convex edges."""
    starts = surface.edges.start[shared]
    h0, h1 = surface.edges.order[starts], surface.edges.order[starts + 1]
    a, b = surface.normals[h0 // 3], surface.normals[h1 // 3]
    across = surface.V[surface.F[h1 // 3, (h1 + 2) % 3]] - surface.V[surface.F.ravel()[h0]]
    angle = np.arctan2(lengths(np.cross(a, b)), np.einsum("ei,ei->e", a, b))
    return np.asarray(np.where(np.einsum("ei,ei->e", a, across) < 0, angle, -angle))


GRADE = 0.3  # Largest growth of the wanted edge length per metre.
LEAST = 1 / 20  # Shortest wanted edge at bends and narrow places, divided by the longest wanted edge.
CHORD_SHARES = 0.85 ** np.arange(19)  # Trial lengths of a curve's chords, as fractions of the general edge length.


def with_sizes(net: Net, chords: Floats, curves: FeatureCurves, base: Floats | float) -> Net:
    """Return the mesh with a wanted edge length at each vertex.
    chords : (p,) largest edge lengths at the points of the curves (boundaries, creases), metres.
    base   : largest edge lengths, metres: (n,) at the vertices, or a number."""
    size = np.broadcast_to(np.asarray(base, dtype=np.float64), (net.n,)).copy()
    edge = float(size.max())
    least = LEAST * edge
    if len(net.node):
        k = np.clip(np.searchsorted(curves.at, net.at), 0, len(chords) - 1)
        np.minimum.at(size, net.node, np.maximum(np.minimum(chords[k], chords[np.maximum(k - 1, 0)]), least))
    for vertex, width, slope in _narrow_places(net):
        wide = width > TOLERANCE * edge  # a smaller width is a fault of the mesh
        row = 1.25 * np.maximum(width, edge * slope)[wide]  # one row of triangles across the narrow place
        np.minimum.at(size, vertex[wide], np.maximum(row, least))
    return replace(net, size=graded_sizes(net.V, net.edges.ends, size))


def graded_sizes(V: Floats, ends: Ints, size: Floats) -> Floats:
    """Return the wanted edge lengths `size` (n,), metres, reduced to grow by at most `GRADE` per metre along edges."""
    length = GRADE * edge_lengths(V, ends)
    a, b = ends.T
    while True:
        lower = size.copy()
        np.minimum.at(lower, a, size[b] + length)
        np.minimum.at(lower, b, size[a] + length)
        if np.array_equal(lower, size):
            return size
        size = lower


def _narrow_places(net: Net) -> list[tuple[Ints, Floats, Floats]]:
    """Return groups of narrow places: vertices (k,), widths (k,), metres, and growth (k,) of the width per metre."""
    constrained, edges, along = net.kind > FREE, net.edges, net.along_curves
    length = edge_lengths(net.V, edges.ends)
    is_along = along[edges.of]
    ear = (is_along.sum(axis=1) >= 2)[:, None] & ~is_along
    beside_ear = np.zeros(len(along), dtype=bool)
    beside_ear[edges.of[ear]] = True
    bridge = np.flatnonzero(constrained[edges.ends].all(axis=1) & ~along & ~beside_ear)
    rigid = np.flatnonzero(along & (net.kind[edges.ends].min(axis=1) == FIXED))
    between = constrained[net.F].all(axis=1) & (is_along.sum(axis=1) == 1)
    face, corner = np.nonzero(is_along & between[:, None])
    base, apex = (net.F[face, corner], net.F[face, (corner + 1) % 3]), net.F[face, (corner + 2) % 3]
    P, A, B = net.V[apex], net.V[base[0]], net.V[base[1]]
    height = np.linalg.norm(np.cross(B - A, P - A), axis=1) / np.linalg.norm(B - A, axis=1)
    first_end, second_end = edges.ends[bridge].T
    across = np.append(_slopes(net, first_end, second_end, length[bridge]), np.zeros(len(rigid)))
    upward = np.maximum(_slopes(net, base[0], apex, height), _slopes(net, base[1], apex, height))
    narrow_edges = np.concatenate([bridge, rigid])
    return [
        (edges.ends[narrow_edges].ravel(), np.repeat(length[narrow_edges], 2), np.repeat(across, 2)),
        (net.F[face].ravel(), np.repeat(height, 3), np.repeat(upward, 3)),
    ]


def _slopes(net: Net, start: Ints, end: Ints, width: Floats) -> Floats:
    corner, distances = _corners(net)
    slope = np.zeros(len(start))
    for i in range(2):
        for j in range(2):
            met = (corner[start, i] == corner[end, j]) & (corner[start, i] >= 0)
            farthest = np.maximum(distances[start, i], distances[end, j])
            slope[met] = np.maximum(slope[met], width[met] / np.maximum(farthest[met], TOLERANCE * width[met]))
    return slope


def _corners(net: Net) -> tuple[Ints, Floats]:
    """Return the two end vertices (n, 2) of the boundary or crease through each vertex; -1 without a curve.
    Return also the arc lengths (n, 2) from each vertex to these ends, metres."""
    corner, distances = np.full((net.n, 2), -1), np.zeros((net.n, 2))
    ends = np.searchsorted(net.curve, net.curve), np.searchsorted(net.curve, net.curve, side="right") - 1
    for i, end in enumerate(ends):
        corner[net.node, i] = net.node[end]
        distances[net.node, i] = np.abs(net.at - net.at[end])
    fixed = net.kind == FIXED
    corner[fixed], distances[fixed] = np.flatnonzero(fixed)[:, None], 0
    return corner, distances


def chord_lengths(curves: FeatureCurves, edge: float) -> Floats:
    """Return the longest edge length (p,) at each point for chords that stay close to the curves, metres.
    edge : upper limit of these lengths, metres."""
    longest = np.full(len(curves.at), edge * CHORD_SHARES[-1])
    open_ = np.arange(len(curves.at))
    is_last = np.append(np.diff(curves.curve) > 0, True) if len(curves.at) else np.zeros(0, dtype=bool)
    ends = curves.at[is_last]
    starts = curves.at[np.append(0, np.flatnonzero(is_last)[:-1] + 1)] if len(ends) else ends
    for share in CHORD_SHARES:
        half, curve = share * edge / 2, curves.curve[open_]
        a = np.maximum(curves.at[open_] - half, starts[curve])
        fine = curves.deviation(a, np.minimum(curves.at[open_] + half, ends[curve]))[0] <= TOLERANCE * edge * 0.8
        longest[open_[fine]] = share * edge
        open_ = open_[~fine]
    return longest
