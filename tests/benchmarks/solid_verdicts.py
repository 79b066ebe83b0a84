"""The verdict on a cut sheet beside a solid of it by CalculiX: movement, buckling factor and utilisation of members.

    python -m tests.benchmarks.solid_verdicts PRESET [KEY=VALUE ...]

The solid has one quadratic wedge (C3D15) for each triangle, upright on the smooth surface, and hinges as supports. Its
stresses are summed over the cuts across members that dsfab uses. The check of members by their standard then has the
forces of the solid in place of those of the sheet.
"""

import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.design import Design
from dsfab.design.member_model import member_utilisation
from dsfab.members.frame import MemberCuts, MemberForces
from dsfab.members.frame.forces import with_balanced_shear
from dsfab.preset.file import load_preset, parse_override, with_overrides
from dsfab.study.calculix import (
    THICKNESS_SHARES,
    WedgeModel,
    Wedges,
    load_lines,
    lowest_buckling,
    model_lines,
    require_ccx,
    solid_model,
)
from dsfab.study.carrying import Carrying, CutStatics, cut_carrying, cut_statics
from tests.benchmarks.solid_wedges import vertex_normals

SECONDS = 600.0
"""For a buckling analysis, at most."""

LEVELS = np.array([-0.5, 0.5, 0.0])  # of the nodes of a column: below, above, in the middle
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
    models = {name: wedge_model(statics, name) for name in names}
    solid, results = models[names[0]].solid, run(list(models.values()))
    moved = np.linalg.norm(results["DISP"][0][solid.columns[:, 2]], axis=1).max()
    stresses = {name: tensors(rows) for name, rows in zip(names, results["STRESS"], strict=True)}
    forces = {name: summed_forces(statics, solid, name, cut, stresses) for name, cut in design.member_cuts.items()}
    use = member_utilisation(statics.preset, design.members, forces)
    found = lowest_buckling(models[sheet.buckling_case], SECONDS) if buckling and sheet.buckling else None
    return SolidVerdict(sheet, float(moved), found[0] if found else float("nan"), float(use.largest.max()))


def wedge_model(statics: CutStatics, name: str) -> WedgeModel:
    """One layer of wedges on the cut sheet, with the forces of a case or a combination."""
    normal = statics.design.sheet.weights @ vertex_normals(statics.design.surface)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    load, factors = next(iter(statics.loads.values())), statics.design.statics.cases[name].factors or {name: 1.0}
    load = replace(load, force=np.asarray(sum(f * statics.loads[case].force for case, f in factors.items())))
    return solid_model(statics.model.surface, normal, statics.thickness, statics.model.material, load)


def run(models: Sequence[WedgeModel]) -> dict[str, list[Floats]]:
    """Solve a solid under the forces of each model: DISP (nodes, 3) and STRESS (nodes, 6) of each."""
    nodes = models[0].solid.nodes
    text = [*model_lines(models[0], nodes)]
    for model in models:
        text += ["*STEP\n*STATIC\n*CLOAD, OP=NEW\n", *load_lines(model.force)]
        text.append("*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "solid.inp").write_text("".join(text), encoding="ascii")
        done = subprocess.run([require_ccx(), "solid"], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise DsfabError(f"CalculiX: {done.stdout.strip()[-300:]}")
        return blocks(Path(folder) / "solid.frd", len(nodes))


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
    statics: CutStatics, solid: Wedges, name: str, cut: MemberCuts, stresses: Mapping[str, Floats]
) -> MemberForces:
    """Forces of a member from the stresses at nodes: two points of Gauss along each line, Simpson's rule through it."""
    graph, surface, lines = statics.design.members, statics.model.surface, cut.sections
    source = graph.source[lines.face]
    F = corners_as_in(graph.sheet.surface.V[graph.sheet.surface.F[lines.face]], surface.V, surface.F[source])
    upright = solid.nodes[solid.columns[F[:, 0], 1]] - solid.nodes[solid.columns[F[:, 0], 0]]
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    sums = {}
    for case, stress in stresses.items():
        P, M = np.zeros((2, len(cut.s), 3))
        for x in GAUSS:
            weight, arm = ((1 - x) * ends[:, 0] + x * ends[:, 1] for ends in (lines.weight, lines.arm))
            for level, (z, share) in enumerate(zip(LEVELS * statics.thickness, THICKNESS_SHARES, strict=True)):
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
