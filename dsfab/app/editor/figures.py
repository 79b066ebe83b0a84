"""What a structure measures, from its cut sheet: area, mass, pieces, and how wide its members are."""

from typing import Any

from dsfab.app.editor.job import Telling
from dsfab.pipeline import Design, least_widths
from dsfab.pipeline.geometry import slicing_step
from dsfab.pipeline.log import Log
from dsfab.slicing.features import features, kept_cells

TIDIED = "slicing: the picture shows stripes as they are drawn; what is built of them, and measured here, is tidied"
"""Told before what that changes."""


def figures(made: Design, progress: Telling | None = None) -> dict[str, Any]:
    """Square metres, kilograms (sheet area times thickness), pieces and widths in metres, ready for JSON.

    Raises DsfabError when the pattern leaves no material.
    """
    log, preset = Log(progress), made.preset
    cut = slicing_step(preset, made.surface, made.statics, made.pattern, log)
    if progress:
        progress("slicing", "measuring members")
    sheet = cut.sheet.surface
    found = features(cut.cells, kept_cells(cut.cells, cut.sheet), made.pattern.names)
    limits, share = found.histogram()
    narrow = found.member
    return {
        "area": sheet.area,
        "share": sheet.area / made.surface.area,
        "mass": sheet.area * preset.statics.thickness * preset.statics.density,
        "pieces": len(cut.pieces),
        "loose": sum(not piece.held for piece in cut.pieces),
        "narrowest": None if narrow is None else narrow.size,
        "place": None if narrow is None else narrow.place.tolist(),
        "limits": limits.tolist(),
        "widths": share.tolist(),
        "min_member": preset.fabrication.min_member or least_widths(made.settled, made.surface).member,
        "pattern": _pattern(made),
        "compliance": made.statics.equilibrium.compliance,
        "notes": [*_tidied(made), *(f"{note.stage}: {note.text}" for note in log.notes)],
    }


def _tidied(made: Design) -> list[str]:
    return [TIDIED] if made.pattern.tidy is not None or made.preset.pattern.fillet else []


def _pattern(made: Design) -> dict[str, Any]:
    """Dead ends, slits, and the clear openings, metres, that nine tenths of the area of both families lie between."""
    found = made.quality(symmetry=False)
    open_ = [family.opening for _, family in found.families if family.opening[2] > 0]
    between = [min(one[0] for one in open_), max(one[2] for one in open_)] if open_ else None
    return {"dead_ends": found.dead_ends, "slits": found.slits, "openings": between}
