"""Finer triangles: edges halved until none is longer than asked, or Loop's smooth subdivision."""

import igl
import numpy as np

from dsfab.arrays import Bools, Floats, Ints, edge_lengths
from dsfab.errors import SurfaceError
from dsfab.surface.creases import feature_edges
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import EdgeTable, edge_table, manifold_faults

LARGEST = 4_000_000
"""More triangles than this are refused before they are made."""


def refined(surface: Surface, target: float, smooth: bool = False) -> Surface:
    """The surface with no edge longer than `target` metres; the vertices it had come first.

    smooth = False : the same flat facets. Long edges are halved in rounds; the longest edge of a face that has a long
                     one is among them, which keeps angles from shrinking on and on [Rivara 1984]. No T-junctions; area
                     and boundary stay.
    smooth = True  : Loop's subdivision [Loop 1987], every triangle in four until all edges are short enough; vertices
                     move towards the smooth limit surface, but none on a boundary or a crease (30 degrees): these are
                     halved where they are.

    Raises SurfaceError for a target that is no length or that would take over `LARGEST` triangles, and for `smooth` on
    a surface that is not manifold and consistently oriented.
    """
    if not (np.isfinite(target) and target > 0):
        raise SurfaceError(f"the edge length {target} to refine to must be a positive length in metres")
    if smooth and (faults := manifold_faults(surface.F, surface.edges, surface.n)):
        raise SurfaceError(f"only a manifold surface can be subdivided smoothly: {faults[0]}; set smooth to false")
    V, F = surface.V, surface.F
    edges = surface.edges
    kept = edges.ends[feature_edges(surface)] if smooth else edges.ends[:0]
    while (long := edge_lengths(V, edges.ends) > target).any():
        if smooth:
            _check_count(4 * len(F), target)
            V, F, kept = _loop(V, F, edges, kept)
        else:
            _check_count(len(F) + int(long[edges.of].sum()), target)
            V, F, _ = halved(V, F, edges, long)
        edges = edge_table(F)
    return surface if F is surface.F else Surface(V, F)


def _loop(V: Floats, F: Ints, edges: EdgeTable, kept: Ints) -> tuple[Floats, Ints, Ints]:
    """One step of Loop's subdivision in which edges (k, 2) stay where they are; their halves (2 k, 2)."""
    at = np.searchsorted(edges.ends @ (len(V), 1), kept @ (len(V), 1))
    moved, finer = igl.loop(V, F, 1)
    middle = np.empty(len(edges.ends), dtype=np.int64)
    quarters = finer.reshape(-1, 4, 3)  # those at corners 0 and 1 come first, each from its corner round
    middle[edges.of] = np.stack([quarters[:, 0, 1], quarters[:, 1, 1], quarters[:, 0, 2]], axis=1)
    moved[kept] = V[kept]
    moved[middle[at]] = V[kept].mean(axis=1)
    halves = np.stack([kept, np.stack([middle[at], middle[at]], axis=1)], axis=2).reshape(-1, 2)
    return moved, finer, np.sort(halves, axis=1)


def _check_count(count: int, target: float) -> None:
    if count > LARGEST:
        raise SurfaceError(f"refining to edges of {target:g} m takes over {LARGEST:,} triangles; ask for longer edges")


def halved(V: Floats, F: Ints, edges: EdgeTable, halves: Bools) -> tuple[Floats, Ints, Ints]:
    """Faces divided along the midpoints of the (e,) edges that are halved: their longest and none, one or both others.

    Returns the vertices, the faces, and what face each of these was.

                 c                             c                          c
               / | \\                         / | \\                       / \\
              /  |  \\                      r   |  \\                     r - q
             /   |   \\                    /  \\ |   \\                   / \\ / \\
            a -- p -- b                  a -- p --- b                 a - p - b      turned so that a-b is the longest
    """
    number = np.cumsum(halves) + len(V) - 1
    V = np.concatenate([V, V[edges.ends[halves]].mean(axis=1)])
    on = halves[edges.of]
    ends = V[edges.ends]  # points, or the places on a chart that stand for them
    lengths = np.where(on, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[edges.of], -1)
    turn = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(F, turn, axis=1).T
    p, q, r = np.take_along_axis(number[edges.of], turn, axis=1).T
    ab, bc, ca = np.take_along_axis(on, turn, axis=1).T
    parts = [
        (~ab, (a, b, c)),
        *((ab & ~bc & ~ca, triangle) for triangle in ((a, p, c), (p, b, c))),
        *((ab & bc & ~ca, triangle) for triangle in ((p, b, q), (p, q, c), (a, p, c))),
        *((ab & ~bc & ca, triangle) for triangle in ((a, p, r), (p, c, r), (p, b, c))),
        *((ab & bc & ca, triangle) for triangle in ((a, p, r), (p, b, q), (p, q, r), (r, q, c))),
    ]
    faces = np.concatenate([np.stack(triangle, axis=1)[where] for where, triangle in parts])
    return V, faces, np.concatenate([np.flatnonzero(where) for where, _ in parts])


def with_longest(V: Floats, edges: EdgeTable, halves: Bools) -> Bools:
    """(e,) marked edges, and the longest of each face that has one, and so on [Rivara 1984]."""
    length = edge_lengths(V, edges.ends)[edges.of]
    longest = np.take_along_axis(edges.of, length.argmax(axis=1)[:, None], axis=1)[:, 0]
    while True:
        more = halves.copy()
        more[longest[halves[edges.of].any(axis=1)]] = True
        if np.array_equal(more, halves):
            return halves
        halves = more
