"""Density of stripes, as even as possible for given directions [cf. Diamanti et al. 2015]."""

from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, cross, unit_vectors, weighted_quantile, weighted_quantiles
from dsfab.pattern.frames import Frames, corner_sums
from dsfab.surface.fields import hat_gradients
from dsfab.surface.mesh import Surface

SMOOTH = 0.02  # Weight of |grad u|^2, for u = log(density). This term determines u where directions are unclear.
EVEN = 0.3
"""Weight of u^2 times the surface's area, for u = log(density of stripes). The term keeps the density near its mean."""
RANGE = (-2.0, 1.5)  # Bounds of u = log(density of stripes) if no lines are removed (see `Halving`).
COARSE_RANGE = (-1.0, 3.0)
"""Bounds of u, the logarithm of the relative density of stripes, if lines may be removed (see `Halving`)."""
MOST_HALVINGS = 3


def log_density(frames: Frames, g: Floats, confidence: Floats) -> Floats:
    """Return u (n,), the logarithm of the relative density of stripes; the median is 0.
    g : (n, 3) direction across the stripes, up to sign.    confidence : (m,) weight of each face, 0 to 1."""
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
    diagonal = corner_sums(surface, blocks[:, (0, 1, 2), (0, 1, 2)]) + EVEN / surface.area * mass
    right = corner_sums(surface, p * (weight * curl / np.maximum(length, 1e-9))[:, None])
    # a complex matrix can reuse the symbolic analysis of the matrix for phases
    u = frames.twisted_factors.hermitian(coupling.astype(complex), diagonal)(right.astype(complex)).real
    return np.asarray(u - weighted_quantile(u, surface.vertex_areas, 0.5))


class Halving(NamedTuple):
    """Numbers of halvings of the stripes' centre lines. A halving removes every second line.
    most : largest number.    wish : (n,) best number at each vertex, not rounded, 0 to `most`.
    free : (n,) best number without these limits.    limits : bounds of u = log(density before halvings)."""

    most: int
    wish: Floats
    free: Floats
    limits: tuple[float, float]

    @property
    def times(self) -> Floats:
        """Whole number (n,) of halvings at each vertex, from 0 to `most`."""
        return np.floor(self.wish)


def halving(u: Floats, mass: Floats, allowed: bool = True) -> Halving:
    """Return the halvings (removals of every second line) for the most even spacing.
    u : (n,) logarithm of the density of lines.    mass : (n,) vertex areas.    allowed : False for no halvings."""
    if not allowed:
        return Halving(0, np.zeros_like(u), np.zeros_like(u), RANGE)
    ascending = np.argsort(u, kind="stable")  # sorted once, for fast quantiles
    sorted_u, sorted_mass = u[ascending], mass[ascending]

    def ratio(limit: float) -> float:
        wish = sorted_u / np.log(2) + limit
        v = np.clip(sorted_u, *COARSE_RANGE) - np.log(2) * np.clip(np.floor(wish), 0, MOST_HALVINGS)
        narrow, wide = weighted_quantiles(v, sorted_mass, (0.05, 0.95)).tolist()
        return float(wide - narrow)

    def halvings(limit: float) -> int:
        return int(np.clip(np.floor(dense_powers + limit), 0, MOST_HALVINGS))

    powers = u / np.log(2)
    dense_powers = weighted_quantile(powers, mass, 0.98)
    limits = np.arange(2.0 * 20) / 20
    best_limit = min(limits, key=lambda limit: round(ratio(limit) + 0.05 * halvings(limit), 6))
    low, high = np.array(COARSE_RANGE) / np.log(2)
    free = np.clip(powers, low, high) + best_limit
    return Halving(halvings(best_limit), np.clip(powers + best_limit, 0, halvings(best_limit)), free, COARSE_RANGE)


def density(surface: Surface, u: Floats, spacing: float, halved: Halving) -> Floats:
    """Return the density of centre lines (n,), per metre, before halvings.
    spacing : mean distance (m) of lines after halvings.    u : (n,) logarithm of the relative density."""
    w = np.exp(np.clip(u, *halved.limits))
    remaining = w / 2**halved.times
    mean = float(surface.vertex_areas @ remaining) / surface.area
    return np.asarray(w / (spacing * mean))
