"""How many stripes per metre: as even as stripes can be that run where they should.

Stripes with the direction of their gradient g have a density e^u with curl(e^u g) = 0, or they must end somewhere:
where rays fan out they part, where they meet they crowd. That fixes the derivative of u along the stripes alone [cf.
the curl-free frame fields of Diamanti et al. 2015; least squares here].
"""

from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, cross, unit_vectors, weighted_quantile, weighted_quantiles
from dsfab.pattern.frames import Frames, corner_sums
from dsfab.surface.fields import hat_gradients
from dsfab.surface.mesh import Surface

SMOOTH = 0.02
"""Weight of |grad u|^2: fills in where the direction is unclear."""
EVEN = 0.3
"""Weight of u^2, over the area of the surface: of all constants the one nearest to an even spacing."""
RANGE = (-2.0, 1.5)
"""Without halving u is clipped to this: it goes to infinity at singular points of the field."""
COARSE_RANGE = (-1.0, 3.0)
"""The same with halving, which takes up all but the last power of two."""
MOST_HALVINGS = 3
LIMITS = 20
"""Limits that are tried, in each power of two, for where halving begins."""
BEGINS = 2.0
"""Halving begins at up to this power of two under the median: stripes may be as close as asked where they part, too."""
WORTH = 0.05
"""A halving must make the largest spacings, over the smallest, less by this share: each has ends of members."""
HALVED_FROM = 0.98
"""Stripes are halved as often as the rest of the surface wants: less than that is not worth a ring of its own."""


def log_density(frames: Frames, g: Floats, confidence: Floats) -> Floats:
    """(n,) u, the logarithm of the relative density of stripes whose gradients point along g (n, 3), median 0.

    On each face, with signs of g aligned at its corners, p . grad u = curl g / |mean g| along the stripe, p = n x g.
    confidence : (m,) weight of that, 0 to 1.
    """
    surface = frames.surface
    grad = hat_gradients(surface)
    corners = g[surface.F]
    a, b, c = surface.F.T
    sign = np.stack([np.ones(surface.m), frames.sides(g, a, b), frames.sides(g, a, c)], axis=1)
    agree = frames.sides(g, b, c) * sign[:, 1] * sign[:, 2] > 0
    corners = corners * sign[:, :, None]
    curl = np.einsum("mci,mi->m", np.cross(grad, corners), surface.normals)
    mean = corners.mean(axis=1)
    mean -= np.einsum("mi,mi->m", mean, surface.normals)[:, None] * surface.normals
    length = np.linalg.norm(mean, axis=1)
    along = cross(surface.normals, unit_vectors(mean))
    weight = surface.areas * confidence * agree * np.clip(length, 0, 1) ** 4
    p = np.einsum("mci,mi->mc", grad, along)
    mass = np.maximum(surface.vertex_areas, np.finfo(float).eps * surface.area)
    blocks = np.einsum("ma,mb,m->mab", p, p, weight)
    blocks += SMOOTH * np.einsum("mai,mbi,m->mab", grad, grad, surface.areas)
    along_edges = blocks[:, (0, 1, 2), (1, 2, 0)]
    coupling = np.bincount(surface.edges.of.ravel(), along_edges.ravel(), len(surface.edges.ends))
    own = corner_sums(surface, blocks[:, (0, 1, 2), (0, 1, 2)]) + EVEN / surface.area * mass
    right = corner_sums(surface, p * (weight * curl / np.maximum(length, 1e-9))[:, None])
    # as complex numbers: the analysis is that of the phases, which takes longer than to count with zeros
    u = frames.twisted.hermitian(coupling.astype(complex), own)(right.astype(complex)).real
    return np.asarray(u - weighted_quantile(u, surface.vertex_areas, 0.5))


class Halving(NamedTuple):
    """How often stripes are halved at most, and `wish` (n,): the whole number under it is how often, at each vertex.

    wish   : in powers of two, 0 to `most`.    free : also under 0 and over `most`.
    limits : what the logarithm of the density of all lines is clipped to.
    """

    most: int
    wish: Floats
    free: Floats
    limits: tuple[float, float]

    @property
    def times(self) -> Floats:
        """(n,) how often lines are halved at each vertex, a whole number from 0 to `most`."""
        return np.floor(self.wish)


def halving(u: Floats, mass: Floats, allowed: bool = True) -> Halving:
    """Where stripes are halved whose logarithm of the density is u (n,), so that what is left is as even as it can be.

    Of all limits from which on stripes are halved it is the one with the smallest ratio of the spacings that 5 % of the
    surface exceed and fall below; the fewest halvings among those that are as good.
    """
    if not allowed:
        return Halving(0, np.zeros_like(u), np.zeros_like(u), RANGE)

    ascending = np.argsort(u, kind="stable")  # few runs are left to be merged for each limit
    sorted_u, sorted_mass = u[ascending], mass[ascending]

    def ratio(limit: float) -> float:
        wish = sorted_u / np.log(2) + limit
        v = np.clip(sorted_u, *COARSE_RANGE) - np.log(2) * np.clip(np.floor(wish), 0, MOST_HALVINGS)
        narrow, wide = weighted_quantiles(v, sorted_mass, (0.05, 0.95)).tolist()
        return float(wide - narrow)

    def most(limit: float) -> int:
        return int(np.clip(np.floor(close + limit), 0, MOST_HALVINGS))

    powers = u / np.log(2)
    close = weighted_quantile(powers, mass, HALVED_FROM)
    limits = np.arange(BEGINS * LIMITS) / LIMITS
    best = min(limits, key=lambda limit: round(ratio(limit) + WORTH * most(limit), 6))
    low, high = np.array(COARSE_RANGE) / np.log(2)
    free = np.clip(powers, low, high) + best
    return Halving(most(best), np.clip(powers + best, 0, most(best)), free, COARSE_RANGE)


def density(surface: Surface, u: Floats, spacing: float, halved: Halving) -> Floats:
    """(n,) periods per metre of the phase, such that what halving leaves is `spacing` metres apart on average."""
    w = np.exp(np.clip(u, *halved.limits))
    left = w / 2**halved.times
    mean = float(surface.vertex_areas @ left) / surface.area
    return np.asarray(w / (spacing * mean))
