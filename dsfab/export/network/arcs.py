r"""Round corners of openings as arcs that leave the walls beside them without an angle.

      chords           arcs          A sheet has a polygon of chords where its outline is round, and a curve fitted to
---o                ----._           some of them meets the wall in an angle of 8 to 30 degrees: an edge across the
    \__o                  \          solid at which fillets of CAD programs often fail. Each chain of a round corner
       |                   |         becomes one cubic, which goes on as the wall does, and through a node between two
       |                   |         arcs on the circle through the ends of both.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from dsfab.arrays import Floats
from dsfab.export.network.curves import BETWEEN, ChainCurve, SampledChain, on_skins
from dsfab.export.network.graph import VOID, ChainNet, ends_at, outline_through, turns
from dsfab.export.network.lines import ChainLine, NetLines

CORNER = np.deg2rad(50.0)
"""Turn from one chain of an outline to the next from which on there is a corner."""

BENT = np.deg2rad(10.0)
"""Turn at one vertex from which on an outline is round there, as in `graph`: where a coarse mesh bends, outlines turn
with it, and are straight."""

FLATTEST = np.cos(np.deg2rad(25.0))
"""Cosine of the least angle between an arc and a border between members that ends where it does: patches in narrower
wedges are folded."""

WIDEST = np.cos(np.deg2rad(80.0))
"""Cosine of the largest angle between an arc's chord and its direction at an end."""

ROUNDS = 4
"""How often arcs that are off their chords become walls, which may do the same to others."""

DENSE = np.linspace(0, 1, 65)
"""Where an arc is compared with its chords."""


class ArcsOnSkins:
    """Arcs on both skins, with how far chains are off them; those of a chain that were asked before are not made anew.

    away : the ways (k, 6) to both skins from points near them.
    """

    def __init__(self, away: Callable[[Floats], Floats]) -> None:
        self.away, self.known = away, dict[int, tuple[SampledChain, bytes, ChainCurve]]()

    def __call__(self, arcs: Mapping[int, ChainCurve], chains: Mapping[int, SampledChain]) -> dict[int, ChainCurve]:
        """By chain."""
        poles = {k: arc.spans.tobytes() for k, arc in arcs.items()}
        new = [k for k in arcs if not self._same(k, chains[k], poles[k])]
        for k, curve in zip(new, on_skins([arcs[k] for k in new], self.away), strict=True):
            self.known[k] = chains[k], poles[k], replace(curve, off=_off(chains[k].Q, curve))
        return {k: self.known[k][2] for k in arcs}

    def _same(self, k: int, chain: SampledChain, poles: bytes) -> bool:
        return k in self.known and self.known[k][0] is chain and self.known[k][1] == poles


def with_arcs(
    lines: NetLines,
    chains: Mapping[int, SampledChain],
    within: Mapping[int, float],
    rounded: Collection[int],
    on: ArcsOnSkins,
) -> NetLines:
    """The lines, those of round corners as arcs as far as these are within tolerances (millimetres, by chain) of them.

    rounded : the chains of round corners.
    """
    corners = _Corners(lines, rounded)
    arcs = dict[int, ChainCurve]()
    for _ in range(ROUNDS):
        arcs = on(corners.arcs(), chains)
        wrong = {k for k, arc in arcs.items() if arc.off > within[k]}
        arcs = {k: arc for k, arc in arcs.items() if k not in wrong}
        if not wrong:
            break
        corners.round -= wrong
    at = {lines.place[k][0]: arc for k, arc in arcs.items()}
    return NetLines(lines.net, [_replaced(line, at[i]) if i in at else line for i, line in enumerate(lines.lines)])


def _replaced(line: ChainLine, arc: ChainCurve) -> ChainLine:
    """A line of one chain with the curve of this."""
    return replace(line, curve=arc if line.steps[0][1] else arc.reversed())


def _off(Q: Floats, curve: ChainCurve) -> float:
    """The largest distance of points (k, 6) from a curve, on either skin."""
    line = curve(DENSE)
    return max(float(cdist(Q[:, s : s + 3], line[:, s : s + 3]).min(axis=1).max()) for s in (0, 3))


def round_chains(net: ChainNet, chains: Mapping[int, SampledChain], within: Mapping[int, float]) -> set[int]:
    """The chains of outlines that have a bent vertex inside, or are chords of arcs that are within tolerances of them
    (millimetres, by chain)."""
    nodes = _nodes(net, ends_at(net))
    angles = dict(
        zip(nodes, _turns([(chains[before], chains[after]) for before, after in nodes.values()]), strict=True)
    )
    outlines = [k for k, chain in net.chains.items() if chain.right == VOID]
    bent = dict(zip(outlines, _bends([chains[k] for k in outlines]), strict=True))
    found = set[int]()
    for k in outlines:
        two, line = [angles.get(int(net.chains[k].points[i]), 0.0) for i in (0, -1)], chains[k]
        chord = min(two) > BENT and max(two) < CORNER and float(line.way[-1]) * sum(two) / 16 <= within[k]
        if chord or bent[k]:
            found.add(k)
    return found


def _nodes(net: ChainNet, ends: Mapping[int, list[tuple[int, int]]]) -> dict[int, tuple[int, int]]:
    """The nodes of outlines, each with the chain that ends there and the one that begins, if there is one of each."""
    return {node: two for node, some in ends.items() if (two := outline_through(net, some))}


class _Corners:
    """The outlines of a net; round : chains that are to be arcs."""

    def __init__(self, lines: NetLines, rounded: Collection[int]) -> None:
        self.lines, self.net = lines, lines.net
        self.ends = ends_at(self.net)
        self.nodes = _nodes(self.net, self.ends)
        self.curves = {k: lines.curve(k) for k, chain in self.net.chains.items() if chain.right == VOID}
        self.round = {k for k in rounded if len(lines.lines[lines.place[k][0]].steps) == 1}
        self.known = dict[tuple[int, bool, bool], Floats | None]()
        self.made = dict[int, tuple[Floats | None, Floats | None, ChainCurve | None]]()

    def arcs(self) -> dict[int, ChainCurve]:
        """The chains of round corners as arcs; where an outline has no direction at a node, a chain keeps its own."""
        found = dict[int, ChainCurve]()
        for k in sorted(self.round):
            arc = self._arc(k, *(self._known_way(int(self.net.chains[k].points[i])) for i in (0, -1)))
            if arc is not None:
                found[k] = arc
        return found

    def _arc(self, k: int, start: Floats | None, end: Floats | None) -> ChainCurve | None:
        """A chain as an arc with directions (6,) at its ends, made once for these."""
        if start is None and end is None:
            return None
        if k not in self.made or self.made[k][0] is not start or self.made[k][1] is not end:
            P, Q = self.curves[k].spans[[0, -1]]
            one = _scaled(P[1] - P[0]) if start is None else start
            two = _scaled(Q[3] - Q[2]) if end is None else end
            self.made[k] = start, end, _arc(P[0], Q[3], one, two)
        return self.made[k][2]

    def _chord(self, k: int) -> tuple[Floats, Floats]:
        """(6,) twice: where a chain begins and ends."""
        spans = self.curves[k].spans
        return spans[0, 0], spans[-1, -1]

    def _known_way(self, node: int) -> Floats | None:
        """(6,) the direction of an outline at a node, found once for each way in which its chains are round; None where
        it has a corner there, or a seam in its direction."""
        if node not in self.nodes:
            return None
        before, after = self.nodes[node]
        kind = node, before in self.round, after in self.round
        if kind not in self.known:
            self.known[kind] = self._way(node, before, after)
        return self.known[kind]

    def _way(self, node: int, before: int, after: int) -> Floats | None:
        one, two = self._end_ways(before, after)
        if _middle(one) @ _middle(two) < np.cos(CORNER):
            return None
        way = two if before in self.round else one
        if before in self.round and after in self.round:
            way = self._on_circle(before, after)
        seams = [(k, end) for k, end in self.ends[node] if self.net.chains[k].right != VOID]
        steep = all(abs(_middle(way) @ self._seam_way(seam, end)) < FLATTEST for seam, end in seams)
        return way if steep else None

    def _end_ways(self, before: int, after: int) -> tuple[Floats, Floats]:
        """(6,) twice: the directions of two chains where the second begins."""
        P, Q = self.curves[before].spans[-1], self.curves[after].spans[0]
        return _scaled(P[3] - P[2]), _scaled(Q[1] - Q[0])

    def _on_circle(self, before: int, after: int) -> Floats:
        """(6,) of the circle through the ends of two chains in a row, where they meet."""
        (a, b), (_, c) = self._chord(before), self._chord(after)
        one, two = (float(np.linalg.norm(_middle(way))) for way in (b - a, c - b))
        return _scaled((b - a) * two / one + (c - b) * one / two)

    def _seam_way(self, k: int, end: int) -> Floats:
        """(3,) the direction of a chain at an end."""
        P = self.lines.curve(k).spans[end]
        return _unit(_middle(P[1] - P[0]) if end == 0 else _middle(P[2] - P[3]))


def _turns(pairs: Sequence[tuple[SampledChain, SampledChain]]) -> list[float]:
    """Radians that an outline turns, seen along the sheet's normal, from a chain's end to another's beginning."""
    if not pairs:
        return []
    Q = np.array([[before.Q[-2], before.Q[-1], after.Q[0], after.Q[1]] for before, after in pairs])
    middle, across = (Q[..., :3] + Q[..., 3:]) / 2, Q[:, 2, :3] - Q[:, 2, 3:]
    cosines = turns(middle[:, 1] - middle[:, 0], middle[:, 3] - middle[:, 2], across)
    return [float(x) for x in np.arccos(np.clip(cosines, -1, 1))]


def _bends(chains: Sequence[SampledChain]) -> list[bool]:
    """Whether chains have a vertex inside at which they turn as round corners do, seen along the sheet's normal."""
    parts = [chain.Q[::BETWEEN] for chain in chains]
    if not parts:
        return []
    Q, of = np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    way = np.diff((Q[:, :3] + Q[:, 3:]) / 2, axis=0)
    inside = np.flatnonzero(of[2:] == of[:-2])  # and the vertex before it, and the one after it
    cosines = turns(way[inside], way[inside + 1], (Q[:, :3] - Q[:, 3:])[inside + 1])
    bent = set(of[inside[cosines < np.cos(BENT)]].tolist())
    return [i in bent for i in range(len(parts))]


def _arc(start: Floats, end: Floats, one: Floats, two: Floats) -> ChainCurve | None:
    """From a point (6,) to another, with directions (6,) there; None where it would turn too far.

    Handles are those of the cubic nearest to a circle with so long a chord and such a turn, chord / (3 cos^2(turn/4)).
    """
    chord, ways = _middle(end - start), (_middle(one), _middle(two))
    long = float(np.linalg.norm(chord))
    if min(float(way @ chord) for way in ways) < WIDEST * long:
        return None
    turn = float(np.arccos(np.clip(ways[0] @ ways[1], -1, 1)))
    handle = long / (3 * np.cos(turn / 4) ** 2)
    poles = np.stack([start, start + handle * one, end - handle * two, end])
    return ChainCurve(np.array([0.0, 1.0]), poles[None])


def _middle(way: Floats) -> Floats:
    """(3,) of both skins."""
    return np.asarray((way[:3] + way[3:]) / 2)


def _scaled(way: Floats) -> Floats:
    """(6,) with a middle 1 mm long."""
    return np.asarray(way / np.linalg.norm(_middle(way)))


def _unit(way: Floats) -> Floats:
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-300))
