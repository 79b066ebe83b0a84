"""Stages 5 and 6: the sheet, cut along the stripes, and the solid."""

from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.core.arrays import Floats, Ints, first
from dsfab.core.errors import PatternError, SolidError
from dsfab.core.messages import force, length
from dsfab.design.finishing import (
    AGAIN,
    Finished,
    Smallest,
    finished_cells,
    kept_to_least_widths,
    least_neck,
    merges_slits,
    smallest_widths,
    taken_rehearsal,
)
from dsfab.design.log import Log
from dsfab.design.pattern_measures import largest_filling
from dsfab.design.sheet_loads import ATTACH, held_vertices, lost_load
from dsfab.preset.model import Pattern, Preset
from dsfab.results import PatternResult, Piece, SlicingResult, StaticsResult
from dsfab.slicing import Sheet, cut, improved
from dsfab.slicing.measures.widths import kept_cells
from dsfab.surface import LoadCase, Surface, pieces
from dsfab.thickening import Base, OffsetLayer, Solid, apart, offsets, thicken, with_extras

PLATE = 5
"""Filled openings side by side that make a plate, which a note reports; the ends of a member have up to three."""


def slicing_step(
    preset: Preset, surface: Surface, statics: StaticsResult, pattern: PatternResult, log: Log
) -> SlicingResult:
    """Stage 5: cut the surface, and return the cells and the sheet that remains. Raises PatternError if nothing
    remains.
    """
    ask = preset.slicing
    with log.stage("slicing", f"cutting {surface.m:,} triangles"):
        smallest = smallest_widths(pattern.settled(preset), surface)
        rehearsal = taken_rehearsal(preset, surface, pattern, smallest)
        cells = rehearsal.cells if rehearsal else cut(surface, pattern.fields, pattern.levels, ask.snap, pattern.tidy)
        drawn = cells
        if not cells.material.any():
            raise PatternError("the pattern leaves no material; lower pattern.major.threshold or raise pattern.keep")
        merge = merges_slits(preset, pattern)
        done = finished_cells(preset, cells, ask, smallest, merge, AGAIN, rehearsal)
        settled, neck = pattern.settled(preset), least_neck(smallest, merge, preset.pattern.fillet)
        cells = kept_to_least_widths(settled, done.cells, surface, log, merge, neck, rehearsal)
        better = improved(cells, surface, ask.tolerance) if ask.improve else None
        cells = better.sheet if better else cells
        sheet = cells.kept()
        listed, label = _pieces(surface, sheet, statics.load)
        built, held = listed, np.array([p.held for p in listed])
        if ask.loose == "refuse":
            _refuse_loose(preset, sheet, listed, label)
        carried = sheet.kept(held[label]) if held.any() and not held.all() else sheet
        lost = lost_load(surface, sheet, carried, [case.load for case in statics.cases.values()])
        if ask.loose == "drop" and carried is not sheet:
            sheet, built = carried, tuple(p for p in listed if p.held)
    _note_slicing(preset, sheet, listed, statics.load, done.pinches, lost, log)
    _note_loads(preset, surface, sheet, statics, log)
    _note_finishing(preset, done, smallest, drawn.stubs, log)
    if done.filled + done.merged >= PLATE:
        _note_plate(preset.pattern, surface, drawn, done.cells, log)
    if better:
        log.note("slicing", better.told)
    return SlicingResult(cells, sheet, built, done.pinches)


def _note_finishing(preset: Preset, done: Finished, smallest: Smallest, stubs: int, log: Log) -> None:
    if stubs:
        which = "members that meet past their last crossings, or pass beside a singular point of the stress,"
        log.note("slicing", f"{which} were cut off, straightened or evened at {_places(stubs)}")
    if done.filled:
        than = length(smallest.opening) + (", or far smaller than most," * (preset.slicing.min_opening is None))
        some, were = (f"{done.filled} openings", "were") if done.filled > 1 else ("an opening", "was")
        log.note("slicing", f"{some} smaller than {than} {were} filled")
    if done.merged:
        log.note(
            "slicing", f"{_slits(done.merged)} narrower than the members beside: filled, so that these are one there"
        )
    if done.bridged:
        log.note("slicing", f"{_bridges(done.bridged)} where openings are narrower than {length(smallest.neck)}")
    if done.spikes:
        log.note("slicing", f"{_spikes(done.spikes)} cut off that stuck out into openings")
    if done.widened:
        least = length(preset.slicing.min_member or 0)
        log.note("slicing", f"members were widened to {least} at {_places(done.widened)}")
    if radius := preset.pattern.fillet:
        log.note("slicing", _rounded(radius, done.rounded))


def _note_plate(ask: Pattern, surface: Surface, drawn: Sheet, done: Sheet, log: Log) -> None:
    apart = max(family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    filling = largest_filling(drawn, done, apart)
    if filling and filling.openings >= PLATE:
        x, y, z = (np.round(filling.place, 2) + 0.0).tolist()
        log.note(
            "slicing",
            f"{filling.openings} openings that were filled lie side by side around ({x:g}, {y:g}, {z:g}) m, where "
            "stripes come together: a plate with a ragged edge; another pattern.keep, spacing or pattern.rotate may "
            "avoid it",
        )


def _slits(count: int) -> str:
    return f"{count} opening{'s were' if count > 1 else ' was'}"


def _places(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"


def _contacts(count: int) -> str:
    return f"{count} point contacts were" if count > 1 else "a point contact was"


def _bridges(count: int) -> str:
    return f"{count} bridges were built" if count > 1 else "a bridge was built"


def _spikes(count: int) -> str:
    return f"{count} teeth of members were" if count > 1 else "a tooth of a member was"


def _rounded(radius: float, found: Floats) -> str:
    """Return a note on the radii (k,), metres, of rounded corners, compared with the requested radius."""
    if not len(found):
        return f"no corner of an opening was rounded: none has room for a radius of {length(radius)} (pattern.fillet)"
    told = f"{len(found)} corners of openings were rounded"
    if np.median(found) < radius / 2:
        half = length(float(np.median(found)))
        return f"{told}, half of them with less than {half} for want of room: {length(radius)} was asked"
    return f"{told} with {length(radius)}, or less for want of room"


def _pieces(surface: Surface, sheet: Sheet, load: LoadCase) -> tuple[tuple[Piece, ...], Ints]:
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)
    marks = []
    for mark in (held_vertices(surface, sheet, load), sheet.between(surface, load.loaded)):
        marks.append(np.bincount(label, mark[sheet.surface.F].any(axis=1), count) > 0)
    listed = tuple(Piece(float(area[k]), bool(marks[0][k]), bool(marks[1][k])) for k in range(count))
    return listed, label


def _alone(preset: Preset) -> str:
    name = preset.pattern.families
    return "" if name == "both" else f": the {name} family alone has no crossings; set pattern.rim, or draw both"


def _refuse_loose(preset: Preset, sheet: Sheet, listed: tuple[Piece, ...], label: Ints) -> None:
    loose = [k for k, piece in enumerate(listed) if not piece.held]
    if loose:
        largest = max(loose, key=lambda k: listed[k].area)
        x, y, z = sheet.surface.centroids[int((label == largest).argmax())]
        raise PatternError(
            f"{len(loose)} of {len(listed)} pieces reach no support, the largest ({listed[largest].area:.3g} m2) near "
            f"({x:.3g}, {y:.3g}, {z:.3g}) m"
            + (_alone(preset) or "; lower the thresholds, set pattern.rim or pattern.keep, or slicing.loose")
        )


def _note_slicing(
    preset: Preset, sheet: Sheet, listed: tuple[Piece, ...], load: LoadCase, pinches: int, lost: str, log: Log
) -> None:
    loose = [piece for piece in listed if not piece.held]
    if loose:
        area = sum(piece.area for piece in loose)
        done = "dropped" if preset.slicing.loose == "drop" and len(loose) < len(listed) else "kept"
        told = f"{len(loose)} of {len(listed)} pieces reach no support and were {done} ({area:.3g} m2)"
        log.note("slicing", f"{told}{_alone(preset)}")
    if pinches:
        log.note("slicing", f"{_contacts(pinches)} {'joined' if preset.slicing.pinch == 'join' else 'split'}")
    bare = np.flatnonzero(load.loaded & (sheet.same_vertex() < 0))
    if lost:
        log.note("slicing", f"{lost}: nothing carries it; {ATTACH}")
    elif len(bare):
        log.note(
            "slicing",
            f"{len(bare)} of {load.loaded.sum()} loaded points lie on removed material (vertices {first(bare, 3)}); "
            "set pattern.keep to protect them",
        )
    total = load.spring.sum()
    if total and (share := 1 - load.spring[sheet.same_vertex() >= 0].sum() / total) > 0.005:
        log.note("slicing", f"{share:.0%} of the springs' stiffness is on removed material; set pattern.keep")


def _note_loads(preset: Preset, surface: Surface, sheet: Sheet, statics: StaticsResult, log: Log) -> None:
    """Note loads on the cut sheet that differ from those of the uncut sheet, which gave the directions."""
    parts = [case.load.parts for case in statics.cases.values() if case.load.parts is not None]
    if any(one.weight.any() for one in parts):
        whole, left = (force(preset.statics.weight * area) for area in (surface.area, sheet.surface.area))
        told = f"the cut sheet weighs {left}, and is judged and compared with that"
        if not preset.pattern.rounds:  # else the pattern tells with which weight they were sought
            told += f"; the directions were sought with {whole}, the weight of the uncut sheet"
        log.note("slicing", told)
    if any(one.bare.any() for one in parts):
        log.note("slicing", "what is not covered acts on the members alone; the directions were sought with all of it")


def thickening_step(preset: Preset, surface: Surface, slicing: SlicingResult, log: Log) -> Solid:
    """Stage 6: thicken the sheet, with offsets of the uncut surface, whose normals are clean, carried through the cut.

    Raises SolidError if the surface bends too sharply for the thickness.
    """
    ask = preset.thickening
    with log.stage("thickening", f"thickening {slicing.sheet.surface.m:,} triangles"):
        offset = offsets(surface, preset.statics.thickness, ask.side)
        if offset.smallest < ask.thinnest:
            x, y, z = surface.V[offset.tightest]
            raise SolidError(
                f"the surface bends so sharply at ({x:.4g}, {y:.4g}, {z:.4g}) m that the sheet would be thinned to "
                f"{offset.smallest:.0%} of its thickness (allowed: {ask.thinnest:.0%}); make "
                "statics.thickness smaller, smooth the surface, or lower thickening.thinnest"
            )
        D = slicing.sheet.carry_corners(offset.at_corners(surface.F), surface.F)
        cells = slicing.cells
        layer = OffsetLayer(surface, offset.D, cells.surface, cells.carry(offset.D), cells.parent, ask.side)
        proven = apart(layer)[kept_cells(cells, slicing.sheet)]
        solid = thicken(slicing.sheet.surface, D, ask.side, proven)
        solid = replace(solid, repairs=replace(solid.repairs, limited=offset.limited, smallest=offset.smallest))
        solid = with_extras(
            solid, ask.extra, Base(surface, slicing.sheet.surface, partial(slicing.sheet.between, surface))
        )
    if ask.strict and solid.repairs.pairs:
        told = next(text for text in reversed(solid.notes) if "intersect" in text)
        raise SolidError(f"{told}; thickening.strict refuses such a solid: make the sheet thinner there")
    if offset.limited:
        log.note(
            "thickening",
            f"{offset.limited} of {surface.n} vertices were thinned where the surface bends sharply, "
            f"down to {offset.smallest:.0%} of the thickness",
        )
    for text in solid.notes:
        log.note("thickening", text)
    return solid
