"""`signs_with_short_seams`: tangents that are known up to sign, given signs that agree but across a few edges.

Around a singular point at which a direction comes back reversed no signs agree everywhere. Edges across which they do
not are crossed by a path over faces from such a face to the next, or to the boundary. Where they are is free:

    faces that are singular, and boundaries  ->  the shortest tree of paths between them  ->  signs carried along edges
    which the tree does not cross
"""

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, minimum_spanning_tree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.pattern.frames import Frames
from dsfab.surface import Surface, connected


def signs_with_short_seams(frames: Frames, along: Floats) -> Floats:
    """(n,) 1 or -1 by which to multiply tangents along (n, 3), such that few neighbours point against each other."""
    surface, (i, j) = frames.surface, frames.ends.T
    against = frames.sides(along, i, j) < 0
    singular = np.logical_xor.reduce(against[surface.edges.of], axis=1)
    return _carried(surface, against, _crossed(surface, singular))


def _crossed(surface: Surface, singular: Bools) -> Bools:
    """(e,) edges that are crossed by a tree of paths over faces between singular ones (m,), and boundaries."""
    edges = surface.edges
    crossed = np.zeros(len(edges.ends), dtype=bool)
    if not singular.any():
        return crossed
    name = _ends(surface, singular)
    h0, h1 = edges.pairs.T
    f, g, edge = h0 // 3, h1 // 3, edges.of.ravel()[h0]
    link = csr_array((np.ones(len(f), dtype=np.int8), (f, g)), shape=(surface.m, surface.m))
    far, preceding, source = dijkstra(
        link, directed=False, unweighted=True, indices=np.flatnonzero(name), return_predecessors=True, min_only=True
    )
    reached = np.isfinite(far[f]) & np.isfinite(far[g])
    one, two = name[source[f]], name[source[g]]
    meeting = np.flatnonzero(reached & (one != two))
    meeting = meeting[np.argsort(far[f[meeting]] + far[g[meeting]], kind="stable")]
    low, high = np.minimum(one, two)[meeting], np.maximum(one, two)[meeting]
    _, first = np.unique(low * (name.max() + 1) + high, return_index=True)
    steps = far[f[meeting]] + far[g[meeting]] + 1
    count = int(name.max()) + 1
    tree = minimum_spanning_tree(coo_array((steps[first], (low[first], high[first])), shape=(count, count)).tocsr())
    number = csr_array((first + 1, (low[first], high[first])), shape=(count, count))
    before = preceding.astype(np.int64)
    for at in meeting[np.asarray(number[tree.nonzero()]).ravel() - 1].tolist():
        crossed[edge[at]] = True
        for face in (int(f[at]), int(g[at])):
            crossed[_on_path(surface, face, before, singular)] = True
    return crossed


def _on_path(surface: Surface, face: int, before: Ints, singular: Bools) -> list[int]:
    """The edges between a face and where its path begins: a singular face, or the boundary, which it crosses."""
    edges, crossed = surface.edges, []
    while before[face] >= 0:
        crossed.append(int(np.intersect1d(edges.of[face], edges.of[before[face]])[0]))
        face = int(before[face])
    if not singular[face]:
        crossed.append(next(k for k in edges.of[face].tolist() if edges.boundary[k]))
    return crossed


def _ends(surface: Surface, singular: Bools) -> Ints:
    """(m,) where the tree's paths may end: a number for each singular face and for all along a boundary; others 0."""
    edges = surface.edges
    count, loop = connected(surface.n, *edges.ends[edges.boundary].T)
    name = np.zeros(surface.m, dtype=np.int64)
    at = edges.order[edges.start[:-1][edges.boundary]]  # half-edges
    name[at // 3] = 1 + loop[edges.ends[edges.boundary, 0]]
    name[singular] = 1 + count + np.arange(singular.sum())
    return np.unique(np.append(name, 0), return_inverse=True)[1][:-1].astype(np.int64)


def _carried(surface: Surface, against: Bools, crossed: Bools) -> Floats:
    """(n,) signs from one vertex of each part on, along edges that are not crossed; turned where edges are against."""
    i, j = surface.edges.ends[~crossed].T
    link = csr_array((np.where(against[~crossed], -1, 1), (i, j)), shape=(surface.n, surface.n))
    link = csr_array(link + link.T)
    signs, todo = np.ones(surface.n), np.ones(surface.n, dtype=bool)
    while todo.any():
        order, before = breadth_first_order(link, int(np.argmax(todo)), directed=False)
        todo[order] = False
        if len(order) > 1:
            signs[order] = _along_paths(link, order.astype(np.int64), before.astype(np.int64))
    return signs


def _along_paths(link: csr_array, order: Ints, before: Ints) -> Floats:
    """(k,) products of the signs of links along the paths of a search; paths to its root are halved in rounds."""
    parent = before[order[1:]]
    sign = np.concatenate([[1.0], np.asarray(link[parent, order[1:]]).ravel()])
    place = np.empty(len(before), dtype=np.int64)
    place[order] = np.arange(len(order))
    earlier = np.concatenate([[0], place[parent]])
    while earlier.any():
        sign = sign[earlier] * sign
        earlier = earlier[earlier]
    return sign
