"""Shapes like the models in Madan, Jacobson and Levin's paper."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from dsfab.core.arrays import Bools, Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.implicit import (
    EDGE_CORRECTION,
    Field,
    Point,
    ball,
    ellipsoid,
    limb,
    mirror_union,
    remeshed_chart,
    rounded_box,
    skin,
    smooth_difference,
    smooth_minimum,
    smooth_union,
)
from dsfab.surface.shapes.meshing import Length, check_density, ring_faces, ring_turns, shape

NECK_CUT = 0.4  # Height of the cut through the camel's neck, in the model's unit.
MOUTH, HOLLOW = 0.017, 0.034  # Longest mesh edges for a camel's mouth and hollow ears, in the model's unit.


def _figure(field: Field, low: Point, high: Point, size: float, edge: float) -> Surface:
    unit = skin(field, low, high, edge / size)
    return Surface(size * unit.V, unit.F)


def _above_ground(field: Field, k: float) -> Field:
    return smooth_difference(field, lambda P: P[:, 2], k)


@shape
def camel_head(height: Length = 1.0, edge: Length = 0.028) -> Surface:
    """A camel's head and neck; the open foot is at z = 0. height : approximate height to the ear tips, metres."""
    neck = limb([(-0.26, 0, -0.15), (-0.25, 0, 0.06), (-0.17, 0, 0.3), (-0.09, 0, 0.55), (-0.05, 0, 0.74)],
        [0.165, 0.155, 0.135, 0.12, 0.11], 0.1)  # fmt: skip
    skull = ellipsoid((0.02, 0, 0.79), (0.17, 0.115, 0.105))
    muzzle = limb([(0.08, 0, 0.785), (0.28, 0, 0.72), (0.4, 0, 0.672)], [0.1, 0.08, 0.075])
    lip = ellipsoid((0.435, 0.02, 0.645), (0.075, 0.062, 0.066))
    jaw = limb([(0.02, 0, 0.685), (0.26, 0, 0.605), (0.385, 0, 0.565)], [0.075, 0.055, 0.046])
    cheek = ellipsoid((0.05, 0.055, 0.72), (0.11, 0.06, 0.09))
    brow = limb([(0.06, 0.085, 0.862), (0.14, 0.1, 0.842)], [0.036, 0.034])
    eye = ball((0.115, 0.1, 0.808), 0.033)
    tuft = ellipsoid((-0.06, 0, 0.875), (0.1, 0.075, 0.055))
    head = smooth_union([neck, skull, muzzle, jaw, cheek, tuft], 0.09)
    head = smooth_union([head, brow, eye], 0.025)
    head = smooth_union([head, lip], 0.03)
    mouth = limb([(0.24, 0.2, 0.632), (0.38, 0.055, 0.6), (0.54, 0.0, 0.59)], [0.008, 0.014, 0.018])
    nostril = limb([(0.455, 0.055, 0.69), (0.5, 0.025, 0.68)], [0.013, 0.018])
    tall = 1.004 - NECK_CUT
    wide = edge * tall / height
    if wide <= MOUTH:
        head = smooth_difference(smooth_difference(head, mouth, 0.03), nostril, 0.015)
    solid = mirror_union(smooth_union([head, _ear(wide)], 0.05))
    unit = skin(solid, (-0.5, -0.3, NECK_CUT), (0.6, 0.3, 1.1), wide, floor=NECK_CUT)
    return Surface((unit.V - [0, 0, NECK_CUT]) * height / tall, unit.F)


def _ear(wide: float) -> Field:
    along = np.array([-0.45, 0.6, 0.66])
    along /= np.linalg.norm(along)
    front = np.array([0.9, 0.3, 0.2])
    front -= along * (front @ along)
    front /= np.linalg.norm(front)
    axes = np.stack([along, np.cross(front, along), front])
    centre = np.array([-0.105, 0.15, 0.93])
    leaf = ellipsoid(centre, (0.095, max(0.055, wide), max(0.036, wide)), axes)
    if wide > HOLLOW:
        return leaf
    return smooth_difference(leaf, ellipsoid(centre + 0.042 * front, (0.068, 0.034, 0.026), axes), 0.02)


@shape
def duck_ring(length: Length = 1.86, edge: Length = 0.06) -> Surface:
    """A swimming ring with the head and the tail of a duck, genus 1. The duck looks towards -x; y is up.
    length : length from beak to tail, metres."""

    def ring(P: Floats) -> Floats:
        x, y, z = P.T
        stretch = 1 + 0.15 * np.tanh(-3 * x) * (x < 0)
        around = np.hypot(np.hypot(x / stretch, y) - 0.265, 0.95 * z)
        return np.asarray(around - 0.135)

    neck = limb([(-0.3, 0, 0.05), (-0.31, 0, 0.22)], [0.125, 0.105])
    head = ball((-0.31, 0, 0.255), 0.128)
    beak = limb([(-0.38, 0, 0.245), (-0.465, 0, 0.205)], [0.07, 0.04])
    tail = limb([(0.33, 0, 0.03), (0.41, 0, 0.12), (0.43, 0, 0.2)], [0.1, 0.06, 0.03])
    body = smooth_union([ring, neck, tail], 0.12)
    body = smooth_difference(body, lambda P: P[:, 2] + 0.125, 0.05)
    solid = smooth_union([body, smooth_union([head, beak], 0.05)], 0.06)
    surface = _figure(solid, (-0.6, -0.5, -0.25), (0.6, 0.5, 0.5), length, edge)
    return Surface(surface.V[:, [0, 2, 1]] * [1, 1, -1], surface.F)


@shape
def mouse(length: Length = 0.12, edge: Length = 0.0028) -> Surface:
    """A computer mouse, genus 0. The buttons are at the +x end."""
    shell = smooth_union([ellipsoid((0, 0, 0), (0.5, 0.29, 0.27)), ellipsoid((-0.12, 0, 0), (0.37, 0.27, 0.34))], 0.15)
    well = ellipsoid((0.27, 0, 0.26), (0.15, 0.07, 0.09))
    wheel = ellipsoid((0.27, 0, 0.17), (0.1, 0.045, 0.1))
    body = smooth_difference(lambda P: shell(P) + _buttons(P), well, 0.05)
    return _figure(
        _above_ground(smooth_union([body, wheel], 0.04), 0.06), (-0.6, -0.4, -0.1), (0.6, 0.4, 0.5), length, edge
    )


def _buttons(P: Floats) -> Floats:
    x, y, z = P.T
    front = x + 0.9 * y**2 - 0.03  # positive on the buttons' side of the seam across the computer mouse
    top, before = _rising((z - 0.07) / 0.04), _rising(front / 0.04)
    seams = np.maximum(np.exp(-((y / 0.035) ** 2)) * before, np.exp(-((front / 0.035) ** 2)))
    return np.asarray(top * (0.018 * seams + 0.012 * before * _rising(y / 0.03)))


def _rising(t: Floats) -> Floats:
    return np.asarray(0.5 * (1 + np.tanh(t)))


@shape
def climbing_hold(width: Length = 0.2, edge: Length = 0.0055) -> Surface:
    """A climbing hold, genus 1. The flat back is at x = 0; a bolt hole runs along x."""
    lump = smooth_union(
        [ellipsoid((0.03, 0, -0.06), (0.3, 0.5, 0.3)), ellipsoid((0.2, 0, 0.14), (0.16, 0.4, 0.15))], 0.12
    )
    grip = limb([(0.13, -0.4, 0.33), (0.09, 0, 0.26), (0.13, 0.4, 0.33)], [0.1, 0.11, 0.1])
    lump = smooth_difference(lump, grip, 0.06)
    lump = smooth_difference(lump, lambda P: P[:, 0], 0.05)
    hole = limb([(-0.3, 0, -0.1), (0.16, 0, -0.1), (0.5, 0, -0.1)], [0.065, 0.065, 0.16])
    return _figure(smooth_difference(lump, hole, 0.04), (-0.1, -0.6, -0.5), (0.5, 0.6, 0.5), width, edge)


@shape
def turkey(height: Length = 0.5, edge: Length = 0.016) -> Surface:
    """A turkey with a spread tail, genus 0."""
    body = ellipsoid((-0.02, 0, 0.36), (0.32, 0.25, 0.28))
    breast = ball((0.13, 0, 0.37), 0.22)
    base = ellipsoid((-0.03, 0, 0.05), (0.27, 0.23, 0.16))
    wing = ellipsoid((-0.06, 0.24, 0.38), (0.25, 0.06, 0.15))
    neck = limb([(0.2, 0, 0.48), (0.33, 0, 0.66), (0.34, 0, 0.84)], [0.14, 0.075, 0.055])
    body = smooth_union([body, breast, base, wing, neck], 0.08)
    head = ellipsoid((0.37, 0, 0.89), (0.085, 0.06, 0.066))
    beak = limb([(0.43, 0, 0.885), (0.515, 0, 0.85)], [0.034, 0.018])
    wattle = limb([(0.43, 0, 0.84), (0.435, 0, 0.74)], [0.026, 0.034])
    bird = smooth_union([body, head, beak, wattle], 0.035)
    fan = [limb([(-0.2, 0, 0.38), *_feather(angle)], [0.06, 0.05, 0.068]) for angle in np.radians(range(0, 91, 15))]
    return _figure(
        _above_ground(mirror_union(smooth_union([bird, *fan], 0.045)), 0.04),
        (-0.75, -0.8, -0.1),
        (0.65, 0.8, 1.1),
        height,
        edge,
    )


def _feather(angle: float) -> list[Point]:
    return [(-0.2 - 0.22 * r, 0.58 * r * np.sin(angle), 0.38 + 0.58 * r * np.cos(angle)) for r in (0.5, 1.0)]


@shape
def pirate(height: Length = 1.8, edge: Length = 0.036) -> Surface:
    """A pirate with a cocked hat, a cutlass, a hook and a wooden leg, genus 0, on z = 0."""
    coat = limb([(-0.01, 0, 0.42), (0, 0, 0.56), (0, 0, 0.7)], [0.12, 0.088, 0.1])
    shoulders = ellipsoid((0, 0, 0.725), (0.08, 0.16, 0.06))
    neck = limb([(0, 0, 0.75), (0.01, 0, 0.84)], [0.05, 0.045])
    boot = limb([(0, -0.075, 0.4), (0.01, -0.085, 0.2), (0, -0.09, 0.05)], [0.075, 0.052, 0.045])
    cuff = ellipsoid((0.005, -0.085, 0.225), (0.075, 0.07, 0.03))
    shoe = ellipsoid((0.05, -0.092, 0.03), (0.1, 0.047, 0.045))
    peg = limb(
        [(0, 0.075, 0.4), (0.01, 0.085, 0.22), (0.01, 0.09, 0.14), (0.01, 0.09, 0.02)], [0.075, 0.06, 0.035, 0.03]
    )
    body = smooth_union([coat, shoulders, neck, boot, cuff, shoe, peg], 0.045)
    head = ellipsoid((0.015, 0, 0.855), (0.078, 0.07, 0.085))
    beard = limb([(0.055, 0, 0.82), (0.08, 0, 0.74)], [0.052, 0.028])
    nose = ball((0.1, 0, 0.855), 0.022)
    hat = smooth_union([ellipsoid((0.005, 0, 0.93), (0.085, 0.085, 0.05)), _brim()], 0.02)
    body = smooth_union([body, smooth_union([head, beard, nose], 0.03), *_arms()], 0.03)
    solid = _above_ground(smooth_union([body, hat], 0.02), 0.02)
    return _figure(solid, (-0.3, -0.5, -0.05), (0.5, 0.5, 1.15), height, edge)


def _brim() -> Field:
    crescent = limb([(0, -0.19, 0.9), (0, -0.1, 0.955), (0, 0, 0.975), (0, 0.1, 0.955), (0, 0.19, 0.9)],
        [0.022, 0.045, 0.05, 0.045, 0.022], 1.0)  # fmt: skip
    return lambda P: crescent(P * [0.75, 1, 1])


def _arms() -> list[Field]:
    right_arm = limb([(0, -0.15, 0.73), (0.0, -0.265, 0.6), (0.13, -0.28, 0.55)], [0.055, 0.043, 0.038])
    hand = ball((0.15, -0.28, 0.555), 0.042)
    guard = limb([(0.17, -0.335, 0.59), (0.17, -0.225, 0.59)], [0.022, 0.022])
    blade = limb(
        [(0.14, -0.28, 0.5), (0.19, -0.28, 0.66), (0.27, -0.28, 0.8), (0.385, -0.28, 0.9)], [0.022, 0.026, 0.029, 0.019]
    )
    left_arm = limb([(0, 0.15, 0.73), (-0.02, 0.27, 0.6), (0.1, 0.3, 0.56)], [0.055, 0.043, 0.036])
    cup = ball((0.115, 0.3, 0.562), 0.042)
    hook = limb([(0.13, 0.3, 0.57), (0.185, 0.3, 0.6), (0.205, 0.3, 0.655), (0.165, 0.3, 0.69)], [0.022] * 4)
    return [right_arm, hand, guard, blade, left_arm, cup, hook]


OPENINGS = (0.22, 0.5, 0.78)  # Heights of the tower's openings, as shares of its height.


@shape
def bridge(span: Length = 30.0, rise: Annotated[float, Gt(0.02), Le(0.25)] = 0.13, edge: Length = 0.5) -> Surface:
    """A bridge along x, genus 0: a deck, an arch, and a wall between deck and arch, on z = 0.
    span : length of the deck, metres.    rise : rise of the arch's underside, divided by the span."""
    crown = rise + 0.075

    def deck(P: Floats) -> Floats:
        return rounded_box((0, 0, 0), (0.5, 0.095, 0.02), 0.016)(P - np.outer(crown - 0.16 * P[:, 0] ** 2, [0, 0, 1.0]))

    def arch(P: Floats) -> Floats:
        height = rise + 0.012 - (rise + 0.03) * (P[:, 0] / 0.45) ** 2
        slope = 2 * (rise + 0.03) * P[:, 0] / 0.45**2
        return np.asarray(_slab((P[:, 2] - height) / np.sqrt(1 + slope**2), np.abs(P[:, 1]) - 0.05, 0.022, 0.014))

    def wall(P: Floats) -> Floats:
        below = rise + 0.012 - (rise + 0.03) * (P[:, 0] / 0.45) ** 2 - P[:, 2]
        above = P[:, 2] - (crown - 0.16 * P[:, 0] ** 2)
        slope = 2 * (rise + 0.03) * P[:, 0] / 0.45**2
        inside = _rounded_maximum(below / np.sqrt(1 + slope**2), above)
        return _rounded_maximum(_rounded_maximum(inside, np.abs(P[:, 0]) - 0.475), np.abs(P[:, 1]) - 0.028)

    solid = smooth_union([smooth_union([wall, arch], 0.02), deck], 0.02)
    solid = smooth_difference(solid, lambda P: P[:, 2], 0.012)
    unit = skin(solid, (-0.56, -0.14, -0.03), (0.56, 0.14, crown + 0.06), edge / span)
    return Surface(span * unit.V, unit.F)


def _rounded_maximum(a: Floats, b: Floats) -> Floats:
    return -smooth_minimum(-a, -b, 0.01)


def _slab(u: Floats, v: Floats, half: float, rounding: float) -> Floats:
    q = np.stack([np.abs(u) - half, v], axis=1) + rounding
    return np.asarray(np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - rounding)


@shape
def twisty_tower(
    height: Length = 30.0, twist: Annotated[float, Ge(-180), Le(180)] = 120.0, edge: Length = 0.6
) -> Surface:
    """A tower: an upright slab with three openings, genus 3, standing on z = 0.
    twist : rotation of the slab from foot to top, degrees."""
    slab = rounded_box((0, 0, 0.5), (0.19, 0.12, 0.6), 0.07)
    openings = [limb([(0, -0.5, z), (0, 0.5, z), (0, 0.6, z)], [0.085] * 3) for z in OPENINGS]
    for opening in openings:
        slab = smooth_difference(slab, opening, 0.05)
    solid = twisted_solid(slab, np.radians(twist))
    solid = smooth_difference(solid, lambda P: P[:, 2], 0.02)
    solid = smooth_difference(solid, lambda P: 1.0 - P[:, 2], 0.02)
    unit = skin(solid, (-0.26, -0.26, -0.03), (0.26, 0.26, 1.03), edge / height)
    return Surface(height * unit.V, unit.F)


def twisted_solid(field: Field, turn: float) -> Field:
    """Twist a solid about the z axis, by `turn` radians per unit of height.
    field : function of points (k, 3) that returns approximate distances (k,) from the solid."""

    def field_there(P: Floats) -> Floats:
        c, s = np.cos(turn * P[:, 2]), np.sin(turn * P[:, 2])
        return field(np.stack([c * P[:, 0] + s * P[:, 1], c * P[:, 1] - s * P[:, 0], P[:, 2]], axis=1))

    return field_there


LOWEST, HIGHEST = -0.4426307, 2.0  # Heights of the lowest points and of the peak of Boy's surface, before scaling.


@shape
def boys_surface(height: Length = 3.0, edge: Length = 0.16) -> Surface:
    """Boy's surface over the unit disc [Kusner 1987], on z = 0. The surface crosses itself, with one boundary."""
    check_density(4 * height**2, edge)
    chart = BoyChart(height)
    rows = 24
    counts = np.array([1, *(6 * k for k in range(1, rows + 1))])
    turns = ring_turns(counts)
    angle, radius = 2 * np.pi * np.concatenate(turns), np.repeat(np.arange(rows + 1) / rows, counts)
    X = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return Surface(*remeshed_chart(chart, X, ring_faces(turns), EDGE_CORRECTION * edge))


@dataclass(frozen=True)
class BoyChart:
    """Boy's surface as a function of points of the unit disc."""

    height: float

    def place(self, X: Floats) -> Floats:
        """Return the points (k, 3) of the surface, metres, at points X (k, 2) of the unit disc."""
        w = X[:, 0] + 1j * X[:, 1]
        a = w**6 + np.sqrt(5) * w**3 - 1
        g = np.stack(
            [-1.5 * (w * (1 - w**4) / a).imag, -1.5 * (w * (1 + w**4) / a).real, ((1 + w**6) / a).imag - 0.5], axis=1
        )
        P = g / (g**2).sum(axis=1, keepdims=True)
        return np.asarray(self.height * (P * [1, -1, -1] - [0, 0, LOWEST]) / (HIGHEST - LOWEST))

    def move(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """Return the disc coordinates (k, 2) of surface points that move by about `step` (k, 3), metres.
        X : (k, 2) disc coordinates before the move.    border : (k,) mask of points that stay on the unit circle."""
        small = 1e-6
        places = self.place(X)
        J = np.stack([(self.place(X + small * e) - places) / small for e in np.eye(2)], axis=2)
        JT = np.swapaxes(J, 1, 2)
        Y = X + np.linalg.solve(JT @ J, JT @ step[:, :, None])[:, :, 0]
        r = np.maximum(np.linalg.norm(Y, axis=1), 1e-300)
        Y *= np.where(border, 1 / r, np.minimum(1, (1 - 1e-3) / r))[:, None]
        return np.asarray(Y)
