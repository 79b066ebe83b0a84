"""Factorisation of sparse symmetric positive definite matrices, the one heavy kernel that statics and modes share.

The ladder, from the first step that can be taken:

1. PARDISO (extra `fast`): the fastest, on all cores.
2. Multifrontal Cholesky over the BLAS that numpy and scipy bring: about PARDISO's time on one core, a quarter of
   SuperLU's, and less memory than SuperLU, which keeps L and U. It works wherever scipy does.
3. Multigrid (extra `amg`) where the factor, whose size the analysis tells, is larger than the free memory. For three
   unknowns a point, and only if the rigid motions are given; slower, and its true residual is checked at each solve.

SuperLU can be asked for by name: its solves with one right-hand side are the quickest for one unknown a point.
"""

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
    give_back,
    one_blas_thread,
    peak_memory,
    require_memory,
)
from dsfab.core.sparse.libraries import ConvergenceError, Matrix, Multigrid, Pardiso, SuperLU, pardiso_matrix

__all__ = [
    "ConvergenceError",
    "Factor",
    "FactorMemoryError",
    "NotPositiveDefinite",
    "OnePattern",
    "SuperLU",
    "factorise",
    "give_back",
    "one_blas_thread",
    "peak_memory",
    "solver_name",
]

Factor = Pardiso | Multifrontal | SuperLU | Multigrid
"""Called with b, (N,) or (N, k), it returns K^-1 b; `refactor(K)` takes new values on the same pattern."""


def solver_name() -> str:
    """The back end in use, for reports: 'PARDISO' or 'multifrontal'."""
    return "PARDISO" if importlib.util.find_spec("pypardiso") else "multifrontal"


def factorise(
    K: Matrix, points: Floats, node: Ints | None = None, solver: str | None = None, rigid: Floats | None = None
) -> Factor:
    """The function b -> K^-1 b for a positive definite K (N, N) with all its diagonal: symmetric, or Hermitian, which
    PARDISO and the multifrontal factor take.

    K      : or a function that makes it, which is called where K is needed: PARDISO then keeps its upper triangle
             alone while it works, which is when most memory is taken.
    points : (n, 3) positions; they only steer the elimination order.
    node   : (N,) the point that each unknown sits on; unknown i on point i when left out.
    solver : "PARDISO", "multifrontal", "SuperLU" or "multigrid"; when left out, the first of the ladder that fits.
    rigid  : (N, 6) rigid motions in the unknowns of K, which multigrid needs.

    Raises NotPositiveDefinite when the factorisation meets a pivot that is not positive, and FactorMemoryError when the
    factor would not fit and multigrid cannot be used.
    """
    node = np.arange(len(points)) if node is None else node
    build = _BUILDERS[solver or solver_name()]
    try:
        return build(K, points, node, rigid)
    except FactorMemoryError:
        if solver or rigid is None or not libraries.has_pyamg() or np.bincount(node).max() > 3:
            raise
        return Multigrid(pardiso_matrix(K), node, rigid)


class OnePattern:
    """Factors of matrices that have one pattern, as those of one mesh have: it is analysed once.

    points, node : see `factorise`.
    many_solves  : whether so much is solved with each factor that PARDISO had better not see points with two unknowns
                   as blocks: solves take three quarters of the time then, factorisations five sixths.
    """

    def __init__(self, points: Floats, node: Ints | None = None, many_solves: bool = False) -> None:
        self._points, self._node, self._many_solves = points, node, many_solves
        self._factor: Factor | None = None

    def factor(self, K: csr_array) -> Factor:
        """The function b -> K^-1 b for a positive definite K (N, N), until the next one is asked for; real or Hermitian
        as the first was.

        Raises what `factorise` raises, and ValueError for another pattern.
        """
        if self._factor is None and self._many_solves and solver_name() == "PARDISO":
            self._factor = Pardiso(K, blocks=False)
        elif self._factor is None:
            self._factor = factorise(K, self._points, self._node)
        else:
            self._factor.refactor(K)
        return self._factor


def _multifrontal(K: Matrix, points: Floats, node: Ints, _rigid: Floats | None) -> Multifrontal:
    K = pardiso_matrix(K)
    fronts = Fronts.of(K, points, node)
    require_memory(8 * fronts.peak)
    return Multifrontal(K, fronts)


def _multigrid(K: Matrix, _points: Floats, node: Ints, rigid: Floats | None) -> Multigrid:
    if rigid is None:
        raise ValueError("multigrid needs the rigid motions")
    return Multigrid(pardiso_matrix(K), node, rigid)


_BUILDERS: dict[str, Callable[[Matrix, Floats, Ints, Floats | None], Factor]] = {
    "PARDISO": lambda K, _points, node, _rigid: Pardiso(K, _blocks(node)),
    "multifrontal": _multifrontal,
    "SuperLU": lambda K, points, node, _rigid: SuperLU(pardiso_matrix(K), points, node),
    "multigrid": _multigrid,
}


def _blocks(node: Ints) -> bool:
    """Whether points have several unknowns each: PARDISO then analyses blocks."""
    return len(node) > 1.5 * float(np.count_nonzero(np.bincount(node)))
