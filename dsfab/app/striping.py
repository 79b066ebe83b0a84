"""A pattern as the shader takes it: values at the vertices, and the numbers that draw stripes along them."""

import numpy as np

from dsfab.app.shader import BY_VERTEX, NO_REACH, Settings
from dsfab.arrays import Floats
from dsfab.design import Design, Draft, PatternResult
from dsfab.preset import AUTO, STAGES, Preset


def fields(design: Design | Draft, distances: tuple[Floats, Floats]) -> Floats:
    """(n, 6) modes, half-widths and distances (see `StripeShader`)."""
    mode, modes = design.pattern.mode, design.diffusion
    half = dict(zip(design.pattern.names, design.pattern.half_widths, strict=True))
    x = modes.major.mode(mode[0]), modes.minor.mode(mode[1])
    return np.stack([*x, half["major"], half["minor"], *distances], axis=1)


def only_numbers(made: Preset, preset: Preset) -> bool:
    """Whether a preset differs from the one that was made in numbers of the shader only."""
    old, new = made.pattern, preset.pattern
    first = preset.first_difference(made)
    if first is None or STAGES.index(first) > STAGES.index("pattern"):
        return True
    if first != "pattern" or old.width != new.width or new.width.solid_fraction or new.width.widths(1.0).vary:
        return False
    if new.auto:  # what fits best depends on every number
        return False
    if new.major.spacing or new.minor.spacing:  # frequencies are solved for
        return False
    return (old.major.mode, old.minor.mode) == (new.major.mode, new.minor.mode)


def numbers(preset: Preset, made: PatternResult, show: str) -> Settings:
    """The numbers of a preset, with those that were solved for or chosen when its pattern was made."""
    ask = preset.pattern
    pair, width = (ask.major, ask.minor), ask.width
    by_vertex = width.solid_fraction > 0 or width.widths(1.0).vary
    phase = [made.phase[k] if family.phase == AUTO else family.shift for k, family in enumerate(pair)]
    drawn = {"major": (1.0, 0.0), "minor": (0.0, 1.0)}.get(show, (1.0, 1.0))
    return Settings(
        (pair[0].frequency or made.frequency[0], pair[1].frequency or made.frequency[1]),
        (phase[0] % 1, phase[1] % 1),
        (BY_VERTEX, BY_VERTEX) if by_vertex else (pair[0].stripes.half_width, pair[1].stripes.half_width),
        (ask.keep or NO_REACH, ask.rim or NO_REACH),
        drawn,
    )
