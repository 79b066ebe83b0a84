"""Boy's surface, the projective plane immersed in space, cut open to a sheet."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import Length, check_density, ring_faces, ring_turns, shape
from dsfab.surface.shapes.remeshing import remeshed

LOWEST, HIGHEST = -0.4426307, 2.0
"""Heights of the lowest points and of the peak in the formula's own units; the lowest are found numerically."""

SHRINK = 0.9
"""Remeshing for an edge length gives a mean edge this much longer."""


@shape
def boys_surface(height: Length = 3.0, edge: Length = 0.16) -> Surface:
    """The parametrisation of Bryant and Kusner [Kusner 1987] over the unit disc, its peak up, standing on z = 0.

    Opposite points of the unit circle have the same image: joined there, the surface would be closed and one-sided.
    It is left open along that seam, which makes it a disc with two sides. It crosses itself, as the projective plane
    must: three sheets meet in a triple point, and there is no solid of one thickness around it.
    """
    check_density(4 * height**2, edge)
    chart = _Disc(height)
    rows = 24
    counts = np.array([1, *(6 * k for k in range(1, rows + 1))])
    turns = ring_turns(counts)
    angle, radius = 2 * np.pi * np.concatenate(turns), np.repeat(np.arange(rows + 1) / rows, counts)
    X = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return Surface(*remeshed(chart, X, ring_faces(turns), SHRINK * edge))


@dataclass(frozen=True)
class _Disc:
    """The unit disc of the complex plane as coordinates of the surface; its circle is the border."""

    height: float

    def place(self, X: Floats) -> Floats:
        """Points (n, 3), metres."""
        w = X[:, 0] + 1j * X[:, 1]
        a = w**6 + np.sqrt(5) * w**3 - 1
        g = np.stack(
            [
                -1.5 * (w * (1 - w**4) / a).imag,
                -1.5 * (w * (1 + w**4) / a).real,
                ((1 + w**6) / a).imag - 0.5,
            ],
            axis=1,
        )
        P = g / (g**2).sum(axis=1, keepdims=True)
        return np.asarray(self.height * (P * [1, -1, -1] - [0, 0, LOWEST]) / (HIGHEST - LOWEST))

    def moved(self, X: Floats, step: Floats, border: Bools) -> Floats:
        """The step in the disc whose image is nearest to `step`, put back on the circle or inside of it."""
        small = 1e-6
        here = self.place(X)
        J = np.stack([(self.place(X + small * e) - here) / small for e in np.eye(2)], axis=2)
        JT = np.swapaxes(J, 1, 2)
        Y = X + np.linalg.solve(JT @ J, JT @ step[:, :, None])[:, :, 0]
        r = np.maximum(np.linalg.norm(Y, axis=1), 1e-300)
        Y *= np.where(border, 1 / r, np.minimum(1, (1 - 1e-3) / r))[:, None]
        return np.asarray(Y)
