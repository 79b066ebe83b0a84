"""PLY files, text and binary, with polygons of any size [Turk 1994].

Not read with trimesh, which refuses binary files that mix triangles and quads and splits every quad from its first
corner.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.surface.polygons import Polygons

_NUMBERS = (
    "char=i1 uchar=u1 short=i2 ushort=u2 int=i4 uint=u4 float=f4 double=f8 "
    "int8=i1 uint8=u1 int16=i2 uint16=u2 int32=i4 uint32=u4 float32=f4 float64=f8"
)
_TYPES = dict(pair.split("=") for pair in _NUMBERS.split())
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


@dataclass(frozen=True)
class _Property:
    """One property of an element; a list has the type of its length in front."""

    name: str
    type: str
    length: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


def read_ply(path: Path) -> Polygons:
    """Vertices and faces of a PLY file; colours, normals and other elements are passed over.

    Raises ValueError (or KeyError, IndexError) when the file is not a PLY file, is cut off or lacks a property.
    """
    data = path.read_bytes()
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise ValueError("there is no PLY header")
    body = data[data.index(b"\n", end) + 1 :]
    style, elements = _header(data[:end].decode("ascii", errors="replace"))
    found: dict[str, dict[str, Any]] = {}
    words, at = (body.split(), 0) if style == "ascii" else ([], 0)
    for element in elements:
        if style == "ascii":
            found[element.name], at = _from_text(words, at, element)
        else:
            found[element.name], at = _from_bytes(body, at, element, _ORDERS[style])
    vertex, face = found["vertex"], found.get("face", {})
    lists = face.get("vertex_indices", face.get("vertex_index", (np.empty(0), np.empty(0))))
    V = np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    return Polygons(V, lists[0].astype(np.int64), lists[1].astype(np.int64))


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


def _header(text: str) -> tuple[str, list[_Element]]:
    """The format (ascii, binary_...) and the elements, in the order of the file."""
    style, elements = "", []
    for line in text.splitlines():
        match line.split():
            case ["format", kind, _]:
                style = kind
            case ["element", name, count]:
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name]:
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name]:
                elements[-1].properties.append(_Property(name, _TYPES[kind]))
    if style != "ascii" and style not in _ORDERS:
        raise ValueError(f"the format {style!r} is not ascii, binary_little_endian or binary_big_endian")
    return style, elements


def _from_text(words: list[bytes], at: int, element: _Element) -> tuple[dict[str, Any], int]:
    """The properties of one element, and where the next one begins."""
    records: dict[str, list[Any]] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        for p in element.properties:
            size = 1 if p.length is None else int(words[at])
            at += p.length is not None
            if at + size > len(words):
                raise ValueError(f"the file ends within the element {element.name!r}")
            records[p.name].append(words[at : at + size])
            at += size
    return {p.name: _packed(p, [[float(w) for w in r] for r in records[p.name]]) for p in element.properties}, at


def _from_bytes(body: bytes, at: int, element: _Element, order: str) -> tuple[dict[str, Any], int]:
    """The same for binary: at once if all lists are as long as the first record's, else record by record."""
    if not element.count:
        return {p.name: _packed(p, []) for p in element.properties}, at
    sizes: list[int] = []
    dtype = _record(body, at, element, order, sizes)
    stop = at + dtype.itemsize * element.count
    if stop <= len(body):
        table = np.frombuffer(body, dtype, element.count, at)
        if all((table[f"#{i}"] == size).all() for i, size in enumerate(sizes) if size >= 0):
            return {p.name: _column(p, table[p.name]) for p in element.properties}, stop
    records: dict[str, list[Any]] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        dtype = _record(body, at, element, order, [])
        one = np.frombuffer(body, dtype, 1, at)[0]
        for p in element.properties:
            records[p.name].append(np.atleast_1d(one[p.name]).tolist())
        at += dtype.itemsize
    return {p.name: _packed(p, records[p.name]) for p in element.properties}, at


def _record(body: bytes, at: int, element: _Element, order: str, sizes: list[int]) -> np.dtype[Any]:
    """The type of the record that begins at byte `at`; the lengths of its lists (-1: no list) go into `sizes`."""
    fields: list[tuple[Any, ...]] = []
    for i, p in enumerate(element.properties):
        size = -1
        if p.length is not None:
            start = at + np.dtype(fields).itemsize
            size = int(np.frombuffer(body, order + p.length, 1, start)[0])
            fields.append((f"#{i}", order + p.length))
        fields.append((p.name, order + p.type) if size < 0 else (p.name, order + p.type, (size,)))
        sizes.append(size)
    return np.dtype(fields)


def _column(p: _Property, values: Any) -> Floats | tuple[Ints, Ints]:
    if p.length is None:
        return values.astype(np.float64)  # type: ignore[no-any-return]
    return values.ravel(), np.full(len(values), values.shape[1])


def _packed(p: _Property, records: list[list[float]]) -> Floats | tuple[Ints, Ints]:
    flat = np.array([x for record in records for x in record])
    if p.length is None:
        return flat
    return flat.astype(np.int64), np.array([len(record) for record in records], dtype=np.int64)
