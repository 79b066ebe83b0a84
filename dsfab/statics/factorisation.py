"""Factorisation of stiffness matrices, and iterative refinement of solutions."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, Self

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import StaticsError
from dsfab.core.sparse import NotPositiveDefinite, factorise
from dsfab.statics.boundary_conditions import rigid_motions
from dsfab.surface.mesh import Surface

ACCURATE = 1e-9
"""A solution with a larger relative residual is refined. This limit is a tenth of the limit `REPORTED_RESIDUAL`."""

REFINEMENTS = 6  # Largest number of refinement steps; two or three usually suffice.
ROWS = 1 << 16
"""Number of matrix rows that are multiplied at a time in high precision, which saves memory."""


class LinearMap(Protocol):
    """A matrix that multiplies vectors."""

    def __matmul__(self, x: Any, /) -> Any: ...

    def astype(self, dtype: Any, /) -> Any: ...


@dataclass(frozen=True, eq=False)
class ScaledStiffness:
    """The matrix diag(scale) K diag(scale), restricted to the unknowns with the indices `free`."""

    K: csr_array
    free: Ints
    scale: Floats
    dtype: Any = np.float64

    def __matmul__(self, x: Floats) -> Floats:
        scale = self.scale if x.ndim == 1 else self.scale[:, None]
        full = np.zeros((self.K.shape[0], *x.shape[1:]), dtype=x.dtype)
        full[self.free] = scale * x
        return np.asarray(scale * self._product(full)[self.free])

    def _product(self, x: Floats) -> Floats:
        if self.dtype == self.K.dtype:
            return np.asarray(self.K @ x)
        starts = range(0, self.K.shape[0], ROWS)
        return np.concatenate([self.K[i : i + ROWS].astype(self.dtype) @ x for i in starts])

    def astype(self, dtype: Any) -> Self:
        """Return a copy of this matrix with numbers of type `dtype`."""
        return type(self)(self.K, self.free, self.scale.astype(dtype), dtype)


@dataclass(frozen=True, eq=False)
class Factor:
    """A factorised stiffness matrix K of all unknowns. free : (N,) indices of the unknowns that can move.
    scale : (N,) 1 / square root of the diagonal of K.    solve : solves the scaled equations."""

    K: csr_array
    free: Ints
    scale: Floats
    solve: Callable[[Floats], Floats]

    @property
    def map(self) -> ScaledStiffness:
        """Stiffness matrix (N, N) of the free unknowns, scaled so that its diagonal is 1."""
        return ScaledStiffness(self.K, self.free, self.scale)

    def displacements(self, forces: Floats) -> Floats:
        """Return the displacements K^-1 F (u, k) for k load vectors F (u, k); 0 for unknowns that cannot move."""
        x, scale = np.zeros(forces.shape), self.scale[:, None]
        x[self.free] = scale * self.solve(scale * forces[self.free])
        return x


def stiffness_factor(surface: Surface, K: csr_array, is_held: Bools) -> Factor:
    """Factorise the stiffness matrix K (u, u). is_held : (u,) True for unknowns that cannot move.
    Raises StaticsError if the matrix is not positive definite."""
    diagonal = K.diagonal()
    free = np.flatnonzero(~is_held & (diagonal > 0))
    # Jacobi scaling: the membrane stiffness is about (size / thickness)^2 times the bending stiffness
    scale = 1 / np.sqrt(diagonal[free])
    points = np.concatenate([surface.V, surface.V[surface.edges.ends].mean(axis=1)])
    node = np.where(free < 3 * surface.n, free // 3, surface.n + (free - 3 * surface.n) % len(surface.edges.ends))
    rigid = None
    if K.shape[0] == 3 * surface.n:
        rigid = rigid_motions(surface.V).reshape(-1, 6)[free] / scale[:, None]
    try:
        # `factorise` makes the restricted matrix, and frees it before the factor takes memory
        return Factor(K, free, scale, factorise(partial(_restriction, K, free, scale), points, node, rigid=rigid))
    except NotPositiveDefinite as error:
        raise StaticsError(
            "the sheet is a mechanism: parts of it meet in single points or are not supported; "
            "check the mesh with `dsfab inspect`, and hold more directions at the supports"
        ) from error


FactorFunction = Callable[[Surface, csr_array, Bools], Factor]


class FactorCache:
    """A function that factorises stiffness matrices, and caches the last `count` factorisations."""

    def __init__(self, count: int = 1) -> None:
        self._kept: list[tuple[csr_array, Bools, Factor]] = []
        self._count = count

    def __call__(self, surface: Surface, K: csr_array, is_held: Bools) -> Factor:
        for matrix, earlier_held, factor in self._kept:
            if _equal_matrices(matrix, K) and np.array_equal(earlier_held, is_held):
                return factor
        del self._kept[: len(self._kept) + 1 - self._count]  # frees memory before the next factor is computed
        self._kept.append((K, is_held.copy(), stiffness_factor(surface, K, is_held)))
        return self._kept[-1][2]


def _equal_matrices(A: csr_array, B: csr_array) -> bool:
    pairs = ((A.indptr, B.indptr), (A.indices, B.indices), (A.data, B.data))
    return A is B or all(np.array_equal(a, b) for a, b in pairs)


def _restriction(K: csr_array, free: Ints, scale: Floats) -> csr_array:
    inner = csr_array(K[free][:, free])
    inner.data *= np.repeat(scale, np.diff(inner.indptr))
    inner.data *= scale[inner.indices]
    return inner


def refined_solution(K: LinearMap, b: Floats, solve: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """Solve K x = b, b (N,) or (N, k), with iterative refinement [Wilkinson 1963]. Return x, and the relative residual
    of each column in the energy norm. solve : applies an approximate inverse of K."""
    x = solve(b)
    r = b - K @ x
    error = _energy_share(r, solve(r), b, x)
    if not (error > ACCURATE).any():
        return x, error
    long = K.astype(np.longdouble)
    r = (b - long @ x).astype(np.float64)
    step = solve(r)
    error = _energy_share(r, step, b, x)
    for _ in range(REFINEMENTS):
        refined = (x.astype(np.longdouble) + step).astype(np.float64)
        r = (b - long @ refined).astype(np.float64)
        step = solve(r)
        next_error = _energy_share(r, step, b, refined)
        if not next_error.max() < error.max():
            break
        slow, x, error = next_error.max() > error.max() / 2, refined, next_error
        if slow or error.max() <= ACCURATE:
            break
    return x, error


def _energy_share(r: Floats, step: Floats, b: Floats, x: Floats) -> Floats:
    """Return the relative residual of each column of x in the energy norm. r : b - K x.    step : K^-1 r."""
    energy = np.sum(b * x, axis=0)
    share = np.abs(np.sum(r * step, axis=0)) / np.where(energy > 0, energy, np.inf)
    return np.asarray(np.sqrt(share))
