"""Round corners of openings."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Floats, Ints
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainLoop, ChainNet, ends_at, outline_through
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.splines import arc_lengths, polyline_length


def with_moved_ends(net: ChainNet, moves: Mapping[tuple[int, int], int], lifting: Lifting) -> ChainNet:
    """Move ends of chains (rows of mesh edges). moves : (chain, 0 for start, -1 for end) -> new end point number."""
    P: Floats = np.asarray(net.weights @ lifting.skins.points)
    ends = {k: [moves.get((k, i), int(net.chains[k].points[i])) for i in (0, -1)] for k, _ in moves}
    if not ends:
        return net
    between = [_moved_points(P, net.chains[k].points, end_points) for k, end_points in ends.items()]
    rows = lifting.weights_at(np.concatenate(between))
    chains, start = dict(net.chains), len(P)
    for (k, end_points), inner_points in zip(ends.items(), between, strict=True):
        points = np.concatenate([end_points[:1], np.arange(start, start + len(inner_points)), end_points[1:]])
        chains[k], start = replace(chains[k], points=points), start + len(inner_points)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)


def _moved_points(P: Floats, points: Ints, ends: list[int]) -> Floats:
    fewest = 5  # a chain with moved ends gets at least 5 points
    line = P[points]
    lengths = arc_lengths(line)
    start, end = P[ends[0]] - line[0], P[ends[1]] - line[-1]
    x = np.linspace(0, 1, max(len(points), fewest))
    points_on_line = np.stack([np.interp(x * lengths[-1], lengths, column) for column in line.T], axis=1)
    return np.asarray((points_on_line + (1 - x)[:, None] * start + x[:, None] * end)[1:-1])


def without_short_walls(net: ChainNet, lifting: Lifting, shortest: float) -> ChainNet:
    """Join each outline part shorter than `shortest` mm, between two borders of members, to a neighbouring part.
    lifting : mapping of mesh points to the sheet's skins."""
    fewest_sides = 3  # a region keeps at least three sides
    P: Floats = np.asarray(net.weights @ lifting.skins.points)
    chains, moves, node_ends = dict(net.chains), dict[tuple[int, int], int](), ends_at(net)
    loops = {region: [list(loop) for loop in region_loops] for region, region_loops in net.loops.items()}
    for k, chain in net.chains.items():
        if chain.right != VOID or arc_lengths(P[chain.points])[-1] >= shortest:
            continue
        before, after = (outline_and_border(net, node_ends[int(chain.points[i])]) for i in (0, -1))
        wall_loop = next(loop for loop in loops[chain.left] if (k, True) in loop)
        if not before or not after or len(wall_loop) <= fewest_sides:
            continue
        three = ([net.chains[i].points[-2], *net.chains[j].points[:2]] for i, j in (before[:2], after[:2]))
        turned = [turn_at(P[points]) for points in three]
        first_gives_way = turned[0] < turned[1]  # the short wall is joined to its neighbour at the smaller bend
        joined_wall, border = (before[0], before[2]) if first_gives_way else (after[1], after[2])
        if joined_wall not in chains or chains[joined_wall].left == chain.left or border in moves:
            continue
        point_rows = [chains[joined_wall].points, chain.points][:: 1 if first_gives_way else -1]
        chains[joined_wall] = replace(chains[joined_wall], points=np.concatenate([point_rows[0], point_rows[1][1:]]))
        moves[border] = int(chain.points[-1 if first_gives_way else 0])
        wall_loop.remove((k, True))
        del chains[k]
    return with_moved_ends(replace(net, chains=chains, loops=loops), moves, lifting)


def outline_and_border(net: ChainNet, ends: list[tuple[int, int]]) -> tuple[int, int, tuple[int, int]] | None:
    """Return the numbers of the outline's chains before and after a node, and the end of the border there.
    Return None unless one outline and one border meet at the node.    ends : ends of the chains at the node."""
    outline, borders = outline_through(net, ends), [end for end in ends if net.chains[end[0]].right != VOID]
    return (*outline, borders[0]) if outline and len(borders) == 1 else None


def turn_at(three: Floats) -> float:
    """Return the bend (degrees) at the middle of three points (3, 3); 0 on a straight line."""
    ways = np.diff(three, axis=0)
    long = max(float(np.prod(np.linalg.norm(ways, axis=1))), 1e-300)
    return float(np.degrees(np.arccos(np.clip(ways[0] @ ways[1] / long, -1, 1))))


class _Arcs:
    def __init__(self, net: ChainNet, P: Floats, arcs: frozenset[int]) -> None:
        self.P, self.chains, self.arcs = P, dict(net.chains), arcs
        self.loops = {region: [list(loop) for loop in loops] for region, loops in net.loops.items()}
        self.moves = dict[tuple[int, int], int]()
        ends = [int(chain.points[i]) for chain in net.chains.values() for i in (0, -1)]
        self.degree = np.bincount(ends, minlength=len(P))

    def take_neighbour(self, arc: int, direction: int) -> None:
        chain = self.chains[arc]
        loop = self._loop(chain.left, (arc, True))
        border, ahead = loop[(loop.index((arc, True)) + direction) % len(loop)]
        beyond_loop = self._loop(self.chains[border].region_beyond(ahead), (border, not ahead))
        if len(beyond_loop) < 4:
            return
        position, node = beyond_loop.index((border, not ahead)), -1 if direction > 0 else 0
        rest, wall = (beyond_loop[(position + i * direction) % len(beyond_loop)] for i in (1, 2))
        points = self.chains[rest[0]].points
        if (
            any(self.chains[k].region_beyond(forwards) != VOID for k, forwards in (rest, wall))
            or self.degree[points[node]] != 2
        ):
            return
        if rest[0] in self.arcs or self._length(points) > self._length(chain.points):
            return
        point_rows = [chain.points, points[1:]] if direction > 0 else [points, chain.points[1:]]
        self.chains[arc] = replace(chain, points=np.concatenate(point_rows))
        self.moves[border, 0 if ahead == (direction > 0) else -1] = int(points[node])
        beyond_loop.remove(rest)
        del self.chains[rest[0]]

    def _loop(self, region: int, step: tuple[int, bool]) -> ChainLoop:
        return next((loop for loop in self.loops.get(region, []) if step in loop), [])

    def _length(self, points: Ints) -> float:
        return float(arc_lengths(self.P[points])[-1])


def without_fillets(net: ChainNet, lifting: Lifting) -> ChainNet:
    """Join each region that fills the rounded corner between two members to the neighbouring regions."""
    work = _Fillets(net, lifting)
    for region in sorted(net.loose & net.loops.keys()):
        work.take_region(region)
    net = work.result()
    arcs = _Arcs(net, np.asarray(net.weights @ lifting.skins.points), frozenset(work.arcs))
    for arc in work.arcs:
        for direction in (-1, 1):
            arcs.take_neighbour(arc, direction)
    return with_moved_ends(replace(net, chains=arcs.chains, loops=arcs.loops), arcs.moves, lifting)


class _Fillets:
    def __init__(self, net: ChainNet, lifting: Lifting) -> None:
        self.net, self.lifting = net, lifting
        P: Floats = np.asarray(net.weights @ lifting.skins.points)
        self.P = np.concatenate([P, np.zeros((len(net.loose), 3))])
        self.count, self.free = len(P), len(net.chains)
        self.middles = list[tuple[tuple[int, int], float]]()
        self.chains, self.loops = dict(net.chains), {r: [list(x) for x in loops] for r, loops in net.loops.items()}
        self.loose = set(net.loose)
        self.place = dict[int, int]()
        self.moved = dict[tuple[int, int], int]()
        self.arcs = list[int]()
        self.at = dict[int, list[int]]()
        for k, chain in net.chains.items():
            for p in {int(chain.points[0]), int(chain.points[-1])}:
                self.at.setdefault(p, []).append(k)
        self.outline = {int(p) for c in net.chains.values() if c.right == VOID for p in (c.points[0], c.points[-1])}

    def take_region(self, region: int) -> None:
        # Limits for length of inner borders / length of the arc: `detour` for 3 or more borders, else `flat_detour`.
        detour, flat_detour = 2.2, 4.0
        if len(self.loops[region]) != 1:
            return
        loop = self.loops[region][0]
        inner, arc = _inner_and_arc(loop, [self._neighbour(step) for step in loop])
        if not inner or not arc:
            return
        points = np.concatenate([self._points(step)[:-1] for step in arc] + [self._points(arc[-1])[-1:]])
        behind = [int(self._points(step)[-1]) for step in inner[:-1]]
        if any(p in self.place or p in self.outline for p in behind):
            return
        limit = detour if len(inner) > 2 else flat_detour
        if sum(self._length(self._points(step)) for step in inner) > limit * self._length(points):
            return
        neighbours = [self._neighbour(step) for step in inner]
        if self._to_crossing(region, inner, arc, neighbours):
            return
        if len(inner) == 1 or len(set(neighbours)) == 1:
            halves = [points]
        else:
            points, middle = self._middle(points)
            halves = [points[middle:], points[: middle + 1]]
            self.place |= dict.fromkeys(behind, int(points[middle]))
        self._divide_arc(inner, neighbours, halves)
        self._remove(region, arc)

    def _to_crossing(self, region: int, inner: ChainLoop, arc: ChainLoop, neighbours: list[int]) -> bool:
        crossing = self._crossing(inner, neighbours)
        if crossing is None or crossing in self.loose:
            return False
        corners = ((0, self._points(inner[0])[[-1, 0]]), (-1, self._points(inner[-1])[[0, -1]]))
        moves = [
            (self._border(int(c), neighbours[i], crossing), int(c), int(end))
            for i, (c, end) in corners
            if neighbours[i] != crossing
        ]
        if any(border < 0 for border, _, _ in moves):
            return False
        steps = [(k, not ahead) for (k, ahead), r in zip(inner, neighbours, strict=True) if r == crossing]
        first_step = steps[0] if steps else (moves[0][0], int(self.chains[moves[0][0]].points[0]) == moves[0][1])
        loop = next((candidate for candidate in self.loops[crossing] if first_step in candidate), None)
        if loop is None:
            return False
        position = loop.index(first_step)
        points = np.concatenate([self._points(step)[:-1] for step in arc] + [self._points(arc[-1])[-1:]])
        self.chains[self.free] = Chain(points, crossing, VOID)
        loop[position : position + len(steps)] = [(self.free, True)]
        self.arcs.append(self.free)
        self.free += 1
        self.moved |= {(border, c): end for border, c, end in moves}
        for (k, ahead), neighbour in zip(inner, neighbours, strict=True):
            for neighbour_loop in self.loops[neighbour]:
                if (k, not ahead) in neighbour_loop:
                    neighbour_loop.remove((k, not ahead))
        self._remove(region, [*inner, *arc])
        return True

    def _remove(self, region: int, steps: ChainLoop) -> None:
        for k, _ in steps:
            del self.chains[k]
        del self.loops[region]
        self.loose.discard(region)

    def _crossing(self, inner: ChainLoop, neighbours: list[int]) -> int | None:
        smaller = 0.6  # the smaller region is a crossing if its perimeter is below 0.6 x the larger region's perimeter
        if len(inner) == 3 and len(set(neighbours)) == 3:
            return neighbours[1]
        if len(inner) != 2 or neighbours[0] == neighbours[1]:
            return None
        corner = int(self._points(inner[0])[-1])
        adjacent = [self.chains[k] for k in self._ending(corner) if k not in (inner[0][0], inner[1][0])]
        if len(adjacent) == 1:
            small, large = sorted(neighbours, key=self._border_length)
            return small if self._border_length(small) < smaller * self._border_length(large) else None
        behind = [({c.left, c.right} - {r}) for c in adjacent for r in neighbours if r in (c.left, c.right)]
        is_common = len(adjacent) == 2 and len(behind) == 2 and behind[0] == behind[1] and VOID not in behind[0]
        return behind[0].pop() if is_common else None

    def _border_length(self, region: int) -> float:
        return sum(self._length(self._points(step)) for loop in self.loops[region] for step in loop)

    def _border(self, corner: int, member: int, crossing: int) -> int:
        candidates = [k for k in self._ending(corner) if (k, corner) not in self.moved]
        candidates = [k for k in candidates if {self.chains[k].left, self.chains[k].right} == {member, crossing}]
        return candidates[0] if len(candidates) == 1 else -1

    def _ending(self, point: int) -> list[int]:
        return [k for k in self.at.get(point, []) if k in self.chains]

    def _divide_arc(self, inner: ChainLoop, neighbours: list[int], halves: list[Ints]) -> None:
        for i, ((k, ahead), neighbour) in enumerate(zip(inner, neighbours, strict=True)):
            replacement: ChainLoop = []
            half = halves[0] if i == 0 else halves[-1] if i == len(inner) - 1 and len(halves) > 1 else None
            if half is not None:
                self.chains[self.free] = Chain(half, neighbour, VOID)
                replacement = [(self.free, True)]
                self.free += 1
            for loop in self.loops[neighbour]:
                if (k, not ahead) in loop:
                    position = loop.index((k, not ahead))
                    loop[position : position + 1] = replacement
            del self.chains[k]

    def _neighbour(self, step: tuple[int, bool]) -> int:
        return self.chains[step[0]].region_beyond(step[1])

    def _points(self, step: tuple[int, bool]) -> Ints:
        return self.chains[step[0]].directed_points(step[1])

    def _length(self, points: Ints) -> float:
        return polyline_length(self.P[points])

    def _middle(self, points: Ints) -> tuple[Ints, int]:
        lengths = arc_lengths(self.P[points])
        half = lengths[-1] / 2
        i = int(np.clip(np.searchsorted(lengths, half) - 1, 0, len(points) - 2))
        t = (half - lengths[i]) / (lengths[i + 1] - lengths[i])
        self.middles.append(((int(points[i]), int(points[i + 1])), float(t)))
        self.P[self.count] = (1 - t) * self.P[points[i]] + t * self.P[points[i + 1]]
        self.count += 1
        return np.insert(points, i + 1, self.count - 1), i + 1

    def result(self) -> ChainNet:
        starts, ends = np.array([points for points, _ in self.middles], dtype=np.int64).reshape(-1, 2).T
        t, rows = np.array([share for _, share in self.middles]), self.net.weights
        halves = rows[starts].multiply(1 - t[:, None]) + rows[ends].multiply(t[:, None])
        rows = csr_array(vstack([rows, halves], format="csr"))
        net = replace(self.net, weights=rows, chains=self.chains, loops=self.loops, loose=frozenset(self.loose))
        moves = {
            (k, i): self.moved.get((k, int(chain.points[i])), self.place.get(int(chain.points[i]), -1))
            for k, chain in self.chains.items()
            for i in (0, -1)
        }
        return with_moved_ends(net, {end: point for end, point in moves.items() if point >= 0}, self.lifting)


def _inner_and_arc(loop: ChainLoop, neighbours: list[int]) -> tuple[ChainLoop, ChainLoop]:
    void = [neighbour == VOID for neighbour in neighbours]
    starts = [i for i in range(len(loop)) if not void[i] and void[i - 1]]
    if len(starts) != 1:
        return [], []
    steps = [*loop[starts[0] :], *loop[: starts[0]]]
    count = len(loop) - sum(void)
    return steps[:count], steps[count:]
