"""What all competitors share, and what a competitor is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.arrays import Bools
from dsfab.pattern import Layer, face_points, frequency_for, material_points
from dsfab.pipeline.design import Design
from dsfab.pipeline.kept import kept_regions
from dsfab.preset import Family, Preset
from dsfab.results import DiffusionResult, EvenStripes, StaticsResult, StressedSurface
from dsfab.slicing import Sheet
from dsfab.statics import flat_axis
from dsfab.surface import LoadCase, Surface, pieces


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
