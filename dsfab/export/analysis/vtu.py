"""VTU files for ParaView: a sheet with all its fields, in metres."""

import base64
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_mesh

UNIT = "metre"


def prepare(part: Part) -> Part:
    """Return the part unchanged. Raises ExportError if a field has the wrong number of rows."""
    for name, values in part.details.values.items():
        if len(values) not in (len(part.V), len(part.F)):
            raise ExportError(
                f"the field {name!r} has {len(values)} rows, but {part.name!r} has {len(part.V)} vertices and "
                f"{len(part.F)} faces; give it one row for each vertex or for each face"
            )
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the VTU file of a part."""
    values = part.details.values
    on_vertices = {name: array for name, array in values.items() if len(array) == len(part.V)}
    on_faces = {name: array for name, array in values.items() if name not in on_vertices}
    notes = "".join(_words(f"note {k}", fact) for k, fact in enumerate(part.details.facts, 1))
    yield (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        f'header_type="UInt64">\n<!-- dsfab {__version__} -->\n<UnstructuredGrid>\n<FieldData>\n{_words("unit", UNIT)}'
        f'{notes}</FieldData>\n<Piece NumberOfPoints="{len(part.V)}" NumberOfCells="{len(part.F)}">\n'
    ).encode()
    for tag, group in (("PointData", on_vertices), ("CellData", on_faces)):
        yield f"<{tag}>\n".encode()
        for name, array in group.items():
            yield _array(name, np.asarray(array, dtype=np.float64))
        yield f"</{tag}>\n".encode()
    yield b"<Points>\n" + _array("Points", part.V / MM_PER_M) + b"</Points>\n<Cells>\n"
    yield _array("connectivity", part.F.ravel()) + _array("offsets", 3 * np.arange(1, len(part.F) + 1))
    yield _array("types", np.full(len(part.F), 5, dtype=np.uint8))  # 5 means VTK_TRIANGLE
    yield b"</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"


def _words(name: str, text: str) -> str:
    codes = " ".join(str(ord(character)) for character in text)
    return f'<DataArray type="String" Name="{name}" NumberOfTuples="1" format="ascii">{codes} 0</DataArray>\n'


def _array(name: str, values: NDArray[Any]) -> bytes:
    kind = {"f": "Float64", "i": "Int64", "u": "UInt8"}[values.dtype.kind]
    little = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    data = base64.b64encode(np.array([little.nbytes], dtype="<u8").tobytes() + little.tobytes())
    components = int(np.prod(values.shape[1:]))
    head = f'<DataArray type="{kind}" Name={quoteattr(name)} NumberOfComponents="{components}" format="binary">'
    return head.encode() + data + b"</DataArray>\n"


def check(part: Part, path: Path) -> ReadBack:
    """Read the mesh and the fields of a VTU file, and compare them with the part."""
    arrays = dict(_arrays(path))
    V, F = arrays.pop("Points"), arrays.pop("connectivity").astype(np.int64).reshape(-1, 3)
    result = check_mesh(replace(part, V=part.V / MM_PER_M), V.reshape(-1, 3), F)
    for name, values in part.details.values.items():
        if name not in arrays or not np.array_equal(arrays[name], np.asarray(values).ravel(), equal_nan=True):
            raise ExportError(
                f"the field {name!r} of {part.name!r} differs when the file is read back; write .csv or .json instead"
            )
    return result


def _arrays(path: Path) -> Iterator[tuple[str, Floats]]:
    for element in ElementTree.parse(path).iter("DataArray"):
        if element.get("format") == "binary":
            data = base64.b64decode(element.text or "")
            kind = {"Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}[element.get("type", "")]
            yield element.get("Name", ""), np.frombuffer(data[8:], dtype=kind).astype(np.float64)
