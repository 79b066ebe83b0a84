"""Planar faces from triangles: coplanar regions, their outlines, and polyhedra with long edges."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, unit_vectors
from dsfab.surface.topology import EdgeTable, edge_table, link_components

FLATNESS = 1e-5  # largest distance (mm) of vertices from the plane or edge of joined faces; Parasolid's precision


def coplanar_regions(V: Floats, F: Ints, table: EdgeTable, tolerance: float = FLATNESS) -> tuple[Ints, Floats]:
    """Return the region (m,) of each triangle, and twice the area vector (r, 3) of each region.
    tolerance : largest distance (mm) of a vertex from the mean plane of its region."""
    corners = V[F]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    units = unit_vectors(vectors)
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    low = np.linalg.norm(vectors, axis=1) <= FLATNESS * lengths.max(axis=1)
    h, k = np.concatenate([table.pairs, table.pairs[:, ::-1]]).T  # triangle h // 3 has the neighbour k // 3
    tip = V[F.ravel()[k - k % 3 + (k + 2) % 3]]
    level = np.abs(np.einsum("pi,pi->p", tip - corners[h // 3, 0], units[h // 3])) <= tolerance
    level &= np.einsum("pi,pi->p", units[h // 3], units[k // 3]) > 0
    forth, back = np.split(level & ~low[h // 3] & ~low[k // 3], 2)
    flat = table.pairs[forth & back] // 3
    absorbed = np.stack([h, k], axis=1)[low[h // 3] & (h % 3 == lengths.argmax(axis=1)[h // 3])] // 3
    _, region = link_components(len(F), *np.concatenate([flat, absorbed]).T)
    uneven = _off_plane(corners, vectors, region) > tolerance
    if uneven.any():
        _, region = link_components(len(F), *np.concatenate([flat[~uneven[region[flat[:, 0]]]], absorbed]).T)
    return region, group_sums(region, vectors)


def _off_plane(corners: Floats, vectors: Floats, region: Ints) -> Floats:
    normal = unit_vectors(group_sums(region, vectors))
    weight = np.linalg.norm(vectors, axis=1)
    total = np.maximum(np.bincount(region, weight), 1e-300)
    middle = group_sums(region, corners.mean(axis=1) * weight[:, None]) / total[:, None]
    height = np.abs(np.einsum("mci,mi->mc", corners - middle[region][:, None], normal[region])).max(axis=1)
    worst = np.zeros(len(normal))
    np.maximum.at(worst, region, height)
    return worst


@dataclass(frozen=True, eq=False)
class FaceOutlines:
    """Outlines of faces as loops of half-edges (directed edges). Loop i consists of h[start[i] : start[i + 1]]."""

    h: Ints
    start: Ints

    @property
    def loop(self) -> Ints:
        """Number (h,) of the loop that contains each half-edge."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    @property
    def next(self) -> Ints:
        """For each half-edge, the position (h,) of the next half-edge of its loop."""
        onward = np.arange(1, len(self.h) + 1)
        onward[self.start[1:] - 1] = self.start[:-1]
        return onward


def outline_of(region: Ints, opposite: Ints) -> FaceOutlines:
    """Return the outlines of regions as loops of half-edges (directed edges), with each region on the left.
    region : (m,) region of each triangle.    opposite : (3 m,) opposite half-edge of each half-edge."""
    on_border = region[np.arange(len(opposite)) // 3] != region[opposite // 3]
    onward = np.arange(len(opposite))
    onward += np.where(onward % 3 == 2, -2, 1)
    follow = onward.copy()
    turning = np.flatnonzero(on_border)  # at half-edges inside a region, the loop below would never end
    while len(turning := turning[~on_border[onward[turning]]]):
        onward[turning] = follow[opposite[onward[turning]]]
    step, passed = onward.tolist(), bytearray(len(opposite))
    h, start = list[int](), [0]
    for half_edge in np.flatnonzero(on_border).tolist():
        while not passed[half_edge]:
            passed[half_edge] = True
            h.append(half_edge)
            half_edge = step[half_edge]
        if len(h) > start[-1]:
            start.append(len(h))
    return FaceOutlines(np.array(h, dtype=np.int64), np.array(start))


def simple_loops(outline: FaceOutlines, F: Ints) -> FaceOutlines:
    """Cut loops that visit a vertex several times into loops that visit each vertex once. F : (m, 3) triangles."""
    vertex = F.ravel()[outline.h]
    visits = np.sort(outline.loop * (int(F.max()) + 1) + vertex)
    touching = set((visits[1:][visits[1:] == visits[:-1]] // (int(F.max()) + 1)).tolist())
    if not touching:
        return outline
    loops: list[list[int]] = []
    for i, (begin, end) in enumerate(zip(outline.start[:-1], outline.start[1:], strict=True)):
        h = outline.h[begin:end].tolist()
        loops.extend(cut_apart(h, vertex[begin:end].tolist()) if i in touching else [h])
    return FaceOutlines(np.concatenate([np.array(loop) for loop in loops]), np.cumsum([0, *map(len, loops)]))


def cut_apart(h: list[int], vertices: list[int]) -> list[list[int]]:
    """Cut a loop of half-edges h (k,), which start at `vertices` (k,), into loops that visit each vertex once."""
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


def ends_of_runs(alive: Bools, outline: FaceOutlines) -> tuple[Ints, Ints]:
    """Return, for each half-edge, the positions (h,) of the last corner up to it, and of the next corner.
    alive : (h,) True for half-edges that start at a corner."""
    corner_positions = np.flatnonzero(alive)
    loop = outline.loop
    loop_first = np.searchsorted(corner_positions, outline.start[:-1])
    loop_last = np.searchsorted(corner_positions, outline.start[1:]) - 1
    rank = np.searchsorted(corner_positions, np.arange(len(alive)), side="right") - 1
    run = np.where(rank >= loop_first[loop], rank, loop_last[loop])
    return corner_positions[run], corner_positions[np.where(rank < loop_last[loop], rank + 1, loop_first[loop])]


def step_positions(start: Ints, loops: Ints) -> tuple[Ints, Ints]:
    """Return the positions (p,) of all half-edges in the loops with the numbers `loops` (k,).
    Return also the index (p,) of each half-edge's loop.    start : position of each loop's first half-edge."""
    length = np.diff(start)[loops]
    loop = np.repeat(np.arange(len(loops)), length)
    return (start[loops] - np.cumsum(length) + length)[loop] + np.arange(len(loop)), loop


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """Planar faces with shared edges. Outer loops run counter-clockwise about the face's normal, inner loops clockwise.
    points  : (p, 3) coordinates, mm.    edges : (e, 2) end points of each straight edge.
    steps   : (s,) edge of each step of the loops.    forward : (s,) True if a step has the direction of its edge.
    loops   : (l + 1,) loop i has the steps loops[i] : loops[i + 1].
    faces   : (f + 1,) face i has the loops faces[i] : faces[i + 1], the outer loop first.
    normals : (f, 3) unit normals.    origin : (f,) number of a point of each face.
    shell   : (f,) number of the closed shell of each face."""

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
    """Build the planar faces of a closed triangle mesh. shell : (m,) number of each triangle's shell."""
    table = edge_table(F)
    opposite = np.empty(3 * len(F), dtype=np.int64)
    opposite[table.pairs[:, 0]], opposite[table.pairs[:, 1]] = table.pairs[:, 1], table.pairs[:, 0]
    region, vectors = coplanar_regions(V, F, table)
    outline = simple_loops(outline_of(region, opposite), F)
    return _numbered_polyhedron(V, F, shell, region, vectors, table, outline, _corners(V, F, table, outline))


def _corners(V: Floats, F: Ints, table: EdgeTable, outline: FaceOutlines) -> Bools:
    """Return a mask (n,) of vertices that are corners of outlines."""
    a = F.ravel()[outline.h]
    alive = np.bincount(table.ends[np.unique(table.of.ravel()[outline.h])].ravel(), minlength=len(V)) > 2
    before, after = np.roll(a, 1), a[outline.next]
    before[outline.start[:-1]] = a[outline.start[1:] - 1]
    two = np.flatnonzero(~alive[a])  # vertices where only two outline edges meet
    points, p, q = V[a[two]], V[before[two]], V[after[two]]
    onward = np.einsum("hi,hi->h", points - p, q - points) > 0
    alive[a[two][~onward | (_from_line(points, p, q) > FLATNESS)]] = True
    while len(dead := two[~alive[a[two]]]):
        few = np.repeat(np.add.reduceat(alive[a], outline.start[:-1]) < 3, np.diff(outline.start))
        bent = dead[few[dead]]
        if not len(bent):
            run, end = ends_of_runs(alive[a], outline)
            off_line = _from_line(V[a[dead]], V[a[run[dead]]], V[a[end[dead]]]) > FLATNESS
            bent = dead[np.isin(run[dead], run[dead[off_line]])]
        if not len(bent):
            break
        alive[a[bent]] = True
    return alive


def _from_line(p: Floats, a: Floats, b: Floats) -> Floats:
    along = b - a
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    return np.asarray(np.linalg.norm(np.cross(p - a, along), axis=1) / length)


def _numbered_polyhedron(
    V: Floats,
    F: Ints,
    shell: Ints,
    region: Ints,
    vectors: Floats,
    table: EdgeTable,
    outline: FaceOutlines,
    alive: Bools,
) -> Polyhedron:
    face_of_loop = region[outline.h[outline.start[:-1]] // 3]
    normals = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    begin, start, (edge, ends, forward) = _long_edges(F, table, outline, alive)
    order = np.lexsort((-_loop_areas(V, begin, start, face_of_loop, normals), face_of_loop))
    steps = step_positions(start, order)[0]
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
    F: Ints, table: EdgeTable, outline: FaceOutlines, alive: Bools
) -> tuple[Ints, Ints, tuple[Ints, Ints, Bools]]:
    """Join half-edges to steps (straight parts of loops).
    Return the first vertex of each step, the first step of each loop, and the edges of the steps."""
    a = F.ravel()[outline.h]
    is_corner = alive[a]
    run, end = ends_of_runs(is_corner, outline)
    smallest = np.full(len(a), len(table.ends))
    np.minimum.at(smallest, run, table.of.ravel()[outline.h])
    start = np.concatenate([[0], np.cumsum(np.add.reduceat(is_corner, outline.start[:-1]))])
    begin, finish = a[is_corner], a[end[is_corner]]
    _, edge = np.unique(smallest[is_corner], return_inverse=True)
    ends = np.zeros((int(edge.max()) + 1, 2), dtype=np.int64)
    ends[edge, 0], ends[edge, 1] = np.minimum(begin, finish), np.maximum(begin, finish)
    return begin, start, (edge, ends, begin < finish)


def _loop_areas(V: Floats, begin: Ints, start: Ints, face_of_loop: Ints, normals: Floats) -> Floats:
    """Return twice the area (l,) inside each loop, negative if it is clockwise. A face's only loop gets 0."""
    around = np.zeros(len(face_of_loop))
    many = np.flatnonzero(np.bincount(face_of_loop)[face_of_loop] > 1)
    if len(many):
        ahead = np.arange(1, len(begin) + 1)
        ahead[start[1:] - 1] = start[:-1]
        place, loop = step_positions(start, many)
        base = V[begin[start[many]]][loop]
        swept = np.cross(V[begin[place]] - base, V[begin[ahead[place]]] - base)
        around[many] = np.bincount(loop, np.einsum("hi,hi->h", swept, normals[face_of_loop[many]][loop]))
    return around
