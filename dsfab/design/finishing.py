"""Finishing of the cut: least widths, round corners, and removal of point contacts, slits and spikes."""

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

SPECK = 0.15
"""Openings between evenly spaced stripes that are smaller than this share of the spacing are filled: the rest of an
opening at the edge of the surface."""
LEFT, AGAIN = 0.95, 5
"""Gaps between rounded members narrower than this share of a neck are bridged too, in up to this number of rounds."""


class Finished(NamedTuple):
    """Finished cells with round corners; numbers of details changed, radii, and places of widened members."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int
    rounded: Floats
    widened: int = 0


class Unrounded(NamedTuple):
    """Finished cells before corners are rounded: no point contacts, specks, slits, necks and spikes; their numbers."""

    cells: Sheet
    pinches: int
    filled: int
    merged: int
    bridged: int
    spikes: int


class FirstRounding(NamedTuple):
    """Cells after the first rounding of corners, the radii, and the number of slits filled then."""

    cells: Sheet
    radii: Floats
    merged: int


class Smallest(NamedTuple):
    """Metres: smaller openings are filled, and openings with a narrower neck are bridged; 0 for neither."""

    opening: float
    neck: float


class Terms(NamedTuple):
    """Options that decide the finishing, up to the first rounding of corners; metres."""

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
    """The trial cut of a pattern from the search for its widths: slicing with the same options continues from it.

    drawn   : weak references to the fields, levels and tidy of the pattern: fields may keep the surface alive.
    terms   : options of finishing.    cells : as they were cut.
    rounded, bridged : after the first rounding, and with bridges by the defaults of [slicing].
    cured   : least widths of openings and members, metres, and the sheet that keeps them.
    """

    drawn: tuple[ref[Any], ...]
    terms: Terms
    cells: Sheet
    unrounded: Unrounded
    rounded: FirstRounding | None
    bridged: "Rounded | None" = None
    cured: tuple[tuple[float, float], LeastWidths] | None = None

    def serves(self, pattern: PatternResult, terms: Terms) -> bool:
        """Return whether a pattern with these options would be cut and finished in the same way."""
        drawn = _drawn(pattern)
        same = len(drawn) == len(self.drawn) and all(a() is b() for a, b in zip(drawn, self.drawn, strict=True))
        return same and terms == self.terms

    @property
    def finished(self) -> Sheet:
        """The cells after the latest step of finishing."""
        return (self.bridged or self.rounded or self.unrounded).cells

    def with_least_widths(self, gap: float, member: float) -> LeastWidths:
        """Return these cells with least widths, metres, of openings and members."""
        if self.cured and self.cured[0] == (gap, member):
            return self.cured[1]
        neck = least_neck(self.terms.smallest, self.terms.merge, self.terms.fillet)
        return with_least_widths(self.finished, gap, member, self.terms.merge, neck)


def _drawn(pattern: PatternResult) -> tuple[ref[Any], ...]:
    return tuple(ref(one) for one in (*pattern.fields, *pattern.levels, pattern.tidy) if one is not None)


_REHEARSALS: WeakKeyDictionary[Surface, Rehearsal] = WeakKeyDictionary()
"""The latest trial cut of each surface, until slicing takes it."""


def taken_rehearsal(preset: Preset, surface: Surface, pattern: PatternResult, smallest: Smallest) -> Rehearsal | None:
    """Remove and return the trial cut of a surface if slicing can continue from it; its memory is needed later."""
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
    """Finish cells after the cut; fill slits and bridge necks by `merging_rule`, and gaps of rounded members in
    `rounds`.

    trial_cut : of these cells, if it exists: its steps are not repeated.
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
    """Finish cells after the cut, without rounding corners."""
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
        cells, more = filled_slits(divided_walls(faired_walls(cells)), merge)  # fairing opens or closes thin slits
        merged += more
        cells, spikes = without_spikes(cells)
    return Unrounded(cells, pinched.count, filled, merged, bridged, spikes)


class Least(NamedTuple):
    """Metres: narrower rounded openings and members are bridged and widened; 0 for neither."""

    neck: float
    member: float


def _least(smallest: Smallest, ask: Slicing, merge: Merging) -> Least:
    """Return the widths below which openings are bridged and members widened; none if slits stay."""
    return Least(smallest.neck, ask.min_member or 0.0) if merge != "none" else Least(0.0, 0.0)


def least_neck(smallest: Smallest, merge: Merging, fillet: float) -> float:
    """Return metres below which openings with round corners are bridged, except tips; 0 for none."""
    return LEFT * smallest.neck if fillet and merge != "none" else 0.0


class Rounded(NamedTuple):
    """Cells with round corners, their radii, slits filled, bridges built, and places of widened members."""

    cells: Sheet
    radii: Floats
    merged: int
    bridged: int
    widened: int


def _rounded_cells(
    cells: Sheet, radius: float, merge: Merging, least: Least, again: int, first: FirstRounding | None = None
) -> Rounded:
    """Round corners, and repeat in up to `rounds` where the result is too narrow; fill slits by `merge`.

    first_rounding : the first result, if it exists.
    """
    bridged, widened, last = 0, 0, cells.surface.m
    for attempt in range(again + 1):
        done, radii, merged = first or _rounded_once(cells, radius, merge)
        first = None
        if attempt == again:
            break
        better, bridges, places = _broadened(cells, done, least)
        if not (bridges or places) or places > last:  # done, or the rounds do not converge
            break
        cells, bridged, widened, last = better, bridged + bridges, widened + places, places or last
    return Rounded(done, radii, merged, bridged, widened)


def _rounded_once(cells: Sheet, radius: float, merge: Merging) -> FirstRounding:
    done, radii = rounded_corners(cells, radius)
    done, merged = (
        filled_slits(done, merge) if merge != "none" and len(radii) else (done, 0)
    )  # round corners narrow the openings
    return FirstRounding(done, radii, merged)


def _broadened(cells: Sheet, rounded: Sheet, least: Least) -> tuple[Sheet, int, int]:
    """Bridge gaps of the rounded sheet, or else widen its members; return cells, bridges and widened places."""
    if least.neck:
        better, bridges = bridged_gaps(cells, rounded, LEFT * least.neck, least.neck)
        if bridges:
            better, others = bridged_necks(better, least.neck)
            return better, bridges + others, 0
    better, places = widened_members(cells, rounded, least.member) if least.member else (cells, 0)
    return better, 0, places


def merges_slits(preset: Preset, pattern: PatternResult) -> Merging:
    """Return which members with a slit between them merge, in tidied patterns; see `merging_rule`.

    Patterns without stripes keep their slits: a topology optimisation, cut by the same preset, meets its mass as it is.
    """
    own = pattern.even is not None or pattern.settled(preset).pattern.method == "modes"
    return merging(preset) if pattern.tidy is not None and own else "none"


def merging(preset: Preset) -> Merging:
    """Return whether all slits are filled, or only those of crowded members.

    With more than half of the surface solid, members are hardly narrower than openings anyway.
    """
    return "crowded" if preset.pattern.width.solid_fraction > 0.5 else "slits"


def added_share(preset: Preset, surface: Surface, pattern: PatternResult, polygons: PolygonMesh | None = None) -> float:
    """Return the share of the surface that finishing, mainly round corners, adds to the stripes of a pattern.

    It uses the defaults of [slicing], because no stage depends on a later section. Slicing continues from that cut if
    it can.
    polygons : the surface cut along the pattern, if it exists.
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
    """Return the share of the surface that bridges add to the latest trial cut; 0 without one.

    Bridges fill gaps that are too narrow between rounded members.
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
    """Return the share of the surface that least widths, metres, add to the latest trial cut; 0 without one."""
    rehearsal = _REHEARSALS.get(surface)
    if rehearsal is None:
        return 0.0
    cured = rehearsal.with_least_widths(gap, member)
    _REHEARSALS[surface] = replace(rehearsal, cured=((gap, member), cured))
    return (_material(cured.cells) - _material(rehearsal.finished)) / surface.area


def _material(cells: Sheet) -> float:
    return float(cells.surface.areas[cells.material].sum())


def smallest_widths(preset: Preset, surface: Surface) -> Smallest:
    """Return the smallest openings and necks; evenly spaced openings have necks about as wide as the sheet is thick."""
    ask, given = preset.pattern, preset.slicing.min_opening
    if given is not None or ask.method != "stripes":
        return Smallest(given or 0.0, given or 0.0)
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    thickness = preset.statics.thickness
    # slits between tidied members are filled anyway
    opening = min(SPECK * spacing, thickness) if ask.tidied else SPECK * spacing
    # a neck exceeds the thickness by a tenth, because chords round the corners beside a bridge
    return Smallest(opening, min(1.1 * thickness, 0.2 * spacing))


LESS = 0.95
"""Members below the usual width are at least this share of the requested one: on flat triangles widths are right to a
few percent."""


class WorkshopWidths(NamedTuple):
    """Least widths of openings and members, metres; 0 for no limit."""

    gap: float
    member: float


def least_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths of a preset on a surface, by [slicing] or by default; none without `pattern.workshop`.

    By default no member is narrower than half the thickness, about the width of a cutter. Members never have more than
    that default: if [slicing] requests more, only members between openings with round corners are widened.
    """
    if not preset.pattern.for_workshop:
        return WorkshopWidths(0.0, 0.0)
    ask, thickness = preset.slicing, preset.statics.thickness
    gap = usual_gap(thickness, surface.size) if ask.min_gap is None else ask.min_gap
    unlimited = preset.pattern.width.min_width == 0
    usual = 0.0 if unlimited else min(0.5 * thickness, LESS * _asked(preset.pattern, surface))
    return WorkshopWidths(gap, usual if ask.min_member is None else min(ask.min_member, usual))


def usual_gap(thickness: float, size: float) -> float:
    """Return the least width of openings, metres, for a thickness and a diagonal of the surface's box, metres.

    It is a quarter of the thickness, and at least 3 mm for a blade, or a 500th of the size of small things.
    """
    return max(0.25 * thickness, min(3e-3, 1 / 500 * size))


def _asked(ask: Pattern, surface: Surface) -> float:
    """Return the least member width, metres, that the preset requests or permits; infinite without any."""
    width = ask.width
    given = width.member if width.rule == "constant" else 0.0
    differ = ask.method == "stripes" and width.rule in ("graded", "stressed") and not width.asked_least
    slim = slimmest(ask, surface) if differ else 0.0
    return min((x for x in (given, width.asked_least, width.max_width, slim) if x), default=float("inf"))


def slimmest(ask: Pattern, surface: Surface) -> float:
    """Return the least width, metres, of evenly spaced members of varying width, for any thickness.

    It is half the width that equally wide members would have; without a solid fraction half the surface is material.
    """
    density = sum(1 / family.distance(surface.area, surface.mean_edge) for family in ask.drawn)
    return 0.5 * (ask.width.solid_fraction or 0.5) / density


def kept_to_least_widths(
    preset: Preset,
    cells: Sheet,
    surface: Surface,
    log: Log,
    merge: Merging = "none",
    neck: float = 0.0,
    rehearsal: Rehearsal | None = None,
) -> Sheet:
    """Return cells, cut from a surface, without narrow places, as far as added material can; note how many were
    changed.

    Filled strips leave needles with edges of a micrometre, on which quadrature and sparse solvers lose digits: cells
    are flipped and collapsed within the faces of the surface, which moves no edge of the material.

    merge, neck : slits to fill and widths to bridge afterwards, see `with_least_widths`.
    trial_cut   : its steps on these cells are not repeated.
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
    """Return the share of the surface that least widths add to the sheet of a pattern, by the defaults of [slicing].

    polygons : the surface cut along the pattern, if it exists.
    """
    usual = pattern.settled(preset.model_copy(update={"slicing": Slicing()}))
    merge, smallest = merges_slits(usual, pattern), smallest_widths(usual, surface)
    polygons = polygons or cut_polygons(surface, pattern.fields, pattern.levels, usual.slicing.snap, pattern.tidy)
    cells = unrounded_cells(usual, sheet_of(polygons), usual.slicing, smallest, merge).cells
    done = with_least_widths(cells, *_usual_widths(preset, surface), merge).cells
    before, after = (float(one.surface.areas[one.material].sum()) for one in (cells, done))
    return (after - before) / surface.area


def rehearsed_closed_share(preset: Preset, surface: Surface) -> float:
    """Return the same share for the latest trial cut; 0 without `pattern.workshop`."""
    return cured_share(surface, *_usual_widths(preset, surface)) if preset.pattern.for_workshop else 0.0


def drawn_member(preset: Preset, surface: Surface) -> float:
    """Return the least width, metres, of members in the pattern, so that few must be widened; 0 without
    `pattern.workshop`.
    """
    return _usual_widths(preset, surface).member / LESS


def _usual_widths(preset: Preset, surface: Surface) -> WorkshopWidths:
    """Return the least widths by the defaults of [slicing], because no stage depends on a later section."""
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
