"""Feet under a solid, and ring beams along the boundary of the surface."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SolidError
from dsfab.surface import Picker
from dsfab.surface.loads.pickers import STRICT, Real
from dsfab.surface.mesh import Surface
from dsfab.thickening.extras.bodies import Base, box, positive, united_bodies
from dsfab.thickening.self_intersection import intersecting_pairs

if TYPE_CHECKING:
    import manifold3d


@dataclass(frozen=True)
class Feet:
    """`kind = "feet"`: a block (box) under each group of neighbouring picked vertices, united with the solid.
    at     : picker of the vertices that stand on feet.
    height : distance from the lowest picked vertex down to the bottom of the block (along z), metres.
    margin : distance by which the block extends beyond the picked vertices in x and y, metres.
    sink   : distance from the lowest picked vertex up to the top of the block, metres."""

    __pydantic_config__: ClassVar[Any] = STRICT
    at: Picker
    height: Real
    margin: Real
    sink: Real
    kind: Literal["feet"] = "feet"

    def apply(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """Return the solid with its feet. Raises SolidError if no vertex picked by `at` is on the sheet."""
        positive(self, "height", "margin", "sink")
        blocks = []
        for points in base.parts(self.at.vertices(base.surface)):
            low, high = points.min(axis=0) - self.margin, points.max(axis=0) + self.margin
            low[2], high[2] = points[:, 2].min() - self.height, points[:, 2].min() + self.sink
            blocks.append(box(low, high))
        if not blocks:
            raise SolidError(
                "thickening.extra 'feet': no picked vertex is on the cut sheet; keep material there by pattern.keep"
            )
        standing = united_bodies([solid, *blocks])
        if len(standing.decompose()) > len(solid.decompose()):
            raise SolidError("thickening.extra 'feet': a foot does not touch the solid; increase sink or margin")
        return standing


STRAIGHT = 1e-9  # A loop is straight at a vertex if its unit direction and unit normal change by less than this.


@dataclass(frozen=True)
class Ring:
    """`kind = "ring"`: a beam along boundary loops of the uncut surface, united with the solid.
    width : size of the beam along the surface, metres.    height : size of the beam normal to the surface, metres.
    at     : picker of vertices. Each loop with a picked vertex gets a beam; by default, all loops get beams."""

    __pydantic_config__: ClassVar[Any] = STRICT
    width: Real
    height: Real
    at: Picker | None = None
    kind: Literal["ring"] = "ring"

    def apply(self, solid: "manifold3d.Manifold", base: Base) -> "manifold3d.Manifold":
        """Return the solid with its beams. Raises SolidError if `at` picks no loop, or a beam misses the solid."""
        positive(self, "width", "height")
        marks = np.ones(base.surface.n, dtype=bool) if self.at is None else self.at.vertices(base.surface)
        loops = [loop for loop in base.surface.loops if marks[loop].any()]
        if not loops:
            raise SolidError("thickening.extra 'ring': no boundary loop has a picked vertex; check the key 'at'")
        beams = [_beam(base.surface, loop, self.width, self.height) for loop in loops]
        united = united_bodies([solid, *beams])
        if len(united.decompose()) > len(solid.decompose()):
            raise SolidError(
                "thickening.extra 'ring': a beam does not touch the solid; increase its width or pattern.rim, or pick "
                "other loops"
            )
        return united


def _beam(surface: Surface, loop: Ints, width: float, height: float) -> "manifold3d.Manifold":
    import manifold3d

    V, F = closed_bar(*bend_points(surface, loop), width, height)
    beam = manifold3d.Manifold(manifold3d.Mesh64(V, F.astype(np.uint64)))
    pairs = intersecting_pairs(V, F)
    if len(pairs) or beam.status() != manifold3d.Error.NoError or beam.volume() <= 0:
        x, y, z = V[F[pairs[0]]].mean(axis=(0, 1)) if len(pairs) else V.mean(axis=0)
        raise SolidError(
            f"thickening.extra 'ring': a beam {width:.4g} x {height:.4g} m would cross itself near "
            f"({x:.4g}, {y:.4g}, {z:.4g}) m, at a bend of the boundary; reduce the beam's width, or smooth the boundary"
        )
    return beam


def bend_points(surface: Surface, loop: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the bends of a boundary loop: points (k, 3), metres, unit directions (k, 3) and unit normals (k, 3).
    Directions and normals belong to the straight segments that start at the bends.
    The cross product normal x direction points into the surface."""
    V, edges = surface.V, surface.edges
    ends = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
    edge = np.searchsorted(edges.ends @ [surface.n, 1], ends @ [surface.n, 1])
    h = edges.order[edges.start[edge]]
    third = surface.F[h // 3, (h % 3 + 2) % 3]
    P = V[loop]
    along = np.roll(P, -1, axis=0) - P
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.cross(along, V[third] - P)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    change = [np.linalg.norm(x - np.roll(x, 1, axis=0), axis=1) for x in (along, normal)]
    bends = np.maximum(*change) > STRAIGHT
    return P[bends], along[bends], normal[bends]


def closed_bar(P: Floats, along: Floats, normal: Floats, width: float, height: float) -> tuple[Floats, Ints]:
    """Return the mesh of a rectangular bar along a closed polyline: vertices (4 k, 3), m, outward faces (8 k, 3).
    P : (k, 3) corners of the polyline, metres.    height : size along the normals, metres.
    along, normal : (k, 3) unit directions and unit normals of the segments that start at these corners."""
    before = np.roll(along, 1, axis=0)
    sharpest = 0.2  # smallest cosine of half the bend angle; a mitre is then five bar widths long
    middle = before + along
    cosine = np.maximum(np.linalg.norm(middle, axis=1) / 2, sharpest)
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), sharpest)
    up = normal + np.roll(normal, 1, axis=0)
    up -= np.einsum("ki,ki->k", up, middle)[:, None] * middle
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    across = np.cross(up, middle)
    bend = along - before
    size = np.linalg.norm(bend, axis=1, keepdims=True)
    bend = np.divide(bend, size, out=np.zeros_like(bend), where=size > STRAIGHT)
    corners = []
    for y, z in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        offset = y * width / 2 * across + z * height / 2 * up
        stretch = (1 / cosine - 1) * np.einsum("ki,ki->k", offset, bend)
        corners.append(P + offset + stretch[:, None] * bend)
    V = np.stack(corners, axis=1).reshape(-1, 3)
    index = 4 * np.arange(len(P))[:, None] + np.arange(4)
    a, b = index.ravel(), np.roll(index, -1, axis=1).ravel()
    c, d = np.roll(index, -1, axis=0).ravel(), np.roll(np.roll(index, -1, axis=0), -1, axis=1).ravel()
    return V, np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
