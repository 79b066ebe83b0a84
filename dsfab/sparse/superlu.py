"""SuperLU from scipy, on a nested dissection: its own orderings take two to four times as long."""

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, Ints
from dsfab.sparse.dissection import SMALL_LEAF, along_a_curve, dissection_keys, point_graph
from dsfab.sparse.multifrontal import NotPositiveDefinite

PANEL = 4
"""Columns that are updated together: with one unknown a point a tenth quicker than SuperLU's own choice."""

OPTIONS = {"SymmetricMode": True, "Equil": False}


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
            self._lu = splu(permuted, "NATURAL", diag_pivot_thresh=0.0, panel_size=PANEL, options=OPTIONS)
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
