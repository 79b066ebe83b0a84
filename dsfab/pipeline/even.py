"""Evenly spaced stripes of a preset: directions, densities, phases, and where lines that crowd are left out."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import EvenStripes, StaticsResult
from dsfab.diffusion import Symmetry, found_symmetry, principal_stresses
from dsfab.pattern import (
    CornerPhase,
    Flow,
    Frames,
    Images,
    StressDirections,
    boundary_lines,
    corner_phase,
    cross_field,
    density,
    halving,
    log_density,
    vertex_means,
)
from dsfab.pipeline.directions import followed_stress, load_axes
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.slicing import chart_of, halved
from dsfab.surface import Surface

SMOOTHING = 0.5
"""Directions are smoothed over this share of the spacing, where the stress does not say which way."""
PEAK = 4
"""A stripe runs through the most stressed places: stress to this power is where its phase begins."""
SLOPES = (0.6, 1.6)
"""The phase grows by this much of what was asked; beyond that it is at a singular face that says nothing."""


@dataclass(frozen=True, eq=False)
class _Lines:
    """One family: its phase, how often it may be halved, (m,) how often it should be, (n,) its periods per metre."""

    phase: CornerPhase
    most: int
    wish: Floats
    slope: Floats


def even_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> EvenStripes:
    """`even_stripes`, with its seconds in a row of their own."""
    if log.progress:
        log.progress("pattern", "finding evenly spaced stripes along the stress")
    with log.row("stripes"):
        return even_stripes(preset, surface, statics)


def even_stripes(preset: Preset, surface: Surface, statics: StaticsResult) -> EvenStripes:
    """Both families of stripes as `[pattern]` asks; raises PatternError where nothing is stressed."""
    ask = preset.pattern
    spacings = [family.distance(surface.area) for family in (ask.major, ask.minor)]
    symmetry = _symmetry(preset, surface, statics)
    sigma = followed_stress(preset, surface, statics)
    given = StressDirections(*principal_stresses(surface, symmetry.stress(sigma) if symmetry else sigma))
    frames = Frames.of(surface)
    images = Images(symmetry.R, symmetry.maps, symmetry.faces) if symmetry else Images.none(surface.n)
    along = images.directions(frames, cross_field(frames, given, SMOOTHING * float(np.mean(spacings))))
    across = np.cross(frames.normal, along)
    major, minor = (
        _lines(frames, g, given, spacing, ask.halve, images)
        for g, spacing in zip((across, along), spacings, strict=True)  # gradients: stripes run square to them
    )
    return _divided(surface, major, minor)


def _lines(frames: Frames, g: Floats, given: StressDirections, spacing: float, halve: bool, images: Images) -> _Lines:
    """The family whose phase grows along g (n, 3)."""
    surface = frames.surface
    size = vertex_means(surface, np.abs(given.stress).max(axis=1))
    u = images.mean(log_density(frames, g, given.confidence(surface.areas)))
    halved_ = halving(u, surface.vertex_areas, halve)
    finest = density(surface, u, spacing, halved_)
    coarse = Flow(frames, g, finest / 2**halved_.most)  # counts then close around every loop, after halving too
    start, lock = (size / size.max()) ** PEAK, boundary_lines(surface, g)
    phase = corner_phase(coarse, coarse.solve(start, lock, images.projection(g))).times(2**halved_.most)
    phase = replace(phase, singular=images.of_any(phase.singular))
    return _Lines(phase, halved_.most, halved_.wish[surface.F].mean(axis=1), _slope(surface, phase, finest))


def _divided(surface: Surface, major: _Lines, minor: _Lines) -> EvenStripes:
    """Both families with their lines left out where they crowd."""
    both = (major, minor)
    most = major.most, minor.most
    divided = halved(surface, (major.phase.field, minor.phase.field), (major.wish, minor.wish), most)

    def wanted(k: int) -> tuple[Floats, ...]:
        return tuple(divided.wanted(surface, k, level) for level in range(most[k]))

    slope = np.stack([lines.slope for lines in both], axis=1)
    left = vertex_means(surface, np.stack([divided.scale(surface, k) for k in (0, 1)], axis=1))
    phases = major.phase, minor.phase
    return EvenStripes(phases, (wanted(0), wanted(1)), slope, slope * left, divided.first, chart_of(divided))


def _symmetry(preset: Preset, surface: Surface, statics: StaticsResult) -> Symmetry | None:
    """What surface, supports and followed loads have, if it is wanted."""
    if preset.pattern.symmetry == "none":
        return None
    loads = [statics.cases[name].load for name in preset.followed]
    return found_symmetry(surface, load_axes(surface, statics.load), loads)


def _slope(surface: Surface, phase: CornerPhase, asked: Floats) -> Floats:
    """(n,) periods per metre around each vertex, of the faces that have a phase."""
    size = np.linalg.norm(phase.gradients(surface), axis=1)
    whole = (~phase.singular).astype(float)
    mean, known = vertex_means(surface, np.stack([size * whole, whole], axis=1)).T
    slope = np.divide(mean, known, out=asked.copy(), where=known > 0)
    return np.asarray(np.clip(slope, SLOPES[0] * asked, SLOPES[1] * asked))
