"""The triangles of a STEP file, read by OCCT in a process of its own that may neither crash nor stall this one."""

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export import step_mesh
from dsfab.export.program import ProgramError, last_line

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
        found = _drawn(path, folder, *((str(deflection),) if deflection else ()))
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
        found = _drawn(path, folder, str(deflection), *((str(only),) if faces is not None else ()))
        return mesh_in(folder, found, shape)


def _drawn(path: Path, folder: str, *how: str) -> dict[str, float]:
    limit = SECONDS + SECONDS_PER_MB * path.stat().st_size / 1e6
    try:
        found: dict[str, float] = json.loads(last_line(step_mesh.__file__, str(path), folder, *how, seconds=limit))
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
