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
from dsfab.export.loops import Outline, ends_of_runs, outline_of, positions, simple
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


def polyhedron(V: Floats, F: Ints, shell: Ints) -> Polyhedron:
    """Planar faces of a closed triangle mesh whose edges have two triangles each; shell (m,) labels its triangles."""
    table = edge_table(F)
    other = np.empty(3 * len(F), dtype=np.int64)
    other[table.pairs[:, 0]], other[table.pairs[:, 1]] = table.pairs[:, 1], table.pairs[:, 0]
    region, vectors = coplanar_regions(V, F, table)
    outline = simple(outline_of(region, other), F)
    alive = _corners(V, F, table, outline)
    return _assembled(V, F, shell, region, vectors, table, outline, alive)


def _corners(V: Floats, F: Ints, table: EdgeTable, outline: Outline) -> Bools:
    """(n,) vertices that the outlines need: not those in the middle of a straight edge.

    A vertex can go when just two outline edges meet there, in line. Then every run of such vertices must lie on the
    line between its ends, or it is kept whole: a finely divided circle is locally straight too. Loops keep three
    corners.
    """
    a = F.ravel()[outline.h]
    edge = np.unique(table.of.ravel()[outline.h])
    degree = np.bincount(table.ends[edge].ravel(), minlength=len(V))
    alive = degree > 2
    before, after = np.roll(a, 1), a[outline.next]
    before[outline.start[:-1]] = a[outline.start[1:] - 1]
    two = np.flatnonzero(~alive[a])  # all others are corners: on a curved solid nearly every vertex
    at, p, q = V[a[two]], V[before[two]], V[after[two]]
    onward = np.einsum("hi,hi->h", at - p, q - at) > 0
    alive[a[two][~onward | (_from_line(at, p, q) > FLATNESS)]] = True
    while len(dead := two[~alive[a[two]]]):
        few = np.repeat(np.add.reduceat(alive[a], outline.start[:-1]) < 3, np.diff(outline.start))
        bent = dead[few[dead]]
        if not len(bent):
            run, end = ends_of_runs(alive[a], outline)
            off = _from_line(V[a[dead]], V[a[run[dead]]], V[a[end[dead]]]) > FLATNESS
            bent = dead[np.isin(run[dead], run[dead[off]])]
        if not len(bent):
            break
        alive[a[bent]] = True
    return alive


def _from_line(p: Floats, a: Floats, b: Floats) -> Floats:
    """(k,) distances of points p from the lines through a and b."""
    along = b - a
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    distances: Floats = np.linalg.norm(np.cross(p - a, along), axis=1) / length
    return distances


def _assembled(
    V: Floats, F: Ints, shell: Ints, region: Ints, vectors: Floats, table: EdgeTable, outline: Outline, alive: Bools
) -> Polyhedron:
    """Number points, edges and faces; what has a row per step is let go early, since there are three to a triangle."""
    face_of_loop = region[outline.h[outline.start[:-1]] // 3]
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    begin, start, (edge, ends, forward) = _long_edges(F, table, outline, alive)
    order = np.lexsort((-_around(V, begin, start, face_of_loop, normals), face_of_loop))
    steps = positions(start, order)[0]
    used, point = np.unique(begin, return_inverse=True)
    of_vertex = np.zeros(len(V), dtype=np.int64)
    of_vertex[used] = np.arange(len(used))
    faces = np.searchsorted(face_of_loop[order], np.arange(len(normals) + 1))
    shell_of = np.zeros(len(normals), dtype=np.int64)
    shell_of[region] = shell
    loops = np.concatenate([[0], np.cumsum(np.diff(start)[order])])
    return Polyhedron(
        points=V[used],
        edges=of_vertex[ends],
        steps=edge[steps],
        forward=forward[steps],
        loops=loops,
        faces=faces,
        normals=normals,
        origin=point[steps[loops[faces[:-1]]]],
        shell=shell_of,
    )


def _long_edges(
    F: Ints, table: EdgeTable, outline: Outline, alive: Bools
) -> tuple[Ints, Ints, tuple[Ints, Ints, Bools]]:
    """The vertex that each step of the loops begins at, where the loops start, and of the steps their edges.

    The edge of each step, the vertices (e, 2) at the edges' ends, and whether a step runs from the first to the second.
    From both sides, a long edge is known by the smallest mesh edge in it.
    """
    a = F.ravel()[outline.h]
    kept = alive[a]
    run, end = ends_of_runs(kept, outline)
    smallest = np.full(len(a), len(table.ends))
    np.minimum.at(smallest, run, table.of.ravel()[outline.h])
    start = np.concatenate([[0], np.cumsum(np.add.reduceat(kept, outline.start[:-1]))])
    begin, finish = a[kept], a[end[kept]]
    _, edge = np.unique(smallest[kept], return_inverse=True)
    ends = np.zeros((int(edge.max()) + 1, 2), dtype=np.int64)
    ends[edge, 0], ends[edge, 1] = np.minimum(begin, finish), np.maximum(begin, finish)
    return begin, start, (edge, ends, begin < finish)


def _around(V: Floats, begin: Ints, start: Ints, face_of_loop: Ints, normals: Floats) -> Floats:
    """(l,) twice the area inside each loop, seen against its face's normal; 0 for the only loop of a face."""
    around = np.zeros(len(face_of_loop))
    many = np.flatnonzero(np.bincount(face_of_loop)[face_of_loop] > 1)
    if len(many):
        ahead = np.arange(1, len(begin) + 1)
        ahead[start[1:] - 1] = start[:-1]
        at, loop = positions(start, many)
        base = V[begin[start[many]]][loop]
        swept = np.cross(V[begin[at]] - base, V[begin[ahead[at]]] - base)
        around[many] = np.bincount(loop, np.einsum("hi,hi->h", swept, normals[face_of_loop[many]][loop]))
    return around
