"""Factorisation of sparse symmetric positive definite matrices, the one heavy kernel that statics and modes share.

PARDISO (extra `fast`) where it is installed, else SuperLU on a nested dissection of the points: with SuperLU's own
orderings the same factorisation takes two to four times as long.
"""

import importlib.metadata
import importlib.util
import os
import weakref
from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, triu
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, Ints

LEAF = 48
"""Nested dissection stops at parts of this many points."""


class NotPositiveDefinite(ArithmeticError):  # noqa: N818  (it names the finding, as LinAlgError does)
    """The matrix has no Cholesky factor: for a stiffness, the structure is a mechanism."""


def solver_name() -> str:
    """The back end in use, for reports: 'PARDISO' or 'SuperLU'."""
    return "PARDISO" if importlib.util.find_spec("pypardiso") else "SuperLU"


def factorise(
    K: csr_array, points: Floats, node: Ints | None = None, solver: str | None = None
) -> Callable[[Floats], Floats]:
    """The function b -> K^-1 b for a symmetric positive definite K (N, N).

    points : (n, 3) positions; they only steer the elimination order.
    node   : (N,) the point that each unknown sits on; unknown i on point i when left out.
    solver : "PARDISO" or "SuperLU"; the faster one that is installed when left out.

    Raises NotPositiveDefinite when the factorisation meets a pivot that is not positive.
    """
    if (solver or solver_name()) == "PARDISO":
        return _pardiso(K)
    node = np.arange(K.shape[0]) if node is None else node
    return _superlu(K, np.argsort(_dissection_keys(_point_graph(K, node, len(points)), points)[node], kind="stable"))


def _pardiso(K: csr_array) -> Callable[[Floats], Floats]:
    """MKL PARDISO, type 2 (symmetric positive definite), upper triangle, the factor kept."""
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    os.environ.setdefault("MKL_CBWR", "AUTO")  # bitwise repeatable sums: the same preset gives the same file
    _point_to_mkl()
    upper = csr_array(triu(K, format="csr"))
    upper.sort_indices()
    solver = PyPardisoSolver(mtype=2)

    def call(phase: int, b: Floats) -> Floats:
        solver.set_phase(phase)
        x: Floats = solver._call_pardiso(upper, b)  # the public `solve` hashes the matrix again at every call
        return x

    try:
        call(12, np.zeros((K.shape[0], 1)))
    except PyPardisoError as error:
        raise NotPositiveDefinite(str(error)) from error

    def solve(b: Floats) -> Floats:
        return call(33, np.asfortranarray(b, dtype=np.float64)).reshape(b.shape)

    weakref.finalize(solve, solver.free_memory, everything=True)  # MKL's memory is not Python's
    return solve


def _point_to_mkl() -> None:
    """Tell pypardiso where MKL is: it would search the whole Python installation at every factorisation (0.7 s)."""
    if "PYPARDISO_MKL_RT" in os.environ:
        return
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return  # installed by other means: let pypardiso search
    found = sorted((str(file.locate()) for file in files if "mkl_rt" in file.name), key=len)
    if found and os.path.exists(found[0]):
        os.environ["PYPARDISO_MKL_RT"] = found[0]


def _superlu(K: csr_array, order: Ints) -> Callable[[Floats], Floats]:
    permuted = csc_array(K[order][:, order])
    try:
        lu = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:  # "Factor is exactly singular"
        raise NotPositiveDefinite(str(error)) from error
    if lu.U.diagonal().min() <= 0:
        raise NotPositiveDefinite("a pivot is not positive")

    def solve(b: Floats) -> Floats:
        x = np.empty_like(b, dtype=np.float64)
        x[order] = lu.solve(np.ascontiguousarray(b[order], dtype=np.float64))
        return x

    return solve


def _point_graph(K: csr_array, node: Ints, n: int) -> tuple[Ints, Ints]:
    """Pairs of different points that K couples, each pair in both directions."""
    i, j = (node[index] for index in K.nonzero())
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(n, n)).tocsr()
    row, column = (index.astype(np.int64) for index in graph.nonzero())
    return row[row != column], column[row != column]


def _dissection_keys(graph: tuple[Ints, Ints], points: Floats) -> Ints:
    """(n,) sort keys of a geometric nested dissection [George 1973].

    Each part is halved at the median of its longest axis; the points of the lower half that touch the upper half
    separate the two and are eliminated after both. The choice is one base-4 digit a level (0 lower, 1 upper,
    2 separator), so sorting by the number is eliminating in order; all parts of a level are cut at once.
    """
    i, j = graph
    n = len(points)
    key, part, alive = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
    levels = min(30, max(1, int(np.ceil(np.log2(max(n, 2) / LEAF)))))
    for level in range(levels):
        digit = np.zeros(n, dtype=np.int64)
        members = np.flatnonzero(alive)
        digit[members] = _upper_half(points[members], part[members])
        inside = alive[i] & alive[j] & (part[i] == part[j])
        touching = i[inside & (digit[i] == 0) & (digit[j] == 1)]
        digit[touching] = 2
        alive[touching] = False
        key += digit * 4 ** (levels - 1 - level)
        part = 2 * part + (digit == 1)
    return key


def _upper_half(points: Floats, part: Ints) -> Ints:
    """(k,) 1 for the points above the median of their part along the part's longest axis, else 0."""
    _, label = np.unique(part, return_inverse=True)
    count = np.bincount(label)
    low, high = np.full((len(count), 3), np.inf), np.full((len(count), 3), -np.inf)
    np.minimum.at(low, label, points)
    np.maximum.at(high, label, points)
    along = points[np.arange(len(points)), (high - low).argmax(axis=1)[label]]
    order = np.lexsort((along, label))
    rank = np.empty(len(points), dtype=np.int64)
    rank[order] = np.arange(len(points)) - np.repeat(np.cumsum(count) - count, count)
    return (2 * rank >= count[label]).astype(np.int64)
