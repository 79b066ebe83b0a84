"""Separate process for the readers of 3DM, STEP, BREP and IFC files, with limits on time and memory."""

import importlib.util
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.errors import SurfaceError
from dsfab.surface.clean.seams import equal_merged, merged_vertices
from dsfab.surface.files.ifc import read_ifc, require_ifc
from dsfab.surface.files.reading import Budget, Content, Drawing, DrawingBudget, MalformedFileError, TriangleFile
from dsfab.surface.files.rhino_and_step import read_occt, read_rhino, read_rhino_meshes, require_rhino

GIB = 2**30
MEMORY = {"drawing": GIB, "meshes": GIB, "cad": 4 * GIB, "ifc": 4 * GIB}  # Largest address space for reading, bytes.
SECONDS = {"drawing": 3, "meshes": 6, "cad": 60, "ifc": 60}  # Time limit (processor s) / (1 + file size/10 MB).
PROGRAM = "from dsfab.surface.files.separate_process import main; main()"
TIME_OVER = -int(getattr(signal, "SIGXCPU", 24))  # Return code of a process that used up its processor seconds.
LIBRARIES = {"drawing": "Rhino's library", "meshes": "Rhino's library", "cad": "OCCT", "ifc": "ifcopenshell"}


def read_rhino_in_process(path: Path, budget: DrawingBudget) -> Drawing:
    """Return the curves and points of a 3DM file. Raises MalformedFileError also if rhino3dm crashes."""
    require_rhino()
    try:
        answer = json.loads(_program_output("drawing", path, budget.seconds))
    except subprocess.TimeoutExpired:
        budget.require_time()  # raises the usual error for an exceeded time limit
        raise
    _raise_refusal(answer)
    runs, points = (
        tuple((layer, np.array(rows, dtype=float).reshape(-1, 3), hidden) for layer, rows, hidden in answer[key])
        for key in ("runs", "points")
    )
    return Drawing(runs, tuple(answer["layers"]), answer["unit"], points)


def read_3dm(path: Path, budget: Budget, only: Sequence[str] = ()) -> TriangleFile:
    """Return the meshes of a 3DM file; vertices at the same place are merged."""
    require_rhino()
    mesh = foreign_triangles("meshes", path, budget, only)
    V, F = equal_merged(mesh.V, mesh.F)
    return replace(mesh, V=V, F=F)


def read_cad(path: Path, budget: Budget, only: Sequence[str] = ()) -> TriangleFile:
    """Return the triangles of a STEP, BREP or IFC file. CAD faces share the vertices on their common edges."""
    is_ifc = path.suffix.lower() == ".ifc"
    if is_ifc:
        require_ifc()
    mesh = foreign_triangles("ifc" if is_ifc else "cad", path, budget, only)
    V, became = merged_vertices(mesh.V, 1e-7)  # faces give slightly different points on a common edge
    V, F = equal_merged(V, became[mesh.F])  # also sort the vertices, as for other formats
    is_triangle = (np.roll(F, 1, axis=1) != F).all(axis=1)
    return replace(mesh, V=V, F=F[is_triangle])


def foreign_triangles(kind: str, path: Path, budget: Budget, only: Sequence[str] = ()) -> TriangleFile:
    """Read a file in a separate process; return its triangles. kind : "meshes" (3DM), "cad" (STEP, BREP) or "ifc"."""
    try:
        answer = _program_output(kind, path, budget.seconds + SECONDS[kind], only)
    except subprocess.TimeoutExpired:
        raise SurfaceError(
            f"reading the file took more than {budget.seconds:.0f} s; export the model as a mesh"
        ) from None
    with np.load(io.BytesIO(answer)) as arrays:
        facts, V, F = json.loads(str(arrays["said"])), arrays["V"], arrays["F"]
    _raise_refusal(facts)
    budget.require_triangles(len(F))
    content = tuple(Content(**entry) for entry in facts["content"])
    return TriangleFile(V, F, facts["unit"], tuple(facts["doubts"]), content=content)


def _program_output(kind: str, path: Path, timeout: float, only: Sequence[str] = ()) -> bytes:
    seconds = int(SECONDS[kind] * (1 + path.stat().st_size / 10_000_000))
    command = [sys.executable, "-P", "-c", PROGRAM, kind, str(path.resolve()), str(seconds), *only]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(folder for folder in sys.path if folder)}
    process = subprocess.run(command, capture_output=True, env=environment, timeout=timeout, check=False)
    if process.returncode == TIME_OVER:
        cure = "draw less into it" if kind == "drawing" else "make the model simpler, or export the model as a mesh"
        raise SurfaceError(f"{LIBRARIES[kind]} needs more than {seconds} s of processor time for the file; {cure}")
    if process.returncode:
        words = f"the file is damaged, or needs more than {MEMORY[kind] // GIB} GiB of memory"
        raise MalformedFileError(f"{words}: {LIBRARIES[kind]} stops while reading it")
    return process.stdout


def _raise_refusal(answer: dict[str, Any]) -> None:
    if "refused" in answer:
        raise SurfaceError(answer["refused"])
    if "malformed" in answer:
        raise MalformedFileError(answer["malformed"])


def main() -> None:
    """Read a file. The command line contains its kind, its path, the limit on seconds, and names of parts to read.
    Print the content: JSON for drawings, .npz for meshes."""
    kind, path, seconds, *only = sys.argv[1:]
    _limit(int(seconds), MEMORY[kind])
    facts, V, F = dict[str, Any](), np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    try:
        if kind == "drawing":
            facts = _drawing(Path(path))
        else:
            if kind == "meshes":
                mesh = read_rhino_meshes(Path(path), DrawingBudget(), only)
            else:
                mesh = (read_ifc if kind == "ifc" else read_occt)(Path(path), only)
            facts = {"unit": mesh.unit, "doubts": mesh.doubts, "content": [*map(asdict, mesh.content)]}
            V, F = mesh.V, mesh.F
    except SurfaceError as error:
        facts = {"refused": str(error)}
    except MalformedFileError as error:
        facts = {"malformed": str(error)}
    if kind == "drawing":
        sys.stdout.write(json.dumps(facts))
    else:
        np.savez(sys.stdout.buffer, said=json.dumps(facts), V=V, F=F)


def _drawing(path: Path) -> dict[str, Any]:
    drawing = read_rhino(path, DrawingBudget())
    runs, points = (
        [(layer, rows.tolist(), hidden) for layer, rows, hidden in curves] for curves in (drawing.runs, drawing.points)
    )
    return {"runs": runs, "points": points, "layers": drawing.layers, "unit": drawing.unit}


def _limit(seconds: int, memory: int) -> None:
    if importlib.util.find_spec("resource") is None:
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))  # SIGXCPU, then SIGKILL
    statm = Path("/proc/self/statm")
    if statm.exists():
        address_limit = int(statm.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (address_limit, address_limit))
