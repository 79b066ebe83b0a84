"""Tables of numbers as text, quickly: one format string for many rows."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

_ROWS = 10_000
"""Rows per piece of text: enough to be quick, few enough to need no memory."""


def rows(template: str, *columns: Any) -> Iterator[str]:
    """`template % row` for every row of the columns (equally long sequences), in pieces of many rows."""
    lists = [column.tolist() if hasattr(column, "tolist") else list(column) for column in columns]
    for start in range(0, len(lists[0]), _ROWS):
        pieces = [column[start : start + _ROWS] for column in lists]
        yield (template * len(pieces[0])) % tuple(chain.from_iterable(zip(*pieces, strict=True)))


def one_line(name: str) -> str:
    """A name without line breaks and other control characters."""
    return "".join(c if c.isprintable() else " " for c in name).strip() or "part"
