"""Competitors of a given mass: a thinner sheet, and stripes along other directions."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import PatternError
from dsfab.design.design import Design
from dsfab.design.directions import diffusion_step, load_axes
from dsfab.design.kept_material import kept_regions, tidy_of
from dsfab.design.log import Log
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.design.stripe_pattern import WidthSearch, solved_layers, striped_families
from dsfab.diffusion import DiffusionTensors, diffusion_modes, diffusion_operator, reference_axes
from dsfab.pattern import (
    JUMP,
    Drawable,
    Layer,
    ModeFamily,
    Stripes,
    face_points,
    frequency_for,
    material_points,
    vertex_means,
)
from dsfab.preset.file import overridden
from dsfab.preset.model import FAMILIES, Family, Preset
from dsfab.results import DiffusionResult, EvenStripes, PatternResult, StaticsResult, StressedSurface
from dsfab.slicing import Sheet, material_area
from dsfab.statics import flat_axis
from dsfab.surface import LoadCase, Surface, pieces
from dsfab.surface.fields import voronoi_mass


@dataclass(frozen=True, eq=False)
class ComparisonTask:
    """A preset with its modes and phases settled, what was made of it before the pattern, and the area to be used, m2.

    frequency : of the major and of the minor stripes, as the design draws them; where they are evenly spaced, that at
                which stripes on the first mode are as far apart in the mean.
    even      : where evenly spaced stripes of the design run; None for stripes on modes.
    """

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    frequency: tuple[float, float]
    area: float
    even: EvenStripes | None = None

    @classmethod
    def of(cls, made: Design, area: float) -> Self:
        """What the competitors of a design share."""
        pattern = made.pattern
        preset = pattern.settled(made.preset)
        frequency = pattern.frequency
        if pattern.even:
            asked, modes = (preset.pattern.major, preset.pattern.minor), (made.diffusion.major, made.diffusion.minor)
            spacings = [family.distance(made.surface.area, made.surface.mean_edge) for family in asked]
            pairs = zip(modes, spacings, strict=True)
            major, minor = (frequency_for(made.surface, family.mode(1), spacing) for family, spacing in pairs)
            frequency = major, minor
        return cls(preset, made.surface, made.statics, made.diffusion, frequency, area, pattern.even)

    @cached_property
    def on_modes(self) -> Preset:
        """The preset with stripes on modes, in the mean as far apart as the design's."""
        if self.even is None:
            return self.preset
        ask, surface = self.preset.pattern, self.surface

        def apart(family: Family) -> Family:
            spacing = family.distance(surface.area, surface.mean_edge)
            return family.model_copy(update={"spacing": spacing, "frequency": 0.0})

        modes = {
            "method": "modes",
            "guide": (),
            "rotate": 0.0,
            "forces": "uncut",
            "major": apart(ask.major),
            "minor": apart(ask.minor),
        }
        return self.preset.model_copy(update={"pattern": ask.model_copy(update=modes)})

    @property
    def stressed(self) -> StressedSurface:
        """What its patterns are drawn on."""
        return StressedSurface(self.surface, self.statics, self.diffusion)

    @property
    def share(self) -> float:
        """The area over that of the surface."""
        return self.area / self.surface.area

    @property
    def loads(self) -> dict[str, LoadCase]:
        """The loads that the pattern follows, on the uncut surface."""
        return self.statics.loads(self.preset.followed)

    @property
    def all_loads(self) -> dict[str, LoadCase]:
        """Every case and combination, on the uncut surface."""
        return {name: case.load for name, case in self.statics.cases.items()}

    @cached_property
    def is_plane(self) -> bool:
        """Whether sheets of this surface are loaded in their own plane, and solved there."""
        return flat_axis(self.surface, *self.all_loads.values()) is not None

    def loads_on(self, structure: "Structure", every: bool = False) -> dict[str, LoadCase]:
        """`loads`, or `all_loads`, on the uncut surface of a sheet as thick as a structure, which weighs as much."""
        share = structure.thickness / self.preset.statics.thickness
        given = self.all_loads if every else self.loads
        return {name: load.of_thickness(self.surface, share) for name, load in given.items()}

    @cached_property
    def kept(self) -> Sequence[Layer]:
        """What every competitor that is cut keeps: the discs around loads and supports, and the rim."""
        return kept_regions(self.preset, self.surface, self.statics.load, self.even)

    @property
    def kept_faces(self) -> Bools:
        """(m,) whether the middle of a face is in what is kept."""
        return np.asarray(material_points(self.surface, self.kept, face_points(1))[:, 0])


@dataclass(frozen=True, eq=False)
class Structure:
    """A sheet to be judged.

    cells  : all cells, material and void.        names : of the fields that made them material, see `cut`.
    sheet  : what is built, without the pieces that reach no support.       pieces : of it.      thickness : metres.
    """

    cells: Sheet
    names: tuple[str, ...]
    sheet: Sheet
    pieces: int
    thickness: float

    @classmethod
    def uncut(cls, surface: Surface, thickness: float) -> Self:
        """The whole surface."""
        every = np.arange(surface.m)
        whole = Sheet(surface, every, np.zeros_like(every), csr_array(eye_array(surface.n)))
        return cls(whole, ("the sheet",), whole, pieces(surface.F, surface.edges)[0], thickness)

    @cached_property
    def drawn(self) -> Sheet:
        """All material, the loose pieces included."""
        return self.cells.kept()

    @property
    def loose(self) -> float:
        """Share of the drawn material that reaches no support and is left out."""
        return max(0.0, 1 - self.sheet.surface.area / self.drawn.surface.area)


@dataclass(frozen=True, eq=False)
class Variant:
    """One of several structures that a competitor may be, such as "modes 1, 2"; `make` may raise DsfabError."""

    says: str
    make: Callable[[], Structure]


Baseline = Callable[[ComparisonTask], list[Variant]]
"""A way to spend the material of a task. Of several variants the stiffest competes."""


def thinner(task: ComparisonTask) -> list[Variant]:
    """The whole surface, everywhere as thin as the design is light."""
    thickness = task.share * task.preset.statics.thickness
    return [Variant("", partial(Structure.uncut, task.surface, thickness))]


SAME_MASS = 1e-3
"""Largest difference in mass, as a share."""

DRAWN = 0.3
"""Share of that for the widths; the rest is for pieces that are dropped and point contacts that are joined."""

ROUNDS = 6
"""How often more is asked for to make up for what is dropped."""

FINE = 0.01
"""Snap fraction of a second try: values that are snapped to a level make the area jump, on coarse meshes by more."""

Drawing = Callable[[ComparisonTask, float, float], Sequence[Layer]]
"""(task, share of the surface, tolerance) -> what to cut, with that share of material."""


def matched_structure(task: ComparisonTask, drawing: Drawing) -> Structure:
    """The structure whose sheet, without pieces that reach no support, has the area of the task.

    Where loose pieces are dropped, more is drawn, so that what carries has the same mass.

    Raises PatternError where the area cannot be met.
    """
    try:
        return _matched(task, drawing)
    except PatternError:
        slicing = task.preset.slicing.model_copy(update={"snap": min(FINE, task.preset.slicing.snap)})
        return _matched(replace(task, preset=task.preset.model_copy(update={"slicing": slicing})), drawing)


def _matched(task: ComparisonTask, drawing: Drawing) -> Structure:
    ask, nearest = task.share, float("inf")
    for _ in range(ROUNDS):
        made = sliced_structure(task, drawing(task, ask, DRAWN * SAME_MASS * task.share))
        off = made.sheet.surface.area / task.area - 1
        if abs(off) <= SAME_MASS:
            return made
        nearest = min(nearest, off, key=abs)
        ask -= off * task.share
        if not 0 < ask < 1:
            break
    raise PatternError(f"falls apart: without its loose pieces its mass is {abs(nearest):.1%} off at the nearest")


def sliced_structure(task: ComparisonTask, layers: Sequence[Layer]) -> Structure:
    """Layers cut as the preset cuts, without the pieces that reach no support; nothing is added to the mass that they
    are drawn with."""
    names, fields, levels, widths, _ = zip(*layers, strict=True)
    slicing = task.preset.slicing.model_copy(update={"loose": "drop"})
    preset = task.preset.with_pattern(workshop=False).model_copy(update={"slicing": slicing})
    tidy = tidy_of(preset, task.stressed, layers)
    pattern = PatternResult(names, fields, levels, widths, tidy=tidy)
    made = slicing_step(preset, task.surface, task.statics, pattern, Log(None))
    return Structure(made.cells, names, made.sheet, len(made.pieces), preset.statics.thickness)


def area_share(task: ComparisonTask, layers: Sequence[Layer]) -> float:
    """The share of the surface that layers make material."""
    fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
    tidy = tidy_of(task.preset, task.stressed, layers)
    return material_area(task.surface, fields, levels, task.preset.slicing.snap, tidy) / task.surface.area


def striped_structure(
    task: ComparisonTask, preset: Preset, diffusion: DiffusionResult, even: EvenStripes | None = None
) -> Structure:
    """Both families of stripes of a preset, as wide as the area of the task asks: on the modes of `diffusion`, or
    evenly spaced."""
    radius = preset.pattern.width.widths(np.sqrt(task.surface.area)).radius
    task = replace(task, diffusion=diffusion)
    return widened_structure(task, preset, striped_families(preset, task.stressed, radius, even=even))


def widened_structure(task: ComparisonTask, preset: Preset, families: Sequence[Drawable]) -> Structure:
    """Families of stripes by the width rule of a preset, as wide as the area of the task asks.

    What leads nowhere is taken off if that preset asks for it, and not since the design is tidied: stripes that do not
    follow its stress all go astray of it.
    """
    task, factor = replace(task, preset=preset), 0.0

    def drawing(task: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
        nonlocal factor
        # what a preset allows its own share is not allowed here: masses are compared below
        update = {"solid_fraction": share, "solid_fraction_tolerance": JUMP}
        width = preset.pattern.width.model_copy(update=update)
        asked = preset.model_copy(update={"pattern": preset.pattern.model_copy(update={"width": width})})
        search = WidthSearch(lambda layers: area_share(task, layers), tolerance, factor)
        layers, factor = solved_layers(asked, task.surface, task.kept, families, search)
        return layers

    return matched_structure(task, drawing)


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
