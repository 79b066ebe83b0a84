"""Flattened plates [Liu et al. 2008], and flat designs divided into pieces of the stock's size.

fingers   ──┐  ┌──┐      fingers of two pieces alternate
            └──┘  └──
scarf     ────╲╲────     two pieces overlap at the joint"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from operator import itemgetter

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.members import Member, MemberGraph
from dsfab.slicing import cut
from dsfab.surface import Surface, link_components, nearest_places, weights_at
from dsfab.workshop.layers import Layering
from dsfab.workshop.parts import (
    PART_LETTERS,
    FlatPart,
    Hole,
    distances_from_outline,
    inside_outline,
    label,
    polygon_area,
)
from dsfab.workshop.splices import SCARF_SLOPE
from dsfab.workshop.strips import HOLE_EDGE_DISTANCE, is_strip


def is_plate(member: Member) -> bool:
    """Return True if a member is built as a plate."""
    return member.kind != "fill" and not is_strip(member)


def layer_numbers(layering: Layering, member: Member) -> tuple[int, ...]:
    """Return the numbers of the layers of a member, from the top; empty if the member is not built."""
    if member.kind == "fill":
        return ()
    return layering.family_layers(member.family) if is_strip(member) else (layering.plate_layer,)


def plate_parts(
    graph: MemberGraph,
    members: Sequence[Member],
    normals: Floats,
    height: float,
    bolt: float,
    missed_nodes: Container[str] = (),
) -> list[FlatPart]:
    """Return the given members as flat plates with holes at their nodes.
    normals : (n, 3) normals at the vertices of the graph's sheet.    missed_nodes : names of nodes without a hole.
    height  : height of the plates over the surface, metres.    bolt : diameter of the holes, metres."""
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    return [_flat_plate(graph, member, normals, (height, bolt), missed_nodes) for member in members]


def _flat_plate(
    graph: MemberGraph, member: Member, normals: Floats, size: tuple[float, float], missed_nodes: Container[str]
) -> FlatPart:
    height, bolt = size
    surface = graph.sheet.surface
    used, F = np.unique(surface.F[member.cells], return_inverse=True)
    flat = FlattenedMesh.from_mesh(surface.V[used] + height * normals[used], F.reshape(-1, 3))
    outline, *slots = flat.loops()
    holes = []
    for node in graph.nodes_along[member.id]:
        hole_place = flat.flat_point(node.point + height * node.normal)
        away = distances_from_outline(hole_place[None], outline)[0]
        is_inside = inside_outline(hole_place[None], outline)[0] and away >= HOLE_EDGE_DISTANCE * bolt
        if is_inside and node.id not in missed_nodes:
            holes.append(Hole(hole_place, bolt, node.id))
    middle = outline.mean(axis=0)
    marks = label(member.id, middle, 0.0, min(PART_LETTERS, 0.1 * float(np.ptp(outline, axis=0).min())))
    part = FlatPart(member.id, member.id, (0.0, 0.0), outline, tuple(holes), tuple(slots), marks, height, flat.strain)
    return part.along_x()


@dataclass(frozen=True, eq=False)
class FlattenedMesh:
    """Triangles F (m, 3), their vertices V (n, 3) in space, and the flattened vertices U (n, 2) in the plane (m)."""

    V: Floats
    F: Ints
    U: Floats

    @classmethod
    def from_mesh(cls, V: Floats, F: Ints) -> "FlattenedMesh":
        """Flatten a mesh V (n, 3), F (m, 3) with as little strain as possible."""
        n = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]).sum(axis=0)
        n /= np.linalg.norm(n)
        x = np.eye(3)[np.abs(n).argmin()]
        x = np.cross(np.cross(n, x), n)
        x /= np.linalg.norm(x)
        U = (V - V.mean(axis=0)) @ np.stack([x, np.cross(n, x)], axis=1)
        data = igl.ARAPData()
        data.max_iter = 60
        igl.arap_precomputation(V, F, 2, np.zeros(1, dtype=np.int32), data)
        return cls(V, F, igl.arap_solve(U[:1], data, U))

    @property
    def strain(self) -> float:
        """Largest strain that flattening causes in a triangle."""
        e1, e2 = (self.V[self.F[:, k]] - self.V[self.F[:, 0]] for k in (1, 2))
        x = e1 / np.linalg.norm(e1, axis=1)[:, None]
        n = np.cross(e1, e2)
        y = np.cross(n / np.linalg.norm(n, axis=1)[:, None], x)
        E = np.stack([np.stack([(e * axis).sum(axis=1) for axis in (x, y)], axis=1) for e in (e1, e2)], axis=2)
        D = np.stack([self.U[self.F[:, k]] - self.U[self.F[:, 0]] for k in (1, 2)], axis=2)
        return float(np.abs(np.linalg.svd(D @ np.linalg.inv(E), compute_uv=False) - 1).max())

    def loops(self) -> list[Floats]:
        """Return the outline, then the openings, (k, 2) each."""
        loops = [self.U[loop] for loop in Surface(self.V, self.F).loops]
        return sorted(loops, key=lambda loop: -abs(polygon_area(loop)))

    def flat_point(self, point: Floats) -> Floats:
        """Return the position (2,) in the plane of the mesh point that is nearest to a point (3,) in space."""
        projection = nearest_places(point[None], self.V, self.F)
        face = self.F[projection.simplex]
        return np.asarray((weights_at(projection.place, self.V, face) @ self.U[face[0]])[0])


FINGER_LENGTH, FINGER_WIDTH = 4.0, 2.0  # length and approximate width of a finger, in sheet thicknesses
REASSIGN_ROUNDS, LEAST_FINGERS = 4, 4.0
"""Small bits of a piece join a neighbouring piece: number of rounds; area of the largest small bit, in finger areas."""
LINE_TOLERANCE = 1e-9  # largest distance of a mesh edge from the line that divides the sheet, divided by sheet size


@dataclass(frozen=True)
class SheetJoint:
    """Joint of the pieces of a sheet: "fingers", "scarf" or "butt" (straight cuts)."""

    kind: str = "butt"
    thickness: float = 0.0

    @property
    def reach(self) -> float:
        """Length of the fingers, or the overlap of a scarf (m)."""
        return {"fingers": FINGER_LENGTH, "scarf": SCARF_SLOPE}.get(self.kind, 0.0) * self.thickness

    def count(self, size: float, room: float) -> int:
        """Return the number of pieces of a sheet with the length `size` (m), for stock of the length `room` (m).
        Raises PatternError if the joints are too long for the stock."""
        if size <= room:
            return 1
        if room <= 2 * self.reach:
            raise PatternError(
                f"joints of a flat sheet are {length(self.reach)} long, too long for sheets of the stock, which have "
                f"room for parts of {length(room)}: give larger sheets in workshop.stock, or workshop.splice = 'none'"
            )
        return int(np.ceil(size / (room - self.reach)))


@dataclass(frozen=True)
class SheetParts:
    """Pieces of a flat sheet, and the numbers of rectangles along and across the sheet."""

    pieces: tuple[FlatPart, ...]
    counts: tuple[int, int]


def sheet_parts(surface: Surface, room: list[tuple[float, float]], joint: SheetJoint = SheetJoint()) -> SheetParts:
    """Cut a flat sheet into as few equal rectangles as possible, with joints.
    room : lengths and widths of the stock, metres. Raises PatternError if parts with joints are too long."""
    x = plane_coordinates(surface)
    level = Surface(np.pad(x - x.min(axis=0), ((0, 0), (0, 1))), surface.F)
    reduction = 0.0
    for _ in range(4):  # a piece with a bit of its neighbour can be too large: try smaller rectangles
        division = _rectangles(level, [(a - reduction, b - reduction) for a, b in room], joint)
        turned = [*room, *((b, a) for a, b in room)]
        excesses = ((p, min(float(max(p.size[0] - a, p.size[1] - b)) for a, b in turned)) for p in division.pieces)
        part, excess = max(excesses, key=itemgetter(1))
        if excess <= LINE_TOLERANCE * float(np.ptp(x)):
            return division
        reduction += excess
    raise PatternError(
        f"piece {part.id} of the flat sheet is {length(part.size[0])} x {length(part.size[1])} together with its "
        f"joints, and fits on no sheet: give larger sheets in workshop.stock, or workshop.splice = 'none'"
    )


def _rectangles(level: Surface, room: list[tuple[float, float]], joint: SheetJoint) -> SheetParts:
    size = np.ptp(level.V[:, :2], axis=0)
    turned = [*room, *((b, a) for a, b in room)]
    counts = min(((joint.count(size[0], a), joint.count(size[1], b)) for a, b in turned), key=lambda n: n[0] * n[1])
    divided, grid = level, _SheetGrid(size, counts, joint)
    for axis in (0, 1):
        if len(lines := grid.lines(axis)):
            divided = cut(divided, [divided.V[:, axis].copy()], [lines], snap=0.0).surface
    parts = list[FlatPart]()
    for (i, j), cells in _rectangle_cells(divided, grid):
        if len(cells):
            parts += _connected_parts(divided, cells, f"S{i + 1}-{j + 1}", grid.bevels((i, j)))
    return SheetParts(tuple(parts), counts)


@dataclass(frozen=True, eq=False)
class _SheetGrid:
    """Division of a sheet into equal rectangles that are connected by joints."""

    size: Floats
    counts: tuple[int, int]
    joint: SheetJoint

    def joints(self, axis: int) -> Floats:
        return np.asarray(self.size[axis] * np.arange(1, self.counts[axis]) / self.counts[axis])

    def fingers(self, axis: int) -> int:
        return 2 * round(float(self.size[axis]) / (2 * FINGER_WIDTH * self.joint.thickness)) + 1

    def lines(self, axis: int) -> Floats:
        half = self.joint.reach / 2
        lines = self.joints(axis) if half == 0 else np.concatenate([self.joints(axis) - half, self.joints(axis) + half])
        if self.joint.kind == "fingers" and self.counts[1 - axis] > 1:
            count = self.fingers(axis)
            lines = np.concatenate([lines, self.size[axis] * np.arange(1, count) / count])
        return np.unique(lines)

    def pieces(self, places: Floats) -> Ints:
        numbers = list[Ints]()
        for axis in (0, 1):
            odd = (places[:, 1 - axis] * self.fingers(1 - axis) / self.size[1 - axis]).astype(int) % 2
            moved = places[:, axis] + (odd - 0.5) * self.joint.reach  # fingers cross a joint by half their length
            numbers.append(np.clip((moved * self.counts[axis] / self.size[axis]).astype(int), 0, self.counts[axis] - 1))
        return np.asarray(numbers[0] * self.counts[1] + numbers[1])

    def inside(self, places: Floats, which: tuple[int, int], margin: float) -> Bools:
        """Return a mask (m,) of the points (m, 3) in the piece `which`, or up to `margin` metres beyond its joints."""
        is_inside = np.ones(len(places), dtype=bool)
        for axis in (0, 1):
            ends = np.concatenate([[-np.inf], self.joints(axis), [np.inf]])[which[axis] : which[axis] + 2]
            is_inside &= (places[:, axis] > ends[0] - margin) & (places[:, axis] < ends[1] + margin)
        return is_inside

    def bevels(self, which: tuple[int, int]) -> list[tuple[int, float]]:
        """Return the lines where scarf bevels of piece `which` begin: axis (0: along, 1: across), coordinate (m)."""
        if self.joint.kind != "scarf":
            return []
        half = self.joint.reach / 2
        bevels = []
        for axis in (0, 1):
            ends = np.concatenate([[0.0], self.joints(axis), [0.0]])[which[axis] : which[axis] + 2]
            bevels += [(axis, float(end + side * half)) for end, side in zip(ends, (1, -1), strict=True) if end > 0]
        return bevels


def _rectangle_cells(divided: Surface, grid: _SheetGrid) -> Iterator[tuple[tuple[int, int], Ints]]:
    along, across = (range(n) for n in grid.counts)
    every, half = list(product(along, across)), grid.joint.reach / 2
    if grid.joint.kind == "fingers":
        least = LEAST_FINGERS * FINGER_LENGTH * FINGER_WIDTH * grid.joint.thickness**2
        pieces = _with_bits_reassigned(divided, grid.pieces(divided.centroids), least)
        yield from ((which, np.flatnonzero(pieces == k)) for k, which in enumerate(every))
        return
    wide = [grid.inside(divided.centroids, which, half) for which in every]
    accepted = wide
    if half:
        inner = [grid.inside(divided.centroids, which, -half) for which in every]
        accepted = [cells & _connected_to(divided, cells, roots) for cells, roots in zip(wide, inner, strict=True)]
    lost = ~np.any(accepted, axis=0)
    for which, candidates, piece_cells in zip(every, wide, accepted, strict=True):
        roots = candidates & lost & grid.inside(divided.centroids, which, 0.0)
        yield which, np.flatnonzero(piece_cells | (candidates & _connected_to(divided, candidates, roots)))


def _connected_to(divided: Surface, selected: Bools, roots: Bools) -> Bools:
    face_a, face_b = (divided.edges.pairs // 3).T
    joined = selected[face_a] & selected[face_b]
    part = link_components(divided.m, face_a[joined], face_b[joined])[1]
    return np.asarray(np.isin(part, part[selected & roots]))


def _with_bits_reassigned(divided: Surface, pieces: Ints, least: float) -> Ints:
    face_a, face_b = (divided.edges.pairs // 3).T
    ends = divided.V[divided.edges.ends[divided.edges.count == 2]]
    edge_lengths, pieces = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), pieces.copy()
    for _ in range(REASSIGN_ROUNDS):
        same_piece = pieces[face_a] == pieces[face_b]
        count, part = link_components(divided.m, face_a[same_piece], face_b[same_piece])
        small = np.bincount(part, divided.areas, count) < least
        if not small.any():
            break
        shared = np.zeros((count, pieces.max() + 1))
        for f, g in ((face_a[~same_piece], face_b[~same_piece]), (face_b[~same_piece], face_a[~same_piece])):
            np.add.at(shared, (part[f], pieces[g]), edge_lengths[~same_piece])
        moves = small & (shared.max(axis=1) > 0)
        pieces = np.where(moves[part], shared.argmax(axis=1)[part], pieces)
    return pieces


def plane_coordinates(surface: Surface) -> Floats:
    """Return the vertices (n, 2) of a flat surface in its plane."""
    normal = surface.normals[0]
    if abs(normal[2]) > 1 - 1e-9:
        return np.asarray(surface.V[:, :2] * ([1, 1] if normal[2] > 0 else [1, -1]))
    x = np.cross([0.0, 0.0, 1.0], normal)
    x /= np.linalg.norm(x)
    return np.asarray(surface.V @ np.stack([x, np.cross(normal, x)], axis=1))


def _connected_parts(divided: Surface, cells: Ints, name: str, bevels: list[tuple[int, float]]) -> list[FlatPart]:
    used, F = np.unique(divided.F[cells], return_inverse=True)
    piece = Surface(divided.V[used], F.reshape(-1, 3))
    count, component = piece.pieces
    parts = []
    for k in range(count):
        vertices, G = np.unique(piece.F[component == k], return_inverse=True)
        part_mesh = Surface(piece.V[vertices], G.reshape(-1, 3))
        loops = [part_mesh.V[loop, :2] for loop in part_mesh.loops]
        outline, *slots = sorted(loops, key=lambda loop: -abs(polygon_area(loop)))
        title = name if count == 1 else f"{name}.{k + 1}"
        label_place, room = _widest_place(part_mesh)
        marks = [*label(title, label_place, 0.0, min(PART_LETTERS, room / 2))] if room > 0 else []
        marks += [line for axis, place in bevels for line in _edges_on_line(part_mesh, axis, place)]
        parts.append(FlatPart(title, "", (0.0, 0.0), outline, slots=tuple(slots), marks=tuple(marks)))
    return parts


def _edges_on_line(surface: Surface, axis: int, place: float) -> list[Floats]:
    ends = surface.V[surface.edges.ends][..., :2]
    on_line = (np.abs(ends[..., axis] - place) < LINE_TOLERANCE * float(np.ptp(surface.V))).all(axis=1)
    return list(ends[on_line])


def _widest_place(surface: Surface) -> tuple[Floats, float]:
    rim = surface.V[np.unique(surface.edges.ends[surface.edges.boundary])]
    away = np.array([np.linalg.norm(rim - place, axis=1).min() for place in surface.centroids])
    return surface.centroids[away.argmax(), :2], float(away.max())
