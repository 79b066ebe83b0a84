"""Conjugate gradients with algebraic multigrid (extra `amg`, pyamg): a tenth of a factor's memory, for huge systems."""

import importlib.util
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from dsfab.arrays import Floats, Ints
from dsfab.errors import DsfabError

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
