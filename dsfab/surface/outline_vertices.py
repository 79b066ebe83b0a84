"""Vertices on a line that is drawn on a surface: new ones at its corners, and those that move onto it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lengths
from dsfab.surface.extent import Extent, pierced
from dsfab.surface.mesh import Surface
from dsfab.surface.outlined import EVEN, NEAR, Outlined, edge_crossings

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
