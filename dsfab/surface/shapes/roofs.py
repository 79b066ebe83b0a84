"""Roof shapes."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import ROW, Length, check_density, pieces_of, shape, staggered_rows


@shape
def plate(length: Length = 6.0, width: Length = 4.0, edge: Length = 0.12) -> Surface:
    """A flat rectangle: length along x, width along y, centred on the origin at z = 0."""
    check_density(length * width, edge)
    uv, F = staggered_rows(pieces_of(length, edge), pieces_of(width, ROW * edge, multiple=2, least=2))
    x, y = (uv - 0.5).T * [[length], [width]]
    return Surface(np.stack([x, y, 0 * x], axis=1), F)


@shape
def barrel_vault(length: Length = 10.0, span: Length = 8.0, rise: Length = 2.5, edge: Length = 0.22) -> Surface:
    """A vault of circular section: length along x, span along y, lower edges at z = 0, height `rise`."""
    radius = (span**2 / 4 + rise**2) / (2 * rise)
    half = np.arctan2(span / 2, radius - rise)
    check_density(2 * half * radius * length, edge)
    uv, F = staggered_rows(pieces_of(length, edge), pieces_of(2 * half * radius, ROW * edge, multiple=2, least=4))
    angle = (2 * uv[:, 1] - 1) * half
    V = np.stack([(uv[:, 0] - 0.5) * length, radius * np.sin(angle), radius * np.cos(angle) + rise - radius], axis=1)
    V[uv[:, 1] % 1 == 0, 2] = 0.0
    return Surface(V, F)


@shape
def hypar(side: Length = 8.0, rise: Length = 3.0, edge: Length = 0.22) -> Surface:
    """A hyperbolic paraboloid over a square: two opposite corners at z = 0, two corners at z = rise."""
    if rise > 4 * side:
        raise SurfaceError(f"hypar: rise = {rise:g} m is more than four times the side of {side:g} m; use a lower rise")
    check_density(side**2 * (1 + rise / side), edge)
    uv, F = staggered_rows(pieces_of(side, edge, least=2), pieces_of(side, ROW * edge, multiple=2, least=2))
    x, y = (uv - 0.5).T * side
    return Surface(np.stack([x, y, rise * (0.5 + 2 * x * y / side**2)], axis=1), F)


@shape
def elliptic_paraboloid(
    length: Length = 12.0, width: Length = 8.0, rise: Length = 1.6, crown: Length = 0.8, edge: Length = 0.22
) -> Surface:
    """A parabola moved along a second parabola: length along x, width along y, corners at z = 0.
    rise : height of the middle.    edge : edge length at the middle.    crown : height of the long sides' middles."""
    if crown >= rise:
        raise SurfaceError(
            f"elliptic_paraboloid: crown = {crown:g} m, height of the long sides, must be less than rise = {rise:g} m"
        )
    if rise > 4 * min(length, width):
        raise SurfaceError(
            f"elliptic_paraboloid: rise = {rise:g} m is more than four times the shorter side of "
            f"{min(length, width):g} m; use a lower rise"
        )
    check_density(length * width * (1 + rise / min(length, width)), edge)
    uv, F = staggered_rows(pieces_of(length, edge, least=2), pieces_of(width, ROW * edge, multiple=2, least=2))
    u, v = (2 * uv - 1).T
    z = rise - crown * u**2 - (rise - crown) * v**2
    return Surface(np.stack([u * length / 2, v * width / 2, np.where(np.abs(u * v) == 1, 0.0, z)], axis=1), F)


def mesh_region(rim: Floats, inside: Callable[[Floats, float], Bools], edge: float) -> tuple[Floats, Ints]:
    """Mesh a region of the plane. Return vertices (n, 2), first the points `rim`, and counter-clockwise faces (m, 3).
    rim    : (k, 2) points along the boundary of the region, about `edge` apart.
    inside : function of points (q, 2) and a distance; marks points at least this far inside the boundary."""
    from scipy.spatial import Delaunay  # imported here, because the import takes a tenth of a second

    reach = int(np.ceil(2 * np.abs(rim).max() / edge)) + 2
    i, j = (x.ravel() for x in np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)))
    lattice = edge * np.stack([i + j / 2, j * np.sqrt(3) / 2], axis=1)
    P = np.concatenate([rim, lattice[inside(lattice, 0.6 * edge)]])  # points nearer the rim would form flat triangles
    F = Delaunay(P).simplices.astype(np.int64)
    u, v = P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]]
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    F = np.where((twice < 0)[:, None], F[:, ::-1], F)
    # Delaunay triangles fill the convex hull; some are very flat
    return P, np.asarray(F[inside(P[F].mean(axis=1), 0.0) & (np.abs(twice) > 1e-3 * edge**2)])


@shape
def pavilion(
    span: Length = 14.0,
    rise: Length = 4.5,
    opening: Length = 2.8,
    feet: Annotated[int, Ge(3), Le(8)] = 4,
    foot: Length = 1.6,
    edge: Length = 0.28,
) -> Surface:
    """A spherical shell on feet, with an arch between neighbouring feet.
    span : diameter of the circle through the feet, at z = 0.    rise : height of the crown.
    opening : height of the middle of each arch.    foot : width of each foot along the circle."""
    _check(span, rise, opening, feet, foot)
    radius = (span**2 / 4 + rise**2) / (2 * rise)
    check_density(2 * np.pi * radius * rise, edge)
    half = np.pi / feet
    ground, top = (2 * radius * np.tan(np.arccos(1 - h / radius) / 2) for h in (rise, rise - opening))
    flat = edge * np.sqrt(1 + (ground / (2 * radius)) ** 2)
    wedge = _Wedge(half, foot / span, float(ground), float(top), float(flat))
    rim, axis, seam = wedge.rim()
    plane, F = _all_feet(*mesh_region(rim, wedge.inside, wedge.edge), axis, seam, feet)
    # stereographic map from the sphere's bottom: rho = 2 R tan(theta / 2)
    t = (plane**2).sum(axis=1) / (4 * radius**2)
    V = np.column_stack([plane / (1 + t)[:, None], rise - 2 * radius * t / (1 + t)])
    V[np.abs(V[:, 2]) < 1e-9 * span, 2] = 0.0
    return Surface(V, F)


def _check(span: float, rise: float, opening: float, feet: int, foot: float) -> None:
    if rise > span / 2:
        raise SurfaceError(f"pavilion: rise = {rise:g} m must be at most half the span of {span:g} m")
    if opening > 0.9 * rise:
        raise SurfaceError(f"pavilion: opening = {opening:g} m must be at most 0.9 x rise = {0.9 * rise:g} m")
    widest = 0.6 * np.pi * span / feet
    if foot > widest:
        raise SurfaceError(f"pavilion: foot = {foot:g} m closes the openings; use at most {widest:.3g} m")


class _Wedge:
    """Half a foot and half an arch of a shell in the stereographic plane: a sector of the angle `half` (radians).
                  x top      crown: top of the shell; top: middle of the arch; ground: middle of the foot.
              /    \\        The arch is a circular arc; if it bends inward, its centre is outside the shell.
    crown x----------x ground"""

    def __init__(self, half: float, half_foot: float, ground: float, top: float, edge: float) -> None:
        self.half, self.half_foot, self.ground, self.edge = half, half_foot, ground, edge
        # the circle of the arch goes through the top of the arch and the ends of two feet
        across, along = ground * np.sin(half - half_foot), ground * np.cos(half - half_foot)
        dip = along - top
        if abs(dip) < 1e-3 * ground:  # curve a nearly straight arch a little, to keep its radius finite
            dip, top = 1e-3 * ground, along - 1e-3 * ground
        self.radius = (across**2 + dip**2) / (2 * abs(dip))
        self.bend = np.sign(dip)
        self.top, self.to_centre = top, top + self.bend * self.radius
        self.centre = self.to_centre * np.array([np.cos(half), np.sin(half)])

    def rim(self) -> tuple[Floats, Ints, Ints]:
        """Return the outline (k, 2), and the indices of the points on each of the two straight sides."""
        ray = np.linspace(0, self.ground, 1 + self._count(self.ground))
        back = np.linspace(self.top, 0, 1 + self._count(self.top))[1:-1]
        foot = np.linspace(0, self.half_foot, 1 + self._count(self.ground * self.half_foot))[1:]
        corner = self.ground * np.array([np.cos(self.half_foot), np.sin(self.half_foot)])
        start = np.arctan2(*(corner - self.centre)[::-1])
        stop = np.arctan2(*(-self.bend * self.centre / self.to_centre)[::-1])
        sweep = (stop - start + np.pi) % (2 * np.pi) - np.pi
        turn = start + np.linspace(0, sweep, 1 + self._count(abs(sweep) * self.radius))[1:]
        arch, seam_points = self.centre + self.radius * _unit(turn), back[:, None] * _unit(np.array([self.half]))
        points = np.concatenate([ray[:, None] * [1.0, 0.0], self.ground * _unit(foot), arch, seam_points])
        axis, seam = np.arange(len(ray)), np.arange(len(points) - len(back) - 1, len(points))
        return points, axis, np.concatenate([[0], seam])

    def _count(self, length: float) -> int:
        return max(1, round(length / self.edge))

    def inside(self, P: Floats, depth: float) -> Bools:
        x, y = P.T
        from_arch = self.bend * (np.linalg.norm(P - self.centre, axis=1) - self.radius)
        room = [y, x * np.sin(self.half) - y * np.cos(self.half), self.ground - np.hypot(x, y), from_arch]
        return np.asarray(np.min(room, axis=0) >= depth)


def _unit(angle: Floats) -> Floats:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _all_feet(P: Floats, F: Ints, axis: Ints, seam: Ints, feet: int) -> tuple[Floats, Ints]:
    n = len(P)
    names = np.arange(2 * feet * n).reshape(feet, 2, n)
    names[:, 1, axis] = names[:, 0, axis]
    names[:, 1, seam] = np.roll(names[:, 0, seam], 1, axis=0)
    names[:, :, 0] = 0
    turn = 2 * np.pi * np.arange(feet) / feet
    c, s = np.cos(turn)[:, None, None], np.sin(turn)[:, None, None]
    x, y = P[:, 0], np.stack([P[:, 1], -P[:, 1]])
    every = np.stack([c * x - s * y, s * x + c * y], axis=-1).reshape(-1, 2)
    faces = np.concatenate([names[k, side][F if side == 0 else F[:, ::-1]] for k in range(feet) for side in (0, 1)])
    used, faces = np.unique(faces, return_inverse=True)
    return every[used], faces.reshape(-1, 3)
