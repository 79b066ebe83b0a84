"""STEP (ISO 10303-21, AP214): solids with shared edges, in millimetres, in one of four ways.

planar  : a flat sheet as a draughtsman has it: two skins, an outline of lines and splines within a tolerance, and a
          wall per curve (`dsfab.export.plate`).
smooth  : a curved sheet likewise: spline skins trimmed by the pattern's edges, and ruled walls (`dsfab.export.smooth`).
faceted : any solid, as planar faces that coplanar triangles were joined to; simplified before that where asked.
tessellated : its triangles, for viewers (`dsfab.export.tessellated`).

`auto` takes planar where the solid is flat, else smooth where the sheet is known and has no more walls than are made
in about ten seconds, and either only where the file stands the check; else faceted. The text is written directly
and read back through build123d. Building the same topology in OCCT first gives larger files (with a curve on the
surface for each edge) and is 30 to 300 times slower to write. Reading back, in a process of its own, is nearly all of
the time; measured for `faceted` with OCCT 8 on a busy machine of two cores:

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
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import ExportError
from dsfab.export import step_check, tessellated
from dsfab.export.part import Part, settled
from dsfab.export.planar import polyhedron
from dsfab.export.plate import outlines_of, plate
from dsfab.export.plate_text import plate_entities
from dsfab.export.program import ProgramError, last_line
from dsfab.export.readback import check_measure, differs
from dsfab.export.shells import solids_of
from dsfab.export.simplify import simplified, usual_tolerance
from dsfab.export.smooth.make import made
from dsfab.export.step_text import DIGITS, FACETED_DIGITS, entities
from dsfab.surface.topology import edge_table, half_edges

CHECK_SECONDS = 120
CHECK_SECONDS_PER_FACE = 0.02
"""Time for reading back, several times what was measured. OCCT's check of very long outlines may not end."""


ROUTES = ("auto", "planar", "smooth", "faceted", "tessellated")

SHARE_OF_THICKNESS = 1 / 40
"""Tolerance of planar outlines unless asked otherwise, as a share of the thickness."""

TIGHTER = 1 / 4
"""A planar file that is refused is tried once more with this share of the tolerance: curves may cross in a narrow."""


def prepare(part: Part) -> Part:
    """The part rounded to the file's decimals; raises ExportError where an edge has more than two triangles."""
    V, coarse = (np.round(part.V, digits) + 0.0 for digits in (DIGITS, FACETED_DIGITS))
    ends = np.stack(half_edges(part.F))
    short = ends[:, (coarse[ends[0]] == coarse[ends[1]]).all(axis=1)]
    V[short] = coarse[short]  # they become one, the others stay where planes are found
    part = settled(part, V, f"a STEP file with {FACETED_DIGITS} decimals")
    crowded = int((edge_table(part.F).count != 2).sum())
    if crowded:
        raise ExportError(
            f"{crowded} edges of {part.name!r} have more than two triangles, which no STEP solid can have; "
            "write STL or 3MF instead"
        )
    return part


def attempts(part: Part) -> Iterator[Part]:
    """The part with its ways, the best first: planar, planar with a smaller tolerance, smooth, faceted, simplified.

    A solid is simplified before it is faceted when a tolerance was asked for, else only when nothing else is accepted.
    """
    if part.step in ("auto", "planar"):
        planar = replace(part, step="planar", tolerance=part.tolerance or default_tolerance(part))
        yield planar
        if planar.tolerance:
            yield replace(planar, tolerance=TIGHTER * planar.tolerance)
    if part.step == "smooth" or (part.step == "auto" and part.curved is not None and not planar.tolerance):
        yield replace(part, step="smooth", hurry=part.step == "auto")
    if part.step == "tessellated":
        yield part
    if part.step in ("auto", "faceted"):
        faceted = replace(part, step="faceted")
        if part.tolerance:
            yield _simpler(faceted, part.tolerance)
        else:
            yield faceted
            if part.step == "auto" and (simple := _simpler(faceted, usual_tolerance(part))).F is not faceted.F:
                yield simple


def _simpler(part: Part, tolerance: float) -> Part:
    """The part simplified within `tolerance`, or as it is if that does not help."""
    try:
        return prepare(simplified(part, tolerance))
    except ExportError as error:
        return replace(part, note=f"not simplified, since {error}")


def default_tolerance(part: Part) -> float:
    """Millimetres; 0 for a solid that is not flat, which will be told why when it is encoded."""
    try:
        return SHARE_OF_THICKNESS * outlines_of(part).thickness
    except ExportError:
        return 0.0


def told(part: Part, refused: str) -> str:
    """How the file was made, and why not otherwise."""
    if part.step == "planar":
        again = f" (a larger tolerance was refused: {refused})" if refused else ""
        return f"STEP is planar, its outline within {part.tolerance:.3g} mm of the mesh{again}"
    if part.step == "smooth":
        return f"STEP is smooth, {made(part).told}"
    if part.step == "tessellated":
        return f"STEP is tessellated: {tessellated.WARNING}"
    note = f", {part.note}" if part.note else ""
    return f"STEP is faceted{note}" + (f": {refused}" if refused else "")


def encode(part: Part) -> Iterator[bytes]:
    """The file, entity by entity; raises ExportError, before the first byte, when it would have too many faces, or the
    solid is not flat and has to be."""
    if part.step == "planar":
        shape = plate(outlines_of(part), part.corners, part.tolerance)
        _within_budget(part, shape.faces)
        texts = plate_entities(shape, part.name)
    elif part.step == "smooth":
        _within_budget(part, made(part).faces)
        texts = iter([made(part).text])
    elif part.step == "tessellated":
        texts = tessellated.entities(part)
    else:
        texts = _faceted(part)
    return _within_size(part, (text.encode("ascii") for text in texts))


def _faceted(part: Part) -> Iterator[str]:
    shell, solids = solids_of(part)
    voids = [i for _, *inner in solids for i in inner]
    inward = np.isin(shell, voids)
    F = np.where(inward[:, None], part.F[:, ::-1], part.F)  # a STEP void is a shell that faces outwards, reversed
    shape = polyhedron(part.V, F, shell)
    _within_budget(part, len(shape.normals))
    return entities(shape, solids, part.name)


def _within_budget(part: Part, count: int) -> None:
    if count > part.step_faces:
        raise too_much(part, f"{count} planar faces, more than step_faces = {part.step_faces}", "step_faces")


def _within_size(part: Part, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The file, as long as it is not larger than allowed."""
    size = 0
    for chunk in chunks:
        size += len(chunk)
        if part.step_mb and size > 1e6 * part.step_mb:
            raise too_much(part, f"over step_mb = {part.step_mb:g} MB", "step_mb")
        yield chunk


def too_much(part: Part, what: str, key: str) -> ExportError:
    """The refusal of a file above the budget, with the ways out."""
    return ExportError(
        f"the STEP file of {part.name!r} would have {what}; write STL or 3MF instead, coarsen the mesh, "
        f"simplify with step_tolerance, or raise {key}"
    )


def check(part: Part, path: Path) -> None:
    """Read back with build123d: as many solids and faces, all valid, with the part's volume.

    Smooth pieces were read back before, one by one; if all are smooth, what is on the disk must be that file.
    """
    if part.step == "smooth":
        if path.read_bytes() != made(part).text.encode("ascii"):
            raise ExportError(f"the STEP file of {part.name!r} is not what was checked; write it again")
        if made(part).smooth == made(part).pieces:
            return
    found = inspection(part, path)
    if part.step == "tessellated":
        tessellated.check(part, found)
        return
    solids, faces = len(solids_of(part)[1]), path.read_bytes().count(b"=ADVANCED_FACE(")
    if found["solids"] != solids:
        raise differs(part, "solids", solids, found["solids"])
    if found["faces"] != faces:
        raise differs(part, "faces", faces, found["faces"])
    if not found["valid"]:
        raise ExportError(
            f"build123d finds the STEP solid of {part.name!r} invalid: look for parts that touch or cross; "
            "write STL or 3MF instead"
        )
    if not found["tessellates"]:
        raise ExportError(
            f"build123d makes no triangles of a face of the STEP solid of {part.name!r}; write step = 'faceted'"
        )
    if part.step != "smooth":  # its pieces were measured one by one
        check_measure(part, found["volume"])


def inspection(part: Part, path: Path) -> dict[str, Any]:
    """What `step_check` says about the file, in a process with a time limit; raises ExportError if it says nothing."""
    limit = CHECK_SECONDS + (CHECK_SECONDS_PER_FACE * part.step_faces if part.step == "faceted" else 0)
    try:
        answer: dict[str, Any] = json.loads(last_line(step_check.__file__, str(path), seconds=limit))
    except subprocess.TimeoutExpired as error:
        raise ExportError(
            f"reading back the STEP file of {part.name!r} did not end within {limit:.0f} s, so nobody knows whether it "
            "is valid; write STL or 3MF instead, or coarsen the mesh"
        ) from error
    except ProgramError as error:
        raise ExportError(
            f"build123d could not read the STEP file of {part.name!r} ({error}); write STL or 3MF instead"
        ) from error
    return answer
