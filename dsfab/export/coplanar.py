"""Which triangles of a closed mesh lie in one plane with their neighbours."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.arrays import Floats, Ints, group_sums
from dsfab.surface.topology import EdgeTable

FLATNESS = 1e-5
"""Millimetres that vertices may be off a joined plane or line: the linear precision of Parasolid, 1e-8 m."""


def coplanar_regions(V: Floats, F: Ints, table: EdgeTable, off: float = FLATNESS) -> tuple[Ints, Floats]:
    """Region (m,) of each triangle, and twice the area vector (r, 3) of each region.

    off : millimetres that vertices may be off a joined plane.

    Neighbours are joined where the apex of each lies in the plane of the other and they are not folded over. Triangles
    lower than FLATNESS have no plane of their own: they join the neighbour across their longest edge and no other, or
    they would bridge the two sides of an edge of the solid.
    Small turns could add up, so a region with a vertex off its mean plane falls apart again.
    """
    corners = V[F]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    units = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    low = np.linalg.norm(vectors, axis=1) <= FLATNESS * lengths.max(axis=1)
    h, k = np.concatenate([table.pairs, table.pairs[:, ::-1]]).T  # seen from triangle h // 3: its neighbour k // 3
    tip = V[F.ravel()[k - k % 3 + (k + 2) % 3]]
    level = np.abs(np.einsum("pi,pi->p", tip - corners[h // 3, 0], units[h // 3])) <= off
    level &= np.einsum("pi,pi->p", units[h // 3], units[k // 3]) > 0
    there, back = np.split(level & ~low[h // 3] & ~low[k // 3], 2)
    flat = table.pairs[there & back] // 3
    absorbed = np.stack([h, k], axis=1)[low[h // 3] & (h % 3 == lengths.argmax(axis=1)[h // 3])] // 3
    region = _components(np.concatenate([flat, absorbed]), len(F))
    uneven = _off_plane(corners, vectors, region) > off
    if uneven.any():
        region = _components(np.concatenate([flat[~uneven[region[flat[:, 0]]]], absorbed]), len(F))
    return region, group_sums(region, vectors)


def _components(links: Ints, count: int) -> Ints:
    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _off_plane(corners: Floats, vectors: Floats, region: Ints) -> Floats:
    """(r,) largest distance of a region's vertices from the plane through their mean, normal to its area vector."""
    normal = group_sums(region, vectors)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    weight = np.linalg.norm(vectors, axis=1)
    total = np.maximum(np.bincount(region, weight), 1e-300)
    middle = group_sums(region, corners.mean(axis=1) * weight[:, None]) / total[:, None]
    height = np.abs(np.einsum("mci,mi->mc", corners - middle[region][:, None], normal[region])).max(axis=1)
    worst = np.zeros(len(normal))
    np.maximum.at(worst, region, height)
    return worst
