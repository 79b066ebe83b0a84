"""Results of the stages of a design, and the log of a run."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.diffusion import DiffusionTensors, Modes, Symmetry
from dsfab.pattern import CornerPhase
from dsfab.preset.model import Pattern, Preset
from dsfab.slicing import Chart, Sheet, Tidy, TrialCut
from dsfab.statics import Answers, Equilibrium
from dsfab.surface import FileRecord, LoadCase, Surface
from dsfab.surface.fields import CornerField, DividedField


@dataclass(frozen=True, eq=False)
class CaseResult:
    """Load, equilibrium and stress of a load case or a combination.
    sigma   : (m, 3, 3) stress, Pa, of the middle surface; of the lower side for a flat sheet that only bends.
    factors : factors of the cases in a combination; None for a case.
    layered : (m, 3, 3) stress combined from all layers, Pa; None if the stripes follow `sigma`."""

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    factors: Mapping[str, float] | None = None
    layered: Floats | None = None

    @property
    def followed_stress(self) -> Floats:
        """(m, 3, 3) stress that the pattern follows, Pa."""
        return self.sigma if self.layered is None else self.layered


@dataclass(frozen=True, eq=False)
class StaticsResult:
    """Results of stage 2 on the uncut surface, for all cases together.
    sigma      : (m, 3, 3) stress, Pa.    cases : load cases by name, then the combinations.
    objections : reasons against building, in sentences, the most serious first."""

    load: LoadCase
    equilibrium: Equilibrium
    sigma: Floats
    answers: Answers
    cases: Mapping[str, CaseResult] = field(default_factory=dict)
    objections: tuple[str, ...] = ()

    @property
    def combinations(self) -> dict[str, Mapping[str, float]]:
        """Factors of the load cases in each combination, by name of the combination, then by name of the case."""
        return {name: case.factors for name, case in self.cases.items() if case.factors is not None}

    def loads(self, names: Iterable[str]) -> dict[str, LoadCase]:
        """Return the loads of the cases or combinations `names`, by name."""
        return {name: self.cases[name].load for name in names}


@dataclass(frozen=True, eq=False)
class DiffusionResult:
    """Results of stage 3: diffusion tensors, and modes of the major and of the minor stripes."""

    tensors: DiffusionTensors
    major: Modes
    minor: Modes


@dataclass(frozen=True, eq=False)
class StripeSteering:
    """Stripe directions after changes by guide curves or symmetry.
    along  : (m,) squared cosine of the angle between the major stripes and the first principal stress.
    guided : (m,) total weight of the guide curves in each face.
    over   : (m,) True if the major stripes follow the second principal stress.
    told   : sentence for the user on these changes, or ''."""

    along: Floats
    guided: Floats
    over: Bools
    told: str = ""


@dataclass(frozen=True, eq=False)
class EvenStripes:
    """Lines of evenly spaced stripes, major (family 0) and minor (family 1). Halving removes every second line.
    phases  : for each family, a phase that is a whole number on every line before halving.
    wanted  : wanted[i][k] (m,) is the fraction of each face where family i is halved at most k times.
    slope   : (n, 2) lines per metre before halving.    density : (n, 2) lines per metre after halving.
    first   : the family, 0 or 1, that is halved first.    chart : surface divided at ends of lines.
    forces   : (m, 2) principal stresses that the stripes follow, Pa; None for stresses of the uncut sheet."""

    phases: tuple[CornerPhase, CornerPhase]
    wanted: tuple[tuple[Floats, ...], tuple[Floats, ...]]
    slope: Floats
    density: Floats
    first: int
    chart: Chart
    symmetry: Symmetry | None = None
    steered: StripeSteering | None = None
    forces: Floats | None = None


class Candidate(NamedTuple):
    """A trial for preset values that are `auto`: modes and phases of the major and of the minor stripes.
    compliance : joules; infinite for a refused trial.    over_uncut : compliance / that of the uncut sheet.
    kept       : share of the surface that is material.    whole : share of the material in the largest supported piece.
    refused    : reason to refuse the trial, or ''."""

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
    """Candidates for modes and phases, best first, if the preset sets these values to `auto`."""

    candidates: tuple[Candidate, ...]

    @property
    def mode(self) -> tuple[int, int]:
        return self.candidates[0].mode

    @property
    def phase(self) -> tuple[float, float]:
        return self.candidates[0].phase


@dataclass(frozen=True, eq=False)
class StressedSurface:
    """A surface, its statics, and its diffusion modes."""

    surface: Surface
    statics: StaticsResult
    diffusion: DiffusionResult

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the surface."""
        return self.statics.load


class Attempt(NamedTuple):
    """A trial for the pattern method `auto`: a method and a width rule.
    compliance : joules; infinite for a refused trial.    over_uncut : compliance / that of the uncut sheet.
    kept       : share of the surface that is material.
    dead_ends  : number of members with a free end.    slits : number of narrow openings.
    refused    : reason to refuse the trial, or ''.    plate : number of filled openings in a plate."""

    name: str
    compliance: float = float("inf")
    over_uncut: float = float("inf")
    kept: float = 0.0
    dead_ends: int = 0
    slits: int = 0
    refused: str = ""
    plate: int = 0

    @property
    def rank(self) -> tuple[bool, bool, bool, bool, float]:
        """Sort key of trials; the best trial has the least key."""
        soft = float("inf") if self.refused else float(f"{self.compliance * self.kept:.3g}")
        return bool(self.refused), self.dead_ends > 0, self.plate > 0, self.slits > 0, soft


@dataclass(frozen=True, eq=False)
class PatternResult:
    """Results of stage 4: named fields, linear on faces, and the levels at which each field is cut.
    fields      : (n,) values at vertices, or (n, 2) for stripes of varying width; a `CornerField` for evenly spaced
                  stripes; a `DividedField` for kept regions.
    levels      : values at which to cut each field. A point is material if an odd number of levels lie below its value.
    half_widths : (n,) half-width of the stripes of each field / distance between middle lines; infinite for fields
                  without stripes.
    factor      : factor by which all widths were scaled.
    frequency, mode, phase : of the major and of the minor stripes.
    even        : evenly spaced stripes; None for stripes that follow diffusion modes.
    asked       : the preset's section [pattern] with results in place of `auto`; None if no value is `auto`.
    choice, attempts : trials for `auto`, best first.    tidy : rules for the removal of stripes, or None.
    trial       : last cut of the search for widths."""

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
    trial: TrialCut | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "trial": None}

    @property
    def cut_inputs(self) -> tuple[tuple[Floats | CornerField | DividedField, ...], tuple[Floats, ...], Tidy | None]:
        """The inputs of the cut: fields, levels, and rules for the removal of stripes."""
        return self.fields, self.levels, self.tidy

    def with_trial(self, trial: TrialCut | None) -> "PatternResult":
        """Return this pattern with the trial cut `trial`, or unchanged if the trial cut has other inputs."""
        return replace(self, trial=trial) if trial and trial.is_cut_of(self.cut_inputs) else self

    def half_width(self, family: str) -> Floats:
        """Return the half-widths (n,) of a stripe family, in stripe periods; 0 for an unused family."""
        by_family = dict(zip(self.names, self.half_widths, strict=True))
        return by_family[family] if family in by_family else np.zeros_like(self.half_widths[0])

    def preset_with_choices(self, preset: Preset) -> Preset:
        """Return the preset with the results of `auto`."""
        return preset.with_pattern(**dict(self.asked)) if self.asked else preset


class Piece(NamedTuple):
    """A connected part of the sheet. area : m2. held : True if supported. loaded : True under a concentrated load."""

    area: float
    held: bool
    loaded: bool


class FilledOpenings(NamedTuple):
    """A group of neighbouring filled openings. openings : number.    place : (3,) centre of their area, m."""

    openings: int
    place: Floats

    @property
    def message(self) -> str:
        """Sentence on neighbouring filled openings."""
        x, y, z = (np.round(self.place, 2) + 0.0).tolist()
        return (
            f"{self.openings} filled openings lie side by side around ({x:g}, {y:g}, {z:g}) m, where stripes come "
            f"together; these fills form a plate with a ragged edge"
        )


@dataclass(frozen=True, eq=False)
class SlicingResult:
    """Results of stage 5: all mesh cells of the cut, the remaining sheet, and its connected pieces (largest first).
    pinches : number of mended contacts at single points.    plate : filled openings that form a plate, or None."""

    cells: Sheet
    sheet: Sheet
    pieces: tuple[Piece, ...]
    pinches: int
    plate: FilledOpenings | None = None


class Note(NamedTuple):
    """A note for the user, and the stage of the design that made it."""

    stage: str
    text: str


ROWS = {
    "surface": ("surface",),
    "statics": ("membrane", "bending", "statics", "stress", "answers"),
    "diffusion": ("diffusion", "modes"),
    "pattern": ("method", "stripes", "choice", "widths", "pattern"),
    "slicing": ("slicing",),
    "thickening": ("thickening",),
}
"""Rows of the timing table, by stage; each row is a key of `Log.seconds`."""
PARTS = {"statics": ("factor",)}  # Timing rows that are parts of other rows, by stage.
Progress = Callable[[str, str], None]  # Receives the name of a stage and a message about its step.


def silent(_stage: str, _doing: str) -> None: ...


@dataclass
class Log:
    """Progress, seconds and notes of a run. file : record of the surface file."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    file: FileRecord | None = None
    clock: Callable[[], float] = time.perf_counter

    def report(self, stage: str, doing: str) -> None:
        if self.progress:
            self.progress(stage, doing)

    @contextmanager
    def stage(self, name: str, doing: str) -> Iterator[None]:
        """Report that a stage begins, and record its seconds."""
        self.report(name, doing)
        start = self.clock()
        yield
        self.seconds[name] = self.clock() - start

    @contextmanager
    def row(self, name: str) -> Iterator[None]:
        """Add the seconds of the `with` block to the entry `name` of `seconds`."""
        start = self.clock()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + self.clock() - start

    def note(self, stage: str, text: str) -> None:
        self.notes.append(Note(stage, text))

    def add_stage(self, earlier: "Log", stage: str) -> None:
        """Add the seconds and notes of a stage from another log."""
        rows = (*ROWS[stage], *PARTS.get(stage, ()))
        self.seconds.update({row: earlier.seconds[row] for row in rows if row in earlier.seconds})
        self.notes.extend(note for note in earlier.notes if note.stage == stage)

    def of_stages(self, stages: Sequence[str], progress: Progress | None) -> "Log":
        """Return a new log with the seconds and notes of the given stages."""
        log = Log(progress, file=self.file if "surface" in stages else None)
        for stage in stages:
            log.add_stage(self, stage)
        return log

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "progress": None}
