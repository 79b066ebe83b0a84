"""Reader of OBJ and OFF files."""

import re
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from dsfab.core.messages import count_phrase
from dsfab.surface.files.polygons import Polygons
from dsfab.surface.files.reading import (
    Budget,
    Content,
    MalformedFileError,
    PolygonFile,
    TextFile,
    contents,
    declarations_in_comments,
    float_of,
    may_lack_digits,
    selected_parts,
    text_file,
    whole_number,
)

_IGNORED_SHAPES = {"l": "line", "p": "point", "curv": "curve", "curv2": "curve", "surf": "free-form surface"}
"""First words of OBJ lines with shapes that dsfab does not read, and the names of these shapes."""
_IGNORED_WORDS = frozenset(
    "vt vn vp s mg usemtl mtllib usemap maplib shadow_obj trace_obj bevel c_interp d_interp lod call csh "  # noqa: SIM905
    "cstype deg bmat step parm trim hole scrv sp end con ctech stech".split()
)
"""First words of OBJ lines that do not change polygons, or that belong to free-form curves and surfaces."""
_NUMBERS = {3, 4, 6, 7}  # Numbers per vertex: 3 coordinates, optional weight (1) and colour (3).
_COMMENT = re.compile(r"^([^\S\n]*#[^\n]*)\\$", re.MULTILINE)  # A comment ending with a backslash.
_DIVIDED = re.compile(r"[^\s\\]\\\n(?=\S)")  # A backslash at the end of a line, with no space beside it.
_DECIMAL_COMMA = re.compile(r"\d,\d")  # A number with a decimal comma.
LINES_PER_CHECK = 1 << 14  # Number of lines between two checks of the counts of vertices and faces.


def read_obj(data: bytes, budget: Budget, only: Sequence[str] = ()) -> PolygonFile:
    """Return the vertices and faces of an OBJ file, and the numbers of all other shapes in the file.
    only : names of the objects and groups to read; by default all.
    Raises MalformedFileError for a line that cannot be read, SurfaceError above the limits of `budget`."""
    file = text_file(data)
    comments = declarations_in_comments(file.text, ("#",))
    if "\\\n" in file.text:
        file = TextFile(_join_lines(file.text), file.doubts, file.ended)
    V, corners, sizes = array("d"), array("q"), array("q")
    ignored: Counter[str] = Counter()
    current_names: dict[str, tuple[str, ...]] = {"o": ("",), "g": ("",)}
    groups: list[_Group] = [(0, ("",), ("",))]
    odd, last_words = "", [""]
    for number, line in file.numbered_lines(budget):
        words = line.split() if "#" not in line else line[: line.index("#")].split()
        if not words:
            continue
        if number % LINES_PER_CHECK == 0:
            budget.require_vertices(len(V) // 3)
            budget.require_triangles(len(sizes))
        last_words, word = words, words[0]
        try:
            if word == "v":
                _add_vertex(V, words, line)
            elif word == "f":
                _add_face(corners, sizes, words, len(V) // 3)
            elif word in ("g", "o"):
                current_names[word] = (" ".join(words[1:]), *(words[1:] if word == "g" else ()))
                groups.append((len(sizes), current_names[word], current_names["o" if word == "g" else "g"]))
            elif word not in _IGNORED_WORDS:
                ignored[word] += 1
                if not odd and word not in _IGNORED_SHAPES:
                    odd = f"line {number}: {line.strip()[:40]!r}"
        except (ValueError, IndexError):
            comma = ": numbers have decimal commas instead of decimal points" if _DECIMAL_COMMA.search(line) else ""
            raise MalformedFileError(f"line {number} cannot be read: {line.strip()[:60]!r}{comma}") from None
    budget.require_vertices(len(V) // 3)
    mesh = Polygons(np.array(V).reshape(-1, 3), np.array(corners), np.array(sizes))
    doubts = file.cut_off("a vertex") if last_words[0] == "v" else ()
    if last_words[0] == "f" and not file.ended and _may_be_cut(last_words[1:], max(sizes), len(V) // 3, file.text):
        doubts = file.cut_off("a face")
    inventory = Counter[Content]()
    mesh = _named_faces(mesh, groups, only, inventory)
    for shape, kind in _IGNORED_SHAPES.items():
        inventory[Content(kind, "dropped")] += ignored[shape]
    odd_lines = sum(count for word, count in ignored.items() if word not in _IGNORED_SHAPES)
    dropped = (f"{count_phrase(odd_lines, 'line')} of unknown kind (first: {odd})",) if odd_lines else ()
    return PolygonFile(mesh, (*file.doubts, *doubts), dropped, comments.unit, comments.up, contents(inventory))


_Group = tuple[int, tuple[str, ...], tuple[str, ...]]
"""A group of faces in an OBJ file: number of its first face, names of the group, and names of its object.
A group can have several names: the line `g roof tiles` gives two."""


def _named_faces(mesh: Polygons, groups: list[_Group], only: Sequence[str], counts: Counter[Content]) -> Polygons:
    ends = (*(start for start, _, _ in groups[1:]), len(mesh.sizes))
    runs = [(*group, end) for group, end in zip(groups, ends, strict=True) if group[0] < end]
    if only:
        runs = [*selected_parts((((*run[1], *run[2]), run) for run in runs), only, counts)]
        mesh = mesh.part(np.concatenate([np.arange(start, end) for start, _, _, end in runs]))
    counts[Content("group")] = len({names[0] for _, names, _, _ in runs} - {""})
    return mesh


def _may_be_cut(face: list[str], largest: int, count: int, text: str) -> bool:
    """Return True if the last face in an OBJ file may be incomplete, because the file is cut off.
    face : words of its corners.    largest : largest number of corners of a face.    count : number of vertices."""
    *other_corners, last_corner = (word.split("/") for word in face or [""])
    if len(face) < max(largest, 3) or len(last_corner) < len(other_corners[0]):
        return True
    if len(last_corner) > 1:
        count = len(re.findall(r"^\s*vt\s" if len(last_corner) == 2 else r"^\s*vn\s", text, re.MULTILINE))
    return may_lack_digits(last_corner[-1], count)


def _join_lines(text: str) -> str:
    text = _COMMENT.sub(r"\1 ", text)
    if cut := _DIVIDED.search(text):
        number = text.count("\n", 0, cut.end() - 1) + 1
        raise MalformedFileError(f"line {number} ends with a backslash, but the words around it run together")
    return text.replace("\\\n", " ")


def _add_vertex(V: "array[float]", words: list[str], line: str) -> None:
    if "_" in line or len(words) - 1 not in _NUMBERS:
        raise ValueError
    V.extend(map(float, words[1:4]))
    if len(words) > 4:
        list(map(float, words[4:]))  # a second vertex in a line raises ValueError


def _add_face(corners: "array[int]", sizes: "array[int]", words: list[str], count: int) -> None:
    sizes.append(len(words) - 1)
    for word in words[1:]:
        i = int(word.partition("/")[0] if "/" in word else word)
        corners.append(i - 1 if i > 0 else count + i if -count <= i < 0 else -1)


KINDS = {"OFF", "COFF", "NOFF", "CNOFF", "NCOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"}
"""First words of OFF files with three coordinates per vertex, with or without colours, normals and textures."""


def read_off(data: bytes, budget: Budget) -> PolygonFile:
    """Return the vertices and faces of an OFF file.
    Raises MalformedFileError for an incomplete file or another format, SurfaceError above the limits of `budget`."""
    file = text_file(data)
    lines = ((number, words) for number, line in file.numbered_lines(budget) if (words := line.split("#")[0].split()))
    n, m = _sizes(lines)
    budget.require_vertices(n)
    budget.require_triangles(m)
    V, corners, sizes = array("d"), array("q"), array("q")
    for kind, count in (("vertices", n), ("faces", m)):
        for count_read in range(count):
            number, words = next(lines, (0, []))
            if not words:
                raise MalformedFileError(f"the file announces {count:,} {kind}, but has only {count_read:,}")
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
    extra_lines = sum(1 for _ in lines)
    bare = not extra_lines and m and len(words) == 1 + sizes[-1]  # the last line has no colour after the corners
    doubts = file.cut_off("a face") if bare and may_lack_digits(words[-1], n) else ()
    mesh = Polygons(np.array(V).reshape(-1, 3), np.array(corners), np.array(sizes))
    dropped = (f"{count_phrase(extra_lines, 'line')} after the last face",) if extra_lines else ()
    return PolygonFile(mesh, (*file.doubts, *doubts), dropped, declarations_in_comments(file.text, ("#",)).unit)


def _sizes(lines: Iterator[tuple[int, list[str]]]) -> tuple[int, int]:
    _, words = next(lines, (0, [""]))
    if words[0].upper() not in KINDS:
        raise MalformedFileError("the first word of the file is not OFF, or the points do not have three coordinates")
    rest = words[1:] or next(lines, (0, []))[1]
    if [word.upper() for word in rest[:1]] == ["BINARY"]:
        raise MalformedFileError("the file is binary, but dsfab reads only the text form of OFF")
    try:
        n, m = whole_number(rest[0]), whole_number(rest[1])
        if n < 0 or m < 0:
            raise ValueError
    except (ValueError, IndexError):
        raise MalformedFileError("the numbers of vertices and faces are missing in the file") from None
    return n, m
