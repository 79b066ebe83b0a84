"""Regions that stay material."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import PatternError, SurfaceError
from dsfab.pattern.layers import Layer
from dsfab.surface import Distances, Origins, PatternRegion, Surface, geodesic_distances, nearest_places, region_key
from dsfab.surface.fields import DividedField, DividedSurface
from dsfab.surface.topology import link_components

EVEN = 0.01  # Largest error of a region's outline, divided by the region's `reach` (see `curve_fields`).
SNAP = 0.05
"""Usual `slicing.snap`: a cut nearer to a vertex than this fraction of an edge is moved to the vertex.
If this would move a region's outline by over 2 x `EVEN` x `reach` (see `SHORT`), edges at the vertex are halved."""
SHORT = 1 / 16
"""Shortest edge that may be halved, divided by `reach`. A region ends at the distance `reach` from its origins."""
FINEST = 1 / 16  # Shortest edge that may be halved, as a fraction of the longest side of its original face.
NEAR = 0.3  # Largest move of an outline onto a vertex, in mesh edges; `EVEN` x `reach` is a second limit.
ASIDE = 0.1  # An edge is divided at the middle, or at an outline within this fraction of the edge from the middle.


def curve_fields(
    surface: Surface, regions: Sequence[tuple[Origins, float]], rounds: int = 16, most_parts: int = 300_000
) -> list[Floats | DividedField]:
    """Return a field (n,) for each region: minus the distance (m) along the surface from the region's origins.
    regions : origins, and the distance (m) at which the region ends. Far outside, distances are only lower bounds.
    rounds : largest number of mesh refinements.    most_parts : largest number of added faces."""
    divided, reaches = DividedSurface.undivided(surface), [reach for _, reach in regions]
    for rounds_left in reversed(range(rounds)):
        fields = [
            geodesic_distances(divided.surface, divided.origins_on_parts(origins), reach) for origins, reach in regions
        ]
        marks = _edges_to_halve(divided, fields, reaches)
        if not (rounds_left and marks.any()) or divided.surface.m > surface.m + most_parts:
            break
        divided = divided.with_halved_edges(marks, _crossings(divided.surface, fields, reaches))
    if divided.surface is surface:
        return [_undivided_field(surface, region, d) for region, d in zip(regions, fields, strict=True)]
    return [
        DividedField(divided, -_snapped_distances(divided.surface, _finite_distances(d.vertex, reach), reach))
        for reach, d in zip(reaches, fields, strict=True)
    ]


def _edges_to_halve(divided: DividedSurface, region_distances: Sequence[Distances], reaches: Sequence[float]) -> Bools:
    parts, uncut = divided.surface, divided.whole
    size, sides = parts.edge_lengths, parts.edges.of
    finest, longest = np.zeros(len(size)), uncut.edge_lengths[uncut.edges.of].max(axis=1)
    np.maximum.at(finest, sides.ravel(), np.repeat(FINEST * longest[divided.parent], 3))
    marks, open_ = np.zeros(len(size), dtype=bool), np.ones(parts.m, dtype=bool)
    for distances, reach in zip(region_distances, reaches, strict=True):
        seen = np.zeros(len(size), dtype=bool)
        seen[sides[open_]] = True
        marks |= seen & _uneven_edges(parts, distances, reach) & (size > np.maximum(SHORT * reach, finest))
        open_ &= np.maximum(distances.vertex[parts.F], distances.middle[sides]).max(axis=1) > reach
    return marks


def _crossings(surface: Surface, region_distances: Sequence[Distances], reaches: Sequence[float]) -> Floats:
    """Return the fraction (e,), 0 to 1, at which to divide each edge: at a region's outline near 1/2, else 1/2."""
    position, count = np.full(len(surface.edges.ends), 0.5), np.zeros(len(surface.edges.ends), dtype=np.int64)
    for distances, reach in zip(region_distances, reaches, strict=True):
        middle = distances.middle
        for end, direction in zip(distances.vertex[surface.edges.ends].T, (-0.5, 0.5), strict=True):
            with np.errstate(invalid="ignore", divide="ignore"):
                parameter = (reach - middle) / (end - middle)
            is_close = (parameter > 0) & (parameter < 2 * ASIDE)
            position[is_close], count = 0.5 + direction * parameter[is_close], count + is_close
    return np.where(count == 1, position, 0.5)


def _distance_growth(surface: Surface, distance: Floats) -> tuple[Floats, Floats]:
    ends, vertex_growth = surface.edges.ends, np.zeros(surface.n)
    growth = np.abs(np.diff(distance[ends], axis=1)[:, 0])
    np.maximum.at(vertex_growth, ends.ravel(), np.repeat(growth, 2))
    return growth, vertex_growth


def _snapped_distances(surface: Surface, distance: Floats, reach: float) -> Floats:
    _, vertex_growth = _distance_growth(surface, distance)
    is_near = np.abs(distance - reach) <= np.minimum(NEAR * vertex_growth, EVEN * reach)
    is_near[surface.F[is_near[surface.F].all(axis=1)]] = False
    return np.where(is_near, reach, distance)


def _undivided_field(surface: Surface, region: tuple[Origins, float], distances: Distances) -> Floats:
    origins, reach = region
    near_vertices = np.unique(surface.F[distances.reached])
    straight = euclidean_distances(
        surface, (surface.edges.ends[origins.edges], np.flatnonzero(origins.vertices)[:, None])
    )
    is_straight = np.abs(straight[near_vertices] - distances.vertex[near_vertices]).max(initial=0.0) <= 1e-3 * reach
    if is_straight and np.delete(straight, near_vertices).min(initial=np.inf) > reach:
        return -straight
    return -_finite_distances(distances.vertex, reach)


def _finite_distances(distance: Floats, reach: float) -> Floats:
    is_finite = np.isfinite(distance)
    return np.where(is_finite, distance, max(2 * reach, distance[is_finite].max(initial=0.0)))


def _uneven_edges(surface: Surface, distances: Distances, reach: float) -> Bools:
    """Return a mask (e,) of edges to divide for a more accurate outline at the distance `reach` (m)."""
    vertex, middle, faces = distances.vertex, distances.middle, np.flatnonzero(distances.reached)
    sides, ends = surface.edges.of[faces], surface.edges.ends
    deviation = np.abs(vertex[ends[sides]].mean(axis=2) - middle[sides])
    farthest = np.maximum(vertex[surface.F[faces]], middle[sides]).max(axis=1)
    deviation[farthest == 0] = reach  # faces with distance 0 on all sides are divided, to measure distances inside
    is_uneven = np.zeros(len(ends), dtype=bool)
    is_uneven[sides[(deviation > EVEN * reach) & (farthest + deviation.max(axis=1) >= reach)[:, None]]] = True
    finite = _finite_distances(vertex, reach)
    growth, vertex_growth = _distance_growth(surface, finite)
    deviation, tolerance = np.abs(finite - reach), 2 * EVEN * reach
    moved = (deviation <= SNAP * vertex_growth) & (deviation > tolerance)
    return np.asarray(is_uneven | (moved[ends].any(axis=1) & (SNAP * growth > tolerance)))


def euclidean_distances(surface: Surface, simplices: Sequence[Ints]) -> Floats:
    """Return the straight distance (n,), m, from each vertex to the nearest of the given faces, edges and vertices.
    simplices : vertex indices (k, 3) of faces, (k, 2) of edges, (k, 1) of vertices."""
    squared = np.full(surface.n, np.inf)
    for group in simplices:
        if len(group):
            squared = np.minimum(squared, nearest_places(surface.V, surface.V, group).squared)
    return np.asarray(np.sqrt(squared))


@dataclass(frozen=True, eq=False)
class RegionBand:
    """A band along the outline of a region, inside the region. outline : edges on the outline.    width : metres.
    inside  : (n,) 1 inside the region, 0 on its outline, -1 outside."""

    outline: Origins
    width: float
    inside: Floats

    def layer(self, field: Floats | DividedField) -> Layer:
        """Return the band as a layer of the pattern. field : minus the distance (n,) from the outline, metres."""
        half_width = np.full(len(self.inside), np.inf)
        if not isinstance(field, DividedField):
            return Layer("rim", np.stack([self.inside, -field - self.width], axis=1), np.zeros(1), half_width)
        inside = np.asarray(field.divided.weights @ self.inside)
        fields = np.stack([inside, -field.x - self.width], axis=1)
        return Layer("rim", DividedField(field.divided, fields), np.zeros(1), half_width)


def region_layers(surface: Surface, regions: Sequence[PatternRegion]) -> list[Layer]:
    """Return a pattern layer for each solid region of the user. Raises PatternError for a region off the surface.
    The values (n,) are 1 inside the region, 0 on its outline, -1 outside."""
    half_width = np.full(surface.n, np.inf)
    return [
        Layer("keep", region_sides(surface, faces), np.zeros(1), half_width)
        for _, faces in _faces(surface, regions, "keep")
    ]


def region_bands(surface: Surface, regions: Sequence[PatternRegion], rim: float) -> list[RegionBand]:
    """Return a band inside the outline of each region that the preset marks with do = "rim".
    rim : default width, m; 0 to compute it from the region.    Raises PatternError for an impossible region."""
    bands = []
    for k, faces in _faces(surface, regions, "rim"):
        inside = region_sides(surface, faces)
        edges = outline_edges(surface, faces)
        if not edges.any():
            raise PatternError(
                f"the outline of {region_key(regions, k)} does not cross the surface; move or shrink the region"
            )
        length = float(surface.edge_lengths[edges].sum())
        width = regions[k].width or rim or 0.25 * 2 * float(surface.areas[faces].sum()) / length
        origins = Origins(_edge_ends(surface, edges), edges, np.zeros(surface.m, dtype=bool))
        bands.append(RegionBand(origins, width, inside))
    return bands


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
                f"{region_key(regions, k)} contains no face of the surface; enlarge the region, or use pick = 'ball'"
            )
        yield k, faces


def region_sides(surface: Surface, faces: Bools) -> Floats:
    """Return (n,): 1 if all faces at a vertex are marked, -1 if none is, else 0. faces : (m,) mask of marked faces."""
    is_side = np.zeros((2, surface.n), dtype=bool)
    is_side[0, surface.F[faces]] = is_side[1, surface.F[~faces]] = True
    return np.asarray(is_side[0].astype(np.float64) - is_side[1])


def outline_edges(surface: Surface, faces: Bools) -> Bools:
    """Return a mask (e,) of the edges between marked faces (m,) and other faces."""
    marked = np.bincount(surface.edges.of[faces].ravel(), minlength=len(surface.edges.ends))
    return np.asarray((marked > 0) & (marked < surface.edges.count))


def distance_to_boundary(surface: Surface, reach: float = np.inf) -> Floats:
    """Return the distance (n,) to the boundary along the surface, metres; distances above `reach` are not valid."""
    return geodesic_distances(surface, boundary_origins(surface), reach).vertex


def distance_to_vertices(surface: Surface, vertices: Bools, reach: float = np.inf) -> Floats:
    """Return the distance (n,), metres, to marked vertices, and to edges and faces with only marked vertices.
    vertices : mask (n,) of marked vertices.    Distances above `reach` are not valid."""
    patch = patches(surface, vertices)
    curves = geodesic_distances(surface, curve_origins(surface, vertices & ~patch), reach)
    return np.minimum(distance_to_patches(surface, patch), curves.vertex)


def patches(surface: Surface, vertices: Bools) -> Bools:
    """Return a mask (n,) of marked vertices that are connected, along edges, to a face with three marked vertices."""
    edges, faces = _spanned_parts(surface, vertices)
    _, part = link_components(surface.n, *surface.edges.ends[edges].T)
    return np.asarray(vertices & np.isin(part, part[surface.F[faces]]))


def distance_to_patches(surface: Surface, vertices: Bools) -> Floats:
    """Return the straight distance (n,), m, to marked vertices, and to edges and faces with only marked vertices."""
    ends = surface.edges.ends
    faces, edges = surface.F[vertices[surface.F].all(axis=1)], ends[vertices[ends].all(axis=1)]
    return euclidean_distances(surface, (faces, edges, np.flatnonzero(vertices)[:, None]))


def boundary_origins(surface: Surface) -> Origins:
    """Return the boundary edges and vertices as the origins of distances."""
    edges = surface.edges.boundary
    return Origins(_edge_ends(surface, edges), edges, np.zeros(surface.m, dtype=bool))


def curve_origins(surface: Surface, vertices: Bools) -> Origins:
    """Return marked vertices (n,), and edges between two marked vertices, as the origins of distances."""
    edges, _ = _spanned_parts(surface, vertices)
    return Origins(vertices, edges, np.zeros(surface.m, dtype=bool))


def _spanned_parts(surface: Surface, vertices: Bools) -> tuple[Bools, Bools]:
    F, ends, boundary = surface.F, surface.edges.ends, surface.edges.boundary
    border = _edge_ends(surface, boundary)
    edges = vertices[ends].all(axis=1) & (boundary | ~border[ends].all(axis=1))
    return edges, np.asarray(vertices[F].all(axis=1) & ~border[F].all(axis=1))


def _edge_ends(surface: Surface, edges: Bools) -> Bools:
    is_end = np.zeros(surface.n, dtype=bool)
    is_end[surface.edges.ends[edges]] = True
    return is_end


def kept_layers(
    surface: Surface, marked: Bools, keep: float, rim: float, regions_of_user: Sequence[PatternRegion] = ()
) -> list[Layer]:
    """Return the layers of the pattern for all parts that stay solid.
    keep : width (m) of solid parts around `marked` vertices (n,).    rim : width (m) of the solid rim.
    regions_of_user : solid regions and bands that the preset defines."""
    patch = patches(surface, marked)
    regions = []
    if keep and (marked & ~patch).any():
        regions.append(("keep", curve_origins(surface, marked & ~patch), keep))
    if rim and surface.edges.boundary.any():
        regions.append(("rim", boundary_origins(surface), rim))
    bands = region_bands(surface, regions_of_user, rim)
    origins = [*((origin, reach) for _, origin, reach in regions), *((band.outline, band.width) for band in bands)]
    fields = curve_fields(surface, origins)
    named = [(name, field, reach) for (name, _, reach), field in zip(regions, fields, strict=False)]
    if keep and patch.any():
        ragged = -distance_to_patches(surface, patch)
        name, even, _ = named[0] if named else ("", ragged, 0.0)
        if name == "keep" and isinstance(even, np.ndarray):
            ragged, named = np.maximum(ragged, even), named[1:]
        named.insert(0, ("keep", ragged, keep))
    half_width = np.full(surface.n, np.inf)
    banded = [band.layer(field) for band, field in zip(bands, fields[len(regions) :], strict=True)]
    return [
        *region_layers(surface, regions_of_user),
        *banded,
        *(Layer(name, field, np.array([-reach]), half_width) for name, field, reach in named),
    ]
