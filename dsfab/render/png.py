"""Pictures as PNG, in a file or in memory."""

import io
from pathlib import Path

from dsfab.render.scene import Bytes


def write_png(pixels: Bytes, path: Path, effort: int = 4) -> Path:
    """Write a picture, whole or not at all; returns its path. Raises ExportError for a file that cannot be written.

    effort : to make the file small, 1 to 9; 6 makes it a twentieth smaller than 4, in twice the time.
    """
    from PIL import Image

    from dsfab.export.atomic import replacing

    with replacing(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG", compress_level=effort)
    return path


def png(pixels: Bytes) -> bytes:
    """A picture as the bytes of a PNG file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
