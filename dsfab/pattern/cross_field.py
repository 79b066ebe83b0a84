"""Where stripes run: a smooth direction field at the vertices that follows the principal stresses where they are clear.

Principal directions are noise where both stresses are equal. There the field is filled in from around: of all fields
the smoothest, weighed by how clear the stress is [Knoeppel et al. 2013, eq. 14].

A field turns over around singular points: by half a turn with the sense of going around, a wedge, or against it, a
trisector. One of each side by side undo each other: members cannot follow that, and what is between them is a knot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import PatternError
from dsfab.pattern.frames import Frames, corner_sums, dots
from dsfab.pattern.guides import Guidance
from dsfab.pattern.images import Images
from dsfab.surface import Surface

UNCLEAR = 0.3
"""Where principal stresses differ by this share of the reference stress, they count half."""
FLOOR = 1e-6
"""Weight of the stress where it says nothing: keeps the field unique on a surface without stress."""

VAGUE = 1e-6
"""A direction under this share of the clearest one is rounding, as at the pole of a symmetric mesh: any other will do,
but it must turn with the surface."""
ROUNDS = 5
"""Fields that are made at most to be rid of pairs of singular points: where some have gone others may have moved
together."""


@dataclass(frozen=True, eq=False)
class StressDirections:
    """What the field follows, on the faces.

    stress    : (m, 2) principal stresses, any unit; major stripes run along the first.
    direction : (m, 2, 3) their unit directions.
    """

    stress: Floats
    direction: Floats

    def renamed(self, over: Bools) -> "StressDirections":
        """The same with first and second exchanged on the faces that are marked (m,)."""
        swapped = np.where(over[:, None], self.stress[:, ::-1], self.stress)
        return StressDirections(swapped, np.where(over[:, None, None], self.direction[:, ::-1], self.direction))

    def confidence(self, areas: Floats) -> Floats:
        """(m,) D / (D + 0.3 reference), 0 to 1: D the difference of the stresses, the reference their RMS."""
        differ = np.abs(self.stress[:, 0] - self.stress[:, 1])
        reference = float(np.sqrt((areas @ (self.stress**2).sum(axis=1)) / (2 * areas.sum())))
        if not reference > 0:
            raise PatternError("nothing is stressed, so stripes have nothing to follow; check the loads")
        return np.asarray(differ / (differ + UNCLEAR * reference))


def cross_field(
    frames: Frames,
    given: StressDirections,
    length: float,
    turn: float = 0.0,
    guidance: Sequence[Guidance] = (),
    pairs: float = 0.0,
    images: Images | None = None,
) -> Floats:
    """(n, 3) unit directions at the vertices, along the major stripes.

    length   : metres over which unclear stress is smoothed. Signs are without meaning: a stripe runs both ways.
    turn     : radians that they are turned by from the stress, counter-clockwise as seen from where normals point to.
    guidance : what else they follow; it is not turned.
    pairs    : metres along the surface; where a wedge and a trisector are nearer, the stress counts for nothing so far
               around them. The field with the fewest such pairs is taken.
    images   : at which the field is the same; None for a surface without symmetry.

    In each frame the direction is the square z^2 of a complex number, which a half turn leaves alone. Minimised is
    length^2 |grad z^2|^2 + c |z^2 - e^2|^2, e the first principal direction, c its confidence; and see `Guidance`.
    Raises PatternError where nothing is stressed.
    """
    surface, confidence = frames.surface, given.confidence(frames.surface.areas)
    same = images or Images.none(surface.n)
    fields: list[tuple[int, Floats]] = []
    for _ in range(ROUNDS):
        along = same.directions(frames, _smoothest(frames, given, confidence, length, turn, guidance))
        knot = _knots(surface, half_turns(frames, along), pairs)
        fields.append((len(knot), along))
        if not len(knot):
            break
        away = _along_edges(surface, surface.F[knot].ravel(), pairs)[surface.F].min(axis=1)
        confidence = np.where(away < pairs, 0.0, confidence)
    return min(fields, key=itemgetter(0))[1]


def _smoothest(
    frames: Frames,
    given: StressDirections,
    confidence: Floats,
    length: float,
    turn: float,
    guidance: Sequence[Guidance],
) -> Floats:
    """(n, 3) the field of a confidence (m,)."""
    surface = frames.surface
    share = (surface.areas * confidence / 3)[:, None].repeat(3, axis=1)
    e = given.direction[:, 0]
    z = np.stack([_complex(frames, surface.F[:, c], e) ** 2 for c in range(3)], axis=1)
    z = z * np.exp(2j * turn) if turn else z
    right = np.concatenate([corner_sums(surface, share * z.real), corner_sums(surface, share * z.imag)])
    weight = corner_sums(surface, share) + FLOOR * surface.vertex_areas
    for guide in guidance:
        asked = surface.vertex_areas * guide.square
        right += np.concatenate([asked.real, asked.imag])
        weight += surface.vertex_areas * guide.weight
    weight[weight == 0] = FLOOR * surface.mean_edge**2  # vertices without a face
    x = frames.two_numbers.factor(length**2 * frames.twisted(2 * frames.turning), np.tile(weight, 2))(right)
    real, imaginary = np.split(x, 2)
    size = np.hypot(real, imaginary)
    angle = np.where(size > VAGUE * size.max(), np.arctan2(imaginary, real) / 2, _along_an_edge(frames))
    return frames.direction(angle)


def half_turns(frames: Frames, along: Floats) -> Ints:
    """(m,) by how many half turns unit tangents along (n, 3), up to sign, turn on the way around each face: 1 around a
    wedge, -1 around a trisector, 0 nearly everywhere. On a closed surface they add up to twice its Euler number."""
    i, j = frames.ends.T
    angle = np.arctan2(dots(along, frames.t2), dots(along, frames.t1))
    grows = _within_a_turn(2 * (angle[j] + frames.turning - angle[i]))
    of, F = frames.surface.edges.of, frames.surface.F
    ahead = np.where(i[of] == F, 1, -1)  # half-edges that run along their edge
    bent = _within_a_turn((2 * ahead * frames.turning[of]).sum(axis=1))  # of the frames themselves
    return np.asarray(np.rint(((ahead * grows[of]).sum(axis=1) - bent) / (2 * np.pi)), dtype=np.int64)


def _within_a_turn(angle: Floats) -> Floats:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _knots(surface: Surface, turns: Ints, reach: float) -> Ints:
    """(p,) faces of half turns (m,) that have one of the opposite kind within reach, metres along edges."""
    wedge, trisector = np.flatnonzero(turns > 0), np.flatnonzero(turns < 0)
    if not reach or not len(wedge) or not len(trisector):
        return np.empty(0, dtype=np.int64)
    near = [
        some[_along_edges(surface, surface.F[others].ravel(), reach)[surface.F[some]].min(axis=1) < reach]
        for some, others in ((wedge, trisector), (trisector, wedge))
    ]
    return np.concatenate(near)


def _along_edges(surface: Surface, sources: Ints, reach: float) -> Floats:
    """(n,) metres along edges from the nearest of vertices (k,); infinite beyond the reach."""
    i, j = surface.edges.ends.T
    graph = coo_array((surface.edge_lengths, (i, j)), shape=(surface.n, surface.n)).tocsr()
    return np.asarray(dijkstra(graph, directed=False, indices=np.unique(sources), limit=reach, min_only=True))


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
