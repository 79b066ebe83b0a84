"""By what designs are compared: one solve, or finer and finer meshes where that takes less than a minute."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

from dsfab.errors import DsfabError, StaticsError
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress, silent
from dsfab.statics import Ask, flat_axis
from dsfab.study.baselines import DEFAULT, ComparisonTask, Structure, chosen
from dsfab.study.comparison import Comparison, comparison
from dsfab.study.judging import Carried, Judge, Judgement, quick, utilisation
from dsfab.study.verdict import BUDGET, LoadedSurface, ModeIntervals, Verdict, check, mode_intervals
from dsfab.study.verdict.stresses import Extreme

TRIANGLE = {True: 4e-4, False: 1.7e-3}
"""Seconds of a full check for each triangle of the mesh as it is cut, in the plane and bent: measured on two meshes."""


def seconds_needed(triangles: int, plane: bool) -> float:
    """What a full check takes on one core, about; four times as much where a third mesh is needed."""
    return TRIANGLE[plane] * triangles


def full(
    task: ComparisonTask,
    structure: Structure,
    ask: Ask | None = None,
    every: bool = False,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> Judgement:
    """`quick`, whose compliance is replaced by the verdict of `dsfab.study.verdict.check`, and whose buckling and
    frequency by those of `dsfab.study.verdict.mode_intervals`, with their bounds.

    Stress is that of its finest mesh; displacements and reactions stay those of the mesh as it is cut. Where nothing
    could be solved within the budget, all stay, the compliance with its bound.

    every : judge each case and combination. One that is not carried, and that the pattern does not follow, makes the
            verdict `fail`.
    ask   : as for `quick`.         budget : bytes.

    Raises StaticsError when the structure does not carry the loads that its pattern follows.
    """
    try:
        first = quick(task, structure, None, every)
    except StaticsError as error:
        if not every or set(task.all_loads) == set(task.loads):
            raise
        told = f"it carries what its pattern follows, but not every load case: {error}"
        return replace(full(task, structure, ask, False, budget, progress), verdict="fail", reason=told)
    statics = task.preset.statics
    made = statics.sheet(structure.thickness)
    loads = task.loads_on(structure, every)
    setting = LoadedSurface(task.surface, made, loads)
    found = check(setting, structure.drawn, "full", budget, progress)
    if found.status == "fail":
        raise StaticsError(found.reason)
    if ask and ask.modes:
        modes = mode_intervals(setting, structure.drawn, ask, budget, progress)
        first = replace(first, cases={name: _with_modes(case, name, modes) for name, case in first.cases.items()})
    if not found.levels:
        return replace(first, verdict="unknown", reason=f"{found.reason}; {first.reason}")
    last, strength = found.levels[-1], statics.strength
    cases = {
        name: _with_stress(case, last.stresses[name], last.triangles, strength) for name, case in first.cases.items()
    }
    value, bound = _together(task, found)
    judged = replace(first, compliance=value, bound=bound, verdict=found.status, cases=cases)
    return replace(judged, reason=found.reason, check=found)


def _with_stress(case: Carried, found: Mapping[str, Extreme], triangles: int, strength: float) -> Carried:
    """The answer to one load with the stress of a mesh of its verdict, of so many triangles."""
    return replace(
        case,
        stress=found["stress"],
        tension=found["tension"],
        compression=found["compression"],
        utilisation=utilisation(found["stress"], strength),
        triangles=triangles,
    )


def _with_modes(case: Carried, name: str, modes: ModeIntervals) -> Carried:
    """The answer to one load with what the meshes say of its buckling and of the frequency; one mesh has no bound."""
    factor, hertz = modes.buckling.get(name), modes.hertz
    return replace(
        case,
        buckling=factor.value if factor else None,
        buckling_bound=factor.known if factor else None,
        frequency=hertz.value if hertz else None,
        frequency_bound=hertz.known if hertz else None,
        refusals=(*case.refusals, *modes.refusals),
        assumed=modes.assumed,
    )


def _together(task: ComparisonTask, found: Verdict) -> tuple[float, float]:
    """Compliance, J, of what the pattern follows, with its weights; and the bound, a share."""
    cases = [(weight, found.case(name)) for name, weight in task.preset.followed.items()]
    value = sum(weight * case.value for weight, case in cases)
    return value, sum(weight * case.value * case.bound for weight, case in cases) / value


PATIENCE = 60.0
"""Seconds that full checks may take in all where no level is asked for."""

Level = Literal["quick", "full"]


@dataclass(frozen=True)
class Checks:
    """How deep each is looked at.

    level  : quick or full; None is full for the design, and for what it is compared with if all take under a minute.
    ask    : answers besides the compliance.        memory : bytes that the solver may take for a full check.
    """

    level: str | None = None
    ask: Ask | None = None
    memory: float = BUDGET
    progress: Progress = silent

    def judge(self, depth: str, every: bool = False) -> Judge:
        """depth : quick, full, or whole: full for whole sheets, on whose meshes one solve is far off, quick for others.
        every : whether all cases are judged.
        """
        if depth == "whole":
            return _full_for_whole_sheets(self.judge("full"), self.judge("quick"))
        if depth == "full":
            return partial(full, ask=self.ask, every=every, budget=self.memory, progress=self.progress)
        return partial(quick, ask=self.ask, every=every) if self.ask or every else quick


class Judges(NamedTuple):
    """Of the design, each case, and of its competitors; and where these are judged by one solve only, why, or ''."""

    own: Judge
    rival: Judge
    told: str = ""


def compare(
    design: Design, against: Iterable[str] = DEFAULT, level: Level | None = None, progress: Progress = silent
) -> Comparison:
    """The design's compliance on its own cut sheet, beside competitors of the same mass, as `dsfab compare` has it.

    against : names of `dsfab.study.baselines.BASELINES`.
    level   : quick, one solve each; full, on finer and finer meshes, for a compliance with a tested bound; None is full
              for the design, and for the competitors too if all take less than a minute.

    Raises StaticsError when the design itself does not carry its loads, DsfabError for names of no baseline.
    """
    names = tuple(against)
    own, rival, _ = judges(design, names, Checks(level, progress=progress))
    return comparison(design, names, own, partial(progress, "compare"), rival)


def judges(design: Design, against: Iterable[str], checks: Checks) -> Judges:
    """Who looks at the design and its competitors, whose names are `against`."""
    names = tuple(chosen(against))
    if checks.level is None and _cuts(design):
        plane = flat_axis(design.surface, *(case.load for case in design.statics.cases.values())) is not None
        whole = 1 + ("thinner" in names)
        triangles = whole * design.surface.m + (2 + len(names) - whole) * design.sheet.surface.m
        seconds = seconds_needed(triangles, plane)
        if seconds > PATIENCE:
            told = f"full checks of all would take about {seconds:.0f} s: those that are cut are judged by one solve"
            return Judges(checks.judge("full", True), checks.judge("whole"), told)
    depth = checks.level or "full"
    return Judges(checks.judge(depth, True), checks.judge(depth))


def _cuts(design: Design) -> bool:
    """Whether its pattern can be cut at all."""
    try:
        return bool(design.sheet)
    except DsfabError:
        return False


def _full_for_whole_sheets(whole: Judge, cut: Judge) -> Judge:
    """`whole` for what is not cut, once for each thickness, and `cut` for the rest."""
    known: dict[float, Judgement] = {}

    def judge(task: ComparisonTask, made: Structure) -> Judgement:
        if made.cells is not made.sheet:
            return cut(task, made)
        if made.thickness not in known:
            known[made.thickness] = whole(task, made)
        return known[made.thickness]

    return judge
