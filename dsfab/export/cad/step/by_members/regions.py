"""Regions of a sheet, the chains of mesh edges between them, joined outlines, and skin points inside regions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.part import StripedSheet
from dsfab.surface import EdgeTable, connected, edge_table, half_edges, next_half_edge

TURN = np.cos(np.deg2rad(40.0))
"""Cosine of the turn of an outline from which on it has a corner."""

ROUND = np.cos(np.deg2rad(10.0))
"""Cosine of the turn, seen along the sheet's normal, from which on vertices are on a round corner: it begins and ends
at a node. Where a coarse mesh bends, outlines turn with it, and are straight."""

SLIVER = 1 / 4
"""Regions smaller than the square of this share of the thickness join the neighbour with the longest border."""

VOID = -1
"""The region beyond an outline."""

Loop = list[tuple[int, bool]]
"""Chains in order, each with whether it is run through forwards."""


@dataclass(frozen=True, eq=False)
class Chain:
    """points : (k,) rows of the net's weights, nodes first and last.    left, right : regions, right may be VOID."""

    points: Ints
    left: int
    right: int

    def beside(self, region: int, ahead: bool) -> "Chain":
        """The same chain with another region on its left, as it is run through (`ahead`, or backwards)."""
        return Chain(self.points, region, self.right) if ahead else Chain(self.points, self.left, region)


@dataclass(frozen=True, eq=False)
class ChainNet:
    """weights : (p, n) barycentric, of all points on the uncut surface.    chains : by number.
    loops : by region, with the region on the left.    loose : regions that lie in no stripe.    cell : (m,) the region
    of each cell of the sheet.    parent : regions that are parts of one that has cells.    twins : points on both sides
    of a seam, see `StripedSheet`, by each other."""

    weights: csr_array
    chains: dict[int, Chain]
    loops: dict[int, list[Loop]]
    loose: frozenset[int]
    cell: Ints
    parent: dict[int, int] = field(default_factory=dict)
    twins: dict[int, int] = field(default_factory=dict)

    def on_seam(self, k: int) -> bool:
        """Whether a chain runs along a seam: void is beyond it, but in the solid the sheet goes on there."""
        points = self.chains[k].points
        return bool(self.twins) and self.chains[k].right == VOID and all(int(p) in self.twins for p in points)

    def ends(self, step: tuple[int, bool]) -> tuple[int, int]:
        """First and last node of a step of a loop."""
        points, ahead = self.chains[step[0]].points, step[1]
        return (int(points[0]), int(points[-1])) if ahead else (int(points[-1]), int(points[0]))


Creased = Callable[[csr_array, Ints, Ints], Bools]
"""Whether lines between points with weights lie on a crease: see `Sides.along`."""


def net_of(sheet: StripedSheet, V: Floats, N: Floats, thickness: float, creased: Creased | None = None) -> ChainNet:
    """The net of a sheet on an uncut surface with vertices V and normals N (n, 3); both lengths in one unit."""
    P, normals = (np.asarray(sheet.weights @ x) for x in (V, N))
    edges = edge_table(sheet.F)
    start, end = half_edges(sheet.F)
    h = edges.pairs[:, 0]
    apart = creased(sheet.weights, start[h], end[h]) if creased else np.zeros(len(h), dtype=bool)
    region, loose = _regions(sheet, P, edges, thickness, apart)
    return _Walk(sheet, P, normals, edges, region).net(loose)


def ends_at(net: ChainNet) -> dict[int, list[tuple[int, int]]]:
    """By node the ends there, each a chain and 0 where it begins, -1 where it ends."""
    found = dict[int, list[tuple[int, int]]]()
    for k, chain in net.chains.items():
        for end in (0, -1):
            found.setdefault(int(chain.points[end]), []).append((k, end))
    return found


def outline_through(net: ChainNet, ends: list[tuple[int, int]]) -> tuple[int, int] | None:
    """Of the ends at a node the chain of the outline that ends there, and the one that begins; None if not one each."""
    before, after = ([k for k, end in ends if end == which and net.chains[k].right == VOID] for which in (-1, 0))
    return (before[0], after[0]) if len(before) == len(after) == 1 and before != after else None


def turns(before: Floats, after: Floats, N: Floats) -> Floats:
    """(k,) cosines of the angles between ways (k, 3), seen along directions N (k, 3) of any length."""
    one, two = (
        way - N * (np.einsum("ki,ki->k", way, N) / np.einsum("ki,ki->k", N, N))[:, None] for way in (before, after)
    )
    length = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    return np.asarray(np.einsum("ki,ki->k", one, two) / np.maximum(length, 1e-300))


def _regions(
    sheet: StripedSheet, P: Floats, edges: EdgeTable, thickness: float, apart: Bools
) -> tuple[Ints, frozenset[int]]:
    """(m,) the region of each cell, connected and of one label; and those that are loose.

    apart : (i,) pairs of neighbours with a crease between them.
    """
    f, g = edges.pairs.T // 3
    same = (sheet.label[f] == sheet.label[g]) & (sheet.loose[f] == sheet.loose[g]) & ~apart
    count, region = connected(len(sheet.F), f[same], g[same])
    a, b, c = (P[sheet.F[:, i]] for i in range(3))
    area = np.bincount(region, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, count)
    loose = np.zeros(count, dtype=bool)
    loose[region[sheet.loose]] = True
    small = np.flatnonzero((area < (SLIVER * thickness) ** 2) & ~loose)
    ends = edges.ends[edges.of.ravel()[edges.pairs[:, 0]]]
    long = np.linalg.norm(P[ends[:, 0]] - P[ends[:, 1]], axis=1)
    for r in small[np.argsort(area[small], kind="stable")]:
        one, two = region[f], region[g]
        border = (one == r) != (two == r)
        if border.any():
            other = np.where(one == r, two, one)[border]
            region[region == r] = int(np.bincount(other, long[border]).argmax())
    return region, frozenset(np.flatnonzero(loose).tolist())


class _Walk:
    """Along the borders of regions, half-edge by half-edge."""

    def __init__(self, sheet: StripedSheet, P: Floats, N: Floats, edges: EdgeTable, region: Ints) -> None:
        self.weights, self.P, self.N, self.region = sheet.weights, P, N, region
        self.twin = edges.twins
        self.start, self.end = half_edges(sheet.F)
        self.left = np.repeat(region, 3)
        self.right = np.where(self.twin >= 0, region[self.twin // 3], VOID)
        self.border = self.left != self.right
        self.along = np.flatnonzero(self.border)
        self.after = np.full(len(self.border), -1)
        self.after[self.along] = self._successors()
        self.seam = sheet.seam
        self.node = self._nodes(sheet.loose)

    def _successors(self) -> Ints:
        """The half-edge of the same region's border that follows each of its border."""
        step = next_half_edge(self.along)
        while (inside := ~self.border[step]).any():
            step[inside] = next_half_edge(self.twin[step[inside]])
        return step

    def _nodes(self, loose: Bools) -> Bools:
        """(n,) the vertices where chains end."""
        n, h = len(self.P), self.along
        once = h[(self.twin[h] < 0) | (h < self.twin[h])]
        ends = np.concatenate([self.start[once], self.end[once]])
        pair = np.minimum(self.left[once], self.right[once]) * (self.region.max() + 2) + self.left[once]
        pair = pair + self.right[once]  # the same for both ways
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        np.minimum.at(low, ends, np.tile(pair, 2))
        np.maximum.at(high, ends, np.tile(pair, 2))
        node = (np.bincount(ends, minlength=n) > 2) | (high > low) | self._seam_ends(n)
        way = self.P[self.end] - self.P[self.start]
        way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
        turn = np.einsum("ki,ki->k", way[h], way[self.after[h]])
        void = self.right[h] == VOID
        sharp = (turn < TURN) & void & ~loose[h // 3]
        node[self.end[h[sharp]]] = True
        bent = turns(way[h], way[self.after[h]], self.N[self.end[h]]) < ROUND
        node[self.end[h[self._round_ends(bent, void)]]] = True
        for one, two in (self._seam_points, self._seam_points[::-1]):
            node[one[node[two]]] = True
        return node

    @cached_property
    def _seam_points(self) -> Ints:
        """(2, k) vertices at one place on both sides of a seam."""
        one, two = self.seam.T
        return np.stack([np.append(self.start[side], self.end[side]) for side in (one, two)])

    def _seam_ends(self, n: int) -> Bools:
        """(n,) the vertices where a seam ends."""
        return np.asarray(np.bincount(self._seam_points.ravel(), minlength=n) == 1)

    def _round_ends(self, bent: Bools, void: Bools) -> Bools:
        """(k,) half-edges of borders after which the outline begins or ends to be round; `bent` (k,) is the turn there.

        void : (k,) which are of the outline.
        """
        h, at = self.along, np.full(len(self.border), -1)
        at[h] = np.arange(len(h))
        after = at[self.after[h]]
        before = np.empty_like(after)
        before[after] = np.arange(len(h))
        both = void & void[after]
        return np.asarray(bent & both & ~(bent[before] & bent[after] & both[before] & both[after]))

    def net(self, loose: frozenset[int]) -> ChainNet:
        """Its chains, and the loops of every region."""
        cycles = list(self._cycles())
        for cycle in cycles:
            self._mark(cycle)
        chains, number = dict[int, Chain](), dict[int, tuple[int, bool]]()
        loops: dict[int, list[Loop]] = {}
        for cycle in cycles:
            first = int(np.flatnonzero(self.node[self.start[cycle]])[0])
            cycle = np.roll(cycle, -first)
            cuts = np.flatnonzero(self.node[self.start[cycle]])
            loop = list[tuple[int, bool]]()
            for some in np.split(cycle, cuts[1:]):
                key = int(some[0])
                if key not in number:
                    k, left, right = len(chains), int(self.left[key]), int(self.right[key])
                    chains[k] = Chain(np.append(self.start[some], self.end[some[-1]]), left, right)
                    number[key] = k, True
                    if right != VOID:
                        number[int(self.twin[some[-1]])] = k, False
                loop.append(number[key])
            loops.setdefault(int(self.left[cycle[0]]), []).append(loop)
        one, two = self._seam_points.tolist()
        return ChainNet(
            self.weights, chains, loops, loose, self.region, twins=dict(zip(one + two, two + one, strict=True))
        )

    def _cycles(self) -> Iterator[Ints]:
        """The closed borders of regions as half-edges, in order."""
        known = np.zeros(len(self.border), dtype=bool)
        for h in self.along.tolist():
            if known[h]:
                continue
            cycle, at = list[int](), h
            while not known[at]:
                known[at] = True
                cycle.append(at)
                at = int(self.after[at])
            yield np.array(cycle)

    def _mark(self, cycle: Ints) -> None:
        """Make two vertices of a border nodes at least, and four where it has none."""
        at = np.flatnonzero(self.node[self.start[cycle]])
        if len(at) > 1:
            return
        way = np.linalg.norm(self.P[self.end[cycle]] - self.P[self.start[cycle]], axis=1)
        first = int(at[0]) if len(at) else int(np.argmin(self.start[cycle]))
        some = np.roll(cycle, -first)
        share = np.concatenate([[0.0], np.cumsum(np.roll(way, -first))[:-1]]) / way.sum()
        wanted = (0.0, 0.25, 0.5, 0.75) if not len(at) else (0.0, 0.5)
        for x in wanted:
            self.node[self.start[some[np.abs(share - x).argmin()]]] = True


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


INNER = ((1 / 3, 1 / 3, 1 / 3), (2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3))
"""Barycentric weights of the points where a trimmed face is held in each cell: with the middle alone it may wave."""

MORE = tuple((a / 7, b / 7, 1 - (a + b) / 7) for a in range(1, 6) for b in range(1, 7 - a))
"""Of more points in cells that are longer than the sheet is thick: between four of them a surface of degree 9 waved by
6 mm, in triangles of 180 mm of a canopy of 100 mm."""

OF_REGION = 1 / 6
"""Share of its region's size that a shorter cell is long from, too: in a notched region of 200 mm of a sheet of 60 mm
one of degree 9 waved by 4 mm between the points of cells of 50 mm."""


@dataclass(frozen=True, eq=False)
class Interior:
    """Where it is asked for.    fine : whether long cells have `MORE` points."""

    sheet: StripedSheet
    lifting: Lifting
    thickness: float
    fine: bool = False

    def points(self, net: ChainNet, regions: Sequence[int]) -> dict[int, Floats]:
        """By region, (k, 6) points of the skins over its cells; all are found at once."""
        if not regions:
            return {}
        cells = [np.flatnonzero(net.cell == net.parent.get(region, region)) for region in regions]
        F: Ints = self.sheet.F[np.concatenate(cells)]
        of = np.repeat(np.arange(len(regions)), [len(some) for some in cells])
        found, region = [self._lifted(F, INNER)], [np.tile(of, len(INNER))]
        if self.fine and (long := self._are_long(F, self._sizes(net, regions)[of])).any():
            found.append(self._lifted(F[long], MORE))
            region.append(np.tile(of[long], len(MORE)))
        order = np.argsort(np.concatenate(region), kind="stable")
        ends = np.cumsum(np.bincount(np.concatenate(region), minlength=len(regions)))[:-1]
        return dict(zip(regions, np.split(np.concatenate(found)[order], ends), strict=True))

    def _lifted(self, F: Ints, weights: Sequence[tuple[float, float, float]]) -> Floats:
        """(k m, 6) points at each of k weights of cells (m, 3)."""
        a, b, c = (self.sheet.weights[F[:, i]] for i in range(3))
        return self.lifting.points(csr_array(vstack([a * u + b * v + c * w for u, v, w in weights], format="csr")))

    def _are_long(self, F: Ints, size: Floats) -> Bools:
        """(m,) whether a side of cells (m, 3) is longer than the sheet is thick, or for its region's size (m,)."""
        P = self._on_mesh(self.sheet.weights)[F]
        long = np.linalg.norm(P - np.roll(P, 1, axis=1), axis=2).max(axis=1)
        return np.asarray(long > np.minimum(self.thickness, OF_REGION * size))

    def _sizes(self, net: ChainNet, regions: Sequence[int]) -> Floats:
        """(r,) diagonals of boxes around the outlines of regions, millimetres."""
        P = self._on_mesh(net.weights)
        outlines = ([net.chains[k].points for loop in net.loops[region] for k, _ in loop] for region in regions)
        return np.array([np.linalg.norm(np.ptp(P[np.concatenate(line)], axis=0)) for line in outlines])

    def _on_mesh(self, weights: csr_array) -> Floats:
        """(k, 3) millimetres, places of weights (k, n)."""
        return np.asarray(weights @ self.lifting.skins.points)
