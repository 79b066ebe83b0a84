"""Competitors made of stripes, as the design is, but along other directions: deaf, turned, of von Mises, straight."""

from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.diffusion import DiffusionTensors, diffusion_modes, diffusion_operator, reference_axes
from dsfab.pattern import ModeFamily, Stripes, vertex_means
from dsfab.pipeline.directions import diffusion_step, load_axes
from dsfab.pipeline.log import Log
from dsfab.preset import FAMILIES, Preset
from dsfab.preset_file import overridden
from dsfab.results import DiffusionResult
from dsfab.study.baselines.matching import striped_structure, widened_structure
from dsfab.study.baselines.task import ComparisonTask, Structure, Variant
from dsfab.surface import Surface
from dsfab.surface.hats import voronoi_mass

MODES = 3
"""Pairs are made of the first so many modes: where modes repeat, one pair would be a lucky draw."""

PAIRS = [(a, b) for a in range(1, MODES + 1) for b in range(1, MODES + 1)]
"""Of the major and of the minor stripes."""

PHASES = (0.0, 0.25, 0.5, 0.75)
"""Periods by which stripes are shifted that have no pairs of modes to choose from."""

TIE = 1e-3
"""Weight of the axes of supports and loads where the surface's own are no clear ones: on a sphere, on a square."""


class BlindStripes(NamedTuple):
    """Stripes that do not hear the stress: a preset with plain widths, the pairs of modes, and what makes the modes."""

    preset: Preset
    pairs: list[tuple[int, int]]
    diffusion: Callable[[], DiffusionResult]


def blind_stripes(task: ComparisonTask) -> BlindStripes:
    """Of plain width and the same frequencies, on modes by r = 1, with the task's share of material."""
    blind = overridden(
        task.on_modes,
        {"diffusion.r": 1.0, "diffusion.modes": MODES, "pattern.width": {"solid_fraction": task.share}},
    )
    diffusion = cache(lambda: diffusion_step(blind, task.surface, task.statics, Log(None)))
    both = blind.pattern.major, blind.pattern.minor
    alike = both[0].stripes == both[1].stripes and both[0].spacing == both[1].spacing
    # without stress both families have the same modes: (1, 2) is (2, 1) where they are striped alike
    wanted = [(a, b) for a, b in PAIRS if not alike or a <= b]
    return BlindStripes(blind, _different(blind, wanted), diffusion)


def isotropic(task: ComparisonTask) -> list[Variant]:
    """`blind_stripes`: all pairs."""
    return blind_variants(task, blind_stripes(task))


def blind_variants(task: ComparisonTask, blind: BlindStripes) -> list[Variant]:
    """Every pair of modes, in the order of `blind.pairs`."""
    return _pairs(task, blind.preset, blind.diffusion, blind.pairs)


def rotated_stripes(task: ComparisonTask) -> list[Variant]:
    """The design's tensors and stripes turned by 45 degrees in the tangent plane: all pairs of modes."""

    @cache
    def diffusion() -> DiffusionResult:
        tensors = turned_tensors(task.surface, task.diffusion.tensors, np.pi / 4)
        axes = load_axes(task.surface, task.statics.load)
        operators = (diffusion_operator(task.surface, D) for D in (tensors.major, tensors.minor))
        major, minor = (diffusion_modes(task.surface, L, MODES, axes) for L in operators)
        return DiffusionResult(tensors, major, minor)

    return _pairs(task, task.on_modes, diffusion, PAIRS)


def von_mises(task: ComparisonTask) -> list[Variant]:
    """Stripes of one family on the von Mises stress, of plain width: the paper's answer to "why not follow that?"."""
    value = as_mode(task.surface, task.statics.answers.stress.largest)
    return [
        Variant(f"phase {phase:g}", partial(_plain, task, {"von Mises": (value, task.frequency[0])}, phase))
        for phase in PHASES
    ]


def grid(task: ComparisonTask) -> list[Variant]:
    """Stripes of plain width, straight along the surface's two principal axes, as many as the design has."""
    centred = task.surface.V - task.surface.V.mean(axis=0)
    fields = {
        name: (scaled_field(task.surface, centred @ axis), frequency)
        for name, axis, frequency in zip(("along", "across"), principal_axes(task), task.frequency, strict=True)
    }
    return [Variant(f"phase {phase:g}", partial(_plain, task, fields, phase)) for phase in PHASES]


def turned_tensors(surface: Surface, tensors: DiffusionTensors, angle: float) -> DiffusionTensors:
    """Tensors turned about the faces' normals by `angle`, radians; what is told of the stresses stays."""
    x, y, z = surface.normals.T
    zero = np.zeros(surface.m)
    across = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    R = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across  # Rodrigues 1840
    major, minor = (R @ D @ R.transpose(0, 2, 1) for D in (tensors.major, tensors.minor))
    return DiffusionTensors(major, minor, tensors.isotropic, tensors.principal)


def as_mode(surface: Surface, face: Floats) -> Floats:
    """(n,) values of faces (m,) at the vertices, `scaled_field` like a mode."""
    return scaled_field(surface, vertex_means(surface, face))


def scaled_field(surface: Surface, value: Floats) -> Floats:
    """(n,) values of vertices (n,) scaled like a mode (see `dsfab.diffusion.Modes`), so that frequencies mean the same:
    mean 0, and area / 4 pi as the integral of the square."""
    mass = voronoi_mass(surface)
    value = value - mass @ value / mass.sum()
    return np.asarray(value * np.sqrt(surface.area / (4 * np.pi) / (mass @ value**2)))


def principal_axes(task: ComparisonTask) -> Floats:
    """(2, 3) unit axes along which the surface is longest; where it is equally long, nearer the loads and supports."""
    surface, load = task.surface, task.statics.load
    mass = voronoi_mass(surface)
    x = surface.V - mass @ surface.V / mass.sum()
    spread = x.T @ (mass[:, None] * x)
    ties = reference_axes(surface, (load.held.astype(float),), (load.force.sum(axis=0),))
    spread += TIE * np.trace(spread) * ties.T @ np.diag([1.0, 0.5, 0.0]) @ ties
    return np.asarray(np.linalg.eigh(spread)[1][:, :0:-1].T)


def _pairs(
    task: ComparisonTask, preset: Preset, diffusion: Callable[[], DiffusionResult], pairs: Iterable[tuple[int, int]]
) -> list[Variant]:
    """A variant for each pair of modes, all on one `diffusion`, which is made when the first is."""
    phases = preset.pattern.major.shift, preset.pattern.minor.shift

    def made(pair: tuple[int, int]) -> Structure:
        return striped_structure(task, preset.settled(pair, phases), diffusion())

    return [Variant(f"modes {a}, {b}", partial(made, (a, b))) for a, b in _different(preset, pairs)]


def _different(preset: Preset, pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pairs that differ in the families that are drawn, the first of each."""
    drawn = [FAMILIES.index(name) for name in preset.pattern.family_names]
    found = {tuple(pair[k] for k in drawn): pair for pair in reversed([*pairs])}
    return [*reversed([*found.values()])]


def _plain(task: ComparisonTask, fields: dict[str, tuple[Floats, float]], phase: float) -> Structure:
    """Stripes of plain width on fields (n,) with a frequency each."""
    preset = overridden(task.on_modes, {"pattern.width": {"solid_fraction": task.share}})
    stripes = [(name, x, Stripes(frequency, phase)) for name, (x, frequency) in fields.items()]
    return widened_structure(task, preset, [ModeFamily.on(task.surface, name, own, x) for name, x, own in stripes])
