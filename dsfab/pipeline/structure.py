"""The first three steps: what is given, how it carries the load, and where material wants to run."""

from types import MappingProxyType

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import CaseResult, DiffusionResult, StaticsResult
from dsfab.diffusion import combined_stress, diffusion_modes, diffusion_operator, diffusion_tensors
from dsfab.errors import SurfaceError
from dsfab.pipeline.answers import answers_step
from dsfab.pipeline.loadings import loadings
from dsfab.pipeline.log import Log
from dsfab.pipeline.notes import note_statics
from dsfab.preset import Preset
from dsfab.statics import bending_stiffness, equilibria, flat_axis, membrane_stiffness, stress
from dsfab.surface import Surface
from dsfab.surface.topology import pieces

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


def check_scale(preset: Preset, surface: Surface, log: Log) -> None:
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
    """All load cases from one factorisation, then their combinations, which are sums."""
    sheet = preset.statics
    check_scale(preset, surface, log)
    if log.progress:
        log.progress("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    acting = loadings(preset, surface)
    solved = [loading for loading in acting if loading.factors is None]
    loads, spreads = [loading.load for loading in solved], [loading.spread for loading in solved]
    plane = flat_axis(surface, *loads) is not None
    elements = sheet.elements.in_plane if plane else sheet.elements
    with log.row("membrane"):
        K = membrane_stiffness(surface, sheet.material, sheet.thickness, sheet.law, elements)
    if elements.bending:
        with log.row("bending"):
            K = K + bending_stiffness(surface, sheet.material, sheet.thickness, elements)
    factor_of = sheet.ask.factor_of(sheet.elements)
    with log.row("statics"):
        sums = [[ld.factors.get(case.name, 0.0) for case in solved] for ld in acting if ld.factors is not None]
        found = equilibria(surface, K, loads, elements, spreads=spreads, sums=sums, factor_of=factor_of)
    with log.row("stress"):
        sigma = [stress(surface, sheet.material, a.u, sheet.law, a.bubbles) for a in found]
    answers = answers_step(sheet, surface, list(zip(acting, found, strict=True)), plane, {elements: K}, factor_of, log)
    results = {
        ld.name: CaseResult(ld.load, e, s, a, ld.factors)
        for ld, e, s, a in zip(acting, found, sigma, answers, strict=True)
    }
    whole = results.pop("", next(iter(results.values())))
    note_statics(surface, results, log)
    return StaticsResult(whole.load, whole.equilibrium, whole.sigma, whole.answers, MappingProxyType(results))


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
