"""Read the user's mesh, in metres with z up."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import coordinates, length
from dsfab.core.units import metres_per
from dsfab.preset.proposal.judgement import SupportChoice, choice
from dsfab.preset.proposal.loads import NO_WISHES, MeshWishes
from dsfab.preset.proposal.readings import SOLE, SupportPlace, soles
from dsfab.preset.proposal.shape import depth_within, is_figure
from dsfab.surface import (
    DEFAULT_TRIANGLES,
    RawMesh,
    Surface,
    SurfaceInFile,
    Up,
    finite_faces,
    is_scan,
    mended_mesh,
    mended_raw_mesh,
    parallel_remarks,
    raw_mesh,
    repaired_scan,
    surface_of_file,
    unit_guess,
    upright_vertices,
)

Z_UP = (".3mf", ".3dm", ".dxf", ".glb", ".gltf", ".ifc")
"""Suffixes of file formats in which z is vertical, always or usually. dsfab rotates glTF files when it reads them."""
MOSTLY_Z = (".stl", ".step", ".stp", ".brep")  # Suffixes of files in which z is mostly the vertical axis.
Y_UP = 0.7  # Factor on the scores of supports if y is the vertical axis; few programs use a vertical y axis.
GROUND = 1e-3  # Largest depth below y = 0 that counts as zero, divided by the size of the surface.


def possible_axes(surface: Surface, suffix: str = "", usual: str | None = None) -> dict[Up, float]:
    """Return the possible vertical axes of a surface, each with a factor on the scores of ways of support.
    suffix : suffix of the file, with the dot.
    usual  : "y" or "z", the vertical axis of the program that wrote the file; None if unknown."""
    y = Y_UP**2 if suffix.lower() in MOSTLY_Z else Y_UP
    if usual == "z" or suffix.lower() in Z_UP:
        return {"z": 1.0}
    below = surface.V[:, 1].min() < -GROUND * surface.size
    if is_figure(surface):
        clear = 0.5 if suffix.lower() in MOSTLY_Z else 0.1
        axes: tuple[Up, ...] = ("y", "-y") if below else ("y",)
        score = {axis: _standing(upright_vertices(surface.V, axis), surface) for axis in axes}
        stablest = max(axes, key=lambda axis: score[axis])
        return {stablest if score[stablest] > _standing(surface.V, surface) + clear else "z": 1.0}
    if usual == "y":
        return {"y": 1.0, "z": Y_UP}
    return {"z": 1.0, "y": y, "-y": y} if below else {"z": 1.0, "y": y}


def _standing(V: Floats, surface: Surface) -> float:
    edges = surface.edges
    low = (V[edges.ends, 2] <= V[:, 2].min() + 0.05 * np.ptp(V[:, 2])).all(axis=1)
    length = surface.edge_lengths * edges.boundary
    return _stability(V, surface) + float(length[low].sum() / max(length.sum(), 1e-12))


def _stability(V: Floats, surface: Surface) -> float:
    base_points = V[V[:, 2] <= V[:, 2].min() + SOLE * np.ptp(V[:, 2]), :2]
    middle = surface.areas @ V[surface.F, :2].mean(axis=1) / surface.area
    depth = depth_within(base_points, middle)
    if depth is None:
        return -0.2  # the lowest points lie on a line, or coincide
    return float(np.clip(depth / np.sqrt(surface.area), -0.2, 0.4))


UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe", "æ": "ae"}
)
SMALLEST, LARGEST = 0.02, 1000.0  # Range of a surface's longest side (m) in which dsfab does not doubt the unit.
USUAL = 2.0, 100.0  # Usual range of the longest side (m); outside of it, dsfab lists other units.
POSSIBLE = 0.2, 500.0  # Range of a surface's longest side (m) for the units that `dsfab inspect` lists.
UNLIKELY = 0.02  # Units with a smaller probability are not listed.
GUESSED = ("mm", "cm", "m", "in", "ft")  # Units that dsfab considers for files without a unit.


@dataclass(frozen=True)
class Decision:
    """A decision of dsfab for the user's preset. topic : one or two words.    choice : chosen value, with its reason.
    change : key of the preset, or option of the command, that changes the choice."""

    topic: str
    choice: str
    change: str = ""


@dataclass(frozen=True, eq=False)
class UserMesh:
    """The user's mesh as a surface (metres, z up). keys : of [surface].    choice : unit, vertical axis and supports.
    places   : supported parts, in coordinates of `surface`.    repaired : a sentence for each repair of the mesh."""

    surface: Surface
    name: str
    keys: dict[str, Any]
    decisions: tuple[Decision, ...]
    choice: SupportChoice
    places: tuple[SupportPlace, ...]
    repaired: tuple[str, ...] = ()


def mesh_in_file(
    path: Path,
    unit: str | None,
    up: Up | None,
    max_triangles: int | None = None,
    raw: RawMesh | None = None,
    wishes: MeshWishes = NO_WISHES,
) -> UserMesh:
    """Return the mesh in a file. unit, up : unit and vertical axis; None lets dsfab choose.    Raises SurfaceError.
    raw : content of the file, if known.    wishes : parts of the file and supports that the user wants."""
    raw = raw or raw_mesh(path, max_triangles or DEFAULT_TRIANGLES, unit, wishes.only)
    finite_faces(path, raw)
    scan, usual = is_scan(raw.V, raw.F), unit or unit_guess(raw)
    file_surface = surface_of_file(path, better := mended_raw_mesh(raw, scan, usual), usual)
    surface = file_surface.surface
    is_open = unit is None and raw.unit is None and not is_figure(surface)
    axes = {up: 1.0} if up else possible_axes(surface, path.suffix, raw.up)
    numbers = Surface(surface.V / metres_per(usual), surface.F) if is_open else surface
    chosen = choice(numbers, axes, "" if is_open else usual, wishes.stand)
    if chosen.unit != usual:
        file_surface = surface_of_file(path, better := mended_raw_mesh(raw, scan, chosen.unit), chosen.unit)
        surface = file_surface.surface
    only = {"only": [*wishes.only]} if wishes.only else {}
    keys: dict[str, Any] = {"file": str(path), "unit": chosen.unit} | only
    if max_triangles is not None:
        keys["max_triangles"] = max_triangles
    words = _unit_words(surface, chosen, raw.unit, unit)
    decisions = [
        Decision("unit", words, f"surface.unit, or --unit {'mm' if chosen.unit == 'cm' else 'cm'}"),
        *_file_decisions(raw, better, scan, file_surface),
    ]
    if len(better.record.repaired) > len(raw.record.repaired):
        keys["repair" if scan else "mend"] = True
    surface, turned = _with_z_up(surface, chosen, up)
    if chosen.best.up != "z":
        keys["up"] = chosen.best.up
    decisions.append(turned)
    origin = origin_near(surface)
    if any(origin):
        keys["origin"] = list(origin)
        surface = Surface(surface.V - origin, surface.F)
        where = f"{coordinates(origin)} m of the file"
        why = "programs round coordinates that are so far from the origin; to move output files back, add this vector"
        decisions.append(Decision("origin", f"{where}: {why}", "surface.origin"))
    places = _places(surface, chosen, np.array(origin))
    repaired = file_surface.record.repaired
    return UserMesh(surface, preset_name(path), keys, tuple(decisions), chosen, places, repaired)


def _file_decisions(raw: RawMesh, better: RawMesh, scan: bool, mesh: SurfaceInFile) -> Iterator[Decision]:
    if raw.record.surface_words:
        yield Decision("file", f"read: {raw.record.surface_words}")
    if raw.record.mark_words:
        yield Decision("file", f"marks: {raw.record.mark_words}")
    if raw.record.other_words:
        yield Decision("file", f"beside the surface: {raw.record.other_words}")
    yield from (Decision("file", remark) for remark in raw.record.remarks)
    if mends := better.record.repaired[len(raw.record.repaired) :]:
        words = ("as a raw scan: " if scan else "") + "; ".join(mends)
        yield Decision("mended", words, f"surface.{'repair' if scan else 'mend'}")
    for remark in mesh.record.repaired[len(better.record.repaired) :]:
        yield Decision("file", f"repaired: {remark}")
    yield from (Decision("sheets", remark) for remark in parallel_remarks(mesh.surface.V, mesh.surface.F))


def _places(surface: Surface, chosen: SupportChoice, origin: Floats) -> tuple[SupportPlace, ...]:
    reading = chosen.best.reading
    return soles(surface) if reading.word == "sole" else tuple(place.with_offset(origin) for place in reading.places)


def preset_name(mesh: str | Path) -> str:
    """Return a name for the preset of a mesh file, in letters without accents."""
    stem = unicodedata.normalize("NFC", Path(mesh).stem).translate(UMLAUTS)
    stem = "".join(letter for letter in unicodedata.normalize("NFKD", stem) if not unicodedata.combining(letter))
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", stem).strip("_.-") or "mesh"


def mesh_in_memory(mesh: Any, unit: str | None, up: Up | None, stand: str = "") -> UserMesh:
    """Return a mesh from Python. unit : default metres.    stand : name of a way of support, or "".
    Raises SurfaceError for an invalid mesh."""
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        surface = Surface.from_mesh(mesh[0], mesh[1], unit or "m")
    else:
        surface = Surface.of(mesh, unit)
    better = (repaired_scan if is_scan(surface.V, surface.F) else mended_mesh)(surface.V, surface.F)
    decisions = [Decision("unit", f"metres: it is {_box(surface)}", "the argument unit")]
    if better.repairs:
        surface = Surface.from_mesh(better.V, better.F)
        decisions.append(Decision("mended", "; ".join(better.repairs)))
    chosen = choice(surface, {up: 1.0} if up else possible_axes(surface), "m", stand)
    surface, turned = _with_z_up(surface, chosen, up)
    places = _places(surface, chosen, np.zeros(3))
    return UserMesh(surface, "roof", {"mesh": surface}, (*decisions, turned), chosen, places)


def _with_z_up(surface: Surface, chosen: SupportChoice, option: Up | None) -> tuple[Surface, Decision]:
    up = chosen.best.up
    turned = surface if up == "z" else Surface(upright_vertices(surface.V, up), surface.F)
    change = f"surface.up, or --up {'y' if up == 'z' else 'z'}"
    if option is not None:
        return turned, Decision("up", f"{up}, as you say", change)
    if up != "z":
        lies = f"{up}; if z pointed up, the surface would lie on its side or back"
        return turned, Decision("up", lies, change)
    low, _, high = np.sort(np.ptp(turned.V, axis=0))
    stands = np.ptp(turned.V[:, 2]) == high and high > 1.5 * low
    words = (
        f"z, so the surface stands {length(high)} high; choose another axis if the surface should lie flat"
        if stands
        else "z"
    )
    return turned, Decision("up", words, change)


def origin_near(surface: Surface) -> tuple[float, ...]:
    """Return a new origin (whole metres) near the lowest corner of a surface; 0 on axes with small coordinates."""
    low = surface.V.min(axis=0)
    # at such distances, single precision (STL) rounds coordinates to 1/100 000 of the size
    is_far = np.abs(surface.V).max(axis=0) > 100.0 * surface.size
    return tuple(np.where(is_far, np.floor(low), 0.0).tolist())


def size_doubt(sides: Sequence[float], unit: str) -> str:
    """Return a question about the unit of the surface if the longest of its sides (m) is unusual, else ''."""
    if SMALLEST <= max(sides) <= LARGEST:
        return ""
    doubt = (
        f"the surface is far {'larger' if max(sides) > LARGEST else 'smaller'} than usual structures; is the file's "
        f"unit right?"
    )
    return f" ({'; '.join([doubt, *sizes_in_other_units(sides, unit, USUAL)])})"


def _unit_words(surface: Surface, chosen: SupportChoice, declared: str | None, option: str | None) -> str:
    sides, unit = np.ptp(surface.V, axis=0).tolist(), chosen.unit
    words = f"{unit}{', as the file says' if declared == unit else ''}: it is {_box(surface)}"
    alternatives = sizes_in_other_units(sides, unit, USUAL)
    if chosen.units:
        likely = [f"--unit {name}:" for name, share in chosen.units[1:] if share > UNLIKELY]
        alternatives = [text for text in alternatives if text.startswith(tuple(likely))]
    elif USUAL[0] <= max(sides) <= USUAL[1] or declared or option:
        alternatives = []
    sizes = f" (the file names no unit; other possible units: {'; '.join(alternatives)})" if alternatives else ""
    return words + (size_doubt(sides, unit) or sizes)


def sizes_in_other_units(sides: Sequence[float], unit: str, between: tuple[float, float] = POSSIBLE) -> list[str]:
    """Return a text such as '--unit in: 8 m x 6 m x 3 m' for each other unit that is plausible. A unit is plausible if
    the longest side then lies within the range `between` (m)."""
    metres = {name: metres_per(name) / metres_per(unit) for name in GUESSED if name != unit}
    return [
        f"--unit {name}: {' x '.join(length(times * side) for side in sides)}"
        for name, times in metres.items()
        if between[0] <= times * max(sides) <= between[1]
    ]


def _box(surface: Surface) -> str:
    return " x ".join(length(float(side)) for side in np.ptp(surface.V, axis=0))


def vertical_axis(up: str | None) -> Up | None:
    """Return the axis with the name `up`, or None. Raises SurfaceError for an unknown name."""
    axes: tuple[Up, ...] = get_args(Up)
    if up is None or up in axes:
        return next((axis for axis in axes if axis == up), None)
    raise SurfaceError(f"up = {up!r} is not an axis; use one of {', '.join(axes)}")
