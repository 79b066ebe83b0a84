"""`parts`: the connected pieces of a solid, each a solid of its own."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import signed_volumes
from dsfab.surface.topology import edge_table, euler_characteristic, pieces
from dsfab.thickening.solid import Solid


def parts(solid: Solid) -> tuple[Solid, ...]:
    """As many solids as the solid has pieces, from low to high, then from front to back and left to right.

    A closed surface inside of a piece is a void of it and stays with the smallest piece around.
    """
    if solid.pieces == 1:
        return (solid,)
    count, shell = pieces(solid.F, edge_table(solid.F))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corner = solid.V[solid.F]
    np.minimum.at(low, shell, corner.min(axis=1))
    np.maximum.at(high, shell, corner.max(axis=1))
    outer = signed_volumes(solid.V, solid.F, shell, count) > 0
    owner = _owners(low, high, outer)
    order = sorted(np.flatnonzero(outer).tolist(), key=lambda k: tuple(low[k, ::-1].tolist()))
    return tuple(_part(solid, owner[shell] == k) for k in order)


def _owners(low: Floats, high: Floats, outer: Bools) -> Ints:
    """(count,) each shell's outer one: itself, or for a void the smallest box around its own."""
    owner = np.arange(len(low))
    at = np.flatnonzero(outer)
    size = np.linalg.norm(high[at] - low[at], axis=1)
    for k in np.flatnonzero(~outer):
        around = (low[at] <= low[k]).all(axis=1) & (high[at] >= high[k]).all(axis=1)
        owner[k] = at[np.where(around, size, np.inf).argmin()]
    return owner


def _part(solid: Solid, mine: Bools) -> Solid:
    F = solid.F[mine]
    used = np.zeros(len(solid.V), dtype=bool)
    used[F] = True
    F = (np.cumsum(used) - 1)[F]
    table = edge_table(F)
    return Solid(solid.V[used], F, pieces(F, table)[0] - euler_characteristic(F, table) // 2, 1)
