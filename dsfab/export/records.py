"""JSON: lines with what they are, for scripts. Lengths are in millimetres; the file says so."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dsfab import __version__
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_lines, with_lines


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it has no lines."""
    return with_lines(part, ".json")


def encode(part: Part) -> Iterator[bytes]:
    """One object; a line of text per line, coordinates to 1e-6 mm."""
    head = {
        "name": part.name,
        "program": f"dsfab {__version__}",
        "unit": "millimetre",
        "tolerance": round(part.details.tolerance, 6),
    }
    yield (json.dumps(head, ensure_ascii=False)[:-1] + ', "lines": [\n').encode()
    last = len(part.details.lines) - 1
    for i, line in enumerate(part.details.lines):
        entry = {"id": line.id, "kind": line.kind, "family": line.family, "number": line.number, "part": line.part}
        entry |= {"closed": line.closed, "length": round(line.length, 6), "points": line.points.round(6).tolist()}
        yield (json.dumps(entry) + ("\n" if i == last else ",\n")).encode()
    yield b"]}\n"


def check(part: Part, path: Path) -> ReadBack:
    """Read back as a whole."""
    lines = json.loads(path.read_text(encoding="utf-8"))["lines"]
    return check_lines(part, [np.array(line["points"], dtype=np.float64) for line in lines])
