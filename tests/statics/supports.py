"""Supports of a surface and orders of convergence."""

import numpy as np

from dsfab.statics import Material

STEEL, BEAM = Material(210e9, 0.3, 7850.0), Material(210e9, 0.0, 7850.0)


def order(errors) -> float:
    """Observed rate between the two finest of meshes that halve their size."""
    return float(np.log2(errors[-2] / errors[-1]))


def hold(surface, *supports):
    """(n, 3) from pairs of marked vertices and directions such as "xz"."""
    fixed = np.zeros((surface.n, 3), dtype=bool)
    for where, axes in supports:
        for axis in axes:
            fixed[where, "xyz".index(axis)] = True
    return fixed


def rim(surface):
    """(n,) vertices of free edges."""
    on = np.zeros(surface.n, dtype=bool)
    on[surface.edges.ends[surface.edges.boundary]] = True
    return on
