"""Edges that OCCT can fillet: seams extended past filled corners, order of walls, direction and length of edges."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.export.cad.step.by_members.curves import parts_of
from dsfab.export.cad.step.by_members.model import (
    FilledCorner,
    NetEdge,
    NetModel,
    NetPatch,
    NetWall,
    filled_corners,
    half_turn,
    outlines,
    turned,
    way,
)
from dsfab.export.cad.step.by_members.patches import places
from dsfab.export.cad.step.by_members.regions import Loop
from dsfab.export.cad.step.by_members.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

NEARLY = 1e-6
"""Millimetres that faces may be off what a seam goes on for."""

ALONG = np.linspace(0, 1, 17)
"""Where that is measured."""

STEPS = 5
"""Of Newton's method for a point of a side, from the nearest of `ALONG`."""


def on_face(face: TrimmedFace, poles: Floats) -> Floats | None:
    """(2, 4, 2) poles of curves (4, 6) over the outer and the inner surface of a trimmed face, if it follows them."""
    if np.abs(face.gaps(bernstein(ALONG) @ poles)).max() > NEARLY:
        return None
    both = zip((face.outer, face.inner), face.axes, np.split(poles, 2, axis=1), strict=True)
    return np.stack([places(*each) for each in both])


def on_patch(patch: NetPatch, edge: Floats, share: Floats, poles: Floats) -> Floats | None:
    """(2, 2, 2) ends of curves (4, 6) over a patch, if they run along one of its sides.

    edge : (4, 6) of the part that lies on the side.    share : (2,) of its parameter that the curves go on by before
    and after it.
    """
    P = patch.poles
    for axis in (0, 1):
        for fixed in (0, 1):
            side = P[:, -fixed] if axis == 0 else P[-fixed]
            first, last = (_parameter(side, edge[-end]) for end in (0, 1))
            uv = np.full((2, 2), float(fixed))
            uv[:, axis] = first - share[0] * (last - first), last + share[1] * (last - first)
            if _is_on(P, uv, poles):
                return np.stack([uv, uv])
    return None


def _parameter(side: Floats, point: Floats) -> float:
    """Of a point (6,), where on a side (4, 6) it lies, which has it."""
    x = float(ALONG[np.argmin(np.linalg.norm(bernstein(ALONG) @ side - point, axis=1))])
    for _ in range(STEPS):
        here, ahead = (bernstein(np.array([x])) @ side)[0], 3 * (_quadratic(x) @ np.diff(side, axis=0))
        x += float((point - here) @ ahead) / max(float(ahead @ ahead), 1e-300)
    return x if abs(x - round(x)) > 1e-10 else float(round(x))


def _quadratic(x: float) -> Floats:
    """(3,) Bernstein polynomials."""
    return np.array([(1 - x) ** 2, 2 * x * (1 - x), x**2])


def _is_on(P: Floats, uv: Floats, poles: Floats) -> bool:
    """Whether a line over a patch is a curve."""
    at = uv[0] + ALONG[:, None] * (uv[1] - uv[0])
    points = np.einsum("ka,kb,abi->ki", bernstein(at[:, 0]), bernstein(at[:, 1]), P)
    return bool(np.abs(points - bernstein(ALONG) @ poles).max() < NEARLY)


CLEAR = 1 / 6
"""Of the thickness, radius of a fillet that a seam goes on for, times the tangent of half the turn."""

MOST = 3.0
"""Times its own length that a seam goes on, at most: a polynomial is not to be trusted farther."""

MARGIN = 0.1
"""Share of that by which surfaces go on farther."""

WIDE = 1 / 100
"""Of the thickness, by which a patch goes on beside a seam that a wall's edge goes straight on as: OCCT makes the seam
longer along that edge, nearly, and finds no places on the patch for what is beyond."""

ROUND = 1 / 8
"""Of the thickness, radius of a fillet that the patch beyond such a seam goes on for. OCCT lengthens the patch itself,
along tangents. The gap between it and where the fillet ends becomes the tolerance of what the seam is longer by; at one
of more than 1e-4 mm this runs the wrong way, and the solid is not valid."""

GAP = 3e-5
"""Millimetres of that gap. With less the tolerance is ten times the seam's, 1e-6, and along the wall's edge, which has
another parameter, the longer seam was off the other patch by up to 2e-6."""

OFF = 1e-5
"""Millimetres that a pole of such a seam is off where a trimmed face is beyond, which is wide enough: there the longer
seam was off by up to 1.4e-5, and its tolerance is then 4e-5."""


@dataclass(frozen=True, eq=False)
class LongSeam:
    """A seam that goes on, or a wall's edge beside the corner where one does, which does not.

    poles : (4, 6) of its curves, millimetres.    on : by face, patches first and then trimmed ones, poles (2, k, 2) of
    the same curves over its outer and its inner surface, which are a square.
    """

    poles: Floats
    on: dict[int, Floats]


def curves_beyond(model: NetModel) -> dict[int, Floats]:
    """By edge the poles (4, 6) of seams that go on: each of them the only one at a corner that is filled."""
    bent = [corner for corner in filled_corners(model) if corner.straight is None]
    return {e: poles for e, (_, poles) in _longer(model, bent).items()}


def _longer(model: NetModel, corners: Iterable[FilledCorner]) -> dict[int, tuple[Floats, Floats]]:
    """By edge the shares (2,) of its own parameter by which a seam goes on before its start and after its end, and the
    poles (4, 6) of its curves then."""
    shares = dict[int, Floats]()
    for corner in corners:
        share = shares.setdefault(corner.seam, np.zeros(2))
        far = _share if corner.straight is None else _share_to_gap
        share[corner.end] = far(model.edges[corner.seam].poles, corner.end, corner.half)
    shares = {e: share for e, share in shares.items() if 0 < share.max() <= MOST}
    if not shares:
        return {}
    P, share = np.stack([model.edges[e].poles for e in shares]), np.stack(list(shares.values()))
    parts = parts_of(P, -share[:, 0], 1 + share[:, 1])
    return {e: (before, part) for e, before, part in zip(shares, share, parts, strict=True)}


def _share(poles: Floats, end: int, half: float) -> float:
    """Of an edge's own parameter by which its curves go on."""
    radius = CLEAR * float(np.linalg.norm(poles[-end, :3] - poles[-end, 3:]))
    way = poles[-end] - poles[-2 if end else 1]
    slow = min(float(np.linalg.norm(part)) for part in np.split(way, 2))
    return radius * half / max(3 * slow, 1e-300)


def _share_to_gap(poles: Floats, end: int, half: float) -> float:
    """The same, up to where OCCT may go on along tangents: beside a fillet of `ROUND` it is off by `GAP`."""
    ahead = poles[::-1] if end else poles
    across = poles[-end, :3] - poles[-end, 3:]
    thick = float(np.linalg.norm(across))
    found = list[float]()
    for P in np.split(ahead, 2, axis=1):
        speed = 3 * float(np.linalg.norm(P[1] - P[0]))
        bend = 6 * abs(float((P[2] - 2 * P[1] + P[0]) @ across)) / max(thick * speed**2, 1e-300)
        found.append((ROUND * thick * half - np.sqrt(2 * GAP / max(bend, 1e-300))) / max(speed, 1e-300))
    return max(0.0, *found) / (1 + MARGIN)


def with_long_seams(
    model: NetModel, faces: list[TrimmedFace]
) -> tuple[NetModel, list[TrimmedFace], dict[int, LongSeam]]:
    """The same solid, on surfaces that go on as its seams do, and by edge these seams and what is beside their ends; a
    seam that one of its faces does not follow stays as it is."""
    corners = filled_corners(model)
    loops = _edges_around(model, faces, corners)
    seams = _on_both(model, faces, corners, loops)
    boxes, needed = _beside_straight(model, faces, corners, loops)
    for seam in seams.values():
        for i, uv in seam.on.items():
            needed.setdefault(i, []).append(uv)
    for i, some in needed.items():
        boxes[i] = _box(np.concatenate([*some, *([boxes[i]] if i in boxes else [])], axis=1))
    patches, faces = list(model.patches), list(faces)
    for i, box in boxes.items():
        if i < len(patches):
            patches[i] = replace(patches[i], poles=_over(patches[i].poles, box[0]), within=True)
        else:
            face = faces[i - len(patches)]
            outer, inner = (_over(poles, part) for poles, part in zip((face.outer, face.inner), box, strict=True))
            faces[i - len(patches)] = replace(face, outer=outer, inner=inner, exact=True)
    moved = {
        e: replace(seam, on={i: (uv - boxes[i][:, :1]) / np.diff(boxes[i], axis=1) for i, uv in seam.on.items()})
        for e, seam in seams.items()
    }
    return replace(model, edges=_with_tolerance(model, corners, loops), patches=patches), faces, moved


def _with_tolerance(model: NetModel, corners: list[FilledCorner], loops: dict[int, set[int]]) -> list[NetEdge]:
    """The edges, of which seams that go straight on from a wall's edge, and have a trimmed face beyond, are off it."""
    edges = list(model.edges)
    for corner in corners:
        trimmed = [mine for i, mine in loops.items() if i >= len(model.patches) and corner.seam in mine]
        if corner.straight is not None and any(corner.straight not in mine for mine in trimmed):
            poles = edges[corner.seam].poles.copy()
            across = poles[0, :3] - poles[0, 3:]
            poles[2 - corner.end] += OFF * np.tile(across / np.linalg.norm(across), 2)
            edges[corner.seam] = replace(edges[corner.seam], poles=poles)
    return edges


def _edges_around(model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner]) -> dict[int, set[int]]:
    """By face, patches first and then trimmed ones, the edges at corners around it, where there are some."""
    some = {e for corner in corners for e in (corner.seam, *corner.beside)}
    loops = [patch.loop for patch in model.patches] + [[step for loop in face.loops for step in loop] for face in faces]
    found = {i: some.intersection([e for e, _ in loop]) for i, loop in enumerate(loops)}
    return {i: mine for i, mine in found.items() if mine}


def _beside_straight(
    model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner], loops: dict[int, set[int]]
) -> tuple[dict[int, Floats], dict[int, list[Floats]]]:
    """By patch what is needed where a seam goes straight on from a wall's edge, at a corner that is filled: beside both
    a box, as `_box`, and beyond the seam the places (2, 2, 2) of that as which it goes on."""
    straight = [corner for corner in corners if corner.straight is not None]
    longer, boxes, needed = _longer(model, straight), dict[int, Floats](), dict[int, list[Floats]]()
    for corner in straight:
        for i in (i for i, mine in loops.items() if corner.seam in mine):
            if corner.straight in loops[i]:
                if i < len(model.patches):
                    boxes[i] = _wide(model.patches[i])
            elif corner.seam in longer and i < len(model.patches):
                uv = _places(model, faces, i, corner.seam, *longer[corner.seam])
                if uv is not None:
                    needed.setdefault(i, []).append(uv)
    return boxes, needed


def _wide(patch: NetPatch) -> Floats:
    """(2, 2, 2) a little more than the square of a patch, as `_box`."""
    P = patch.poles[:, :, :3]
    thick = float(np.linalg.norm(patch.poles[0, 0, :3] - patch.poles[0, 0, 3:]))
    long = np.linalg.norm([P[3, 0] - P[0, 0], P[0, 3] - P[0, 0]], axis=1)
    more = WIDE * thick / np.maximum(long, WIDE * thick)
    return np.tile(np.stack([-more, 1 + more]), (2, 1, 1))


def _on_both(
    model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner], loops: dict[int, set[int]]
) -> dict[int, LongSeam]:
    """The seams that go on, over both of the faces beside them, and the walls' edges beside where they do, over one."""
    bent = [corner for corner in corners if corner.straight is None]
    longer = _longer(model, bent)
    bent = [corner for corner in bent if corner.seam in longer]
    mine = {e for corner in bent for e in (corner.seam, *corner.beside)}
    curves = {e: longer.get(e, (np.zeros(2), model.edges[e].poles)) for e in mine}
    found = {e: LongSeam(poles, {}) for e, (_, poles) in curves.items()}
    for i, around in loops.items():
        for e in around & mine:
            uv = _places(model, faces, i, e, *curves[e])
            if uv is not None:
                found[e].on[i] = uv
    sound = [corner for corner in bent if len(found[corner.seam].on) == 2]
    kept = {e for corner in sound for e in (corner.seam, *corner.beside)}
    return {e: seam for e, seam in found.items() if e in kept and seam.on}


def _places(model: NetModel, faces: list[TrimmedFace], i: int, e: int, share: Floats, poles: Floats) -> Floats | None:
    """(2, k, 2) where on a face, if there, an edge's curves with poles (4, 6) are that go on by a share."""
    count = len(model.patches)
    return (
        on_patch(model.patches[i], model.edges[e].poles, share, poles)
        if i < count
        else on_face(faces[i - count], poles)
    )


def _box(uv: Floats) -> Floats:
    """(2, 2, 2) on each skin the lowest and the highest place that a surface needs for curves (2, k, 2)."""
    low, high = np.minimum(uv.min(axis=1), 0), np.maximum(uv.max(axis=1), 1)
    return np.stack([(1 + MARGIN) * low, 1 + (1 + MARGIN) * (high - 1)], axis=1)


def _over(poles: Floats, box: Floats) -> Floats:
    """Poles (j, k, d) of the same surface over another part (2, 2) of the plane: from its lowest place to its
    highest."""
    for axis in (0, 1):
        if box[0, axis] != 0 or box[1, axis] != 1:
            poles = _part(poles.swapaxes(0, axis), box[0, axis], box[1, axis]).swapaxes(0, axis)
    return poles


def _part(P: Floats, low: float, high: float) -> Floats:
    """Poles (k, ..) of the part of a polynomial between two parameters, by de Casteljau."""
    count, found = len(P) - 1, list[Floats]()
    for j in range(count + 1):
        Q = P
        for x in [low] * (count - j) + [high] * j:
            Q = (1 - x) * Q[:-1] + x * Q[1:]
        found.append(Q[0])
    return np.stack(found)


CLEAR_EDGE = 1 / 7
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
    first, last = (CLEAR_EDGE * share * half for half in corners)
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
    near = len(found) == 2 and max(found) - min(found) < CLEAR_EDGE * share
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
