"""Support for all readers: limits on time and size, records of repairs, error messages, text lines and curves."""

import codecs
import logging
import re
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.core.units import UNIT_WORDS
from dsfab.surface.files.polygons import Polygons

DEFAULT_TRIANGLES = 4_000_000
"""Triangles of a file unless asked otherwise: twice what the whole line was ever tried with."""
BYTES_EACH = 500
"""Bytes of a file for each triangle: a text file with normals, textures and colours at every corner takes 350."""
VERTICES_EACH = 3
"""Vertices for each triangle: a soup has three."""
SECONDS_EACH = 6e-5
"""Seconds for each triangle: the slowest reader takes a sixth of it on one core of 2020."""
SMALLEST = 20.0
"""Seconds that any file may take."""


class MalformedFileError(ValueError):
    """What is wrong with the content of a file, in words for its user; `guard.readable` adds the file's name."""


@dataclass(frozen=True)
class Budget:
    """How much one file may take.

    triangles : most triangles that it may have.
    started   : when the reading began, seconds of the process's clock.
    """

    triangles: int = DEFAULT_TRIANGLES
    started: float = field(default_factory=time.monotonic)

    @property
    def bytes(self) -> int:
        """Most bytes of the file, and of what it is unpacked to."""
        return BYTES_EACH * self.triangles

    @property
    def seconds(self) -> float:
        """Most seconds."""
        return max(SMALLEST, SECONDS_EACH * self.triangles)

    def require_triangles(self, count: int) -> None:
        """Raise SurfaceError for more triangles than are accepted."""
        self._require(count, self.triangles, "triangles")

    def require_vertices(self, count: int, what: str = "vertices") -> None:
        """Raise SurfaceError for more vertices, or other records, than the accepted triangles can have."""
        self._require(count, VERTICES_EACH * self.triangles, what)

    def require_bytes(self, count: int, what: str = "bytes") -> None:
        """Raise SurfaceError for more bytes than a file of the accepted triangles has; `what` says of which kind."""
        self._require(count, self.bytes, what)

    def require_time(self) -> None:
        """Raise SurfaceError once the reading took too long."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading took more than {self.seconds:.0f} s; {_LIFT}")

    def _require(self, count: int, most: int, what: str) -> None:
        if count > most:
            raise SurfaceError(f"the file has {count:,} {what}, and {most:,} is the limit; {_LIFT}")


_LIFT = "make the mesh coarser, or allow more with --max-triangles N (surface.max_triangles in a preset)"
"""What to do about any of the limits."""


log = logging.getLogger(__name__)


@contextmanager
def readable(path: Path, smaller: str, damaged: str) -> Iterator[None]:
    """A file is read within this: whatever is raised there becomes a SurfaceError with a sentence.

    smaller : what to do where memory does not suffice.    damaged : what a foreign parser's error may mean.
    """
    kind = path.suffix[1:].upper()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of foreign parsers: what matters becomes a SurfaceError
            yield
    except SurfaceError as error:
        raise SurfaceError(f"{path}: {error}") from None
    except MalformedFileError as error:
        raise SurfaceError(f"{path} cannot be read as {kind} ({error}); export it again") from None
    except MemoryError:
        raise SurfaceError(f"{path} needs more memory than there is; {smaller}") from None
    except OSError as error:
        raise SurfaceError(f"{path} cannot be read ({error.strerror or 'the system says no more'})") from None
    except Exception:  # of a foreign parser: its words are no help to a person
        log.debug("reading %s", path, exc_info=True)
        raise SurfaceError(f"{path} cannot be read as {kind} ({damaged}); export it again") from None


@dataclass(frozen=True)
class FileRecord:
    """What became of the content of one file, a few words for each thing.

    read     : the format and what it holds; then what is doubtful about it.
    repaired : what is otherwise than in the file.
    dropped  : what the file has and the surface has not.
    """

    read: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()

    def also(self, repaired: tuple[str, ...] = (), dropped: tuple[str, ...] = ()) -> "FileRecord":
        """The record with more of what was repaired and dropped."""
        return replace(self, repaired=(*self.repaired, *repaired), dropped=(*self.dropped, *dropped))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know, a line each: all but the plain fact of what the file holds."""
        kinds = ("read", self.read[1:]), ("repaired", self.repaired), ("dropped", self.dropped)
        return tuple(f"{kind}: {text}" for kind, texts in kinds for text in texts)


NOTHING_READ = FileRecord()


@dataclass(frozen=True, eq=False)
class PolygonFile:
    """The polygons of a file, and remarks about the file.

    doubts : what is odd about it and may be a fault. dropped : what was passed over. unit : the one that its comments
    name. up : the axis that the program which wrote it has up, "y" or "z". None where they do not say.
    """

    mesh: Polygons
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    unit: str | None = None
    up: str | None = None


@dataclass(frozen=True, eq=False)
class TriangleFile:
    """Triangles of a file: vertices V (n, 3) in its unit and faces F (m, 3); and remarks as of a `PolygonFile`.

    unit : the one that the file declares, None if it does not say. metres : in one of it.
    """

    V: Floats
    F: Ints
    unit: str | None = None
    metres: float = 1.0
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


_MARKS = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with a byte order mark"),
    (codecs.BOM_UTF32_LE, "utf-32-le", "UTF-32 text"),  # before UTF-16, whose mark it begins with
    (codecs.BOM_UTF32_BE, "utf-32-be", "UTF-32 text"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16 text"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16 text"),
)
_UNIT = re.compile(rf"\bunits?\s*[:=]\s*[\"']?({'|'.join(UNIT_WORDS)})\b", re.IGNORECASE)
"""A comment that names one: '# File units = inches', 'comment unit: mm'."""
_PROGRAMS = re.compile(r"\b(?:(SketchUp|Blender|Rhino)|(FreeCAD|AutoCAD|Revit|dsfab))\b", re.IGNORECASE)
"""What have y up in the OBJ files that they write unasked, and what z."""
SAYING = 4096
"""Letters at the beginning of a file among which comments tell of it as a whole."""
BLOCK = 1 << 20
"""Letters that are made into lines together, between two looks at the clock."""


@dataclass(frozen=True)
class TextFile:
    """The text of a file with plain line ends, what is doubtful about it, and whether its last line has an end."""

    text: str
    doubts: tuple[str, ...]
    ended: bool

    def numbered(self, budget: Budget) -> Iterator[tuple[int, str]]:
        """Lines and their numbers from 1. Raises SurfaceError once reading takes too long."""
        number, at, text = 0, 0, self.text
        while at <= len(text):  # some lines at a time: a list of all takes several times the file
            end = text.find("\n", at + BLOCK)
            end = len(text) if end < 0 else end
            budget.require_time()
            for line in text[at:end].split("\n"):
                number += 1
                yield number, line
            at = end + 1

    def cut_off(self, last: str) -> tuple[str, ...]:
        """A doubt about a last line without an end, `last` being what it should be part of; none if it has one."""
        return () if self.ended else (f"the last line has no end: the file may be cut off within {last}",)


def may_lack_digits(word: str, count: int) -> bool:
    """Whether a whole number at the end of a file, which counts from 1 to `count`, may have lost its last digits: there
    are none with more unless ten times as many are counted."""
    if not (word.isascii() and word.isdigit()):
        return True
    return len(word) <= len(str(count)) and 10 * int(word) <= count  # Python reads no number of 5000 digits


def text_file(data: bytes) -> TextFile:
    """The text in `data`: UTF-8, or what a byte order mark or zeros between the letters say.

    Bytes that are no text become a sign that no number has. Raises MalformedFileError for UTF-16 that is cut off.
    """
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
        raise MalformedFileError(f"it is {doubt} with a part that is no text, or cut off") from None
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return TextFile(text, (doubt,) if doubt else (), text.endswith("\n") or not text.strip())


@dataclass(frozen=True)
class Said:
    """What comments at the beginning of a file say of its numbers; None where they do not.

    unit : a key of METRES_PER.    up : "y" or "z", which the program that wrote the file has up unasked.
    """

    unit: str | None = None
    up: str | None = None


def said_in_comments(text: str, marks: tuple[str, ...]) -> Said:
    """The unit and the vertical axis in comments at the beginning of a file, lines that begin with `marks`."""
    said = "\n".join(line for line in text[:SAYING].split("\n") if line.lstrip().startswith(marks))
    unit, program = _UNIT.search(said), _PROGRAMS.search(said)
    return Said(
        None if unit is None else UNIT_WORDS[unit[1].lower()],
        None if program is None else "y" if program[1] else "z",
    )


def float_of(word: str) -> float:
    """A number; raises ValueError for what Python alone takes for one (1_0)."""
    if "_" in word:
        raise ValueError
    return float(word)


def whole_number(word: str) -> int:
    """A whole number; raises ValueError for what Python alone takes for one (1_0)."""
    if "_" in word:
        raise ValueError
    return int(word)


FLAT = 2e-4
"""How far the sides of a polygon may be off the curve, as a share of the curve's size."""
FINEST = 1024
"""Points at most between two knots of a curve."""
LARGEST = 1e12
"""Larger numbers are no lengths and no angles, and some that foreign libraries count down from would take for ever."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What is drawn: layer and points (k, 3) of each curve, in the drawing's unit; the layers; the unit, if it says;
    layer and place (1, 3) of each point that is drawn."""

    runs: tuple[tuple[str, Floats], ...]
    layers: tuple[str, ...]
    unit: str | None
    points: tuple[tuple[str, Floats], ...] = ()


@dataclass(frozen=True)
class DrawingBudget:
    """How much a drawing of outlines may take: nobody draws doors and supports with more.

    bytes, entities (those of a block count each time that it is inserted), points of all curves, seconds; depth of
    blocks within blocks.  started : when the reading began, seconds of the process's clock.
    """

    bytes: int = 50_000_000
    entities: int = 50_000
    points: int = 2_000_000
    seconds: float = 60.0
    depth: int = 16
    started: float = field(default_factory=time.monotonic)

    def require(self, kind: str, count: int) -> None:
        """Raise SurfaceError for more of a kind ("bytes", "entities", "points") than accepted, or after too long."""
        if count > getattr(self, kind):
            raise SurfaceError(f"the drawing has {count:,} {kind}, and {getattr(self, kind):,} is the limit; {_APART}")
        self.require_time()

    def require_time(self) -> None:
        """Raise SurfaceError after too long."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading the drawing took more than {self.seconds:.0f} s; {_APART}")


_APART = "put the outlines into a drawing of their own"
"""What to do about any of the limits."""


def flattened(spans: Floats, at: Callable[[Floats], Floats]) -> Floats:
    """(k, 3) points `at` the ends of spans (s,) of a curve and at as many between as it takes to be within `FLAT`."""
    count = 4
    while True:
        t = np.interp(np.arange(2 * count * (len(spans) - 1) + 1) / (2 * count), np.arange(len(spans)), spans)
        points = at(t)
        off = np.linalg.norm(points[1::2] - (points[:-1:2] + points[2::2]) / 2, axis=1).max()
        if off <= FLAT * np.linalg.norm(np.ptp(points, axis=0)) or count >= FINEST:
            return np.asarray(points[::2])
        count *= 2
