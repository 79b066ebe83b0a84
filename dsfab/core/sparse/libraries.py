"""Solvers of other libraries: SuperLU, MKL PARDISO and algebraic multigrid."""

import importlib.metadata
import importlib.util
import os
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import splu

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.core.sparse.cholesky import (
    SMALL_LEAF,
    FactorMemoryError,
    NotPositiveDefinite,
    along_a_curve,
    dissection_keys,
    give_back,
    point_graph,
    require_memory,
)

PANEL = 4
"""Columns that are updated together: with one unknown a point a tenth quicker than SuperLU's own choice."""

SUPERLU_OPTIONS = {"SymmetricMode": True, "Equil": False}


class SuperLU:
    """The factor of a symmetric positive definite matrix; called with b, (N,) or (N, k), it returns K^-1 b.

    order    : (N,) in which the unknowns are eliminated, from another matrix of the same pattern.
    definite : K is known to be positive definite: reading the pivots costs a tenth of the factorisation.

    Raises NotPositiveDefinite when a pivot is not positive.
    """

    def __init__(
        self, K: csr_array, points: Floats, node: Ints, order: Ints | None = None, definite: bool = False
    ) -> None:
        self._definite = definite
        self.order = elimination_order(K, points, node) if order is None else order
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Take the values of K (n, n); the order of elimination stays."""
        permuted = csc_array(K[self.order][:, self.order])
        try:
            self._lu = splu(permuted, "NATURAL", diag_pivot_thresh=0.0, panel_size=PANEL, options=SUPERLU_OPTIONS)
        except RuntimeError as error:  # "Factor is exactly singular"
            raise NotPositiveDefinite(str(error)) from error
        if not self._definite and self._lu.U.diagonal().min() <= 0:
            raise NotPositiveDefinite("a pivot is not positive")

    def __call__(self, b: Floats) -> Floats:
        x = np.empty_like(b, dtype=np.float64)
        x[self.order] = self._lu.solve(np.ascontiguousarray(b[self.order], dtype=np.float64))
        return x


def elimination_order(K: csr_array, points: Floats, node: Ints) -> Ints:
    """(N,) the unknowns of K (N, N) in the order of a nested dissection of their points; equal parts along a curve."""
    used, node = np.unique(node, return_inverse=True)
    points = points[used]
    keys = dissection_keys(point_graph(K, node, len(used)), points, K.shape[0], SMALL_LEAF)
    rank = np.empty(len(used), dtype=np.int64)
    rank[np.lexsort((along_a_curve(points), keys))] = np.arange(len(used))
    return np.argsort(rank[node], kind="stable")


ANALYSE, FACTORISE, SOLVE = 11, 22, 33
"""Phases, in PARDISO's numbers."""

SYMMETRIC, HERMITIAN = 2, 4
"""Kinds of positive definite matrices, in PARDISO's numbers."""

PARDISO_OPTIONS = {0: 1, 1: 2, 9: 8, 17: -1, 23: 1}
"""Entries of PARDISO's `iparm`, counted from 0: own choices; nested dissection by METIS; pivots as for symmetric
matrices; count the factor's entries; the two-level factorisation, whose factor solves in 40 % of the time with one
unknown a point (with three nothing changes). All others are 0: above all no refinement at each solve (entry 7), which
would triple its time; whoever needs more digits refines with longer numbers."""

BLOCKS = {36: -100}
"""The same where points have several unknowns: rows of one structure are analysed as one. With three unknowns a point
the analysis takes a third of the memory and of the time, which is worth more than the few percent that the
factorisation then takes longer."""

ALONE = 12_000
"""Unknowns up to which one thread does it: with two, solves of 10 000 took twice the time on the clock and three times
that of the processor, and factorisations as long. The answer is then the same on any number of cores."""

PREPARED = 700.0
"""Bytes for each unknown that making the matrix and its analysis leave."""

OUT_OF_MEMORY = (-2, -9)
"""PARDISO's errors for want of memory; every other one of the factorisation means a pivot that is not positive."""


Matrix = csr_array | Callable[[], csr_array]
"""A matrix, or what makes it: for those who need it for a moment only."""


def pardiso_matrix(K: Matrix) -> csr_array:
    """The matrix (n, n) itself."""
    return K() if callable(K) else K


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Where a symmetric matrix (n, n) has entries, and which of these are its upper triangle.

    indptr, indices : of the matrix.    pointer, column : of the upper triangle.    place : its entries among all.
    """

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    pointer: NDArray[np.int32]
    column: NDArray[np.int32]
    place: Ints

    @classmethod
    def of(cls, K: csr_array) -> Self:
        row = np.repeat(np.arange(K.shape[0], dtype=K.indices.dtype), np.diff(K.indptr))
        place = np.flatnonzero(K.indices >= row)
        pointer = np.concatenate([[0], np.cumsum(np.bincount(row[place], minlength=K.shape[0]))]).astype(np.int32)
        found = csr_array((place, K.indices[place], pointer), shape=K.shape)
        found.sort_indices()
        return cls(K.indptr, K.indices, found.indptr, found.indices, found.data)

    def fits(self, K: csr_array) -> bool:
        """Whether a matrix has entries in the same places."""
        return np.array_equal(self.indptr, K.indptr) and np.array_equal(self.indices, K.indices)

    def upper(self, K: csr_array) -> csr_array:
        """The upper triangle of a matrix that it fits."""
        return csr_array((K.data[self.place], self.column, self.pointer), shape=K.shape)


class Pardiso:
    """The factor of a positive definite matrix, real or Hermitian; called with b, (N,) or (N, k), it returns K^-1 b.

    K      : see `dsfab.core.sparse.factorise`.
    blocks : whether unknowns come in groups with rows of one structure.

    Raises NotPositiveDefinite when a pivot is not positive, FactorMemoryError when the factor would not fit.
    """

    def __init__(self, K: Matrix, blocks: bool = False) -> None:
        os.environ.setdefault("MKL_CBWR", "AUTO")  # bitwise repeatable sums: the same preset gives the same file
        # a thread that waits for work sleeps: on a shared machine it would take the time of those who have some
        os.environ.setdefault("KMP_BLOCKTIME", "0")
        _point_to_mkl()
        from pypardiso import PyPardisoSolver

        K = pardiso_matrix(K)
        self._solver = PyPardisoSolver(mtype=HERMITIAN if np.iscomplexobj(K) else SYMMETRIC)
        for entry, value in (PARDISO_OPTIONS | (BLOCKS if blocks else {})).items():
            self._solver.set_iparm(entry + 1, value)
        weakref.finalize(self, _release, self._solver)  # MKL's memory is not Python's
        self._threads = 1 if K.shape[0] <= ALONE else int(self._solver.libmkl.MKL_Get_Max_Threads())
        self._upper = _Pattern.of(K).upper(K)
        self._known: _Pattern | None = None  # it takes memory that one factor alone can do without
        del K
        nothing = np.zeros((self._upper.shape[0], 1), dtype=self._upper.dtype)
        self._call(ANALYSE, nothing)
        analysis, kept, work = (1024 * int(self._solver.iparm[k]) for k in (14, 15, 16))
        give_back(PREPARED * len(nothing))  # what made the matrix, before the factor takes the most of all
        require_memory(max(analysis, kept + work))
        self._call(FACTORISE, nothing)

    def refactor(self, K: csr_array) -> None:
        """Take the values of K (n, n), whose pattern must be that of the matrix analysed."""
        if self._known is None or not self._known.fits(K):
            self._known = _Pattern.of(K)
        taken = self._known.upper(K)
        same = np.array_equal(self._upper.indptr, taken.indptr)
        if not same or not np.array_equal(self._upper.indices, taken.indices):
            raise ValueError("the pattern of the matrix has changed")
        self._upper = taken
        self._call(FACTORISE, np.zeros((K.shape[0], 1), dtype=self._upper.dtype))

    def __call__(self, b: Floats) -> Floats:
        return self._call(SOLVE, np.asfortranarray(b, dtype=self._upper.dtype)).reshape(b.shape)

    def _call(self, phase: int, b: Floats) -> Floats:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._solver.set_phase(phase)
        # the two-level factor is laid out for its threads: solved with another number of them, the answer is wrong
        before = self._solver.libmkl.MKL_Set_Num_Threads_Local(self._threads)
        try:
            x: Floats = self._solver._call_pardiso(self._upper, b)  # `solve` would hash the matrix at every call
        except PyPardisoError as error:
            if error.value in OUT_OF_MEMORY:
                raise FactorMemoryError.of(None) from error
            raise NotPositiveDefinite(str(error)) from error
        finally:
            self._solver.libmkl.MKL_Set_Num_Threads_Local(before)
        return x


def _point_to_mkl() -> None:
    """Tell pypardiso where MKL is, before its import: it would search the whole Python installation (0.5 to 1 s)."""
    if "PYPARDISO_MKL_RT" in os.environ:
        return
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return  # installed by other means: let pypardiso search
    found = sorted((str(file.locate()) for file in files if "mkl_rt" in file.name), key=len)
    if found and os.path.exists(found[0]):
        os.environ["PYPARDISO_MKL_RT"] = found[0]


def _release(solver: Any) -> None:
    """Give all its memory back. PARDISO refuses where Ctrl-C came between its phases: nobody could act on that."""
    from pypardiso.pardiso_wrapper import PyPardisoError

    with suppress(PyPardisoError):
        solver.free_memory(everything=True)


TOLERANCE = 1e-12
"""Relative residual that the iteration aims at."""

REACHED = 1e-9
"""Relative residual, computed anew from the answer, above which the answer is refused."""

ITERATIONS = 1000


class ConvergenceError(DsfabError, ArithmeticError):
    """The iteration stopped short of the wanted residual."""


def has_pyamg() -> bool:
    """Whether pyamg can be used."""
    return importlib.util.find_spec("pyamg") is not None


class Multigrid:
    """A solver for the stiffness of thin sheets with up to three unknowns a point; called with b it returns K^-1 b.

    Smoothed aggregation [Vanek, Mandel and Brezina 1996] told everything it can use: points as blocks of three, the
    rigid motions, strength 0, energy-smoothed prolongation, symmetric block Gauss-Seidel. Without these it needs
    hundreds of steps or diverges on irregular sheets, hence the true residual is computed after every solve.

    rigid : (N, 6) the rigid motions in the unknowns of K, which K nearly annihilates away from supports.

    Raises ConvergenceError at a solve whose true residual is above `REACHED`.
    """

    def __init__(self, K: csr_array, node: Ints, rigid: Floats) -> None:
        self._K, self._node, self._rigid = K, node, rigid
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Take the values of K, (N, N) on the same points."""
        import pyamg

        self._K = K
        self._place, size = _in_threes(self._node)
        full = K.tocoo()
        spare = np.setdiff1d(np.arange(size), self._place)  # held unknowns: a unit diagonal, so that blocks are whole
        blocks = coo_array(
            (
                np.concatenate([full.data, np.ones(len(spare))]),
                (np.concatenate([self._place[full.row], spare]), np.concatenate([self._place[full.col], spare])),
            ),
            shape=(size, size),
        ).tobsr((3, 3))
        near_null = np.zeros((size, 6))
        near_null[self._place] = self._rigid
        smoother = ("block_gauss_seidel", {"sweep": "symmetric", "iterations": 2})
        self._levels: Any = pyamg.smoothed_aggregation_solver(
            blocks,
            B=near_null,
            symmetry="symmetric",
            strength=("symmetric", {"theta": 0.0}),
            smooth="energy",
            presmoother=smoother,
            postsmoother=smoother,
            max_coarse=300,
        )

    def __call__(self, b: Floats) -> Floats:
        if b.ndim == 2:
            return np.stack([self(column) for column in b.T], axis=1)
        wanted = np.zeros(self._levels.levels[0].A.shape[0])
        wanted[self._place] = b
        state = np.random.get_state()
        x = self._levels.solve(wanted, tol=TOLERANCE, accel="cg", maxiter=ITERATIONS)[self._place]
        np.random.set_state(state)
        off, whole = float(np.linalg.norm(b - self._K @ x)), float(np.linalg.norm(b))
        if off > REACHED * whole:
            raise ConvergenceError(
                f"the multigrid solver stopped at a relative residual of {off / whole:.1e} (wanted: {REACHED:g}); "
                "use a coarser or more regular mesh, a thicker sheet, or a machine with more memory for a direct solver"
            )
        return np.asarray(x)


def _in_threes(node: Ints) -> tuple[Ints, int]:
    """(N,) places of the unknowns when every used point has three, and how many places there are."""
    used, at, count = np.unique(node, return_inverse=True, return_counts=True)
    if count.max() > 3:
        raise ValueError("multigrid takes up to three unknowns a point")
    order = np.argsort(at, kind="stable")
    place = np.empty(len(node), dtype=np.int64)
    place[order] = 3 * at[order] + np.arange(len(node)) - np.repeat(np.cumsum(count) - count, count)
    return place, 3 * len(used)
