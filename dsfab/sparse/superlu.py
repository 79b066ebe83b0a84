"""SuperLU from scipy, on a nested dissection: its own orderings take two to four times as long."""

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, Ints
from dsfab.sparse.dissection import dissection_keys, point_graph
from dsfab.sparse.multifrontal import NotPositiveDefinite


class SuperLU:
    """The factor of a symmetric positive definite matrix; called with b, (N,) or (N, k), it returns K^-1 b.

    Raises NotPositiveDefinite when a pivot is not positive.
    """

    def __init__(self, K: csr_array, points: Floats, node: Ints) -> None:
        used, node = np.unique(node, return_inverse=True)
        keys = dissection_keys(point_graph(K, node, len(used)), points[used], K.shape[0])
        self._order = np.argsort(keys[node], kind="stable")
        self.refactor(K)

    def refactor(self, K: csr_array) -> None:
        """Take the values of K; the order of elimination stays."""
        permuted = csc_array(K[self._order][:, self._order])
        try:
            self._lu = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:  # "Factor is exactly singular"
            raise NotPositiveDefinite(str(error)) from error
        if self._lu.U.diagonal().min() <= 0:
            raise NotPositiveDefinite("a pivot is not positive")

    def __call__(self, b: Floats) -> Floats:
        x = np.empty_like(b, dtype=np.float64)
        x[self._order] = self._lu.solve(np.ascontiguousarray(b[self._order], dtype=np.float64))
        return x
