"""`Images`: what makes stripes symmetric: directions, densities and phases averaged over the images of each point."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.arrays import Bools, Complexes, Floats, Ints
from dsfab.pattern.frames import Frames, dots

Projection = Callable[[Complexes], Complexes]
"""Takes complex numbers (n,) at the vertices to the nearest field of them that is symmetric."""


@dataclass(frozen=True, eq=False)
class Images:
    """A group of rotations and mirrors of a surface, and where they take its vertices.

    R     : (g, 3, 3) orthogonal, the first the identity.
    maps  : g sparse (n, n); maps[i] @ x reads a field x at the images of the vertices.
    faces : (g, m) the face that the image of each face's centroid lies on; None: not needed.
    """

    R: Floats
    maps: tuple[csr_array, ...]
    faces: Ints | None = None

    @classmethod
    def none(cls, n: int) -> Self:
        """Of a surface without symmetry: each of n vertices is its only image."""
        return cls(np.eye(3)[None], (csr_array(eye_array(n)),))

    def mean(self, x: Floats) -> Floats:
        """A field (n, ...) averaged over the images of each point."""
        return np.asarray(sum((T @ x for T in self.maps[1:]), x) / len(self.maps))

    def of_any(self, marked: Bools) -> Bools:
        """(m,) faces of which an image is marked: a singular point at a vertex lies in one of its faces by chance.

        On a mesh that is less symmetric than its surface images of faces are no faces, and marks stay as they are.
        """
        exact = all(T.nnz == T.shape[0] for T in self.maps)
        return np.asarray(marked[self.faces].any(axis=0)) if exact and self.faces is not None else marked

    def directions(self, frames: Frames, along: Floats) -> Floats:
        """(n, 3) unit tangents, up to sign, of the field that is nearest to such tangents and the same at all images.

        A line is told by the products of its coordinates, v v^T, which signs leave alone; they are averaged.
        """
        if len(self.maps) == 1:
            return along
        n = len(along)
        products = (along[:, :, None] * along[:, None, :]).reshape(n, 9)
        total = np.zeros((n, 3, 3))
        for R, T in zip(self.R, self.maps, strict=True):
            total += R.T @ (T @ products).reshape(n, 3, 3) @ R
        xx = np.einsum("ni,nij,nj->n", frames.t1, total, frames.t1)
        yy = np.einsum("ni,nij,nj->n", frames.t2, total, frames.t2)
        xy = np.einsum("ni,nij,nj->n", frames.t1, total, frames.t2)
        return frames.direction(np.arctan2(2 * xy, xx - yy) / 2)

    def projection(self, V: Floats, g: Floats, density: Floats) -> Projection:
        """Of phases at vertices V (n, 3) that grow along g (n, 3) by so many periods per metre, density (n,): an image
        that sees g turned over has the conjugate.

        Where the image of a vertex lies between others, their phases are carried to it before they are averaged: they
        are turned by what a phase grows by in between, or where few edges make a period the mean of them would lag.
        """
        if len(self.maps) == 1:
            return lambda x: x
        growth = density[:, None] * g
        own = [self._phase_map(R, T, V, growth) for R, T in zip(self.R[1:], self.maps[1:], strict=True)]
        same, turned = (sum(parts[1:], parts[0]) for parts in zip(*own, strict=True))
        order = len(self.maps)
        return lambda x: np.asarray((x + same @ x + turned @ x.conj()) / order)

    @staticmethod
    def _phase_map(R: Floats, T: csr_array, V: Floats, growth: Floats) -> tuple[csr_array, csr_array]:
        """(n, n) each: what images take of phases, and of their conjugates; growth (n, 3) is the gradient of the phase,
        up to sign, periods per metre."""
        column = T.indices
        row = np.repeat(np.arange(T.shape[0]), np.diff(T.indptr))
        there, here = growth[row] @ R.T, growth[column]
        turned = dots(there, here) < 0
        sign = np.where(turned, -1.0, 1.0)
        step = (T @ V)[row] - V[column]
        turn = np.pi * dots(here + sign[:, None] * there, step)  # of the mean growth of both ends
        value = T.data * np.exp(1j * turn)
        same, other = (csr_array((value * of, column, T.indptr), shape=T.shape) for of in (~turned, turned))
        return same, csr_array(other.conj())
