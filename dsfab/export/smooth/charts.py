"""Both skins over each chart: spline surfaces through V + D and V - D, fitted over the plane that sees the chart.

A chart that no spline with so many poles follows is divided in two across its longer side, and one that no plane sees
between what leans one way and the other; all other borders stay where they were.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import ExportError
from dsfab.export.smooth.dense import dense
from dsfab.export.smooth.patch_fits import FIRST, MOST_POLES, Fit, fitted
from dsfab.export.smooth.patches import Patch
from dsfab.export.smooth.points import FOLDED, SkinPoints, points_of
from dsfab.export.smooth.source import Curved
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import corners_of, faces_at

USELESS = 3
"""A chart that is off by so many tolerances is not worth asking OCCT about. One that is off by less may be, since the
solid is measured in the end, and few of its pieces are where the chart is worst."""

DIVISIONS = 2
"""Coarse meshes are divided so often for the fit, by points on cubics between the vertices: charts then agree at seams.
Nothing is known between the vertices of a coarse mesh, but two skins must say the same there."""

HALVED, FEWEST = 4, 12
"""How often a chart is divided, at most, and the vertices of the mesh that it must have for it."""

FEW_POLES = 24
"""A chart that needs more poles in one direction is divided once: OCCT looks through all poles of a surface for each
point that it projects, and the halves need fewer together. Without it the tower took a third more time."""

STEEPEST = np.cos(np.deg2rad(80.0))
"""A chart that leans more is divided between where it does and where it looks the other way."""

STEEP = 0.25
"""The fields of both halves of a chart part within this share of its half length: a border between others is as steep.
"""

OF_CHORD = 0.3
"""Share of the mesh's own chord error that counts to the tolerance: between its vertices it says no more."""


@dataclass(frozen=True, eq=False)
class SkinChart:
    """A plane and the skins over it. Lengths in millimetres.

    origin, axes : (3,) and (3, 3): two in the plane, and the one across it, where the normals point to.
    upper, lower, middle : surfaces of the skins, and between them, over the plane.
    tolerance    : what was asked of the fit: more where the mesh is coarse.
    steepest     : cosine of the largest angle between the plane and a face, but for a few.
    off          : largest distance of a skin from the points it was fitted to.
    """

    origin: Floats
    axes: Floats
    upper: Patch
    lower: Patch
    middle: Patch
    tolerance: float
    steepest: float
    off: float

    @cached_property
    def both(self) -> Patch:
        """Both skins as one surface of six coordinates, those of the upper one first."""
        return Patch(self.upper.u, self.upper.v, np.concatenate([self.upper.poles, self.lower.poles], axis=2))

    def over(self, points: Floats) -> Floats:
        """(k, 2) where points (k, 3) are seen in the plane."""
        return np.asarray((points - self.origin) @ self.axes[:2].T)


class Atlas:
    """The charts of a surface, made when they are asked for.

    fields : (n, c) on the vertices, chart k is where field k is largest; there are more once charts were divided.
    charts : by number; those that no spline follows are missing, and `failed` says why.
    """

    def __init__(self, surface: Surface, curved: Curved, fields: Floats, tolerance: float) -> None:
        self.surface, self.fields, self.tolerance = surface, fields, tolerance
        self.charts, self.failed = dict[int, SkinChart](), dict[int, str]()
        self._levels = [dense(surface, curved)]
        self._best = [fields.argmax(axis=1)]

    def make(
        self, numbers: Iterable[int], halve: bool = True, hopeless: Callable[[int], bool] = lambda _: False
    ) -> None:
        """The charts of these numbers (tolerance in millimetres), and those that they are divided into.

        hopeless : whether the others are of no use without a chart that failed; it ends there then.
        """
        todo = [(int(k), 0) for k in numbers if k not in self.charts and k not in self.failed]
        while todo:
            k, turn = todo.pop()
            may = halve and turn < HALVED and np.count_nonzero(self._best[0] == k) >= FEWEST
            halves = [(k, turn + 1), (self.fields.shape[1], turn + 1)]
            leaning = self._leaning(k)
            if may and leaning is not None:
                self._divide(k, leaning)
                todo += halves
                continue
            try:
                chart = self._chart(k, FIRST * (2 if turn else 1), FEW_POLES if may and not turn else MOST_POLES)
            except ExportError as error:
                self.failed[k] = str(error)
                if hopeless(k):
                    return
                continue
            if may and chart.off > chart.tolerance:
                self._divide(k, (self._levels[0].points - chart.origin) @ chart.axes[0])
                todo += halves
            elif chart.off > USELESS * chart.tolerance:
                self.failed[k] = (
                    f"no spline surface follows chart {k + 1} of {self.fields.shape[1]} of the sheet "
                    f"within {chart.tolerance:.2g} mm ({chart.off:.2g} mm)"
                )
                if hopeless(k):
                    return
            else:
                self.charts[k] = chart

    def _leaning(self, k: int) -> Floats | None:
        """(n,) from where chart k leans most to where it looks the other way; nothing when a plane sees it well."""
        touched = faces_at(self.surface.F, self._best[0] == k)
        N = self.surface.normals[touched]
        mean = self.surface.areas[touched] @ N
        cosine = N @ mean / max(float(np.linalg.norm(mean)), 1e-300)
        if not len(N) or np.quantile(cosine, FOLDED) >= STEEPEST:
            return None
        first = N[cosine.argmin()]
        return np.asarray(self._levels[0].normals @ (N[(N @ first).argmin()] - first))

    def _divide(self, k: int, along: Floats) -> None:
        """Chart k, and a new one where a field (n,) is beyond its middle between the ends of the chart."""
        inside = self._best[0] == k
        low, high = along[inside].min(), along[inside].max()
        steep = np.clip((along - (low + high) / 2) / (STEEP * (high - low) / 2), -1, 1)
        old = self.fields[:, k]
        fields = np.column_stack([self.fields, old - np.maximum(-steep, 0)])
        fields[:, k] = old - np.maximum(steep, 0)
        self.fields = fields
        for level, best in enumerate(self._best):
            fresh = self._carried(level, fields[:, [k, -1]])
            best[(best == k) & (fresh[:, 1] > fresh[:, 0])] = fields.shape[1] - 1

    def _carried(self, level: int, fields: Floats) -> Floats:
        for below in self._levels[:level]:
            fields = below.carry(fields)
        return fields

    def _chart(self, k: int, first: float, most: int) -> SkinChart:
        """Chart k, on points that are dense enough for its curvature and for its poles; see `fitted`."""
        F = self.surface.F
        near = faces_at(F, self._best[0] == k)
        for _ in range(2):
            near = faces_at(F, corners_of(F, near, self.surface.n))
        for level in range(DIVISIONS + 1):
            if level == len(self._levels):
                self._levels.append(self._levels[-1].finer)
                self._best.append(self._carried(level, self.fields).argmax(axis=1))
            points = points_of(self._levels[level], near, self._best[level] == k)
            if level < DIVISIONS and points.chord > self.tolerance:
                continue
            tolerance = self.tolerance + OF_CHORD * points.chord
            fit = fitted(points.uv, points.Q, points.inside, points.weight, tolerance, first, most)
            if not fit.starved:
                break
            first = fit.size
        return _charted(points, fit, tolerance)


def _charted(points: SkinPoints, fit: Fit, tolerance: float) -> SkinChart:
    lower, upper = fit.patch.only(3, 6), fit.patch.only(0, 3)
    mean = Patch(upper.u, upper.v, (upper.poles + lower.poles) / 2)
    return SkinChart(points.origin, points.axes, upper, lower, mean, tolerance, points.steepest, fit.off)
