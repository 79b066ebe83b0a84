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
"""Largest distance of edges from the curved line that they follow, as a share of `Extent.width`."""
NEAR = 0.25
"""Share of an edge within which its end moves along it onto the line."""

LOOKED = 7
"""Number of points between the ends of an edge that are tested against the line."""


@dataclass(frozen=True, eq=False)
class Outlined:
    """A surface with vertices on outlines.

    on    : (n,) vertices on the current line.    fixed : (n,) vertices on earlier lines, which stay.
    """

    surface: Surface
    on: Bools
    fixed: Bools

    def halved(self, edges: Bools, places: Floats | None = None) -> "Outlined":
        """Divide marked edges (e,) in their middle, or at places (k, 3) on the line."""
        old = self.surface
        V, F, _ = halved(old.V, old.F, old.edges, edges)
        count = len(V) - old.n
        if places is not None:
            V[old.n :] = places
        new = np.full(count, places is not None)
        between = self.fixed[old.edges.ends[edges]].all(axis=1)
        return Outlined(Surface(V, F), np.append(self.on, new), np.append(self.fixed, between))

    def moved(self, vertices: Ints, places: Floats) -> "Outlined":
        """Move vertices (k,) onto the line, to places (k, 3)."""
        V, on = self.surface.V.copy(), self.on.copy()
        V[vertices], on[vertices] = places, True
        return replace(self, surface=Surface(V, self.surface.F), on=on)

    def depth(self, extent: Extent) -> Floats:
        """Return the depth (n,) of the vertices in an extent, 0 on the line."""
        return np.where(self.on, 0.0, extent.depth(self.surface.V))

    def divided(self, faces: Ints, places: Floats, on: bool) -> "Outlined":
        """Divide faces (k,) in three around places (k, 3) in them."""
        s, count = self.surface, len(faces)
        new = s.n + np.arange(count)
        stay = np.delete(s.F, faces, axis=0)
        fans = [np.column_stack([s.F[faces, i], s.F[faces, (i + 1) % 3], new]) for i in range(3)]
        grown = Surface(np.concatenate([s.V, places]), np.concatenate([stay, *fans]))
        return Outlined(
            grown, np.append(self.on, np.full(count, on)), np.append(self.fixed, np.zeros(count, dtype=bool))
        )


class EdgeCrossings(NamedTuple):
    """Edges (k,) that the line crosses, ascending, their shares (k,), 0 at the first end to 1, and the places (k,
    3)."""

    edge: Ints
    share: Floats
    place: Floats


def edge_crossings(made: Outlined, extent: Extent) -> EdgeCrossings:
    """Return the crossings of the line with edges between its inside and its outside, by bisection. An edge from the
    line to its one side may begin on the other side; then it crosses the line again."""
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
    for _ in range(48 if len(edge) else 0):  # to the last digit
        middle = (low + high) / 2
        same = np.sign(extent.depth(a + middle[:, None] * (b - a))) == sides
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    share = (low + high) / 2
    return EdgeCrossings(edge, share, a + share[:, None] * (b - a))


def _other_side(s: Surface, extent: Extent, edges: Ints, end: int, sign: Floats) -> Floats:
    """Return the share of edges (k,), from an end (0 or 1) on the line, up to which they are on the wrong side, or 0.

    sign : (k,) of the side of their other end.
    """
    a, b = s.V[s.edges.ends[edges, end]], s.V[s.edges.ends[edges, 1 - end]]
    found = np.zeros(len(edges))
    for t in np.arange(1, LOOKED + 1) / (LOOKED + 1):
        depth = extent.depth(a + t * (b - a))
        found[sign * depth < -EVEN * extent.width] = t
    return found


def with_corners(made: Outlined, extent: Extent) -> Outlined:
    """Create a vertex at each corner of the line, where a crease of the extent meets the surface."""
    close = EVEN * extent.width
    for a, b in extent.creases:
        for _ in range(64):
            faces, t = pierced(made.surface, a, b)
            places = a + t[:, None] * (b - a)
            held = made.surface.V[made.on]
            new = [k for k, p in enumerate(places) if not (lengths(held - p) <= 1e-6 * made.surface.size).any()]
            if not new:
                break
            made = _with_vertex(made, int(faces[new[0]]), places[new[0]], close)
    return made


def _with_vertex(made: Outlined, face: int, place: Floats, close: float) -> Outlined:
    """Create a vertex on the line at a place (3,) in a face: a moved corner, a divided side, or a new vertex inside."""
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
    sides = np.roll(corners, -1, axis=0), np.roll(corners, -2, axis=0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    parts = np.cross(sides[0] - place, sides[1] - place) @ normal
    return np.asarray(parts / parts.sum())


def snapped(made: Outlined, extent: Extent) -> tuple[Outlined, int]:
    """Move vertices close to the line onto it, each along one of its edges; return also their number."""
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
    """Return which vertices (k,) may move to places (k, 3): not fixed, and without moving the surface or its boundary.

    tolerance : metres. Vertices at creases stay, where a face leans from the step by more than a sine of 0.2.
    """
    s, around = made.surface, _FacesAt.of(made.surface)
    found = ~(made.fixed | made.on)[vertices]
    for k in np.flatnonzero(found):
        v, step = int(vertices[k]), places[k] - s.V[vertices[k]]
        faces = around.at(v)
        leaning = np.abs(s.normals[faces] @ step) <= max(close, 0.2 * float(np.linalg.norm(step)))
        found[k] = leaning.all() and _straight(s, v, faces, step, close)
    return np.asarray(found)


class _FacesAt(NamedTuple):
    order: Ints
    start: Ints

    @classmethod
    def of(cls, surface: Surface) -> "_FacesAt":
        corner = surface.F.ravel()
        return cls(np.argsort(corner, kind="stable") // 3, np.searchsorted(np.sort(corner), np.arange(surface.n + 1)))

    def at(self, vertex: int) -> Ints:
        return self.order[self.start[vertex] : self.start[vertex + 1]]


def _straight(s: Surface, vertex: int, faces: Ints, step: Floats, close: float) -> bool:
    edges = np.unique(s.edges.of[faces])
    edges = edges[s.edges.boundary[edges] & (s.edges.ends[edges] == vertex).any(axis=1)]
    sides = s.V[s.edges.ends[edges]].sum(axis=1) - 2 * s.V[vertex]
    off = lengths(np.cross(sides, step)) / np.maximum(lengths(sides), np.finfo(float).tiny) if len(sides) else sides
    return bool((off <= close).all())


def _spoilt(s: Surface, V: Floats) -> Bools:
    """Return the faces (m,) that turn or shrink too much if the vertices move to V (n, 3)."""
    a, b, c = (V[s.F[:, k]] for k in range(3))
    area = np.einsum("mi,mi->m", np.cross(b - a, c - a), s.normals) / 2
    return np.asarray(area < 0.3 * s.areas)


def touched(made: Outlined, extent: Extent) -> Outlined:
    """Mark vertices very close to the line, which could not move, as vertices on it."""
    s, crossed = made.surface, edge_crossings(made, extent)
    ends, share = s.edges.ends[crossed.edge], crossed.share
    near = np.concatenate([ends[share < 0.05, 0], ends[share > 1 - 0.05, 1]])
    on = made.on.copy()
    on[near] |= np.abs(extent.depth(s.V[near])) <= EVEN * extent.width
    return replace(made, on=on)


def with_outline(surface: Surface, extent: Extent, fixed: Bools) -> Outlined:
    """Return the surface with edges along the line in which an extent meets it; its old vertices come first.

    fixed : (n,) vertices on earlier outlines, which stay in place.

    Corners of the line are vertices; edges follow its curves within `EVEN`. Raises SurfaceError for a line that is so
    fine
    that it needs too many faces.
    """
    made = Outlined(surface, np.zeros(surface.n, dtype=bool), fixed)
    made = with_corners(_fine(made, extent, _coarse), extent)
    made = replace(made, on=made.on | (np.abs(extent.depth(made.surface.V)) <= 1e-9 * surface.size))
    for _ in range(3):
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
    return made.fixed[made.surface.edges.ends].all(axis=1) | _between(made.surface, extent)


def _fine(made: Outlined, extent: Extent, marks: Callable[[Outlined, Extent], Bools]) -> Outlined:
    for _ in range(24):
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
    """Return the edges (e,) near the line that are longer than the extent is wide, because it could slip through
    them."""
    s = made.surface
    depth, size, of = np.abs(made.depth(extent)), s.edge_lengths, s.edges.of
    near = depth[s.F].min(axis=1) <= size[of].max(axis=1)
    marks = np.zeros(len(size), dtype=bool)
    marks[of[near]] = True
    return np.asarray(marks & (size > extent.width))


def _uneven(made: Outlined, extent: Extent) -> Bools:
    """Return the edges (e,) that the line crosses more than once, and sides of faces in which it is not straight."""
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
    one, two = s.edges.pairs.T // 3
    within, found = extent.depth(s.centroids) > 0, np.zeros(len(s.edges.ends), dtype=bool)
    found[s.edges.count == 2] = within[one] != within[two]
    return found


def _turns_back(depth: Floats) -> Bools:
    """Return whether (k,) depths (p, k) along edges change their sign more than once, or touch 0 between equal
    signs."""
    sign = np.sign(depth)
    low, high = np.minimum.accumulate(sign), np.maximum.accumulate(sign)
    fell, rose = (high > 0) & (sign < 0), (low < 0) & (sign > 0)
    back = np.zeros(depth.shape[1], dtype=bool)
    for was, now in ((fell, sign > 0), (rose, sign < 0)):
        after = np.logical_or.accumulate(was)
        back |= (after[:-1] & now[1:]).any(axis=0)
    return back


def _chords(made: Outlined, extent: Extent) -> tuple[Ints, Floats]:
    """Return the faces (k,) that the line crosses, and the distance (k,) of the middle of their chords from it."""
    s, crossed = made.surface, edge_crossings(made, extent)
    place = np.full((len(s.edges.ends), 3), np.nan)
    place[crossed.edge] = crossed.place
    points = np.concatenate([place[s.edges.of], np.where(made.on[s.F][:, :, None], s.V[s.F], np.nan)], axis=1)
    here = np.isfinite(points[:, :, 0])
    faces = np.flatnonzero((here.sum(axis=1) == 2) & here[:, :3].any(axis=1))
    middle = points[faces][here[faces]].reshape(-1, 2, 3).mean(axis=1)
    return faces, np.abs(extent.depth(middle))


def _no_flat_faces(made: Outlined, extent: Extent) -> Outlined:
    """Divide faces whose corners are all on lines, along an inner edge if there is one. A field that is 0 on the lines
    could not distinguish their sides otherwise."""
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
