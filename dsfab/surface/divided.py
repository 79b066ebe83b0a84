"""`Divided`: a surface with some of its faces divided, and `DividedField`: a field that is linear on the parts of them.

A distance, for one, is no linear function of the place on a large face: it needs more values there than three.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array, vstack

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.surface.geodesic import Origins
from dsfab.surface.mesh import Surface
from dsfab.surface.refine import halved, with_longest


@dataclass(frozen=True, eq=False)
class Divided:
    """A surface with n vertices and m faces in parts: n' vertices and m' triangles on the same sheet.

    whole   : the surface.    surface : its parts, on its vertices first.
    parent  : (m',) the face that each is a part of.
    weights : (n', n) barycentric weights of the vertices on the undivided ones, as in `dsfab.slicing.Sheet`.
    """

    whole: Surface
    surface: Surface
    parent: Ints
    weights: csr_array

    def __post_init__(self) -> None:
        lock(self, "parent", np.int64, (self.surface.m,))

    @classmethod
    def nowhere(cls, surface: Surface) -> Self:
        """Every face its own part."""
        return cls(surface, surface, np.arange(surface.m), csr_array(eye_array(surface.n)))

    def halved(self, edges: Bools, at: Floats | None = None) -> "Divided":
        """With marked edges (e',) halved, and the longest of each face with them, which keeps angles from shrinking.

        at : (e',) where they are divided, from 0 at their first end to 1; in their middle when left out.
        """
        old = self.surface
        edges = with_longest(old.V, old.edges, edges)
        V, F, source = halved(old.V, old.F, old.edges, edges)
        t = np.full(edges.sum(), 0.5) if at is None else at[edges]
        step = _interpolation(old.edges.ends[edges], t, old.n)
        V[old.n :] = step @ old.V
        weights = csr_array(vstack([self.weights, step @ self.weights], format="csr"))
        return Divided(self.whole, Surface(V, F), self.parent[source], weights)

    def new(self) -> Ints:
        """(k,) the parts that are less than a face."""
        return np.flatnonzero(self.surface.F.max(axis=1) >= self.whole.n)

    def corners(self, parts: Ints) -> Floats:
        """(k, 3, 3) barycentric coordinates, in their faces, of the corners of parts (k,)."""
        rows, columns = self.surface.F[parts][:, :, None], self.whole.F[self.parent[parts]][:, None, :]
        i, j = (np.broadcast_to(index, (len(parts), 3, 3)).ravel() for index in (rows, columns))
        return np.asarray(self.weights[i, j]).reshape(-1, 3, 3)

    def carried(self, origins: Origins) -> Origins:
        """What is marked on the surface, on its parts."""
        if self.surface is self.whole:
            return origins
        n, old, new = self.whole.n, self.whole.edges, self.surface.edges
        vertices, edges = np.zeros(self.surface.n, dtype=bool), np.zeros(len(new.ends), dtype=bool)
        vertices[:n] = origins.vertices
        same = np.flatnonzero(new.ends[:, 1] < n)
        at = np.searchsorted(old.ends @ (n, 1), new.ends[same] @ (n, 1))
        edges[same] = origins.edges[at]
        parts = self.new()
        corners = self.corners(parts)
        on = (corners == 0) & (
            corners[:, [1, 2, 0]] == 0
        )  # side k of a part, on the side of its face opposite corner j
        marked = origins.edges[old.of[self.parent[parts]][:, [1, 2, 0]]]
        part, side, _ = np.nonzero(on & marked[:, None, :])
        edges[new.of[parts[part], side]] = True
        faces = origins.faces[self.parent]
        edges[new.of[faces]] = True
        vertices[new.ends[edges]] = True
        return Origins(vertices, edges, faces)


def _interpolation(ends: Ints, at: Floats, n: int) -> csr_array:
    """(k, n) from values at n vertices to those between the ends (k, 2) of edges, `at` 0 to 1 from the first to the
    second."""
    rows = np.repeat(np.arange(len(ends)), 2)
    return csr_array((np.stack([1 - at, at], axis=1).ravel(), (rows, ends.ravel())), shape=(len(ends), n))


@dataclass(frozen=True, eq=False)
class DividedField:
    """Values x (n',), or (n', 2), at the vertices of a divided surface, linear on its parts."""

    divided: Divided
    x: Floats

    def __post_init__(self) -> None:
        lock(self, "x", np.float64, (self.divided.surface.n, *([2] if np.ndim(self.x) == 2 else [])))

    @property
    def at_vertices(self) -> Floats:
        """(n,) or (n, 2) at the vertices of the undivided surface."""
        return self.x[: self.divided.whole.n]

    @property
    def columns(self) -> "tuple[DividedField, ...]":
        """The one or two fields that have one value at each vertex."""
        return (self,) if self.x.ndim == 1 else tuple(DividedField(self.divided, x) for x in self.x.T)

    def at_points(self, points: Floats) -> Floats:
        """(m, p) of one value at each vertex: at points of each face, in barycentric coordinates (p, 3)."""
        whole, parts = self.divided.whole, self.divided.new()
        values, inside = self.x[whole.F] @ points.T, np.full((whole.m, len(points)), -np.inf)
        own = points @ np.linalg.inv(self.divided.corners(parts))  # (k, p, 3) coordinates in each part
        least, parent = own.min(axis=2), self.divided.parent[parts]
        np.maximum.at(inside, parent, least)
        part, point = np.nonzero(least == inside[parent])
        corners = self.x[self.divided.surface.F[parts[part]]]
        values[parent[part], point] = np.einsum("kc,kc->k", own[part, point], corners)
        return np.asarray(values)
