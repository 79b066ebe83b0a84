"""Reports of the OCCT program about a STEP file."""

import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.worker import program as occt_program
from dsfab.export.subprocesses import PreparedProgram, ProgramError, last_line

SECONDS, SECONDS_PER_MB = 60.0, 10.0  # time limit for reading: seconds, and seconds per megabyte


def occt_report(command: str, *arguments: str, seconds: float) -> dict[str, Any]:
    """Run a command of the OCCT program, and return its report. Raises ProgramError or TimeoutExpired."""
    return dict(json.loads(last_line(occt_program.__file__, command, *arguments, seconds=seconds)))


@dataclass(frozen=True, eq=False)
class StepMesh:
    """Triangles of a STEP file. solids : number of solids.    shape : OCCT's binary shape.
    V, F : (n, 3) points, mm, and (m, 3) triangles. Different STEP faces share no points.
    face : (m,) STEP face of each triangle.    deflection : largest distance of triangles from curved faces, mm."""

    V: Floats
    F: Ints
    face: Ints
    solids: int
    deflection: float
    shape: bytes


def read_step(path: Path, deflection: float = 0.0) -> StepMesh:
    """Read the solids of a STEP file as triangles. Raises ExportError.
    deflection : largest distance of triangles from curved faces, mm; 0 for the default."""
    with tempfile.TemporaryDirectory() as folder:
        return mesh_in(folder, _drawn(path, folder, *((str(deflection),) if deflection else ())))


def drawn_anew(shape: bytes, deflection: float, faces: Ints | None = None) -> StepMesh:
    """Triangulate OCCT's binary shape. Raises ExportError.
    deflection : largest distance of triangles from curved faces, mm.    faces : (k,) numbers of faces; None for all."""
    with tempfile.TemporaryDirectory() as folder:
        path, only = Path(folder) / "shape.bin", Path(folder) / "faces.npy"
        path.write_bytes(shape)
        if faces is not None:
            np.save(only, faces)
        facts = _drawn(path, folder, str(deflection), *((str(only),) if faces is not None else ()))
        return mesh_in(folder, facts, shape)


def _drawn(path: Path, folder: str, *how: str) -> dict[str, float]:
    limit = SECONDS + SECONDS_PER_MB * path.stat().st_size / 1e6
    try:
        return occt_report("triangles", str(path), folder, *how, seconds=limit)
    except subprocess.TimeoutExpired:
        raise ExportError(
            f"reading {path} did not end within {limit:.0f} s; write an STL or 3MF file and check that file instead"
        ) from None
    except ProgramError as error:
        raise ExportError(f"{path} cannot be read as STEP ({str(error)[:160]}); export the file again") from None


def mesh_in(folder: str, facts: dict[str, float], shape: bytes = b"") -> StepMesh:
    """Read the triangles that the OCCT program wrote to a folder. Raises OSError.
    facts : report of the program.    shape : OCCT's binary shape; read from the folder if empty."""
    shape = shape or (Path(folder) / "shape.bin").read_bytes()
    with np.load(Path(folder) / "mesh.npz") as mesh:
        solids = int(facts["solids"] if "solids" in facts else mesh["solids"])
        return StepMesh(mesh["V"], mesh["F"], mesh["face"], solids, float(facts["deflection"]), shape)


RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
"""Record of one triangle in a binary STL file, after 84 bytes of header."""


@dataclass(frozen=True, eq=False)
class OcctFinding:
    """OCCT's findings about a solid; lengths in mm. tessellates : True if every face has triangles.
    gap : largest distance of an edge from its curve on a face.    box : lowest and highest corner, six numbers.
    bad : (k, 3) end points of edges that cross.    V, F : triangles of the solid."""

    valid: bool
    closed: bool
    tessellates: bool
    faces: int
    volume: float
    gap: float
    box: list[float]
    bad: Floats
    V: Floats
    F: Ints


def occt() -> PreparedProgram:
    """Start the OCCT program in advance, for later use by `findings`."""
    return PreparedProgram(occt_program.__file__)


def findings(
    program: PreparedProgram,
    text: str,
    deflection: float,
    limit: float,
    on_triangles: Callable[[StepMesh], None] | None = None,
) -> list[OcctFinding]:
    """Return findings about each solid of a STEP file `text`; [] if OCCT fails or takes over `limit` seconds.
    deflection   : largest distance of the triangles from the solid, mm.
    on_triangles : function of all triangles; if it is given, the findings contain no triangles."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "a.step"
        path.write_text(text, encoding="ascii")
        look = (lambda: on_triangles(mesh_in(folder, {"deflection": deflection}))) if on_triangles else None
        try:
            records = solid_records(program, str(path), folder, deflection, limit, look)
        except (subprocess.TimeoutExpired, ProgramError):
            return []
        return [_finding(record, Path(folder) / f"{i}.stl") for i, record in enumerate(records)]


def solid_records(
    program: PreparedProgram,
    path: str,
    folder: str,
    deflection: float,
    limit: float,
    look: Callable[[], None] | None = None,
) -> list[dict[str, Any]]:
    """Return OCCT's findings about each solid of a STEP file, as dictionaries. limit : seconds of processor time.
    look : function to call once OCCT has written all triangles to `folder`."""
    program.send("pieces", path, folder, str(deflection), *(["whole"] if look else []))
    mesh_path = Path(folder) / "mesh.npz"
    line = program.answer_with_work(mesh_path.exists, look, limit) if look else program.answer(limit)
    return list(json.loads(line)["solids"])


def _finding(record: dict[str, Any], path: Path) -> OcctFinding:
    data = path.read_bytes() if path.is_file() else b""
    corners = np.frombuffer(data, RECORD, offset=84)["corners"] if len(data) > 84 else np.zeros((0, 3, 3))
    V, F = distinct_points(corners.reshape(-1, 3))
    bad = np.array(record.pop("bad"), dtype=np.float64).reshape(-1, 3)
    return OcctFinding(**record, bad=bad, V=V.astype(np.float64), F=F.reshape(-1, 3))


def distinct_points(points: Floats) -> tuple[Floats, Ints]:
    """Return the different points (n, 3), sorted, and for each given point (k, 3) its number (k,) among them."""
    order = np.lexsort(points.T[::-1])
    ranked = points[order]
    is_first = np.ones(len(points), dtype=bool)
    is_first[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    number = np.empty(len(points), dtype=np.int64)
    number[order] = np.cumsum(is_first) - 1
    return ranked[is_first], number
