"""Bodies for extras of a solid, such as feet and holes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SolidError
from dsfab.surface.loads.pickers import Vector
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import edge_table, pieces

if TYPE_CHECKING:
    import manifold3d


@dataclass(frozen=True, eq=False)
class Base:
    """A surface, and the sheet that was cut from this surface.
    between : function that turns marks (n,) of the surface's vertices into marks (n',) of the sheet's vertices."""

    surface: Surface
    sheet: Surface
    between: Callable[[Bools], Bools]

    def parts(self, marks: Bools) -> list[Floats]:
        """Return the sheet's marked vertices in groups: points (k, 3), metres. Faces connect the vertices of a group.
        marks : (n,) mask of the surface's vertices."""
        marked = self.between(marks)
        touching = marked[self.sheet.F].any(axis=1)
        if not touching.any():
            return []
        F = self.sheet.F[touching]
        count, label = pieces(F, edge_table(F))
        points = []
        for k in range(count):
            vertices = np.unique(F[label == k])
            points.append(self.sheet.V[vertices[marked[vertices]]])
        return points

    def nearest(self, point: Floats) -> str:
        """Return the coordinates of the sheet's vertex nearest to a point (3,), metres, as text."""
        x, y, z = self.sheet.V[cKDTree(self.sheet.V).query(point)[1]]
        return f"({x:.4g}, {y:.4g}, {z:.4g})"


ROUND = 48  # Number of sides of the prisms for round holes and dowels.


def positive(extra: object, *names: str) -> None:
    """Raise SolidError if an attribute of an extra (foot, hole, ...) is not positive. names : names of attributes."""
    for name in names:
        if not getattr(extra, name) > 0:
            raise SolidError(f"thickening.extra {getattr(extra, 'kind', '')!r}: {name} must be a positive length")


def unit(vector: Vector, whose: str) -> Floats:
    """Return the vector (3,) scaled to length 1. Raises SolidError if the vector is zero."""
    length = float(np.linalg.norm(vector))
    if not length > 0:
        raise SolidError(f"{whose} is a zero vector; give a direction with a length above 0")
    return np.array(vector) / length


def box(low: Floats, high: Floats) -> "manifold3d.Manifold":
    """Return the box between its lowest and its highest corner (3,)."""
    import manifold3d

    return manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())


def united_bodies(bodies: list["manifold3d.Manifold"]) -> "manifold3d.Manifold":
    import manifold3d

    return manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)


def drill(point: Floats, axis: Floats, diameter: float, length: float) -> "manifold3d.Manifold":
    """Return the cylinder that a drill removes. point : (3,) centre, metres. diameter, length : metres."""
    import manifold3d

    z = unit((float(axis[0]), float(axis[1]), float(axis[2])), "thickening.extra: axis")
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z, point])
    rod = manifold3d.Manifold.cylinder(length, diameter / 2, circular_segments=ROUND, center=True)
    return rod.transform(frame.tolist())
