"""What of a design goes into a file of which format: the solid, the sheet with its lines, or the fields."""

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsfab.delivery.curved import curved_design
from dsfab.delivery.fields import design_fields
from dsfab.delivery.lines import design_lines
from dsfab.export import Details, StepOptions
from dsfab.export import write as written
from dsfab.export.formats import FORMATS, format_of, suffix_of
from dsfab.limits import OUTLINE
from dsfab.pipeline.design import Design
from dsfab.preset import Export
from dsfab.slicing import Sheet
from dsfab.slicing.corners import outline_corners
from dsfab.surface import Surface
from dsfab.surface.topology import pieces
from dsfab.thickening import Solid

if TYPE_CHECKING:
    import build123d


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
    part, how = delivered(thing, suffix_of(Path(path)))
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


def delivered(design: Design, suffix: str) -> tuple[Solid | Surface, dict[str, Any]]:
    """The thing, and the keywords for `dsfab.export.write`; `suffix` is one of `FORMATS`, with its dot.

    The solid for formats of meshes, with the lines for those that hold both; the kept sheet for formats of lines; the
    uncut surface for fields, which are known there.
    """
    ask, takes = design.preset.export, FORMATS[suffix].takes
    if takes == "fields":
        values = design_fields(design) if design.fields is None else design.fields
        return design.surface, {"details": Details(values=values)}
    if takes == "mesh":
        corners = outline_corners(design.sheet, design.surface)
        details = Details(measures=_measures(design))
        step = replace(step_options(ask), corners=corners, curved=partial(curved_design, design))
        return design.solid, {"step": step, "details": details}
    tolerance = ask.step_tolerance or OUTLINE * design.preset.statics.thickness
    exact = FORMATS[suffix].curves  # its tolerance is for the curves alone
    details = Details(design_lines(design, 0.0 if exact else tolerance), tolerance, facts=_facts(design))
    return (design.solid if takes == "both" else design.sheet.surface), {"details": details}


def step_options(ask: Export) -> StepOptions:
    """How STEP is made, as the preset has it."""
    return StepOptions(ask.step, ask.step_faces, ask.step_tolerance, ask.step_mb)


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
