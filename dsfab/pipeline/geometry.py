"""The last two steps: the sheet cut along the stripes, and the solid."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np

from dsfab.arrays import Floats, Ints, first
from dsfab.errors import PatternError, SolidError
from dsfab.pipeline.handover import ATTACH, held_vertices, lost_load
from dsfab.pipeline.log import Log
from dsfab.preset import Preset, Slicing
from dsfab.results import PatternResult, Piece, SlicingResult, StaticsResult
from dsfab.slicing import (
    PolygonMesh,
    Sheet,
    bridged_gaps,
    bridged_necks,
    cut,
    cut_polygons,
    filled_openings,
    filled_slits,
    resolve_pinches,
    sheet_of,
    widened_members,
)
from dsfab.slicing.features import kept_cells
from dsfab.slicing.fillet import rounded_corners
from dsfab.slicing.improve import improved
from dsfab.surface import LoadCase, Surface, pieces
from dsfab.thickening import Base, OffsetLayer, Solid, apart, offsets, thicken, with_extras
from dsfab.wording import force

SPECK = 0.15
"""Openings between evenly spaced stripes that are smaller than this share of the spacing are filled: what the edge of
the surface leaves of an opening that it cuts through."""
NECK, WIDEST = 1.1, 0.2
"""Evenly spaced openings are bridged where they are narrower than so many times the thickness, or than this share of
the spacing if that is less. A little more than once: the corners beside a bridge are rounded by chords."""
LEFT, AGAIN = 0.95, 5
"""Gaps between rounded members that are narrower than this share of a neck are bridged too, in so many rounds."""
ROOM = 0.5
"""The user is told of the median radius of corners where it is less than this share of what was asked."""
SPRINGS_LOST = 0.005
"""The user is told when a larger share of the stiffness of spring supports lies on removed material."""


def slicing_step(
    preset: Preset, surface: Surface, statics: StaticsResult, pattern: PatternResult, log: Log
) -> SlicingResult:
    """The fifth stage: the surface cut, and the sheet that is kept; raises PatternError where nothing is."""
    ask, radius = preset.slicing, preset.pattern.fillet
    with log.stage("slicing", f"cutting {surface.m:,} triangles"):
        smallest = _smallest(pattern.settled(preset), surface)
        rehearsal = _REHEARSALS.pop(surface, None)  # its memory is needed from here on
        if rehearsal and not rehearsal.serves(pattern, _terms(preset, ask, smallest, pattern)):
            rehearsal = None
        cells = rehearsal.cells if rehearsal else cut(surface, pattern.fields, pattern.levels, ask.snap, pattern.tidy)
        stubs = cells.stubs
        if not cells.material.any():
            raise PatternError("the pattern leaves no material; lower pattern.major.threshold or raise pattern.keep")
        done = finished_cells(preset, cells, ask, smallest, _merged(pattern), AGAIN, rehearsal)
        cells, pinches, rounded = done.cells, done.pinches, done.rounded
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
    _note_slicing(preset, sheet, listed, statics.load, pinches, lost, log)
    _note_loads(preset, surface, sheet, statics, log)
    if stubs:
        log.note("slicing", f"members that met past their last crossings were cut off there at {_places(stubs)}")
    if done.filled:
        log.note("slicing", f"{done.filled} openings smaller than {smallest.opening:.3g} m were filled")
    if done.merged:
        log.note(
            "slicing", f"{_slits(done.merged)} narrower than the members beside: filled, so that these are one there"
        )
    if done.bridged:
        log.note("slicing", f"{_bridges(done.bridged)} where openings are narrower than {smallest.neck:.3g} m")
    if done.widened:
        log.note("slicing", f"members were widened to {ask.min_member:.3g} m at {_places(done.widened)}")
    if radius:
        log.note("slicing", _rounded(radius, rounded))
    if better:
        log.note("slicing", better.told)
    return SlicingResult(cells, sheet, built, pinches)


class Finished(NamedTuple):
    """All cells without point contacts, specks, slits and necks, with round corners; how many of each there were, the
    radii, and at how many places members were widened.
    """

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    rounded: Floats
    widened: int = 0


class Unrounded(NamedTuple):
    """Cells without point contacts, specks, slits and necks, and how many of each there were."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int


class FirstRounding(NamedTuple):
    """Cells whose corners were rounded for the first time, the radii, and the slits that were filled then."""

    cells: Sheet
    radii: Floats
    merged: int


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """The sheet of a pattern as it was measured while its widths were sought: slicing by the same terms goes on from
    it.

    drawn : weak references to what was cut, of `_drawn`: fields may lie on the surface that a rehearsal is kept for,
            which would live as long as that.
    terms : of `_terms`.    cells : as they were cut.
    """

    drawn: tuple[ref[Any], ...]
    terms: tuple[Any, ...]
    cells: Sheet
    unrounded: Unrounded
    rounded: FirstRounding | None

    def serves(self, pattern: PatternResult, terms: tuple[Any, ...]) -> bool:
        """Whether the same would be cut of a pattern and finished by these terms."""
        drawn = _drawn(pattern)
        same = len(drawn) == len(self.drawn) and all(a() is b() for a, b in zip(drawn, self.drawn, strict=True))
        return same and terms == self.terms


def _drawn(pattern: PatternResult) -> tuple[ref[Any], ...]:
    """What is cut of a pattern."""
    return tuple(ref(one) for one in (*pattern.fields, *pattern.levels, pattern.tidy) if one is not None)


_REHEARSALS: WeakKeyDictionary[Surface, Rehearsal] = WeakKeyDictionary()
"""The last one of each surface that lives, until it is sliced."""


class Smallest(NamedTuple):
    """Metres: smaller openings are filled, and bridged where they are narrower than a neck may be; 0 for neither."""

    opening: float
    neck: float


def _terms(preset: Preset, ask: Slicing, smallest: Smallest, pattern: PatternResult) -> tuple[Any, ...]:
    """All that finishing goes by, until corners have been rounded once."""
    own = preset.statics.thickness, preset.pattern.fillet
    return (ask.snap, ask.pinch, ask.min_opening, smallest, _merged(pattern), *own)


def finished_cells(
    preset: Preset,
    cells: Sheet,
    ask: Slicing,
    smallest: Smallest,
    merge: bool,
    again: int = AGAIN,
    rehearsal: Rehearsal | None = None,
) -> Finished:
    """What is made of cells as they were cut; slits are filled and necks bridged if `merge` says so, and gaps between
    rounded members `again` and again.

    rehearsal : of these cells, if there was one: what was done there is not done again.
    """
    plain = rehearsal.unrounded if rehearsal else unrounded_cells(preset, cells, ask, smallest, merge)
    if not preset.pattern.fillet:
        return Finished(*plain, np.empty(0))
    least = Least(smallest.neck, ask.min_member) if merge else Least(0.0, 0.0)
    first = rehearsal.rounded if rehearsal else None
    done = _rounded_cells(plain.cells, preset.pattern.fillet, merge, least, again, first)
    merged, bridged = plain.merged + done.merged, plain.bridged + done.bridged
    return Finished(done.cells, plain.pinches, plain.filled, merged, bridged, done.radii, done.widened)


def unrounded_cells(preset: Preset, cells: Sheet, ask: Slicing, smallest: Smallest, merge: bool) -> Unrounded:
    """What is made of cells as they were cut before corners are rounded."""
    pinched = resolve_pinches(cells, preset.statics.thickness / 2, ask.pinch)
    cells, filled, merged, bridged = pinched.sheet, 0, 0, 0
    late = merge and ask.min_opening is None  # most of these are slits
    if smallest.opening and not late:
        cells, filled = filled_openings(cells, smallest.opening)
    if merge:
        cells, merged = filled_slits(cells)
    if smallest.opening and late:
        cells, filled = filled_openings(cells, smallest.opening, alike=True)
    if smallest.neck and merge:
        cells, bridged = bridged_necks(cells, smallest.neck)
    return Unrounded(cells, pinched.count, filled, merged, bridged)


class Least(NamedTuple):
    """Metres: rounded openings and members that are narrower are bridged and widened; 0 for neither."""

    neck: float
    member: float


class Rounded(NamedTuple):
    """Cells with round corners of so many radii; slits filled and bridges built, and at how many places members were
    widened."""

    cells: Sheet
    radii: Floats
    merged: int
    bridged: int
    widened: int


def _rounded_cells(
    cells: Sheet, radius: float, merge: bool, least: Least, again: int, first: FirstRounding | None = None
) -> Rounded:
    """Cells with round corners, `again` and again where that leaves what is too narrow; slits filled if `merge`.

    first : what comes first, where it is known.
    """
    bridged, widened, last = 0, 0, cells.surface.m
    for attempt in range(again + 1):
        done, radii, merged = first or _rounded_once(cells, radius, merge)
        first = None
        if attempt == again:
            break
        better, bridges, places = _broadened(cells, done, least)
        if not (bridges or places) or places > last:  # nothing is left, or it comes to no end
            break
        cells, bridged, widened, last = better, bridged + bridges, widened + places, places or last
    return Rounded(done, radii, merged, bridged, widened)


def _rounded_once(cells: Sheet, radius: float, merge: bool) -> FirstRounding:
    done, radii = rounded_corners(cells, radius)
    done, merged = filled_slits(done) if merge and len(radii) else (done, 0)  # corners take their share of openings
    return FirstRounding(done, radii, merged)


def _broadened(cells: Sheet, rounded: Sheet, least: Least) -> tuple[Sheet, int, int]:
    """The cells with the gaps of the rounded sheet bridged, or else its members widened; the bridges and the places."""
    if least.neck:
        better, bridges = bridged_gaps(cells, rounded, LEFT * least.neck, least.neck)
        if bridges:
            better, others = bridged_necks(better, least.neck)
            return better, bridges + others, 0
    better, places = widened_members(cells, rounded, least.member) if least.member else (cells, 0)
    return better, 0, places


def _merged(pattern: PatternResult) -> bool:
    """Whether members with a slit between them become one: evenly spaced ones that are tidied."""
    return pattern.even is not None and pattern.tidy is not None


def _slits(count: int) -> str:
    return f"{count} opening{'s were' if count > 1 else ' was'}"


def _places(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"


def _bridges(count: int) -> str:
    return f"{count} bridges were built" if count > 1 else "a bridge was built"


def added_share(preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None) -> float:
    """The share of the surface that the sheet of a pattern has beyond what its stripes keep: round corners above all.

    By the defaults of [slicing]: no stage depends on a later section. Slicing goes on from that sheet if it can.
    polygons : what the surface is cut into, where it is at hand.
    """
    ask, fields = Slicing(), (pattern.fields, pattern.levels)
    cells = sheet_of(polygons or cut_polygons(surface, *fields, ask.snap, pattern.tidy))
    if not cells.material.any():
        return 0.0
    smallest = _smallest(pattern.settled(preset.model_copy(update={"slicing": ask})), surface)
    merge = _merged(pattern)
    unrounded = unrounded_cells(preset, cells, ask, smallest, merge)
    radius = preset.pattern.fillet
    rounded = _rounded_once(unrounded.cells, radius, merge) if radius else None  # a few bridges later weigh nothing
    done = rounded.cells if rounded else unrounded.cells
    terms = _terms(preset, ask, smallest, pattern)
    _REHEARSALS[surface] = Rehearsal(_drawn(pattern), terms, cells, unrounded, rounded)
    before, after = (float(one.surface.areas[one.material].sum()) for one in (cells, done))
    return (after - before) / surface.area


def _rounded(radius: float, found: Floats) -> str:
    """What became of the corners of openings for a radius that was asked for."""
    if not len(found):
        return f"no corner of an opening was rounded: none has room for a radius of {radius:.3g} m (pattern.fillet)"
    told = f"{len(found)} corners of openings were rounded"
    if np.median(found) < ROOM * radius:
        return (
            f"{told}, half of them with less than {np.median(found):.2g} m for want of room: {radius:.3g} m was asked"
        )
    return f"{told} with {radius:.3g} m, or less for want of room"


def _smallest(preset: Preset, surface: Surface) -> Smallest:
    """Of openings and necks; evenly spaced ones have no neck that is narrower than the sheet is thick."""
    ask, given = preset.pattern, preset.slicing.min_opening
    if given is not None or ask.method != "stripes":
        return Smallest(given or 0.0, given or 0.0)
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    thickness = preset.statics.thickness
    # slits between tidied ones are filled anyway
    opening = min(SPECK * spacing, thickness) if ask.tidied else SPECK * spacing
    return Smallest(opening, min(NECK * thickness, WIDEST * spacing))


def _pieces(surface: Surface, sheet: Sheet, load: LoadCase) -> tuple[tuple[Piece, ...], Ints]:
    """The pieces of a sheet, and the piece of each of its faces."""
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)
    marks = []
    for mark in (held_vertices(surface, sheet, load), sheet.between(surface, load.loaded)):
        marks.append(np.bincount(label, mark[sheet.surface.F].any(axis=1), count) > 0)
    listed = tuple(Piece(float(area[k]), bool(marks[0][k]), bool(marks[1][k])) for k in range(count))
    return listed, label


def _alone(preset: Preset) -> str:
    """Why pieces are loose, where one family is drawn."""
    name = preset.pattern.families
    return "" if name == "both" else f": the {name} family alone has no crossings; set pattern.rim, or draw both"


def _refuse_loose(preset: Preset, sheet: Sheet, listed: tuple[Piece, ...], label: Ints) -> None:
    """Raise PatternError for pieces that reach no support."""
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
        log.note("slicing", f"{pinches} point contacts were {'joined' if preset.slicing.pinch == 'join' else 'split'}")
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
    if total and (share := 1 - load.spring[sheet.same_vertex() >= 0].sum() / total) > SPRINGS_LOST:
        log.note("slicing", f"{share:.0%} of the springs' stiffness is on removed material; set pattern.keep")


def _note_loads(preset: Preset, surface: Surface, sheet: Sheet, statics: StaticsResult, log: Log) -> None:
    """What acts on the cut sheet otherwise than on the uncut one, on which the directions were sought."""
    parts = [case.load.parts for case in statics.cases.values() if case.load.parts is not None]
    if any(one.weight.any() for one in parts):
        whole, left = (force(preset.statics.weight * area) for area in (surface.area, sheet.surface.area))
        log.note(
            "slicing",
            f"the cut sheet weighs {left}, and is judged and compared with that; the directions were sought with "
            f"{whole}, the weight of the uncut sheet",
        )
    if any(one.bare.any() for one in parts):
        log.note("slicing", "what is not covered acts on the members alone; the directions were sought with all of it")


def thickening_step(preset: Preset, surface: Surface, slicing: SlicingResult, log: Log) -> Solid:
    """Offsets are made on the uncut surface, where normals are clean, and carried through the cut."""
    ask = preset.thickening
    with log.stage("thickening", f"thickening {slicing.sheet.surface.m:,} triangles"):
        offset = offsets(surface, preset.statics.thickness, ask.side)
        if offset.smallest < ask.thinnest:
            raise SolidError(
                f"the surface bends so sharply that the sheet would be thinned to {offset.smallest:.0%} of its "
                f"thickness (allowed: {ask.thinnest:.0%}); make statics.thickness smaller, smooth the "
                "surface, or lower thickening.thinnest"
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
