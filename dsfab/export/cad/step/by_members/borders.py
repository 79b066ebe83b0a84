"""Borders between members: straightened, ended steeply at round corners, and removed where outlines cross."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.export.cad.step.by_members.curves import ChainCurve
from dsfab.export.cad.step.by_members.fillets import outline_and_border, turn_at, with_moved_ends
from dsfab.export.cad.step.by_members.lines import BENT, CORNER
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainNet, Loop, ends_at
from dsfab.export.cad.step.by_members.trimmed import axes_of, middle_normal, signed_area
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.smooth.edges import spread
from dsfab.export.splines import Spline, bernstein, splines_through

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


SIDEWAYS = 1 / 3
"""Share of the thickness that a chain may be moved by, sideways."""

POINTS = 9
"""Of a straightened chain, at least."""

SAG = 1 / 400
"""Share of the thickness by which the chords between its points are off its curve, about: what is fitted to the corners
of a polyline has many spans."""

PLACES = np.linspace(0, 1, 65)
"""Where a curve is asked how it bends."""

BACK = 1.5
"""Times the distance between its ends that a hairpin is long, at least: half a circle is 1.57."""

SPANS = 4
"""Of a chain that wanders too much to be the side of a patch, there are more."""

LEVEL = 0.5
"""Least cosine between the mean normal around a region that others become part of and any one."""


def straightened(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """The net without hairpins, its inner chains on the simplest curves near them; thickness in millimetres."""
    P = np.asarray(net.weights @ lifting.skins.points)
    inner = [k for k, chain in net.chains.items() if chain.right != VOID and len(chain.points) > 2]
    if inner and len(lifting.sides.creases):
        crease = lifting.sides.on_creases(net.weights)
        inner = [k for k in inner if not crease[net.chains[k].points].all()]
    fits = splines_through([spread(P[net.chains[k].points]) for k in inner], [SIDEWAYS * thickness] * len(inner))
    curves = {k: curve for k, (curve, _) in zip(inner, fits, strict=True)}
    N = np.asarray(net.weights @ lifting.skins.normals)
    net = _without_hairpins(net, [k for k, curve in curves.items() if _turns_back(curve)], N)
    curves = {k: curve for k, curve in curves.items() if k in net.chains}
    if not curves:
        return net
    between = [curve(np.linspace(0, 1, _points(curve, SAG * thickness))[1:-1]) for curve in curves.values()]
    rows = lifting.weights_at(np.concatenate(between))
    chains, start = dict(net.chains), len(P)
    for k, some in zip(curves, between, strict=True):
        points, new = chains[k].points, np.arange(start, start + len(some))
        chains[k] = replace(chains[k], points=np.concatenate([points[:1], new, points[-1:]]))
        start += len(some)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)


def _turns_back(curve: Spline) -> bool:
    """Whether a chain is a hairpin, or wanders as much."""
    line = curve(PLACES)
    way = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    return way > BACK * float(np.linalg.norm(line[-1] - line[0])) or len(np.unique(curve.knots)) - 1 > SPANS


def _without_hairpins(net: ChainNet, some: Sequence[int], N: Floats) -> ChainNet:
    """The net without some chains, where one plane sees both regions beside them; N (p, 3) normals at its points."""
    for k in some:
        chain = net.chains.get(k)
        if chain is None or chain.left == chain.right:
            continue
        steps = [step for region in (chain.left, chain.right) for loop in net.loops[region] for step, _ in loop]
        around = N[np.concatenate([net.chains[step].points for step in steps])]
        mean = around.mean(axis=0)
        if (around @ mean).min() > LEVEL * np.linalg.norm(mean):
            net = without_chain(net, k)
    return net


def _points(curve: Spline, sag: float) -> int:
    """How many points of a curve have chords between them that are off it by no more than `sag`, in its unit."""
    bends = np.diff(curve(PLACES), n=2, axis=0) * (len(PLACES) - 1) ** 2
    most = float(np.linalg.norm(bends, axis=1).max())
    return max(POINTS, 1 + int(np.ceil(np.sqrt(most / (8 * sag)))))


STEEP = 30.0
"""Degrees between a border and an outline from which on its end stays where it is."""

STEEPER = 15.0
"""Degrees that a place has to be steeper by, at least."""

SHARP = 20.0
"""Degrees that an outline turns by where a border is in the way, at least: so sharp an edge asks for a fillet. To move
all others made 5 % more faces of a dome."""

ENOUGH = 45.0
"""Degrees from which on a place is as good as a steeper one."""

LONGEST = 2.0
"""Length of a chord of a round corner, times the thickness, at most."""

ROUNDS = 3
"""How often ends are moved: chords of one corner may be several chains."""


def with_steep_ends(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """The net whose borders end on round corners steeply; thickness in millimetres."""
    for _ in range(ROUNDS):
        work = _Ends(net, np.asarray(net.weights @ lifting.skins.points), thickness)
        for node in sorted(work.nodes):
            work.take(node)
        if not work.moves:
            break
        net = with_moved_ends(replace(net, chains=work.chains, loops=work.loops), work.moves, lifting)
    return net


class _Ends:
    """nodes : with the chains of the outline before and after each, and a border's end there."""

    def __init__(self, net: ChainNet, P: Floats, thickness: float) -> None:
        self.P, self.t = P, thickness
        self.chains, self.free = dict(net.chains), max(net.chains, default=-1) + 1
        self.loops = {region: [list(loop) for loop in loops] for region, loops in net.loops.items()}
        at = ends_at(net)
        self.degree = {node: len(ends) for node, ends in at.items()}
        self.nodes = {node: three for node, ends in at.items() if (three := outline_and_border(net, ends))}
        self.moves, self.changed = dict[tuple[int, int], int](), set[int]()

    def take(self, node: int) -> None:
        """Move the end of the border at a node, if there is a steeper place."""
        before, after, (seam, end) = self.nodes[node]
        if self.changed & {before, after, seam} or turn_at(self._beside(before, after)) < SHARP:
            return
        line = self.chains[seam].points if end == 0 else self.chains[seam].points[::-1]
        anchor = self._anchor(line)
        now = self._angle_at(before, after, anchor)
        if now >= STEEP:
            return
        places = [(self._steepness(k, i, anchor), k, i) for k in (before, after) for i in self._places(k, node)]
        best, k, i = max(places, key=self._worth, default=(0.0, -1, 0))
        if best < now + STEEPER or not self._moved(k, i, node, (seam, end)):
            return
        self.changed |= {before, after, seam}

    def _worth(self, place: tuple[float, int, int]) -> tuple[float, bool, float]:
        """Of a place, degrees at a point of a chain: an arc's own end is as good as any, and leaves the arc whole."""
        steep, k, i = place
        return min(steep, ENOUGH), i in (0, len(self.chains[k].points) - 1), steep

    def _anchor(self, line: Ints) -> Floats:
        """(3,) the point of a border as far from its end as the sheet is thick."""
        P = self.P[line]
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(P, axis=0), axis=1))])
        return np.array([np.interp(min(self.t, way[-1]), way, column) for column in P.T])

    def _beside(self, before: int, after: int) -> Floats:
        """(3, 3) the points of an outline before, at and after a node."""
        one, two = self.chains[before].points, self.chains[after].points
        return self.P[[one[-2], two[0], two[1]]]

    def _angle_at(self, before: int, after: int, anchor: Floats) -> float:
        """Degrees between an outline where one chain goes on as another and a border with an anchor: a wall keeps its
        direction."""
        P = self._beside(before, after)
        weights = [1.0 - (self._is_round(j) and not self._is_round(k)) for j, k in ((before, after), (after, before))]
        return _angle(P, weights, anchor)

    def _is_round(self, k: int) -> bool:
        """Whether a chain is short, as chords of round corners are, or bends."""
        line = self.P[self.chains[k].points]
        return len(_bent(line)) > 0 or float(np.linalg.norm(line[-1] - line[0])) < LONGEST * self.t

    def _places(self, k: int, node: int) -> list[int]:
        """Points of a chain of a round corner where a border may end: bent ones inside, and its other end if free."""
        points = self.chains[k].points
        long = np.linalg.norm(np.diff(self.P[points], axis=0), axis=1)
        inside = _bent(self.P[points]).tolist()
        other = len(points) - 1 if points[0] == node else 0
        chords = np.concatenate([[0], inside, [len(points) - 1]]).astype(int)
        if max(long[a:b].sum() for a, b in pairwise(chords)) > LONGEST * self.t:
            return []
        return [*inside, other] if self._next(k, other) >= 0 else inside

    def _next(self, k: int, i: int) -> int:
        """The chain of the outline beyond an end of a chain where only these two meet, and it turns a little; or -1."""
        node = int(self.chains[k].points[i])
        if self.degree.get(node) != 2:
            return -1
        region = self.chains[k].left
        loop = next(loop for loop in self.loops[region] if (k, True) in loop)
        j = loop[(loop.index((k, True)) + (1 if i else -1)) % len(loop)][0]
        if len(loop) < 4 or j == k or self.chains[j].right != VOID or j in self.changed:
            return -1
        return j if BENT < np.deg2rad(turn_at(self._beside(k, j) if i else self._beside(j, k))) < CORNER else -1

    def _steepness(self, k: int, i: int, anchor: Floats) -> float:
        """Degrees between the outline and a border with an anchor that ends at a point of a chain."""
        points = self.chains[k].points
        if 0 < i < len(points) - 1:
            return _angle(self.P[points[i - 1 : i + 2]], [1.0, 1.0], anchor)
        j = self._next(k, i)
        return self._angle_at(k, j, anchor) if i else self._angle_at(j, k, anchor)

    def _moved(self, k: int, i: int, node: int, border: tuple[int, int]) -> bool:
        """Whether a border's end could be moved from a node to a point of a chain that ends there."""
        chain = self.chains[k]
        ahead = int(chain.points[0]) == node
        passed, rest = (chain.points[: i + 1], chain.points[i:]) if ahead else (chain.points[i:], chain.points[: i + 1])
        seam, end = border
        mine, other = self.chains[seam].left, self.chains[seam].right
        region = other if mine == chain.left else mine
        loop, theirs = self._loop(chain.left, k), self._loop(region, seam)
        if region == chain.left or not loop or not theirs:
            return False
        at = theirs.index(next(step for step in theirs if step[0] == seam))
        self.chains[self.free] = Chain(passed, region, VOID)
        theirs.insert(at if ahead else at + 1, (self.free, True))
        if len(rest) > 1:
            self.chains[k] = replace(chain, points=rest)
        else:
            loop.remove((k, True))
            del self.chains[k]
        self.moves[seam, end] = int(chain.points[i])
        self.changed.add(self.free)
        self.free += 1
        return True

    def _loop(self, region: int, k: int) -> Loop:
        """The loop of a region with a chain, if it runs through that once."""
        some = [loop for loop in self.loops[region] for step in loop if step[0] == k]
        return some[0] if len(some) == 1 else []


def _bent(line: Floats) -> Ints:
    """Which inner points of a line (k, 3) it turns at."""
    way = np.diff(line, axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    return 1 + np.flatnonzero(np.einsum("ki,ki->k", way[:-1], way[1:]) < np.cos(BENT))


def _angle(three: Floats, weights: list[float], anchor: Floats) -> float:
    """Degrees between the way from the middle one of three points to an anchor and the line through it whose direction
    is the mean of those on both sides."""
    ways = np.diff(three, axis=0)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    along, there = weights @ ways, anchor - three[1]
    cosine = abs(along @ there) / max(float(np.linalg.norm(along) * np.linalg.norm(there)), 1e-300)
    return float(np.degrees(np.arccos(min(1.0, cosine))))
