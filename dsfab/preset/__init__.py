"""Presets: all choices of a design, one section per stage."""

from dsfab.preset.model import (
    AUTO,
    FAMILIES,
    STAGES,
    STRIPES_ACROSS,
    Diffusion,
    Export,
    Fabrication,
    Family,
    FormatName,
    LeastWidth,
    Method,
    Mode,
    Pattern,
    Phase,
    Preset,
    Slicing,
    Statics,
    Thickening,
    Width,
)

__all__ = [
    "AUTO", "FAMILIES", "STAGES", "STRIPES_ACROSS", "Diffusion", "Export", "Fabrication", "Family", "FormatName",
    "LeastWidth", "Method", "Mode", "Pattern", "Phase", "Preset", "Slicing", "Statics", "Thickening", "Width",
]  # fmt: skip
