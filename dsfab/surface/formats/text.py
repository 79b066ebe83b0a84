"""Bytes of a text file to lines, whatever program wrote them."""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass

from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.units import UNIT_WORDS

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
