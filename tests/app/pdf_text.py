"""The words of a PDF file."""

import base64
import re
import zlib


def pdf_words(data: bytes) -> str:
    """The text of a PDF."""
    return " ".join(pdf_pages(data))


def pdf_pages(data: bytes) -> list[str]:
    """The text of each page, by a reader of a few lines: streams in base 85 and deflate, strings before Tj."""
    pages = []
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", data, re.DOTALL):
        try:
            text = zlib.decompress(base64.a85decode(b"<~" + stream.strip(), adobe=True))
        except (ValueError, zlib.error):
            continue
        if found := re.findall(rb"\(((?:\\.|[^()\\])*)\) Tj", text):
            pages.append(_plain(b" ".join(found)))
    return pages


def _plain(plain: bytes) -> str:
    plain = re.sub(rb"\\([0-7]{3})", lambda match: bytes([int(match[1], 8)]), plain)
    return re.sub(r"\\(.)", r"\1", plain.decode("cp1252")).replace("\u00a0", " ")
