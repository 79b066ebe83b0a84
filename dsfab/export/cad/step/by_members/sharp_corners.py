"""Put trimmed faces exactly onto edges at sharp corners, for fillets."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lstsq

from dsfab.core.arrays import Floats
from dsfab.export.cad.step.by_members.fillet_edges import CutEdges, curves_beyond
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetWall, corner_tangents
from dsfab.export.cad.step.by_members.patches import differences, height_rows, places, raised_poles, rows_at
from dsfab.export.cad.step.by_members.trimmed import HELD_PLACES, SPLIT, TrimmedFace, inside_of, loop_samples
from dsfab.export.splines import bernstein


@dataclass(frozen=True)
class MovedRim:
    """Changes that move edges of walls onto a face.    pieces : numbers of the edges that lie on the face afterwards.
    edges, vertices : changed values, by number. A vertex (6,) is a pair of points on the two skins, mm."""

    pieces: list[int]
    edges: dict[int, NetEdge]
    vertices: dict[int, Floats]


class Rims:
    """Edges of walls (rims), which can move onto neighbouring faces at sharp corners."""

    def __init__(self, model: NetModel, pieces: Collection[int]) -> None:
        self.model, self.edges, self.vertices = model, list(model.edges), list(model.vertices)
        self.rims = {e for wall in model.walls for e, _ in wall.steps}
        self.pieces = self.rims.intersection(pieces)
        self.ends = dict[int, list[int]]()
        for e, edge in enumerate(model.edges):
            for v in (edge.start, edge.end):
                self.ends.setdefault(v, []).append(e)
        self.moved = set[int]()

    def pieces_around(self, face: TrimmedFace) -> set[int]:
        """Return the numbers of the rims (edges of walls) at sharp corners on the outline of a face."""
        return self.pieces & _edges_of_face(face)

    def seams(self, face: TrimmedFace, curves: Mapping[int, Floats]) -> dict[int, Floats]:
        """Select the `curves` (poles by edge number) on a face's outline that are not rims (edges of walls)."""
        around = _edges_of_face(face)
        return {e: poles for e, poles in curves.items() if e in around and e not in self.rims}

    def moved_onto(self, face: TrimmedFace, on_seams: bool) -> MovedRim | None:
        """Return the changes that move rims (edges of walls) onto a face; None if no rim can move.
        on_seams : True if rims that end at seams (edges between two faces) can move, too."""
        nodes, around = np.linspace(0, 1, 4)[:, None], _edges_of_face(face)  # heights at 4 places determine a cubic
        free = {v for v, ends in self.ends.items() if len(ends) == 2 and around & self.rims >= set(ends)}
        ends = {e: (self.edges[e].start, self.edges[e].end) for e in around}
        face_pieces = [e for e in sorted(self.pieces_around(face)) if on_seams or free.issuperset(ends[e])]
        if not face_pieces:
            return None
        normals = np.stack([axes[2] for axes in face.axes])
        moves = {v: -face.gaps(self.vertices[v][None])[0] for e in face_pieces for v in ends[e] if v in free}
        vertices = {v: self.vertices[v] + (shifts[:, None] * normals).ravel() for v, shifts in moves.items()}
        edges = dict[int, NetEdge]()
        for e in sorted({e for v in moves for e in self.ends[v]}.union(face_pieces)):
            edge, (a, b) = self.edges[e], (moves.get(v, np.zeros(2)) for v in ends[e])
            shifts = (1 - nodes) * a + nodes * b
            if e in face_pieces:
                shifts[1:-1] = -face.gaps(bernstein(nodes[1:-1, 0]) @ edge.poles)
                shifts = np.linalg.solve(bernstein(nodes[:, 0]), shifts)
            poles = edge.poles + (shifts[:, :, None] * normals).reshape(4, 6)
            poles[[0, -1]] = [vertices.get(v, self.vertices[v]) for v in ends[e]]
            edges[e] = replace(edge, poles=poles)
        return MovedRim(face_pieces, edges, vertices)

    def take(self, change: MovedRim) -> None:
        """Replace edges and vertices of the model by the values in `change`."""
        for e, edge in change.edges.items():
            self.edges[e] = edge
        for v, point in change.vertices.items():
            self.vertices[v] = point
        self.moved |= change.edges.keys()

    def result(self) -> NetModel:
        """Return the model with the moved rims (edges of walls)."""
        model, walls = replace(self.model, edges=self.edges, vertices=self.vertices), list[NetWall]()
        for wall in self.model.walls:
            still = self.moved.isdisjoint(e for e, _ in wall.steps)
            walls += [wall] if still else [NetWall([step], model.poles(step)) for step in wall.steps]
        return replace(model, walls=walls)


def _edges_of_face(face: TrimmedFace) -> set[int]:
    return {e for loop in face.loops for e, _ in loop}


FILLET_SHARE = 1 / 6  # edges lie exactly on the surface as far as a fillet of this radius / thickness reaches

INNER_SHARE = 6 / 7
"""Smallest ratio of a fillet's radius on the inner skin to its radius on the outer skin."""

TEST_PLACES = np.linspace(0, 1, 33)  # parameters of the samples along an edge

FLUSH_TOLERANCE = 1e-6
"""Largest distance (mm) between a face and its edge at a sharp corner where OCCT can make a fillet."""

STILL_ROWS = rows_at(np.stack(np.meshgrid(*[np.linspace(0, 1, 13)] * 2), axis=2).reshape(-1, 2))
"""Function of a surface's degree. It returns the Bezier basis at 13 x 13 places that a fit should hardly move."""

MOVED = 1 / 400  # largest movement of points inside a face, as a fraction of the thickness


def flush_at_corners(model: NetModel, faces: list[TrimmedFace]) -> tuple[NetModel, list[TrimmedFace]]:
    """Cut edges near sharp corners, and fit trimmed faces exactly to the edge parts at the corners."""
    face_edges = {e for face in faces for loop in face.loops for e, _ in loop}
    near_vertices = {v for e in face_edges for v in (model.edges[e].start, model.edges[e].end)}
    corners = {v: half for v, half in corner_tangents(model).items() if v in near_vertices}
    work, held_edges = CutEdges(model), set[int]()
    for e, edge in enumerate(model.edges):
        halves = corners.get(edge.start, 0.0), corners.get(edge.end, 0.0)
        if any(halves):
            work.cut(e, True, _stops(edge.poles, halves), False)
            parts = [k for k, _ in work.loop([(e, True)])]
            held_edges |= {k for k, half in ((parts[0], halves[0]), (parts[-1], halves[1])) if half}
    cut_model = work.model(model.walls)
    poles = {e: cut_model.edges[e].poles for e in held_edges}
    beyond = {e: P for e, P in curves_beyond(cut_model).items() if e in held_edges}
    result = list[TrimmedFace]()
    for face in faces:
        cut_face = replace(face, loops=[work.loop(loop) for loop in face.loops])
        cut_edges = {e for loop in cut_face.loops for e, _ in loop}
        extended_face = _flush_face(cut_face, cut_model, poles | beyond) if cut_edges & beyond.keys() else cut_face
        result.append(_flush_face(cut_face, cut_model, poles) if extended_face is cut_face else extended_face)
    rims = Rims(cut_model, held_edges)
    result = [face if face.exact else _on_rims(face, rims, (poles | beyond, poles)) for face in result]
    return rims.result(), result


def _on_rims(face: TrimmedFace, rims: Rims, held_curves: Iterable[Mapping[int, Floats]]) -> TrimmedFace:
    if not rims.pieces_around(face):
        return face
    ways = [rims.seams(face, curves) for curves in held_curves]
    for i, seams in enumerate(ways):
        is_repeated = any(all(earlier[e] is P for e, P in seams.items()) for earlier in ways[:i])
        flush_face = face if is_repeated else _flush_face(face, rims.model, seams)
        result = None if flush_face is face else _with_moved_rims(flush_face, rims, seams)
        if result:
            return result
    return _with_moved_rims(face, rims, {}) or face


def _with_moved_rims(face: TrimmedFace, rims: Rims, seams: Mapping[int, Floats]) -> TrimmedFace | None:
    change = rims.moved_onto(face, bool(seams))
    moves = [edge.poles - rims.edges[e].poles for e, edge in change.edges.items()] if change else []
    if change is None or np.abs(moves).max() > SPLIT:
        return None
    moved_model = replace(rims.model, edges=[change.edges.get(e, edge) for e, edge in enumerate(rims.edges)])
    pieces = {e: change.edges[e].poles for e in change.pieces}
    distance = float(np.abs(face.gaps(np.concatenate([bernstein(TEST_PLACES) @ P for P in pieces.values()]))).max())
    gap = float(np.abs(face.gaps(np.concatenate([loop_samples(moved_model, loop) for loop in face.loops]))).max())
    result = replace(face, exact=True, gap=gap)
    if distance > FLUSH_TOLERANCE:
        result = _flush_face(result, moved_model, {**seams, **pieces})
    if (distance > FLUSH_TOLERANCE and result.outer is face.outer) or result.gap > max(SPLIT, face.gap):
        return None
    rims.take(change)
    return result


def _stops(poles: Floats, halves: tuple[float, float]) -> list[float]:
    shortest_cut = 0.1  # shortest part between two cuts, or beyond a single cut, as a fraction of the edge
    radius = FILLET_SHARE * float(np.linalg.norm(poles[0, :3] - poles[0, 3:]))
    line, shares = bernstein(TEST_PLACES) @ poles, list[float]()
    for end, half in enumerate(halves):
        if half:
            away = np.linalg.norm((line - line[-end]).reshape(-1, 2, 3), axis=2)[:: -1 if end else 1]
            limits = zip((radius * half, INNER_SHARE * radius * half), np.maximum.accumulate(away).T, strict=True)
            x = max(float(np.interp(far_as, skin, TEST_PLACES)) for far_as, skin in limits)  # x = 1 if no fillet fits
            if x > 1 - shortest_cut:
                return []
            shares.append(1 - x if end else x)
    is_close = len(shares) == 2 and shares[1] - shares[0] < shortest_cut
    return [float(np.mean(shares))] if is_close else shares


def _flush_face(face: TrimmedFace, model: NetModel, held_curves: Mapping[int, Floats]) -> TrimmedFace:
    curves = [held_curves[e] for e in sorted({e for loop in face.loops for e, _ in loop} & held_curves.keys())]
    if not curves:
        return face
    held_points, test_points = (np.concatenate([bernstein(x) @ P for P in curves]) for x in (HELD_PLACES, TEST_PLACES))
    edges = np.concatenate([loop_samples(model, loop) for loop in face.loops])
    middle, surfaces = edges.mean(axis=0), list[Floats]()
    inside = inside_of(edges)
    largest_move = MOVED * float(np.linalg.norm(middle[:3] - middle[3:]))
    for poles, axes, s in face.skins:
        points = tuple(group[:, s] for group in (held_points, test_points, edges, inside))
        surface = _surface_through(poles, axes, points, largest_move)
        if surface is None:
            return face
        surfaces.append(surface)
    result = replace(face, outer=surfaces[0], inner=surfaces[1], exact=True)
    return replace(result, gap=float(np.abs(result.gaps(edges)).max()))


def _surface_through(poles: Floats, axes: Floats, points: tuple[Floats, ...], largest_move: float) -> Floats | None:
    """Return poles of a surface through `points[0]` and near the surface of `poles`; None if no fit succeeds."""
    hopeless = 20.0  # the search ends after three polynomial degrees if a residual is over 20 times its limit
    more_degrees = 6  # the degree of a surface rises by at most 6
    exact = 5e-8  # goal of the fit (mm): half of the gap that OCCT ignores, because rounded poles widen gaps
    weights = (1.0, 1e-2), (0.1, 1e-4)  # weights for two trials: of the old surface, and of smooth changes
    local, limits = poles @ axes.T, (FLUSH_TOLERANCE, SPLIT, largest_move)
    parameters, heights = [places(poles, axes, group) for group in points], [group @ axes[2] for group in points[:3]]
    heights.append(height_rows(parameters[3], len(poles) - 1) @ local[..., 2].ravel())
    for calm, smooth in weights:
        result, least = None, FLUSH_TOLERANCE
        for degree in range(len(poles) - 1, len(poles) + more_degrees):
            raised_surface = np.stack([raised_poles(local[..., i], degree) for i in range(3)], axis=2)
            rows = [height_rows(uv, degree) for uv in parameters]
            distances = [z - A @ raised_surface[..., 2].ravel() for z, A in zip(heights, rows, strict=True)]
            moves = _moves(rows, distances, calm, smooth)
            residuals = [float(np.abs(z - A @ moves).max()) for z, A in zip(distances, rows, strict=True)][1:]
            share = max(x / y for x, y in zip(residuals, limits, strict=True))
            if degree == len(poles) + 1 and share > hopeless:
                return None
            raised_surface[..., 2] += moves.reshape(raised_surface.shape[:2])
            if residuals[0] < least and share <= 1:
                result, least = raised_surface @ axes, residuals[0]
            if least < exact:
                break
        if result is not None:
            return result
    return None


def _moves(rows: list[Floats], distances: list[Floats], calm: float, smooth: float) -> Floats:
    """Return the changes of pole heights (mm) that move a surface by `distances` at sample points (least squares)."""
    held_weight, move_weight = 1e6, 1e-4  # weights of points that must be on the surface, and of small pole movements
    degree = int(np.sqrt(rows[0].shape[1])) - 1
    still = [smooth * differences(degree + 1), move_weight * np.eye((degree + 1) ** 2), calm * STILL_ROWS(degree)]
    right = np.concatenate([held_weight * distances[0], distances[2], np.zeros(sum(map(len, still)))])
    A = np.concatenate([held_weight * rows[0], rows[2], *still])
    return np.asarray(lstsq(A, right, lapack_driver="gelsd", cond=1e-15, check_finite=False)[0])
