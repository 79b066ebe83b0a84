"""Tangent frames at vertices, and Laplacians with complex weights."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.core.arrays import Bools, Complexes, Floats, Ints, cross, unit_vectors
from dsfab.core.sparse import SamePatternFactors, one_blas_thread
from dsfab.surface.fields import hat_gradients
from dsfab.surface.mesh import Surface

FEW = 16
"""Limit of the number of vertices on turned edges (see `TwistedFactors.factor`) for the use of `_corrected_solver`.
This method needs one solve for each of these vertices. For more vertices, `_real_factor` is faster."""

Solve = Callable[[Complexes], Complexes]


class TwistedFactors:
    """Solvers for Laplace matrices with a complex weight for each edge, `ends` (e, 2), between vertices V (n, 3)."""

    def __init__(self, V: Floats, ends: Ints) -> None:
        self._V, self._ends, self._one_pattern = V, ends, SamePatternFactors(V)

    def factor(self, coupling: Complexes, diagonal: Floats, turned: Bools | None = None) -> Solve:
        """Return a function b -> x that solves (K + diagonal) x = b and is valid until the next call.
        (K x)_i sums |w| x_i - w x_j over the edges from i to j. In the reverse direction, conj(w) replaces w.
        coupling : (e,) complex weights w.    turned : (e,) edges with w conj(x_j) in place of w x_j."""
        turned = np.zeros(len(coupling), dtype=bool) if turned is None else turned
        across = np.unique(self._ends[turned])
        if len(across) > FEW:
            return self._real_factor(coupling, diagonal, turned)
        solve = self.hermitian(np.where(turned, 0.0, -coupling), self._sizes(coupling) + diagonal)
        if not len(across):
            return solve
        (i, j), (at_i, at_j) = self._ends[turned].T, np.searchsorted(across, self._ends[turned]).T
        W = np.zeros((len(self._V), len(across)), dtype=complex)
        W[i, at_j] = W[j, at_i] = coupling[turned]
        return _corrected_solver(solve, across, W)

    def hermitian(self, coupling: Complexes, diagonal: Floats) -> Solve:
        """Return a function b -> x that solves A x = b for a Hermitian matrix A.
        coupling : (e,) A[i, j] for each edge (i, j).    diagonal : (n,) A[i, i]."""
        solve: Any = self._one_pattern.factor(
            self._complex_pattern.matrix(np.concatenate([coupling, coupling.conj(), diagonal]))
        )
        return lambda b: np.asarray(solve(b))

    def _sizes(self, coupling: Complexes) -> Floats:
        return np.bincount(self._ends.ravel(), np.repeat(np.abs(coupling), 2), len(self._V)).astype(np.float64)

    @cached_property
    def _complex_pattern(self) -> "_EntryPositions":
        n, (i, j) = len(self._V), self._ends.T
        every = np.arange(n)
        return _EntryPositions(np.concatenate([i, j, every]), np.concatenate([j, i, every]), n)

    def _real_factor(self, coupling: Complexes, diagonal: Floats, turned: Bools) -> Solve:
        c, s, sign = coupling.real, coupling.imag, np.where(turned, -1.0, 1.0)
        values = -np.concatenate([c, -sign * s, s, sign * c])
        places, pattern = self._real_pattern
        doubled_diagonal = np.repeat(self._sizes(coupling) + diagonal, 2)
        solve = pattern.factor(places.matrix(np.concatenate([values, values, doubled_diagonal])))
        return lambda b: np.asarray(solve(np.ascontiguousarray(b).view(np.float64)).view(np.complex128))

    @cached_property
    def _real_pattern(self) -> "tuple[_EntryPositions, SamePatternFactors]":
        n = len(self._V)
        i, j = 2 * self._ends.T  # two adjacent rows per complex number
        parts = ((0, 0), (0, 1), (1, 0), (1, 1))
        every = np.arange(2 * n)
        rows = np.concatenate([i + a for a, _ in parts] + [j + b for _, b in parts] + [every])
        columns = np.concatenate([j + b for _, b in parts] + [i + a for a, _ in parts] + [every])
        return _EntryPositions(rows, columns, 2 * n), SamePatternFactors(
            self._V, np.repeat(np.arange(n), 2), many_solves=True
        )


class _EntryPositions:
    """Builds sparse matrices (N, N) with nonzero values in the same places."""

    def __init__(self, rows: Ints, columns: Ints, N: int) -> None:
        place = coo_array((np.arange(1, len(rows) + 1), (rows, columns)), shape=(N, N)).tocsr()
        self._place, self._indices, self._indptr, self._N = place.data - 1, place.indices, place.indptr, N

    def matrix(self, values: Floats | Complexes) -> csr_array:
        return csr_array((values[self._place], self._indices, self._indptr), shape=(self._N, self._N))


def _corrected_solver(solve: Solve, across: Ints, W: Complexes) -> Solve:
    """Return a function b -> x that solves H x - W conj(x[across]) = b. solve : solver b -> x of H x = b."""
    Z = solve(W)
    Z_across, identity = Z[across], np.eye(len(across))
    inverse = np.linalg.inv(
        np.block([[identity - Z_across.real, -Z_across.imag], [-Z_across.imag, identity + Z_across.real]])
    )

    def solve_corrected(b: Complexes) -> Complexes:
        x = solve(b)
        with one_blas_thread():  # for few columns, two threads take a hundred times as long
            real, imaginary = np.split(inverse @ np.concatenate([x[across].real, x[across].imag]), 2)
            return np.asarray(x + Z @ (real - 1j * imaginary))

    return solve_corrected


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames at the vertices of an oriented surface: two tangents and the normal.
    normal, t1, t2 : (n, 3) orthonormal, right-handed.    weight : (e,) cotangent weights, not negative."""

    surface: Surface
    normal: Floats
    t1: Floats
    t2: Floats
    weight: Floats

    @classmethod
    def for_surface(cls, surface: Surface) -> Self:
        """Return the frames of a surface."""
        normal = surface.vertex_normals.copy()
        normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
        axis = np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        t1 = unit_vectors(axis - dots(axis, normal)[:, None] * normal)
        return cls(surface, normal, t1, cross(normal, t1), _cotangents(surface))

    @property
    def ends(self) -> Ints:
        """Vertices (e, 2) of every edge."""
        return self.surface.edges.ends

    @cached_property
    def turning(self) -> Floats:
        """Angle (e,), rad, of a direction in the frame at an edge's first end, minus its angle at the second end."""
        i, j = self.ends.T
        across = cross(self.normal[j], self.normal[i])
        cosine = dots(self.normal[i], self.normal[j])[:, None]
        x = self.t1[j]
        y = x * cosine + cross(across, x) + across * (dots(across, x)[:, None] / (1 + np.maximum(cosine, -0.99)))
        return np.arctan2(dots(y, self.t2[i]), dots(y, self.t1[i]))

    def sides(self, g: Floats, i: Ints, j: Ints) -> Floats:
        """Return 1 (k,) if the tangents g (n, 3) at vertices i and j (k,) make an angle under 90 degrees, else -1."""
        turned = g + 1e-7 * cross(self.normal, g)
        return np.where(dots(g[i], turned[j]) < 0, -1.0, 1.0)

    def direction(self, angle: Floats) -> Floats:
        """Return the unit tangents (n, 3) at an angle (n,), radians, from `t1` towards `t2` at each vertex."""
        return np.cos(angle)[:, None] * self.t1 + np.sin(angle)[:, None] * self.t2

    def coupling(self, turn: Floats) -> Complexes:
        """Return the complex weight w e^{i turn} (e,) of each edge with cotangent weight w. turn : (e,) radians."""
        return np.asarray(self.weight * np.exp(1j * turn))

    @cached_property
    def twisted_factors(self) -> TwistedFactors:
        """Solvers for Laplace matrices with a complex weight for each edge."""
        return TwistedFactors(self.surface.V, self.ends)


def dots(a: Floats, b: Floats) -> Floats:
    """Return scalar products (k,) of a and b (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def corner_sums(surface: Surface, x: Floats) -> Floats:
    """Return the sum (n,) of values x (m, 3) at each vertex. x : a value for each corner of each face."""
    return np.bincount(surface.F.ravel(), x.ravel(), surface.n).astype(np.float64)


def _cotangents(surface: Surface) -> Floats:
    g = hat_gradients(surface)
    after, before = np.roll(g, -1, axis=1), np.roll(g, -2, axis=1)
    opposite = -np.einsum("mci,mci->mc", after, before) * surface.areas[:, None]  # half cotangent at corner c
    per_edge = np.bincount(np.roll(surface.edges.of, -1, axis=1).ravel(), opposite.ravel(), len(surface.edges.ends))
    # obtuse triangles would have negative weights, which reverse phases
    return np.asarray(np.maximum(per_edge, 0.05 * np.median(per_edge)))
