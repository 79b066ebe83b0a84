"""The order of the stages: `run` makes a `Design` of a preset, `revise` remakes it from the first changed section."""

from dataclasses import replace
from types import MappingProxyType
from typing import TypeVar

from dsfab.design import Choice, Design, Draft, EvenStripes, StaticsResult
from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.directions import diffusion_step
from dsfab.pipeline.even import even_step, same_stripes
from dsfab.pipeline.geometry import slicing_step, thickening_step
from dsfab.pipeline.log import Log, Progress
from dsfab.pipeline.method import method_step
from dsfab.pipeline.patterns import pattern_step
from dsfab.pipeline.stressing import stressed_step
from dsfab.pipeline.structure import statics_step, surface_step
from dsfab.preset import STAGES, Pattern, Preset
from dsfab.sparse import give_back
from dsfab.surface import Surface

__all__ = ["PARTS", "ROWS", "TIMED", "Progress", "draft", "revise", "run"]

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes", "slicing", "thickening")
"""Rows of the timing table that a run fills: those of the paper's Table 2, then the stages beyond the paper."""

ROWS = {
    "surface": ("surface",),
    "statics": ("membrane", "bending", "statics", "stress", "answers"),
    "diffusion": ("diffusion", "modes"),
    "pattern": ("method", "stripes", "choice", "widths", "pattern"),
    "slicing": ("slicing",),
    "thickening": ("thickening",),
}
"""The rows of the timing table that each stage fills."""

PARTS = {"statics": ("factor",)}
"""Seconds that are part of another row of the stage, told beside it."""


def run(preset: Preset, progress: Progress | None = None) -> Design:
    """Make the design of a preset.

    Raises DsfabError, of the stage that refuses, when it cannot be built.
    """
    return _make(preset, Log(progress), None, "surface")


def revise(design: Design | Draft, preset: Preset, progress: Progress | None = None) -> Design:
    """The design of `preset`, with every stage of `design` (or of a draft) before the first section that differs.

    A change of [pattern] solves nothing again; `gamma` and `r` restart at diffusion, since statics are linear.
    """
    start = preset.first_difference(design.preset) or "export"
    return _make(preset, Log(progress), design, start)


def draft(preset: Preset, progress: Progress | None = None, old: Draft | Design | None = None) -> Draft:
    """The stages of a preset up to its pattern, with those of `old` before the first section that differs.

    Raises DsfabError, of the stage that refuses.
    """
    start = "surface" if old is None else preset.first_difference(old.preset) or "export"
    return _drafted(preset, Log(progress), old, start)


Made = TypeVar("Made", bound=Draft | Design)


def _reused(stage: str, log: Log, old: Made | None, start: str) -> Made | None:
    """What was made before, if this stage's result is still good."""
    if old is None or STAGES.index(stage) >= STAGES.index(start):
        return None
    rows = (*ROWS[stage], *PARTS.get(stage, ()))
    log.seconds.update({row: old.seconds[row] for row in rows if row in old.seconds})
    log.notes.extend(note for note in old.notes if note.stage == stage)
    return old


def _drafted(preset: Preset, log: Log, old: Draft | Design | None, start: str) -> Draft:
    surface = was.surface if (was := _reused("surface", log, old, start)) else surface_step(preset, log)
    statics = was.statics if (was := _reused("statics", log, old, start)) else statics_step(preset, surface, log)
    was = _reused("diffusion", log, old, start)
    diffusion = was.diffusion if was else diffusion_step(preset, surface, statics, log)
    was = _reused("pattern", log, old, start)
    if was:
        pattern = was.pattern
    else:
        asked, even = preset, None
        if preset.pattern.method == "auto":
            asked, even = method_step(preset, surface, statics, diffusion, log)
        elif preset.pattern.method == "stripes":
            even = _even(preset, surface, statics, log, old, start)
        if even and even.steered and even.steered.told:
            log.note("pattern", even.steered.told)
        choice = choice_step(asked, surface, statics, diffusion, log) if asked.pattern.auto else None
        given = asked, surface, statics, diffusion, log, choice
        grading = stressed_step(*given, even) if asked.pattern.width.rule == "stressed" else None
        pattern = replace(pattern_step(*given, grading, even), asked=_settled(preset, asked, choice))
    give_back()  # what the solvers held: whoever draws needs memory of another shape
    return Draft(preset, surface, statics, diffusion, pattern, MappingProxyType(log.seconds), tuple(log.notes))


def _settled(preset: Preset, asked: Preset, choice: Choice | None) -> Pattern | None:
    """[pattern] with all that was chosen; None where nothing was to be."""
    if choice:
        return asked.settled(choice.mode, choice.phase).pattern
    return None if asked is preset else asked.pattern


def _even(
    preset: Preset, surface: Surface, statics: StaticsResult, log: Log, old: Draft | Design | None, start: str
) -> EvenStripes:
    """Evenly spaced stripes; those of `old` where at most their widths and what is kept besides them have changed."""
    if old and old.pattern.even and start == "pattern" and same_stripes(old.preset.pattern, preset.pattern):
        log.seconds["stripes"] = old.seconds["stripes"]
        return old.pattern.even
    return even_step(preset, surface, statics, log)


def _make(preset: Preset, log: Log, old: Draft | Design | None, start: str) -> Design:
    made = _drafted(preset, log, old, start)
    cut = old if isinstance(old, Design) else None
    surface, statics, pattern = made.surface, made.statics, made.pattern
    was = _reused("slicing", log, cut, start)
    slicing = was.slicing if was else slicing_step(preset, surface, statics, pattern, log)
    was = _reused("thickening", log, cut, start)
    solid = was.solid if was else thickening_step(preset, surface, slicing, log)
    seconds = MappingProxyType(log.seconds)
    return Design(preset, surface, statics, made.diffusion, pattern, slicing, solid, seconds, tuple(log.notes))
