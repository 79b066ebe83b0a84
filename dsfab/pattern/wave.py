"""The triangle wave: the one definition that slicer, shader and browser share.

  p(t)
 1 +\\      /\\      /       period 1, range [-1, 1], p(0) = +1
   | \\    /  \\    /
 0 +--\\--/----\\--/---- t
   |   \\/      \\/
-1 +   1/2  1
"""

import numpy as np

from dsfab.arrays import Floats

GLSL = "float wave(float t) { return 4.0 * abs(fract(t) - 0.5) - 1.0; }"
"""The same function for shaders."""


def wave(t: Floats) -> Floats:
    """p(t) = 4 |fract(t) - 1/2| - 1 of t (...)."""
    return np.asarray(4 * np.abs(t - np.floor(t) - 0.5) - 1)


def half_width(threshold: float) -> float:
    """d with p(t) > threshold exactly where |t - k| < d for an integer k: (1 - threshold) / 4, in periods."""
    return (1 - threshold) / 4
