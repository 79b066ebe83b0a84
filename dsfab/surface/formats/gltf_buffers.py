"""The bytes of a glTF file, inside it, in its text or beside it, and the arrays in them."""

import base64
import binascii
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from dsfab.surface.formats.limits import Budget, MalformedFileError

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class Buffers:
    """The buffers that a file's JSON `tree` names; `binary` is the one in the file, `beside` reads one next to it."""

    tree: dict[str, Any]
    binary: bytes | None
    beside: Callable[[str], bytes] | None
    budget: Budget
    known: dict[int, bytes] = field(default_factory=dict)

    def view(self, number: int) -> tuple[bytes, int]:
        """The bytes of a view of a buffer, and how far its elements are apart, 0 if they follow each other.

        Raises MalformedFileError for one that reaches beyond its buffer.
        """
        view = self.tree["bufferViews"][number]
        start, length = _count(view.get("byteOffset", 0)), _count(view["byteLength"])
        data = self._buffer(_count(view["buffer"]))
        if start + length > len(data):
            raise MalformedFileError(
                f"it names bytes up to {start + length:,} of a buffer with {len(data):,}: it is cut off"
            )
        return data[start : start + length], _count(view.get("byteStride", 0))

    def _buffer(self, number: int) -> bytes:
        if number not in self.known:
            uri = self.tree["buffers"][number].get("uri")
            self.known[number] = self._content(uri)
            self.budget.require_bytes(sum(map(len, self.known.values())))
        return self.known[number]

    def _content(self, uri: Any) -> bytes:
        if uri is None:
            if self.binary is None:
                raise MalformedFileError("the part with its numbers is missing")
            return self.binary
        if not isinstance(uri, str):
            raise MalformedFileError("a buffer of it has no name")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise MalformedFileError("the numbers in its text are damaged") from None
        if self.beside is None or "://" in uri:
            raise MalformedFileError(f"its numbers are elsewhere ({uri[:60]}): export it as one file")
        return self.beside(unquote(uri))


def accessor(tree: dict[str, Any], buffers: Buffers, number: Any, width: int) -> NDArray[Any]:
    """(count, width) what an accessor of the file holds, whole numbers that stand for shares as shares.

    Raises MalformedFileError for one of another width or beyond its bytes, before memory is taken for it.
    """
    entry = tree["accessors"][_count(number)]
    count, kind = _count(entry["count"]), _TYPES.get(entry["componentType"])
    if kind is None or _WIDTHS.get(entry["type"]) != width:
        raise MalformedFileError("it has numbers of a type that glTF does not know there")
    buffers.budget.require_vertices(count)
    if "bufferView" in entry:
        values = _elements(buffers, entry, kind, count, width)
    else:
        values = np.zeros((count, width), dtype=kind)
    if "sparse" in entry:
        values = _with_sparse(buffers, entry["sparse"], values)
    if entry.get("normalized"):
        values = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return values


def _elements(buffers: Buffers, entry: dict[str, Any], kind: str, count: int, width: int) -> NDArray[Any]:
    """(count, width) elements from an offset in a view on."""
    data, stride = buffers.view(_count(entry["bufferView"]))
    start, each = _count(entry.get("byteOffset", 0)), np.dtype(kind).itemsize * width
    stride = stride or each
    if stride < each or (count and start + stride * (count - 1) + each > len(data)):
        raise MalformedFileError(
            f"{count:,} elements are announced that its bytes do not hold: it is damaged or cut off"
        )
    if not count:
        return np.zeros((0, width), dtype=kind)
    return np.ndarray((count, width), kind, data, start, (stride, np.dtype(kind).itemsize)).copy()


def _with_sparse(buffers: Buffers, sparse: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
    """Values (n, width) with those of some elements in place."""
    count, indices = _count(sparse["count"]), sparse["indices"]
    kind = _TYPES.get(indices["componentType"])
    if kind is None or count > len(values):
        raise MalformedFileError("it replaces more elements than there are")
    at = _elements(buffers, indices, kind, count, 1).ravel().astype(np.int64)
    if count and not 0 <= at.min() <= at.max() < len(values):
        raise MalformedFileError("it replaces elements that are not there")
    values[at] = _elements(buffers, sparse["values"], values.dtype.str, count, values.shape[1])
    return values


def _count(value: Any) -> int:
    """A whole number from 0 on."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise MalformedFileError("a number of its JSON is negative or none")
    return value
