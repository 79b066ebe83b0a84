"""`Design`: a preset and everything that was made of it, stage by stage."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.diffusion import DiffusionTensors, Modes, Symmetry
from dsfab.pattern import CornerPhase
from dsfab.preset import Pattern, Preset
from dsfab.slicing import Chart, Sheet, Tidy
from dsfab.statics import Answers, Equilibrium
from dsfab.surface import LoadCase, Surface
from dsfab.surface.corner_field import CornerField
from dsfab.thickening import Solid


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A load case or a combination: its load, its equilibrium and the stress (m, 3, 3), Pa, of the middle surface.

    answers : what else the sheet tells; by other elements than `equilibrium` where these do not answer (see `Ask`).
    factors : of the cases in a combination; None for a case.
    """

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    factors: Mapping[str, float] | None = None


@dataclass(frozen=True, eq=False)
class StaticsResult:
    """Stage 2, on the uncut surface: load, equilibrium, stress (m, 3, 3), Pa, and answers, as in a `CaseResult`.

    These are of all cases together, each once: what is drawn, and all there is with one case. What the pattern follows
    is chosen out of `cases` by the next stage, so that another choice solves nothing again.

    cases : the load cases by name, then the combinations.
    """

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    cases: Mapping[str, CaseResult] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DiffusionResult:
    """Stage 3: tensors, and the modes of both families."""

    tensors: DiffusionTensors
    major: Modes
    minor: Modes


@dataclass(frozen=True, eq=False)
class Steered:
    """How stripes run that follow a person too.

    along  : (m,) squared cosine of the angle between the major stripes and the first principal stress.
    guided : (m,) what guides weigh; 1 as much as clear stress.
    told   : what a person should know of it, or ''.
    """

    along: Floats
    guided: Floats
    told: str = ""


@dataclass(frozen=True, eq=False)
class EvenStripes:
    """Where evenly spaced stripes run, whatever their width: the major and the minor ones. A family that is not drawn
    has no phase on any face.

    phases  : with every line that may be drawn.
    wanted  : for each level of halving, the finest first, (m,) the share of each face where its lines are drawn.
    slope   : (n, 2) lines per metre of the phases.    density : (n, 2) the same of those that are drawn.
    first   : the family whose finer lines are drawn before those of the other.
    chart   : the surface divided where lines end, with both phases: for pictures and measures.
    symmetry : the mirrors and turns that they have; None without any.
    steered  : how they run elsewhere than along the stress; None where they do not.
    """

    phases: tuple[CornerPhase, CornerPhase]
    wanted: tuple[tuple[Floats, ...], tuple[Floats, ...]]
    slope: Floats
    density: Floats
    first: int
    chart: Chart
    symmetry: Symmetry | None = None
    steered: Steered | None = None


class Candidate(NamedTuple):
    """Modes and phases of the major and of the minor stripes, tried for those that are `auto`.

    compliance : joules on its own cut mesh; infinite when refused.
    over_uncut : the same over that of the uncut sheet.
    kept       : share of the surface that is material, loose pieces included.
    whole      : share of the material that hangs together in the largest piece that reaches a support.
    pieces     : how many pieces of material there are.
    refused    : why it cannot be chosen, or ''.
    """

    mode: tuple[int, int]
    phase: tuple[float, float]
    compliance: float = float("inf")
    over_uncut: float = float("inf")
    kept: float = 0.0
    whole: float = 0.0
    pieces: int = 0
    refused: str = ""


@dataclass(frozen=True, eq=False)
class Choice:
    """The candidates for modes and phases that are `auto`, best first: the first one is taken."""

    candidates: tuple[Candidate, ...]

    @property
    def mode(self) -> tuple[int, int]:
        """Of the major and of the minor stripes."""
        return self.candidates[0].mode

    @property
    def phase(self) -> tuple[float, float]:
        """Of the major and of the minor stripes."""
        return self.candidates[0].phase


@dataclass(frozen=True, eq=False)
class PatternResult:
    """Stage 4: by name, linear fields and the values to cut each at (see `dsfab.slicing.cut`); of one family, where
    only that is drawn.

    fields      : (n,) each, an odd number of levels lies below material; (n, 2) for stripes of varying width; evenly
                  spaced ones at corners, a family in several: its coarse lines, then those between them.
    half_widths : (n,) each: material is |z - k| < d, k integer, for the families; inf for the others. z is frequency x
                  + phase on modes, and the phase of the lines that are drawn on even stripes.
    factor      : what the widths were multiplied with to reach pattern.width.solid_fraction; 1 without it.
    frequency   : of the major and of the minor stripes, as drawn: what `spacing` became, where it was asked.
    mode, phase : of both, as drawn: what `auto` became, where it was asked.
    choice      : what was tried for that; None where nothing is `auto`.
    even        : where evenly spaced stripes run; None for stripes on modes.
    asked       : [pattern] with what `auto` became; None where nothing was.
    tidy        : what the cut takes off where stripes lead nowhere; None takes off nothing.
    """

    names: tuple[str, ...]
    fields: tuple[Floats | CornerField, ...]
    levels: tuple[Floats, ...]
    half_widths: tuple[Floats, ...] = ()
    factor: float = 1.0
    frequency: tuple[float, float] = (1.0, 1.0)
    mode: tuple[int, int] = (1, 1)
    phase: tuple[float, float] = (0.0, 0.0)
    choice: Choice | None = None
    even: EvenStripes | None = None
    tidy: Tidy | None = None
    asked: Pattern | None = None

    def half_width(self, family: str) -> Floats:
        """(n,) half-widths of a family, in periods; 0 where it is not drawn."""
        drawn = dict(zip(self.names, self.half_widths, strict=True))
        return drawn[family] if family in drawn else np.zeros_like(self.half_widths[0])


class Piece(NamedTuple):
    """A connected part of the sheet: its area, m2, and whether it reaches a support and carries a concentrated load."""

    area: float
    held: bool
    loaded: bool


@dataclass(frozen=True, eq=False)
class SlicingResult:
    """Stage 5: all cells, the sheet kept of them, its pieces (largest first), and how many pinches were cured."""

    cells: Sheet
    sheet: Sheet
    pieces: tuple[Piece, ...]
    pinches: int


class Note(NamedTuple):
    """Something the user should know, and the stage that found it."""

    stage: str
    text: str


def settled(preset: Preset, pattern: PatternResult) -> Preset:
    """A preset with what `auto` became in its pattern."""
    return preset.with_pattern(**dict(pattern.asked)) if pattern.asked else preset


class Shown:
    """What a notebook shows as a picture. Drawing lives above this part, so the facade, which knows where each public
    name lives, is asked for it by name."""

    def _repr_png_(self) -> bytes | None:
        """PNG, or None where nothing can be drawn."""
        import dsfab

        return dsfab.inline_picture(self)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Draft(Shown):
    """A preset and what was made of it before anything is cut: enough to draw it (see `dsfab.pipeline.draft`)."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    pattern: PatternResult
    seconds: Mapping[str, float]
    notes: tuple[Note, ...]

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the surface."""
        return self.statics.load


@dataclass(frozen=True, eq=False)
class Design(Shown):
    """A preset and everything that was made of it. Frozen; `revise` makes the next one."""

    preset: Preset
    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult
    pattern: PatternResult
    slicing: SlicingResult
    solid: Solid
    seconds: Mapping[str, float]
    notes: tuple[Note, ...]

    @property
    def settled(self) -> Preset:
        """The preset with what was chosen: it makes the same design without a search."""
        return settled(self.preset, self.pattern)

    @property
    def sheet(self) -> Sheet:
        """The sheet that is kept."""
        return self.slicing.sheet

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the uncut surface."""
        return self.statics.load

    @property
    def mass(self) -> float:
        """Mass of the solid, kg."""
        return self.solid.volume * self.preset.statics.density
