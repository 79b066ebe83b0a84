"""Stripes around small supported boundary loops: rings along the loop, and rays away from the loop."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Complexes, Floats, Ints, polygon_perimeter, unit_vectors
from dsfab.pattern.direction_field import StressDirections
from dsfab.pattern.frames import Frames, dots
from dsfab.pattern.guides import Guidance
from dsfab.pattern.kept_regions import curve_origins
from dsfab.pattern.widths import vertex_means
from dsfab.surface import Surface, geodesic_distances
from dsfab.surface.fields import hat_gradients

REACH = 1.5
"""Stripes form rings and rays up to this distance from a small supported boundary loop. Unit: the stripe spacing."""
PULL = 100.0
"""Weight of ring and ray directions at a small supported boundary loop; the stress has at most 1.
The weight falls to 0 at the distance `REACH`."""


def small_loops(surface: Surface, supported: Bools, spacing: float) -> list[Ints]:
    """Return the vertices (k,) of each fully supported boundary loop with a mean radius below `spacing`.
    supported : mask (n,) of vertices.    spacing : distance between stripes, m."""
    loops = [loop for loop in surface.loops if supported[loop].all()]
    return [loop for loop in loops if polygon_perimeter(surface.V[loop]) < 2 * np.pi * spacing]


@dataclass(frozen=True, eq=False)
class LoopSurroundings:
    """Directions of rings and rays around a small supported boundary loop.
    weight   : (n,) weight of these directions.
    ray      : (n,) e^2. The complex number e is the unit direction of the ray in the vertex's frame.
    outwards : (m, 3) unit vector on each face, away from the loop; 0 far away."""

    weight: Floats
    ray: Complexes
    outwards: Floats

    @classmethod
    def from_support(cls, frames: Frames, supported: Bools, spacing: float) -> tuple[Self, ...]:
        """Return rings and rays around each small boundary loop of `supported` vertices (n,)."""
        surface, reach, surroundings = frames.surface, REACH * spacing, []
        for loop in small_loops(surface, supported, spacing):
            on_loop = np.isin(np.arange(surface.n), loop)
            distance = geodesic_distances(surface, curve_origins(surface, on_loop), reach).vertex
            gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), np.minimum(distance, reach)[surface.F])
            mean_gradient = vertex_means(surface, gradient)
            z = dots(mean_gradient, frames.t1) + 1j * dots(mean_gradient, frames.t2)
            ray = np.divide(z, np.abs(z), out=np.zeros_like(z), where=z != 0) ** 2
            weight = PULL * np.clip(1 - distance / reach, 0, 1) * np.abs(ray)
            surroundings.append(cls(weight, ray, unit_vectors(gradient)))
        return tuple(surroundings)

    def guidance(self, frames: Frames, stress: StressDirections, turn: float) -> Guidance:
        """Return the directions of stripes around this loop. turn : rotation of the two families, radians."""
        surface, cosine = frames.surface, dots(stress.direction[:, 0], self.outwards)
        ray_minus_ring_stress = (stress.stress[:, 0] - stress.stress[:, 1]) * (2 * cosine**2 - 1)
        share = surface.areas * self.weight[surface.F].mean(axis=1)
        major_sign = 1 if share @ ray_minus_ring_stress > 0 else -1
        return Guidance(self.weight, major_sign * self.weight * self.ray * np.exp(2j * turn))
