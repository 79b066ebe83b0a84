"""Flattened plates, and flat designs divided into pieces of the stock's size."""

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
from dsfab.surface import Surface, connected, nearest, weights_at
from dsfab.workshop.layers import Layering
from dsfab.workshop.parts import LABEL, FlatPart, Hole, label, polygon_area
from dsfab.workshop.splices import SCARF
from dsfab.workshop.strips import EDGE, is_strip


def is_plate(member: Member) -> bool:
    """Whether a member is built as a plate: fills are not built, and all others are strips."""
    return member.kind != "fill" and not is_strip(member)


def layer_numbers(layering: Layering, member: Member) -> tuple[int, ...]:
    """The layers that a member is in, counted from the top; none where it is not built."""
    if member.kind == "fill":
        return ()
    return layering.numbers(member.family) if is_strip(member) else (layering.plates,)


def plate_parts(
    graph: MemberGraph,
    members: Sequence[Member],
    normals: Floats,
    height: float,
    bolt: float,
    left: Container[str] = (),
) -> list[FlatPart]:
    """Members of a graph as plates at a height over the surface, with holes of a diameter at their nodes, metres;
    normals (n, 3) at the vertices of its sheet. Nodes that are left, by their names, have none."""
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    return [_plate(graph, member, normals, (height, bolt), left) for member in members]


def _plate(
    graph: MemberGraph, member: Member, normals: Floats, size: tuple[float, float], left: Container[str]
) -> FlatPart:
    height, bolt = size
    surface = graph.sheet.surface
    used, F = np.unique(surface.F[member.cells], return_inverse=True)
    flat = FlattenedMesh.of(surface.V[used] + height * normals[used], F.reshape(-1, 3))
    outline, *slots = flat.loops()
    holes = []
    for node in graph.along[member.id]:
        at = flat.at(node.point + height * node.normal)
        if node.id not in left and _inside(outline, at, EDGE * bolt):
            holes.append(Hole(at, bolt, node.id))
    middle = outline.mean(axis=0)
    marks = label(member.id, middle, 0.0, min(LABEL, 0.1 * float(np.ptp(outline, axis=0).min())))
    part = FlatPart(member.id, member.id, (0.0, 0.0), outline, tuple(holes), tuple(slots), marks, height, flat.strain)
    return part.lying()


def _inside(outline: Floats, at: Floats, least: float) -> bool:
    """Whether a place (2,) is so far inside of a polygon (k, 2)."""
    a, b = outline, np.roll(outline, -1, axis=0)
    t = np.clip(((at - a) * (b - a)).sum(axis=1) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-30), 0, 1)
    away = np.linalg.norm(at - a - t[:, None] * (b - a), axis=1).min()
    crosses = (a[:, 1] > at[1]) != (b[:, 1] > at[1])
    x = a[:, 0] + (at[1] - a[:, 1]) / np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.sum(crosses & (x > at[0])) % 2) and bool(away >= least)


@dataclass(frozen=True, eq=False)
class FlattenedMesh:
    """Triangles F (m, 3) of points V (n, 3) and their places U (n, 2) in the plane, metres."""

    V: Floats
    F: Ints
    U: Floats

    @classmethod
    def of(cls, V: Floats, F: Ints) -> "FlattenedMesh":
        """As rigid as possible, from the projection along the mean normal; what bends only keeps every length."""
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
        """The largest of all triangles, by the singular values of what flattening does to them."""
        e1, e2 = (self.V[self.F[:, k]] - self.V[self.F[:, 0]] for k in (1, 2))
        x = e1 / np.linalg.norm(e1, axis=1)[:, None]
        n = np.cross(e1, e2)
        y = np.cross(n / np.linalg.norm(n, axis=1)[:, None], x)
        E = np.stack([np.stack([(e * axis).sum(axis=1) for axis in (x, y)], axis=1) for e in (e1, e2)], axis=2)
        D = np.stack([self.U[self.F[:, k]] - self.U[self.F[:, 0]] for k in (1, 2)], axis=2)
        return float(np.abs(np.linalg.svd(D @ np.linalg.inv(E), compute_uv=False) - 1).max())

    def loops(self) -> list[Floats]:
        """(k, 2) the outline, then its openings."""
        found = [self.U[loop] for loop in Surface(self.V, self.F).loops]
        return sorted(found, key=lambda loop: -abs(polygon_area(loop)))

    def at(self, point: Floats) -> Floats:
        """(2,) where the place of the mesh nearest to a point (3,) is in the plane."""
        there = nearest(point[None], self.V, self.F)
        face = self.F[there.simplex]
        return np.asarray((weights_at(there.place, self.V, face) @ self.U[face[0]])[0])


FINGER, PITCH = 4.0, 2.0
"""Thicknesses that a finger is long, and about how wide it is."""
ROUNDS, WHOLE = 4, 4.0
"""Rounds in which bits of fingers that hang on nothing, smaller than so many fingers, go to a piece beside them."""
ON = 1e-9
"""Share of a sheet's size by which an edge of its mesh may be off a line that it was divided along."""


@dataclass(frozen=True)
class SheetJoint:
    """How pieces are joined: by "fingers", by a "scarf", or not at all, "butt"; of a sheet of a thickness, metres."""

    kind: str = "butt"
    thickness: float = 0.0

    @property
    def reach(self) -> float:
        """Metres along which both pieces are there, in turn or on each other."""
        return {"fingers": FINGER, "scarf": SCARF}.get(self.kind, 0.0) * self.thickness

    def count(self, size: float, room: float) -> int:
        """How many pieces a length is divided into, none with its joints longer than the room, metres.

        Raises PatternError where joints would be most of a piece.
        """
        if size <= room:
            return 1
        if room <= 2 * self.reach:
            raise PatternError(
                f"joints of a flat sheet are {length(self.reach)} long, too long for stock with room for "
                f"{length(room)}: give larger sheets in workshop.stock, or workshop.splice = 'none'"
            )
        return int(np.ceil(size / (room - self.reach)))


@dataclass(frozen=True)
class SheetParts:
    """The pieces, and how many there are along and across the sheet."""

    pieces: tuple[FlatPart, ...]
    counts: tuple[int, int]


def sheet_parts(surface: Surface, room: list[tuple[float, float]], joint: SheetJoint = SheetJoint()) -> SheetParts:
    """A flat sheet cut into rectangles, as few as there can be, none larger than one of `room`, metres.

    Pieces of one rectangle that do not hang together are parts of their own; openings become slots. With fingers all
    pieces together are the sheet; with a scarf they are on each other along the joints.

    Raises PatternError where joints are too long for the stock, or pieces with all that hangs on them are.
    """
    x = in_plane(surface)
    level = Surface(np.pad(x - x.min(axis=0), ((0, 0), (0, 1))), surface.F)
    less = 0.0
    for _ in range(4):  # smaller rectangles, because bits of neighbours can make a piece too large
        found = _divided(level, [(a - less, b - less) for a, b in room], joint)
        part, beyond = max(((part, _beyond(part, room)) for part in found.pieces), key=itemgetter(1))
        if beyond <= ON * float(np.ptp(x)):
            return found
        less += beyond
    raise PatternError(
        f"piece {part.id} of the flat sheet is {length(part.size[0])} x {length(part.size[1])} with what hangs on it, "
        "and fits on no sheet: give larger sheets in workshop.stock, or workshop.splice = 'none'"
    )


def _beyond(part: FlatPart, room: list[tuple[float, float]]) -> float:
    """Metres by which a part is too large for all of some rectangles, along or across; at most 0 where it fits."""
    x, y = part.size
    return float(min(max(x - a, y - b) for a, b in [*room, *((b, a) for a, b in room)]))


def _divided(level: Surface, room: list[tuple[float, float]], joint: SheetJoint) -> SheetParts:
    """A level sheet with its lowest corner at the origin, in rectangles and what belongs to their joints."""
    size = np.ptp(level.V[:, :2], axis=0)
    turned = [*room, *((b, a) for a, b in room)]
    counts = min(((joint.count(size[0], a), joint.count(size[1], b)) for a, b in turned), key=lambda n: n[0] * n[1])
    divided, grid = level, _Grid(size, counts, joint)
    for axis in (0, 1):
        if len(lines := grid.lines(axis)):
            divided = cut(divided, [divided.V[:, axis].copy()], [lines], snap=0.0).surface
    found = list[FlatPart]()
    for (i, j), cells in _cells(divided, grid):
        if len(cells):
            found += _parts(divided, cells, f"S{i + 1}-{j + 1}", grid.bevels((i, j)))
    return SheetParts(tuple(found), counts)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Rectangles of a size (2,), metres, so many along and across, and what lies along their joints."""

    size: Floats
    counts: tuple[int, int]
    joint: SheetJoint

    def joints(self, axis: int) -> Floats:
        """(q,) where pieces meet, metres."""
        return np.asarray(self.size[axis] * np.arange(1, self.counts[axis]) / self.counts[axis])

    def fingers(self, axis: int) -> int:
        """How many lie side by side along the whole sheet, an odd number: both ends look alike."""
        return 2 * round(float(self.size[axis]) / (2 * PITCH * self.joint.thickness)) + 1

    def lines(self, axis: int) -> Floats:
        """(q,) ascending, along which the sheet is to be divided."""
        half = self.joint.reach / 2
        found = self.joints(axis) if half == 0 else np.concatenate([self.joints(axis) - half, self.joints(axis) + half])
        if self.joint.kind == "fingers" and self.counts[1 - axis] > 1:
            count = self.fingers(axis)
            found = np.concatenate([found, self.size[axis] * np.arange(1, count) / count])
        return np.unique(found)

    def pieces(self, places: Floats) -> Ints:
        """(m,) the number of the piece of each of places (m, 3): along joints both have every other finger."""
        at = list[Ints]()
        for axis in (0, 1):
            odd = (places[:, 1 - axis] * self.fingers(1 - axis) / self.size[1 - axis]).astype(int) % 2
            moved = places[:, axis] + (odd - 0.5) * self.joint.reach  # a finger reaches half of its length over
            at.append(np.clip((moved * self.counts[axis] / self.size[axis]).astype(int), 0, self.counts[axis] - 1))
        return np.asarray(at[0] * self.counts[1] + at[1])

    def inside(self, places: Floats, which: tuple[int, int], more: float) -> Bools:
        """(m,) whether places (m, 3) are in a rectangle, or no more than `more` metres beyond one of its joints."""
        found = np.ones(len(places), dtype=bool)
        for axis in (0, 1):
            ends = np.concatenate([[-np.inf], self.joints(axis), [np.inf]])[which[axis] : which[axis] + 2]
            found &= (places[:, axis] > ends[0] - more) & (places[:, axis] < ends[1] + more)
        return found

    def bevels(self, which: tuple[int, int]) -> list[tuple[int, float]]:
        """Axes and places, metres, of lines across a piece at which the bevels of its scarf joints begin."""
        if self.joint.kind != "scarf":
            return []
        half = self.joint.reach / 2
        found = []
        for axis in (0, 1):
            ends = np.concatenate([[0.0], self.joints(axis), [0.0]])[which[axis] : which[axis] + 2]
            found += [(axis, float(end + side * half)) for end, side in zip(ends, (1, -1), strict=True) if end > 0]
        return found


def _cells(divided: Surface, grid: _Grid) -> Iterator[tuple[tuple[int, int], Ints]]:
    """The cells (c,) of each rectangle, with what belongs to its joints."""
    along, across = (range(n) for n in grid.counts)
    every, half = list(product(along, across)), grid.joint.reach / 2
    if grid.joint.kind == "fingers":
        least = WHOLE * FINGER * PITCH * grid.joint.thickness**2
        pieces = _hanging(divided, grid.pieces(divided.centroids), least)
        yield from ((which, np.flatnonzero(pieces == k)) for k, which in enumerate(every))
        return
    wide = [grid.inside(divided.centroids, which, half) for which in every]
    kept = [
        here & _rooted(divided, here, grid.inside(divided.centroids, which, -half)) if half else here
        for which, here in zip(every, wide, strict=True)
    ]
    lost = ~np.any(kept, axis=0)
    for which, here, own in zip(every, wide, kept, strict=True):
        more = here & lost & grid.inside(divided.centroids, which, 0.0)
        yield which, np.flatnonzero(own | (here & _rooted(divided, here, more)))


def _rooted(divided: Surface, here: Bools, roots: Bools) -> Bools:
    """(m,) whether faces hang together with one of some roots (m,), by faces that are here (m,)."""
    one, other = (divided.edges.pairs // 3).T
    joined = here[one] & here[other]
    part = connected(divided.m, one[joined], other[joined])[1]
    return np.asarray(np.isin(part, part[here & roots]))


def _hanging(divided: Surface, pieces: Ints, least: float) -> Ints:
    """(m,) pieces of faces: what hangs together of one and is smaller than `least`, square metres, goes to the piece
    beside it with which it has most of its edges in common."""
    one, other = (divided.edges.pairs // 3).T
    ends = divided.V[divided.edges.ends[divided.edges.count == 2]]
    long, pieces = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), pieces.copy()
    for _ in range(ROUNDS):
        same = pieces[one] == pieces[other]
        count, part = connected(divided.m, one[same], other[same])
        small = np.bincount(part, divided.areas, count) < least
        if not small.any():
            break
        shared = np.zeros((count, pieces.max() + 1))
        for f, g in ((one[~same], other[~same]), (other[~same], one[~same])):
            np.add.at(shared, (part[f], pieces[g]), long[~same])
        moves = small & (shared.max(axis=1) > 0)
        pieces = np.where(moves[part], shared.argmax(axis=1)[part], pieces)
    return pieces


def in_plane(surface: Surface) -> Floats:
    """(n, 2) the vertices of a flat surface in its plane, x and y as they are where it is level."""
    normal = surface.normals[0]
    if abs(normal[2]) > 1 - 1e-9:
        return np.asarray(surface.V[:, :2] * ([1, 1] if normal[2] > 0 else [1, -1]))
    x = np.cross([0.0, 0.0, 1.0], normal)
    x /= np.linalg.norm(x)
    return np.asarray(surface.V @ np.stack([x, np.cross(normal, x)], axis=1))


def _parts(divided: Surface, cells: Ints, name: str, bevels: list[tuple[int, float]]) -> list[FlatPart]:
    """The connected parts of some cells (c,), with lines where bevels begin: an axis and a place on it, metres."""
    used, F = np.unique(divided.F[cells], return_inverse=True)
    piece = Surface(divided.V[used], F.reshape(-1, 3))
    count, of = piece.pieces
    found = []
    for k in range(count):
        mine, G = np.unique(piece.F[of == k], return_inverse=True)
        one = Surface(piece.V[mine], G.reshape(-1, 3))
        loops = [one.V[loop, :2] for loop in one.loops]
        outline, *slots = sorted(loops, key=lambda loop: -abs(polygon_area(loop)))
        title = name if count == 1 else f"{name}.{k + 1}"
        at, room = _widest_place(one)
        marks = [*label(title, at, 0.0, min(LABEL, room / 2))] if room > 0 else []
        marks += [line for axis, place in bevels for line in _along(one, axis, place)]
        found.append(FlatPart(title, "", (0.0, 0.0), outline, slots=tuple(slots), marks=tuple(marks)))
    return found


def _along(surface: Surface, axis: int, place: float) -> list[Floats]:
    """(2, 2) edges of a mesh in the plane that lie on a line across an axis, metres."""
    ends = surface.V[surface.edges.ends][..., :2]
    on = (np.abs(ends[..., axis] - place) < ON * float(np.ptp(surface.V))).all(axis=1)
    return list(ends[on])


def _widest_place(surface: Surface) -> tuple[Floats, float]:
    """(2,) a place far from all edges of a flat surface, and how far it is from their corners, metres."""
    rim = surface.V[np.unique(surface.edges.ends[surface.edges.boundary])]
    away = np.array([np.linalg.norm(rim - place, axis=1).min() for place in surface.centroids])
    return surface.centroids[away.argmax(), :2], float(away.max())
