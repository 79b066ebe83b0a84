"""The last three steps: stripes of material, the sheet cut along them, and the solid."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Ints, first
from dsfab.design import DiffusionResult, PatternResult, Piece, SlicingResult, StaticsResult
from dsfab.errors import PatternError, SolidError
from dsfab.pattern import (
    Family,
    Layer,
    Widths,
    distance_to_boundary,
    distance_to_vertices,
    frequency_for,
    mean_duty_factor,
    relative_stresses,
    solved_factor,
)
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.slicing import Sheet, cut, material_area, resolve_pinches
from dsfab.surface import LoadCase, Surface
from dsfab.surface.topology import pieces
from dsfab.thickening import Solid, offsets, thicken

SHARE_TOLERANCE = 4e-4
"""How closely pattern.width.solid_fraction is reached, as a share of the surface."""

SPRINGS_LOST = 0.005
"""The user is told when a larger share of the stiffness of spring supports lies on removed material."""

SHARE_SNAP = 0.05
"""Snap fraction of the cuts that measure it: the default of slicing.snap, for no stage depends on a later section."""


def pattern_step(
    preset: Preset, surface: Surface, statics: StaticsResult, diffusion: DiffusionResult, log: Log
) -> PatternResult:
    """Kept regions come first: a cell that they make material is not cut again by the stripes."""
    ask = preset.pattern
    with log.stage("pattern", "drawing stripes"):
        kept = _kept_regions(preset, surface, statics.load)
        widths = ask.width.widths(np.sqrt(surface.area))
        families = _families(preset, surface, diffusion, widths.radius)
        for family, asked in zip(families, (ask.major, ask.minor), strict=True):
            if asked.spacing:
                told = f"spacing {asked.spacing:g} m: frequency of the {family.name} stripes became"
                log.note("pattern", f"{told} {family.stripes.frequency:.4g}")
        factor = mean_duty_factor(surface, families, widths) if widths.rule == "graded" else 1.0
        if ask.width.solid_fraction:

            def share(relative: float) -> float:
                layers = [*kept, *(family.layer(widths, factor * relative) for family in families)]
                fields, levels = zip(*((layer.field, layer.levels) for layer in layers), strict=True)
                return material_area(surface, fields, levels, SHARE_SNAP) / surface.area

            factor *= solved_factor(share, ask.width.solid_fraction, SHARE_TOLERANCE)
            log.note("pattern", _solved(preset, widths, factor))
        layers = [*kept, *(family.layer(widths, factor) for family in families)]
    names, fields, levels, half_widths = zip(*layers, strict=True)
    major, minor = (family.stripes.frequency for family in families)
    return PatternResult(names, fields, levels, half_widths, factor, (major, minor))


def _kept_regions(preset: Preset, surface: Surface, load: LoadCase) -> list[Layer]:
    """What is material whatever the stripes do."""
    ask, regions = preset.pattern, []
    if ask.keep:
        regions.append(("keep", distance_to_vertices(surface, load.held | load.loaded), ask.keep))
    if ask.rim and surface.edges.boundary.any():
        regions.append(("rim", distance_to_boundary(surface), ask.rim))
    every = np.full(surface.n, np.inf)
    return [Layer(name, -distance, np.array([-reach]), every) for name, distance, reach in regions]


def _families(preset: Preset, surface: Surface, diffusion: DiffusionResult, radius: float) -> list[Family]:
    """Both families of stripes; the major one runs along the primary stress, the minor one along the secondary."""
    ask, families = preset.pattern, []
    stress = [None, None]
    if ask.width.rule == "graded":
        stress = list(relative_stresses(surface, diffusion.tensors.principal).T)
    pairs = (("major", ask.major, diffusion.major), ("minor", ask.minor, diffusion.minor))
    for (name, family, modes), along in zip(pairs, stress, strict=True):
        if family.mode > len(modes.lam):
            raise PatternError(
                f"pattern.{name}.mode = {family.mode} but only diffusion.modes = {len(modes.lam)} are computed; "
                "raise diffusion.modes or choose a lower mode"
            )
        x, stripes = modes.mode(family.mode), family.stripes
        if family.spacing:
            stripes = replace(stripes, frequency=frequency_for(surface, x, family.spacing))
        families.append(Family.on(surface, name, stripes, x, along, radius))
    return families


def _solved(preset: Preset, widths: Widths, factor: float) -> str:
    """What the widths became for the wanted share of material."""
    ask = preset.pattern
    if widths.rule == "constant":
        became = f"members are {factor * widths.member:.3g} m wide"
    elif widths.rule == "plain":
        major, minor = (family.stripes.widened(factor).threshold for family in (ask.major, ask.minor))
        became = f"the thresholds became {major:.3f} and {minor:.3f}"
    else:
        became = f"the graded widths were multiplied by {factor:.3g}"
    return f"{became} for solid_fraction = {ask.width.solid_fraction:.1%}"


def slicing_step(
    preset: Preset, surface: Surface, statics: StaticsResult, pattern: PatternResult, log: Log
) -> SlicingResult:
    ask = preset.slicing
    with log.stage("slicing", f"cutting {surface.m:,} triangles"):
        cells = cut(surface, pattern.fields, pattern.levels, ask.snap)
        if not cells.material.any():
            raise PatternError("the pattern leaves no material; lower pattern.major.threshold or raise pattern.keep")
        pinched = resolve_pinches(cells, preset.statics.thickness / 2, ask.pinch)
        sheet = pinched.sheet.kept()
        listed, label = _pieces(sheet, statics.load)
        built = listed
        if ask.loose == "drop" and any(p.held for p in listed) and not all(p.held for p in listed):
            sheet = sheet.kept(np.array([p.held for p in listed])[label])
            built = tuple(p for p in listed if p.held)
    _note_slicing(preset, sheet, listed, statics.load, pinched.count, log)
    return SlicingResult(pinched.sheet, sheet, built, pinched.count)


def _pieces(sheet: Sheet, load: LoadCase) -> tuple[tuple[Piece, ...], Ints]:
    """The pieces of a sheet, and the piece of each of its faces."""
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)
    marks = []
    for mark in (load.held, load.loaded):
        marks.append(np.bincount(label, sheet.between(mark)[sheet.surface.F].any(axis=1), count) > 0)
    listed = tuple(Piece(float(area[k]), bool(marks[0][k]), bool(marks[1][k])) for k in range(count))
    return listed, label


def _note_slicing(
    preset: Preset, sheet: Sheet, listed: tuple[Piece, ...], load: LoadCase, pinches: int, log: Log
) -> None:
    loose = [piece for piece in listed if not piece.held]
    if loose:
        area = sum(piece.area for piece in loose)
        done = "dropped" if preset.slicing.loose == "drop" and len(loose) < len(listed) else "kept"
        log.note("slicing", f"{len(loose)} of {len(listed)} pieces reach no support and were {done} ({area:.3g} m2)")
    if pinches:
        log.note("slicing", f"{pinches} point contacts were {'joined' if preset.slicing.pinch == 'join' else 'split'}")
    lost = np.flatnonzero(load.loaded & (sheet.same_vertex() < 0))
    if len(lost):
        log.note(
            "slicing",
            f"{len(lost)} of {load.loaded.sum()} loaded points lie on removed material (vertices {first(lost, 3)}); "
            "set pattern.keep to protect them",
        )
    total = load.spring.sum()
    if total and (share := 1 - load.spring[sheet.same_vertex() >= 0].sum() / total) > SPRINGS_LOST:
        log.note("slicing", f"{share:.0%} of the springs' stiffness is on removed material; set pattern.keep")


def thickening_step(preset: Preset, surface: Surface, slicing: SlicingResult, log: Log) -> Solid:
    """Offsets are made on the uncut surface, where normals are clean, and carried through the cut."""
    ask = preset.thickening
    with log.stage("thickening", f"thickening {slicing.sheet.surface.m:,} triangles"):
        offset = offsets(surface, preset.statics.thickness, ask.side)
        if offset.smallest < ask.thinnest:
            raise SolidError(
                f"the surface bends so sharply that the sheet would be thinned to {offset.smallest:.0%} of its "
                f"thickness (allowed: {ask.thinnest:.0%}); make statics.thickness smaller, smooth the "
                "surface, or lower thickening.thinnest"
            )
        D = slicing.sheet.carry_corners(offset.at_corners(surface.F), surface.F)
        solid = thicken(slicing.sheet.surface, D, ask.side)
        solid = replace(solid, repairs=replace(solid.repairs, limited=offset.limited, smallest=offset.smallest))
    if ask.strict and solid.repairs.pairs:
        told = next(text for text in solid.notes if "still intersect" in text)
        raise SolidError(f"{told}; thickening.strict refuses such a solid: make the sheet thinner there")
    if offset.limited:
        log.note(
            "thickening",
            f"{offset.limited} of {surface.n} vertices were thinned where the surface bends sharply, "
            f"down to {offset.smallest:.0%} of the thickness",
        )
    for text in solid.notes:
        log.note("thickening", text)
    return solid
