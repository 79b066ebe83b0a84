"""`with_outline`: a surface whose edges follow the line in which an extent meets it, with triangles that can be solved.

Cutting faces where the line happens to cross them leaves slivers. So the mesh is first made as fine as the line asks,
where the line runs; then corners of the line become vertices; vertices close to it move onto it, along the surface;
and only then faces are cut, through the middle parts of their edges.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import SurfaceError
from dsfab.surface.extent import Extent
from dsfab.surface.flips import flipped
from dsfab.surface.mesh import Surface
from dsfab.surface.outline_vertices import snapped, touched, with_corners
from dsfab.surface.outlined import EVEN, LOOKED, Outlined, edge_crossings
from dsfab.surface.refine import LARGEST, with_longest

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
