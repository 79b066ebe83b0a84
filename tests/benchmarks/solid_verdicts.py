"""The verdict on a cut sheet beside a solid of it by CalculiX: movement, buckling factor and utilisation of members.

    python -m tests.benchmarks.solid_verdicts PRESET [KEY=VALUE ...]

The solid has one quadratic wedge (C3D15) for each triangle, upright on the smooth surface, and hinges as supports. Its
stresses are summed over the cuts across members that dsfab uses. The check of members by their standard then has the
forces of the solid in place of those of the sheet.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.design import Design
from dsfab.design.member_model import member_utilisation
from dsfab.members.frame import MemberForces, member_cuts
from dsfab.members.frame.forces import MemberCuts, with_balanced_shear
from dsfab.preset.file import load_preset, parse_override, with_overrides
from dsfab.statics import flat_axis
from dsfab.study.carrying import Carrying, CutStatics, cut_carrying, cut_statics
from tests.benchmarks.solid_wedges import Layers, layers, supports, vertex_normals

LEVELS = np.array([-0.5, 0.0, 0.5])
WEIGHTS = np.array([1 / 6, 4 / 6, 1 / 6])
"""Of the lower, middle and upper node of a column: Simpson's rule."""
GAUSS = (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3))
ON_FACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Components of a stress in CalculiX's order."""


@dataclass(frozen=True)
class SolidVerdict:
    """dsfab's verdict; and of the solid: movement (m) in the verdict's case, lowest positive buckling factor (nan where
    none was asked), largest utilisation of members."""

    sheet: Carrying
    movement: float
    buckling: float
    utilisation: float

    @property
    def ratios(self) -> tuple[float, float, float]:
        """Values of the solid over those of the sheet: movement, buckling, utilisation."""
        assert self.sheet.movement
        assert self.sheet.use
        factor = self.sheet.buckling or float("nan")
        return (
            self.movement / self.sheet.movement.value,
            self.buckling / factor,
            self.utilisation / self.sheet.use.value,
        )


def solid_verdict(design: Design, buckling: bool = True) -> SolidVerdict:
    """The cut sheet of a design, judged by dsfab, and solved as a solid for the cases that its verdict names."""
    statics = cut_statics(design, design.preset.statics.thickness)
    sheet = cut_carrying(statics)
    if not (sheet.movement and sheet.use):
        raise DsfabError("without a strength nothing is compared")
    names = list(dict.fromkeys([sheet.movement.case, *design.preset.judged_in("ULS", statics.answers)]))
    solid = wedges(statics)
    results = run(statics, solid, [force(statics, name) for name in names])
    moved = np.linalg.norm(results["DISP"][0][solid.columns[:, 1]], axis=1).max()
    stresses = {name: tensors(rows) for name, rows in zip(names, results["STRESS"], strict=True)}
    cuts = member_cuts(design.members)
    forces = {name: summed_forces(statics, solid, name, cut, stresses) for name, cut in cuts.items()}
    use = member_utilisation(statics.preset, design.members, forces)
    factor = float("nan")
    if buckling and sheet.buckling:
        factor = min(f for f in run(statics, solid, [force(statics, sheet.buckling_case)], 6)["factors"] if f > 0)
    return SolidVerdict(sheet, float(moved), factor, float(use.largest.max()))


def wedges(statics: CutStatics) -> Layers:
    """One layer of wedges on the cut sheet."""
    design, surface, ends = statics.design, statics.model.surface, statics.model.surface.edges.ends
    normal = design.sheet.weights @ vertex_normals(design.surface)
    normal = np.concatenate([normal, normal[ends].sum(axis=1)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    fine = SimpleNamespace(V=np.concatenate([surface.V, surface.V[ends].mean(axis=1)]))
    return layers(surface, statics.thickness, fine, normal, 1)


def force(statics: CutStatics, name: str) -> Floats:
    """Newtons (n, 3) on the vertices of the cut sheet, of a case or a combination."""
    factors = statics.design.statics.cases[name].factors
    if factors is None:
        return statics.loads[name].force
    return np.asarray(sum(f * statics.loads[case].force for case, f in factors.items()))


def run(statics: CutStatics, solid: Layers, forces: Sequence[Floats], modes: int = 0) -> dict[str, list[Floats]]:
    """Solve the solid: DISP (nodes, 3) and STRESS (nodes, 6) of each load; or the `factors` of buckling."""
    surface, load = statics.model.surface, next(iter(statics.loads.values()))
    held = np.concatenate([load.fixed, load.fixed[surface.edges.ends].all(axis=1)])
    fixed, opposite = supports(solid, surface, load, held, flat_axis(surface, *statics.loads.values()))
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1},{x:.12e},{y:.12e},{z:.12e}" for k, (x, y, z) in enumerate(solid.nodes)]
    lines.append("*ELEMENT, TYPE=C3D15, ELSET=S")
    lines += [f"{k},{','.join(map(str, row))}" for k, row in enumerate((solid.elements + 1).tolist(), start=1)]
    material = statics.model.material
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.young},{material.poisson}"]
    lines += ["*SOLID SECTION, ELSET=S, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{k + 1},{way + 1},{way + 1}" for k, way in fixed.tolist()]
    for a, b, way in opposite.tolist():
        lines += ["*EQUATION", "2", f"{a + 1},{way + 1},1.,{b + 1},{way + 1},1."]
    for rows in forces:
        lines += ["*STEP", *(["*BUCKLE", str(modes)] if modes else ["*STATIC"]), "*CLOAD,OP=NEW"]
        for column, weight in zip(solid.columns.T, WEIGHTS, strict=True):
            lines += [
                f"{column[v] + 1},{w + 1},{rows[v, w] * weight:.12e}" for v, w in zip(*rows.nonzero(), strict=True)
            ]
        lines += ["*NODE FILE", "U", *(() if modes else ("*EL FILE", "S")), "*END STEP"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "solid.inp").write_text("\n".join([*lines, ""]), encoding="ascii")
        single = {**os.environ, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(["ccx", "solid"], cwd=folder, capture_output=True, text=True, env=single, check=False)
        if done.returncode:
            raise DsfabError(f"CalculiX: {done.stdout.strip()[-300:]}")
        if modes:
            text = (Path(folder) / "solid.dat").read_text(encoding="ascii")
            return {"factors": [np.float64(x) for x in re.findall(r"^ +\d+ +(-?\d\S+)$", text, re.MULTILINE)]}
        return blocks(Path(folder) / "solid.frd", len(solid.nodes))


def blocks(path: Path, nodes: int) -> dict[str, list[Floats]]:
    """Results at nodes, by name, in CalculiX's .frd file: columns of 12 characters."""
    results: dict[str, list[Floats]] = {"DISP": [], "STRESS": []}
    rows: Floats | None = None
    with path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            if line.startswith(" -4"):
                rows = np.zeros((nodes, 6))
                results.setdefault(line[5:11].strip(), []).append(rows)
            elif line.startswith(" -1") and rows is not None:
                values = [float(line[k : k + 12]) for k in range(13, len(line.rstrip()) - 11, 12)]
                rows[int(line[3:13]) - 1, : len(values)] = values
            elif line.startswith(" -3"):
                rows = None
    return results | {"DISP": [rows[:, :3] for rows in results["DISP"]]}


def tensors(rows: Floats) -> Floats:
    """(nodes, 3, 3) of (nodes, 6)."""
    full = np.zeros((len(rows), 3, 3))
    for column, (i, j) in enumerate(ON_FACES):
        full[:, i, j] = full[:, j, i] = rows[:, column]
    return full


def summed_forces(
    statics: CutStatics, solid: Layers, name: str, cut: MemberCuts, stresses: Mapping[str, Floats]
) -> MemberForces:
    """Forces of a member from the stresses at nodes: two points of Gauss along each line, Simpson's rule through it."""
    graph, surface, lines = statics.design.members, statics.model.surface, cut.sections
    source = graph.source[lines.face]
    F = corners_as_in(graph.sheet.surface.V[graph.sheet.surface.F[lines.face]], surface.V, surface.F[source])
    upright = solid.nodes[solid.columns[F[:, 0], 2]] - solid.nodes[solid.columns[F[:, 0], 0]]
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    sums = {}
    for case, stress in stresses.items():
        P, M = np.zeros((2, len(cut.s), 3))
        for x in GAUSS:
            weight, arm = ((1 - x) * ends[:, 0] + x * ends[:, 1] for ends in (lines.weight, lines.arm))
            for level, (z, share) in enumerate(zip(LEVELS * statics.thickness, WEIGHTS, strict=True)):
                traction = np.einsum("cn,cnij,cj->ci", weight, stress[solid.columns[F, level]], lines.across)
                traction *= (statics.thickness * share * lines.length / len(GAUSS))[:, None]
                np.add.at(P, lines.station, traction)
                np.add.at(M, lines.station, np.cross(arm + z * upright, traction))
        rows = np.concatenate([np.einsum("kai,ki->ka", cut.axes, values) for values in (P, M)], axis=1)
        sums[case] = with_balanced_shear(rows, cut)
    return MemberForces(name, cut.s, cut.bay, cut.width, sums)


def corners_as_in(wanted: Floats, V: Floats, F: Ints) -> Ints:
    """The corners (c, 3) of faces in the order of the places (c, 3, 3)."""
    away = np.linalg.norm(wanted[:, :, None] - V[F][:, None], axis=3)
    return np.take_along_axis(F, away.argmin(axis=2), axis=1)


def main(words: Sequence[str]) -> None:
    preset = with_overrides(load_preset(words[0]), dict(parse_override(word) for word in words[1:]))
    verdict = solid_verdict(Design.from_preset(preset))
    print(replace(verdict, sheet=replace(verdict.sheet, stress=None, reactions=())))
    print("solid / sheet: movement {:.3f}, buckling {:.3f}, utilisation {:.3f}".format(*verdict.ratios))


if __name__ == "__main__":
    main(sys.argv[1:])
