"""Competitors of a design, and alternatives of its mass: a thinner sheet, stripes that ignore the stress."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.design import Design, sheet_loads
from dsfab.design.mode_search import Trial
from dsfab.preset.model import Preset
from dsfab.results import Candidate
from dsfab.statics import solve_for
from dsfab.study.baselines import ComparisonTask, Structure, Variant
from dsfab.study.baselines.structures import blind_stripes, blind_variants
from dsfab.study.judges import Judge, Judgement, full, quick


@dataclass(frozen=True)
class Spread:
    """Compliances of a competitor's variants, joules, by `quick`.

    tried, carried : variants, and those of them that carry the loads.      best, mean, worst : of these.
    median         : of all, those that carry nothing counted as infinitely soft.
    """

    tried: int
    carried: int
    best: float
    mean: float
    worst: float
    median: float

    @classmethod
    def of(cls, compliances: Sequence[float]) -> "Spread":
        """Infinite ones carry nothing."""
        sound = [value for value in compliances if np.isfinite(value)]
        told = (min(sound), float(np.mean(sound)), max(sound)) if sound else (float("inf"),) * 3
        return cls(len(compliances), len(sound), *told, float(np.median(compliances)))


@dataclass(frozen=True)
class Competitor:
    """A structure under the design's loads, or the reason (`error`) why there is none.

    variant         : which of several was the stiffest, such as "modes 1, 2".
    area_fraction   : of the surface; 1 for those that are not cut.       mass : kg.     thickness : metres.
    judgement       : None with an error.       pieces : of the sheet.      loose : share of the material left out.
    smallest_member : metres; None where there is none to be measured.
    spread          : over the variants, where there are several.
    seconds_made, seconds : of making all variants, and of making and judging them.
    structure       : what was judged, for those who want to draw it; with an error, what does not carry the loads, if
                      it is one structure.
    """

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
        """Joules; infinite where nothing carries the loads."""
        return self.judgement.compliance if self.judgement else float("inf")

    def _failed(self) -> dict[str, Any]:
        """Of a structure that does not carry the loads; nothing of one that could not be made."""
        return {"verdict": "fail", "reason": self.error} if self.structure else {}

    def row(self, full: float, design: float) -> dict[str, Any]:
        """One row of a table, SI units: plain values, None where they are unknown. `full`, `design`: joules of both."""
        known: dict[str, Any] = {
            "name": self.name,
            "variant": self.variant,
            "area_fraction": _number(self.area_fraction),
            "mass_kg": _number(self.mass),
            "thickness_m": _number(self.thickness),
            "compliance_J": _number(self.compliance),
            "ratio_to_full": _number(self.compliance / full),
            "ratio_to_design": _number(self.compliance / design) if np.isfinite(design) else None,
        }
        measured = _competitors_judged(self.judgement) if self.judgement else self._failed()
        made = {
            "pieces": self.pieces,
            "loose_share": self.loose,
            "smallest_member_m": self.smallest_member,
            "seconds_made": round(self.seconds_made, 3),
            "seconds": round(self.seconds, 3),
        }
        spread = vars(self.spread) if self.spread else {}
        apart = {f"variants_{key}": _number(value) for key, value in spread.items()}
        return {**known, **measured, **made, **apart, "error": self.error}


def _competitors_judged(judgement: Judgement) -> dict[str, Any]:
    """The columns of a judgement: the worst over the cases, and all reactions."""
    found: dict[str, Any] = {"bound": judgement.bound, "verdict": judgement.verdict, "reason": judgement.reason}
    found["level"] = judgement.level
    if judgement.theory is not None:
        found["theory"] = judgement.theory
    for name, unit in (("displacement", "m"), ("tension", "Pa"), ("compression", "Pa"), ("stress", "Pa")):
        worst = judgement.worst(name)
        found |= {f"{name}_{unit}": worst.value, f"{name}_at_m": worst.place, f"{name}_99_{unit}": worst.quantile}
        if worst.away is not None:
            found[f"{name}_off_corners_{unit}"] = max(getattr(case, name).settled for case in judgement.cases.values())
    cases = judgement.cases.values()
    shares = [case.utilisation for case in cases if case.utilisation]
    if shares:
        found["utilisation_99"], found["utilisation_off_corners"] = (
            max(column) for column in zip(*shares, strict=True)
        )
    for name, lowest in (("buckling", min), ("frequency", min)):
        known = [
            (value, getattr(case, f"{name}_bound")) for case in cases if (value := getattr(case, name)) is not None
        ]
        if known:
            value, bound = lowest(known, key=lambda one: one[0])
            found |= {f"{name}{'_hz' if name == 'frequency' else '_factor'}": value, f"{name}_bound": bound}
    found["reactions_N"] = {name: case.reactions for name, case in judgement.cases.items()}
    if refusals := [told for case in cases for told in case.refusals]:
        found["refusals"] = "; ".join(refusals)
    if assumed := "; ".join(dict.fromkeys(case.assumed for case in cases if case.assumed)):
        found["assumed"] = assumed
    found["imbalance"] = max(case.imbalance for case in cases)
    found["residual"] = max(case.residual for case in cases)
    return found


def _number(value: float) -> float | int | None:
    """Infinite and unknown numbers have no place in JSON."""
    return value if np.isfinite(value) else None


ALTERNATIVE_WORDS = {
    "thinner": "a uniformly thinner sheet without openings",
    "isotropic": "the best pair of isotropic stripes",
}
"""Alternatives of the same mass, and what they are called in a sentence."""

ALIKE = 0.1
"""Bound of the ratio of two cut sheets solved by the same elements, which err to the same side on both."""

JUDGED_PAIRS = 2
"""Of the pairs of modes so many are cut to the same mass and solved by better elements, the best by quick ones."""

RANKED = 0.15
"""Bound of the compliance of a cut sheet by the elements that rank: 5 to 15 % off, see `dsfab.study.sweeps.metrics`."""


@dataclass(frozen=True)
class Alternative:
    """Another structure of the mass of a design, under the same loads.

    over      : the design's compliance over its own: above 1 the design is the softer one. Infinite where the design
                does not carry its loads; 0 where the alternative does not.
    low, high : what `over` may be, by the bounds of both.      variant : which of several, such as "modes 1, 2".
    level     : how both were judged, in words.                 error : why there is none, or ''.
    """

    name: str
    over: float
    low: float
    high: float
    level: str
    variant: str = ""
    error: str = ""

    @property
    def is_stiffer(self) -> bool:
        """Whether the design loses to it, as far as is known."""
        return self.over > 1

    @property
    def sentence(self) -> str:
        """What to tell of a design that loses to it."""
        which = f"{ALTERNATIVE_WORDS[self.name]} of the same mass"
        if not np.isfinite(self.over):
            return f"this design does not carry its loads, and {which} does"
        may = "may lose" if self.low <= 1 else "loses"
        between = f", {self.low:.3g} to {self.high:.3g}" if self.high > self.low else ""
        return f"this design {may}: {which} is {self.over:.3g} x as stiff ({self.level}{between})"

    def record(self) -> dict[str, Any]:
        """Plain values for a file; None where they are infinite."""
        numbers = {"over": self.over, "over_low": self.low, "over_high": self.high}
        told = {"name": self.name, **{key: x if np.isfinite(x) else None for key, x in numbers.items()}}
        return {**told, "design_loses": self.is_stiffer, "level": self.level, "variant": self.variant} | (
            {"error": self.error} if self.error else {}
        )


def losing_line(found: Iterable[Alternative]) -> str:
    """The first line about a design that loses to an alternative, the worst loss first; '' where it loses to none."""
    return "; ".join(one.sentence for one in sorted(found, key=lambda one: -one.over) if one.is_stiffer)


def is_searched(preset: Preset) -> bool:
    """Whether something of the pattern is found by trying: a method, modes, phases, or widths that even out stress."""
    ask = preset.pattern
    return ask.method == "auto" or ask.auto or ask.width.rule == "stressed"


def design_alternatives(design: Design) -> tuple[Alternative, ...]:
    """Those of a design, by the quickest look that can tell; worked out once.

    Raises DsfabError of a design that cannot be cut.
    """

    def looked() -> tuple[Alternative, ...]:
        slicing, thickness = design.slicing, design.preset.statics.thickness
        own = Structure(slicing.cells, design.pattern.names, slicing.sheet, len(slicing.pieces), thickness)
        return alternatives(ComparisonTask.of(design, slicing.sheet.surface.area), own)

    return design.once("slicing", "alternatives", looked)


def alternatives(
    task: ComparisonTask, own: Structure, names: Sequence[str] = tuple(ALTERNATIVE_WORDS)
) -> tuple[Alternative, ...]:
    """Named alternatives beside a structure of the task's mass."""
    return tuple({"thinner": beside_thinner, "isotropic": beside_isotropic}[name](task, own) for name in names)


class _Known(NamedTuple):
    """A compliance, J, and by what share it may be off; infinite where the loads are not carried, which `error` says.
    variant : which of several."""

    compliance: float
    bound: float
    variant: str = ""
    error: str = ""

    @property
    def least(self) -> float:
        return self.compliance * (1 - self.bound)

    @property
    def most(self) -> float:
        return self.compliance * (1 + self.bound)


def beside_thinner(task: ComparisonTask, own: Structure) -> Alternative:
    """By one solve each, of the cut sheet by the elements that rank; where that cannot tell which is stiffer, by better
    elements for the cut sheet and, unless it lies in a plane, a full check of the thinner one: the mesh of a whole
    shell is coarse beside that of a cut one."""
    thin = Structure.uncut(task.surface, task.share * task.preset.statics.thickness)
    found = _beside("thinner", _ranked(task, own), _judged(quick, task, thin), "one solve each")
    if found.low <= 1 <= found.high:
        judge, checked = (quick, "one solve each") if task.is_plane else (full, "the sheet checked in full")
        found = _beside("thinner", _judged(quick, task, own), _judged(judge, task, thin), checked)
    return found


def beside_isotropic(task: ComparisonTask, own: Structure) -> Alternative:
    """Every pair of modes is cut once and solved as candidates of a search are. The best few are cut again to exactly
    the design's mass, and judged by better elements, as it is: members that bend in their plane, as those that ignore
    the stress do, look up to twice too stiff by the quick ones, and 1 % more material makes them 5 % stiffer."""
    blind = blind_stripes(task)
    phases = blind.preset.pattern.major.shift, blind.preset.pattern.minor.shift
    level = f"one solve each, best of {len(blind.pairs)} pairs"
    try:
        trial = Trial(blind.preset, replace(task.stressed, diffusion=blind.diffusion()))
    except DsfabError as error:
        return _beside("isotropic", _Known(0.0, 0.0), _Known(np.inf, 0.0, error=str(error)), level)
    tried = [trial.candidate(pair, phases) for pair in blind.pairs]
    variants = zip(tried, blind_variants(task, blind), strict=True)
    best = sorted((pair for pair in variants if not pair[0].refused), key=lambda pair: _worth(pair[0]))
    rivals = [_made(task, variant) for _, variant in best[:JUDGED_PAIRS]]
    failed = _Known(np.inf, 0.0, error=f"no pair of modes carries the loads; the first: {tried[0].refused}")
    rival = min(rivals, key=lambda one: one.compliance, default=failed)._replace(bound=0.0)
    return _beside("isotropic", _judged(quick, task, own)._replace(bound=ALIKE), rival, level)


def _made(task: ComparisonTask, variant: Variant) -> _Known:
    """A variant as a comparison makes and judges it."""
    try:
        return _judged(quick, task, variant.make())._replace(variant=variant.says)
    except DsfabError as error:
        return _Known(np.inf, 0.0, variant.says, str(error))


def compared_alternatives(own: Competitor, rivals: Iterable[Competitor]) -> tuple[Alternative, ...]:
    """Those that a comparison judged anyway."""
    mine = _of(own)
    return tuple(
        _beside(one.name, mine, _of(one), f"{one.judgement.level} check" if one.judgement else "")
        for one in rivals
        if one.name in ALTERNATIVE_WORDS
    )


def _of(one: Competitor) -> _Known:
    bound = one.judgement.bound if one.judgement else None
    return _Known(one.compliance, bound or 0.0, one.variant, one.error)


def _beside(name: str, own: _Known, rival: _Known, level: str) -> Alternative:
    """Where neither carries the loads, nothing is lost to it."""
    if not np.isfinite(rival.compliance):
        return Alternative(name, 0.0, 0.0, 0.0, level, error=rival.error)
    if not np.isfinite(own.compliance):
        return Alternative(name, np.inf, np.inf, np.inf, level, rival.variant)
    over = own.compliance / rival.compliance
    return Alternative(name, over, own.least / rival.most, own.most / rival.least, level, rival.variant)


def _ranked(task: ComparisonTask, own: Structure) -> _Known:
    """A cut sheet by one solve with the elements that rank."""
    statics = task.preset.statics
    try:
        loads = sheet_loads(task.surface, own.drawn, own.sheet, task.loads_on(own))
        answers = solve_for(statics.sheet(own.thickness).on(own.sheet.surface), loads, "ranking")
    except DsfabError as error:
        return _Known(np.inf, 0.0, error=str(error))
    return _Known(sum(weight * answers[name].compliance for name, weight in task.preset.followed.items()), RANKED)


def _judged(judge: Judge, task: ComparisonTask, structure: Structure) -> _Known:
    try:
        found = judge(task, structure)
    except DsfabError as error:
        return _Known(np.inf, 0.0, error=str(error))
    return _Known(found.compliance, found.bound or 0.0)


def _worth(candidate: Candidate) -> float:
    """Joules times share of the surface."""
    return candidate.compliance * candidate.kept
