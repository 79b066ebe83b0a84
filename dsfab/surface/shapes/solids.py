"""Solids as functions that are negative inside, their smooth unions, and even triangles on where they vanish."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import igl
import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import check_density
from dsfab.surface.shapes.remeshing import remeshed

Field = Callable[[Floats], Floats]
"""Takes points (q, 3), metres; gives about the distance to a solid (q,), metres, negative inside."""

Point = Sequence[float] | Floats

GRID = 1.3
"""Cells of the grid over the edge length: coarser ones lose details, finer ones are collapsed again."""

SHRINK = 0.9
"""Remeshing for an edge length gives a mean edge this much longer."""


def _norm(Q: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("qa,qa->q", Q, Q)))


def ball(centre: Point, radius: float) -> Field:
    """A ball: a field of P (k, 3), metres, its signed distance (k,)."""
    c = np.array(centre)
    return lambda P: _norm(P - c) - radius


def ellipsoid(centre: Point, radii: Point, axes: Floats | None = None) -> Field:
    """axes : (3, 3) unit vectors of the radii, a row each; x, y and z when left out. First order in the distance."""
    c, r, R = np.array(centre), np.array(radii), np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = (P - c) @ (R.T / r)
        k, slope = _norm(Q), _norm(Q / r)
        return np.asarray(k * (k - 1) / np.maximum(slope, 1e-12))

    return field


def limb(points: Sequence[Point], radii: Sequence[float], soft: float = 0.3) -> Field:
    """A tube along a polygon whose radius runs linearly from corner to corner, with round ends.

    soft : the width over which its joints are filled, as a share of the smallest radius.
    """
    parts = [_cone(*ends) for ends in zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)]
    return blended(parts, soft * min(radii)) if len(parts) > 1 else parts[0]


def _cone(a: Point, b: Point, at_a: float, at_b: float) -> Field:
    start, along = np.array(a), np.array(b) - np.array(a)
    square = float(along @ along)

    def field(P: Floats) -> Floats:
        Q = P - start
        forward = Q @ along
        t = np.clip(forward / square, 0, 1)
        away = np.einsum("qa,qa->q", Q, Q) + t * (t * square - 2 * forward)
        return np.asarray(np.sqrt(np.maximum(away, 0)) - at_a - t * (at_b - at_a))

    return field


def box(centre: Point, halves: Point, rounding: float, axes: Floats | None = None) -> Field:
    """A box, rounded: a field of P (k, 3), metres.

    halves : half of each side, metres, with the rounding of all edges in it.    axes : (3, 3) along its sides, in
    rows.
    """
    c, h, R = np.array(centre), np.array(halves) - rounding, np.eye(3) if axes is None else axes

    def field(P: Floats) -> Floats:
        Q = np.abs((P - c) @ R.T) - h
        return np.asarray(_norm(np.maximum(Q, 0)) + np.minimum(Q.max(axis=1), 0) - rounding)

    return field


def smaller(a: Floats, b: Floats, k: float) -> Floats:
    """(k,) the smaller value, rounded off where they differ by less than k [polynomial smooth minimum, Quilez 2013]."""
    return np.asarray(np.minimum(a, b) - np.maximum(k - np.abs(a - b), 0) ** 2 / (4 * k))


def blended(fields: Sequence[Field], k: float) -> Field:
    """The union, its inner corners filled over a width of about k metres."""

    def field(P: Floats) -> Floats:
        value = fields[0](P)
        for other in fields[1:]:
            value = smaller(value, other(P), k)
        return value

    return field


def without(field: Field, cut: Field, k: float) -> Field:
    """The part of a solid outside of another, the edge of the cut rounded by about k metres."""
    return lambda P: -smaller(-field(P), cut(P), k)


def mirrored(field: Field, axis: int = 1) -> Field:
    """The union of a solid on the positive side of an axis with its mirror image."""

    def both(P: Floats) -> Floats:
        Q = P.copy()
        Q[:, axis] = np.abs(Q[:, axis])
        return field(Q)

    return both


@dataclass(frozen=True)
class LevelSet:
    """Where a field vanishes, as a chart: coordinates are the points themselves. The border lies at z = floor."""

    field: Field
    reach: float
    """Metres: no point is moved further at a time than half of this."""
    floor: float | None = None

    def place(self, X: Floats) -> Floats:
        """X (n, 3) itself, metres."""
        return X

    def moved(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """(n, 3) X + step after two of Newton's steps along the gradient, which is found once; those of the border
        (n,) stay on the floor."""
        P = X + step
        down = border & (self.floor is not None)
        if self.floor is not None:
            P[:, 2] = np.where(down, self.floor, np.maximum(P[:, 2], self.floor + 0.1 * self.reach))
        small = 1e-4 * self.reach
        value = self.field(P)
        slope = np.stack([(self.field(P + small * e) - value) / small for e in np.eye(3)], axis=1)
        slope[down, 2] = 0
        square = np.maximum(np.einsum("na,na->n", slope, slope), 1e-2)[:, None]
        most = 0.5 * self.reach * np.sqrt(square[:, 0])
        P -= np.clip(value, -most, most)[:, None] * slope / square
        return np.asarray(P - np.clip(self.field(P), -most, most)[:, None] * slope / square)


def skin(field: Field, low: Point, high: Point, edge: float, floor: float | None = None) -> Surface:
    """The surface on which a field vanishes, in even triangles about `edge` metres wide, normals outward.

    low, high : corners of a box around the solid, metres.
    floor     : the solid is cut at this height, and its surface open there, with the boundary in the plane.

    Raises SurfaceError for an edge so long that details are lost, or so short that the mesh would be endless.
    """
    bottom, top = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    if floor is not None:
        bottom[2] = floor
    x, y, z = size = top - bottom
    check_density(2 * float(x * y + y * z + z * x), edge)
    cells = np.maximum(np.ceil(size / (GRID * edge)), 4).astype(int)
    nodes = [np.linspace(a, b, n + 1) for a, b, n in zip(bottom, top, cells, strict=True)]
    z, y, x = np.meshgrid(nodes[2], nodes[1], nodes[0], indexing="ij")
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    value = field(grid)
    # a node on the surface itself would make triangles without area
    value = np.where(np.abs(value) < 1e-3 * edge, 1e-3 * edge, value)
    V, F, _ = igl.marching_cubes(value, grid, *(len(n) for n in nodes), 0.0)
    if Surface(V, F).volume < 0:
        F = F[:, ::-1]
    V, F = remeshed(LevelSet(field, edge, floor), V, F, SHRINK * edge)
    return Surface(V, F)
