"""Cut sheets beside solids of them by CalculiX: what the theory of thin shells leaves out where ribs are narrow.

    python -m tests.benchmarks.solid_truth table.csv [KIND ...] [--seeds 0-5]

A random design is drawn for each kind and seed, and its thickness for a width of the ribs of 1.5 to 15 thicknesses. The
cut sheet is solved as a verdict solves it, and as a solid: quadratic wedges (C3D15), upright on the smooth surface, on
meshes that are halved; the values are carried on at their own rate (`limit`). One layer of wedges cannot bend its
section: what a second one adds is measured on the first mesh and carried over. Supports that hold a sheet's vertices
are hinges here: the middle stands still, and what is above moves against what is below. Rows are added to the table,
the model's term is fitted to them by `--fit`.
"""

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import dsfab
from dsfab.errors import DsfabError
from dsfab.pipeline.design import Design
from dsfab.study.verdict import LoadedSurface, check
from dsfab.study.verdict.check import members
from dsfab.study.verdict.finer import meshes, shares
from dsfab.study.verdict.loaded_surface import attached_material
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.study.verdict.theory import NARROW, BendingShares, theory_share
from dsfab.study.verdict.trials import KINDS, WIDTHS, Kind
from tests.benchmarks.solid_wedges import solid_compliance

UNKNOWNS = 4.5e5
"""Of a solid, at most."""

_EDGES = {"at": {"pick": "boundary"}, "hold": "xyz"}
_FOOT = {"at": {"pick": "side", "axis": "z", "end": "min"}, "hold": "xyz"}
_SNOW = {"kind": "snow", "pressure": 800.0}
_CLAMPED = {"at": {"pick": "side", "axis": "x", "end": "min"}, "hold": "xyz", "clamp": True}
_DOWN = {"kind": "force", "at": {"pick": "side", "axis": "x", "end": "max"}, "force": [0.0, 0.0, -1e3]}
_TOP = {"kind": "line", "at": {"pick": "side", "axis": "z", "end": "max"}, "per_metre": [800.0, 0.0, -3000.0]}


def _dome(surface: dict[str, Any], keep: float, **more: Any) -> Kind:
    changes = {"surface": surface, "pattern.keep": keep, "pattern.rim": 0.8 * keep, **more}
    return Kind("dome", changes, (2.0, 4.0))


COARSER = 1.5
"""Edges of the kinds of `dsfab verify --calibration`, times this: three meshes of a solid are to be solved."""

FEWER = 0.65
"""And their frequencies times this."""

DRAWN: dict[str, Kind] = {
    **{
        name: replace(kind, changes=kind.changes | {"surface.edge": COARSER * kind.changes["surface.edge"]})
        for name, kind in KINDS.items()
    },
    "hypar": _dome(
        {"shape": "hypar", "side": 8.0, "rise": 3.0, "edge": 0.5, "support": [_EDGES], "load": [_SNOW]}, 0.3
    ),
    "catenoid": _dome(
        {"shape": "catenoid", "waist": 1.5, "rim": 4.0, "edge": 0.6, "support": [_FOOT], "load": [_SNOW]}, 0.3
    ),
    "cylinder": _dome(
        {"shape": "cylinder", "radius": 2.0, "height": 4.0, "edge": 0.4, "support": [_FOOT], "load": [_TOP]}, 0.25
    ),
    "torus": Kind(
        "globe",
        {
            "surface": {
                "shape": "torus",
                "major": 3.0,
                "minor": 1.2,
                "edge": 0.55,
                "support": [{"at": {"pick": "side", "axis": "z", "end": "min", "depth": 0.1}, "hold": "xyz"}],
                "load": [
                    {
                        "kind": "force",
                        "at": {"pick": "box", "min": [2.0, -0.8, 1.0], "max": [4.0, 0.8, 2.0]},
                        "force": [0, 0, -5e4],
                    }
                ],
            },
            "pattern.keep": 0.4,
        },
        (2.0, 4.0),
    ),
    "tower": Kind("tower", {"surface.edge": 1.2, "pattern.keep": 0.6}, (2.5, 5.0)),
    "bracket": Kind(
        "cantilever",
        {
            "surface.edge": 0.12,
            "statics.bending": "hhj",
            "statics.membrane": "quadratic",
            "surface.support": [_CLAMPED],
            "surface.load": [_DOWN],
            "pattern.rim": 0.06,
        },
        (2.5, 4.5),
    ),
}
"""The kinds of `dsfab verify --calibration` with fewer triangles, a bent plate that is built in, and shells."""

RATIOS = (1.5, 15.0)
"""Widths of ribs over the thickness."""


def drawn_design(kind: str, seed: int) -> tuple[Design, float]:
    """A design of that kind, and the ratio of its ribs' width to the thickness that it is to have."""
    rng, given = np.random.default_rng([seed, list(DRAWN).index(kind), 7]), DRAWN[kind]
    changes: dict[str, Any] = {**given.changes, "pattern.method": "modes", "pattern.fillet": 0.0}
    for family in ("major", "minor"):
        frequency, phase = FEWER * float(rng.uniform(*given.frequency)), float(rng.uniform(0, 1))
        drawn = {"mode": int(rng.integers(1, 4)), "frequency": round(frequency, 2), "phase": round(phase, 3)}
        changes |= {f"pattern.{family}": drawn | {"threshold": round(float(rng.uniform(-0.3, 0.2)), 2)}}
    rule = WIDTHS[int(rng.integers(1, len(WIDTHS)))]
    share = round(float(rng.uniform(0.25, 0.6)), 2)
    ratio = float(np.exp(rng.uniform(*np.log(RATIOS))))
    return dsfab.run(
        dsfab.load_preset(given.preset, changes | {"pattern.width": {"rule": rule, "solid_fraction": share}})
    ), ratio


@dataclass(frozen=True)
class SolidRow:
    """A design beside its solid.

    share, triangles : of the material, as cut.     ratio : mean width of its ribs over the thickness.
    value, bound     : the verdict's, J and a share.
    bending, twisting : shares of the energy, see `BendingShares`.
    shell            : J, mesh after mesh, of the verdict.
    solid            : J, mesh after mesh, of one layer of wedges.      second : two layers over one, on the first mesh.
    """

    kind: str
    seed: int
    share: float
    triangles: int
    ratio: float
    value: float
    bound: float
    bending: float
    twisting: float
    shell: tuple[float, ...]
    solid: tuple[float, ...]
    second: float

    @property
    def truth(self) -> float:
        """J, of the solid, on meshes without end."""
        return limit(self.solid) * self.second

    @property
    def gap(self) -> float:
        """Of the solid's compliance over the best thin sheet's, less 1."""
        return self.truth / self.value - 1

    def theory(self, constant: float) -> float:
        """The model's term with another constant."""
        return constant / NARROW * theory_share(BendingShares(self.bending, self.twisting), self.ratio)

    def inside(self, constant: float) -> bool:
        """Whether the solid lies within what the verdict says: bound below, bound and term above."""
        return -self.bound <= self.gap <= self.bound + self.theory(constant)


SHRINK = 3.0
"""A step between solids over the next one, where two were solved."""


def limit(values: Sequence[float]) -> float:
    """Carried on from the last two at the rate of the last three, which is kept within 1.7 and 4; or at `SHRINK`."""
    step, rate = values[-1] - values[-2], SHRINK
    if len(values) > 2 and step:
        rate = float(np.clip((values[-2] - values[-3]) / step, 1.7, 4.0))
    return values[-1] + step / (rate - 1)


def measured_row(kind: str, seed: int) -> SolidRow:
    """Raises DsfabError for a draw that cannot be made or does not carry its loads."""
    design, wanted = drawn_design(kind, seed)
    setting, material = LoadedSurface.of(design), design.slicing.cells.kept()
    sheet, _, _ = attached_material(setting, material)
    thickness = members(sheet) / wanted
    setting = LoadedSurface.of(design, thickness / setting.made.thickness)
    name = next(iter(setting.loads))
    setting = replace(setting, loads={name: setting.loads[name]})
    sheet, _, loads = attached_material(setting, material)
    verdict = check(setting, sheet)
    if not len(verdict.levels) > 1:
        raise DsfabError(verdict.reason)
    forces, count = shares(sheet, loads), 0
    solid, second, chain = [], 1.0, meshes(sheet, SmoothSurface.through(design.surface))
    mesh = next(chain)
    while 9 * mesh.surface.n + 6 * len(mesh.surface.edges.ends) < UNKNOWNS:
        fine = next(chain)
        solid.append(solid_compliance(setting, mesh, fine, forces, 1))
        if count == 0:
            second = solid_compliance(setting, mesh, fine, forces, 2) / solid[0]
        mesh, count = fine, count + 1
    bent = verdict.levels[-1].bent[name]
    shell = tuple(one.compliance[name] for one in verdict.levels)
    size = sheet.surface.area / design.surface.area, sheet.surface.m, members(sheet) / thickness
    return SolidRow(kind, seed, *size, verdict.value, verdict.bound, *bent, shell, tuple(solid), second)


def read(table: Path) -> list[SolidRow]:
    """The rows of a table, the last of each design."""
    rows = {}
    for cells in csv.DictReader(table.read_text(encoding="ascii").splitlines()):
        values: dict[str, Any] = {
            field.name: tuple(map(float, cells[field.name].split()))
            if field.name in ("shell", "solid")
            else field.type(cells[field.name])  # type: ignore[operator]
            for field in fields(SolidRow)
        }
        rows[cells["kind"], cells["seed"]] = SolidRow(**values)
    return list(rows.values())


MARGIN = 1.1
"""Of the constant over the least that covers all designs."""


def needed(rows: Sequence[SolidRow]) -> float:
    """The least constant of the model's term with which all solids lie inside, times `MARGIN`."""
    unit = [(row, theory_share(BendingShares(row.bending, row.twisting), row.ratio) / NARROW) for row in rows]
    return MARGIN * max((row.gap - row.bound) / share for row, share in unit if share > 0)


def fit(rows: Sequence[SolidRow]) -> str:
    """The constant, and how many solids are inside: by the bound alone, with the term, and with the term of the other
    kinds, each kind left out in turn."""
    lines = ["design        share  w/t  bending twisting   verdict          theory  solid"]
    for row in rows:
        told = f"{row.value:10.4g} ±{row.bound:5.1%}  +{row.theory(NARROW):6.1%} {row.gap:+7.1%}"
        name = f"{row.kind} {row.seed}"
        shown = f"{name:13} {row.share:.2f} {row.ratio:5.1f} {row.bending:7.2f} {row.twisting:7.2f}"
        lines.append(f"{shown} {told}{'' if row.inside(NARROW) else '  outside'}")
    kinds = sorted({row.kind for row in rows})
    others = {kind: needed([row for row in rows if row.kind != kind]) for kind in kinds}
    counts = {
        "the bound alone": sum(row.inside(0.0) for row in rows),
        "bound and theory": sum(row.inside(NARROW) for row in rows),
        "and theory fitted to the other kinds": sum(row.inside(others[row.kind]) for row in rows),
    }
    lines.append(f"constant {needed(rows):.2f}; of {len(rows)} solids inside: ")
    return "\n".join([*lines, *(f"  {count} by {name}" for name, count in counts.items())])


def written(row: SolidRow) -> list[str]:
    """Cells of a table, six digits."""
    values = (getattr(row, field.name) for field in fields(SolidRow))
    return [
        " ".join(f"{x:.6g}" for x in v) if isinstance(v, tuple) else f"{v:.6g}" if isinstance(v, float) else str(v)
        for v in values
    ]


def main() -> None:
    given = argparse.ArgumentParser()
    given.add_argument("table", type=Path)
    given.add_argument("kinds", nargs="*")
    given.add_argument("--seeds", default="0-1")
    given.add_argument("--fit", action="store_true")
    asked = given.parse_args()
    if asked.fit:
        print(fit(read(asked.table)))
        return
    first, last = map(int, asked.seeds.split("-"))
    if not asked.table.exists():
        asked.table.write_text(",".join(field.name for field in fields(SolidRow)) + "\n", encoding="ascii")
    for seed in range(first, last + 1):
        for kind in asked.kinds or DRAWN:
            start = time.perf_counter()
            try:
                row = measured_row(kind, seed)
            except DsfabError as error:
                print(f"{kind} {seed}: {str(error)[:150]}", flush=True)
                continue
            with asked.table.open("a", encoding="ascii", newline="") as file:
                csv.writer(file, lineterminator="\n").writerow(written(row))
            told = f"w/t {row.ratio:.1f}, bending {row.bending:.2f}, twisting {row.twisting:.2f}"
            spent = time.perf_counter() - start
            print(f"{kind} {seed}: {row.triangles} triangles, {told}, gap {row.gap:+.2%}, {spent:.0f} s", flush=True)


if __name__ == "__main__":
    main()
