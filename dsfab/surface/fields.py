"""Fields on a surface: linear hat functions, level lines, fields at face corners, and fields on divided faces."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, Self

import igl
import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.core.derived import derived
from dsfab.surface.edge_changes import halved_edges, with_longest_edges
from dsfab.surface.geodesic import Origins
from dsfab.surface.mesh import Surface


def hat_gradients(surface: Surface) -> Floats:
    """Return the gradients (m, 3 corners, 3 xyz), per metre, of each face's hat functions."""
    P = surface.V[surface.F]
    u, v, w = (P[:, (2, 0, 1)] - P[:, (1, 2, 0)]).transpose(2, 0, 1)  # edges opposite to the corners
    x, y, z = surface.normals.T[:, :, None]
    gradients = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=2)
    gradients /= (2 * surface.areas)[:, None, None]
    return gradients


def tangents(surface: Surface) -> Floats:
    """Return two orthonormal axes (m, 2, 3) in each face's plane: t, along the first edge, and n x t, with normal n."""
    edge = surface.V[surface.F[:, 1]] - surface.V[surface.F[:, 0]]
    t1 = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.stack([t1, np.cross(surface.normals, t1)], axis=1)


@derived
def voronoi_mass(surface: Surface) -> Floats:
    """Return the Voronoi area (n,) of each vertex, m2: its part of the surface's area [Meyer et al. 2003]."""
    diagonal: Floats = igl.massmatrix(surface.V, surface.F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    diagonal.flags.writeable = False
    return diagonal


def assemble(surface: Surface, blocks: Floats, diagonal: Floats | None = None) -> csr_array:
    """Assemble face matrices `blocks` (m, 3, 3) into a sparse matrix (n, n), plus `diagonal` (n,) on its diagonal."""
    rows = np.repeat(surface.F, 3, axis=1).ravel()
    columns = np.tile(surface.F, (1, 3)).ravel()
    values = blocks.ravel()
    if diagonal is not None:
        every = np.arange(surface.n)
        rows, columns = np.concatenate([rows, every]), np.concatenate([columns, every])
        values = np.concatenate([values, diagonal])
    return coo_array((values, (rows, columns)), shape=(surface.n, surface.n)).tocsr()


Kind = Literal["edge", "centre"]  # An edge of the material, or the middle line of a member.


@dataclass(frozen=True, eq=False)
class StructureLine:
    """A line of the structure, as a polyline on the surface.
    kind   : "edge": a border of the material. "centre": the centre line of a member.
    family : "major", "minor", "keep" (kept regions), "rim", or "boundary" for borders of the uncut surface.
    number : number of the stripe in its family; 0 if the line belongs to no stripe.
    part   : 1, 2, ... for lines with equal kind, family and number.
    points : (k, 3) metres; the last point repeats the first point if the line is closed."""

    kind: Kind
    family: str
    number: int
    part: int
    points: Floats
    length: float

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 3))

    @cached_property
    def is_closed(self) -> bool:
        """True if the line is a closed curve: its last point is its first point."""
        return len(self.points) > 2 and bool((self.points[0] == self.points[-1]).all())

    @property
    def layer(self) -> str:
        """Name of the line's layer in drawing programs, such as `edges-major`, `centre-minor` or `boundary`."""
        kind = "edges" if self.kind == "edge" else "centre"
        return "boundary" if self.family == "boundary" else f"{kind}-{self.family}"

    @property
    def id(self) -> str:
        """Name of the line, such as `centre-major-3.1`."""
        return f"{self.layer}-{self.number}.{self.part}"


class Track(NamedTuple):
    """A level line: points (k, 3), metres, the index of its level, and the face (k - 1,) between successive points."""

    points: Floats
    level: int
    faces: Ints


def polyline_length(points: Floats) -> float:
    """Return the length of the polyline through (k, 3) points."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def level_lines(surface: Surface, x: Floats, levels: Floats, within: Bools | None = None) -> list[Track]:
    """Return the level lines of a field. x : (n,) values at the vertices.    levels : (l,) values of lines, ascending.
    within : (m,) mask of the faces that may have lines."""
    nodes = _nodes(surface, x, levels)
    if nodes.level.size == 0:
        return []
    face, first_node, second_node = _chords(surface, x, levels, nodes)
    if within is not None:
        is_inside = within[face]
        face, first_node, second_node = face[is_inside], first_node[is_inside], second_node[is_inside]
    tracks = []
    for order, chord in chains(first_node, second_node, len(nodes.level)):
        points = nodes.points[order]
        moved = (np.diff(points, axis=0) != 0).any(axis=1)
        if moved.any():
            points = points[np.concatenate([[True], moved])]
            tracks.append(Track(points, int(nodes.level[order[0]]), face[chord][moved]))
    return tracks


class _Nodes(NamedTuple):
    """Points where level lines cross edges, edge after edge, in the order of the levels.
    The first point on edge e has the index offset[e] and lies on the level with the index begin[e]."""

    offset: Ints
    begin: Ints
    level: Ints
    points: Floats


def _nodes(surface: Surface, x: Floats, levels: Floats) -> _Nodes:
    ends = surface.edges.ends
    below = np.searchsorted(levels, x, side="right")  # a vertex on a level counts as above the level
    begin, end = below[ends].min(axis=1), below[ends].max(axis=1)
    offset = np.concatenate([[0], np.cumsum(end - begin)])
    edge = np.repeat(np.arange(len(ends)), end - begin)
    level = begin[edge] + np.arange(offset[-1]) - offset[edge]
    p, q = ends[edge].T
    t = ((levels[level] - x[p]) / (x[q] - x[p]))[:, None] if len(edge) else np.zeros((0, 1))
    t = np.clip(t, 0.0, 1.0)
    return _Nodes(
        offset[:-1], begin, level, np.where(t == 1, surface.V[q], surface.V[p] + t * (surface.V[q] - surface.V[p]))
    )


def _chords(surface: Surface, x: Floats, levels: Floats, nodes: _Nodes) -> tuple[Ints, Ints, Ints]:
    below = np.searchsorted(levels, x[surface.F], side="right")
    rank = np.argsort(below, axis=1, kind="stable")
    low, mid, high = np.take_along_axis(below, rank, axis=1).T
    face = np.repeat(np.arange(surface.m), high - low)
    level = low[face] + np.arange(len(face)) - (np.cumsum(high - low) - (high - low))[face]
    lowest, middle, highest = rank[face].T
    longest = _side(lowest, highest)
    second_side = np.where(level < mid[face], _side(lowest, middle), _side(middle, highest))
    edge = surface.edges.of[face]
    rows = np.arange(len(face))
    e, f = edge[rows, longest], edge[rows, second_side]
    return face, nodes.offset[e] + level - nodes.begin[e], nodes.offset[f] + level - nodes.begin[f]


def _side(i: Ints, j: Ints) -> Ints:
    return np.where((i + 1) % 3 == j, i, j)


def chains(first_nodes: Ints, second_nodes: Ints, count: int) -> list[tuple[Ints, Ints]]:
    """Join links to chains. Link k connects first_nodes[k] and second_nodes[k]; a node has at most two links.
    Return the nodes and links of each chain. Closed chains come last, and end with their first node."""
    node = np.concatenate([first_nodes, second_nodes])
    order = np.argsort(node, kind="stable")
    degree = np.bincount(node, minlength=count)
    start = np.cumsum(degree) - degree
    link = np.full((count, 2), -1)
    for k in range(2):
        has = degree > k
        link[has, k] = order[start[has] + k] % len(first_nodes)
    sum_of_ends, links = (first_nodes + second_nodes).tolist(), link.tolist()
    used = bytearray(len(first_nodes))
    result = []
    for begin in [*np.flatnonzero(degree == 1).tolist(), *np.flatnonzero(degree == 2).tolist()]:
        nodes, passed, current = [begin], list[int](), begin
        while True:
            a, b = links[current]
            step = a if a >= 0 and not used[a] else b
            if step < 0 or used[step]:
                break
            used[step] = True
            current = sum_of_ends[step] - current
            nodes.append(current)
            passed.append(step)
        if passed:
            result.append((np.array(nodes), np.array(passed)))
    return result


def simplified_line(points: Floats, tolerance: float) -> Floats:
    """Return the polyline through `points` (k, d) with fewer points [Douglas, Peucker 1973].
    The distance of omitted points from the result is at most `tolerance`."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    if len(points) > 3 and (points[0] == points[-1]).all():
        farthest = int(np.linalg.norm(points - points[0], axis=1).argmax())
        keep[farthest] = True
        spans = [(0, farthest), (farthest, len(points) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        distances = _from_segment(points[a + 1 : b], points[a], points[b])
        worst = int(distances.argmax())
        if distances[worst] > tolerance:
            middle = a + 1 + worst
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return points[keep]


def _from_segment(points: Floats, a: Floats, b: Floats) -> Floats:
    along = b - a
    squared = float(along @ along)
    away = points - a
    if squared:  # np.clip and np.linalg.norm would be slow
        away -= np.minimum(np.maximum(away @ along / squared, 0.0), 1.0)[:, None] * along
    return np.asarray(np.sqrt((away * away).sum(axis=1)))


@dataclass(frozen=True, eq=False)
class CornerField:
    """A field; a surface is cut along its level lines. The value at a corner of a face is sign * x + shift.
    x      : values at the vertices, (n, 1) or (n, 2). With two values per vertex, material lies where more levels are
             below x[:, 0] than below x[:, 1].
    sign   : (m, 3) 1 or -1 at each corner of a face.    shift : (m, 3) offset at each corner of a face.
    blank  : (m,) mask of the faces without a field.
    wanted : (m,) fraction of each face's area to which the field applies, 0 to 1; None for 1 everywhere."""

    x: Floats
    sign: Floats
    shift: Floats
    blank: Bools
    wanted: Floats | None = None

    def __post_init__(self) -> None:
        lock(self, "x", np.float64, (None, None))
        lock(self, "sign", np.float64, (None, 3))
        lock(self, "shift", np.float64, (len(self.sign), 3))
        lock(self, "blank", np.bool_, (len(self.sign),))
        if self.wanted is not None:
            lock(self, "wanted", np.float64, (len(self.sign),))

    @cached_property
    def changed_faces(self) -> Bools:
        """Mask (m,) of the faces that have a corner with `sign` -1 or with a `shift` other than 0."""
        return np.asarray(((self.sign < 0) | (self.shift != 0)).any(axis=1))

    def corners(self, F: Ints) -> Floats:
        """Return the field's values (m, 3, 1 or 2) at the corners of the faces F (m, 3)."""
        x, sign = self.x[F], self.sign[:, :, None]
        return np.asarray(np.where(sign > 0, x, -x[..., ::-1]) + self.shift[:, :, None])


@dataclass(frozen=True, eq=False)
class DividedSurface:
    """A surface `whole` (n vertices, m faces) and the same surface with divided faces (n' vertices, m' triangles).
    surface : the divided surface; the first n vertices are those of `whole`.
    parent  : (m',) number of the face of `whole` that contains each triangle.
    weights : (n', n) matrix that gives each vertex as a weighted mean of the vertices of `whole`."""

    whole: Surface
    surface: Surface
    parent: Ints
    weights: csr_array

    def __post_init__(self) -> None:
        lock(self, "parent", np.int64, (self.surface.m,))

    @classmethod
    def undivided(cls, surface: Surface) -> Self:
        """Return a `DividedSurface` in which no face of the surface is divided."""
        return cls(surface, surface, np.arange(surface.m), csr_array(eye_array(surface.n)))

    def with_halved_edges(self, edges: Bools, positions: Floats | None = None) -> "DividedSurface":
        """Divide the edges in the mask `edges` (e',), and the longest edge of each face that has such an edge.
        positions : (e',) positions of the new vertices on the edges, 0 to 1; None for the midpoints."""
        surface = self.surface
        edges = with_longest_edges(surface.V, surface.edges, edges)
        V, F, source = halved_edges(surface.V, surface.F, surface.edges, edges)
        t = np.full(edges.sum(), 0.5) if positions is None else positions[edges]
        step = _interpolation(surface.edges.ends[edges], t, surface.n)
        V[surface.n :] = step @ surface.V
        weights = csr_array(vstack([self.weights, step @ self.weights], format="csr"))
        return DividedSurface(self.whole, Surface(V, F), self.parent[source], weights)

    def cut_parts(self) -> Ints:
        """Return the numbers (k,) of the triangles that are parts of divided faces."""
        return np.flatnonzero(self.surface.F.max(axis=1) >= self.whole.n)

    def corners(self, parts: Ints) -> Floats:
        """Return barycentric coordinates (k, 3, 3), in undivided faces, of the corners of triangles `parts` (k,)."""
        rows, columns = self.surface.F[parts][:, :, None], self.whole.F[self.parent[parts]][:, None, :]
        i, j = (np.broadcast_to(index, (len(parts), 3, 3)).ravel() for index in (rows, columns))
        return np.asarray(self.weights[i, j]).reshape(-1, 3, 3)

    def origins_on_parts(self, origins: Origins) -> Origins:
        """Return the vertices, edges and faces to measure distances from (`origins`) on the divided surface."""
        if self.surface is self.whole:
            return origins
        n, whole_edges, part_edges = self.whole.n, self.whole.edges, self.surface.edges
        vertices, edges = np.zeros(self.surface.n, dtype=bool), np.zeros(len(part_edges.ends), dtype=bool)
        vertices[:n] = origins.vertices
        uncut = np.flatnonzero(part_edges.ends[:, 1] < n)
        edges[uncut] = origins.edges[np.searchsorted(whole_edges.ends @ (n, 1), part_edges.ends[uncut] @ (n, 1))]
        parts = self.cut_parts()
        corners = self.corners(parts)
        # is_on_side[part, k, j]: True if side k of the part lies on the face's side opposite to corner j
        is_on_side = (corners == 0) & (corners[:, [1, 2, 0]] == 0)
        marked = origins.edges[whole_edges.of[self.parent[parts]][:, [1, 2, 0]]]
        part, side, _ = np.nonzero(is_on_side & marked[:, None, :])
        edges[part_edges.of[parts[part], side]] = True
        faces = origins.faces[self.parent]
        edges[part_edges.of[faces]] = True
        vertices[part_edges.ends[edges]] = True
        return Origins(vertices, edges, faces)


def _interpolation(ends: Ints, positions: Floats, n: int) -> csr_array:
    rows = np.repeat(np.arange(len(ends)), 2)
    return csr_array((np.stack([1 - positions, positions], axis=1).ravel(), (rows, ends.ravel())), shape=(len(ends), n))


@dataclass(frozen=True, eq=False)
class DividedField:
    """A field on a divided surface. x : values at its vertices, (n',) or (n', 2)."""

    divided: DividedSurface
    x: Floats

    def __post_init__(self) -> None:
        lock(self, "x", np.float64, (self.divided.surface.n, *([2] if np.ndim(self.x) == 2 else [])))

    @property
    def at_vertices(self) -> Floats:
        """Values (n,) or (n, 2) of the field at the vertices of the undivided surface."""
        return self.x[: self.divided.whole.n]

    @property
    def columns(self) -> "tuple[DividedField, ...]":
        """Fields with a single value per vertex, a field for each column of x."""
        return (self,) if self.x.ndim == 1 else tuple(DividedField(self.divided, x) for x in self.x.T)

    def at_points(self, points: Floats) -> Floats:
        """Return the values (m, p) at barycentric coordinates (p, 3) in each face, for a field with a single column."""
        surface, parts = self.divided.whole, self.divided.cut_parts()
        values, inside = self.x[surface.F] @ points.T, np.full((surface.m, len(points)), -np.inf)
        part_coordinates = points @ np.linalg.inv(self.divided.corners(parts))  # barycentric, (k, p, 3)
        least, parent = part_coordinates.min(axis=2), self.divided.parent[parts]
        np.maximum.at(inside, parent, least)
        part, point = np.nonzero(least == inside[parent])
        corners = self.x[self.divided.surface.F[parts[part]]]
        values[parent[part], point] = np.einsum("kc,kc->k", part_coordinates[part, point], corners)
        return np.asarray(values)
