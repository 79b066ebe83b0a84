r"""Walls in an order, and edges in directions and lengths, with which OCCT (8.0) rounds the corners between walls.

        |  later          Two seams go on beyond most corners of openings. To round one, OCCT lengthens a face of the
   seam |                 skin beyond a seam, and an edge with it: that of the wall which is first in the file. If it
 -------o========  first  begins at the corner, and does not end there, a wrong part of the lengthened curve is taken:
        | seam    <---    of a sphere's corners 31 of 34 were rounded where edges end, and 8 of 33 where they begin.

Where a seam alone goes straight on as a wall's edge, at a corner that is filled, it is the seam that is lengthened: it
ends there, too. Any other seam there is not lengthened, see `beyond`.

It also makes edges shorter, which keep their tolerance. That is their largest distance from a face at 23 points; at
those of what is left it may be a thousandth more, and then the solid is not valid. Where the largest is at an end, both
are exact, or what is left has less. So edges of trimmed faces are cut in two where they are farthest off.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.corners import filled_corners, half_turn, outlines, way
from dsfab.export.network.curves import parts_of
from dsfab.export.network.graph import Loop
from dsfab.export.network.model import NetEdge, NetModel, NetWall, turned
from dsfab.export.network.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

CLEAR = 1 / 7
"""Of the thickness, radius of a fillet that takes no more of a wall than up to where its edge is cut at the nearest."""

FAR = 4.0
"""Times the thickness, and the tangent of half a turn up to 1, that an edge is long which ends at a corner. OCCT makes
it longer, out and back to where the fillet ends, and looks for that place from few samples: it may find the farthest
one out, if the fillet takes less than 1.5 % of the edge. Of one of 700 mm a fillet took 5, of one of 180 mm 2."""

DENSE = np.linspace(0, 1, 129)
"""Where an edge is compared with its trimmed face."""

EXACT = 1e-6
"""Millimetres of a gap up to which OCCT takes an edge as one of a face."""


def in_order(model: NetModel, faces: list[TrimmedFace]) -> tuple[NetModel, list[TrimmedFace]]:
    """The same solid, whose walls follow each other around each outline, edges along them.

    An outline begins where it is smoothest. Where it has corners only, both its first corner and its last are of its
    first wall, and an edge of this ends at each: a wall with a single edge gets two.
    """
    work, walls = CutEdges(model), list[NetWall]()
    beside = {e: face for face in faces for loop in face.loops for e, _ in loop}
    for outline in outlines(model):
        walls += _directed(outline, model, beside, work)
    for corner in filled_corners(model):
        if corner.straight is not None and not corner.end:
            work.cut(corner.seam, True, [], True)
    return work.model(walls), [replace(face, loops=[work.loop(loop) for loop in face.loops]) for face in faces]


def _directed(
    outline: list[NetWall], model: NetModel, beside: dict[int, TrimmedFace], work: "CutEdges"
) -> list[NetWall]:
    """An outline from where it is smoothest, once its edges are directed and cut."""
    cosines = [float(way(wall, model, True) @ way(outline[i - 1], model, False)) for i, wall in enumerate(outline)]
    begin = int(np.argmax(cosines))
    walls = [*outline[begin:], *outline[:begin]]
    turns = [half_turn(x) for x in (*cosines[begin:], *cosines[:begin], cosines[begin])]
    for i, wall in enumerate(walls):
        for j, (e, ahead) in enumerate(wall.steps):
            corners = turns[i] if j == 0 else 0.0, turns[i + 1] if j == len(wall.steps) - 1 else 0.0
            against = i == 0 and corners[0] > 0
            ending = against, i + 1 < len(walls) and corners[1] > 0
            stops = _stops(model.poles((e, ahead)), beside.get(e), corners, ending)
            work.cut(e, ahead, stops or ([0.5] if against and len(wall.steps) == 1 else []), against)
    return walls


def _stops(
    poles: Floats, face: TrimmedFace | None, corners: tuple[float, float], ending: tuple[bool, bool]
) -> list[float]:
    """Where an edge is cut that has corners at its ends: as far from each as the gap of a trimmed face is nowhere wider
    between than here or there, on both skins, and not `FAR` from one that is rounded at the end of this edge.

    corners : tangents of half the turns, 0 where there is no corner."""
    thick, long = (float(np.linalg.norm(way)) for way in (poles[0, :3] - poles[0, 3:], poles[3, :3] - poles[0, :3]))
    share = thick / max(long, 1e-300)
    first, last = (CLEAR * share * half for half in corners)
    between = (first < DENSE) & (last < DENSE[::-1]) & (DENSE > 0) & (DENSE < 1)
    gaps = np.zeros((len(DENSE), 2)) if face is None else np.abs(face.gaps(bernstein(DENSE) @ poles))
    gaps[:, gaps.max(axis=0) < EXACT] = 0
    found = set[float]()
    for at_end in np.flatnonzero(corners):
        there = gaps[::-1] if at_end else gaps
        largest = np.asarray((np.maximum(there, there[0]) >= np.maximum.accumulate(there)).all(axis=1))
        most = min(FAR * share * min(corners[at_end], 1.0), 1.0) if ending[at_end] else 1.0
        inside = (between[::-1] if at_end else between) & (most >= DENSE)
        places = np.flatnonzero(inside & largest)
        if most < 1 and not len(places):
            places = np.flatnonzero(inside)
        if len(places) and not (most == 1 and largest[-1]):
            found.add(float((DENSE[::-1] if at_end else DENSE)[places[-1]]))
    near = len(found) == 2 and max(found) - min(found) < CLEAR * share
    return [float(np.mean(list(found)))] if near else sorted(found)


class CutEdges:
    """Edges of a model, some of them turned or cut; forwards : what such a one has become, run through as it was."""

    def __init__(self, model: NetModel) -> None:
        self.given, self.vertices, self.edges = model, list(model.vertices), list(model.edges)
        self.forwards = dict[int, Loop]()

    def cut(self, e: int, ahead: bool, stops: list[float], against: bool) -> None:
        """Cut an edge at shares of it, as it is run through, and let all parts run this way, or the first one against
        it."""
        edge, ends = self.given.edges[e], np.array([0.0, *stops, 1.0])
        P = np.stack([self.given.poles((e, ahead))] * (len(ends) - 1))
        parts = parts_of(P, ends[:-1], ends[1:]) if stops else P.copy()
        parts[0, 0], parts[-1, -1], parts[1:, 0] = P[0, 0], P[0, -1], parts[:-1, -1]
        start, end = (edge.start, edge.end) if ahead else (edge.end, edge.start)
        inside = range(len(self.vertices), len(self.vertices) + len(stops))
        self.vertices += list(parts[1:, 0])
        nodes, numbers = [start, *inside, end], [e, *range(len(self.edges), len(self.edges) + len(stops))]
        made = [NetEdge(a, b, part) for a, b, part in zip(nodes, nodes[1:], parts, strict=False)]
        if against:
            made[0] = NetEdge(nodes[1], start, parts[0, ::-1])
        self.edges[e], self.edges[len(self.edges) :] = made[0], made[1:]
        along = [(k, i > 0 or not against) for i, k in enumerate(numbers)]
        self.forwards[e] = along if ahead else turned(along)

    def model(self, walls: Iterable[NetWall]) -> NetModel:
        """The model with walls in an order."""
        return replace(self.given, vertices=self.vertices, edges=self.edges, walls=list(walls)).over(self.loop)

    def loop(self, loop: Loop) -> Loop:
        """The same edges as they are now."""
        found: Loop = []
        for e, ahead in loop:
            steps = self.forwards.get(e, [(e, True)])
            found += steps if ahead else turned(steps)
        return found
