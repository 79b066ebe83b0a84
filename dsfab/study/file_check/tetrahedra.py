"""Tetrahedra for the solid in a file, by gmsh where it is installed (extra `solid`), checked before they are used."""

import importlib.util
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.errors import StaticsError
from dsfab.export.program import ProgramError, run_program
from dsfab.limits import CHANGED_VOLUME
from dsfab.study.file_check import gmsh_program
from dsfab.study.file_check.reading import FileContents
from dsfab.surface import Surface
from dsfab.surface.refine import refined

NEEDED = ("gmsh", "skfem")
"""What the extra `solid` installs: a mesher (GPL) and assembly of solid elements (BSD-3)."""

SECONDS = 300.0
"""How long meshing may take."""

SAME_VOLUME = 1e-6
"""The tetrahedra fill the solid to this share of its volume, or are not of it; on curved faces they have chords, which
count as everywhere (`CHANGED_VOLUME`)."""

STEP = (".step", ".stp")
"""Suffixes of files that gmsh reads itself."""

FLAT = 1e-12
"""A tetrahedron whose volume is a smaller share of its longest edge cubed has none."""


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """X (p, 3) metres and T (k, 4), all of positive volume."""

    X: Floats
    T: Ints

    def __post_init__(self) -> None:
        lock(self, "X", np.float64, (None, 3))
        lock(self, "T", np.int64, (None, 4))


def missing() -> str:
    """Why no solid model can be made here, and how to change that; empty when it can."""
    absent = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    return f'{" and ".join(absent)} not installed; pip install "dsfab[solid]"' if absent else ""


def tetrahedra(found: FileContents, edge: float) -> Tetrahedra:
    """Fill the sound solid of a file, with edges of at most `edge` metres on its surface.

    A STEP file is read by gmsh itself and gets new triangles; of other files the triangles stay and are halved.

    Raises StaticsError when gmsh fails, takes too long, or fills something else.
    """
    volume = Surface(found.V, found.F).volume
    if found.path.suffix.lower() in STEP:
        X, T = _filled({"step": str(found.path.resolve()), "edge": edge})
        return _sound(X, T, volume, CHANGED_VOLUME)
    fine = refined(Surface(found.V, found.F), edge)
    middle = found.V.mean(axis=0)
    X, T = _filled({"V": (fine.V - middle) / found.size, "F": fine.F, "edge": edge / found.size})
    return _sound(X * found.size + middle, T, volume, SAME_VOLUME)


def _filled(given: Mapping[str, Any]) -> tuple[Floats, Ints]:
    """What the program makes of it; raises StaticsError when it makes nothing."""
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder) / "surface.npz", Path(folder) / "tets.npz"
        np.savez(source, **given)
        try:
            run_program(gmsh_program.__file__, str(source), str(made), seconds=SECONDS)
            with np.load(made) as mesh:
                return np.asarray(mesh["X"], dtype=np.float64), np.asarray(mesh["T"], dtype=np.int64)
        except subprocess.TimeoutExpired:
            raise StaticsError(f"gmsh did not fill the solid with tetrahedra within {SECONDS:.0f} s") from None
        except (ProgramError, FileNotFoundError) as error:
            raise StaticsError(f"gmsh could not fill the solid with tetrahedra ({str(error)[:160]})") from None


def _sound(X: Floats, T: Ints, volume: float, tolerance: float) -> Tetrahedra:
    """The tetrahedra turned to positive volume; raises StaticsError when they do not fill the solid."""
    P = X[T]
    six = np.einsum("ki,ki->k", P[:, 1] - P[:, 0], np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 0]))
    T = np.where((six < 0)[:, None], T[:, [0, 2, 1, 3]], T)
    long = np.linalg.norm(P[:, [1, 2, 3, 2, 3, 3]] - P[:, [0, 0, 0, 1, 1, 2]], axis=2).max(axis=1)
    if flat := int((np.abs(six) <= FLAT * long**3).sum()):
        raise StaticsError(f"gmsh left {flat} of {len(T)} tetrahedra without volume; the surface has needles")
    filled = float(np.abs(six).sum() / 6)
    if abs(filled - volume) > tolerance * volume:
        raise StaticsError(f"gmsh filled {filled:.6g} m3 of a solid of {volume:.6g} m3")
    return Tetrahedra(X, T)
