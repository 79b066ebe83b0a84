"""Finishing: all passes over a cut surface, in order; and trial cuts.

polygons                                cells
--------                                -----
ends        join stripes at a node      pinches   join or split material that touches in a point
closed      fill chosen openings        filled    fill small openings
loose_ends  cut stripes back            merged    fill slits, also after each change of walls
stubs       remove ends near a node     bridged   bridge narrow places of openings
bars        straighten bent bars        spikes    cut off spikes of material
                                        rounded   round corners; then bridge and widen narrow places
                                        widths    keep minimum widths of openings and members
                                        improved  flip and collapse edges"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dsfab.core.arrays import Floats
from dsfab.slicing.cutting.cut import Field, checked_lines, polygons_along, sheet_of
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.finishing.fairing import divided_walls, faired_walls
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.slicing.finishing.least_widths import (
    LeastWidths,
    bridged_gaps,
    bridged_necks,
    widened_members,
    with_least_widths,
)
from dsfab.slicing.finishing.loose_ends import Tidy, with_closed_openings, with_meeting_ends, without_loose_ends
from dsfab.slicing.finishing.mesh_quality import improve_cells
from dsfab.slicing.finishing.openings import Merging, filled_crumbs, filled_openings, filled_slits
from dsfab.slicing.finishing.point_contacts import Rule, resolve_pinches
from dsfab.slicing.finishing.spikes import without_spikes
from dsfab.slicing.finishing.straight_bars import with_straight_bars
from dsfab.slicing.finishing.stubs import without_stubs
from dsfab.surface import Surface

BRIDGED_SHARE, ROUNDING_ROUNDS = 0.95, 5
"""After rounding, openings narrower than BRIDGED_SHARE x `neck` get bridges, in at most ROUNDING_ROUNDS rounds."""

PolygonPass = Callable[[PolygonMesh], tuple[PolygonMesh, int]]
"""A pass over the polygons: it returns all polygons, and the number of details that it changed."""


def tidied_sheet(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> Sheet:
    """Cut a surface along levels of fields; return all cells as triangles.
    fields, levels, snap : as in `cut`.    tidy : rules for the removal of stripes, or None."""
    return sheet_of(tidied_polygons(surface, fields, levels, snap, tidy))


def material_area(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> float:
    """Return the area, m2, of the material after a cut along levels of fields.
    fields, levels, snap : as in `cut`.    tidy : rules for the removal of stripes, or None."""
    return tidied_polygons(surface, fields, levels, snap, tidy).material_area


def tidied_polygons(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> PolygonMesh:
    """Cut a surface into polygons along levels of fields.
    fields, levels, snap : as in `cut`.    tidy : rules for the removal of stripes, or None."""
    values, lines = checked_lines(surface, fields, levels)
    if not tidy:
        return polygons_along(surface, fields, values, lines, snap)
    mesh, counts = polygons_along(surface, fields, values, lines, snap, tidy.divided_again), Counter[str]()
    for name, run in polygon_passes(surface, fields, lines, tidy):
        mesh, counts[name] = run(mesh)
    return replace(mesh, stubs=counts["stubs"] + counts["bars"])


def polygon_passes(
    surface: Surface, fields: Sequence[Field], lines: Sequence[Floats], tidy: Tidy
) -> Iterator[tuple[str, PolygonPass]]:
    """Yield name and function of each pass over the polygons. lines : levels of each field."""
    yield "ends", partial(with_meeting_ends, fields=fields, levels=lines)
    yield "closed", partial(with_closed_openings, closed=tidy.closed)
    yield "loose_ends", partial(without_loose_ends, tidy=tidy)
    yield "stubs", partial(without_stubs, tidy=tidy)
    yield "bars", partial(with_straight_bars, surface=surface, fields=fields, tidy=tidy)


class FinishingOptions(NamedTuple):
    """Options of finishing; lengths in metres.
    sized     : True if the preset sets the size `opening`.
    opening   : size under which openings are filled; 0 for none.
    merge     : rule for slits that are filled. With "none", neck and member have no effect.
    neck      : width under which openings get a bridge; 0 for none.    fillet : radius of round corners; 0 for none.
    member    : minimum width of members between round corners; 0 for none.
    least     : minimum widths of openings and of members; 0 for no limit.
    tolerance : largest move of stripe edges when cells are improved; None for no improvement."""

    snap: float
    pinch: Rule
    thickness: float
    sized: bool
    opening: float
    merge: Merging
    neck: float
    fillet: float
    member: float = 0.0
    least: tuple[float, float] = (0.0, 0.0)
    tolerance: float | None = None

    @property
    def rounded_neck(self) -> float:
        return BRIDGED_SHARE * self.neck if self.fillet and self.merge != "none" else 0.0

    @property
    def of_trial(self) -> "FinishingOptions":
        """The options that a `TrialCut` depends on."""
        return self._replace(member=0.0, least=(0.0, 0.0), tolerance=None)


@dataclass(frozen=True, eq=False)
class FinishedSheet:
    """A sheet after some passes of finishing.
    cells     : all cells, material and void.    counts : number of changes by each pass.
    radii     : (k,) radii of the round corners, metres.    unwidened : the cells before the pass for minimum widths.
    shape     : a sentence about the improvement of the cells, or ""."""

    cells: Sheet
    counts: Counter[str] = field(default_factory=Counter)
    radii: Floats = field(default_factory=lambda: np.empty(0))
    unwidened: Sheet | None = None
    shape: str = ""

    def with_cells(self, cells: Sheet, **counts: int) -> "FinishedSheet":
        """Return this sheet with new cells. counts : numbers of changes to add, by name of the pass."""
        return replace(self, cells=cells, counts=self.counts + Counter(counts))


Pass = Callable[[FinishedSheet], FinishedSheet]
"""A pass over the cells: it returns a sheet with all cells, and adds its number of changes to the sheet's `counts`."""


def finish(cells: Sheet, uncut: Surface, options: FinishingOptions, trial: "TrialCut | None" = None) -> FinishedSheet:
    """Finish a cut sheet. uncut : the surface before the cut.    trial : a trial cut with these cells, if available."""
    return _after_passes(cells, passes(uncut, options, trial))


def passes(uncut: Surface, options: FinishingOptions, trial: "TrialCut | None" = None) -> Iterator[tuple[str, Pass]]:
    """Yield name and function of each pass over the cells. A trial cut replaces the passes before rounding."""
    if trial:
        unrounded = trial.unrounded
        yield "trial", lambda _: unrounded
    else:
        yield from passes_before_rounding(options)
    if options.fillet:
        yield "rounded", partial(_with_round_corners, options=options, trial=trial)
    if any(options.least):
        yield "widths", partial(_with_least_widths, uncut=uncut, options=options, trial=trial)
    if options.tolerance is not None:
        yield "improved", partial(_with_better_cells, uncut=uncut, tolerance=options.tolerance)


def passes_before_rounding(options: FinishingOptions) -> Iterator[tuple[str, Pass]]:
    """Yield name and function of each pass before corners are rounded."""
    merge, merges, opening = options.merge, options.merge != "none", options.opening
    slits_first = merges and not options.sized  # most small openings are slits, so slits are filled first
    yield _counting_pass("pinches", partial(resolve_pinches, radius=options.thickness / 2, rule=options.pinch))
    if opening and not slits_first:
        yield _counting_pass("filled", partial(filled_openings, size=opening))
    if merges:
        yield _counting_pass("merged", partial(filled_slits, merge=merge))
    if opening and slits_first:
        yield _counting_pass("filled", partial(filled_openings, size=opening, alike=True))
    if opening and not options.sized:
        yield _counting_pass("filled", filled_crumbs)
    if options.neck and merges:
        yield _counting_pass("bridged", partial(bridged_necks, width=options.neck))
    if merges:
        # fairing opens or closes thin slits, so slits are filled again
        yield _counting_pass("merged", lambda cells: filled_slits(divided_walls(faired_walls(cells)), merge))
        yield _counting_pass("spikes", without_spikes)


def _counting_pass(name: str, change: Callable[[Sheet], tuple[Sheet, int]]) -> tuple[str, Pass]:
    def run(sheet: FinishedSheet) -> FinishedSheet:
        cells, count = change(sheet.cells)
        return sheet.with_cells(cells, **{name: count})

    return name, run


def unrounded_sheet(cells: Sheet, options: FinishingOptions) -> FinishedSheet:
    """Return a sheet after all passes that come before the rounding of corners."""
    return _after_passes(cells, passes_before_rounding(options))


def _after_passes(cells: Sheet, named_passes: Iterator[tuple[str, Pass]]) -> FinishedSheet:
    sheet = FinishedSheet(cells)
    for _, run in named_passes:
        sheet = run(sheet)
    return sheet


def _with_round_corners(
    sheet: FinishedSheet, options: FinishingOptions, trial: "TrialCut | None" = None
) -> FinishedSheet:
    if trial and trial.bridged and trial.options.member == options.member:
        return trial.bridged
    first_rounded, previous_count = trial.rounded if trial else None, sheet.cells.surface.m
    for attempt in range(ROUNDING_ROUNDS + 1):
        rounded = first_rounded or _rounded_once(sheet, options)
        first_rounded = None
        if attempt == ROUNDING_ROUNDS:
            break
        better, bridges, places = _bridged_or_widened(sheet.cells, rounded.cells, options)
        if not (bridges or places) or places > previous_count:  # no change, or more widened places than before
            break
        sheet, previous_count = sheet.with_cells(better, bridged=bridges, widened=places), places or previous_count
    return rounded


def _rounded_once(sheet: FinishedSheet, options: FinishingOptions) -> FinishedSheet:
    cells, radii = rounded_corners(sheet.cells, options.fillet)
    # round corners narrow the openings, so slits are filled again
    cells, merged = filled_slits(cells, options.merge) if options.merge != "none" and len(radii) else (cells, 0)
    return replace(sheet.with_cells(cells, merged=merged), radii=radii)


def _bridged_or_widened(cells: Sheet, rounded: Sheet, options: FinishingOptions) -> tuple[Sheet, int, int]:
    """Bridge narrow openings, or else widen narrow members. Return also the numbers of bridges and widened places."""
    if options.merge == "none":
        return cells, 0, 0
    if options.neck:
        better, bridges = bridged_gaps(cells, rounded, BRIDGED_SHARE * options.neck, options.neck)
        if bridges:
            better, neck_bridges = bridged_necks(better, options.neck)
            return better, bridges + neck_bridges, 0
    better, places = widened_members(cells, rounded, options.member) if options.member else (cells, 0)
    return better, 0, places


def _with_least_widths(
    sheet: FinishedSheet, uncut: Surface, options: FinishingOptions, trial: "TrialCut | None" = None
) -> FinishedSheet:
    if trial and trial.latest.cells is sheet.cells and trial.least and trial.least[0] == options.least:
        result = trial.least[1]
    else:
        result = with_least_widths(sheet.cells, *options.least, options.merge, options.rounded_neck)
    cells = improve_cells(result.cells, uncut).sheet if result.bridged or result.widened else result.cells
    closed = result.filled + result.bridged
    finished = sheet.with_cells(
        cells, closed=closed, thickened=result.widened, narrowed=result.merged, necks=result.necks
    )
    return replace(finished, unwidened=sheet.cells)


def _with_better_cells(sheet: FinishedSheet, uncut: Surface, tolerance: float) -> FinishedSheet:
    better = improve_cells(sheet.cells, uncut, tolerance)
    finished = sheet.with_cells(better.sheet, flips=better.flips, collapses=better.collapses)
    return replace(finished, shape=better.summary)


@dataclass(frozen=True, eq=False)
class TrialCut:
    """A cut with its finishing, made by the search for stripe widths. Slicing can continue from the last trial cut.
    inputs  : fields, levels and `Tidy` rules of the pattern.    cells : sheet before finishing.
    rounded : sheet after the first rounding, or None.    bridged : sheet with added bridges.
    least   : minimum widths of openings and members, metres, and the sheet with these widths."""

    inputs: tuple[object, object, object]
    options: FinishingOptions
    cells: Sheet
    unrounded: FinishedSheet
    rounded: FinishedSheet | None
    bridged: FinishedSheet | None = None
    least: tuple[tuple[float, float], LeastWidths] | None = None

    @classmethod
    def from_cells(cls, inputs: tuple[object, object, object], cells: Sheet, options: FinishingOptions) -> "TrialCut":
        """Make a trial cut: finish the cells of a cut up to the first rounding of corners."""
        unrounded = unrounded_sheet(cells, options)
        rounded = _rounded_once(unrounded, options) if options.fillet else None
        return cls(inputs, options, cells, unrounded, rounded)

    def is_cut_of(self, inputs: tuple[object, object, object]) -> bool:
        """Return True if this cut was made from these `inputs`; equal copies do not count."""
        return all(a is b for a, b in zip(self.inputs, inputs, strict=True))

    def serves(self, inputs: tuple[object, object, object], options: FinishingOptions) -> bool:
        """Return True if slicing with these inputs and options can continue from this cut."""
        return self.is_cut_of(inputs) and options.of_trial == self.options.of_trial

    @property
    def latest(self) -> FinishedSheet:
        """The sheet after the latest pass, without minimum widths."""
        return self.bridged or self.rounded or self.unrounded

    @property
    def added_area(self) -> float:
        """Area of material added by finishing up to the first rounding of corners, square metres."""
        return (self.rounded or self.unrounded).cells.material_area - self.cells.material_area

    @property
    def bridged_area(self) -> float:
        """Area of added bridges, square metres."""
        if not (self.bridged and self.rounded):
            return 0.0
        return self.bridged.cells.material_area - self.rounded.cells.material_area

    @property
    def widened_area(self) -> float:
        """Area of material that the pass for minimum widths added, square metres."""
        return self.least[1].cells.material_area - self.latest.cells.material_area if self.least else 0.0

    def with_bridges(self) -> "TrialCut":
        """Return this cut with bridges across narrow openings."""
        return replace(self, bridged=_with_round_corners(self.unrounded, self.options, self)) if self.rounded else self

    def with_least_widths(self, gap: float, member: float) -> "TrialCut":
        """Return this cut with minimum widths of openings (`gap`) and members, metres."""
        options = self.options
        widened = with_least_widths(self.latest.cells, gap, member, options.merge, options.rounded_neck)
        return replace(self, least=((gap, member), widened))
