"""Drawn regions as layers: solid ones, and bands along the inside of an outline."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.errors import PatternError, SurfaceError
from dsfab.pattern.layers import Layer
from dsfab.surface import DividedField, Origins, PatternRegion, Surface, region_key

SHARE = 0.25
"""Width of a band where none is given, as a share of half the region's."""


@dataclass(frozen=True, eq=False)
class RegionBand:
    """A band along the outline of a region, on its inside.

    outline : the edges between faces in the region and others, to measure from.    width : metres.
    inside  : (n,) 1 in the region, 0 on its outline, -1 outside.
    """

    outline: Origins
    width: float
    inside: Floats

    def layer(self, field: Floats | DividedField) -> Layer:
        """What slicing cuts, of minus the distance (n,) from the outline, metres: the region without its middle.

        Two fields with a level at 0, of which the first is over it and the second is not (see `dsfab.slicing.cut`).
        """
        every = np.full(len(self.inside), np.inf)
        if not isinstance(field, DividedField):
            return Layer("rim", np.stack([self.inside, -field - self.width], axis=1), np.zeros(1), every)
        inside = np.asarray(field.divided.weights @ self.inside)
        both = np.stack([inside, -field.x - self.width], axis=1)
        return Layer("rim", DividedField(field.divided, both), np.zeros(1), every)


def region_layers(surface: Surface, regions: Sequence[PatternRegion]) -> list[Layer]:
    """The solid regions, each as a field (n,) that is 0 along its outline.

    Raises PatternError for one that is nowhere on the surface.
    """
    every = np.full(surface.n, np.inf)
    return [Layer("keep", sides(surface, faces), np.zeros(1), every) for _, faces in _faces(surface, regions, "keep")]


def region_bands(surface: Surface, regions: Sequence[PatternRegion], rim: float) -> list[RegionBand]:
    """The bands of the regions that have one; as wide as the `rim`, metres, where they do not say.

    Raises PatternError for a region that is nowhere on the surface, or wholly covers a piece of it.
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
        width = regions[k].width or rim or SHARE * 2 * float(surface.areas[faces].sum()) / length
        found.append(RegionBand(Origins(ends, edges, np.zeros(surface.m, dtype=bool)), width, inside))
    return found


def _faces(surface: Surface, regions: Sequence[PatternRegion], do: str) -> Iterator[tuple[int, Bools]]:
    """Number and faces (m,) of the regions of a kind."""
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
    """(n,) 1 at the vertices of marked faces (m,), -1 at those of others, 0 at those of both."""
    found = np.zeros((2, surface.n), dtype=bool)
    found[0, surface.F[faces]] = found[1, surface.F[~faces]] = True
    return np.asarray(found[0].astype(np.float64) - found[1])


def outline_edges(surface: Surface, faces: Bools) -> Bools:
    """(e,) the edges between marked faces (m,) and others."""
    marked = np.bincount(surface.edges.of[faces].ravel(), minlength=len(surface.edges.ends))
    return np.asarray((marked > 0) & (marked < surface.edges.count))
