"""Stand-ins for the paper's bridge and tower: closed surfaces of solids that a builder would know."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import Length, shape
from dsfab.surface.shapes.solids import Field, blended, box, skin, smaller, without


@shape
def bridge(
    span: Length = 30.0,
    rise: Annotated[float, Gt(0.02), Le(0.25)] = 0.13,
    edge: Length = 0.5,
) -> Surface:
    """A deck on an arch with a wall between them, genus 0: along x, as wide as a road, abutments down to z = 0.

    span : between the ends of the deck, metres. rise : of the arch's underside, as a share of the span.
    """
    crown = rise + 0.075

    def deck(P: Floats) -> Floats:
        return box((0, 0, 0), (0.5, 0.095, 0.02), 0.016)(P - _along(P, crown - 0.16 * P[:, 0] ** 2))

    def arch(P: Floats) -> Floats:
        height = rise + 0.012 - (rise + 0.03) * (P[:, 0] / 0.45) ** 2
        slope = 2 * (rise + 0.03) * P[:, 0] / 0.45**2
        across = np.abs(P[:, 1]) - 0.05
        return np.asarray(_slab((P[:, 2] - height) / np.sqrt(1 + slope**2), across, 0.022, 0.014))

    def wall(P: Floats) -> Floats:
        below = rise + 0.012 - (rise + 0.03) * (P[:, 0] / 0.45) ** 2 - P[:, 2]
        above = P[:, 2] - (crown - 0.16 * P[:, 0] ** 2)
        slope = 2 * (rise + 0.03) * P[:, 0] / 0.45**2
        ends = np.abs(P[:, 0]) - 0.475
        inside = -smaller(-below / np.sqrt(1 + slope**2), -above, 0.01)
        return -smaller(-smaller_of_two(inside, ends), 0.028 - np.abs(P[:, 1]), 0.01)

    whole = blended([blended([wall, arch], 0.02), deck], 0.02)
    whole = without(whole, lambda P: P[:, 2], 0.012)
    unit = skin(whole, (-0.56, -0.14, -0.03), (0.56, 0.14, crown + 0.06), edge / span)
    return Surface(span * unit.V, unit.F)


def smaller_of_two(a: Floats, b: Floats) -> Floats:
    """The larger value with a rounded corner: the solid inside both."""
    return -smaller(-a, -b, 0.01)


def _along(P: Floats, height: Floats) -> Floats:
    """Vectors (q, 3) upwards of the given heights."""
    return np.asarray(np.outer(height, [0, 0, 1.0]))


def _slab(u: Floats, v: Floats, half: float, rounding: float) -> Floats:
    """A strip |u| < half, v < 0 with rounded corners."""
    q = np.stack([np.abs(u) - half, v], axis=1) + rounding
    return np.asarray(np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - rounding)


@shape
def twisty_tower(
    height: Length = 30.0,
    twist: Annotated[float, Ge(-180), Le(180)] = 120.0,
    edge: Length = 0.55,
) -> Surface:
    """Four legs that wind around each other from a base to a crown, genus 3, standing on z = 0.

    twist : degrees that the crown is turned against the base.
    """
    legs = _twisted(_legs, np.radians(twist))
    base = box((0, 0, 0.0), (0.205, 0.205, 0.06), 0.05)
    crown = _twisted(box((0, 0, 1.0), (0.155, 0.155, 0.06), 0.05), np.radians(twist))
    whole = blended([legs, base, crown], 0.07)
    whole = without(whole, lambda P: P[:, 2], 0.02)
    whole = without(whole, lambda P: 1.0 - P[:, 2], 0.02)
    unit = skin(whole, (-0.36, -0.36, -0.03), (0.36, 0.36, 1.03), edge / height)
    return Surface(height * unit.V, unit.F)


def _twisted(field: Field, turn: float) -> Field:
    """The solid turned about z, by nothing at z = 0 and by `turn` radians at z = 1."""

    def field_there(P: Floats) -> Floats:
        c, s = np.cos(turn * P[:, 2]), np.sin(turn * P[:, 2])
        return field(np.stack([c * P[:, 0] + s * P[:, 1], c * P[:, 1] - s * P[:, 0], P[:, 2]], axis=1))

    return field_there


def _legs(P: Floats) -> Floats:
    """Four upright tubes at the corners of a square that narrows upwards and swells a little in the middle."""
    z = np.clip(P[:, 2], 0, 1)
    corner = 0.135 - 0.035 * z + 0.03 * np.sin(np.pi * z)
    radius = 0.068 - 0.016 * z
    return np.asarray(np.hypot(np.abs(P[:, 0]) - corner, np.abs(P[:, 1]) - corner) - radius)
