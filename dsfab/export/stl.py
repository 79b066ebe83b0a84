"""STL, binary: triangles only, single precision, no unit. Millimetres by convention, and the header says so."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsfab import __version__
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh, merged_mesh, read_with_igl

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def prepare(part: Part) -> Part:
    """The part in single precision. A file without indices joins vertices by their position, and so is it judged."""
    part = in_single_precision(part)
    V, F = merged_mesh(part.V, part.F)
    return replace(part, V=V, F=F)


def encode(part: Part) -> Iterator[bytes]:
    """Header, number of triangles, then 50 bytes for each.

    The header must not begin with "solid", which is how readers recognise the text variant. It ends with a zero: admesh
    prints it as a text of C, and went on into what lay behind it in memory.
    """
    records = np.zeros(len(part.F), dtype=_RECORD)
    corners = part.V[part.F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    records["corners"] = corners
    yield f"binary STL, unit: millimetre, written by dsfab {__version__}".encode("ascii").ljust(79) + b"\0"
    yield np.uint32(len(records)).astype("<u4").tobytes()
    yield records.tobytes()


def check(part: Part, path: Path) -> ReadBack:
    """Read back with libigl."""
    return check_mesh(part, *merged_mesh(*read_with_igl(path)))
