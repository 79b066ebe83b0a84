"""OBJ (Wavefront): text, indexed from 1. A comment gives the unit: millimetre."""

from collections.abc import Iterator
from pathlib import Path

from dsfab import __version__
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_mesh, read_with_trimesh
from dsfab.export.text import one_line, rows


def prepare(part: Part) -> Part:
    """The part as it is: the text holds every digit."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """One line per vertex and per face; 17 digits are what a double needs."""
    yield f"# written by dsfab {__version__}\n# unit: millimetre\no {one_line(part.name)}\n".encode()
    yield from (text.encode("ascii") for text in rows("v %.17g %.17g %.17g\n", *part.V.T))
    yield from (text.encode("ascii") for text in rows("f %d %d %d\n", *(part.F + 1).T))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with trimesh."""
    return check_mesh(part, *read_with_trimesh(path))
