"""Regions whose outline crosses or touches itself become one with what is beyond the chain that does it.

Chains between material are straightened, and at a pointed or round corner they may then run across the wall beside
them, or along it: OCCT makes no sound triangles of a face whose corner is a hundredth of a millimetre from an edge that
does not end there. The walls are as they are in the sheet: without the chain between them, the outline of both regions
is sound.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.network.curves import ChainCurve
from dsfab.export.network.graph import VOID, ChainNet, Loop
from dsfab.export.network.trimmed import axes_of, middle_normal, signed_area
from dsfab.export.splines import bernstein

SEGMENTS = 600
"""About as many are a region's outline, and `FINEST` at most are each cubic of it, short ones at its ends: chains that
meet nearly along each other cross close to where they meet."""

FINEST = 12

TOUCHING = 1 / 400
"""Share of the thickness within which an outline touches itself: a sixth of what was found where nothing was wrong."""


def crossing_chains(net: ChainNet, curves: Mapping[int, ChainCurve], region: int, near: float = 0.0) -> set[int]:
    """The chains of a region that cross others of it, seen along the normal of its middle; or that come within `near`,
    millimetres, of a corner where they do not end, and those that end there. All of one that is inside out."""
    steps = [step for loop in net.loops[region] for step in loop]
    spans = [len(curves[k].spans) for k, _ in steps]
    fine = int(np.clip(SEGMENTS // sum(spans), 4, FINEST))
    lines = [_samples(curves, loop, fine) for loop in net.loops[region]]
    chain = np.repeat([k for k, _ in steps], fine * np.array(spans))
    plane = axes_of(middle_normal(np.concatenate(lines)))[:2].T
    first = np.cumsum([0, *spans[:-1]]) * fine
    away = _not_ending(net, steps, chain)
    found = set[int]()
    for some in (slice(3), slice(3, 6)):
        seen = [line[:, some] @ plane for line in lines]
        if sum(signed_area(line) for line in seen) <= 0:
            return set(chain.tolist())  # so narrow that its sides are on the wrong side of each other
        found.update(chain[crossing_segments(seen)].tolist())
        corner, segment = np.nonzero(away & (_distances(seen, first) < near))
        found.update(chain[segment].tolist())
        nodes = {net.ends(steps[i])[0] for i in corner.tolist()}
        found.update(k for k, _ in steps if nodes & set(net.ends((k, True))))
    return found


def _not_ending(net: ChainNet, steps: Loop, chain: Ints) -> Bools:
    """(c, k) whether segments of chains (k,) are of none that ends where each of c steps begins."""
    start = np.array([net.ends(step)[0] for step in steps])
    ends = np.array([net.ends((k, True)) for k in chain.tolist()])
    return np.asarray((start[:, None, None] != ends).all(axis=2))


def _distances(lines: list[Floats], first: Ints) -> Floats:
    """(c, k) of the points numbered `first` (c,) of closed lines (., 2) from their k segments."""
    a = np.concatenate(lines)
    way = np.concatenate([np.roll(line, -1, axis=0) for line in lines]) - a
    off = a[first][:, None] - a
    share = np.clip(np.einsum("cki,ki->ck", off, way) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(off - share[..., None] * way, axis=2))


def _samples(curves: Mapping[int, ChainCurve], loop: Loop, fine: int) -> Floats:
    """(k, 6) points along a loop of chains, so many on each cubic."""
    B = bernstein((1 - np.cos(np.pi * np.arange(fine) / fine)) / 2)
    parts = [curves[k].spans if ahead else curves[k].spans[::-1, ::-1] for k, ahead in loop]
    return np.concatenate([(B @ part).reshape(-1, 6) for part in parts])


def crossing_segments(lines: list[Floats]) -> Bools:
    """(k,) whether each segment of closed lines (k, 2) in a plane crosses another, inside of both."""
    a = np.concatenate(lines)
    b = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    apart = _side(a[:, None], b[:, None], a[None]) * _side(a[:, None], b[:, None], b[None]) < 0
    return np.asarray((apart & apart.T).any(axis=1))


def _side(a: Floats, b: Floats, p: Floats) -> Floats:
    """Positive where p is on the left of the line from a to b."""
    d, e = b - a, p - a
    return np.asarray(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0])


def without_crossings(
    net: ChainNet, curves: Mapping[int, ChainCurve], regions: Iterable[int], near: float = 0.0
) -> ChainNet:
    """The net in which some regions, if their outline crosses itself or comes as near, have joined that beyond an inner
    chain of it; the same net where there is none."""
    whole = net
    for region in regions:
        for k in sorted(crossing_chains(net, curves, region, near)):
            chain = whole.chains.get(k)
            if chain is not None and VOID != chain.right != chain.left:
                whole = without_chain(whole, k)
                break
    return whole


def without_chain(net: ChainNet, k: int) -> ChainNet:
    """The net in which both regions of a chain are the one on its left; it is of single outlines, or as it was."""
    left, right = net.chains[k].left, net.chains[k].right
    if len(net.loops[left]) + len(net.loops[right]) > 2:
        return net
    chains, loops, cell = dict(net.chains), dict(net.loops), net.cell.copy()
    one, two = _after(loops[left][0], (k, True)), _after(loops.pop(right)[0], (k, False))
    loop = _without_spurs(one + two)
    for step, ahead in two:
        chains[step] = chains[step].beside(left, ahead)
    for step in {step for step, _ in [*one, *two, (k, True)]} - {step for step, _ in loop}:
        del chains[step]
    loops[left] = [loop]
    cell[cell == right] = left
    return replace(net, chains=chains, loops=loops, cell=cell, loose=net.loose - {right})


def _after(loop: Loop, step: tuple[int, bool]) -> Loop:
    """What follows a step of a loop, once around."""
    at = loop.index(step)
    return [*loop[at + 1 :], *loop[:at]]


def _without_spurs(loop: Loop) -> Loop:
    """A loop without chains that are run through there and back."""
    found = list[tuple[int, bool]]()
    for step in loop:
        if found and found[-1] == (step[0], not step[1]):
            found.pop()
        else:
            found.append(step)
    while len(found) > 1 and found[0] == (found[-1][0], not found[-1][1]):
        found = found[1:-1]
    return found
