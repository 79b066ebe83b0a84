"""From triangles to planar faces: coplanar neighbours joined, their outline as loops of long edges.

+-----+-----+            +-----------+      A flat region is one face with an outer loop and one inner loop per
|  \\  | \\  |            |           |      hole; straight runs of its outline are one edge. Vertices and edges
+-----+-----+    -->     |           |      stay shared with the neighbours, so closed stays closed.
|  /  | /   |            |           |
+-----+-----+            +-----------+
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.coplanar import FLATNESS, coplanar_regions
from dsfab.surface.topology import EdgeTable, edge_table


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """Planar faces with shared edges. Loops run counter-clockwise about the face's normal, inner loops clockwise.

    points  : (p, 3) millimetres.
    edges   : (e, 2) points at the ends of each straight edge.
    steps   : (s,) edge of each step of the loops; every edge has two steps, one in each direction.
    forward : (s,) whether the step runs from the edge's first end to its second.
    loops   : (l + 1,) loop i has the steps loops[i] : loops[i + 1].
    faces   : (f + 1,) face i has the loops faces[i] : faces[i + 1], its outer loop first.
    normals : (f, 3) unit normals.
    origin  : (f,) a point of each face.
    shell   : (f,) the closed shell of each face.
    """

    points: Floats
    edges: Ints
    steps: Ints
    forward: Bools
    loops: Ints
    faces: Ints
    normals: Floats
    origin: Ints
    shell: Ints


@dataclass(frozen=True, eq=False)
class _Outline:
    """Loops of vertices: loop i has the half-edges h[start[i] : start[i + 1]], each leaving its vertex."""

    h: Ints
    start: Ints

    @property
    def loop(self) -> Ints:
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    @property
    def next(self) -> Ints:
        """Position of the next half-edge of the same loop."""
        onward = np.arange(1, len(self.h) + 1)
        onward[self.start[1:] - 1] = self.start[:-1]
        return onward


def polyhedron(V: Floats, F: Ints, shell: Ints) -> Polyhedron:
    """Planar faces of a closed triangle mesh whose edges have two triangles each; shell (m,) labels its triangles."""
    table = edge_table(F)
    other = np.empty(3 * len(F), dtype=np.int64)
    other[table.pairs[:, 0]], other[table.pairs[:, 1]] = table.pairs[:, 1], table.pairs[:, 0]
    region, vectors = coplanar_regions(V, F, table)
    outline = _simple(_outline(region, other), F)
    alive = _corners(V, F, table, outline)
    return _assembled(V, F, shell, region, vectors, table, outline, alive)


def _outline(region: Ints, other: Ints) -> _Outline:
    """The half-edges between different regions, chained with their region on the left.

    After a half-edge, the next one is found by turning about its end through triangles of the same region: loops never
    jump across a vertex where a region touches itself.
    """
    kept = region[np.arange(len(other)) // 3] != region[other // 3]
    onward = np.arange(len(other))
    onward += np.where(onward % 3 == 2, -2, 1)
    follow = onward.copy()
    turning = np.flatnonzero(kept)  # about a vertex inside a region one would turn for ever
    while len(turning := turning[~kept[onward[turning]]]):
        onward[turning] = follow[other[onward[turning]]]
    step, passed = onward.tolist(), bytearray(len(other))
    h, start = list[int](), [0]
    for at in np.flatnonzero(kept).tolist():
        while not passed[at]:
            passed[at] = True
            h.append(at)
            at = step[at]
        if len(h) > start[-1]:
            start.append(len(h))
    return _Outline(np.array(h, dtype=np.int64), np.array(start))


def _simple(outline: _Outline, F: Ints) -> _Outline:
    """The loops cut where they come back to a vertex, so that none touches itself."""
    vertex = F.ravel()[outline.h]
    visits = np.unique(np.stack([outline.loop, vertex]), axis=1, return_counts=True)
    touching = set(visits[0][0][visits[1] > 1].tolist())
    if not touching:
        return outline
    loops: list[list[int]] = []
    for i, (begin, end) in enumerate(zip(outline.start[:-1], outline.start[1:], strict=True)):
        h = outline.h[begin:end].tolist()
        loops.extend(_cut_apart(h, vertex[begin:end].tolist()) if i in touching else [h])
    return _Outline(np.concatenate([np.array(loop) for loop in loops]), np.cumsum([0, *map(len, loops)]))


def _cut_apart(h: list[int], vertices: list[int]) -> list[list[int]]:
    """One loop of half-edges as loops that visit each vertex once."""
    loops, path, place = [], list[int](), dict[int, int]()
    visited: list[int] = []
    for half_edge, vertex in zip(h, vertices, strict=True):
        if vertex in place:
            begin = place[vertex]
            loops.append(path[begin:])
            for v in visited[begin:]:
                del place[v]
            del path[begin:], visited[begin:]
        place[vertex] = len(path)
        path.append(half_edge)
        visited.append(vertex)
    return [*loops, path]


def _corners(V: Floats, F: Ints, table: EdgeTable, outline: _Outline) -> Bools:
    """(n,) vertices that the outlines need: not those in the middle of a straight edge.

    A vertex can go when just two outline edges meet there, in line. Then every run of such vertices must lie on the
    line between its ends, or it is kept whole: a finely divided circle is locally straight too. Loops keep three
    corners.
    """
    a = F.ravel()[outline.h]
    edge = np.unique(table.of.ravel()[outline.h])
    degree = np.bincount(table.ends[edge].ravel(), minlength=len(V))
    alive = np.zeros(len(V), dtype=bool)
    before, after = np.roll(a, 1), a[outline.next]
    before[outline.start[:-1]] = a[outline.start[1:] - 1]
    onward = np.einsum("hi,hi->h", V[a] - V[before], V[after] - V[a]) > 0
    alive[a[~onward | (_from_line(V[a], V[before], V[after]) > FLATNESS)]] = True
    alive[degree > 2] = True
    while True:
        few = np.add.reduceat(alive[a], outline.start[:-1]) < 3
        bent = np.repeat(few, np.diff(outline.start)) & ~alive[a]
        if not bent.any():
            run, end = _ends_of_runs(alive[a], outline)
            off = ~alive[a] & (_from_line(V[a], V[a[run]], V[a[end]]) > FLATNESS)
            bent = off if not off.any() else (np.bincount(run[off], minlength=len(a)) > 0)[run] & ~alive[a]
        if not bent.any():
            return alive
        alive[a[bent]] = True


def _ends_of_runs(alive: Bools, outline: _Outline) -> tuple[Ints, Ints]:
    """For each position, the last corner of its loop at or before it, and the first corner after it."""
    at = np.flatnonzero(alive)
    loop = outline.loop
    first = np.searchsorted(at, outline.start[:-1])
    last = np.searchsorted(at, outline.start[1:]) - 1
    rank = np.searchsorted(at, np.arange(len(alive)), side="right") - 1
    run = np.where(rank >= first[loop], rank, last[loop])
    end = np.where(rank + 1 <= last[loop], rank + 1, first[loop])
    return at[run], at[end]


def _from_line(p: Floats, a: Floats, b: Floats) -> Floats:
    """(k,) distances of points p from the lines through a and b."""
    along = b - a
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    distances: Floats = np.linalg.norm(np.cross(p - a, along), axis=1) / length
    return distances


def _assembled(
    V: Floats, F: Ints, shell: Ints, region: Ints, vectors: Floats, table: EdgeTable, outline: _Outline, alive: Bools
) -> Polyhedron:
    """Number points, edges and faces. From both sides, a long edge is known by the smallest mesh edge in it."""
    a = F.ravel()[outline.h]
    kept = alive[a]
    run, end = _ends_of_runs(kept, outline)
    smallest = np.full(len(a), len(table.ends))
    np.minimum.at(smallest, run, table.of.ravel()[outline.h])
    begin, finish, chain = a[kept], a[end[kept]], smallest[kept]
    start = np.concatenate([[0], np.cumsum(np.add.reduceat(kept, outline.start[:-1]))])

    face_of_loop = region[outline.h[outline.start[:-1]] // 3]
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    ahead = np.arange(1, len(begin) + 1)
    ahead[start[1:] - 1] = start[:-1]
    reference = np.repeat(begin[start[:-1]], np.diff(start))
    swept = np.cross(V[begin] - V[reference], V[begin[ahead]] - V[reference])
    around = np.einsum("li,li->l", np.add.reduceat(swept, start[:-1]), normals[face_of_loop])
    order = np.lexsort((-around, face_of_loop))
    steps = np.concatenate([np.arange(start[i], start[i + 1]) for i in order])

    used, point = np.unique(begin, return_inverse=True)
    of_vertex = np.zeros(len(V), dtype=np.int64)
    of_vertex[used] = np.arange(len(used))
    _, edge = np.unique(chain, return_inverse=True)
    ends = np.zeros((int(edge.max()) + 1, 2), dtype=np.int64)
    low = np.minimum(begin, finish)
    ends[edge, 0], ends[edge, 1] = of_vertex[low], of_vertex[np.maximum(begin, finish)]
    faces = np.searchsorted(face_of_loop[order], np.arange(len(normals) + 1))
    shell_of = np.zeros(len(normals), dtype=np.int64)
    shell_of[region] = shell
    loops = np.concatenate([[0], np.cumsum(np.diff(start)[order])])
    return Polyhedron(
        points=V[used],
        edges=ends,
        steps=edge[steps],
        forward=(begin == low)[steps],
        loops=loops,
        faces=faces,
        normals=normals,
        origin=point[steps][loops[faces[:-1]]],
        shell=shell_of,
    )
