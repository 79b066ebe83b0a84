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
    FactorMemoryError,
    NotPositiveDefinite,
    dissection_keys,
    morton_positions,
    point_graph,
    release_freed_memory,
    require_memory,
)

SUPERLU_OPTIONS = {"SymmetricMode": True, "Equil": False}


class SuperLU:
    """Factor of a positive definite matrix; a call with b, (N,) or (N, k), returns K^-1 b. Raises NotPositiveDefinite.
    order : (N,) elimination order.    definite : True skips the test that K is positive definite."""

    def __init__(
        self, K: csr_array, points: Floats, node: Ints, order: Ints | None = None, definite: bool = False
    ) -> None:
        self._definite = definite
        self.order = elimination_order(K, points, node) if order is None else order
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Factorise another matrix K (N, N) with the same order of elimination."""
        permuted = csc_array(K[self.order][:, self.order])
        try:
            # panels of 4 columns are 10 % faster than the default
            self._lu = splu(permuted, "NATURAL", diag_pivot_thresh=0.0, panel_size=4, options=SUPERLU_OPTIONS)
        except RuntimeError as error:  # SuperLU: "Factor is exactly singular"
            raise NotPositiveDefinite(str(error)) from error
        if not self._definite and self._lu.U.diagonal().min() <= 0:
            raise NotPositiveDefinite("a pivot is not positive")

    def __call__(self, b: Floats) -> Floats:
        x = np.empty_like(b, dtype=np.float64)
        x[self.order] = self._lu.solve(np.ascontiguousarray(b[self.order], dtype=np.float64))
        return x


def elimination_order(K: csr_array, points: Floats, node: Ints) -> Ints:
    """Return the order (N,) in which to eliminate the unknowns of a matrix K (N, N)."""
    used, node = np.unique(node, return_inverse=True)
    points = points[used]
    keys = dissection_keys(point_graph(K, node, len(used)), points, K.shape[0], leaf=24)
    rank = np.empty(len(used), dtype=np.int64)
    rank[np.lexsort((morton_positions(points), keys))] = np.arange(len(used))
    return np.argsort(rank[node], kind="stable")


ANALYSE, FACTORISE, SOLVE = 11, 22, 33  # PARDISO's numbers for its phases.
SYMMETRIC, HERMITIAN = 2, 4  # PARDISO's numbers for kinds of positive definite matrices.
PARDISO_OPTIONS = {0: 1, 1: 2, 9: 8, 17: -1, 23: 1}
"""Entries of PARDISO's `iparm`, counted from 0. All other entries are 0.
In this order, the entries select: values from the user; nested dissection by METIS; pivots for symmetric matrices; a
count of the factor's entries; the two-level factorisation, which makes solves faster."""
BLOCKS = {36: -100}  # PARDISO's option for points with several unknowns: the analysis groups rows with equal columns.
ALONE = 12_000  # Largest number of unknowns for which PARDISO uses one thread; more threads would be slower.
OUT_OF_MEMORY = (-2, -9)  # PARDISO's codes for lack of memory. Other codes mean a pivot that is not positive.
Matrix = csr_array | Callable[[], csr_array]  # A matrix, or a function that builds a matrix.


def pardiso_matrix(K: Matrix) -> csr_array:
    """Return the matrix K (n, n). If K is a function, call the function to build the matrix."""
    return K() if callable(K) else K


@dataclass(frozen=True, eq=False)
class _Pattern:
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    pointer: NDArray[np.int32]
    column: NDArray[np.int32]
    place: Ints

    @classmethod
    def from_matrix(cls, K: csr_array) -> Self:
        row = np.repeat(np.arange(K.shape[0], dtype=K.indices.dtype), np.diff(K.indptr))
        place = np.flatnonzero(K.indices >= row)
        pointer = np.concatenate([[0], np.cumsum(np.bincount(row[place], minlength=K.shape[0]))]).astype(np.int32)
        triangle = csr_array((place, K.indices[place], pointer), shape=K.shape)
        triangle.sort_indices()
        return cls(K.indptr, K.indices, triangle.indptr, triangle.indices, triangle.data)

    def fits(self, K: csr_array) -> bool:
        return np.array_equal(self.indptr, K.indptr) and np.array_equal(self.indices, K.indices)

    def upper(self, K: csr_array) -> csr_array:
        return csr_array((K.data[self.place], self.column, self.pointer), shape=K.shape)


class Pardiso:
    """Factor of a positive definite matrix; a call with b, (N,) or (N, k), returns K^-1 b.
    blocks : True if K has groups of rows with equal sparsity patterns, such as three rows for each point.
    Raises NotPositiveDefinite, and FactorMemoryError if the factor does not fit."""

    def __init__(self, K: Matrix, blocks: bool = False) -> None:
        os.environ.setdefault("MKL_CBWR", "AUTO")  # repeatable sums, so that equal presets give equal files
        os.environ.setdefault("KMP_BLOCKTIME", "0")  # idle threads sleep at once, to take no time from others
        _set_mkl_path()
        from pypardiso import PyPardisoSolver

        K = pardiso_matrix(K)
        self._solver = PyPardisoSolver(mtype=HERMITIAN if np.iscomplexobj(K) else SYMMETRIC)
        for entry, value in (PARDISO_OPTIONS | (BLOCKS if blocks else {})).items():
            self._solver.set_iparm(entry + 1, value)
        weakref.finalize(self, _release, self._solver)  # Python does not free MKL's memory
        self._threads = 1 if K.shape[0] <= ALONE else int(self._solver.libmkl.MKL_Get_Max_Threads())
        self._upper = _Pattern.from_matrix(K).upper(K)
        self._known: _Pattern | None = None  # only `refactor` sets and uses this pattern
        del K
        nothing = np.zeros((self._upper.shape[0], 1), dtype=self._upper.dtype)
        self._call(ANALYSE, nothing)
        analysis, permanent, work = (1024 * int(self._solver.iparm[k]) for k in (14, 15, 16))
        freed = 700.0 * len(nothing)  # bytes that assembly and analysis have freed: 700 for each unknown
        release_freed_memory(freed)
        require_memory(max(analysis, permanent + work))
        self._call(FACTORISE, nothing)

    def refactor(self, K: csr_array) -> None:
        """Factorise another matrix K (N, N). Raises ValueError if its sparsity pattern is different."""
        if self._known is None or not self._known.fits(K):
            self._known = _Pattern.from_matrix(K)
        upper = self._known.upper(K)
        same_rows = np.array_equal(self._upper.indptr, upper.indptr)
        if not same_rows or not np.array_equal(self._upper.indices, upper.indices):
            raise ValueError("the pattern of the matrix has changed")
        self._upper = upper
        self._call(FACTORISE, np.zeros((K.shape[0], 1), dtype=self._upper.dtype))

    def __call__(self, b: Floats) -> Floats:
        return self._call(SOLVE, np.asfortranarray(b, dtype=self._upper.dtype)).reshape(b.shape)

    def _call(self, phase: int, b: Floats) -> Floats:
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._solver.set_phase(phase)
        # after a two-level factorisation, each solve needs the same number of threads as the factorisation
        before = self._solver.libmkl.MKL_Set_Num_Threads_Local(self._threads)
        try:
            x: Floats = self._solver._call_pardiso(self._upper, b)  # `solve` would hash the matrix, which is slow
        except PyPardisoError as error:
            if error.value in OUT_OF_MEMORY:
                raise FactorMemoryError.from_bytes(None) from error
            raise NotPositiveDefinite(str(error)) from error
        finally:
            self._solver.libmkl.MKL_Set_Num_Threads_Local(before)
        return x


def _set_mkl_path() -> None:
    if "PYPARDISO_MKL_RT" in os.environ:  # the path of MKL is known; pypardiso's own search takes 1 s
        return
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return  # pip did not install MKL, so pypardiso must search for MKL
    paths = sorted((str(file.locate()) for file in files if "mkl_rt" in file.name), key=len)
    if paths and os.path.exists(paths[0]):
        os.environ["PYPARDISO_MKL_RT"] = paths[0]


def _release(solver: Any) -> None:
    from pypardiso.pardiso_wrapper import PyPardisoError

    with suppress(PyPardisoError):
        solver.free_memory(everything=True)


ITERATIONS = 1000  # Maximum number of steps of the multigrid solver.


class ConvergenceError(DsfabError, ArithmeticError):
    """Error for an iteration that stopped too early."""


def has_pyamg() -> bool:
    """Return whether pyamg is installed."""
    return importlib.util.find_spec("pyamg") is not None


class Multigrid:
    """Solver for thin sheets by smoothed aggregation [Vanek, Mandel and Brezina 1996]: a call with b returns K^-1 b.
    b     : (N,) or (N, k).    rigid : (N, 6) values of the unknowns in six rigid motions.
    Raises ConvergenceError if the relative residual exceeds 1e-9."""

    def __init__(self, K: csr_array, node: Ints, rigid: Floats) -> None:
        self._K, self._node, self._rigid = K, node, rigid
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Use a new matrix K (N, N) for the same unknowns at the same points."""
        import pyamg

        self._K = K
        self._place, size = _positions_in_blocks(self._node)
        full = K.tocoo()
        spare = np.setdiff1d(np.arange(size), self._place)  # rows without an unknown get 1 on the diagonal
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
        load = np.zeros(self._levels.levels[0].A.shape[0])
        load[self._place] = b
        state = np.random.get_state()
        x = self._levels.solve(load, tol=1e-12, accel="cg", maxiter=ITERATIONS)[self._place]
        np.random.set_state(state)
        residual, load_norm = float(np.linalg.norm(b - self._K @ x)), float(np.linalg.norm(b))
        accepted = 1e-9  # relative residual
        if residual > accepted * load_norm:
            raise ConvergenceError(
                f"multigrid stopped at a relative residual of {residual / load_norm:.1e} (wanted: {accepted:g}); use "
                "a coarser or more regular mesh, a thicker sheet, or more memory for a direct solver"
            )
        return np.asarray(x)


def _positions_in_blocks(node: Ints) -> tuple[Ints, int]:
    used, point, count = np.unique(node, return_inverse=True, return_counts=True)
    if count.max() > 3:
        raise ValueError("the multigrid solver takes up to three unknowns per point")
    order = np.argsort(point, kind="stable")
    place = np.empty(len(node), dtype=np.int64)
    place[order] = 3 * point[order] + np.arange(len(node)) - np.repeat(np.cumsum(count) - count, count)
    return place, 3 * len(used)
