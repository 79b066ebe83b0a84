"""Stand-ins for the paper's bridge and tower: closed surfaces of solids that a builder would know."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import Length, shape
from dsfab.surface.shapes.solids import Field, blended, box, limb, skin, smaller, without

OPENINGS = (0.22, 0.5, 0.78)
"""Heights of the tower's openings, as shares of its own."""


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
        inside = _both(below / np.sqrt(1 + slope**2), above)
        return _both(_both(inside, np.abs(P[:, 0]) - 0.475), np.abs(P[:, 1]) - 0.028)

    whole = blended([blended([wall, arch], 0.02), deck], 0.02)
    whole = without(whole, lambda P: P[:, 2], 0.012)
    unit = skin(whole, (-0.56, -0.14, -0.03), (0.56, 0.14, crown + 0.06), edge / span)
    return Surface(span * unit.V, unit.F)


def _both(a: Floats, b: Floats) -> Floats:
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
    edge: Length = 0.6,
) -> Surface:
    """A slab that twists as it rises, with three openings through it one above the other, genus 3, on z = 0.

    twist : degrees that its top is turned against its foot.
    """
    slab = box((0, 0, 0.5), (0.19, 0.12, 0.6), 0.07)
    openings = [limb([(0, -0.5, z), (0, 0.5, z), (0, 0.6, z)], [0.085] * 3) for z in OPENINGS]
    for opening in openings:
        slab = without(slab, opening, 0.05)
    whole = _twisted(slab, np.radians(twist))
    whole = without(whole, lambda P: P[:, 2], 0.02)
    whole = without(whole, lambda P: 1.0 - P[:, 2], 0.02)
    unit = skin(whole, (-0.26, -0.26, -0.03), (0.26, 0.26, 1.03), edge / height)
    return Surface(height * unit.V, unit.F)


def _twisted(field: Field, turn: float) -> Field:
    """The solid turned about z, by nothing at z = 0 and by `turn` radians at z = 1."""

    def field_there(P: Floats) -> Floats:
        c, s = np.cos(turn * P[:, 2]), np.sin(turn * P[:, 2])
        return field(np.stack([c * P[:, 0] + s * P[:, 1], c * P[:, 1] - s * P[:, 0], P[:, 2]], axis=1))

    return field_there
