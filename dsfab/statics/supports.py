"""What the supports of vertices mean for the unknowns on edges."""

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.arrays import Bools
from dsfab.errors import StaticsError
from dsfab.statics.elements import BUBBLES, Elements, edge_frames
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

MOSTLY = 0.5
"""A bubble is held when more than this share of its squared direction lies in held directions."""


def held_on_edges(surface: Surface, elements: Elements, fixed: Bools, clamped: Bools | None) -> Bools:
    """(e, k) which edge unknowns of `elements` do not move.

    fixed   : (n, 3) held directions of the vertices.
    clamped : (e,) edges that may not turn about themselves: built-in edges, and edges on a plane of symmetry.

    An edge is held along a direction where the sheet beside it is: on the boundary when both ends are, inside when all
    corners of one of its faces are. The ears of a mesh (faces with two boundary edges) do not count as such faces:
    their corners are held by the boundary alone. Edges of faces held in all directions do not turn either.
    """
    faces, held = held_faces(surface, fixed), held_middles(surface, fixed)
    still = np.zeros(len(held), dtype=bool)
    still[surface.edges.of[faces.all(axis=1)]] = True
    if clamped is not None:
        still |= clamped
    bubbles = np.einsum("edx,ex->ed", edge_frames(surface) ** 2, held.astype(float)) > MOSTLY
    columns = [bubbles[:, BUBBLES.index(name)] if name in BUBBLES else still for name in elements.on_edges]
    return np.stack(columns, axis=1) if columns else np.zeros((len(held), 0), dtype=bool)


def held_middles(surface: Surface, fixed: Bools) -> Bools:
    """(e, 3) directions in which the middles of edges are held when the vertices are held as (n, 3) `fixed` says."""
    edges, faces = surface.edges, held_faces(surface, fixed)
    held = fixed[edges.ends].all(axis=1) & edges.boundary[:, None]
    for axis in range(3):
        held[edges.of[faces[:, axis]], axis] = True
    return np.asarray(held)


def held_faces(surface: Surface, fixed: Bools) -> Bools:
    """(m, 3) directions in which whole faces are held when the vertices are held as (n, 3) `fixed` says; no ears."""
    ears = surface.edges.boundary[surface.edges.of].sum(axis=1) >= 2
    return np.asarray(fixed[surface.F].all(axis=1) & ~ears[:, None])


def require_clampable(surface: Surface, elements: Elements, clamped: Bools | None) -> None:
    """Raise StaticsError when edges (e,) are clamped that have no rotation; a sheet solved in its plane needs none."""
    if clamped is None:
        return
    if clamped.shape != (len(surface.edges.ends),):
        raise StaticsError(
            f"clamped must say yes or no for each of the {len(surface.edges.ends)} edges, not {clamped.shape}"
        )
    if elements.bending == "hinge" and clamped.any():
        raise StaticsError(
            f"{clamped.sum()} edges are clamped, but `hinge` bending has no rotations of edges; "
            'choose bending = "midedge" or "hhj"'
        )


def all_clamped(load: LoadCase) -> Bools | None:
    """(e,) edges that may not turn; None where the supports name none."""
    return load.clamped if len(load.clamped) else None


def with_springs(K: csr_array, load: LoadCase) -> csr_array:
    """K (u, u), N/m, with the spring supports of `load` on the diagonal of its first 3 n unknowns; K itself without
    any."""
    if not load.spring.any():
        return K
    springs = np.zeros(K.shape[0])
    springs[: load.spring.size] = load.spring.ravel()
    return csr_array(K + diags_array(springs))
