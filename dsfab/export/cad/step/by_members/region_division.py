"""Division of long and of strongly bent regions."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, cross, unit_vectors
from dsfab.export.cad.step.by_members.curves import sampled_chains
from dsfab.export.cad.step.by_members.patch_sides import REACH_SHARE, quad_of
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainLoop, ChainNet, mean_width, vector_area
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.shared.skins import SmoothLimits
from dsfab.export.part import StripedSheet
from dsfab.export.splines import polyline_length
from dsfab.surface import edge_table, half_edges, link_components


def with_cut_ends(net: ChainNet, regions: Iterable[int], lifting: Lifting, width: float) -> ChainNet:
    """Cut the two ends off each region between two long walls, so that the ends become new regions.
    An end narrower than `width` (mm) stays in its region."""
    points_each = 9  # a chain that divides a region has 9 points
    P = np.asarray(net.weights @ lifting.skins.points)
    chains, loops, cell = dict(net.chains), dict(net.loops), dict(net.parent)
    free, count, lines = max(loops) + 1, len(P), list[Floats]()
    for region in regions:
        walls = _long_walls(net, loops[region], P)
        if walls is None:
            continue
        loop = loops[region][0]
        i, j = walls
        region_area = vector_area(P[_points(net, loop)])
        turned = [*loop[i:], *loop[:i]]
        ends = [turned[1 : j - i], turned[j - i + 1 :]]
        member: ChainLoop = [turned[0]]
        for wall, end in zip((turned[0], turned[j - i]), ends, strict=True):
            if member[-1] != wall:
                member.append(wall)
            if len(end) == 1 or is_narrow_end(net, end, P, width, region_area):
                member += end
                continue
            a, b = net.ends(end[0])[0], net.ends(end[-1])[1]
            k, between = max(chains) + 1, np.arange(count, count + points_each - 2)
            lines.append(P[a] + np.linspace(0, 1, points_each)[1:-1, None] * (P[b] - P[a]))
            chains[k] = Chain(np.concatenate([[a], between, [b]]), region, free)
            count += len(between)
            member.append((k, True))
            loops[free] = [[*end, (k, False)]]
            cell[free] = cell.get(region, region)
            for e, ahead in end:
                chains[e] = chains[e].with_region(free, ahead)
            free += 1
        loops[region] = [member]
    if not lines:
        return net
    weights = csr_array(vstack([net.weights, lifting.weights_at(np.concatenate(lines))], format="csr"))
    return replace(net, weights=weights, chains=chains, loops=loops, parent=cell)


def _long_walls(net: ChainNet, loops: list[ChainLoop], P: Floats) -> tuple[int, int] | None:
    """Return the positions of the two long walls in a region's loop of chains; None without two long walls."""
    long = 1.5  # a member's walls are longer than 1.5 times the distance between the walls
    if len(loops) != 1 or len(loops[0]) < 5:
        return None
    loop = loops[0]
    chains = [net.chains[k] for k, _ in loop]
    length = np.array([polyline_length(P[chain.points]) if chain.right == VOID else 0.0 for chain in chains])
    i, j = np.sort(np.argsort(-length, kind="stable")[:2]).tolist()
    if j - i < 2 or i + len(loop) - j < 2:
        return None
    (a, b), (c, d) = net.ends(loop[i]), net.ends(loop[j])
    apart = max(np.linalg.norm(P[a] - P[d]), np.linalg.norm(P[b] - P[c]))
    return (i, j) if min(length[i], length[j]) > long * apart > 0 else None


def is_narrow_end(net: ChainNet, end: ChainLoop, P: Floats, width: float, region_area: Floats) -> bool:
    """Return True if an end is narrower than `width` (mm), or if a straight cut at the end leaves the region.
    end : chains of the end.    P : (n, 3) points, mm.    region_area : (3,) area vector of the region."""
    line = P[_points(net, end)]
    return mean_width(line) < width or float(vector_area(line) @ region_area) < 0


def _points(net: ChainNet, loop: ChainLoop) -> Ints:
    return np.concatenate([net.chains[k].directed_points(ahead) for k, ahead in loop])


LEAST_COSINE = 0.75
"""Smallest cosine between the normals and the mean normal of a region. Below this value, a region may be divided."""


def level(net: ChainNet, sheet: StripedSheet, lifting: Lifting, limits: SmoothLimits) -> ChainNet:
    """Divide strongly bent regions into flatter parts. The first points of `net` must be the points of `sheet`."""
    most_seams = 200  # a sheet gets at most 200 seams
    work = _BendSeams(net, sheet, lifting, limits.thickness)
    bends = {r: work.least_cosine(r) for r, loops in net.loops.items() if len(loops) == 1}
    todo = {r: x for r, x in bends.items() if x < LEAST_COSINE and not _is_member(work, r, lifting, limits)}
    for _ in range(most_seams):
        if not todo:
            break
        region = min(todo, key=todo.__getitem__)
        del todo[region]
        if (added_region := work.divide(region)) >= 0:
            todo |= {r: least for r in (region, added_region) if (least := work.least_cosine(r)) < LEAST_COSINE}
    return work.net


def _is_member(work: "_BendSeams", region: int, lifting: Lifting, limits: SmoothLimits) -> bool:
    if region in work.net.loose or work.is_stout(region):
        return False
    chains = {k: work.net.chains[k] for k, _ in work.net.loops[region][0]}
    alone = replace(work.net, chains=chains, loops={region: work.net.loops[region]})
    reach = REACH_SHARE * limits.thickness
    return quad_of(region, alone.loops[region], sampled_chains(alone, lifting, limits), reach) is not None


class _BendSeams:
    def __init__(self, net: ChainNet, sheet: StripedSheet, lifting: Lifting, wall_distance: float) -> None:
        self.near = wall_distance
        self.net, self.F, self.skins = net, sheet.F, lifting.skins
        self.P = np.asarray(sheet.weights @ self.skins.points)
        a, b, c = (self.P[self.F[:, i]] for i in range(3))
        N = np.asarray(sheet.weights @ self.skins.normals)[self.F].sum(axis=1)  # face normals are wrong at slivers
        self.N = unit_vectors(N) * np.linalg.norm(cross(b - a, c - a), axis=1)[:, None]

    def least_cosine(self, region: int) -> float:
        cells = np.flatnonzero(self.net.cell == region)
        if not len(cells):
            return 1.0
        outline = np.concatenate([self.net.chains[k].points for loop in self.net.loops[region] for k, _ in loop])
        N = unit_vectors(np.concatenate([self.N[cells], self.net.weights[outline] @ self.skins.normals]))
        mean = N.sum(axis=0)
        return float((N @ mean).min() / max(np.linalg.norm(mean), 1e-300))

    def is_stout(self, region: int) -> bool:
        stout_limit = 32.0  # largest perimeter^2 / area; 16 for a square, 29 for a row of five squares
        area = np.linalg.norm(self.N[self.net.cell == region], axis=1).sum() / 2
        outline = sum(self._length(self.net.chains[k].points) for k, _ in self.net.loops[region][0])
        return bool(outline**2 < stout_limit * area)

    def _normal_spread(self, cells: Ints) -> float:
        N = self.N[cells]
        return float(np.linalg.norm(N, axis=1).sum() - np.linalg.norm(N.sum(axis=0)))

    def divide(self, region: int) -> int:
        """Divide a region by a seam (row of mesh edges); return the new region's number, or -1 without a seam."""
        seam = self._seam(region)
        if seam is None and self._halve_chains(region):
            seam = self._seam(region)
        return -1 if seam is None else self._with_seam(region, *seam)

    def _seam(self, region: int) -> tuple[Ints, Ints] | None:
        most_left = 0.8  # the cost (bending and seam) of a divided region must be below this fraction of its old cost
        seam_cost = 0.1  # cost of a seam whose length is the square root of the region's area
        cells = np.flatnonzero(self.net.cell == region)
        nodes = [self.net.ends(step)[0] for step in self.net.loops[region][0]]
        whole_spread, size = self._normal_spread(cells), np.sqrt(np.linalg.norm(self.N[cells], axis=1).sum())
        result, least = None, most_left
        for path, long in _paths(self.F[cells], self.P, nodes, self.near):
            right = _on_the_right(self.F[cells], path)
            remaining = self._normal_spread(cells[right]) + self._normal_spread(cells[~right])
            if (worth := remaining / whole_spread + seam_cost * long / size) < least:
                result, least = (path, cells[right]), worth
        return result

    def _halve_chains(self, region: int) -> bool:
        few = 8  # a chain of edges is halved only if it is longer than an eighth of the region's outline
        long = {k: self._length(self.net.chains[k].points) for k, _ in self.net.loops[region][0]}
        longest = [k for k, x in long.items() if few * x > sum(long.values()) and len(self.net.chains[k].points) > 2]
        for k in longest:
            chain, added_chain = self.net.chains[k], max(self.net.chains) + 1
            half = len(chain.points) // 2
            first_half, second_half = replace(chain, points=chain.points[: half + 1]), chain.points[half:]
            two = {(k, True): [(k, True), (added_chain, True)], (k, False): [(added_chain, False), (k, False)]}
            neighbours = {r: self.net.loops[r] for r in {chain.left, chain.right} - {VOID}}
            loops = {
                r: [[part for step in loop for part in two.get(step, [step])] for loop in loops]
                for r, loops in neighbours.items()
            }
            chains = self.net.chains | {k: first_half, added_chain: replace(chain, points=second_half)}
            self.net = replace(self.net, chains=chains, loops=self.net.loops | loops)
        return len(longest) > 0

    def _length(self, points: Ints) -> float:
        return polyline_length(self.net.weights[points] @ self.skins.points)

    def _with_seam(self, region: int, path: Ints, right: Ints) -> int:
        chains, loops, cell = dict(self.net.chains), dict(self.net.loops), self.net.cell.copy()
        loop, added_region, first_chain = loops[region][0], max(*loops, int(cell.max())) + 1, max(chains) + 1
        nodes = [self.net.ends(step)[0] for step in loop]
        i, j = nodes.index(int(path[0])), nodes.index(int(path[-1]))
        parts = [path] if len(path) < 3 else [path[: len(path) // 2 + 1], path[len(path) // 2 :]]
        seam: ChainLoop = []
        for k, part in enumerate(parts, first_chain):
            chains[k] = Chain(part, region, added_region)
            seam.append((k, True))
        loops[added_region] = [[*loop[i:j], *[(k, False) for k, _ in seam[::-1]]]]
        loops[region] = [[*loop[:i], *seam, *loop[j:]]]
        for step, ahead in loop[i:j]:
            chains[step] = chains[step].with_region(added_region, ahead)
        cell[right] = added_region
        self.net = replace(self.net, chains=chains, loops=loops, cell=cell)
        return added_region


def _paths(F: Ints, P: Floats, nodes: list[int], wall_distance: float) -> Iterator[tuple[Ints, float]]:
    used, local = np.unique(F, return_inverse=True)
    edges = edge_table(local.reshape(-1, 3))
    place = {int(v): x for x, v in enumerate(used) if nodes.count(int(v)) == 1}
    ends = edges.ends[~edges.boundary]
    border = np.zeros(len(used), dtype=bool)
    border[edges.ends[edges.boundary]] = True
    away = np.asarray(cKDTree(P[used[border]]).query(P[used])[0])
    # paths keep away from the region's walls, because a path is straightened later and could then cross a wall
    wall_factor = 1 + wall_distance / np.maximum(away[ends].mean(axis=1), wall_distance / 4)
    long = np.tile(wall_factor * np.linalg.norm(P[used[ends[:, 0]]] - P[used[ends[:, 1]]], axis=1), 2)
    start, end = np.concatenate([ends, ends[:, ::-1]]).T
    for i, node in enumerate(nodes):
        if node not in place:
            continue
        out = ~border[start] | (start == place[node])  # a path ends at the outline
        graph = csr_array((long[out], (start[out], end[out])), shape=(len(used), len(used)))
        distances, before = (x[0] for x in dijkstra(graph, indices=[place[node]], return_predecessors=True))
        for end_node in nodes[i + 1 :]:
            if end_node in place and np.isfinite(distances[place[end_node]]):
                path = [place[end_node]]
                while path[-1] != place[node]:
                    path.append(int(before[path[-1]]))
                yield used[path[::-1]], float(distances[place[end_node]])


def _on_the_right(F: Ints, path: Ints) -> Bools:
    _, local = np.unique(np.append(F.ravel(), path), return_inverse=True)
    cells, line = local[: F.size].reshape(-1, 3), local[F.size :]
    edges = edge_table(cells)
    half_edges_a, half_edges_b = edges.pairs.T
    steps = np.sort(np.stack([line[:-1], line[1:]], axis=1), axis=1)
    across = np.isin(edges.of.ravel()[half_edges_a], edges.edges_between(steps[:, 0], steps[:, 1]))
    _, part = link_components(len(F), half_edges_a[~across] // 3, half_edges_b[~across] // 3)
    start, end = half_edges(cells)
    backwards = {(int(b), int(a)) for a, b in pairwise(line)}
    adjacent = np.concatenate([half_edges_a[across], half_edges_b[across]]).tolist()
    right_cells = [h // 3 for h in adjacent if (int(start[h]), int(end[h])) in backwards]
    return np.isin(part, part[right_cells])
