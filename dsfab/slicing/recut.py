"""Some cells of a sheet divided once more as polygons; the others stay as they are."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Ints, sorted_order
from dsfab.slicing.cells import Cells
from dsfab.slicing.cut import filled_polygons
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import Sheet


@dataclass(frozen=True, eq=False)
class Recut:
    """Cells (k,) of a sheet, ascending, their vertices (v,) of it, ascending, and both as a mesh of polygons."""

    sheet: Sheet
    cells: Ints
    vertices: Ints
    mesh: PolygonMesh

    @classmethod
    def of(cls, sheet: Sheet, cells: Ints) -> "Recut":
        """Cells (k,) of a sheet and those beside them, which get new vertices on their sides."""
        surface = sheet.surface
        near = np.zeros(surface.m, dtype=bool)
        near[cells] = True
        one, two = surface.edges.pairs.T // 3
        some = near[one] | near[two]
        near[one[some]] = near[two[some]] = True
        which = np.flatnonzero(near)
        vertices, F = np.unique(surface.F[which], return_inverse=True)
        triangles, X = Cells.triangles(F.reshape(-1, 3)), surface.V[vertices]
        mesh = PolygonMesh.plain(F, triangles, X, sheet.weights[vertices], sheet.parent[which], sheet.family[which])
        return cls(sheet, which, vertices, mesh)

    def together(self, mesh: PolygonMesh, source: Ints) -> Sheet:
        """All cells of the sheet, in their order, these ones replaced by the polygons that they became.

        source : (c,) the place in `cells` of each polygon.
        """
        sheet, surface, new = self.sheet, self.sheet.surface, len(mesh.X) - len(self.vertices)
        number = np.concatenate([self.vertices, surface.n + np.arange(new)])
        stay = np.ones(surface.m, dtype=bool)
        stay[self.cells] = False
        others = np.flatnonzero(stay)
        start = np.concatenate([3 * np.arange(len(others)), 3 * len(others) + mesh.cells.start])
        cells = Cells(start, np.concatenate([surface.F[others].ravel(), number[mesh.cells.corner]]))
        came = np.concatenate([others, self.cells[source]])
        order = sorted_order(came)
        X = np.concatenate([surface.V, mesh.X[len(self.vertices) :]])
        weights = csr_array(vstack([sheet.weights, mesh.weights[len(self.vertices) :]], format="csr"))
        cells, parent = cells.some(order), sheet.parent[came[order]]
        family = np.concatenate([sheet.family[others], mesh.family])[order]
        done, cell = filled_polygons(cells, X, parent)
        return Sheet(done, parent[cell], family[cell], weights)
