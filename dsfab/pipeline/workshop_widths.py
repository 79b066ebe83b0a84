"""What a workshop makes: the least widths of openings and members of a preset, kept on the finished cells, and told."""

from typing import NamedTuple

from dsfab.pipeline.finishing import Rehearsal, cured_share, merges_slits, smallest_widths, unrounded_cells
from dsfab.pipeline.log import Log
from dsfab.preset import Pattern, Preset, Slicing
from dsfab.results import PatternResult
from dsfab.slicing import LeastWidths, Merging, PolygonMesh, Sheet, cut_polygons, improved, sheet_of, with_least_widths
from dsfab.surface import Surface
from dsfab.wording import length

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
