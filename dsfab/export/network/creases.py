"""Creases of a surface: rows of edges that bend far more than the edges beside them. Where one fades, it ends."""

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.surface import CREASE, Surface, connected

WEAK = 8.0
"""Degrees between two faces from which their edge may be part of a crease; one of its edges bends by `CREASE`."""

RATIO = 4.0
"""Times by which a crease bends more than the edges beside it."""

SHORTEST = 6
"""Edges that a crease has at least: single sharp edges are noise of the mesh."""

STRAIGHT = np.cos(np.radians(30.0))
"""Cosine of the turn up to which an edge goes on from the end of a crease."""

OTHERS = [[1, 2], [2, 0], [0, 1]]
"""Of a face's edges, those beside each."""


def crease_edges(surface: Surface) -> Bools:
    """(e,) the edges that are parts of creases."""
    edges = surface.edges
    inner = edges.count == 2
    bend = np.zeros(len(edges.ends))
    one, two = surface.normals[edges.pairs // 3].transpose(1, 0, 2)
    bend[inner] = np.degrees(np.arccos(np.clip(np.einsum("ei,ei->e", one, two), -1, 1)))
    crease = np.zeros(len(bend), dtype=bool)
    for _ in range(2):  # again, for faces of two creases
        rest = np.where(crease | ~inner, 0.0, bend)
        beside = rest[edges.of[:, OTHERS]].max(axis=2)  # (m, 3) the sharper of a face's other edges
        around = np.zeros(len(bend))
        np.maximum.at(around, edges.of, beside)
        crease |= inner & (bend >= np.maximum(WEAK, RATIO * around))
    crease = _gone_on(surface, bend, inner, crease)
    at = np.flatnonzero(crease)
    _, part = connected(surface.n, *edges.ends[at].T)
    run = part[edges.ends[at, 0]]
    long = np.bincount(run, minlength=surface.n) >= SHORTEST
    sharpest = np.zeros(surface.n)
    np.maximum.at(sharpest, run, bend[at])
    crease[at] = (long & (sharpest >= CREASE))[run]
    return crease


def _gone_on(surface: Surface, bend: Floats, inner: Bools, crease: Bools) -> Bools:
    """(e,) creases with the edges that go on straight from their ends, up to where several of them meet: a face there
    has another sharp edge, and is judged by the flatter one."""
    edges = surface.edges
    around = np.zeros(len(bend))
    np.maximum.at(around, edges.of, np.where(inner, bend, 0.0)[edges.of[:, OTHERS]].min(axis=2))
    maybe = inner & ~crease & (bend >= np.maximum(WEAK, RATIO * around))
    way = surface.V[edges.ends[:, 1]] - surface.V[edges.ends[:, 0]]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    new = crease
    while new.any():
        ends, tip = edges.ends[crease], np.zeros((surface.n, 3))
        np.add.at(tip, ends, way[crease][:, None])
        tip[np.bincount(ends.ravel(), minlength=surface.n) != 1] = 0
        new = maybe & (np.abs(np.einsum("eci,ei->ec", tip[edges.ends], way)) >= STRAIGHT).any(axis=1)
        crease, maybe = crease | new, maybe & ~new
    return crease
