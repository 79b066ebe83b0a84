"""`crossed_over`: where both families change names, so that members go on where the principal stresses cross.

The major direction is that of the larger stress. Across a curve on which both are equal it is suddenly the other one,
though neither stress has turned:

    - - - - | | | |                         - - - - - - - -      the stress along - falls below the other at the curve:
    - - - - | | | |     named by size       - - - - - - - -      members that go on, and two families that are each
    - - - - | | | |                         - - - - - - - -      continuous, are named by neither size there
"""

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from dsfab.arrays import Bools, Floats
from dsfab.pattern.frames import Frames, dots
from dsfab.surface import connected

TIE = 1e-6
"""Regions whose areas differ by less than this share of the surface are as large."""


def crossed_over(frames: Frames, along: Floats) -> Bools:
    """(n,) vertices at which the other family goes on in the direction along (n, 3), a unit tangent up to sign.

    Regions inside which it turns by less than 45 degrees from vertex to vertex are told apart; the largest keeps its
    name, and its neighbours change theirs. A curve that ends inside the surface bounds no region, and is left alone.
    """
    surface, (i, j) = frames.surface, frames.ends.T
    square = np.cross(frames.normal[j], along[j])
    turned = np.abs(dots(along[i], square)) > np.abs(dots(along[i], along[j]))
    count, region = connected(surface.n, i[~turned], j[~turned])
    if count == 1:
        return np.zeros(surface.n, dtype=bool)
    metres = np.linalg.norm(surface.V[i] - surface.V[j], axis=1)
    one, two = region[i], region[j]
    apart = one != two
    border = coo_array((metres[apart], (one[apart], two[apart])), shape=(count, count)).tocsr()
    border = csr_array(border + border.T)
    border.data = -border.data  # the longest borders are those across which families go on
    tree = minimum_spanning_tree(border)
    area = np.bincount(region, surface.vertex_areas, count) / surface.area
    odd, todo = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    while todo.any():
        root = int(np.argmax(np.where(todo, np.rint(area / TIE), -1)))
        order, before = breadth_first_order(tree, root, directed=False)
        todo[order] = False
        for child in order[1:].tolist():
            odd[child] = not odd[before[child]]
    return np.asarray(odd[region])
