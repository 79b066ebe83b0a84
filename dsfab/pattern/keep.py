"""Regions that stay material whatever the stripes say: around loads and supports, and along the boundary."""

from collections.abc import Sequence

import igl
import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lengths
from dsfab.pattern.layers import Layer
from dsfab.surface.divided import Divided, DividedField
from dsfab.surface.geodesic import Distances, Origins, geodesic_distances
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected

EVEN = 0.01
"""How far off the edge of a region may be because a distance is taken as linear on faces, as a share of its reach."""

ALIKE = 1e-3
"""On fine meshes straight lines are taken if they differ from ways along the surface by this share of the reach."""

SNAP = 0.05
"""Cutting moves vertices onto the edge of a region that are nearer than this share of the growth of the distance along
one of their edges (the usual `slicing.snap`); if that is farther than three times `EVEN`, these edges are halved."""

SHORT = 1 / 16
"""Edges that are shorter, as a share of the reach, are not halved: where two parts of the boundary are equally near."""

ROUNDS = 16
"""How often edges are halved at most."""

PARTS = 300_000
"""Faces are not divided any more when there are so many more parts than faces."""


def distance_to_boundary(surface: Surface, reach: float = np.inf) -> Floats:
    """(n,) distance along the surface, metres, to the boundary; too large beyond the reach, or infinite."""
    return geodesic_distances(surface, boundary_origins(surface), reach).vertex


def distance_to_vertices(surface: Surface, vertices: Bools, reach: float = np.inf) -> Floats:
    """(n,) distance, metres, to what marked vertices span: straight to patches, along the surface to points and curves,
    there as in `distance_to_boundary`."""
    patch = patches(surface, vertices)
    curves = geodesic_distances(surface, curve_origins(surface, vertices & ~patch), reach)
    return np.minimum(distance_to_patches(surface, patch), curves.vertex)


def patches(surface: Surface, vertices: Bools) -> Bools:
    """(n,) the marked vertices that hang together with faces between them; the others are points and curves.

    Three vertices of the boundary mark no face, and two of them no edge within the surface: it depends on the mesh
    alone how far these go beyond the curve that is meant.
    """
    edges, faces = _spanned(surface, vertices)
    _, part = connected(surface.n, *surface.edges.ends[edges].T)
    return np.asarray(vertices & np.isin(part, part[surface.F[faces]]))


def distance_to_patches(surface: Surface, vertices: Bools) -> Floats:
    """(n,) straight distance, metres, to what marked vertices span: their faces, their edges, themselves."""
    ends = surface.edges.ends
    faces, edges = surface.F[vertices[surface.F].all(axis=1)], ends[vertices[ends].all(axis=1)]
    return _straight(surface, (faces, edges, np.flatnonzero(vertices)[:, None]))


def _straight(surface: Surface, simplices: Sequence[Ints]) -> Floats:
    """(n,) straight distance, metres, to the nearest of some faces, edges and vertices, by those of their corners."""
    squared = np.full(surface.n, np.inf)
    for group in simplices:
        if len(group):
            squared = np.minimum(squared, igl.point_mesh_squared_distance(surface.V, surface.V, group)[0])
    return np.asarray(np.sqrt(squared))


def boundary_origins(surface: Surface) -> Origins:
    """The boundary, to measure distances from."""
    edges = surface.edges.boundary
    return Origins(_ends(surface, edges), edges, np.zeros(surface.m, dtype=bool))


def curve_origins(surface: Surface, vertices: Bools) -> Origins:
    """Marked vertices (n,), no `patches` among them, and the edges that they span, to measure distances from."""
    edges, _ = _spanned(surface, vertices)
    return Origins(vertices, edges, np.zeros(surface.m, dtype=bool))


def _spanned(surface: Surface, vertices: Bools) -> tuple[Bools, Bools]:
    """(e,) edges and (m,) faces between marked vertices; see `patches`."""
    F, ends, boundary = surface.F, surface.edges.ends, surface.edges.boundary
    border = _ends(surface, boundary)
    edges = vertices[ends].all(axis=1) & (boundary | ~border[ends].all(axis=1))
    return edges, np.asarray(vertices[F].all(axis=1) & ~border[F].all(axis=1))


def _ends(surface: Surface, edges: Bools) -> Bools:
    found = np.zeros(surface.n, dtype=bool)
    found[surface.edges.ends[edges]] = True
    return found


def kept_layers(surface: Surface, marked: Bools, keep: float, rim: float) -> list[Layer]:
    """What is material within `keep` metres of marked vertices (n,) and within `rim` metres of the boundary.

    Around patches that is to a straight line over each face; such a patch is ragged itself. Around points and along
    curves the edge of the region is even: see `curve_fields`.
    """
    patch = patches(surface, marked)
    regions = []
    if keep and (marked & ~patch).any():
        regions.append(("keep", curve_origins(surface, marked & ~patch), keep))
    if rim and surface.edges.boundary.any():
        regions.append(("rim", boundary_origins(surface), rim))
    fields = curve_fields(surface, [(origins, reach) for _, origins, reach in regions])
    named = [(name, field, reach) for (name, _, reach), field in zip(regions, fields, strict=True)]
    if keep and patch.any():
        ragged = -distance_to_patches(surface, patch)
        name, even, _ = named[0] if named else ("", ragged, 0.0)
        if name == "keep" and isinstance(even, np.ndarray):
            ragged, named = np.maximum(ragged, even), named[1:]
        named.insert(0, ("keep", ragged, keep))
    every = np.full(surface.n, np.inf)
    return [Layer(name, field, np.array([-reach]), every) for name, field, reach in named]


def curve_fields(surface: Surface, regions: Sequence[tuple[Origins, float]]) -> list[Floats | DividedField]:
    """For each region the negative distance along the surface from its origins, metres, to be cut at minus its reach.

    Faces that this edge crosses are divided where the distance is not linear; all fields are on one division. Farther
    away than the reach and the longest edge values are bounds: too low, and finite.
    """
    divided, found = Divided.nowhere(surface), dict[int, tuple[Divided, Distances]]()
    going = list(range(len(regions)))
    for _ in range(ROUNDS):
        for k in going:
            origins, reach = regions[k]
            found[k] = divided, geodesic_distances(divided.surface, divided.carried(origins), reach)
        marks = [_uneven(divided.surface, found[k][1], regions[k][1]) for k in going]
        going = [k for k, some in zip(going, marks, strict=True) if some.any()]
        if not going or divided.surface.m > surface.m + PARTS:
            break
        divided = divided.halved(np.logical_or.reduce(marks))
    if divided.surface is surface:
        return [_plain(surface, regions[k], found[k][1]) for k in range(len(regions))]
    fields = list[Floats | DividedField]()
    for k, (origins, reach) in enumerate(regions):
        at, distances = found[k]
        if at is not divided:
            distances = geodesic_distances(divided.surface, divided.carried(origins), reach)
        fields.append(DividedField(divided, -_finite(distances.vertex, reach)))
    return fields


def _plain(surface: Surface, region: tuple[Origins, float], distances: Distances) -> Floats:
    """(n,) the field of a region on faces as they are; by straight lines where these lead to the same places."""
    origins, reach = region
    near = np.unique(surface.F[distances.reached])
    straight = _straight(surface, (surface.edges.ends[origins.edges], np.flatnonzero(origins.vertices)[:, None]))
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
    growth, most = np.abs(np.diff(known[ends], axis=1)[:, 0]), np.zeros(surface.n)
    np.maximum.at(most, ends.ravel(), np.repeat(growth, 2))
    off, most_off = np.abs(known - reach), 3 * EVEN * reach
    moved = (off <= SNAP * most) & (off > most_off)
    found |= moved[ends].any(axis=1) & (SNAP * growth > most_off)
    found[found] = lengths(np.diff(surface.V[ends[found]], axis=1)[:, 0]) > SHORT * reach
    return found
