"""The words of a PDF file."""

import base64
import re
import zlib
from contextlib import suppress


def pdf_words(data: bytes) -> str:
    """The text of a PDF."""
    return " ".join(pdf_pages(data))


def pdf_pages(data: bytes) -> list[str]:
    """The text of each page: strings before Tj."""
    found = (re.findall(rb"\(((?:\\.|[^()\\])*)\) Tj", drawn) for drawn in pdf_drawings(data))
    return [_plain(b" ".join(words)) for words in found if words]


def pdf_drawings(data: bytes) -> list[bytes]:
    """The operators of each page, by a reader of a few lines: streams in base 85 and deflate."""
    drawings = []
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", data, re.DOTALL):
        with suppress(ValueError, zlib.error):
            drawings.append(zlib.decompress(base64.a85decode(b"<~" + stream.strip(), adobe=True)))
    return drawings


def _plain(plain: bytes) -> str:
    plain = re.sub(rb"\\([0-7]{3})", lambda match: bytes([int(match[1], 8)]), plain)
    return re.sub(r"\\(.)", r"\1", plain.decode("cp1252")).replace("\u00a0", " ")
