"""Holes, trimming by a plane or a box, and splitting into parts that fit a machine."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import SolidError
from dsfab.surface.loads.pickers import STRICT, Real, Vector
from dsfab.thickening.extras.bodies import Base, box, drill, positive, unit, united_bodies

if TYPE_CHECKING:
    import manifold3d


@dataclass(frozen=True)
class Holes:
    """`kind = "holes"`: round holes in the solid, parallel to `axis`.
    at : middle of each hole, a point on the sheet, metres.    diameter : diameter of the holes, metres.
    depth    : length of each hole, metres; half on each side of the point."""

    __pydantic_config__: ClassVar[Any] = STRICT
    at: tuple[Vector, ...]
    diameter: Real
    depth: Real
    axis: Vector = (0.0, 0.0, 1.0)
    kind: Literal["holes"] = "holes"

    def apply(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """Return the solid with holes. Raises SolidError for a hole that meets no material."""
        positive(self, "diameter", "depth")
        for number, point in enumerate(self.at, 1):
            drilled = solid - drill(np.array(point), np.array(self.axis), self.diameter, self.depth)
            if drilled.volume() > solid.volume() * (1 - 1e-12):
                raise SolidError(
                    f"thickening.extra 'holes': point {number} of {len(self.at)} is not on material; the nearest "
                    f"material is at {base.nearest(np.array(point))} m"
                )
            solid = drilled
        return solid


@dataclass(frozen=True)
class Trim:
    """`kind = "trim"`: cut off the material beyond a plane and outside a box. Plane or box may be missing.
    point, normal : point (metres) and normal of the plane; material on the side of the normal is cut off.
    low, high     : opposite corners of the box, metres."""

    __pydantic_config__: ClassVar[Any] = STRICT
    point: Vector | None = None
    normal: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    kind: Literal["trim"] = "trim"

    def apply(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """Return the part of the solid behind the plane and inside the box. Raises SolidError for missing values."""
        plane, corners = (self.point, self.normal), (self.low, self.high)
        if (None in plane and any(plane)) or (None in corners and any(corners)) or not (any(plane) or any(corners)):
            raise SolidError(
                "thickening.extra 'trim' needs the keys point and normal of a plane, or low and high of a box"
            )
        if self.point is not None and self.normal is not None:
            normal = unit(self.normal, "thickening.extra 'trim': normal")
            solid = solid.trim_by_plane((-normal).tolist(), float(-normal @ np.array(self.point)))
        if self.low is not None and self.high is not None:
            if not (np.array(self.low) < np.array(self.high)).all():
                raise SolidError("thickening.extra 'trim': low must be below high along x, y and z")
            solid = solid ^ box(np.array(self.low), np.array(self.high))
        return solid


@dataclass(frozen=True)
class SplitBodies:
    """`kind = "split"`: cut the solid into parts that fit a machine, and move the parts apart.
    bed : largest size of a part along x, y, z, metres.    apart : gap between parts after the move, metres.
    dowel : diameter of dowel holes in cut faces, metres; 0 for none.    deep : depth of a dowel hole, metres."""

    __pydantic_config__: ClassVar[Any] = STRICT
    bed: Vector
    apart: Real
    dowel: Real = 0.0
    deep: Real = 0.0
    kind: Literal["split"] = "split"

    def apply(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """Return the solid in parts that are at most as large as `bed`. Raises SolidError for invalid options."""
        positive(self, "apart")
        if min(self.bed) <= 0 or self.dowel < 0 or (self.dowel > 0) != (self.deep > 0):
            raise SolidError(
                "thickening.extra 'split': set bed to positive lengths; set both dowel and deep, or neither"
            )
        ends = np.array(solid.bounding_box()).reshape(2, 3)
        levels = [self._levels(ends[0, axis], ends[1, axis], self.bed[axis]) for axis in range(3)]
        drills = [drill for axis in range(3) for drill in self._drills(solid, axis, levels)] if self.dowel else []
        solid = solid - united_bodies(drills) if drills else solid
        for axis, inner in enumerate(levels):
            parts, normal = [], np.eye(3)[axis]
            for number, level in enumerate(inner[1:-1]):
                solid, below = solid.split_by_plane(normal.tolist(), float(level))
                parts.append(below.translate((number * self.apart * normal).tolist()))
            parts.append(solid.translate(((len(inner) - 2) * self.apart * normal).tolist()))
            solid = united_bodies(parts)
        return solid

    def _levels(self, low: float, high: float, bed: float) -> Floats:
        return np.asarray(np.linspace(low, high, int(np.ceil((high - low) / bed - 1e-9)) + 1))

    def _drills(self, solid: "manifold3d.Manifold", axis: int, levels: list[Floats]) -> list["manifold3d.Manifold"]:
        turned = solid.rotate([[0, 90, 0], [90, 0, 0], [0, 0, 0]][axis])  # the axis is now parallel to z
        ups = [(2, 1), (0, 2), (0, 1)][axis]
        drills = []
        for level in levels[axis][1:-1]:
            face = turned.slice(-level if axis == 0 else level)
            for part in _cells(face, levels[ups[0]], -levels[ups[1]][::-1] if axis == 1 else levels[ups[1]]):
                if (spot := _innermost(part, self.dowel)) is not None:
                    u, v = spot
                    point = np.array([[level, v, u], [u, level, -v], [u, v, level]][axis])
                    drills.append(drill(point, np.eye(3)[axis], self.dowel, 2 * self.deep))
        return drills


def _cells(face: "manifold3d.CrossSection", u: Floats, v: Floats) -> list["manifold3d.CrossSection"]:
    import manifold3d

    regions = []
    for low, high in pairwise(u):
        for bottom, top in pairwise(v):
            cell = manifold3d.CrossSection.square((high - low, top - bottom)).translate((low, bottom))
            regions += (face ^ cell).decompose()
    return regions


def _innermost(region: "manifold3d.CrossSection", margin: float) -> Floats | None:
    import manifold3d

    def inset(by: float) -> "manifold3d.CrossSection":
        return region.offset(-by, manifold3d.JoinType.Round)

    if inset(margin).is_empty():
        return None
    low, high = margin, float(np.sqrt(region.area()))
    for _ in range(12):
        half = (low + high) / 2
        low, high = (low, half) if inset(half).is_empty() else (half, high)
    largest = max(inset(low).decompose(), key=lambda part: part.area())
    corners: Floats = np.concatenate([np.asarray(loop) for loop in largest.to_polygons()])
    middle = corners.mean(axis=0)
    dot = manifold3d.CrossSection.square((low / 9, low / 9), center=True).translate(middle.tolist())
    if not (inset(0.9 * low) ^ dot).is_empty():
        return np.asarray(middle)
    # the middle of a bent strip may be outside of the strip
    return np.asarray(corners[np.linalg.norm(corners - middle, axis=1).argmin()])
