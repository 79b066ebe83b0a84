"""Is a verdict's bound true? Random designs on six surfaces, judged, and compared with one or two levels more."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from itertools import islice
from typing import Any

import numpy as np

from dsfab.design import Design
from dsfab.errors import DsfabError
from dsfab.pipeline import run
from dsfab.preset_file import load_preset
from dsfab.study.verdict import rules
from dsfab.study.verdict.check import facets_of, members
from dsfab.study.verdict.finer import meshes, on_mesh, shares
from dsfab.study.verdict.levels import HHJ, MIDEDGE, level
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.study.verdict.structure import Structure, attached

SEEDS = 8
"""Designs of each kind."""

LARGEST = 150_000
"""Triangles at most: the fourth mesh is left out where it would have more, and the third one tells the truth."""

WIDTHS = ("plain", "constant", "graded")

TABLE = files("dsfab.study.verdict") / "calibration.csv"
"""The table that ships with dsfab."""


@dataclass(frozen=True)
class Kind:
    """Designs of one surface: a shipped preset, changes to it, and the range that frequencies are drawn from."""

    preset: str
    changes: dict[str, Any]
    frequency: tuple[float, float]


_EDGES = {"at": {"pick": "boundary"}, "hold": "xyz"}
_MIDDLE = {"kind": "force", "at": {"pick": "ball", "center": [0.3, 0.1, 0.0], "radius": 0.2}, "force": [0, 0, -1e3]}
KINDS: dict[str, Kind] = {
    "cantilever": Kind("cantilever", {"surface.edge": 0.065}, (2.5, 5.0)),
    "plate": Kind(
        "cantilever",
        {"surface.edge": 0.065, "surface.support": [_EDGES], "surface.load": [_MIDDLE], "pattern.rim": 0.05},
        (2.5, 4.5),
    ),
    "dome": Kind("dome", {"surface.edge": 0.62, "statics.thickness": 0.12, "pattern.rim": 0.3}, (2.0, 4.0)),
    "vault": Kind("barrel_vault", {"surface.edge": 0.45, "statics.thickness": 0.15}, (2.5, 5.0)),
    "sphere": Kind("globe", {"surface.edge": 0.16, "statics.thickness": 0.05, "pattern.keep": 0.2}, (2.0, 4.0)),
    "ring": Kind("bob", {"surface.edge": 0.1, "statics.thickness": 0.03, "pattern.keep": 0.08}, (3.0, 6.0)),
}
"""Each is meshed with 500 to 700 vertices; `ring` is the closed duck of genus 1 that stands for Bob."""


@dataclass(frozen=True)
class Row:
    """A random design, solved on two to four meshes.

    width, share : its width rule, and the share of the surface that is material.
    vertices, triangles : of the uncut mesh, and of the cut one.     per_member, facets : see `Verdict`.
    quick        : J, by quadratic + midedge on the mesh as it is cut.
    midedge      : J, by the same on the refined mesh.
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
        return 2 if self._after(2).bound <= rules.CONVERGED else 3

    @property
    def estimate(self) -> rules.Estimate:
        """The verdict's value and bound."""
        return self._after(self.levels)

    @property
    def truth(self) -> float:
        """J, the compliance extrapolated from the two finest meshes."""
        return self.compliance[-1] + (self.compliance[-1] - self.compliance[-2]) / rules.STEP

    @property
    def error(self) -> float:
        """Of the verdict's value, over the truth, with its sign."""
        return self.estimate.value / self.truth - 1

    @property
    def quick_error(self) -> float:
        """Of the quick level, over the truth, with its sign."""
        return self.quick / self.truth - 1

    @property
    def inside(self) -> bool:
        """Whether the truth lies within the bound."""
        found = self.estimate
        return abs(self.truth - found.value) <= found.bound * found.value

    def _after(self, count: int) -> rules.Estimate:
        spread = 0.0 if self.plane else self.midedge / self.compliance[1] - 1
        return rules.estimate(self.compliance[:count], spread, self.recovery[count - 1])


@dataclass(frozen=True)
class Summary:
    """What the table says: how many designs, the share of them inside their bound, the median bound and the largest
    error of the verdict; how many were converged, and what the quick level is off by, median and nine in ten."""

    designs: int
    inside: float
    median_bound: float
    largest_error: float
    converged: int
    quick_median: float
    quick_most: float


def summary(rows: Sequence[Row]) -> Summary:
    """Of a table."""
    bounds, quick = [row.estimate.bound for row in rows], [abs(row.quick_error) for row in rows]
    return Summary(
        len(rows),
        float(np.mean([row.inside for row in rows])),
        float(np.median(bounds)),
        max(abs(row.error) for row in rows),
        sum(bound <= rules.CONVERGED for bound in bounds),
        float(np.median(quick)),
        float(np.quantile(quick, 0.9)),
    )


def random_design(kind: str, seed: int) -> Design:
    """A design of that kind: frequencies, modes, phases, widths and share of material drawn with the seed.

    Raises DsfabError for a draw that cannot be made.
    """
    rng, given = np.random.default_rng([seed, list(KINDS).index(kind)]), KINDS[kind]
    width: dict[str, Any] = {"rule": WIDTHS[int(rng.integers(len(WIDTHS)))]}
    changes: dict[str, Any] = dict(given.changes)
    for family in ("major", "minor"):
        changes[f"pattern.{family}.mode"] = int(rng.integers(1, 4))
        changes[f"pattern.{family}.frequency"] = round(float(rng.uniform(*given.frequency)), 2)
        changes[f"pattern.{family}.phase"] = round(float(rng.uniform(0, 1)), 3)
        changes[f"pattern.{family}.threshold"] = round(float(rng.uniform(-0.3, 0.2)), 2)
    if width["rule"] != "plain":
        width["solid_fraction"] = round(float(rng.uniform(0.45, 0.7)), 2)
    return run(load_preset(given.preset, changes | {"pattern.width": width}))


def measured(kind: str, seed: int, count: int = 4) -> Row:
    """A random design solved on `count` meshes, fewer where they would have over `LARGEST` triangles.

    Raises DsfabError for a draw that cannot be made or does not carry its loads.
    """
    design = random_design(kind, seed)
    structure = Structure.of(design)
    sheet, _, loads = attached(structure, design.slicing.cells.kept())
    smooth, forces, surface = SmoothSurface.through(design.surface), shares(sheet, loads), design.surface
    case = next(iter(structure.loads))
    quick = level(sheet.surface, structure.made, *on_mesh(surface, sheet, structure.loads, forces), (MIDEDGE,))
    solved = []
    for k, mesh in enumerate(islice(meshes(sheet, smooth), count)):
        if mesh.surface.m > LARGEST and k > 2:
            break
        pairs = (HHJ, MIDEDGE) if k == 1 else (HHJ,)
        solved.append(level(mesh.surface, structure.made, *on_mesh(surface, mesh, structure.loads, forces), pairs))
    return Row(
        kind,
        seed,
        design.preset.pattern.width.rule,
        sheet.surface.area / surface.area,
        surface.n,
        sheet.surface.m,
        members(sheet) / surface.mean_edge,
        facets_of(smooth, structure.made.thickness),
        quick.compliance[case],
        solved[1].midedge.get(case, solved[1].compliance[case]),
        tuple(one.compliance[case] for one in solved),
        tuple(one.zz_membrane[case] + one.zz_bending[case] for one in solved),
    )


def calibrate(count: int = SEEDS, told: Callable[[str, int], None] | None = None) -> Iterator[Row]:
    """The rows of the first `count` designs of each kind that can be made: a quarter of an hour.

    told : called with the kind and the seed before each.
    """
    for kind in KINDS:
        seed = found = 0
        while found < count:
            if told:
                told(kind, seed)
            try:
                yield measured(kind, seed)
                found += 1
            except DsfabError:
                pass  # a draw that falls apart is no test of a bound
            seed += 1


def table_text(rows: Iterable[Row]) -> str:
    """The rows as CSV, six digits; several numbers in one cell stand with spaces between."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(Row)]
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(getattr(row, name)) for name in names])
    return text.getvalue()


def shipped_table() -> list[Row]:
    """The table that ships with dsfab."""
    return read_table(TABLE.read_text(encoding="utf-8"))


def read_table(text: str) -> list[Row]:
    """The rows of `table_text`."""
    rows = []
    for cells in csv.DictReader(io.StringIO(text)):
        values = {
            field.name: tuple(map(float, cells[field.name].split()))
            if field.name in ("compliance", "recovery")
            else field.type(cells[field.name])  # type: ignore[operator]
            for field in fields(Row)
        }
        rows.append(Row(**values))
    return rows


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_cell, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
