"""Which edges are a design's boundaries and creases, and which are only sharp by chance."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, lengths
from dsfab.surface.creases import CREASE, border_edges, sharp_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected

TOLERANCE = 1 / 50
"""Of the edge: how far the new boundaries and creases may be from those of the input."""

CORNER = 30.0
"""Degrees by which a curve turns at a vertex from which that is a corner."""

DULL = 0.6 * CREASE
"""Degrees between the mean normals on both sides of a crease below which that is one of a few faces only."""

FRAGMENT = 2.0
"""Times that length: shorter creases that are dull are slivers or noise. A longer one is a small step of the design."""

AROUND = 128
"""How many faces within the length of an edge, at most, make the mean normals."""

NOISY = 2.0
"""Times the mean edge of the file: normals are averaged over as much, however short the new edges are, for noise is as
wide as the file's own faces."""

FINE = 1 / 80
"""Of the box's diagonal, which `NOISY` does not go beyond: a file of longer edges is drawn, not scanned, and a bend
between two of its faces is meant."""


class Passes(NamedTuple):
    """Vertices (k,) in which just two of some edges meet, which (k, 2), by how much (k,) they turn there, radians, and
    the length (k,) of the shorter one, metres."""

    vertex: Ints
    edges: Ints
    turn: Floats
    arm: Floats


def smooth_passes(V: Floats, ends: Ints) -> Passes:
    """The vertices of V (n, 3) in which two of the edges (e, 2) meet, smoothly or not."""
    order = np.argsort(ends.ravel(), kind="stable")
    vertex = ends.ravel()[order]
    start = np.flatnonzero(np.diff(vertex, prepend=-1))
    two = start[np.diff(np.append(start, len(vertex))) == 2]
    at = np.stack([order[two], order[two + 1]], axis=1)
    other = ends.ravel()[at ^ 1]
    inner = vertex[two]
    p, q = V[inner] - V[other[:, 0]], V[other[:, 1]] - V[inner]
    turn = np.arctan2(lengths(np.cross(p, q)), np.einsum("ki,ki->k", p, q))
    return Passes(inner, at // 2, turn, np.minimum(lengths(p), lengths(q)))


def design_features(surface: Surface, edge: float) -> Bools:
    """(e,) boundaries, seams and creases, without short pieces of creases that are sharp on a few faces only: the edges
    of slivers and the noise of scans, at the scale of new edges of `edge` metres or of a scan's own."""
    sharp = sharp_edges(surface)
    marks = border_edges(surface) | sharp
    crease = np.flatnonzero(sharp)
    scale = max(edge, min(NOISY * surface.mean_edge, FINE * surface.size))
    short = crease[_stretches(surface, crease) < FRAGMENT * scale]
    marks[short[_mean_bends(surface, short, scale) < np.radians(DULL)]] = False
    return marks


def _stretches(surface: Surface, crease: Ints) -> Floats:
    """(c,) the length of the smooth curve of creases (c,) that each is part of, metres."""
    ends = surface.edges.ends[crease]
    passes = smooth_passes(surface.V, ends)
    smooth = passes.edges[passes.turn < np.radians(CORNER)]
    count, part = connected(len(crease), smooth[:, 0], smooth[:, 1])
    return np.asarray(np.bincount(part, surface.edge_lengths[crease], minlength=count)[part])


def _mean_bends(surface: Surface, crease: Ints, radius: float) -> Floats:
    """(c,) angles between the mean normals of the faces around each crease (c,), on its one side and on the other,
    radians."""
    if not len(crease):
        return np.zeros(0)
    start = surface.edges.start[crease]
    faces = np.stack([surface.edges.order[start], surface.edges.order[start + 1]], axis=1) // 3
    middle = surface.V[surface.edges.ends[crease]].mean(axis=1)
    toward = surface.centroids[faces] - middle[:, None]
    toward /= lengths(toward)[:, :, None]
    across = toward[:, 0] - toward[:, 1]
    tree = cKDTree(surface.centroids)
    _, near = tree.query(middle, k=min(AROUND, surface.m), distance_upper_bound=radius)
    near = np.concatenate([near.reshape(len(crease), -1), faces], axis=1)
    there = near < surface.m
    near = np.where(there, near, 0)
    side = np.einsum("cki,ci->ck", surface.centroids[near] - middle[:, None], across)
    weight = np.where(there, surface.areas[near], 0)
    u, v = (np.einsum("ck,cki->ci", weight * on, surface.normals[near]) for on in (side > 0, side <= 0))
    bend = np.arctan2(lengths(np.cross(u, v)), np.einsum("ci,ci->c", u, v))
    slight = np.minimum(lengths(u), lengths(v)) < TOLERANCE * radius * surface.edge_lengths[crease]
    return np.where(slight, 0, bend)  # a sliver alone, at the boundary, has no direction
