"""`full`: the judge that looks at finer and finer meshes."""

from dataclasses import replace

from dsfab.errors import StaticsError
from dsfab.pipeline.log import Progress
from dsfab.statics import Ask
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judging import Judgement, quick
from dsfab.study.verdict import BUDGET, LoadedSurface, Verdict, check


def full(
    task: ComparisonTask,
    structure: Structure,
    ask: Ask | None = None,
    every: bool = False,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> Judgement:
    """`quick`, whose compliance is replaced by the verdict of `dsfab.study.verdict.check`.

    Stress, displacements and reactions stay those of the mesh as it is cut. Where nothing could be solved within the
    budget, the compliance stays too, with its bound.

    every : judge each case and combination. One that is not carried, and that the pattern does not follow, makes the
            verdict `fail`.
    ask   : as for `quick`.         budget : bytes.

    Raises StaticsError when the structure does not carry the loads that its pattern follows.
    """
    try:
        first = quick(task, structure, ask, every)
    except StaticsError as error:
        if not every or set(task.all_loads) == set(task.loads):
            raise
        told = f"it carries what its pattern follows, but not every load case: {error}"
        return replace(full(task, structure, ask, False, budget, progress), verdict="fail", reason=told)
    statics = task.preset.statics
    made = statics.sheet(structure.thickness)
    loads = task.loads_on(structure, every)
    found = check(LoadedSurface(task.surface, made, loads), structure.drawn, "full", budget, progress)
    if found.status == "fail":
        raise StaticsError(found.reason)
    if not found.levels:
        return replace(first, verdict="unknown", reason=f"{found.reason}; {first.reason}")
    value, bound = _together(task, found)
    return replace(first, compliance=value, bound=bound, verdict=found.status, reason=found.reason, check=found)


def _together(task: ComparisonTask, found: Verdict) -> tuple[float, float]:
    """Compliance, J, of what the pattern follows, with its weights; and the bound, a share."""
    cases = [(weight, found.case(name)) for name, weight in task.preset.followed.items()]
    value = sum(weight * case.value for weight, case in cases)
    return value, sum(weight * case.value * case.bound for weight, case in cases) / value
