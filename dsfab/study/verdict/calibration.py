"""Is a verdict's bound true? The table of random designs (see `dsfab.study.verdict.trials`), and what it says."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

import numpy as np

from dsfab.limits import CONVERGED
from dsfab.study.verdict import rules

TABLE = files("dsfab.study.verdict") / "calibration.csv"
"""The table that ships with dsfab."""


@dataclass(frozen=True)
class TrialRow:
    """A random design, solved on two to four meshes.

    width, share : its width rule, and the share of the surface that is material.
    vertices, triangles : of the uncut mesh, and of the cut one.     per_member, facets : see `Verdict`.
    quick        : J, by hybrid + hhj on the mesh as it is cut.
    midedge      : J, by quadratic + midedge on the first mesh of the verdict.
    compliance   : J, by quadratic + hhj, mesh after mesh.           recovery : ZZ of the same, both parts together.
    """

    kind: str
    seed: int
    width: str
    share: float
    vertices: int
    triangles: int
    per_member: float
    facets: float
    quick: float
    midedge: float
    compliance: tuple[float, ...]
    recovery: tuple[float, ...]

    @property
    def plane(self) -> bool:
        """Whether it was solved in its plane."""
        return self.kind == "cantilever"

    @property
    def levels(self) -> int:
        """How many meshes its verdict takes: two, or three where two are not enough."""
        return 2 if self._after(2).bound <= CONVERGED else 3

    @property
    def estimate(self) -> rules.ComplianceEstimate:
        """The verdict's value and bound."""
        return self._after(self.levels)

    @property
    def truth(self) -> float:
        """J, the compliance carried on from all meshes at their own rate."""
        return rules.limit_at_own_rate(self.compliance)

    @property
    def error(self) -> float:
        """Of the verdict's value, over the truth, with its sign."""
        return self.estimate.value / self.truth - 1

    @property
    def quick_error(self) -> float:
        """Of the quick level, over the truth, with its sign."""
        return self.quick / self.truth - 1

    @property
    def tested(self) -> bool:
        """Whether a mesh beyond those of the verdict was solved: else the truth is the verdict itself."""
        return len(self.compliance) > self.levels

    @property
    def inside(self) -> bool:
        """Whether the truth lies within the bound."""
        found = self.estimate
        return abs(self.truth - found.value) <= found.bound * found.value

    def _after(self, count: int) -> rules.ComplianceEstimate:
        spread = 0.0 if self.plane else self.midedge / self.compliance[0] - 1
        return rules.estimate(self.compliance[:count], spread, self.recovery[count - 1])


@dataclass(frozen=True)
class Summary:
    """What the table says of designs that were `tested`: their number, the share of them inside their bound, the median
    bound and the largest error of the verdict, how many were converged, and what the quick level is off by, the median
    and what nine in ten keep."""

    designs: int
    inside: float
    median_bound: float
    largest_error: float
    converged: int
    quick_median: float
    quick_most: float


def summary(rows: Sequence[TrialRow]) -> Summary:
    """Of a table. Raises ValueError for one without a row that is tested."""
    rows = [row for row in rows if row.tested]
    if not rows:
        raise ValueError("no design was solved on a mesh beyond those of its verdict")
    bounds, quick = [row.estimate.bound for row in rows], [abs(row.quick_error) for row in rows]
    return Summary(
        len(rows),
        float(np.mean([row.inside for row in rows])),
        float(np.median(bounds)),
        max(abs(row.error) for row in rows),
        sum(bound <= CONVERGED for bound in bounds),
        float(np.median(quick)),
        float(np.quantile(quick, 0.9)),
    )


def table_text(rows: Iterable[TrialRow]) -> str:
    """The rows as CSV, six digits; several numbers in one cell stand with spaces between."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(TrialRow)]
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(getattr(row, name)) for name in names])
    return text.getvalue()


def shipped_table() -> list[TrialRow]:
    """The table that ships with dsfab."""
    return read_table(TABLE.read_text(encoding="utf-8"))


def read_table(text: str) -> list[TrialRow]:
    """The rows of `table_text`."""
    rows = []
    for cells in csv.DictReader(io.StringIO(text)):
        values: dict[str, Any] = {
            field.name: tuple(map(float, cells[field.name].split()))
            if field.name in ("compliance", "recovery")
            else field.type(cells[field.name])  # type: ignore[operator]
            for field in fields(TrialRow)
        }
        rows.append(TrialRow(**values))
    return rows


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_cell, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
