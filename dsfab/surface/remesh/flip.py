"""Edges turned within their two faces, towards Delaunay triangles or towards six edges at each vertex."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, area_vectors, lengths
from dsfab.surface.edge_changes import has_new_diagonal, quads, with_other_diagonals
from dsfab.surface.neighbours import on_boundary
from dsfab.surface.remesh.net import FIXED, FREE, Net, edges_of, independent
from dsfab.surface.topology import EdgeTable

FLAT = 0.8
"""Both new faces turn by less than the angle of this cosine, about 37 degrees, from the two old ones."""

SOUND = np.radians(25)
"""An edge is not turned where that leaves an angle below this which is less than the least before."""


def with_edges_flipped(net: Net, by_valence: bool, rounds: int) -> Net:
    """The net with edges that are not along curves turned; in so many rounds at most."""
    V, F = net.V, net.F
    for _ in range(rounds):
        net = replace(net, F=F)
        edges = edges_of(net)
        pairs = edges.pairs[~net.along_curves(edges)[edges.count == 2]]
        quad = quads(F, pairs)
        gain = _valence_gain(net, quad, edges) if by_valence else _delaunay_gain(V, quad)
        good = np.flatnonzero(gain > 0)
        good = good[has_new_diagonal(quad[good], edges, net.n)]
        good = good[_sound(V, quad[good])]
        good = good[independent(quad[good], -gain[good], net.n)]
        if not len(good):
            break
        F = with_other_diagonals(F, pairs[good], quad[good])
    return replace(net, F=F)


def _valence_gain(net: Net, quad: Ints, edges: EdgeTable) -> Floats:
    """(q,) by how much the squared differences from the best number of edges shrink, of vertices that are free."""
    valence = np.bincount(edges.ends.ravel(), minlength=net.n)
    best = np.where(net.kind == FREE, 6, valence)
    best[(net.kind > FREE) & (net.kind < FIXED)] = 6
    best[on_boundary(edges, net.n) & (net.kind < FIXED)] = 4
    off = (valence - best)[quad]
    change = np.where((net.kind == FIXED)[quad], 0, np.array([-1, -1, 1, 1]))
    return np.asarray((off**2 - (off + change) ** 2).sum(axis=1), dtype=np.float64)


def _delaunay_gain(V: Floats, quad: Ints) -> Floats:
    """(q,) by how much the angles opposite an edge exceed half a turn together, radians."""
    a, b, c, d = quad.T
    return np.asarray(_angle(V, c, a, b) + _angle(V, d, a, b) - np.pi - 1e-6)


def _sound(V: Floats, quad: Ints) -> Bools:
    """(q,) whether the turned edge's faces lie like the old ones, and are no worse where they are bad."""
    a, b, c, d = quad.T
    old, new = ((a, b, c), (b, a, d)), ((a, d, c), (d, b, c))
    before = area_vectors(V, np.stack(old[0], axis=1)) + area_vectors(V, np.stack(old[1], axis=1))
    fine = np.ones(len(quad), dtype=bool)
    for face in new:
        after = area_vectors(V, np.stack(face, axis=1))
        fine &= np.einsum("qi,qi->q", before, after) > FLAT * lengths(before) * lengths(after)
    least = [np.minimum(*(_least_angle(V, *face) for face in faces)) for faces in (old, new)]
    return np.asarray(fine & (least[1] > np.minimum(SOUND, least[0])))


def _least_angle(V: Floats, a: Ints, b: Ints, c: Ints) -> Floats:
    """(q,) radians."""
    return np.minimum(np.minimum(_angle(V, a, b, c), _angle(V, b, c, a)), _angle(V, c, a, b))


def _angle(V: Floats, at: Ints, one: Ints, two: Ints) -> Floats:
    """(q,) the angle at a vertex between two others, radians."""
    u, v = V[one] - V[at], V[two] - V[at]
    x, y, z = u.T
    r, s, t = v.T
    twice = np.sqrt((y * t - z * s) ** 2 + (z * r - x * t) ** 2 + (x * s - y * r) ** 2)
    return np.asarray(np.arctan2(twice, x * r + y * s + z * t))
