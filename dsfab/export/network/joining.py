"""Chains of an outline joined where nothing ends: a round corner of which a part lay in a fillet is one chain again."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.graph import ROUND, VOID, ChainNet, Loop

FEWEST = 4
"""Chains that a loop keeps."""


def joined_outlines(net: ChainNet, P: Floats) -> ChainNet:
    """The net without nodes in the middle of round corners and of straight walls; P (p, d) are its points."""
    ends = [int(p) for chain in net.chains.values() for p in (chain.points[0], chain.points[-1])]
    degree = np.bincount(ends, minlength=len(P))
    chains, loops = dict(net.chains), dict[int, list[Loop]]()

    def one(loop: Loop) -> Loop:
        if all(chains[k].right == VOID for k, _ in loop):
            return loop
        found = list(loop)
        at = 0
        while at < len(found) and len(found) > FEWEST:
            (j, _), (k, _) = found[at - 1], found[at]
            a, b = chains[j], chains[k]
            outer = a.right == VOID and b.right == VOID and j != k
            if outer and degree[b.points[0]] == 2 and not _round_end(P, a.points, b.points):
                chains[j] = replace(a, points=np.concatenate([a.points, b.points[1:]]))
                del chains[k], found[at]
            else:
                at += 1
        return found

    for region, some in net.loops.items():
        loops[region] = [one(loop) for loop in some]
    return replace(net, chains=chains, loops=loops)


def _round_end(P: Floats, one: Ints, two: Ints) -> bool:
    """Whether the first of two chains' points in a row ends, and the other begins, where an outline begins or ends to
    be round."""
    bent = _bent(P[np.concatenate([one[-3:], two[1:3]])])
    middle = len(one[-3:]) - 2
    beside = [bent[i] for i in (middle - 1, middle + 1) if 0 <= i < len(bent)]
    return bent[middle] and not all(beside)


def _bent(line: Floats) -> list[bool]:
    """Whether a line (k, d) turns where its inner points are."""
    way = np.diff(line, axis=0)
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    return (np.einsum("ki,ki->k", way[1:], way[:-1]) < ROUND).tolist()
