"""The class `Design`: a preset and its stages, each of them computed when it is first needed."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError, PresetError
from dsfab.core.messages import length, mass
from dsfab.design.buildability import require_buildable
from dsfab.design.directions import diffusion_step, without_modes
from dsfab.design.log import Log, Progress
from dsfab.design.member_model import action_cases, beam_agreement, beam_model, member_utilisation
from dsfab.design.pattern_measures import measured_pattern
from dsfab.design.pattern_stage import ChosenMethod, EarlierStripes, chosen_method, pattern_stage, sketched_pattern
from dsfab.design.sheet_loads import sheet_loads
from dsfab.design.slicing_and_thickening import slicing_step, thickening_step
from dsfab.design.surface_and_statics import checked_sheet, rough_statics, statics_step, surface_step
from dsfab.preset.model import STAGES, Preset
from dsfab.preset.surface_section import missing_preset
from dsfab.results import DiffusionResult, Note, PatternResult, SlicingResult, StaticsResult, StressedSurface
from dsfab.slicing import Sheet
from dsfab.slicing.measures.pattern_quality import PatternQuality
from dsfab.statics import SectionForces, ShearRecovery, section_forces, sheet_stress, solve_for
from dsfab.surface import FileRecord, LoadCase, Surface
from dsfab.thickening import Solid

if TYPE_CHECKING:
    import build123d

    from dsfab.members import MemberGraph
    from dsfab.members.eurocode import Utilisation
    from dsfab.members.frame import Frame, FrameAgreement, MemberForces
    from dsfab.report.design.save import SavedDesign


T = TypeVar("T")


class EarlyResults:
    """Results by name that follow from rough `statics` (see `rough_statics`), each with its own log."""

    def __init__(self, statics: StaticsResult, progress: Progress | None) -> None:
        self.statics, self._progress = statics, progress
        self._made: dict[str, tuple[Any, Log]] = {}

    def cached_result(self, name: str, make: Callable[[Log], T]) -> T:
        """Return the result of `make`, computed once under `name`."""
        if name not in self._made:
            log = Log(self._progress)
            self._made[name] = make(log), log
        result: T = self._made[name][0]
        return result

    def take_result(self, name: str, statics: StaticsResult, log: Log) -> Any | None:
        """Remove and return a result, adding its seconds and notes to `log`; None if the pattern follows another
        stress.
        """
        if name not in self._made or not self._holds(statics):
            return None
        result, result_log = self._made.pop(name)
        log.seconds.update(result_log.seconds)
        log.notes.extend(result_log.notes)
        return result

    def _holds(self, statics: StaticsResult) -> bool:
        cases = self.statics.cases
        return all(
            np.array_equal(case.followed_stress, cases[name].followed_stress) for name, case in statics.cases.items()
        )


ROWS = {
    "surface": ("surface",),
    "statics": ("membrane", "bending", "statics", "stress", "answers"),
    "diffusion": ("diffusion", "modes"),
    "pattern": ("method", "stripes", "choice", "widths", "pattern"),
    "slicing": ("slicing",),
    "thickening": ("thickening",),
}
"""The rows of the timing table that each stage fills."""

PARTS = {"statics": ("factor",)}
"""Timing rows that are part of another row of the stage."""

RESULT_NAMES = {"slicing": ("slicing", "sheet"), "thickening": ("solid",)}
"""Attributes that hold the results of a stage, where their name is not that of the stage."""


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """A preset and the results of its stages, computed on first access and cached; `dsfab.revise` makes the next
    design.

    surface, statics, diffusion, pattern, slicing and solid each raise the DsfabError of their stage. `dsfab.run`
    computes all of them, `dsfab.design.draft` those before the cut.
    """

    preset: Preset
    _log: Log = field(default_factory=lambda: Log(None))
    _before: EarlierStripes | None = None
    _answers: dict[str, tuple[str, Any]] = field(default_factory=dict)

    @classmethod
    def from_preset(cls, preset: Preset, earlier: "Design | None" = None, progress: Progress | None = None) -> "Design":
        """Return a design without results, except those of `earlier` before the first section that differs.

        Raises PresetError for an argument that is no preset, for example a mesh; the message lists what is missing.
        """
        if not isinstance(preset, Preset):
            raise PresetError(missing_preset(preset))
        if earlier is None:
            return cls(preset, Log(progress))
        stage = preset.first_difference(earlier.preset) or "export"
        design, start = (
            cls(preset, Log(progress), earlier._stripes() if stage == "pattern" else None),
            STAGES.index(stage),
        )
        for stage in STAGES[:start]:
            for name in RESULT_NAMES.get(stage, (stage,)):
                if name in vars(earlier):
                    vars(design)[name] = vars(earlier)[name]
            rows = (*ROWS[stage], *PARTS.get(stage, ()))
            design._log.seconds.update({row: earlier.seconds[row] for row in rows if row in earlier.seconds})
            design._log.notes.extend(note for note in earlier.notes if note.stage == stage)
        if "surface" in STAGES[:start]:
            design._log.file = earlier.file
        design._answers.update(
            {key: answer for key, answer in earlier._answers.items() if STAGES.index(answer[0]) < start}
        )
        return design

    @classmethod
    def from_results(cls, preset: Preset, log: Log | None = None, **results: Any) -> "Design":
        """Return a design with given results, by the names of its attributes (see `HELD`).

        log : receives the seconds and notes of the stages that are still to be computed.
        """
        design = cls(preset, log or Log(None))
        vars(design).update(results)
        return design

    def until(self, stage: str) -> Self:
        """Compute every stage up to `stage` and return the design itself. Raises the DsfabError of the stage that
        refuses.
        """
        before = STAGES[: STAGES.index(stage) + 1]
        for name in before:
            getattr(self, RESULT_NAMES.get(name, (name,))[0])
            if name == "statics" and "slicing" in before:
                require_buildable(self.preset, self.statics)
        return self

    def _stripes(self) -> EarlierStripes | None:
        """Return the evenly spaced stripes for a design whose first difference is in [pattern]."""
        even = self.pattern.even if self.has("pattern") else None
        return EarlierStripes(self.preset.pattern, even, self.seconds["stripes"]) if even else None

    def has(self, stage: str) -> bool:
        """Return whether the results of a stage exist already."""
        return any(name in vars(self) for name in RESULT_NAMES.get(stage, (stage,)))

    def cached_result(self, stage: str, name: str, make: Callable[[], T]) -> T:
        """Memoise `make()` under `name`; revisions keep it if only stages after `stage` changed."""
        if name not in self._answers:
            self._answers[name] = stage, make()
        result: T = self._answers[name][1]
        return result

    def write(self, path: str | Path, **options: Any) -> Path:
        """Write one file in the format of its suffix, as `dsfab build` does; see `dsfab.write`."""
        from dsfab.design.output import write

        return write(self, path, **options)

    def save(self, folder: str | Path, **options: Any) -> "SavedDesign":
        """Write into a folder all files that `dsfab build` writes; see `dsfab.save`."""
        from dsfab.report.design.save import save

        return save(self, folder, **options)

    def to_build123d(self) -> "build123d.Shape":
        """Return the CAD shape, millimetres, that `write("x.step")` writes: smooth where that is possible."""
        from dsfab.design.output import to_build123d

        return to_build123d(self)

    def _repr_png_(self) -> bytes | None:
        """Return a PNG for a notebook, or None if no picture can be rendered."""
        from dsfab.render.design_picture import inline_picture

        return inline_picture(self)

    def __repr__(self) -> str:
        return "\n".join(summary_lines(self))

    def __getstate__(self) -> dict[str, Any]:
        """Leave the progress callback and memoised answers out of a pickled design."""
        now = {name: value for name, value in vars(self).items() if name not in ("_solved", "_early")}
        return {**now, "_log": replace(self._log, progress=None), "_answers": {}}

    @cached_property
    def surface(self) -> Surface:
        """Stage 1: the surface, metres."""
        return surface_step(self.preset, self._log)

    @cached_property
    def statics(self) -> StaticsResult:
        """Stage 2: the equilibrium of the uncut surface under its loads."""
        solved = vars(self).pop("_solved", None)  # large, and not needed again
        return statics_step(self.preset, self.surface, self._log, **({"solved": solved} if solved else {}))

    @cached_property
    def diffusion(self) -> DiffusionResult:
        """Stage 3: tensors and modes."""
        early: DiffusionResult | None = self._early_result("diffusion")
        return early or diffusion_step(self.preset, self.surface, self.statics, self._log)

    @cached_property
    def pattern(self) -> PatternResult:
        """Stage 4: the stripes, before the surface is cut."""
        result = pattern_stage(self.preset, self.analysis, self._log, self._stripe_method(self.analysis))
        for name in ("_chosen", "_early"):  # the pattern holds what is needed of them
            vars(self).pop(name, None)
        return result

    def _stripe_method(self, analysis: StressedSurface) -> ChosenMethod:
        """Return the method and course of the stripes, once for the sketch and the pattern after it."""
        if "_chosen" not in vars(self):
            early = self._early_result("way")
            vars(self)["_chosen"] = early or chosen_method(self.preset, analysis, self._log, self._before)
        method: ChosenMethod = vars(self)["_chosen"]
        return method

    @cached_property
    def _early(self) -> EarlyResults | None:
        """Rough results for a sketch before better elements are solved; None if these save no time."""
        if self.has("statics"):
            return None
        solved = vars(self)["_solved"] = checked_sheet(self.preset, self.surface, self._log)
        rough = rough_statics(self.preset, self.surface, solved)
        return EarlyResults(rough, self._log.progress) if rough else None

    def _early_result(self, name: str) -> Any:
        """Return a result of the sketch if it is still valid, else None."""
        early, statics = vars(self).get("_early"), self.statics
        return early.take_result(name, statics, self._log) if early else None

    def sketch(self, modes: bool = True, answers: bool = False) -> "Design | None":
        """Return a design with an approximate pattern in a tenth of the time, for a first picture.

        modes   : whether its modes are needed; without, modes that evenly spaced stripes do not use are not computed.
        answers : whether stress and energy must be those of the design; else rough ones suffice.

        None if the widths cannot be found by counting points: `pattern` raises the reason. Raises the DsfabError of the
        stage that refuses.
        """
        if answers:
            _ = self.statics
        early = None if self.has("statics") else self._early
        statics = early.statics if early else self.statics
        options, stage_inputs = self.preset.pattern, (self.preset, self.surface, statics)
        if not (modes or self.has("diffusion") or options.method != "stripes" or options.width.rule == "stressed"):
            analysis = StressedSurface(self.surface, statics, without_modes(*stage_inputs))
        elif early:
            diffusion = early.cached_result("diffusion", lambda log: diffusion_step(*stage_inputs, log))
            analysis = StressedSurface(self.surface, statics, diffusion)
        else:
            analysis = self.analysis
        if early:
            method = early.cached_result("way", lambda log: chosen_method(self.preset, analysis, log, self._before))
        else:
            method = self._stripe_method(analysis)
        with suppress(PatternError):
            pattern = sketched_pattern(analysis, method)
            results = {
                "surface": analysis.surface,
                "statics": analysis.statics,
                "diffusion": analysis.diffusion,
                "pattern": pattern,
            }
            return self.from_results(self.preset, None, **results)
        return None

    @cached_property
    def slicing(self) -> SlicingResult:
        """Stage 5: the cut surface, and the sheet that remains."""
        require_buildable(self.preset, self.statics)
        return slicing_step(self.preset, self.surface, self.statics, self.pattern, self._log)

    @cached_property
    def sheet(self) -> Sheet:
        """The sheet that remains after slicing."""
        return self.slicing.sheet

    @property
    def members(self) -> "MemberGraph":
        """The members of the sheet by name, and the nodes between them."""
        from dsfab.members import member_graph  # takes half of the time of `import dsfab`; few designs need it

        return self.cached_result("slicing", "members", lambda: member_graph(self.surface, self.sheet, self.pattern))

    @property
    def frame(self) -> "Frame":
        """The members as beams between nodes, with supports and loads.

        Raises StaticsError if no member has an axis, or if nothing carries a load.
        """
        return self.cached_result("slicing", "frame", self._frame)

    def _frame(self) -> "Frame":
        cases, material = action_cases(self.preset, self.surface, self.statics), self.slicing.cells.subset()
        loads = sheet_loads(self.surface, material, self.sheet, {name: case.load for name, case in cases.items()})
        return beam_model(self.preset, self.sheet.surface, self.members, self.statics, cases, loads)

    @property
    def member_forces(self) -> "dict[str, MemberForces]":
        """Forces along the axis of each member, by its name, from `section_forces`."""
        from dsfab.members.frame import member_forces

        return self.cached_result("slicing", "member forces", lambda: member_forces(self.members, self.section_forces))

    @property
    def member_utilisation(self) -> "Utilisation":
        """Forces of members over their resistance by the standard of their material, see `dsfab.members.eurocode`.

        Raises StaticsError if neither the material nor a strength is set.
        """
        return self.cached_result(
            "slicing",
            "member utilisation",
            lambda: member_utilisation(self.preset, self.members, self.member_forces),
        )

    def frame_agreement(self) -> "list[FrameAgreement]":
        """Compare beams and sheet, by case and combination."""
        return self.cached_result("slicing", "frame agreement", self._frame_agreement)

    def _frame_agreement(self) -> "list[FrameAgreement]":
        loads = self._loads_on_sheet(self.statics.cases)
        return beam_agreement(self.preset, self.sheet.surface, self.members, self.frame, loads)

    @cached_property
    def solid(self) -> Solid:
        """Stage 6: the thickened sheet."""
        return thickening_step(self.preset, self.surface, self.slicing, self._log)

    @cached_property
    def fields(self) -> Mapping[str, Floats] | None:
        """Fields of the VTU file by name, (n, ...) or (m, ...), of a design read from a folder; None for a computed
        design.
        """
        return None

    @property
    def analysis(self) -> StressedSurface:
        """Stages 1 to 3: the input of the pattern."""
        return StressedSurface(self.surface, self.statics, self.diffusion)

    @property
    def seconds(self) -> Mapping[str, float]:
        """Rows of the timing table for the stages that ran."""
        return MappingProxyType(self._log.seconds)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes for the user from the stages that ran."""
        return tuple(self._log.notes)

    @property
    def file(self) -> FileRecord | None:
        """The record of the surface file: data read, repaired and dropped; None before it is read and for other
        surfaces.
        """
        return self._log.file

    @property
    def resolved_preset(self) -> Preset:
        """The preset with the results of all searches: it makes the same design without a search."""
        return self.pattern.preset_with_choices(self.preset)

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the uncut surface."""
        return self.statics.load

    def quality(self, symmetry: bool = True) -> PatternQuality:
        """Measure the quality of the pattern, on the sheet if it exists, else on the stripes.

        symmetry : whether the error of the symmetry is measured too, which takes longest.
        """
        cells, sheet = (self.slicing.cells, self.sheet) if self.has("slicing") else (None, None)
        return measured_pattern(self, symmetry, cells, sheet)

    @property
    def cut_loads(self) -> dict[str, LoadCase]:
        """The loads that the pattern follows, by name, on the cut sheet. Raises StaticsError if nothing carries a
        load.
        """
        return self._loads_on_sheet(self.preset.followed_weights)

    def _loads_on_sheet(self, names: Iterable[str]) -> dict[str, LoadCase]:
        return sheet_loads(self.surface, self.slicing.cells.subset(), self.sheet, self.statics.loads(names))

    @property
    def section_forces(self) -> dict[str, SectionForces]:
        """n, m and q on each face of the cut sheet, by case and combination, see `dsfab.statics.SectionForces`.

        Raises StaticsError if nothing carries a load.
        """
        return self.cached_result("slicing", "section forces", self._section_forces)

    def _section_forces(self) -> dict[str, SectionForces]:
        model = self.preset.statics.sheet().model_for(self.sheet.surface)
        loads = self._loads_on_sheet(self.statics.cases)
        answers, forces, shear = solve_for(model, loads, "stress"), {}, None
        for name, answer in answers.items():
            stress = sheet_stress(model, answer.elements, answer)
            shear = shear or ShearRecovery.for_surface(model.surface, linear=answer.elements.bending == "hhj")
            forces[name] = section_forces(model.surface, model.thickness, stress, shear)
        return forces

    @property
    def mass(self) -> float:
        """Mass of the solid, kg."""
        return self.solid.volume * self.preset.statics.density


def summary_lines(design: Design) -> Iterator[str]:
    """Yield one line for the design and one for each result, for people."""
    preset = design.preset
    yield f"Design {preset.name}" + (f": {preset.description}" if preset.description else "")
    if design.has("surface"):
        surface = design.surface
        yield f"  surface  {surface.area:.4g} m2, {surface.n:,} vertices, {surface.m:,} triangles"
    if design.has("pattern"):
        yield f"  pattern  {design.resolved_preset.pattern.method}: {' and '.join(design.pattern.names)}"
    if design.has("slicing"):
        sheet = design.sheet.surface
        yield f"  sheet    {sheet.area / design.surface.area:.0%} of it, {length(preset.statics.thickness)} thick"
    if design.has("thickening"):
        solid = design.solid
        pieces = "1 piece" if solid.pieces == 1 else f"{solid.pieces} pieces"
        yield f"  solid    {mass(design.mass)}, {solid.volume:.4g} m3, {pieces}, {len(solid.F):,} triangles"
    if not design.has("thickening"):
        yield "  stages that are not listed run on first access"
