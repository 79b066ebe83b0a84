"""What a sheet must be before it can be thickened: at most two faces on an edge, no contact in a point."""

import numpy as np

from dsfab.arrays import Ints, first
from dsfab.errors import SolidError
from dsfab.surface.cover import one_sided_pieces
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges


def check_edges(surface: Surface) -> None:
    """Raise SolidError unless every edge has one face or two."""
    edges = surface.edges
    crowded = np.flatnonzero(edges.count > 2)
    if len(crowded):
        raise SolidError(
            f"{len(crowded)} edges of the sheet have more than two faces (first, by vertices: "
            f"{_named(edges.ends[crowded])}); separate the sheets that meet there"
        )


def check_oriented(surface: Surface) -> None:
    """Raise SolidError like `check_edges`, and for two faces that point to opposite sides though they need not."""
    check_edges(surface)
    edges = surface.edges
    against = misoriented_edges(surface.F, edges)
    wrong = against[~one_sided_pieces(surface.F, edges)[edges.order[edges.start[against]] // 3]]
    if len(wrong):
        raise SolidError(
            f"the two faces of {len(wrong)} edges of the sheet point to opposite sides (first, by vertices: "
            f"{_named(edges.ends[wrong])}); orient the faces of the mesh consistently"
        )


def check_contacts(surface: Surface) -> None:
    """Raise SolidError where parts of the sheet meet in a vertex only: no solid is a manifold there."""
    pinched = surface.pinches
    if len(pinched):
        raise SolidError(
            f"parts of the sheet meet in nothing but a point at {len(pinched)} vertices (first: {first(pinched)}); "
            "join or split them before thickening"
        )


def _named(ends: Ints, count: int = 5) -> str:
    shown = ", ".join(f"{a}-{b}" for a, b in ends[:count])
    return shown + (", ..." if len(ends) > count else "")
