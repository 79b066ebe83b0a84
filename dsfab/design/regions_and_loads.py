"""The surface, cut along the outlines of its regions, and its load cases."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Ints
from dsfab.core.derived import derived_results
from dsfab.core.errors import SurfaceError
from dsfab.design.log import Log
from dsfab.diffusion import Symmetry
from dsfab.preset.model import Preset
from dsfab.statics import SpreadLoad, spread_load
from dsfab.surface import (
    All,
    Load,
    LoadCase,
    PatternRegion,
    Support,
    Surface,
    VerticesLeft,
    combined_case,
    edges_of,
    load_cases,
    region_key,
    with_regions,
)

IMAGE_DIFFERENCE = 0.3
"""Largest accepted difference of a region or guide from its image, as a share of its area, because edges are ragged."""


def surface_with_regions(preset: Preset, surface: Surface, log: Log) -> Surface:
    """Return the surface with cuts along the outlines of the preset's regions; voids are cut out.
    Raises SurfaceError for a region outside of the surface, and for voids that separate a support, a load or a piece of
    the surface from the supports."""
    regions, voids = preset.pattern.region, preset.pattern.voids
    cut = with_regions(surface, regions)
    for k in voids:
        log.note("surface", f"{region_key(regions, k)} is void: {cut.taken[k]:.3g} m2 of {surface.area:.4g} m2")
    if voids:
        derived_results(cut.surface)[_before_voids] = cut.whole, cut.vertices
        _check_pieces(preset, surface, cut.surface)
    return cut.surface


class Acting(NamedTuple):
    """Supports and loads whose pickers select vertices of one surface."""

    support: tuple[Support, ...]
    load: tuple[Load, ...]


def acting_on(preset: Preset, surface: Surface) -> Acting:
    """Return the supports and the loads of a preset on its surface.
    Pickers select vertices before voids are cut out, so the edge of an oculus is not a boundary. Raises SurfaceError if
    all vertices of a picker are inside voids."""
    section = preset.surface
    if not preset.pattern.voids:
        return Acting(section.support, section.load)
    uncut, vertices = _before_voids(preset, surface)
    words = _void_names(preset)
    support, load = (
        tuple(
            _remaining_entry(f"surface.{key}.{k}", entry, uncut, vertices, surface.edges.ends, words)
            for k, entry in enumerate(getattr(section, key))
        )
        for key in ("support", "load")
    )
    return Acting(support, load)


def whole_surface(preset: Preset, surface: Surface) -> Surface:
    """Return the surface of a preset before its voids are cut out."""
    return _before_voids(preset, surface)[0] if preset.pattern.voids else surface


def _before_voids(preset: Preset, surface: Surface) -> tuple[Surface, Ints]:
    """Return the surface before its voids are cut out, and the number (n,) there of each vertex of `surface`."""
    results = derived_results(surface)
    if _before_voids not in results:
        from dsfab.design.surface_and_statics import base_surface  # a circular import

        cut = with_regions(base_surface(preset), preset.pattern.region)
        results[_before_voids] = cut.whole, cut.vertices
    uncut, vertices = results[_before_voids]
    return uncut, vertices


def _remaining_entry(key: str, entry: Any, uncut: Surface, vertices: Ints, edges: Ints, voids: str) -> Any:
    picker = getattr(entry, "at", None)
    if picker is None or isinstance(picker, All):
        return entry
    picked = picker.vertices(uncut)[vertices]
    picked_left = np.flatnonzero(picked)
    if not len(picked_left):
        raise SurfaceError(
            f"{key}: all of its vertices are inside {voids}; make the void smaller, or pick other vertices"
        )
    edges_left = edges[picked[edges].all(axis=1)]
    is_picked = edges_of(picker, uncut)[uncut.edges.edges_between(*vertices[edges_left].T)]
    ends = tuple(map(tuple, edges_left[is_picked].tolist()))
    return replace(entry, at=VerticesLeft(tuple(picked_left.tolist()), ends=ends))


def one_sided_message(surface: Surface, regions: Sequence[PatternRegion], symmetry: Symmetry | None) -> str:
    """Return a sentence about regions without symmetric images; '' if all images of regions are regions."""
    if symmetry is None:
        return ""
    exceptions = []
    for k, region in enumerate(regions):
        if region.do == "void":
            continue  # the symmetry of the surface already includes its voids
        inside = region.faces(surface)
        differing_areas = [float(surface.areas @ (inside[images] != inside)) for images in symmetry.faces]
        matching = int((np.array(differing_areas) <= IMAGE_DIFFERENCE * float(surface.areas @ inside)).sum())
        if matching < symmetry.order:
            exceptions.append(f"{region_key(regions, k)} at {matching}")
    message = f"the stripes have a symmetry of {symmetry.order} images, but {', '.join(exceptions)} of them only"
    return message if exceptions else ""


def _void_names(preset: Preset) -> str:
    names = [region_key(preset.pattern.region, k) for k in preset.pattern.voids]
    return f"the void {names[0]}" if len(names) == 1 else f"the voids {', '.join(names)}"


def _check_pieces(preset: Preset, before: Surface, after: Surface) -> None:
    count, label = after.pieces
    supports = acting_on(preset, after).support
    if count == before.pieces[0] or not supports:
        return
    supported: Bools = np.logical_or.reduce([support.at.vertices(after) for support in supports])
    area = np.bincount(label, after.areas, count)
    loose = np.bincount(label, supported[after.F].any(axis=1), count) == 0
    if loose.any():
        piece = int(np.where(loose, area, 0.0).argmax())
        x, y, z = np.average(after.centroids[label == piece], axis=0, weights=after.areas[label == piece])
        raise SurfaceError(
            f"{_void_names(preset)} part{'s' if len(preset.pattern.voids) == 1 else ''} {int(loose.sum())} of {count} "
            f"pieces of the surface from all supports, the largest ({area[piece]:.3g} m2) around ({x:.3g}, {y:.3g}, "
            f"{z:.3g}) m; leave a connection, support the piece, or enlarge the void over it"
        )


@dataclass(frozen=True, eq=False)
class Loading:
    """A load for which the sheet is solved.
    name    : name of the case or the combination; empty for the sum of all cases.
    factors : factors of the cases in a combination; None for a case. Combinations are sums of solved cases."""

    name: str
    load: LoadCase
    spread: SpreadLoad
    factors: Mapping[str, float] | None = None


def loadings(preset: Preset, surface: Surface) -> list[Loading]:
    """Return the cases of a preset, then its combinations, then the sum of several cases.
    Raises SurfaceError for supports and loads without a vertex."""
    section, weight = preset.surface, preset.statics.area_weight
    acting = acting_on(preset, surface)
    loads = load_cases(surface, acting.support, acting.load, weight)
    parts = {name: spread_load(surface, [ld for ld in acting.load if ld.case == name], weight) for name in loads}
    cases = [Loading(name, load, parts[name]) for name, load in loads.items()]
    sums = [(combination.name, dict(combination.factors)) for combination in section.sums]
    if len(loads) > 1:
        sums.append(("", dict.fromkeys(loads, 1.0)))
    return cases + [
        Loading(name, combined_case(loads, factors), SpreadLoad.total(parts, factors), factors)
        for name, factors in sums
    ]
