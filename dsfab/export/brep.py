"""BREP (OCCT's own text) for FreeCAD and scripts on OCCT: the shape of the STEP file, planar or faceted. Millimetres.

OCCT reads the STEP text and writes the shape that it made of it. The file is read back as STEP is, in a process with a
time limit. BREP has no place for a unit: OCCT and FreeCAD take millimetres.
"""

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.export import ladder, step, step_check
from dsfab.export.network.build import member_file
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_measure, differs
from dsfab.export.shells import solids_of
from dsfab.export.smooth.build import smooth_file
from dsfab.limits import READ_BACK


def route_sentence(part: Part, refused: Sequence[ExportError]) -> str:
    """As for STEP."""
    return ladder.route_sentence(part, refused).replace("STEP", "BREP", 1)


def encode(part: Part) -> Iterator[bytes]:
    """STEP to a temporary file, read and written again by OCCT."""
    chunks = step.encode(part)
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        given, path = Path(folder) / "a.step", Path(folder) / "a.brep"
        given.write_bytes(b"".join(chunks))
        from OCP.BRepTools import BRepTools

        if not BRepTools.Write_s(step_check.read(given), str(path)):
            raise ExportError(f"OCCT could not write {part.name!r} as BREP; write STEP instead")
        yield path.read_bytes()


def check(part: Part, path: Path) -> ReadBack:
    """Read back with OCCT, in a process with a time limit: as many solids, all valid, with the part's volume."""
    found, solids = step.inspection(part, path), len(solids_of(part)[1])
    if found["solids"] != solids:
        raise differs(part, "solids", solids, found["solids"])
    if not (found["valid"] and found["tessellates"]):
        raise ExportError(f"OCCT finds the BREP solid of {part.name!r} invalid; write STL or 3MF instead")
    if part.step not in ("smooth", "members"):
        return ReadBack(found["faces"], "faces", check_measure(part, found["volume"]))
    if part.step == "members":
        if not abs(found["volume"] - member_file(part).volume) <= READ_BACK * member_file(part).volume:
            raise ExportError(f"the BREP by members of {part.name!r} has another volume; write STEP instead")
        return ReadBack(found["faces"], "faces", found["volume"] / part.volume - 1)
    smooth = smooth_file(
        part
    )  # its pieces were measured one by one; the mesh is smaller, since it cuts its curves short
    if smooth.smooth == smooth.pieces and not abs(found["volume"] - smooth.volume) <= READ_BACK * smooth.volume:
        raise ExportError(f"the smooth BREP of {part.name!r} reads back with another volume; write STEP instead")
    return ReadBack(found["faces"], "faces", found["volume"] / part.volume - 1)
