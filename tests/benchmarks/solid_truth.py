"""Cut sheets beside solids of them by CalculiX: what the theory of thin shells leaves out where ribs are narrow.

    python -m tests.benchmarks.solid_truth table.csv [KIND ...] [--seeds 0-5]    drawn designs
    python -m tests.benchmarks.solid_truth table.csv --named                     eleven named ones
    python -m tests.benchmarks.solid_truth table.csv --fit                       what the table says

A random design is drawn for each kind and seed, and its thickness for a width of the ribs of 1.5 to 15 thicknesses. The
cut sheet is solved as a verdict solves it, and as a solid: quadratic wedges (C3D15), upright on the smooth surface, on
meshes that are halved; the values are carried on at their own rate (`limit`). One layer of wedges cannot bend its
section: what a second one adds is measured on the first mesh and carried over. Supports that hold a sheet's vertices
are hinges here: the middle stands still, and what is above moves against what is below. Rows are added to the table.
The named torus needs `--unknowns 5.2e5`: thin wedges converge slowly.
"""

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.slicing import Sheet
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.study.verdict import LoadedSurface, check
from dsfab.study.verdict.estimates import rib_width
from dsfab.study.verdict.levels import RibSoftening, shares, theory_share
from dsfab.study.verdict.verdict import attached_material
from tests.benchmarks.solid_designs import DRAWN, FITTED, LATER, NAMED, drawn_design, named_design
from tests.benchmarks.solid_wedges import solid_compliance

UNKNOWNS = 4.5e5
"""Of a solid, at most, where nothing is said."""


@dataclass(frozen=True)
class SolidRow:
    """A design beside its solid.

    share, triangles : of the material, as cut.     ratio : mean width of its ribs over the thickness.
    value, bound     : the verdict's, J and a share.
    torsion, shear, bending : shares of the compliance, see `RibSoftening`.
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
    torsion: float
    shear: float
    bending: float
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

    @property
    def theory(self) -> float:
        """What the verdict says besides its bound."""
        return theory_share(RibSoftening(self.torsion, self.shear, self.bending))

    def inside(self, theory: bool = True) -> bool:
        """Whether the solid lies within what the verdict says: bound below, bound and theory above."""
        return -self.bound <= self.gap <= self.bound + theory * self.theory


SHRINK = 3.0
"""A step between solids over the next one, where two were solved."""


def limit(values: Sequence[float]) -> float:
    """Carried on from the last two at the rate of the last three, which is kept within 1.7 and 4; or at
    `EDGE_CORRECTION`."""
    step, rate = values[-1] - values[-2], SHRINK
    if len(values) > 2 and step:
        rate = float(np.clip((values[-2] - values[-3]) / step, 1.7, 4.0))
    return values[-1] + step / (rate - 1)


def given_design(kind: str, seed: int) -> tuple[LoadedSurface, Sheet, float]:
    """A design's surface under its loads, at the thickness that it is to have, its material, and that share of all."""
    design, wanted = (named_design(kind), None) if kind in NAMED else drawn_design(kind, seed)
    setting, material = LoadedSurface.from_design(design), design.slicing.cells.subset()
    sheet, _, _ = attached_material(setting, material)
    if wanted:
        setting = LoadedSurface.from_design(design, rib_width(sheet.surface) / wanted / setting.made.thickness)
    return setting, material, sheet.surface.area / design.surface.area


def measured_row(kind: str, seed: int, unknowns: float = UNKNOWNS) -> SolidRow:
    """Raises DsfabError for a draw that cannot be made or does not carry its loads."""
    setting, material, share = given_design(kind, seed)
    name = next(iter(setting.loads))
    setting = replace(setting, loads={name: setting.loads[name]})
    sheet, _, loads = attached_material(setting, material)
    verdict = check(setting, sheet)
    if not len(verdict.levels) > 1:
        raise DsfabError(verdict.reason)
    forces, count = shares(sheet, loads), 0
    solid, second, chain = [], 1.0, meshes(sheet, SmoothSurface.from_surface(setting.surface))
    mesh = next(chain)
    while 9 * mesh.surface.n + 6 * len(mesh.surface.edges.ends) < unknowns:
        fine = next(chain)
        solid.append(solid_compliance(setting, mesh, fine, forces, 1))
        if count == 0:
            second = solid_compliance(setting, mesh, fine, forces, 2) / solid[0]
        mesh, count = fine, count + 1
    soft = verdict.levels[0].softer.get(name, RibSoftening(0.0, 0.0, 0.0))
    shell = tuple(one.compliance[name] for one in verdict.levels)
    size = share, sheet.surface.m, rib_width(sheet.surface) / setting.made.thickness
    return SolidRow(kind, seed, *size, verdict.value, verdict.bound, *soft, shell, tuple(solid), second)


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


def fit(rows: Sequence[SolidRow]) -> str:
    """What the verdict says of each design and what the solid is; how many are inside, of the kinds that the factors
    of `theory_share` were chosen on and of others, and how wide what is said is."""
    lines = ["design                         share  w/t  torsion  shear  bending   verdict          theory   solid"]
    for row in rows:
        name = row.kind if row.kind in NAMED else f"{row.kind} {row.seed}"
        shown = f"{name:30} {row.share:.2f} {row.ratio:5.1f} {row.torsion:7.1%} {row.shear:7.1%} {row.bending:7.1%}"
        told = f"{row.value:10.4g} ±{row.bound:5.1%}  +{row.theory:6.1%} {row.gap:+7.1%}"
        lines.append(f"{shown} {told}{'' if row.inside() else '  outside'}")
    for name, kinds in {"chosen on": FITTED, "others": LATER, "named": NAMED}.items():
        some = [row for row in rows if row.kind in kinds]
        if some:
            inside, alone = (sum(row.inside(theory) for row in some) for theory in (True, False))
            wide, gap = (100 * float(np.median(x)) for x in ([row.theory for row in some], [row.gap for row in some]))
            said = (
                f"{inside} inside ({alone} by the bound alone), theory says {wide:.1f} %, solids are {gap:.1f} % softer"
            )
            lines.append(f"{name:11} {len(some)} designs: {said} in the median")
    return "\n".join(lines)


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
    given.add_argument("--named", action="store_true")
    given.add_argument("--unknowns", type=float, default=UNKNOWNS, help="of a solid, at most: more for thin ones")
    given.add_argument("--fit", action="store_true")
    asked = given.parse_args()
    if asked.fit:
        print(fit(read(asked.table)))
        return
    first, last = map(int, ("0-0" if asked.from_name else asked.seeds).split("-"))
    if not asked.table.exists():
        asked.table.write_text(",".join(field.name for field in fields(SolidRow)) + "\n", encoding="ascii")
    for seed in range(first, last + 1):
        for kind in asked.kinds or (NAMED if asked.from_name else DRAWN):
            add_row(asked.table, kind, seed, asked.unknowns)


def add_row(table: Path, kind: str, seed: int, unknowns: float) -> None:
    """Solves one design and says how it went."""
    start = time.perf_counter()
    try:
        row = measured_row(kind, seed, unknowns)
    except DsfabError as error:
        print(f"{kind} {seed}: {str(error)[:150]}", flush=True)
        return
    with table.open("a", encoding="ascii", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(written(row))
    told = f"w/t {row.ratio:.1f}, theory +{row.theory:.2%}, solid {row.gap:+.2%}"
    print(f"{kind} {seed}: {row.triangles} triangles, {told}, {time.perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
