"""What architects add to a solid: feet, holes, trimming, splitting for a print bed; `[[thickening.extra]]` in a preset.

All of it is boolean work of manifold3d; its result passes the same tests as every solid (see `judge`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats
from dsfab.errors import SolidError
from dsfab.surface.mesh import Surface
from dsfab.surface.pickers import STRICT, Picker, Real, Vector
from dsfab.surface.topology import edge_table, euler_characteristic, pieces
from dsfab.thickening.intersect import intersecting_pairs
from dsfab.thickening.solid import Solid, judge

if TYPE_CHECKING:
    import manifold3d

ROUND = 48
"""Sides of the prisms that stand for round holes and dowels; their area is 0.3 % under that of the circle."""

HALVINGS = 12
"""Steps towards the innermost point of a cut face."""

SPECK = 1e-6
"""Pieces under this share of the solid's volume are crumbs of the cutting, and left out."""


@dataclass(frozen=True)
class Feet:
    """`kind = "feet"`: a block under each part of the sheet that reaches the picked vertices, united with it.

    at : what stands on feet.    height : metres below the lowest picked vertex of a part.    margin : metres around it.
    sink : metres above that vertex: blocks must meet the sheet.    Blocks stand along z.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    at: Picker
    height: Real
    margin: Real
    sink: Real
    kind: Literal["feet"] = "feet"

    def applied(self, solid: "manifold3d.Manifold", base: "Base") -> "manifold3d.Manifold":
        _positive(self, "height", "margin", "sink")
        blocks = []
        for points in base.parts(self.at.vertices(base.surface)):
            low, high = points.min(axis=0) - self.margin, points.max(axis=0) + self.margin
            low[2], high[2] = points[:, 2].min() - self.height, points[:, 2].min() + self.sink
            blocks.append(_box(low, high))
        if not blocks:
            raise SolidError("thickening.extra 'feet': none of the picked vertices is on the sheet; set pattern.keep")
        standing = _united([solid, *blocks])
        if len(standing.decompose()) > len(solid.decompose()):
            raise SolidError("thickening.extra 'feet': a foot does not meet the solid; raise sink or margin")
        return standing


@dataclass(frozen=True)
class Holes:
    """`kind = "holes"`: round holes through the solid.

    at : points on the middle of the sheet, metres.    diameter : metres.    axis : direction of the drill.
    depth : metres, half of it on each side of the point; holes go no further, so that what lies behind stays whole.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    at: tuple[Vector, ...]
    diameter: Real
    depth: Real
    axis: Vector = (0.0, 0.0, 1.0)
    kind: Literal["holes"] = "holes"

    def applied(self, solid: "manifold3d.Manifold", base: "Base") -> "manifold3d.Manifold":
        _positive(self, "diameter", "depth")
        for number, point in enumerate(self.at, 1):
            drilled = solid - _drill(np.array(point), np.array(self.axis), self.diameter, self.depth)
            if drilled.volume() > solid.volume() * (1 - 1e-12):
                raise SolidError(
                    f"thickening.extra 'holes': point {number} of {len(self.at)} meets no material; the nearest is at "
                    f"{base.nearest(np.array(point))} m"
                )
            solid = drilled
        return solid


@dataclass(frozen=True)
class Trim:
    """`kind = "trim"`: cut off what lies beyond a plane, or outside of a box, or both.

    point, normal : of the plane; what lies where the normal points to is cut off.    low, high : corners of the box.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    point: Vector | None = None
    normal: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    kind: Literal["trim"] = "trim"

    def applied(self, solid: "manifold3d.Manifold", base: "Base") -> "manifold3d.Manifold":
        plane, box = (self.point, self.normal), (self.low, self.high)
        if (None in plane and any(plane)) or (None in box and any(box)) or not (any(plane) or any(box)):
            raise SolidError("thickening.extra 'trim' needs point and normal of a plane, or low and high of a box")
        if self.point is not None and self.normal is not None:
            normal = _unit(self.normal, "thickening.extra 'trim': normal")
            solid = solid.trim_by_plane((-normal).tolist(), float(-normal @ np.array(self.point)))
        if self.low is not None and self.high is not None:
            if not (np.array(self.low) < np.array(self.high)).all():
                raise SolidError("thickening.extra 'trim': low must be below high along x, y and z")
            solid = solid ^ _box(np.array(self.low), np.array(self.high))
        return solid


@dataclass(frozen=True)
class Split:
    """`kind = "split"`: cut the solid into parts that fit a machine, moved apart, with holes for dowels in the cuts.

    bed    : metres along x, y, z that a part may have; parts are equally large along each axis.
    apart  : metres between the parts.
    dowel, deep : diameter of the dowels, and how deep they sit in each part, metres; 0 drills none. A hole is drilled
             in every cut face, where it is widest, if that is twice as wide as the dowel at least.
    """

    __pydantic_config__: ClassVar[Any] = STRICT
    bed: Vector
    apart: Real
    dowel: Real = 0.0
    deep: Real = 0.0
    kind: Literal["split"] = "split"

    def applied(self, solid: "manifold3d.Manifold", base: "Base") -> "manifold3d.Manifold":
        _positive(self, "apart")
        if min(self.bed) <= 0 or self.dowel < 0 or (self.dowel > 0) != (self.deep > 0):
            raise SolidError("thickening.extra 'split' needs a bed of positive lengths; and dowel and deep, or neither")
        box = np.array(solid.bounding_box()).reshape(2, 3)
        levels = [self._levels(box[0, axis], box[1, axis], self.bed[axis]) for axis in range(3)]
        drills = [drill for axis in range(3) for drill in self._drills(solid, axis, levels)] if self.dowel else []
        solid = solid - _united(drills) if drills else solid
        for axis, inner in enumerate(levels):
            parts, normal = [], np.eye(3)[axis]
            for number, level in enumerate(inner[1:-1]):
                solid, below = solid.split_by_plane(normal.tolist(), float(level))
                parts.append(below.translate((number * self.apart * normal).tolist()))
            parts.append(solid.translate(((len(inner) - 2) * self.apart * normal).tolist()))
            solid = _united(parts)
        return solid

    def _levels(self, low: float, high: float, bed: float) -> Floats:
        """Ends and cuts along one axis."""
        count = int(np.ceil((high - low) / bed - 1e-9))
        return np.asarray(np.linspace(low, high, count + 1))

    def _drills(self, solid: "manifold3d.Manifold", axis: int, levels: list[Floats]) -> list["manifold3d.Manifold"]:
        """One for each part of a face cut square to an axis whose middle is as far inside as the dowel is thick."""
        turned = solid.rotate([[0, 90, 0], [90, 0, 0], [0, 0, 0]][axis])  # the axis, or its opposite, becomes z
        ups = [(2, 1), (0, 2), (0, 1)][axis]
        drills = []
        for level in levels[axis][1:-1]:
            face = turned.slice(-level if axis == 0 else level)
            for part in _cells(face, levels[ups[0]], -levels[ups[1]][::-1] if axis == 1 else levels[ups[1]]):
                if (spot := _innermost(part, self.dowel)) is not None:
                    u, v = spot
                    point = np.array([[level, v, u], [u, level, -v], [u, v, level]][axis])
                    drills.append(_drill(point, np.eye(3)[axis], self.dowel, 2 * self.deep))
        return drills


def _cells(face: "manifold3d.CrossSection", u: Floats, v: Floats) -> list["manifold3d.CrossSection"]:
    """The connected parts of a region in each cell of a grid with lines at u and at v."""
    import manifold3d

    found = []
    for low, high in pairwise(u):
        for bottom, top in pairwise(v):
            cell = manifold3d.CrossSection.square((high - low, top - bottom)).translate((low, bottom))
            found += (face ^ cell).decompose()
    return found


def _innermost(region: "manifold3d.CrossSection", margin: float) -> Floats | None:
    """A point about as far inside a region as can be, by halving; None where no point is `margin` from the border."""
    import manifold3d

    def inset(by: float) -> "manifold3d.CrossSection":
        return region.offset(-by, manifold3d.JoinType.Round)

    if inset(margin).is_empty():
        return None
    low, high = margin, float(np.sqrt(region.area()))
    for _ in range(HALVINGS):
        half = (low + high) / 2
        low, high = (low, half) if inset(half).is_empty() else (half, high)
    largest = max(inset(low).decompose(), key=lambda part: part.area())
    corners: Floats = np.concatenate([np.asarray(loop) for loop in largest.to_polygons()])
    middle = corners.mean(axis=0)
    dot = manifold3d.CrossSection.square((low / 9, low / 9), center=True).translate(middle.tolist())
    if not (inset(0.9 * low) ^ dot).is_empty():
        return np.asarray(middle)
    return np.asarray(corners[np.linalg.norm(corners - middle, axis=1).argmin()])  # of a bent strip


Extra = Feet | Holes | Trim | Split


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
        x, y, z = self.sheet.V[cKDTree(self.sheet.V).query(point)[1]]
        return f"({x:.4g}, {y:.4g}, {z:.4g})"


def with_extras(solid: Solid, extras: Sequence[Extra], base: Base) -> Solid:
    """The solid after each of the extras, in their order.

    Raises SolidError for an extra that does nothing or too much, and for a result that is not a solid; intersections
    that rounding leaves are counted in `notes`.
    """
    if not extras:
        return solid
    import manifold3d

    body = manifold3d.Manifold(manifold3d.Mesh64(np.array(solid.V), np.array(solid.F, dtype=np.uint64)))
    for extra in extras:
        body = extra.applied(body, base)
        if body.status() != manifold3d.Error.NoError or body.is_empty():
            raise SolidError(f"thickening.extra {extra.kind!r} leaves nothing of the solid; check its sizes and places")
    return _proven(body, solid)


def _proven(body: "manifold3d.Manifold", before: Solid) -> Solid:
    """The body as a judged solid, without crumbs."""
    import manifold3d

    whole = body.volume()
    parts = [part for part in body.decompose() if abs(part.volume()) > SPECK * whole]
    body = manifold3d.Manifold.compose(parts)
    mesh = body.to_mesh64()
    V, F = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    notes, repairs = list(before.notes), replace(before.repairs, pairs=0, pairs_at=None)
    if len(pairs := intersecting_pairs(V, F)):
        x, y, z = (float(c) for c in V[F[pairs[0]]].mean(axis=(0, 1)))
        repairs = replace(repairs, pairs=len(pairs), pairs_at=(x, y, z))
        notes.append(
            f"{len(pairs)} pairs of faces intersect after the extras, the first near ({x:.4g}, {y:.4g}, {z:.4g}) m; "
            "move the extra a little"
        )
    outer = sum(part.volume() > 0 for part in parts)
    result = Solid(V, F, len(parts) - euler_characteristic(F, edge_table(F)) // 2, outer, tuple(notes), repairs)
    judge(result)
    return result


def _positive(extra: Extra, *names: str) -> None:
    for name in names:
        if not getattr(extra, name) > 0:
            raise SolidError(f"thickening.extra {extra.kind!r}: {name} must be a positive length in metres")


def _unit(vector: Vector, whose: str) -> Floats:
    length = float(np.linalg.norm(vector))
    if not length > 0:
        raise SolidError(f"{whose} must have a length")
    return np.array(vector) / length


def _box(low: Floats, high: Floats) -> "manifold3d.Manifold":
    import manifold3d

    return manifold3d.Manifold.cube((high - low).tolist()).translate(low.tolist())


def _united(bodies: list["manifold3d.Manifold"]) -> "manifold3d.Manifold":
    import manifold3d

    return manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)


def _drill(point: Floats, axis: Floats, diameter: float, length: float) -> "manifold3d.Manifold":
    """A round prism of a length along an axis, its middle at a point."""
    import manifold3d

    z = _unit((float(axis[0]), float(axis[1]), float(axis[2])), "thickening.extra: axis")
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(z, x), z, point])
    rod = manifold3d.Manifold.cylinder(length, diameter / 2, circular_segments=ROUND, center=True)
    return rod.transform(frame.tolist())
