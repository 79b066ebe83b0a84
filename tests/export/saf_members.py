"""Crooked members and the SAF file of them."""

from dataclasses import replace

import numpy as np

from dsfab.export import Details, write
from dsfab.surface.shapes import plate
from tests.members.frames import CLAMPED, PINNED, frame

ACTIONS = {"dead": "permanent", "snow": "snow", "crowd": "variable"}


def crooked():
    """Beams in space with a spring, three cases and two combinations."""
    points = [[0, 0, 0], [1, 0.2, 1.5], [2.5, 0, 2], [4, -0.3, 1.6], [5, 0, 0], [2.5, 2, 2]]
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (2, 5)]
    loads = {
        "dead": {1: [0, 0, -2e3, 0, 0, 0], 3: [0, 0, -2e3, 10, -20, 0]},
        "snow": {2: [0, 0, -5e3, 0, 0, 0]},
        "crowd": {5: [100, -50, -1e3, 0, 0, 0]},
    }
    made = frame(points, {0: CLAMPED, 4: PINNED}, loads, ends=ends, normal=(0.1, 1, 0.3), width=0.1234)
    spring = np.zeros((6, 6))
    spring[5, 2] = 2e6
    sums = {"ULS 1": {"dead": 1.35, "snow": 1.5}, "lifted": {"dead": 0.9, "crowd": -1.5}}
    return replace(made, normal=made.axes[:, 2], spring=spring, combinations=sums)


def written(made, path):
    details = Details(frame=replace(made, actions=ACTIONS), facts=("all good",))
    return write(plate(1, 1, 1), path, name="crooked", details=details)
