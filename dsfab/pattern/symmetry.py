"""Symmetric stripes, from means over the symmetric images of each point."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.arrays import Bools, Complexes, Floats, Ints
from dsfab.pattern.frames import Frames, dots

Projection = Callable[[Complexes], Complexes]
"""A function from complex numbers (n,) at the vertices to the nearest field with the symmetry of the surface."""


@dataclass(frozen=True, eq=False)
class Images:
    """Rotations and mirrors of a surface, and the images of its vertices.
    R     : (g, 3, 3) orthogonal matrices, the identity first.
    maps  : g sparse (n, n) matrices; maps[i] @ x interpolates a field x at the images of the vertices.
    faces : (g, m) the face that contains the image of each face's centroid; None if unused."""

    R: Floats
    maps: tuple[csr_array, ...]
    faces: Ints | None = None

    @classmethod
    def identity(cls, n: int) -> Self:
        """Return the images for a surface without symmetry: each of n vertices is the only image of itself."""
        return cls(np.eye(3)[None], (csr_array(eye_array(n)),))

    def mean(self, x: Floats) -> Floats:
        """Return the mean (n, ...) of a field over the symmetric images of each vertex."""
        return np.asarray(sum((T @ x for T in self.maps[1:]), x) / len(self.maps))

    def marked_in_any(self, marked: Bools) -> Bools:
        """Return a mask (m,) of the marked faces and, if the mesh is symmetric, of their symmetric images."""
        exact = all(T.nnz == T.shape[0] for T in self.maps)
        return np.asarray(marked[self.faces].any(axis=0)) if exact and self.faces is not None else marked

    def directions(self, frames: Frames, along: Floats) -> Floats:
        """Return the symmetric unit tangents (n, 3) nearest to the tangents `along` (n, 3). Signs have no meaning."""
        if len(self.maps) == 1:
            return along
        n = len(along)
        products = (along[:, :, None] * along[:, None, :]).reshape(n, 9)  # matrices v v^T, equal for v and -v
        total = np.zeros((n, 3, 3))
        for R, T in zip(self.R, self.maps, strict=True):
            total += R.T @ (T @ products).reshape(n, 3, 3) @ R
        xx = np.einsum("ni,nij,nj->n", frames.t1, total, frames.t1)
        yy = np.einsum("ni,nij,nj->n", frames.t2, total, frames.t2)
        xy = np.einsum("ni,nij,nj->n", frames.t1, total, frames.t2)
        return frames.direction(np.arctan2(2 * xy, xx - yy) / 2)

    def projection(self, V: Floats, g: Floats, density: Floats) -> Projection:
        """Return a function that makes complex phases (n,) symmetric.
        The gradient of the phases at the vertices V (n, 3) is `density` (n,) x g (n, 3)."""
        if len(self.maps) == 1:
            return lambda x: x
        growth = density[:, None] * g
        phase_maps = [self._phase_map(R, T, V, growth) for R, T in zip(self.R[1:], self.maps[1:], strict=True)]
        direct, conjugate = (sum(parts[1:], parts[0]) for parts in zip(*phase_maps, strict=True))
        order = len(self.maps)
        return lambda x: np.asarray((x + direct @ x + conjugate @ x.conj()) / order)

    @staticmethod
    def _phase_map(R: Floats, T: csr_array, V: Floats, growth: Floats) -> tuple[csr_array, csr_array]:
        """Return matrices A, B (n, n): A x + B conj(x) are the complex phases x (n,) at the images of the vertices V.
        growth : (n, 3) gradient of the phase."""
        column = T.indices
        row = np.repeat(np.arange(T.shape[0]), np.diff(T.indptr))
        growth_there, growth_here = growth[row] @ R.T, growth[column]
        turned = dots(growth_there, growth_here) < 0
        sign = np.where(turned, -1.0, 1.0)
        step = (T @ V)[row] - V[column]
        turn = np.pi * dots(growth_here + sign[:, None] * growth_there, step)  # growth of the phase along `step`
        value = T.data * np.exp(1j * turn)
        direct, conjugate = (
            csr_array((value * selected, column, T.indptr), shape=T.shape) for selected in (~turned, turned)
        )
        return direct, csr_array(conjugate.conj())
