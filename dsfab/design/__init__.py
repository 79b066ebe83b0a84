"""The order of the stages: `run` makes a `Design` of a preset, `revise` remakes it from the first changed section."""

from dsfab.design.buildability import refusal
from dsfab.design.design import PARTS, ROWS, Design
from dsfab.design.finishing import least_widths
from dsfab.design.log import Log, Progress, silent
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
    """Make the design of a preset, all of its stages.

    Raises DsfabError, of the stage that refuses, when it cannot be built; PresetError for a mesh alone.
    """
    return Design.of(preset, None, progress).until("thickening")


def revise(design: Design, preset: Preset, progress: Progress | None = None) -> Design:
    """The design of `preset`, with every stage of `design` before the first section that differs.

    A change of [pattern] solves nothing again; `gamma` and `r` restart at diffusion, since statics are linear.
    """
    return Design.of(preset, design, progress).until("thickening")


def draft(preset: Preset, progress: Progress | None = None, old: Design | None = None) -> Design:
    """A design up to its pattern, with the stages of `old` before the first section that differs; nothing is cut.

    Raises DsfabError, of the stage that refuses.
    """
    return Design.of(preset, old, progress).until("pattern")
