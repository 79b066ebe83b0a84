"""`TwistedFactors`: factors of twisted Laplacians, whose unknowns are complex numbers at the vertices.

Neighbours are compared after a turn, and on some edges one of them is conjugated first [Knoeppel et al. 2015, eq. 8]:

    x^H K x = sum over edges (i, j) of w |x_i - e^{i turn} x_j|^2,   x_j conjugated on edges that are turned over

Without such edges K is Hermitian: half the work of a real matrix of twice the size. A few of them, between signs that
no choice makes the same around a singular point, are put back afterwards [Woodbury 1950].
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Bools, Complexes, Floats, Ints
from dsfab.sparse import OnePattern, one_blas_thread

FEW = 16
"""So many vertices at edges that are turned over are put back afterwards: each costs a solve more for every factor. At
10 000 points twice as many take as long as the real matrix of twice the size."""

Solve = Callable[[Complexes], Complexes]


class TwistedFactors:
    """Factors of twisted Laplacians on points V (n, 3) and edges (e, 2): they have one pattern, analysed once."""

    def __init__(self, V: Floats, ends: Ints) -> None:
        self._V, self._ends, self._one_pattern = V, ends, OnePattern(V)

    def factor(self, coupling: Complexes, diagonal: Floats, turned: Bools | None = None) -> Solve:
        """b -> (K + diagonal)^-1 b, (n,) complex, until the next factor is asked for.

        coupling : (e,) w e^{i turn}.    diagonal : (n,).    turned : (e,) edges with a conjugate; none if left out.
        """
        turned = np.zeros(len(coupling), dtype=bool) if turned is None else turned
        across = np.unique(self._ends[turned])
        if len(across) > FEW:
            return self._doubled(coupling, diagonal, turned)
        solve = self.hermitian(np.where(turned, 0.0, -coupling), self._sizes(coupling) + diagonal)
        if not len(across):
            return solve
        (i, j), (at_i, at_j) = self._ends[turned].T, np.searchsorted(across, self._ends[turned]).T
        W = np.zeros((len(self._V), len(across)), dtype=complex)
        W[i, at_j] = W[j, at_i] = coupling[turned]
        return _put_back(solve, across, W)

    def hermitian(self, coupling: Complexes, diagonal: Floats) -> Solve:
        """The same for a matrix with coupling (e,) from the second end of each edge to the first, diagonal (n,)."""
        solve: Any = self._one_pattern.factor(self._one.matrix(np.concatenate([coupling, coupling.conj(), diagonal])))
        return lambda b: np.asarray(solve(b))

    def _sizes(self, coupling: Complexes) -> Floats:
        """(n,) the sum of the weights of all edges at each vertex."""
        return np.bincount(self._ends.ravel(), np.repeat(np.abs(coupling), 2), len(self._V)).astype(np.float64)

    @cached_property
    def _one(self) -> "_Places":
        n, (i, j) = len(self._V), self._ends.T
        every = np.arange(n)
        return _Places(np.concatenate([i, j, every]), np.concatenate([j, i, every]), n)

    def _doubled(self, coupling: Complexes, diagonal: Floats, turned: Bools) -> Solve:
        """The same of the real matrix, both parts of each number one after the other: a solver finds blocks of two."""
        c, s, sign = coupling.real, coupling.imag, np.where(turned, -1.0, 1.0)
        values = -np.concatenate([c, -sign * s, s, sign * c])
        places, pattern = self._real
        both = np.repeat(self._sizes(coupling) + diagonal, 2)
        solve = pattern.factor(places.matrix(np.concatenate([values, values, both])))
        return lambda b: np.asarray(solve(np.ascontiguousarray(b).view(np.float64)).view(np.complex128))

    @cached_property
    def _real(self) -> "tuple[_Places, OnePattern]":
        n = len(self._V)
        i, j = 2 * self._ends.T
        parts = ((0, 0), (0, 1), (1, 0), (1, 1))
        every = np.arange(2 * n)
        rows = np.concatenate([i + a for a, _ in parts] + [j + b for _, b in parts] + [every])
        columns = np.concatenate([j + b for _, b in parts] + [i + a for a, _ in parts] + [every])
        return _Places(rows, columns, 2 * n), OnePattern(self._V, np.repeat(np.arange(n), 2), many_solves=True)


class _Places:
    """Where values stand in a sparse matrix (N, N) that are given with rows (k,) and columns (k,) in any order."""

    def __init__(self, rows: Ints, columns: Ints, N: int) -> None:
        place = coo_array((np.arange(1, len(rows) + 1), (rows, columns)), shape=(N, N)).tocsr()
        self._place, self._indices, self._indptr, self._N = place.data - 1, place.indices, place.indptr, N

    def matrix(self, values: Floats | Complexes) -> csr_array:
        """(N, N) of values (k,)."""
        return csr_array((values[self._place], self._indices, self._indptr), shape=(self._N, self._N))


def _put_back(solve: Solve, across: Ints, W: Complexes) -> Solve:
    """b -> x with H x - W conj(x) = b by `solve` for H alone; W (n, s) takes the conjugates at vertices (s,).

    x = H^-1 b + Z conj(x) with Z = H^-1 W: at these vertices 2 s real equations.
    """
    Z = solve(W)
    own, one = Z[across], np.eye(len(across))
    inverse = np.linalg.inv(np.block([[one - own.real, -own.imag], [-own.imag, one + own.real]]))

    def solved(b: Complexes) -> Complexes:
        x = solve(b)
        with one_blas_thread():  # a few columns: two threads took a hundred times as long on a busy machine
            real, imaginary = np.split(inverse @ np.concatenate([x[across].real, x[across].imag]), 2)
            return np.asarray(x + Z @ (real - 1j * imaginary))

    return solved
