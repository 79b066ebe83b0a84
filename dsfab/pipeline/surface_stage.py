"""The first step: the surface that is given, made anew where that is asked for, and cut along its regions."""

from collections.abc import Iterator

from dsfab import ways_out
from dsfab.pipeline.log import Log
from dsfab.pipeline.regions import surface_with_regions
from dsfab.pipeline.structure import statics_step
from dsfab.preset import Preset
from dsfab.preset_surface import FileSurface, OwnSurface
from dsfab.results import StaticsResult
from dsfab.surface import SizeField, Surface, change_sizes, coincident, pieces, twin_remarks
from dsfab.wording import coordinates


def surface_step(preset: Preset, log: Log) -> Surface:
    """The first stage: the surface, metres, cut along the outlines of regions."""
    with log.stage("surface", "reading the mesh" if hasattr(preset.surface, "file") else "making the shape"):
        surface = base_surface(preset, log)
        if preset.pattern.region:
            surface = surface_with_regions(preset, surface, log)
        count = pieces(surface.F, surface.edges)[0]
    if count > 1:
        doubled = coincident(surface.V)
        merge = f", unless its {doubled} vertices that lie where another one does are merged" if doubled else ""
        log.note("surface", f"the surface has {count} separate pieces; each needs its own supports{merge}")
    for remark in twin_remarks(surface.V, surface.F):
        log.note("surface", remark)
    return surface


def base_surface(preset: Preset, log: Log | None = None) -> Surface:
    """The surface of a preset before it is cut along its regions: with shorter edges where the stress changes, as
    statics on even triangles tell, if [surface] asks for that."""
    given = preset.surface
    if not isinstance(given, OwnSurface):
        return given.build()
    there = _surface_read(given, log)
    if not given.by_stress:
        return given.build(given=there)
    plain = preset.model_copy(update={"statics": preset.statics.model_copy(update={"frequencies": 0, "buckling": 0})})
    even = given.build(given=there)
    cut = surface_with_regions(plain, even, Log(None)) if preset.pattern.region else even
    surface = given.build(list(_stress_sizes(given, cut, statics_step(plain, cut, Log(None)))), there)
    if log:
        log.note("surface", f"{even.m:,} even triangles became {surface.m:,}: smaller ones where the stress changes")
    return surface


def _surface_read(given: OwnSurface, log: Log | None) -> Surface:
    """The surface before its mesh is made anew; of a file what was doubtful, repaired or dropped is told."""
    if not isinstance(given, FileSurface):
        return given.given()
    found = given.read()
    if log:
        log.file = found.record
        for remark in found.record.remarks:
            log.note("surface", f"{given.file.name}, {remark}")
        if any(given.origin):
            at = coordinates(given.origin)
            log.note("surface", f"files are about {at} m of the mesh: move what goes back by that; IFC files say it")
    return found.surface


def _stress_sizes(given: OwnSurface, surface: Surface, statics: StaticsResult) -> Iterator[SizeField]:
    """Lengths of edges by the stress at both sides of the sheet, of each case."""
    for case in statics.cases.values():
        for side in ("top", "bottom"):
            stress = case.answers.stress.tensor(side)
            yield SizeField(surface, change_sizes(surface, stress, given.edge, given.finest))


ways_out.open_way("base_surface", base_surface)
