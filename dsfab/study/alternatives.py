"""Comparison of a design with other structures of the same mass."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.design import Design, sheet_loads
from dsfab.design.mode_search import Trial
from dsfab.preset.model import Preset
from dsfab.statics import solve_for
from dsfab.study.baselines import ComparisonTask, Structure, Variant
from dsfab.study.baselines.structures import isotropic_stripes, isotropic_variants
from dsfab.study.judges import AnsweredLoad, Judge, Judgement, full, quick


@dataclass(frozen=True)
class Spread:
    """Statistics of the compliances (J) of all variants of a structure.
    tried, carried : number of variants, and number of variants that carry the loads.
    best, mean, worst : compliances of the variants that carry the loads.
    median : median compliance of all variants. A variant that does not carry the loads has an infinite compliance."""

    tried: int
    carried: int
    best: float
    mean: float
    worst: float
    median: float

    @classmethod
    def from_compliances(cls, compliances: Sequence[float]) -> "Spread":
        """Return the statistics of compliances (J); inf for variants that do not carry the loads."""
        sound = [value for value in compliances if np.isfinite(value)]
        statistics = (min(sound), float(np.mean(sound)), max(sound)) if sound else (float("inf"),) * 3
        return cls(len(compliances), len(sound), *statistics, float(np.median(compliances)))


@dataclass(frozen=True)
class Competitor:
    """A structure that is compared with a design under the same loads. error : reason of a failure, or ''.
    variant         : name of the stiffest variant, such as "modes 1, 2".
    area_fraction   : material area divided by the area of the surface.     mass : kg.     thickness : metres.
    judgement       : computed results; None if the structure does not carry its loads.
    loose           : fraction of the material that is connected to no support.
    smallest_member : width of the narrowest member, metres, or None.
    spread          : statistics of the variants; None for a single variant."""

    name: str
    variant: str = ""
    area_fraction: float = float("nan")
    mass: float = float("nan")
    thickness: float = float("nan")
    judgement: Judgement | None = None
    pieces: int = 0
    loose: float = 0.0
    smallest_member: float | None = None
    spread: Spread | None = None
    seconds_made: float = 0.0
    seconds: float = 0.0
    error: str = ""
    structure: Structure | None = None

    @property
    def compliance(self) -> float:
        """Compliance in joules; inf if the structure does not carry its loads."""
        return self.judgement.compliance if self.judgement else float("inf")

    def row(self, full: float, design: float) -> dict[str, Any]:
        """Return this structure's row of the comparison table, in SI units; None for unknown values.
        full, design : compliances (J) of the uncut sheet and of the design."""
        columns: dict[str, Any] = {
            "name": self.name,
            "variant": self.variant,
            "area_fraction": _number(self.area_fraction),
            "mass_kg": _number(self.mass),
            "thickness_m": _number(self.thickness),
            "compliance_J": _number(self.compliance),
            "ratio_to_full": _number(self.compliance / full),
            "ratio_to_design": _number(self.compliance / design) if np.isfinite(design) else None,
        }
        failure = {"verdict": "fail", "reason": self.error} if self.structure else {}
        judgement_columns = _judgement_columns(self.judgement) if self.judgement else failure
        making_columns = {
            "pieces": self.pieces,
            "loose_share": self.loose,
            "smallest_member_m": self.smallest_member,
            "seconds_made": round(self.seconds_made, 3),
            "seconds": round(self.seconds, 3),
        }
        spread = vars(self.spread) if self.spread else {}
        spread_columns = {f"variants_{key}": _number(value) for key, value in spread.items()}
        return {**columns, **judgement_columns, **making_columns, **spread_columns, "error": self.error}


def _judgement_columns(judgement: Judgement) -> dict[str, Any]:
    columns = {key: getattr(judgement, key) for key in ("bound", "verdict", "reason", "level")}
    if judgement.theory is not None:
        columns["theory"] = judgement.theory
    for name, unit in (("displacement", "m"), ("tension", "Pa"), ("compression", "Pa"), ("stress", "Pa")):
        worst = judgement.worst(name)
        columns |= {f"{name}_{unit}": worst.value, f"{name}_at_m": worst.place, f"{name}_99_{unit}": worst.quantile}
        if worst.away is not None:
            settled = (getattr(case, name).settled for case in judgement.cases.values())
            columns[f"{name}_off_corners_{unit}"] = max(settled)
    cases = judgement.cases.values()
    shares = [case.utilisation for case in cases if case.utilisation]
    if shares:
        columns["utilisation_99"], columns["utilisation_off_corners"] = map(max, zip(*shares, strict=True))
    for name in ("buckling", "frequency"):
        bounded_values = [
            (value, getattr(case, f"{name}_bound")) for case in cases if (value := getattr(case, name)) is not None
        ]
        if bounded_values:
            value, bound = min(bounded_values, key=lambda bounded_value: bounded_value[0])
            columns |= {f"{name}{'_hz' if name == 'frequency' else '_factor'}": value, f"{name}_bound": bound}
    columns["reactions_N"] = {name: case.reactions for name, case in judgement.cases.items()}
    if refusals := [refusal for case in cases for refusal in case.refusals]:
        columns["refusals"] = "; ".join(refusals)
    if assumed := "; ".join(dict.fromkeys(case.assumed for case in cases if case.assumed)):
        columns["assumed"] = assumed
    if local := "; ".join(dict.fromkeys(case.local for case in cases if case.local)):
        columns["buckling_mode"] = local
    return columns | {name: max(getattr(case, name) for case in cases) for name in ("imbalance", "residual")}


def _number(value: float) -> float | int | None:
    return value if np.isfinite(value) else None


ALTERNATIVE_WORDS = {
    "thinner": "a uniformly thinner sheet without openings",
    "isotropic": "the best pair of isotropic stripes",
}
"""Descriptions of the structures that a design is compared with, by name. Messages contain these texts."""


@dataclass(frozen=True)
class Alternative:
    """Comparison of a design with another structure of the same mass, under the same loads.
    over      : compliance of the design / compliance of this structure; inf if the design does not carry its loads.
    low, high : limits of `over` from the error bounds of the compliances.
    level     : how the compliances were computed, such as "one solve each".    error : reason of a failure, or ''."""

    name: str
    over: float
    low: float
    high: float
    level: str
    variant: str = ""
    error: str = ""

    @property
    def is_stiffer(self) -> bool:
        """True if this structure is probably stiffer than the design."""
        return self.over > 1

    @property
    def sentence(self) -> str:
        """Sentence that compares the stiffness of this structure with that of the design."""
        which = f"{ALTERNATIVE_WORDS[self.name]} of the same mass"
        if not np.isfinite(self.over):
            return f"this design does not carry its loads, but {which} does"
        may = "may lose" if self.low <= 1 else "loses"
        between = f", {self.low:.3g} to {self.high:.3g}" if self.high > self.low else ""
        return f"this design {may}: {which} is {self.over:.3g} x as stiff ({self.level}{between})"

    def record(self) -> dict[str, Any]:
        """Return this comparison as a dict for a JSON file, with None for infinite values."""
        numbers = {"over": self.over, "over_low": self.low, "over_high": self.high}
        finite = {key: x if np.isfinite(x) else None for key, x in numbers.items()}
        verdict = {"design_loses": self.is_stiffer, "level": self.level, "variant": self.variant}
        return {"name": self.name, **finite, **verdict, **({"error": self.error} if self.error else {})}


def losing_line(candidates: Iterable[Alternative]) -> str:
    """Return a line about the structures in `candidates` that are stiffer than the design; '' if there are none."""
    stiffer = sorted((x for x in candidates if x.is_stiffer), key=lambda alternative: -alternative.over)
    return "; ".join(alternative.sentence for alternative in stiffer)


def is_searched(preset: Preset) -> bool:
    """Return True if dsfab searches for the method, modes, phases or widths of a pattern."""
    pattern = preset.pattern
    return pattern.method == "auto" or pattern.auto or pattern.width.rule == "stressed"


def design_alternatives(design: Design) -> tuple[Alternative, ...]:
    """Compare a design with other structures of the same mass. Raises DsfabError if the design cannot be cut."""

    def solve() -> tuple[Alternative, ...]:
        slicing, thickness = design.slicing, design.preset.statics.thickness
        structure = Structure(slicing.cells, design.pattern.names, slicing.sheet, len(slicing.pieces), thickness)
        return alternatives(ComparisonTask.from_design(design, slicing.sheet.surface.area), structure)

    return design.cached_result("slicing", "alternatives", solve)


def alternatives(
    task: ComparisonTask,
    structure: Structure,
    names: Sequence[str] = tuple(ALTERNATIVE_WORDS),
    solved: Mapping[str, AnsweredLoad] | None = None,
) -> tuple[Alternative, ...]:
    """Compare a structure with other structures of the same mass. names : keys of `ALTERNATIVE_WORDS`.
    solved : known solutions of the structure, by name of the load case."""
    makers = {"thinner": thinner_alternative, "isotropic": isotropic_alternative}
    return tuple(makers[name](task, structure, partial(quick, solved=solved)) for name in names)


class _BoundedCompliance(NamedTuple):
    """A compliance (J) with its relative error bound; inf for a structure that does not carry the loads."""

    compliance: float
    bound: float
    variant: str = ""
    error: str = ""


def thinner_alternative(task: ComparisonTask, structure: Structure, own_judge: Judge = quick) -> Alternative:
    """Compare a structure, solved by `own_judge`, with a thinner sheet without openings of the same mass."""
    thin = Structure.uncut(task.surface, task.share * task.preset.statics.thickness)
    design, rival = _ranked_compliance(task, structure), _judged_compliance(quick, task, thin)
    alternative = _alternative("thinner", design, rival, "one solve each")
    if alternative.low <= 1 <= alternative.high:
        judge, checked = (
            (quick, "one solve each") if task.is_plane else (full, "running the full check of the thinner sheet")
        )
        design, rival = _judged_compliance(own_judge, task, structure), _judged_compliance(judge, task, thin)
        alternative = _alternative("thinner", design, rival, checked)
    return alternative


def isotropic_alternative(task: ComparisonTask, structure: Structure, own_judge: Judge = quick) -> Alternative:
    """Compare a structure, solved by `own_judge`, with the stiffest isotropic stripe pattern of the same mass."""
    blind = isotropic_stripes(task)
    phases = blind.preset.pattern.major.shift, blind.preset.pattern.minor.shift
    level = f"one solve of each sheet; isotropic stripes are the best of {len(blind.pairs)} pairs of modes"
    try:
        trial = Trial(blind.preset, replace(task.stressed_surface, diffusion=blind.diffusion()))
    except DsfabError as error:
        failed = _BoundedCompliance(np.inf, 0.0, error=str(error))
        return _alternative("isotropic", _BoundedCompliance(0.0, 0.0), failed, level)
    tried = [trial.candidate(pair, phases) for pair in blind.pairs]
    variants = zip(tried, isotropic_variants(task, blind), strict=True)
    sound = (pair for pair in variants if not pair[0].refused)
    stiffest = sorted(sound, key=lambda pair: pair[0].compliance * pair[0].kept)
    rivals = [_variant_compliance(task, variant) for _, variant in stiffest[:2]]
    failed = _BoundedCompliance(
        np.inf, 0.0, error=f"no pair of modes carries the loads; reason for pair 1: {tried[0].refused}"
    )
    rival = min(rivals, key=lambda rival: rival.compliance, default=failed)._replace(bound=0.0)
    # the errors of the two compliances have equal signs, so the error of the ratio is at most 10 %
    return _alternative("isotropic", _judged_compliance(own_judge, task, structure)._replace(bound=0.1), rival, level)


def _variant_compliance(task: ComparisonTask, variant: Variant) -> _BoundedCompliance:
    try:
        return _judged_compliance(quick, task, variant.make())._replace(variant=variant.says)
    except DsfabError as error:
        return _BoundedCompliance(np.inf, 0.0, variant.says, str(error))


def judged_alternatives(design: Competitor, rivals: Iterable[Competitor]) -> tuple[Alternative, ...]:
    """Compare the design with those `rivals` that `ALTERNATIVE_WORDS` names, by their computed compliances."""
    design_value, judged = _competitor_compliance(design), []
    for rival in (rival for rival in rivals if rival.name in ALTERNATIVE_WORDS):
        level = f"{rival.judgement.level} check" if rival.judgement else ""
        judged.append(_alternative(rival.name, design_value, _competitor_compliance(rival), level))
    return tuple(judged)


def _competitor_compliance(competitor: Competitor) -> _BoundedCompliance:
    bound = competitor.judgement.bound if competitor.judgement else None
    return _BoundedCompliance(competitor.compliance, bound or 0.0, competitor.variant, competitor.error)


def _alternative(name: str, design: _BoundedCompliance, rival: _BoundedCompliance, level: str) -> Alternative:
    if not np.isfinite(rival.compliance):
        return Alternative(name, 0.0, 0.0, 0.0, level, error=rival.error)
    if not np.isfinite(design.compliance):
        return Alternative(name, np.inf, np.inf, np.inf, level, rival.variant)
    over = design.compliance / rival.compliance
    low = design.compliance * (1 - design.bound) / (rival.compliance * (1 + rival.bound))
    high = design.compliance * (1 + design.bound) / (rival.compliance * (1 - rival.bound))
    return Alternative(name, over, low, high, level, rival.variant)


def _ranked_compliance(task: ComparisonTask, structure: Structure) -> _BoundedCompliance:
    statics = task.preset.statics
    try:
        loads = sheet_loads(task.surface, structure.material, structure.sheet, task.loads_on(structure))
        answers = solve_for(statics.sheet(structure.thickness).model_for(structure.sheet.surface), loads, "ranking")
    except DsfabError as error:
        return _BoundedCompliance(np.inf, 0.0, error=str(error))
    total = sum(weight * answers[name].compliance for name, weight in task.preset.followed_weights.items())
    return _BoundedCompliance(total, 0.15)


def _judged_compliance(judge: Judge, task: ComparisonTask, structure: Structure) -> _BoundedCompliance:
    try:
        judgement = judge(task, structure)
    except DsfabError as error:
        return _BoundedCompliance(np.inf, 0.0, error=str(error))
    return _BoundedCompliance(judgement.compliance, judgement.bound or 0.0)
