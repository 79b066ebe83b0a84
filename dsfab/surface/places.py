"""Vertices at the same place: what cutting and drawing programs leave where they part a mesh."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints

SAME_PLACE = 1e-9
"""Vertices closer than this share of the mesh's largest side are at one place: `trimesh.slice_plane` works out the end
of a cut once for each face there, and some of these differ in the last digit."""


def merged(V: Floats, within: float = SAME_PLACE) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at the same place made one, the first of them, in the order given; and which (n,) each became.

    within : share of the mesh's largest side that counts as one place.

    Mesh files are merged by equality alone (`dsfab.surface.files`): their numbers were written with the same digits.
    """
    alone = V, np.arange(len(V))
    if not len(V) or not np.isfinite(V).all():  # told where the surface is made
        return alone
    pairs = cKDTree(V).query_pairs(within * float(np.ptp(V, axis=0).max()), output_type="ndarray")
    if not len(pairs):
        return alone
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(V), len(V)))
    label = connected_components(links, directed=False)[1]
    _, first, became = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return V[first[order]], rank[became.ravel()]


def equal_merged(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at exactly the same place made one, ordered by place, and faces F (m, 3) of them.

    + 0.0 turns -0.0 into 0.0.
    """
    fewer, became = np.unique(V + 0.0, axis=0, return_inverse=True)
    return fewer, became.ravel()[F]


def coincident(V: Floats) -> int:
    """How many of the vertices V (n, 3) lie where an earlier one does."""
    return len(V) - len(merged(V)[0])
