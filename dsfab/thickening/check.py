"""What a sheet must be before it can be thickened: at most two faces on an edge, one side, no contact in a point."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.arrays import Ints, first
from dsfab.errors import SolidError
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import half_edges, misoriented_edges, pinches


def check_edges(surface: Surface) -> None:
    """Raise SolidError unless every edge has one face, or two that run through it in opposite directions."""
    edges = surface.edges
    crowded = np.flatnonzero(edges.count > 2)
    if len(crowded):
        raise SolidError(
            f"{len(crowded)} edges of the sheet have more than two faces (first, by vertices: "
            f"{_named(edges.ends[crowded])}); separate the sheets that meet there"
        )
    against = misoriented_edges(surface.F, edges)
    if not len(against):
        return
    if _is_one_sided(surface):
        raise SolidError(
            "the sheet has one side only, like a Moebius strip, so its two skins cannot be told apart; "
            "cut it open along a line that crosses it"
        )
    raise SolidError(
        f"the two faces of {len(against)} edges of the sheet point to opposite sides (first, by vertices: "
        f"{_named(edges.ends[against])}); orient the faces of the mesh consistently"
    )


def check_contacts(surface: Surface) -> None:
    """Raise SolidError where parts of the sheet meet in a vertex only: no solid is a manifold there."""
    pinched = pinches(surface.F, surface.edges, surface.n)
    if len(pinched):
        raise SolidError(
            f"parts of the sheet meet in nothing but a point at {len(pinched)} vertices (first: {first(pinched)}); "
            "join or split them before thickening"
        )


def _is_one_sided(surface: Surface) -> bool:
    """Whether some piece has a face whose two sides are connected: nodes are (face, side), 2 f + side."""
    h0, h1 = surface.edges.pairs.T
    start, _ = half_edges(surface.F)
    crossing = start[h0] == start[h1]  # the neighbour is turned over, so the same side of it is its other one
    near, far = 2 * (h0 // 3), 2 * (h1 // 3)
    i = np.concatenate([near, near + 1])
    j = np.concatenate([far + crossing, far + 1 - crossing])
    links = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(2 * surface.m,) * 2)
    _, side = connected_components(links, directed=False)
    return bool((side[0::2] == side[1::2]).any())


def _named(ends: Ints, count: int = 5) -> str:
    shown = ", ".join(f"{a}-{b}" for a, b in ends[:count])
    return shown + (", ..." if len(ends) > count else "")
