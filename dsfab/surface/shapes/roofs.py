"""Shapes over a rectangle, meshed in staggered rows."""

import numpy as np

from dsfab.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import ROW, Length, check_density, pieces_of, shape, staggered


@shape
def plate(length: Length = 6.0, width: Length = 4.0, edge: Length = 0.12) -> Surface:
    """A flat rectangle, length along x and width along y, centred on the origin at z = 0.

    Staggered rows of nearly equilateral triangles with half ones at the two short sides; it mirrors onto itself
    in x and y. Area length x width exactly.
    """
    check_density(length * width, edge)
    uv, F = staggered(pieces_of(length, edge), pieces_of(width, ROW * edge, multiple=2, least=2))
    x, y = (uv - 0.5).T * [[length], [width]]
    return Surface(np.stack([x, y, 0 * x], axis=1), F)


@shape
def barrel_vault(length: Length = 10.0, span: Length = 8.0, rise: Length = 2.5, edge: Length = 0.22) -> Surface:
    """A vault of circular section: length along x, span along y, springing at z = 0, `rise` at the crown.

    Area length x radius x opening angle, for radius = (span^2 / 4 + rise^2) / (2 rise).
    """
    radius = (span**2 / 4 + rise**2) / (2 * rise)
    half = np.arctan2(span / 2, radius - rise)
    check_density(2 * half * radius * length, edge)
    uv, F = staggered(pieces_of(length, edge), pieces_of(2 * half * radius, ROW * edge, multiple=2, least=4))
    angle = (2 * uv[:, 1] - 1) * half
    V = np.stack([(uv[:, 0] - 0.5) * length, radius * np.sin(angle), radius * np.cos(angle) + rise - radius], axis=1)
    V[uv[:, 1] % 1 == 0, 2] = 0.0
    return Surface(V, F)


@shape
def hypar(side: Length = 8.0, rise: Length = 3.0, edge: Length = 0.22) -> Surface:
    """A hyperbolic paraboloid over a square: two opposite corners at z = 0, the other two at z = rise.

    z = rise (1/2 + 2 x y / side^2): both sets of rulings are straight.
    """
    if rise > 4 * side:
        raise SurfaceError(f"hypar: rise = {rise:g} m is more than four times its side of {side:g} m; use a lower rise")
    check_density(side**2 * (1 + rise / side), edge)
    uv, F = staggered(pieces_of(side, edge, least=2), pieces_of(side, ROW * edge, multiple=2, least=2))
    x, y = (uv - 0.5).T * side
    return Surface(np.stack([x, y, rise * (0.5 + 2 * x * y / side**2)], axis=1), F)


@shape
def elliptic_paraboloid(
    length: Length = 12.0, width: Length = 8.0, rise: Length = 1.6, crown: Length = 0.8, edge: Length = 0.22
) -> Surface:
    """A parabola moved along another one, over a rectangle: length along x, width along y; its corners are at z = 0.

    rise  : height of the middle.
    crown : height of the middles of the two long sides; those of the short ones are at rise - crown.

    z = rise - crown (2 x / length)^2 - (rise - crown) (2 y / width)^2. Edges are measured at the middle.
    """
    if crown >= rise:
        raise SurfaceError(
            f"elliptic_paraboloid: crown = {crown:g} m, the height of the long sides, must be less than "
            f"rise = {rise:g} m, that of the middle"
        )
    if rise > 4 * min(length, width):
        raise SurfaceError(
            f"elliptic_paraboloid: rise = {rise:g} m is more than four times its shorter side of "
            f"{min(length, width):g} m; use a lower rise"
        )
    check_density(length * width * (1 + rise / min(length, width)), edge)
    uv, F = staggered(pieces_of(length, edge, least=2), pieces_of(width, ROW * edge, multiple=2, least=2))
    u, v = (2 * uv - 1).T
    z = rise - crown * u**2 - (rise - crown) * v**2
    return Surface(np.stack([u * length / 2, v * width / 2, np.where(np.abs(u * v) == 1, 0.0, z)], axis=1), F)
