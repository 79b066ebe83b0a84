"""A material, a thickness and load cases."""

import numpy as np

from dsfab.statics import Material
from dsfab.surface import LoadCase, Surface

STEEL = Material(young=210e9, poisson=0.3, density=7850)

H = 0.01


def case(surface: Surface, fixed=(), force=()) -> LoadCase:
    """Load case from (mask, "xyz") and (mask, (3,) total force) pairs."""
    held = np.zeros((surface.n, 3), dtype=bool)
    for mask, axes in fixed:
        for axis in axes:
            held[mask, "xyz".index(axis)] = True
    f = np.zeros((surface.n, 3))
    for mask, total in force:
        f[mask] += np.asarray(total, dtype=float) / np.count_nonzero(mask)
    return LoadCase(held, f, (f != 0).any(axis=1))
