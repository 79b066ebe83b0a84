"""`PatternRegion`: what a person draws on a surface, `[[pattern.region]]` in a preset: solid, void, or with a band.

The mesh is cut along the outlines of regions before anything is solved: statics, pattern, sheet and solid all have
edges there, and a void is a hole in the surface for each of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from dsfab.arrays import Bools, Floats
from dsfab.errors import SurfaceError
from dsfab.surface.extent import Extent
from dsfab.surface.mesh import Surface
from dsfab.surface.outline_cut import Outlined, with_outline
from dsfab.surface.picker import Picker, extent_of, has_outline
from dsfab.surface.pickers import STRICT, Real
from dsfab.surface.topology import corner_fans, edge_table


class RegionError(SurfaceError, ValueError):
    """A region that contradicts itself; being a ValueError too, pydantic collects it with the key that it is at."""


@dataclass(frozen=True)
class PatternRegion:
    """A part of the surface with a will of its own.

    at    : where it is. Its edge is a line for the pickers plan, curve, brush, ball, box and side; the others mean
            vertices, and it runs halfway between those that are picked and those that are not.
    do    : keep, it is solid; void, there is nothing; rim, it has a solid band inside of its edge.
    width : of the band, metres along the surface; left out, that of pattern.rim, or an eighth of the region's.
    name  : what messages call it.

    Raises RegionError for a width of what has no band, and for a band of what has no outline.
    """

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
                f"do = 'rim' needs an outline, and pick = {self.at.pick!r} means vertices; use plan, curve, brush, "
                "ball, box or side"
            )

    def faces(self, surface: Surface) -> Bools:
        """(m,) the faces in the region, of a surface that is cut along its outline (see `with_regions`).

        Raises SurfaceError as its picker does.
        """
        extent = extent_of(self.at, surface)
        return surface.faces_of(self.at.vertices(surface)) if extent is None else extent.depth(surface.centroids) > 0

    def cut_as(self, other: "PatternRegion") -> bool:
        """Whether a surface is cut alike for both."""
        return (self.at, self.do == "void") == (other.at, other.do == "void")


def region_key(regions: Sequence[PatternRegion], k: int) -> str:
    """What a message calls a region: 'pattern.region.0 (door)'."""
    return f"pattern.region.{k}" + (f" ({regions[k].name})" if regions[k].name else "")


class RegionedSurface(NamedTuple):
    """A surface that is cut along the outlines of regions, and (k,) the area that each void took from it, m2."""

    surface: Surface
    taken: Floats


def with_regions(surface: Surface, regions: Sequence[PatternRegion]) -> RegionedSurface:
    """The surface with edges along the outlines of regions, and without those that are void.

    Raises SurfaceError, which names the region, for one that is nowhere on the surface, and for voids that take all of
    it.
    """
    nothing = np.zeros(surface.n, dtype=bool)
    made, taken = Outlined(surface, nothing, nothing), np.zeros(len(regions))
    extents = _extents(surface, regions)
    for k in sorted(range(len(regions)), key=lambda k: (regions[k].do != "void", extents[k] is not None, k)):
        try:
            made, taken[k] = _cut(made, regions[k], extents[k])
        except SurfaceError as error:
            raise SurfaceError(f"{region_key(regions, k)}: {error}") from None
    return RegionedSurface(made.surface, taken)


def _extents(surface: Surface, regions: Sequence[PatternRegion]) -> list[Extent | None]:
    """The parts of space that regions are, as the surface is before any of them is cut."""
    found = []
    for k, region in enumerate(regions):
        try:
            found.append(extent_of(region.at, surface))
        except SurfaceError as error:
            raise SurfaceError(f"{region_key(regions, k)}: {error}") from None
    return found


def _cut(made: Outlined, region: PatternRegion, extent: Extent | None) -> tuple[Outlined, float]:
    """A surface cut for one region, and the area of the void that it is, m2."""
    if extent is None and region.do != "void":
        return made, 0.0  # the edge of what is picked by vertices is no line
    made, here = _ragged(made, region.at) if extent is None else _along(made, extent)
    if not here.any():
        raise SurfaceError(f"it is nowhere on the surface{_how_far(made, extent)}; move it onto the surface")
    if region.do != "void":
        return made, 0.0
    return _without(made, here), float(made.surface.areas[here].sum())


def _along(made: Outlined, extent: Extent) -> tuple[Outlined, Bools]:
    """A surface cut along the outline of an extent, and (m,) its faces within."""
    cut = with_outline(made.surface, extent, made.fixed)
    return replace(cut, fixed=cut.fixed | cut.on), extent.depth(cut.surface.centroids) > 0


def _ragged(made: Outlined, at: Picker) -> tuple[Outlined, Bools]:
    """A surface cut halfway between picked vertices and others, and (m,) its faces on the side of the picked ones."""
    picked, edges = at.vertices(made.surface), made.surface.edges.ends
    cut = made.halved(picked[edges].sum(axis=1) == 1)
    marks = np.zeros(cut.surface.n, dtype=bool)
    marks[: len(picked)] = picked
    return cut, np.asarray(marks[cut.surface.F].any(axis=1))


def _how_far(made: Outlined, extent: Extent | None) -> str:
    away = -float(extent.depth(made.surface.V).max()) if extent else 0.0
    return f", {away:.3g} m from its nearest vertex" if away > 0 else ""


def _without(made: Outlined, faces: Bools) -> Outlined:
    """A surface without faces (m,); where what is left touches in a point, it parts.

    Raises SurfaceError where none is left.
    """
    if faces.all():
        raise SurfaceError("it takes all that is left of the surface; draw a smaller one")
    old = made.surface
    used, F = np.unique(old.F[~faces], return_inverse=True)
    F = F.reshape(-1, 3)
    fans = corner_fans(F, edge_table(F))
    if fans.max() >= len(used):
        of_fan = np.empty(int(fans.max()) + 1, dtype=np.int64)
        of_fan[fans] = F
        used, F = used[of_fan], fans
    return Outlined(Surface(old.V[used], F), made.on[used], made.fixed[used])
