"""The third step: where material wants to run."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.diffusion import (
    CLEAR,
    DiffusionTensors,
    Labelling,
    Modes,
    Symmetry,
    combined_stress,
    diffusion_operator,
    diffusion_tensors,
    family_modes,
    reference_axes,
    symmetry_of,
)
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.results import DiffusionResult, StaticsResult
from dsfab.surface import LoadCase, Surface

CELLS_PER_ROOT_R = 3.2
"""Cells across a surface that keep the first eigenvalues within 10 % at anisotropy r: 32 at r = 100 (measured)."""


def followed_stress(preset: Preset, surface: Surface, statics: StaticsResult) -> Floats:
    """(m, 3, 3) the stress, Pa, that the pattern follows: of one case, or combined of several."""
    sigma = {name: statics.cases[name].followed for name in preset.followed}
    if not preset.combines:
        return next(iter(sigma.values()))
    return combined_stress(surface, list(sigma.values()), list(preset.followed.values()))


def load_axes(surface: Surface, load: LoadCase) -> Floats:
    """(3, 3) rows, what signs and bases of modes look at: the loads and the supports, and so they turn with the
    design."""
    sizes = np.linalg.norm(load.force, axis=1)
    density = sizes / np.where(surface.vertex_areas > 0, surface.vertex_areas, np.inf)
    resultant = load.force.sum(axis=0)
    clear = np.linalg.norm(resultant) > CLEAR * sizes.sum()
    return reference_axes(surface, (density, load.held.astype(float)), (resultant,) if clear else ())


def diffusion_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> DiffusionResult:
    """The third stage: tensors and modes of both families."""
    ask = preset.diffusion
    if log.progress:
        log.progress("diffusion", f"computing {ask.modes} modes of both families")
    with log.row("diffusion"):
        symmetry, tensors = _tensors(preset, surface, statics)
        operators = [diffusion_operator(surface, D) for D in (tensors.major, tensors.minor)]
    with log.row("modes"):
        axes = load_axes(surface, statics.load)
        major, minor = family_modes(surface, operators, ask.modes, axes, symmetry)
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
    if (share := float(tensors.isotropic @ surface.areas) / surface.area) > 0.5:
        log.note("diffusion", _unclear(share, ask.labelling))
    return DiffusionResult(tensors, major, minor)


def _tensors(preset: Preset, surface: Surface, statics: StaticsResult) -> tuple[Symmetry | None, DiffusionTensors]:
    """Those of [diffusion], and the symmetry that it asks for."""
    ask = preset.diffusion
    loads = statics.loads(preset.followed).values()
    symmetry = symmetry_of(surface, ask.symmetry, *loads) if ask.symmetry else None
    sigma = followed_stress(preset, surface, statics)
    sigma = symmetry.stress(sigma) if symmetry else sigma
    return symmetry, diffusion_tensors(surface, sigma, ask.r, ask.gamma, ask.labelling, ask.isotropy)


def without_modes(preset: Preset, surface: Surface, statics: StaticsResult) -> DiffusionResult:
    """Tensors alone: for who draws evenly spaced stripes at once, and solves for modes later."""
    none = Modes(np.zeros(0), np.zeros((surface.n, 0)))
    return DiffusionResult(_tensors(preset, surface, statics)[1], none, none)


def _unclear(share: float, labelling: Labelling) -> str:
    """What is told where most of the surface has no direction: larger loads would not change that, the stress grows
    alike everywhere."""
    alike = "as large" if labelling == "magnitude" else "nearly the same"
    more = ', or labelling = "signed" where tension and compression are' if labelling == "magnitude" else ""
    return (
        f"{share:.0%} of the surface has no clear stress direction, both principal stresses are {alike} there: stripes "
        f"run as they do around it; diffusion.isotropy = 0 follows the smallest difference{more}"
    )
