"""Tests of the verdict's error bound on random designs."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib.resources import files
from typing import Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.core.limits import CONVERGED
from dsfab.design import run
from dsfab.design.design import Design
from dsfab.preset.file import load_preset
from dsfab.slicing import Sheet
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.statics import Elements
from dsfab.study.verdict import estimates
from dsfab.study.verdict.levels import (
    MAIN_ELEMENTS,
    QUICK_ELEMENTS,
    SPREAD_ELEMENTS,
    Level,
    Shares,
    level,
    on_mesh,
    shares,
)
from dsfab.study.verdict.verdict import LoadedSurface, attached_material, facet_ratio

TABLE = files("dsfab.study.verdict") / "calibration.csv"


@dataclass(frozen=True)
class TrialRow:
    """Results of a random design, solved on two to four meshes.
    width      : rule for the widths of the stripes.          share : material area / surface area.
    vertices   : number of vertices of the uncut mesh.        triangles : number of triangles of the cut mesh.
    per_member : mean width of the members / mean edge length of the uncut mesh.
    facets     : median of L^2 / (R h): edge length L, radius of curvature R, thickness h.
    quick      : compliance (J) by hybrid + hhj elements on the cut mesh.
    midedge    : compliance (J) by quadratic + midedge elements on the first mesh.
    compliance : compliance (J) on each mesh.    recovery : energy of the stress error / compliance on each mesh."""

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
    def is_plane(self) -> bool:
        """True if the sheet is flat and loaded in its plane."""
        return self.kind == "cantilever"

    @property
    def levels(self) -> int:
        """Number of meshes (two or three) that the verdict on the design uses."""
        return 2 if self._estimate_after(2).bound <= CONVERGED else 3

    @property
    def estimate(self) -> estimates.ComplianceEstimate:
        """Compliance (J) and error bound that the verdict on the design gives."""
        return self._estimate_after(self.levels)

    @property
    def truth(self) -> float:
        """Compliance (J) extrapolated from all meshes, used as the true value."""
        return estimates.limit_at_own_rate(self.compliance)

    @property
    def error(self) -> float:
        """Signed relative error of the verdict's compliance, compared with `truth`."""
        return self.estimate.value / self.truth - 1

    @property
    def quick_error(self) -> float:
        return self.quick / self.truth - 1

    @property
    def is_tested(self) -> bool:
        """True if the design was also solved on a mesh that the verdict does not use."""
        return len(self.compliance) > self.levels

    @property
    def is_inside(self) -> bool:
        """True if the true compliance lies within the verdict's error bound."""
        compliance_estimate = self.estimate
        return abs(self.truth - compliance_estimate.value) <= compliance_estimate.bound * compliance_estimate.value

    def _estimate_after(self, count: int) -> estimates.ComplianceEstimate:
        spread = 0.0 if self.is_plane else self.midedge / self.compliance[0] - 1
        return estimates.estimate(self.compliance[:count], spread, self.recovery[count - 1])


@dataclass(frozen=True)
class Summary:
    """Statistics of random designs. Errors and error bounds are relative to the compliance.
    converged    : number of designs with an error bound of at most `CONVERGED`.
    inside       : fraction of designs with an error within the bound.    median_bound : median of all bounds.
    largest_error : largest error of a verdict.
    quick_median, quick_most : median and 90 % quantile of the errors of a single solve."""

    designs: int
    inside: float
    median_bound: float
    largest_error: float
    converged: int
    quick_median: float
    quick_most: float


def summary(rows: Sequence[TrialRow]) -> Summary:
    """Return the statistics of all designs in `rows` that were also solved on a finer mesh than the verdict uses.
    Raises ValueError if there are none."""
    rows = [row for row in rows if row.is_tested]
    if not rows:
        raise ValueError("no design was solved on a mesh finer than the meshes of its verdict")
    bounds, quick = [row.estimate.bound for row in rows], [abs(row.quick_error) for row in rows]
    return Summary(
        len(rows),
        float(np.mean([row.is_inside for row in rows])),
        float(np.median(bounds)),
        max(abs(row.error) for row in rows),
        sum(bound <= CONVERGED for bound in bounds),
        float(np.median(quick)),
        float(np.quantile(quick, 0.9)),
    )


def table_text(rows: Iterable[TrialRow]) -> str:
    """Return the rows as a text in CSV format."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [field.name for field in fields(TrialRow)]
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(getattr(row, name)) for name in names])
    return text.getvalue()


def shipped_table() -> list[TrialRow]:
    """Return the rows of the table that ships with dsfab."""
    return read_table(TABLE.read_text(encoding="utf-8"))


def read_table(text: str) -> list[TrialRow]:
    """Return the rows in a CSV text that `table_text` has made."""
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


WIDTHS = ("plain", "constant", "graded")


@dataclass(frozen=True)
class Kind:
    """A kind of random designs. preset : name of the shipped preset with their surface.
    changes : changed values of the preset, by key.    frequency : smallest and largest frequency of the stripes."""

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
    "dome": Kind(
        "dome",
        {
            "surface.edge": 0.62,
            "statics.thickness": 0.12,
            "pattern.keep": 0.35,
            "pattern.rim": 0.3,
            "slicing.min_opening": 0.03,
        },
        (2.0, 4.0),
    ),
    "vault": Kind("barrel_vault", {"surface.edge": 0.45, "statics.thickness": 0.15}, (2.5, 5.0)),
    "sphere": Kind(
        "globe",
        {"surface.edge": 0.16, "statics.thickness": 0.05, "pattern.keep": 0.2, "slicing.snap": 0.05},
        (2.0, 4.0),
    ),
    "ring": Kind("bob", {"surface.edge": 0.1, "statics.thickness": 0.03, "pattern.keep": 0.08}, (3.0, 6.0)),
}
"""Kinds of random designs, by name. Their meshes have 500 to 700 vertices. `ring` is a closed surface of genus 1."""


def random_design(kind: str, seed: int) -> Design:
    """Return a random design. kind : key of `KINDS`.    seed : equal seeds give equal designs.
    Raises DsfabError if the design cannot be built."""
    rng, surface_kind = np.random.default_rng([seed, list(KINDS).index(kind)]), KINDS[kind]
    width: dict[str, Any] = {"rule": WIDTHS[int(rng.integers(len(WIDTHS)))]}
    changes: dict[str, Any] = {**surface_kind.changes, "pattern.method": "modes", "pattern.fillet": 0.0}
    for family in ("major", "minor"):
        changes[f"pattern.{family}.mode"] = int(rng.integers(1, 4))
        changes[f"pattern.{family}.frequency"] = round(float(rng.uniform(*surface_kind.frequency)), 2)
        changes[f"pattern.{family}.phase"] = round(float(rng.uniform(0, 1)), 3)
        changes[f"pattern.{family}.threshold"] = round(float(rng.uniform(-0.3, 0.2)), 2)
    if width["rule"] != "plain":
        width["solid_fraction"] = round(float(rng.uniform(0.45, 0.7)), 2)
    return run(load_preset(surface_kind.preset, changes | {"pattern.width": width}))


def trial_row(kind: str, seed: int, count: int = 4) -> TrialRow:
    """Return the results of the design `random_design(kind, seed)`, solved on up to `count` finer and finer meshes.
    Raises DsfabError if the design cannot be built or does not carry its loads."""
    design = random_design(kind, seed)
    setting = LoadedSurface.from_design(design)
    sheet, _, loads = attached_material(setting, design.slicing.cells.subset())
    forces, smooth = shares(sheet, loads), SmoothSurface.from_surface(design.surface)
    quick = _solve(setting, sheet, forces, QUICK_ELEMENTS)
    finer = meshes(sheet, smooth)
    levels = [
        _solve(setting, next(finer), forces, *pairs)
        for pairs in ((MAIN_ELEMENTS, SPREAD_ELEMENTS), (MAIN_ELEMENTS,), (MAIN_ELEMENTS,))[:count]
    ]
    case = next(iter(setting.loads))
    row = TrialRow(
        kind,
        seed,
        design.preset.pattern.width.rule,
        sheet.surface.area / design.surface.area,
        design.surface.n,
        sheet.surface.m,
        estimates.rib_width(sheet.surface) / design.surface.mean_edge,
        facet_ratio(smooth, setting.made.thickness),
        quick.compliance[case],
        levels[0].midedge.get(case, levels[0].compliance[case]),
        tuple(mesh_level.compliance[case] for mesh_level in levels),
        tuple(mesh_level.zz_membrane[case] + mesh_level.zz_bending[case] for mesh_level in levels),
    )
    largest_triangles = 100_000  # tested rows skip a fourth mesh with more triangles
    if count > 3 and (64 * row.triangles <= largest_triangles or not row.is_tested):
        finest = _solve(setting, next(finer), forces, MAIN_ELEMENTS)
        recovery = finest.zz_membrane[case] + finest.zz_bending[case]
        return replace(row, compliance=(*row.compliance, finest.compliance[case]), recovery=(*row.recovery, recovery))
    return row


def _solve(setting: LoadedSurface, mesh: Sheet, forces: Mapping[str, Shares], *pairs: Elements) -> Level:
    return level(mesh.surface, setting.made, *on_mesh(setting.surface, mesh, setting.loads, forces), pairs)


def calibrate(count: int = 8, report: Callable[[str, int], None] | None = None) -> Iterator[TrialRow]:
    """Yield the results of `count` random designs of each kind.
    report : function that is called with the kind and the seed before each design is made."""
    for kind in KINDS:
        seed = solved = 0
        while solved < count:
            if report:
                report(kind, seed)
            try:
                yield trial_row(kind, seed)
                solved += 1
            except DsfabError:
                pass
            seed += 1
