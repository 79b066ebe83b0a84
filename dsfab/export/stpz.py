"""Compressed STEP, .stpz: a zip with the STEP file in it, as the CAx Implementor Forum recommends (2013).

The file inside is the one of `.step`, in the same ways and within the same budget; a program that does not know the
suffix finds it by unpacking.
"""

import io
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.export import step
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack
from dsfab.export.text import one_line

LEVEL = 6
"""Of deflate: 9 takes five times as long for 2 % less."""
_BEGINNING_OF_ZIP = (1980, 1, 1, 0, 0, 0)


def encode(part: Part) -> Iterator[bytes]:
    """The zip; its one entry bears the part's name."""
    package = io.BytesIO()
    entry = zipfile.ZipInfo(f"{one_line(part.name).replace('/', '-')}.stp", _BEGINNING_OF_ZIP)
    entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 0
    with zipfile.ZipFile(package, "w", compresslevel=LEVEL) as archive, archive.open(entry, "w") as file:
        for chunk in step.encode(part):
            file.write(chunk)
    yield package.getvalue()


def check(part: Part, path: Path) -> ReadBack:
    """Unpacked, its checksum found right, and read back as STEP is."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder, zipfile.ZipFile(path) as archive:
        if len(archive.namelist()) != 1 or archive.testzip() is not None:
            raise ExportError(f"the compressed STEP file of {part.name!r} does not unpack; write .step instead")
        unpacked = Path(folder) / "a.step"
        unpacked.write_bytes(archive.read(archive.namelist()[0]))
        return step.check(part, unpacked)
