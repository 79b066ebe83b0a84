"""Creases of a surface: rows of edges that bend far more than the edges beside them. Where one fades, it ends."""

import numpy as np

from dsfab.arrays import Bools
from dsfab.surface import CREASE, Surface, connected

WEAK = 8.0
"""Degrees between two faces from which their edge may be part of a crease; one of its edges bends by `CREASE`."""

RATIO = 4.0
"""Times by which a crease bends more than the edges beside it."""

SHORTEST = 6
"""Edges that a crease has at least: single sharp edges are noise of the mesh."""


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
        beside = rest[edges.of[:, [[1, 2], [2, 0], [0, 1]]]].max(axis=2)  # (m, 3) the sharper of a face's other edges
        around = np.zeros(len(bend))
        np.maximum.at(around, edges.of, beside)
        crease |= inner & (bend >= np.maximum(WEAK, RATIO * around))
    at = np.flatnonzero(crease)
    _, part = connected(surface.n, *edges.ends[at].T)
    run = part[edges.ends[at, 0]]
    long = np.bincount(run, minlength=surface.n) >= SHORTEST
    sharpest = np.zeros(surface.n)
    np.maximum.at(sharpest, run, bend[at])
    crease[at] = (long & (sharpest >= CREASE))[run]
    return crease
