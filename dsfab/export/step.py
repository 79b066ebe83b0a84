"""STEP (ISO 10303-21, AP214): solids with shared edges, in millimetres, in one of five ways.

planar  : a flat sheet as a draughtsman has it: two skins, an outline of lines and splines within a tolerance, and a
          wall per curve (`dsfab.export.plate`); folded sheets of flat facets likewise (`dsfab.export.folds`).
members : a curved sheet of four-sided patches that nothing trims, on shared curves (`dsfab.export.network`).
smooth  : a curved sheet likewise: spline skins trimmed by the pattern's edges, and ruled walls (`dsfab.export.smooth`).
faceted : any solid, as planar faces that coplanar triangles were joined to; simplified before that where asked.
tessellated : its triangles, for viewers (`dsfab.export.tessellated`).

`auto` takes the first of these that the solid allows and that stands the check, but for tessellated, within a budget
(`dsfab.export.ladder`). The text is written directly and read back through OCCT. Building the same topology in
OCCT first gives larger files (with a curve on the surface for each edge) and is 30 to 300 times slower to write.
Reading back, in a process of its own, is nearly all of the time; measured for `faceted` with OCCT 8 on a busy machine
of two cores:

    faces                                               write s    read back s    MB
    4 096, thickened sphere: nothing to join              0.1            8         2.8
    16 384                                                0.5           14        11.8
    65 536                                                2             70        48.4
    12 619, flat plate with 293 holes (89 704 triangles)  0.7          116        13.3

OCCT's check of a face takes time with the square of its edges, and each skin of that plate has six thousand. The budget
of 30 000 faces keeps usual solids under half a minute on a quiet machine, and files small enough for other programs.
"""

import json
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import ExportError
from dsfab.export import step_check, tessellated
from dsfab.export.budget import BudgetError
from dsfab.export.folds_text import planar_file
from dsfab.export.network.build import member_file
from dsfab.export.part import Part
from dsfab.export.planar import polyhedron
from dsfab.export.program import ProgramError, last_line
from dsfab.export.readback import ReadBack, check_measure, differs
from dsfab.export.sampled_use import smooth_use
from dsfab.export.shells import solids_of
from dsfab.export.smooth.build import smooth_file
from dsfab.export.step_soundness import step_fault
from dsfab.export.step_text import entities, faceted_bytes
from dsfab.limits import DEFLECTION
from dsfab.units import MM_PER_M

CHECK_SECONDS = 120
CHECK_SECONDS_PER_FACE = 0.02
"""Time for reading back, several times what was measured. OCCT's check of very long outlines may not end."""

LIGHT = 8.0
"""Megabytes of a faceted file that is better than a smooth one whose cuts fail."""


def encode(part: Part) -> Iterator[bytes]:
    """The file, entity by entity; raises ExportError, before the first byte, when it would have too many faces, or the
    solid is not flat and has to be."""
    faces, size, texts = ENCODERS[part.step](part)
    if faces > part.step_faces:
        raise BudgetError(part, faces, size)
    return _within_size(part, faces, size, (text.encode("ascii") for text in texts))


def _planar(part: Part) -> tuple[int, float, Iterable[str]]:
    file = planar_file(part)
    return file.faces, sum(map(len, file.texts)), file.texts


def _smooth(part: Part) -> tuple[int, float, Iterable[str]]:
    """In a hurry, one that OCCT cannot cut is refused for facets, which it can, where these are no large file."""
    file = smooth_file(part)
    if part.hurry and part.cut and (fault := smooth_use(part).fault):
        faces, size, _ = _faceted(part)
        if size <= 1e6 * LIGHT and faces <= part.step_faces:
            raise ExportError(f"smooth {fault}")
    return file.faces, len(file.text), [file.text]


def _members(part: Part) -> tuple[int, float, Iterable[str]]:
    return member_file(part).faces, len(member_file(part).text), [member_file(part).text]


def _tessellated(part: Part) -> tuple[int, float, Iterable[str]]:
    return 0, tessellated.expected_bytes(part), tessellated.entities(part)


def _faceted(part: Part) -> tuple[int, float, Iterable[str]]:
    shell, solids = solids_of(part)
    voids = [i for _, *inner in solids for i in inner]
    inward = np.isin(shell, voids)
    F = np.where(inward[:, None], part.F[:, ::-1], part.F)  # a STEP void is a shell that faces outwards, reversed
    shape = polyhedron(part.V, F, shell)
    return len(shape.normals), faceted_bytes(shape), entities(shape, solids, part.name)


ENCODERS: dict[str, Callable[[Part], tuple[int, float, Iterable[str]]]] = {
    "planar": _planar,
    "members": _members,
    "smooth": _smooth,
    "faceted": _faceted,
    "tessellated": _tessellated,
}
"""For each way: planar faces that count, about how many bytes, and the text."""


def _within_size(part: Part, faces: int, expected: float, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The file, as long as it is not larger than allowed; `expected` is what is said of its size if it is."""
    size = 0
    for chunk in chunks:
        size += len(chunk)
        if part.step_mb and size > 1e6 * part.step_mb:
            raise BudgetError(part, faces, max(size, expected))
        yield chunk


def check(part: Part, path: Path) -> ReadBack:
    """Read back with OCCT: as many solids and faces, all valid, with the part's volume.

    Files by members were read back, measured and asked what `dsfab check` asks, and smooth pieces were read back and
    measured, one by one: what is on the disk must be that file. Smooth ones that are tried in use are asked the same:
    whether they hold a solid. Others are not, since that takes as long as making them.
    """
    if part.step == "members":
        file = member_file(part)
        _require_same(part, path, file.text)
        return ReadBack(file.faces, "faces", file.volume / part.volume - 1)
    if part.step == "smooth":
        smooth = smooth_file(part)
        _require_same(part, path, smooth.text)
        if part.cut and (fault := step_fault(path, DEFLECTION * smooth.limits.distance / MM_PER_M)):
            raise ExportError(f"smooth, {fault}")
        if smooth.smooth == smooth.pieces:
            return ReadBack(smooth.faces, "faces", smooth.volume / part.volume - 1)
    found = inspection(part, path)
    if part.step == "tessellated":
        return tessellated.check(part, found)
    solids, faces = len(solids_of(part)[1]), path.read_bytes().count(b"=ADVANCED_FACE(")
    if found["solids"] != solids:
        raise differs(part, "solids", solids, found["solids"])
    if found["faces"] != faces:
        raise differs(part, "faces", faces, found["faces"])
    if not found["valid"]:
        raise ExportError(
            f"OCCT finds the STEP solid of {part.name!r} invalid: look for parts that touch or cross; "
            "write STL or 3MF instead"
        )
    if not found["tessellates"]:
        raise ExportError(
            f"OCCT makes no triangles of a face of the STEP solid of {part.name!r}; write step = 'faceted'"
        )
    off = found["volume"] / part.volume - 1
    return ReadBack(faces, "faces", off if part.step == "smooth" else check_measure(part, found["volume"]))


def _require_same(part: Part, path: Path, text: str) -> None:
    """Raise ExportError where a file is not what was checked before it was written."""
    if path.read_bytes() != text.encode("ascii"):
        raise ExportError(f"the STEP file of {part.name!r} is not what was checked; write it again")


def inspection(part: Part, path: Path) -> dict[str, Any]:
    """What `step_check` says about the file, in a process with a time limit; raises ExportError if it says nothing."""
    limit = CHECK_SECONDS + (CHECK_SECONDS_PER_FACE * part.step_faces if part.step in ("faceted", "smooth") else 0)
    try:
        answer: dict[str, Any] = json.loads(last_line(step_check.__file__, str(path), seconds=limit))
    except subprocess.TimeoutExpired as error:
        raise ExportError(
            f"reading back the STEP file of {part.name!r} did not end within {limit:.0f} s, so nobody knows whether it "
            "is valid; write STL or 3MF instead, or coarsen the mesh"
        ) from error
    except ProgramError as error:
        raise ExportError(
            f"OCCT could not read the STEP file of {part.name!r} ({error}); write STL or 3MF instead"
        ) from error
    return answer
