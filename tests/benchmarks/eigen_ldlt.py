"""Eigen's SimplicialLDLT (the paper's solver) against dsfab's whole statics stage, on the same matrix in one run.

    python tests/benchmarks/eigen_ldlt.py [10000,40000]

needs g++ and libeigen3-dev. Eigen's column is compute + solve of the free unknowns' matrix alone, which is given to it;
dsfab's is everything: pattern and assembly (membrane, hinge), factor, solve, checks and stress, on a surface that was
not solved before. CPU seconds of all threads, then seconds of the clock on all cores (Eigen's solver has one thread:
both are the same for it on a quiet machine); the best and the median of three runs of each, taken in turn.
"""

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from dsfab.core import sparse
from dsfab.statics import SheetModel, equilibrium, sheet_stiffness, stress
from dsfab.statics.factorisation import stiffness_factor
from dsfab.surface import LoadCase
from tests.benchmarks.common import compiled, sizes, sphere, write_lower

RUNS = 3


def stage(preset, surface, load):
    """dsfab's statics stage: seconds of CPU and of the clock, and the stiffness."""
    sheet = preset.statics
    cpu, wall = time.process_time(), time.perf_counter()
    K = sheet_stiffness(SheetModel(surface, sheet.elastic, sheet.thickness, sheet.law), sheet.elements)
    answer = equilibrium(surface, K, load, sheet.elements)
    stress(surface, sheet.elastic, answer.u, sheet.law, answer.bubbles)
    return time.process_time() - cpu, time.perf_counter() - wall, K


def timed(solver, preset, load):
    """`stage` with the named solver on a fresh copy of the surface, whose edges its own stage has found."""
    surface = preset.surface.build()
    _ = surface.edges, surface.normals
    original, sparse.solver_name = sparse.solver_name, lambda: solver
    try:
        return stage(preset, surface, load)
    finally:
        sparse.solver_name = original


def shown(name: str, runs: list[float], theirs: list[float]) -> str:
    """Best and median, and how many times faster than the other side's best and median."""
    return (
        f"{name:>20} {min(runs):8.3f} {np.median(runs):8.3f} {min(theirs) / min(runs):8.1f} "
        f"{np.median(theirs) / np.median(runs):8.1f}"
    )


def main() -> None:
    solvers = (["PARDISO"] if sparse.solver_name() == "PARDISO" else []) + ["multifrontal", "SuperLU"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compiled("eigen_ldlt", folder)
        for vertices in sizes(__doc__, "10000,40000"):
            preset = sphere(vertices)
            surface = preset.surface.build()
            load = LoadCase.build(surface, preset.surface.support, preset.surface.load, 0.0)
            K = stage(preset, surface, load)[2]
            factor = stiffness_factor(surface, K, load.fixed.ravel())
            write_lower(folder / "matrix", factor.inner, factor.scale * load.force.ravel()[factor.free])
            del factor
            runs: dict[str, list[float]] = {solver: [] for solver in ("Eigen", *solvers)}
            clock: dict[str, list[float]] = {solver: [] for solver in solvers}
            for _ in range(RUNS):
                done = subprocess.run([program, folder / "matrix"], capture_output=True, text=True, check=True)
                compute, solve, residual = map(float, done.stdout.split())
                runs["Eigen"].append(compute + solve)
                for solver in solvers:
                    cpu, wall, _ = timed(solver, preset, load)
                    runs[solver].append(cpu)
                    clock[solver].append(wall)
            print(f"{surface.n:,} vertices; Eigen's residual {residual:.1e}")
            print(f"{'':>20} {'best s':>8} {'median s':>8} {'x best':>8} {'x median':>8}")
            for solver, seconds in runs.items():
                print(shown(solver, seconds, runs["Eigen"]), flush=True)
            for solver, seconds in clock.items():
                print(shown(f"{solver}, clock", seconds, runs["Eigen"]), flush=True)


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
