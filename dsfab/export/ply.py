"""PLY, binary [Turk 1994]: indexed, double precision. A comment gives the unit: millimetre."""

from collections.abc import Iterator
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_mesh, read_with_igl
from dsfab.surface import ply_chunks


def prepare(part: Part) -> Part:
    """The part as it is: nothing is rounded."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Header, vertices, faces; little endian."""
    return ply_chunks(part.V, part.F, "millimetre")


def check(part: Part, path: Path) -> ReadBack:
    """Read back with libigl, which says nothing of a last face that is cut off: the file is as long as it should be."""
    read = check_mesh(part, *read_with_igl(path))
    short = sum(map(len, encode(part))) - path.stat().st_size
    if short > 0:
        raise ExportError(f"{part.name!r} reads back {short} bytes short; free some space or write another format")
    return read
