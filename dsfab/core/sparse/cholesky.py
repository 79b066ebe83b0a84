"""Sparse Cholesky factorisation with nested dissection, and functions for memory and threads."""

import ctypes
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv, zherk, ztrsm, ztrsv
from scipy.linalg.lapack import dpotrf, zpotrf
from scipy.sparse import csr_array
from threadpoolctl import ThreadpoolController

from dsfab.core.arrays import Floats, Ints, distinct
from dsfab.core.errors import DsfabError

MEMINFO = Path("/proc/meminfo")


class FactorMemoryError(DsfabError, MemoryError):
    """Error for a factor that does not fit into the memory."""

    @classmethod
    def from_bytes(cls, needed: int | None, free: int | None = None) -> Self:
        """Return an error. Its message states the `needed` and the `free` bytes."""
        unknown = "factorising the stiffness needs more memory than is free"
        words = unknown if needed is None else f"factorising the stiffness needs {needed / 2**30:.1f} GiB of memory"
        free_words = "" if free is None else f"; {free / 2**30:.1f} GiB are free"
        return cls(
            f"{words}{free_words}; use a coarser mesh or simpler elements, close other programs, or install "
            f"dsfab[amg]. Its solver needs a tenth of the memory (constant+hinge elements only)"
        )


def free_memory() -> int | None:
    """Return the bytes of memory that are free without swapping, or None if unknown."""
    if MEMINFO.exists():
        for line in MEMINFO.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def peak_memory() -> int:
    """Return the largest memory of this process so far, bytes; 0 if unknown."""
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)


def require_memory(needed: int) -> None:
    """Raise FactorMemoryError if `needed` bytes exceed the free memory."""
    free = free_memory()
    if free is not None and needed > free:
        raise FactorMemoryError.from_bytes(needed, free)


LITTLE = 20e6  # Largest number of freed bytes that `release_freed_memory` ignores, because a call takes up to 20 ms.


def release_freed_memory(freed: float) -> None:
    """Give memory that Python no longer uses back to the system. freed : approximate number of unused bytes."""
    if freed > LITTLE and (trim := malloc_trim()):
        trim(0)


@cache
def malloc_trim() -> Any:
    """Return glibc's function that gives freed memory back to the system, or None."""
    return getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform.startswith("linux") else None


_BLAS_LOCK = threading.RLock()


@cache
def blas_pools() -> Any:
    """Return the controller of the threads of all BLAS libraries."""
    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread in the `with` block. Only one Python thread at a time can run this block."""
    with _BLAS_LOCK, blas_pools().limit(limits=1, user_api="blas"):
        yield


def dissection_keys(graph: tuple[Ints, Ints], points: Floats, unknowns: int, leaf: int = 192) -> Ints:
    """Return sort keys (n,) of points (n, 3): elimination by ascending key keeps the factor small (nested dissection).
    graph    : first and second point of each pair that the matrix couples, in both directions.
    unknowns : total number of unknowns.    leaf : largest number of unknowns of an undivided part."""
    i, j = graph
    n = len(points)
    key, part, alive = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
    levels = min(30, max(1, int(np.ceil(np.log2(max(unknowns, 2) / leaf)))))
    for level in range(levels):
        members = np.flatnonzero(alive)
        digit = np.zeros(n, dtype=np.int64)
        digit[members] = upper_half(points[members], part[members])
        touching = np.zeros(n, dtype=bool)
        touching[i[digit[i] != digit[j]]] = True
        touched = [np.bincount(part[touching & (digit == half)], minlength=2**level) for half in (0, 1)]
        digit[touching & (digit == (touched[1] < touched[0])[part])] = 2
        alive &= digit != 2
        key += digit * 4 ** (levels - 1 - level)
        part = 2 * part + (digit == 1)
        inside = alive[i] & alive[j] & (part[i] == part[j])
        i, j = i[inside], j[inside]
    return key


def upper_half(points: Floats, part: Ints) -> Ints:
    """Return 1 for points (k, 3) in the upper half of their part, else 0. part : (k,) number of the part."""
    count = np.bincount(part)
    begin = np.cumsum(count) - count
    used = count > 0
    grouped = points[np.argsort(part, kind="stable")]
    extent = np.zeros((len(count), 3))
    extent[used] = np.maximum.reduceat(grouped, begin[used]) - np.minimum.reduceat(grouped, begin[used])
    along = points[np.arange(len(points)), extent.argmax(axis=1)[part]]
    rank = np.empty(len(points), dtype=np.int64)
    rank[np.lexsort((along, part))] = np.arange(len(points)) - np.repeat(begin, count)
    return (2 * rank >= count[part]).astype(np.int64)


def point_graph(K: csr_array, node: Ints, n: int) -> tuple[Ints, Ints]:
    """Return pairs of points that matrix K (N, N) couples, in both directions. node : (N,) point of each unknown."""
    pairs = csr_array((np.ones(K.nnz, dtype=bool), node[K.indices].astype(np.int32), K.indptr), (K.shape[0], n))
    gather = csr_array((np.ones(len(node), dtype=bool), (node, np.arange(len(node)))), (n, len(node)))
    graph = (gather @ pairs).tocoo()
    apart = graph.row != graph.col
    return graph.row[apart], graph.col[apart]


def morton_positions(points: Floats) -> Ints:
    """Return the positions (n,) of points (n, 3) along a space-filling curve [Morton 1966]."""
    low = points.min(axis=0)
    cell = ((points - low) * (1023 / max(float((points - low).max()), np.finfo(float).tiny))).astype(np.int64)
    number = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            number |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return number


Index = npt.NDArray[np.integer[Any]]  # Array of indices of matrix entries, as 4-byte integers if possible.
Numbers = npt.NDArray[Any]  # Real or complex array.


class NotPositiveDefinite(ArithmeticError):  # noqa: N818  (named like LinAlgError)
    """Error for a matrix without a Cholesky factor."""


@dataclass(frozen=True, eq=False)
class Fronts:
    """Plan for the multifrontal Cholesky factorisation of matrices K (N, N) with equal sparsity patterns.
    order    : (N,) unknowns in the order of elimination. The fields below number unknowns in this order.
    start    : (fronts + 1,) first unknown of each front (dense block).
    rows     : for each front, the later unknowns that the front changes, ascending.
    children : for each front, the earlier fronts that update the front.
    entry    : positions in K.data of the entries of the lower triangle, column by column.
    pointer  : (N + 1,) index in `entry` of the first entry of each column."""

    order: Ints
    start: Ints
    rows: list[Ints]
    children: list[list[int]]
    entry: Index
    row: Index
    column: Index
    pointer: Ints

    @classmethod
    def from_matrix(cls, K: csr_array, points: Floats, node: Ints) -> Self:
        """Return the plan for the sparsity pattern of K (N, N). node : (N,) row of `points` for each unknown."""
        used, node = np.unique(node, return_inverse=True)
        points, n, N = points[used], len(used), K.shape[0]
        keys = dissection_keys(point_graph(K, node, n), points, N)
        # along a space-filling curve, neighbours get similar numbers, so updates are added to fronts faster
        sequence = np.lexsort((morton_positions(points), keys))
        rank = np.empty(n, dtype=np.int32)
        rank[sequence] = np.arange(n)
        order = np.argsort(rank[node], kind="stable")
        place = np.empty(N, dtype=np.int32)
        place[order] = np.arange(N)
        row, column = np.repeat(place, np.diff(K.indptr)), place[K.indices]
        entry = np.flatnonzero(row >= column)
        entry = entry[np.argsort(column[entry], kind="stable")].astype(np.int32 if K.nnz < 2**31 else np.int64)
        row, column = row[entry], column[entry]
        pointer = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=N))])
        front_starts = np.concatenate([[0], np.flatnonzero(np.diff(keys[sequence])) + 1, [n]])
        ranks = rank[node[order]]
        touched, children = _touched_points(ranks[row], ranks[column], front_starts)
        unknowns = np.concatenate([[0], np.cumsum(np.bincount(ranks, minlength=n))])
        rows = [_unknowns_of_points(unknowns, touched_set) for touched_set in touched]
        return cls(order, unknowns[front_starts], rows, children, entry, row, column, pointer)

    @property
    def peak(self) -> int:
        """Largest number of floating-point values in memory during the factorisation."""
        stored = waiting = worst = 0
        for k, rows, children in zip(np.diff(self.start).tolist(), self.rows, self.children, strict=True):
            m = len(rows)
            stored += k * (k + m)
            worst = max(worst, stored + waiting + m * m + k * (k + m))
            waiting += m * m - sum(len(self.rows[c]) ** 2 for c in children)
        return worst


def _touched_points(row: Index, column: Index, front_start: Ints) -> tuple[list[Ints], list[list[int]]]:
    """Return the later points that each front changes, and the earlier fronts that update each front.
    row, column : points of each entry of the lower triangle.    front_start : first point of each front."""
    n = int(front_start[-1])
    front = np.repeat(np.arange(len(front_start) - 1), np.diff(front_start))
    outside = front[row] != front[column]
    front_numbers, point = np.divmod(distinct(front[column[outside]] * n + row[outside]), n)
    direct = np.split(point, np.searchsorted(front_numbers, np.arange(1, len(front_start) - 1)))
    touched: list[Ints] = []
    children: list[list[int]] = [[] for _ in direct]
    for s, points in enumerate(direct):
        inherited = [touched[c][np.searchsorted(touched[c], front_start[s + 1]) :] for c in children[s]]
        touched.append(distinct(np.concatenate([points, *inherited])) if inherited else points)
        if len(touched[s]):
            children[front[touched[s][0]]].append(s)
    return touched, children


def _unknowns_of_points(begin: Ints, points: Ints) -> Ints:
    count = begin[points + 1] - begin[points]
    return np.asarray(np.arange(count.sum()) + np.repeat(begin[points] - (np.cumsum(count) - count), count))


class Multifrontal:
    """Factor of a positive definite K: a call with b, (N,) or (N, k), returns K^-1 b. Raises NotPositiveDefinite."""

    def __init__(self, K: csr_array, fronts: Fronts) -> None:
        self._fronts = fronts
        self._factor: list[tuple[Numbers, Numbers]] = []
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Factorise another matrix K (N, N) with the same sparsity pattern. Raises ValueError for a different size."""
        f = self._fronts
        if len(K.data) != 0 and (K.shape[0] != len(f.order) or K.nnz < len(f.entry)):
            raise ValueError("the pattern of the matrix has changed")
        self._factor = []
        waiting: dict[int, Numbers] = {}
        where = np.empty(len(f.order), dtype=np.int64)
        with one_blas_thread():
            for s, rows in enumerate(f.rows):
                a, b, m = f.start[s], f.start[s + 1], len(rows)
                k = b - a
                where[a:b] = np.arange(k)
                where[rows] = np.arange(k, k + m)
                pivot_rows, rest = np.zeros((k, k + m), K.dtype), np.zeros((m, m), K.dtype)
                span = slice(f.pointer[a], f.pointer[b])
                pivot_rows[f.column[span] - a, where[f.row[span]]] = K.data[f.entry[span]]
                for child in f.children[s]:
                    _add_update(pivot_rows, rest, waiting.pop(child), where[f.rows[child]])
                L, P, waiting[s] = _partial_factorisation(pivot_rows, rest)
                self._factor.append((L, P))

    def __call__(self, b: Any) -> Any:
        start, rows = self._fronts.start, self._fronts.rows
        x = np.asarray(b, dtype=self._factor[0][0].dtype)[self._fronts.order]
        with one_blas_thread():
            for s, (L, P) in enumerate(self._factor):
                span = slice(start[s], start[s + 1])
                x[span] = y = _triangular_solve(L, x[span])
                x[rows[s]] -= P @ y
            for s in range(len(self._factor) - 1, -1, -1):
                L, P = self._factor[s]
                span = slice(start[s], start[s + 1])
                x[span] = _triangular_solve(L, x[span] - P.conj().T @ x[rows[s]], adjoint=True)
        solution = np.empty_like(x)
        solution[self._fronts.order] = x
        return solution


def _add_update(pivot_rows: Numbers, rest: Numbers, update: Numbers, positions: Ints) -> None:
    k = len(pivot_rows)
    inner = int(np.searchsorted(positions, k))
    ends = np.flatnonzero((np.diff(positions) != 1) | (positions[1:] == k)) + 1
    for a, b in zip([0, *ends.tolist()], [*ends.tolist(), len(positions)], strict=True):
        if a == b:
            continue
        column, top = int(positions[a]), min(inner, b)
        pivot_rows[positions[:top], column : column + b - a] += update[:top, a:b]
        if b > inner:
            rest[positions[inner:b] - k, column - k : column - k + b - a] += update[inner:b, a:b]


def _partial_factorisation(pivot_rows: Numbers, rest: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    k, is_complex = len(pivot_rows), np.iscomplexobj(pivot_rows)
    potrf, trsm, rank_k = (zpotrf, ztrsm, zherk) if is_complex else (dpotrf, dtrsm, dsyrk)
    if not k:
        return np.zeros((0, 0), pivot_rows.dtype), np.zeros((len(rest), 0), pivot_rows.dtype), rest
    L, info = potrf(np.ascontiguousarray(pivot_rows[:, :k]).T, lower=1, overwrite_a=1)
    if info:
        raise NotPositiveDefinite("a pivot is not positive")
    if not len(rest):
        return L, np.zeros((0, k), pivot_rows.dtype), rest
    P = trsm(1.0, L, np.ascontiguousarray(pivot_rows[:, k:]).T, side=1, lower=1, trans_a=2, overwrite_b=1)
    return L, P, rank_k(-1.0, P, beta=1.0, c=rest.T, lower=1, overwrite_c=1).T


def _triangular_solve(L: Numbers, b: Numbers, adjoint: bool = False) -> Numbers:
    if not len(L):
        return b
    transposed = 2 if adjoint else 0  # BLAS codes for the adjoint and the transposed matrix
    trsv, trsm = (ztrsv, ztrsm) if np.iscomplexobj(L) else (dtrsv, dtrsm)
    solve = trsv(L, b, lower=1, trans=transposed) if b.ndim == 1 else trsm(1.0, L, b, lower=1, trans_a=transposed)
    return np.asarray(solve)
