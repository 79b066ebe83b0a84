"""The first three steps: what is given, how it carries the load, and where material wants to run."""

from types import MappingProxyType

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import CaseResult, DiffusionResult, StaticsResult
from dsfab.diffusion import combined_stress, diffusion_modes, diffusion_operator, diffusion_tensors
from dsfab.errors import SurfaceError
from dsfab.pipeline.log import Log
from dsfab.pipeline.notes import note_statics
from dsfab.preset import Preset
from dsfab.statics import bending_stiffness, equilibria, flat_axis, membrane_stiffness, spread_load, stress
from dsfab.surface import Surface, load_cases, together
from dsfab.surface.topology import pieces
from dsfab.units import GRAVITY

PLAUSIBLE = (3.0, 1e5)
"""A surface's size over its thickness must lie between these."""

USUAL = (10.0, 5e3)
"""Outside of these the user is told."""

CELLS_PER_ROOT_R = 3.2
"""Cells across a surface that keep the first eigenvalues within 10 % at anisotropy r: 32 at r = 100 (measured)."""


def surface_step(preset: Preset, log: Log) -> Surface:
    with log.stage("surface", "reading the mesh" if hasattr(preset.surface, "file") else "making the shape"):
        surface = preset.surface.build()
        count = pieces(surface.F, surface.edges)[0]
    if count > 1:
        log.note("surface", f"the surface has {count} separate pieces; each needs its own supports")
    return surface


def _check_scale(preset: Preset, surface: Surface, log: Log) -> None:
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


def statics_step(preset: Preset, surface: Surface, log: Log) -> StaticsResult:
    given, sheet = preset.surface, preset.statics
    _check_scale(preset, surface, log)
    if log.progress:
        log.progress("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    weight = sheet.density * sheet.thickness * GRAVITY
    loads = load_cases(surface, given.support, given.load, weight)
    elements = sheet.elements if flat_axis(surface, *loads.values()) is None else sheet.elements.in_plane
    with log.row("membrane"):
        K = membrane_stiffness(surface, sheet.material, sheet.thickness, sheet.law, elements)
    if elements.bending:
        with log.row("bending"):
            K = K + bending_stiffness(surface, sheet.material, sheet.thickness, elements)
    sums = {combination.name: combination.factors for combination in given.combination}
    all_once = [dict.fromkeys(loads, 1.0)] if len(loads) > 1 else []
    table = [*sums.values(), *all_once]
    with log.row("statics"):
        spreads = [spread_load(surface, [ld for ld in given.load if ld.case == name], weight) for name in loads]
        rows = [[factors.get(name, 0.0) for name in loads] for factors in table]
        answers = equilibria(surface, K, [*loads.values()], elements, spreads=spreads, sums=rows)
    with log.row("stress"):
        sigma = [stress(surface, sheet.material, a.u, sheet.law, a.bubbles) for a in answers]
    acting = [*loads.values(), *(together(loads, factors) for factors in table)]
    factors = [*([None] * len(loads)), *table]
    results = [CaseResult(*result) for result in zip(acting, answers, sigma, factors, strict=True)]
    cases = dict(zip((*loads, *sums), results, strict=False))
    note_statics(surface, cases, log)
    whole = results[-1 if all_once else 0]
    return StaticsResult(whole.load, whole.equilibrium, whole.sigma, MappingProxyType(cases))


def _followed(preset: Preset, surface: Surface, statics: StaticsResult) -> Floats:
    """(m, 3, 3) the stress, Pa, that the pattern follows: of one case, or combined of several."""
    sigma = {name: statics.cases[name].sigma for name in preset.followed}
    if not preset.combines:
        return next(iter(sigma.values()))
    return combined_stress(surface, list(sigma.values()), list(preset.followed.values()))


def diffusion_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> DiffusionResult:
    ask = preset.diffusion
    if log.progress:
        log.progress("diffusion", f"computing {ask.modes} modes of both families")
    with log.row("diffusion"):
        tensors = diffusion_tensors(
            surface, _followed(preset, surface, statics), ask.r, ask.gamma, ask.labelling, ask.isotropy
        )
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
