"""What each stage of a design makes, as frozen values (see `dsfab.design.Design`)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.diffusion import DiffusionTensors, Modes, Symmetry
from dsfab.pattern import CornerPhase
from dsfab.preset.model import Pattern, Preset
from dsfab.slicing import Chart, Sheet, Tidy
from dsfab.statics import Answers, Equilibrium
from dsfab.surface import LoadCase, Surface
from dsfab.surface.fields import CornerField, DividedField


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A load case or a combination: its load, its equilibrium and the stress (m, 3, 3), Pa, of the middle surface, or
    of the lower side of a flat sheet that only bends.

    sigma   : (m, 3, 3) Pa, the stress of the middle surface, or of the lower side of a flat sheet that only bends.
    answers : what else the sheet tells; by other elements than `equilibrium` where these do not answer (see `Ask`).
    factors : of the cases in a combination; None for a case.
    layered : (m, 3, 3) Pa, the stress of all layers (`layer_stress`), where the pattern follows it; else None.
    """

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    factors: Mapping[str, float] | None = None
    layered: Floats | None = None

    @property
    def followed(self) -> Floats:
        """(m, 3, 3) Pa, what the pattern follows."""
        return self.sigma if self.layered is None else self.layered


@dataclass(frozen=True, eq=False)
class StaticsResult:
    """Stage 2, on the uncut surface: load, equilibrium, stress (m, 3, 3), Pa, and answers, as in a `CaseResult`.

    These are of all cases together, each once: what is drawn, and all there is with one case. What the pattern follows
    is chosen out of `cases` by the next stage, so that another choice solves nothing again.

    cases      : the load cases by name, then the combinations.
    objections : sentences on why it should not be built, the gravest first (see `dsfab.design.buildability`).
    """

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    cases: Mapping[str, CaseResult] = field(default_factory=dict)
    objections: tuple[str, ...] = ()

    def loads(self, names: Iterable[str]) -> dict[str, LoadCase]:
        """The loads of some cases or combinations, by name, in the order asked for."""
        return {name: self.cases[name].load for name in names}


@dataclass(frozen=True, eq=False)
class DiffusionResult:
    """Stage 3: tensors, and the modes of both families."""

    tensors: DiffusionTensors
    major: Modes
    minor: Modes


@dataclass(frozen=True, eq=False)
class Steered:
    """How stripes run that do not follow the stress by name alone.

    along  : (m,) squared cosine of the angle between the major stripes and the first principal stress.
    guided : (m,) what guides weigh; 1 as much as clear stress.
    over   : (m,) faces where the families have changed names: the major stripes run along the second principal stress.
    told   : what a person should know of it, or ''.
    """

    along: Floats
    guided: Floats
    over: Bools
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
    forces   : (m, 2) principal stresses that they follow in place of those of the uncut sheet, Pa; None for these.
    """

    phases: tuple[CornerPhase, CornerPhase]
    wanted: tuple[tuple[Floats, ...], tuple[Floats, ...]]
    slope: Floats
    density: Floats
    first: int
    chart: Chart
    symmetry: Symmetry | None = None
    steered: Steered | None = None
    forces: Floats | None = None


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
class StressedSurface:
    """What a pattern is drawn on: a surface, how it carries its loads, and the modes along its stresses."""

    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult

    @property
    def load(self) -> LoadCase:
        """Supports and loads on it."""
        return self.statics.load


class Attempt(NamedTuple):
    """A method and a width rule, tried where the method is `auto`.

    name       : of both, in plain words.
    compliance : joules on its own cut mesh; infinite when refused.
    over_uncut : the same over that of the uncut sheet.
    kept       : share of the surface that is material, loose pieces included.
    dead_ends, slits : of its members, see `PatternQuality`.
    refused    : why it cannot be taken, or ''.
    """

    name: str
    compliance: float = float("inf")
    over_uncut: float = float("inf")
    kept: float = 0.0
    dead_ends: int = 0
    slits: int = 0
    refused: str = ""

    @property
    def rank(self) -> tuple[bool, bool, bool, float]:
        """The least is the best: that carries its loads, without a dead end, without a slit, the stiffest per share of
        material. Equal to three digits, as mirror images are, the first comes first: rounding errors decide nothing."""
        soft = float("inf") if self.refused else float(f"{self.compliance * self.kept:.3g}")
        return bool(self.refused), self.dead_ends > 0, self.slits > 0, soft


@dataclass(frozen=True, eq=False)
class PatternResult:
    """Stage 4: by name, linear fields and the values to cut each at (see `dsfab.slicing.cutting.cut`); of one
    family, where
    only that is drawn.

    fields      : (n,) each, an odd number of levels lies below material; (n, 2) for stripes of varying width; evenly
                  spaced ones at corners, a family in several: its coarse lines, then those between them; what is
                  kept on parts of faces, where these are divided, and `keep` in two: patches, and points and curves.
    half_widths : (n,) each: material is |z - k| < d, k integer, for the families; inf for the others. z is frequency x
                  + phase on modes, and the phase of the lines that are drawn on even stripes.
    factor      : what the widths were multiplied with to reach pattern.width.solid_fraction; 1 without it.
    frequency   : of the major and of the minor stripes, as drawn: what `spacing` became, where it was asked.
    mode, phase : of both, as drawn: what `auto` became, where it was asked.
    choice      : what was tried for that; None where nothing is `auto`.
    even        : where evenly spaced stripes run; None for stripes on modes.
    asked       : [pattern] with what `auto` became; None where nothing was.
    tidy        : what the cut takes off where stripes lead nowhere; None takes off nothing.
    attempts    : what was tried for a method that is `auto`, best first; empty where it is given.
    """

    names: tuple[str, ...]
    fields: tuple[Floats | CornerField | DividedField, ...]
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
    attempts: tuple[Attempt, ...] = ()

    def half_width(self, family: str) -> Floats:
        """(n,) half-widths of a family, in periods; 0 where it is not drawn."""
        drawn = dict(zip(self.names, self.half_widths, strict=True))
        return drawn[family] if family in drawn else np.zeros_like(self.half_widths[0])

    def settled(self, preset: Preset) -> Preset:
        """The preset with what `auto` became."""
        return preset.with_pattern(**dict(self.asked)) if self.asked else preset


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
