"""A person for scale, as an outline. Numpy only."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.render.marks import Mesh

PERSON = 1.75
"""Height of the person, metres."""


def person(foot: Floats, right: Floats, up: Floats) -> Mesh:
    """A flat figure of 1.75 m, standing at `foot` (3,), metres, and facing along `right` x `up`, unit vectors (3,)."""
    strips = [[(0.0, half, y) for half, y in _BODY]]
    strips += [[(side * x, half, y) for x, half, y in limb] for limb in (_ARM, _LEG) for side in (-1.0, 1.0)]
    vertices, faces, count = [], [], 0
    for strip in strips:
        x, half, y = np.array(strip).T
        vertices += [np.stack([x - half, y], axis=1), np.stack([x + half, y], axis=1)]
        low = count + np.arange(len(strip) - 1)
        high = low + len(strip)
        faces += [np.stack([low, low + 1, high + 1], axis=1), np.stack([low, high + 1, high], axis=1)]
        count += 2 * len(strip)
    flat = np.concatenate(vertices)
    return foot + flat[:, :1] * right + flat[:, 1:] * up, np.concatenate(faces)


# half width and height, metres, down the middle of a standing figure; then middle, half width and height of its limbs
_BODY = [
    (0.002, 1.75), (0.040, 1.743), (0.064, 1.720), (0.077, 1.680), (0.078, 1.640), (0.070, 1.590), (0.053, 1.545),
    (0.047, 1.515), (0.052, 1.490), (0.090, 1.467), (0.145, 1.447), (0.188, 1.420), (0.200, 1.385), (0.180, 1.280),
    (0.163, 1.150), (0.153, 1.050), (0.161, 0.960), (0.172, 0.880), (0.174, 0.820), (0.120, 0.790), (0.002, 0.780),
]  # fmt: skip
_ARM = [
    (0.180, 0.012, 1.425), (0.196, 0.034, 1.405), (0.205, 0.042, 1.360), (0.214, 0.040, 1.250), (0.229, 0.036, 1.100),
    (0.243, 0.031, 0.950), (0.252, 0.025, 0.850), (0.257, 0.030, 0.790), (0.258, 0.027, 0.730), (0.256, 0.010, 0.690),
]  # fmt: skip
_LEG = [
    (0.088, 0.086, 0.860), (0.092, 0.077, 0.700), (0.093, 0.057, 0.500), (0.095, 0.056, 0.400), (0.097, 0.053, 0.300),
    (0.098, 0.035, 0.140), (0.099, 0.034, 0.060), (0.106, 0.046, 0.020), (0.108, 0.048, 0.0),
]  # fmt: skip
