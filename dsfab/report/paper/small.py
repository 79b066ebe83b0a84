"""The page as one small file: its pictures in half the size, within it."""

import base64
import io
import re
from collections.abc import Sequence
from pathlib import Path

SMALL_NAME = "small.html"

QUALITY = 60
"""Of the pictures, in WebP's hundred."""

LINKED = re.compile(r'<a href="[\w.-]+\.webp">(<img[^>]*>)</a>')
PICTURE = re.compile(r'src="([\w.-]+\.(?:webp|svg))"')


def small_page(text: str, folders: Sequence[Path]) -> str:
    """A page with its pictures, of half as many pixels a side, in the text; they lead to no larger ones.

    text : the page whose pictures lie in one of the `folders`.
    """
    known: dict[str, str] = {}

    def inside(found: re.Match[str]) -> str:
        name = found.group(1)
        if name not in known:
            known[name] = _data(next(path for folder in folders if (path := folder / name).is_file()))
        return f'src="{known[name]}"'

    return PICTURE.sub(inside, LINKED.sub(r"\1", text))


def _data(path: Path) -> str:
    """A picture as an address that holds it; drawings keep every line."""
    if path.suffix == ".svg":
        return f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
    from PIL import Image

    buffer = io.BytesIO()
    with Image.open(path) as picture:
        size = max(picture.width // 2, 1), max(picture.height // 2, 1)
        half = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    half.save(buffer, format="WEBP", quality=QUALITY, method=6)
    return f"data:image/webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"
