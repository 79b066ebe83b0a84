"""Long members cut off from what is at their ends, where both together are no patch with four sides.

 .-----a================b--.          Its long walls run from a to b and from c to d. What is left of a d and right of
/   e  |      member    | f )         b c is a region of its own, small, and the member between them has four sides.
 '-----d================c--'
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats, Ints
from dsfab.export.network.graph import VOID, Chain, ChainNet, Loop
from dsfab.export.network.joining import mean_width, vector_area
from dsfab.export.network.lifting import Lifting

LONG = 1.5
"""Times the distance between them that both walls of a member are long at least."""

POINTS = 9
"""Of a chain that divides a region."""


def divided(net: ChainNet, regions: Iterable[int], lifting: Lifting, width: float) -> ChainNet:
    """The net with the ends of some regions as regions of their own, where these have two long walls; an end that is
    narrower than a width, millimetres, stays with the member."""
    P = np.asarray(net.weights @ lifting.skins.points)
    chains, loops, cell = dict(net.chains), dict(net.loops), dict(net.parent)
    free, count, lines = max(loops) + 1, len(P), list[Floats]()
    for region in regions:
        walls = _long_walls(net, loops[region], P)
        if walls is None:
            continue
        loop = loops[region][0]
        i, j = walls
        whole = vector_area(P[_points(net, loop)])
        turned = [*loop[i:], *loop[:i]]
        ends = [turned[1 : j - i], turned[j - i + 1 :]]
        member: Loop = [turned[0]]
        for wall, end in zip((turned[0], turned[j - i]), ends, strict=True):
            if member[-1] != wall:
                member.append(wall)
            if len(end) == 1 or _narrow(net, end, P, width, whole):
                member += end
                continue
            a, b = net.ends(end[0])[0], net.ends(end[-1])[1]
            k, between = max(chains) + 1, np.arange(count, count + POINTS - 2)
            lines.append(P[a] + np.linspace(0, 1, POINTS)[1:-1, None] * (P[b] - P[a]))
            chains[k] = Chain(np.concatenate([[a], between, [b]]), region, free)
            count += len(between)
            member.append((k, True))
            loops[free] = [[*end, (k, False)]]
            cell[free] = cell.get(region, region)
            for e, ahead in end:
                chains[e] = chains[e].beside(free, ahead)
            free += 1
        loops[region] = [member]
    if not lines:
        return net
    rows = lifting.weights_at(np.concatenate(lines))
    weights = csr_array(vstack([net.weights, rows], format="csr"))
    return replace(net, weights=weights, chains=chains, loops=loops, parent=cell)


def _long_walls(net: ChainNet, loops: list[Loop], P: Floats) -> tuple[int, int] | None:
    """The places in a region's only loop of two walls, longer than they are apart, with something between them."""
    if len(loops) != 1 or len(loops[0]) < 5:
        return None
    loop = loops[0]
    length = np.array([_length(P, net, step) if _wall(net, step) else 0.0 for step in loop])
    i, j = np.sort(np.argsort(-length, kind="stable")[:2]).tolist()
    if j - i < 2 or i + len(loop) - j < 2:
        return None
    (a, b), (c, d) = net.ends(loop[i]), net.ends(loop[j])
    apart = max(np.linalg.norm(P[a] - P[d]), np.linalg.norm(P[b] - P[c]))
    return (i, j) if min(length[i], length[j]) > LONG * apart > 0 else None


def _narrow(net: ChainNet, end: Loop, P: Floats, width: float, whole: Floats) -> bool:
    """Whether chains in a row are nearly straight, or turn back: what a line between their ends cuts off from a region
    with a vector area (3,) is narrow, or lies beyond it."""
    line = P[_points(net, end)]
    return mean_width(line) < width or float(vector_area(line) @ whole) < 0


def _points(net: ChainNet, loop: Loop) -> Ints:
    """The points of chains in a row."""
    return np.concatenate([net.chains[k].points[:: 1 if ahead else -1] for k, ahead in loop])


def _wall(net: ChainNet, step: tuple[int, bool]) -> bool:
    return net.chains[step[0]].right == VOID


def _length(P: Floats, net: ChainNet, step: tuple[int, bool]) -> float:
    return float(np.linalg.norm(np.diff(P[net.chains[step[0]].points], axis=0), axis=1).sum())
