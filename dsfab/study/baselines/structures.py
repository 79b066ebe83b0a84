"""Structures with the mass of a design, to compare with the design."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import NamedTuple, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import PatternError
from dsfab.design.design import Design
from dsfab.design.directions import diffusion_step, load_axes
from dsfab.design.regions_and_loads import permanent_loads
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.design.stripe_pattern import WidthSearch, drawable_families, kept_regions, solved_layers, tidy_of
from dsfab.diffusion import DiffusionTensors, diffusion_modes, diffusion_operator, reference_axes
from dsfab.pattern import (
    JUMP,
    DrawableFamily,
    Layer,
    ModeFamily,
    Stripes,
    face_points,
    frequency_for,
    material_points,
    vertex_means,
)
from dsfab.preset.file import with_overrides
from dsfab.preset.model import FAMILIES, Family, Preset
from dsfab.results import DiffusionResult, EvenStripes, Log, PatternResult, StaticsResult, StressedSurface
from dsfab.slicing import Sheet, material_area
from dsfab.statics import flat_axis
from dsfab.study.verdict import whole_sheet
from dsfab.surface import LoadCase, Surface, pieces
from dsfab.surface.fields import voronoi_mass


@dataclass(frozen=True, eq=False)
class ComparisonTask:
    """Data of a design for making other structures of the same mass.
    preset    : preset with the modes and phases of the design.    area : area of the material, m2.
    frequency : factors on the diffusion modes that give the stripe patterns of the major and the minor family.
    even      : the design's evenly spaced stripes; None if its stripes are level lines of modes."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    frequency: tuple[float, float]
    area: float
    even: EvenStripes | None = None

    @classmethod
    def from_design(cls, design: Design, area: float) -> Self:
        """Return the data of a design for making structures with the material area `area`, m2."""
        pattern = design.pattern
        preset = pattern.preset_with_choices(design.preset)
        frequency = pattern.frequency
        if pattern.even:
            families = preset.pattern.major, preset.pattern.minor
            modes = design.diffusion.major, design.diffusion.minor
            spacings = [family.distance(design.surface.area, design.surface.mean_edge) for family in families]
            pairs = zip(modes, spacings, strict=True)
            major, minor = (frequency_for(design.surface, family.mode(1), spacing) for family, spacing in pairs)
            frequency = major, minor
        return cls(preset, design.surface, design.statics, design.diffusion, frequency, area, pattern.even)

    @cached_property
    def on_modes(self) -> Preset:
        """The preset, changed so that stripes are level lines of diffusion modes."""
        if self.even is None:
            return self.preset
        pattern, surface = self.preset.pattern, self.surface

        def with_spacing(family: Family) -> Family:
            spacing = family.distance(surface.area, surface.mean_edge)
            return family.model_copy(update={"spacing": spacing, "frequency": 0.0})

        families = {"major": with_spacing(pattern.major), "minor": with_spacing(pattern.minor)}
        modes = {"method": "modes", "guide": (), "rotate": 0.0, "forces": "uncut", **families}
        return self.preset.model_copy(update={"pattern": pattern.model_copy(update=modes)})

    @property
    def stressed_surface(self) -> StressedSurface:
        """Surface, statics and diffusion of the design."""
        return StressedSurface(self.surface, self.statics, self.diffusion)

    @property
    def share(self) -> float:
        """Material area divided by the area of the uncut surface."""
        return self.area / self.surface.area

    @property
    def loads(self) -> dict[str, LoadCase]:
        """Load cases of the uncut surface whose stress determines the pattern, by name."""
        return self.statics.loads(self.preset.followed_weights)

    @property
    def all_loads(self) -> dict[str, LoadCase]:
        """Loads of every load case and load combination, by name."""
        return {name: case.load for name, case in self.statics.cases.items()}

    @cached_property
    def is_plane(self) -> bool:
        """True if the sheet is flat and its loads lie in its plane."""
        return flat_axis(self.surface, *self.all_loads.values()) is not None

    @cached_property
    def permanent(self) -> dict[str, LoadCase]:
        """Permanent loads by name; their mass vibrates with the sheet."""
        return permanent_loads(self.preset, self.surface, next(iter(self.loads.values())))

    def loads_on(self, structure: "Structure", every: bool = False) -> dict[str, LoadCase]:
        """Return `loads`, or `all_loads` if `every`, with the self-weight of a sheet as thick as `structure`."""
        share = structure.thickness / self.preset.statics.thickness
        uncut_loads = self.all_loads if every else self.loads
        return {name: load.of_thickness(self.surface, share) for name, load in uncut_loads.items()}

    @cached_property
    def kept_layers(self) -> Sequence[Layer]:
        """Layers of a pattern that define the kept regions. These regions are material in every pattern."""
        return kept_regions(self.preset, self.surface, self.statics.load, self.even)

    @property
    def kept_faces(self) -> Bools:
        """Mask (m,) of the faces whose centre lies in a kept region."""
        return np.asarray(material_points(self.surface, self.kept_layers, face_points(1))[:, 0])


@dataclass(frozen=True, eq=False)
class Structure:
    """A design's sheet, or another structure to compare.
    cells  : mesh of the cut surface, both material and void.    names : names of the fields that define the cut.
    sheet  : material without loose pieces.       pieces : number of pieces of `sheet`.      thickness : metres."""

    cells: Sheet
    names: tuple[str, ...]
    sheet: Sheet
    pieces: int
    thickness: float

    @classmethod
    def uncut(cls, surface: Surface, thickness: float) -> Self:
        """Return the uncut surface as a structure."""
        sheet = whole_sheet(surface)
        return cls(sheet, ("the sheet",), sheet, pieces(surface.F, surface.edges)[0], thickness)

    @cached_property
    def material(self) -> Sheet:
        """Material of the structure, including loose pieces."""
        return self.cells.subset()

    @property
    def loose(self) -> float:
        """Fraction of the material that is connected to no support."""
        return max(0.0, 1 - self.sheet.surface.area / self.material.surface.area)


@dataclass(frozen=True, eq=False)
class Variant:
    """A variant of a structure that is not made yet. The function `make` makes it, and may raise DsfabError."""

    says: str
    make: Callable[[], Structure]


Baseline = Callable[[ComparisonTask], list[Variant]]  # makes variants of a structure; the stiffest variant is compared


def thinner(task: ComparisonTask) -> list[Variant]:
    """Return the variant "uncut surface with the thickness that gives the design's mass", in a list."""
    return [Variant("", partial(Structure.uncut, task.surface, task.share * task.preset.statics.thickness))]


SAME_MASS = 1e-3  # masses count as equal up to this relative difference
Drawing = Callable[[ComparisonTask, float, float], Sequence[Layer]]
"""Function of (task, share, tolerance). It returns layers that cover the fraction share +- tolerance with material."""


def matched_structure(task: ComparisonTask, drawing: Drawing) -> Structure:
    """Return a structure with the material area `task.area`, m2. Raises PatternError if there is none.
    drawing : function that returns the layers of a pattern for a given fraction of material."""
    try:
        return _structure_of_area(task, drawing)
    except PatternError:
        slicing = task.preset.slicing.model_copy(update={"snap": min(0.01, task.preset.slicing.snap)})
        return _structure_of_area(replace(task, preset=task.preset.model_copy(update={"slicing": slicing})), drawing)


def _structure_of_area(task: ComparisonTask, drawing: Drawing, rounds: int = 6) -> Structure:
    target_share, nearest = task.share, float("inf")
    for _ in range(rounds):
        # the widths may use 30 % of the mass tolerance; bridges and removed pieces need the rest
        layers = drawing(task, target_share, 0.3 * SAME_MASS * task.share)
        structure = sliced_structure(task, layers, improve=False)
        excess = structure.sheet.surface.area / task.area - 1
        if abs(excess) <= SAME_MASS:
            return sliced_structure(task, layers) if task.preset.slicing.improve else structure
        nearest = min(nearest, excess, key=abs)
        target_share -= excess * task.share
        if not 0 < target_share < 1:
            break
    raise PatternError(
        f"the structure falls apart: the mass of its supported part differs from the mass of the design by "
        f"{abs(nearest):.1%} or more"
    )


def sliced_structure(task: ComparisonTask, layers: Sequence[Layer], improve: bool = True) -> Structure:
    """Return the structure that is cut from the surface along the stripes of `layers`, without loose pieces.
    improve : False to leave badly shaped triangles in the mesh."""
    names, fields, levels, widths, _ = zip(*layers, strict=True)
    changes = {"loose": "drop", "improve": improve and task.preset.slicing.improve}
    slicing = task.preset.slicing.model_copy(update=changes)
    preset = task.preset.with_pattern(workshop=False).model_copy(update={"slicing": slicing})
    pattern = PatternResult(names, fields, levels, widths, tidy=tidy_of(preset, task.stressed_surface, layers))
    result = slicing_step(preset, task.surface, task.statics, pattern, Log(None))
    return Structure(result.cells, names, result.sheet, len(result.pieces), preset.statics.thickness)


def area_share(task: ComparisonTask, layers: Sequence[Layer]) -> float:
    """Return the fraction of the surface's area that the layers of a pattern cover with material."""
    fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
    tidy = tidy_of(task.preset, task.stressed_surface, layers)
    return material_area(task.surface, fields, levels, task.preset.slicing.snap, tidy) / task.surface.area


def striped_structure(
    task: ComparisonTask, preset: Preset, diffusion: DiffusionResult, even: EvenStripes | None = None
) -> Structure:
    """Return a structure of area `task.area` with stripes along modes, or with the evenly spaced stripes `even`."""
    radius = preset.pattern.width.widths(np.sqrt(task.surface.area)).radius
    task = replace(task, diffusion=diffusion)
    return widened_structure(task, preset, drawable_families(preset, task.stressed_surface, radius, even=even))


def widened_structure(task: ComparisonTask, preset: Preset, families: Sequence[DrawableFamily]) -> Structure:
    """Return a structure with the given families of stripes, so wide that the material area is `task.area`."""
    task, factor = replace(task, preset=preset), 0.0

    def drawing(task: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
        nonlocal factor
        # for equal masses, the tolerance must be smaller than the preset's
        width = preset.pattern.width.model_copy(update={"solid_fraction": share, "solid_fraction_tolerance": JUMP})
        widened = preset.model_copy(update={"pattern": preset.pattern.model_copy(update={"width": width})})
        search = WidthSearch(lambda layers: area_share(task, layers), tolerance, factor)
        layers, factor = solved_layers(widened, task.surface, task.kept_layers, families, search)
        return layers

    return matched_structure(task, drawing)


MODES = 3  # number of modes of each family that `PAIRS` combines
PAIRS = [(a, b) for a in range(1, MODES + 1) for b in range(1, MODES + 1)]  # numbers of a major and a minor mode
PHASES = (0.0, 0.25, 0.5, 0.75)  # phases of stripes that do not follow modes, in periods


class IsotropicStripes(NamedTuple):
    """Data of stripe patterns that ignore the stress. diffusion : function that computes the modes.
    pairs : numbers of a major and a minor mode for each pattern."""

    preset: Preset
    pairs: list[tuple[int, int]]
    diffusion: Callable[[], DiffusionResult]


def isotropic_stripes(task: ComparisonTask) -> IsotropicStripes:
    """Return the data of stripe patterns that have a constant width and ignore the stress."""
    isotropy = {"diffusion.r": 1.0, "diffusion.modes": MODES, "pattern.width": {"solid_fraction": task.share}}
    blind = with_overrides(task.on_modes, isotropy)
    diffusion = cache(lambda: diffusion_step(blind, task.surface, task.statics, Log(None)))
    families = blind.pattern.major, blind.pattern.minor
    alike = families[0].stripes == families[1].stripes and families[0].spacing == families[1].spacing
    # if the stripes of both families are equal, the pairs of modes (1, 2) and (2, 1) give the same structure
    pairs = [(a, b) for a, b in PAIRS if not alike or a <= b]
    return IsotropicStripes(blind, _distinct_pairs(blind, pairs), diffusion)


def isotropic(task: ComparisonTask) -> list[Variant]:
    """Return a structure with stripes that ignore the stress, for each pair of modes."""
    return isotropic_variants(task, isotropic_stripes(task))


def isotropic_variants(task: ComparisonTask, blind: IsotropicStripes) -> list[Variant]:
    """Return a structure for each pair of modes in `blind`, which describes stripes that ignore the stress."""
    return _pair_variants(task, blind.preset, blind.diffusion, blind.pairs)


def rotated_stripes(task: ComparisonTask) -> list[Variant]:
    """Return structures with stripes from diffusion tensors that are turned by 45 degrees, for each pair of modes."""

    @cache
    def diffusion() -> DiffusionResult:
        tensors = turned_tensors(task.surface, task.diffusion.tensors, np.pi / 4)
        axes = load_axes(task.surface, task.statics.load)
        operators = (diffusion_operator(task.surface, D) for D in (tensors.major, tensors.minor))
        major, minor = (diffusion_modes(task.surface, L, MODES, axes) for L in operators)
        return DiffusionResult(tensors, major, minor)

    return _pair_variants(task, task.on_modes, diffusion, PAIRS)


def von_mises(task: ComparisonTask) -> list[Variant]:
    """Return structures with stripes along level lines of the von Mises stress, for several phases of the stripes."""
    value = mode_like_field(task.surface, task.statics.answers.stress.largest)
    return [
        Variant(f"phase {phase:g}", partial(_plain_stripes, task, {"von Mises": (value, task.frequency[0])}, phase))
        for phase in PHASES
    ]


def grid(task: ComparisonTask) -> list[Variant]:
    """Return structures with straight stripes along the surface's longest directions, for several stripe phases."""
    centred = task.surface.V - task.surface.V.mean(axis=0)
    fields = {
        name: (scaled_field(task.surface, centred @ axis), frequency)
        for name, axis, frequency in zip(("along", "across"), principal_axes(task), task.frequency, strict=True)
    }
    return [Variant(f"phase {phase:g}", partial(_plain_stripes, task, fields, phase)) for phase in PHASES]


def turned_tensors(surface: Surface, tensors: DiffusionTensors, angle: float) -> DiffusionTensors:
    """Return diffusion tensors turned by `angle` (radians) about the normals of the faces."""
    x, y, z = surface.normals.T
    zero = np.zeros(surface.m)
    across = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    R = np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across  # formula of Rodrigues, 1840
    major, minor = (R @ D @ R.transpose(0, 2, 1) for D in (tensors.major, tensors.minor))
    return DiffusionTensors(major, minor, tensors.isotropic, tensors.principal)


def mode_like_field(surface: Surface, face: Floats) -> Floats:
    """Return values (n,) at the vertices from values `face` (m,) of the faces, scaled like a diffusion mode."""
    return scaled_field(surface, vertex_means(surface, face))


def scaled_field(surface: Surface, value: Floats) -> Floats:
    """Shift and scale values (n,) at vertices like a diffusion mode: mean 0, mean square 1 / (4 pi)."""
    mass = voronoi_mass(surface)
    value = value - mass @ value / mass.sum()
    return np.asarray(value * np.sqrt(surface.area / (4 * np.pi) / (mass @ value**2)))


def principal_axes(task: ComparisonTask) -> Floats:
    """Return two unit vectors (2, 3): the two principal axes along which the surface is longest."""
    surface, load = task.surface, task.statics.load
    mass = voronoi_mass(surface)
    x = surface.V - mass @ surface.V / mass.sum()
    spread = x.T @ (mass[:, None] * x)
    ties = reference_axes(surface, (load.supported.astype(float),), (load.force.sum(axis=0),))
    spread += 1e-3 * np.trace(spread) * ties.T @ np.diag([1.0, 0.5, 0.0]) @ ties
    return np.asarray(np.linalg.eigh(spread)[1][:, :0:-1].T)


def _pair_variants(
    task: ComparisonTask, preset: Preset, diffusion: Callable[[], DiffusionResult], pairs: Iterable[tuple[int, int]]
) -> list[Variant]:
    phases = preset.pattern.major.shift, preset.pattern.minor.shift

    def structure_of_pair(pair: tuple[int, int]) -> Structure:
        return striped_structure(task, preset.with_modes(pair, phases), diffusion())

    return [Variant(f"modes {a}, {b}", partial(structure_of_pair, (a, b))) for a, b in _distinct_pairs(preset, pairs)]


def _distinct_pairs(preset: Preset, pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    indices = [FAMILIES.index(name) for name in preset.pattern.family_names]
    pair_by_modes = {tuple(pair[k] for k in indices): pair for pair in reversed([*pairs])}
    return [*reversed([*pair_by_modes.values()])]


def _plain_stripes(task: ComparisonTask, fields: dict[str, tuple[Floats, float]], phase: float) -> Structure:
    preset = with_overrides(task.on_modes, {"pattern.width": {"solid_fraction": task.share}})
    stripes = [(name, x, Stripes(frequency, phase)) for name, (x, frequency) in fields.items()]
    families = [ModeFamily.from_mode(task.surface, name, stripe, x) for name, x, stripe in stripes]
    return widened_structure(task, preset, families)
