"""Tables of numbers as text, quickly: one format string for many rows."""

import re
from collections.abc import Iterator
from itertools import chain
from typing import Any

TRAILING_ZEROS = re.compile(r"(\.\d*?)0+(?=[,)])")
"""At the end of decimals: a quarter of a STEP file."""

_ROWS = 10_000
"""Rows per piece of text: enough to be quick, few enough to need no memory."""


def rows(template: str, *columns: Any) -> Iterator[str]:
    """`template % row` for every row of the columns (equally long sequences), in pieces of many rows."""
    for start in range(0, len(columns[0]), _ROWS):
        sliced = [column[start : start + _ROWS] for column in columns]
        pieces = [piece.tolist() if hasattr(piece, "tolist") else piece for piece in sliced]  # all at once is gigabytes
        yield (template * len(pieces[0])) % tuple(chain.from_iterable(zip(*pieces, strict=True)))


def listed_rows(template: str, *columns: Any) -> Iterator[str]:
    """As `rows`, for a list of numbers inside brackets: without the comma at its end, and no zeros after decimals."""
    before = ""
    for text in rows(template, *columns):
        if before:
            yield before
        before = TRAILING_ZEROS.sub(r"\1", text)
    yield before.rstrip(",\n")


def one_line(name: str) -> str:
    """A name without line breaks and other control characters."""
    return "".join(c if c.isprintable() else " " for c in name).strip() or "part"
