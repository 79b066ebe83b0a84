"""How far a smooth solid may be off the mesh: what is asked for, and what the mesh itself does not know."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.dense import chord_errors, dense, excess
from dsfab.export.smooth.source import Curved
from dsfab.limits import OFF_SURFACE
from dsfab.surface.mesh import Surface
from dsfab.units import MM_PER_M

MOST_CHORD = 1 / 4
"""No more of the mesh's own chord error counts, as a share of the thickness: at creases it is no such thing."""

COARSE = 2
"""Times the usual chord error from which the largest is told, too."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Millimetres: the thickness, and how far the smooth solid may be off the mesh beside the mesh's own chord error.

    V, F    : (n, 3) and (m, 3) both skins of the uncut surface.
    chord   : (m,) the chord error of their triangles.
    rounder : (m,) by what share the volume over them may be larger, since the mesh cuts its curves short.
    """

    thickness: float
    distance: float
    V: Floats
    F: Ints
    chord: Floats
    rounder: Floats

    @cached_property
    def usual(self) -> float:
        """The chord error that nine of ten triangles stay under."""
        return float(np.percentile(self.chord, 90))

    @property
    def told(self) -> str:
        """What is allowed, as part of a sentence: where triangles are coarse, or at creases, it is far more."""
        most = float(self.chord.max())
        some = f"usually under {self.usual:.2g} mm" if self.usual > 0 else "usually none"
        more = f", {most:.2g} mm where it is coarsest" if most > COARSE * self.usual and most > self.distance else ""
        return f"allowed are {self.distance:.2g} mm and the mesh's own chord error, {some}{more}"

    def allowed(self, points: Floats) -> Floats:
        """(k,) how far points may be off: the chord error of the triangle where they are counts.

        That of a vertex beside them does not say it: where triangles are long, no corner of theirs may be the nearest.
        """
        return np.asarray(self.distance + self.chord[self.nearest(points)])

    def nearest(self, points: Floats) -> Ints:
        """(k,) the triangles nearest to points."""
        return np.asarray(self._tree.squared_distance(self.V, self.F, points)[1])

    @cached_property
    def _tree(self) -> igl.AABB:
        """Of the triangles: it takes as long as asking it about as many points."""
        tree = igl.AABB()
        tree.init(self.V, self.F)
        return tree


def smooth_limits(surface: Surface, curved: Curved, tolerance: float = 0.0) -> Limits:
    """For a solid cut from a surface; tolerance : millimetres that were asked for, `OFF_SURFACE` if 0.

    What a build makes smooth solids within, and what `dsfab check` accepts of their files.
    """
    mesh = dense(surface, curved)
    t = 2 * MM_PER_M * float(np.median(np.linalg.norm(curved.D, axis=1)))
    chord = np.minimum(MM_PER_M * chord_errors(mesh), MOST_CHORD * t)
    V = np.concatenate([mesh.middle + mesh.across, mesh.middle - mesh.across])
    F = np.concatenate([surface.F, surface.F + surface.n])
    return Limits(t, tolerance or OFF_SURFACE * t, V, F, np.tile(chord, 2), np.tile(excess(mesh, curved), 2))
