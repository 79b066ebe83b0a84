"""A draft cut as it is built, and what that measures: area, mass, pieces, and how wide its members are."""

from typing import Any

from dsfab.app.editor.job import Telling
from dsfab.pipeline import Design, Log, least_widths
from dsfab.pipeline.geometry import slicing_step
from dsfab.pipeline.measures import measured_pattern
from dsfab.results import SlicingResult
from dsfab.slicing.features import features, kept_cells, under


def cut_as_built(made: Design, progress: Telling | None = None) -> tuple[SlicingResult, list[str]]:
    """The cut and tidied sheet of a draft, and what there is to say of it.

    Raises DsfabError when the pattern leaves no material.
    """
    log = Log(progress)
    cut = slicing_step(made.preset, made.surface, made.statics, made.pattern, log)
    return cut, [f"{note.stage}: {note.text}" for note in log.notes]


def figures(made: Design, cut: SlicingResult, notes: list[str]) -> dict[str, Any]:
    """Square metres, kilograms (sheet area times thickness), pieces and widths in metres, ready for JSON.

    under, bars_under : whether the narrowest member, and what a bar of the histogram holds, is under the least width.
    """
    preset, sheet = made.preset, cut.sheet.surface
    found = features(cut.cells, kept_cells(cut.cells, cut.sheet), made.pattern.names)
    least = preset.fabrication.min_member or least_widths(made.settled, made.surface).member
    limits, share = found.histogram(least)
    narrow = found.member
    return {
        "area": sheet.area,
        "share": sheet.area / made.surface.area,
        "mass": sheet.area * preset.statics.thickness * preset.statics.density,
        "pieces": len(cut.pieces),
        "loose": sum(not piece.held for piece in cut.pieces),
        "narrowest": None if narrow is None else narrow.size,
        "under": narrow is not None and bool(under(narrow.size, least)),
        "place": None if narrow is None else narrow.place.tolist(),
        "limits": limits.tolist(),
        "widths": share.tolist(),
        "bars_under": under((limits[1:] + limits[:-1]) / 2, least).tolist(),  # one ends at the least width
        "min_member": least,
        "pattern": _pattern(made, cut),
        "compliance": made.statics.equilibrium.compliance,
        "notes": notes,
    }


def _pattern(made: Design, cut: SlicingResult) -> dict[str, Any]:
    """Dead ends, slits, and the clear openings, metres, that nine tenths of the area of both families lie between."""
    found = measured_pattern(made, False, cut.cells, cut.sheet)
    open_ = [family.opening for _, family in found.families if family.opening[2] > 0]
    between = [min(one[0] for one in open_), max(one[2] for one in open_)] if open_ else None
    return {"dead_ends": found.dead_ends, "slits": found.slits, "openings": between}
