"""Evenly spaced stripes of a preset: directions, densities, phases, and where lines that crowd are left out."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import EvenStripes, StaticsResult, Steered
from dsfab.diffusion import Symmetry, found_symmetry, principal_stresses
from dsfab.errors import PatternError
from dsfab.pattern import (
    CornerPhase,
    Flow,
    Frames,
    Halving,
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
from dsfab.pipeline.steering import steering
from dsfab.preset import FAMILIES, Family, Pattern, Preset, Width
from dsfab.slicing import chart_of, halved
from dsfab.surface import Surface

SMOOTHING = 1.0
"""Directions are smoothed over this share of the smaller spacing, where the stress does not say which way."""
PEAK = 4
"""A stripe runs through the most stressed places: stress to this power is where its phase begins."""
SLOPES = (0.6, 1.6)
"""The phase grows by this much of what was asked; beyond that it is at a singular face that says nothing."""

FINEST = 0.5
"""Stripes are at least this share of a mean edge apart: members that are much thinner than triangles are ragged."""
HOLDS = 0.05
"""Halved stripes that are farther off their mean spacing than this share are drawn a second time."""
LEAST_GROWN = 0.5
"""Of what was asked a phase grows at least by this much: or the surface is too small to have two stripes around it."""


@dataclass(frozen=True, eq=False)
class _Lines:
    """One family: its phase, how often it may be halved, (m,) how often it should be, (n,) its periods per metre.

    grown : how much the phase grows in all, over how much it was asked to.
    """

    phase: CornerPhase
    most: int
    wish: Floats
    slope: Floats
    grown: float


def even_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> EvenStripes:
    """`even_stripes`, with its seconds in a row of their own."""
    if log.progress:
        log.progress("pattern", "finding evenly spaced stripes along the stress")
    with log.row("stripes"):
        return even_stripes(preset, surface, statics)


def same_stripes(old: Pattern, new: Pattern) -> bool:
    """Whether two [pattern] ask for the same middles of stripes: all is alike but widths, and what is kept besides.

    What stripes on modes alone are drawn by makes no difference either. A key that is not named here does.
    """

    def middles(ask: Pattern) -> Pattern:
        both = {
            name: getattr(ask, name).model_copy(update={"threshold": 0.0, "frequency": 0.0, "mode": 1, "phase": 0.0})
            for name in FAMILIES
        }
        return ask.model_copy(update={"width": Width(), "keep": 0.0, "rim": 0.0, "tidy": None, **both})

    return middles(old) == middles(new)


def even_stripes(preset: Preset, surface: Surface, statics: StaticsResult) -> EvenStripes:
    """The families of stripes as `[pattern]` asks.

    Raises PatternError where nothing is stressed, and for spacings that the mesh is too coarse or the surface too small
    for.
    """
    ask = preset.pattern
    spacings = [family.distance(surface.area, surface.mean_edge) for family in (ask.major, ask.minor)]
    shown = [FAMILIES.index(name) for name in ask.family_names]
    for k in shown:
        _refuse_impossible(FAMILIES[k], spacings[k], surface)
    follow = _Follow.of(preset, surface, statics, min(spacings[k] for k in shown))
    courses = {k: _Course.of(follow, follow.gradients[k], ask.halved) for k in shown}
    both = [courses[k].lines(h) if k in courses else _no_lines(surface, h) for k, h in enumerate(spacings)]
    for name, lines, spacing in zip(FAMILIES, both, spacings, strict=True):
        if lines.grown < LEAST_GROWN:
            raise _too_far(name, spacing, surface)
    found = _divided(surface, *both)
    off = _off(surface, found, spacings)
    if (again := [lines.most > 0 and abs(miss) > HOLDS for lines, miss in zip(both, off, strict=True)]) and any(again):
        for k in np.flatnonzero(again).tolist():  # levels follow whole openings: what they leave is known afterwards
            both[k] = courses[k].lines(spacings[k] * float(np.exp(off[k])))
        other = _divided(surface, *both)
        found = min(found, other, key=lambda one: float(np.abs(_off(surface, one, spacings)).max()))
    return replace(found, symmetry=follow.symmetry, steered=follow.steered)


def _off(surface: Surface, found: EvenStripes, spacings: list[float]) -> Floats:
    """(2,) logarithm of the stripes per metre that are drawn, in the mean, over what was asked."""
    mean = surface.vertex_areas @ found.density / surface.area
    return np.asarray(np.log(mean * np.array(spacings)))


@dataclass(frozen=True, eq=False)
class _Follow:
    """What both families follow.

    along : (n, 3) directions of the major stripes.    confidence : (m,) how clear these are, 0 to 1.
    """

    frames: Frames
    given: StressDirections
    along: Floats
    confidence: Floats
    images: Images
    symmetry: Symmetry | None
    steered: Steered | None

    @classmethod
    def of(cls, preset: Preset, surface: Surface, statics: StaticsResult, spacing: float) -> Self:
        """Of a preset; spacing is the smaller one that is drawn, metres."""
        symmetry = _symmetry(preset, surface, statics)
        sigma = followed_stress(preset, surface, statics)
        given = StressDirections(*principal_stresses(surface, symmetry.stress(sigma) if symmetry else sigma))
        frames = Frames.of(surface)
        steer = steering(preset.pattern, frames, symmetry, spacing)
        symmetry = steer.symmetry
        images = Images(symmetry.R, symmetry.maps, symmetry.faces) if symmetry else Images.none(surface.n)
        field = cross_field(frames, given, SMOOTHING * spacing, steer.turn, steer.guidance)
        along = images.directions(frames, field)
        confidence = steer.confidence(surface, given.confidence(surface.areas))
        steered = steer.steered(surface, along, given) if steer.turn or steer.guidance else None
        return cls(frames, given, along, confidence, images, symmetry, steered)

    @property
    def gradients(self) -> tuple[Floats, Floats]:
        """(n, 3) of both phases: stripes run square to them."""
        return np.cross(self.frames.normal, self.along), self.along


@dataclass(frozen=True, eq=False)
class _Course:
    """What a family is whatever its spacing: (n, 3) g where its phase grows to, (n,) u how dense its lines are, how
    often they are halved, and (n,) start where the phase begins."""

    follow: _Follow
    g: Floats
    u: Floats
    halved: Halving
    start: Floats

    @classmethod
    def of(cls, follow: _Follow, g: Floats, halve: bool) -> Self:
        surface = follow.frames.surface
        size = vertex_means(surface, np.abs(follow.given.stress).max(axis=1))
        u = follow.images.mean(log_density(follow.frames, g, follow.confidence))
        return cls(follow, g, u, halving(u, surface.vertex_areas, halve), (size / size.max()) ** PEAK)

    def lines(self, spacing: float) -> _Lines:
        """The family with so many metres between its lines, in the mean."""
        frames, images, most = self.follow.frames, self.follow.images, self.halved.most
        surface = frames.surface
        finest = density(surface, self.u, spacing, self.halved)
        coarse = Flow(frames, self.g, finest / 2**most)  # counts then close around every loop, after halving too
        lock = boundary_lines(surface, self.g)
        given = self.start, lock, images.projection(self.g)
        phase = corner_phase(coarse, coarse.solve(*given))
        if phase.broken and lock.any():
            phase = min(phase, corner_phase(coarse, coarse.solve(*given, free=True)), key=lambda one: one.broken)
        phase = phase.times(2**most)
        phase = replace(phase, singular=images.of_any(phase.singular))
        whole = surface.areas * ~phase.singular
        size = np.linalg.norm(phase.gradients(surface), axis=1)
        grown = float(whole @ size / (whole @ finest[surface.F].mean(axis=1)))
        return _Lines(phase, most, self.halved.wish[surface.F].mean(axis=1), _slope(surface, phase, finest), grown)


def _no_lines(surface: Surface, spacing: float) -> _Lines:
    """A family that is not drawn: without a phase on any face."""
    sides = (surface.m, 3)
    phase = CornerPhase(np.zeros(surface.n), np.ones(sides), np.zeros(sides), np.ones(surface.m, dtype=bool))
    return _Lines(phase, 0, np.zeros(surface.m), np.full(surface.n, 1 / spacing), 1.0)


def _refuse_impossible(name: str, spacing: float, surface: Surface) -> None:
    """Raise PatternError for metres between stripes that no phase needs to be solved for."""
    if spacing < FINEST * surface.mean_edge:
        raise PatternError(
            f"pattern.{name}.spacing = {spacing:.4g} m is too fine for this mesh, whose edges are "
            f"{surface.mean_edge:.3g} m long on average: ask for {_digits(FINEST * surface.mean_edge)} m or more, or "
            "make the mesh finer (surface.edge or surface.refine)"
        )
    if spacing > surface.size:
        raise _too_far(name, spacing, surface)


def _too_far(name: str, spacing: float, surface: Surface) -> PatternError:
    default = Family().distance(surface.area, surface.mean_edge)
    return PatternError(
        f"pattern.{name}.spacing = {spacing:.4g} m is too far for this surface, which is {surface.size:.3g} m from "
        f"corner to corner: not even one stripe and the next fit on it; {default:.2g} m "
        "is the default"
    )


def _digits(length: float) -> str:
    """Rounded up to two digits."""
    unit = 10.0 ** (np.floor(np.log10(length)) - 1)
    return f"{np.ceil(length / unit) * unit:.2g}"


def _divided(surface: Surface, major: _Lines, minor: _Lines) -> EvenStripes:
    """Both families with their lines left out where they crowd."""
    both = (major, minor)
    most = major.most, minor.most
    fields = major.phase.field, minor.phase.field
    divided = halved(surface, fields, (major.wish, minor.wish), most)

    def wanted(k: int) -> tuple[Floats, ...]:
        return tuple(divided.wanted(surface, k, level) for level in range(most[k]))

    slope = np.stack([lines.slope for lines in both], axis=1)
    left = vertex_means(surface, np.stack([divided.scale(surface, k) for k in (0, 1)], axis=1))
    phases = major.phase, minor.phase
    return EvenStripes(phases, (wanted(0), wanted(1)), slope, slope * left, divided.first, chart_of(divided, fields))


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
