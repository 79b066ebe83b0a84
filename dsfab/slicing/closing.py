"""Openings between members that crowd: they close as a whole, or stay as wide as the members."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID

ALIKE = 0.1
"""Openings whose values differ by less may be the same but for the mesh."""


def with_closed(mesh: PolygonMesh, closed: Sequence[Floats | None]) -> PolygonMesh:
    """The mesh with openings that close made material.

    closed : for each field (n,) values at the uncut vertices, or None: an opening becomes material of the first field
             of whose values the mean over its area is over 0. Of openings that are alike all do or none.
    """
    given = {k: x for k, x in enumerate(closed) if x is not None}
    if not given or not mesh.void.any():
        return mesh
    _, opening = np.unique(mesh.parts(mesh.void), return_inverse=True)  # the first is all material
    area = np.where(mesh.void, mesh.cells.areas(mesh.X)[0], 0.0)
    total = np.bincount(opening, area)
    family, also = mesh.family, mesh.also
    for k, x in given.items():
        at = (mesh.weights @ x)[mesh.cells.corner]
        mean = mesh.cells.reduced(np.add, at) / mesh.cells.sizes
        means = np.divide(np.bincount(opening, area * mean), total, out=np.full(len(total), -np.inf), where=total > 0)
        closes = means > limit(means[np.isfinite(means)], 0.0, ALIKE)
        mine = (family == VOID) & closes[opening.ravel()]
        family, also = np.where(mine, k, family), np.where(mine, k, also)  # a joint, as a crossing is one
    return replace(mesh, family=family, also=also)


def limit(values: Floats, least: float, alike: float) -> float:
    """Where to part values (k,) into small and large ones: at `least`, or near it in the widest gap between values.

    Things that are alike but for the mesh, as all are between two rings of a dome, are then on the same side.
    """
    near = values[np.abs(values - least) < alike]
    if not len(near):
        return least
    below = values[values <= least - alike].max(initial=least - 2 * alike)
    above = values[values >= least + alike].min(initial=least + 2 * alike)
    x = np.sort(np.array([below, *near, above]))
    widest = int(np.argmax(np.round(np.diff(x), 6)))
    return float(x[widest : widest + 2].mean())
