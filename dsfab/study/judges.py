"""Functions that solve a structure on one mesh or several: compliance, displacements and stress."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from dsfab.core.arrays import point_tuple
from dsfab.core.errors import StaticsError
from dsfab.core.limits import Status
from dsfab.design import Progress, acting_on, loads_on, sheet_loads
from dsfab.statics import (
    Equilibrium,
    ResultRequest,
    SheetStress,
    frequencies,
    lowest_buckling,
    mass_of_loads,
    mode_supports,
    sheet_stress,
    solve_for,
)
from dsfab.statics.boundary_conditions import all_clamped
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.carrying import support_shares
from dsfab.study.verdict import BUDGET, LoadedSurface, ModeIntervals, Verdict, check, estimates, mode_intervals
from dsfab.study.verdict.estimates import Extreme, quantile, stress_extremes
from dsfab.surface import LoadCase


@dataclass(frozen=True)
class CaseResponse:
    """Response of a sheet to a load.
    compliance   : joules.     displacement : largest displacement (m) and the point where it occurs.
    stress, tension, compression : largest von Mises, tensile and compressive stress (Pa).
    utilisation  : two values of stress / strength: not exceeded on 99 % of the area; largest away from corners.
    reactions    : (3,) force of each support, newtons, in the order of surface.support.
    buckling     : lowest buckling factor, or None.     frequency : lowest natural frequency (Hz), or None.
    buckling_bound, frequency_bound : relative error bounds; None if only one mesh was solved.
    local        : message if only a small part of the sheet buckles, or ''."""

    compliance: float
    displacement: Extreme
    tension: Extreme
    compression: Extreme
    stress: Extreme
    utilisation: tuple[float, float] | None
    reactions: tuple[tuple[float, float, float], ...]
    imbalance: float
    residual: float
    buckling: float | None = None
    frequency: float | None = None
    refusals: tuple[str, ...] = ()
    assumed: str = ""
    local: str = ""
    buckling_bound: float | None = None
    frequency_bound: float | None = None
    triangles: int = 0


@dataclass(frozen=True, eq=False)
class AnsweredLoad:
    """A load on a cut sheet, with the displacements and stress that it causes."""

    load: LoadCase
    equilibrium: Equilibrium
    stress: SheetStress


@dataclass(frozen=True)
class Judgement:
    """Computed compliance of a structure, response to each load, and verdict on the accuracy.
    compliance : weighted sum over the loads whose stress determines the pattern, joules.
    bound      : relative error bound of the compliance, or None.     cases : response to each load, by name.
    check      : result of solves on several meshes; None if only one mesh was solved.
    theory     : largest expected value of "compliance of the solid / compliance of the shell - 1", or None.
    solved     : solutions on the unrefined mesh, by name of the load; may be empty."""

    compliance: float
    cases: Mapping[str, CaseResponse]
    bound: float | None = None
    verdict: Status = "unknown"
    reason: str = ""
    check: Verdict | None = None
    theory: float | None = None
    solved: Mapping[str, AnsweredLoad] = field(default_factory=dict, compare=False, repr=False)

    @property
    def level(self) -> Literal["quick", "full"]:
        return "full" if self.check else "quick"

    def solid_loss(self, power: float) -> float:
        """Return the fraction by which a buckling factor or frequency of the solid is below that of the shell model.
        power : 1 for buckling factors, 0.5 for frequencies."""
        return float(1 - (1 + (self.theory or 0.0)) ** -power)

    def worst(self, name: str) -> Extreme:
        """Return the largest `displacement`, `tension`, `compression` or `stress` (the `name`) of all load cases."""
        extremes: list[Extreme] = [getattr(case, name) for case in self.cases.values()]
        return max(extremes, key=lambda extreme: extreme.settled)


Judge = Callable[[ComparisonTask, Structure], Judgement]  # solves a structure; DsfabError if a load has no support


def solved_loads(task: ComparisonTask, structure: Structure, every: bool = False) -> dict[str, AnsweredLoad]:
    """Solve the sheet of a structure for each load whose stress determines the pattern.
    every : True to solve all cases and combinations. Raises StaticsError if the structure does not carry a load."""
    statics, surface = task.preset.statics, structure.sheet.surface
    loads = sheet_loads(task.surface, structure.material, structure.sheet, task.loads_on(structure, every))
    sheet = statics.sheet(structure.thickness).model_for(surface)
    answers = solve_for(sheet, loads, "displacement")
    return {
        name: AnsweredLoad(loads[name], answer, sheet_stress(sheet, answer.elements, answer))
        for name, answer in answers.items()
    }


def quick(
    task: ComparisonTask,
    structure: Structure,
    ask: ResultRequest | None = None,
    every: bool = False,
    solved: Mapping[str, AnsweredLoad] | None = None,
) -> Judgement:
    """Compute compliance, stress and displacements by one solve on the unrefined mesh, without a verdict.
    ask   : requested numbers of frequencies and buckling factors.
    every : True for all cases and combinations; False for the loads whose stress determines the pattern.
    solved : earlier solutions by name of the load. Raises StaticsError if the structure does not carry a load."""
    answers, request = solved or solved_loads(task, structure, every), ask or ResultRequest()
    cases = {name: _case_response(task, structure, answered, request) for name, answered in answers.items()}
    total = sum(weight * cases[name].compliance for name, weight in task.preset.followed_weights.items())
    typical, largest = estimates.QUICK_ERRORS
    text = (
        f"one solve on the cut mesh gives no verdict: the median error is {typical:.0%}, and 90 % of errors are below "
        f"{largest:.0%}"
    )
    if structure.cells is structure.sheet and not task.is_plane:
        largest, text = (
            0.5,
            "one solve on the uncut mesh gives no verdict: errors reached a third in tests, and may be larger",
        )
    return Judgement(total, cases, bound=largest, reason=text, solved=answers)


def _case_response(
    task: ComparisonTask, structure: Structure, answered: AnsweredLoad, request: ResultRequest
) -> CaseResponse:
    load, answer, stress = answered.load, answered.equilibrium, answered.stress
    statics, surface = task.preset.statics, structure.sheet.surface
    moved = np.linalg.norm(answer.u, axis=1)
    stresses = stress_extremes(surface, stress, load.supported)
    return CaseResponse(
        answer.compliance,
        Extreme(float(moved.max()), point_tuple(surface.V[moved.argmax()]), quantile(moved, surface.vertex_areas)),
        stresses["tension"],
        stresses["compression"],
        stresses["stress"],
        utilisation(stresses["stress"], statics.strength),
        _reactions(task, structure, answer),
        answer.imbalance,
        answer.residual,
        *_modes(task, structure, load, answer, request),
        triangles=surface.m,
    )


def utilisation(stress: Extreme, strength: float) -> tuple[float, float] | None:
    """Return two values of stress / strength; None if the strength (Pa) is 0.
    The first stress is not exceeded on 99 % of the area. The second stress is the largest away from corners."""
    return (stress.quantile / strength, stress.settled / strength) if strength else None


def _reactions(
    task: ComparisonTask, structure: Structure, answer: Equilibrium
) -> tuple[tuple[float, float, float], ...]:
    shares = support_shares(acting_on(task.preset, task.surface).support, task.surface, structure.sheet)
    return tuple(point_tuple((answer.reaction * share).sum(axis=0)) for share in shares)


def _modes(
    task: ComparisonTask, structure: Structure, load: LoadCase, answer: Equilibrium, request: ResultRequest
) -> tuple[float | None, float | None, tuple[str, ...], str, str]:
    sheet = task.preset.statics.sheet(structure.thickness).model_for(structure.sheet.surface)
    factor, local, hertz, refusals = None, "", None, []
    if not request.modes:
        return None, None, (), "", ""
    standing = mode_supports(sheet.surface, load)
    try:
        if request.buckling:
            factor, local = lowest_buckling(sheet, standing.load, answer)
    except StaticsError as error:
        refusals.append(f"no buckling factor: {error}")
    try:
        if request.frequencies:
            masses = mass_of_loads(loads_on(task.surface, structure.sheet, task.permanent).values())
            moving = replace(sheet, clamped=all_clamped(standing.load), carried=masses)
            hertz = float(frequencies(moving, standing.load.fixed, 1, spring=load.spring).hertz[0])
    except StaticsError as error:
        refusals.append(f"no natural frequency: {error}")
    return factor, hertz, tuple(refusals), standing.told, local


def full(
    task: ComparisonTask,
    structure: Structure,
    ask: ResultRequest | None = None,
    every: bool = False,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> Judgement:
    """Compute compliance, buckling factors and frequencies on finer and finer meshes, with error bounds.
    budget : memory, bytes. If the memory is too small, the result is that of `quick`.    ask, every : as for `quick`.
    Raises StaticsError if the structure does not carry the loads whose stress determines its pattern."""
    try:
        quick_judgement = quick(task, structure, None, every)
    except StaticsError as error:
        if not every or set(task.all_loads) == set(task.loads):
            raise
        text = f"the sheet carries the loads that its pattern follows, but not every load case: {error}"
        return replace(full(task, structure, ask, False, budget, progress), verdict="fail", reason=text)
    statics = task.preset.statics
    model, loads = statics.sheet(structure.thickness), task.loads_on(structure, every)
    setting = LoadedSurface(task.surface, model, loads, task.permanent)
    checked = check(setting, structure.material, "full", budget, progress, structure.cells)
    if checked.status == "fail":
        raise StaticsError(checked.reason)
    if ask and ask.modes:
        modes = mode_intervals(setting, structure.material, ask, budget, progress)
        with_modes = {name: _with_modes(case, name, modes) for name, case in quick_judgement.cases.items()}
        quick_judgement = replace(quick_judgement, cases=with_modes)
    if not checked.levels:
        return replace(quick_judgement, verdict="unknown", reason=f"{checked.reason}; {quick_judgement.reason}")
    finest, strength = checked.levels[-1], statics.strength
    cases = {
        name: _with_stress(case, finest.stresses[name], finest.triangles, strength)
        for name, case in quick_judgement.cases.items()
    }
    weighted = [(weight, checked.case(name)) for name, weight in task.preset.followed_weights.items()]
    value = sum(weight * case.value for weight, case in weighted)
    bound = sum(weight * case.value * case.bound for weight, case in weighted) / value
    theory = sum(weight * case.value * case.theory for weight, case in weighted) / value
    judged = replace(quick_judgement, compliance=value, bound=bound, theory=theory, verdict=checked.status, cases=cases)
    return replace(judged, reason=checked.reason, check=checked)


def _with_stress(case: CaseResponse, extremes: Mapping[str, Extreme], triangles: int, strength: float) -> CaseResponse:
    return replace(
        case,
        stress=extremes["stress"],
        tension=extremes["tension"],
        compression=extremes["compression"],
        utilisation=utilisation(extremes["stress"], strength),
        triangles=triangles,
    )


def _with_modes(case: CaseResponse, name: str, modes: ModeIntervals) -> CaseResponse:
    factor, hertz = modes.buckling.get(name), modes.hertz
    return replace(
        case,
        buckling=factor.value if factor else None,
        buckling_bound=factor.finite_bound if factor else None,
        frequency=hertz.value if hertz else None,
        frequency_bound=hertz.finite_bound if hertz else None,
        refusals=(*case.refusals, *modes.refusals),
        assumed=modes.assumed,
        local=modes.local.get(name, ""),
    )
