"""A solid of three pieces."""

import numpy as np

from dsfab.thickening import Solid
from tests.export.solids import solid_box, solid_torus


def three() -> Solid:
    """A box, a box with a bubble in it, and a ring."""
    solids = [
        solid_box(),
        solid_box(corner=(0.5, 0, 0)),
        solid_box(size=np.full(3, 0.01), corner=(0.6, 0.1, 0.02)),
        solid_torus(),
    ]
    V, F, at = [], [], 0
    for i, one in enumerate(solids):
        V.append(one.V + [0, 0, 2.0 * (i == 3)])
        F.append((one.F[:, ::-1] if i == 2 else one.F) + at)
        at += len(one.V)
    return Solid(np.concatenate(V), np.concatenate(F), genus=1, pieces=3)
