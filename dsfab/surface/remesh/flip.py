"""Edges turned within their two faces, towards Delaunay triangles or towards six edges at each vertex."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, area_vectors, lengths, row_min
from dsfab.surface.edge_changes import has_new_diagonal, quads, with_other_diagonals
from dsfab.surface.neighbours import on_boundary
from dsfab.surface.remesh.net import FIXED, FREE, Net, NetFaces, independent
from dsfab.surface.topology import next_half_edge

FLAT = 0.8
"""Both new faces turn by less than the angle of this cosine, about 37 degrees, from the two old ones."""

SOUND = np.radians(25)
"""An edge is not turned where that leaves an angle below this which is less than the least before."""


def with_edges_flipped(net: Net, by_valence: bool, rounds: int) -> Net:
    """The net with edges that are not along curves turned; in so many rounds at most."""
    angles = np.empty(0) if by_valence else _face_angles(net.V, net.F)
    for _ in range(rounds):
        edges = net.edges
        pairs = edges.pairs[~net.along_curves[edges.count == 2]]
        gain = _valence_gain(net, quads(net.F, pairs)) if by_valence else _delaunay_gain(angles, pairs)
        pairs, gain = pairs[gain > 0], gain[gain > 0]
        quad = quads(net.F, pairs)
        good = np.flatnonzero(has_new_diagonal(quad, edges, net.n))
        good = good[_sound(net.V, quad[good])]
        good = good[independent(quad[good], -gain[good], net.n)]
        if not len(good):
            break
        net = replace(net, faces=NetFaces(with_other_diagonals(net.F, pairs[good], quad[good])))
        if not by_valence:
            turned = pairs[good].ravel() // 3
            angles[turned] = _face_angles(net.V, net.F[turned])
    return net


def _valence_gain(net: Net, quad: Ints) -> Floats:
    """(q,) by how much the squared differences from the best number of edges shrink, of vertices that are free."""
    edges = net.edges
    valence = np.bincount(edges.ends.ravel(), minlength=net.n)
    best = np.where(net.kind == FREE, 6, valence)
    best[(net.kind > FREE) & (net.kind < FIXED)] = 6
    best[on_boundary(edges, net.n) & (net.kind < FIXED)] = 4
    off, free = valence - best, net.kind < FIXED
    less = np.where(free, 2 * off - 1, 0)  # off^2 - (off - 1)^2
    more = np.where(free, -2 * off - 1, 0)
    a, b, c, d = quad.T
    return np.asarray(less[a] + less[b] + more[c] + more[d], dtype=np.float64)


def _delaunay_gain(angles: Floats, pairs: Ints) -> Floats:
    """(q,) by how much the angles opposite edges exceed half a turn together, radians; of faces with angles (m, 3), the
    edges having half-edges pairs (q, 2)."""
    one, two = angles.ravel()[next_half_edge(pairs.T, 2)]
    return np.asarray(one + two - np.pi - 1e-6)


def _face_angles(V: Floats, F: Ints) -> Floats:
    """(m, 3) the angles at the corners of faces F (m, 3), radians."""
    return np.stack([angle_at(V, F[:, c], F[:, (c + 1) % 3], F[:, (c + 2) % 3]) for c in range(3)], axis=1)


def _sound(V: Floats, quad: Ints) -> Bools:
    """(q,) whether the turned edge's faces lie like the old ones, and are no worse where they are bad."""
    a, b, c, d = quad.T
    old, new = ((a, b, c), (b, a, d)), ((a, d, c), (d, b, c))
    before = area_vectors(V, np.stack(old[0], axis=1)) + area_vectors(V, np.stack(old[1], axis=1))
    fine = np.ones(len(quad), dtype=bool)
    for face in new:
        after = area_vectors(V, np.stack(face, axis=1))
        fine &= np.einsum("qi,qi->q", before, after) > FLAT * lengths(before) * lengths(after)
    least = [np.minimum(*(row_min(_face_angles(V, np.stack(face, axis=1))) for face in faces)) for faces in (old, new)]
    return np.asarray(fine & (least[1] > np.minimum(SOUND, least[0])))


def angle_at(V: Floats, at: Ints, one: Ints, two: Ints) -> Floats:
    """(q,) the angle at a vertex between two others, radians."""
    u, v = V[one] - V[at], V[two] - V[at]
    x, y, z = u.T
    r, s, t = v.T
    twice = np.sqrt((y * t - z * s) ** 2 + (z * r - x * t) ** 2 + (x * s - y * r) ** 2)
    return np.asarray(np.arctan2(twice, x * r + y * s + z * t))
