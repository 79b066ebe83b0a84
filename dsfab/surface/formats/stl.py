"""STL files, binary and text: triangles without shared vertices."""

import re
import struct
from array import array

import numpy as np

from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.surface.formats.record import TriangleFile
from dsfab.surface.formats.text import text_file
from dsfab.surface.places import equal_merged
from dsfab.wording import counted

HEAD, EACH = 84, 50
"""Bytes of the header with the number of triangles behind it, and of each triangle."""
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = r"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rf"\s*facet(?:\s+normal\s+\S+\s+\S+\s+\S+)?\s+outer\s+loop\s+{3 * _VERTEX}endloop\s+endfacet(?=\s|$)",
    re.IGNORECASE,
)
_BETWEEN = re.compile(r"\s*(?:end\s*solid|solid)\b[^\n]*?(?=\n|\sfacet\s|\Z)", re.IGNORECASE)
CHUNK = 1 << 14
"""Triangles of a text file between two looks at the clock."""


def read_stl(data: bytes, budget: Budget) -> TriangleFile:
    """The triangles, corners at exactly the same place made one: they have the same bits everywhere.

    Many binary files begin with "solid" as those in text do, so the length decides.

    Raises MalformedFileError for a file that is cut off or neither, SurfaceError beyond the budget.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEAD else -1
    whole = HEAD + EACH * count
    looks_like_text = b"facet" in data[:2000].replace(b"\0", b"").lower() or len(data) < HEAD
    if count < 0 or (len(data) != whole and looks_like_text):
        return _text(data, budget)
    budget.require_triangles(count)
    if len(data) < whole:
        raise MalformedFileError(f"{count:,} triangles are announced, and it ends after {(len(data) - HEAD) // EACH:,}")
    soup = np.frombuffer(data, _RECORD, count, HEAD)["corners"].astype(np.float64)
    more = len(data) - whole
    dropped = (f"{counted(more, 'byte')} after the last triangle",) if more else ()
    return TriangleFile(*equal_merged(soup.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), dropped=dropped)


def _text(data: bytes, budget: Budget) -> TriangleFile:
    file = text_file(data)
    text, at, numbers, ended = file.text.rstrip(), 0, array("d"), False
    head = _BETWEEN.match(text)
    if head is None or not text.lstrip()[:5].lower() == "solid":
        raise MalformedFileError("it is neither text that begins with 'solid' nor as long as its binary header says")
    at = head.end()
    while at < len(text):
        if found := _FACET.match(text, at):
            ended = False
            try:
                numbers.extend(map(_number, found.groups()))
            except ValueError:
                raise MalformedFileError(
                    f"line {_line(text, at)} and those after it hold a number that is none"
                ) from None
            if len(numbers) % (9 * CHUNK) == 0:
                budget.require_time()
                budget.require_triangles(len(numbers) // 9)
        elif found := _BETWEEN.match(text, at):
            ended = found.group().strip().lower().startswith("end")
        else:
            raise MalformedFileError(f"line {_line(text, at)} and those after it are no triangle")
        at = found.end()
    budget.require_triangles(len(numbers) // 9)
    doubts = file.doubts if ended else (*file.doubts, "the last line, endsolid, is missing: it may be cut off")
    V, F = equal_merged(np.array(numbers).reshape(-1, 3), np.arange(len(numbers) // 3).reshape(-1, 3))
    return TriangleFile(V, F, doubts=doubts)


def _number(word: str) -> float:
    if "_" in word:
        raise ValueError
    return float(word)


def _line(text: str, at: int) -> int:
    """The number, from 1, of the line of the first letter behind `at`."""
    return text.count("\n", 0, at) + text[at:].count("\n", 0, len(text) - at - len(text[at:].lstrip())) + 1
