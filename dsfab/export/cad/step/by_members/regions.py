"""Regions of a sheet, and chains of mesh edges between regions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, polygon_perimeter, unit_vectors
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.part import StripedSheet
from dsfab.surface import EdgeTable, edge_table, half_edges, link_components, next_half_edge

CORNER_COSINE = np.cos(np.deg2rad(40.0))  # cosine of the smallest bend at a corner of an outline

ROUND_COSINE = np.cos(np.deg2rad(10.0))
"""Cosine of the smallest bend between two edges at a vertex of a round corner.
Bends are measured in the plane of the sheet. Bends out of this plane come from the coarse mesh."""

VOID = -1  # number in place of a region, for the space beyond an outline
ChainLoop = list[tuple[int, bool]]  # chain numbers in order; True if the loop runs along the chain


@dataclass(frozen=True, eq=False)
class Chain:
    """Chain of mesh edges between two nodes.    left, right : numbers of regions; `VOID` for no region.
    points : (k,) numbers of points along the chain. The first and the last point are nodes."""

    points: Ints
    left: int
    right: int

    def directed_points(self, ahead: bool) -> Ints:
        """Return the point numbers (k,) of this chain, in reverse order unless `ahead`."""
        return self.points if ahead else self.points[::-1]

    def region_beyond(self, ahead: bool) -> int:
        """Return the number of the region on the right of the chain if `ahead`, else on the left."""
        return self.right if ahead else self.left

    def with_region(self, region: int, ahead: bool) -> "Chain":
        """Return the chain with `region` on its left if `ahead`, else on its right."""
        return Chain(self.points, region, self.right) if ahead else Chain(self.points, self.left, region)


@dataclass(frozen=True, eq=False)
class ChainNet:
    """Regions of a sheet, and the chains of mesh edges between regions.
    weights : (p, n) barycentric weights of all points on the uncut surface.    chains : by chain number.
    loops   : by region, loops of chains with the region on the left.    loose : regions outside of all stripes.
    cell    : (m,) region of each face of the sheet. For faces of a cut-off region: its parent region.
    parent  : number of a cut-off region -> number of the region from which it was cut.
    twins   : point on the seam -> point at the same place on the opposite side of the seam."""

    weights: csr_array
    chains: dict[int, Chain]
    loops: dict[int, list[ChainLoop]]
    loose: frozenset[int]
    cell: Ints
    parent: dict[int, int] = field(default_factory=dict)
    twins: dict[int, int] = field(default_factory=dict)

    def on_seam(self, k: int) -> bool:
        """Return True if chain k lies on the seam where a one-sided sheet was cut open."""
        points = self.chains[k].points
        return bool(self.twins) and self.chains[k].right == VOID and all(int(p) in self.twins for p in points)

    def ends(self, step: tuple[int, bool]) -> tuple[int, int]:
        """Return the first and last node of a chain. step : chain number, and True for the chain's own direction."""
        points = self.chains[step[0]].directed_points(step[1])
        return int(points[0]), int(points[-1])


CreaseTest = Callable[[csr_array, Ints, Ints], Bools]
"""Function that marks the segments between two points on a crease, see `CreaseSides.lines_on_creases`."""


def net_of(sheet: StripedSheet, V: Floats, N: Floats, thickness: float, creased: CreaseTest | None = None) -> ChainNet:
    """Return the regions of a sheet, and the chains of mesh edges between regions.
    V, N : (n, 3) vertices and normals of the uncut surface.    creased : test for segments on a crease."""
    P, normals = (np.asarray(sheet.weights @ x) for x in (V, N))
    edges = edge_table(sheet.F)
    start, end = half_edges(sheet.F)
    h = edges.pairs[:, 0]
    apart = creased(sheet.weights, start[h], end[h]) if creased else np.zeros(len(h), dtype=bool)
    region, loose = _regions(sheet, P, edges, thickness, apart)
    return _BorderWalk(sheet, P, normals, edges, region).net(loose)


def ends_at(net: ChainNet) -> dict[int, list[tuple[int, int]]]:
    """Return, by node, the ends of the chains there: (chain, 0) for a chain's start, (chain, -1) for its end."""
    node_ends = dict[int, list[tuple[int, int]]]()
    for k, chain in net.chains.items():
        for end in (0, -1):
            node_ends.setdefault(int(chain.points[end]), []).append((k, end))
    return node_ends


def outline_through(net: ChainNet, ends: list[tuple[int, int]]) -> tuple[int, int] | None:
    """Return the numbers of the outline's chain that ends at a node, and of its chain that begins at the node.
    Return None unless exactly one outline passes.    ends : ends of the chains at the node."""
    before, after = ([k for k, end in ends if end == which and net.chains[k].right == VOID] for which in (-1, 0))
    return (before[0], after[0]) if len(before) == len(after) == 1 and before != after else None


def turns(before: Floats, after: Floats, N: Floats) -> Floats:
    """Return cosines (k,) of the angles between `before` and `after` (k, 3) after projection along normals N (k, 3)."""
    flat_before, flat_after = (
        direction - N * (np.einsum("ki,ki->k", direction, N) / np.einsum("ki,ki->k", N, N))[:, None]
        for direction in (before, after)
    )
    length = np.linalg.norm(flat_before, axis=1) * np.linalg.norm(flat_after, axis=1)
    return np.asarray(np.einsum("ki,ki->k", flat_before, flat_after) / np.maximum(length, 1e-300))


def _regions(
    sheet: StripedSheet, P: Floats, edges: EdgeTable, thickness: float, apart: Bools
) -> tuple[Ints, frozenset[int]]:
    """Return the region (m,) of each face, and the numbers of the regions outside stripes."""
    sliver = 1 / 4  # a region with an area below (thickness / 4)^2 joins a neighbour
    f, g = edges.pairs.T // 3
    is_joined = (sheet.label[f] == sheet.label[g]) & (sheet.loose[f] == sheet.loose[g]) & ~apart
    count, region = link_components(len(sheet.F), f[is_joined], g[is_joined])
    area = np.bincount(region, np.linalg.norm(area_vectors(P, sheet.F), axis=1) / 2, count)
    loose = np.zeros(count, dtype=bool)
    loose[region[sheet.loose]] = True
    small = np.flatnonzero((area < (sliver * thickness) ** 2) & ~loose)
    ends = edges.ends[edges.of.ravel()[edges.pairs[:, 0]]]
    long = np.linalg.norm(P[ends[:, 0]] - P[ends[:, 1]], axis=1)
    for r in small[np.argsort(area[small], kind="stable")]:
        regions_left, regions_right = region[f], region[g]
        border = (regions_left == r) != (regions_right == r)
        if border.any():
            neighbour = np.where(regions_left == r, regions_right, regions_left)[border]
            region[region == r] = int(np.bincount(neighbour, long[border]).argmax())
    return region, frozenset(np.flatnonzero(loose).tolist())


class _BorderWalk:
    def __init__(self, sheet: StripedSheet, P: Floats, N: Floats, edges: EdgeTable, region: Ints) -> None:
        self.weights, self.P, self.N, self.region = sheet.weights, P, N, region
        self.twin = edges.twins
        self.start, self.end = half_edges(sheet.F)
        self.left = np.repeat(region, 3)
        self.right = np.where(self.twin >= 0, region[self.twin // 3], VOID)
        self.border = self.left != self.right
        self.along = np.flatnonzero(self.border)
        self.after = np.full(len(self.border), -1)
        step = next_half_edge(self.along)
        while (inside := ~self.border[step]).any():
            step[inside] = next_half_edge(self.twin[step[inside]])
        self.after[self.along] = step
        self.seam = sheet.seam
        self.node = self._nodes(sheet.loose)

    def _nodes(self, loose: Bools) -> Bools:
        n, h = len(self.P), self.along
        once = h[(self.twin[h] < 0) | (h < self.twin[h])]
        ends = np.concatenate([self.start[once], self.end[once]])
        pair = np.minimum(self.left[once], self.right[once]) * (self.region.max() + 2) + self.left[once]
        pair = pair + self.right[once]  # a number for each pair of regions, in either order
        low, high = np.full(n, np.inf), np.full(n, -np.inf)
        np.minimum.at(low, ends, np.tile(pair, 2))
        np.maximum.at(high, ends, np.tile(pair, 2))
        is_seam_end = np.bincount(self._seam_points.ravel(), minlength=n) == 1
        node = (np.bincount(ends, minlength=n) > 2) | (high > low) | is_seam_end
        direction = unit_vectors(self.P[self.end] - self.P[self.start])
        turn = np.einsum("ki,ki->k", direction[h], direction[self.after[h]])
        void = self.right[h] == VOID
        sharp = (turn < CORNER_COSINE) & void & ~loose[h // 3]
        node[self.end[h[sharp]]] = True
        bent = turns(direction[h], direction[self.after[h]], self.N[self.end[h]]) < ROUND_COSINE
        node[self.end[h[self._round_ends(bent, void)]]] = True
        for side_a, side_b in (self._seam_points, self._seam_points[::-1]):
            node[side_a[node[side_b]]] = True
        return np.asarray(node)

    @cached_property
    def _seam_points(self) -> Ints:
        """Pairs (2, k) of vertices at the same place on the two sides of the seam."""
        side_a, side_b = self.seam.T
        return np.stack([np.append(self.start[side], self.end[side]) for side in (side_a, side_b)])

    def _round_ends(self, bent: Bools, void: Bools) -> Bools:
        h, position = self.along, np.full(len(self.border), -1)
        position[h] = np.arange(len(h))
        after = position[self.after[h]]
        before = np.empty_like(after)
        before[after] = np.arange(len(h))
        is_outline = void & void[after]
        return np.asarray(bent & is_outline & ~(bent[before] & bent[after] & is_outline[before] & is_outline[after]))

    def net(self, loose: frozenset[int]) -> ChainNet:
        cycles = list(self._cycles())
        for cycle in cycles:
            self._mark(cycle)
        chains, number = dict[int, Chain](), dict[int, tuple[int, bool]]()
        loops: dict[int, list[ChainLoop]] = {}
        for cycle in cycles:
            begin = int(np.flatnonzero(self.node[self.start[cycle]])[0])
            cycle = np.roll(cycle, -begin)
            cuts = np.flatnonzero(self.node[self.start[cycle]])
            loop = list[tuple[int, bool]]()
            for part in np.split(cycle, cuts[1:]):
                key = int(part[0])
                if key not in number:
                    k, left_region, right_region = len(chains), int(self.left[key]), int(self.right[key])
                    chains[k] = Chain(np.append(self.start[part], self.end[part[-1]]), left_region, right_region)
                    number[key] = k, True
                    if right_region != VOID:
                        number[int(self.twin[part[-1]])] = k, False
                loop.append(number[key])
            loops.setdefault(int(self.left[cycle[0]]), []).append(loop)
        seam_a, seam_b = self._seam_points.tolist()
        twins = dict(zip(seam_a + seam_b, seam_b + seam_a, strict=True))
        return ChainNet(self.weights, chains, loops, loose, self.region, twins=twins)

    def _cycles(self) -> Iterator[Ints]:
        seen = np.zeros(len(self.border), dtype=bool)
        for h in self.along.tolist():
            if seen[h]:
                continue
            cycle, half_edge = list[int](), h
            while not seen[half_edge]:
                seen[half_edge] = True
                cycle.append(half_edge)
                half_edge = int(self.after[half_edge])
            yield np.array(cycle)

    def _mark(self, cycle: Ints) -> None:
        marked = np.flatnonzero(self.node[self.start[cycle]])
        if len(marked) > 1:
            return
        lengths = np.linalg.norm(self.P[self.end[cycle]] - self.P[self.start[cycle]], axis=1)
        begin = int(marked[0]) if len(marked) else int(np.argmin(self.start[cycle]))
        turned_cycle = np.roll(cycle, -begin)
        share = np.concatenate([[0.0], np.cumsum(np.roll(lengths, -begin))[:-1]]) / lengths.sum()
        shares = (0.0, 0.25, 0.5, 0.75) if not len(marked) else (0.0, 0.5)
        for x in shares:
            self.node[self.start[turned_cycle[np.abs(share - x).argmin()]]] = True


def joined_outlines(net: ChainNet, P: Floats, N: Floats) -> ChainNet:
    """Join consecutive chains along a round corner or a straight wall. P, N : (p, 3) points and normals."""
    ends = [int(p) for chain in net.chains.values() for p in (chain.points[0], chain.points[-1])]
    degree = np.bincount(ends, minlength=len(P))
    degree[list(net.twins)] = 0  # chains on the two sides of a seam are not joined
    chains = dict(net.chains)
    loops = {r: [_joined_loop(loop, chains, P, N, degree) for loop in group] for r, group in net.loops.items()}
    return replace(net, chains=chains, loops=loops)


def _joined_loop(loop: ChainLoop, chains: dict[int, Chain], P: Floats, N: Floats, degree: Ints) -> ChainLoop:
    fewest = 4  # a loop around a region keeps at least 4 chains
    if all(chains[k].right == VOID for k, _ in loop):
        return loop
    steps, position = list(loop), 0
    while position < len(steps) and len(steps) > fewest:
        (j, _), (k, _) = steps[position - 1], steps[position]
        a, b = chains[j], chains[k]
        outer = a.right == VOID and b.right == VOID and j != k
        around = _outline_points(steps, position, chains)
        if outer and degree[b.points[0]] == 2 and not _is_outline_end(P[around], N[around]):
            chains[j] = replace(a, points=np.concatenate([a.points, b.points[1:]]))
            del chains[k], steps[position]
        else:
            position += 1
    return steps


def _outline_points(loop: ChainLoop, position: int, chains: dict[int, Chain]) -> Ints:
    parts = [chains[loop[(position + i) % len(loop)][0]] for i in (-2, -1, 0, 1)]
    before, after = parts[1].points, parts[2].points
    if parts[0].right == VOID:
        before = np.concatenate([parts[0].points[:-1], before])
    if parts[3].right == VOID:
        after = np.concatenate([after, parts[3].points[1:]])
    return np.concatenate([before[-3:-1], after[:3]]) if min(len(before), len(after)) > 2 else after[:0]


def _is_outline_end(line: Floats, N: Floats) -> bool:
    """Return True if a wall ends at the middle point of 5 outline points (5, 3). N : (5, 3) normals of the sheet."""
    if len(line) < 5:
        return True
    d = np.diff(line, axis=0)
    before, at_middle, after = turns(d[:-1], d[1:], N[1:-1])
    sharp = d[1] @ d[2] < CORNER_COSINE * np.linalg.norm(d[1]) * np.linalg.norm(d[2])
    return bool(sharp or (at_middle < ROUND_COSINE and max(before, after) >= ROUND_COSINE))


def without_lenses(net: ChainNet, P: Floats, width: float) -> ChainNet:
    """Join each narrow region between two chains to a neighbouring region. P : (p, 3) points of the chains.
    width : least mean width, in the unit of P."""
    chains, loops, loose, cell = dict(net.chains), dict(net.loops), set(net.loose), net.cell.copy()
    for region in list(loops):
        if len(loops[region]) != 1 or len(loops[region][0]) != 2:
            continue
        steps = loops[region][0]
        sides = [chains[k].directed_points(ahead) for k, ahead in steps]
        beyond = [chains[k].region_beyond(ahead) for k, ahead in steps]
        inner = [i for i in (0, 1) if beyond[i] not in (VOID, region)]
        if not inner or region in beyond or mean_width(P[np.concatenate([p[:-1] for p in sides])]) >= width:
            continue
        (gone, ahead), rest, neighbour = steps[inner[0]], steps[1 - inner[0]], beyond[inner[0]]
        loops[neighbour] = [[rest if step == (gone, not ahead) else step for step in loop] for loop in loops[neighbour]]
        chains[rest[0]] = chains[rest[0]].with_region(neighbour, rest[1])
        del chains[gone], loops[region]
        loose.discard(region)
        cell[cell == region] = neighbour
    return replace(net, chains=chains, loops=loops, loose=frozenset(loose), cell=cell)


def mean_width(line: Floats) -> float:
    """Return the mean width inside a closed line (k, 3): the enclosed area / half of the line's length."""
    return 2 * float(np.linalg.norm(vector_area(line))) / max(polygon_perimeter(line), 1e-300)


def vector_area(line: Floats) -> Floats:
    """Return the area vector (3,) of a closed line (k, 3)."""
    line = line - line.mean(axis=0)
    return np.asarray(np.cross(line, np.roll(line, -1, axis=0)).sum(axis=0) / 2)


INNER = ((1 / 3, 1 / 3, 1 / 3), (2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3))
"""Barycentric coordinates of the points in each mesh face to which a trimmed face is fitted."""

MORE = tuple((a / 7, b / 7, 1 - (a + b) / 7) for a in range(1, 6) for b in range(1, 7 - a))
"""More barycentric coordinates for mesh faces longer than the sheet's thickness. They prevent waves in fitted faces."""


@dataclass(frozen=True, eq=False)
class RegionInterior:
    """Points inside regions, on both skins of the sheet.    fine : True for more points in long triangles."""

    sheet: StripedSheet
    lifting: Lifting
    thickness: float
    fine: bool = False

    def points(self, net: ChainNet, regions: Sequence[int]) -> dict[int, Floats]:
        """Return points (k, 6) inside each region, by region number. A row has two points, one on each skin."""
        if not regions:
            return {}
        cells = [np.flatnonzero(net.cell == net.parent.get(region, region)) for region in regions]
        F: Ints = self.sheet.F[np.concatenate(cells)]
        cell_region = np.repeat(np.arange(len(regions)), [len(region_cells) for region_cells in cells])
        point_rows, region = [self._skin_points(F, INNER)], [np.tile(cell_region, len(INNER))]
        if self.fine and (long := self._are_long(F, self._sizes(net, regions)[cell_region])).any():
            point_rows.append(self._skin_points(F[long], MORE))
            region.append(np.tile(cell_region[long], len(MORE)))
        order = np.argsort(np.concatenate(region), kind="stable")
        ends = np.cumsum(np.bincount(np.concatenate(region), minlength=len(regions)))[:-1]
        return dict(zip(regions, np.split(np.concatenate(point_rows)[order], ends), strict=True))

    def _skin_points(self, F: Ints, weights: Sequence[tuple[float, float, float]]) -> Floats:
        a, b, c = (self.sheet.weights[F[:, i]] for i in range(3))
        return self.lifting.points(csr_array(vstack([a * u + b * v + c * w for u, v, w in weights], format="csr")))

    def _are_long(self, F: Ints, size: Floats) -> Bools:
        region_share = 1 / 6  # a side is long if it is longer than a sixth of the region's size
        P = np.asarray(self.sheet.weights @ self.lifting.skins.points)[F]
        long = np.linalg.norm(P - np.roll(P, 1, axis=1), axis=2).max(axis=1)
        return np.asarray(long > np.minimum(self.thickness, region_share * size))

    def _sizes(self, net: ChainNet, regions: Sequence[int]) -> Floats:
        P = np.asarray(net.weights @ self.lifting.skins.points)
        outlines = ([net.chains[k].points for loop in net.loops[region] for k, _ in loop] for region in regions)
        return np.array([np.linalg.norm(np.ptp(P[np.concatenate(line)], axis=0)) for line in outlines])
