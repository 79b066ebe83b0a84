"""Stage 3: diffusion tensors and modes, and changes of the stripe directions."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import PatternError
from dsfab.design.regions_and_loads import IMAGE_DIFFERENCE
from dsfab.diffusion import (
    CLEAR_MOMENT,
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
from dsfab.pattern import Frames, Guidance, LoopSurroundings, StressDirections
from dsfab.preset.model import Pattern, Preset
from dsfab.results import DiffusionResult, Log, StaticsResult, StripeSteering
from dsfab.surface import LoadCase, Surface, generated_group
from dsfab.surface.orientation import one_sided_pieces


def followed_stress(preset: Preset, surface: Surface, statics: StaticsResult) -> Floats:
    """Return the stress (m, 3, 3), Pa, that the pattern follows on each face."""
    sigma = {name: statics.cases[name].followed_stress for name in preset.followed_weights}
    if not preset.combines:
        return next(iter(sigma.values()))
    return combined_stress(surface, list(sigma.values()), list(preset.followed_weights.values()))


def load_axes(surface: Surface, load: LoadCase) -> Floats:
    """Return orthonormal axes (3, 3), in rows, that depend on the shape, loads and supports of a surface."""
    sizes = np.linalg.norm(load.force, axis=1)
    density = sizes / np.where(surface.vertex_areas > 0, surface.vertex_areas, np.inf)
    resultant = load.force.sum(axis=0)
    clear = np.linalg.norm(resultant) > CLEAR_MOMENT * sizes.sum()
    return reference_axes(surface, (density, load.supported.astype(float)), (resultant,) if clear else ())


def diffusion_step(preset: Preset, surface: Surface, statics: StaticsResult, log: Log) -> DiffusionResult:
    """Return diffusion tensors, and modes of the major and of the minor stripes."""
    options = preset.diffusion
    log.report("diffusion", f"computing {options.modes} modes of major and minor stripes")
    with log.row("diffusion"):
        symmetry, tensors = _tensors(preset, surface, statics)
        operators = [diffusion_operator(surface, D) for D in (tensors.major, tensors.minor)]
    with log.row("modes"):
        axes = load_axes(surface, statics.load)
        major, minor = family_modes(surface, operators, options.modes, axes, symmetry)
    if symmetry:
        asymmetry = max(symmetry.asymmetry(surface, x) for modes in (major, minor) for x in modes.X.T)
        log.note(
            "diffusion",
            f"modes have the symmetries {', '.join(options.symmetry)} ({symmetry.order} symmetric images), with "
            f"a relative error of {asymmetry:.1g} on this mesh",
        )
    # errors are below 10 % if the surface is at least 3.2 sqrt(r) edges wide; r is the anisotropy of the diffusion
    edge = np.sqrt(surface.area) / (3.2 * np.sqrt(options.r))
    if surface.mean_edge > edge:
        log.note(
            "diffusion",
            f"the mesh is too coarse for the anisotropy r = {options.r:g}: edges are {surface.mean_edge:.3g} m long; "
            f"make them shorter than {edge:.3g} m (surface.refine)",
        )
    if (share := float(tensors.isotropic @ surface.areas) / surface.area) > 0.5:
        log.note("diffusion", _unclear_direction_message(share, options.labelling))
    return DiffusionResult(tensors, major, minor)


def _tensors(preset: Preset, surface: Surface, statics: StaticsResult) -> tuple[Symmetry | None, DiffusionTensors]:
    options = preset.diffusion
    loads = statics.loads(preset.followed_weights).values()
    symmetry = symmetry_of(surface, options.symmetry, *loads) if options.symmetry else None
    sigma = followed_stress(preset, surface, statics)
    sigma = symmetry.mean_stress(sigma) if symmetry else sigma
    return symmetry, diffusion_tensors(surface, sigma, options.r, options.gamma, options.labelling, options.isotropy)


def without_modes(preset: Preset, surface: Surface, statics: StaticsResult) -> DiffusionResult:
    """Return diffusion tensors without modes, for evenly spaced stripes."""
    none = Modes(np.zeros(0), np.zeros((surface.n, 0)))
    return DiffusionResult(_tensors(preset, surface, statics)[1], none, none)


def _unclear_direction_message(share: float, labelling: Labelling) -> str:
    alike = "as large" if labelling == "magnitude" else "nearly the same"
    hint = (
        ', and with labelling = "signed", one family follows tension and the other compression'
        if labelling == "magnitude"
        else ""
    )
    return (
        f"{share:.0%} of the surface has no clear stress direction, because the first principal stress is {alike} as "
        f"the second: there stripes take the direction of nearby stripes; with diffusion.isotropy = 0, stripes follow "
        f"even the smallest difference of the stresses{hint}"
    )


@dataclass(frozen=True, eq=False)
class Steering:
    """Changes of stripe directions by the user. turn : angle from the principal stress to the stripes, radians.
    guidance : guides (curves that steer stripes).    symmetry : symmetry of the changed directions, or None.
    told     : note for the user, or ''.    loops : surroundings of supported boundary loops."""

    turn: float
    guidance: tuple[Guidance, ...]
    symmetry: Symmetry | None
    told: str = ""
    loops: tuple[LoopSurroundings, ...] = ()

    def with_loops(self, frames: Frames, stress: StressDirections) -> "Steering":
        """Return a copy with an added guide (curve that steers stripes) around each of the boundary loops `loops`."""
        around = (loop.guidance(frames, stress, self.turn) for loop in self.loops)
        return replace(self, guidance=(*self.guidance, *around), loops=())

    def confidence(self, surface: Surface, stress: Floats) -> Floats:
        """Return how clear the stripe direction of each face is (m,), 0 to 1. stress : (m,) the same without guides."""
        return np.minimum(stress + self.guide_weights(surface), 1.0) if self.guidance else stress

    def guide_weights(self, surface: Surface) -> Floats:
        return np.asarray(sum((guide.weight for guide in self.guidance), np.zeros(surface.n))[surface.F].mean(axis=1))

    def outcome(self, surface: Surface, along: Floats, directions: StressDirections, over: Bools) -> StripeSteering:
        """Return how stripes differ from the stress on each face. along : (n, 3) directions of the major stripes.
        over  : (n,) mask of vertices where major stripes follow the second principal stress."""
        cosines = (np.einsum("mcx,mx->mc", along[surface.F], directions.direction[:, k]) for k in (0, 1))
        first_share, second_share = ((cosine**2).sum(axis=1) for cosine in cosines)
        crossed = over[surface.F].mean(axis=1) > 0.5
        messages = [self.told] * bool(self.told)
        if share := float(surface.areas @ crossed) / surface.area:
            messages.append(
                f"on {share:.0%} of the surface, the directions of major and minor stress change places. There "
                f"members keep their direction and change their family, so that no member ends at the change"
            )
        along_one = first_share / np.maximum(first_share + second_share, np.finfo(float).tiny)
        return StripeSteering(along_one, self.guide_weights(surface), crossed, "; ".join(messages))


def steering(options: Pattern, frames: Frames, symmetry: Symmetry | None, spacing: float) -> Steering:
    """Return the changes of stripe directions that the options of a [pattern] section request.
    symmetry : symmetry of surface, supports and loads.    spacing : distance to which a guide acts by default, metres.
    Raises PatternError for an oblique `rotate` on a one-sided surface, and for a guide without effect."""
    oblique = options.rotate % 90 != 0
    if oblique and one_sided_pieces(frames.surface.F, frames.surface.edges).any():
        raise PatternError(
            f"pattern.rotate = {options.rotate:g} is impossible, because left and right are not defined on a "
            f"one-sided surface, such as a Moebius strip; use 0 or 90"
        )
    guidance = Guidance.from_guides(frames, options.guide, spacing)
    group, message = symmetry, ""
    if symmetry is not None and (oblique or guidance):
        all_images = np.ones(symmetry.order, dtype=bool)
        turned = keeps_orientation(frames.surface, symmetry) if oblique else all_images
        guided = keeps_guides(frames, symmetry, guidance) if guidance else all_images
        group, remaining_order = _subgroup(symmetry, turned & guided)
        causes = [f"rotate = {options.rotate:g}"] * (not turned.all()) + ["guides"] * (not guided.all())
        if causes:
            message = (
                f"surface, supports and loads have {symmetry.order} symmetric images, but the pattern has only "
                f"{remaining_order}, because of {' and '.join(causes)}"
            )
    return Steering(float(np.radians(options.rotate)), guidance, group, message)


def keeps_orientation(surface: Surface, symmetry: Symmetry) -> Bools:
    """Return a mask (g,) of the mirrors and rotations that preserve the sense of rotation on the surface."""
    normal = surface.normals
    agree = [
        np.linalg.det(R) * np.einsum("mi,mi->m", normal @ R.T, normal[face]) > 0
        for R, face in zip(symmetry.R, symmetry.faces, strict=True)
    ]
    return np.array([surface.areas @ faces > 0.9 * surface.area for faces in agree])


def keeps_guides(frames: Frames, symmetry: Symmetry, guidance: tuple[Guidance, ...]) -> Bools:
    """Return a mask (g,) of the mirrors and rotations that map guides (curves that steer stripes) to themselves."""
    area, n = frames.surface.vertex_areas, frames.surface.n
    tensors = [guide.tensors(frames) for guide in guidance]
    total = np.asarray(sum(tensors))
    sizes = [np.linalg.norm(tensor, axis=(1, 2)) for tensor in tensors]
    agree = np.ones(symmetry.order, dtype=bool)
    for k, (R, T) in enumerate(zip(symmetry.R, symmetry.maps, strict=True)):
        image = (T @ total.reshape(n, 9)).reshape(n, 3, 3)
        differences = np.linalg.norm(image - R @ total @ R.T, axis=(1, 2))
        agree[k] = all((area * (size > 0)) @ differences < IMAGE_DIFFERENCE * (area @ size) for size in sizes)
    return agree


def _subgroup(symmetry: Symmetry, selected: Bools) -> tuple[Symmetry | None, int]:
    R = symmetry.R[selected]
    maps = tuple(T for T, is_selected in zip(symmetry.maps, selected, strict=True) if is_selected)
    if len(R) < 2 or len(generated_group(list(R))) != len(R):
        return None, 1
    return Symmetry(R, maps, symmetry.faces[selected]), len(R)
