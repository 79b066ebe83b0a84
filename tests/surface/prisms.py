"""A tube with vertices at irregular places along its edges."""

import numpy as np

from dsfab.surface import Surface


def prism(sides: int, rows: int, length: float) -> Surface:
    """A tube of radius 1, open at both ends, with vertices at irregular places along its edges."""
    i, j = np.meshgrid(np.arange(sides), np.arange(rows + 1), indexing="ij")
    z = length * (j + np.random.default_rng(1).uniform(-0.4, 0.4, i.shape) * ((j > 0) & (j < rows))) / rows
    turn = 2 * np.pi * i / sides
    V = np.stack([np.cos(turn), np.sin(turn), z], axis=-1).reshape(-1, 3)
    a, c = (i * (rows + 1) + j)[:, :-1].ravel(), ((i + 1) % sides * (rows + 1) + j)[:, :-1].ravel()
    return Surface(V, np.concatenate([np.c_[a, c, a + 1], np.c_[c, c + 1, a + 1]]))
