"""Round shapes."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import ROW, Length, check_density, pieces_of, ring_faces, ring_turns, shape


@shape
def cylinder(radius: Length = 2.0, height: Length = 6.0, edge: Length = 0.2) -> Surface:
    """An open tube around the z axis, standing on z = 0, normals outward. Area 2 pi radius height."""
    check_density(2 * np.pi * radius * height, edge)
    z = np.linspace(0, height, 1 + pieces_of(height, ROW * edge, multiple=2, least=2))
    return surface_of_revolution(np.full(len(z), radius), z, edge, outward=True)


@shape
def dome(span: Length = 10.0, rise: Length = 3.0, oculus: Annotated[float, Ge(0)] = 0.0, edge: Length = 0.2) -> Surface:
    """A spherical cap. span : diameter at z = 0. rise : height of the crown.
    oculus : radius of a round opening at the top; 0 for no opening.
    Area: 2 pi R h for R = (span^2 / 4 + rise^2) / (2 rise), and h the height from z = 0 to the opening."""
    if oculus > 0.45 * span:
        raise SurfaceError(f"dome: oculus = {oculus:g} m is too wide; use less than 0.45 x span")
    radius = (span**2 / 4 + rise**2) / (2 * rise)
    top, foot = np.arcsin(oculus / radius), np.arctan2(span / 2, radius - rise)
    check_density(2 * np.pi * radius * rise, edge)
    angle = np.linspace(top, foot, 1 + pieces_of(radius * (foot - top), ROW * edge, least=3))
    z = radius * np.cos(angle) + rise - radius
    z[-1] = 0.0
    r = radius * np.sin(angle)
    r[0] = oculus
    return surface_of_revolution(r, z, edge)


@shape
def catenoid(waist: Length = 1.5, rim: Length = 6.0, edge: Length = 0.2) -> Surface:
    """A trumpet-shaped canopy: the catenoid r = a cosh(z / a), a minimal surface, normals up.
    The radius is a = waist at z = 0, and `rim` at the top."""
    if rim < 1.05 * waist:
        raise SurfaceError(f"catenoid: rim = {rim:g} m must be wider than 1.05 x waist = {waist:g} m")
    height = waist * np.arccosh(rim / waist)
    arc = waist * np.sinh(height / waist)
    check_density(np.pi * (waist + rim) * arc, edge)
    z = waist * np.arcsinh(np.linspace(0, arc, 1 + pieces_of(arc, ROW * edge, least=3)) / waist)
    return surface_of_revolution(waist * np.cosh(z / waist), z, edge)


@shape
def tower(
    width: Length = 9.0,
    height: Length = 30.0,
    taper: Annotated[float, Gt(0.1), Le(2)] = 0.55,
    twist: Annotated[float, Ge(-360), Le(360)] = 90.0,
    squareness: Annotated[float, Ge(2), Le(12)] = 4.0,
    edge: Length = 0.6,
) -> Surface:
    """A twisting tube with a rounded square plan, standing on z = 0, open at foot and top, normals outward.
    taper      : width of the plan at the top, divided by `width`.    twist : rotation from foot to top, degrees.
    squareness : exponent p of the plan |x|^p + |y|^p = 1: 2 is a circle."""
    x, y, around = _superellipse(squareness)
    check_density(0.5 * (1 + taper) * around * width / 2 * height, edge)
    if abs(np.radians(twist)) * width / 2 > 1.5 * height:
        raise SurfaceError(f"tower: twist = {twist:g} degrees is too much for a height of {height:g} m; twist less")
    z = np.linspace(0, height, 1 + pieces_of(height, ROW * edge, multiple=2, least=4))
    scale = 0.5 * width * (1 + (taper - 1) * z / height)
    turns = ring_turns(np.array([pieces_of(around * s, edge, multiple=4, least=8) for s in scale]))
    share = np.linspace(0, 1, len(x))
    rings = []
    for t, s, level in zip(turns, scale, z, strict=True):
        angle = np.radians(twist) * level / height
        u, v = s * np.interp(t, share, x), s * np.interp(t, share, y)
        c, d = np.cos(angle), np.sin(angle)
        rings.append(np.stack([c * u - d * v, d * u + c * v, np.full(len(t), level)], axis=1))
    return Surface(np.concatenate(rings), ring_faces(turns)[:, ::-1])


def _superellipse(p: float) -> tuple[Floats, Floats, float]:
    angle = np.linspace(0, 2 * np.pi, 4 * 2048 + 1)
    c, s = np.cos(angle), np.sin(angle)
    r = (np.abs(c) ** p + np.abs(s) ** p) ** (-1 / p)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r * c), np.diff(r * s)))])
    even = np.linspace(0, arc[-1], len(arc))
    return np.interp(even, arc, r * c), np.interp(even, arc, r * s), float(arc[-1])


def surface_of_revolution(r: Floats, z: Floats, edge: float, outward: bool = False) -> Surface:
    """Return the surface of revolution of a profile. r, z : (k,) radii and heights, metres; radius 0 is a pole.
    outward : true to flip the normals. Without a flip, normals point up where the radius grows along the profile."""
    counts: Ints = np.array([pieces_of(2 * np.pi * x, edge, multiple=6, least=6) if x else 1 for x in r])
    turns = ring_turns(counts)
    angle = 2 * np.pi * np.concatenate(turns)
    radius, height = np.repeat(r, counts), np.repeat(z, counts)
    V = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    F = ring_faces(turns)
    return Surface(V, F[:, ::-1] if outward else F)


@shape
def sphere(radius: Length = 2.0, edge: Length = 0.2) -> Surface:
    """A sphere around the origin, from an icosahedron with divided edges [class I subdivision, Clinton 1971]."""
    area = 4 * np.pi * radius**2
    check_density(area, edge)
    corners, faces = _icosahedron()
    f = max(1, round(float(np.sqrt(area / (20 * ROW / 2 * edge**2)))))
    V, F = _subdivide(corners, faces, f)
    return Surface(radius * V / np.linalg.norm(V, axis=1, keepdims=True), F)


def _icosahedron() -> tuple[Floats, Ints]:
    k = np.arange(5)
    upper, lower = 2 * np.pi * k / 5, 2 * np.pi * (k + 0.5) / 5
    ring = [
        np.stack([2 * np.cos(t), 2 * np.sin(t), np.full(5, h)], axis=1) / np.sqrt(5)
        for t, h in ((upper, 1), (lower, -1))
    ]
    V = np.concatenate([[[0, 0, 1.0]], ring[0], ring[1], [[0, 0, -1.0]]])
    a, b, c, d = 1 + k, 1 + (k + 1) % 5, 6 + k, 6 + (k + 1) % 5
    top, bottom = 0 * k, 0 * k + 11
    return V, np.concatenate([np.stack(t, axis=1) for t in ((top, a, b), (a, c, b), (b, c, d), (bottom, d, c))])


def _subdivide(corners: Floats, faces: Ints, f: int) -> tuple[Floats, Ints]:
    i, j = (x.ravel() for x in np.meshgrid(np.arange(f + 1), np.arange(f + 1), indexing="ij"))
    inside = i + j <= f
    index = np.full((f + 1, f + 1), -1)
    index[i[inside], j[inside]] = np.arange(inside.sum())
    i, j = i[inside], j[inside]
    weights = np.zeros((len(faces), len(i), len(corners)), dtype=np.int64)
    face = np.arange(len(faces))[:, None]
    for corner, weight in enumerate((f - i - j, i, j)):
        weights[face, np.arange(len(i)), faces[:, [corner]]] += weight
    up = i + j < f
    down = i + j < f - 1
    upward = np.stack([index[i[up], j[up]], index[i[up] + 1, j[up]], index[i[up], j[up] + 1]], axis=1)
    k, m = i[down], j[down]
    small = np.concatenate([upward, np.stack([index[k + 1, m], index[k + 1, m + 1], index[k, m + 1]], axis=1)])
    names, name = np.unique(weights.reshape(-1, len(corners)), axis=0, return_inverse=True)
    every = (small[None] + len(i) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    return names @ corners / f, name.ravel()[every]


@shape
def torus(major: Length = 3.0, minor: Length = 1.2, edge: Length = 0.22) -> Surface:
    """A ring around the z axis: a tube of radius `minor` along a circle of radius `major`, normals outward.
    Raises SurfaceError if minor is 0.95 major or more."""
    if minor >= 0.95 * major:
        raise SurfaceError(f"torus: minor = {minor:g} m leaves no hole; use less than 0.95 x major = {major:g} m")
    check_density(4 * np.pi**2 * major * minor, edge)
    rows = pieces_of(2 * np.pi * minor, ROW * edge, multiple=2, least=6)
    phi = 2 * np.pi * np.arange(rows) / rows
    r, z = major + minor * np.cos(phi), minor * np.sin(phi)
    counts = np.array([pieces_of(2 * np.pi * x, edge, multiple=6, least=6) for x in r])
    turns = ring_turns(counts)
    angle, radius = 2 * np.pi * np.concatenate(turns), np.repeat(r, counts)
    V = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.repeat(z, counts)], axis=1)
    return Surface(V, ring_faces(turns, closed=True)[:, ::-1])
