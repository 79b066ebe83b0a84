"""`Base`: what extras stand on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import edge_table, pieces


@dataclass(frozen=True, eq=False)
class Base:
    """What extras stand on: the uncut surface, the sheet, and which of its vertices lie between marked ones.

    between : from marks (n,) on the surface to (n',) on the sheet (see `Sheet.between`).
    """

    surface: Surface
    sheet: Surface
    between: Callable[[Bools], Bools]

    def parts(self, marks: Bools) -> list[Floats]:
        """The points of the sheet at marked vertices (n,), connected ones together."""
        here = self.between(marks)
        touching = here[self.sheet.F].any(axis=1)
        if not touching.any():
            return []
        F = self.sheet.F[touching]
        count, label = pieces(F, edge_table(F))
        points = []
        for k in range(count):
            vertices = np.unique(F[label == k])
            points.append(self.sheet.V[vertices[here[vertices]]])
        return points

    def nearest(self, point: Floats) -> str:
        """The vertex of the sheet nearest to a point (3,), metres, as text."""
        x, y, z = self.sheet.V[cKDTree(self.sheet.V).query(point)[1]]
        return f"({x:.4g}, {y:.4g}, {z:.4g})"
