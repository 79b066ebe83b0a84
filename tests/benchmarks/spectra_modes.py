"""Spectra's shift-invert Lanczos over Eigen's SimplicialLDLT against dsfab's modes stage, on the same two operators.

    python tests/benchmarks/spectra_modes.py [10000,40000,100000]

needs g++, libeigen3-dev and libspectra-dev. CPU seconds for both operators together. Spectra is given the scaled
matrices; dsfab's time includes making them, and fixing signs and bases.
"""

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.diffusion import diffusion_modes, diffusion_operator, diffusion_tensors
from dsfab.diffusion.modes import SPARE
from dsfab.pipeline.log import Log
from dsfab.pipeline.structure import statics_step
from dsfab.surface.hats import voronoi_mass
from tests.benchmarks.common import compiled, sizes, sphere, write_lower


def main() -> None:
    print(f"{'|V|':>8} {'Spectra':>8} {'dsfab':>8} {'times faster':>13} {'eigenvalues differ':>19}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compiled("spectra_modes", folder)
        for vertices in sizes(__doc__, "10000,40000,100000"):
            preset = sphere(vertices)
            surface, ask = preset.surface.build(), preset.diffusion
            sigma = statics_step(preset, surface, Log(None)).sigma
            tensors = diffusion_tensors(surface, sigma, ask.r, ask.gamma, ask.labelling, ask.isotropy)
            ours = theirs = worst = 0.0
            for D in (tensors.major, tensors.minor):
                L = diffusion_operator(surface, D)
                start = time.process_time()
                modes = diffusion_modes(surface, L, ask.modes)
                ours += time.process_time() - start
                inverse = diags_array(1 / np.sqrt(voronoi_mass(surface)))
                write_lower(folder / "matrix", csr_array(inverse @ L @ inverse))
                count, shift = ask.modes + 1 + SPARE, -1 / surface.area
                command = [program, folder / "matrix", str(count), str(shift)]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                seconds, *values = map(float, done.stdout.split())
                theirs += seconds
                lam = np.sort(values)[1 : 1 + len(modes.lam)]
                worst = max(worst, float(np.abs(lam / modes.lam - 1).max()))
            print(f"{surface.n:8,} {theirs:8.2f} {ours:8.2f} {theirs / ours:13.1f} {worst:19.1e}", flush=True)


if __name__ == "__main__":
    main()
