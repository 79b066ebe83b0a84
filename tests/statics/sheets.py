"""Sheets and pairs of elements that tests of statics share."""

import numpy as np
import pytest

from dsfab.statics import Elements, elements_of
from dsfab.statics.elements import edge_frames
from dsfab.surface import Surface
from tests.shapes import grid, jittered, lifted, moebius, sphere, three_leaves

BEST, SIX_NODES = elements_of("displacement"), elements_of("six_nodes")

PAIRS = [Elements(m, b) for m in ("constant", "quadratic") for b in ("hinge", "midedge", "hhj")] + [BEST]

pairs = pytest.mark.parametrize("elements", PAIRS, ids=str)


def pleat() -> Surface:
    """Two sheets that fold back onto each other by 170 degrees: their normals have no mean to speak of."""
    flat = grid(4, 3, 2.0, 1.0)
    x, turn = flat.V[:, 0] - 1, np.radians(10)
    return Surface(np.stack([np.abs(x) * np.cos(turn / 2), flat.V[:, 1], x * np.sin(turn / 2)], axis=1), flat.F)


SHEETS = {
    "flat": lambda: jittered(grid(4, 3, 2.0, 1.0)),
    "dome": lambda: lifted(lambda x, y: 16 * x * (1 - x) * y * (1 - y), cells=4),
    "closed": lambda: sphere(1),
    "moebius": lambda: moebius(24, 3, 0.6),
    "three leaves": three_leaves,
    "pleat": pleat,
}

sheets = pytest.mark.parametrize("name", list(SHEETS))


def unknowns(surface: Surface, elements: Elements, u, rotation=0.0, slope=0.0, bubble=None):
    """The vector of unknowns from displacements (n, 3), rotations (e,), slopes (e,) and bubbles (e, 3) in space."""
    count = len(surface.edges.ends)
    bubble = np.zeros((count, 3)) if bubble is None else bubble
    framed = dict(
        zip(("along", "across", "normal"), np.einsum("edx,ex->de", edge_frames(surface), bubble), strict=True)
    )
    known = {"rotation": np.broadcast_to(rotation, count), "slope": np.broadcast_to(slope, count), **framed}
    return np.concatenate([u.ravel(), *(known[name] for name in elements.on_edges)])
