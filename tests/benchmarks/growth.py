"""How the slicer grows: CPU seconds, seconds by the clock and memory for more and more triangles in its result.

    python tests/benchmarks/growth.py [300000,1000000,2500000,5000000]

The numbers are triangles of the result, material and void, which come out within a tenth. A wavy square, two families
of stripes that grow in number with the mesh, so that the same share of its faces is cut; each size in a process of its
own. Linear growth is a last column but one that stays: microseconds of CPU for each triangle; the last one is bytes.
"""

import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from dsfab.slicing import cut
from tests.benchmarks.common import sizes
from tests.shapes import lifted

PER_FACE, FACES_ACROSS = 1.86, 5.6
"""Triangles of the result for each face, with this many faces along the edge of the mesh for each stripe: measured."""


def main() -> None:
    head = ("faces", "stripes", "triangles", "CPU s", "clock s", "GB at most", "us each")
    print(" ".join(f"{row:>11}" for row in head), flush=True)
    for triangles in sizes(__doc__ or "", "300000,1000000,2500000,5000000"):
        subprocess.run([sys.executable, str(Path(__file__).resolve()), "one", str(triangles)], check=True)


def one(triangles: int) -> None:
    """Measure one size, in this process."""
    across = round((triangles / PER_FACE / 2) ** 0.5)
    surface = lifted(lambda x, y: 0.1 * np.sin(5 * x) * np.cos(4 * y), cells=across)
    x, y, z = surface.V.T
    fields = [x + 0.2 * y**2 + z, y - 0.3 * x + z]
    stripes = round(across / FACES_ACROSS)
    levels = [np.linspace(f.min(), f.max(), 2 * stripes + 2)[1:-1] for f in fields]
    cpu, clock = time.process_time(), time.perf_counter()
    sheet = cut(surface, fields, levels)
    cpu, clock = time.process_time() - cpu, time.perf_counter() - clock
    m, most = sheet.surface.m, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    numbers = f"{cpu:11.2f} {clock:11.2f} {most:11.2f} {1e6 * cpu / m:11.2f}"
    print(f"{surface.m:11,} {stripes:11} {m:11,} {numbers}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        one(int(sys.argv[2]))
    else:
        main()
