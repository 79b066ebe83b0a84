"""The order of the stages: `run` makes a `Design` from a preset; `revise` repeats it from the first changed section."""

from dsfab.design.buildability import refusal
from dsfab.design.design import Design
from dsfab.design.finishing import least_widths
from dsfab.design.log import PARTS, ROWS, Log, Progress, silent
from dsfab.design.regions_and_loads import acting_on
from dsfab.design.sheet_loads import held_vertices, loads_on, sheet_load, sheet_loads, sheet_supports
from dsfab.design.surface_and_statics import statics_step, surface_step
from dsfab.preset.model import Preset

__all__ = [
    "PARTS",
    "ROWS",
    "TIMED",
    "Design",
    "Log",
    "Progress",
    "acting_on",
    "draft",
    "held_vertices",
    "least_widths",
    "loads_on",
    "refusal",
    "revise",
    "run",
    "sheet_load",
    "sheet_loads",
    "sheet_supports",
    "silent",
    "statics_step",
    "surface_step",
]

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes", "slicing", "thickening")
"""Rows of the timing table that a run fills: those of the paper's Table 2, then the stages beyond the paper."""


def run(preset: Preset, progress: Progress | None = None) -> Design:
    """Run all stages of a preset.

    Raises the DsfabError of the stage that refuses, and PresetError if `preset` is a mesh alone.
    """
    return Design.from_preset(preset, None, progress).until("thickening")


def revise(design: Design, preset: Preset, progress: Progress | None = None) -> Design:
    """Return the design of `preset`, reusing each stage of `design` before the first section that differs.

    A change of [pattern] solves nothing again; `gamma` and `r` restart at diffusion, because statics are linear.
    """
    return Design.from_preset(preset, design, progress).until("thickening")


def draft(preset: Preset, progress: Progress | None = None, earlier: Design | None = None) -> Design:
    """Run the stages up to the pattern, reusing those of `earlier` before the first section that differs; cut nothing.

    Raises the DsfabError of the stage that refuses.
    """
    return Design.from_preset(preset, earlier, progress).until("pattern")
