"""`[pattern] forces = "optimal"`: stripes run along the forces of the stiffest sheet of varying thickness.

In the uncut sheet much of the load goes where a stiff structure has no material: around an opening, into corners. What
is cut along these forces has members there, which carry little. The sheet of varying thickness is the first step of
topology optimisation with layered materials [Bendsoe, Kikuchi 1988; Groen, Sigmund 2018, of their projection].
"""

from dataclasses import replace

import numpy as np

from dsfab.errors import PatternError
from dsfab.pipeline.layers import is_slab
from dsfab.preset import Preset
from dsfab.results import StaticsResult
from dsfab.statics import varying_thickness
from dsfab.surface import Surface


def follows_membrane(preset: Preset, surface: Surface, statics: StaticsResult) -> bool:
    """Whether the pattern follows the stress of the middle surface: which forces of bending are best is not sought."""
    cases = [statics.cases[name] for name in preset.followed]
    return all(case.layered is None for case in cases) and not is_slab(surface, [case.answers for case in cases])


def optimal_statics(preset: Preset, surface: Surface, statics: StaticsResult) -> StaticsResult:
    """The statics with those stresses, times the thickness over the whole one, in place of what the pattern follows.

    Raises PatternError where the pattern follows bending too.
    """
    if not follows_membrane(preset, surface, statics):
        raise PatternError(
            'pattern.forces = "optimal" seeks forces in the surface, and the pattern follows bending here: set '
            'pattern.forces = "uncut", or statics.stress = "membrane" where the surface is curved'
        )
    names, weights = list(preset.followed), np.array(list(preset.followed.values()))
    sheet, loads = preset.statics.sheet().on(surface), statics.loads(names)
    sought = varying_thickness(sheet, list(loads.values()), weights, preset.pattern.width.solid_fraction)
    found = zip(names, sought.forces, strict=True)
    cases = {name: replace(statics.cases[name], sigma=N / preset.statics.thickness) for name, N in found}
    return replace(statics, cases={**statics.cases, **cases})
