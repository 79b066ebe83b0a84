"""The class `Design`: a preset, and the results of its stages, computed on first access."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError, PresetError
from dsfab.core.messages import length, mass
from dsfab.design.buildability import require_buildable
from dsfab.design.directions import diffusion_step, without_modes
from dsfab.design.member_model import action_cases, beam_agreement, beam_model, member_utilisation
from dsfab.design.pattern_measures import measured_pattern
from dsfab.design.pattern_stage import ChosenMethod, EarlierStripes, chosen_method, pattern_stage, sketched_pattern
from dsfab.design.regions_and_loads import sheet_loads
from dsfab.design.slicing_and_thickening import slicing_step, thickening_step
from dsfab.design.surface_and_statics import (
    checked_sheet,
    rough_statics,
    same_followed_stress,
    statics_step,
    surface_step,
)
from dsfab.preset.model import STAGES, Preset
from dsfab.preset.surface_section import missing_preset
from dsfab.results import (
    DiffusionResult,
    Log,
    Note,
    PatternResult,
    Progress,
    SlicingResult,
    StaticsResult,
    StressedSurface,
)
from dsfab.slicing import Sheet
from dsfab.slicing.measures.pattern_quality import PatternQuality
from dsfab.statics import (
    SectionForces,
    ShearRecovery,
    SheetModel,
    rib_shape,
    section_forces,
    sheet_stress,
    solve_for,
    with_barlike_ribs,
)
from dsfab.surface import FileRecord, LoadCase, Surface
from dsfab.thickening import Solid

if TYPE_CHECKING:
    import build123d

    from dsfab.members import MemberGraph
    from dsfab.members.eurocode import Utilisation
    from dsfab.members.frame import Frame, FrameAgreement, MemberCuts, MemberForces
    from dsfab.report.design.save import SavedDesign

T = TypeVar("T")
RESULT_NAMES = {"slicing": ("slicing", "sheet"), "thickening": ("solid",)}  # Default result: the stage's own name.


@dataclass
class StageResults:
    """The results of a design by name; each is computed once. results : results of the stages.
    derived : values computed from `results`, each with the last stage that it depends on. Pickle omits these values.
    inputs  : large intermediate values, each with the stage that needs the value and then deletes it.
    A revised design takes over `results` and `derived` of the stages before the first changed preset section."""

    results: dict[str, Any] = field(default_factory=dict)
    derived: dict[str, tuple[str, Any]] = field(default_factory=dict)
    inputs: dict[str, tuple[str, Any]] = field(default_factory=dict)

    def has(self, stage: str) -> bool:
        """Return True if a result of the stage exists."""
        return any(name in self.results for name in RESULT_NAMES.get(stage, (stage,)))

    def result(self, name: str, compute: Callable[[], T]) -> T:
        """Return the result `name`. The first call computes the result and deletes the inputs of the stage `name`."""
        if name not in self.results:
            self.results[name] = compute()
            for key in [key for key, (stage, _) in self.inputs.items() if stage == name]:
                del self.inputs[key]
        result: T = self.results[name]
        return result

    def replace(self, name: str, value: Any) -> None:
        """Replace a result, for example to omit parts that later stages do not need."""
        self.results[name] = value

    def derived_value(self, stage: str, name: str, compute: Callable[[], T]) -> T:
        """Return the value `name`, computed on the first call. The value depends on results of stages up to `stage`."""
        return _computed_once(self.derived, stage, name, compute)

    def input_of(self, stage: str, name: str, compute: Callable[[], T]) -> T:
        """Return the intermediate value `name`, computed on the first call and deleted after `stage`."""
        return _computed_once(self.inputs, stage, name, compute)

    def existing_value(self, name: str) -> Any:
        """Return the derived value `name` if it is stored, else None."""
        return self.derived.get(name, ("", None))[1]

    def existing_input(self, name: str) -> Any:
        """Return the intermediate value `name` if it is stored, else None."""
        return self.inputs.get(name, ("", None))[1]

    def of_stages(self, stages: Sequence[str]) -> "StageResults":
        """Return a copy that has only the results and derived values of these stages."""
        names = [name for stage in stages for name in RESULT_NAMES.get(stage, (stage,)) if name in self.results]
        derived = {name: held for name, held in self.derived.items() if held[0] in stages}
        return StageResults({name: self.results[name] for name in names}, derived)

    def __getstate__(self) -> dict[str, Any]:
        return {"results": self.results, "derived": {}, "inputs": {}}


def _computed_once(held: dict[str, tuple[str, Any]], stage: str, name: str, compute: Callable[[], T]) -> T:
    if name not in held:
        held[name] = stage, compute()
    value: T = held[name][1]
    return value


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """A preset and the results of its stages, computed on first access. Results raise the DsfabError of their stage.
    `dsfab.run` computes all results. `dsfab.revise` returns a changed design."""

    preset: Preset
    _log: Log = field(default_factory=lambda: Log(None))
    _results: StageResults = field(default_factory=StageResults)

    @classmethod
    def from_preset(cls, preset: Preset, earlier: "Design | None" = None, progress: Progress | None = None) -> "Design":
        """Return the design of a preset; its stages are computed later. Stages before the first changed section take
        results from the design `earlier`. Raises PresetError for a wrong type, or if the thickness is 'auto'."""
        if not isinstance(preset, Preset):
            raise PresetError(missing_preset(preset))
        if not preset.statics.is_sized:
            raise PresetError(
                f"preset {preset.name}: statics.thickness = 'auto' is not a number yet; give metres, or let "
                "dsfab.sized_design(preset) or the command dsfab size choose a thickness"
            )
        if earlier is None:
            return cls(preset, Log(progress))
        stage = preset.first_difference(earlier.preset) or "export"
        before = STAGES[: STAGES.index(stage)]
        design = cls(preset, earlier._log.of_stages(before, progress), earlier._results.of_stages(before))
        if stage == "pattern" and earlier.has("pattern") and (even := earlier.pattern.even):
            stripes = EarlierStripes(earlier.resolved_preset.pattern, even, earlier.seconds.get("stripes", 0.0))
            design._results.input_of("pattern", "earlier stripes", lambda: stripes)
        return design

    @classmethod
    def from_results(cls, preset: Preset, log: Log | None = None, **results: Any) -> "Design":
        """Return a design with existing results. The keywords of the results are the names of Design's attributes.
        log : receives the times and notes of the stages that are computed later."""
        return cls(preset, log or Log(None), StageResults(results))

    def until(self, stage: str) -> Self:
        """Compute all stages up to `stage` and return the design. Raises the DsfabError of a stage that fails."""
        before = STAGES[: STAGES.index(stage) + 1]
        for name in before:
            getattr(self, RESULT_NAMES.get(name, (name,))[0])
            if name == "statics" and "slicing" in before:
                require_buildable(self.preset, self.statics)
        return self

    def has(self, stage: str) -> bool:
        """Return True if the result of a stage exists."""
        return self._results.has(stage)

    def cached_result(self, stage: str, name: str, make: Callable[[], T]) -> T:
        """Return the result of `make()` and store it under `name`; later calls return the stored value.
        A revised design takes over the value if only stages after `stage` change."""
        return self._results.derived_value(stage, name, make)

    def existing_result(self, name: str) -> Any:
        """Return the value that `cached_result` stored under `name`, or None."""
        return self._results.existing_value(name)

    def write(self, path: str | Path, **options: Any) -> Path:
        """Write one file in the format of its suffix; see `dsfab.write`."""
        from dsfab.design.output import write

        return write(self, path, **options)

    def save(self, folder: str | Path, **options: Any) -> "SavedDesign":
        """Write all files of `dsfab build` into a folder; see `dsfab.save`."""
        from dsfab.report.design.save import save

        return save(self, folder, **options)

    def to_build123d(self) -> "build123d.Shape":
        """Return the solid of `write("x.step")` as a build123d shape, millimetres; its faces are smooth if possible."""
        from dsfab.design.output import to_build123d

        return to_build123d(self)

    def _repr_png_(self) -> bytes | None:
        from dsfab.render.design_picture import inline_picture

        return inline_picture(self)

    def __repr__(self) -> str:
        return "\n".join(summary_lines(self))

    @property
    def surface(self) -> Surface:
        """Stage 1: the surface, metres."""
        return self._results.result("surface", lambda: surface_step(self.preset, self._log))

    @property
    def statics(self) -> StaticsResult:
        """Stage 2: the equilibrium of the uncut surface under its loads."""
        return self._results.result("statics", self._statics)

    def _statics(self) -> StaticsResult:
        solved = self._results.existing_input("solved sheet")
        return statics_step(self.preset, self.surface, self._log, solved=solved)

    @property
    def diffusion(self) -> DiffusionResult:
        """Stage 3: diffusion tensors, made from the stress, and modes: fields whose level lines are stripes."""
        return self._results.result("diffusion", self._diffusion)

    def _diffusion(self) -> DiffusionResult:
        rough = self._valid_rough_design()
        if rough and rough.has("diffusion"):
            self._log.add_stage(rough._log, "diffusion")
            return rough.diffusion
        return diffusion_step(self.preset, self.surface, self.statics, self._log)

    @property
    def pattern(self) -> PatternResult:
        """Stage 4: the stripes, before the surface is cut."""
        return self._results.result("pattern", self._pattern)

    def _pattern(self) -> PatternResult:
        return pattern_stage(self.preset, self.analysis, self._log, self._stripe_method(self.analysis))

    def _stripe_method(self, analysis: StressedSurface) -> ChosenMethod:
        return self._results.input_of("pattern", "method", lambda: self._chosen_method(analysis))

    def _chosen_method(self, analysis: StressedSurface) -> ChosenMethod:
        rough = self._valid_rough_design()
        method: ChosenMethod | None = rough._results.existing_input("method") if rough else None
        if rough and method:
            self._log.add_stage(rough._log, "pattern")
            return method
        return chosen_method(self.preset, analysis, self._log, self._results.existing_input("earlier stripes"))

    def _rough_design(self) -> "Design | None":
        if self.has("statics"):
            return None
        return self._results.input_of("pattern", "rough design", self._design_with_rough_statics)

    def _design_with_rough_statics(self) -> "Design | None":
        make = partial(checked_sheet, self.preset, self.surface, self._log)
        solved = self._results.input_of("statics", "solved sheet", make)
        statics = rough_statics(self.preset, self.surface, solved)
        log = Log(self._log.progress)
        return self.from_results(self.preset, log, surface=self.surface, statics=statics) if statics else None

    def _valid_rough_design(self) -> "Design | None":
        rough: Design | None = self._results.existing_input("rough design")
        return rough if rough and same_followed_stress(rough.statics, self.statics) else None

    def sketch(self, modes: bool = True, answers: bool = False) -> "Design | None":
        """Return a design with an approximate pattern, for a first picture; it takes a tenth of the usual time.
        modes   : False to skip the diffusion modes if stripes are evenly spaced.
        answers : True for accurate stress and energy, False for values from fast finite elements.
        Returns None if no approximate widths give the requested share of material.
        Raises the DsfabError of the stage that fails."""
        if answers:
            _ = self.statics
        source, options = self._rough_design() or self, self.preset.pattern
        if not (modes or source.has("diffusion") or options.method != "stripes" or options.width.rule == "stressed"):
            diffusion = without_modes(self.preset, self.surface, source.statics)
            analysis = StressedSurface(self.surface, source.statics, diffusion)
        else:
            analysis = source.analysis
        method = source._stripe_method(analysis)
        with suppress(PatternError):
            pattern = sketched_pattern(analysis, method)
            results = {"statics": analysis.statics, "diffusion": analysis.diffusion, "pattern": pattern}
            return self.from_results(self.preset, None, surface=analysis.surface, **results)
        return None

    @property
    def slicing(self) -> SlicingResult:
        """Stage 5: the cut surface, and the sheet that remains."""
        return self._results.result("slicing", self._slicing)

    def _slicing(self) -> SlicingResult:
        require_buildable(self.preset, self.statics)
        result = slicing_step(self.preset, self.surface, self.statics, self.pattern, self._log)
        if self.pattern.trial is not None:  # the trial cut is large, and later stages do not need it
            self._results.replace("pattern", replace(self.pattern, trial=None))
        return result

    @property
    def sheet(self) -> Sheet:
        """The sheet that remains after slicing."""
        return self._results.result("sheet", lambda: self.slicing.sheet)

    @property
    def members(self) -> "MemberGraph":
        """The members of the sheet, with names, and the nodes between members."""
        from dsfab.members import member_graph  # this import is slow

        return self.cached_result("slicing", "members", lambda: member_graph(self.surface, self.sheet, self.pattern))

    @property
    def frame(self) -> "Frame":
        """The beam model of the members, with supports and loads.
        Raises StaticsError if no member has an axis, or if a load has no support."""
        return self.cached_result("slicing", "frame", self._frame)

    def _frame(self) -> "Frame":
        cases, material = action_cases(self.preset, self.surface, self.statics), self.slicing.cells.subset()
        loads = sheet_loads(self.surface, material, self.sheet, {name: case.load for name, case in cases.items()})
        return beam_model(self.preset, self.sheet.surface, self.members, self.statics, cases, loads)

    @property
    def member_forces(self) -> "dict[str, MemberForces]":
        """Forces and moments at points along the axis of each member, by member name, from `section_forces`."""
        from dsfab.members.frame import member_forces

        def make() -> "dict[str, MemberForces]":
            combinations = self.statics.combinations
            forces = {name: forces for name, forces in self.section_forces.items() if name not in combinations}
            return member_forces(self.members, forces, self.member_cuts, combinations)

        return self.cached_result("slicing", "member forces", make)

    @property
    def member_cuts(self) -> "dict[str, MemberCuts]":
        """Cross sections at points along the axis of each member, by member name; independent of the thickness."""
        from dsfab.members.frame import member_cuts

        return self.cached_result("slicing", "member cuts", lambda: member_cuts(self.members))

    def sheet_with_ribs(self, thickness: float) -> SheetModel:
        """Return the model of the cut sheet with a thickness (m). Ribs get the low torsional stiffness of bars."""
        surface = self.sheet.surface
        ribs = self.cached_result("slicing", "rib shape", lambda: rib_shape(surface))  # the same for every thickness
        return with_barlike_ribs(self.preset.statics.sheet(thickness).model_for(surface), ribs)

    @property
    def member_utilisation(self) -> "Utilisation":
        """Forces in the members divided by their resistance, by the standard of the material.
        Raises StaticsError if there is neither a material nor a strength."""
        return self.cached_result("slicing", "member utilisation", self._member_utilisation)

    def _member_utilisation(self) -> "Utilisation":
        return member_utilisation(self.preset, self.members, self.member_forces)

    def frame_agreement(self) -> "list[FrameAgreement]":
        """Compare compliance and displacement of the beam model with the cut sheet, in each case and combination."""
        return self.cached_result("slicing", "frame agreement", self._frame_agreement)

    def _frame_agreement(self) -> "list[FrameAgreement]":
        loads = self._loads_on_sheet(self.statics.cases)
        return beam_agreement(self.preset, self.sheet.surface, self.members, self.frame, loads)

    @property
    def solid(self) -> Solid:
        """Stage 6: the thickened sheet."""
        return self._results.result(
            "solid", lambda: thickening_step(self.preset, self.surface, self.slicing, self._log)
        )

    @property
    def fields(self) -> Mapping[str, Floats] | None:
        """Fields by name, (n, ...) at vertices or (m, ...) on faces, from a built folder; None for a new design."""
        return self._results.result("fields", lambda: None)

    @property
    def analysis(self) -> StressedSurface:
        """Results of stages 1 to 3 (surface, statics, diffusion), the input of the pattern."""
        return StressedSurface(self.surface, self.statics, self.diffusion)

    @property
    def seconds(self) -> Mapping[str, float]:
        """Computing times (s) of the stages computed so far, by name of the stage or step, as in `TIMED`."""
        return MappingProxyType(self._log.seconds)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes for the user from the computed stages."""
        return tuple(self._log.notes)

    @property
    def file(self) -> FileRecord | None:
        """Record of the surface file: which data were read, repaired or left out. None without a file."""
        return self._log.file

    @property
    def resolved_preset(self) -> Preset:
        """The preset with the values that dsfab chose in place of `auto`; this preset gives the same design."""
        return self.pattern.preset_with_choices(self.preset)

    @property
    def load(self) -> LoadCase:
        """Supports and loads on the uncut surface."""
        return self.statics.load

    def quality(self, symmetry: bool = True) -> PatternQuality:
        """Return the quality of the pattern, measured on the cut sheet if it is computed, else on the stripes.
        symmetry : True to measure the symmetry error, too, which takes longest."""
        cells, sheet = (self.slicing.cells, self.sheet) if self.has("slicing") else (None, None)
        return measured_pattern(self, symmetry, cells, sheet)

    @property
    def cut_loads(self) -> dict[str, LoadCase]:
        """Loads on the cut sheet, by name of the load case or combination, if the pattern follows this case.
        Raises StaticsError if a load has no support."""
        return self._loads_on_sheet(self.preset.followed_weights)

    def _loads_on_sheet(self, names: Iterable[str]) -> dict[str, LoadCase]:
        return sheet_loads(self.surface, self.slicing.cells.subset(), self.sheet, self.statics.loads(names))

    @property
    def section_forces(self) -> dict[str, SectionForces]:
        """Section forces n, m and q on each face of the cut sheet, by load case or combination; see `SectionForces`.
        Raises StaticsError if a load has no support."""
        return self.cached_result("slicing", "section forces", self._section_forces)

    def _section_forces(self) -> dict[str, SectionForces]:
        model = self.sheet_with_ribs(self.preset.statics.thickness)
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
    """Yield lines of text about a design: its name, then a line for each computed result."""
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
        yield "  all other results are computed when you first read them"


def run(preset: Preset, progress: Progress | None = None) -> Design:
    """Run all stages of a preset. Raises the DsfabError of a stage that fails, and PresetError for a wrong argument."""
    return Design.from_preset(preset, None, progress).until("thickening")


def revise(design: Design, preset: Preset, progress: Progress | None = None) -> Design:
    """Return the design of a changed preset. Stages before the first changed section take their results from `design`,
    for example the statics if [pattern] changes."""
    return Design.from_preset(preset, design, progress).until("thickening")


def draft(preset: Preset, progress: Progress | None = None, earlier: Design | None = None) -> Design:
    """Return a design that is computed up to the pattern; the surface is not cut. Raises the DsfabError of its stages.
    earlier : earlier design, which gives the results of unchanged stages."""
    return Design.from_preset(preset, earlier, progress).until("pattern")
