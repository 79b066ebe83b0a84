"""Cuts of a surface mesh along the outline of a region."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lengths
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import MOST_TRIANGLES
from dsfab.surface.edge_changes import halved_edges, with_flipped_edges, with_longest_edges
from dsfab.surface.loads.pickers import Extent, pierced_faces
from dsfab.surface.mesh import Surface

LINE_TOLERANCE = 0.002  # Largest distance of edges from a curved line, divided by `Extent.width`.
SNAP_SHARE = 0.25  # Largest move of a vertex along an edge onto an outline, as a fraction of the edge.
TEST_POINTS = 7  # Number of points inside an edge that are tested against the outline.


@dataclass(frozen=True, eq=False)
class OutlinedSurface:
    """A surface that is being cut along an outline.
    on : (n,) mask of vertices on the outline.    fixed : (n,) mask of vertices on earlier outlines."""

    surface: Surface
    on: Bools
    fixed: Bools

    def with_halved_edges(self, edges: Bools, places: Floats | None = None) -> "OutlinedSurface":
        """Return the surface with marked edges (e,) divided in the middle, or at points (k, 3) of the outline."""
        surface = self.surface
        V, F, _ = halved_edges(surface.V, surface.F, surface.edges, edges)
        count = len(V) - surface.n
        if places is not None:
            V[surface.n :] = places
        is_on_line = np.full(count, places is not None)
        between = self.fixed[surface.edges.ends[edges]].all(axis=1)
        return OutlinedSurface(Surface(V, F), np.append(self.on, is_on_line), np.append(self.fixed, between))

    def with_moved_vertices(self, vertices: Ints, places: Floats) -> "OutlinedSurface":
        """Return the surface with vertices (k,) moved to points `places` (k, 3) on the outline."""
        V, on_line = self.surface.V.copy(), self.on.copy()
        V[vertices], on_line[vertices] = places, True
        return replace(self, surface=Surface(V, self.surface.F), on=on_line)

    def depth(self, extent: Extent) -> Floats:
        """Return the distance (n,) of the vertices from the border of `extent`, metres; negative outside."""
        return np.where(self.on, 0.0, extent.depth(self.surface.V))

    def with_divided_faces(self, faces: Ints, places: Floats, on_line: bool) -> "OutlinedSurface":
        """Return the surface with faces (k,) divided into three at inner points `places` (k, 3).
        on_line : True if the points lie on the outline."""
        s, count = self.surface, len(faces)
        centre_vertices = s.n + np.arange(count)
        stay = np.delete(s.F, faces, axis=0)
        fans = [np.column_stack([s.F[faces, i], s.F[faces, (i + 1) % 3], centre_vertices]) for i in range(3)]
        grown = Surface(np.concatenate([s.V, places]), np.concatenate([stay, *fans]))
        fixed = np.append(self.fixed, np.zeros(count, dtype=bool))
        return OutlinedSurface(grown, np.append(self.on, np.full(count, on_line)), fixed)


class EdgeCrossings(NamedTuple):
    """Points (k, 3) where an outline crosses edges: edge numbers (k,), ascending; fractions (k,) along the edges."""

    edge: Ints
    share: Floats
    place: Floats


def edge_crossings(outlined: OutlinedSurface, extent: Extent) -> EdgeCrossings:
    """Return the points where the border of a part of space crosses edges."""
    s, depth = outlined.surface, outlined.depth(extent)
    sign = np.sign(depth[s.edges.ends])
    edge = np.flatnonzero(sign.prod(axis=1) < 0)
    start, sides = np.zeros(len(edge)), sign[edge, 0]
    for end in (0, 1):
        maybe = np.flatnonzero((sign[:, end] == 0) & (sign[:, 1 - end] != 0))
        maybe = maybe[np.abs(depth[s.edges.ends[maybe, 1 - end]]) < s.edge_lengths[maybe]]
        begin = _other_side(s, extent, maybe, end, sign[maybe, 1 - end])
        crosses = begin > 0
        edge, start = np.append(edge, maybe[crosses]), np.append(start, np.abs(end - begin[crosses]))
        sides = np.append(sides, -sign[maybe[crosses], 1 - end])
    order = np.argsort(edge)
    edge, start, sides = edge[order], start[order], sides[order]
    a, b = s.V[s.edges.ends[edge]].transpose(1, 0, 2)
    low, high = start, np.where(sign[edge, 1] == 0, 0.0, 1.0)
    for _ in range(48 if len(edge) else 0):  # 48 halvings reach full precision
        middle = (low + high) / 2
        is_same_side = np.sign(extent.depth(a + middle[:, None] * (b - a))) == sides
        low, high = np.where(is_same_side, middle, low), np.where(is_same_side, high, middle)
    share = (low + high) / 2
    return EdgeCrossings(edge, share, a + share[:, None] * (b - a))


def _other_side(s: Surface, extent: Extent, edges: Ints, end: int, sign: Floats) -> Floats:
    a, b = s.V[s.edges.ends[edges, end]], s.V[s.edges.ends[edges, 1 - end]]
    shares = np.zeros(len(edges))
    for t in np.arange(1, TEST_POINTS + 1) / (TEST_POINTS + 1):
        depth = extent.depth(a + t * (b - a))
        shares[sign * depth < -LINE_TOLERANCE * extent.width] = t
    return shares


def with_corners(outlined: OutlinedSurface, extent: Extent) -> OutlinedSurface:
    """Return the surface with a vertex at each corner of the outline."""
    tolerance = LINE_TOLERANCE * extent.width
    for a, b in extent.creases:
        for _ in range(64):
            faces, t = pierced_faces(outlined.surface, a, b)
            places = a + t[:, None] * (b - a)
            vertices = outlined.surface.V[outlined.on]
            missing = [
                k for k, p in enumerate(places) if not (lengths(vertices - p) <= 1e-6 * outlined.surface.size).any()
            ]
            if not missing:
                break
            outlined = _with_vertex(outlined, int(faces[missing[0]]), places[missing[0]], tolerance)
    return outlined


def _with_vertex(outlined: OutlinedSurface, face: int, place: Floats, tolerance: float) -> OutlinedSurface:
    s = outlined.surface
    share = _shares(s.V[s.F[face]], place)
    corner, side = int(share.argmax()), (int(share.argmin()) + 1) % 3
    vertex, edge = int(s.F[face, corner]), int(s.edges.of[face, side])
    if share[corner] > 1 - SNAP_SHARE and _may_move(outlined, np.array([vertex]), place[None], tolerance)[0]:
        return outlined.with_moved_vertices(np.array([vertex]), place[None])
    if share.min() < SNAP_SHARE / 2 and not (s.edges.boundary[edge] and share.min() > 1e-6):
        edges = np.zeros(len(s.edges.ends), dtype=bool)
        edges[edge] = True
        return outlined.with_halved_edges(edges, place[None])
    return outlined.with_divided_faces(np.array([face]), place[None], True)


def _shares(corners: Floats, place: Floats) -> Floats:
    sides = np.roll(corners, -1, axis=0), np.roll(corners, -2, axis=0)
    parts = np.cross(sides[0] - place, sides[1] - place) @ np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(parts / parts.sum())


def with_snapped_vertices(outlined: OutlinedSurface, extent: Extent) -> tuple[OutlinedSurface, int]:
    """Return the surface with close vertices moved onto the outline, and the number of moved vertices."""
    s, crossed = outlined.surface, edge_crossings(outlined, extent)
    ends, size = s.edges.ends[crossed.edge], s.edge_lengths[crossed.edge]
    vertex = np.concatenate([ends[:, 0], ends[:, 1]])
    share = np.concatenate([crossed.share, 1 - crossed.share])
    distance, place = share * np.tile(size, 2), np.tile(crossed.place, (2, 1))
    may = share < SNAP_SHARE
    may[may] = _may_move(outlined, vertex[may], place[may], LINE_TOLERANCE * extent.width)
    vertex, distance, place = vertex[may], distance[may], place[may]
    order = np.lexsort((distance, vertex))
    chosen = order[np.unique(vertex[order], return_index=True)[1]]
    vertex, place = vertex[chosen], place[chosen]
    while len(vertex):
        V = s.V.copy()
        V[vertex] = place
        bad = np.zeros(s.n, dtype=bool)
        bad[s.F[_spoilt(s, V)]] = True
        if not bad[vertex].any():
            return outlined.with_moved_vertices(vertex, place), len(vertex)
        vertex, place = vertex[~bad[vertex]], place[~bad[vertex]]
    return outlined, 0


def _may_move(outlined: OutlinedSurface, vertices: Ints, places: Floats, tolerance: float) -> Bools:
    """Return a mask (k,) of the vertices that may move to points `places` (k, 3) without a change of the shape.
    tolerance : largest change of the surface's shape, metres."""
    s, around = outlined.surface, _FacesAt.from_surface(outlined.surface)
    allowed = ~(outlined.fixed | outlined.on)[vertices]
    for k in np.flatnonzero(allowed):
        v, step = int(vertices[k]), places[k] - s.V[vertices[k]]
        faces = around.faces(v)
        leaning = np.abs(s.normals[faces] @ step) <= max(tolerance, 0.2 * float(np.linalg.norm(step)))
        allowed[k] = leaning.all() and _keeps_boundary(s, v, faces, step, tolerance)
    return np.asarray(allowed)


class _FacesAt(NamedTuple):
    order: Ints
    start: Ints

    @classmethod
    def from_surface(cls, surface: Surface) -> "_FacesAt":
        corner = surface.F.ravel()
        return cls(np.argsort(corner, kind="stable") // 3, np.searchsorted(np.sort(corner), np.arange(surface.n + 1)))

    def faces(self, vertex: int) -> Ints:
        return self.order[self.start[vertex] : self.start[vertex + 1]]


def _keeps_boundary(s: Surface, vertex: int, faces: Ints, step: Floats, tolerance: float) -> bool:
    edges = np.unique(s.edges.of[faces])
    edges = edges[s.edges.boundary[edges] & (s.edges.ends[edges] == vertex).any(axis=1)]
    sides = s.V[s.edges.ends[edges]].sum(axis=1) - 2 * s.V[vertex]
    away = lengths(np.cross(sides, step)) / np.maximum(lengths(sides), np.finfo(float).tiny) if len(sides) else sides
    return bool((away <= tolerance).all())


def _spoilt(s: Surface, V: Floats) -> Bools:
    a, b, c = (V[s.F[:, k]] for k in range(3))
    return np.asarray((np.einsum("mi,mi->m", np.cross(b - a, c - a), s.normals) / 2) < 0.3 * s.areas)


def with_touched_vertices(outlined: OutlinedSurface, extent: Extent) -> OutlinedSurface:
    """Return the surface with a mask `on` that also marks vertices very close to the outline."""
    s, crossed = outlined.surface, edge_crossings(outlined, extent)
    ends, share = s.edges.ends[crossed.edge], crossed.share
    close_vertices = np.concatenate([ends[share < 0.05, 0], ends[share > 1 - 0.05, 1]])
    on_line = outlined.on.copy()
    on_line[close_vertices] |= np.abs(extent.depth(s.V[close_vertices])) <= LINE_TOLERANCE * extent.width
    return replace(outlined, on=on_line)


def with_outline(surface: Surface, extent: Extent, fixed: Bools) -> OutlinedSurface:
    """Return the surface with edges along the border of a part of space.
    fixed : (n,) mask of vertices that stay in place. The vertices of `surface` come first in the result.
    Raises SurfaceError if too many faces are needed."""
    outlined = OutlinedSurface(surface, np.zeros(surface.n, dtype=bool), fixed)
    outlined = with_corners(_refine(outlined, extent, _coarse_edges), extent)
    outlined = replace(outlined, on=outlined.on | (np.abs(extent.depth(outlined.surface.V)) <= 1e-9 * surface.size))
    for _ in range(3):
        outlined = _refine(outlined, extent, _uneven_edges)
        outlined, count = with_snapped_vertices(outlined, extent)
        if not count:
            break
    outlined = with_touched_vertices(outlined, extent)
    crossed = edge_crossings(outlined, extent)
    edges = np.zeros(len(outlined.surface.edges.ends), dtype=bool)
    edges[crossed.edge] = True
    outlined = outlined.with_halved_edges(edges, crossed.place)
    stays = outlined.surface.edges.ends[_outline_edges(outlined, extent)]
    may_change, tolerance = outlined.on | outlined.fixed, LINE_TOLERANCE * extent.width
    flipped = with_flipped_edges(outlined.surface, may_change, stays, tolerance)
    return _divide_flat_faces(replace(outlined, surface=flipped), extent)


def _outline_edges(outlined: OutlinedSurface, extent: Extent) -> Bools:
    return outlined.fixed[outlined.surface.edges.ends].all(axis=1) | _border_edges(outlined.surface, extent)


def _refine(
    outlined: OutlinedSurface, extent: Extent, marks: Callable[[OutlinedSurface, Extent], Bools]
) -> OutlinedSurface:
    for _ in range(24):
        edges = marks(outlined, extent)
        if not edges.any():
            break
        s = outlined.surface
        edges = with_longest_edges(s.V, s.edges, edges)
        if s.m + 2 * int(edges.sum()) > MOST_TRIANGLES:
            raise SurfaceError(
                f"an outline needs over {MOST_TRIANGLES:,} triangles: it is {2 * extent.width:.3g} m wide at its "
                "narrowest place; draw a simpler or larger outline"
            )
        outlined = outlined.with_halved_edges(edges)
    return outlined


def _coarse_edges(outlined: OutlinedSurface, extent: Extent) -> Bools:
    s = outlined.surface
    depth, size, face_edges = np.abs(outlined.depth(extent)), s.edge_lengths, s.edges.of
    is_near = depth[s.F].min(axis=1) <= size[face_edges].max(axis=1)
    marks = np.zeros(len(size), dtype=bool)
    marks[face_edges[is_near]] = True
    return np.asarray(marks & (size > extent.width))


def _uneven_edges(outlined: OutlinedSurface, extent: Extent) -> Bools:
    """Return a mask (e,) of the edges near the outline that are too long to follow its shape."""
    s, even = outlined.surface, LINE_TOLERANCE * extent.width
    depth, size = outlined.depth(extent), s.edge_lengths
    ends = s.edges.ends
    marks = np.zeros(len(size), dtype=bool)
    near_edges = np.flatnonzero((np.abs(depth[ends]).sum(axis=1) <= size) & (size > 2 * even))
    t = np.arange(1, TEST_POINTS + 1)[:, None, None] / (TEST_POINTS + 1)
    a, b = s.V[ends[near_edges]].transpose(1, 0, 2)
    inner = extent.depth(((1 - t) * a + t * b).reshape(-1, 3)).reshape(TEST_POINTS, -1)
    depths = np.concatenate([depth[ends[near_edges, :1].T], inner, depth[ends[near_edges, 1:].T]])
    depths = np.where(np.abs(depths) <= even, 0.0, depths)
    marks[near_edges] = _turns_back(depths)
    faces, distance = _chords(outlined, extent)
    marks[s.edges.of[faces[distance > even]]] = True
    is_bent = np.abs(extent.depth(s.V[ends].mean(axis=1))) > even
    marks |= outlined.on[ends].all(axis=1) & _border_edges(s, extent) & is_bent
    return np.asarray(marks & (size > 2 * even))


def _border_edges(s: Surface, extent: Extent) -> Bools:
    first_face, second_face = s.edges.pairs.T // 3
    within, is_border = extent.depth(s.centroids) > 0, np.zeros(len(s.edges.ends), dtype=bool)
    is_border[s.edges.count == 2] = within[first_face] != within[second_face]
    return is_border


def _turns_back(depth: Floats) -> Bools:
    """Return a mask (k,) of edges that cross an outline more than once.
    depth : (p, k) distances from the outline at p points along each edge, negative outside."""
    sign = np.sign(depth)
    low, high = np.minimum.accumulate(sign), np.maximum.accumulate(sign)
    fell, rose = (high > 0) & (sign < 0), (low < 0) & (sign > 0)
    back = np.zeros(depth.shape[1], dtype=bool)
    for was, now in ((fell, sign > 0), (rose, sign < 0)):
        back |= (np.logical_or.accumulate(was)[:-1] & now[1:]).any(axis=0)
    return back


def _chords(outlined: OutlinedSurface, extent: Extent) -> tuple[Ints, Floats]:
    s, crossed = outlined.surface, edge_crossings(outlined, extent)
    place = np.full((len(s.edges.ends), 3), np.nan)
    place[crossed.edge] = crossed.place
    points = np.concatenate([place[s.edges.of], np.where(outlined.on[s.F][:, :, None], s.V[s.F], np.nan)], axis=1)
    is_crossed = np.isfinite(points[:, :, 0])
    faces = np.flatnonzero((is_crossed.sum(axis=1) == 2) & is_crossed[:, :3].any(axis=1))
    return faces, np.abs(extent.depth(points[faces][is_crossed[faces]].reshape(-1, 2, 3).mean(axis=1)))


def _divide_flat_faces(outlined: OutlinedSurface, extent: Extent) -> OutlinedSurface:
    s, inner = outlined.surface, ~_outline_edges(outlined, extent)
    flat = np.flatnonzero((outlined.on | outlined.fixed)[s.F].all(axis=1))
    length = np.where(inner, s.edge_lengths, 0.0)[s.edges.of[flat]]
    longest = np.take_along_axis(s.edges.of[flat], length.argmax(axis=1)[:, None], axis=1)[:, 0]
    edges = np.zeros(len(s.edges.ends), dtype=bool)
    edges[longest[length.max(axis=1) > 0]] = True
    outlined = outlined.with_halved_edges(edges)
    s = outlined.surface
    flat = np.flatnonzero((outlined.on | outlined.fixed)[s.F].all(axis=1))
    return outlined.with_divided_faces(flat, s.centroids[flat], False) if len(flat) else outlined
