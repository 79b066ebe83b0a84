"""Chains of an outline joined where nothing ends: a round corner of which a part lay in a fillet is one chain again.

Lenses between two chains that would become one when they are straightened join a region beside them.
"""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.graph import ROUND, TURN, VOID, Chain, ChainNet, Loop, turns

FEWEST = 4
"""Chains that a loop keeps."""


def joined_outlines(net: ChainNet, P: Floats, N: Floats) -> ChainNet:
    """The net without nodes in the middle of round corners and of straight walls; P and N (p, 3) are its points and the
    normals there."""
    ends = [int(p) for chain in net.chains.values() for p in (chain.points[0], chain.points[-1])]
    degree = np.bincount(ends, minlength=len(P))
    degree[list(net.twins)] = 0  # a seam, and what it ends, stay two
    chains = dict(net.chains)
    loops = {region: [_joined(loop, chains, P, N, degree) for loop in some] for region, some in net.loops.items()}
    return replace(net, chains=chains, loops=loops)


def _joined(loop: Loop, chains: dict[int, Chain], P: Floats, N: Floats, degree: Ints) -> Loop:
    """A loop with fewer chains; `chains` loses those that have become part of others."""
    if all(chains[k].right == VOID for k, _ in loop):
        return loop
    found, at = list(loop), 0
    while at < len(found) and len(found) > FEWEST:
        (j, _), (k, _) = found[at - 1], found[at]
        a, b = chains[j], chains[k]
        outer = a.right == VOID and b.right == VOID and j != k
        near = _around(found, at, chains)
        if outer and degree[b.points[0]] == 2 and not _ends(P[near], N[near]):
            chains[j] = replace(a, points=np.concatenate([a.points, b.points[1:]]))
            del chains[k], found[at]
        else:
            at += 1
    return found


def _around(loop: Loop, at: int, chains: dict[int, Chain]) -> Ints:
    """(5,) points of the outline around that where a chain of a loop begins; (0,) where it is not that long."""
    parts = [chains[loop[(at + i) % len(loop)][0]] for i in (-2, -1, 0, 1)]
    before, after = parts[1].points, parts[2].points
    if parts[0].right == VOID:
        before = np.concatenate([parts[0].points[:-1], before])
    if parts[3].right == VOID:
        after = np.concatenate([after, parts[3].points[1:]])
    return np.concatenate([before[-3:-1], after[:3]]) if min(len(before), len(after)) > 2 else after[:0]


def _ends(line: Floats, N: Floats) -> bool:
    """Whether something ends in the middle of five points (5, 3) with normals there: a sharp corner, or that an outline
    is round; and where there are fewer."""
    if len(line) < 5:
        return True
    way = np.diff(line, axis=0)
    before, here, after = turns(way[:-1], way[1:], N[1:-1])
    sharp = way[1] @ way[2] < TURN * np.linalg.norm(way[1]) * np.linalg.norm(way[2])
    return bool(sharp or (here < ROUND and max(before, after) >= ROUND))


def without_lenses(net: ChainNet, P: Floats, width: float) -> ChainNet:
    """The net without regions of two chains that are narrower than a width, each part of the region beyond an inner
    chain of its own; P (p, 3) are the net's points, in the same unit.

    Straightened, that chain may run along the other one, or beyond it, an outline too: no face is between them then.
    """
    chains, loops, loose, cell = dict(net.chains), dict(net.loops), set(net.loose), net.cell.copy()
    for region in list(loops):
        if len(loops[region]) != 1 or len(loops[region][0]) != 2:
            continue
        steps = loops[region][0]
        sides = [chains[k].points if ahead else chains[k].points[::-1] for k, ahead in steps]
        beyond = [chains[k].right if ahead else chains[k].left for k, ahead in steps]
        inner = [i for i in (0, 1) if beyond[i] not in (VOID, region)]
        if not inner or region in beyond or mean_width(P[np.concatenate([p[:-1] for p in sides])]) >= width:
            continue
        (gone, ahead), kept, other = steps[inner[0]], steps[1 - inner[0]], beyond[inner[0]]
        loops[other] = [[kept if step == (gone, not ahead) else step for step in loop] for loop in loops[other]]
        chains[kept[0]] = chains[kept[0]].beside(other, kept[1])
        del chains[gone], loops[region]
        loose.discard(region)
        cell[cell == region] = other
    return replace(net, chains=chains, loops=loops, loose=frozenset(loose), cell=cell)


def mean_width(line: Floats) -> float:
    """Of what a closed line (k, 3) is around: its area over half its length."""
    around = float(np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1).sum())
    return 2 * float(np.linalg.norm(vector_area(line))) / max(around, 1e-300)


def vector_area(line: Floats) -> Floats:
    """(3,) of what a closed line (k, 3) is around, along its normal."""
    line = line - line.mean(axis=0)
    return np.asarray(np.cross(line, np.roll(line, -1, axis=0)).sum(axis=0) / 2)
