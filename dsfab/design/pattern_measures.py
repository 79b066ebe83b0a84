"""The measures of a good pattern, of a draft or a design: its phases on a chart, the stress, and the symmetry."""

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

TOUCH = 0.1
"""A dead end is still there if material is this near to it, as a share of a mean edge."""
REACH = 1.5
"""Widths of a member around a dead end within which it is seen whether it is one."""
GUIDED = 0.1
"""Guides of this weight, beside clear stress of 1, may make members turn back."""
LOOKS = 120_000
"""About how many points and images of points are looked at to see whether material is symmetric: of a floor with eight
images, and 24,000 points, .40 % were told where .55 % of the area differ."""
FILLED_LOOKS = 3
"""An opening is filled where so many of its largest cells are."""
R2 = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of a sequence of points that fills a square evenly: the powers of 1 / 1.3247..., the root of x^3 = x + 1."""


class Patterned(Protocol):
    """A design, or what is known of one when its pattern is."""

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
    """Stages 1 to 4 of a design that may never be made."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    pattern: PatternResult


def measured_pattern(
    made: Patterned, symmetry: bool = True, cells: Sheet | None = None, sheet: Sheet | None = None
) -> PatternQuality:
    """The measures of what is drawn. Once cut, symmetry is that of the cells; if tidied too, dead ends and slits are
    those of the sheet.

    symmetry : whether the error of the symmetry that the pattern was made with is measured too: it takes longest.
    cells    : all that it was cut to; None measures what is drawn (see `Design.quality`).
    sheet    : what is kept of these; all material where it is left out.
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
    guided = steered.guided[parent] > GUIDED if steered else None
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
    """The measures with the dead ends and the slits that the sheet has."""
    openings, name = Openings.of(cells), np.array([*made.pattern.names, ""])[cells.family]
    both = []
    for k, (own, family) in enumerate(found.families):
        slits, share = openings.slits_between(name == own) if openings else (0, 0.0)
        built = _built(sheet, TOUCH * made.surface.mean_edge, family, drawn.d[:, k])
        both.append(replace(built, slits=slits, slit_share=share))
    return replace(found, major=both[0], minor=both[1])


def _built(sheet: Surface, near: float, family: FamilyQuality, half_width: Floats) -> FamilyQuality:
    """The family without dead ends that are none on the sheet: where nothing is left, as they were taken off, and where
    the member goes on, as one of the other family does around a singular point of the stress.

    near       : metres; where material is no farther from a dead end it is still there.
    half_width : (n,) of its members, in periods.
    """
    width = 2 * float(np.median(half_width)) * family.spacing[1]

    def left(places: Floats, dead: Callable[[Arms, float], bool]) -> Floats:
        if not len(places):
            return places
        there = nearest(places, sheet.V, sheet.F).squared < near**2
        there[there] = [dead(arms(sheet, place, REACH * width), width) for place in places[there]]
        return np.asarray(places[there])

    ends = family.dead_ends
    return replace(family, dead_ends=DeadEnds(left(ends.loose, Arms.tip), left(ends.turns, Arms.hairpin)))


def pattern_chart(made: Patterned) -> Chart:
    """The chart of either kind of stripes."""
    even = made.pattern.even
    return even.chart if even is not None else modes_chart(made.surface, made.diffusion, made.pattern)


def drawn_on_chart(made: Patterned) -> Drawn:
    """What is drawn, on that chart."""
    return drawn_pattern(made.surface, pattern_chart(made), made.pattern)


def modes_chart(surface: Surface, diffusion: DiffusionResult, pattern: PatternResult) -> Chart:
    """The surface as its own chart: phases on modes have one value at each vertex, z = frequency x + phase."""
    modes = zip((diffusion.major, diffusion.minor), pattern.mode, strict=True)
    x = np.stack([family.mode(number) for family, number in modes], axis=1)
    z = x * np.array(pattern.frequency) + np.array(pattern.phase)
    return Chart(surface, np.arange(surface.m), csr_array(eye_array(surface.n)), z, np.ones((surface.n, 2)))


def drawn_pattern(surface: Surface, chart: Chart, pattern: PatternResult) -> Drawn:
    """What is drawn, on a chart."""
    d = np.stack([pattern.half_width(name) for name in FAMILIES], axis=1)
    kept = np.full(surface.n, -1.0)
    for name, x, levels in zip(pattern.names, pattern.fields, pattern.levels, strict=True):
        if name not in FAMILIES and not isinstance(x, CornerField):
            at = (x.at_vertices if isinstance(x, DividedField) else x) - levels[0]
            kept = np.maximum(kept, at if at.ndim == 1 else np.minimum(at[:, 0], -at[:, 1]))
    return Drawn.of(chart, d, np.maximum(kept, -surface.size))


def _followed(made: Patterned) -> StressDirections:
    """What the members of both families were to run along, but for guides."""
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
    """The mirrors and turns that the pattern was made with; None without any."""
    if made.pattern.even is not None:
        return made.pattern.even.symmetry
    words = made.preset.diffusion.symmetry
    loads = made.statics.loads(made.preset.followed).values()
    return symmetry_of(made.surface, words, *loads) if words else None


def symmetry_error(surface: Surface, drawn: Drawn, symmetry: Symmetry) -> float:
    """Share of the surface (uncut) where what is drawn differs from its image, the largest over the group."""
    return _differing(surface, drawn.surface, symmetry, partial(_material, drawn))


def cut_error(surface: Surface, cells: Sheet, symmetry: Symmetry) -> float:
    """As `symmetry_error`, of the cells of the cut: edges of members have moved by up to `slicing.snap` there, narrow
    openings are closed, and corners round."""
    V, F = cells.surface.V, cells.surface.F
    return _differing(surface, cells.surface, symmetry, lambda points: cells.material[nearest(points, V, F).simplex])


def _differing(surface: Surface, faces: Surface, symmetry: Symmetry, material: Callable[[Floats], Bools]) -> float:
    """Share of the area where material differs from its image, the largest over the group.

    surface  : uncut, about whose centroid the images are.    faces : the chart or the cells. Looked at are points that
               stand for the same area each, so that no large face counts by one; spread in their faces so that no row
               lies along the edge of a member [Roberts 2018, R2].
    material : whether the places nearest to points (p, 3) are material, (p,).
    """
    centre = centroid(surface)
    upto = np.cumsum(faces.areas)
    number = np.arange(LOOKS // symmetry.order)
    some = np.searchsorted(upto, (number + 0.5) / len(number) * upto[-1])
    uv = number[:, None] * R2 % 1
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    at = np.column_stack([1 - uv.sum(axis=1), uv])
    looked = np.einsum("pc,pcx->px", at, faces.V[faces.F[some]]) - centre
    points = [looked @ R.T + centre for R in symmetry.R]  # the first is the identity
    each = material(np.concatenate(points)).reshape(symmetry.order, -1)
    return float((each != each[0]).mean(axis=1).max())


def _material(drawn: Drawn, points: Floats) -> Bools:
    """(p,) whether the nearest point of the sheet to points (p, 3) is material."""
    V, F = drawn.surface.V, drawn.surface.F
    _, face, place = nearest(points, V, F)
    at = weights_at(place, V, F[face])
    return drawn.inside(0, face, at) | drawn.inside(1, face, at) | drawn.is_kept(face, at)


class Filling(NamedTuple):
    """Openings side by side that were filled: how many, and where in the mean (3,), metres, by their areas."""

    openings: int
    place: Floats


def largest_filling(before: Sheet, after: Sheet, apart: float) -> Filling | None:
    """The most openings of a sheet before it was finished that are filled after, none farther than `apart` metres from
    the next; None where none is."""
    every = Openings.of(before)
    if every is None:
        return None
    order = np.lexsort((-every.part.areas, every.label))
    rank = np.arange(len(order)) - np.searchsorted(every.label[order], every.label[order])
    seen = order[rank < FILLED_LOOKS]
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
