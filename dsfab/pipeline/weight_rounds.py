"""`[pattern] weight_rounds`: stripes run along the stress of a sheet that weighs what stripes leave of it.

The uncut sheet weighs more than what is cut out of it, and weight pulls elsewhere than wind and snow do. So stripes are
drawn, each face weighs the share of it that they cover, its stress is sought again, and the stripes run along that.
The stiffness stays that of the uncut sheet: what is not drawn yet has no directions.
"""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.diffusion import principal_stresses
from dsfab.errors import PatternError
from dsfab.pipeline.directions import followed_stress
from dsfab.pipeline.even import even_stripes
from dsfab.pipeline.loadings import Loading, loadings
from dsfab.pipeline.log import Log
from dsfab.pipeline.patterns import SHARE_SNAP, sketched_step
from dsfab.pipeline.structure import statics_step
from dsfab.preset import Preset
from dsfab.results import EvenStripes, StaticsResult, StressedSurface
from dsfab.slicing import cut_polygons
from dsfab.surface import LoadParts, Surface

CLEAR = 0.1
"""A direction is clear where half the difference of the principal stresses is over this share of the stress."""


def weighed_stripes(preset: Preset, given: StressedSurface, log: Log) -> EvenStripes:
    """Evenly spaced stripes as `[pattern]` asks, after as many rounds as it asks for.

    Raises PatternError as `even_stripes` does.
    """
    if log.progress:
        log.progress("pattern", "finding evenly spaced stripes along the stress")
    surface, statics = given.surface, given.statics
    even = even_stripes(preset.with_pattern(weight_rounds=0), surface, statics)
    rounds = preset.pattern.rounds
    if rounds and not _weighs(preset, statics):
        log.note("pattern", f"weight_rounds = {rounds} changes nothing: no load is the sheet's own weight")
        return even
    lighter: StaticsResult | None = None
    for _ in range(rounds):
        try:
            share = drawn_share(preset, given, even)
        except PatternError as error:
            log.note("pattern", f"directions were not sought {'again' if lighter is None else 'twice'}: {error}")
            break
        lighter = weighed_statics(preset, surface, statics, share)
        even = even_stripes(preset, surface, lighter)
    if lighter is not None:
        turn, most = turned(surface, *(followed_stress(preset, surface, one) for one in (statics, lighter)))
        log.note(
            "pattern",
            f"directions were sought with {share @ surface.areas / surface.area:.0%} of the uncut sheet's weight, face "
            f"by face what stripes leave: they turned by {turn:.2g} degrees on average, by at most {most:.2g} on 95 % "
            "of the surface",
        )
    return even


def _weighs(preset: Preset, statics: StaticsResult) -> bool:
    """Whether what the pattern follows has a part that is the sheet's own weight."""
    parts = [load.parts for load in statics.loads(preset.followed).values()]
    return any(one is not None and bool(one.weight.any()) for one in parts)


def drawn_share(preset: Preset, given: StressedSurface, even: EvenStripes) -> Floats:
    """(m,) share of each face that stripes and what is kept besides them cover, the same at all images.

    Widths are those of a sketch: what round corners and filled openings add is not in it.
    """
    surface, drawn = given.surface, sketched_step(preset, given, even=even)
    polygons = cut_polygons(surface, drawn.fields, drawn.levels, SHARE_SNAP, drawn.tidy)
    area = polygons.cells.areas(polygons.X)[0] * ~polygons.void
    share = np.minimum(np.bincount(polygons.parent, area, surface.m) / surface.areas, 1.0)
    return share[even.symmetry.faces].mean(axis=0) if even.symmetry else share


def weighed_statics(preset: Preset, surface: Surface, statics: StaticsResult, share: Floats) -> StaticsResult:
    """`statics`, and in what the pattern follows each face weighs a share (m,) of what it does; as stiff as before."""
    layered = any(case.layered is not None for case in statics.cases.values())
    follow = "layers" if layered else "membrane"  # as was decided with the whole weight
    plain = preset.statics.model_copy(update={"frequencies": 0, "buckling": 0, "stress": follow})
    acting = [_lighter(one, surface, share) for one in loadings(preset, surface)]
    found = statics_step(preset.model_copy(update={"statics": plain}), surface, Log(None), acting).cases
    return replace(statics, cases={**statics.cases, **{name: found[name] for name in preset.followed}})


def _lighter(one: Loading, surface: Surface, share: Floats) -> Loading:
    """A loading with shares (m,) of its weight."""
    whole = one.load.parts
    if whole is None:
        return one
    left: LoadParts = whole.on_share(weight=share)
    spread = replace(one.spread, face=one.spread.face + left.weight - whole.weight)
    return replace(one, load=one.load.with_parts(surface, left), spread=spread)


def turned(surface: Surface, before: Floats, after: Floats) -> tuple[float, float]:
    """Degrees between the principal directions of stresses (m, 3, 3): mean by area and by how clear they are before
    (difference of principal stresses), and what 95 % of the area whose directions are clear stay under."""
    (stress, first), (_, second) = (principal_stresses(surface, sigma) for sigma in (before, after))
    one, other = first[:, 0], second[:, 0]
    across, along = np.linalg.norm(np.cross(one, other), axis=1), np.abs(np.einsum("mi,mi->m", one, other))
    angle, apart = np.degrees(np.arctan2(across, along)), (stress[:, 0] - stress[:, 1]) / 2
    size = surface.areas * apart
    clear = np.flatnonzero(apart > CLEAR * np.linalg.norm(before, axis=(1, 2)))
    order = clear[np.argsort(angle[clear])]
    grown = np.cumsum(surface.areas[order])
    if not len(grown):
        return 0.0, 0.0
    return float(angle @ size / size.sum()), float(angle[order][np.searchsorted(grown, 0.95 * grown[-1])])
