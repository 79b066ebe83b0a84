"""Vertices at the same place: what cutting and drawing programs leave where they part a mesh."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, lengths

SAME_PLACE = 1e-9
"""Vertices closer than this share of the mesh's largest side are at one place: `trimesh.slice_plane` works out the end
of a cut once for each face there, and some of these differ in the last digit."""


FAR = 1000.0
"""A vertex is astray that many times as far from the middle of all as 99 of 100 are: a number of its file is broken."""


def in_reach(V: Floats) -> Bools:
    """(n,) whether a vertex of V (n, 3) has finite numbers and is not astray: see `FAR`."""
    near: Bools = np.asarray(np.isfinite(V).all(axis=1))
    if not near.any():
        return near
    from_middle = np.abs(V[near] - np.median(V[near], axis=0)).max(axis=1)
    most = float(np.quantile(from_middle, 0.99, method="lower"))
    if most > 0:
        near[near] = from_middle <= FAR * most
    return near


def merged(V: Floats, within: float = SAME_PLACE, apart: Callable[[Ints], Bools] | None = None) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at the same place made one, the first of them, in the order given; and which (n,) each became.

    within : share of the mesh's largest side that counts as one place; none moves further.
    apart  : which (p,) of the pairs (p, 2) of them stay two; none where left out.

    Mesh files are merged by equality alone (`dsfab.surface.files`): their numbers were written with the same digits.
    """
    alone = V, np.arange(len(V))
    if not len(V) or not np.isfinite(V).all():  # told where the surface is made
        return alone
    reach = within * float(np.ptp(V, axis=0).max())
    pairs = cKDTree(V).query_pairs(reach, output_type="ndarray")
    pairs = pairs[~apart(pairs)] if apart and len(pairs) else pairs
    if not len(pairs):
        return alone
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(V), len(V)))
    label = connected_components(links, directed=False)[1]
    _, first, became = np.unique(label, return_index=True, return_inverse=True)
    at = _without_chains(V, pairs, first[became.ravel()], reach)
    kept, became = np.unique(at, return_inverse=True)
    return V[kept], became.ravel()


def _without_chains(V: Floats, pairs: Ints, at: Ints, reach: float) -> Ints:
    """(n,) the vertex that each becomes: the first `at` of those it is linked to, unless that is further than `reach`.

    Links go on from vertex to vertex, so that a finely divided outline would shrink to a point: along such a chain a
    vertex becomes the first within reach of it that stays.
    """
    long = np.unique(at[lengths(V - V[at]) > reach])
    if not len(long):
        return at
    near: dict[int, list[int]] = {}
    for a, b in np.sort(pairs[np.isin(at[pairs[:, 0]], long)], axis=1).tolist():
        near.setdefault(b, []).append(a)
    at = at.copy()
    for vertex in np.flatnonzero(np.isin(at, long)).tolist():
        at[vertex] = min((k for k in near.get(vertex, ()) if at[k] == k), default=vertex)
    return at


def equal_merged(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at exactly the same place made one, ordered by place, and faces F (m, 3) of them.

    + 0.0 turns -0.0 into 0.0.
    """
    fewer, became = np.unique(V + 0.0, axis=0, return_inverse=True)
    return fewer, became.ravel()[F]


def coincident(V: Floats) -> int:
    """How many of the vertices V (n, 3) lie where an earlier one does."""
    return len(V) - len(merged(V)[0])
