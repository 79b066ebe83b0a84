"""Cut cells made fit to be built: least widths, round corners, no point contacts, slits or spikes."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary, ref

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.design.log import Log
from dsfab.preset.model import Pattern, Preset, Slicing
from dsfab.results import PatternResult
from dsfab.slicing import (
    LeastWidths,
    Merging,
    PolygonMesh,
    Sheet,
    bridged_gaps,
    bridged_necks,
    cut_polygons,
    divided_walls,
    faired_walls,
    filled_crumbs,
    filled_openings,
    filled_slits,
    improved,
    resolve_pinches,
    sheet_of,
    widened_members,
    with_least_widths,
    without_spikes,
)
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.surface import Surface

MOSTLY = 0.5
"""Of so much material members are not much narrower than openings anyway."""

SPECK = 0.15
"""Openings between evenly spaced stripes that are smaller than this share of the spacing are filled: what the edge of
the surface leaves of an opening that it cuts through."""
NECK, WIDEST = 1.1, 0.2
"""Evenly spaced openings are bridged where they are narrower than so many times the thickness, or than this share of
the spacing if that is less. A little more than once: the corners beside a bridge are rounded by chords."""
LEFT, AGAIN = 0.95, 5
"""Gaps between rounded members that are narrower than this share of a neck are bridged too, in so many rounds."""


class Finished(NamedTuple):
    """All cells without point contacts, specks, slits, necks and spikes, with round corners; how many of each there
    were, the radii, and at how many places members were widened.
    """

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int
    rounded: Floats
    widened: int = 0


class Unrounded(NamedTuple):
    """Cells without point contacts, specks, slits, necks and spikes, and how many of each there were."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int


class FirstRounding(NamedTuple):
    """Cells whose corners were rounded for the first time, the radii, and the slits that were filled then."""

    cells: Sheet
    radii: Floats
    merged: int


class Smallest(NamedTuple):
    """Metres: smaller openings are filled, and bridged where they are narrower than a neck may be; 0 for neither."""

    opening: float
    neck: float


class Terms(NamedTuple):
    """All that finishing goes by, until corners have been rounded once; metres."""

    snap: float
    pinch: str
    min_opening: float | None
    smallest: Smallest
    merge: Merging
    thickness: float
    fillet: float


def _terms(preset: Preset, ask: Slicing, smallest: Smallest, pattern: PatternResult) -> Terms:
    own = preset.statics.thickness, preset.pattern.fillet
    return Terms(ask.snap, ask.pinch, ask.min_opening, smallest, merges_slits(preset, pattern), *own)


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """The sheet of a pattern as it was measured while its widths were sought: slicing by the same terms goes on from
    it.

    drawn : weak references to what was cut, of `_drawn`: fields may lie on the surface that a rehearsal is kept for,
            which would live as long as that.
    terms : what finishing goes by.    cells : as they were cut.
    rounded, bridged : as they were rounded once, and with what is too narrow bridged by the defaults of [slicing].
    cured : least widths of openings and members, metres, and that sheet with nothing narrower.
    """

    drawn: tuple[ref[Any], ...]
    terms: Terms
    cells: Sheet
    unrounded: Unrounded
    rounded: FirstRounding | None
    bridged: "Rounded | None" = None
    cured: tuple[tuple[float, float], LeastWidths] | None = None

    def serves(self, pattern: PatternResult, terms: Terms) -> bool:
        """Whether the same would be cut of a pattern and finished by these terms."""
        drawn = _drawn(pattern)
        same = len(drawn) == len(self.drawn) and all(a() is b() for a, b in zip(drawn, self.drawn, strict=True))
        return same and terms == self.terms

    @property
    def finished(self) -> Sheet:
        """All cells, as far as they are known."""
        return (self.bridged or self.rounded or self.unrounded).cells

    def with_least_widths(self, gap: float, member: float) -> LeastWidths:
        """They with nothing narrower than that."""
        if self.cured and self.cured[0] == (gap, member):
            return self.cured[1]
        neck = least_neck(self.terms.smallest, self.terms.merge, self.terms.fillet)
        return with_least_widths(self.finished, gap, member, self.terms.merge, neck)


def _drawn(pattern: PatternResult) -> tuple[ref[Any], ...]:
    """What is cut of a pattern."""
    return tuple(ref(one) for one in (*pattern.fields, *pattern.levels, pattern.tidy) if one is not None)


_REHEARSALS: WeakKeyDictionary[Surface, Rehearsal] = WeakKeyDictionary()
"""The last one of each surface that lives, until it is sliced."""


def taken_rehearsal(preset: Preset, surface: Surface, pattern: PatternResult, smallest: Smallest) -> Rehearsal | None:
    """The rehearsal of a surface if slicing can go on from it; it is kept no longer, for its memory is needed."""
    rehearsal = _REHEARSALS.pop(surface, None)
    if rehearsal is None or not rehearsal.serves(pattern, _terms(preset, preset.slicing, smallest, pattern)):
        return None
    return rehearsal


def finished_cells(
    preset: Preset,
    cells: Sheet,
    ask: Slicing,
    smallest: Smallest,
    merge: Merging,
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
    least = _least(smallest, ask, merge)
    first, done = (rehearsal.rounded, rehearsal.bridged) if rehearsal else (None, None)
    if done is None or again != AGAIN or least != _least(smallest, Slicing(), merge):
        done = _rounded_cells(plain.cells, preset.pattern.fillet, merge, least, again, first)
    merged, bridged = plain.merged + done.merged, plain.bridged + done.bridged
    return Finished(done.cells, plain.pinches, plain.filled, merged, bridged, plain.spikes, done.radii, done.widened)


def unrounded_cells(preset: Preset, cells: Sheet, ask: Slicing, smallest: Smallest, merge: Merging) -> Unrounded:
    """What is made of cells as they were cut before corners are rounded."""
    pinched = resolve_pinches(cells, preset.statics.thickness / 2, ask.pinch)
    cells, filled, merged, bridged, spikes = pinched.sheet, 0, 0, 0, 0
    late = merge != "none" and ask.min_opening is None  # most of these are slits
    if smallest.opening and not late:
        cells, filled = filled_openings(cells, smallest.opening)
    if merge != "none":
        cells, merged = filled_slits(cells, merge)
    if smallest.opening and late:
        cells, filled = filled_openings(cells, smallest.opening, alike=True)
    if smallest.opening and ask.min_opening is None:
        cells, crumbs = filled_crumbs(cells)
        filled += crumbs
    if smallest.neck and merge != "none":
        cells, bridged = bridged_necks(cells, smallest.neck)
    if merge != "none":
        cells, more = filled_slits(divided_walls(faired_walls(cells)), merge)  # hairs decide of some
        merged += more
        cells, spikes = without_spikes(cells)
    return Unrounded(cells, pinched.count, filled, merged, bridged, spikes)


class Least(NamedTuple):
    """Metres: rounded openings and members that are narrower are bridged and widened; 0 for neither."""

    neck: float
    member: float


def _least(smallest: Smallest, ask: Slicing, merge: Merging) -> Least:
    """What is bridged and widened; nothing where slits stay."""
    return Least(smallest.neck, ask.min_member or 0.0) if merge != "none" else Least(0.0, 0.0)


def least_neck(smallest: Smallest, merge: Merging, fillet: float) -> float:
    """Metres; openings with round corners that are left narrower are bridged, but for tips. 0 for none."""
    return LEFT * smallest.neck if fillet and merge != "none" else 0.0


class Rounded(NamedTuple):
    """Cells with round corners of so many radii; slits filled and bridges built, and at how many places members were
    widened."""

    cells: Sheet
    radii: Floats
    merged: int
    bridged: int
    widened: int


def _rounded_cells(
    cells: Sheet, radius: float, merge: Merging, least: Least, again: int, first: FirstRounding | None = None
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


def _rounded_once(cells: Sheet, radius: float, merge: Merging) -> FirstRounding:
    done, radii = rounded_corners(cells, radius)
    done, merged = (
        filled_slits(done, merge) if merge != "none" and len(radii) else (done, 0)
    )  # corners take their share of openings
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


def merges_slits(preset: Preset, pattern: PatternResult) -> Merging:
    """Which members with a slit between them become one, of those that are tidied; see `merging`.

    Nothing is filled of what is tidied but no stripes: a topology optimisation, which is cut by the preset of evenly
    spaced ones and meets their mass as it is drawn.
    """
    own = pattern.even is not None or pattern.settled(preset).pattern.method == "modes"
    return merging(preset) if pattern.tidy is not None and own else "none"


def merging(preset: Preset) -> Merging:
    """All slits are filled; where more than `MOSTLY` of the surface is to be kept, those where members crowd."""
    return "crowded" if preset.pattern.width.solid_fraction > MOSTLY else "slits"


def added_share(preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None) -> float:
    """The share of the surface that the sheet of a pattern has beyond what its stripes keep: round corners above all.

    By the defaults of [slicing]: no stage depends on a later section. Slicing goes on from that sheet if it can.
    polygons : what the surface is cut into, where it is at hand.
    """
    ask, fields = Slicing(), (pattern.fields, pattern.levels)
    cells = sheet_of(polygons or cut_polygons(surface, *fields, ask.snap, pattern.tidy))
    if not cells.material.any():
        return 0.0
    smallest = smallest_widths(pattern.settled(preset.model_copy(update={"slicing": ask})), surface)
    merge = merges_slits(preset, pattern)
    unrounded = unrounded_cells(preset, cells, ask, smallest, merge)
    radius = preset.pattern.fillet
    rounded = _rounded_once(unrounded.cells, radius, merge) if radius else None
    done = rounded.cells if rounded else unrounded.cells
    terms = _terms(preset, ask, smallest, pattern)
    _REHEARSALS[surface] = Rehearsal(_drawn(pattern), terms, cells, unrounded, rounded)
    return (_material(done) - _material(cells)) / surface.area


def bridged_share(surface: Surface) -> float:
    """The share of the surface that bridges add to the sheet that `added_share` has made of it last.

    They are built where round members leave too little between them. 0 where there is no such sheet.
    """
    rehearsal = _REHEARSALS.get(surface)
    if rehearsal is None or rehearsal.rounded is None:
        return 0.0
    terms = rehearsal.terms
    least = _least(terms.smallest, Slicing(), terms.merge)
    plain = rehearsal.unrounded.cells
    done = _rounded_cells(plain, terms.fillet, terms.merge, least, AGAIN, rehearsal.rounded)
    _REHEARSALS[surface] = replace(rehearsal, bridged=done)
    return (_material(done.cells) - _material(rehearsal.rounded.cells)) / surface.area


def cured_share(surface: Surface, gap: float, member: float) -> float:
    """The share of the surface that the sheet which these two have made last is given besides, so that nothing is
    narrower than these widths, metres. 0 where there is no such sheet."""
    rehearsal = _REHEARSALS.get(surface)
    if rehearsal is None:
        return 0.0
    cured = rehearsal.with_least_widths(gap, member)
    _REHEARSALS[surface] = replace(rehearsal, cured=((gap, member), cured))
    return (_material(cured.cells) - _material(rehearsal.finished)) / surface.area


def _material(cells: Sheet) -> float:
    """Square metres."""
    return float(cells.surface.areas[cells.material].sum())


def smallest_widths(preset: Preset, surface: Surface) -> Smallest:
    """Of openings and necks; evenly spaced ones have no neck that is narrower than the sheet is thick."""
    ask, given = preset.pattern, preset.slicing.min_opening
    if given is not None or ask.method != "stripes":
        return Smallest(given or 0.0, given or 0.0)
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    thickness = preset.statics.thickness
    # slits between tidied ones are filled anyway
    opening = min(SPECK * spacing, thickness) if ask.tidied else SPECK * spacing
    return Smallest(opening, min(NECK * thickness, WIDEST * spacing))


THIN_MEMBER, NARROW_GAP = 0.5, 0.25
"""With `pattern.workshop` no member and no opening is narrower than these shares of the thickness, unless [slicing]
says otherwise: a cutter that goes through a sheet is about so wide."""
WIDE_CUT, OF_SIZE = 3e-3, 1 / 500
"""Nor is an opening narrower than so many metres, where a blade goes in, or this share of the size of small things."""
LESS = 0.95
"""Members that are asked to be narrower than that are as wide as this share of what is asked: on flat triangles widths
are right to some percent."""
SLIMMEST = 0.5
"""Where widths differ, members may be this share of what equally wide ones would be, however thick the sheet is."""
PLAIN_SHARE = 0.5
"""The share of material that stripes are about, where none is asked."""


class WorkshopWidths(NamedTuple):
    """Metres that openings and members have at least; 0 where nothing is asked."""

    gap: float
    member: float


def least_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Those of a preset on a surface: what [slicing] says, or what is usual; none without `pattern.workshop`.

    Members are kept to no more than is usual, in every design: where [slicing] asks for more, only members between
    openings with round corners are widened.
    """
    if not preset.pattern.for_workshop:
        return WorkshopWidths(0.0, 0.0)
    ask, thickness = preset.slicing, preset.statics.thickness
    gap = usual_gap(thickness, surface.size) if ask.min_gap is None else ask.min_gap
    unlimited = preset.pattern.width.min_width == 0
    usual = 0.0 if unlimited else min(THIN_MEMBER * thickness, LESS * _asked(preset.pattern, surface))
    return WorkshopWidths(gap, usual if ask.min_member is None else min(ask.min_member, usual))


def usual_gap(thickness: float, size: float) -> float:
    """The least width of openings, metres, in a sheet of this thickness and this diagonal of its box, metres."""
    return max(NARROW_GAP * thickness, min(WIDE_CUT, OF_SIZE * size))


def _asked(ask: Pattern, surface: Surface) -> float:
    """Metres that members are asked to have somewhere, or may have; infinite where nothing is said."""
    width = ask.width
    given = width.member if width.rule == "constant" else 0.0
    differ = ask.method == "stripes" and width.rule in ("graded", "stressed") and not width.asked_least
    slim = slimmest(ask, surface) if differ else 0.0
    return min((x for x in (given, width.asked_least, width.max_width, slim) if x), default=float("inf"))


def slimmest(ask: Pattern, surface: Surface) -> float:
    """Metres that evenly spaced members whose widths differ may have, however thick the sheet is."""
    density = sum(1 / family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    return SLIMMEST * (ask.width.solid_fraction or PLAIN_SHARE) / density


def kept_to_least_widths(
    preset: Preset,
    cells: Sheet,
    surface: Surface,
    log: Log,
    merge: Merging = "none",
    neck: float = 0.0,
    rehearsal: Rehearsal | None = None,
) -> Sheet:
    """The cells, cut from a surface, without what is too narrow, as far as material can do that; how many places that
    took is told.

    Strips end where they must and leave needles, edges of a micrometre, on which quadrature and sparse solvers lose
    their digits: cells are flipped and collapsed within the faces of the surface, which moves no edge of the material.

    merge, neck : which slits that this leaves are filled, and what is bridged, see `with_least_widths`.
    rehearsal   : what it has done to these cells is not done again.
    """
    if not any(least := least_widths(preset, surface)):
        return cells
    if rehearsal and rehearsal.finished is cells:
        done = rehearsal.with_least_widths(*least)
    else:
        done = with_least_widths(cells, *least, merge, neck)
    if told := _told(least, done):
        log.note("slicing", told)
    return improved(done.cells, surface).sheet if done.bridged or done.widened else done.cells


def closed_share(
    preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None
) -> float:
    """The share of the surface that is added to the sheet of a pattern so that nothing is too narrow.

    By the defaults of [slicing]: no stage depends on a later section.
    polygons : what it cuts the surface into, where that is at hand.
    """
    usual = pattern.settled(preset.model_copy(update={"slicing": Slicing()}))
    merge, smallest = merges_slits(usual, pattern), smallest_widths(usual, surface)
    polygons = polygons or cut_polygons(surface, pattern.fields, pattern.levels, usual.slicing.snap, pattern.tidy)
    cells = unrounded_cells(usual, sheet_of(polygons), usual.slicing, smallest, merge).cells
    done = with_least_widths(cells, *_usual_widths(preset, surface), merge).cells
    before, after = (float(one.surface.areas[one.material].sum()) for one in (cells, done))
    return (after - before) / surface.area


def rehearsed_closed_share(preset: Preset, surface: Surface) -> float:
    """The same for the sheet that `added_share` and `bridged_share` have made last; 0 without `pattern.workshop`."""
    return cured_share(surface, *_usual_widths(preset, surface)) if preset.pattern.for_workshop else 0.0


def drawn_member(preset: Preset, surface: Surface) -> float:
    """Metres that members are drawn with at least, so that few have to be widened; 0 without `pattern.workshop`."""
    return _usual_widths(preset, surface).member / LESS


def _usual_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Those of a preset by the defaults of [slicing]: no stage depends on a later section."""
    return least_widths(preset.model_copy(update={"slicing": Slicing()}), surface)


def _told(least: WorkshopWidths, done: LeastWidths) -> str:
    closed, widened = done.filled + done.bridged, done.widened
    told = [f"openings narrower than {length(least.gap)} were closed at {_places(closed)}"] * bool(closed)
    told += [f"members narrower than {length(least.member)} were widened at {_places(widened)}"] * bool(widened)
    told += [f"{done.merged} openings that this left narrower than the members beside were filled"] * bool(done.merged)
    told += [f"bridges were built at {_places(done.necks)} that this left narrow"] * bool(done.necks)
    return ", ".join(told) and ", ".join(told) + " (slicing.min_gap, min_member)"


def _places(count: int) -> str:
    return f"{count} places" if count > 1 else "one place"
