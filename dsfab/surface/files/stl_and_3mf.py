"""Reader of STL and 3MF files."""

import io
import re
import struct
import zipfile
import zlib
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.messages import count_phrase
from dsfab.core.units import metres_per
from dsfab.surface.clean.seams import equal_merged
from dsfab.surface.files.reading import Budget, MalformedFileError, TriangleFile, float_of, text_file

HEAD, EACH = 84, 50  # Bytes of the header with the number of triangles, and of each triangle.
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = r"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rf"\s*facet(?:\s+normal\s+\S+\s+\S+\s+\S+)?\s+outer\s+loop\s+{3 * _VERTEX}endloop\s+endfacet(?=\s|$)", re.IGNORECASE
)
_BETWEEN = re.compile(r"\s*(?:end\s*solid|solid)\b[^\n]*?(?=\n|\sfacet\s|\Z)", re.IGNORECASE)
CHUNK = 1 << 14  # Triangles of a text file between two checks of the time.


def read_stl(data: bytes, budget: Budget) -> TriangleFile:
    """Return the triangles of an STL file, with coincident corners merged. The length of the file distinguishes binary
    files from text, because many binary files also begin with "solid". Raises MalformedFileError for an incomplete or
    foreign file, SurfaceError beyond the budget."""
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEAD else -1
    announced = HEAD + EACH * count
    looks_like_text = b"facet" in data[:2000].replace(b"\0", b"").lower() or len(data) < HEAD
    if count < 0 or (len(data) != announced and looks_like_text):
        return _read_text(data, budget)
    budget.require_triangles(count)
    if len(data) < announced:
        raise MalformedFileError(f"{count:,} triangles are announced, and it ends after {(len(data) - HEAD) // EACH:,}")
    soup = np.frombuffer(data, _RECORD, count, HEAD)["corners"].astype(np.float64)
    extra_bytes = len(data) - announced
    dropped = (f"{count_phrase(extra_bytes, 'byte')} after the last triangle",) if extra_bytes else ()
    return TriangleFile(*equal_merged(soup.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), dropped=dropped)


def _read_text(data: bytes, budget: Budget) -> TriangleFile:
    file = text_file(data)
    text, position, numbers, ended = file.text.rstrip(), 0, array("d"), False
    head = _BETWEEN.match(text)
    if head is None or not text.lstrip()[:5].lower() == "solid":
        raise MalformedFileError("it does not begin with 'solid', and its length differs from its binary header")
    position = head.end()
    while position < len(text):
        if match := _FACET.match(text, position):
            ended = False
            try:
                numbers.extend(map(float_of, match.groups()))
            except ValueError:
                raise MalformedFileError(
                    f"line {_line_number(text, position)} or a later line has a word that is not a number"
                ) from None
            if len(numbers) % (9 * CHUNK) == 0:
                budget.require_time()
                budget.require_triangles(len(numbers) // 9)
        elif match := _BETWEEN.match(text, position):
            ended = match.group().strip().lower().startswith("end")
        else:
            raise MalformedFileError(f"line {_line_number(text, position)} does not begin a triangle")
        position = match.end()
    budget.require_triangles(len(numbers) // 9)
    doubts = file.doubts if ended else (*file.doubts, "the last line, endsolid, is missing: it may be cut off")
    V, F = equal_merged(np.array(numbers).reshape(-1, 3), np.arange(len(numbers) // 3).reshape(-1, 3))
    return TriangleFile(V, F, doubts=doubts)


def _line_number(text: str, position: int) -> int:
    return (
        text.count("\n", 0, position)
        + text[position:].count("\n", 0, len(text) - position - len(text[position:].lstrip()))
        + 1
    )


_UNITS = {"MicroMeter": "um", "MilliMeter": "mm", "CentiMeter": "cm", "Meter": "m", "Inch": "in", "Foot": "ft"}
_PARTS = re.compile(rb"<(/?)(?:[\w.-]+:)?(object|component|item)\b([^>]*)>")
_TRIANGLE = re.compile(rb"[<:]triangle\s")
_ATTRIBUTE = re.compile(rb"""\b(id|objectid|path)\s*=\s*["']([^"']*)["']""")
Key = tuple[str, bytes]  # The name of a part of the file, and the number of an object in this part.


def read_3mf(path: Path, data: bytes, budget: Budget) -> TriangleFile:
    """Return the triangles of all objects on the build plate of a 3MF file, at their places. Raises MalformedFileError
    for a damaged file and SurfaceError beyond the budget, both before lib3mf reads the file."""
    plate = _Plate(data, budget)
    budget.require_triangles(plate.triangles())
    import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    try:
        model.QueryReader("3mf").ReadFromFile(str(path))
        unit = _UNITS[model.GetUnit().name]
        parts = list(_meshes(model.MergeToModel()))
    except lib3mf.ELib3MFException as error:
        raise MalformedFileError(f"lib3mf refuses it with code {error._code}") from None
    metres = 1e-6 if unit == "um" else metres_per(unit)
    offsets = np.cumsum([0, *(len(V) for V, _ in parts)])[:-1].tolist()
    V = np.concatenate([np.empty((0, 3)), *(V for V, _ in parts)])
    F = np.concatenate([np.empty((0, 3), dtype=np.int64), *(F + n for (_, F), n in zip(parts, offsets, strict=True))])
    unplaced = len(plate.own) - len(plate.used)
    dropped = (f"{count_phrase(unplaced, 'object')} that the build plate lacks",) if unplaced > 0 else ()
    return TriangleFile(V, F, unit, metres, dropped=dropped)


def _meshes(model: Any) -> Iterator[tuple[Floats, Ints]]:
    objects = model.GetMeshObjects()
    while objects.MoveNext():
        mesh = objects.GetCurrentMeshObject()
        V = np.frombuffer(b"".join(mesh.GetVertices()), dtype="<f4").reshape(-1, 3).astype(np.float64)
        yield V, np.frombuffer(b"".join(mesh.GetTriangleIndices()), dtype="<u4").reshape(-1, 3).astype(np.int64)


class _Plate:
    """Counts of the content that needs memory: triangles and components of objects, and items on the plate."""

    def __init__(self, data: bytes, budget: Budget) -> None:
        self.own: dict[Key, int] = {}
        self.made_of: dict[Key, list[Key]] = {}
        self.items: list[Key] = []
        self.used: set[Key] = set()
        self._known: dict[Key, int] = {}
        for name, text in _models(data, budget):
            self._scan(name, text)

    def _scan(self, name: str, text: bytes) -> None:
        inside, start = (name, b""), -1
        for tag in _PARTS.finditer(text):
            ends, kind, rest = tag.groups()
            if kind == b"object" and (ends or rest.endswith(b"/")):
                if start >= 0:
                    self.own[inside] = sum(1 for _ in _TRIANGLE.finditer(text, start, tag.start()))
                start = -1
                continue
            values = dict(_ATTRIBUTE.findall(rest))
            path = values[b"path"].decode("utf-8", "replace").lstrip("/") if b"path" in values else name
            if kind == b"object":
                inside, start = (name, values.get(b"id", b"")), tag.end()
                self.own[inside] = 0
            elif not ends:
                whose = self.items if kind == b"item" else self.made_of.setdefault(inside, [])
                whose.append((path, values.get(b"objectid", b"")))

    def triangles(self) -> int:
        return sum(self._triangles_of(item, 0) for item in self.items)

    def _triangles_of(self, key: Key, depth: int) -> int:
        if depth > 100:
            raise MalformedFileError("an object contains itself, or objects in over 100 nested levels")
        self.used.add(key)
        if key not in self._known:
            parts = sum(self._triangles_of(part, depth + 1) for part in self.made_of.get(key, ()))
            self._known[key] = self.own.get(key, 0) + parts
        return self._known[key]


def _models(data: bytes, budget: Budget) -> Iterator[tuple[str, bytes]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
            # compression shrinks numbers to a tenth, and repeated triangles to a hundredth
            if size > max(1 << 24, 60 * len(data)):
                raise MalformedFileError(f"it unpacks to {size / len(data):,.0f} times its size, more than any mesh")
            budget.require_bytes(size, "bytes once it is unpacked")
            for entry in packed.infolist():
                budget.require_time()
                text = packed.read(entry)
                if not entry.filename.lower().endswith(".model"):
                    continue
                if b"<!DOCTYPE" in text:
                    raise MalformedFileError("it declares a document type, which 3MF forbids")
                yield entry.filename, text
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, ValueError, NotImplementedError, RuntimeError) as error:
        if isinstance(error, MalformedFileError):
            raise
        raise MalformedFileError("it is not a ZIP archive, or it is damaged") from None
    except (OSError, zlib.error):
        raise MalformedFileError("dsfab cannot unpack a part of it") from None
