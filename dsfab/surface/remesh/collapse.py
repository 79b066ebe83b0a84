"""Short edges collapsed to a point, where that keeps the topology, the curves and the lie of the faces."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, area_vectors, edge_lengths, lengths, row_max, row_min
from dsfab.surface.edge_changes import contracted, has_three_corners, meets_link_condition
from dsfab.surface.neighbours import faces_at
from dsfab.surface.remesh.curves import FeatureCurves
from dsfab.surface.remesh.features import TOLERANCE
from dsfab.surface.remesh.net import FIXED, FREE, ON_CURVE, Net, NetFaces, independent
from dsfab.surface.remesh.split import LONGEST

SHORTEST = 4 / 5
"""Times the wanted length, below which an edge is collapsed [Botsch and Kobbelt 2004]."""

TURN = 0.7
"""No face turns by more than the angle of this cosine, about 45 degrees."""

ROUND = 0.2
"""Least twofold area of a face over its longest edge squared, 0.87 of the best face, or that of the worst around."""


@dataclass(frozen=True, eq=False)
class _Collapses:
    """Vertices `gone` (c,) that are put together with vertices `kept` (c,) at places `goal` (c, 3), metres."""

    kept: Ints
    gone: Ints
    goal: Floats

    def only(self, which: Bools) -> "_Collapses":
        return _Collapses(self.kept[which], self.gone[which], self.goal[which])


def with_short_edges_collapsed(net: Net, curves: FeatureCurves, edge: float, batches: int) -> Net:
    """The net with its short edges collapsed in so many batches; `edge`, metres, is what the tolerance refers to."""
    for batch in range(batches):
        collapses, cost = _candidates(net, curves, edge, backwards=batch % 2 == 1)
        pairs = np.stack([collapses.kept, collapses.gone], axis=1)
        collapses = collapses.only(independent(pairs, cost, net.n, beside=net.edges.ends))
        collapses = collapses.only(_keeps_faces(net, collapses))
        if not len(collapses.kept):
            break
        net = _merged(net, collapses)
    return net.without_lost()


def _candidates(net: Net, curves: FeatureCurves, edge: float, backwards: bool) -> tuple[_Collapses, Floats]:
    """Collapses of short edges that keep topology and curves, and their costs (c,).

    A free vertex goes to any other, two to their middle, one on a curve along that only, a fixed one nowhere.
    """
    edges = net.edges
    cost = edge_lengths(net.V, edges.ends) / net.edge_sizes
    chosen = np.flatnonzero(cost < SHORTEST)
    lower = row_min(net.kind[edges.ends[chosen]])
    chosen = chosen[(lower < FIXED) & (net.along_curves[chosen] | (lower == FREE))]
    chosen = chosen[meets_link_condition(edges, chosen, net.n)]
    ends = edges.ends[chosen]
    a, b = ends.T
    swap = (net.kind[a] < net.kind[b]) | ((net.kind[a] == net.kind[b]) & backwards)
    kept, gone = np.where(swap, b, a), np.where(swap, a, b)
    fine = (net.kind[gone] == FREE) | _keeps_curves(net, curves, kept, gone, edge)
    both = (net.kind[kept] == FREE)[:, None]
    goal = np.where(both, (net.V[kept] + net.V[gone]) / 2, net.V[kept])
    return _Collapses(kept, gone, goal).only(fine), cost[chosen[fine]]


def _keeps_curves(net: Net, curves: FeatureCurves, kept: Ints, gone: Ints, edge: float) -> Bools:
    """(c,) whether a vertex on a curve may go to a neighbour on it: the longer edge stays near the curve, is not too
    long and not there yet."""
    position = np.zeros(net.n, dtype=np.int64)
    position[net.node] = np.arange(len(net.node))
    k = np.clip(position[gone], 1, max(len(net.node) - 2, 1))
    on = net.kind[gone] == ON_CURVE
    fine = np.zeros(len(gone), dtype=bool)
    k, kept = k[on], kept[on]
    before, after = net.node[k - 1], net.node[k + 1]
    deviation, _ = curves.deviation(net.at[k - 1], net.at[k + 1])
    ends = np.stack([before, after], axis=1)
    short = edge_lengths(net.V, ends) < LONGEST * net.size[ends].mean(axis=1)
    there = np.isin(np.sort(ends, axis=1) @ (net.n, 1), np.sort(net.link_ends, axis=1) @ (net.n, 1))
    fine[on] = (deviation <= TOLERANCE * edge) & short & ~there & ((kept == before) | (kept == after))
    return fine


def _keeps_faces(net: Net, collapses: _Collapses) -> Bools:
    """(c,) whether the faces around stay as they lie, get no edge that is too long and do not become needles."""
    onto, of = np.arange(net.n), np.full(net.n, -1)
    onto[collapses.gone] = collapses.kept
    of[collapses.kept] = of[collapses.gone] = np.arange(len(collapses.kept))
    V = net.V.copy()
    V[collapses.kept] = collapses.goal
    face = np.flatnonzero(faces_at(net.F, of >= 0))
    before, after, which = net.F[face], onto[net.F[face]], row_max(of[net.F[face]])
    count = len(collapses.kept)
    least = _least(_roundness(net.V, before), which, count)
    stays = has_three_corners(after)
    before, after, which = before[stays], after[stays], which[stays]
    old, new = area_vectors(net.V, before), area_vectors(V, after)
    turned = np.einsum("mi,mi->m", old, new) < TURN * lengths(old) * lengths(new)
    too_long = _longest(V, after) > np.maximum(LONGEST * net.size[after].mean(axis=1), _longest(net.V, before))
    fine = _least(_roundness(V, after), which, count) >= np.minimum(ROUND, least)
    fine[which[turned | too_long]] = False
    return np.asarray(fine)


def _least(values: Floats, of: Ints, count: int) -> Floats:
    """(c,) the least of the values (k,) of each of so many things `of` (k,)."""
    least = np.full(count, np.inf)
    np.minimum.at(least, of, values)
    return least


def _roundness(V: Floats, F: Ints) -> Floats:
    """(m,) twofold areas over longest edges squared: 0.87 of the best face."""
    return np.asarray(lengths(area_vectors(V, F)) / _longest(V, F) ** 2)


def _longest(V: Floats, F: Ints) -> Floats:
    """(m,) the longest edge of each face, metres."""
    a, b, c = V[F.T]
    return row_max(np.stack([lengths(b - a), lengths(c - b), lengths(a - c)], axis=1))


def _merged(net: Net, collapses: _Collapses) -> Net:
    """The net with vertices put together; those that are gone stay in its list."""
    V, onto, size = net.V.copy(), np.arange(net.n), net.size.copy()
    V[collapses.kept] = collapses.goal
    onto[collapses.gone] = collapses.kept
    free = net.kind[collapses.kept] == FREE
    kept, gone = collapses.kept[free], collapses.gone[free]
    size[kept] = (size[kept] + size[gone]) / 2
    stays = ~np.isin(net.node, collapses.gone)
    F = contracted(net.F, onto)
    return replace(
        net, V=V, faces=NetFaces(F), size=size, node=net.node[stays], at=net.at[stays], curve=net.curve[stays]
    )
