"""The order in which a sparse matrix over points in space is eliminated: geometric nested dissection [George 1973]."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, Ints

LEAF = 192
"""Parts of at most this many unknowns are not cut further: fronts of one to two hundred unknowns suit BLAS best."""

SMALL_LEAF = 24
"""The same for SuperLU, which finds its own dense blocks: a fifth fewer entries in the factor."""


def dissection_keys(graph: tuple[Ints, Ints], points: Floats, unknowns: int, leaf: int = LEAF) -> Ints:
    """(n,) sort keys of the points; equal keys belong to one part or to one separator.

    graph    : pairs of different points that the matrix couples, each pair in both directions.
    unknowns : how many unknowns all points have together.
    leaf     : parts of at most this many unknowns are not cut further.

    Each part is halved at the median of its longest axis. The points of the one half that touch the other separate the
    two (the half with fewer such points gives them) and are eliminated after both. The choice is one base-4 digit a
    level (0 lower, 1 upper, 2 separator), so that sorting by the number is eliminating in order; all parts of a level
    are cut at once.
    """
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
    """(k,) 1 for the points above the median of their part along the part's longest axis, else 0.

    part : (k,) numbers from 0.
    """
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
    """Pairs of different points that K couples, each pair in both directions.

    node : (N,) the point that each unknown sits on, 0 to n - 1.
    """
    pairs = csr_array((np.ones(K.nnz, dtype=bool), node[K.indices].astype(np.int32), K.indptr), (K.shape[0], n))
    gather = csr_array((np.ones(len(node), dtype=bool), (node, np.arange(len(node)))), (n, len(node)))
    graph = (gather @ pairs).tocoo()
    apart = graph.row != graph.col
    return graph.row[apart], graph.col[apart]


def along_a_curve(points: Floats) -> Ints:
    """(n,) positions on a space-filling curve [Morton 1966], 1024 steps an axis: near points get near numbers."""
    low = points.min(axis=0)
    cell = ((points - low) * (1023 / max(float((points - low).max()), np.finfo(float).tiny))).astype(np.int64)
    number = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            number |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return number
