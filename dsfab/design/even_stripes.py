"""Evenly spaced stripes: their directions, densities and phases, and lines that end where they crowd."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, cross
from dsfab.core.errors import PatternError
from dsfab.design.directions import Steering, followed_stress, load_axes, steering
from dsfab.design.surface_and_statics import is_slab
from dsfab.diffusion import Symmetry, found_symmetry, principal_stresses
from dsfab.pattern import (
    CornerPhase,
    Flow,
    Frames,
    GuideLine,
    Halving,
    Images,
    StressDirections,
    aimed,
    boundary_lines,
    corner_phase,
    cross_field,
    crossed_over,
    density,
    halving,
    log_density,
    signs_with_short_seams,
    through_peaks,
    vertex_means,
)
from dsfab.preset.model import FAMILIES, Family, Pattern, Preset, Width
from dsfab.results import EvenStripes, StaticsResult, Steered
from dsfab.slicing import Halved, chart_of, halved
from dsfab.statics import varying_thickness
from dsfab.surface import Surface, connected

SLOPES = (0.6, 1.6)
"""Bounds of the growth of a phase over the wanted growth; values beyond come from singular faces."""


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of one family.

    most, wish : largest number of halvings, and (m,) the number wanted on each face.    slope : (n,) periods per metre.
    free       : (m,) number of halvings wanted without limits, also negative.
    grown      : total growth of the phase over the wanted growth.
    """

    phase: CornerPhase
    most: int
    wish: Floats
    free: Floats
    slope: Floats
    grown: float


@dataclass(frozen=True, eq=False)
class Followed:
    """Directions and constraints that both families follow.

    along   : (n, 3) directions of the major stripes.    confidence : (m,) their clarity, 0 to 1.
    moved   : (n,) movement of the vertices under the followed loads, in any unit.
    members : curves of guides that become members.
    """

    frames: Frames
    given: StressDirections
    along: Floats
    confidence: Floats
    moved: Floats
    images: Images
    symmetry: Symmetry | None
    steered: Steered | None
    members: tuple[GuideLine, ...] = ()

    @classmethod
    def of(cls, preset: Preset, surface: Surface, statics: StaticsResult, spacings: list[float]) -> Self:
        """Return the directions of a preset, for spacings of the drawn families, metres."""
        symmetry = _symmetry(preset, surface, statics)
        sigma = followed_stress(preset, surface, statics)
        given = StressDirections(*principal_stresses(surface, symmetry.stress(sigma) if symmetry else sigma))
        frames = Frames.of(surface)
        steer = steering(preset.pattern, frames, symmetry, min(spacings))
        symmetry = steer.symmetry
        images = Images(symmetry.R, symmetry.maps, symmetry.faces) if symmetry else Images.none(surface.n)
        length = max(float(np.mean(spacings)), surface.mean_edge)  # members cannot follow shorter changes
        along, over = _directions(preset.pattern, frames, given, steer, images, length)
        confidence = steer.confidence(surface, given.confidence(surface.areas))
        along = signs_with_short_seams(frames, along)[:, None] * along
        own = bool(steer.turn or steer.guidance or over.any())
        steered = steer.steered(surface, along, given, over) if own else None
        moved = images.mean(_moved(preset, surface, statics))
        members = tuple(GuideLine.of(surface, preset.pattern.guide))
        return cls(frames, given, along, confidence, moved, images, symmetry, steered, members)

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """Directions (n, 3) of the gradients of both phases, square to the stripes."""
        return cross(self.frames.normal, self.along), self.along

    def with_members(self, both: Sequence[Lines]) -> Steered | None:
        """Return the steering of the families, with messages on the curves of guides that become members."""
        if self.steered is None or not self.members:
            return self.steered
        surface, told = self.frames.surface, [self.steered.told] * bool(self.steered.told)
        for line in self.members:
            lines = both[FAMILIES.index(line.family)]
            share = line.followed(surface, lines.phase, 2**lines.most)
            stress = self.given.direction[:, FAMILIES.index(line.family)]
            told.append(_member_words(line, share, line.across(stress)))
        return replace(self.steered, told="; ".join(told))


def _member_words(line: GuideLine, share: float, across: bool) -> str:
    """Return a message on the share of a guide's curve that is a member, and on its direction across the stress."""
    key = f"pattern.guide.{line.number}"
    other = FAMILIES[1 - FAMILIES.index(line.family)]
    hint = f"; the {other} family runs along it by itself: family = '{other}' bends less" if across else ""
    if share >= 0.995:  # a few sample points may lie beside the member
        return f"a {line.family} member runs on the curve of {key}{hint}"
    return (
        f"a {line.family} member runs on {share:.0%} of the curve of {key} only: another guide, an edge or a point "
        f"around which stripes turn is in its way; move the curve{hint}"
    )


def _directions(
    ask: Pattern, frames: Frames, given: StressDirections, steer: Steering, images: Images, length: float
) -> tuple[Floats, Bools]:
    """Return directions (n, 3) of the major stripes, smoothed over `length` metres, and vertices (n,) where they
    continue as minor ones.

    The search for crossings of the two stresses comes before smoothing. From one side to the other the larger stress
    turns by a right angle; any direction between would be equally smooth and make singular points along the curve.
    """

    def smoothed(given: StressDirections, length: float) -> Floats:
        return images.directions(frames, cross_field(frames, given, length, steer.turn, steer.guidance))

    over = np.zeros(frames.surface.n, dtype=bool)
    if not ask.steered:
        # measured on eight plates: over 1 edge a face between both sides joins them, over .25 edges noise does
        over = _crossed_over(ask, frames, smoothed(given, 0.6 * frames.surface.mean_edge), images)
        # a smaller region has no room for two members: with 1.6 lengths, four members of a floor had loose ends
        over = over & (_region_areas(frames, over) > (2.0 * length) ** 2)
        given = _renamed(given, over[frames.surface.F].mean(axis=1) > 0.5)
    along = smoothed(given, length)
    more = _crossed_over(ask, frames, along, images)
    return np.where(more[:, None], cross(frames.normal, along), along), over ^ more


def _region_areas(frames: Frames, over: Bools) -> Floats:
    """Return the area (n,), m2, of the region around each vertex in which families keep their names."""
    surface, (i, j) = frames.surface, frames.ends.T
    same = over[i] == over[j]
    count, region = connected(surface.n, i[same], j[same])
    return np.asarray(np.bincount(region, surface.vertex_areas, count)[region])


def _renamed(given: StressDirections, over: Bools) -> StressDirections:
    """Return the directions with the first and the second stress exchanged on marked faces (m,)."""
    order = np.where(over[:, None], [1, 0], [0, 1])
    stress = np.take_along_axis(given.stress, order, axis=1)
    return StressDirections(stress, np.take_along_axis(given.direction, order[:, :, None], axis=1))


def _crossed_over(ask: Pattern, frames: Frames, along: Floats, images: Images) -> Bools:
    """Return vertices (n,) where the families exchange names: none if guides use the names, or if images disagree."""
    over = crossed_over(frames, along)
    same = np.abs(images.mean(over.astype(float)) - over).max() < 0.5
    return over if same and not ask.steered else np.zeros_like(over)


@dataclass(frozen=True, eq=False)
class Course:
    """The course of a family for any spacing.

    g : (n, 3) direction of the phase's gradient.    u : (n,) logarithm of the density.    halved : where lines are
        halved.
    start : (n,) where the phase begins.             members : curves that become members of the family.
    """

    follow: Followed
    g: Floats
    u: Floats
    halved: Halving
    start: Floats
    members: tuple[GuideLine, ...]

    @classmethod
    def of(cls, follow: Followed, name: str, halve: bool) -> Self:
        """Return the course of a family by its name.

        Lines run through the most stressed places: the start is the stress to the fourth power.
        """
        g = follow.gradients[FAMILIES.index(name)]
        surface = follow.frames.surface
        size = vertex_means(surface, np.abs(follow.given.stress).max(axis=1))
        u = follow.images.mean(log_density(follow.frames, g, follow.confidence))
        members = tuple(line for line in follow.members if line.family == name)
        return cls(follow, g, u, halving(u, surface.vertex_areas, halve), (size / size.max()) ** 4, members)

    @property
    def unhalved(self) -> Self:
        """The same course with every line drawn everywhere."""
        return replace(self, halved=halving(self.u, self.follow.frames.surface.vertex_areas, allowed=False))

    def lines(self, spacing: float) -> Lines:
        """Return the lines of the family, `spacing` metres apart on average.

        Of two phases half a period apart, lines run where stressed places move: held places are stiff anyway.
        """
        frames, images, most = self.follow.frames, self.follow.images, self.halved.most
        surface = frames.surface
        finest = density(surface, self.u, spacing, self.halved)
        coarse = Flow(frames, self.g, finest / 2**most)  # whole periods around loops stay whole after halving
        beside, aim = aimed(self.members, frames, self.g, coarse.density)
        lock = beside | boundary_lines(surface, self.g, spacing)
        given = self.start, lock, images.projection(surface.V, self.g, coarse.density), aim
        solved = coarse.solve(*given)
        if not lock.any():
            solved = through_peaks(solved, surface.vertex_areas * self.start * self.follow.moved)
        phase = corner_phase(coarse, solved, partial(coarse.solve, *given, free=True) if lock.any() else None)
        phase = phase.times(2**most)
        phase = replace(phase, singular=images.of_any(phase.singular))
        whole = surface.areas * ~phase.singular
        size = np.linalg.norm(phase.gradients(surface), axis=1)
        grown = float(whole @ size / (whole @ finest[surface.F].mean(axis=1)))
        slope = images.mean(_slope(surface, size, phase.singular, finest))
        wish, free = (x[surface.F].mean(axis=1) for x in (self.halved.wish, self.halved.free))
        return Lines(phase, most, wish, free, slope, grown)


def _moved(preset: Preset, surface: Surface, statics: StaticsResult) -> Floats:
    """Return the size of displacements (n,), summed over the followed loads; 1 everywhere if all are zero."""
    followed = [(weight, statics.cases[name].equilibrium.u) for name, weight in preset.followed.items()]
    moved = sum(abs(weight) * np.linalg.norm(u, axis=1) for weight, u in followed)
    return np.asarray(moved if np.any(moved) else np.ones(surface.n))


def no_lines(surface: Surface, spacing: float) -> Lines:
    """Return a family that is not drawn: it has no phase on any face."""
    sides = (surface.m, 3)
    phase = CornerPhase(np.zeros(surface.n), np.ones(sides), np.zeros(sides), np.ones(surface.m, dtype=bool))
    return Lines(phase, 0, np.zeros(surface.m), np.zeros(surface.m), np.full(surface.n, 1 / spacing), 1.0)


def _symmetry(preset: Preset, surface: Surface, statics: StaticsResult) -> Symmetry | None:
    """Return the symmetry of surface, supports and followed loads, unless the preset excludes it."""
    if preset.pattern.symmetry == "none":
        return None
    loads = list(statics.loads(preset.followed).values())
    return found_symmetry(surface, load_axes(surface, statics.load), loads)


def _slope(surface: Surface, size: Floats, singular: Bools, asked: Floats) -> Floats:
    """Return periods per metre (n,) around each vertex, from `size` (m,) on faces with a phase."""
    whole = (~singular).astype(float)
    mean, known = vertex_means(surface, np.stack([size * whole, whole], axis=1)).T
    slope = np.divide(mean, known, out=asked.copy(), where=known > 0)
    return np.asarray(np.clip(slope, SLOPES[0] * asked, SLOPES[1] * asked))


def follows_membrane(preset: Preset, surface: Surface, statics: StaticsResult) -> bool:
    """Return whether the pattern follows the stress of the middle surface; optimal forces exist for that only."""
    cases = [statics.cases[name] for name in preset.followed]
    return all(case.layered is None for case in cases) and not is_slab(surface, [case.answers for case in cases])


def optimal_statics(preset: Preset, surface: Surface, statics: StaticsResult) -> StaticsResult:
    """Return the statics with stresses of the stiffest sheet of varying thickness in place of the followed ones.

    Stresses are times the thickness over that of the whole sheet. Raises PatternError if the pattern follows bending.
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


FINEST = 0.5
"""Least spacing of stripes in mean edges: members much thinner than triangles are ragged."""


def same_stripes(old: Pattern, new: Pattern) -> bool:
    """Return whether two [pattern] sections give the same centre lines: all keys are equal except widths and kept
    regions.

    Keys that only stripes on modes use make no difference either. A new key does until this function names it. With
    rounds of weight, every key counts.
    """
    if new.rounds:
        return old == new

    def middles(ask: Pattern) -> Pattern:
        both = {
            name: getattr(ask, name).model_copy(update={"threshold": 0.0, "frequency": 0.0, "mode": 1, "phase": 0.0})
            for name in FAMILIES
        }
        width = Width(solid_fraction=ask.width.solid_fraction) if ask.forces == "optimal" else Width()
        return ask.model_copy(update={"width": width, "keep": 0.0, "rim": 0.0, "tidy": None, **both})

    return middles(old) == middles(new)


def even_stripes(preset: Preset, surface: Surface, statics: StaticsResult) -> EvenStripes:
    """Return the evenly spaced stripes that [pattern] requests.

    Raises PatternError if the stress is zero, and for spacings too fine for the mesh or too wide for the surface.
    """
    ask = preset.pattern
    if ask.forces == "optimal":
        statics = optimal_statics(preset, surface, statics)
    spacings = [family.distance(surface.area, surface.mean_edge) for family in (ask.major, ask.minor)]
    shown = [FAMILIES.index(name) for name in ask.family_names]
    for k in shown:
        _refuse_impossible(FAMILIES[k], spacings[k], surface)
    followed = Followed.of(preset, surface, statics, [spacings[k] for k in shown])
    courses = {k: Course.of(followed, FAMILIES[k], ask.halved) for k in shown}
    both = [courses[k].lines(h) if k in courses else no_lines(surface, h) for k, h in enumerate(spacings)]
    for name, lines, spacing in zip(FAMILIES, both, spacings, strict=True):
        if lines.grown < 0.5:  # the surface is too small for two stripes around it
            raise _too_far(name, spacing, surface)
    found = _drawn_again(followed, courses, both, spacings)
    made = found.stripes(followed)
    own = ask.forces == "optimal" or ask.rounds > 0
    return replace(made, forces=followed.given.stress) if own else made


def _drawn_again(
    followed: Followed, courses: dict[int, Course], both: list[Lines], spacings: list[float]
) -> "_Divided":
    """Return both families of lines, redrawn if the spacing, metres, of the remaining lines is off by over 5 %.

    Lines halved everywhere or nowhere may be half off at any spacing: a family still off by 30 % is not halved.
    """
    surface, found = followed.frames.surface, _Divided.of(followed, *both)
    tries = [found]
    for most, halve in ((0.05, True), (0.3, False)):
        off = _off(surface, found, spacings)
        again = [k for k, lines in enumerate(both) if lines.most > 0 and abs(off[k]) > most]
        if not again:
            break
        for k in again:  # levels end at whole openings, so that the spacing follows from the drawn lines
            wider = spacings[k] * float(np.exp(off[k]))
            both[k] = courses[k].lines(wider) if halve else courses[k].unhalved.lines(spacings[k])
        tries.append(_Divided.of(followed, *both))
        found = min(tries, key=lambda one: float(np.abs(_off(surface, one, spacings)).max()))
    return found


def _off(surface: Surface, found: "_Divided", spacings: list[float]) -> Floats:
    """Return the logarithm (2,) of drawn over requested stripes per metre, on average."""
    mean = surface.vertex_areas @ found.density / surface.area
    return np.asarray(np.log(mean * np.array(spacings)))


def _refuse_impossible(name: str, spacing: float, surface: Surface) -> None:
    """Raise PatternError for a spacing, metres, that no phase can have."""
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
        f"is the default{_as_millimetres(spacing, surface)}"
    )


def _as_millimetres(spacing: float, surface: Surface) -> str:
    fits = FINEST * surface.mean_edge <= spacing / 1000 <= surface.size
    return f" (lengths are in metres: {spacing / 1000:.4g} for {spacing:.4g} mm)" if fits else ""


def _digits(length: float) -> str:
    """Round up to two digits."""
    unit = 10.0 ** (np.floor(np.log10(length)) - 1)
    return f"{np.ceil(length / unit) * unit:.2g}"


@dataclass(frozen=True, eq=False)
class _Divided:
    """Both families without the lines dropped where they crowd; density : (n, 2) remaining lines per metre.

    The density is the mean over all images of a point, because widths follow it and faces are less symmetric than
    vertices.
    """

    both: tuple[Lines, Lines]
    halved: Halved
    density: Floats

    @classmethod
    def of(cls, followed: Followed, major: Lines, minor: Lines) -> Self:
        both, surface = (major, minor), followed.frames.surface
        fields = major.phase.field, minor.phase.field
        wish, free = (major.wish, minor.wish), (major.free, minor.free)
        divided = halved(surface, fields, wish, (major.most, minor.most), free)
        scales = np.stack([divided.scale(surface, k) for k in (0, 1)], axis=1)
        left = followed.images.mean(vertex_means(surface, scales))
        return cls(both, divided, np.stack([lines.slope for lines in both], axis=1) * left)

    def stripes(self, followed: Followed) -> EvenStripes:
        """Return the evenly spaced stripes."""
        surface, (major, minor) = followed.frames.surface, self.both
        slope = np.stack([major.slope, minor.slope], axis=1)
        phases = major.phase, minor.phase
        chart = chart_of(self.halved, (major.phase.field, minor.phase.field))
        wanted = self._wanted(surface, 0), self._wanted(surface, 1)
        same = followed.symmetry, followed.with_members(self.both)
        return EvenStripes(phases, wanted, slope, self.density, self.halved.first, chart, *same)

    def _wanted(self, surface: Surface, k: int) -> tuple[Floats, ...]:
        return tuple(self.halved.wanted(surface, k, level) for level in range(self.both[k].most))
