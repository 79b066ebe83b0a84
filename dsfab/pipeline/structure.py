"""The first three steps: what is given, how it carries the load, and where material wants to run."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import DiffusionResult, StaticsResult
from dsfab.diffusion import (
    CLEAR,
    diffusion_modes,
    diffusion_operator,
    diffusion_tensors,
    reference_axes,
    symmetry_of,
)
from dsfab.errors import SurfaceError
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.statics import bending_stiffness, equilibrium, flat_axis, membrane_stiffness, spread_load, stress
from dsfab.surface import LoadCase, Surface
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


def _axes(surface: Surface, load: LoadCase) -> Floats:
    """What signs and bases of modes look at: the loads and the supports, and so they turn with the design."""
    sizes = np.linalg.norm(load.force, axis=1)
    density = sizes / np.where(surface.vertex_areas > 0, surface.vertex_areas, np.inf)
    resultant = load.force.sum(axis=0)
    clear = np.linalg.norm(resultant) > CLEAR * sizes.sum()
    return reference_axes(surface, (density, load.held.astype(float)), (resultant,) if clear else ())


def diffusion_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> DiffusionResult:
    ask = preset.diffusion
    if log.progress:
        log.progress("diffusion", f"computing {ask.modes} modes of both families")
    with log.row("diffusion"):
        symmetry = symmetry_of(surface, ask.symmetry, statics.load) if ask.symmetry else None
        sigma = symmetry.stress(statics.sigma) if symmetry else statics.sigma
        tensors = diffusion_tensors(surface, sigma, ask.r, ask.gamma, ask.labelling, ask.isotropy)
        L_major, L_minor = (diffusion_operator(surface, D) for D in (tensors.major, tensors.minor))
    with log.row("modes"):
        axes = _axes(surface, statics.load)
        major, minor = (diffusion_modes(surface, L, ask.modes, axes, symmetry) for L in (L_major, L_minor))
    if symmetry:
        off = max(symmetry.asymmetry(surface, x) for modes in (major, minor) for x in modes.X.T)
        log.note(
            "diffusion",
            f"modes are the same at {symmetry.order} images ({', '.join(ask.symmetry)}), to {off:.1g} of their size "
            "on this mesh",
        )
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
