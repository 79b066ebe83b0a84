"""PLY files, text and binary, with polygons of any size [Turk 1994].

Not read with trimesh, which refuses binary files that mix triangles and quads and splits every quad from its first
corner.
"""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.surface.formats.ply_records import PlyElement, PlyProperty, binary_element, text_element, text_numbers
from dsfab.surface.formats.record import PolygonFile
from dsfab.surface.formats.text import said_in_comments, text_file, whole_number
from dsfab.surface.polygons import Polygons
from dsfab.wording import counted

_NUMBERS = (
    "char=i1 uchar=u1 short=i2 ushort=u2 int=i4 uint=u4 float=f4 double=f8 "
    "int8=i1 uint8=u1 int16=i2 uint16=u2 int32=i4 uint32=u4 float32=f4 float64=f8"
)
_TYPES = dict(pair.split("=") for pair in _NUMBERS.split())
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"(?<=[\r\n])end_header[ \t]*(\r\n|\n|\r|\Z)")
LONGEST_HEADER = 1 << 20
"""Bytes within which a header ends."""

_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def read_ply(data: bytes, budget: Budget) -> PolygonFile:
    """Vertices and faces of a PLY file; colours, normals and other elements are passed over.

    Raises MalformedFileError when the file is not a PLY file, is cut off or lacks a property, SurfaceError beyond the
    budget; both before anything is made of what the header announces.
    """
    if data[:3] != b"ply":  # with a byte order mark, or UTF-16
        file = text_file(data)
        if not file.text.startswith("ply"):
            raise MalformedFileError("there is no PLY header")
        data, doubts = file.text.encode("utf-8"), file.doubts
    else:
        doubts = ()
    end = _END.search(data, 0, LONGEST_HEADER)
    if end is None:
        raise MalformedFileError("there is no PLY header, or it does not end")
    header = data[: end.start()].decode("ascii", errors="replace")
    said = said_in_comments(header, ("comment", "obj_info"))
    style, elements = _header(header)
    found, left = _elements(data[end.end() :], style, elements, budget)
    passed = tuple(
        f"{counted(e.count, 'record')} of the element {e.name!r}" for e in elements if e.name not in ("vertex", "face")
    )
    if style == "ascii" and not data.endswith((b"\n", b"\r")) and elements:
        doubts = (*doubts, f"the last line has no end: the file may be cut off within the last {elements[-1].name}")
    return PolygonFile(_polygons(found), doubts, (*passed, *left), said.unit)


def _elements(
    body: bytes, style: str, elements: list[PlyElement], budget: Budget
) -> tuple[dict[str, dict[str, Any]], tuple[str, ...]]:
    """The properties of each element, and what there is behind the last one."""
    for element in elements:
        _require_within(budget, element)
    found: dict[str, dict[str, Any]] = {}
    numbers, odd = text_numbers(body) if style == "ascii" else (np.empty(0), False)
    at = 0
    for element in elements:
        budget.require_time()
        if style == "ascii":
            try:
                found[element.name], at = text_element(numbers, at, element, budget)
            except MalformedFileError:
                if odd:
                    raise MalformedFileError(f"the element {element.name!r} holds a word that is no number") from None
                raise
        else:
            found[element.name], at = binary_element(body, at, element, _ORDERS[style], budget)
    more = len(numbers) - at if style == "ascii" else len(body) - at
    thing = "number" if style == "ascii" else "byte"
    left = [counted(more, thing)] if more else []
    left += ["words that are no numbers"] if odd else []
    return found, (f"{' and '.join(left)} after the last element",) if left else ()


def _require_within(budget: Budget, element: PlyElement) -> None:
    """Raise SurfaceError for an element with more records than are accepted; those without a property cost nothing."""
    count = element.count if element.properties else 0
    if element.name == "face":
        budget.require_triangles(count)
    else:
        what = "vertices" if element.name == "vertex" else f"records of the element {element.name!r}"
        budget.require_vertices(count, what)


def _polygons(found: dict[str, dict[str, Any]]) -> Polygons:
    """Raises MalformedFileError where the element vertex, one of its places, or whole numbers in faces are missing."""
    vertex, face = found.get("vertex"), found.get("face", {})
    if vertex is None:
        raise MalformedFileError("it has no element 'vertex'")
    missing = [axis for axis in "xyz" if not isinstance(vertex.get(axis), np.ndarray)]
    if missing:
        raise MalformedFileError(f"its vertices have no property {', '.join(missing)}")
    V = np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if lists is None:
        return Polygons(V, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    if not isinstance(lists, tuple):
        raise MalformedFileError("the property vertex_indices of its faces is no list")
    return Polygons(V, _whole(lists[0]), lists[1])


def _whole(indices: NDArray[Any]) -> Ints:
    if indices.dtype.kind == "f" and not ((np.abs(indices) < 2**53) & (indices == np.floor(indices))).all():
        raise MalformedFileError("its faces name vertices by numbers that are not whole")
    return indices.astype(np.int64)


def ply_chunks(V: Floats, F: Ints, unit: str) -> Iterator[bytes]:
    """A binary file, little endian, of V (n, 3), doubles in `unit`, which a comment names, and of F (m, 3)."""
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment written by dsfab {__version__}",
        f"comment unit: {unit}",
        f"element vertex {len(V)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(F)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    faces = np.empty(len(F), dtype=_FACE)
    faces["count"] = 3
    faces["vertices"] = F
    yield ("\n".join(lines) + "\n").encode("ascii")
    yield V.astype("<f8").tobytes()
    yield faces.tobytes()


def _header(text: str) -> tuple[str, list[PlyElement]]:
    """The format (ascii, binary_...) and the elements, in the order of the file."""
    style, elements = "", list[PlyElement]()
    for number, line in enumerate(text.splitlines(), start=1):
        match line.split():
            case ["format", kind, *_]:
                style = kind
            case ["element", name, count]:
                elements.append(PlyElement(name, _count(count, number), []))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= set(_TYPES):
                elements[-1].properties.append(PlyProperty(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(PlyProperty(name, _TYPES[kind]))
            case [] | ["ply"] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MalformedFileError(f"line {number} of its header cannot be read: {line.strip()[:60]!r}")
    if style != "ascii" and style not in _ORDERS:
        raise MalformedFileError(f"the format {style!r} is not ascii, binary_little_endian or binary_big_endian")
    _require_unique([element.name for element in elements], "element")
    for element in elements:
        _require_unique([one.name for one in element.properties], f"property of {element.name!r}")
        if any(one.length in ("f4", "f8") for one in element.properties):
            raise MalformedFileError(f"a list of {element.name!r} has a length that is no whole number")
    return style, elements


def _count(word: str, line: int) -> int:
    try:
        count = whole_number(word)
    except ValueError:
        count = -1
    if count < 0:
        raise MalformedFileError(f"line {line} of its header has no number of records: {word[:40]!r}")
    return count


def _require_unique(names: list[str], what: str) -> None:
    if twice := {name for name in names if names.count(name) > 1}:
        raise MalformedFileError(f"its header has the {what} {min(twice)!r} twice")
