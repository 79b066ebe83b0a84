"""A mesh of the user's as a surface in metres with z up, and what was decided on the way."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from dsfab.errors import SurfaceError
from dsfab.proposal.vertical import likely_up
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
from dsfab.units import metres_per
from dsfab.wording import coordinates, length

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
