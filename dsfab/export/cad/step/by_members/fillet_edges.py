"""Preparation of edges for fillets that the CAD kernel OCCT makes."""

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
    backwards,
    filled_corners,
    half_turn,
    outlines,
    wall_direction,
)
from dsfab.export.cad.step.by_members.patches import places
from dsfab.export.cad.step.by_members.regions import ChainLoop
from dsfab.export.cad.step.by_members.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

FACE_TOLERANCE = 1e-6  # a curve lies on a face if its distance from the face is at most this (mm)
PLACES = np.linspace(0, 1, 17)  # parameters of a curve where its distance from a face is measured


def on_face(face: TrimmedFace, poles: Floats) -> Floats | None:
    """Return an edge's control points as parameters (2, 4, 2) of a face's outer and inner surface.
    Return None if the edge is not on a surface.    poles : (4, 6) control points on the outer and inner skin, mm."""
    if np.abs(face.gaps(bernstein(PLACES) @ poles)).max() > FACE_TOLERANCE:
        return None
    return np.stack([places(surface, axes, poles[:, s]) for surface, axes, s in face.skins])


def on_patch(patch: NetPatch, edge: Floats, share: Floats, poles: Floats) -> Floats | None:
    """Return the patch parameters (2 skins, 2 ends, 2) of an extended edge; None if the edge is on no patch side.
    edge, poles : (4, 6) control points before and after the extension, mm.
    share       : (2,) length added at each end / old length of the edge."""
    P = patch.poles
    for axis in (0, 1):
        for fixed in (0, 1):
            side = P[:, -fixed] if axis == 0 else P[-fixed]
            begin, finish = (_parameter(side, edge[-end]) for end in (0, 1))
            uv = np.full((2, 2), float(fixed))
            uv[:, axis] = begin - share[0] * (finish - begin), finish + share[1] * (finish - begin)
            if _is_on(P, uv, poles):
                return np.stack([uv, uv])
    return None


def _parameter(side: Floats, point: Floats) -> float:
    steps = 5  # Newton's method begins at the nearest sample and needs few steps
    x = float(PLACES[np.argmin(np.linalg.norm(bernstein(PLACES) @ side - point, axis=1))])
    for _ in range(steps):
        quadratic = np.array([(1 - x) ** 2, 2 * x * (1 - x), x**2])
        point_on_side, ahead = (bernstein(np.array([x])) @ side)[0], 3 * (quadratic @ np.diff(side, axis=0))
        x += float((point - point_on_side) @ ahead) / max(float(ahead @ ahead), 1e-300)
    return x if abs(x - round(x)) > 1e-10 else float(round(x))


def _is_on(P: Floats, uv: Floats, poles: Floats) -> bool:
    places_on_patch = uv[0] + PLACES[:, None] * (uv[1] - uv[0])
    points = np.einsum("ka,kb,abi->ki", bernstein(places_on_patch[:, 0]), bernstein(places_on_patch[:, 1]), P)
    return bool(np.abs(points - bernstein(PLACES) @ poles).max() < FACE_TOLERANCE)


FILLET_SHARE = 1 / 6  # radius of a fillet / thickness; a seam is extended by radius * tan(bend / 2)
MARGIN = 0.1  # the surface at a seam is extended by this fraction more than the seam

LARGE_FILLET_SHARE = 1 / 8
"""Largest valid fillet radius / thickness, where a seam (edge between two faces) continues a wall's edge."""

TANGENT_GAP = 3e-5
"""Largest gap (mm) that the kernel OCCT may leave at the end of the largest fillet."""

POLE_OFFSET = 1e-5
"""Distance (mm) by which a pole of a seam (edge between two faces) is moved, for OCCT's tolerance.
Only a seam that continues a wall's edge beside a trimmed face is moved."""


@dataclass(frozen=True, eq=False)
class LongSeam:
    """Extended seam (edge between two faces of a skin), or a wall's edge beside the seam's end.
    poles : (4, 6) control points on the outer and inner skin, mm.
    on    : by face number, k of the edge's points as parameters (2, k, 2) of the face's outer and inner surface."""

    poles: Floats
    on: dict[int, Floats]


def curves_beyond(model: NetModel) -> dict[int, Floats]:
    """Return the poles (4, 6), mm, of extended seams (edges between two faces), by edge number."""
    bent = [corner for corner in filled_corners(model) if corner.straight is None]
    return {e: poles for e, (_, poles) in _extensions(model, bent).items()}


def _extensions(model: NetModel, corners: Iterable[FilledCorner]) -> dict[int, tuple[Floats, Floats]]:
    """Extend the seams (edges between two faces) at corners.
    Return, by edge number, the lengths (2,) added at the ends / old length, and the new poles (4, 6), mm."""
    longest = 3.0  # a polynomial is unreliable beyond three times the edge's length
    shares = dict[int, Floats]()
    for corner in corners:
        share = shares.setdefault(corner.seam, np.zeros(2))
        share_function = _share if corner.straight is None else _share_to_gap
        share[corner.end] = share_function(model.edges[corner.seam].poles, corner.end, corner.half)
    shares = {e: share for e, share in shares.items() if 0 < share.max() <= longest}
    if not shares:
        return {}
    P, share = np.stack([model.edges[e].poles for e in shares]), np.stack(list(shares.values()))
    parts = parts_of(P, -share[:, 0], 1 + share[:, 1])
    return {e: (before, part) for e, before, part in zip(shares, share, parts, strict=True)}


def _share(poles: Floats, end: int, half: float) -> float:
    radius = FILLET_SHARE * float(np.linalg.norm(poles[-end, :3] - poles[-end, 3:]))
    handle = poles[-end] - poles[-2 if end else 1]
    slow = min(float(np.linalg.norm(part)) for part in np.split(handle, 2))
    return radius * half / max(3 * slow, 1e-300)


def _share_to_gap(poles: Floats, end: int, half: float) -> float:
    ahead = poles[::-1] if end else poles
    across = poles[-end, :3] - poles[-end, 3:]
    thick = float(np.linalg.norm(across))
    shares = list[float]()
    for P in np.split(ahead, 2, axis=1):
        speed = 3 * float(np.linalg.norm(P[1] - P[0]))
        bend = 6 * abs(float((P[2] - 2 * P[1] + P[0]) @ across)) / max(thick * speed**2, 1e-300)
        reach = LARGE_FILLET_SHARE * thick * half - np.sqrt(2 * TANGENT_GAP / max(bend, 1e-300))
        shares.append(reach / max(speed, 1e-300))
    return max(0.0, *shares) / (1 + MARGIN)


def with_long_seams(
    model: NetModel, faces: list[TrimmedFace]
) -> tuple[NetModel, list[TrimmedFace], dict[int, LongSeam]]:
    """Extend seams (edges between faces) and their surfaces for fillets.
    Return the model, the trimmed faces, and the extended edges by edge number."""
    corners = filled_corners(model)
    loops = _edges_around(model, faces, corners)
    seams = _on_both(model, faces, corners, loops)
    boxes, needed = _beside_straight(model, faces, corners, loops)
    for seam in seams.values():
        for i, uv in seam.on.items():
            needed.setdefault(i, []).append(uv)
    for i, places_needed in needed.items():
        boxes[i] = _box(np.concatenate([*places_needed, *([boxes[i]] if i in boxes else [])], axis=1))
    patches, faces = list(model.patches), list(faces)
    for i, box in boxes.items():
        if i < len(patches):
            patches[i] = replace(patches[i], poles=_reparametrised(patches[i].poles, box[0]), within=True)
        else:
            face = faces[i - len(patches)]
            outer, inner = (_reparametrised(P, part) for P, part in zip((face.outer, face.inner), box, strict=True))
            faces[i - len(patches)] = replace(face, outer=outer, inner=inner, exact=True)
    moved = {
        e: replace(seam, on={i: (uv - boxes[i][:, :1]) / np.diff(boxes[i], axis=1) for i, uv in seam.on.items()})
        for e, seam in seams.items()
    }
    return replace(model, edges=_with_tolerance(model, corners, loops), patches=patches), faces, moved


def _with_tolerance(model: NetModel, corners: list[FilledCorner], loops: dict[int, set[int]]) -> list[NetEdge]:
    edges = list(model.edges)
    for corner in corners:
        trimmed = [group for i, group in loops.items() if i >= len(model.patches) and corner.seam in group]
        if corner.straight is not None and any(corner.straight not in group for group in trimmed):
            poles = edges[corner.seam].poles.copy()
            across = poles[0, :3] - poles[0, 3:]
            poles[2 - corner.end] += POLE_OFFSET * np.tile(across / np.linalg.norm(across), 2)
            edges[corner.seam] = replace(edges[corner.seam], poles=poles)
    return edges


def _edges_around(model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner]) -> dict[int, set[int]]:
    corner_edges = {e for corner in corners for e in (corner.seam, *corner.beside)}
    loops = [patch.loop for patch in model.patches] + [[step for loop in face.loops for step in loop] for face in faces]
    face_edges = {i: corner_edges.intersection([e for e, _ in loop]) for i, loop in enumerate(loops)}
    return {i: edges for i, edges in face_edges.items() if edges}


def _beside_straight(
    model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner], loops: dict[int, set[int]]
) -> tuple[dict[int, Floats], dict[int, list[Floats]]]:
    straight = [corner for corner in corners if corner.straight is not None]
    longer, boxes, needed = _extensions(model, straight), dict[int, Floats](), dict[int, list[Floats]]()
    for corner in straight:
        for i in (i for i, edges in loops.items() if corner.seam in edges and i < len(model.patches)):
            if corner.straight in loops[i]:
                boxes[i] = _wider_box(model.patches[i])
            elif corner.seam in longer:
                uv = _places(model, faces, i, corner.seam, *longer[corner.seam])
                if uv is not None:
                    needed.setdefault(i, []).append(uv)
    return boxes, needed


def _wider_box(patch: NetPatch) -> Floats:
    wider = 1 / 100  # OCCT lengthens seams, so a patch grows by this fraction of the thickness
    P = patch.poles[:, :, :3]
    thick = float(np.linalg.norm(patch.poles[0, 0, :3] - patch.poles[0, 0, 3:]))
    long = np.linalg.norm([P[3, 0] - P[0, 0], P[0, 3] - P[0, 0]], axis=1)
    margin = wider * thick / np.maximum(long, wider * thick)
    return np.tile(np.stack([-margin, 1 + margin]), (2, 1, 1))


def _on_both(
    model: NetModel, faces: list[TrimmedFace], corners: list[FilledCorner], loops: dict[int, set[int]]
) -> dict[int, LongSeam]:
    bent = [corner for corner in corners if corner.straight is None]
    longer = _extensions(model, bent)
    bent = [corner for corner in bent if corner.seam in longer]
    involved = {e for corner in bent for e in (corner.seam, *corner.beside)}
    curves = {e: longer.get(e, (np.zeros(2), model.edges[e].poles)) for e in involved}
    long_seams = {e: LongSeam(poles, {}) for e, (_, poles) in curves.items()}
    for i, around in loops.items():
        for e in around & involved:
            uv = _places(model, faces, i, e, *curves[e])
            if uv is not None:
                long_seams[e].on[i] = uv
    sound = [corner for corner in bent if len(long_seams[corner.seam].on) == 2]
    sound_edges = {e for corner in sound for e in (corner.seam, *corner.beside)}
    return {e: seam for e, seam in long_seams.items() if e in sound_edges and seam.on}


def _places(model: NetModel, faces: list[TrimmedFace], i: int, e: int, share: Floats, poles: Floats) -> Floats | None:
    if i < len(model.patches):
        return on_patch(model.patches[i], model.edges[e].poles, share, poles)
    return on_face(faces[i - len(model.patches)], poles)


def _box(uv: Floats) -> Floats:
    low, high = np.minimum(uv.min(axis=1), 0), np.maximum(uv.max(axis=1), 1)
    return np.stack([(1 + MARGIN) * low, 1 + (1 + MARGIN) * (high - 1)], axis=1)


def _reparametrised(poles: Floats, box: Floats) -> Floats:
    for axis in (0, 1):
        if box[0, axis] != 0 or box[1, axis] != 1:
            poles = _polynomial_part(poles.swapaxes(0, axis), box[0, axis], box[1, axis]).swapaxes(0, axis)
    return poles


def _polynomial_part(P: Floats, low: float, high: float) -> Floats:
    count, parts = len(P) - 1, list[Floats]()
    for j in range(count + 1):
        Q = P
        for x in [low] * (count - j) + [high] * j:
            Q = (1 - x) * Q[:-1] + x * Q[1:]
        parts.append(Q[0])
    return np.stack(parts)


CLEAR_EDGE = 1 / 7  # edges at a corner are cut beyond the reach of a fillet with this radius / thickness

LONGEST_SHARE = 4.0
"""Largest length of an edge at a corner / (thickness * t), where t is the smaller of tan(bend / 2) and 1.
On a longer edge, OCCT may find the wrong end of a fillet."""

DENSE = np.linspace(0, 1, 129)  # parameters of an edge where its gap to a trimmed face is measured


def with_ordered_walls(model: NetModel, faces: list[TrimmedFace]) -> tuple[NetModel, list[TrimmedFace]]:
    """Sort walls (faces through the thickness) into the order that OCCT needs for fillets, and cut their edges.
    Return the new model and the new trimmed faces."""
    work, walls = CutEdges(model), list[NetWall]()
    face_of_edge = {e: face for face in faces for loop in face.loops for e, _ in loop}
    for outline in outlines(model):
        walls += _directed_walls(outline, model, face_of_edge, work)
    for corner in filled_corners(model):
        if corner.straight is not None and not corner.end:
            work.cut(corner.seam, True, [], True)
    return work.model(walls), [replace(face, loops=[work.loop(loop) for loop in face.loops]) for face in faces]


def _directed_walls(
    outline: list[NetWall], model: NetModel, face_of_edge: dict[int, TrimmedFace], work: "CutEdges"
) -> list[NetWall]:
    starts, ends = ([wall_direction(wall, model, at_start) for wall in outline] for at_start in (True, False))
    cosines = [float(start @ ends[i - 1]) for i, start in enumerate(starts)]
    begin = int(np.argmax(cosines))
    walls = [*outline[begin:], *outline[:begin]]
    turns = [half_turn(x) for x in (*cosines[begin:], *cosines[:begin], cosines[begin])]
    for i, wall in enumerate(walls):
        for j, (e, ahead) in enumerate(wall.steps):
            corners = turns[i] if j == 0 else 0.0, turns[i + 1] if j == len(wall.steps) - 1 else 0.0
            against = i == 0 and corners[0] > 0
            ending = against, i + 1 < len(walls) and corners[1] > 0
            stops = edge_stops(model.poles((e, ahead)), face_of_edge.get(e), corners, ending)
            work.cut(e, ahead, stops or ([0.5] if against and len(wall.steps) == 1 else []), against)
    return walls


def edge_stops(
    poles: Floats, face: TrimmedFace | None, corners: tuple[float, float], ending: tuple[bool, bool]
) -> list[float]:
    """Return where an edge with poles (4, 6) is cut for fillets, as fractions of the edge's length.
    corners : tan(bend angle / 2) at the start and the end of the edge; 0 if there is no corner.
    ending  : for each end, True if `LONGEST_SHARE` limits the distance between this end and the cut."""
    exact = 1e-6  # OCCT ignores a gap below this (mm)
    thick, long = (float(np.linalg.norm(v)) for v in (poles[0, :3] - poles[0, 3:], poles[3, :3] - poles[0, :3]))
    share = thick / max(long, 1e-300)
    clear_start, clear_end = (CLEAR_EDGE * share * half for half in corners)
    between = (clear_start < DENSE) & (clear_end < DENSE[::-1]) & (DENSE > 0) & (DENSE < 1)
    gaps = np.zeros((len(DENSE), 2)) if face is None else np.abs(face.gaps(bernstein(DENSE) @ poles))
    gaps[:, gaps.max(axis=0) < exact] = 0
    shares = set[float]()
    for at_end in np.flatnonzero(corners):
        end_gaps = gaps[::-1] if at_end else gaps
        largest = np.asarray((np.maximum(end_gaps, end_gaps[0]) >= np.maximum.accumulate(end_gaps)).all(axis=1))
        farthest = min(LONGEST_SHARE * share * min(corners[at_end], 1.0), 1.0) if ending[at_end] else 1.0
        inside = (between[::-1] if at_end else between) & (farthest >= DENSE)
        places = np.flatnonzero(inside & largest)
        if farthest < 1 and not len(places):
            places = np.flatnonzero(inside)
        if len(places) and not (farthest == 1 and largest[-1]):
            shares.add(float((DENSE[::-1] if at_end else DENSE)[places[-1]]))
    is_close = len(shares) == 2 and max(shares) - min(shares) < CLEAR_EDGE * share
    return [float(np.mean(list(shares)))] if is_close else sorted(shares)


class CutEdges:
    """Edges of a model, which can be cut and reversed. forwards : number of an old edge -> new edges in its place."""

    def __init__(self, model: NetModel) -> None:
        self.given, self.vertices, self.edges = model, list(model.vertices), list(model.edges)
        self.forwards = dict[int, ChainLoop]()

    def cut(self, e: int, ahead: bool, stops: list[float], against: bool) -> None:
        """Cut the edge with number e at the fractions `stops` of its length, from its end if `ahead` is False.
        against : True to reverse the direction of the first part."""
        edge, ends = self.given.edges[e], np.array([0.0, *stops, 1.0])
        P = np.stack([self.given.poles((e, ahead))] * (len(ends) - 1))
        parts = parts_of(P, ends[:-1], ends[1:]) if stops else P.copy()
        parts[0, 0], parts[-1, -1], parts[1:, 0] = P[0, 0], P[0, -1], parts[:-1, -1]
        start, end = (edge.start, edge.end) if ahead else (edge.end, edge.start)
        inside = range(len(self.vertices), len(self.vertices) + len(stops))
        self.vertices += list(parts[1:, 0])
        nodes, numbers = [start, *inside, end], [e, *range(len(self.edges), len(self.edges) + len(stops))]
        new_edges = [NetEdge(a, b, part) for a, b, part in zip(nodes, nodes[1:], parts, strict=False)]
        if against:
            new_edges[0] = NetEdge(nodes[1], start, parts[0, ::-1])
        self.edges[e], self.edges[len(self.edges) :] = new_edges[0], new_edges[1:]
        along = [(k, i > 0 or not against) for i, k in enumerate(numbers)]
        self.forwards[e] = along if ahead else backwards(along)

    def model(self, walls: Iterable[NetWall]) -> NetModel:
        """Return the model with the given walls and the cut edges."""
        return replace(self.given, vertices=self.vertices, edges=self.edges, walls=list(walls)).with_loops(self.loop)

    def loop(self, loop: ChainLoop) -> ChainLoop:
        """Return a loop of edges in which new edges replace each cut edge."""
        result: ChainLoop = []
        for e, ahead in loop:
            steps = self.forwards.get(e, [(e, True)])
            result += steps if ahead else backwards(steps)
        return result
