"""`Shape`: a coarse copy of a surface, and its features that suggest supports."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import find_peaks
from scipy.spatial import ConvexHull, QhullError, cKDTree

from dsfab.core.arrays import Floats, Ints, lengths, lock
from dsfab.core.errors import SurfaceError
from dsfab.surface import Surface, polyline_length, remeshed_surface

VERTICES = 1500  # Usual number of vertices of a coarse shape, for fast solves.
STEPS = 400  # Number of equal steps along a closed edge.
SLOPE = 0.25  # Slope (14 degrees) at which `levelness` is 1/2.
CORNER = 40.0  # Smallest change of an edge's direction at a corner, degrees.
DEPTH, RISE = 0.15, 0.05
"""Smallest depth of a foot (low part of an edge), and largest rise within a foot, divided by the surface's height."""
SMALL = 0.15  # Largest length of a small edge, divided by the length of the surface's longest edge.
STRIP = 3.0  # Smallest ratio of long to short sides of a strip, such as a footbridge.
NECK = 0.2  # Smallest vertical component of `Shape.neck` for a column head (up) or a hanging point (down).
LUG = 2.0  # Smallest height of a lug, divided by its radius.
HEAD = 2.2  # Height that people need, metres.


def coarse_surface(surface: Surface) -> Surface:
    """Return the surface with about `VERTICES` vertices; unchanged if a new mesh is impossible."""
    if 0.5 * VERTICES < surface.n < 1.6 * VERTICES:
        return surface
    middle, size = surface.V.mean(axis=0), surface.size
    unit = Surface((surface.V - middle) / size, surface.F)
    try:
        coarse = remeshed_surface(unit, float(np.sqrt(unit.area / VERTICES * 2 / np.sqrt(3))))
    except SurfaceError:
        return surface
    return Surface(coarse.V * size + middle, coarse.F)


def is_nearly_closed(surface: Surface) -> bool:
    """Return True if the surface has no boundary except very small holes."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() < 0.02 * np.sqrt(surface.area))


def is_figure(surface: Surface) -> bool:
    """Return True if the surface is closed, or if its boundary is shorter than 2 sqrt(area)."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() ** 2 < 4 * surface.area)


def depth_within(points: Floats, middle: Floats) -> float | None:
    """Return the distance (m) from `middle` (2,) to the convex outline of points (k, 2); negative outside.
    Return None if the points lie on a line."""
    try:
        sides = ConvexHull(points).equations  # negative for a point inside
    except (QhullError, ValueError):
        return None
    return float(-(sides[:, :2] @ middle + sides[:, 2]).max())


@dataclass(frozen=True, eq=False)
class Edge:
    """A closed free edge (boundary loop), or a part of an edge. loop : number of the loop on the coarse surface.
    points : (k, 3) points in equal steps along the edge, metres. A closed edge does not repeat its first point.
    closed : True for a whole loop."""

    loop: int
    points: Floats
    closed: bool = True

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 3))

    @classmethod
    def from_loop(cls, loop: int, P: Floats) -> "Edge":
        """Return the closed edge through points P (k, 3), with new points in equal steps."""
        line = np.vstack([P, P[:1]])
        along = np.concatenate([[0.0], np.cumsum(lengths(np.diff(line, axis=0)))])
        even = np.linspace(0.0, along[-1], STEPS, endpoint=False)
        return cls(loop, np.stack([np.interp(even, along, x) for x in line.T], axis=1))

    @cached_property
    def length(self) -> float:
        """Length of the edge, metres."""
        return polyline_length(np.vstack([self.points, self.points[:1]]) if self.closed else self.points)

    @property
    def z(self) -> Floats:
        """Heights (k,) of the points, metres."""
        return self.points[:, 2]

    def part(self, start: int, end: int) -> "Edge":
        """Return the part of a closed edge from point `start` to point `end`, both included."""
        run = np.arange(start, end + 1 if end >= start else end + 1 + len(self.points))
        return Edge(self.loop, self.points[run % len(self.points)], closed=False)

    @cached_property
    def levelness(self) -> float:
        """Score of the edge: 1 if level, 1/2 if the root mean square slope is `SLOPE`."""
        P = self.points[:: max(len(self.points) // 60, 1)]
        step = np.diff(np.vstack([P, P[:1]]), axis=0) if self.closed else np.diff(P, axis=0)
        run = lengths(step) + 1e-12
        return float(1 / (1 + (step[:, 2] ** 2 / run).sum() / run.sum() / SLOPE**2))

    @cached_property
    def straight_levelness(self) -> float:
        """Score of the edge: 1 if level, 1/2 if (largest - smallest height) / length is `SLOPE`."""
        return float(1 / (1 + (np.ptp(self.z) / max(self.length, 1e-12) / SLOPE) ** 2))

    def valleys(self, height: float, shortest: float) -> Iterator[tuple["Edge", float]]:
        """Yield the low parts of a closed edge, with the depth (m) of each part. height : of the surface, metres.
        shortest : smallest length of a part, metres."""
        z, n, step = self.z, len(self.points), self.length / len(self.points)
        tops, facts = find_peaks(-np.tile(z, 3), prominence=DEPTH * height, plateau_size=(None, None))
        for top, depth in zip((tops - n).tolist(), facts["prominences"].tolist(), strict=True):
            if not 0 <= top < n:
                continue
            profiles = [np.maximum.accumulate(np.roll(z, -top)[::sign][: n // 2 - 1]) for sign in (1, -1)]
            least = np.sort(np.concatenate(profiles))[min(int(np.ceil(shortest / step)), n - 3)]
            level = max(z[top] + RISE * height, least) + 1e-4 * height  # 1e-4 includes all points of equal height
            after, before = (int((profile <= level).sum()) for profile in profiles)
            yield self.part((top - before) % n, (top + after - 1) % n), float(depth)

    def corners(self, arm: float) -> list[int]:
        """Return indices of points where the direction of a closed edge changes by at least `CORNER`.
        arm : length (m) before and after a point over which the change is measured."""
        n, reach = len(self.points), max(round(arm / self.length * len(self.points)), 1)
        before, after = self.points - np.roll(self.points, reach, 0), np.roll(self.points, -reach, 0) - self.points
        long = lengths(before) * lengths(after) + 1e-12
        cosine = np.einsum("ki,ki->k", before, after) / long
        plan = np.linalg.norm(before[:, :2], axis=1) * np.linalg.norm(after[:, :2], axis=1)
        in_plan = np.einsum("ki,ki->k", before[:, :2], after[:, :2]) / np.maximum(plan, 1e-12)
        cosine = np.where(plan > 0.25 * long, np.maximum(cosine, in_plan), cosine)
        corners = list[int]()
        for k in np.argsort(cosine, kind="stable").tolist():
            apart = [min((k - j) % n, (j - k) % n) for j in corners]
            if cosine[k] <= np.cos(np.radians(CORNER)) and all(gap > 1.5 * reach for gap in apart):
                corners.append(k)
        return sorted(corners)

    def posts(self, apart: float, width: float) -> list["Edge"]:
        """Return parts of an open edge, `width` metres long, about `apart` metres apart."""
        n, count = len(self.points), max(round(self.length / apart), 2)
        half = max(round(width / self.length * n / 2), 1)
        middles = [round((k + 0.5) * (n - 1) / count) for k in range(count)]
        return [Edge(self.loop, self.points[max(k - half, 0) : k + half + 1], closed=False) for k in middles]


@dataclass(frozen=True, eq=False)
class Shape:
    """A coarse surface in metres with z up, and its features."""

    surface: Surface

    @cached_property
    def edges(self) -> list[Edge]:
        """Closed free edges, the longest first."""
        return [Edge.from_loop(k, self.surface.V[loop]) for k, loop in enumerate(self.surface.loops)]

    @cached_property
    def outer(self) -> list[Edge]:
        """The longest edge (boundary loop) of each piece."""
        piece = self.surface.vertex_pieces
        _, index = np.unique([piece[loop[0]] for loop in self.surface.loops], return_index=True)
        return [self.edges[k] for k in sorted(index)]

    @cached_property
    def large(self) -> list[Edge]:
        """Long boundary loops that are not in `outer`, such as the edge of a courtyard."""
        return [edge for edge in self.edges if edge not in self.outer and edge not in self.small]

    @cached_property
    def small(self) -> list[Edge]:
        """Short boundary loops that are not in `outer`."""
        return [edge for edge in self.edges if edge not in self.outer and edge.length < SMALL * self.edges[0].length]

    @cached_property
    def rise(self) -> float:
        return float(np.ptp(self.surface.V[:, 2]))

    @cached_property
    def width(self) -> float:
        """Mean width in metres: 4 x area / length of the long edges."""
        length = sum(edge.length for edge in (*self.outer, *self.large))
        return float(4 * self.surface.area / length if length else np.sqrt(self.surface.area))

    @cached_property
    def plan_share(self) -> float:
        """Mean of |z component of the normal|: 1 for a level surface, 0 for a vertical surface."""
        return float(self.surface.areas @ np.abs(self.surface.normals[:, 2]) / self.surface.area)

    @cached_property
    def middle(self) -> Floats:
        """Centre of mass (3,), metres."""
        return np.asarray(self.surface.areas @ self.surface.centroids / self.surface.area)

    @property
    def is_raised(self) -> bool:
        """True if the surface is probably above the ground."""
        return self.rise < HEAD or HEAD <= self.surface.V[:, 2].min() <= 1.5 * self.surface.size

    @cached_property
    def corners(self) -> list[int]:
        """Indices of the corners among the points of the longest edge."""
        return self.edges[0].corners(self.width / 8)

    @cached_property
    def sides(self) -> list[Edge]:
        """The four sides of a surface with four corners, the shorter sides first and third; else []."""
        if len(self.corners) != 4:
            return []
        c = self.corners
        sides = [self.edges[0].part(a, b) for a, b in zip(c, c[1:] + c[:1], strict=True)]
        is_ordered = sum(side.length for side in sides[::2]) <= sum(side.length for side in sides[1::2])
        return sides if is_ordered else sides[1:] + sides[:1]

    @cached_property
    def ratio(self) -> float:
        """Length of long sides / length of short sides; 0 without four sides."""
        ends, long = (sum(side.length for side in self.sides[k::2]) for k in (0, 1))
        return long / ends if self.sides else 0.0

    def neck(self, edge: Edge) -> Floats:
        """Return the mean direction (3,) from an edge into the sheet."""
        V, F = self.surface.V, self.surface.F
        is_on = np.isin(F, self.surface.loops[edge.loop])
        faces = is_on.sum(axis=1) == 2
        third = np.argmin(is_on[faces], axis=1)
        a, b, c = (V[F[faces][np.arange(len(third)), (third + k) % 3]] for k in (1, 2, 0))
        length = lengths(b - a)
        along = (b - a) / length[:, None]
        into = c - a - np.einsum("ki,ki->k", c - a, along)[:, None] * along
        return np.asarray(length @ (into / lengths(into)[:, None]) / length.sum()) if len(third) else np.zeros(3)

    def slenderness(self, edge: Edge) -> float:
        """Return the height of an edge above the surrounding sheet, divided by the mean radius of the edge."""
        radius = edge.length / (2 * np.pi)
        middle = edge.points.mean(axis=0)
        away = np.linalg.norm(self.surface.V[:, :2] - middle[:2], axis=1) / radius
        around = self.surface.V[(away > 3) & (away < 6), 2]
        return float(middle[2] - np.median(around)) / radius if len(around) else 0.0

    def lowness(self, edge: Edge) -> float:
        """Return a score: 1 for an edge below the centre of mass, 0 for an edge at the surface's top."""
        rise = (edge.z.mean() - self.middle[2]) / max(self.surface.V[:, 2].max() - self.middle[2], 1e-9)
        return 1.0 if self.rise < 0.05 * self.width else float(np.clip(1 - rise, 0, 1))

    @cached_property
    def hollows(self) -> Ints:
        """Indices (k,) of the lowest vertices of hollows in the surface."""
        V, z = self.surface.V, self.surface.V[:, 2]
        tree = cKDTree(V[:, :2])
        radius, lowest, hollows = self.width / 12, z.copy(), list[int]()
        for pair in (pairs := tree.query_pairs(radius, output_type="ndarray")).T, pairs.T[::-1]:
            np.minimum.at(lowest, pair[0], z[pair[1]])
        for k in np.flatnonzero(z <= lowest).tolist():
            inner, outer = (tree.query_ball_point(V[k, :2], reach) for reach in (radius, self.width / 7))
            ring = np.setdiff1d(outer, inner)
            is_deep = len(ring) and z[ring].min() - z[k] > max(RISE * self.rise, 0.002 * self.width)
            if is_deep and all(np.linalg.norm(V[k, :2] - V[j, :2]) > self.width / 8 for j in hollows):
                hollows.append(k)
        return np.array(hollows, dtype=np.int64)

    @cached_property
    def inner_hollows(self) -> Ints:
        """Indices (k,) of vertices in `hollows` that are not on a free edge."""
        return np.setdiff1d(self.hollows, np.concatenate([*self.surface.loops, np.zeros(0, dtype=np.int64)]))

    def below(self, plan: Floats) -> Floats:
        """Return the position (k, 3) of the vertex nearest in plan to each point of `plan` (j, 2) within the sheet."""
        away, vertex = (np.atleast_1d(values) for values in cKDTree(self.surface.V[:, :2]).query(plan))
        return np.asarray(self.surface.V[vertex[away < 0.05 * self.width]])

    @cached_property
    def is_object(self) -> bool:
        """True for a sculpture: a closed surface, or a nearly closed surface with all edges above the ground."""
        if is_nearly_closed(self.surface):
            return True
        ground = self.surface.V[:, 2].min() + RISE * self.rise
        raised = all(edge.z.min() > ground and edge.z.mean() < self.middle[2] for edge in self.edges)
        return is_figure(self.surface) and raised

    @cached_property
    def heads(self) -> list[Edge]:
        """Column heads: small inner edges from which the sheet goes up."""
        return [edge for edge in self.small if self.neck(edge)[2] > NECK]

    @cached_property
    def lugs(self) -> list[Edge]:
        """Small inner edges, high above the surrounding sheet, from which the sheet may hang."""
        return [edge for edge in self.small if self.neck(edge)[2] < -NECK and self.slenderness(edge) > LUG]

    @cached_property
    def wall(self) -> float:
        """Score by mean slope: 1 for a wall, 0 for a roof, or a value between."""
        return float(np.clip((0.55 - self.plan_share) / 0.2, 0, 1))

    @cached_property
    def is_deck(self) -> bool:
        """True for a long strip with level ends and a walkable slope, such as a footbridge."""
        climb = abs(float(np.subtract(*(end.z.mean() for end in self.sides[::2])))) if self.sides else 0.0
        walkable = np.abs(self.surface.normals[:, 2]) > np.cos(np.radians(40.0 if climb > 0.9 * self.rise else 25.0))
        share = float(self.surface.areas[walkable].sum() / self.surface.area)
        return self.ratio > STRIP and share > 0.8 and min(end.straight_levelness for end in self.sides[::2]) > 0.97

    @property
    def is_floor(self) -> bool:
        """True for a walkable strip (see `is_deck`) and for a flat sheet."""
        return self.is_deck or self.rise < 0.01 * self.width


def is_scalloped(edge: Edge, corners: Sequence[int]) -> bool:
    """Return True if a closed edge curves inwards between all adjacent corners. corners : numbers of points."""
    middle = edge.points[list(corners), :2].mean(axis=0)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        arc = edge.part(a, b).points[:, :2]
        chord = arc[-1] - arc[0]
        normal = np.array([-chord[1], chord[0]]) / (np.linalg.norm(chord) + 1e-12)
        inwards = (arc - arc[0]) @ normal * np.sign(normal @ (middle - arc[0]))
        if inwards.max() < 0.05 * np.linalg.norm(chord):
            return False
    return True
