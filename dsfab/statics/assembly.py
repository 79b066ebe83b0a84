"""Assembly of a stiffness matrix from 3 x 3 blocks, one for each pair of vertices."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.sparse import bsr_array, csr_array

from dsfab.core.arrays import Bools, Floats, Ints, distinct
from dsfab.core.derived import derived_results
from dsfab.surface import next_half_edge
from dsfab.surface.mesh import Surface


def hinges(surface: Surface) -> Ints:
    r"""Return the vertices (i, 4) of each hinge (two faces with a common edge), in the order of this picture.

          2
         / \
        0---1      0 -> 1 runs counter-clockwise in the face of vertex 2
         \ /
          3"""
    h0, h1 = surface.edges.pairs.T
    corner = surface.F.ravel()
    ends = [corner[h0], corner[next_half_edge(h0)]]
    opposite = [corner[next_half_edge(h, 2)] for h in (h0, h1)]
    return np.stack(ends + opposite, axis=1)


def angle_gradients(surface: Surface, hinge: Ints) -> tuple[Floats, Floats]:
    """Return the gradients (i, 4, 3), 1/m, of fold angles for displacements of the vertices of hinges (i, 4).
    Return also weights (i,), l^2 / (A1 + A2): l, length of the common edge; A1, A2, areas of the faces."""
    p0, p1, p2, p3 = (surface.V[hinge[:, k]] for k in range(4))
    edge = p1 - p0
    length = np.linalg.norm(edge, axis=1)
    n2, n3 = np.cross(edge, p2 - p0), np.cross(p3 - p0, edge)
    area2, area3 = np.linalg.norm(n2, axis=1) / 2, np.linalg.norm(n3, axis=1) / 2
    g2 = n2 * (length / (4 * area2**2))[:, None]
    g3 = n3 * (length / (4 * area3**2))[:, None]
    s2 = np.einsum("ij,ij->i", p2 - p0, edge) / length**2
    s3 = np.einsum("ij,ij->i", p3 - p0, edge) / length**2
    g1 = -(g2 * s2[:, None] + g3 * s3[:, None])
    return np.stack([-(g1 + g2 + g3), g1, g2, g3], axis=1), length**2 / (area2 + area3)


Index = npt.NDArray[np.integer[Any]]
"""Indices of a sparse matrix. They have four bytes to save memory, because every entry of the matrix has an index."""

CORNERS = ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3))
"""The six pairs of the four vertices of a hinge, see `hinges`."""


@dataclass(frozen=True, eq=False)
class VertexPairs:
    """Pairs of vertices that have a 3 x 3 block in a stiffness matrix. A hinge is two faces with a common edge.
    ends     : (p, 2) vertices of each pair, lower number first.    of_edge : (e,) number of the pair of each edge.
    opposite : (i,) pair of each hinge's opposite vertices; p if they are equal; empty without hinges."""

    n: int
    ends: Ints
    of_edge: Ints
    opposite: Ints

    @classmethod
    def from_surface(cls, surface: Surface, hinge: Ints | None = None) -> Self:
        """Return the pairs of vertices at edges and hinges (i, 4)."""
        n, ends = surface.n, surface.edges.ends
        edge = ends[:, 0] * n + ends[:, 1]
        if hinge is None:
            return cls(n, ends, np.arange(len(ends)), np.zeros(0, dtype=np.int64))
        across = hinge[:, 2:].min(axis=1) * n + hinge[:, 2:].max(axis=1)
        apart = hinge[:, 2] != hinge[:, 3]
        keys = distinct(np.concatenate([edge, across[apart]]))
        opposite = np.where(apart, np.searchsorted(keys, across), len(keys))
        return cls(n, np.stack(np.divmod(keys, n), axis=1), np.searchsorted(keys, edge), opposite)

    def of_hinge(self, surface: Surface, hinge: Ints) -> Ints:
        """Return the numbers (6, i) of the six vertex pairs of each hinge, in the order of `CORNERS`."""
        edge = self.of_edge[surface.edges.of.ravel()]
        h0, h1 = surface.edges.pairs.T
        next0, next1 = (next_half_edge(h) for h in (h0, h1))
        last0, last1 = (next_half_edge(h, 2) for h in (h0, h1))
        from0 = surface.F.ravel()[h1] == hinge[:, 0]  # true if both faces list the edge in the same direction
        second_face = np.where(from0, last1, next1), np.where(from0, next1, last1)
        return np.stack([edge[h0], edge[last0], edge[next0], edge[second_face[0]], edge[second_face[1]], self.opposite])

    @cached_property
    def _block_positions(self) -> tuple[Index, Index, Index]:
        low, high = self.ends.T.astype(np.int32)
        vertex, pair = np.arange(self.n, dtype=np.int32), np.arange(len(low), dtype=np.int32)
        # this order gives ascending columns in each row without sorting
        row, column = np.concatenate([high, vertex, low]), np.concatenate([low, vertex, high])
        begin = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=self.n))]).astype(np.int32)
        order = np.argsort(row, kind="stable")
        number = np.concatenate([len(pair) + pair, 2 * len(pair) + vertex, pair])[order]
        return begin, column[order], number

    def matrix(self, blocks: "PairBlocks") -> csr_array:
        """Return the stiffness matrix (3 n, 3 n) of these blocks."""
        begin, column, number = self._block_positions
        all_blocks = np.concatenate([blocks.between.T, _transposed_blocks(blocks.between).T, blocks.own.T])
        values = all_blocks[number].reshape(-1, 3, 3)
        return csr_array(bsr_array((values, column, begin), (3 * self.n, 3 * self.n)).tocsr())


@dataclass(frozen=True, eq=False)
class PairBlocks:
    """A stiffness matrix as 3 x 3 blocks for pairs of vertices, and for single vertices.
    between : (9, p) block of each pair, row by row, N/m. The rows belong to the vertex with the lower number.
    own     : (9, n) symmetric blocks on the diagonal, N/m."""

    pairs: VertexPairs
    between: Floats
    own: Floats

    @classmethod
    def without_shifts(cls, pairs: VertexPairs, between: Floats) -> Self:
        """Return the stiffness from blocks (9, p) of vertex pairs. A translation of all vertices causes no force."""
        low, high = np.ascontiguousarray(pairs.ends.T)
        diagonal = np.empty((3, 3, pairs.n))
        for entry, upper, lower in zip(diagonal.reshape(9, -1), between, _transposed_blocks(between), strict=True):
            entry[:] = -np.bincount(low, upper, pairs.n) - np.bincount(high, lower, pairs.n)
        return cls(pairs, between, ((diagonal + diagonal.transpose(1, 0, 2)) / 2).reshape(9, -1))

    def __add__(self, other: Self) -> Self:
        if self.pairs is not other.pairs:
            raise ValueError("only PairBlocks with the same `pairs` can be added")
        return type(self)(self.pairs, self.between + other.between, self.own + other.own)

    def matrix(self) -> csr_array:
        """Return the stiffness (3 n, 3 n), N/m."""
        return self.pairs.matrix(self)


def _transposed_blocks(blocks: Floats) -> Floats:
    return blocks.reshape(3, 3, -1).transpose(1, 0, 2).reshape(9, -1)


def summed_blocks(u: Floats, v: Floats, pair: Ints, count: int) -> Floats:
    """Return the sums (9, count) of blocks u v^T (3 x 3) for each pair of vertices. u, v : (3, k).
    pair : (k,) number of each block's pair; blocks with the number `count` are left out."""
    return np.stack([np.bincount(pair, u[a] * v[b], count + 1)[:count] for a in range(3) for b in range(3)])


def ascending_pairs(a: Floats, b: Floats, ascending: Bools) -> tuple[Floats, Floats]:
    """Return the arrays a and b (...), with their entries swapped where `ascending` (...) is False."""
    return np.where(ascending, a, b), np.where(ascending, b, a)


def vertex_pairs(surface: Surface, hinge: Ints | None = None) -> VertexPairs:
    """Return the vertex pairs that have a block in the stiffness matrix. hinge : (i, 4) see `hinges`, or None."""
    results, key = derived_results(surface), (VertexPairs, hinge is None)
    if key not in results:
        results[key] = VertexPairs.from_surface(surface, hinge)
    pairs: VertexPairs = results[key]
    return pairs


def matrix_sum(A: csr_array, B: csr_array) -> csr_array:
    """Return the sum of two sparse matrices."""
    if A.shape == B.shape and np.array_equal(A.indptr, B.indptr) and np.array_equal(A.indices, B.indices):
        return csr_array((A.data + B.data, A.indices, A.indptr), shape=A.shape)
    return csr_array(A + B)
