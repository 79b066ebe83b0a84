"""Can it be made? The smallest things on a design, each with its place, against what the workshop can make."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import PatternError, StaticsError
from dsfab.limits import FILM, Status
from dsfab.pipeline import acting_on, least_widths, sheet_loads
from dsfab.pipeline.design import Design
from dsfab.slicing.features import Feature, Features, features, kept_cells
from dsfab.slicing.quality import Quality, quality
from dsfab.surface import Picker, edges_of, load_names, pieces, support_names
from dsfab.thickening.wall import Wall, thinnest_wall
from dsfab.wording import length

TOO_FINE = 1e-3
"""Metres; what is narrower, and than its limit, is not built unless somebody accepts it."""


@dataclass(frozen=True, eq=False)
class Check:
    """A limit of [fabrication] and what was measured, metres (for `bed` three of each).

    name  : the key of the limit.    value, place, what : empty where there is nothing of the kind, which passes.
    asked : whether [fabrication] says it; else it is what the design is kept to, see `least_widths`.
    """

    name: str
    limit: tuple[float, ...]
    value: tuple[float, ...]
    place: tuple[float, ...]
    what: str
    verdict: Status
    asked: bool = True


@dataclass(frozen=True)
class Touches:
    """A piece of the sheet: m2, and the entries of surface.support and surface.load that act on it, counted from 1; and
    what they are called."""

    area: float
    supports: tuple[int, ...]
    loads: tuple[int, ...]
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FabricationMeasures:
    """What `fabrication` finds; lengths in metres."""

    thickness: float
    features: Features
    wall: Wall | None
    box: Floats
    pieces: tuple[Touches, ...]
    quality: Quality
    checks: tuple[Check, ...]

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that fail."""
        return tuple(check for check in self.checks if check.verdict == "fail")


def fabrication(design: Design) -> FabricationMeasures:
    """Measure a design and compare it with the limits of its preset.

    A limit is met or not on the sheet and the solid as they are built: it passes or fails.
    """
    cells = design.slicing.cells
    least = least_widths(design.settled, design.surface)
    found = features(cells, kept_cells(cells, design.sheet), design.pattern.names, tips=least.gap > 0)
    wall, box = thinnest_wall(design.solid), np.ptp(design.solid.box, axis=0)
    ask = design.preset.fabrication
    checks = []
    if limit := ask.min_member or least.member:
        checks.append(_checked("min_member", limit, found.member, asked=ask.min_member > 0))
    if limit := ask.min_gap or least.gap:
        checks.append(_checked("min_gap", limit, found.gap, asked=ask.min_gap > 0))
    if ask.min_wall:
        here = None if wall is None else Feature(wall.thickness, wall.place, "a wall of the solid", 0.0)
        checks.append(_checked("min_wall", ask.min_wall, here))
    if ask.bed is not None:
        fits = bool((np.sort(box) <= np.sort(ask.bed)).all())
        size = tuple(box.tolist())
        checks.append(Check("bed", ask.bed, size, (), "the whole solid", "pass" if fits else "fail"))
    touches, thickness = _touches(design), design.preset.statics.thickness
    return FabricationMeasures(thickness, found, wall, box, touches, quality(design.sheet.surface), tuple(checks))


def refusals(design: Design, made: FabricationMeasures | None = None) -> tuple[str, ...]:
    """Why a design is not to be shipped unless somebody accepts it, a clause each: loads that nothing carries, a sheet
    that was thinned to a film; where it is kept to what a workshop makes, members and openings under a millimetre that
    fail their limit.

    made : what was measured on it; None leaves out what has to be measured.
    """
    loads, why = {name: case.load for name, case in design.statics.cases.items()}, []
    try:
        sheet_loads(design.surface, design.slicing.cells.kept(), design.sheet, loads)
    except StaticsError as error:
        why.append(str(error))
    repairs = design.solid.repairs
    if repairs.thinnest < FILM and repairs.thinnest_at is not None:
        thin = length(repairs.thinnest * design.preset.statics.thickness)
        place = ", ".join(f"{x + 0.0:.3g}" for x in repairs.thinnest_at)
        why.append(f"the sheet was thinned to a film of {thin} at ({place}) m")
    for check in made.failed if made and design.settled.pattern.for_workshop else ():
        if check.name in ("min_member", "min_gap") and check.value[0] < TOO_FINE:
            place = ", ".join(f"{x + 0.0:.3g}" for x in check.place)
            why.append(f"{check.what} of {length(check.value[0])} at ({place}) m cannot be made")
    return tuple(why)


def require_fit(design: Design, made: FabricationMeasures | None = None, measure: bool = True) -> None:
    """Raise PatternError for what `refusals` finds, unless the preset accepts it (`fabrication.accept`).

    measure : whether what has to be measured is, unless it is known.
    """
    if made is None and measure and design.settled.pattern.for_workshop:
        made = fabrication(design)
    if not design.preset.fabrication.accept and (why := refusals(design, made)):
        raise PatternError(f"{'; '.join(why)}. To have it as it is: --accept, or fabrication.accept = true")


def _checked(name: str, limit: float, found: Feature | None, asked: bool = True) -> Check:
    if found is None:
        return Check(name, (limit,), (), (), "", "pass", asked)
    verdict: Status = "fail" if found.size < limit else "pass"
    return Check(name, (limit,), (found.size,), tuple(found.place.tolist()), found.what, verdict, asked)


def _touches(design: Design) -> tuple[Touches, ...]:
    """The pieces of the sheet, largest first by number of triangles, and what each touches."""
    sheet, on = design.sheet, acting_on(design.preset, design.surface)
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)

    def touched(entries: Sequence[object]) -> list[list[int]]:
        found: list[list[int]] = [[] for _ in range(count)]
        for number, entry in enumerate(entries, 1):
            if (at := getattr(entry, "at", None)) is not None:  # self-weight acts everywhere
                for k in _pieces_at(design, at, label):
                    found[k].append(number)
        return found

    supports, loads = touched(on.support), touched(on.load)
    called = support_names(on.support), load_names(on.load)

    def piece(k: int) -> Touches:
        names = [names[number - 1] for names, at in zip(called, (supports[k], loads[k]), strict=True) for number in at]
        return Touches(float(area[k]), tuple(supports[k]), tuple(loads[k]), tuple(names))

    return tuple(map(piece, range(count)))


def _pieces_at(design: Design, at: Picker, label: Ints) -> list[int]:
    surface = design.surface
    there = design.sheet.between(surface, at.vertices(surface), edges_of(at, surface))
    faces = there[design.sheet.surface.F].any(axis=1)
    return [int(k) for k in np.unique(label[faces])]
