"""Lines where one thing ends in front of another, or where faces meet (Saito and Takahashi 1990)."""

import numpy as np

from dsfab.render.scene import Bytes, Floats32, Pixels

TURN = np.float32(0.87)
"""Cosine of the angle from which an edge between faces is drawn."""

STRIP = 64
"""Rows searched for edges at a time."""


def edges(pixels: Pixels, jump: float) -> Floats32:
    """(h, w) 0..1: where depth jumps by more than `jump` (radii) to a neighbouring pixel, or the normals turn.

    Drawn on the nearer of the two pixels, so that lines lie on what they bound.
    """
    strong = np.zeros(pixels.depth.shape, dtype=np.float32)
    for start in range(0, len(strong), STRIP):  # in strips: bounds the memory
        low, high = max(start - 2, 0), min(start + STRIP + 2, len(strong))
        strip = _edges(pixels.depth[low:high], pixels.normal[low:high], jump)
        strong[start : start + STRIP] = strip[start - low : start - low + STRIP]
    return strong


def _edges(depth: Floats32, normal: Bytes, jump: float) -> Floats32:
    strong = np.zeros(depth.shape, dtype=np.float32)
    flat = np.where(np.isfinite(depth), depth, np.float32(1e3))
    units = normal.astype(np.float32) / np.float32(127.5) - 1
    for axis in (0, 1):
        head = tuple(slice(None, -1) if a == axis else slice(None) for a in range(2))
        tail = tuple(slice(1, None) if a == axis else slice(None) for a in range(2))
        inner = tuple(slice(1, -1) if a == axis else slice(None) for a in range(2))
        one, two = flat[head], flat[tail]
        step = np.abs(one - two)
        # along a slanted face depth changes as well: only what the pixels on either side do not continue is a jump
        steady = np.full_like(flat, np.inf)
        steady[inner] = np.minimum(step[head], step[tail])
        excess = step - 2 * np.minimum(steady[head], steady[tail])
        turned = (TURN - np.einsum("hwi,hwi->hw", units[head], units[tail])) / TURN * (np.minimum(one, two) < 100)
        line = np.clip(np.maximum(excess / np.float32(jump) - 1, 2 * turned), 0, 1)
        strong[head] = np.maximum(strong[head], line * (one <= two))
        strong[tail] = np.maximum(strong[tail], line * (two < one))
    return strong
