"""Files that foreign libraries read, in a process of their own: rhino3dm crashes on some damaged files of 7 kB, and
takes 6.7 GB or half a minute for others; OCCT may take any time for a surface, and end the process."""

import importlib.util
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.errors import SurfaceError
from dsfab.surface.clean.seams import equal_merged, merged
from dsfab.surface.files.reading import Budget, Drawing, DrawingBudget, MalformedFileError, TriangleFile
from dsfab.surface.files.rhino_and_step import read_occt, read_rhino, read_rhino_meshes, require_rhino

GIB = 2**30
MEMORY = {"drawing": GIB, "meshes": GIB, "cad": 4 * GIB}
"""Bytes of addresses beyond those that the process has before it reads."""
SECONDS = {"drawing": 3, "meshes": 6, "cad": 60}
"""Of the processor for a small file; as many more for each `EACH` bytes."""
EACH = 10_000_000
JOINED = 1e-7
"""Points of two CAD faces on their common edge are this near each other, as a share of the largest side."""
PROGRAM = "from dsfab.surface.files.separate_process import main; main()"
WHOSE = {"drawing": "Rhino's library", "meshes": "Rhino's library", "cad": "OCCT"}


def read_rhino_apart(path: Path, budget: DrawingBudget) -> Drawing:
    """As `read_rhino`, and raises MalformedFileError where the library crashes or takes too much."""
    require_rhino()
    try:
        said = json.loads(_said("drawing", path, budget.seconds))
    except subprocess.TimeoutExpired:
        budget.require_time()  # it says that it took too long
        raise
    _raise(said)
    runs, points = (
        tuple((layer, np.array(rows, dtype=float).reshape(-1, 3)) for layer, rows in said[key])
        for key in ("runs", "points")
    )
    return Drawing(runs, tuple(said["layers"]), said["unit"], points)


def read_3dm(path: Path, budget: Budget) -> TriangleFile:
    """The meshes of a 3DM file, vertices at exactly the same place made one. Raises as `read_rhino_apart` does."""
    require_rhino()
    found = _triangles("meshes", path, budget)
    V, F = equal_merged(found.V, found.F)
    return TriangleFile(V, F, found.unit, found.metres, found.doubts, found.dropped)


def read_cad(path: Path, budget: Budget) -> TriangleFile:
    """The faces of a STEP or BREP file as triangles, joined along common edges. Raises as `read_rhino_apart` does."""
    found = _triangles("cad", path, budget)
    V, became = merged(found.V, JOINED)
    F = became[found.F]
    whole = (np.roll(F, 1, axis=1) != F).all(axis=1)
    return TriangleFile(V, F[whole], found.unit, found.metres, found.doubts, found.dropped)


def _triangles(kind: str, path: Path, budget: Budget) -> TriangleFile:
    """What the program reads, checked against the budget."""
    try:
        answer = _said(kind, path, budget.seconds + SECONDS[kind])
    except subprocess.TimeoutExpired:
        raise SurfaceError(f"reading took more than {budget.seconds:.0f} s; export it as a mesh") from None
    with np.load(io.BytesIO(answer)) as arrays:
        said, V, F = json.loads(str(arrays["said"])), arrays["V"], arrays["F"]
    _raise(said)
    budget.require_triangles(len(F))
    return TriangleFile(V, F, said["unit"], said["metres"], (), tuple(said["dropped"]))


def _said(kind: str, path: Path, most: float) -> bytes:
    """What the program writes; raises MalformedFileError where it ends early."""
    seconds = int(SECONDS[kind] * (1 + path.stat().st_size / EACH))
    command = [sys.executable, "-P", "-c", PROGRAM, kind, str(path.resolve()), str(seconds)]
    found = os.environ | {"PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}
    done = subprocess.run(command, capture_output=True, env=found, timeout=most, check=False)
    if done.returncode:
        raise MalformedFileError(f"it is damaged: {WHOSE[kind]} breaks on it")
    return done.stdout


def _raise(said: dict[str, Any]) -> None:
    if "refused" in said:
        raise SurfaceError(said["refused"])
    if "malformed" in said:
        raise MalformedFileError(said["malformed"])


def main() -> None:
    """The program: what is read, the file and its seconds as arguments; the answer is a line of JSON, of meshes an .npz
    file with that line in it."""
    kind, path, seconds = sys.argv[1:]
    _limit(int(seconds), MEMORY[kind])
    if kind == "drawing":
        sys.stdout.write(json.dumps(_drawing(Path(path))))
        return
    said, V, F = _meshes(kind, Path(path))
    np.savez(sys.stdout.buffer, said=json.dumps(said), V=V, F=F)


def _drawing(path: Path) -> dict[str, Any]:
    try:
        drawing = read_rhino(path, DrawingBudget())
    except SurfaceError as error:
        return {"refused": str(error)}
    except MalformedFileError as error:
        return {"malformed": str(error)}
    runs, points = ([(layer, rows.tolist()) for layer, rows in some] for some in (drawing.runs, drawing.points))
    return {"runs": runs, "points": points, "layers": drawing.layers, "unit": drawing.unit}


def _meshes(kind: str, path: Path) -> tuple[dict[str, Any], Any, Any]:
    try:
        found = read_rhino_meshes(path, DrawingBudget()) if kind == "meshes" else read_occt(path)
    except SurfaceError as error:
        return {"refused": str(error)}, np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    except MalformedFileError as error:
        return {"malformed": str(error)}, np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    return {"unit": found.unit, "metres": found.metres, "dropped": found.dropped}, found.V, found.F


def _limit(seconds: int, memory: int) -> None:
    """Less memory and time for this process, where the system knows such limits (not on Windows)."""
    if importlib.util.find_spec("resource") is None:
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    held = Path("/proc/self/statm")
    if held.exists():
        most = int(held.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
