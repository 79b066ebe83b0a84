"""Quality measures of a pattern, of a draft or a design: phases on a chart, directions, and symmetry."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import PatternError
from dsfab.design.directions import followed_stress
from dsfab.diffusion import Symmetry, principal_stresses, symmetry_of
from dsfab.pattern import StressDirections
from dsfab.preset.model import FAMILIES, Preset
from dsfab.results import DiffusionResult, PatternResult, StaticsResult
from dsfab.slicing import Chart, Openings, Sheet
from dsfab.slicing.measures.chart import Drawn
from dsfab.slicing.measures.pattern_quality import Arms, DeadEnds, FamilyQuality, PatternQuality, arms, pattern_quality
from dsfab.surface import Surface, centroid, connected, nearest, weights_at
from dsfab.surface.fields import CornerField, DividedField

R2 = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of a sequence that fills the unit square evenly: powers of 1 / 1.3247..., the root of x^3 = x + 1 [Roberts
2018].
"""


class Patterned(Protocol):
    """A design, or the stages of one up to its pattern."""

    @property
    def preset(self) -> Preset: ...
    @property
    def surface(self) -> Surface: ...
    @property
    def statics(self) -> StaticsResult: ...
    @property
    def diffusion(self) -> DiffusionResult: ...
    @property
    def pattern(self) -> PatternResult: ...


class Drafted(NamedTuple):
    """Stages 1 to 4 of a design."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    pattern: PatternResult


def measured_pattern(
    made: Patterned, symmetry: bool = True, cells: Sheet | None = None, sheet: Sheet | None = None
) -> PatternQuality:
    """Measure the quality of a pattern. After the cut, symmetry is measured on the cells, and dead ends and slits of
    tidied patterns on the sheet.

    symmetry : whether the error of the pattern's own symmetry is measured too, which takes longest.
    cells    : all cells of the cut; None measures the stripes (see `Design.quality`).
    sheet    : the part of the cells that remains; all material by default.
    """
    chart = pattern_chart(made)
    drawn = drawn_pattern(made.surface, chart, made.pattern)
    given = _followed(made)
    try:
        confidence = given.confidence(made.surface.areas)
    except PatternError:  # nothing is stressed
        confidence = np.zeros(made.surface.m)
    parent = chart.parent
    steered = made.pattern.even.steered if made.pattern.even else None
    guided = steered.guided[parent] > 0.1 if steered else None  # beside clear stress of 1
    columns = given.stress[parent], given.direction[parent], confidence[parent]
    found = pattern_quality(drawn, *columns, guided=guided)
    found = replace(found, turned=made.preset.pattern.rotate if steered else 0.0)
    if cells is not None and made.pattern.tidy:
        found = _of_sheet(made, cells, (sheet or cells.kept()).surface, drawn, found)
    group = used_symmetry(made) if symmetry else None
    if group is None:
        return found
    error = symmetry_error(made.surface, drawn, group) if cells is None else cut_error(made.surface, cells, group)
    return replace(found, symmetry_error=error)


def _of_sheet(made: Patterned, cells: Sheet, sheet: Surface, drawn: Drawn, found: PatternQuality) -> PatternQuality:
    openings, name = Openings.of(cells), np.array([*made.pattern.names, ""])[cells.family]
    both = []
    for k, (own, family) in enumerate(found.families):
        slits, share = openings.slits_between(name == own) if openings else (0, 0.0)
        built = _built(sheet, 0.1 * made.surface.mean_edge, family, drawn.d[:, k])
        both.append(replace(built, slits=slits, slit_share=share))
    return replace(found, major=both[0], minor=both[1])


def _built(sheet: Surface, near: float, family: FamilyQuality, half_width: Floats) -> FamilyQuality:
    """Return the family without dead ends that the sheet does not have.

    An end counts no more if its material was removed, or if the member continues, for example as a member of the other
    family around a singular point of the stress.

    reach      : metres; a dead end still exists if material is nearer than this.
    half_width : (n,) of its members, in periods.
    """
    width = 2 * float(np.median(half_width)) * family.spacing[1]

    def left(places: Floats, dead: Callable[[Arms, float], bool]) -> Floats:
        if not len(places):
            return places
        there = nearest(places, sheet.V, sheet.F).squared < near**2
        there[there] = [dead(arms(sheet, place, 1.5 * width), width) for place in places[there]]
        return np.asarray(places[there])

    ends = family.dead_ends
    return replace(family, dead_ends=DeadEnds(left(ends.loose, Arms.tip), left(ends.turns, Arms.hairpin)))


def pattern_chart(made: Patterned) -> Chart:
    """Return the chart of evenly spaced stripes or of stripes on modes."""
    even = made.pattern.even
    return even.chart if even is not None else modes_chart(made.surface, made.diffusion, made.pattern)


def drawn_on_chart(made: Patterned) -> Drawn:
    """Return the stripes and kept regions of a design, on its chart."""
    return drawn_pattern(made.surface, pattern_chart(made), made.pattern)


def modes_chart(surface: Surface, diffusion: DiffusionResult, pattern: PatternResult) -> Chart:
    """Return the surface as its own chart: phases on modes have one value at each vertex, z = frequency x + phase."""
    modes = zip((diffusion.major, diffusion.minor), pattern.mode, strict=True)
    x = np.stack([family.mode(number) for family, number in modes], axis=1)
    z = x * np.array(pattern.frequency) + np.array(pattern.phase)
    return Chart(surface, np.arange(surface.m), csr_array(eye_array(surface.n)), z, np.ones((surface.n, 2)))


def drawn_pattern(surface: Surface, chart: Chart, pattern: PatternResult) -> Drawn:
    """Return the stripes and kept regions of a pattern, on a chart."""
    d = np.stack([pattern.half_width(name) for name in FAMILIES], axis=1)
    kept = np.full(surface.n, -1.0)
    for name, x, levels in zip(pattern.names, pattern.fields, pattern.levels, strict=True):
        if name not in FAMILIES and not isinstance(x, CornerField):
            at = (x.at_vertices if isinstance(x, DividedField) else x) - levels[0]
            kept = np.maximum(kept, at if at.ndim == 1 else np.minimum(at[:, 0], -at[:, 1]))
    return Drawn.of(chart, d, np.maximum(kept, -surface.size))


def _followed(made: Patterned) -> StressDirections:
    """Return the directions that both families follow, without guides."""
    ask = made.preset
    stress, direction = principal_stresses(made.surface, followed_stress(ask, made.surface, made.statics))
    if made.pattern.even is None and ask.diffusion.labelling == "magnitude":
        swap = np.abs(stress[:, 1]) > np.abs(stress[:, 0])
        stress[swap], direction[swap] = stress[swap, ::-1], direction[swap, ::-1]
    if made.pattern.even is not None and made.pattern.even.steered:
        over = made.pattern.even.steered.over
        stress[over], direction[over] = stress[over, ::-1], direction[over, ::-1]
    if made.pattern.even is not None and ask.pattern.rotate:
        a = np.radians(ask.pattern.rotate)
        square = np.cross(made.surface.normals[:, None], direction)
        direction = np.cos(a) * direction + np.sin(a) * square
        stress = np.cos(a) ** 2 * np.abs(stress) + np.sin(a) ** 2 * np.abs(stress[:, ::-1])
    return StressDirections(stress, direction)


def used_symmetry(made: Patterned) -> Symmetry | None:
    """Return the mirrors and rotations of a pattern; None without any."""
    if made.pattern.even is not None:
        return made.pattern.even.symmetry
    words = made.preset.diffusion.symmetry
    loads = made.statics.loads(made.preset.followed).values()
    return symmetry_of(made.surface, words, *loads) if words else None


def symmetry_error(surface: Surface, drawn: Drawn, symmetry: Symmetry) -> float:
    """Return the share of the uncut surface where the stripes differ from their image, the largest over the group."""
    return _differing(surface, drawn.surface, symmetry, partial(_material, drawn))


def cut_error(surface: Surface, cells: Sheet, symmetry: Symmetry) -> float:
    """Return `symmetry_error` for the cells of the cut.

    There, edges of members have moved by up to `slicing.snap`, narrow openings are closed, and corners are round.
    """
    V, F = cells.surface.V, cells.surface.F
    return _differing(surface, cells.surface, symmetry, lambda points: cells.material[nearest(points, V, F).simplex])


def _differing(
    surface: Surface,
    faces: Surface,
    symmetry: Symmetry,
    material: Callable[[Floats], Bools],
    samples: int = 120_000,
) -> float:
    """Return the share of the area where material differs from its image, the largest over the group.

    surface  : uncut; images are about its centroid.    faces : the chart or the cells. Each sample point stands for the
               same area; points spread evenly in their faces, so that no row lies along the edge of a member.
    material : whether the places nearest to points (p, 3) are material, (p,).
    samples  : about how many points and images. On a floor with eight images, 24,000 gave .40 % instead of .55 %.
    """
    centre = centroid(surface)
    upto = np.cumsum(faces.areas)
    number = np.arange(samples // symmetry.order)
    some = np.searchsorted(upto, (number + 0.5) / len(number) * upto[-1])
    uv = number[:, None] * R2 % 1
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    at = np.column_stack([1 - uv.sum(axis=1), uv])
    looked = np.einsum("pc,pcx->px", at, faces.V[faces.F[some]]) - centre
    points = [looked @ R.T + centre for R in symmetry.R]  # the first is the identity
    each = material(np.concatenate(points)).reshape(symmetry.order, -1)
    return float((each != each[0]).mean(axis=1).max())


def _material(drawn: Drawn, points: Floats) -> Bools:
    """Return whether the nearest point of the sheet to each point (p, 3) is material."""
    V, F = drawn.surface.V, drawn.surface.F
    _, face, place = nearest(points, V, F)
    at = weights_at(place, V, F[face])
    return drawn.inside(0, face, at) | drawn.inside(1, face, at) | drawn.is_kept(face, at)


class Filling(NamedTuple):
    """Filled openings side by side: their number, and their mean place (3,), metres, by area."""

    openings: int
    place: Floats


def largest_filling(before: Sheet, after: Sheet, apart: float, samples: int = 3) -> Filling | None:
    """Return the largest group of openings that finishing filled, each at most `apart` metres from the next; None
    without any.

    samples : an opening counts as filled if all of this number of its largest cells are.
    """
    every = Openings.of(before)
    if every is None:
        return None
    order = np.lexsort((-every.part.areas, every.label))
    rank = np.arange(len(order)) - np.searchsorted(every.label[order], every.label[order])
    seen = order[rank < samples]
    there = nearest(every.part.centroids[seen], after.surface.V, after.surface.F).simplex
    open_ = np.bincount(every.label[seen], ~after.material[there], every.count) > 0
    filled = np.flatnonzero(~open_)
    if not len(filled):
        return None
    where = every.places[filled]
    pairs = cKDTree(where).query_pairs(apart, output_type="ndarray")
    _, group = connected(len(filled), *pairs.T.astype(np.int64))
    most = group == np.bincount(group).argmax()
    area = np.bincount(every.label, every.part.areas, every.count)[filled[most]]
    return Filling(int(most.sum()), area @ where[most] / area.sum())
