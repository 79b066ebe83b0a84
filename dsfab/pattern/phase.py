"""The phase of evenly spaced stripes: a complex number at every vertex whose angle grows by 2 pi from stripe to stripe.

Stripes have no front: where the direction field is carried around a singular point it comes back reversed, and with it
the phase becomes its conjugate. So phases are values up to sign and whole periods [Knoeppel et al. 2015].
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Complexes, Floats
from dsfab.pattern.frames import Frames, dots
from dsfab.pattern.images import Projection
from dsfab.pattern.twisted import Solve
from dsfab.sparse import one_blas_thread

SHIFT = 1e-3
"""Of the inverse iteration, over the squared spacing: makes the matrix definite and changes no eigenvector."""
STEPS = 20
"""Inverse iterations: the lowest eigenvectors differ little from each other, and any of them will do."""
KRYLOV = 12
"""Solves that these take: what they end at is in the Krylov space of twelve of them to 1e-5 or better."""
EXHAUSTED = 1e-12
"""What is left of a product is nothing if it is under this share of it."""
FLOWS = 10
"""Rounds of diffusion and normalisation, in which pairs of dislocations find each other and vanish."""
FLOW = 0.25
"""Length of a round: 1 / tau, tau = this share of (2 pi / spacing)^2."""
EXACT = 0.05
"""Locked phases that are off by less, in periods, are not off at all: the edge of a surface gets a straight member."""
LOCK = 3.0
"""Weight of a locked phase, over (2 pi / spacing)^2."""
CHANCE = 0.02
"""A mean cosine of phases that is this small says nothing: as many stressed places are on lines as between them."""


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

    @cached_property
    def coupling(self) -> Complexes:
        """(e,) what the phases at both ends of the edges share; see `Frames.coupling`."""
        return self.frames.coupling(-2 * np.pi * self.turn)

    def solve(
        self,
        start: Floats,
        lock: Bools,
        projection: Projection | None = None,
        aim: Floats | None = None,
        free: bool = False,
    ) -> Floats:
        """(n,) phases at the vertices, in periods, -1/2 to 1/2, each in the sign that g has at its vertex.

        Minimised is the sum over the edges of w |psi_j - e^{2 pi i turn} psi_i|^2, psi_i conjugated where g turns over:
        first over all psi of one size, then, by diffusion and normalisation in turns, over all of size 1 everywhere
        [Merriman, Bence, Osher 1992; on phases Viertel, Osting 2019].

        start : (n,) where the iteration begins; a line is drawn through its peak, as far as nothing else decides.
        lock  : (n,) vertices through which the middle of a stripe should run.
        aim   : (n,) what the phase is to be at some of these, in periods, -1/2 to 1/2, if it is not 0.
        free  : begin without them: from where they are the first phases may meet out of step in between.
        """
        surface, n = self.frames.surface, self.frames.surface.n
        mass = np.maximum(surface.vertex_areas, 1e-12 * surface.area)
        inverse_square = float(surface.vertex_areas @ self.density / surface.area) ** 2
        wave = 4 * np.pi**2 * inverse_square
        project = projection or (lambda x: x)
        held = LOCK * wave * mass * lock
        aim = np.zeros(n) if aim is None else aim
        target = held * np.exp(2j * np.pi * aim)
        from_lock = bool(lock.any()) and not free
        solve = self._factor(SHIFT * inverse_square * mass + (held if from_lock else 0.0))
        x = project(solve(target)) if from_lock else _lowest(lambda x: project(solve(mass * x)), start, mass)
        tau = FLOW * wave
        solve = self._factor(tau * mass + held)
        for _ in range(FLOWS):
            x = project(solve(tau * mass * _normalised(x) + target))
        phase = np.angle(x) / (2 * np.pi)
        miss = phase - aim
        return np.where(lock & (np.abs(miss - np.rint(miss)) < EXACT), aim, phase)

    def _factor(self, diagonal: Floats) -> Solve:
        return self.frames.twisted.factor(self.coupling, diagonal, self.sign < 0)


def _lowest(B: Callable[[Complexes], Complexes], start: Floats, mass: Floats) -> Complexes:
    """(n,) what inverse iteration with B from start (n,) ends at: complex numbers as pairs of real ones, for conjugates
    are linear for these alone."""
    x = krylov_power(lambda x: _pairs(B(_numbers(x))), _pairs(start.astype(complex)), np.repeat(mass, 2), STEPS, KRYLOV)
    return _numbers(x)


def _pairs(x: Complexes) -> Floats:
    """(2 n,) real and imaginary part of each number (n,), one after the other."""
    return np.ascontiguousarray(x).view(np.float64)


def _numbers(x: Floats) -> Complexes:
    """(n,) the numbers of such pairs (2 n,)."""
    return np.ascontiguousarray(x).view(np.complex128)


@one_blas_thread()  # hundreds of products of vectors: on two busy cores, threads took three times as long
def krylov_power(B: Callable[[Floats], Floats], x: Floats, mass: Floats, power: int, products: int) -> Floats:
    """B^power x, of length 1 in the mass (N,), from the Krylov space of so many products with a linear B.

    Arnoldi's method [Saad 1992]: B as a small matrix H on an orthonormal basis of B x, B B x, ..., and powers of that.
    With as many products as powers it is exact.
    """
    basis = [_of_length_1(B(x), mass)]
    H = np.zeros((products, products - 1))
    for k in range(products - 1):
        rest = B(basis[k])
        for _ in range(2):  # the second time what rounding has left
            for j, q in enumerate(basis):
                share = q @ (mass * rest)
                H[j, k] += share
                rest = rest - share * q
        H[k + 1, k] = np.sqrt(rest @ (mass * rest))
        if H[k + 1, k] <= EXHAUSTED * H[k, k]:
            H = H[: k + 1, : k + 1]
            break
        basis.append(rest / H[k + 1, k])
    y = np.eye(1, max(H.shape[1], 1))[0]
    for _ in range(power - 2 if H.size else 0):
        y = H[: len(y)] @ y
        y /= np.linalg.norm(y)
    y = H @ y if power > 1 and H.size else y
    return _of_length_1(y @ np.array(basis), mass)


def _of_length_1(x: Floats, mass: Floats) -> Floats:
    return np.asarray(x / np.sqrt(x @ (mass * x)))


def through_peaks(phase: Floats, weight: Floats) -> Floats:
    """(n,) the phases at the vertices, in periods, or those half a period on, such that lines run where weight (n,) is
    large.

    What `Flow.solve` minimises does not tell the two apart, nor do signs and images of phases: 1/2 and -1/2 are one.
    """
    if weight @ np.cos(2 * np.pi * phase) >= -CHANCE * weight.sum():
        return phase
    return np.asarray(np.where(phase > 0, phase - 0.5, phase + 0.5))


def _normalised(x: Complexes) -> Complexes:
    return np.asarray(x / np.maximum(np.abs(x), np.finfo(float).tiny))
