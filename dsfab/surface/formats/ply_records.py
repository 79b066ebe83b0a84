"""The records of one element of a PLY file, of text or binary, to an array for each property."""

import re
import warnings
from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Floats, Ints
from dsfab.surface.formats.limits import Budget, MalformedFileError
from dsfab.surface.formats.text import float_of

CHUNK = 1 << 16
"""Records between two looks at the clock."""
BLOCK = 1 << 20
"""Bytes of text that are made into numbers together."""
_SPACE = re.compile(rb"\s")


@dataclass(frozen=True)
class PlyProperty:
    """One property of an element; a list has the type of its length in front."""

    name: str
    type: str
    length: str | None = None


@dataclass(frozen=True)
class PlyElement:
    """An element: what it is called, how many records of it there are, and what each holds."""

    name: str
    count: int
    properties: list[PlyProperty]

    @property
    def has_lists(self) -> bool:
        """Whether records may differ in length."""
        return any(one.length for one in self.properties)

    def cut_off(self) -> MalformedFileError:
        """What is said where a file has fewer records than announced."""
        return MalformedFileError(
            f"the file ends within the element {self.name!r}, of which {self.count:,} are announced"
        )


Columns = dict[str, Any]
"""Of each property an array (count,); of a list a pair: the values of all records (c,), and how many each has."""


def text_numbers(body: bytes) -> tuple[Floats, bool]:
    """(c,) all numbers of a text up to the first word that is none, and whether there is such a word."""
    parts, at, odd = [np.empty(0)], 0, False
    while at < len(body) and not odd:
        gap = _SPACE.search(body, at + BLOCK)
        end = gap.start() if gap else len(body)
        block, at = body[at:end].strip(), end
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # what numpy before 2.3 says of other words
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


def text_element(numbers: Floats, at: int, element: PlyElement, budget: Budget) -> tuple[Columns, int]:
    """The properties of an element whose records begin with number `at` of (c,), and where the next one begins.

    Raises MalformedFileError for a file that ends before, or has a word that is no number there.
    """
    if not element.properties or not element.count:
        return {p.name: _nothing(p) for p in element.properties}, at
    if element.count * len(element.properties) > len(numbers) - at:  # before anything is made of it
        raise element.cut_off()
    begins, counts, stop = _even(numbers, at, element) or _text_walk(numbers, at, element, budget)
    found: Columns = {}
    for i, p in enumerate(element.properties):
        found[p.name] = _as_column(p, numbers[_places(begins[:, i], counts[:, i], 1)], counts[:, i])
    return found, stop


def _even(numbers: Floats, at: int, element: PlyElement) -> tuple[Ints, Ints, int] | None:
    """(count, p) where each property of each record begins, how many values it has, and the end; None where lists
    differ in length from those of the first record."""
    start, sizes, lists, place = [], [], [], 0
    for p in element.properties:
        if p.length is not None:
            size = numbers[at + place] if at + place < len(numbers) else -1
            if not 0 <= size <= len(numbers):
                return None
            lists.append(place)
            place += 1
        start.append(place)
        sizes.append(int(size) if p.length is not None else 1)
        place += sizes[-1]
    stop = at + place * element.count
    if stop > len(numbers):
        return None
    table = numbers[at:stop].reshape(element.count, place)
    if any((table[:, k] != table[0, k]).any() for k in lists):
        return None
    first = at + place * np.arange(element.count)
    return first[:, None] + np.array(start), np.tile(np.array(sizes), (element.count, 1)), stop


def _text_walk(numbers: Floats, at: int, element: PlyElement, budget: Budget) -> tuple[Ints, Ints, int]:
    """The same record by record."""
    start, sizes = array("q"), array("q")
    for k in range(element.count):
        if k % CHUNK == 0:
            budget.require_time()
        for p in element.properties:
            size = 1
            if p.length is not None:
                told = numbers[at] if at < len(numbers) else -1.0
                size = int(told) if 0 <= told <= len(numbers) and told == int(told) else -1
                at += 1
            if size < 0 or at + size > len(numbers):
                raise element.cut_off()
            start.append(at)
            sizes.append(size)
            at += size
    begins, counts = (np.array(x, dtype=np.int64).reshape(element.count, -1) for x in (start, sizes))
    return begins, counts, at


def binary_element(body: bytes, at: int, element: PlyElement, order: str, budget: Budget) -> tuple[Columns, int]:
    """The same for binary, from byte `at`: at once if all lists are as long as the first record's, else one by one.

    order : '<' little endian, '>' big endian.
    """
    if not element.properties or not element.count:
        return {p.name: _nothing(p) for p in element.properties}, at
    least = sum(np.dtype(p.length or p.type).itemsize for p in element.properties)
    if element.count * least > len(body) - at:  # before anything is made of it
        raise element.cut_off()
    dtype, lists = _first_record(body, at, element, order)
    stop = at + dtype.itemsize * element.count
    if stop <= len(body):
        table = np.frombuffer(body, dtype, element.count, at)
        if all((table[f"length of {name}"] == size).all() for name, size in lists.items()):
            return {p.name: _column(p, table[p.name]) for p in element.properties}, stop
    begins, counts, at = _walk(body, at, element, order, budget)
    raw = np.frombuffer(body, np.uint8)

    found: Columns = {}
    for i, p in enumerate(element.properties):
        width = np.dtype(p.type).itemsize
        places = _places(begins[:, i], counts[:, i], width)
        found[p.name] = _as_column(
            p, raw[places[:, None] + np.arange(width)].view(order + p.type).ravel(), counts[:, i]
        )
    return found, at


def _first_record(body: bytes, at: int, element: PlyElement, order: str) -> tuple[np.dtype[Any], dict[str, int]]:
    """The type of the record that begins at byte `at`, and the lengths of its lists."""
    fields: list[tuple[Any, ...]] = []
    lists: dict[str, int] = {}
    for p in element.properties:
        if p.length is None:
            fields.append((p.name, order + p.type))
            continue
        width = np.dtype(p.length).itemsize
        start = at + np.dtype(fields).itemsize
        size = int(np.frombuffer(body, order + p.length, 1, start)[0]) if start + width <= len(body) else -1
        if size < 0 or size > len(body):
            raise element.cut_off()
        lists[p.name] = size
        fields += [(f"length of {p.name}", order + p.length), (p.name, order + p.type, (size,))]
    return np.dtype(fields), lists


def _walk(body: bytes, at: int, element: PlyElement, order: str, budget: Budget) -> tuple[Ints, Ints, int]:
    """(count, p) the byte at which each property of each record begins, how many values it has, and the end."""
    byte = "little" if order == "<" else "big"
    steps = [
        (
            np.dtype(p.length).itemsize if p.length else 0,
            np.dtype(p.type).itemsize,
            bool(p.length and p.length[0] == "i"),
        )
        for p in element.properties
    ]
    start, sizes = array("q"), array("q")
    for k in range(element.count):
        if k % CHUNK == 0:
            budget.require_time()
        for wide, width, signed in steps:
            size = int.from_bytes(body[at : at + wide], byte, signed=signed) if wide else 1  # type: ignore[arg-type]
            at += wide
            if size < 0 or at + size * width > len(body):
                raise element.cut_off()
            start.append(at)
            sizes.append(size)
            at += size * width
    begins, counts = (np.array(x, dtype=np.int64).reshape(element.count, -1) for x in (start, sizes))
    return begins, counts, at


def _places(begin: Ints, count: Ints, step: int) -> Ints:
    """(c,) where each value of one property is: `count` of them from `begin` on, `step` apart."""
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
