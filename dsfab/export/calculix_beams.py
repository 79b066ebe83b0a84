"""CalculiX: the beam model as text, `NAME.beams.inp`, that `ccx NAME.beams` runs. Metres, newtons, pascals.

B32R has three nodes; CalculiX makes a solid of it (C3D20R), as wide along local y and as high along local z as the
beam, and joins those that meet in a node as a rigid knot: structures are a little stiffer than beams between points.
The total force that it prints is the reaction where nodes may turn; at clamped nodes it has moments in it.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.errors import ExportError
from dsfab.export.opensees import all_loads
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.saf import prepare, told
from dsfab.export.text import one_line, rows

__all__ = ["SUFFIX", "check", "encode", "prepare", "told"]

SUFFIX = ".beams.inp"
PIECES = 4
"""Elements of a beam: with one the solids are up to 17 % too stiff where beams meet at angles, with four up to 8 %."""
READ = 1e-9
"""Coordinates read back may be off by this share of the largest one."""


def encode(part: Part) -> Iterator[bytes]:
    """The file; the same part gives the same bytes."""
    for text in _cards(part.name, part.details.records):
        yield text.encode("ascii", "replace")


def check(part: Part, path: Path) -> ReadBack:
    """Read back card by card: as many beams, and nodes where they are."""
    cards = path.read_text(encoding="ascii").split("\n*")
    frame = part.details.records["frame"]
    beams = sum(card.startswith("ELEMENT, TYPE=B32R") for card in cards)
    if beams != PIECES * len(frame["ends"]):
        raise differs(part, "elements", PIECES * len(frame["ends"]), beams)
    lines = next(card for card in cards if card.startswith("NODE, NSET=ALL")).splitlines()[1:]
    found = np.array([line.split(",")[1:] for line in lines], dtype=np.float64)
    if not (np.abs(found - frame["points"]) <= READ * np.abs(frame["points"]).max()).all():
        raise ExportError(f"the nodes of {part.name!r} read back elsewhere; write saf in place of it")
    return ReadBack(beams, "elements")


def _cards(name: str, records: Mapping[str, Any]) -> Iterator[str]:
    frame, material = records["frame"], records["material"]
    points, ends, n = frame["points"], frame["ends"], len(frame["points"])
    yield f"** {one_line(name)}: {len(ends)} beams, written by dsfab {__version__}; metres, newtons, pascals\n"
    yield "** The total force of HELD is the reaction where nodes may turn; at clamped nodes moments are added to it\n"
    yield "*NODE, NSET=ALL\n"
    yield from rows("%d, %.11e, %.11e, %.11e\n", np.arange(1, n + 1), *points.T)
    yield "*NODE, NSET=BETWEEN\n"
    share = np.arange(1, 2 * PIECES)[:, None] / (2 * PIECES)
    between = np.concatenate([(1 - share) * points[i] + share * points[j] for i, j in ends])
    yield from rows("%d, %.11e, %.11e, %.11e\n", n + np.arange(1, len(between) + 1), *between.T)
    yield f"*MATERIAL, NAME=BEAMS\n*ELASTIC\n{material['young']:.12g}, {material['poisson']:.12g}\n"
    columns = zip(*(frame[key] for key in ("ends", "thickness", "width", "z", "member")), strict=True)
    for k, ((i, j), thickness, width, z, member) in enumerate(columns, 1):
        chain = [i + 1, *range(n + (k - 1) * (2 * PIECES - 1) + 1, n + k * (2 * PIECES - 1) + 1), j + 1]
        yield f"** {member or 'link'}\n"
        for piece in range(PIECES):
            nodes = ", ".join(map(str, chain[2 * piece : 2 * piece + 3]))
            yield f"*ELEMENT, TYPE=B32R, ELSET=B{k}\n{PIECES * (k - 1) + piece + 1}, {nodes}\n"
        yield f"*BEAM SECTION, ELSET=B{k}, MATERIAL=BEAMS, SECTION=RECT\n{thickness:.9g}, {width:.9g}\n"
        yield ", ".join(f"{value + 0.0:.9g}" for value in z) + "\n"
    yield f"*ELSET, ELSET=BEAMS, GENERATE\n1, {PIECES * len(ends)}\n"
    yield from _supports(frame)
    for case, load in all_loads(frame).items():
        yield from _step(case, load)


def _supports(frame: Mapping[str, Any]) -> Iterator[str]:
    held = np.flatnonzero(frame["fixed"].any(axis=1))
    yield "*NSET, NSET=HELD\n" + "".join(f"{k + 1}\n" for k in held)
    yield "*BOUNDARY\n"
    node, way = np.nonzero(frame["fixed"])
    yield from rows("%d, %d, %d\n", node + 1, way + 1, way + 1)
    count = PIECES * len(frame["ends"])
    for k, axis in np.argwhere(frame["spring"] > 0).tolist():
        count += 1
        yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING{count}\n{count}, {k + 1}\n"
        yield f"*SPRING, ELSET=SPRING{count}\n{axis + 1}\n{frame['spring'][k, axis]:.11e}\n"


def _step(case: str, load: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> Iterator[str]:
    yield f"** {one_line(case)}\n*STEP\n*STATIC\n*CLOAD, OP=NEW\n"
    node, way = np.nonzero(load)
    if len(node):
        yield from rows("%d, %d, %.11e\n", node + 1, way + 1, load[node, way])
    yield "*NODE PRINT, NSET=ALL\nU\n*NODE PRINT, NSET=HELD, TOTALS=ONLY\nRF\n"
    yield "*EL PRINT, ELSET=BEAMS, TOTALS=ONLY\nELSE\n*NODE FILE\nU\n*END STEP\n"
