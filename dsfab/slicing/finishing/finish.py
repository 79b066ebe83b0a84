"""Finishing: the passes over a cut surface, from loose ends of stripes to round corners, and trial cuts."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dsfab.core.arrays import Bools, Floats
from dsfab.slicing.cutting.cut import Field, adjacent_faces, checked_lines, cut_polygons, sheet_of
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh, Tidy
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
from dsfab.slicing.finishing.loose_ends import with_closed_openings, with_meeting_ends, without_loose_ends
from dsfab.slicing.finishing.openings import Merging, filled_crumbs, filled_openings, filled_slits
from dsfab.slicing.finishing.point_contacts import Rule, resolve_pinches
from dsfab.slicing.finishing.spikes import without_spikes
from dsfab.slicing.finishing.straight_bars import with_straight_bars
from dsfab.slicing.finishing.stubs import without_stubs
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField

BRIDGED_SHARE, ROUNDING_ROUNDS = 0.95, 5
"""Rounding and bridging repeat at most ROUNDING_ROUNDS times; gaps under BRIDGED_SHARE of a neck get a bridge."""


def tidied_sheet(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> Sheet:
    """Return the cells of `tidied_polygons` (fields and levels as in `cut`), filled with triangles (m, 3)."""
    return sheet_of(tidied_polygons(surface, fields, levels, snap, tidy))


def material_area(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> float:
    """Return the material area of `tidied_polygons`, square metres; fields (n,) or (n, 2) and levels as in `cut`."""
    return tidied_polygons(surface, fields, levels, snap, tidy).material_area


def tidied_polygons(
    surface: Surface, fields: Sequence[Field], levels: Sequence[ArrayLike], snap: float = 0.05, tidy: Tidy | None = None
) -> PolygonMesh:
    """Cut a surface as `cut_polygons` does; join, close, remove and straighten loose ends, unless `tidy` is None."""
    mesh = cut_polygons(surface, fields, levels, snap, tidy)
    if not tidy:
        return mesh
    mesh = with_meeting_ends(mesh, fields, checked_lines(surface, fields, levels)[1])
    nodes = _nodes(mesh)
    mesh = without_loose_ends(with_closed_openings(mesh, tidy.closed), tidy)
    mesh, stubs = without_stubs(mesh, nodes, tidy)
    mesh, bars = with_straight_bars(mesh, _nodes(mesh), _near_singular(mesh, surface, fields), tidy, surface.size)
    return replace(mesh, stubs=stubs + bars)


def _nodes(mesh: PolygonMesh) -> Bools:
    return np.asarray((mesh.also == mesh.family) & ~mesh.void)


def _near_singular(mesh: PolygonMesh, surface: Surface, fields: Sequence[Field]) -> Bools:
    """Mask (c,) of polygons beside faces where the polygon's field has no phase; void polygons have any value."""
    blank = [x.blank if isinstance(x, CornerField) else np.zeros(surface.m, dtype=bool) for x in fields]
    near_blank = np.array([adjacent_faces(surface, faces) for faces in blank])
    return np.asarray(near_blank[mesh.family, mesh.parent])


class FinishingOptions(NamedTuple):
    """Options of finishing; lengths in metres.

    snap, pinch : as in [slicing].    thickness : of the sheet.
    sized   : whether the preset sets the smallest opening.
    opening : smaller openings are filled; 0 for none.
    merge   : slits to fill. Without any, necks, rounded openings and members stay as they are.
    neck    : openings with a narrower neck get a bridge; 0 for none.
    fillet  : radius of round corners, or 0.
    member  : members narrower than this between round corners become wider; 0 for none."""

    snap: float
    pinch: Rule
    thickness: float
    sized: bool
    opening: float
    merge: Merging
    neck: float
    fillet: float
    member: float = 0.0

    @property
    def rounded_neck(self) -> float:
        """Metres below which openings with round corners are bridged, except tips; 0 for none."""
        return BRIDGED_SHARE * self.neck if self.fillet and self.merge != "none" else 0.0


@dataclass(frozen=True, eq=False)
class FinishedSheet:
    """All cells after some passes.

    counts : numbers of details that passes changed, by the names of the passes.
    radii  : (k,) radii of the round corners, metres."""

    cells: Sheet
    counts: Counter[str] = field(default_factory=Counter)
    radii: Floats = field(default_factory=lambda: np.empty(0))

    def with_cells(self, cells: Sheet, **counts: int) -> "FinishedSheet":
        """Return the cells after a pass, with more counts."""
        return replace(self, cells=cells, counts=self.counts + Counter(counts))

    @property
    def material_area(self) -> float:
        """Area of the material, square metres."""
        return float(self.cells.surface.areas[self.cells.material].sum())


Pass = Callable[[Sheet], tuple[Sheet, int]]
"""A step of finishing: it returns all cells, and the number of details that it changed."""


def passes(options: FinishingOptions) -> Iterator[tuple[str, Pass]]:
    """Yield the passes that precede the rounding of corners, in order, each with the name of its count in the notes."""
    merge, merges, opening = options.merge, options.merge != "none", options.opening
    slits_first = merges and not options.sized  # most small openings are slits
    yield "pinches", partial(_without_pinches, options=options)
    if opening and not slits_first:
        yield "filled", partial(filled_openings, size=opening)
    if merges:
        yield "merged", partial(filled_slits, merge=merge)
    if opening and slits_first:
        yield "filled", partial(filled_openings, size=opening, alike=True)
    if opening and not options.sized:
        yield "filled", filled_crumbs
    if options.neck and merges:
        yield "bridged", partial(bridged_necks, width=options.neck)
    if merges:
        # because fairing opens or closes thin slits
        yield "merged", lambda cells: filled_slits(divided_walls(faired_walls(cells)), merge)
        yield "spikes", without_spikes


def _without_pinches(cells: Sheet, options: FinishingOptions) -> tuple[Sheet, int]:
    result = resolve_pinches(cells, options.thickness / 2, options.pinch)
    return result.sheet, result.count


def unrounded_sheet(cells: Sheet, options: FinishingOptions) -> FinishedSheet:
    """Finish the cells of a cut by all `passes`, without round corners."""
    sheet = FinishedSheet(cells)
    for name, run in passes(options):
        changed_cells, count = run(sheet.cells)
        sheet = sheet.with_cells(changed_cells, **{name: count})
    return sheet


def finish(cells: Sheet, options: FinishingOptions, trial: "TrialCut | None" = None) -> FinishedSheet:
    """Finish the cells of a cut by all `passes`, and round their corners.

    trial : the trial cut with these cells, if it exists: its steps are not repeated.
    """
    if trial and trial.bridged and trial.options == options:
        return trial.bridged
    sheet = trial.unrounded if trial else unrounded_sheet(cells, options)
    return _rounded_sheet(sheet, options, trial.rounded if trial else None) if options.fillet else sheet


def _rounded_sheet(sheet: FinishedSheet, options: FinishingOptions, first: FinishedSheet | None) -> FinishedSheet:
    """Round corners, and repeat where the result is too narrow.

    first : the first result, if it exists.
    """
    previous_count = sheet.cells.surface.m
    for attempt in range(ROUNDING_ROUNDS + 1):
        rounded = first or _rounded_once(sheet, options)
        first = None
        if attempt == ROUNDING_ROUNDS:
            break
        better, bridges, places = _bridged_or_widened(sheet.cells, rounded.cells, options)
        if not (bridges or places) or places > previous_count:  # finished, or the rounds do not converge
            break
        sheet, previous_count = sheet.with_cells(better, bridged=bridges, widened=places), places or previous_count
    return rounded


def _rounded_once(sheet: FinishedSheet, options: FinishingOptions) -> FinishedSheet:
    cells, radii = rounded_corners(sheet.cells, options.fillet)
    # round corners narrow the openings
    cells, merged = filled_slits(cells, options.merge) if options.merge != "none" and len(radii) else (cells, 0)
    return replace(sheet.with_cells(cells, merged=merged), radii=radii)


def _bridged_or_widened(cells: Sheet, rounded: Sheet, options: FinishingOptions) -> tuple[Sheet, int, int]:
    """Bridge gaps of the rounded sheet, or else widen its members; return cells, bridges and widened places."""
    if options.merge == "none":
        return cells, 0, 0
    if options.neck:
        better, bridges = bridged_gaps(cells, rounded, BRIDGED_SHARE * options.neck, options.neck)
        if bridges:
            better, neck_bridges = bridged_necks(better, options.neck)
            return better, bridges + neck_bridges, 0
    better, places = widened_members(cells, rounded, options.member) if options.member else (cells, 0)
    return better, 0, places


@dataclass(frozen=True, eq=False)
class TrialCut:
    """The cut of a pattern from the search for its widths: slicing with the same options continues from it.

    inputs  : fields, levels and tidy of the pattern.    cells : as they were cut.
    rounded : after the first rounding; None without round corners.    bridged : with bridges.
    least   : least widths of openings and members, metres, and the sheet that keeps them.
    """

    inputs: tuple[object, object, object]
    options: FinishingOptions
    cells: Sheet
    unrounded: FinishedSheet
    rounded: FinishedSheet | None
    bridged: FinishedSheet | None = None
    least: tuple[tuple[float, float], LeastWidths] | None = None

    @classmethod
    def from_cells(cls, inputs: tuple[object, object, object], cells: Sheet, options: FinishingOptions) -> "TrialCut":
        """Finish the cells of a cut up to the first rounding of corners."""
        unrounded = unrounded_sheet(cells, options)
        rounded = _rounded_once(unrounded, options) if options.fillet else None
        return cls(inputs, options, cells, unrounded, rounded)

    def is_cut_of(self, inputs: tuple[object, object, object]) -> bool:
        """Return whether this is the cut along these fields, levels and tidy, by identity."""
        return all(a is b for a, b in zip(self.inputs, inputs, strict=True))

    def serves(self, inputs: tuple[object, object, object], options: FinishingOptions) -> bool:
        """Return whether the program would cut and finish a pattern with these inputs and options in the same way."""
        return self.is_cut_of(inputs) and options._replace(member=0.0) == self.options._replace(member=0.0)

    @property
    def latest(self) -> FinishedSheet:
        """The sheet after the latest step of finishing, except least widths."""
        return self.bridged or self.rounded or self.unrounded

    @property
    def added_area(self) -> float:
        """Material that finishing adds to the cut up to the first rounding, square metres."""
        return (self.rounded or self.unrounded).material_area - FinishedSheet(self.cells).material_area

    @property
    def bridged_area(self) -> float:
        """Material that bridges between round corners add, square metres."""
        return self.bridged.material_area - self.rounded.material_area if self.bridged and self.rounded else 0.0

    @property
    def widened_area(self) -> float:
        """Area that wider members add, square metres."""
        return FinishedSheet(self.least[1].cells).material_area - self.latest.material_area if self.least else 0.0

    def with_bridges(self) -> "TrialCut":
        """Return the trial cut with bridges where gaps are too narrow between rounded members."""
        bridged = _rounded_sheet(self.unrounded, self.options, self.rounded) if self.rounded else None
        return replace(self, bridged=bridged)

    def with_least_widths(self, gap: float, member: float) -> "TrialCut":
        """Return the trial cut with least widths, metres, of openings and members."""
        return replace(self, least=((gap, member), least_widths_of(self.latest.cells, gap, member, self.options, self)))


def least_widths_of(
    cells: Sheet, gap: float, member: float, options: FinishingOptions, trial: TrialCut | None = None
) -> LeastWidths:
    """Return finished cells with least widths, metres, of openings and members, see `with_least_widths`.

    trial : a trial cut of the same cells and widths already holds the result."""
    if trial and trial.latest.cells is cells and trial.least and trial.least[0] == (gap, member):
        return trial.least[1]
    return with_least_widths(cells, gap, member, options.merge, options.rounded_neck)
