"""The line under the picture of a design."""

from dsfab.pipeline.design import Design
from dsfab.wording import length, mass


def caption(design: Design) -> str:
    """One line under the picture."""
    pieces = design.solid.pieces
    share = design.sheet.surface.area / design.surface.area
    return (
        f"{design.preset.name} - {share:.0%} of the surface kept, {length(design.preset.statics.thickness)} thick, "
        f"{mass(design.mass)}, {pieces} {'piece' if pieces == 1 else 'pieces'}"
    )
