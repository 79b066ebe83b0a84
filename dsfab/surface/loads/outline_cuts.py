"""Surface with mesh edges along the outline of a region."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lengths
from dsfab.core.errors import SurfaceError
from dsfab.surface.edge_changes import LARGEST, flipped, halved, with_longest
from dsfab.surface.loads.pickers import Extent, pierced
from dsfab.surface.mesh import Surface

EVEN = 0.002
"""How far the edges that follow a curved line may be off it, as a share of the `Extent.width`."""
NEAR = 0.25
"""Vertices move onto the line if that is nearer along an edge than this share of it."""
BISECTIONS = 48
"""Steps by which it is found where an edge meets the line: as far as digits go."""
LOOKED = 7
"""Points between the ends of an edge at which it is looked for the line."""


@dataclass(frozen=True, eq=False)
class Outlined:
    """A surface some of whose vertices lie on outlines.

    on    : (n,) vertices on the line that is being drawn.    fixed : (n,) those on earlier ones, which stay.
    """

    surface: Surface
    on: Bools
    fixed: Bools

    def halved(self, edges: Bools, places: Floats | None = None) -> "Outlined":
        """With marked edges (e,) divided in their middle, or at places (k, 3) that lie on the line."""
        old = self.surface
        V, F, _ = halved(old.V, old.F, old.edges, edges)
        count = len(V) - old.n
        if places is not None:
            V[old.n :] = places
        new = np.full(count, places is not None)
        between = self.fixed[old.edges.ends[edges]].all(axis=1)
        return Outlined(Surface(V, F), np.append(self.on, new), np.append(self.fixed, between))

    def moved(self, vertices: Ints, places: Floats) -> "Outlined":
        """With vertices (k,) on the line, at places (k, 3)."""
        V, on = self.surface.V.copy(), self.on.copy()
        V[vertices], on[vertices] = places, True
        return replace(self, surface=Surface(V, self.surface.F), on=on)

    def depth(self, extent: Extent) -> Floats:
        """(n,) how deep vertices are in an extent: 0 on the line."""
        return np.where(self.on, 0.0, extent.depth(self.surface.V))

    def divided(self, faces: Ints, places: Floats, on: bool) -> "Outlined":
        """With faces (k,) divided in three around places (k, 3) in them."""
        s, count = self.surface, len(faces)
        new = s.n + np.arange(count)
        stay = np.delete(s.F, faces, axis=0)
        fans = [np.column_stack([s.F[faces, i], s.F[faces, (i + 1) % 3], new]) for i in range(3)]
        grown = Surface(np.concatenate([s.V, places]), np.concatenate([stay, *fans]))
        return Outlined(
            grown, np.append(self.on, np.full(count, on)), np.append(self.fixed, np.zeros(count, dtype=bool))
        )


class EdgeCrossings(NamedTuple):
    """Edges (k,) that the line crosses, ascending, how far along (k,), 0 at their first end to 1, and where (k, 3)."""

    edge: Ints
    share: Floats
    place: Floats


def edge_crossings(made: Outlined, extent: Extent) -> EdgeCrossings:
    """Where the line crosses edges between what is within and what is not, by bisection.

    An edge from the line to one side of it may begin on the other side: there it crosses the line once more.
    """
    s, depth = made.surface, made.depth(extent)
    sign = np.sign(depth[s.edges.ends])
    edge = np.flatnonzero(sign.prod(axis=1) < 0)
    start, sides = np.zeros(len(edge)), sign[edge, 0]
    for end in (0, 1):
        maybe = np.flatnonzero((sign[:, end] == 0) & (sign[:, 1 - end] != 0))
        maybe = maybe[np.abs(depth[s.edges.ends[maybe, 1 - end]]) < s.edge_lengths[maybe]]
        begin = _other_side(s, extent, maybe, end, sign[maybe, 1 - end])
        there = begin > 0
        edge, start = np.append(edge, maybe[there]), np.append(start, np.abs(end - begin[there]))
        sides = np.append(sides, -sign[maybe[there], 1 - end])
    order = np.argsort(edge)
    edge, start, sides = edge[order], start[order], sides[order]
    a, b = s.V[s.edges.ends[edge]].transpose(1, 0, 2)
    low, high = start, np.where(sign[edge, 1] == 0, 0.0, 1.0)
    for _ in range(BISECTIONS if len(edge) else 0):
        middle = (low + high) / 2
        same = np.sign(extent.depth(a + middle[:, None] * (b - a))) == sides
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    share = (low + high) / 2
    return EdgeCrossings(edge, share, a + share[:, None] * (b - a))


def _other_side(s: Surface, extent: Extent, edges: Ints, end: int, sign: Floats) -> Floats:
    """(k,) the share of edges (k,), from an end (0 or 1) on the line, up to which they are on the side that `sign` (k,)
    of their other end is not; 0 where they nowhere are."""
    a, b = s.V[s.edges.ends[edges, end]], s.V[s.edges.ends[edges, 1 - end]]
    found = np.zeros(len(edges))
    for t in np.arange(1, LOOKED + 1) / (LOOKED + 1):
        depth = extent.depth(a + t * (b - a))
        found[sign * depth < -EVEN * extent.width] = t
    return found


SMOOTH = 0.2
"""Vertices move only where faces around them lean from the step by less than this sine: creases stay."""
TOUCHING = 0.05
"""Vertices that may not move are on the line if that is nearer along an edge than this share of it."""
HELD = 1e-6
"""A corner of the line has its vertex if one on it is nearer than this share of the surface's size."""
TRIES = 64
"""Places at most where a crease meets a surface."""
SMALLEST = 0.3
"""No face becomes smaller than this share of itself, or turns, because its corners move onto the line."""


def with_corners(made: Outlined, extent: Extent) -> Outlined:
    """With a vertex at each corner of the line: where a crease of the extent meets the surface."""
    close = EVEN * extent.width
    for a, b in extent.creases:
        for _ in range(TRIES):
            faces, t = pierced(made.surface, a, b)
            places = a + t[:, None] * (b - a)
            held = made.surface.V[made.on]
            new = [k for k, p in enumerate(places) if not (lengths(held - p) <= HELD * made.surface.size).any()]
            if not new:
                break
            made = _with_vertex(made, int(faces[new[0]]), places[new[0]], close)
    return made


def _with_vertex(made: Outlined, face: int, place: Floats, close: float) -> Outlined:
    """With a vertex on the line at a place (3,) in a face: a corner that moves, a side that is divided, or a new one
    within."""
    s = made.surface
    share = _shares(s.V[s.F[face]], place)
    corner, side = int(share.argmax()), (int(share.argmin()) + 1) % 3
    vertex, edge = int(s.F[face, corner]), int(s.edges.of[face, side])
    if share[corner] > 1 - NEAR and _free(made, np.array([vertex]), place[None], close)[0]:
        return made.moved(np.array([vertex]), place[None])
    if share.min() < NEAR / 2 and not (s.edges.boundary[edge] and share.min() > 1e-6):
        edges = np.zeros(len(s.edges.ends), dtype=bool)
        edges[edge] = True
        return made.halved(edges, place[None])
    return made.divided(np.array([face]), place[None], True)


def _shares(corners: Floats, place: Floats) -> Floats:
    """(3,) barycentric coordinates of a place (3,) in a triangle (3, 3)."""
    sides = np.roll(corners, -1, axis=0), np.roll(corners, -2, axis=0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    parts = np.cross(sides[0] - place, sides[1] - place) @ normal
    return np.asarray(parts / parts.sum())


def snapped(made: Outlined, extent: Extent) -> tuple[Outlined, int]:
    """With vertices that are close to the line moved onto it, each along one of its edges; and how many moved."""
    s, crossed = made.surface, edge_crossings(made, extent)
    ends, size = s.edges.ends[crossed.edge], s.edge_lengths[crossed.edge]
    vertex = np.concatenate([ends[:, 0], ends[:, 1]])
    share = np.concatenate([crossed.share, 1 - crossed.share])
    way, place = share * np.tile(size, 2), np.tile(crossed.place, (2, 1))
    may = share < NEAR
    may[may] = _free(made, vertex[may], place[may], EVEN * extent.width)
    vertex, way, place = vertex[may], way[may], place[may]
    order = np.lexsort((way, vertex))
    chosen = order[np.unique(vertex[order], return_index=True)[1]]
    vertex, place = vertex[chosen], place[chosen]
    while len(vertex):
        V = s.V.copy()
        V[vertex] = place
        bad = np.zeros(s.n, dtype=bool)
        bad[s.F[_spoilt(s, V)]] = True
        if not bad[vertex].any():
            return made.moved(vertex, place), len(vertex)
        vertex, place = vertex[~bad[vertex]], place[~bad[vertex]]
    return made, 0


def _free(made: Outlined, vertices: Ints, places: Floats, close: float) -> Bools:
    """(k,) whether vertices may go to places (k, 3): none that is fixed, and the surface and its boundary stay where
    they are, within a distance in metres."""
    s, around = made.surface, _FacesAt.of(made.surface)
    found = ~(made.fixed | made.on)[vertices]
    for k in np.flatnonzero(found):
        v, step = int(vertices[k]), places[k] - s.V[vertices[k]]
        faces = around.at(v)
        leaning = np.abs(s.normals[faces] @ step) <= max(close, SMOOTH * float(np.linalg.norm(step)))
        found[k] = leaning.all() and _straight(s, v, faces, step, close)
    return np.asarray(found)


class _FacesAt(NamedTuple):
    """The faces around each vertex of a surface."""

    order: Ints
    start: Ints

    @classmethod
    def of(cls, surface: Surface) -> "_FacesAt":
        corner = surface.F.ravel()
        return cls(np.argsort(corner, kind="stable") // 3, np.searchsorted(np.sort(corner), np.arange(surface.n + 1)))

    def at(self, vertex: int) -> Ints:
        return self.order[self.start[vertex] : self.start[vertex + 1]]


def _straight(s: Surface, vertex: int, faces: Ints, step: Floats, close: float) -> bool:
    """Whether a vertex that goes a step (3,) leaves the boundary where it is."""
    edges = np.unique(s.edges.of[faces])
    edges = edges[s.edges.boundary[edges] & (s.edges.ends[edges] == vertex).any(axis=1)]
    sides = s.V[s.edges.ends[edges]].sum(axis=1) - 2 * s.V[vertex]
    off = lengths(np.cross(sides, step)) / np.maximum(lengths(sides), np.finfo(float).tiny) if len(sides) else sides
    return bool((off <= close).all())


def _spoilt(s: Surface, V: Floats) -> Bools:
    """(m,) faces that turn or shrink too much where vertices go to V (n, 3)."""
    a, b, c = (V[s.F[:, k]] for k in range(3))
    area = np.einsum("mi,mi->m", np.cross(b - a, c - a), s.normals) / 2
    return np.asarray(area < SMALLEST * s.areas)


def touched(made: Outlined, extent: Extent) -> Outlined:
    """With vertices that are very close to the line, and could not move, on it as they are."""
    s, crossed = made.surface, edge_crossings(made, extent)
    ends, share = s.edges.ends[crossed.edge], crossed.share
    near = np.concatenate([ends[share < TOUCHING, 0], ends[share > 1 - TOUCHING, 1]])
    on = made.on.copy()
    on[near] |= np.abs(extent.depth(s.V[near])) <= EVEN * extent.width
    return replace(made, on=on)


ROUNDS = 24
"""How often edges are halved at most."""
MOVES = 3
"""How often vertices are moved: each time faces are looked at anew."""
SAME = 1e-9
"""Vertices that are off the line by less than this share of the surface's size are on it."""


def with_outline(surface: Surface, extent: Extent, fixed: Bools) -> Outlined:
    """The surface with edges along the line in which an extent meets it; the vertices that it had come first.

    fixed : (n,) vertices that stay where they are, on earlier outlines.

    Corners of the line are vertices; its curves are followed within `EVEN`. Raises SurfaceError for a line that is so
    fine that too many faces are needed.
    """
    made = Outlined(surface, np.zeros(surface.n, dtype=bool), fixed)
    made = with_corners(_fine(made, extent, _coarse), extent)
    made = replace(made, on=made.on | (np.abs(extent.depth(made.surface.V)) <= SAME * surface.size))
    for _ in range(MOVES):
        made = _fine(made, extent, _uneven)
        made, count = snapped(made, extent)
        if not count:
            break
    made = touched(made, extent)
    crossed = edge_crossings(made, extent)
    edges = np.zeros(len(made.surface.edges.ends), dtype=bool)
    edges[crossed.edge] = True
    made = made.halved(edges, crossed.place)
    stays = made.surface.edges.ends[_outline(made, extent)]
    made = replace(made, surface=flipped(made.surface, made.on | made.fixed, stays, EVEN * extent.width))
    return _no_flat_faces(made, extent)


def _outline(made: Outlined, extent: Extent) -> Bools:
    """(e,) the edges on the line, and those that may be on earlier ones."""
    return made.fixed[made.surface.edges.ends].all(axis=1) | _between(made.surface, extent)


def _fine(made: Outlined, extent: Extent, marks: Callable[[Outlined, Extent], Bools]) -> Outlined:
    """With edges halved until none is marked."""
    for _ in range(ROUNDS):
        edges = marks(made, extent)
        if not edges.any():
            break
        s = made.surface
        edges = with_longest(s.V, s.edges, edges)
        if s.m + 2 * int(edges.sum()) > LARGEST:
            raise SurfaceError(
                f"an outline takes over {LARGEST:,} triangles: it is {2 * extent.width:.3g} m wide at its narrowest; "
                "draw it simpler or larger"
            )
        made = made.halved(edges)
    return made


def _coarse(made: Outlined, extent: Extent) -> Bools:
    """(e,) edges that are longer than the extent is wide, of faces near the line: it may slip through these."""
    s = made.surface
    depth, size, of = np.abs(made.depth(extent)), s.edge_lengths, s.edges.of
    near = depth[s.F].min(axis=1) <= size[of].max(axis=1)
    marks = np.zeros(len(size), dtype=bool)
    marks[of[near]] = True
    return np.asarray(marks & (size > extent.width))


def _uneven(made: Outlined, extent: Extent) -> Bools:
    """(e,) edges that the line crosses more than once, and sides of faces in which it is no straight line."""
    s, even = made.surface, EVEN * extent.width
    depth, size = made.depth(extent), s.edge_lengths
    ends = s.edges.ends
    marks = np.zeros(len(size), dtype=bool)
    near = np.flatnonzero((np.abs(depth[ends]).sum(axis=1) <= size) & (size > 2 * even))
    t = np.arange(1, LOOKED + 1)[:, None, None] / (LOOKED + 1)
    a, b = s.V[ends[near]].transpose(1, 0, 2)
    inner = extent.depth(((1 - t) * a + t * b).reshape(-1, 3)).reshape(LOOKED, -1)
    most = np.concatenate([depth[ends[near, :1].T], inner, depth[ends[near, 1:].T]])
    most = np.where(np.abs(most) <= even, 0.0, most)
    marks[near] = _turns_back(most)
    faces, off = _chords(made, extent)
    marks[s.edges.of[faces[off > even]]] = True
    marks |= made.on[ends].all(axis=1) & _between(s, extent) & (np.abs(extent.depth(s.V[ends].mean(axis=1))) > even)
    return np.asarray(marks & (size > 2 * even))


def _between(s: Surface, extent: Extent) -> Bools:
    """(e,) edges between a face within an extent and one outside of it."""
    one, two = s.edges.pairs.T // 3
    within, found = extent.depth(s.centroids) > 0, np.zeros(len(s.edges.ends), dtype=bool)
    found[s.edges.count == 2] = within[one] != within[two]
    return found


def _turns_back(depth: Floats) -> Bools:
    """(k,) whether depths (p, k) along edges change their sign more than once, or touch 0 between equal signs."""
    sign = np.sign(depth)
    low, high = np.minimum.accumulate(sign), np.maximum.accumulate(sign)
    fell, rose = (high > 0) & (sign < 0), (low < 0) & (sign > 0)
    back = np.zeros(depth.shape[1], dtype=bool)
    for was, now in ((fell, sign > 0), (rose, sign < 0)):
        after = np.logical_or.accumulate(was)
        back |= (after[:-1] & now[1:]).any(axis=0)
    return back


def _chords(made: Outlined, extent: Extent) -> tuple[Ints, Floats]:
    """(k,) faces that the line crosses, and (k,) how far from it the middle of the straight way through each is."""
    s, crossed = made.surface, edge_crossings(made, extent)
    place = np.full((len(s.edges.ends), 3), np.nan)
    place[crossed.edge] = crossed.place
    points = np.concatenate([place[s.edges.of], np.where(made.on[s.F][:, :, None], s.V[s.F], np.nan)], axis=1)
    here = np.isfinite(points[:, :, 0])
    faces = np.flatnonzero((here.sum(axis=1) == 2) & here[:, :3].any(axis=1))
    middle = points[faces][here[faces]].reshape(-1, 2, 3).mean(axis=1)
    return faces, np.abs(extent.depth(middle))


def _no_flat_faces(made: Outlined, extent: Extent) -> Outlined:
    """With faces whose corners are all on lines divided, along an edge that is on none if there is one: a field that is
    0 on the lines would not tell them apart."""
    s, inner = made.surface, ~_outline(made, extent)
    flat = np.flatnonzero((made.on | made.fixed)[s.F].all(axis=1))
    length = np.where(inner, s.edge_lengths, 0.0)[s.edges.of[flat]]
    longest = np.take_along_axis(s.edges.of[flat], length.argmax(axis=1)[:, None], axis=1)[:, 0]
    edges = np.zeros(len(s.edges.ends), dtype=bool)
    edges[longest[length.max(axis=1) > 0]] = True
    made = made.halved(edges)
    s = made.surface
    flat = np.flatnonzero((made.on | made.fixed)[s.F].all(axis=1))
    return made.divided(flat, s.centroids[flat], False) if len(flat) else made
