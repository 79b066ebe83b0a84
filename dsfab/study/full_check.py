"""`full`: the judge that looks at finer and finer meshes."""

from collections.abc import Mapping
from dataclasses import replace

from dsfab.errors import StaticsError
from dsfab.pipeline import Progress
from dsfab.statics import Ask
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judging import Carried, Judgement, quick, utilisation
from dsfab.study.verdict import BUDGET, LoadedSurface, ModeIntervals, Verdict, check, mode_intervals
from dsfab.study.verdict.stresses import Extreme


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
    found = check(setting, structure.drawn, "full", budget, progress, structure.cells)
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
    value, bound, theory = _together(task, found)
    judged = replace(first, compliance=value, bound=bound, theory=theory, verdict=found.status, cases=cases)
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


def _together(task: ComparisonTask, found: Verdict) -> tuple[float, float, float]:
    """Compliance, J, of what the pattern follows, with its weights; the bound and what theory leaves out, shares."""
    cases = [(weight, found.case(name)) for name, weight in task.preset.followed.items()]
    value = sum(weight * case.value for weight, case in cases)
    bound = sum(weight * case.value * case.bound for weight, case in cases) / value
    return value, bound, sum(weight * case.value * case.theory for weight, case in cases) / value
