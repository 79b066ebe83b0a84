"""The surface with its regions: cut along their outlines, without the voids, and still held and loaded."""

from collections.abc import Iterator

import numpy as np

from dsfab.arrays import Bools
from dsfab.errors import SurfaceError
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.surface import Picker, Surface, region_key, with_regions


def surface_with_regions(preset: Preset, surface: Surface, log: Log) -> Surface:
    """The surface cut along the outlines of the regions of a preset, and without those that are void.

    Raises SurfaceError for a region that is nowhere on it, and for voids that leave a support, a load or a piece of the
    surface with nothing that holds it.
    """
    regions, voids = preset.pattern.region, preset.pattern.voids
    cut = with_regions(surface, regions)
    for k in voids:
        log.note("surface", f"{region_key(regions, k)} is void: {cut.taken[k]:.3g} m2 of {surface.area:.4g} m2")
    if voids:
        _check_picks(preset, surface, cut.surface)
        _check_pieces(preset, surface, cut.surface)
    return cut.surface


def _pickers(preset: Preset) -> Iterator[tuple[str, Picker]]:
    """Where supports and loads are, with their keys."""
    for key in ("support", "load"):
        for k, one in enumerate(getattr(preset.surface, key)):
            if (at := getattr(one, "at", None)) is not None:
                yield f"surface.{key}.{k}", at


def _void_words(preset: Preset) -> str:
    names = [region_key(preset.pattern.region, k) for k in preset.pattern.voids]
    return f"the void {names[0]}" if len(names) == 1 else f"the voids {', '.join(names)}"


def _check_picks(preset: Preset, before: Surface, after: Surface) -> None:
    """Raise SurfaceError for what picked vertices and picks none any more."""
    for key, at in _pickers(preset):
        try:
            at.vertices(after)
        except SurfaceError:
            at.vertices(before)  # where nothing was before either, that is what has to be said
            raise SurfaceError(
                f"{key}: everything that it picks has been taken away by {_void_words(preset)}; draw that smaller, or "
                "pick something else"
            ) from None


def _check_pieces(preset: Preset, before: Surface, after: Surface) -> None:
    """Raise SurfaceError for pieces that voids part from all supports."""
    count, label = after.pieces
    if count == before.pieces[0] or not preset.surface.support:
        return
    held: Bools = np.logical_or.reduce([support.at.vertices(after) for support in preset.surface.support])
    area = np.bincount(label, after.areas, count)
    loose = np.bincount(label, held[after.F].any(axis=1), count) == 0
    if loose.any():
        piece = int(np.where(loose, area, 0.0).argmax())
        x, y, z = np.average(after.centroids[label == piece], axis=0, weights=after.areas[label == piece])
        raise SurfaceError(
            f"{_void_words(preset)} part{'s' if len(preset.pattern.voids) == 1 else ''} {int(loose.sum())} of {count} "
            f"pieces of the surface from all supports, the largest ({area[piece]:.3g} m2) around ({x:.3g}, {y:.3g}, "
            f"{z:.3g}) m; leave a connection, support it, or draw the void over it"
        )
