"""Reader and writer of PLY files."""

import re
import warnings
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.messages import count_phrase
from dsfab.surface.files.polygons import Polygons
from dsfab.surface.files.reading import (
    Budget,
    Content,
    MalformedFileError,
    PolygonFile,
    declarations_in_comments,
    float_of,
    text_file,
    whole_number,
)

CHUNK = 1 << 16  # Number of records between two checks of the time.
BLOCK = 1 << 20  # Number of bytes of text that the reader converts together.
_SPACE = re.compile(rb"\s")


@dataclass(frozen=True)
class PlyProperty:
    """A property of a PLY element: its name and number type. length : number type of a list's length, or None."""

    name: str
    type: str
    length: str | None = None


@dataclass(frozen=True)
class PlyElement:
    """An element of a PLY file: a table with `count` records of the given properties."""

    name: str
    count: int
    properties: list[PlyProperty]

    def cut_off(self) -> MalformedFileError:
        """Return an error which says that the file has too few records of this element."""
        return MalformedFileError(
            f"the file ends before the last of the {self.count:,} records of the element {self.name!r}"
        )


Columns = dict[str, Any]  # For each property, values (count,); for lists, all values (c,) and the lengths (count,).


def text_numbers(body: bytes) -> tuple[Floats, bool]:
    """Return the numbers (c,) at the beginning of a text, and True if a word that is no number follows."""
    parts, position, odd = [np.empty(0)], 0, False
    while position < len(body) and not odd:
        gap = _SPACE.search(body, position + BLOCK)
        end = gap.start() if gap else len(body)
        block, position = body[position:end].strip(), end
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # numpy before 2.3 only warns if a word is no number
                parts.append(np.fromstring(block, dtype=np.float64, sep=" ") if block else np.empty(0))
        except (ValueError, DeprecationWarning):
            parts.append(_numbers_before_words(block))
            odd = True
    return np.concatenate(parts), odd


def _numbers_before_words(block: bytes) -> Floats:
    numbers = []
    for word in block.split():
        try:
            numbers.append(float_of(word.decode("ascii")))
        except ValueError:
            break
    return np.array(numbers, dtype=np.float64)


def text_element(numbers: Floats, position: int, element: PlyElement, budget: Budget) -> tuple[Columns, int]:
    """Return the values of an element's properties in a text file, and the index in `numbers` after its records.
    numbers : (c,) all numbers of the file's body.    position : index of the element's first number.
    Raises MalformedFileError for a file that ends too early."""
    if not element.properties or not element.count:
        return {p.name: _nothing(p) for p in element.properties}, position
    if element.count * len(element.properties) > len(numbers) - position:
        raise element.cut_off()  # fail before the records take memory
    begins, counts, stop = _equal_records(numbers, position, element) or _text_walk(numbers, position, element, budget)
    columns: Columns = {}
    for i, p in enumerate(element.properties):
        columns[p.name] = _as_column(p, numbers[_places(begins[:, i], counts[:, i], 1)], counts[:, i])
    return columns, stop


def _equal_records(numbers: Floats, position: int, element: PlyElement) -> tuple[Ints, Ints, int] | None:
    start, sizes, lists, place = [], [], [], 0
    for p in element.properties:
        if p.length is not None:
            size = numbers[position + place] if position + place < len(numbers) else -1
            if not 0 <= size <= len(numbers):
                return None
            lists.append(place)
            place += 1
        start.append(place)
        sizes.append(int(size) if p.length is not None else 1)
        place += sizes[-1]
    stop = position + place * element.count
    if stop > len(numbers):
        return None
    table = numbers[position:stop].reshape(element.count, place)
    if any((table[:, k] != table[0, k]).any() for k in lists):
        return None
    record_starts = position + place * np.arange(element.count)
    return record_starts[:, None] + np.array(start), np.tile(np.array(sizes), (element.count, 1)), stop


def _text_walk(numbers: Floats, position: int, element: PlyElement, budget: Budget) -> tuple[Ints, Ints, int]:
    start, sizes = array("q"), array("q")
    for k in range(element.count):
        if k % CHUNK == 0:
            budget.require_time()
        for p in element.properties:
            size = 1
            if p.length is not None:
                length = numbers[position] if position < len(numbers) else -1.0
                size = int(length) if 0 <= length <= len(numbers) and length == int(length) else -1
                position += 1
            if size < 0 or position + size > len(numbers):
                raise element.cut_off()
            start.append(position)
            sizes.append(size)
            position += size
    begins, counts = (np.array(x, dtype=np.int64).reshape(element.count, -1) for x in (start, sizes))
    return begins, counts, position


def binary_element(body: bytes, position: int, element: PlyElement, order: str, budget: Budget) -> tuple[Columns, int]:
    """Return the values of an element's properties in a binary file, and the index of the byte after its records.
    position : index of its first byte in `body`.    order : '<' little endian, '>' big endian."""
    if not element.properties or not element.count:
        return {p.name: _nothing(p) for p in element.properties}, position
    if element.count * sum(np.dtype(p.length or p.type).itemsize for p in element.properties) > len(body) - position:
        raise element.cut_off()  # fail before the records take memory
    dtype, lists = _first_record(body, position, element, order)
    stop = position + dtype.itemsize * element.count
    if stop <= len(body):
        table = np.frombuffer(body, dtype, element.count, position)
        if all((table[f"length of {name}"] == size).all() for name, size in lists.items()):
            return {p.name: _column(p, table[p.name]) for p in element.properties}, stop
    begins, counts, position = _binary_walk(body, position, element, order, budget)
    raw = np.frombuffer(body, np.uint8)
    columns: Columns = {}
    for i, p in enumerate(element.properties):
        width = np.dtype(p.type).itemsize
        places = _places(begins[:, i], counts[:, i], width)
        values = raw[places[:, None] + np.arange(width)].view(order + p.type).ravel()
        columns[p.name] = _as_column(p, values, counts[:, i])
    return columns, position


def _first_record(body: bytes, position: int, element: PlyElement, order: str) -> tuple[np.dtype[Any], dict[str, int]]:
    fields: list[tuple[Any, ...]] = []
    lists: dict[str, int] = {}
    for p in element.properties:
        if p.length is None:
            fields.append((p.name, order + p.type))
            continue
        width = np.dtype(p.length).itemsize
        start = position + np.dtype(fields).itemsize
        size = int(np.frombuffer(body, order + p.length, 1, start)[0]) if start + width <= len(body) else -1
        if size < 0 or size > len(body):
            raise element.cut_off()
        lists[p.name] = size
        fields += [(f"length of {p.name}", order + p.length), (p.name, order + p.type, (size,))]
    return np.dtype(fields), lists


def _binary_walk(body: bytes, position: int, element: PlyElement, order: str, budget: Budget) -> tuple[Ints, Ints, int]:
    byte = "little" if order == "<" else "big"
    widths = [(np.dtype(p.length).itemsize if p.length else 0, np.dtype(p.type).itemsize) for p in element.properties]
    signs = [bool(p.length and p.length[0] == "i") for p in element.properties]
    start, sizes = array("q"), array("q")
    for k in range(element.count):
        if k % CHUNK == 0:
            budget.require_time()
        for (wide, width), signed in zip(widths, signs, strict=True):
            size = int.from_bytes(body[position : position + wide], byte, signed=signed) if wide else 1  # type: ignore[arg-type]
            position += wide
            if size < 0 or position + size * width > len(body):
                raise element.cut_off()
            start.append(position)
            sizes.append(size)
            position += size * width
    begins, counts = (np.array(x, dtype=np.int64).reshape(element.count, -1) for x in (start, sizes))
    return begins, counts, position


def _places(begin: Ints, count: Ints, step: int) -> Ints:
    within = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
    places: Ints = np.repeat(begin, count) + step * within
    return places


def _as_column(p: PlyProperty, values: NDArray[Any], count: Ints) -> Any:
    return values.astype(np.float64) if p.length is None else (values, count)


def _column(p: PlyProperty, values: NDArray[Any]) -> Any:
    if p.length is None:
        return values.astype(np.float64)
    return values.ravel(), np.full(len(values), values.shape[1])


def _nothing(p: PlyProperty) -> Any:
    empty = np.empty(0)
    return empty if p.length is None else (empty.astype(np.int64), np.empty(0, dtype=np.int64))


_NUMBERS = (
    "char=i1 uchar=u1 short=i2 ushort=u2 int=i4 uint=u4 float=f4 double=f8 "
    "int8=i1 uint8=u1 int16=i2 uint16=u2 int32=i4 uint32=u4 float32=f4 float64=f8"
)
_TYPES = dict(pair.split("=") for pair in _NUMBERS.split())
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"(?<=[\r\n])end_header[ \t]*(\r\n|\n|\r|\Z)")
LONGEST_HEADER = 1 << 20  # Largest number of bytes of a header.
_FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def read_ply(data: bytes, budget: Budget) -> PolygonFile:
    """Return the vertices and faces in a PLY file.
    Raises MalformedFileError for an invalid file, and SurfaceError for a file above the limits of `budget`."""
    if data[:3] not in (b"ply", b"PLY"):  # a text file may have a byte order mark or be UTF-16
        file = text_file(data)
        if not file.text.startswith(("ply", "PLY")):
            raise MalformedFileError("the file has no PLY header")
        data, doubts = file.text.encode("utf-8"), file.doubts
    else:
        doubts = ()
    end = _END.search(data, 0, LONGEST_HEADER)
    if end is None:
        raise MalformedFileError("the file has no PLY header, or the header does not end")
    header = data[: end.start()].decode("ascii", errors="replace")
    comments = declarations_in_comments(header, ("comment", "obj_info"))
    style, elements = _header(header)
    columns, leftovers = _element_columns(data[end.end() :], style, elements, budget)
    passed = tuple(
        Content("record", "dropped", f"of the element {e.name!r}", e.count)
        for e in elements
        if e.name not in ("vertex", "face") and e.count
    )
    if style == "ascii" and not data.endswith((b"\n", b"\r")) and elements:
        doubts = (*doubts, f"the last line is incomplete: the file may be cut off within the last {elements[-1].name}")
    return PolygonFile(_polygons(columns), doubts, leftovers, comments.unit, content=passed)


def _element_columns(
    body: bytes, style: str, elements: list[PlyElement], budget: Budget
) -> tuple[dict[str, dict[str, Any]], tuple[str, ...]]:
    for element in elements:
        _require_within(budget, element)
    columns: dict[str, dict[str, Any]] = {}
    numbers, odd = text_numbers(body) if style == "ascii" else (np.empty(0), False)
    position = 0
    for element in elements:
        budget.require_time()
        if style == "ascii":
            try:
                columns[element.name], position = text_element(numbers, position, element, budget)
            except MalformedFileError:
                if odd:
                    raise MalformedFileError(f"the element {element.name!r} has a word that is not a number") from None
                raise
        else:
            columns[element.name], position = binary_element(body, position, element, _ORDERS[style], budget)
    extra = len(numbers) - position if style == "ascii" else len(body) - position
    thing = "number" if style == "ascii" else "byte"
    leftovers = [f"{count_phrase(extra, thing)} after the last element"] if extra else []
    leftovers += ["words that are not numbers after the last element"] if odd else []
    return columns, tuple(leftovers)


def _require_within(budget: Budget, element: PlyElement) -> None:
    count = element.count if element.properties else 0
    if element.name == "face":
        budget.require_triangles(count)
    else:
        what = "vertices" if element.name == "vertex" else f"records of the element {element.name!r}"
        budget.require_vertices(count, what)


def _polygons(columns: dict[str, dict[str, Any]]) -> Polygons:
    vertex, face = columns.get("vertex"), columns.get("face", {})
    if vertex is None:
        raise MalformedFileError("the file has no element 'vertex'")
    missing = [axis for axis in "xyz" if not isinstance(vertex.get(axis), np.ndarray)]
    if missing:
        raise MalformedFileError(f"the vertices in the file have no property {', '.join(missing)}")
    V = np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if lists is None:
        return Polygons(V, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    if not isinstance(lists, tuple):
        raise MalformedFileError("the property vertex_indices of the file's faces is not a list")
    return Polygons(V, _whole(lists[0]), lists[1])


def _whole(indices: NDArray[Any]) -> Ints:
    if indices.dtype.kind == "f" and not ((np.abs(indices) < 2**53) & (indices == np.floor(indices))).all():
        raise MalformedFileError("the faces in the file have vertex numbers that are not whole numbers")
    return indices.astype(np.int64)


def ply_chunks(V: Floats, F: Ints, unit: str) -> Iterator[bytes]:
    """Yield pieces of the binary PLY file of a mesh V (n, 3), F (m, 3). unit : unit of V."""
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
            case [] | ["ply" | "PLY"] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MalformedFileError(f"line {number} of the file's header cannot be read: {line.strip()[:60]!r}")
    if style != "ascii" and style not in _ORDERS:
        raise MalformedFileError(
            f"the format {style!r} in the file's header is not ascii, binary_little_endian or binary_big_endian"
        )
    _require_unique([element.name for element in elements], "element")
    for element in elements:
        _require_unique([entry.name for entry in element.properties], f"property of {element.name!r}")
        if any(entry.length in ("f4", "f8") for entry in element.properties):
            raise MalformedFileError(f"a list in the element {element.name!r} has a length that is not a whole number")
    return style, elements


def _count(word: str, line: int) -> int:
    try:
        count = whole_number(word)
    except ValueError:
        count = -1
    if count < 0:
        raise MalformedFileError(f"line {line} of the file's header has no number of records: {word[:40]!r}")
    return count


def _require_unique(names: list[str], what: str) -> None:
    if twice := {name for name in names if names.count(name) > 1}:
        raise MalformedFileError(f"the file's header lists the {what} {min(twice)!r} twice")
