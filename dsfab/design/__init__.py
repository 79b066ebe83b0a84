"""Stages of a design: `run` computes a preset; `revise` computes a design again after changes."""

from dsfab.design.buildability import refusal
from dsfab.design.design import Design, draft, revise, run
from dsfab.design.regions_and_loads import (
    acting_on,
    held_vertices,
    loads_on,
    permanent_loads,
    sheet_load,
    sheet_loads,
    sheet_supports,
)
from dsfab.design.slicing_and_thickening import checked_offsets, least_widths
from dsfab.design.surface_and_statics import statics_step, surface_step
from dsfab.results import PARTS, ROWS, Log, Progress, silent

__all__ = [
    "PARTS", "ROWS", "TIMED", "Design", "Log", "Progress", "acting_on", "checked_offsets", "draft", "held_vertices",
    "least_widths", "loads_on", "permanent_loads", "refusal", "revise", "run", "sheet_load", "sheet_loads",
    "sheet_supports", "silent", "statics_step", "surface_step",
]  # fmt: skip

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes", "slicing", "thickening")
"""Rows of the table of computing times: first the rows of the paper's Table 2, then further stages."""
