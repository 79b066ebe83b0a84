"""Which regions have four sides. A side is one chain or several; where they meet, a third chain ends on the side."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints, cross
from dsfab.export.network.curves import SampledChain
from dsfab.export.network.graph import ChainNet, Loop

STRAIGHT = 30.0
"""Degrees off 180 within which a node is on a side, not at a corner."""

BLUNT = 60.0
"""Degrees off 180 within which it may be on a side where a region has more than four corners."""

REACH = 3 / 4
"""Of the thickness along a chain, at most, at which its direction is read."""


@dataclass(frozen=True, eq=False)
class Quad:
    """A region with four sides in order, each of chains with whether they are run through forwards, it on the left."""

    region: int
    sides: tuple[Loop, Loop, Loop, Loop]


def quads_of(net: ChainNet, chains: Mapping[int, SampledChain], reach: float) -> tuple[list[Quad], list[int]]:
    """The regions of a net with four sides, and the others; directions are read within `reach`, millimetres."""
    quads, others = list[Quad](), list[int]()
    for region, loops in net.loops.items():
        quad = _quad(region, loops, chains, reach)
        if quad:
            quads.append(quad)
        else:
            others.append(region)
    return quads, others


def _quad(region: int, loops: list[Loop], chains: Mapping[int, SampledChain], reach: float) -> Quad | None:
    if len(loops) != 1 or len(loops[0]) < 4:
        return None
    loop = loops[0]
    angle = _angles(loop, chains, reach)
    corners = _corners(angle)
    if corners is None:
        return None
    stops = [*corners.tolist(), int(corners[0]) + len(loop)]
    one, two, three, four = ([loop[i % len(loop)] for i in range(a, b)] for a, b in pairwise(stops))
    return Quad(region, (one, two, three, four))


def _corners(angle: Floats) -> Ints | None:
    """The four places among interior angles (k,), degrees, where sides begin, or None."""
    off = 180 - angle
    corners = np.flatnonzero(np.abs(off) > STRAIGHT)
    if len(corners) > 4:
        corners = np.sort(np.argsort(-off, kind="stable")[:4])
        rest = np.setdiff1d(np.arange(len(angle)), corners)
        if (np.abs(off[rest]) > BLUNT).any():
            return None
    if len(corners) < 4:
        more = [i for i in np.argsort(-off, kind="stable").tolist() if i not in corners and off[i] > STRAIGHT / 3]
        corners = np.sort(np.concatenate([corners, more[: 4 - len(corners)]]).astype(np.int64))
    return corners if len(corners) == 4 and (off[corners] > 0).all() else None


def _angles(loop: Loop, chains: Mapping[int, SampledChain], reach: float) -> Floats:
    """(k,) interior angles in degrees where each chain of a loop begins."""
    ahead = [chains[k].direction(way, reach) for k, way in loop]
    behind = [chains[k].direction(not way, reach) for k, way in [loop[-1], *loop[:-1]]]
    out, normal, back = (np.stack(rows) for rows in (*zip(*ahead, strict=True), [way for way, _ in behind]))
    sine = np.einsum("ki,ki->k", cross(out, back), normal)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ki,ki->k", out, back))) % 360)
