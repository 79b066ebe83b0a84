"""`curve_fields`: distances along a surface that are cut at a reach, with an edge that is even whatever the mesh.

Faces on which a distance is not linear are divided where that edge runs, and so that it does not pass close by one of
the new vertices: what is cut has as few needles as stripes have.
"""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import Distances, Origins, Surface, geodesic_distances, nearest
from dsfab.surface.divided import Divided, DividedField

EVEN = 0.01
"""How far off the edge of a region may be because a distance is taken as linear on faces, as a share of its reach."""

ALIKE = 1e-3
"""On fine meshes straight lines are taken if they differ from ways along the surface by this share of the reach."""

SNAP = 0.05
"""Cutting moves vertices onto the edge of a region that are nearer than this share of the growth of the distance along
one of their edges (the usual `slicing.snap`); if that is farther than twice `EVEN`, these edges are halved."""

SHORT = 1 / 16
"""Edges that are shorter, as a share of the reach, are not halved: where two parts of the boundary are equally near."""

FINEST = 1 / 16
"""Nor are those that are shorter as a share of the longest side of the face that they lie in: much smaller parts make
what is cut hard to solve. Corners of a region are blunt by at most half of this share of a side."""

NEAR = 0.3
"""Values within this share of the growth of the distance along one of a vertex's edges are moved onto the edge of the
region, unless that moves it by more than `EVEN`: lines that pass close by a vertex leave needles."""

ASIDE = 0.1
"""Edges are divided where the edge of a region crosses them if that is less than this share of them off their middle:
else it would pass close by the new vertex."""

ROUNDS = 16
"""How often edges are halved at most."""

PARTS = 300_000
"""Faces are not divided any more when there are so many more parts than faces."""


def curve_fields(surface: Surface, regions: Sequence[tuple[Origins, float]]) -> list[Floats | DividedField]:
    """(n,) for each region the negative distance along the surface from its origins, metres, to be cut at minus its
    reach.

    Faces that this edge crosses are divided where the distance is not linear; all fields are on one division. Farther
    away than the reach and the longest edge values are bounds: too low, and finite.
    """
    divided, reaches = Divided.nowhere(surface), [reach for _, reach in regions]
    for left in reversed(range(ROUNDS)):
        found = [geodesic_distances(divided.surface, divided.carried(origins), reach) for origins, reach in regions]
        marks = _marks(divided, found, reaches)
        if not (left and marks.any()) or divided.surface.m > surface.m + PARTS:
            break
        divided = divided.halved(marks, _crossings(divided.surface, found, reaches))
    if divided.surface is surface:
        return [_plain(surface, region, distances) for region, distances in zip(regions, found, strict=True)]
    return [
        DividedField(divided, -_snapped(divided.surface, _finite(distances.vertex, reach), reach))
        for reach, distances in zip(reaches, found, strict=True)
    ]


def _marks(divided: Divided, found: Sequence[Distances], reaches: Sequence[float]) -> Bools:
    """(e',) edges that are to be halved for one of the regions: none within one of those before it."""
    parts, whole = divided.surface, divided.whole
    size, sides = parts.edge_lengths, parts.edges.of
    finest, longest = np.zeros(len(size)), whole.edge_lengths[whole.edges.of].max(axis=1)
    np.maximum.at(finest, sides.ravel(), np.repeat(FINEST * longest[divided.parent], 3))
    marks, open_ = np.zeros(len(size), dtype=bool), np.ones(parts.m, dtype=bool)
    for distances, reach in zip(found, reaches, strict=True):
        seen = np.zeros(len(size), dtype=bool)
        seen[sides[open_]] = True
        marks |= seen & _uneven(parts, distances, reach) & (size > np.maximum(SHORT * reach, finest))
        open_ &= np.maximum(distances.vertex[parts.F], distances.middle[sides]).max(axis=1) > reach
    return marks


def _crossings(surface: Surface, found: Sequence[Distances], reaches: Sequence[float]) -> Floats:
    """(e,) where to divide edges, from 0 at their first end to 1: where the edge of a region crosses them (see
    `ASIDE`), or in their middle where none does so close to it, or more than one."""
    at, count = np.full(len(surface.edges.ends), 0.5), np.zeros(len(surface.edges.ends), dtype=np.int64)
    for distances, reach in zip(found, reaches, strict=True):
        middle = distances.middle
        for end, way in zip(distances.vertex[surface.edges.ends].T, (-0.5, 0.5), strict=True):
            with np.errstate(invalid="ignore", divide="ignore"):
                off = (reach - middle) / (end - middle)
            close = (off > 0) & (off < 2 * ASIDE)
            at[close], count = 0.5 + way * off[close], count + close
    return np.where(count == 1, at, 0.5)


def _most_growth(surface: Surface, distance: Floats) -> tuple[Floats, Floats]:
    """(e,) by how much a distance grows along each edge, and (n,) along the edges at each vertex at most."""
    ends, most = surface.edges.ends, np.zeros(surface.n)
    growth = np.abs(np.diff(distance[ends], axis=1)[:, 0])
    np.maximum.at(most, ends.ravel(), np.repeat(growth, 2))
    return growth, most


def _snapped(surface: Surface, distance: Floats, reach: float) -> Floats:
    """Distances (n,) close to the reach moved onto it (see `NEAR`), but not those of all corners of a face."""
    _, most = _most_growth(surface, distance)
    near = np.abs(distance - reach) <= np.minimum(NEAR * most, EVEN * reach)
    near[surface.F[near[surface.F].all(axis=1)]] = False
    return np.where(near, reach, distance)


def _plain(surface: Surface, region: tuple[Origins, float], distances: Distances) -> Floats:
    """(n,) the field of a region on faces as they are; by straight lines where these lead to the same places."""
    origins, reach = region
    near = np.unique(surface.F[distances.reached])
    straight = straight_distances(
        surface, (surface.edges.ends[origins.edges], np.flatnonzero(origins.vertices)[:, None])
    )
    alike = np.abs(straight[near] - distances.vertex[near]).max(initial=0.0) <= ALIKE * reach
    if alike and np.delete(straight, near).min(initial=np.inf) > reach:
        return -straight
    return -_finite(distances.vertex, reach)


def _finite(distance: Floats, reach: float) -> Floats:
    """The largest of the others for what is infinite: it tells nothing of how steep a distance is."""
    known = np.isfinite(distance)
    return np.where(known, distance, max(2 * reach, distance[known].max(initial=0.0)))


def _uneven(surface: Surface, distances: Distances, reach: float) -> Bools:
    """(e,) edges on the edge of a region along which the distance is not linear, or too steep."""
    vertex, middle, faces = distances.vertex, distances.middle, np.flatnonzero(distances.reached)
    sides, ends = surface.edges.of[faces], surface.edges.ends
    off = np.abs(vertex[ends[sides]].mean(axis=2) - middle[sides])
    farthest = np.maximum(vertex[surface.F[faces]], middle[sides]).max(axis=1)
    off[farthest == 0] = reach  # all sides are on the boundary: nothing is known of the middle
    found = np.zeros(len(ends), dtype=bool)
    found[sides[(off > EVEN * reach) & (farthest + off.max(axis=1) >= reach)[:, None]]] = True
    known = _finite(vertex, reach)
    growth, most = _most_growth(surface, known)
    off, most_off = np.abs(known - reach), 2 * EVEN * reach
    moved = (off <= SNAP * most) & (off > most_off)
    return np.asarray(found | (moved[ends].any(axis=1) & (SNAP * growth > most_off)))


def straight_distances(surface: Surface, simplices: Sequence[Ints]) -> Floats:
    """(n,) straight distance, metres, to the nearest of some faces, edges and vertices, by those of their corners."""
    squared = np.full(surface.n, np.inf)
    for group in simplices:
        if len(group):
            squared = np.minimum(squared, nearest(surface.V, surface.V, group).squared)
    return np.asarray(np.sqrt(squared))
