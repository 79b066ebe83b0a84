"""OFF (Object File Format of Geomview): text, indexed from 0. A comment gives the unit: millimetre."""

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
    """Counts of vertices, faces and edges (0: not counted, as the format allows), then a line each."""
    yield f"OFF\n# {one_line(part.name)}, written by dsfab {__version__}\n# unit: millimetre\n".encode()
    yield f"{len(part.V)} {len(part.F)} 0\n".encode()
    yield from (text.encode("ascii") for text in rows("%.17g %.17g %.17g\n", *part.V.T))
    yield from (text.encode("ascii") for text in rows("3 %d %d %d\n", *part.F.T))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with trimesh."""
    return check_mesh(part, *read_with_trimesh(path))
