"""Regions that stay material whatever the stripes say: around loads and supports, along the boundary, and as drawn."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.pattern.curve_fields import curve_fields, straight_distances
from dsfab.pattern.layers import Layer
from dsfab.pattern.region_layers import region_bands, region_layers
from dsfab.surface import Origins, PatternRegion, geodesic_distances
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected


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
    return straight_distances(surface, (faces, edges, np.flatnonzero(vertices)[:, None]))


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


def kept_layers(
    surface: Surface, marked: Bools, keep: float, rim: float, drawn: Sequence[PatternRegion] = ()
) -> list[Layer]:
    """What is material: drawn regions, what is within `keep` metres of marked vertices (n,), and within `rim` metres of
    the boundary.

    Around patches that is to a straight line over each face; such a patch is ragged itself. Around points and along
    curves the edge of the region is even: see `curve_fields`. Drawn regions end where the surface is cut for them.
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
