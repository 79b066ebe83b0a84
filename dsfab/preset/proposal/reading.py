"""Read the user's mesh in metres with z up, with the decisions about its unit, vertical axis and repairs."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dsfab.core.arrays import Floats, polygon_perimeter
from dsfab.core.errors import SurfaceError
from dsfab.core.messages import coordinates, length
from dsfab.core.units import metres_per
from dsfab.surface import (
    DEFAULT_TRIANGLES,
    RawMesh,
    Surface,
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

CLEAR_IN = {".3mf": np.inf, ".3dm": np.inf, ".dxf": np.inf, ".glb": np.inf, ".gltf": np.inf}
"""Least lead of the score of axis y over that of z, by suffix of the file. It is 0.5 for formats that mostly have z up.
It is infinite where the format or program defines the vertical axis (z for glTF, whose axes the reader turns)."""
CLEAR_IN |= dict.fromkeys((".stl", ".step", ".stp", ".brep"), 0.5)

SLICE = 0.05
"""Share of the height that counts as the bottom, or as the top, of a surface."""
SOLE = 0.03
"""A surface stands on its vertices within this share of the height above its lowest point."""
GROUND = 1e-3
"""Vertices nearer to the plane through the origin than this share of the surface's size touch the plane."""


def likely_up(surface: Surface, suffix: str = "", usual: str | None = None) -> Up:
    """Return the likely vertical axis: y or -y if the surface clearly stands better on it (Blender, web tools), else z.

    suffix : suffix of the file, with the dot; some formats need a clearer result for y, see `CLEAR_IN`.
    usual  : "y" or "z", the vertical axis of the program that wrote the file; None if unknown.

    Three criteria judge an open surface: its area in plan, the length of its boundary at the bottom minus that at the
    top, and its stability. Stability alone judges a closed surface. Surfaces that end in level rings, such as a tower
    or a bowl, have z up. -y is possible only for surfaces that reach below y = 0. A wall has no area in plan. If a wall
    stands on the ground with a long edge, its axis is z, or y for programs with y up."""
    if usual == "z" or _ends_in_level_rings(surface) or _stands_on_ground(surface, "z"):
        return "z"
    if usual == "y" and _stands_on_ground(surface, "y"):
        return "y"
    below = surface.V[:, 1].min() < -GROUND * surface.size  # -y up is possible
    axes: tuple[Up, ...] = ("y", "-y") if below else ("y",)
    score = {axis: _standing(surface, axis) for axis in axes}
    best_axis = max(axes, key=lambda axis: score[axis])
    return best_axis if score[best_axis] > _standing(surface, "z") + CLEAR_IN.get(suffix.lower(), 0.1) else "z"


def _stands_on_ground(surface: Surface, up: Up) -> bool:
    """Return True for a wall or screen that stands with a long edge on the plane through the origin.
    With a wrong vertical axis its face would cross or touch that plane. A roof with y up is above y = 0."""
    V = upright_vertices(surface.V, up)
    level, y = V[:, 2], V[:, 1]  # y: coordinate along the other possible vertical axis
    limit = GROUND * surface.size
    if abs(level.min()) > limit or not (y.min() < -limit < limit < y.max() or np.ptp(y) < limit):
        return False
    ends = surface.edges.ends[surface.edges.boundary]
    on_ground = (np.abs(level[ends]) <= limit).all(axis=1)
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    return bool(length[on_ground].sum() > 0.7 * np.ptp(V[:, 0]))


def _ends_in_level_rings(surface: Surface) -> bool:
    if is_nearly_closed(surface):
        return False
    flat = SLICE * float(np.ptp(surface.V[:, 2]))
    rings = [surface.V[loop] for loop in surface.loops]
    length = np.array([polygon_perimeter(ring) for ring in rings])
    level = np.array([np.ptp(ring[:, 2]) <= flat for ring in rings])
    return bool(length[level].sum() > 0.8 * length.sum())  # the rest are edges of doors and windows


def _standing(surface: Surface, up: Up) -> float:
    """Return the score of a surface with the axis `up`: 0 to 2 for an open one, -0.2 to 0.4 for a closed one."""
    V = upright_vertices(surface.V, up)
    stability = _stability(V, surface)
    if is_nearly_closed(surface):
        return stability
    plan = float(surface.areas @ np.abs(surface.normals[:, "xyz".index(up[-1])]) / surface.area)
    ends = surface.edges.ends[surface.edges.boundary]
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    z = V[ends, 2].mean(axis=1)
    low, high = V[:, 2].min(), V[:, 2].max()
    bottom = length[z < low + SLICE * (high - low)].sum()
    top = length[z > high - SLICE * (high - low)].sum()
    return plan + float((bottom - top) / length.sum()) + 0.5 * stability


def is_nearly_closed(surface: Surface) -> bool:
    """Return True if the surface has no boundary except pinholes."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() < 0.02 * np.sqrt(surface.area))


def _stability(V: Floats, surface: Surface) -> float:
    """Return the distance of the centre of mass from the edge of the base, divided by the root of the surface's area.
    V : (n, 3) vertices with z up. The result is between -0.2 (the surface falls over) and 0.4."""
    base_points = V[V[:, 2] <= V[:, 2].min() + SOLE * np.ptp(V[:, 2]), :2]
    middle = surface.areas @ V[surface.F, :2].mean(axis=1) / surface.area
    try:
        plane = ConvexHull(base_points).equations  # a point is inside if all equations are negative
    except (QhullError, ValueError):
        return -0.2  # the base is a point or a line
    inside = -(plane[:, :2] @ middle + plane[:, 2]).max()
    return float(np.clip(inside / np.sqrt(surface.area), -0.2, 0.4))


UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe", "æ": "ae"}
)
SMALLEST, LARGEST = 0.02, 1000.0
"""Limits of the longest side (m) of a surface; outside of them its unit is doubtful."""
USUAL = 2.0, 100.0
"""Usual longest side (m). For a file of another size without a unit, dsfab lists the sizes in several units."""
POSSIBLE = 0.2, 500.0
"""Longest side (m) of the sizes in several units that `dsfab inspect` lists."""
GUESSED = ("mm", "cm", "m", "in", "ft")
"""Possible units of files without a unit."""


@dataclass(frozen=True)
class Decision:
    """A decision of dsfab for the user's preset.
    topic  : one or two words.
    choice : the choice and its reason.
    change : the key of the preset, or the option of the command, that changes the choice."""

    topic: str
    choice: str
    change: str = ""


@dataclass(frozen=True, eq=False)
class UserMesh:
    """The user's mesh as a surface (metres, z up), with its keys of [surface]. repaired : texts about its repairs."""

    surface: Surface
    name: str
    keys: dict[str, Any]
    decisions: tuple[Decision, ...]
    repaired: tuple[str, ...] = ()


def mesh_in_file(
    path: Path, unit: str | None, up: Up | None, max_triangles: int | None = None, raw: RawMesh | None = None
) -> UserMesh:
    """Return the mesh in a file; by default dsfab guesses its unit and vertical axis.
    max_triangles : limit for the file. raw : content of the file, if the caller has read it.
    Raises SurfaceError for an unreadable file, and for a mesh that is not a sheet even after repair."""
    raw = raw or raw_mesh(path, max_triangles or DEFAULT_TRIANGLES)
    finite_faces(path, raw)
    unit_is_given, unit = unit is not None, unit or unit_guess(raw)
    keys: dict[str, Any] = {"file": str(path), "unit": unit}
    if max_triangles is not None:
        keys["max_triangles"] = max_triangles
    scan = is_scan(raw.V, raw.F)
    better = mended_raw_mesh(raw, scan, unit)
    mends = better.record.repaired[len(raw.record.repaired) :]
    file_surface = surface_of_file(path, better, unit)
    surface = file_surface.surface
    unit_is_known = raw.unit is not None or unit_is_given
    unit_words = f"{unit}{', as the file says' if raw.unit == unit else ''}: it is {_box(surface)}"
    doubt = size_doubt(np.ptp(surface.V, axis=0).tolist(), unit)
    unit_words += doubt or ("" if unit_is_known else _alternative_units(surface, unit))
    decisions = [Decision("unit", unit_words, "surface.unit, or --unit cm")]
    for remark in raw.record.remarks:
        decisions.append(Decision("file", remark))
    if mends:
        key = "repair" if scan else "mend"
        keys[key] = True
        decisions.append(Decision("mended", ("as a raw scan: " if scan else "") + "; ".join(mends), f"surface.{key}"))
    for remark in file_surface.record.repaired[len(better.record.repaired) :]:
        decisions.append(Decision("file", f"repaired: {remark}"))
    decisions += [Decision("sheets", remark) for remark in parallel_remarks(surface.V, surface.F)]
    surface, up, turned = _with_z_up(surface, up, path.suffix, raw.up)
    if up != "z":
        keys["up"] = up
    decisions.append(turned)
    origin = _origin(surface)
    if any(origin):
        keys["origin"] = list(origin)
        surface = Surface(surface.V - origin, surface.F)
        where = f"{coordinates(origin)} m of the file"
        why = "it lies so far away that other programs have too few digits; move what is written back by that"
        decisions.append(Decision("origin", f"{where}: {why}", "surface.origin"))
    return UserMesh(surface, preset_name(path), keys, tuple(decisions), file_surface.record.repaired)


def preset_name(mesh: str | Path) -> str:
    """Return a preset's name for a mesh file, in letters without accents; an umlaut becomes two letters."""
    stem = unicodedata.normalize("NFC", Path(mesh).stem).translate(UMLAUTS)
    stem = "".join(letter for letter in unicodedata.normalize("NFKD", stem) if not unicodedata.combining(letter))
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", stem).strip("_.-") or "mesh"


def mesh_in_memory(mesh: Any, unit: str | None, up: Up | None) -> UserMesh:
    """Return a mesh from Python: a `Surface`, or an object that `Surface.of` takes; metres by default.
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
    surface, _, turned = _with_z_up(surface, up)
    return UserMesh(surface, "roof", {"mesh": surface}, (*decisions, turned))


def _with_z_up(
    surface: Surface, up: Up | None, suffix: str = "", usual: str | None = None
) -> tuple[Surface, Up, Decision]:
    guess = likely_up(surface, suffix, usual) if up is None else up
    turned = surface if guess == "z" else Surface(upright_vertices(surface.V, guess), surface.F)
    other_axis = "y" if guess == "z" else "z"
    change = f"surface.up, or --up {other_axis}"
    if up is not None:
        return turned, guess, Decision("up", f"{up}, as you say", change)
    if guess != "z":
        lies = f"with z up it would lie on its side or back; {guess} is taken for the vertical axis"
        return turned, guess, Decision("up", lies, change)
    low, _, high = np.sort(np.ptp(turned.V, axis=0))
    stands = np.ptp(turned.V[:, 2]) == high and high > 1.5 * low
    words = f"z; it stands upright, {length(high)} high: if it should lie, another axis is up" if stands else "z"
    return turned, guess, Decision("up", words, change)


def _origin(surface: Surface) -> tuple[float, ...]:
    """Return an origin in whole metres near the lowest corner of a surface; 0 for coordinates not far from 0."""
    low = surface.V.min(axis=0)
    # at a distance of 100 times the size, STL files round coordinates to 1/100 000 of the size (single precision)
    is_far = np.abs(surface.V).max(axis=0) > 100.0 * surface.size
    return tuple(np.where(is_far, np.floor(low), 0.0).tolist())


def size_doubt(sides: Sequence[float], unit: str) -> str:
    """Return a doubt about the unit if the sides of the box (m) are unusual, else ''."""
    if SMALLEST <= max(sides) <= LARGEST:
        return ""
    doubt = f"far {'larger' if max(sides) > LARGEST else 'smaller'} than what is built; is that the file's unit?"
    return f" ({'; '.join([doubt, *sizes_in_other_units(sides, unit, USUAL)])})"


def _alternative_units(surface: Surface, unit: str) -> str:
    sides = np.ptp(surface.V, axis=0).tolist()
    alternatives = [] if USUAL[0] <= max(sides) <= USUAL[1] else sizes_in_other_units(sides, unit, USUAL)
    return f" (the file does not say; {'; '.join(alternatives)})" if alternatives else ""


def sizes_in_other_units(sides: Sequence[float], unit: str, between: tuple[float, float] = POSSIBLE) -> list[str]:
    """Return '--unit in: 8 m x 6 m x 3 m' for each unit in which the longest side (m) is in the range `between` (m)."""
    metres = {name: metres_per(name) / metres_per(unit) for name in GUESSED if name != unit}
    return [
        f"--unit {name}: {' x '.join(length(times * side) for side in sides)}"
        for name, times in metres.items()
        if between[0] <= times * max(sides) <= between[1]
    ]


def _box(surface: Surface) -> str:
    return " x ".join(length(float(side)) for side in np.ptp(surface.V, axis=0))


def vertical_axis(up: str | None) -> Up | None:
    """Return the axis, or None if the user gave none; raises SurfaceError for words other than x, y, z, -x, -y, -z."""
    for axis in get_args(Up):
        if axis == up:
            result: Up = axis
            return result
    if up is not None:
        raise SurfaceError(f"up = {up!r} is not an axis; use one of {', '.join(get_args(Up))}")
    return None
