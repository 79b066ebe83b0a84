"""PLY, binary [Turk 1994]: indexed, double precision. A comment gives the unit: millimetre."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dsfab import __version__
from dsfab.export.part import Part
from dsfab.export.readback import Found, check_mesh, read_with_trimesh

_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def prepare(part: Part) -> Part:
    """The part as it is: nothing is rounded."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Header, vertices, faces; little endian."""
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment written by dsfab {__version__}",
        "comment unit: millimetre",
        f"element vertex {len(part.V)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(part.F)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    faces = np.empty(len(part.F), dtype=_FACE)
    faces["count"] = 3
    faces["vertices"] = part.F
    yield ("\n".join(lines) + "\n").encode("ascii")
    yield part.V.astype("<f8").tobytes()
    yield faces.tobytes()


def check(part: Part, path: Path) -> Found:
    """Read back with trimesh."""
    return check_mesh(part, *read_with_trimesh(path))
