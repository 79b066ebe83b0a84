"""Data for the curved solid of a part, and its comparison with the mesh."""

from collections.abc import Container
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.shared.sheet_outline import SheetOutline, sheet_of
from dsfab.export.cad.step.shared.skins import SmoothLimits, prisms, smooth_limits
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Part
from dsfab.surface import nearest_places
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corners_of


class MeshDistances(NamedTuple):
    """Distances of points from a mesh or a solid, mm. most : largest distance.    bad : (k, 3) points too far away.
    worst : distance of the point that exceeds its limit most.    allowed : limit at this point."""

    most: float
    worst: float
    allowed: float
    bad: Floats


@dataclass(frozen=True, eq=False)
class MeshSolids:
    """The separate solids in the mesh of a part, millimetres."""

    part: Part

    @cached_property
    def _shells(self) -> tuple[Ints, list[list[int]]]:
        return solids_of(self.part)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.part.V)

    def distances(self, points: Floats) -> Floats:
        """Return the distances (k,) of points (k, 3) from the mesh."""
        P, V, F = (np.ascontiguousarray(x) for x in (points, self.part.V, self.part.F))
        return np.asarray(np.sqrt(self._triangles.squared_distance(V, F, P)[0]))

    @cached_property
    def _triangles(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(np.ascontiguousarray(self.part.V), np.ascontiguousarray(self.part.F))
        return tree

    def solids_at(self, points: Floats) -> Ints:
        """Return the number (k,) of the solid with the mesh vertex nearest to each point (k, 3)."""
        shell, solids = self._shells
        vertex_shell = np.full(len(self.part.V), -1)
        vertex_shell[self.part.F] = shell[:, None]
        shell_solid = np.empty(int(shell.max()) + 1, dtype=np.int64)
        for i, shells in enumerate(solids):
            shell_solid[shells] = i
        return np.asarray(shell_solid[vertex_shell[self._tree.query(points)[1]]])

    def faces(self, selected: Container[int]) -> Ints:
        """Return the triangles (m, 3) of the mesh solids with the numbers `selected`."""
        shell, solids = self._shells
        shells = [k for i, solid_shells in enumerate(solids) if i in selected for k in solid_shells]
        return np.asarray(self.part.F[np.isin(shell, shells)])

    @property
    def count(self) -> int:
        """Number of solids in the mesh."""
        return len(self._shells[1])


@dataclass(frozen=True, eq=False)
class PieceJudge:
    """Comparison of a sheet's pieces with the solids in the mesh of a part, millimetres."""

    solids: MeshSolids
    sheet: SheetOutline
    limits: SmoothLimits

    @cached_property
    def solid(self) -> Ints:
        """(p,) number of the mesh solid of each piece."""
        sample_vertices = self.sheet.F[np.unique(self.sheet.piece, return_index=True)[1], 0]
        return self.solids.solids_at((self.sheet.V + self.sheet.D)[sample_vertices])

    @cached_property
    def volumes(self) -> Floats:
        """(p,) volume of each piece, mm3."""
        return self._sum(np.ones(len(self.sheet.F)))

    @cached_property
    def excess_volumes(self) -> Floats:
        """(p,) fraction by which the volume of each smooth piece may exceed `volumes`."""
        sheet = self.sheet
        upper = (sheet.V + sheet.D)[sheet.F].mean(axis=1)  # `nearest` is twice as fast for points on a skin
        return np.maximum(self._sum(self.limits.rounder[self.limits.nearest(upper)]) / self.volumes, 0.0)

    def _sum(self, share: Floats) -> Floats:
        sheet = self.sheet
        volumes = share * prisms(sheet.V, sheet.D, sheet.F)
        return np.asarray(np.bincount(sheet.piece, volumes, sheet.count), dtype=np.float64)

    def distances(self, V: Floats, F: Ints) -> tuple[MeshDistances, MeshDistances]:
        """Return the distances from triangles V (n, 3), F (m, 3) to the mesh, and from the mesh to these triangles."""
        part = self.solids.part
        return self.farthest(V, F, part.V, part.F), self.farthest(part.V, part.F, V, F)

    def excess_distances(self, points: Floats) -> Floats:
        """Return the distance (k,) of points (k, 3) from the mesh, minus the allowed distance."""
        away = self.solids.distances(points)
        is_far = away > self.limits.distance / 2  # near points need no chord errors, which take time to compute
        away[is_far] -= self.limits.allowed_distances(points[is_far])
        away[~is_far] -= self.limits.distance
        return away

    def farthest(self, V: Floats, F: Ints, V2: Floats, F2: Ints) -> MeshDistances:
        """Return the distances of sample points on triangles V (n, 3), F (m, 3) from the triangles V2, F2."""
        points = np.concatenate([V[corners_of(F, np.ones(len(F), dtype=bool), len(V))], V[F].mean(axis=1)])
        away = nearest_places(points, V2, F2).distance
        far_points = points[away > self.limits.distance]  # points within `distance` are allowed everywhere
        if not len(far_points):
            return MeshDistances(float(away.max()), float(away.max()), self.limits.distance, far_points)
        far_distances, allowed = away[away > self.limits.distance], self.limits.allowed_distances(far_points)
        bad, k = far_points[far_distances > allowed], int((far_distances - allowed).argmax())
        return MeshDistances(float(away.max()), float(far_distances[k]), float(allowed[k]), bad)


class SolidPlan:
    """Data for writing a part as a solid with curved faces. Raises ExportError if the data are missing."""

    def __init__(self, part: Part) -> None:
        if part.curved is None:
            raise ExportError("a smooth STEP file needs the sheet, but the part has only a solid")
        self.curved, self.solids = part.curved(), MeshSolids(part)
        self.surface = Surface(self.curved.V, self.curved.F)
        self.limits = smooth_limits(self.surface, self.curved, part.tolerance)

    @cached_property
    def whole(self) -> SheetOutline:
        """The whole sheet as a single chart, with its outlines."""
        return sheet_of(self.curved.divided(np.ones((self.surface.n, 1))), self.curved.shift)

    @cached_property
    def gate(self) -> PieceJudge:
        """Comparison of the whole sheet with the mesh of the part."""
        return PieceJudge(self.solids, self.whole, self.limits)
