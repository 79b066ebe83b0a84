"""Eigen's SimplicialLDLT (the paper's solver) against dsfab's whole statics stage, on the same matrix in one run.

    python tests/benchmarks/eigen_ldlt.py [10000,40000]

needs g++ and libeigen3-dev. Eigen's column is compute + solve of the free unknowns' matrix alone, which is given to it;
dsfab's is everything: assembly (membrane, hinge), factor, solve and stress. CPU seconds, best of three (Eigen: one).
"""

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from dsfab import sparse
from dsfab.statics import added, bending_stiffness, equilibrium, membrane_stiffness, stress
from dsfab.statics.factor import factored
from dsfab.surface import LoadCase
from tests.benchmarks.common import compiled, sizes, sphere, write_lower

RUNS = 3


def stage(preset, surface, load):
    """dsfab's statics stage: seconds of CPU and of the clock, and the displacements."""
    sheet = preset.statics
    cpu, wall = time.process_time(), time.perf_counter()
    K = membrane_stiffness(surface, sheet.material, sheet.thickness, sheet.law, sheet.elements)
    K = added(K, bending_stiffness(surface, sheet.material, sheet.thickness, sheet.elements))
    answer = equilibrium(surface, K, load, sheet.elements)
    stress(surface, sheet.material, answer.u, sheet.law, answer.bubbles)
    return time.process_time() - cpu, time.perf_counter() - wall, K


def main() -> None:
    print(f"{'|V|':>8} {'Eigen compute':>14} {'solve':>7} {'residual':>9} | whole stage, CPU s (wall s), times faster")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compiled("eigen_ldlt", folder)
        for vertices in sizes(__doc__, "10000,40000"):
            preset = sphere(vertices)
            surface = preset.surface.build()
            load = LoadCase.build(surface, preset.surface.support, preset.surface.load, 0.0)
            row, K = [], None
            for solver in (["PARDISO"] if sparse.solver_name() == "PARDISO" else []) + ["multifrontal", "SuperLU"]:
                original, sparse.solver_name = sparse.solver_name, lambda solver=solver: solver
                try:
                    runs = [stage(preset, surface, load) for _ in range(RUNS)]
                finally:
                    sparse.solver_name = original
                K = runs[0][2]
                row.append((solver, min(run[0] for run in runs), min(run[1] for run in runs)))
            factor = factored(surface, K, load.fixed.ravel())
            write_lower(folder / "matrix", factor.inner, factor.scale * load.force.ravel()[factor.free])
            done = subprocess.run([program, folder / "matrix"], capture_output=True, text=True, check=True)
            compute, solve, residual = map(float, done.stdout.split())
            shown = ", ".join(f"{s} {c:.2f} ({w:.2f}) {(compute + solve) / c:.1f} x" for s, c, w in row)
            print(f"{surface.n:8,} {compute:14.2f} {solve:7.2f} {residual:9.1e} | {shown}", flush=True)


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
