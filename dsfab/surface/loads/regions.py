"""`PatternRegion`: a part of the surface that is solid, is a hole (void), or has a solid strip along its edge.

Presets list regions as `[[pattern.region]]`. dsfab cuts the mesh along the outlines of regions before any analysis.
All later stages work on the surface without voids."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.outline_cuts import OutlinedSurface, with_outline
from dsfab.surface.loads.outlines import Picker, extent_of, has_outline
from dsfab.surface.loads.pickers import STRICT, Extent, Real
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import corner_fans, edge_table


class RegionError(SurfaceError, ValueError):
    """Error for a region with contradictory values; also a ValueError, so that pydantic adds the preset's key."""


@dataclass(frozen=True)
class PatternRegion:
    """A part of the surface that is solid, is a hole, or has a solid strip along its edge.

    at    : picker (selection of vertices). The pickers plan, curve, brush, ball, box and side give a smooth edge.
            With any other picker, the region's edge is halfway between picked and unpicked vertices.
    do    : "keep": a solid region. "void": a hole. "rim": a solid strip along the inside of the region's edge.
    width : width of the strip, metres; by default pattern.rim, else 1/8 of the region's width.
    name  : text for messages.

    Raises RegionError for a `width` without do = "rim", and for do = "rim" in a region without a smooth edge."""

    __pydantic_config__: ClassVar[Any] = STRICT
    at: Picker
    do: Literal["keep", "void", "rim"]
    width: Annotated[Real, Gt(0)] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if self.width is not None and self.do != "rim":
            raise RegionError(f"width is for do = 'rim'; a region with do = {self.do!r} has no band")
        if self.do == "rim" and not has_outline(self.at):
            raise RegionError(
                f"do = 'rim' needs an outline, but pick = {self.at.pick!r} selects only vertices; set pick = 'plan', "
                "'curve', 'brush', 'ball', 'box' or 'side'"
            )

    def faces(self, surface: Surface) -> Bools:
        """Return a mask (m,) of the region's faces on a surface with edges along the outline.
        Raises SurfaceError if the picker `at` raises it."""
        extent = extent_of(self.at, surface)
        return surface.faces_of(self.at.vertices(surface)) if extent is None else extent.depth(surface.centroids) > 0

    def cut_as(self, region: "PatternRegion") -> bool:
        """Return True if this region and `region` cut the surface along the same outline and remove the same faces."""
        return (self.at, self.do == "void") == (region.at, region.do == "void")


def region_key(regions: Sequence[PatternRegion], k: int) -> str:
    """Return the name of region number k for messages: 'pattern.region.0 (door)'."""
    return f"pattern.region.{k}" + (f" ({regions[k].name})" if regions[k].name else "")


class RegionedSurface(NamedTuple):
    """A surface that is cut along the outlines of regions. Voids are regions without material.
    surface  : the surface without voids.    whole : the surface before voids are removed.
    taken    : (k,) area that each region removes, m2; 0 for regions that are no voids.
    vertices : (n,) index in `whole` of each vertex of `surface`."""

    surface: Surface
    taken: Floats
    whole: Surface
    vertices: Ints


def with_regions(surface: Surface, regions: Sequence[PatternRegion]) -> RegionedSurface:
    """Cut a surface along the outlines of regions, and remove the voids.
    The vertices of `surface` come first in the result's `whole`.
    Raises SurfaceError for a region that misses the surface, and if voids remove all faces."""
    extents, nothing = _extents(surface, regions), np.zeros(surface.n, dtype=bool)
    outlined = OutlinedSurface(surface, nothing, nothing)
    for k in _voids_first(regions):
        if extent := extents[k]:
            with _with_region_key(regions, k):
                outlined = with_outline(outlined.surface, extent, outlined.fixed)
            outlined = replace(outlined, fixed=outlined.fixed | outlined.on)
    ragged = [k for k, region in enumerate(regions) if region.do == "void" and extents[k] is None]
    picked = np.zeros((len(regions), outlined.surface.n), dtype=bool)
    for k in ragged:
        with _with_region_key(regions, k):
            picked[k] = regions[k].at.vertices(outlined.surface)
    taken_away: Bools = np.logical_or.reduce(picked)
    outlined = outlined.with_halved_edges(taken_away[outlined.surface.edges.ends].sum(axis=1) == 1)
    return _without_voids(outlined.surface, regions, extents, picked)


def _without_voids(
    surface: Surface, regions: Sequence[PatternRegion], extents: Sequence[Extent | None], picked: Bools
) -> RegionedSurface:
    taken, gone = np.zeros(len(regions)), np.zeros(surface.m, dtype=bool)
    marks = np.zeros((len(regions), surface.n), dtype=bool)
    marks[:, : picked.shape[1]] = picked
    for k in _voids_first(regions):
        extent = extents[k]
        in_region = marks[k][surface.F].any(axis=1) if extent is None else extent.depth(surface.centroids) > 0
        in_region &= ~gone
        with _with_region_key(regions, k):
            if not in_region.any() and (extent is not None or regions[k].do == "void"):
                raise SurfaceError(f"the region misses the surface{_how_far(surface, extent)}; move the region")
            if regions[k].do == "void":
                taken[k], gone = float(surface.areas[in_region].sum()), gone | in_region
            if gone.all():
                raise SurfaceError("the void removes the rest of the surface; draw a smaller void")
    if not gone.any():
        return RegionedSurface(surface, taken, surface, np.arange(surface.n))
    used, F = _compact(surface.F[~gone])
    return RegionedSurface(Surface(surface.V[used], F), taken, surface, used)


def _voids_first(regions: Sequence[PatternRegion]) -> list[int]:
    return sorted(range(len(regions)), key=lambda k: regions[k].do != "void")


@contextmanager
def _with_region_key(regions: Sequence[PatternRegion], k: int) -> Iterator[None]:
    try:
        yield
    except SurfaceError as error:
        raise SurfaceError(f"{region_key(regions, k)}: {error}") from None


def _extents(surface: Surface, regions: Sequence[PatternRegion]) -> list[Extent | None]:
    extents = list[Extent | None]()
    for k, region in enumerate(regions):
        with _with_region_key(regions, k):
            extents.append(extent_of(region.at, surface))
    return extents


def _how_far(surface: Surface, extent: Extent | None) -> str:
    away = -float(extent.depth(surface.V).max()) if extent else 0.0
    return f", {away:.3g} m from its nearest vertex" if away > 0 else ""


def _compact(F: Ints) -> tuple[Ints, Ints]:
    used, F = np.unique(F, return_inverse=True)
    F = F.reshape(-1, 3)
    fans = corner_fans(F, edge_table(F))
    if fans.max() < len(used):
        return used, F
    of_fan = np.empty(int(fans.max()) + 1, dtype=np.int64)
    of_fan[fans] = F
    return used[of_fan], fans
