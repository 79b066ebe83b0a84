"""Factorisation of sparse symmetric positive definite matrices.

`factorise` takes the first of these solvers that it can use:

1. PARDISO (extra `fast`).
2. Multifrontal Cholesky, which works on every machine.
3. Multigrid (extra `amg`), if the factor would exceed the free memory."""

import importlib.util
from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats, Ints
from dsfab.core.sparse import libraries
from dsfab.core.sparse.cholesky import (
    FactorMemoryError,
    Fronts,
    Multifrontal,
    NotPositiveDefinite,
    one_blas_thread,
    peak_memory,
    release_freed_memory,
    require_memory,
)
from dsfab.core.sparse.libraries import Matrix, Multigrid, Pardiso, SuperLU, pardiso_matrix

__all__ = [
    "Factor", "FactorMemoryError", "NotPositiveDefinite", "SamePatternFactors", "SuperLU", "factorise",
    "one_blas_thread", "peak_memory", "release_freed_memory", "solver_name",
]  # fmt: skip

Factor = Pardiso | Multifrontal | SuperLU | Multigrid
"""Factor of a matrix K (N, N): a call with b, (N,) or (N, k), returns K^-1 b; `refactor(K)` takes new values of K."""


def solver_name() -> str:
    """Return the name of the installed solver: 'PARDISO' or 'multifrontal'."""
    return "PARDISO" if importlib.util.find_spec("pypardiso") else "multifrontal"


def factorise(
    K: Matrix, points: Floats, node: Ints | None = None, solver: str | None = None, rigid: Floats | None = None
) -> Factor:
    """Return a function b -> K^-1 b for a positive definite matrix K (N, N).
    K      : the matrix, with all diagonal entries stored, or a function that builds the matrix.
    points : (n, 3) positions of points, which determine the order of elimination.
    node   : (N,) the point of each unknown; default: unknown i is on point i.
    solver : "PARDISO", "multifrontal", "SuperLU" or "multigrid"; default: PARDISO if installed, else multifrontal.
    rigid  : (N, 6) values of the unknowns in six rigid motions, which multigrid needs.
    Raises NotPositiveDefinite, and FactorMemoryError if the factor does not fit into memory."""
    node = np.arange(len(points)) if node is None else node
    build = _BUILDERS[solver or solver_name()]
    try:
        return build(K, points, node, rigid)
    except FactorMemoryError:
        if solver or rigid is None or not libraries.has_pyamg() or np.bincount(node).max() > 3:
            raise
        return Multigrid(pardiso_matrix(K), node, rigid)


class SamePatternFactors:
    """Factors of several matrices, all real or all Hermitian, with the same sparsity pattern."""

    def __init__(self, points: Floats, node: Ints | None = None, many_solves: bool = False) -> None:
        self._points, self._node, self._many_solves = points, node, many_solves
        self._factor: Factor | None = None

    def factor(self, K: csr_array) -> Factor:
        """Return a function b -> K^-1 b for a positive definite K (N, N), valid until the next call.
        Raises the errors of `factorise`, and ValueError if K has a different sparsity pattern than the first matrix."""
        if self._factor is None and self._many_solves and solver_name() == "PARDISO":
            self._factor = Pardiso(K, blocks=False)
        elif self._factor is None:
            self._factor = factorise(K, self._points, self._node)
        else:
            self._factor.refactor(K)
        return self._factor


def _multifrontal(K: Matrix, points: Floats, node: Ints, _rigid: Floats | None) -> Multifrontal:
    K = pardiso_matrix(K)
    fronts = Fronts.from_matrix(K, points, node)
    require_memory(8 * fronts.peak)
    return Multifrontal(K, fronts)


def _multigrid(K: Matrix, _points: Floats, node: Ints, rigid: Floats | None) -> Multigrid:
    if rigid is None:
        raise ValueError("the multigrid solver needs the rigid motions of the structure")
    return Multigrid(pardiso_matrix(K), node, rigid)


_BUILDERS: dict[str, Callable[[Matrix, Floats, Ints, Floats | None], Factor]] = {
    "PARDISO": lambda K, _points, node, _rigid: Pardiso(K, _has_blocks(node)),
    "multifrontal": _multifrontal,
    "SuperLU": lambda K, points, node, _rigid: SuperLU(pardiso_matrix(K), points, node),
    "multigrid": _multigrid,
}


def _has_blocks(node: Ints) -> bool:
    return len(node) > 1.5 * float(np.count_nonzero(np.bincount(node)))
