"""What of a design goes into a file of which format: the solid, the sheet with its lines, or the fields."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.delivery.bar_records import bar_records, utilisation_records
from dsfab.delivery.beam_records import beam_records
from dsfab.delivery.fields import design_fields
from dsfab.delivery.forces import force_records
from dsfab.delivery.lines import design_lines
from dsfab.delivery.member_records import graph_records
from dsfab.delivery.member_shapes import member_shapes
from dsfab.delivery.opened import opened
from dsfab.errors import ExportError
from dsfab.export import Details, StepOptions
from dsfab.export import write as written
from dsfab.export.formats import FORMATS, Takes, format_of, suffix_of
from dsfab.export.smooth.source import NO_PAIRS, Curved, DividedSheet, StripedSheet
from dsfab.limits import OUTLINE
from dsfab.members import striped_cells
from dsfab.pipeline.design import Design
from dsfab.preset import Export
from dsfab.preset_surface import FileSurface
from dsfab.results import PatternResult
from dsfab.slicing import Sheet, cut
from dsfab.slicing.corners import outline_corners, outline_labels
from dsfab.surface import Surface, pieces
from dsfab.thickening import SHIFT, Side, Solid, offsets

if TYPE_CHECKING:
    import build123d

SNAP = 0.1
"""Snap fraction of the borders of charts (see `cut`)."""


def write(thing: Design | Sheet | Solid | Surface, path: str | Path, **options: Any) -> Path:
    """Write one file, its format by the suffix of `path`, and read it back; returns the path.

    Of a design what `dsfab build` and `dsfab export` write, byte for byte: the solid with its edges and facts, the
    lines of the sheet, or the fields of the uncut surface, whichever the format holds. Of a solid, a sheet or a surface
    alone that alone. `options` are those of `dsfab.export.write`; of a design they go before those of its preset.

    Raises ExportError: see there.
    """
    if not isinstance(thing, Design):
        return written(thing.surface if isinstance(thing, Sheet) else thing, path, **options)
    format_of(Path(path))
    part, how = deliverable(thing, suffix_of(Path(path)))
    if isinstance(route := options.get("step"), str) and "step" in how:
        options["step"] = replace(how["step"], route=route)
    return written(part, path, **{"name": thing.preset.name, **how, **options})


def to_build123d(thing: Design | Solid) -> "build123d.Shape":
    """As STEP has it, millimetres: of a design what `design.write("x.step")` writes, smooth where it is.

    Raises ExportError: see `write`.
    """
    import build123d

    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        return build123d.import_step(write(thing, Path(folder) / "shape.step"))


def deliverable(design: Design, suffix: str) -> tuple[Solid | Surface, dict[str, Any]]:
    """The thing, and the keywords for `dsfab.export.write`; `suffix` is one of `FORMATS`, with its dot.

    The solid for formats of meshes, with the lines for those that hold both; the kept sheet for formats of lines, of
    members, also as bodies, of section forces and of beams; the uncut surface for fields, which are known there.
    """
    ask, takes = design.preset.export, FORMATS[suffix].takes
    if takes == "fields":
        values = design_fields(design) if design.fields is None else design.fields
        return design.surface, {"details": Details(values=values)}
    if told := _OF_SHEET.get(takes):
        return design.sheet.surface, {"details": told(design)}
    if takes == "mesh":
        corners = outline_corners(design.sheet, design.surface)
        made_of = {"material": design.preset.statics.material}
        details = Details(measures=_measures(design), records=made_of, origin=_origin(design))
        step = replace(step_options(ask), corners=corners, curved=partial(curved_design, design))
        return design.solid, {"step": step, "details": details}
    tolerance = ask.step_tolerance or OUTLINE * design.preset.statics.thickness
    exact = FORMATS[suffix].curves  # its tolerance is for the curves alone
    details = Details(design_lines(design, 0.0 if exact else tolerance), tolerance, facts=_facts(design))
    return (design.solid if takes == "both" else design.sheet.surface), {"details": details}


def body_details(design: Design) -> Details:
    """Members as bodies, with what is known of them and what they are made of."""
    tolerance = design.preset.export.step_tolerance or OUTLINE * design.preset.statics.thickness
    records = graph_records(design.members) | {"material": design.preset.statics.material}
    shapes = member_shapes(design)
    return Details(
        tolerance=tolerance, measures=_measures(design), records=records, shapes=shapes, origin=_origin(design)
    )


_OF_SHEET: dict[Takes, Callable[[Design], Details]] = {
    "members": lambda design: Details(records=graph_records(design.members)),
    "bodies": body_details,
    "forces": lambda design: Details(records=force_records(design)),
    "bars": lambda design: Details(records=bar_records(design)),
    "utilisation": lambda design: Details(records=utilisation_records(design)),
    "frame": lambda design: Details(records=beam_records(design)),
}
"""What formats of the kept sheet take of a design, but for those of lines."""


def step_options(ask: Export) -> StepOptions:
    """How STEP is made, as the preset has it."""
    return StepOptions(ask.step, ask.step_faces, ask.step_tolerance, ask.step_mb)


def _origin(design: Design) -> tuple[float, float, float]:
    """Metres, of a mesh file with a survey's coordinates; shapes have none."""
    surface = design.preset.surface
    return surface.origin if isinstance(surface, FileSurface) else (0.0, 0.0, 0.0)


def _measures(design: Design) -> dict[str, float]:
    """Thickness and material, SI."""
    statics = design.preset.statics
    return {key: getattr(statics, key) for key in ("thickness", "density", "young", "poisson")}


def _facts(design: Design) -> tuple[str, ...]:
    """Lines of a title block."""
    statics, sheet = design.preset.statics, design.sheet.surface
    area, count = sheet.area, pieces(sheet.F, sheet.edges)[0]
    mass = f"{design.mass:,.0f}".replace(",", " ") if design.mass >= 100 else f"{design.mass:.3g}"
    return (
        f"sheet {1000 * statics.thickness:.3g} mm thick, {mass} kg",
        f"{area:.4g} m2, {area / design.surface.area:.0%} of the uncut surface",
        f"{count} {'piece' if count == 1 else 'pieces'}",
        "centre lines: blue major, red minor",
    )


def curved_design(design: Design) -> Curved:
    """The sheet of a design; raises ExportError where the solid is more than that sheet, thickened."""
    ask = design.preset.thickening
    if ask.extra:
        raise ExportError("the solid has extra parts beside the sheet")
    if design.solid.repairs.rung == "united":
        raise ExportError("the sheet crosses itself, and its parts are fused there")
    sheet = curved_sheet(design.surface, design.sheet, design.preset.statics.thickness, ask.side)
    return replace(sheet, striped=lambda: striped_sheet(design.surface, design.sheet, design.pattern))


def striped_sheet(surface: Surface, sheet: Sheet, pattern: PatternResult) -> StripedSheet:
    """A kept sheet that was cut from `surface` along a pattern, by its stripes; opened if the surface has one side."""
    cells, opening = striped_cells(surface, sheet, pattern), opened(surface, sheet)
    whole, seam = opening.sheet(cells.sheet) if opening else (cells.sheet, NO_PAIRS)
    return StripedSheet(whole.surface.F, whole.weights, cells.label, cells.loose, seam)


def curved_sheet(surface: Surface, sheet: Sheet, thickness: float | Floats, side: Side = "mid") -> Curved:
    """A kept sheet and the surface it was cut from.

    thickness : metres, or (n,) of them.   A surface with one side only is cut open.
    """
    found, opening, twins = offsets(surface, thickness, side), opened(surface, sheet), NO_PAIRS
    D = found.D
    if opening:
        D, twins = opening.offsets(found.at_corners(surface.F)), opening.twins
        surface, sheet = opening.surface, opening.sheet(sheet)[0]
    cut_in = partial(divided, surface, sheet, D)
    return Curved(surface.V, surface.F, D, SHIFT[side], cut_in, twins=twins)


def divided(surface: Surface, sheet: Sheet, D: Floats, fields: Floats) -> DividedSheet:
    """The kept sheet cut along the upper envelope of fields (n, c) on the uncut surface."""
    count = fields.shape[1]
    chart = np.zeros(sheet.surface.m, dtype=np.int64)
    if count > 1:
        over = [fields[:, k] - fields[:, k + 1 :].max(axis=1) for k in range(count - 1)]
        parts = cut(sheet.surface, [sheet.carry(x) for x in over], [np.zeros(1)] * len(over), SNAP)
        chart = np.where(parts.material, parts.family, count - 1)
        family, weights = sheet.family[parts.parent], parts.weights @ sheet.weights
        sheet = Sheet(parts.surface, sheet.parent[parts.parent], family, weights)
        chart = _where_largest(sheet.carry(fields), sheet.surface.F, chart)
    labels = outline_labels(sheet, surface)
    return DividedSheet(sheet.surface.V, sheet.surface.F, sheet.carry(D), chart, labels.half_edge, labels.family)


def _where_largest(fields: Floats, F: Ints, chart: Ints) -> Ints:
    """(m,) charts, but for faces where theirs is largest at no corner: there the largest in the middle.

    Where three borders meet, what is cut away by one of them may be none of the others': it would be left to the last
    chart, which may be far away.
    """
    corners = fields[F]
    own = np.take_along_axis(corners, chart[:, None, None], axis=2)[:, :, 0]
    lost = (own < corners.max(axis=2)).all(axis=1)
    return np.where(lost, corners.mean(axis=1).argmax(axis=1), chart)
