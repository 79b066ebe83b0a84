"""What CAD work does to a STEP by members and to a smooth one: `python tests/benchmarks/step_cuts.py [PRESET...]`.

Per way: faces, megabytes, seconds of CPU (the file; the cuts), largest distance from the mesh and back, how many of
eight half-space cuts leave two valid halves that add up to 1e-5 of the whole, the worst of these, and by how much the
plain rule for volumes, which most programs take, misses.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import dsfab
from dsfab.export.cad.step.worker import program

SECONDS = 3600


def row(name: str, step: str) -> str:
    """A line of the table."""
    design = dsfab.run(dsfab.load_preset(name, {"export.step": step}))
    with tempfile.TemporaryDirectory() as folder:
        path, begin = Path(folder) / "a.step", time.process_time()
        written = design.write(path)
        seconds = time.process_time() - begin
        command = [sys.executable, "-P", program.__file__, "use", str(path)]
        said = json.loads(subprocess.run(command, capture_output=True, text=True, check=True, timeout=SECONDS).stdout)
        size = path.stat().st_size / 1e6
    plain = said["plain"] / said["volume"] - 1
    numbers = f"{said['faces']:6d} {size:6.2f} {seconds:6.1f} {said['seconds']:6.1f}"
    return f"{name:14s} {step:8s} {numbers}  {said['sound']} of 8  {said['worst']:.0e}  {plain:+.1e}  {written}"


if __name__ == "__main__":
    print("preset         way       faces     MB  CPU s   cuts  sound    worst  plain rule")
    for name in sys.argv[1:] or ("barrel_vault", "snow_vault"):
        for step in ("members", "smooth"):
            print(row(name, step), flush=True)
