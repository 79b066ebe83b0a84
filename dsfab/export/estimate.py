"""What a STEP file will cost before it is written: faces, size, seconds to write and to open, memory of the receiver.

A STEP file of one face per triangle makes the program that opens it wait, not the one that writes it. Sizes are counted
from the entities that the writer would write, so they are right to a tenth; seconds and memory are of OCCT 8 on a busy
machine of two cores (`tests/benchmarks/formats.py` measures them), and other programs are slower rather than faster.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dsfab.errors import ExportError
from dsfab.export import step, tessellated
from dsfab.export.part import Part
from dsfab.export.planar import polyhedron
from dsfab.export.plate import outlines_of, plate
from dsfab.export.plate_text import plate_entities
from dsfab.export.shells import solids_of
from dsfab.export.simplify import simplified, usual_tolerance
from dsfab.export.smooth.make import drafted
from dsfab.export.step_text import FACETED_DIGITS, faceted_bytes

START = 3.0
"""Seconds that reading back takes at least: a process that imports build123d."""


@dataclass(frozen=True)
class Cost:
    """Per face: seconds to write and read back, seconds for another program to open it, bytes of memory for that."""

    write: float
    open: float
    memory: float


COSTS = {
    "planar": Cost(3e-3, 1e-3, 30e3),
    "smooth": Cost(8e-3, 4e-3, 30e3),
    "faceted": Cost(1e-3, 5e-4, 9e3),
    "tessellated": Cost(2e-5, 1e-5, 1e3),
}


@dataclass(frozen=True)
class Estimate:
    """One way to write the file.

    way           : planar, smooth, faceted, simplified (faceted after it), tessellated ...
    faces         : of the file; triangles for tessellated. 0 where the way cannot be taken.
    size, memory  : bytes.
    write_seconds : until it is written and read back.
    open_seconds  : for the program that opens it.
    note          : how far it is off, and what else one should know.
    refused       : why this way cannot be taken; "" if it can.
    chosen        : whether `write` would take it.
    """

    way: str
    faces: int = 0
    size: float = 0.0
    memory: float = 0.0
    write_seconds: float = 0.0
    open_seconds: float = 0.0
    note: str = ""
    refused: str = ""
    chosen: bool = False


def estimates(part: Part) -> tuple[Estimate, ...]:
    """What each way would cost for a prepared part, the best way first; the first that `part.step` allows is chosen.

    Nothing is written, and nothing is checked by OCCT: a way that is chosen here may still be refused for its result.
    """
    found = [_estimate(part, way, shape) for way, shape in WAYS.items() if way != "smooth" or part.curved is not None]
    allowed = {"planar", "smooth", "faceted", "simplified"} if part.step == "auto" else {part.step}
    allowed |= {"simplified"} if part.step == "faceted" and part.tolerance else set()
    order = ["planar", "smooth", "simplified", "faceted"] if part.tolerance else list(WAYS)
    best = next((way for way in order for e in found if e.way == way and way in allowed and not e.refused), None)
    return tuple(replace(one, chosen=one.way == best) for one in found)


def _estimate(part: Part, way: str, shape: Callable[[Part], tuple[int, float, str]]) -> Estimate:
    try:
        faces, size, note = shape(part)
    except ExportError as error:
        return Estimate(way, refused=str(error))
    cost = COSTS["faceted" if way == "simplified" else way]
    refused = next(over_budget(part, faces, size), "") if way != "tessellated" else ""
    start = START if way != "tessellated" else 0.0
    times = (start + cost.write * faces, cost.open * faces)
    return Estimate(way, faces, size, cost.memory * faces, *times, note, refused)


def over_budget(part: Part, faces: int, size: float) -> Iterator[str]:
    """Why the file would be too much: faces, or bytes."""
    if faces > part.step_faces:
        yield f"{faces:,} faces, more than step_faces = {part.step_faces:,}"
    if part.step_mb and size > 1e6 * part.step_mb:
        yield f"{size / 1e6:.3g} MB, more than step_mb = {part.step_mb:g}"


def _planar(part: Part) -> tuple[int, float, str]:
    tolerance = part.tolerance or step.default_tolerance(part)
    shape = plate(outlines_of(part), part.corners, tolerance)
    size = float(sum(len(text) for text in plate_entities(shape, part.name)))
    return shape.faces, size, f"its outline within {shape.deviation:.2g} mm of the mesh"


def _smooth(part: Part) -> tuple[int, float, str]:
    if default := step.default_tolerance(part):
        raise ExportError(f"a flat sheet is planar, within {default:.2g} mm")
    return (
        *drafted(replace(part, hurry=part.step == "auto")),
        "not checked yet: pieces that are refused will be faceted",
    )


def _faceted(part: Part) -> tuple[int, float, str]:
    shape = polyhedron(part.V, part.F, solids_of(part)[0])
    return len(shape.normals), faceted_bytes(shape), "no deviation"


def _simplified(part: Part) -> tuple[int, float, str]:
    simple = step.prepare(simplified(part, part.tolerance or usual_tolerance(part)))
    faces, size, _ = _faceted(simple)
    return faces, size, simple.note


def _tessellated(part: Part) -> tuple[int, float, str]:
    digits = np.log10(max(np.abs(part.V).max(), 1.0)) + FACETED_DIGITS + 2.5
    size = 1500 + 3 * (digits + 1) * len(part.V) + (3 * np.log10(len(part.V)) + 8) * len(part.F)
    return len(part.F), float(size), f"no deviation; only on request: {tessellated.WARNING}"


WAYS: dict[str, Callable[[Part], tuple[int, float, str]]] = {
    "planar": _planar,
    "smooth": _smooth,
    "faceted": _faceted,
    "simplified": _simplified,
    "tessellated": _tessellated,
}
"""For each way, the best first: faces, bytes and a note; ExportError where the way cannot be taken."""
