"""IFC4 (ISO 16739) for building models: a roof of a plate for each piece, with its material, thickness and mass.

Lengths are in millimetres, areas, volumes and masses in m2, m3 and kg, and the file says so. Other programs show and
measure such elements but do not edit them. The text is written here, with identifiers that depend on names only;
ifcopenshell (extra `ifc`) reads it back.
"""

import importlib.util
import uuid
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.ifc_text import beginning, building, element, roof
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_mesh, differs
from dsfab.export.shells import solids_of
from dsfab.export.step_pieces import Numbered, piece_name
from dsfab.surface import signed_volume, total_area
from dsfab.units import MM_PER_M

MM2, MM3 = MM_PER_M**2, MM_PER_M**3
PLACE = uuid.uuid5(uuid.NAMESPACE_URL, "dsfab")
"""Identifiers are made from names within this space."""


def ready() -> None:
    """Raise ExportError if ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise ExportError('.ifc files need the library ifcopenshell; install it with: pip install "dsfab[ifc]"')


def prepare(part: Part) -> Part:
    """The part as it is: the text holds every digit that matters."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Project, site, building and roof, then a plate for each piece; the same part gives the same bytes."""
    shell, solids = solids_of(part)
    new, measures = Numbered(1), part.details.measures
    yield beginning(part.name, __version__).encode()
    naming = partial(identifier, part.name)
    at = building(new, part.name, part.details, naming)
    elements = []
    for i, shells in enumerate(solids):
        used, corner = np.unique(part.F[np.isin(shell, shells)], return_inverse=True)
        V, F = part.V[used], corner.reshape(-1, 3)
        amounts = {"NetVolume": signed_volume(V, F) / MM3, "NetSurfaceArea": total_area(V, F) / MM2}
        if measures.get("thickness", 0) > 0:
            amounts["Width"] = MM_PER_M * measures["thickness"]
        if "density" in measures:
            amounts["NetWeight"] = amounts["NetVolume"] * measures["density"]
        name = piece_name(part.name, i, len(solids))
        made = element(new, at, (name, i), (V, F + 1), amounts, naming)
        elements.append(made)
        yield from flushed(new)
    roof(new, at, part.name, elements, naming)
    yield from flushed(new)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def flushed(new: Numbered) -> Iterator[bytes]:
    yield "".join(new.text).encode("ascii")
    new.text.clear()


def identifier(name: str, what: str) -> str:
    """The 22 characters of an IFC identifier: a number of 128 bits in base 64."""
    value = uuid.uuid5(PLACE, f"{name}/{what}").int
    digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
    return "".join(digits[(value >> (6 * k)) & 63] for k in range(21, -1, -1))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: lengths in millimetres, every triangle, closed, the part's volume."""
    V, F = _arrays(millimetre_model(part, path))
    if not len(F):
        raise differs(part, "triangles", len(part.F), 0)
    return check_mesh(part, V, F)


def millimetre_model(part: Part, path: Path) -> Any:
    """A file as ifcopenshell reads it; raises ExportError unless it can, and finds lengths in millimetres."""
    import ifcopenshell
    import ifcopenshell.util.unit

    try:
        model = ifcopenshell.open(str(path))
        scale = ifcopenshell.util.unit.calculate_unit_scale(model)
    except Exception as error:  # whatever a reader of unknown files raises
        raise ExportError(f"ifcopenshell cannot read the IFC file of {part.name!r}: {error}") from error
    if abs(scale * MM_PER_M - 1) > 1e-9:
        raise ExportError(f"the IFC file of {part.name!r} does not read back in millimetres; write .step instead")
    return model


def _arrays(model: Any) -> tuple[Floats, Ints]:
    """All face sets as one mesh."""
    return joined_face_sets(model.by_type("IfcTriangulatedFaceSet"))


def joined_face_sets(items: Iterable[Any]) -> tuple[Floats, Ints]:
    """Face sets of ifcopenshell as one mesh, V (n, 3) and F (m, 3)."""
    points, faces, at = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in items:
        points.append(np.array(item.Coordinates.CoordList, dtype=np.float64))
        faces.append(np.array(item.CoordIndex, dtype=np.int64) - 1 + at)
        at += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)
