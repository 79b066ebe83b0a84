"""Functions that all readers of mesh and drawing files share: limits, messages, text files, units."""

import codecs
import difflib
import logging
import re
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import MOST_TRIANGLES
from dsfab.core.messages import count_phrase, names_and_count
from dsfab.core.units import UNIT_WORDS
from dsfab.surface.files.polygons import Polygons

DEFAULT_TRIANGLES = MOST_TRIANGLES  # Default limit on a file's triangles, the same as for meshes that dsfab creates.


class MalformedFileError(ValueError):
    """Error in the content of a file. The message is written for the user."""


@dataclass(frozen=True)
class Budget:
    """Limits for reading a file. triangles : largest number.    started : start of reading (monotonic clock, s)."""

    triangles: int = DEFAULT_TRIANGLES
    started: float = field(default_factory=time.monotonic)

    @property
    def bytes(self) -> int:
        """Largest size of the file, bytes, also after decompression."""
        return 500 * self.triangles

    @property
    def seconds(self) -> float:
        """Time limit for reading, seconds."""
        return max(20.0, 6e-5 * self.triangles)

    def require_triangles(self, count: int) -> None:
        """Raise SurfaceError if `count` is above the limit on triangles."""
        self._require(count, self.triangles, "triangles")

    def require_vertices(self, count: int, what: str = "vertices") -> None:
        """Raise SurfaceError if `count` is above three times the limit on triangles. what : noun for the message."""
        self._require(count, 3 * self.triangles, what)

    def require_bytes(self, count: int, what: str = "bytes") -> None:
        """Raise SurfaceError if `count` is above the limit on bytes. what : noun for the message."""
        self._require(count, self.bytes, what)

    def require_time(self) -> None:
        """Raise SurfaceError if reading has taken longer than the time limit."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading took more than {self.seconds:.0f} s; {_LIFT}")

    def _require(self, count: int, limit: int, what: str) -> None:
        if count > limit:
            raise SurfaceError(f"the file has {count:,} {what}, but {limit:,} is the limit; {_LIFT}")


_LIFT = "make the mesh coarser, or raise the limits with --max-triangles N (surface.max_triangles in a preset)"
"""End of the error messages about the limits of `Budget`: advice for the user."""


log = logging.getLogger(__name__)


@contextmanager
def readable(path: Path, smaller: str, damaged: str) -> Iterator[None]:
    """Convert any exception in the `with` block to a SurfaceError with a message for the user.
    smaller : advice in the message if memory is too small.    damaged : probable cause in the message otherwise."""
    kind = path.suffix[1:].upper()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # ignore warnings of parsers; real faults become a SurfaceError
            yield
    except SurfaceError as error:
        raise SurfaceError(f"{path}: {error}") from None
    except MalformedFileError as error:
        raise SurfaceError(f"{path} cannot be read as {kind} ({error}); export the file again") from None
    except MemoryError:
        raise SurfaceError(f"{path} needs more memory than this machine has; {smaller}") from None
    except OSError as error:
        raise SurfaceError(f"{path} cannot be read ({error.strerror or 'the system gives no reason'})") from None
    except Exception:  # the message of a parser does not help the user
        log.debug("reading %s", path, exc_info=True)
        raise SurfaceError(f"{path} cannot be read as {kind} ({damaged}); export the file again") from None


@dataclass(frozen=True)
class Content:
    """Number of objects of a kind in a file, and their use by dsfab.
    kind  : name of the kind, such as "mesh", "curve" or "hidden object".
    fate  : "taken": part of the surface. "marks": support, load or region. "beside": ignored, no part of a surface.
            "dropped": ignored, although the user may expect these objects in the surface.
    about : words for messages after the kind, such as a layer or a reason."""

    kind: str
    fate: Literal["taken", "marks", "beside", "dropped"] = "taken"
    about: str = ""
    count: int = 1

    @property
    def text(self) -> str:
        """Text with the number and the kind, such as `2 hidden objects on layer 'old'`."""
        return f"{count_phrase(self.count, self.kind)} {self.about}".rstrip()


def hidden_on(layer: str) -> Content:
    """Return the `Content` entry for an object that the file hides. layer : its layer; "" in files without layers."""
    return Content("hidden object", "dropped", f"on layer {layer!r}" if layer else "")


MARK_LAYERS = ("support", "load", "keep", "void")
"""Names of layers. Points and curves on these layers are supports, loads and regions of a design."""
_OTHER_NAMES = {
    "support": ("auflager", "lager", "stuetze", "stütze", "stützen", "appui", "appuis", "apoyo", "apoyos", "appoggi"),
    "load": ("last", "lasten", "charge", "charges", "carga", "cargas", "carichi"),
    "void": ("opening", "openings", "öffnung", "öffnungen", "hole", "holes", "loch"),
}
"""Other names that users may give to the layers of `MARK_LAYERS`, also in other languages."""


ALIKE = 0.85
"""Smallest similarity (difflib) of a misspelt layer name: "supports" counts as "support", not "upload" as "load"."""


def mark(kind: str, layer: str) -> Content:
    """Return the `Content` entry for an object on a layer. kind : name of the object's kind, such as "curve"."""
    if layer.lower() in MARK_LAYERS:
        return Content(kind, "marks" if kind in ("curve", "point") else "beside", f"on layer {layer!r}")
    matches = (_mark_layer(word) for word in re.findall(r"[^\W\d_]+", layer.lower()))
    if (match := next(filter(None, matches), "")) and kind in ("curve", "point"):
        return Content(kind, "dropped", f"on layer {layer!r}; did you mean layer {match}?")
    return Content(kind, "beside")


def _mark_layer(word: str) -> str:
    match = next((name for name, words in _OTHER_NAMES.items() if word in words), "")
    return match or "".join(difflib.get_close_matches(word, MARK_LAYERS, 1, ALIKE))


def contents(counts: Counter[Content]) -> tuple[Content, ...]:
    """Return the list of a file's content. counts : number of the objects of each kind."""
    shown = {thing: count for thing, count in counts.items() if count}
    for kind, start, plural in (("hidden object", "on layer ", "on {} layers"), (UNSELECTED, "of ", "of {} names")):
        similar = [thing for thing in shown if thing.kind == kind]
        if len(similar) > MANY_LAYERS:
            words = f"{plural.format(len(similar))}, first {similar[0].about.removeprefix(start)}"
            shown[replace(similar[0], about=words)] = sum(shown.pop(thing) for thing in similar)
    return tuple(replace(thing, count=count) for thing, count in shown.items())


def ignored_clause(texts: Iterable[str]) -> str:
    """Return the end of an error message: descriptions of the objects in a file that were ignored."""
    return "".join(f"; ignored: {text}" for text in texts)


MANY_LAYERS = 5  # If objects are hidden on more layers than this, one line reports them all.
UNSELECTED = "unselected part"  # Kind of the parts that the user did not name.
Part = TypeVar("Part")


def selected_parts(
    parts: Iterable[tuple[Sequence[str], Part]], only: Sequence[str], counts: Counter[Content]
) -> Iterator[Part]:
    """Yield the parts of a file that the user names in `only`; an empty `only` selects all parts.
    parts : the names of each part, and the part.    counts : counter to which the omitted parts are added.
    Raises SurfaceError for a name that no part has."""
    if not only:
        yield from (part for _, part in parts)
        return
    named = [([name for name in names if name], part) for names, part in parts]
    names_in_file = [*dict.fromkeys(name for names, _ in named for name in names)]
    selected = {_name_in_file(name, names_in_file) for name in only}
    for names, part in named:
        if selected.isdisjoint(names):
            counts[Content(UNSELECTED, "dropped", f"of {names[0]!r}" if names else "without a name")] += 1
        else:
            yield part


def _name_in_file(name: str, names: list[str]) -> str:
    matches = [match for match in names if match.lower() == name.lower()]
    if name in matches or len(matches) == 1:
        return name if name in matches else matches[0]
    if matches:
        raise SurfaceError(
            f"the name {name!r} may mean {' or '.join(map(repr, matches))}; write one of these names exactly"
        )
    if not names:
        raise SurfaceError(f"no visible part has the name {name!r}; the parts have no names: leave out {ONLY_OPTION}")
    likeness = {match: difflib.SequenceMatcher(None, match.lower(), name.lower()).ratio() for match in names}
    nearest = names_and_count(sorted(names, key=lambda match: -likeness[match]), 8)
    raise SurfaceError(
        f"no visible part has the name {name!r}; the names are {nearest}: choose one name with {ONLY_OPTION}"
    )


ONLY_OPTION = "--only (surface.only in a preset)"


@dataclass(frozen=True)
class FileRecord:
    """Messages about the content of a file.
    read     : format and content, then possible faults.    repaired : differences between the surface and the file.
    dropped  : content that is not part of the surface.    content : list of the file's content."""

    read: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    content: tuple[Content, ...] = ()

    def also(self, repaired: tuple[str, ...] = (), dropped: tuple[str, ...] = ()) -> "FileRecord":
        """Return the record with messages about further repairs and dropped parts."""
        return replace(self, repaired=(*self.repaired, *repaired), dropped=(*self.dropped, *dropped))

    @property
    def surface_words(self) -> str:
        """Text about the objects that form the surface, such as '2 meshes, 4 block insertions'."""
        things = [thing for thing in self.content if thing.fate == "taken"]
        return ", ".join(thing.text for thing in things) if {thing.kind for thing in things} - {"face"} else ""

    @property
    def mark_words(self) -> str:
        """Text about objects that mark supports, loads and regions, such as `2 curves on layer 'support'`."""
        return ", ".join(thing.text for thing in self.content if thing.fate == "marks")

    @property
    def other_words(self) -> str:
        """Text about ignored objects that cannot be part of a surface, such as '2 curves, 1 point'."""
        return ", ".join(thing.text for thing in self.content if thing.fate == "beside")

    @property
    def remarks(self) -> tuple[str, ...]:
        """Lines with all messages for the user, except the first message in `read`."""
        kinds = ("read", self.read[1:]), ("repaired", self.repaired), ("dropped", self.dropped)
        return tuple(f"{kind}: {text}" for kind, texts in kinds for text in texts)


NOTHING_READ = FileRecord()


@dataclass(frozen=True, eq=False)
class PolygonFile:
    """The polygons in a file.
    doubts  : messages about likely faults.    dropped : messages about ignored parts.    unit : unit in comments.
    up      : vertical axis, "y" or "z", that is usual in the program that wrote the file; None if unknown.
    content : list of the file's content."""

    mesh: Polygons
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    unit: str | None = None
    up: str | None = None
    content: tuple[Content, ...] = ()


@dataclass(frozen=True, eq=False)
class TriangleFile:
    """The triangles in a file: vertices V (n, 3) in the file's unit, and faces F (m, 3).
    unit    : unit that the file declares, or None.    doubts : messages about likely faults.
    dropped : messages about ignored parts.            content : list of the file's content."""

    V: Floats
    F: Ints
    unit: str | None = None
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    content: tuple[Content, ...] = ()


def declared_unit(word: str) -> str | None:
    """Return the unit that a word such as 'Yards' names; None for "unitless"; an unknown word in lower case."""
    lower = word.lower()
    return None if lower in ("none", "unset", "unitless") else UNIT_WORDS.get(lower, lower)


def is_mirrored(place: Floats) -> bool:
    """Return True if a transformation matrix `place` (4, 4) mirrors, so that faces turn inside out."""
    return bool(np.linalg.det(place[:3, :3]) < 0)


def placed_points(points: Floats, place: Floats) -> Floats:
    """Return points (n, 3), moved by the transformation matrix `place` (4, 4)."""
    return np.asarray(points @ place[:3, :3].T + place[:3, 3]) if (place != np.eye(4)).any() else points


def mesh_at(V: Floats, F: Ints, place: Floats) -> tuple[Floats, Ints]:
    """Return a mesh, moved by the transformation matrix `place` (4, 4). Mirrored faces are reversed."""
    return placed_points(V, place), F[:, ::-1] if is_mirrored(place) else F


_MARKS = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with a byte order mark"),
    (codecs.BOM_UTF32_LE, "utf-32-le", "UTF-32 text"),  # the mark of UTF-32 begins with the mark of UTF-16
    (codecs.BOM_UTF32_BE, "utf-32-be", "UTF-32 text"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16 text"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16 text"),
)
_UNIT = re.compile(rf"\bunits?\s*[:=]\s*[\"']?({'|'.join(UNIT_WORDS)})\b", re.IGNORECASE)
"""Pattern of a comment with a known unit, such as '# File units = inches' or 'comment unit: mm'."""
_FILE_UNIT = re.compile(r"\bfile units?\s*=\s*[\"']?([^\W\d_]+)", re.IGNORECASE)
"""Pattern of the comment in which programs declare a unit. It also finds units that dsfab does not know."""
_PROGRAMS = re.compile(r"\b(?:(SketchUp|Blender|Rhino)|(FreeCAD|AutoCAD|Revit|dsfab))\b", re.IGNORECASE)
"""Pattern with names of programs that write OBJ files. First group: y is up by default. Second group: z is up."""

BLOCK = 1 << 20  # Number of characters that are split into lines between two checks of the time.


@dataclass(frozen=True)
class TextFile:
    """The text in a file, with a line feed at the end of each line.
    doubts : messages about likely faults.    ended : True if the last line is complete."""

    text: str
    doubts: tuple[str, ...]
    ended: bool

    def numbered_lines(self, budget: Budget) -> Iterator[tuple[int, str]]:
        """Yield the number (from 1) and the text of each line. Raises SurfaceError if reading takes too long."""
        number, position, text = 0, 0, self.text
        while position <= len(text):  # blocks save memory, because a list of all lines is large
            end = text.find("\n", position + BLOCK)
            end = len(text) if end < 0 else end
            budget.require_time()
            for line in text[position:end].split("\n"):
                number += 1
                yield number, line
            position = end + 1

    def cut_off(self, part: str) -> tuple[str, ...]:
        """Return a message if the last line is incomplete, else (). part : words for the incomplete part ("a face")."""
        return () if self.ended else (f"the last line is incomplete: the file may be cut off within {part}",)


def may_lack_digits(word: str, count: int) -> bool:
    """Return True if an index at the end of a cut-off file may lack its last digits. count : largest possible index."""
    if not (word.isascii() and word.isdigit()):
        return True
    return len(word) <= len(str(count)) and 10 * int(word) <= count  # int() fails for words with 5000 digits


def text_file(data: bytes) -> TextFile:
    """Return the text that the bytes of a file encode. Raises MalformedFileError for invalid UTF-16 or UTF-32."""
    encoding, doubt, skipped = "utf-8", "", 0
    for mark, name, word in _MARKS:
        if data.startswith(mark):
            encoding, doubt, skipped = name, word, len(mark)
            break
    else:
        even, odd = data[:200:2].count(0), data[1:200:2].count(0)
        if max(even, odd) > 10 * max(min(even, odd), 1):
            encoding, doubt = ("utf-16-be" if even > odd else "utf-16-le"), "UTF-16 text without a byte order mark"
    try:
        text = data[skipped:].decode(encoding, errors="replace" if encoding == "utf-8" else "strict")
    except UnicodeDecodeError:
        raise MalformedFileError(f"the file is {doubt}, but a part of the text is damaged or missing") from None
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return TextFile(text, (doubt,) if doubt else (), text.endswith("\n") or not text.strip())


@dataclass(frozen=True)
class CommentDeclarations:
    """Declarations in comments at the beginning of a file; None if missing.
    unit : a key of METRES_PER, or an unknown unit.
    up   : vertical axis, "y" or "z", that is usual in the program that wrote the file."""

    unit: str | None = None
    up: str | None = None


def declarations_in_comments(text: str, marks: tuple[str, ...]) -> CommentDeclarations:
    """Return unit and vertical axis from comments at a file's beginning. marks : starts of comments, such as "#"."""
    comments = "\n".join(line for line in text[:4096].split("\n") if line.lstrip().startswith(marks))
    unit, program = _UNIT.search(comments) or _FILE_UNIT.search(comments), _PROGRAMS.search(comments)
    return CommentDeclarations(
        None if unit is None else declared_unit(unit[1]), None if program is None else "y" if program[1] else "z"
    )


def float_of(word: str) -> float:
    """Return the number that a word contains. Raises ValueError for other words."""
    if "_" in word:
        raise ValueError
    return float(word)


def whole_number(word: str) -> int:
    """Return the whole number that a word contains. Raises ValueError for other words."""
    if "_" in word:
        raise ValueError
    return int(word)


CURVE_TOLERANCE = 2e-4  # Largest distance of a polygon from its curve, divided by the curve's size.
LARGEST_NUMBER = 1e12  # Largest number in a drawing; libraries may loop endlessly on larger numbers.


FAR = 100.0  # A mesh is far from the origin if a coordinate exceeds this times the mesh's largest dimension.
DIGITS = 6  # Default number of digits with which C and C++ programs, such as gmsh, write coordinates.
COARSE_STEP, LARGEST_STEP = 0.02, 0.5
"""Limits of the step to which coordinates are rounded, divided by the mean edge length.
dsfab warns of steps above COARSE_STEP. It refuses a file with steps above LARGEST_STEP, because faces may turn over."""


def number_steps(V: Floats, F: Ints, unit: str | None = None) -> tuple[float, str]:
    """Return the largest step to which coordinates V (n, 3) of faces F (m, 3) are rounded, divided by the mean edge.
    Return also a message about the step. For a small step, return 0 and "". unit : unit of V."""
    P = V[F].reshape(-1, 3)
    largest = np.abs(P).max(axis=0)
    if not np.isfinite(largest).all() or largest.max() <= FAR * np.ptp(P, axis=0).max():
        return 0.0, ""
    tens = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(P), 1e-300))) + 1 - DIGITS)
    if (P.astype(np.float32) == P).all():
        step, why = np.spacing(largest.astype(np.float32)).astype(np.float64), "32-bit numbers"
        step *= (P % (2 * step)).any(axis=0)  # 0 if all of an axis's coordinates are multiples of 2 * step
    elif (np.abs(P / tens - np.rint(P / tens)) < 1e-6).all():
        step, why = tens.max(axis=0), f"{DIGITS} digits"
    else:
        return 0.0, ""
    edges, k = V[F] - V[np.roll(F, 1, axis=1)], int(step.argmax())
    edge = float(np.linalg.norm(edges, axis=2).mean())
    if step[k] <= COARSE_STEP * edge:
        return 0.0, ""
    of_step, of_edge = (f"{size:.2g} {unit or ''}".strip() for size in (step[k], edge))
    text = (
        f"coordinate {'xyz'[k]} has steps of {of_step} in this file ({why}), but the mean edge length is {of_edge}: "
        f"export the mesh near the origin"
    )
    return float(step[k]) / max(edge, 1e-300), text


@dataclass(frozen=True, eq=False)
class Drawing:
    """Content of a drawing, in the drawing's unit.
    runs   : for each curve, its layer, its points (k, 3), and True if the file hides it.
    layers : names of all layers.    unit : unit of the file; None if missing or unknown.
    points : for each single point, its layer, its position (1, 3), and True if the file hides it."""

    runs: tuple[tuple[str, Floats, bool], ...]
    layers: tuple[str, ...]
    unit: str | None
    points: tuple[tuple[str, Floats, bool], ...] = ()


@dataclass(frozen=True)
class DrawingBudget:
    """Limits for reading a drawing: size (bytes), time (seconds), entities, points of all curves.
    depth   : largest number of nested blocks.    started : start time of reading (monotonic clock, s)."""

    bytes: int = 50_000_000
    entities: int = 50_000
    points: int = 2_000_000
    seconds: float = 60.0
    depth: int = 16
    started: float = field(default_factory=time.monotonic)

    def require(self, kind: str, count: int) -> None:
        """Raise SurfaceError if `count` of "bytes", "entities" or "points" (`kind`) is too large, or time is over."""
        if count > getattr(self, kind):
            raise SurfaceError(f"the drawing has {count:,} {kind}, but {getattr(self, kind):,} is the limit; {_APART}")
        self.require_time()

    def require_time(self) -> None:
        """Raise SurfaceError if reading has taken longer than `seconds`."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading the drawing took more than {self.seconds:.0f} s; {_APART}")


_APART = "put the outlines into a separate drawing"  # Remedy in the messages about the limits of `DrawingBudget`.


def curve_points(spans: Floats, curve: Callable[[Floats], Floats]) -> Floats:
    """Return points (k, 3) on a curve, so dense that their polyline is accurate to `CURVE_TOLERANCE`.
    spans : (s,) parameters at the ends of the curve's parts.    curve : function that maps parameters to points."""
    count = 4
    while True:
        t = np.interp(np.arange(2 * count * (len(spans) - 1) + 1) / (2 * count), np.arange(len(spans)), spans)
        points = curve(t)
        deviation = np.linalg.norm(points[1::2] - (points[:-1:2] + points[2::2]) / 2, axis=1).max()
        if deviation <= CURVE_TOLERANCE * np.linalg.norm(np.ptp(points, axis=0)) or count >= 1024:
            return np.asarray(points[::2])
        count *= 2
