"""The order of the stages: `run` makes a `Design` of a preset, `revise` remakes it from the first changed section."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from dsfab.arrays import Ints, first
from dsfab.design import Design, DiffusionResult, Draft, Note, PatternResult, Piece, SlicingResult, StaticsResult
from dsfab.diffusion import diffusion_modes, diffusion_operator, diffusion_tensors
from dsfab.errors import PatternError, SolidError, SurfaceError
from dsfab.pattern import (
    Family,
    Layer,
    Widths,
    distance_to_boundary,
    distance_to_vertices,
    mean_duty_factor,
    relative_stresses,
    solved_factor,
)
from dsfab.preset import STAGES, Preset
from dsfab.slicing import Sheet, cut, material_area, resolve_pinches
from dsfab.statics import bending_stiffness, equilibrium, flat_axis, membrane_stiffness, spread_load, stress
from dsfab.surface import LoadCase, Surface
from dsfab.surface.topology import pieces
from dsfab.thickening import Solid, offsets, thicken
from dsfab.units import GRAVITY

Progress = Callable[[str, str], None]
"""Called with a stage and what it is about to do."""

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes", "slicing", "thickening")
"""Rows of the timing table that a run fills: those of the paper's Table 2, then the stages beyond the paper."""

ON_SIMPLEX = 1 - 1e-9
"""A carried 0/1 field of at least this value marks a point that lies between marked vertices only."""

SHARE_TOLERANCE = 4e-4
"""How closely pattern.width.solid_fraction is reached, as a share of the surface."""

SHARE_SNAP = 0.05
"""Snap fraction of the cuts that measure it: the default of slicing.snap, for no stage depends on a later section."""

PLAUSIBLE = (3.0, 1e5)
"""A surface's size over its thickness must lie between these."""

USUAL = (10.0, 5e3)
"""Outside of these the user is told."""

CELLS_PER_ROOT_R = 3.2
"""Cells across a surface that keep the first eigenvalues within 10 % at anisotropy r: 32 at r = 100 (measured)."""


@dataclass
class _Log:
    """What a run tells besides its results."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, doing: str) -> Iterator[None]:
        if self.progress:
            self.progress(name, doing)
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start

    @contextmanager
    def row(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def note(self, stage: str, text: str) -> None:
        self.notes.append(Note(stage, text))


def run(preset: Preset, progress: Progress | None = None) -> Design:
    """Make the design of a preset.

    Raises DsfabError, of the stage that refuses, when it cannot be built.
    """
    return _make(preset, _Log(progress), None, "surface")


def revise(design: Design, preset: Preset, progress: Progress | None = None) -> Design:
    """The design of `preset`, with every stage of `design` before the first section that differs.

    A change of [pattern] solves nothing again; `gamma` and `r` restart at diffusion, since statics are linear.
    """
    start = preset.first_difference(design.preset) or "export"
    return _make(preset, _Log(progress), design, start)


def draft(preset: Preset, progress: Progress | None = None, old: Draft | Design | None = None) -> Draft:
    """The stages of a preset up to its pattern, with those of `old` before the first section that differs.

    Raises DsfabError, of the stage that refuses.
    """
    start = "surface" if old is None else preset.first_difference(old.preset) or "export"
    return _drafted(preset, _Log(progress), old, start)


Made = TypeVar("Made", bound=Draft | Design)


def _reused(stage: str, log: _Log, old: Made | None, start: str) -> Made | None:
    """What was made before, if this stage's result is still good."""
    if old is None or STAGES.index(stage) >= STAGES.index(start):
        return None
    log.seconds.update({row: old.seconds[row] for row in ROWS[stage] if row in old.seconds})
    log.notes.extend(note for note in old.notes if note.stage == stage)
    return old


def _drafted(preset: Preset, log: _Log, old: Draft | Design | None, start: str) -> Draft:
    surface = was.surface if (was := _reused("surface", log, old, start)) else _surface(preset, log)
    statics = was.statics if (was := _reused("statics", log, old, start)) else _statics(preset, surface, log)
    was = _reused("diffusion", log, old, start)
    diffusion = was.diffusion if was else _diffusion(preset, surface, statics, log)
    was = _reused("pattern", log, old, start)
    pattern = was.pattern if was else _pattern(preset, surface, statics, diffusion, log)
    return Draft(preset, surface, statics, diffusion, pattern, MappingProxyType(log.seconds), tuple(log.notes))


def _make(preset: Preset, log: _Log, old: Design | None, start: str) -> Design:
    made = _drafted(preset, log, old, start)
    surface, statics, pattern = made.surface, made.statics, made.pattern
    was = _reused("slicing", log, old, start)
    slicing = was.slicing if was else _slicing(preset, surface, statics, pattern, log)
    was = _reused("thickening", log, old, start)
    solid = was.solid if was else _thickening(preset, surface, slicing, log)
    seconds = MappingProxyType(log.seconds)
    return Design(preset, surface, statics, made.diffusion, pattern, slicing, solid, seconds, tuple(log.notes))


ROWS = {
    "surface": ("surface",),
    "statics": ("membrane", "bending", "statics", "stress"),
    "diffusion": ("diffusion", "modes"),
    "pattern": ("pattern",),
    "slicing": ("slicing",),
    "thickening": ("thickening",),
}
"""The rows of the timing table that each stage fills."""


def _surface(preset: Preset, log: _Log) -> Surface:
    with log.stage("surface", "reading the mesh" if hasattr(preset.surface, "file") else "making the shape"):
        surface = preset.surface.build()
        count = pieces(surface.F, surface.edges)[0]
    if count > 1:
        log.note("surface", f"the surface has {count} separate pieces; each needs its own supports")
    return surface


def _check_scale(preset: Preset, surface: Surface, log: _Log) -> None:
    """Swapped units show in the ratio of size and thickness: refuse what no sheet has, and mention what few have."""
    thickness = preset.statics.thickness
    slenderness = surface.size / thickness
    told = f"the surface is {surface.size:.3g} m large and the sheet {thickness:.3g} m thick"
    if not PLAUSIBLE[0] < slenderness < PLAUSIBLE[1]:
        raise SurfaceError(
            f"{told}: that is no sheet; check surface.unit (mm, m, in ...) and statics.thickness (metres)"
        )
    if not USUAL[0] < slenderness < USUAL[1]:
        log.note(
            "statics", f"{told}: thin-sheet statics hold for ratios of about 20 to 2000; check units and thickness"
        )


def _statics(preset: Preset, surface: Surface, log: _Log) -> StaticsResult:
    given, sheet = preset.surface, preset.statics
    _check_scale(preset, surface, log)
    if log.progress:
        log.progress("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    weight = sheet.density * sheet.thickness * GRAVITY
    load = LoadCase.build(surface, given.support, given.load, weight)
    elements = sheet.elements if flat_axis(surface, load) is None else sheet.elements.in_plane
    with log.row("membrane"):
        K = membrane_stiffness(surface, sheet.material, sheet.thickness, sheet.law, elements)
    if elements.bending:
        with log.row("bending"):
            K = K + bending_stiffness(surface, sheet.material, sheet.thickness, elements)
    with log.row("statics"):
        answer = equilibrium(surface, K, load, elements, spread=spread_load(surface, given.load, weight))
    with log.row("stress"):
        sigma = stress(surface, sheet.material, answer.u, sheet.law, answer.bubbles)
    if answer.largest_displacement > 0.1 * surface.size:
        log.note(
            "statics",
            f"the sheet would move by {answer.largest_displacement:.3g} m, over a tenth of its size: directions stay "
            "right (statics are linear), but the load is too large or the sheet too thin to be built",
        )
    return StaticsResult(load, answer, sigma)


def _diffusion(preset: Preset, surface: Surface, statics: StaticsResult, log: _Log) -> DiffusionResult:
    ask = preset.diffusion
    if log.progress:
        log.progress("diffusion", f"computing {ask.modes} modes of both families")
    with log.row("diffusion"):
        tensors = diffusion_tensors(surface, statics.sigma, ask.r, ask.gamma, ask.labelling, ask.isotropy)
        L_major, L_minor = (diffusion_operator(surface, D) for D in (tensors.major, tensors.minor))
    with log.row("modes"):
        major = diffusion_modes(surface, L_major, ask.modes)
        minor = diffusion_modes(surface, L_minor, ask.modes)
    edge = np.sqrt(surface.area) / (CELLS_PER_ROOT_R * np.sqrt(ask.r))
    if surface.mean_edge > edge:
        log.note(
            "diffusion",
            f"the mesh is coarse for r = {ask.r:g}: edges of {surface.mean_edge:.3g} m, better under {edge:.3g} m "
            "(surface.refine)",
        )
    if (share := tensors.isotropic @ surface.areas / surface.area) > 0.5:
        log.note("diffusion", f"{share:.0%} of the surface has no clear stress direction; raise gamma or the loads")
    return DiffusionResult(tensors, major, minor)


def _pattern(
    preset: Preset, surface: Surface, statics: StaticsResult, diffusion: DiffusionResult, log: _Log
) -> PatternResult:
    """Kept regions come first: a cell that they make material is not cut again by the stripes."""
    ask = preset.pattern
    with log.stage("pattern", "drawing stripes"):
        kept = _kept_regions(preset, surface, statics.load)
        widths = ask.width.widths(np.sqrt(surface.area))
        families = _families(preset, surface, diffusion, widths.radius)
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
    return PatternResult(names, fields, levels, half_widths, factor)


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
        families.append(Family.on(surface, name, family.stripes, modes.mode(family.mode), along, radius))
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


def _slicing(
    preset: Preset, surface: Surface, statics: StaticsResult, pattern: PatternResult, log: _Log
) -> SlicingResult:
    ask = preset.slicing
    with log.stage("slicing", f"cutting {surface.m:,} triangles"):
        cells = cut(surface, pattern.fields, pattern.levels, ask.snap)
        if not cells.material.any():
            raise PatternError("the pattern leaves no material; lower pattern.major.threshold or raise pattern.keep")
        pinched = resolve_pinches(cells, preset.statics.thickness / 2, ask.pinch)
        sheet = pinched.sheet.kept()
        listed, label = _pieces(sheet, statics.load)
        if ask.loose == "drop" and any(p.held for p in listed) and not all(p.held for p in listed):
            sheet = sheet.kept(np.array([p.held for p in listed])[label])
    _note_slicing(preset, sheet, listed, statics.load, pinched.count, log)
    return SlicingResult(pinched.sheet, sheet, _pieces(sheet, statics.load)[0], pinched.count)


def _pieces(sheet: Sheet, load: LoadCase) -> tuple[tuple[Piece, ...], Ints]:
    """The pieces of a sheet, and the piece of each of its faces."""
    count, label = pieces(sheet.surface.F, sheet.surface.edges)
    area = np.bincount(label, sheet.surface.areas, count)
    marks = []
    for mark in (load.held, load.loaded):
        on = sheet.carry(mark.astype(float)) >= ON_SIMPLEX
        marks.append(np.bincount(label, on[sheet.surface.F].any(axis=1), count) > 0)
    listed = tuple(Piece(float(area[k]), bool(marks[0][k]), bool(marks[1][k])) for k in range(count))
    return listed, label


def _note_slicing(
    preset: Preset, sheet: Sheet, listed: tuple[Piece, ...], load: LoadCase, pinches: int, log: _Log
) -> None:
    loose = [piece for piece in listed if not piece.held]
    if loose:
        area = sum(piece.area for piece in loose)
        done = "dropped" if preset.slicing.loose == "drop" and len(loose) < len(listed) else "kept"
        log.note("slicing", f"{len(loose)} of {len(listed)} pieces reach no support and were {done} ({area:.3g} m2)")
    if pinches:
        log.note("slicing", f"{pinches} point contacts were {'joined' if preset.slicing.pinch == 'join' else 'split'}")
    present = np.asarray(sheet.weights.max(axis=0).todense()).ravel() >= ON_SIMPLEX
    lost = np.flatnonzero(load.loaded & ~present)
    if len(lost):
        log.note(
            "slicing",
            f"{len(lost)} of {load.loaded.sum()} loaded points lie on removed material (vertices {first(lost, 3)}); "
            "set pattern.keep to protect them",
        )


def _thickening(preset: Preset, surface: Surface, slicing: SlicingResult, log: _Log) -> Solid:
    """Offsets are made on the uncut surface, where normals are clean, and carried through the cut."""
    with log.stage("thickening", f"thickening {slicing.sheet.surface.m:,} triangles"):
        offset = offsets(surface, preset.statics.thickness)
        if offset.smallest < preset.thickening.thinnest:
            raise SolidError(
                f"the surface bends so sharply that the sheet would be thinned to {offset.smallest:.0%} of its "
                f"thickness (allowed: {preset.thickening.thinnest:.0%}); make statics.thickness smaller, smooth the "
                "surface, or lower thickening.thinnest"
            )
        solid = thicken(slicing.sheet.surface, slicing.sheet.carry(offset.D))
    if offset.limited:
        log.note(
            "thickening",
            f"{offset.limited} of {surface.n} vertices were thinned where the surface bends sharply, "
            f"down to {offset.smallest:.0%} of the thickness",
        )
    for text in solid.notes:
        log.note("thickening", text)
    return solid
