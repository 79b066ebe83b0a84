"""Comparison of a design with other structures of the same mass under the same loads."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.core.messages import mass, sentence, table
from dsfab.design.design import Design
from dsfab.results import Progress, silent
from dsfab.slicing.measures.pattern_quality import PatternQuality
from dsfab.slicing.measures.widths import features, kept_cells
from dsfab.statics import ResultRequest, flat_axis
from dsfab.study.alternatives import (
    ALTERNATIVE_WORDS,
    Alternative,
    Competitor,
    Spread,
    alternatives,
    judged_alternatives,
    losing_line,
)
from dsfab.study.baselines import DEFAULT, Baseline, ComparisonTask, Structure, Variant, baselines_by_name
from dsfab.study.baselines.structures import striped_structure
from dsfab.study.judges import Judge, Judgement, full, quick
from dsfab.study.verdict import BUDGET

NameReport = Callable[[str], None]  # receives the name of the structure that is compared next


@dataclass(frozen=True, repr=False)
class Comparison:
    """Compliances of a design, the uncut sheet (`full`), and other structures of the design's mass (`rivals`).
    A compliance, small for a stiff structure, is a weighted sum over the load cases that determine the pattern.
    task      : data of the design that the structures were made from.
    pattern   : quality of the design's pattern; None if stripe widths were scaled or the design cannot be cut.
    looked_at : comparisons by fast solves with the structures of `ALTERNATIVE_WORDS` that are not in `rivals`."""

    name: str
    task: ComparisonTask
    full: Competitor
    design: Competitor
    rivals: tuple[Competitor, ...]
    pattern: PatternQuality | None = None
    looked_at: tuple[Alternative, ...] = ()

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Comparisons of the design with the structures of `ALTERNATIVE_WORDS` in `rivals`, then in `looked_at`."""
        judged = judged_alternatives(self.design, self.rivals)
        return judged + tuple(entry for entry in self.looked_at if entry.name not in {two.name for two in judged})

    def with_alternatives(self) -> Self:
        """Return this comparison with the missing structures of `ALTERNATIVE_WORDS` added, computed by fast solves."""
        missing = [name for name in ALTERNATIVE_WORDS if name not in {rival.name for rival in self.rivals}]
        structure = self.design.structure
        if not (structure and missing):
            return self
        solved = self.design.judgement.solved if self.design.judgement else None
        return replace(self, looked_at=alternatives(self.task, structure, missing, solved))

    @property
    def competitors(self) -> tuple[Competitor, ...]:
        """The uncut sheet, the design, and the other structures in the requested order."""
        return (self.full, self.design, *self.rivals)

    def __getitem__(self, name: str) -> Competitor:
        return next(competitor for competitor in self.competitors if competitor.name == name)

    def gain(self, name: str) -> float:
        """Return compliance of a structure / compliance of the design (above 1: the design is stiffer), or nan."""
        rival, design_compliance = self[name].compliance, self.design.compliance
        if np.isfinite(design_compliance):
            return rival / design_compliance
        return 0.0 if np.isfinite(rival) else float("nan")

    def __repr__(self) -> str:
        """Return a table of all structures: name, compliance, compliance divided by the design's, and mass."""
        rows = []
        for entry in self.competitors:
            values = (f"{entry.compliance:.4g} J", f"{self.gain(entry.name):.3g} x the design's", mass(entry.mass))
            carries = np.isfinite(entry.compliance)
            rows.append((entry.name, *(values if carries else ("does not carry the loads", "", ""))))
        lost = losing_line(self.alternatives)
        head = f"{sentence(lost)}\n" if lost else ""
        return head + table((f"Comparison of {self.name}", "compliance", "", "mass"), rows)

    def record(self) -> dict[str, Any]:
        """Return the comparison as plain values for a file, in SI units."""
        return {
            "name": self.name,
            "alternatives": [entry.record() for entry in self.alternatives],
            "competitors": [entry.row(self.full.compliance, self.design.compliance) for entry in self.competitors],
        }


def comparison(
    design: Design,
    against: Iterable[str] = DEFAULT,
    judge: Judge = quick,
    report: NameReport | None = None,
    rival_judge: Judge | None = None,
    refuse: bool = True,
) -> Comparison:
    """Compare the compliance of a design's cut sheet with that of other structures of the same mass.
    against : names of the other structures, in `BASELINES`.    judge : function that solves the design and uncut sheet.
    rival_judge : function that solves the other structures, `judge` by default. It solves only the stiffest variant.
    report : function that is called with the name of each other structure before the structure is made.
    refuse : True to raise an error if the design does not carry its loads; else `Comparison.design` has the error.
    Raises StaticsError if the design does not carry its loads, and DsfabError for unknown names."""
    rivals = baselines_by_name(against)
    try:
        slicing, thickness = design.slicing, design.preset.statics.thickness
    except DsfabError as error:
        if refuse:
            raise
        task, uncut = ComparisonTask.from_design(design, design.surface.area), Competitor("design", error=str(error))
        return _comparison(task, uncut, {}, (judge, judge), report)
    task = ComparisonTask.from_design(design, slicing.sheet.surface.area)
    structure = Structure(slicing.cells, design.pattern.names, slicing.sheet, len(slicing.pieces), thickness)
    entered = _competitor(task, "design", [Variant("", lambda: structure)], judge, refuse)
    compared = _comparison(task, entered, rivals, (judge, rival_judge or judge), report)
    return replace(compared, pattern=design.quality())


def compare_at(
    design: Design,
    share: float,
    against: Iterable[str] = DEFAULT,
    judge: Judge = quick,
    report: NameReport | None = None,
) -> Comparison:
    """Compare a design with other structures at a given mass: material covers the fraction `share` of the surface.
    The design's stripe widths are scaled to this fraction. If the design fails, `Comparison.design` has the error.
    against : names of the other structures, in `BASELINES`.    judge : function that solves all structures.
    Raises DsfabError for unknown names, or if `share` is not between 0 and 1."""
    rivals = baselines_by_name(against)
    if not 0 < share < 1:
        raise DsfabError(f"the share {share:g} of the surface that is material must lie between 0 and 1")
    task = ComparisonTask.from_design(design, share * design.surface.area)
    variant = Variant("", lambda: striped_structure(task, task.preset, task.diffusion, task.even))
    return _comparison(task, _competitor(task, "design", [variant], judge), rivals, (judge, judge), report)


def _comparison(
    task: ComparisonTask,
    design: Competitor,
    rivals: dict[str, Baseline],
    judges: tuple[Judge, Judge],
    report: NameReport | None,
) -> Comparison:
    full_variant = Variant("", lambda: Structure.uncut(task.surface, task.preset.statics.thickness))
    full = _competitor(task, "full", [full_variant], _without_answers(judges[0]), refuse=True)
    entered = []
    for name, baseline in rivals.items():
        if report:
            report(name)
        start = time.perf_counter()
        try:
            variants = baseline(task)
        except DsfabError as error:
            entered.append(Competitor(name, error=str(error), seconds=time.perf_counter() - start))
            continue
        late = time.perf_counter() - start
        rival = _competitor(task, name, variants, _without_answers(judges[1]))
        entered.append(replace(rival, seconds_made=rival.seconds_made + late, seconds=rival.seconds + late))
    return Comparison(task.preset.name, task, full, design, tuple(entered))


def _without_answers(judge: Judge) -> Judge:
    """Return a function that solves as `judge` does, but discards displacements and stresses to save memory."""
    return _quick_judgement if judge is quick else lambda task, structure: replace(judge(task, structure), solved={})


def _quick_judgement(task: ComparisonTask, structure: Structure) -> Judgement:
    return replace(quick(task, structure), solved={})


def _competitor(
    task: ComparisonTask, name: str, variants: Sequence[Variant], judge: Judge, refuse: bool = False
) -> Competitor:
    start, making, solved_variants, errors = time.perf_counter(), 0.0, [], []
    several, structure = len(variants) > 1, None
    for variant in variants:
        before = time.perf_counter()
        try:
            structure = variant.make()
            making += time.perf_counter() - before
            solved_variants.append((variant.says, structure, (_quick_judgement if several else judge)(task, structure)))
        except DsfabError as error:
            if refuse:
                raise
            errors.append(str(error))
    values = [judgement.compliance for _, _, judgement in solved_variants]
    spread = Spread.from_compliances([*values, *(float("inf") for _ in errors)]) if several else None
    if not solved_variants:
        reason = f"none of {len(errors)} variants carries the loads; the first: {errors[0]}" if several else errors[0]
        lost = Competitor(name, spread=spread, error=reason, seconds_made=making, seconds=time.perf_counter() - start)
        return lost if several or structure is None else _with_measures(task, lost, structure)
    says, structure, judgement = solved_variants[int(np.argmin(values))]
    try:
        judgement = judge(task, structure) if several and judge is not _quick_judgement else judgement
    except DsfabError as error:
        return Competitor(name, says, spread=spread, error=str(error), seconds=time.perf_counter() - start)
    entered = Competitor(name, says, judgement=judgement, spread=spread, seconds_made=making)
    return replace(_with_measures(task, entered, structure), seconds=time.perf_counter() - start)


def _with_measures(task: ComparisonTask, entered: Competitor, structure: Structure) -> Competitor:
    area = structure.sheet.surface.area
    return replace(
        entered,
        area_fraction=area / task.surface.area,
        mass=area * structure.thickness * task.preset.statics.density,
        thickness=structure.thickness,
        pieces=structure.pieces,
        loose=structure.loose,
        smallest_member=_smallest_member(structure),
        structure=structure,
    )


def _smallest_member(structure: Structure) -> float | None:
    if structure.cells is structure.sheet:  # an uncut sheet
        return None
    member = features(structure.cells, kept_cells(structure.cells, structure.sheet), structure.names).member
    return None if member is None else member.size


SECONDS_PER_TRIANGLE = {True: 4e-4, False: 1.7e-3}  # in a full check; True: flat sheet with loads in its plane
Level = Literal["quick", "full"]


@dataclass(frozen=True)
class Checks:
    """Options for solving the structures of a comparison.
    level  : "quick" (one solve) or "full" (several meshes, with an error bound). None means full for the design, and
             also full for the other structures if all solves take less than a minute.
    ask    : requested numbers of frequencies and buckling factors.    memory : limit of a full check, bytes."""

    level: str | None = None
    ask: ResultRequest | None = None
    memory: float = BUDGET
    progress: Progress = silent

    def judge(self, depth: str, every: bool = False) -> Judge:
        """Return the function that computes the compliance of a structure.
        depth : "quick" (one solve), "full" (several meshes), or "whole": full for uncut sheets, quick for cut sheets.
        every : True to solve all load cases; False to solve only the cases whose stresses determine the pattern."""
        if depth == "whole":
            return _full_for_whole_sheets(self.judge("full"), self.judge("quick"))
        if depth == "full":
            return partial(full, ask=self.ask, every=every, budget=self.memory, progress=self.progress)
        return partial(quick, ask=self.ask, every=every) if self.ask or every else quick


class Judges(NamedTuple):
    """Functions that compute compliances: of a design in all load cases (`own`), and of other structures (`rival`).
    told : message that structures with openings are solved only once; '' if all structures are solved alike."""

    own: Judge
    rival: Judge
    told: str = ""


def compare(
    design: Design, against: Iterable[str] = DEFAULT, level: Level | None = None, progress: Progress = silent
) -> Comparison:
    """Compare the compliance of a design's cut sheet with that of other structures of the same mass.
    against : names of these structures in `dsfab.study.baselines.BASELINES`.
    level   : "quick": one solve of each sheet. "full": solves on finer and finer meshes, with an error bound.
              None: full for the design, and also for the other structures if all solves take less than a minute.
    Raises StaticsError if the design does not carry its loads, and DsfabError for unknown names."""
    names = tuple(against)
    design_judge, rival, _ = judges(design, names, Checks(level, progress=progress))
    return comparison(design, names, design_judge, partial(progress, "compare"), rival).with_alternatives()


def judges(design: Design, against: Iterable[str], checks: Checks) -> Judges:
    """Return the functions that compute the compliances of a design and of the structures compared with the design.
    against : names of these structures in `BASELINES`.    checks : options for solving the structures."""
    names = tuple(baselines_by_name(against))
    if checks.level is None and _can_be_cut(design):
        plane = flat_axis(design.surface, *(case.load for case in design.statics.cases.values())) is not None
        whole_sheets = 1 + ("thinner" in names)
        triangles = whole_sheets * design.surface.m + (2 + len(names) - whole_sheets) * design.sheet.surface.m
        seconds = SECONDS_PER_TRIANGLE[plane] * triangles  # time on one core with two meshes
        if seconds > 60:
            reason = f"full checks would take {seconds:.0f} s, so dsfab solves competitors with openings only once"
            return Judges(checks.judge("full", True), checks.judge("whole"), reason)
    depth = checks.level or "full"
    return Judges(checks.judge(depth, True), checks.judge(depth))


def full_at_many_shares(memory: float = BUDGET) -> Judge:
    """Return a function that checks a structure as `full` does, and caches its results for uncut sheets.
    Use the function for several comparisons of the same surface. memory : bytes that the solver may use."""
    judge = partial(full, budget=memory)
    return _full_for_whole_sheets(judge, judge)


def _can_be_cut(design: Design) -> bool:
    try:
        return bool(design.sheet)
    except DsfabError:
        return False


def _full_for_whole_sheets(whole_judge: Judge, cut: Judge) -> Judge:
    judgements: dict[float, Judgement] = {}

    def judge(task: ComparisonTask, structure: Structure) -> Judgement:
        if structure.cells is not structure.sheet:
            return cut(task, structure)
        if structure.thickness not in judgements:
            judgements[structure.thickness] = _without_answers(whole_judge)(task, structure)
        return judgements[structure.thickness]

    return judge
