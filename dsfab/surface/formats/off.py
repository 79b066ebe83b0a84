"""OFF text files: vertices and polygons."""

from array import array
from collections.abc import Iterator

import numpy as np

from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.surface.formats.record import PolygonFile
from dsfab.surface.formats.text import float_of, may_lack_digits, said_in_comments, text_file, whole_number
from dsfab.surface.polygons import Polygons
from dsfab.wording import counted

KINDS = {"OFF", "COFF", "NOFF", "CNOFF", "NCOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"}
"""First words of files with three coordinates, with what follows them: colours, normals, textures."""


def read_off(data: bytes, budget: Budget) -> PolygonFile:
    """Vertices and faces; colours, normals and textures are passed over.

    Raises MalformedFileError for a file that is no OFF file or ends too soon, SurfaceError beyond the budget.
    """
    file = text_file(data)
    lines = ((number, words) for number, line in file.numbered(budget) if (words := line.split("#")[0].split()))
    n, m = _sizes(lines)
    budget.require_vertices(n)
    budget.require_triangles(m)
    V, corners, sizes = array("d"), array("q"), array("q")
    for kind, count in (("vertices", n), ("faces", m)):
        for done in range(count):
            number, words = next(lines, (0, []))
            if not words:
                raise MalformedFileError(f"{count:,} {kind} are announced, and it ends after {done:,}")
            try:
                if kind == "vertices":
                    V.extend([float_of(words[0]), float_of(words[1]), float_of(words[2])])
                else:
                    sizes.append(size := whole_number(words[0]))
                    corners.extend([whole_number(word) for word in words[1 : 1 + size]])
                    if size < 0 or len(words) < 1 + size:
                        raise ValueError
            except (ValueError, IndexError, OverflowError):
                raise MalformedFileError(f"line {number} cannot be read: {' '.join(words)[:60]!r}") from None
    more = sum(1 for _ in lines)
    bare = not more and m and len(words) == 1 + sizes[-1]  # no colour is behind its corners
    doubts = file.cut_off("a face") if bare and may_lack_digits(words[-1], n) else ()
    mesh = Polygons(np.array(V).reshape(-1, 3), np.array(corners), np.array(sizes))
    dropped = (f"{counted(more, 'line')} after the last face",) if more else ()
    return PolygonFile(mesh, (*file.doubts, *doubts), dropped, said_in_comments(file.text, ("#",)).unit)


def _sizes(lines: Iterator[tuple[int, list[str]]]) -> tuple[int, int]:
    """The numbers of vertices and of faces, on the first line behind OFF or on the next one."""
    _, words = next(lines, (0, [""]))
    if words[0].upper() not in KINDS:
        raise MalformedFileError("the first word is not OFF, or says that points have other than three coordinates")
    rest = words[1:] or next(lines, (0, []))[1]
    if [word.upper() for word in rest[:1]] == ["BINARY"]:
        raise MalformedFileError("it is binary, and dsfab reads the text form only")
    try:
        n, m = whole_number(rest[0]), whole_number(rest[1])
        if n < 0 or m < 0:
            raise ValueError
    except (ValueError, IndexError):
        raise MalformedFileError("the numbers of vertices and faces are missing") from None
    return n, m
