"""Posts on a plate that a stripe ends beside."""

import numpy as np

from dsfab.slicing.cutting.sheet import Sheet
from dsfab.surface import pieces
from tests.shapes import grid

LONG, HIGH, FRAME, HALF, STEP = 5.0, 3.0, 0.1, 0.15, 0.25

PLATE = grid(20, 5, LONG, HIGH)


def blank_face(x: float, y: float) -> np.ndarray:
    """(m,) the one face at a place."""
    V = PLATE.V[PLATE.F]
    side = [np.cross(V[:, (k + 1) % 3] - V[:, k], np.array([x, y, 0.0]) - V[:, k])[:, 2] for k in range(3)]
    found = np.all(np.array(side) > 0, axis=0)
    assert found.sum() == 1
    return np.asarray(found)


def material(sheet: Sheet) -> float:
    return float(sheet.surface.areas[sheet.material].sum())


def parts(sheet: Sheet) -> int:
    kept = sheet.subset().surface
    return pieces(kept.F, kept.edges)[0]
