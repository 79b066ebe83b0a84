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

    deflection : millimetres that the triangles may be off curved faces.
    shape      : what was read, as OCCT keeps it (`.bin`).
    """

    V: Floats
    F: Ints
    solids: int
    deflection: float
    shape: bytes


def read_step(path: Path, deflection: float = 0.0) -> StepMesh:
    """The solids of a STEP file, or of a `.bin` one, as triangles; raises ExportError when OCCT cannot read it or
    takes too long.

    deflection : millimetres that they may be off curved faces; a share of the solids' size if 0.
    """
    asked = (str(deflection),) if deflection else ()
    limit = SECONDS + SECONDS_PER_MB * path.stat().st_size / 1e6
    with tempfile.TemporaryDirectory() as folder:
        try:
            found = json.loads(last_line(step_mesh.__file__, str(path), folder, *asked, seconds=limit))
        except subprocess.TimeoutExpired:
            raise ExportError(f"reading {path} did not end within {limit:.0f} s; check the STL or 3MF file") from None
        except ProgramError as error:
            raise ExportError(f"{path} cannot be read as STEP ({str(error)[:160]}); export it again") from None
        shape = (Path(folder) / "shape.bin").read_bytes()
        with np.load(Path(folder) / "mesh.npz") as mesh:
            return StepMesh(mesh["V"], mesh["F"], int(found["solids"]), float(found["deflection"]), shape)


def drawn_anew(shape: bytes, deflection: float) -> StepMesh:
    """The triangles of what was read, as OCCT keeps it (see `StepMesh`), with another deflection, millimetres: reading
    the file again takes as long as drawing it. Raises ExportError when OCCT takes too long."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.bin"
        path.write_bytes(shape)
        return read_step(path, deflection)
