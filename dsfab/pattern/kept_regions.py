"""Regions that stay material: around loads and supports, along the boundary, and outlines from the user."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import PatternError, SurfaceError
from dsfab.pattern.layers import Layer
from dsfab.surface import Distances, Origins, PatternRegion, Surface, geodesic_distances, nearest, region_key
from dsfab.surface.fields import Divided, DividedField
from dsfab.surface.topology import connected

EVEN = 0.01
"""Largest error of a region's edge by linear distances on faces, as a share of its reach."""


SNAP = 0.05
"""The usual `slicing.snap`: a cut moves vertices onto the edge of a region if they are nearer than this share of the
growth of the distance along one of their edges. If that exceeds twice `EVEN`, these edges are halved.
"""

SHORT = 1 / 16
"""Shorter edges, as a share of the reach, are not halved: two parts of the boundary are equally near there."""

FINEST = 1 / 16
"""Edges shorter than this share of their face's longest side are not halved: much smaller parts make the cut sheet hard
to solve. Corners of a region are blunt by at most half of this share of a side.
"""

NEAR = 0.3
"""Values within this share of the growth of the distance along one of a vertex's edges move onto the edge of the
region, unless by more than `EVEN`: lines that pass close by a vertex leave needles.
"""

ASIDE = 0.1
"""Edges are divided at the edge of a region if this crosses them less than this share off their middle; otherwise it
would pass close by the new vertex.
"""


def curve_fields(
    surface: Surface, regions: Sequence[tuple[Origins, float]], rounds: int = 16, most_parts: int = 300_000
) -> list[Floats | DividedField]:
    """Return minus the distance (n,) along the surface, metres, from the origins of each region, to cut at minus its
    reach.

    The edge of a region divides faces where the distance is not linear; all fields share one division, after at most
    `rounds` of halving and `most_parts` additional parts. Beyond the reach and the longest edge, values are bounds: too
    low, and finite.
    """
    divided, reaches = Divided.nowhere(surface), [reach for _, reach in regions]
    for left in reversed(range(rounds)):
        found = [geodesic_distances(divided.surface, divided.carried(origins), reach) for origins, reach in regions]
        marks = _marks(divided, found, reaches)
        if not (left and marks.any()) or divided.surface.m > surface.m + most_parts:
            break
        divided = divided.halved(marks, _crossings(divided.surface, found, reaches))
    if divided.surface is surface:
        return [_plain(surface, region, distances) for region, distances in zip(regions, found, strict=True)]
    return [
        DividedField(divided, -_snapped(divided.surface, _finite(distances.vertex, reach), reach))
        for reach, distances in zip(reaches, found, strict=True)
    ]


def _marks(divided: Divided, found: Sequence[Distances], reaches: Sequence[float]) -> Bools:
    """Return edges (e',) to halve for one of the regions, except in regions before it."""
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
    """Return where to divide edges (e,), from 0 at their first end to 1.

    At the edge of a region if that crosses near the middle (see `ASIDE`), else in the middle; also if several cross.
    """
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
    """Return the growth of a distance along each edge (e,), and the largest along the edges at each vertex (n,)."""
    ends, most = surface.edges.ends, np.zeros(surface.n)
    growth = np.abs(np.diff(distance[ends], axis=1)[:, 0])
    np.maximum.at(most, ends.ravel(), np.repeat(growth, 2))
    return growth, most


def _snapped(surface: Surface, distance: Floats, reach: float) -> Floats:
    """Return distances (n,), moved onto the reach if close to it (see `NEAR`), except at faces with all corners
    close.
    """
    _, most = _most_growth(surface, distance)
    near = np.abs(distance - reach) <= np.minimum(NEAR * most, EVEN * reach)
    near[surface.F[near[surface.F].all(axis=1)]] = False
    return np.where(near, reach, distance)


def _plain(surface: Surface, region: tuple[Origins, float], distances: Distances) -> Floats:
    """Return the field (n,) of a region on undivided faces, by straight lines if these give the same distances."""
    origins, reach = region
    near = np.unique(surface.F[distances.reached])
    straight = straight_distances(
        surface, (surface.edges.ends[origins.edges], np.flatnonzero(origins.vertices)[:, None])
    )
    alike = np.abs(straight[near] - distances.vertex[near]).max(initial=0.0) <= 1e-3 * reach
    if alike and np.delete(straight, near).min(initial=np.inf) > reach:
        return -straight
    return -_finite(distances.vertex, reach)


def _finite(distance: Floats, reach: float) -> Floats:
    """Replace infinite distances by the largest finite one, which does not affect slopes."""
    known = np.isfinite(distance)
    return np.where(known, distance, max(2 * reach, distance[known].max(initial=0.0)))


def _uneven(surface: Surface, distances: Distances, reach: float) -> Bools:
    """Return edges (e,) at the edge of a region along which the distance is not linear, or too steep."""
    vertex, middle, faces = distances.vertex, distances.middle, np.flatnonzero(distances.reached)
    sides, ends = surface.edges.of[faces], surface.edges.ends
    off = np.abs(vertex[ends[sides]].mean(axis=2) - middle[sides])
    farthest = np.maximum(vertex[surface.F[faces]], middle[sides]).max(axis=1)
    off[farthest == 0] = reach  # all sides are on the boundary: the middle has no distance
    found = np.zeros(len(ends), dtype=bool)
    found[sides[(off > EVEN * reach) & (farthest + off.max(axis=1) >= reach)[:, None]]] = True
    known = _finite(vertex, reach)
    growth, most = _most_growth(surface, known)
    off, most_off = np.abs(known - reach), 2 * EVEN * reach
    moved = (off <= SNAP * most) & (off > most_off)
    return np.asarray(found | (moved[ends].any(axis=1) & (SNAP * growth > most_off)))


def straight_distances(surface: Surface, simplices: Sequence[Ints]) -> Floats:
    """Return the straight distance (n,), metres, to the nearest of faces, edges and vertices, given by their
    corners.
    """
    squared = np.full(surface.n, np.inf)
    for group in simplices:
        if len(group):
            squared = np.minimum(squared, nearest(surface.V, surface.V, group).squared)
    return np.asarray(np.sqrt(squared))


@dataclass(frozen=True, eq=False)
class RegionBand:
    """A band along the outline of a region, on its inside.

    outline : the edges between faces in the region and outside, as origins of distances.    width : metres.
    inside  : (n,) 1 in the region, 0 on its outline, -1 outside.
    """

    outline: Origins
    width: float
    inside: Floats

    def layer(self, field: Floats | DividedField) -> Layer:
        """Return the layer of minus the distance (n,) from the outline, metres: the region without its middle.

        Two fields with a level at 0: material is where the first exceeds it and the second does not (see
        `dsfab.slicing.cutting.cut`).
        """
        every = np.full(len(self.inside), np.inf)
        if not isinstance(field, DividedField):
            return Layer("rim", np.stack([self.inside, -field - self.width], axis=1), np.zeros(1), every)
        inside = np.asarray(field.divided.weights @ self.inside)
        both = np.stack([inside, -field.x - self.width], axis=1)
        return Layer("rim", DividedField(field.divided, both), np.zeros(1), every)


def region_layers(surface: Surface, regions: Sequence[PatternRegion]) -> list[Layer]:
    """Return the solid regions, each as a field (n,) that is 0 along its outline.

    Raises PatternError for a region off the surface.
    """
    every = np.full(surface.n, np.inf)
    return [Layer("keep", sides(surface, faces), np.zeros(1), every) for _, faces in _faces(surface, regions, "keep")]


def region_bands(surface: Surface, regions: Sequence[PatternRegion], rim: float) -> list[RegionBand]:
    """Return the bands of regions, by default as wide as the `rim`, metres, or a quarter of half the region's width.

    Raises PatternError for a region off the surface, and for one that covers a piece of it wholly.
    """
    found = []
    for k, faces in _faces(surface, regions, "rim"):
        inside = sides(surface, faces)
        edges = outline_edges(surface, faces)
        if not edges.any():
            raise PatternError(f"{region_key(regions, k)} has no edge on the surface that a band could follow")
        ends = np.zeros(surface.n, dtype=bool)
        ends[surface.edges.ends[edges]] = True
        length = float(surface.edge_lengths[edges].sum())
        width = regions[k].width or rim or 0.25 * 2 * float(surface.areas[faces].sum()) / length
        found.append(RegionBand(Origins(ends, edges, np.zeros(surface.m, dtype=bool)), width, inside))
    return found


def _faces(surface: Surface, regions: Sequence[PatternRegion], do: str) -> Iterator[tuple[int, Bools]]:
    for k, region in enumerate(regions):
        if region.do != do:
            continue
        try:
            faces = region.faces(surface)
        except SurfaceError as error:
            raise PatternError(f"{region_key(regions, k)}: {error}") from None
        if not faces.any():
            raise PatternError(
                f"{region_key(regions, k)} has no face of the surface; make it larger, or pick by a ball"
            )
        yield k, faces


def sides(surface: Surface, faces: Bools) -> Floats:
    """Return 1 (n,) at vertices of marked faces (m,), -1 at those of unmarked faces, 0 at those of both."""
    found = np.zeros((2, surface.n), dtype=bool)
    found[0, surface.F[faces]] = found[1, surface.F[~faces]] = True
    return np.asarray(found[0].astype(np.float64) - found[1])


def outline_edges(surface: Surface, faces: Bools) -> Bools:
    """Return the edges (e,) between marked faces (m,) and unmarked ones."""
    marked = np.bincount(surface.edges.of[faces].ravel(), minlength=len(surface.edges.ends))
    return np.asarray((marked > 0) & (marked < surface.edges.count))


def distance_to_boundary(surface: Surface, reach: float = np.inf) -> Floats:
    """Return the distance (n,) along the surface, metres, to the boundary; too large or infinite beyond the reach."""
    return geodesic_distances(surface, boundary_origins(surface), reach).vertex


def distance_to_vertices(surface: Surface, vertices: Bools, reach: float = np.inf) -> Floats:
    """Return the distance (n,), metres, to the span of marked vertices.

    To patches it is straight, to points and curves along the surface, as in `distance_to_boundary`.
    """
    patch = patches(surface, vertices)
    curves = geodesic_distances(surface, curve_origins(surface, vertices & ~patch), reach)
    return np.minimum(distance_to_patches(surface, patch), curves.vertex)


def patches(surface: Surface, vertices: Bools) -> Bools:
    """Return the marked vertices (n,) that faces connect; the rest are points and curves.

    Three vertices of the boundary mark no face, and two of them no inner edge: only the mesh decides how far these
    extend beyond the intended curve.
    """
    edges, faces = _spanned(surface, vertices)
    _, part = connected(surface.n, *surface.edges.ends[edges].T)
    return np.asarray(vertices & np.isin(part, part[surface.F[faces]]))


def distance_to_patches(surface: Surface, vertices: Bools) -> Floats:
    """Return the straight distance (n,), metres, to the span of marked vertices: their faces, edges, and themselves."""
    ends = surface.edges.ends
    faces, edges = surface.F[vertices[surface.F].all(axis=1)], ends[vertices[ends].all(axis=1)]
    return straight_distances(surface, (faces, edges, np.flatnonzero(vertices)[:, None]))


def boundary_origins(surface: Surface) -> Origins:
    """Return the boundary as origins of distances."""
    edges = surface.edges.boundary
    return Origins(_ends(surface, edges), edges, np.zeros(surface.m, dtype=bool))


def curve_origins(surface: Surface, vertices: Bools) -> Origins:
    """Return marked vertices (n,), without `patches`, and the edges of their span, as origins of distances."""
    edges, _ = _spanned(surface, vertices)
    return Origins(vertices, edges, np.zeros(surface.m, dtype=bool))


def _spanned(surface: Surface, vertices: Bools) -> tuple[Bools, Bools]:
    """Return edges (e,) and faces (m,) between marked vertices; see `patches`."""
    F, ends, boundary = surface.F, surface.edges.ends, surface.edges.boundary
    border = _ends(surface, boundary)
    edges = vertices[ends].all(axis=1) & (boundary | ~border[ends].all(axis=1))
    return edges, np.asarray(vertices[F].all(axis=1) & ~border[F].all(axis=1))


def _ends(surface: Surface, edges: Bools) -> Bools:
    found = np.zeros(surface.n, dtype=bool)
    found[surface.edges.ends[edges]] = True
    return found


def kept_layers(
    surface: Surface, marked: Bools, keep: float, rim: float, drawn: Sequence[PatternRegion] = ()
) -> list[Layer]:
    """Return the layers of kept material: regions of the user, within `keep` metres of marked vertices (n,), and within
    `rim` metres of the boundary.

    Around patches the edge of a region is straight on each face; such a patch is ragged itself. Around points and along
    curves it is smooth: see `curve_fields`. Regions of the user end at edges of the surface, which was cut for them.
    """
    patch = patches(surface, marked)
    regions = []
    if keep and (marked & ~patch).any():
        regions.append(("keep", curve_origins(surface, marked & ~patch), keep))
    if rim and surface.edges.boundary.any():
        regions.append(("rim", boundary_origins(surface), rim))
    bands = region_bands(surface, drawn, rim)
    origins = [*((one, reach) for _, one, reach in regions), *((band.outline, band.width) for band in bands)]
    fields = curve_fields(surface, origins)
    named = [(name, field, reach) for (name, _, reach), field in zip(regions, fields, strict=False)]
    if keep and patch.any():
        ragged = -distance_to_patches(surface, patch)
        name, even, _ = named[0] if named else ("", ragged, 0.0)
        if name == "keep" and isinstance(even, np.ndarray):
            ragged, named = np.maximum(ragged, even), named[1:]
        named.insert(0, ("keep", ragged, keep))
    every = np.full(surface.n, np.inf)
    banded = [band.layer(field) for band, field in zip(bands, fields[len(regions) :], strict=True)]
    return [
        *region_layers(surface, drawn),
        *banded,
        *(Layer(name, field, np.array([-reach]), every) for name, field, reach in named),
    ]
