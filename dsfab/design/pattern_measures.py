"""Measures for the quality of a pattern."""

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
from dsfab.pattern import FamilyRole, Layer, StressDirections, family_roles, material_points
from dsfab.pattern.widths import SOLID
from dsfab.preset.model import FAMILIES, Pattern, Preset
from dsfab.results import DiffusionResult, FilledOpenings, PatternResult, StaticsResult
from dsfab.slicing import Chart, Sheet, openings_of
from dsfab.slicing.measures.chart import StripeChart
from dsfab.slicing.measures.pattern_quality import Arms, DeadEnds, FamilyQuality, PatternQuality, arms, pattern_quality
from dsfab.surface import Surface, centroid, link_components, nearest_places, weights_at
from dsfab.surface.fields import CornerField, DividedField

R2 = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of points that fill the unit square evenly: 1 / g and 1 / g^2, with g^3 = g + 1 [Roberts 2018]."""


class PatternedDesign(Protocol):
    """A `Design`, or a `DesignDraft`: results up to the pattern."""

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


class DesignDraft(NamedTuple):
    """Results of the stages of a design up to the pattern."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    pattern: PatternResult


def measured_pattern(
    design: PatternedDesign, symmetry: bool = True, cells: Sheet | None = None, sheet: Sheet | None = None
) -> PatternQuality:
    """Return the quality of a pattern. symmetry : True to measure the symmetry error, too, which takes longest.
    cells : all cells of the cut surface (material and openings); None before the cut.
    sheet : the cut sheet; default: all material of `cells`."""
    chart = pattern_chart(design)
    stripes = pattern_on_chart(design.surface, chart, design.pattern)
    followed = followed_directions(design)
    try:
        confidence = followed.confidence(design.surface.areas)
    except PatternError:  # the stress is zero everywhere
        confidence = np.zeros(design.surface.m)
    parent = chart.parent
    steered = design.pattern.even.steered if design.pattern.even else None
    guided = steered.guided[parent] > 0.1 if steered else None  # below 0.1, a face does not count as guided
    columns = followed.stress[parent], followed.direction[parent], confidence[parent]
    quality = pattern_quality(stripes, *columns, guided=guided)
    major, minor = (role.title for role in roles_of_families(design))
    quality = replace(quality, turned=design.preset.pattern.rotate if steered else 0.0, titles=(major, minor))
    if cells is not None and design.pattern.tidy:
        quality = _sheet_quality(design, cells, (sheet or cells.subset()).surface, stripes, quality)
    group = used_symmetry(design) if symmetry else None
    if group is None:
        return quality
    error = symmetry_error(design.surface, stripes, group) if cells is None else cut_error(design.surface, cells, group)
    return replace(quality, symmetry_error=error)


def _sheet_quality(
    design: PatternedDesign, cells: Sheet, sheet: Surface, stripes: StripeChart, quality: PatternQuality
) -> PatternQuality:
    openings, name = openings_of(cells), np.array([*design.pattern.names, ""])[cells.family]
    families = []
    for k, (family_name, family) in enumerate(quality.families):
        slits, share = openings.slits_between(name == family_name) if openings else (0, 0.0)
        built = _ends_on_sheet(sheet, 0.1 * design.surface.mean_edge, family, stripes.d[:, k])
        families.append(replace(built, slits=slits, slit_share=share))
    return replace(quality, major=families[0], minor=families[1])


def _ends_on_sheet(sheet: Surface, reach: float, family: FamilyQuality, half_width: Floats) -> FamilyQuality:
    width = 2 * float(np.median(half_width)) * family.spacing[1]

    def remaining(places: Floats, dead: Callable[[Arms, float], bool]) -> Floats:
        if not len(places):
            return places
        is_near = nearest_places(places, sheet.V, sheet.F).squared < reach**2
        is_near[is_near] = [dead(arms(sheet, place, 1.5 * width), width) for place in places[is_near]]
        return np.asarray(places[is_near])

    ends = family.dead_ends
    dead_ends = DeadEnds(remaining(ends.loose, Arms.is_tip), remaining(ends.turns, Arms.is_hairpin))
    return replace(family, dead_ends=dead_ends)


def pattern_chart(design: PatternedDesign) -> Chart:
    even = design.pattern.even
    return even.chart if even is not None else modes_chart(design.surface, design.diffusion, design.pattern)


def stripes_on_chart(design: PatternedDesign) -> StripeChart:
    """Return the stripes of a design before the cut."""
    return pattern_on_chart(design.surface, pattern_chart(design), design.pattern)


def modes_chart(surface: Surface, diffusion: DiffusionResult, pattern: PatternResult) -> Chart:
    """Return the surface with the phases (n, 2) of major and minor stripes, for a pattern from diffusion modes."""
    modes = zip((diffusion.major, diffusion.minor), pattern.mode, strict=True)
    x = np.stack([family.mode(number) for family, number in modes], axis=1)
    z = x * np.array(pattern.frequency) + np.array(pattern.phase)
    return Chart(surface, np.arange(surface.m), csr_array(eye_array(surface.n)), z, np.ones((surface.n, 2)))


def pattern_on_chart(surface: Surface, chart: Chart, pattern: PatternResult) -> StripeChart:
    """Return the stripes of a pattern, with their widths. chart : mesh with the phases of the stripes."""
    d = np.stack([pattern.half_width(name) for name in FAMILIES], axis=1)
    kept_height = np.full(surface.n, -1.0)
    for name, x, levels in zip(pattern.names, pattern.fields, pattern.levels, strict=True):
        if name not in FAMILIES and not isinstance(x, CornerField):
            height = (x.at_vertices if isinstance(x, DividedField) else x) - levels[0]
            height = height if height.ndim == 1 else np.minimum(height[:, 0], -height[:, 1])
            kept_height = np.maximum(kept_height, height)
    return StripeChart.from_chart(chart, d, np.maximum(kept_height, -surface.size))


def followed_directions(design: PatternedDesign) -> StressDirections:
    """Return the directions that major and minor stripes follow on each face, and the stress in these directions."""
    preset = design.preset
    stress, direction = principal_stresses(design.surface, followed_stress(preset, design.surface, design.statics))
    if design.pattern.even is None and preset.diffusion.labelling == "magnitude":
        swap = np.abs(stress[:, 1]) > np.abs(stress[:, 0])
        stress[swap], direction[swap] = stress[swap, ::-1], direction[swap, ::-1]
    if design.pattern.even is not None and design.pattern.even.steered:
        over = design.pattern.even.steered.over
        stress[over], direction[over] = stress[over, ::-1], direction[over, ::-1]
    if design.pattern.even is not None and preset.pattern.rotate:
        a = np.radians(preset.pattern.rotate)
        square = np.cross(design.surface.normals[:, None], direction)
        direction = np.cos(a) * direction + np.sin(a) * square
        stress = np.cos(a) ** 2 * np.abs(stress) + np.sin(a) ** 2 * np.abs(stress[:, ::-1])
    return StressDirections(stress, direction)


def roles_of_families(design: PatternedDesign) -> tuple[FamilyRole, FamilyRole]:
    """Return the structural roles of the major and the minor stripes, such as arches or hoops."""
    if design.preset.pattern.rotate or design.preset.combines:
        return FamilyRole("major"), FamilyRole("minor")
    return family_roles(design.surface, followed_directions(design))


def one_family_message(roles: tuple[FamilyRole, FamilyRole], families: str) -> str:
    """Return a warning if the pattern omits the family of stripes that forms load-carrying arches; else ''."""
    drawn_role, omitted_role = sorted(roles, key=lambda role: role.key != families)
    if families == "both" or omitted_role.shape != "arches":
        return ""
    return (
        f"pattern.families = '{families}' draws only the {drawn_role.title}, but the {omitted_role.title} carry the "
        f"loads to the supports: set pattern.families = '{omitted_role.key}' or 'both'"
    )


def used_symmetry(design: PatternedDesign) -> Symmetry | None:
    """Return the mirrors and rotations under which the pattern must be symmetric, or None."""
    if design.pattern.even is not None:
        return design.pattern.even.symmetry
    words = design.preset.diffusion.symmetry
    loads = design.statics.loads(design.preset.followed_weights).values()
    return symmetry_of(design.surface, words, *loads) if words else None


def symmetry_error(surface: Surface, stripes: StripeChart, symmetry: Symmetry) -> float:
    """Return the fraction of the uncut surface where the stripes differ from their image under `symmetry`."""
    return _asymmetric_share(surface, stripes.surface, symmetry, partial(_is_material, stripes))


def cut_error(surface: Surface, cells: Sheet, symmetry: Symmetry) -> float:
    """Return the fraction of the surface where the material after the cut differs from its image under `symmetry`."""
    V, F = cells.surface.V, cells.surface.F
    return _asymmetric_share(
        surface, cells.surface, symmetry, lambda points: cells.material[nearest_places(points, V, F).simplex]
    )


def _asymmetric_share(
    surface: Surface, faces: Surface, symmetry: Symmetry, material: Callable[[Floats], Bools], samples: int = 120_000
) -> float:
    centre = centroid(surface)
    cumulated_area = np.cumsum(faces.areas)
    number = np.arange(samples // symmetry.order)
    face = np.searchsorted(cumulated_area, (number + 0.5) / len(number) * cumulated_area[-1])
    uv = number[:, None] * R2 % 1
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv)
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    points_from_centre = np.einsum("pc,pcx->px", weights, faces.V[faces.F[face]]) - centre
    points = [points_from_centre @ R.T + centre for R in symmetry.R]  # R[0] is the identity
    is_material = material(np.concatenate(points)).reshape(symmetry.order, -1)
    return float((is_material != is_material[0]).mean(axis=1).max())


def _is_material(stripes: StripeChart, points: Floats) -> Bools:
    V, F = stripes.surface.V, stripes.surface.F
    _, face, place = nearest_places(points, V, F)
    weights = weights_at(place, V, F[face])
    return stripes.inside(0, face, weights) | stripes.inside(1, face, weights) | stripes.is_kept(face, weights)


def largest_filling(before: Sheet, after: Sheet, apart: float, samples: int = 3) -> FilledOpenings | None:
    """Return the largest group of neighbouring openings that finishing filled, or None.
    apart  : largest distance of neighbouring openings, metres.
    before, after : cells before and after finishing.    samples : number of tested points in each opening."""
    openings = openings_of(before)
    if openings is None:
        return None
    order = np.lexsort((-openings.void.surface.areas, openings.label))
    rank = np.arange(len(order)) - np.searchsorted(openings.label[order], openings.label[order])
    sample = order[rank < samples]
    cell = nearest_places(openings.void.surface.centroids[sample], after.surface.V, after.surface.F).simplex
    open_ = np.bincount(openings.label[sample], ~after.material[cell], openings.count) > 0
    filled = np.flatnonzero(~open_)
    if not len(filled):
        return None
    places = openings.centroids[filled]
    pairs = cKDTree(places).query_pairs(apart, output_type="ndarray")
    _, group = link_components(len(filled), *pairs.T.astype(np.int64))
    largest_group = group == np.bincount(group).argmax()
    area = np.bincount(openings.label, openings.void.surface.areas, openings.count)[filled[largest_group]]
    return FilledOpenings(int(largest_group.sum()), area @ places[largest_group] / area.sum())


def merged_members(options: Pattern, surface: Surface, pattern: PatternResult) -> FilledOpenings | None:
    """Return the largest area where neighbouring members touch, for a pattern of a single family, or None."""
    if options.families == "both":
        return None  # for two families, `largest_filling` measures the filled openings
    touch = pattern.half_width(options.families) >= SOLID
    layers = map(Layer, pattern.names, pattern.fields, pattern.levels, pattern.half_widths)
    kept_layers = [layer for layer in layers if layer.name not in FAMILIES]
    is_kept = material_points(surface, kept_layers, np.full((1, 3), 1 / 3))[:, 0]
    faces = np.flatnonzero(touch[surface.F].all(axis=1) & ~is_kept)
    if not len(faces):
        return None
    i, j = surface.edges.ends[touch[surface.edges.ends].all(axis=1)].T
    label = link_components(surface.n, i, j)[1][surface.F[faces, 0]]
    plate = faces[label == np.bincount(label, surface.areas[faces]).argmax()]
    area, spacing = surface.areas[plate], options.drawn_families[0].distance(surface.area, surface.mean_edge)
    return FilledOpenings(int(area.sum() / spacing**2), area @ surface.centroids[plate] / area.sum())
