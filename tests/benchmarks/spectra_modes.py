"""Spectra's shift-invert Lanczos against dsfab's modes stage, on the same two operators.

    python tests/benchmarks/spectra_modes.py [10000,40000,100000]

needs g++, libeigen3-dev and libspectra-dev. Seconds by the clock and (CPU seconds of all threads) for both operators
together, the least of five runs of each, taken in turn; as many pairs for all. Spectra runs twice: as it comes
(SparseSymShiftSolve, an LU), and with Eigen's Cholesky put in its place. It is given the scaled matrices; dsfab's time
includes making them, the order of elimination, and fixing signs and bases, on a surface that was not used before.
Residuals are |A y - lambda y| / lambda of the modes that were asked for, the largest.
"""

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.design.surface_and_statics import statics_step
from dsfab.diffusion import diffusion_operator, diffusion_tensors, family_modes, reference_axes
from dsfab.diffusion.modes import SPARE
from dsfab.results import Log
from dsfab.surface.fields import voronoi_mass
from tests.benchmarks.common import compiled, sizes, sphere, write_lower

RUNS = 5


def ours(preset, operators):
    """Seconds (clock, CPU), and the modes of both operators."""
    surface = preset.surface.build()
    _ = surface.edges, surface.normals
    clock, cpu = time.perf_counter(), time.process_time()
    axes = reference_axes(surface)
    modes = family_modes(surface, operators, preset.diffusion.modes, axes)
    return np.array([time.perf_counter() - clock, time.process_time() - cpu]), modes


def theirs(program, paths, count, shift, solver):
    """Seconds (clock, CPU), and per operator the eigenvalues and the largest residuals, ascending."""
    seconds, found = np.zeros(2), []
    for path in paths:
        command = [program, path, str(count), str(shift), solver]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        cpu, clock, *rest = map(float, done.stdout.split())
        seconds += clock, cpu
        lam, residual = np.array(rest).reshape(-1, 2).T
        order = np.argsort(lam)
        found.append((lam[order], residual[order]))
    return seconds, found


def residual(L, mass, modes) -> float:
    """The largest |A y - lambda y| / (lambda |y|), A = M^-1/2 L M^-1/2."""
    root = np.sqrt(mass)[:, None]
    off = np.linalg.norm((L @ modes.X - mass[:, None] * modes.X * modes.lam) / root, axis=0)
    return float((off / np.linalg.norm(root * modes.X, axis=0) / modes.lam).max())


def main() -> None:
    names = ("Spectra", "with Cholesky", "dsfab")
    print(f"{'|V|':>8} " + " ".join(f"{name:>17}" for name in names) + "   times faster, residuals, eigenvalues differ")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compiled("spectra_modes", folder)
        for vertices in sizes(__doc__, "10000,40000,100000"):
            preset = sphere(vertices)
            surface, ask = preset.surface.build(), preset.diffusion
            sigma = statics_step(preset, surface, Log(None)).sigma
            tensors = diffusion_tensors(surface, sigma, ask.r, ask.gamma, ask.labelling, ask.isotropy)
            operators = [diffusion_operator(surface, D) for D in (tensors.major, tensors.minor)]
            mass = voronoi_mass(surface)
            inverse, paths = diags_array(1 / np.sqrt(mass)), [folder / "major", folder / "minor"]
            for path, L in zip(paths, operators, strict=True):
                write_lower(path, csr_array(inverse @ L @ inverse))
            count, shift = ask.modes + 1 + SPARE, -1 / surface.area
            runs = []
            for run in range(RUNS):
                # as it comes it takes a multiple: once is enough
                own = theirs(program, paths, count, shift, "own")[0] if run == 0 else runs[0][0]
                cholesky, pairs = theirs(program, paths, count, shift, "cholesky")
                dsfab, modes = ours(preset, operators)
                runs.append((own, cholesky, dsfab))
            least = np.min(runs, axis=0)  # (3 solvers, clock and CPU)
            kept = slice(1, 1 + ask.modes)
            worst = max(float(np.abs(lam[kept] / m.lam - 1).max()) for (lam, _), m in zip(pairs, modes, strict=True))
            their = max(float((off[kept] / lam[kept]).max()) for lam, off in pairs)
            our = max(residual(L, mass, m) for L, m in zip(operators, modes, strict=True))
            print(
                f"{surface.n:8,} "
                + " ".join(f"{clock:8.3f} ({cpu:6.3f})" for clock, cpu in least)
                + "   "
                + ", ".join(f"{clock:.2f} ({cpu:.2f})" for clock, cpu in least[:2] / least[2])
                + f"   {their:.0e} / {our:.0e}, {worst:.0e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
