"""Stages of a design: `run` computes a preset; `revise` computes a design again from its first changed section."""

from dsfab.design.buildability import refusal
from dsfab.design.design import Design
from dsfab.design.finishing import least_widths
from dsfab.design.log import PARTS, ROWS, Log, Progress, silent
from dsfab.design.regions_and_loads import acting_on
from dsfab.design.sheet_loads import held_vertices, loads_on, sheet_load, sheet_loads, sheet_supports
from dsfab.design.surface_and_statics import statics_step, surface_step
from dsfab.preset.model import Preset

__all__ = [
    "PARTS", "ROWS", "TIMED", "Design", "Log", "Progress", "acting_on", "draft", "held_vertices", "least_widths",
    "loads_on", "refusal", "revise", "run", "sheet_load", "sheet_loads", "sheet_supports", "silent", "statics_step",
    "surface_step",
]  # fmt: skip

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes", "slicing", "thickening")
"""Rows of the timing table: those of the paper's Table 2, followed by further stages."""


def run(preset: Preset, progress: Progress | None = None) -> Design:
    """Run all stages of a preset. Raises the DsfabError of a stage that fails, and PresetError for a wrong argument."""
    return Design.from_preset(preset, None, progress).until("thickening")


def revise(design: Design, preset: Preset, progress: Progress | None = None) -> Design:
    """Return the design of `preset`; stages of `design` before the first section that differs are not computed again.
    So a change of [pattern] keeps statics and diffusion, and a change of `gamma` or `r` keeps the statics."""
    return Design.from_preset(preset, design, progress).until("thickening")


def draft(preset: Preset, progress: Progress | None = None, earlier: Design | None = None) -> Design:
    """Run the stages up to the pattern, without a cut. earlier : design whose unchanged first stages are used again.
    Raises the DsfabError of the stage that fails."""
    return Design.from_preset(preset, earlier, progress).until("pattern")
