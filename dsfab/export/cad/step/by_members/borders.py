"""Corrections of the borders between the regions of members."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, plane_cross, unit_vectors
from dsfab.export.cad.step.by_members.curves import ChainCurve
from dsfab.export.cad.step.by_members.fillets import outline_and_border, turn_at, with_moved_ends
from dsfab.export.cad.step.by_members.lines import BEND_ANGLE, CORNER_ANGLE
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainLoop, ChainNet, ends_at
from dsfab.export.cad.step.by_members.trimmed import axes_of, middle_normal, signed_area
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.splines import Spline, arc_lengths, bernstein, even_samples, polyline_length, splines_through

TOUCHING_SHARE = 1 / 400  # parts of an outline touch if their distance is below this fraction of the thickness


def crossing_chains(net: ChainNet, curves: Mapping[int, ChainCurve], region: int, distance: float = 0.0) -> set[int]:
    """Return numbers of the chains (rows of mesh edges) around a region that cross or nearly touch.
    distance : curves of chains nearly touch if they are less than this distance (mm) apart."""
    finest = 12  # a cubic gets at most 12 chords; the chords at its ends are short
    segments = 600  # an outline gets about 600 chords
    steps = [step for loop in net.loops[region] for step in loop]
    spans = [len(curves[k].spans) for k, _ in steps]
    fine = int(np.clip(segments // sum(spans), 4, finest))
    lines = [_samples(curves, loop, fine) for loop in net.loops[region]]
    chain = np.repeat([k for k, _ in steps], fine * np.array(spans))
    plane = axes_of(middle_normal(np.concatenate(lines)))[:2].T
    first_points = np.cumsum([0, *spans[:-1]]) * fine
    start, ends = np.array([net.ends(x)[0] for x in steps]), np.array([net.ends((k, True)) for k in chain.tolist()])
    ends_elsewhere = (start[:, None, None] != ends).all(axis=2)
    chain_numbers = set[int]()
    for skin in (slice(3), slice(3, 6)):
        seen = [line[:, skin] @ plane for line in lines]
        if sum(signed_area(line) for line in seen) <= 0:
            return set(chain.tolist())  # the area is negative where sides of a narrow region cross
        chain_numbers.update(chain[crossing_segments(seen)].tolist())
        corner, segment = np.nonzero(ends_elsewhere & (_distances(seen, first_points) < distance))
        chain_numbers.update(chain[segment].tolist())
        nodes = {net.ends(steps[i])[0] for i in corner.tolist()}
        chain_numbers.update(k for k, _ in steps if nodes & set(net.ends((k, True))))
    return chain_numbers


def _distances(lines: list[Floats], point_numbers: Ints) -> Floats:
    a = np.concatenate(lines)
    ways = np.concatenate([np.roll(line, -1, axis=0) for line in lines]) - a
    offsets = a[point_numbers][:, None] - a
    share = np.clip(np.einsum("cki,ki->ck", offsets, ways) / np.maximum((ways**2).sum(axis=1), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(offsets - share[..., None] * ways, axis=2))


def _samples(curves: Mapping[int, ChainCurve], loop: ChainLoop, fine: int) -> Floats:
    B = bernstein((1 - np.cos(np.pi * np.arange(fine) / fine)) / 2)
    parts = [curves[k].spans if ahead else curves[k].spans[::-1, ::-1] for k, ahead in loop]
    return np.concatenate([(B @ part).reshape(-1, 6) for part in parts])


def crossing_segments(lines: list[Floats]) -> Bools:
    """Return a mask (k,) of crossing segments. lines : closed polygons in a plane, with k points in all."""
    a = np.concatenate(lines)
    b = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    along = (b - a)[:, None]
    apart = plane_cross(along, a[None] - a[:, None]) * plane_cross(along, b[None] - a[:, None]) < 0
    return np.asarray((apart & apart.T).any(axis=1))


def without_crossings(
    net: ChainNet, curves: Mapping[int, ChainCurve], regions: Iterable[int], distance: float = 0.0
) -> ChainNet:
    """Join a region to a neighbour if the region's outline crosses or nearly touches itself. distance : limit, mm."""
    result = net
    for region in regions:
        for k in sorted(crossing_chains(net, curves, region, distance)):
            chain = result.chains.get(k)
            if chain is not None and VOID != chain.right != chain.left:
                result = without_chain(result, k)
                break
    return result


def without_chain(net: ChainNet, k: int) -> ChainNet:
    """Join the regions left and right of chain k (row of mesh edges), unless a region has holes."""
    kept_region, joined_region = net.chains[k].left, net.chains[k].right
    if len(net.loops[kept_region]) + len(net.loops[joined_region]) > 2:
        return net
    chains, loops, cell = dict(net.chains), dict(net.loops), net.cell.copy()
    left_steps = _rest_of_loop(loops[kept_region][0], (k, True))
    right_steps = _rest_of_loop(loops.pop(joined_region)[0], (k, False))
    loop = _without_spurs(left_steps + right_steps)
    for step, ahead in right_steps:
        chains[step] = chains[step].with_region(kept_region, ahead)
    for step in {step for step, _ in [*left_steps, *right_steps, (k, True)]} - {step for step, _ in loop}:
        del chains[step]
    loops[kept_region] = [loop]
    cell[cell == joined_region] = kept_region
    return replace(net, chains=chains, loops=loops, cell=cell, loose=net.loose - {joined_region})


def _rest_of_loop(loop: ChainLoop, step: tuple[int, bool]) -> ChainLoop:
    position = loop.index(step)
    return [*loop[position + 1 :], *loop[:position]]


def _without_spurs(loop: ChainLoop) -> ChainLoop:
    steps = list[tuple[int, bool]]()
    for step in loop:
        if steps and steps[-1] == (step[0], not step[1]):
            steps.pop()
        else:
            steps.append(step)
    while len(steps) > 1 and steps[0] == (steps[-1][0], not steps[-1][1]):
        steps = steps[1:-1]
    return steps


PLACES = np.linspace(0, 1, 65)  # parameters where the curvature is measured


def straight_net(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """Replace the borders between regions by smooth curves.
    net : regions and their borders.    lifting : maps mesh points to the sheet's skins.    thickness : mm."""
    sideways = 1 / 3  # a chain moves sideways by at most this fraction of the thickness
    sag = 1 / 400  # largest distance of chords from the curve, as a fraction of the thickness
    P = np.asarray(net.weights @ lifting.skins.points)
    inner = [k for k, chain in net.chains.items() if chain.right != VOID and len(chain.points) > 2]
    if inner and len(lifting.sides.creases):
        crease = lifting.sides.on_creases(net.weights)
        inner = [k for k in inner if not crease[net.chains[k].points].all()]
    fits = splines_through([even_samples(P[net.chains[k].points]) for k in inner], [sideways * thickness] * len(inner))
    curves = {k: curve for k, (curve, _) in zip(inner, fits, strict=True)}
    N = np.asarray(net.weights @ lifting.skins.normals)
    net = _without_hairpins(net, [k for k, curve in curves.items() if _turns_back(curve)], N)
    curves = {k: curve for k, curve in curves.items() if k in net.chains}
    if not curves:
        return net
    between = [curve(np.linspace(0, 1, point_count(curve, sag * thickness))[1:-1]) for curve in curves.values()]
    rows = lifting.weights_at(np.concatenate(between))
    chains, start = dict(net.chains), len(P)
    for k, row in zip(curves, between, strict=True):
        points, inner_points = chains[k].points, np.arange(start, start + len(row))
        chains[k] = replace(chains[k], points=np.concatenate([points[:1], inner_points, points[-1:]]))
        start += len(row)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)


def _turns_back(curve: Spline) -> bool:
    most_spans = 4  # a curve with more spans is too wavy
    detour = 1.5  # a curve longer than 1.5 chords is a hairpin; half a circle is 1.57 chords long
    line = curve(PLACES)
    return (
        polyline_length(line) > detour * float(np.linalg.norm(line[-1] - line[0]))
        or len(np.unique(curve.knots)) - 1 > most_spans
    )


def _without_hairpins(net: ChainNet, hairpins: Sequence[int], N: Floats) -> ChainNet:
    least_cosine = 0.5  # normals of a joined region are at most 60 degrees from their mean
    for k in hairpins:
        chain = net.chains.get(k)
        if chain is None or chain.left == chain.right:
            continue
        steps = [step for region in (chain.left, chain.right) for loop in net.loops[region] for step, _ in loop]
        around = N[np.concatenate([net.chains[step].points for step in steps])]
        mean = around.mean(axis=0)
        if (around @ mean).min() > least_cosine * np.linalg.norm(mean):
            net = without_chain(net, k)
    return net


def point_count(curve: Spline, sag: float) -> int:
    """Return the number of points of a polyline that stays within `sag` (mm) of a curve."""
    fewest = 9  # a straightened chain has at least 9 points
    bends = np.linalg.norm(np.diff(curve(PLACES), n=2, axis=0) * (len(PLACES) - 1) ** 2, axis=1)
    return max(fewest, 1 + int(np.ceil(np.sqrt(bends.max() / (8 * sag)))))


LONGEST_CHORD = 2.0  # largest chord of a round corner, as a multiple of the thickness


def with_steep_ends(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """Move ends of borders along the outline, to places where border and outline form larger angles.
    net : regions and their borders.    lifting : maps mesh points to the sheet's skins.    thickness : mm."""
    rounds = 3  # a border's end may move along several chains of the outline: one chain in each round
    for _ in range(rounds):
        work = _BorderEnds(net, np.asarray(net.weights @ lifting.skins.points), thickness)
        for node in sorted(work.nodes):
            work.move_border(node)
        if not work.moves:
            break
        net = with_moved_ends(replace(net, chains=work.chains, loops=work.loops), work.moves, lifting)
    return net


class _BorderEnds:
    def __init__(self, net: ChainNet, P: Floats, thickness: float) -> None:
        self.P, self.t = P, thickness
        self.chains, self.free = dict(net.chains), max(net.chains, default=-1) + 1
        self.loops = {region: [list(loop) for loop in loops] for region, loops in net.loops.items()}
        node_ends = ends_at(net)
        self.degree = {node: len(ends) for node, ends in node_ends.items()}
        self.nodes = {node: three for node, ends in node_ends.items() if (three := outline_and_border(net, ends))}
        self.moves, self.changed = dict[tuple[int, int], int](), set[int]()

    def move_border(self, node: int) -> None:
        sharp = 20.0  # degrees; a border does not move if the outline turns by less at the border's end
        gain = 15.0  # degrees; a border moves only if its angle to the outline grows by at least this
        steep = 30.0  # degrees; a border does not move if its angle to the outline is already at least this
        before, after, (seam, end) = self.nodes[node]
        if self.changed & {before, after, seam} or turn_at(self._points_around(before, after)) < sharp:
            return
        line = self.P[self.chains[seam].directed_points(end == 0)]
        lengths = arc_lengths(line)
        anchor = np.array([np.interp(min(self.t, lengths[-1]), lengths, column) for column in line.T])
        now = self._angle_at(before, after, anchor)
        if now >= steep:
            return
        places = [(self._steepness(k, i, anchor), k, i) for k in (before, after) for i in self._places(k, node)]
        steepness, k, i = max(places, key=self._worth, default=(0.0, -1, 0))
        if steepness < now + gain or not self._move(k, i, node, (seam, end)):
            return
        self.changed |= {before, after, seam}

    def _worth(self, place: tuple[float, int, int]) -> tuple[float, bool, float]:
        enough = 45.0  # degrees; all places with larger angles between border and outline are equally good
        steep, k, i = place
        return min(steep, enough), i in (0, len(self.chains[k].points) - 1), steep

    def _points_around(self, before: int, after: int) -> Floats:
        points_before, points_after = self.chains[before].points, self.chains[after].points
        return self.P[[points_before[-2], points_after[0], points_after[1]]]

    def _angle_at(self, before: int, after: int, anchor: Floats) -> float:
        P = self._points_around(before, after)
        weights = [1.0 - (self._is_round(j) and not self._is_round(k)) for j, k in ((before, after), (after, before))]
        return _angle(P, weights, anchor)

    def _is_round(self, k: int) -> bool:
        line = self.P[self.chains[k].points]
        return len(_bent(line)) > 0 or float(np.linalg.norm(line[-1] - line[0])) < LONGEST_CHORD * self.t

    def _places(self, k: int, node: int) -> list[int]:
        points = self.chains[k].points
        long = np.linalg.norm(np.diff(self.P[points], axis=0), axis=1)
        inside = _bent(self.P[points]).tolist()
        far_end = len(points) - 1 if points[0] == node else 0
        chords = np.concatenate([[0], inside, [len(points) - 1]]).astype(int)
        if max(long[a:b].sum() for a, b in pairwise(chords)) > LONGEST_CHORD * self.t:
            return []
        return [*inside, far_end] if self._next(k, far_end) >= 0 else inside

    def _next(self, k: int, i: int) -> int:
        if self.degree.get(int(self.chains[k].points[i])) != 2:
            return -1
        loop = next(loop for loop in self.loops[self.chains[k].left] if (k, True) in loop)
        j = loop[(loop.index((k, True)) + (1 if i else -1)) % len(loop)][0]
        if len(loop) < 4 or j == k or self.chains[j].right != VOID or j in self.changed:
            return -1
        turn = np.deg2rad(turn_at(self._points_around(k, j) if i else self._points_around(j, k)))
        return j if BEND_ANGLE < turn < CORNER_ANGLE else -1

    def _steepness(self, k: int, i: int, anchor: Floats) -> float:
        points = self.chains[k].points
        if 0 < i < len(points) - 1:
            return _angle(self.P[points[i - 1 : i + 2]], [1.0, 1.0], anchor)
        j = self._next(k, i)
        return self._angle_at(k, j, anchor) if i else self._angle_at(j, k, anchor)

    def _move(self, k: int, i: int, node: int, border: tuple[int, int]) -> bool:
        chain = self.chains[k]
        ahead = int(chain.points[0]) == node
        passed, rest = (chain.points[: i + 1], chain.points[i:]) if ahead else (chain.points[i:], chain.points[: i + 1])
        seam, end = border
        left_region, right_region = self.chains[seam].left, self.chains[seam].right
        region = right_region if left_region == chain.left else left_region
        loop, theirs = self._loop(chain.left, k), self._loop(region, seam)
        if region == chain.left or not loop or not theirs:
            return False
        position = theirs.index(next(step for step in theirs if step[0] == seam))
        self.chains[self.free] = Chain(passed, region, VOID)
        theirs.insert(position if ahead else position + 1, (self.free, True))
        if len(rest) > 1:
            self.chains[k] = replace(chain, points=rest)
        else:
            loop.remove((k, True))
            del self.chains[k]
        self.moves[seam, end] = int(chain.points[i])
        self.changed.add(self.free)
        self.free += 1
        return True

    def _loop(self, region: int, k: int) -> ChainLoop:
        matches = [loop for loop in self.loops[region] for step in loop if step[0] == k]
        return matches[0] if len(matches) == 1 else []


def _bent(line: Floats) -> Ints:
    directions = unit_vectors(np.diff(line, axis=0))
    return 1 + np.flatnonzero(np.einsum("ki,ki->k", directions[:-1], directions[1:]) < np.cos(BEND_ANGLE))


def _angle(points: Floats, weights: list[float], anchor: Floats) -> float:
    along, to_anchor = weights @ unit_vectors(np.diff(points, axis=0)), anchor - points[1]
    cosine = abs(along @ to_anchor) / max(float(np.linalg.norm(along) * np.linalg.norm(to_anchor)), 1e-300)
    return float(np.degrees(np.arccos(min(1.0, cosine))))
