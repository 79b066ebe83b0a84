"""Frames of a few bars."""

import numpy as np

from dsfab.members.frame import BeamMaterial, Frame

E, NU = 200e9, 0.3

STEEL = BeamMaterial(E, NU, 7850.0)

FREE, PINNED, CLAMPED = [0] * 6, [1, 1, 1, 0, 0, 0], [1] * 6


def frame(points, fixed, loads, *, width=0.1, thickness=0.05, normal=(0, 0, 1), ends=None) -> Frame:
    """A chain of beams, or beams between `ends`, of one section."""
    points = np.array(points, dtype=float)
    ends = np.array([(k, k + 1) for k in range(len(points) - 1)] if ends is None else ends)
    normal = np.broadcast_to(np.array(normal, dtype=float), (len(ends), 3))
    given = {name: np.zeros((len(points), 6)) for name in loads}
    for name, rows in loads.items():
        for node, row in rows.items():
            given[name][node] = row
    b = len(ends)
    return Frame(
        points,
        tuple(f"K{k}" for k in range(len(points))),
        ends,
        normal,
        np.full(b, width),
        np.full(b, thickness),
        np.zeros(b, dtype=int),
        ("A1",),
        np.array([fixed.get(k, FREE) for k in range(len(points))], dtype=bool),
        np.zeros((len(points), 6)),
        given,
        STEEL,
    )
