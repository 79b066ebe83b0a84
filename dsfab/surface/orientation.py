"""Which way is up: coordinates of programs whose vertical axis is not z, turned."""

from typing import Literal

import numpy as np

from dsfab.arrays import Floats

Up = Literal["x", "y", "z", "-x", "-y", "-z"]
"""The axis of a file that points to the sky."""

_TURNS: dict[Up, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "z": ((0, 1, 2), (1, 1, 1)),
    "-z": ((0, 1, 2), (1, -1, -1)),
    "y": ((0, 2, 1), (1, -1, 1)),
    "-y": ((0, 2, 1), (1, 1, -1)),
    "x": ((1, 2, 0), (1, 1, 1)),
    "-x": ((2, 1, 0), (1, 1, -1)),
}
"""Up axis -> the axes that become x, y, z, and their signs: turns, no mirrors."""


def upright(V: Floats, up: Up) -> Floats:
    """The vertices V (n, 3), turned so that the axis `up` becomes z; y keeps x, as for glTF (x, -z, y)."""
    axes, signs = _TURNS[up]
    return V if up == "z" else np.asarray(V[:, list(axes)] * np.array(signs, dtype=float) + 0.0)
