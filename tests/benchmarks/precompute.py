"""The whole pre-computation, from the membrane to the modes, against the paper's stack in C++, on the same matrices.

    python -m tests.benchmarks.precompute [10000,40000]

needs g++, libeigen3-dev and libspectra-dev, and a machine that does nothing else. C++ is given its matrices: Eigen's
SimplicialLDLT solves the statics, Spectra over Eigen's Cholesky finds the modes of both families; one run, for at
40 000 vertices it takes a minute, on one thread, so that its CPU seconds are what the clock shows. dsfab's is
everything from the surface on, assembly, factor, checks, stress, tensors and modes; medians of five runs, by the clock,
which a user waits for, and in CPU seconds of all threads; what of these is the assembly of both stiffnesses and modes.
"""

import dsfab  # noqa: F401  # isort: skip  (before numpy, as every command loads it: waiting threads of BLAS then sleep)

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.design import Design, Log
from dsfab.design.directions import diffusion_step
from dsfab.design.surface_and_statics import statics_step
from dsfab.diffusion import diffusion_operator
from dsfab.diffusion.modes import SPARE
from dsfab.statics import SheetModel, sheet_stiffness
from dsfab.statics.factorisation import stiffness_factor
from dsfab.surface.fields import voronoi_mass
from tests.benchmarks.common import compiled, sizes, sphere, write_lower
from tests.benchmarks.spectra_modes import theirs

RUNS = 5


def ours(preset) -> tuple[float, float, float, float]:
    """Seconds by the clock, of the CPU, and of these the assembly's and the modes', of statics and diffusion."""
    surface = preset.surface.build()
    _ = surface.edges, surface.normals
    log, clock, begun = Log(None, clock=time.process_time), time.perf_counter(), time.process_time()
    diffusion_step(preset, surface, statics_step(preset, surface, log), log)
    clock, spent = time.perf_counter() - clock, time.process_time() - begun
    return clock, spent, log.seconds["membrane"] + log.seconds["bending"], log.seconds["modes"]


def cplusplus(preset, folder: Path) -> tuple[float, float]:
    """CPU seconds of Eigen's statics, and of Spectra's modes of both families."""
    design, sheet, ask = Design.from_preset(preset).until("diffusion"), preset.statics, preset.diffusion
    surface, load = design.surface, design.statics.load
    model = SheetModel(surface, sheet.elastic, sheet.thickness, sheet.law)
    factor = stiffness_factor(surface, sheet_stiffness(model, sheet.elements), load.fixed.ravel())
    write_lower(folder / "K", factor.inner, factor.scale * load.force.ravel()[factor.free])
    inverse = diags_array(1 / np.sqrt(voronoi_mass(surface)))
    families = [folder / name for name in ("major", "minor")]
    for path, D in zip(families, (design.diffusion.tensors.major, design.diffusion.tensors.minor), strict=True):
        write_lower(path, csr_array(inverse @ diffusion_operator(surface, D) @ inverse))
    del factor, design
    done = subprocess.run([compiled("eigen_ldlt", folder), folder / "K"], capture_output=True, text=True, check=True)
    compute, solve, _ = map(float, done.stdout.split())
    spectra = compiled("spectra_modes", folder)
    return compute + solve, theirs(spectra, families, ask.modes + 1 + SPARE, -1 / surface.area, "cholesky")[0][1]


def main() -> None:
    """Print one line for each size."""
    ours_are = f"{'clock':>7} {'CPU':>7} {'assembly':>9} {'modes':>7}"
    print(f"{'|V|':>8} {'Eigen':>8} {'Spectra':>8} {ours_are} {'times faster':>15}")
    for vertices in sizes(__doc__, "10000,40000"):
        preset = sphere(vertices)
        with tempfile.TemporaryDirectory() as name:
            statics, modes = cplusplus(preset, Path(name))
        clock, spent, assembly, own = np.median([ours(preset) for _ in range(RUNS)], axis=0)
        print(
            f"{preset.surface.build().n:8,} {statics:8.2f} {modes:8.2f} {clock:7.2f} {spent:7.2f} {assembly:9.3f} "
            f"{own:7.3f} {(statics + modes) / clock:7.1f} ({(statics + modes) / spent:.1f})",
            flush=True,
        )


if __name__ == "__main__":
    main()
