"""A sphere cut along random stripes, and its openings."""

import numpy as np

from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.surface import Surface
from tests.shapes import sphere


def openings(plate: Surface, count: int = 3, half: float = 0.2, snap: float = 0.0) -> Sheet:
    """A unit plate with count x count square openings."""
    levels = np.sort(np.concatenate([np.arange(count + 1) - half, np.arange(count + 1) + half]))
    return cut(plate, [count * plate.V[:, 0], count * plate.V[:, 1]], [levels, levels], snap)


def striped_ball(frequency: float, level: float, seed: int) -> tuple[Surface, Sheet]:
    """A ball, and the same cut along curved stripes, turned at random, without pinches."""
    ball = sphere(2)
    turned = ball.V @ np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    one, two = np.sin(frequency * turned[:, 0]), np.sin(frequency * turned[:, 1] + 2 * turned[:, 2] ** 2)
    return ball, resolve_pinches(cut(ball, [one, two], [[level], [level]]), 0.01).sheet
