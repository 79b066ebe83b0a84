"""Which curves of a piece are fitted more closely: those that cross, gape or stray, and those that OCCT refuses."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, from_segments
from dsfab.export.smooth.acceptance import GAP
from dsfab.export.smooth.edges import TIGHTER
from dsfab.export.smooth.limits import Limits
from dsfab.export.smooth.outline import WALL, Sheet
from dsfab.export.smooth.plan import Built
from dsfab.export.smooth.seams import Key
from dsfab.export.smooth.solid import Model, Piece
from dsfab.export.smooth.touching import crossings

CLOSEST = len(TIGHTER) - 1
"""The level that no curve is refitted beyond."""

CHORDS, NEAR = 64, 4
"""Chords of an edge that corners of the mesh are compared with, and how many of those nearest by their middles."""


def tighten(model: Model, k: int, level: dict[Key, int], bad: Floats) -> bool:
    """Raise the level of the runs nearest to the `bad` points (k, 3), millimetres; whether there was one to raise."""
    piece = model.pieces[k]
    x = np.linspace(0, 1, 9)
    samples = np.concatenate([curve(x) for edge in piece.edges for curve in (edge.upper, edge.lower)])
    tree = cKDTree(samples)
    reach = np.atleast_1d(tree.query(bad)[0]) + 1e-3 * model.thickness
    hit = {i // (2 * len(x)) for point, r in zip(bad, reach, strict=True) for i in tree.query_ball_point(point, r)}
    keys = {piece.keys[i] for i in hit if level.get(piece.keys[i], 0) < CLOSEST}
    level |= {key: level.get(key, 0) + 1 for key in keys}
    return bool(keys)


def untangle(built: Built, k: int, level: dict[Key, int]) -> None:
    """Build a piece again until none of its curves crosses, gapes or strays, as long as closer fits are left."""
    model, corners = built.model, _corners(built.gate.sheet, k)
    for _ in range(CLOSEST):
        piece = model.pieces[k]
        gaping = piece.ends[[edge.gap > GAP * model.thickness for edge in piece.edges]]
        stray = astray(piece, corners, built.gate.limits)
        bad = np.concatenate([crossings(piece), gaping, stray])
        if not len(bad) or not tighten(model, k, level, bad):
            return
        model.pieces[k] = built.builder.piece(k, level)


def astray(piece: Piece, corners: Floats, limits: Limits) -> Floats:
    """(k, 3) the corners (n, 3) of the mesh at walls that are farther from the piece's edges than its solid may be.

    OCCT's triangles would tell so, but another round with OCCT takes seconds.
    """
    x = np.linspace(0, 1, CHORDS + 1)
    lines = np.stack([curve(x) for edge in piece.edges if edge.wall for curve in (edge.upper, edge.lower)])
    start, end = lines[:, :-1].reshape(-1, 3), lines[:, 1:].reshape(-1, 3)
    near = cKDTree((start + end) / 2).query(corners, NEAR)[1]
    away = from_segments(corners[:, None], start[near], end[near]).min(axis=1)
    far = away > limits.distance
    return np.asarray(corners[far][away[far] > limits.allowed(corners[far])])


def _corners(sheet: Sheet, k: int) -> Floats:
    """(n, 3) both ends of the mesh's posts along the walls of a piece."""
    runs = [run for region in sheet.regions if region.piece == k for loop in region.loops for run in loop]
    v = np.unique(np.concatenate([run.vertices for run in runs if run.beyond == WALL]))
    return np.concatenate([sheet.V[v] + sheet.D[v], sheet.V[v] - sheet.D[v]])
