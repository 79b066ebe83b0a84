"""`Competitor`: a structure in a comparison, what its judge says of it, and its row in a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.study.baselines import Structure
from dsfab.study.judging import Judgement


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
        measured = _judged(self.judgement) if self.judgement else self._failed()
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


def _judged(judgement: Judgement) -> dict[str, Any]:
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
