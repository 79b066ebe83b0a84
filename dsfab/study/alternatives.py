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

    tried, carried : number of variants, and of those that carry the loads.      best, mean, worst : of the latter.
    median         : of all, with infinite compliance for variants that carry no loads.
    """

    tried: int
    carried: int
    best: float
    mean: float
    worst: float
    median: float

    @classmethod
    def of(cls, compliances: Sequence[float]) -> "Spread":
        """Return the statistics of compliances (J); infinite values carry no loads."""
        sound = [value for value in compliances if np.isfinite(value)]
        told = (min(sound), float(np.mean(sound)), max(sound)) if sound else (float("inf"),) * 3
        return cls(len(compliances), len(sound), *told, float(np.median(compliances)))


@dataclass(frozen=True)
class Competitor:
    """A structure under the design's loads, or the reason (`error`) why it is missing.

    variant         : the stiffest of several variants, such as "modes 1, 2".
    area_fraction   : of the surface; 1 for an uncut sheet.       mass : kg.     thickness : metres.
    judgement       : None with an error.       pieces : of the sheet.      loose : share of the material left out.
    smallest_member : metres; None if the sheet has no measurable member.
    spread          : over the variants, if they are several.
    seconds_made, seconds : of making all variants, and of making and judging them.
    structure       : the judged structure, for drawings; with an error, a single structure that does not carry its
                      loads.
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
        """Compliance in joules; infinite if the loads are not carried."""
        return self.judgement.compliance if self.judgement else float("inf")

    def _failed(self) -> dict[str, Any]:
        return {"verdict": "fail", "reason": self.error} if self.structure else {}

    def row(self, full: float, design: float) -> dict[str, Any]:
        """Return a table row of plain values in SI units, None for unknown values. full, design: compliance of both
        (J)."""
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
    """Return the columns of a judgement: the worst of all cases, and all reactions."""
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
    return value if np.isfinite(value) else None


ALTERNATIVE_WORDS = {
    "thinner": "a uniformly thinner sheet without openings",
    "isotropic": "the best pair of isotropic stripes",
}
"""Alternatives of the same mass, with their names in sentences."""


@dataclass(frozen=True)
class Alternative:
    """Another structure of the mass of a design, under the same loads.

    over      : the design's compliance over the alternative's: above 1 the design is softer. Infinite if the design
                does not carry its loads; 0 if the alternative does not.
    low, high : interval of `over`, from the bounds of both.        variant : the best variant, such as "modes 1, 2".
    level     : how both were judged, in words.                     error : why the alternative is missing, or ''.
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
        """True if the alternative is probably stiffer than the design."""
        return self.over > 1

    @property
    def sentence(self) -> str:
        """Sentence about a design that loses to this alternative."""
        which = f"{ALTERNATIVE_WORDS[self.name]} of the same mass"
        if not np.isfinite(self.over):
            return f"this design does not carry its loads, and {which} does"
        may = "may lose" if self.low <= 1 else "loses"
        between = f", {self.low:.3g} to {self.high:.3g}" if self.high > self.low else ""
        return f"this design {may}: {which} is {self.over:.3g} x as stiff ({self.level}{between})"

    def record(self) -> dict[str, Any]:
        """Return plain values for a file, None for infinite values."""
        numbers = {"over": self.over, "over_low": self.low, "over_high": self.high}
        told = {"name": self.name, **{key: x if np.isfinite(x) else None for key, x in numbers.items()}}
        return {**told, "design_loses": self.is_stiffer, "level": self.level, "variant": self.variant} | (
            {"error": self.error} if self.error else {}
        )


def losing_line(found: Iterable[Alternative]) -> str:
    """Return a line about the alternatives that are stiffer than the design, the worst loss first; '' for none."""
    return "; ".join(one.sentence for one in sorted(found, key=lambda one: -one.over) if one.is_stiffer)


def is_searched(preset: Preset) -> bool:
    """Return True if a search sets part of the pattern: method, modes, phases, or widths that even out stress."""
    ask = preset.pattern
    return ask.method == "auto" or ask.auto or ask.width.rule == "stressed"


def design_alternatives(design: Design) -> tuple[Alternative, ...]:
    """Return the alternatives of a design by the quickest sufficient solve; computed once per design. Raises DsfabError
    if the design cannot be cut."""

    def looked() -> tuple[Alternative, ...]:
        slicing, thickness = design.slicing, design.preset.statics.thickness
        own = Structure(slicing.cells, design.pattern.names, slicing.sheet, len(slicing.pieces), thickness)
        return alternatives(ComparisonTask.of(design, slicing.sheet.surface.area), own)

    return design.once("slicing", "alternatives", looked)


def alternatives(
    task: ComparisonTask, own: Structure, names: Sequence[str] = tuple(ALTERNATIVE_WORDS)
) -> tuple[Alternative, ...]:
    """Return the alternatives `names` to a structure of the task's mass."""
    return tuple({"thinner": beside_thinner, "isotropic": beside_isotropic}[name](task, own) for name in names)


class _Known(NamedTuple):
    """A compliance (J) with its relative bound; infinite if the loads are not carried (see `error`)."""

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
    """Compare with a thinner sheet, by one solve each with the elements that rank.

    If that leaves open which is stiffer, better elements solve both. Outside a plane, the thinner sheet then gets a
    full check, because its mesh is coarse beside that of a cut sheet.
    """
    thin = Structure.uncut(task.surface, task.share * task.preset.statics.thickness)
    found = _beside("thinner", _ranked(task, own), _judged(quick, task, thin), "one solve each")
    if found.low <= 1 <= found.high:
        judge, checked = (quick, "one solve each") if task.is_plane else (full, "the sheet checked in full")
        found = _beside("thinner", _judged(quick, task, own), _judged(judge, task, thin), checked)
    return found


def beside_isotropic(task: ComparisonTask, own: Structure) -> Alternative:
    """Compare with the best isotropic stripes.

    Every pair of modes is cut once and solved with quick elements, like a candidate of a search. The two best pairs are
    cut again to exactly the design's mass and judged with better elements, like the design. Quick elements make members
    up to twice too stiff if they bend in their plane, and 1 % more material makes them 5 % stiffer.
    """
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
    rivals = [_made(task, variant) for _, variant in best[:2]]
    failed = _Known(np.inf, 0.0, error=f"no pair of modes carries the loads; the first: {tried[0].refused}")
    rival = min(rivals, key=lambda one: one.compliance, default=failed)._replace(bound=0.0)
    # the same elements err to the same side on both sheets: their ratio is known to 10 %
    return _beside("isotropic", _judged(quick, task, own)._replace(bound=0.1), rival, level)


def _made(task: ComparisonTask, variant: Variant) -> _Known:
    try:
        return _judged(quick, task, variant.make())._replace(variant=variant.says)
    except DsfabError as error:
        return _Known(np.inf, 0.0, variant.says, str(error))


def compared_alternatives(own: Competitor, rivals: Iterable[Competitor]) -> tuple[Alternative, ...]:
    """Return the alternatives that a comparison has judged as rivals."""
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
    """Return the comparison of two compliances; a rival that does not carry the loads has `over` 0."""
    if not np.isfinite(rival.compliance):
        return Alternative(name, 0.0, 0.0, 0.0, level, error=rival.error)
    if not np.isfinite(own.compliance):
        return Alternative(name, np.inf, np.inf, np.inf, level, rival.variant)
    over = own.compliance / rival.compliance
    return Alternative(name, over, own.least / rival.most, own.most / rival.least, level, rival.variant)


def _ranked(task: ComparisonTask, own: Structure) -> _Known:
    """Return the compliance of a cut sheet by one solve with the elements that rank, which are 5 to 15 % off."""
    statics = task.preset.statics
    try:
        loads = sheet_loads(task.surface, own.drawn, own.sheet, task.loads_on(own))
        answers = solve_for(statics.sheet(own.thickness).on(own.sheet.surface), loads, "ranking")
    except DsfabError as error:
        return _Known(np.inf, 0.0, error=str(error))
    return _Known(sum(weight * answers[name].compliance for name, weight in task.preset.followed.items()), 0.15)


def _judged(judge: Judge, task: ComparisonTask, structure: Structure) -> _Known:
    try:
        found = judge(task, structure)
    except DsfabError as error:
        return _Known(np.inf, 0.0, error=str(error))
    return _Known(found.compliance, found.bound or 0.0)


def _worth(candidate: Candidate) -> float:
    return candidate.compliance * candidate.kept
