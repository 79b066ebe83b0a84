"""A mesh of the user in metres with z up, with the decisions on unit, vertical axis and repairs."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dsfab.core.arrays import Floats, closed_length
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
    mended,
    mended_raw,
    raw_mesh,
    repaired_scan,
    surface_of_file,
    twin_remarks,
    unit_guess,
    upright,
)

CLEAR = 0.1
"""By this much y has to look better than z before it is taken for the vertical axis."""
CLEAR_IN = {".3mf": np.inf, ".3dm": np.inf, ".dxf": np.inf, ".glb": np.inf, ".gltf": np.inf}
CLEAR_IN |= dict.fromkeys((".stl", ".step", ".stp", ".brep"), 0.5)
"""The same for files whose format or program says which axis is up (glTF's is z once it is read), and for those of
which most have z up: a bench and a facade were laid on their backs."""
SLICE = 0.05
"""Share of the height in which boundary counts as the bottom or the top."""
SOLE = 0.03
"""Share of the height over its lowest point in which vertices are what a surface stands on."""
PINHOLES = 0.02
"""Boundary shorter than this share of the side of a square of the same area makes no surface open."""
GROUND = 1e-3
"""Share of its size within which a surface touches the plane through the origin."""
LONG_EDGE = 0.7
"""Share of its length in plan along which a wall's edge is on the ground."""
RINGS = 0.8
"""Share of the boundary that has to lie in level rings, for a structure that stands on one or hangs from it; the rest
are doors and windows."""


def likely_up(surface: Surface, suffix: str = "", usual: str | None = None) -> Up:
    """z; or y, or -y, where the surface plainly stands better that way up, as files of Blender and web tools may.

    suffix : of its file, with the dot; files of some formats have z up: see `CLEAR_IN`.
    usual  : "y" or "z", which the program that wrote the file has up unasked; None where that is not known.

    An open surface is judged by how much of it a plan shows, by how much more of its boundary lies at its bottom than
    at its top, and by how well it stands; a closed one by how well it stands alone. What ends in level rings, as a
    tower, a vase or a bowl does, has z up. What has y over 0 everywhere has not -y up. A wall shows nothing in plan,
    and would always be laid on its back: what stands on the ground with a long edge has z up, or y where its program
    has.
    """
    if usual == "z" or _ends_in_level_rings(surface) or _stands_on_ground(surface, "z"):
        return "z"
    if usual == "y" and _stands_on_ground(surface, "y"):
        return "y"
    below = surface.V[:, 1].min() < -GROUND * surface.size  # else -y would put all of it under the ground
    others: tuple[Up, ...] = ("y", "-y") if below else ("y",)
    score = {axis: _standing(surface, axis) for axis in others}
    best = max(others, key=lambda axis: score[axis])
    return best if score[best] > _standing(surface, "z") + CLEAR_IN.get(suffix.lower(), CLEAR) else "z"


def _stands_on_ground(surface: Surface, up: Up) -> bool:
    """Whether it stands on the plane through the origin with a long edge, and its face is drawn about that plane, not
    on it, with the other axis up: as a wall is, or a screen.

    A roof with y up stands on y = 0, or is above it: there is none of it under that plane.
    """
    V = upright(surface.V, up)
    level, through = V[:, 2], V[:, 1]  # the other axis of the two
    near = GROUND * surface.size
    if abs(level.min()) > near or not (through.min() < -near < near < through.max() or np.ptp(through) < near):
        return False
    ends = surface.edges.ends[surface.edges.boundary]
    on = (np.abs(level[ends]) <= near).all(axis=1)
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    return bool(length[on].sum() > LONG_EDGE * np.ptp(V[:, 0]))


def _ends_in_level_rings(surface: Surface) -> bool:
    """Whether nearly all of its boundary are closed lines that are level with z up."""
    if is_nearly_closed(surface):
        return False
    flat = SLICE * float(np.ptp(surface.V[:, 2]))
    rings = [surface.V[loop] for loop in surface.loops]
    length = np.array([closed_length(ring) for ring in rings])
    level = np.array([np.ptp(ring[:, 2]) <= flat for ring in rings])
    return bool(length[level].sum() > RINGS * length.sum())


def _standing(surface: Surface, up: Up) -> float:
    """How well a surface stands with that axis up; about 0 to 2 of an open one, -0.2 to 0.4 of a closed one."""
    V = upright(surface.V, up)
    stability = _stability(V, surface)
    if is_nearly_closed(surface):
        return stability
    k = "xyz".index(up[-1])
    plan = float(surface.areas @ np.abs(surface.normals[:, k]) / surface.area)
    ends = surface.edges.ends[surface.edges.boundary]
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    z = V[ends, 2].mean(axis=1)
    low, high = V[:, 2].min(), V[:, 2].max()
    bottom = length[z < low + SLICE * (high - low)].sum()
    top = length[z > high - SLICE * (high - low)].sum()
    return plan + float((bottom - top) / length.sum()) + 0.5 * stability


def is_nearly_closed(surface: Surface) -> bool:
    """Whether it has no boundary, or pinholes only."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() < PINHOLES * np.sqrt(surface.area))


def _stability(V: Floats, surface: Surface) -> float:
    """How far inside of what it stands on the middle of its weight lies, over the side of a square of its area.

    V : (n, 3) its vertices with z up. Between -0.2, it falls over, and 0.4.
    """
    height = np.ptp(V[:, 2])
    on = V[V[:, 2] <= V[:, 2].min() + SOLE * height, :2]
    middle = surface.areas @ V[surface.F, :2].mean(axis=1) / surface.area
    try:
        plane = ConvexHull(on).equations  # a point is inside where all of them are negative
    except (QhullError, ValueError):
        return -0.2  # a point or a line: it stands on no area
    inside = -(plane[:, :2] @ middle + plane[:, 2]).max()
    return float(np.clip(inside / np.sqrt(surface.area), -0.2, 0.4))


UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "oe", "æ": "ae"}
)
SMALLEST, LARGEST = 0.02, 1000.0
"""Metres that a surface's box is long at least and at most, or its unit is doubted."""
USUAL = 2.0, 100.0
"""Metres between which most that is built is long; beyond, sizes in other units are told where the file has none."""
FAR_OFF = 100.0
"""A surface further from the origin of its file than so many times its size gets an origin of its own: numbers of
single precision, as in STL files, are then coarser than a hundred-thousandth of it, and CAD programs lose digits, too.
"""
POSSIBLE = 0.2, 500.0
"""The same for what `dsfab inspect` tells of sizes in other units."""
GUESSED = ("mm", "cm", "m", "in", "ft")
"""Units that files without one are in."""


@dataclass(frozen=True)
class Decision:
    """One thing that was decided.

    topic : a word or two.  choice : what, and why.  change : the key of the preset, or the option, that changes it.
    """

    topic: str
    choice: str
    change: str = ""


@dataclass(frozen=True, eq=False)
class GivenMesh:
    """A mesh as a surface, metres, z up; and the keys of [surface] that make it that.

    repaired : what is otherwise than in its file.
    """

    surface: Surface
    name: str
    keys: dict[str, Any]
    decisions: tuple[Decision, ...]
    repaired: tuple[str, ...] = ()


def mesh_in_file(
    path: Path, unit: str | None, up: Up | None, max_triangles: int | None = None, raw: RawMesh | None = None
) -> GivenMesh:
    """The mesh in a file; unit and vertical axis are guessed where they are not given.

    max_triangles : how many the file may have, where that is said. raw : what is in it, where it was read before.

    Raises SurfaceError for a file that cannot be read, or is no sheet even when it is mended.
    """
    raw = raw or raw_mesh(path, max_triangles or DEFAULT_TRIANGLES)
    finite_faces(path, raw)
    given, unit = unit is not None, unit or unit_guess(raw)
    keys: dict[str, Any] = {"file": str(path), "unit": unit}
    if max_triangles is not None:
        keys["max_triangles"] = max_triangles
    scan = is_scan(raw.V, raw.F)
    better = mended_raw(raw, scan, unit)
    mends = better.record.repaired[len(raw.record.repaired) :]
    found = surface_of_file(path, better, unit)
    surface = found.surface
    known = raw.unit is not None or given
    told = f"{unit}{', as the file says' if raw.unit == unit else ''}: it is {_box(surface)}"
    doubt = size_doubt(np.ptp(surface.V, axis=0).tolist(), unit)
    told += doubt or ("" if known else _others(surface, unit))
    decisions = [Decision("unit", told, "surface.unit, or --unit cm")]
    for remark in raw.record.remarks:
        decisions.append(Decision("file", remark))
    if mends:
        key = "repair" if scan else "mend"
        keys[key] = True
        decisions.append(Decision("mended", ("as a raw scan: " if scan else "") + "; ".join(mends), f"surface.{key}"))
    for remark in found.record.repaired[len(better.record.repaired) :]:
        decisions.append(Decision("file", f"repaired: {remark}"))
    decisions += [Decision("sheets", remark) for remark in twin_remarks(surface.V, surface.F)]
    surface, up, turned = _turned(surface, up, path.suffix, raw.up)
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
    return GivenMesh(surface, preset_name(path), keys, tuple(decisions), found.record.repaired)


def preset_name(mesh: str | Path) -> str:
    """What a preset for a mesh file is called: letters without their marks, umlauts as two."""
    plain = unicodedata.normalize("NFC", Path(mesh).stem).translate(UMLAUTS)
    plain = "".join(letter for letter in unicodedata.normalize("NFKD", plain) if not unicodedata.combining(letter))
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", plain).strip("_.-") or "mesh"


def mesh_in_memory(mesh: Any, unit: str | None, up: Up | None) -> GivenMesh:
    """The same of a mesh that Python holds: a `Surface`, or what `Surface.of` takes; metres where nothing else is said.

    Raises SurfaceError for what is no mesh.
    """
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        surface = Surface.from_mesh(mesh[0], mesh[1], unit or "m")
    else:
        surface = Surface.of(mesh, unit)
    better = (repaired_scan if is_scan(surface.V, surface.F) else mended)(surface.V, surface.F)
    decisions = [Decision("unit", f"metres: it is {_box(surface)}", "the argument unit")]
    if better.repairs:
        surface = Surface.from_mesh(better.V, better.F)
        decisions.append(Decision("mended", "; ".join(better.repairs)))
    surface, _, turned = _turned(surface, up)
    return GivenMesh(surface, "roof", {"mesh": surface}, (*decisions, turned))


def _turned(
    surface: Surface, up: Up | None, suffix: str = "", usual: str | None = None
) -> tuple[Surface, Up, Decision]:
    """The surface with z up, the vertical axis of its file of that suffix, whose program has `usual` up, and how that
    was found."""
    guess = likely_up(surface, suffix, usual) if up is None else up
    turned = surface if guess == "z" else Surface(upright(surface.V, guess), surface.F)
    other = "y" if guess == "z" else "z"
    change = f"surface.up, or --up {other}"
    if up is not None:
        return turned, guess, Decision("up", f"{up}, as you say", change)
    if guess != "z":
        lies = f"with z up it would lie on its side or back; {guess} is taken for the vertical axis"
        return turned, guess, Decision("up", lies, change)
    low, _, high = np.sort(np.ptp(turned.V, axis=0))
    stands = np.ptp(turned.V[:, 2]) == high and high > 1.5 * low
    told = f"z; it stands upright, {length(high)} high: if it should lie, another axis is up" if stands else "z"
    return turned, guess, Decision("up", told, change)


def _origin(surface: Surface) -> tuple[float, ...]:
    """Where the origin of a surface is, metres: whole ones near its lowest corner along the axes on which it is
    `FAR_OFF`, 0 along others, as its height above the sea."""
    low = surface.V.min(axis=0)
    far = np.abs(surface.V).max(axis=0) > FAR_OFF * surface.size
    return tuple(np.where(far, np.floor(low), 0.0).tolist())


def size_doubt(sides: Sequence[float], unit: str) -> str:
    """What is to be said of a box of such sides, metres, that nothing is built in, read in that unit: mostly it is
    another one, or the file scaled twice."""
    if SMALLEST <= max(sides) <= LARGEST:
        return ""
    doubt = f"far {'larger' if max(sides) > LARGEST else 'smaller'} than what is built; is that the file's unit?"
    return f" ({'; '.join([doubt, *sizes_in_other_units(sides, unit, USUAL)])})"


def _others(surface: Surface, unit: str) -> str:
    """What a surface would measure in other units, where its unit is a guess that makes it smaller or larger than most
    that is built, and another one does not."""
    sides = np.ptp(surface.V, axis=0).tolist()
    found = [] if USUAL[0] <= max(sides) <= USUAL[1] else sizes_in_other_units(sides, unit, USUAL)
    return f" (the file does not say; {'; '.join(found)})" if found else ""


def sizes_in_other_units(sides: Sequence[float], unit: str, between: tuple[float, float] = POSSIBLE) -> list[str]:
    """'--unit in: 8 m x 6 m x 3 m' for each of the units that files without one are in, other than that in which a box
    has these sides, metres; where its longest side is `between` so many metres."""
    metres = {other: metres_per(other) / metres_per(unit) for other in GUESSED if other != unit}
    return [
        f"--unit {other}: {' x '.join(length(times * side) for side in sides)}"
        for other, times in metres.items()
        if between[0] <= times * max(sides) <= between[1]
    ]


def _box(surface: Surface) -> str:
    return " x ".join(length(float(side)) for side in np.ptp(surface.V, axis=0))


def vertical_axis(up: str | None) -> Up | None:
    """The axis, if one is named; raises SurfaceError for what is none of x, y, z, -x, -y, -z."""
    for axis in get_args(Up):
        if axis == up:
            known: Up = axis
            return known
    if up is not None:
        raise SurfaceError(f"up = {up!r} is no axis; use one of {', '.join(get_args(Up))}")
    return None
