"""Loads of a proposed preset, such as snow. All values are placeholders for those of the local standard."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats, point_tuple
from dsfab.core.errors import PresetError, SurfaceError
from dsfab.preset.proposal.readings import SupportPlace
from dsfab.preset.proposal.shape import is_nearly_closed
from dsfab.surface import Surface, Wind, faces_without_upper_side, one_sided_pieces
from dsfab.surface.loads.load_case import WindShape, outward_normals
from dsfab.surface.loads.roof_shapes import ROOF_RISE, TWO_SLOPES, CanopyCoefficients, RoofProfile, roofs, side_of_plan

USUAL_LOAD = {"roof": "snow", "hung": "services", "floor": "people", "wall": "wind"}
"""Usual load of a surface besides its weight, by kind of surface."""
LINE_OF_COMMENT = {
    "snow": "Pa on the ground: a placeholder for the value of your code [EN 1991-1-3]",
    "people": "Pa on the plan area: a placeholder for crowds of people [EN 1991-1-1, table 6.2, category C5]",
    "services": "Pa on the plan area: a placeholder for lights and pipes that hang from the surface",
    "wind": "Pa, velocity pressure: a placeholder for your site [EN 1991-1-4, 4.5]",
}
WindRoof = Literal["", "vault", "canopy", "flat"]  # kind of roof for wind loads; "" for surfaces without such a shape
LINE_OF_SHAPE = {
    "vault": "suction and pressure on a curved roof; also for domes [EN 1991-1-4, 7.2.8, figure 7.11]",
    "canopy": "net pressure on a roof without walls [EN 1991-1-4, 7.3, tables 7.6 and 7.7]",
    "flat": "suction on a flat roof on walls [EN 1991-1-4, 7.2.3, table 7.2]",
}
PRESSURE = {"snow": 1000.0, "people": 5000.0, "services": 300.0, "wind": 500.0}  # Pa; placeholders for values of codes.
AROUND = 0.3  # A surface is a tower if the horizontal part of sum(normal x area) is below this share of its area.


@dataclass(frozen=True)
class MeshWishes:
    """The user's choices for a surface.
    stand : value of --stand: kind of supports (feet, edge ...), height (m) up to which edges are supported, or "".
    loads : "snow", "wind", "people", "services" or "none", also with a value in kPa: "snow=1.2".
    only  : names of the parts of the file that form the surface."""

    stand: str = ""
    built_in: bool = False
    loads: tuple[str, ...] = ()
    only: tuple[str, ...] = ()

    def pressures(self, kind: str, is_model: bool) -> dict[str, float]:
        """Return the pressures (Pa) of the loads by name, without the weight.
        Raises PresetError for an unknown load, and for a value that is not positive."""
        if not self.loads:
            usual = None if is_model else USUAL_LOAD.get(kind)
            return {usual: PRESSURE[usual]} if usual else {}
        pressures = {}
        for text in self.loads:
            name, _, value = text.partition("=")
            if text == "none" and len(self.loads) == 1:
                continue
            if text == "none":
                raise PresetError("--load none excludes all other loads; remove it, or remove the other --load")
            if name not in PRESSURE:
                words = ", ".join(PRESSURE)
                raise PresetError(f"--load {text} is not known; use {words} or none; values are in kPa: snow=1.2")
            number = _positive(value) if value else PRESSURE[name] / 1000
            if not number:
                raise PresetError(
                    f"--load {text}: {value!r} is not a positive number; give kPa, for instance {name}=1.2"
                )
            pressures[name] = 1000 * number
        return pressures


NO_WISHES = MeshWishes()  # The user has no wishes: dsfab chooses supports and loads.


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return 0.0
    return value if 0 < value < np.inf else 0.0


def load_words(surface: Surface, pressures: Mapping[str, float], roof: WindRoof) -> str:
    """Return the loads as text for a preset."""
    places = {
        "snow": "on the ground, less on slopes [EN 1991-1-3, 5.3]",
        "people": "on the plan area [EN 1991-1-1, table 6.2]",
        "services": "on the plan",
        "wind": {
            "": "from both sides [EN 1991-1-4, 7.4]",
            "vault": "from both sides [EN 1991-1-4, 7.2.8]",
            "canopy": "that presses the open roof down or lifts it [EN 1991-1-4, 7.3]",
            "flat": "from four sides [EN 1991-1-4, 7.2.3]",
        }[roof],
    }
    if snow_picker(surface):
        places["snow"] = "on the ground, here on top only, less on slopes [EN 1991-1-3, 5.3]"
    parts = [f"{name} of {pressure / 1000:g} kPa {places[name]}" for name, pressure in pressures.items()]
    words = " and ".join(["its own weight", *parts])
    return f"{words}; replace these loads by those of your local code" if parts else words


def load_tables(surface: Surface, pressures: Mapping[str, float], roof: WindRoof) -> Iterator[list[str]]:
    """Yield the tables of loads for a preset, each as lines."""
    if len(pressures) > 1 or "wind" not in pressures:
        yield ["[[surface.load]]", 'kind = "self_weight"']
        for name in pressures:
            if name != "wind":
                yield list(_vertical(surface, name, pressures[name]))
    if "wind" in pressures:
        yield from _wind(surface, pressures["wind"], roof)


@dataclass(frozen=True)
class WindCase:
    """A load case of wind: horizontal direction (3,), shape of the load, and height (m) of the eaves."""

    name: str
    direction: Floats
    shape: WindShape = ""
    eaves: float = 0.0

    def traction(self, surface: Surface) -> Floats:
        """Return the traction (m, 3) for a velocity pressure of 1 Pa."""
        return Wind(1.0, point_tuple(self.direction), shape=self.shape, eaves=self.eaves).traction(surface)


def _wind(surface: Surface, pressure: float, roof: WindRoof) -> Iterator[list[str]]:
    for case in _wind_cases(surface, roof):
        direction = [float(value) for value in np.round(case.direction, 3) + 0.0]
        yield ["[[surface.load]]", 'kind = "self_weight"', f'case = "{case.name}"']
        lines = ["[[surface.load]]", 'kind = "wind"', toml_line("pressure", pressure, LINE_OF_COMMENT["wind"])]
        lines += [f"direction = {direction}", f'case = "{case.name}"']
        if roof:
            lines.append(toml_line("shape", case.shape, LINE_OF_SHAPE[roof]))
        if (roof == "canopy" and faces_without_upper_side(surface).any()) or not (roof or _goes_around(surface)):
            note = "net coefficient of a free-standing wall [EN 1991-1-4, table 7.9, zone D]"
            lines += [toml_line("windward", 1.2, note), "leeward = 1.2"]
        if case.eaves:
            largest = "; a placeholder with the largest zones" if roof == "flat" else ""
            lines.append(toml_line("eaves", case.eaves, f"m, height of the eaves above the ground{largest}"))
        yield lines


def _wind_cases(surface: Surface, roof: WindRoof) -> list[WindCase]:
    """Return the cases of wind on a kind of roof; equal cases count once.
    Raises SurfaceError if the shape of the load does not fit the roof."""
    n = outward_normals(surface)
    parts = roofs(surface, np.ones(surface.m, dtype=bool), n)
    on_roof = np.logical_or.reduce(parts) if parts else np.zeros(surface.m, dtype=bool)
    d = broadside(surface, on_roof)
    if roof == "canopy":
        around = [RoofProfile.all_around(surface, part, n) for part in parts]
        canopies = [CanopyCoefficients.of_roof(profiles) for profiles in around]
        if all(profiles[0].tilt + profiles[0].uneven < np.tan(np.radians(TWO_SLOPES)) for profiles in around):
            d = side_of_plan(surface)
        turns = (0, 180) if len(canopies) == 1 and canopies[0].has_one_axis else (0, 90, 180, 270)
        cases = [WindCase("wind_down", d, "canopy down"), WindCase("wind_up", d, "canopy up")]
        for turn in turns:
            cases.append(WindCase(f"wind_down_{turn}", _turn(d, turn), "canopy down half"))
            cases.append(WindCase(f"wind_up_{turn}", _turn(d, turn), "canopy up half"))
    elif roof == "flat":
        d = side_of_plan(surface)
        eaves = round(float(np.hypot(*np.ptp(surface.V[:, :2], axis=0))) / 2, 1)
        cases = [WindCase(f"wind_{turn}", _turn(d, turn), "flat up", eaves) for turn in (0, 90, 180, 270)]
    elif roof == "vault":
        low = min(surface.V[surface.F[part], 2].min() for part in parts)
        eaves = round(float(low - min(surface.V[:, 2].min(), 0.0)), 2)
        if not _fits(surface, WindCase("wind", d, "vault", eaves)):
            d = _turn(d, 90)
        names = [("wind", d), ("wind_back", -d)]
        cases = [WindCase(name, side, "vault", eaves) for name, side in names]
        cases += [WindCase(f"{name}_up", side, "vault up", eaves) for name, side in names]
    else:
        return [WindCase("wind", d), WindCase("wind_back", -d)]
    tractions = [case.traction(surface) for case in cases]
    return [
        case
        for k, case in enumerate(cases)
        if not any(np.allclose(tractions[k], earlier, atol=1e-9) for earlier in tractions[:k])
    ]


def wind_roof(surface: Surface, stands: Sequence[SupportPlace]) -> WindRoof:
    """Return the kind of roof for wind loads; "" if the surface is no roof but a wall, a tower or an object.
    A roof is a canopy, open at its sides, if it stands on less than half of its edges.
    Raises PresetError for a roof of a shape without coefficients."""
    if one_sided_pieces(surface.F, surface.edges).any():
        return ""
    wall = faces_without_upper_side(surface)
    supported, edges = sum(place.length for place in stands), surface.edge_lengths[surface.edges.boundary].sum()
    is_open = bool(supported < 0.5 * float(edges)) and not _closed_pieces(surface).any()
    kinds: tuple[WindRoof, ...] = ("canopy", "vault") if is_open else ("flat", "vault")
    if not wall.all() and not _covers_its_plan(surface, wall):
        for roof in kinds:
            with suppress(SurfaceError):
                _wind_cases(surface, roof)
                return roof
    if not _covers_its_plan(surface, np.ones(surface.m, dtype=bool)):
        return ""
    raise PresetError(
        "--load wind: a surface with a mean slope of less than 60 degrees counts as a roof; dsfab has the coefficients "
        "of vaults, of flat roofs and of open roofs with slopes of up to 30 degrees; for this roof make the preset "
        "without wind, and add loads of kind 'pressure' by your code"
    )


def _fits(surface: Surface, case: WindCase) -> bool:
    with suppress(SurfaceError):
        return bool(case.traction(surface).any())
    return False


def _closed_pieces(surface: Surface) -> Bools:
    """Return a mask of the pieces without boundary."""
    count, piece = surface.pieces
    return np.asarray(np.bincount(piece, surface.edges.boundary[surface.edges.of].any(axis=1), count) == 0)


def _covers_its_plan(surface: Surface, faces: Bools) -> bool:
    """Return True if those of the `faces` (m,) that look upwards, with slopes below 60 degrees, cover half of the
    smallest rectangle around the plan. The outside of walls is unknown, so their level faces count as upward."""
    n = outward_normals(surface)[faces, 2]
    is_wall = faces_without_upper_side(surface)[faces]
    upward = np.where(is_wall, np.abs(n), n)
    along = side_of_plan(surface)
    across = np.array([-along[1], along[0], 0.0])
    plan = np.ptp(surface.V @ along) * np.ptp(surface.V @ across)
    covered = surface.areas[faces] @ np.where(upward > ROOF_RISE, upward, 0.0)
    return bool(covered > 0 and covered >= 0.5 * plan)


def _vertical(surface: Surface, name: str, pressure: float) -> Iterator[str]:
    yield "[[surface.load]]"
    yield f'kind = "{"snow" if name == "snow" else "imposed"}"'
    yield from () if name == "snow" else (f'name = "{name}"',)
    yield toml_line("pressure", pressure, LINE_OF_COMMENT[name])
    if name == "snow":
        yield toml_line("shape", "mu1", "less snow on steep faces, none from 60 degrees on [table 5.2]")
        if picker := snow_picker(surface):
            yield f"at = {{ {picker} }}"


def toml_line(key: str, value: object, note: str = "") -> str:
    line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    return f"{line:<26}  # {note}" if note else line


def snow_picker(surface: Surface) -> str:
    """Return TOML keys that select the faces under snow; '' for the whole surface."""
    upward = surface.normals[:, 2] * surface.areas
    if np.abs(upward).sum() < 1.2 * abs(upward.sum()) or one_sided_pieces(surface.F, surface.edges).any():
        return ""
    outwards = np.einsum("mi,mi,m->", surface.normals, surface.centroids - surface.V.mean(axis=0), surface.areas)
    return f'pick = "facing", direction = [0.0, 0.0, {1.0 if outwards > 0 else -1.0}], angle = 60'


def takes_snow(surface: Surface) -> bool:
    """Return True if snow lies on the surface; False for closed and for porous objects."""
    edge = float(surface.edge_lengths[surface.edges.boundary].sum())
    upward = surface.normals[:, 2] * surface.areas
    is_simple = np.abs(upward).sum() < 1.2 * abs(upward.sum())
    return bool(is_simple or (edge**2 < 16 * surface.area and not is_nearly_closed(surface)))


def broadside(surface: Surface, faces: Bools | None = None) -> Floats:
    """Return the horizontal unit vector (3,) from which most of the surface is visible: the worst wind.
    faces : (m,) faces that count; by default all, also if no face is marked."""
    chosen = faces if faces is not None and faces.any() else np.ones(surface.m, dtype=bool)
    n = surface.normals[chosen, :2]
    x, y = np.linalg.eigh((n * surface.areas[chosen][:, None]).T @ n)[1][:, -1]
    return np.array([x, y, 0.0]) * (1.0 if x + y > 0 else -1.0)


def _turn(direction: Floats, degrees: float) -> Floats:
    x, y, z = direction
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([c * x - s * y, s * x + c * y, z])


def _goes_around(surface: Surface) -> bool:
    total = surface.areas @ surface.normals
    return bool(np.hypot(total[0], total[1]) < AROUND * surface.area)
