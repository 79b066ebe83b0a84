"""Trimmed faces and rims of openings moved onto their edges beside sharp corners, so that fillets succeed."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lstsq

from dsfab.core.arrays import Floats
from dsfab.export.cad.step.by_members.fillet_edges import CutEdges, curves_beyond
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetWall, corner_tangents
from dsfab.export.cad.step.by_members.patches import differences, height_rows, places, raised, rows_at
from dsfab.export.cad.step.by_members.trimmed import SPLIT, TrimmedFace, inside_of, loop_samples
from dsfab.export.splines import bernstein

NODES = np.linspace(0, 1, 4)[:, None]
"""(4, 1) shares of a piece where it is moved onto a face: a cubic has four heights."""


@dataclass(frozen=True)
class MovedRim:
    """Changes for one face: numbers of rim pieces that then lie on it, and new edges and vertices (6,) by number."""

    pieces: list[int]
    edges: dict[int, NetEdge]
    vertices: dict[int, Floats]


class Rims:
    """Rims of a model, that can move onto the faces beside them.

    pieces : rim edges at sharp corners.    ends : edges by vertex.
    """

    def __init__(self, model: NetModel, pieces: Collection[int]) -> None:
        self.model, self.edges, self.vertices = model, list(model.edges), list(model.vertices)
        self.rims = {e for wall in model.walls for e, _ in wall.steps}
        self.pieces = self.rims.intersection(pieces)
        self.ends = dict[int, list[int]]()
        for e, edge in enumerate(model.edges):
            for v in (edge.start, edge.end):
                self.ends.setdefault(v, []).append(e)
        self.moved = set[int]()

    def beside(self, face: TrimmedFace) -> set[int]:
        """Pieces around a face."""
        return self.pieces & _around(face)

    def seams(self, face: TrimmedFace, curves: Mapping[int, Floats]) -> dict[int, Floats]:
        """Curves around a face that are no rims."""
        around = _around(face)
        return {e: poles for e, poles in curves.items() if e in around and e not in self.rims}

    def moved_onto(self, face: TrimmedFace, on_seams: bool) -> MovedRim | None:
        """Return the changes that put the pieces around a face onto it; None if it has no such pieces.

        on_seams : True if the face runs through the seams at corners, so that pieces beside them can lie on it, too.
        """
        around = _around(face)
        free = {v for v, ends in self.ends.items() if len(ends) == 2 and around & self.rims >= set(ends)}
        ends = {e: (self.edges[e].start, self.edges[e].end) for e in around}
        mine = [e for e in sorted(self.beside(face)) if on_seams or free.issuperset(ends[e])]
        if not mine:
            return None
        normals = np.stack([axes[2] for axes in face.axes])
        moves = {v: -face.gaps(self.vertices[v][None])[0] for e in mine for v in ends[e] if v in free}
        vertices = {v: self.vertices[v] + (way[:, None] * normals).ravel() for v, way in moves.items()}
        edges = dict[int, NetEdge]()
        for e in sorted({e for v in moves for e in self.ends[v]}.union(mine)):
            edge, (a, b) = self.edges[e], (moves.get(v, np.zeros(2)) for v in ends[e])
            way = (1 - NODES) * a + NODES * b
            if e in mine:
                way[1:-1] = -face.gaps(bernstein(NODES[1:-1, 0]) @ edge.poles)
                way = np.linalg.solve(bernstein(NODES[:, 0]), way)
            poles = edge.poles + (way[:, :, None] * normals).reshape(4, 6)
            poles[[0, -1]] = [vertices.get(v, self.vertices[v]) for v in ends[e]]
            edges[e] = replace(edge, poles=poles)
        return MovedRim(mine, edges, vertices)

    def take(self, change: MovedRim) -> None:
        """Apply changes."""
        for e, edge in change.edges.items():
            self.edges[e] = edge
        for v, point in change.vertices.items():
            self.vertices[v] = point
        self.moved |= change.edges.keys()

    def result(self) -> NetModel:
        """Return the model with walls along the moved rims."""
        new, walls = replace(self.model, edges=self.edges, vertices=self.vertices), list[NetWall]()
        for wall in self.model.walls:
            still = self.moved.isdisjoint(e for e, _ in wall.steps)
            walls += [wall] if still else [NetWall([step], new.poles(step)) for step in wall.steps]
        return replace(new, walls=walls)


def _around(face: TrimmedFace) -> set[int]:
    return {e for loop in face.loops for e, _ in loop}


CLEAR = 1 / 6
"""Radius over the thickness of the largest fillet that takes no more of an edge than the surface lies on."""

INNER = 6 / 7
"""Least share of that radius on the inner skin. Around one opening the inner edge is a quarter shorter, and fillets of
2 mm in a sheet of 16 mm took all of it and more."""

HELD = (1 - np.cos(np.pi * np.arange(6) / 5)) / 2
"""Parameters where a part of an edge is held; between six of them the surface is off by less than 5e-8 mm."""

ASKED = np.linspace(0, 1, 33)
"""Parameters where the distance is measured, and where an edge may be cut."""

NEARLY = 1e-6
"""Largest accepted distance in mm: with 5e-7 all corners of a dome take fillets."""

FAST, SMALL = 1e6, 1e-4
"""Weights of held points and of the movement of poles, against 1 of points along edges."""

OTHERS = ((1.0, 1e-2), (0.1, 1e-4))
"""Weights of old places and of second differences of the movement of poles. With the first, faces with three corners of
openings strayed 0.07 to 0.3 mm from other edges, where only `SPLIT` is allowed; with the second 0.02 mm."""

HOLD = np.stack(np.meshgrid(*[np.linspace(0, 1, 13)] * 2), axis=2).reshape(-1, 2)
"""Parameters where a surface stays in place; without them one of a sphere of 2 m moved by 1.4 mm."""

ROWS = rows_at(HOLD)

MOVED = 1 / 400
"""Largest movement there over the thickness."""


def flush_at_corners(model: NetModel, faces: list[TrimmedFace]) -> tuple[NetModel, list[TrimmedFace]]:
    """Cut edges at sharp corners beside trimmed faces, and put these faces exactly onto the cut parts.

    If no degree fits within `SPLIT`, or if the inside moves by more than `MOVED`, the face stays and rims move onto it
    as far as they may.
    """
    beside = {e for face in faces for loop in face.loops for e, _ in loop}
    near = {v for e in beside for v in (model.edges[e].start, model.edges[e].end)}
    corners = {v: half for v, half in corner_tangents(model).items() if v in near}
    work, held = CutEdges(model), set[int]()
    for e, edge in enumerate(model.edges):
        halves = corners.get(edge.start, 0.0), corners.get(edge.end, 0.0)
        if any(halves):
            stops = _stops(edge.poles, halves)
            work.cut(e, True, stops, False)
            parts = [k for k, _ in work.loop([(e, True)])]
            held |= {k for k, half in ((parts[0], halves[0]), (parts[-1], halves[1])) if half}
    new = work.model(model.walls)
    poles = {e: new.edges[e].poles for e in held}
    beyond = {e: P for e, P in curves_beyond(new).items() if e in held}
    found = list[TrimmedFace]()
    for face in faces:
        given = replace(face, loops=[work.loop(loop) for loop in face.loops])
        mine = {e for loop in given.loops for e, _ in loop}
        long = _flush(given, new, poles | beyond) if mine & beyond.keys() else given
        found.append(_flush(given, new, poles) if long is given else long)
    rims = Rims(new, held)
    found = [face if face.exact else _on_rims(face, rims, (poles | beyond, poles)) for face in found]
    return rims.result(), found


def _on_rims(face: TrimmedFace, rims: Rims, held: Iterable[Mapping[int, Floats]]) -> TrimmedFace:
    """Put a face at least on its seams and move its rims onto it, or the rims at corners without seams; else return it
    unchanged."""
    if not rims.beside(face):
        return face
    ways = [rims.seams(face, curves) for curves in held]
    for i, seams in enumerate(ways):
        same = any(all(some[e] is P for e, P in seams.items()) for some in ways[:i])
        on = face if same else _flush(face, rims.model, seams)
        done = None if on is face else _with_moved_rims(on, rims, seams)
        if done:
            return done
    return _with_moved_rims(face, rims, {}) or face


def _with_moved_rims(face: TrimmedFace, rims: Rims, seams: Mapping[int, Floats]) -> TrimmedFace | None:
    """Return the face with moved rims; None if these move, or edges are off, by more than `SPLIT`."""
    change = rims.moved_onto(face, bool(seams))
    moves = [edge.poles - rims.edges[e].poles for e, edge in change.edges.items()] if change else []
    if change is None or np.abs(moves).max() > SPLIT:
        return None
    new = replace(rims.model, edges=[change.edges.get(e, edge) for e, edge in enumerate(rims.edges)])
    on = {e: change.edges[e].poles for e in change.pieces}
    off = float(np.abs(face.gaps(np.concatenate([bernstein(ASKED) @ P for P in on.values()]))).max())
    gap = float(np.abs(face.gaps(np.concatenate([loop_samples(new, loop) for loop in face.loops]))).max())
    done = replace(face, exact=True, gap=gap)
    if off > NEARLY:
        done = _flush(done, new, {**seams, **on})
    if (off > NEARLY and done.outer is face.outer) or done.gap > max(SPLIT, face.gap):
        return None
    rims.take(change)
    return done


def _stops(poles: Floats, halves: tuple[float, float]) -> list[float]:
    """Shares where an edge is cut, beyond fillets whose radius times `halves` reaches along it."""
    whole = 0.1  # share of an edge that is too short for a cut
    radius = CLEAR * float(np.linalg.norm(poles[0, :3] - poles[0, 3:]))
    line, found = bernstein(ASKED) @ poles, list[float]()
    for end, half in enumerate(halves):
        if half:
            away = np.linalg.norm((line - line[-end]).reshape(-1, 2, 3), axis=2)[:: -1 if end else 1]
            far = zip((radius * half, INNER * radius * half), np.maximum.accumulate(away).T, strict=True)
            x = max(float(np.interp(far_as, skin, ASKED)) for far_as, skin in far)  # 1 for a shorter edge
            if x > 1 - whole:
                return []
            found.append(1 - x if end else x)
    near = len(found) == 2 and found[1] - found[0] < whole
    return [float(np.mean(found))] if near else found


def _flush(face: TrimmedFace, model: NetModel, held: Mapping[int, Floats]) -> TrimmedFace:
    """Return a face that runs through its held edges, curves with poles (4, 6); the same face if that fails."""
    mine = [held[e] for e in sorted({e for loop in face.loops for e, _ in loop} & held.keys())]
    if not mine:
        return face
    at, asked = (np.concatenate([bernstein(x) @ P for P in mine]) for x in (HELD, ASKED))
    edges = np.concatenate([loop_samples(model, loop) for loop in face.loops])
    middle, two = edges.mean(axis=0), list[Floats]()
    inside = inside_of(edges)
    most = MOVED * float(np.linalg.norm(middle[:3] - middle[3:]))
    for poles, axes, s in ((face.outer, face.axes[0], np.s_[:, :3]), (face.inner, face.axes[1], np.s_[:, 3:])):
        on = _through(poles, axes, (at[s], asked[s], edges[s], inside[s]), most)
        if on is None:
            return face
        two.append(on)
    new = replace(face, outer=two[0], inner=two[1], exact=True)
    return replace(new, gap=float(np.abs(new.gaps(edges)).max()))


def _through(poles: Floats, axes: Floats, points: tuple[Floats, ...], most: float) -> Floats | None:
    """Return poles of a surface through the first points; None if that fails. All points are (k, 3).

    It is within `FLUSH_TOLERANCE` of the second points, near to the third, those of edges, and within `largest_move` of
    the old surface at the fourth, inside.
    """
    # Largest excess after three degrees: of 502 faces that became flush in seven designs the worst had 10.3. Hopeless
    # faces took nine tenths of the time.
    hopeless = 20.0
    more_degrees = 6  # by which a surface may be raised
    exact = 5e-8  # millimetres: OCCT ignores 1e-7, and poles are rounded
    local, most_off = poles @ axes.T, (NEARLY, SPLIT, most)
    each, heights = [places(poles, axes, some) for some in points], [some @ axes[2] for some in points[:3]]
    heights.append(height_rows(each[3], len(poles) - 1) @ local[..., 2].ravel())
    for calm, smooth in OTHERS:
        best, least = None, NEARLY
        for degree in range(len(poles) - 1, len(poles) + more_degrees):
            new = np.stack([raised(local[..., i], degree) for i in range(3)], axis=2)
            rows = [height_rows(uv, degree) for uv in each]
            off = [z - A @ new[..., 2].ravel() for z, A in zip(heights, rows, strict=True)]
            more = _moves(rows, off, calm, smooth)
            left = [float(np.abs(z - A @ more).max()) for z, A in zip(off, rows, strict=True)][1:]
            share = max(x / y for x, y in zip(left, most_off, strict=True))
            if degree == len(poles) + 1 and share > hopeless:
                return None
            new[..., 2] += more.reshape(new.shape[:2])
            if left[0] < least and share <= 1:
                best, least = new @ axes, left[0]
            if least < exact:
                break
        if best is not None:
            return best
    return None


def _moves(rows: list[Floats], off: list[Floats], calm: float, smooth: float) -> Floats:
    """(k,) movement of pole heights that brings the surface onto the first points and near to the third.

    rows : basis (., k) for each kind of points.    distances : from the surface.
    """
    degree = int(np.sqrt(rows[0].shape[1])) - 1
    still = [smooth * differences(degree + 1), SMALL * np.eye((degree + 1) ** 2), calm * ROWS(degree)]
    right = np.concatenate([FAST * off[0], off[2], np.zeros(sum(map(len, still)))])
    A = np.concatenate([FAST * rows[0], rows[2], *still])
    return np.asarray(lstsq(A, right, lapack_driver="gelsd", cond=1e-15, check_finite=False)[0])
