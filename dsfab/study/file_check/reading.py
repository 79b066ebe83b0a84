"""The file as its receiver finds it: triangles in metres, joined by position and by nothing else."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.errors import ExportError, SurfaceError
from dsfab.export import read_step, step_triangles
from dsfab.surface import DEFAULT_TRIANGLES, raw_mesh
from dsfab.surface.bridges import stl_by_trimesh
from dsfab.units import METRES_PER, MM_PER_M, metres_per

SUFFIXES = (".stl", ".3mf", ".step", ".stp")
"""What can be checked."""

STEP_BEGINS = b"ISO-10303-21"
"""The first words of every STEP file."""

BY_CONVENTION = "mm"
"""STL files name no unit; dsfab writes millimetres, and workshops read them so."""

CURVED = (
    *(f"{word}_SURFACE".encode() for word in ("B_SPLINE", "UNIFORM", "BEZIER")),
    *(f"{word}_SURFACE".encode() for word in ("CYLINDRICAL", "CONICAL", "SPHERICAL", "TOROIDAL")),
    b"SURFACE_OF_",
)
"""What a STEP file calls faces that are not planes."""


@dataclass(frozen=True, eq=False)
class FileContents:
    """What a reader found in a file.

    V       : (n, 3) metres, no two at the same place.      F : (m, 3) triangles with three different corners.
    unit    : of the file's numbers.                        declared : whether the file names it.
    metres  : in one of these units.                        collapsed : triangles without three different corners.
    reader  : whose reader it was.       path : of the file.
    deflection : metres that the triangles may be off the faces of the file, which are curved in STEP; else 0.
    shape   : of STEP, what OCCT read, as it keeps it; else empty.      face : (m,) of it that each triangle is of.
    """

    path: Path
    V: Floats
    F: Ints
    unit: str
    declared: bool
    metres: float
    collapsed: int
    reader: str
    deflection: float = 0.0
    shape: bytes = b""
    face: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "face", np.int64, (None,))

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, metres."""
        return float(np.linalg.norm(np.ptp(self.V, axis=0)))


def read_shipped(
    path: str | Path, unit: str | None = None, max_triangles: int = DEFAULT_TRIANGLES, deflection: float = 0.0
) -> FileContents:
    """The solid in an STL, 3MF or STEP file, read by trimesh, lib3mf or OCCT: none of them wrote it.

    unit : of the numbers of an STL file, millimetres when left out; 3MF and STEP files name theirs.
    max_triangles : how many an STL or a 3MF file may have; what reading may cost follows from it.
    deflection : metres that triangles may be off curved faces of STEP; 0 leaves it to the reader.

    Raises SurfaceError or ExportError, one sentence, for a missing, empty, unreadable or foreign file, for coordinates
    that are not finite, and for a unit given to a file that names its own.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if path.is_dir():
        names = sorted(file.name for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        hint = f"give {path / names[0]}" if names else f"`dsfab check` reads {', '.join(SUFFIXES)}, and none is there"
        raise ExportError(f"{path} is a folder; {hint}")
    if suffix not in SUFFIXES:
        raise ExportError(f"{path} has the suffix {suffix!r}; `dsfab check` reads {', '.join(SUFFIXES)}")
    if unit is not None and suffix != ".stl":
        raise ExportError(f"{path} names its own unit; leave out --unit, which is for STL files")
    if suffix in (".step", ".stp"):
        found = _step(path, deflection)
    else:
        raw = raw_mesh(path, max_triangles)
        here = unit or raw.unit or BY_CONVENTION
        metres = raw.metres if raw.unit else metres_per(here)
        V, F, lost = _joined(*(stl_by_trimesh(path) if suffix == ".stl" else (raw.V, raw.F)))
        found = FileContents(
            path, V * metres, F, here, raw.unit is not None, metres, lost, "lib3mf" if raw.unit else "trimesh"
        )
    if not np.isfinite(found.V).all():
        raise SurfaceError(f"{path} has coordinates that are not finite numbers; export it again")
    if not len(found.F):
        raise ExportError(f"{path} holds no triangle with three different corners; export it again")
    return found


def _step(path: Path, deflection: float) -> FileContents:
    if not path.is_file():
        raise ExportError(f"{path} does not exist; check the path")
    if not path.stat().st_size:
        raise ExportError(f"{path} is empty; export it again")
    with path.open("rb") as file:
        if STEP_BEGINS not in file.read(1000):
            raise ExportError(f"{path} is no STEP file: it does not begin with {STEP_BEGINS.decode()}; export it again")
    mesh = read_step(path, deflection * MM_PER_M)
    if not mesh.solids or not len(mesh.F):
        raise ExportError(f"{path} holds no solid, only loose faces or nothing; export it again as a solid")
    V, F, face, lost = step_triangles(mesh)
    metres = METRES_PER["mm"]
    off = mesh.deflection * metres if _curved(path) else 0.0
    return FileContents(path, V, F, "mm", True, metres, lost, "OCCT", off, mesh.shape, face)


def _curved(path: Path) -> bool:
    """Whether a STEP file has faces that are not planes."""
    text = path.read_bytes()
    return any(word in text for word in CURVED)


def _joined(V: Floats, F: Ints) -> tuple[Floats, Ints, int]:
    """Vertices at exactly the same place made one."""
    points, of = np.unique(V + 0.0, axis=0, return_inverse=True)
    F, lost = _whole(of.reshape(-1)[F])
    return points, F, lost


def _whole(F: Ints) -> tuple[Ints, int]:
    """The triangles that have three different corners, and how many have not."""
    whole = (np.roll(F, -1, axis=1) != F).all(axis=1)
    return F[whole], int((~whole).sum())
