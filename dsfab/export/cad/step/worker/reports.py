"""Reports of the OCCT programs: triangles of a STEP file, and findings about each piece of smooth solids."""

import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.worker import piece_check, step_triangles
from dsfab.export.subprocesses import Ahead, ProgramError, last_line

SECONDS, SECONDS_PER_MB = 60.0, 10.0
"""How long reading may take."""


@dataclass(frozen=True, eq=False)
class StepMesh:
    """V (n, 3) millimetres, F (m, 3) not joined between faces, and the number of solids.

    face       : (m,) that each triangle is of, counted through all solids.
    deflection : millimetres that the triangles may be off curved faces.
    shape      : what was read, as OCCT keeps it (`.bin`).
    """

    V: Floats
    F: Ints
    face: Ints
    solids: int
    deflection: float
    shape: bytes


def read_step(path: Path, deflection: float = 0.0) -> StepMesh:
    """The solids of a STEP file as triangles; raises ExportError when OCCT cannot read it or takes too long.

    deflection : millimetres that they may be off curved faces; a share of the solids' size if 0.
    """
    with tempfile.TemporaryDirectory() as folder:
        found = _step_read_drawn(path, folder, *((str(deflection),) if deflection else ()))
        return mesh_in(folder, found)


def drawn_anew(shape: bytes, deflection: float, faces: Ints | None = None) -> StepMesh:
    """The triangles of what was read, as OCCT keeps it (see `StepMesh`), with another deflection, millimetres: reading
    the file again takes longer than drawing it. Raises ExportError when OCCT takes too long.

    faces : (k,) numbers of those that are drawn, and no others; all when left out.
    """
    with tempfile.TemporaryDirectory() as folder:
        path, only = Path(folder) / "shape.bin", Path(folder) / "faces.npy"
        path.write_bytes(shape)
        if faces is not None:
            np.save(only, faces)
        found = _step_read_drawn(path, folder, str(deflection), *((str(only),) if faces is not None else ()))
        return mesh_in(folder, found, shape)


def _step_read_drawn(path: Path, folder: str, *how: str) -> dict[str, float]:
    limit = SECONDS + SECONDS_PER_MB * path.stat().st_size / 1e6
    try:
        found: dict[str, float] = json.loads(last_line(step_triangles.__file__, str(path), folder, *how, seconds=limit))
    except subprocess.TimeoutExpired:
        raise ExportError(f"reading {path} did not end within {limit:.0f} s; check the STL or 3MF file") from None
    except ProgramError as error:
        raise ExportError(f"{path} cannot be read as STEP ({str(error)[:160]}); export it again") from None
    return found


def mesh_in(folder: str, found: dict[str, float], shape: bytes = b"") -> StepMesh:
    """What `step_mesh` wrote to a folder, and said: `deflection`, and `solids` unless that was written, too; the shape
    where that is known already.

    Raises OSError where it wrote nothing.
    """
    shape = shape or (Path(folder) / "shape.bin").read_bytes()
    with np.load(Path(folder) / "mesh.npz") as mesh:
        solids = int(found["solids"] if "solids" in found else mesh["solids"])
        return StepMesh(mesh["V"], mesh["F"], mesh["face"], solids, float(found["deflection"]), shape)


RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
"""A triangle of a binary STL file, after 84 bytes of header."""


@dataclass(frozen=True, eq=False)
class OcctFinding:
    """A solid as OCCT reads it: see `check`. bad : (k, 3) ends of edges that cross; V, F : its triangles; millimetres.

    The triangles of different faces share no vertices.
    """

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


def occt() -> Ahead:
    """The program that `findings` asks, once: loading OCCT takes it most of a second."""
    return Ahead(piece_check.__file__)


def findings(program: Ahead, text: str, deflection: float, limit: float) -> list[OcctFinding]:
    """About each solid of a file; nothing when it takes OCCT longer than `limit` seconds, or it fails.

    deflection : how far the triangles may be off the solid, millimetres.
    """
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "a.step"
        path.write_text(text, encoding="ascii")
        try:
            said = _said(program, str(path), folder, deflection, limit)
        except (subprocess.TimeoutExpired, ProgramError):
            return []
        return [_finding(one, Path(folder) / f"{i}.stl") for i, one in enumerate(said)]


def whole_findings(
    program: Ahead, text: str, deflection: float, limit: float, drawn: Callable[[StepMesh], None] = lambda mesh: None
) -> list[OcctFinding]:
    """As `findings`, of solids that are judged together: they have no triangles of their own, but those of all are as
    `read_step` draws them. `drawn` is called with these, if every face becomes triangles, while OCCT goes on.

    One reading serves both: it takes OCCT half of the time of everything that it is asked here.
    """
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / "a.step"
        path.write_text(text, encoding="ascii")
        try:
            look = partial(_occt_check_drawn, folder, deflection, drawn)
            said = _said(program, str(path), folder, deflection, limit, look)
        except (subprocess.TimeoutExpired, ProgramError):
            return []
        return [_finding(one, Path(folder) / "none.stl") for one in said]


def _occt_check_drawn(folder: str, deflection: float, drawn: Callable[[StepMesh], None]) -> None:
    drawn(mesh_in(folder, {"deflection": deflection}))


def _said(
    program: Ahead, path: str, folder: str, deflection: float, limit: float, look: Callable[[], None] | None = None
) -> list[dict[str, Any]]:
    """What the program says; of solids that are judged together with a `look` at what it draws of them."""
    program.ask(path, folder, str(deflection), *["whole"] * bool(look))
    drawn = Path(folder) / "mesh.npz"
    line = program.answer_and(drawn.exists, look, limit) if look else program.answer(limit)
    return list(json.loads(line)["solids"])


def _finding(said: dict[str, Any], path: Path) -> OcctFinding:
    data = path.read_bytes() if path.is_file() else b""
    corners = np.frombuffer(data, RECORD, offset=84)["corners"] if len(data) > 84 else np.zeros((0, 3, 3))
    V, F = distinct_points(corners.reshape(-1, 3))
    bad = np.array(said.pop("bad"), dtype=np.float64).reshape(-1, 3)
    return OcctFinding(**said, bad=bad, V=V.astype(np.float64), F=F.reshape(-1, 3))


def distinct_points(points: Floats) -> tuple[Floats, Ints]:
    """The different ones of points (k, 3), in order, and which each is: `np.unique`, in a quarter of its time."""
    order = np.lexsort(points.T[::-1])
    ranked = points[order]
    first = np.ones(len(points), dtype=bool)
    first[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    number = np.empty(len(points), dtype=np.int64)
    number[order] = np.cumsum(first) - 1
    return ranked[first], number
