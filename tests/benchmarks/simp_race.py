"""The cantilever's pattern against topology optimisation on the same mesh: time, and what the results are worth.

    python tests/benchmarks/simp_race.py [6000,24000]

The pattern is the preset `cantilever` from its surface to the cut sheet: with the modes given, and with both modes
`auto` (16 candidates, each cut and solved). SIMP runs with a filter of 0.04 m from the same statics: 60 steps, until
no density changes by more than 1 %, and 60 steps whose systems SciPy's SuperLU solves anew, as in ports of top88
[Andreassen et al. 2011] to Python; dsfab's own SIMP analyses the matrix once. Seconds of the CPU (all threads) and by
the clock, the least of two runs; compliance of the cut sheet over that of the uncut one, by `quadratic` elements on the
mesh as it is cut.
"""

import time

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from dsfab.design import draft
from dsfab.design.regions_and_loads import sheet_load
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.preset.file import load_preset
from dsfab.results import Log
from dsfab.statics import Elements, FaceStiffness, SheetModel, solve_statics
from dsfab.study.baselines import ComparisonTask
from dsfab.study.baselines.topology_optimisation import Simp, level_set_structure, optimised_densities
from tests.benchmarks.common import sizes

AUTO = {f"pattern.{family}.mode": "auto" for family in ("major", "minor")}
RUNS = 2


def timed(task, runs=RUNS):
    """The least seconds (CPU, clock) of some runs, and what came of the last."""
    seconds = []
    for _ in range(runs):
        cpu, clock = time.process_time(), time.perf_counter()
        made = task()
        seconds.append((time.process_time() - cpu, time.perf_counter() - clock))
    return np.min(seconds, axis=0), made


def cut(preset):
    """The sheet of a preset."""
    made = draft(preset)
    return slicing_step(preset, made.surface, made.statics, made.pattern, Log(None)).sheet


def worth(made, sheet):
    """Compliance of a sheet over that of the whole surface."""
    ask, surface = made.preset.statics, made.surface
    whole, part = (
        solve_statics(SheetModel(s, ask.elastic, ask.thickness), load, Elements("quadratic", "hinge")).compliance
        for s, load in ((surface, made.load), (sheet.surface, sheet_load(surface, sheet, made.load)))
    )
    return part / whole


def anew(self, scale, earlier=None):
    """`FaceStiffness.factor` that learns nothing from the step before."""
    return splu(csc_array(self.matrix(scale))).solve


def race(vertices: int) -> None:
    """One size of the mesh."""
    edge = 0.02 * (5988 / vertices) ** 0.5
    preset, auto = (load_preset("cantilever", {"surface.edge": edge, **more}) for more in ({}, AUTO))
    made = draft(preset)
    task = ComparisonTask.from_design(made, preset.pattern.width.solid_fraction * made.surface.area)
    rows = [("pattern, modes given", *timed(lambda: cut(preset))), ("pattern, modes auto", *timed(lambda: cut(auto)))]
    usual, FaceStiffness.factor = FaceStiffness.factor, anew
    seconds, found = timed(lambda: optimised_densities(task, Simp(radius=0.04)), 1)
    FaceStiffness.factor = usual
    rows.append(
        (f"SIMP, {len(found.history)} steps, SuperLU anew", seconds, level_set_structure(task, found.density).sheet)
    )
    for most in (60, 1000):
        seconds, found = timed(lambda most=most: optimised_densities(task, Simp(radius=0.04, iterations=most)), 1)
        rows.append((f"SIMP, {len(found.history)} steps", seconds, level_set_structure(task, found.density).sheet))
    print(f"\n{made.surface.n} vertices{'':18s} CPU s  clock s  x uncut")
    for name, (cpu, clock), sheet in rows:
        print(f"{name:32s} {cpu:8.2f} {clock:8.2f} {worth(made, sheet):8.3f}", flush=True)


if __name__ == "__main__":
    for number in sizes(__doc__.splitlines()[0], "6000,24000"):
        race(number)
