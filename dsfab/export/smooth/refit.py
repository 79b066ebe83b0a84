"""Which curves of a piece are fitted more closely: those that cross others or gape, and those that OCCT refuses."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.export.smooth.edges import TIGHTER
from dsfab.export.smooth.gate import GAP
from dsfab.export.smooth.seams import Key
from dsfab.export.smooth.solid import Builder, Model
from dsfab.export.smooth.touching import crossings

CLOSEST = len(TIGHTER) - 1
"""The level that no curve is refitted beyond."""


def tighten(model: Model, k: int, level: dict[Key, int], bad: Floats) -> bool:
    """Raise the level of the runs nearest to the `bad` points; whether there was one to raise."""
    piece = model.pieces[k]
    x = np.linspace(0, 1, 9)
    samples = np.concatenate([curve(x) for edge in piece.edges for curve in (edge.upper, edge.lower)])
    tree = cKDTree(samples)
    reach = np.atleast_1d(tree.query(bad)[0]) + 1e-3 * model.thickness
    hit = {i // (2 * len(x)) for point, r in zip(bad, reach, strict=True) for i in tree.query_ball_point(point, r)}
    keys = {piece.keys[i] for i in hit if level.get(piece.keys[i], 0) < CLOSEST}
    level |= {key: level.get(key, 0) + 1 for key in keys}
    return bool(keys)


def untangle(builder: Builder, model: Model, k: int, level: dict[Key, int]) -> None:
    """Build a piece again until none of its curves crosses another or gapes, as long as closer fits are left."""
    for _ in range(CLOSEST):
        piece = model.pieces[k]
        bad = np.concatenate([crossings(piece), piece.ends[[edge.gap > GAP * model.thickness for edge in piece.edges]]])
        if not len(bad) or not tighten(model, k, level, bad):
            return
        model.pieces[k] = builder.piece(k, level)
