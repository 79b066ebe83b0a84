"""`Verdict`: a compliance with its bound, whether to believe it, and why."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from dsfab.limits import Status
from dsfab.study.verdict.levels import Level
from dsfab.study.verdict.loaded_surface import Dropped

Depth = Literal["quick", "full"]


@dataclass(frozen=True)
class CaseVerdict:
    """One load case or combination.

    value  : compliance, J; nan where it could not be found.
    bound  : half width of the interval that the true compliance lies in, over the value; inf where nothing is known.
    status : pass: it carries its loads, and the compliance is known to `CONVERGED`. fail: it does not carry them.
             unknown: the compliance is not known well enough.
    spread : compliance of quadratic + midedge over that of quadratic + hhj on the first mesh, less 1.
    zz_membrane, zz_bending : on the finest mesh, see `Level`.
    theory : by what a solid may be softer besides, over the value: the bound is about thin sheets, see `theory_share`.
    """

    name: str
    value: float
    bound: float
    status: Status
    reason: str
    spread: float = 0.0
    zz_membrane: float = 0.0
    zz_bending: float = 0.0
    theory: float = 0.0


@dataclass(frozen=True)
class Verdict:
    """What `check` finds.

    depth      : quick (one mesh) or full (two or three).
    status     : the worst of all cases.       reason : of the case that decides.
    cases      : the governing one first: the worst status, then the largest compliance.
    levels     : the meshes that were solved, coarse to fine.
    dropped    : pieces of material that reach no support, largest first; they are not part of what was solved.
    per_member : edges of the uncut mesh across a member, in the mean: twice the area over the length of all borders;
                 inf for a closed sheet without openings.
    facets     : L^2 / (R h) of the uncut mesh, the median: edge length, radius of curvature, thickness.
    warnings   : of these two numbers beyond their limits, a sentence each.
    """

    depth: Depth
    status: Status
    reason: str
    cases: tuple[CaseVerdict, ...]
    levels: tuple[Level, ...]
    dropped: tuple[Dropped, ...]
    per_member: float
    facets: float
    warnings: tuple[str, ...]
    seconds: float

    @property
    def value(self) -> float:
        """Compliance of the governing case, J."""
        return self.cases[0].value

    @property
    def bound(self) -> float:
        """Half width of its interval, over the value."""
        return self.cases[0].bound

    @property
    def theory(self) -> float:
        """By what a solid may be softer besides, over the value."""
        return self.cases[0].theory

    @property
    def memory(self) -> int:
        """Bytes, the most that the process has held; 0 where nothing was solved."""
        return max((level.memory for level in self.levels), default=0)

    def case(self, name: str) -> CaseVerdict:
        """The verdict on one case. Raises KeyError for a case that there is not."""
        return {case.name: case for case in self.cases}[name]

    def record(self) -> dict[str, Any]:
        """Everything as numbers, text, lists and dicts for JSON; None for what is not finite."""
        values = asdict(self) | {"value": self.value, "bound": self.bound, "theory": self.theory, "memory": self.memory}
        values["dropped"] = [piece._asdict() for piece in self.dropped]
        return dict(_plain(values))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
