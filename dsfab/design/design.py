"""The class `Design`: a preset and its stages, each of them computed when it is first needed."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from dsfab import ways_out
from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError, PresetError
from dsfab.core.messages import length, mass
from dsfab.design.buildability import require_buildable
from dsfab.design.directions import diffusion_step, without_modes
from dsfab.design.log import Log, Progress
from dsfab.design.member_model import action_cases, beam_agreement, beam_model, member_utilisation
from dsfab.design.pattern_measures import measured_pattern
from dsfab.design.pattern_stage import Before, ChosenWay, chosen_way, pattern_stage, sketched_pattern
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


T = TypeVar("T")


class Early:
    """Results that follow from `statics`, by name, each with a log of its own.

    statics : of `rough_statics`: what the pattern follows is there, stress and energy are rough.
    """

    def __init__(self, statics: StaticsResult, progress: Progress | None) -> None:
        self.statics, self._progress = statics, progress
        self._made: dict[str, tuple[Any, Log]] = {}

    def once(self, name: str, make: Callable[[Log], T]) -> T:
        """What `make` gives, made once."""
        if name not in self._made:
            log = Log(self._progress)
            self._made[name] = make(log), log
        found: T = self._made[name][0]
        return found

    def taken(self, name: str, statics: StaticsResult, log: Log) -> Any | None:
        """It, with its seconds and notes into `log`, if the pattern follows the same stress; else None."""
        if name not in self._made or not self._holds(statics):
            return None
        found, told = self._made.pop(name)
        log.seconds.update(told.seconds)
        log.notes.extend(told.notes)
        return found

    def _holds(self, statics: StaticsResult) -> bool:
        cases = self.statics.cases
        return all(np.array_equal(case.followed, cases[name].followed) for name, case in statics.cases.items())


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
"""Seconds that are part of another row of the stage, told beside it."""

HELD = {"slicing": ("slicing", "sheet"), "thickening": ("solid",)}
"""What holds the results of a stage, where that is not an attribute of its name."""


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """A preset and everything that is made of it. Frozen: `dsfab.revise` makes the next one.

    surface, statics, diffusion, pattern, slicing and solid are made when they are first asked for, and kept; each
    raises the DsfabError of its stage. `dsfab.run` makes them all, `dsfab.design.draft` those before the cut.
    """

    preset: Preset
    _log: Log = field(default_factory=lambda: Log(None))
    _before: Before | None = None
    _answers: dict[str, tuple[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, preset: Preset, old: "Design | None" = None, progress: Progress | None = None) -> "Design":
        """A design whose stages are still to be made, but for those of `old` before the first section that differs.

        Raises PresetError for what is no preset, a mesh for instance: it says what is missing.
        """
        if not isinstance(preset, Preset):
            raise PresetError(missing_preset(preset))
        if old is None:
            return cls(preset, Log(progress))
        stage = preset.first_difference(old.preset) or "export"
        new, start = cls(preset, Log(progress), old._stripes() if stage == "pattern" else None), STAGES.index(stage)
        for stage in STAGES[:start]:
            for name in HELD.get(stage, (stage,)):
                if name in vars(old):
                    vars(new)[name] = vars(old)[name]
            rows = (*ROWS[stage], *PARTS.get(stage, ()))
            new._log.seconds.update({row: old.seconds[row] for row in rows if row in old.seconds})
            new._log.notes.extend(note for note in old.notes if note.stage == stage)
        if "surface" in STAGES[:start]:
            new._log.file = old.file
        new._answers.update({key: one for key, one in old._answers.items() if STAGES.index(one[0]) < start})
        return new

    @classmethod
    def known(cls, preset: Preset, log: Log | None = None, **results: Any) -> "Design":
        """A design of which some results are there already, by the names of its attributes (see `HELD`).

        log : where the stages that are still to be made write down their seconds and notes.
        """
        new = cls(preset, log or Log(None))
        vars(new).update(results)
        return new

    def until(self, stage: str) -> Self:
        """The design itself, with everything up to this stage made. Raises the DsfabError of the one that refuses."""
        before = STAGES[: STAGES.index(stage) + 1]
        for each in before:
            getattr(self, HELD.get(each, (each,))[0])
            if each == "statics" and "slicing" in before:
                require_buildable(self.preset, self.statics)
        return self

    def _stripes(self) -> Before | None:
        """Evenly spaced stripes for a design that differs in [pattern] first."""
        even = self.pattern.even if self.has("pattern") else None
        return Before(self.preset.pattern, even, self.seconds["stripes"]) if even else None

    def has(self, stage: str) -> bool:
        """Whether what the stage makes is there already."""
        return any(name in vars(self) for name in HELD.get(stage, (stage,)))

    def once(self, stage: str, name: str, make: Callable[[], T]) -> T:
        """What somebody works out of this design, worked out once; revisions that differ later share it."""
        if name not in self._answers:
            self._answers[name] = stage, make()
        found: T = self._answers[name][1]
        return found

    def write(self, path: str | Path, **options: Any) -> Path:
        """Write one file, its format by its suffix, as `dsfab build` writes it; see `dsfab.write`."""
        done: Path = ways_out.through("write", self, path, **options)
        return done

    def save(self, folder: str | Path, **options: Any) -> Path:
        """Write everything that `dsfab build` writes into a folder; see `dsfab.save`."""
        done: Path = ways_out.through("save", self, folder, **options)
        return done

    def to_build123d(self) -> "build123d.Shape":
        """For CAD, millimetres: what `write("x.step")` writes, smooth where it is."""
        shape: build123d.Shape = ways_out.through("to_build123d", self)
        return shape

    def _repr_png_(self) -> bytes | None:
        """PNG for a notebook, or None where nothing can be drawn."""
        picture: bytes | None = ways_out.through("inline_picture", self)
        return picture

    def __repr__(self) -> str:
        return "\n".join(described(self))

    def __getstate__(self) -> dict[str, Any]:
        """For another process: who is told of the progress, and what others worked out, stay behind."""
        now = {name: value for name, value in vars(self).items() if name not in ("_solved", "_early")}
        return {**now, "_log": replace(self._log, progress=None), "_answers": {}}

    @cached_property
    def surface(self) -> Surface:
        """Stage 1: the surface, metres."""
        return surface_step(self.preset, self._log)

    @cached_property
    def statics(self) -> StaticsResult:
        """Stage 2: how the uncut surface carries its loads."""
        solved = vars(self).pop("_solved", None)  # large, and needed no more
        return statics_step(self.preset, self.surface, self._log, **({"solved": solved} if solved else {}))

    @cached_property
    def diffusion(self) -> DiffusionResult:
        """Stage 3: tensors and modes."""
        early: DiffusionResult | None = self._found_early("diffusion")
        return early or diffusion_step(self.preset, self.surface, self.statics, self._log)

    @cached_property
    def pattern(self) -> PatternResult:
        """Stage 4: the stripes, before anything is cut."""
        made = pattern_stage(self.preset, self.stressed, self._log, self._way(self.stressed))
        for name in ("_chosen", "_early"):  # what is wanted of them is in the pattern
            vars(self).pop(name, None)
        return made

    def _way(self, given: StressedSurface) -> ChosenWay:
        """Where the stripes run: once for a sketch and the pattern after it."""
        if "_chosen" not in vars(self):
            early = self._found_early("way")
            vars(self)["_chosen"] = early or chosen_way(self.preset, given, self._log, self._before)
        way: ChosenWay = vars(self)["_chosen"]
        return way

    @cached_property
    def _early(self) -> Early | None:
        """What a sketch can be drawn from before better elements answer; None where that is no sooner."""
        if self.has("statics"):
            return None
        solved = vars(self)["_solved"] = checked_sheet(self.preset, self.surface, self._log)
        rough = rough_statics(self.preset, self.surface, solved)
        return Early(rough, self._log.progress) if rough else None

    def _found_early(self, name: str) -> Any:
        """What a sketch was drawn from, where that is still so; else None."""
        early, statics = vars(self).get("_early"), self.statics
        return early.taken(name, statics, self._log) if early else None

    def sketch(self, modes: bool = True, answers: bool = False) -> "Design | None":
        """A design whose pattern is about what `pattern` will be, found in a tenth of the time: for a first picture.

        modes   : whether it has modes; without, those that evenly spaced stripes have no use for are left for later.
        answers : whether its stress and energy are the design's; else rough ones will do.

        None where its widths cannot be counted: `pattern` says why. Raises the DsfabError of the stage that refuses.
        """
        if answers:
            _ = self.statics
        early = None if self.has("statics") else self._early
        statics = early.statics if early else self.statics
        ask, plain = self.preset.pattern, (self.preset, self.surface, statics)
        if not (modes or self.has("diffusion") or ask.method != "stripes" or ask.width.rule == "stressed"):
            given = StressedSurface(self.surface, statics, without_modes(*plain))
        elif early:
            diffusion = early.once("diffusion", lambda log: diffusion_step(*plain, log))
            given = StressedSurface(self.surface, statics, diffusion)
        else:
            given = self.stressed
        if early:
            way = early.once("way", lambda log: chosen_way(self.preset, given, log, self._before))
        else:
            way = self._way(given)
        with suppress(PatternError):
            drawn = sketched_pattern(given, way)
            known = {"surface": given.surface, "statics": given.statics, "diffusion": given.diffusion, "pattern": drawn}
            return self.known(self.preset, None, **known)
        return None

    @cached_property
    def slicing(self) -> SlicingResult:
        """Stage 5: the surface cut, and what is kept of it."""
        require_buildable(self.preset, self.statics)
        return slicing_step(self.preset, self.surface, self.statics, self.pattern, self._log)

    @cached_property
    def sheet(self) -> Sheet:
        """The sheet that is kept."""
        return self.slicing.sheet

    @property
    def members(self) -> "MemberGraph":
        """The members of the sheet by their names, and the nodes at which they meet."""
        from dsfab.members import member_graph  # takes half of the time of `import dsfab`, and few designs need it

        return self.once("slicing", "members", lambda: member_graph(self.surface, self.sheet, self.pattern))

    @property
    def frame(self) -> "Frame":
        """The members of the sheet as beams between nodes, with supports and loads; raises StaticsError where there are
        none, and where nothing carries its loads."""
        return self.once("slicing", "frame", self._frame)

    def _frame(self) -> "Frame":
        cases, drawn = action_cases(self.preset, self.surface, self.statics), self.slicing.cells.kept()
        loads = sheet_loads(self.surface, drawn, self.sheet, {name: one.load for name, one in cases.items()})
        return beam_model(self.preset, self.sheet.surface, self.members, self.statics, cases, loads)

    @property
    def member_forces(self) -> "dict[str, MemberForces]":
        """By the names of members, what they bear along their axes, from `section_forces`."""
        from dsfab.members.frame import member_forces

        return self.once("slicing", "member forces", lambda: member_forces(self.members, self.section_forces))

    @property
    def member_utilisation(self) -> "Utilisation":
        """What members bear over what the standard of their material lets them bear, see `dsfab.members.eurocode`.

        Raises StaticsError where neither the material nor a strength is known.
        """
        return self.once(
            "slicing",
            "member utilisation",
            lambda: member_utilisation(self.preset, self.members, self.member_forces),
        )

    def frame_agreement(self) -> "list[FrameAgreement]":
        """By case and combination, how far the beams answer as the sheet does."""
        return self.once("slicing", "frame agreement", self._frame_agreement)

    def _frame_agreement(self) -> "list[FrameAgreement]":
        loads = self._loads_on_sheet(self.statics.cases)
        return beam_agreement(self.preset, self.sheet.surface, self.members, self.frame, loads)

    @cached_property
    def solid(self) -> Solid:
        """Stage 6: the sheet thickened."""
        return thickening_step(self.preset, self.surface, self.slicing, self._log)

    @cached_property
    def fields(self) -> Mapping[str, Floats] | None:
        """What a VTU file shows, by name, (n, ...) or (m, ...), where it was read from a folder; None where it is
        still to be worked out."""
        return None

    @property
    def stressed(self) -> StressedSurface:
        """What the pattern is drawn on: stages 1 to 3."""
        return StressedSurface(self.surface, self.statics, self.diffusion)

    @property
    def seconds(self) -> Mapping[str, float]:
        """Rows of the timing table, of the stages that were made."""
        return MappingProxyType(self._log.seconds)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What a person should know, of the stages that were made."""
        return tuple(self._log.notes)

    @property
    def file(self) -> FileRecord | None:
        """What was read, repaired and dropped of the file of the surface, once it was read; None for other surfaces."""
        return self._log.file

    @property
    def settled(self) -> Preset:
        """The preset with what was chosen: it makes the same design without a search."""
        return self.pattern.settled(self.preset)

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the uncut surface."""
        return self.statics.load

    def quality(self, symmetry: bool = True) -> PatternQuality:
        """The measures of a good pattern: of the sheet where that is made, else of what is drawn.

        symmetry : whether the error of its symmetry is measured too: it takes longest.
        """
        cells, sheet = (self.slicing.cells, self.sheet) if self.has("slicing") else (None, None)
        return measured_pattern(self, symmetry, cells, sheet)

    @property
    def cut_loads(self) -> dict[str, LoadCase]:
        """By name, the loads that the pattern follows, on the cut sheet; raises StaticsError where nothing carries
        them."""
        return self._loads_on_sheet(self.preset.followed)

    def _loads_on_sheet(self, names: Iterable[str]) -> dict[str, LoadCase]:
        return sheet_loads(self.surface, self.slicing.cells.kept(), self.sheet, self.statics.loads(names))

    @property
    def section_forces(self) -> dict[str, SectionForces]:
        """By case and combination, n, m and q per face of the cut sheet, see `dsfab.statics.SectionForces`; raises
        StaticsError where nothing carries its loads."""
        return self.once("slicing", "section forces", self._section_forces)

    def _section_forces(self) -> dict[str, SectionForces]:
        """By the elements for displacements, on the mesh as it is cut."""
        model = self.preset.statics.sheet().on(self.sheet.surface)
        loads = self._loads_on_sheet(self.statics.cases)
        answers, found, shear = solve_for(model, loads, "stress"), {}, None
        for name, answer in answers.items():
            stress = sheet_stress(model, answer.elements, answer)
            shear = shear or ShearRecovery.of(model.surface, linear=answer.elements.bending == "hhj")
            found[name] = section_forces(model.surface, model.thickness, stress, shear)
        return found

    @property
    def mass(self) -> float:
        """Mass of the solid, kg."""
        return self.solid.volume * self.preset.statics.density


def described(design: Design) -> Iterator[str]:
    """A line for the design and one for each thing that it has, for people."""
    preset = design.preset
    yield f"Design {preset.name}" + (f": {preset.description}" if preset.description else "")
    if design.has("surface"):
        surface = design.surface
        yield f"  surface  {surface.area:.4g} m2, {surface.n:,} vertices, {surface.m:,} triangles"
    if design.has("pattern"):
        yield f"  pattern  {design.settled.pattern.method}: {' and '.join(design.pattern.names)}"
    if design.has("slicing"):
        sheet = design.sheet.surface
        yield f"  sheet    {sheet.area / design.surface.area:.0%} of it, {length(preset.statics.thickness)} thick"
    if design.has("thickening"):
        solid = design.solid
        pieces = "1 piece" if solid.pieces == 1 else f"{solid.pieces} pieces"
        yield f"  solid    {mass(design.mass)}, {solid.volume:.4g} m3, {pieces}, {len(solid.F):,} triangles"
    if not design.has("thickening"):
        yield "  what is not listed is made when it is asked for"
