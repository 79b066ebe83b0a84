"""Where stripes run: a smooth direction field at the vertices that follows the principal stresses where they are clear.

Principal directions are noise where both stresses are equal. There the field is filled in from around: of all fields
the smoothest, weighed by how clear the stress is [Knoeppel et al. 2013, eq. 14].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import PatternError
from dsfab.pattern.frames import Frames, corner_sums, dots
from dsfab.pattern.guides import Guidance

UNCLEAR = 0.3
"""Where principal stresses differ by this share of the reference stress, they count half."""
FLOOR = 1e-6
"""Weight of the stress where it says nothing: keeps the field unique on a surface without stress."""

VAGUE = 1e-6
"""A direction under this share of the clearest one is rounding, as at the pole of a symmetric mesh: any other will do,
but it must turn with the surface."""


@dataclass(frozen=True, eq=False)
class StressDirections:
    """What the field follows, on the faces.

    stress    : (m, 2) principal stresses, any unit; major stripes run along the first.
    direction : (m, 2, 3) their unit directions.
    """

    stress: Floats
    direction: Floats

    def confidence(self, areas: Floats) -> Floats:
        """(m,) D / (D + 0.3 reference), 0 to 1: D the difference of the stresses, the reference their RMS."""
        differ = np.abs(self.stress[:, 0] - self.stress[:, 1])
        reference = float(np.sqrt((areas @ (self.stress**2).sum(axis=1)) / (2 * areas.sum())))
        if not reference > 0:
            raise PatternError("nothing is stressed, so stripes have nothing to follow; check the loads")
        return np.asarray(differ / (differ + UNCLEAR * reference))


def cross_field(
    frames: Frames, given: StressDirections, length: float, turn: float = 0.0, guidance: Sequence[Guidance] = ()
) -> Floats:
    """(n, 3) unit directions at the vertices, along the major stripes.

    length   : metres over which unclear stress is smoothed. Signs are without meaning: a stripe runs both ways.
    turn     : radians that they are turned by from the stress, counter-clockwise as seen from where normals point to.
    guidance : what else they follow; it is not turned.

    In each frame the direction is the square z^2 of a complex number, which a half turn leaves alone. Minimised is
    length^2 |grad z^2|^2 + c |z^2 - e^2|^2, e the first principal direction, c its confidence; and see `Guidance`.
    Raises PatternError where nothing is stressed.
    """
    surface = frames.surface
    share = (surface.areas * given.confidence(surface.areas) / 3)[:, None].repeat(3, axis=1)
    e = given.direction[:, 0]
    z = np.stack([_complex(frames, surface.F[:, c], e) ** 2 for c in range(3)], axis=1)
    z = z * np.exp(2j * turn) if turn else z
    right = corner_sums(surface, share * z.real) + 1j * corner_sums(surface, share * z.imag)
    weight = corner_sums(surface, share) + FLOOR * surface.vertex_areas
    for guide in guidance:
        right += surface.vertex_areas * guide.square
        weight += surface.vertex_areas * guide.weight
    weight[weight == 0] = FLOOR * surface.mean_edge**2  # vertices without a face
    x = frames.twisted.factor(length**2 * frames.coupling(2 * frames.turning), weight)(right)
    size = np.abs(x)
    angle = np.where(size > VAGUE * size.max(), np.angle(x) / 2, _along_an_edge(frames))
    return frames.direction(angle)


def _along_an_edge(frames: Frames) -> Floats:
    """(n,) at each vertex the angle of its edge to the neighbour of the smallest number; 0 where there is none."""
    ends = np.concatenate([frames.ends, frames.ends[:, ::-1]])
    ends = ends[np.lexsort((ends[:, 1], ends[:, 0]))]
    at, begins = np.unique(ends[:, 0], return_index=True)
    step = frames.surface.V[ends[begins, 1]] - frames.surface.V[at]
    angle = np.zeros(frames.surface.n)
    angle[at] = np.angle(_complex(frames, at, step))
    return angle


def _complex(frames: Frames, vertex: Ints, e: Floats) -> Floats:
    """(m,) directions e (m, 3) as complex numbers in the frames of vertices (m,)."""
    return np.asarray(dots(e, frames.t1[vertex]) + 1j * dots(e, frames.t2[vertex]))
