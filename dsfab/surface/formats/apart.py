"""3DM drawings read in a process of their own: rhino3dm crashes on some damaged files of 7 kB, and takes 6.7 GB or half
a minute for others."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import SurfaceError
from dsfab.surface.formats.curves import Drawing, DrawingBudget
from dsfab.surface.formats.limits import MalformedFileError
from dsfab.surface.formats.rhino import read_rhino, require_rhino

MEMORY = 2**30
"""Bytes of addresses beyond those that the process has before it reads."""
SECONDS = 3
"""Of the processor for a small file; as many more for each `EACH` bytes."""
EACH = 10_000_000
PROGRAM = "from dsfab.surface.formats.apart import main; main()"


def read_rhino_apart(path: Path, budget: DrawingBudget) -> Drawing:
    """As `read_rhino`, and raises MalformedFileError where the library crashes or takes too much."""
    require_rhino()
    seconds = int(SECONDS * (1 + path.stat().st_size / EACH))
    command = [sys.executable, "-P", "-c", PROGRAM, str(path.resolve()), str(seconds)]
    found = os.environ | {"PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}
    try:
        done = subprocess.run(command, capture_output=True, env=found, timeout=budget.seconds, check=False)
    except subprocess.TimeoutExpired:
        budget.require("bytes", 0)  # it says that it took too long
        raise
    if done.returncode:
        raise MalformedFileError("it is damaged: Rhino's library breaks on it")
    said = json.loads(done.stdout)
    if "refused" in said:
        raise SurfaceError(said["refused"])
    if "malformed" in said:
        raise MalformedFileError(said["malformed"])
    runs = tuple((layer, np.array(points, dtype=float).reshape(-1, 3)) for layer, points in said["runs"])
    return Drawing(runs, tuple(said["layers"]), said["unit"])


def main() -> None:
    """The program: the file and its seconds as arguments, one line of JSON as the answer."""
    path, seconds = sys.argv[1:]
    _limit(int(seconds))
    sys.stdout.write(json.dumps(_answer(Path(path))))


def _answer(path: Path) -> dict[str, Any]:
    try:
        drawing = read_rhino(path, DrawingBudget())
    except SurfaceError as error:
        return {"refused": str(error)}
    except MalformedFileError as error:
        return {"malformed": str(error)}
    runs = [(layer, points.tolist()) for layer, points in drawing.runs]
    return {"runs": runs, "layers": drawing.layers, "unit": drawing.unit}


def _limit(seconds: int) -> None:
    """Less memory and time for this process, where the system knows such limits (not on Windows)."""
    if importlib.util.find_spec("resource") is None:
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    held = Path("/proc/self/statm")
    if held.exists():
        most = int(held.read_text().split()[0]) * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
