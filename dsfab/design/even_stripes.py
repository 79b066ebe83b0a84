"""Directions, densities and phases of evenly spaced stripes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, cross
from dsfab.core.errors import PatternError
from dsfab.design.directions import Steering, followed_stress, load_axes, steering
from dsfab.design.surface_and_statics import is_slab
from dsfab.diffusion import Symmetry, largest_symmetry, principal_stresses
from dsfab.pattern import (
    CornerPhase,
    Flow,
    Frames,
    GuideLine,
    Halving,
    Images,
    LoopSurroundings,
    StressDirections,
    boundary_lines,
    corner_phase,
    cross_field,
    density,
    family_crossings,
    guide_phases,
    halving,
    log_density,
    signs_with_short_seams,
    through_peaks,
    vertex_means,
)
from dsfab.preset.model import FAMILIES, Family, Pattern, Preset, Width
from dsfab.results import EvenStripes, StaticsResult, StripeSteering
from dsfab.slicing import LineHalving, chart_of, halve_lines
from dsfab.statics import varying_thickness
from dsfab.surface import Surface, link_components

SLOPES = (0.6, 1.6)  # Limits of the actual number of stripes per metre, divided by the wanted number.


@dataclass(frozen=True, eq=False)
class FamilyLines:
    """The centre lines of a family of stripes. A halving removes every second line from a part of the surface.
    most  : largest number of halvings.    wish : (m,) wanted number of halvings on each face, 0 to `most`.
    free  : (m,) `wish` without limits.    slope : (n,) lines per metre at each vertex, before halvings.
    grown : mean number of lines per metre before halvings, divided by the wanted number."""

    phase: CornerPhase
    most: int
    wish: Floats
    free: Floats
    slope: Floats
    grown: float


@dataclass(frozen=True, eq=False)
class StripeDirections:
    """Directions of the major and of the minor stripes. along : (n, 3) directions of the major stripes at vertices.
    steered    : record of how the stripes differ from the stress directions; None if they do not differ.
    confidence : (m,) how clear the direction of each face is, 0 to 1.
    moved      : (n,) size of the displacement of each vertex under the loads, in any unit."""

    frames: Frames
    given: StressDirections
    along: Floats
    confidence: Floats
    moved: Floats
    images: Images
    symmetry: Symmetry | None
    steered: StripeSteering | None
    members: tuple[GuideLine, ...] = ()

    @classmethod
    def from_statics(cls, preset: Preset, surface: Surface, statics: StaticsResult, spacings: list[float]) -> Self:
        """Return the stripe directions of a preset. spacings : distance of stripes of each family, metres."""
        symmetry = _symmetry(preset, surface, statics)
        sigma = followed_stress(preset, surface, statics)
        stress = StressDirections(*principal_stresses(surface, symmetry.mean_stress(sigma) if symmetry else sigma))
        frames = Frames.for_surface(surface)
        loops = LoopSurroundings.from_support(frames, statics.load.supported, min(spacings))
        steer = replace(steering(preset.pattern, frames, symmetry, min(spacings)), loops=loops)
        symmetry = steer.symmetry
        images = Images(symmetry.R, symmetry.maps, symmetry.faces) if symmetry else Images.identity(surface.n)
        length = max(float(np.mean(spacings)), surface.mean_edge)  # a member needs this length to change direction
        along, over = stripe_directions(preset.pattern, frames, stress, steer, images, length)
        steer = steer.with_loops(frames, stress)
        confidence = steer.confidence(surface, stress.confidence(surface.areas))
        along = signs_with_short_seams(frames, along)[:, None] * along
        is_steered = bool(steer.turn or steer.guidance or over.any())
        steered = steer.outcome(surface, along, stress, over) if is_steered else None
        moved = images.mean(_movement(preset, surface, statics))
        members = tuple(GuideLine.from_guides(surface, preset.pattern.guide))
        return cls(frames, stress, along, confidence, moved, images, symmetry, steered, members)

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """Directions (n, 3) across the major stripes and across the minor stripes: the gradients of their phases."""
        return cross(self.frames.normal, self.along), self.along

    def steered_with_members(self, families: Sequence[FamilyLines]) -> StripeSteering | None:
        """Return `steered`, with notes on guide curves that become members. families : lines of the two families."""
        if self.steered is None or not self.members:
            return self.steered
        surface, messages = self.frames.surface, [self.steered.told] * bool(self.steered.told)
        for line in self.members:
            lines = families[FAMILIES.index(line.family)]
            share = line.followed_share(surface, lines.phase, 2**lines.most)
            stress_direction = self.given.direction[:, FAMILIES.index(line.family)]
            messages.append(_member_message(line, share, line.runs_across(stress_direction)))
        return replace(self.steered, told="; ".join(messages))


def _member_message(line: GuideLine, share: float, across: bool) -> str:
    key = f"pattern.guide.{line.number}"
    other_family = FAMILIES[1 - FAMILIES.index(line.family)]
    hint = (
        f"; stripes of the {other_family} family already run along this curve: family = '{other_family}' bends "
        f"members less"
    )
    hint = hint if across else ""
    if share >= 0.995:  # a few points of the curve may lie outside the member
        return f"a {line.family} member follows the whole curve of {key}{hint}"
    return (
        f"a {line.family} member follows only {share:.0%} of the curve of {key}, because of another guide, an edge "
        f"or a point around which stripes turn; move this curve{hint}"
    )


def stripe_directions(
    options: Pattern, frames: Frames, stress: StressDirections, steer: Steering, images: Images, length: float
) -> tuple[Floats, Bools]:
    """Return directions (n, 3) of the major stripes, and a mask (n,) of vertices.
    The mask is True where major stripes follow the minor principal stress. length : smoothing length, metres."""

    def smooth(stress: StressDirections, length: float) -> Floats:
        guidance = steer.with_loops(frames, stress).guidance
        return images.directions(frames, cross_field(frames, stress, length, steer.turn, guidance))

    crossed = np.zeros(frames.surface.n, dtype=bool)
    if not options.is_steered:
        # smoothing over the full mean edge length would join separate regions
        crossed = _crossed_over(options, frames, smooth(stress, 0.6 * frames.surface.mean_edge), images)
        crossed = crossed & (_region_areas(frames, crossed) > (2.0 * length) ** 2)  # space for two members
        stress = _exchanged_on(stress, crossed[frames.surface.F].mean(axis=1) > 0.5)
    along = smooth(stress, length)
    crossed_after = _crossed_over(options, frames, along, images)
    return np.where(crossed_after[:, None], cross(frames.normal, along), along), crossed ^ crossed_after


def _region_areas(frames: Frames, crossed: Bools) -> Floats:
    surface, (i, j) = frames.surface, frames.ends.T
    inside = crossed[i] == crossed[j]
    count, region = link_components(surface.n, i[inside], j[inside])
    return np.asarray(np.bincount(region, surface.vertex_areas, count)[region])


def _exchanged_on(directions: StressDirections, faces: Bools) -> StressDirections:
    order = np.where(faces[:, None], [1, 0], [0, 1])
    stress = np.take_along_axis(directions.stress, order, axis=1)
    return StressDirections(stress, np.take_along_axis(directions.direction, order[:, :, None], axis=1))


def _crossed_over(options: Pattern, frames: Frames, along: Floats, images: Images) -> Bools:
    crossed = family_crossings(frames, along)
    symmetric = np.abs(images.mean(crossed.astype(float)) - crossed).max() < 0.5
    return crossed if symmetric and not options.is_steered else np.zeros_like(crossed)


@dataclass(frozen=True, eq=False)
class FamilyCourse:
    """Directions and density of a family of stripes.
    g      : (n, 3) direction across the stripes.    u : (n,) logarithm of the relative number of lines per metre.
    halved : wanted halvings (removals of every second line).    members : guide curves that become members.
    start  : (n,) weight of each vertex in the choice of the phase; large where the stress is large."""

    follow: StripeDirections
    g: Floats
    u: Floats
    halved: Halving
    start: Floats
    members: tuple[GuideLine, ...]

    @classmethod
    def for_family(cls, directions: StripeDirections, name: str, halve: bool) -> Self:
        """Return directions and density of the family `name`. halve : True if every second line may end."""
        g = directions.gradients[FAMILIES.index(name)]
        surface = directions.frames.surface
        size = vertex_means(surface, np.abs(directions.given.stress).max(axis=1))
        u = directions.images.mean(log_density(directions.frames, g, directions.confidence))
        members = tuple(line for line in directions.members if line.family == name)
        return cls(directions, g, u, halving(u, surface.vertex_areas, halve), (size / size.max()) ** 4, members)

    @property
    def without_halving(self) -> Self:
        """A copy of the family without halvings (removals of every second line)."""
        return replace(self, halved=halving(self.u, self.follow.frames.surface.vertex_areas, allowed=False))

    def lines(self, spacing: float) -> FamilyLines:
        """Return the centre lines of the family. spacing : mean distance of neighbouring lines, metres."""
        frames, images, halvings = self.follow.frames, self.follow.images, self.halved.most
        surface = frames.surface
        finest = density(surface, self.u, spacing, self.halved)
        coarse = Flow(frames, self.g, finest / 2**halvings)  # flow of the lines that remain after all halvings
        locked_to_guides, aim = guide_phases(self.members, frames, self.g, coarse.density)
        lock = locked_to_guides | boundary_lines(surface, self.g, spacing)
        conditions = self.start, lock, images.projection(surface.V, self.g, coarse.density), aim
        solved = coarse.solve(*conditions)
        if not lock.any():
            solved = through_peaks(solved, surface.vertex_areas * self.start * self.follow.moved)
        phase = corner_phase(coarse, solved, partial(coarse.solve, *conditions, free=True) if lock.any() else None)
        phase = phase.times(2**halvings)
        phase = replace(phase, singular=images.marked_in_any(phase.singular))
        regular_areas = surface.areas * ~phase.singular
        size = np.linalg.norm(phase.gradients(surface), axis=1)
        grown = float(regular_areas @ size / (regular_areas @ finest[surface.F].mean(axis=1)))
        slope = images.mean(_slope(surface, size, phase.singular, finest))
        wish, free = (x[surface.F].mean(axis=1) for x in (self.halved.wish, self.halved.free))
        return FamilyLines(phase, halvings, wish, free, slope, grown)


def _movement(preset: Preset, surface: Surface, statics: StaticsResult) -> Floats:
    followed = [(weight, statics.cases[name].equilibrium.u) for name, weight in preset.followed_weights.items()]
    movement = sum(abs(weight) * np.linalg.norm(u, axis=1) for weight, u in followed)
    return np.asarray(movement if np.any(movement) else np.ones(surface.n))


def no_lines(surface: Surface, spacing: float) -> FamilyLines:
    """Return `FamilyLines` for a family that has no lines. spacing : nominal distance of lines, metres."""
    sides = (surface.m, 3)
    phase = CornerPhase(np.zeros(surface.n), np.ones(sides), np.zeros(sides), np.ones(surface.m, dtype=bool))
    return FamilyLines(phase, 0, np.zeros(surface.m), np.zeros(surface.m), np.full(surface.n, 1 / spacing), 1.0)


def _symmetry(preset: Preset, surface: Surface, statics: StaticsResult) -> Symmetry | None:
    if preset.pattern.symmetry == "none":
        return None
    loads = list(statics.loads(preset.followed_weights).values())
    return largest_symmetry(surface, load_axes(surface, statics.load), loads)


def _slope(surface: Surface, size: Floats, singular: Bools, wanted_density: Floats) -> Floats:
    regular = (~singular).astype(float)
    mean, regular_share = vertex_means(surface, np.stack([size * regular, regular], axis=1)).T
    slope = np.divide(mean, regular_share, out=wanted_density.copy(), where=regular_share > 0)
    return np.asarray(np.clip(slope, SLOPES[0] * wanted_density, SLOPES[1] * wanted_density))


def follows_membrane(preset: Preset, surface: Surface, statics: StaticsResult) -> bool:
    """Return True if the pattern follows only membrane stress, and no bending stress."""
    cases = [statics.cases[name] for name in preset.followed_weights]
    return all(case.layered is None for case in cases) and not is_slab(surface, [case.answers for case in cases])


def optimal_statics(preset: Preset, surface: Surface, statics: StaticsResult) -> StaticsResult:
    """Return statics of the stiffest sheet of varying thickness. Raises PatternError if the pattern follows bending.
    The stress is the membrane force of this sheet, divided by the preset's thickness."""
    if not follows_membrane(preset, surface, statics):
        raise PatternError(
            'pattern.forces = "optimal" needs membrane forces, but this pattern follows bending; set '
            'pattern.forces = "uncut", or statics.stress = "membrane" if the surface is curved'
        )
    names, weights = list(preset.followed_weights), np.array(list(preset.followed_weights.values()))
    sheet, loads = preset.statics.sheet().model_for(surface), statics.loads(names)
    optimum = varying_thickness(sheet, list(loads.values()), weights, preset.pattern.width.solid_fraction)
    named_forces = zip(names, optimum.forces, strict=True)
    cases = {name: replace(statics.cases[name], sigma=N / preset.statics.thickness) for name, N in named_forces}
    return replace(statics, cases={**statics.cases, **cases})


FINEST = 0.5  # Smallest spacing of stripes, divided by the mean edge length.


def same_stripes(earlier: Pattern, current: Pattern) -> bool:
    """Return True if two [pattern] sections give the same centre lines."""
    if current.rounds:
        return earlier == current

    def centre_line_options(options: Pattern) -> Pattern:
        unused = {"threshold": 0.0, "frequency": 0.0, "mode": 1, "phase": 0.0}
        families = {name: getattr(options, name).model_copy(update=unused) for name in FAMILIES}
        width = Width(solid_fraction=options.width.solid_fraction) if options.forces == "optimal" else Width()
        return options.model_copy(update={"width": width, "keep": 0.0, "rim": 0.0, "tidy": None, **families})

    return centre_line_options(earlier) == centre_line_options(current)


def even_stripes(preset: Preset, surface: Surface, statics: StaticsResult) -> EvenStripes:
    """Return the evenly spaced stripes of a preset.
    Raises PatternError if the stress is zero, or if a spacing is too small for the mesh or too large."""
    options = preset.pattern
    if options.forces == "optimal":
        statics = optimal_statics(preset, surface, statics)
    spacings = [family.distance(surface.area, surface.mean_edge) for family in (options.major, options.minor)]
    drawn_families = [FAMILIES.index(name) for name in options.family_names]
    for k in drawn_families:
        _refuse_impossible(FAMILIES[k], spacings[k], surface)
    directions = StripeDirections.from_statics(preset, surface, statics, [spacings[k] for k in drawn_families])
    courses = {k: FamilyCourse.for_family(directions, FAMILIES[k], options.may_halve) for k in drawn_families}
    families = [courses[k].lines(h) if k in courses else no_lines(surface, h) for k, h in enumerate(spacings)]
    for name, lines, spacing in zip(FAMILIES, families, spacings, strict=True):
        if lines.grown < 0.5:
            raise _too_far_error(name, spacing, surface)
    divided = _redrawn_lines(directions, courses, families, spacings)
    stripes = divided.stripes(directions)
    has_own_forces = options.forces == "optimal" or options.rounds > 0
    return replace(stripes, forces=directions.given.stress) if has_own_forces else stripes


def _redrawn_lines(
    directions: StripeDirections, courses: dict[int, FamilyCourse], families: list[FamilyLines], spacings: list[float]
) -> "_DividedFamilies":
    surface, result = directions.frames.surface, _DividedFamilies.from_lines(directions, *families)
    tries = [result]
    for limit, halve in ((0.05, True), (0.3, False)):
        deviations = _spacing_errors(surface, result, spacings)
        redo = [k for k, lines in enumerate(families) if lines.most > 0 and abs(deviations[k]) > limit]
        if not redo:
            break
        for k in redo:  # halving ends some lines early, which changes the mean spacing
            wider = spacings[k] * float(np.exp(deviations[k]))
            families[k] = courses[k].lines(wider) if halve else courses[k].without_halving.lines(spacings[k])
        tries.append(_DividedFamilies.from_lines(directions, *families))
        result = min(tries, key=lambda one: float(np.abs(_spacing_errors(surface, one, spacings)).max()))
    return result


def _spacing_errors(surface: Surface, divided: "_DividedFamilies", spacings: list[float]) -> Floats:
    mean = surface.vertex_areas @ divided.density / surface.area
    return np.asarray(np.log(mean * np.array(spacings)))


def _refuse_impossible(name: str, spacing: float, surface: Surface) -> None:
    if spacing < FINEST * surface.mean_edge:
        raise PatternError(
            f"pattern.{name}.spacing = {spacing:.4g} m is too fine for this mesh, whose mean edge length is "
            f"{surface.mean_edge:.3g} m; set a spacing of {_digits(FINEST * surface.mean_edge)} m or more, or make "
            f"the mesh finer (surface.edge or surface.refine)"
        )
    if spacing > surface.size:
        raise _too_far_error(name, spacing, surface)


def _too_far_error(name: str, spacing: float, surface: Surface) -> PatternError:
    default = Family().distance(surface.area, surface.mean_edge)
    return PatternError(
        f"pattern.{name}.spacing = {spacing:.4g} m is too large for two stripes on this surface, whose bounding box "
        f"has a diagonal of {surface.size:.3g} m; the default is {default:.2g} m{_as_millimetres(spacing, surface)}"
    )


def _as_millimetres(spacing: float, surface: Surface) -> str:
    fits = FINEST * surface.mean_edge <= spacing / 1000 <= surface.size
    return f" (lengths are in metres: {spacing / 1000:.4g} for {spacing:.4g} mm)" if fits else ""


def _digits(length: float) -> str:
    unit = 10.0 ** (np.floor(np.log10(length)) - 1)
    return f"{np.ceil(length / unit) * unit:.2g}"


@dataclass(frozen=True, eq=False)
class _DividedFamilies:
    both: tuple[FamilyLines, FamilyLines]
    halved: LineHalving
    density: Floats

    @classmethod
    def from_lines(cls, directions: StripeDirections, major: FamilyLines, minor: FamilyLines) -> Self:
        families, surface = (major, minor), directions.frames.surface
        fields = major.phase.field, minor.phase.field
        wish, free = (major.wish, minor.wish), (major.free, minor.free)
        divided = halve_lines(surface, fields, wish, (major.most, minor.most), free)
        scales = np.stack([divided.mean_scale(surface, k) for k in (0, 1)], axis=1)
        remaining = directions.images.mean(vertex_means(surface, scales))
        return cls(families, divided, np.stack([lines.slope for lines in families], axis=1) * remaining)

    def stripes(self, directions: StripeDirections) -> EvenStripes:
        surface, (major, minor) = directions.frames.surface, self.both
        slope = np.stack([major.slope, minor.slope], axis=1)
        phases = major.phase, minor.phase
        chart = chart_of(self.halved, (major.phase.field, minor.phase.field))
        line_shares = self._line_shares(surface, 0), self._line_shares(surface, 1)
        symmetry_and_steering = directions.symmetry, directions.steered_with_members(self.both)
        return EvenStripes(phases, line_shares, slope, self.density, self.halved.first, chart, *symmetry_and_steering)

    def _line_shares(self, surface: Surface, k: int) -> tuple[Floats, ...]:
        return tuple(self.halved.drawn_share(surface, k, level) for level in range(self.both[k].most))
