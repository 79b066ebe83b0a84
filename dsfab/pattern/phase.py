"""The phase of evenly spaced stripes: a complex number at every vertex whose angle grows by 2 pi from stripe to stripe.

Stripes have no front: where the direction field is carried around a singular point it comes back reversed, and with it
the phase becomes its conjugate. So phases are values up to sign and whole periods [Knoeppel et al. 2015].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.arrays import Bools, Floats
from dsfab.pattern.frames import Frames, dots, twisted_laplacian
from dsfab.pattern.images import Projection
from dsfab.sparse import factorise

SHIFT = 1e-3
"""Of the inverse iteration, over the squared spacing: makes the matrix definite and changes no eigenvector."""
STEPS = 20
"""Inverse iterations: the lowest eigenvectors differ little from each other, and any of them will do."""
FLOWS = 10
"""Rounds of diffusion and normalisation, in which pairs of dislocations find each other and vanish."""
FLOW = 0.25
"""Length of a round: 1 / tau, tau = this share of (2 pi / spacing)^2."""
EXACT = 0.05
"""Locked phases that are off by less, in periods, are not off at all: the edge of a surface gets a straight member."""
LOCK = 3.0
"""Weight of a locked phase, over (2 pi / spacing)^2."""


@dataclass(frozen=True, eq=False)
class Flow:
    """What the phase of a family follows.

    g       : (n, 3) unit direction of its gradient at the vertices, up to sign.
    density : (n,) periods per metre.
    """

    frames: Frames
    g: Floats
    density: Floats

    @cached_property
    def sign(self) -> Floats:
        """(e,) 1 where g points the same way at both ends of an edge, -1 where it is turned over."""
        i, j = self.frames.ends.T
        return self.frames.sides(self.g, i, j)

    @cached_property
    def turn(self) -> Floats:
        """(e,) periods that the phase grows by from the first end of an edge to the second, as the first sees it."""
        i, j = self.frames.ends.T
        step = self.frames.surface.V[j] - self.frames.surface.V[i]
        mean = self.density[i, None] * self.g[i] + (self.sign * self.density[j])[:, None] * self.g[j]
        return dots(mean, step) / 2

    def solve(self, start: Floats, lock: Bools, projection: Projection | None = None, free: bool = False) -> Floats:
        """(n,) phases at the vertices, in periods, -1/2 to 1/2, each in the sign that g has at its vertex.

        Minimised is the sum over the edges of w |psi_j - e^{2 pi i turn} psi_i|^2, psi_i conjugated where g turns over:
        first over all psi of one size, then, by diffusion and normalisation in turns, over all of size 1 everywhere
        [Merriman, Bence, Osher 1992; on phases Viertel, Osting 2019].

        start : (n,) where the iteration begins; a line is drawn through its peak, as far as nothing else decides.
        lock  : (n,) vertices through which the middle of a stripe should run.
        free  : begin without them: from where they are the first phases may meet out of step in between.
        """
        surface, n = self.frames.surface, self.frames.surface.n
        points, node = surface.V, np.tile(np.arange(n), 2)
        mass = np.tile(np.maximum(surface.vertex_areas, 1e-12 * surface.area), 2)
        inverse_square = float(surface.vertex_areas @ self.density / surface.area) ** 2
        wave = 4 * np.pi**2 * inverse_square
        A = twisted_laplacian(n, self.frames.ends, self.frames.weight, -2 * np.pi * self.turn, self.sign)
        project = projection or (lambda x: x)
        held = LOCK * wave * mass * np.tile(lock, 2)
        target = held * np.repeat([1.0, 0.0], n)
        from_lock = bool(lock.any()) and not free
        solve = factorise(_shifted(A, SHIFT * inverse_square * mass + (held if from_lock else 0.0)), points, node)
        if from_lock:
            x = project(solve(target))
        else:
            x = np.concatenate([start, np.zeros(n)])
            for _ in range(STEPS):
                x = project(solve(mass * x))
                x /= np.sqrt(x @ (mass * x))
        tau = FLOW * wave
        solve.refactor(_shifted(A, tau * mass + held))
        for _ in range(FLOWS):
            x = project(solve(tau * mass * _normalised(x) + target))
        phase = np.arctan2(x[n:], x[:n]) / (2 * np.pi)
        return np.where(lock & (np.abs(phase) < EXACT), 0.0, phase)


def _shifted(A: csr_array, diagonal: Floats) -> csr_array:
    return csr_array(A + diags_array(diagonal))


def _normalised(x: Floats) -> Floats:
    real, imaginary = np.split(x, 2)
    return np.asarray(x / np.tile(np.maximum(np.hypot(real, imaginary), np.finfo(float).tiny), 2))
