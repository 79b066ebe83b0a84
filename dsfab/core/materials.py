"""Materials by name, with sources.

The design strength is the characteristic strength divided by the partial factor of the material. For timber it is also
multiplied by k_mod = 0.8 (medium load duration, indoors or under a roof). For timber, plywood, GFRP and concrete, this
strength is only a first estimate."""

from dataclasses import dataclass
from typing import NamedTuple

from dsfab.core.errors import PresetError, did_you_mean


@dataclass(frozen=True)
class NamedMaterial:
    """A material that a preset may name.
    young : Young's modulus, Pa.    density : kg/m3.    strength : design strength, Pa.    expansion : thermal, 1/K.
    says : text on the kind and derivation of the strength.    source : reference for all values."""

    name: str
    young: float
    poisson: float
    density: float
    strength: float
    expansion: float
    says: str
    source: str

    @property
    def values(self) -> dict[str, float]:
        """Values by key of [statics]: Young's modulus (Pa), Poisson's ratio, density (kg/m3), strength (Pa)."""
        return {key: getattr(self, key) for key in KEYS}


KEYS = ("young", "poisson", "density", "strength")  # Keys of [statics] that a material sets.


def _steel(name: str, strength: int, source: str = "") -> NamedMaterial:
    says = f"yield strength {strength} MPa / 1.0, for plates up to 40 mm thick"
    source += "EN 1993-1-1, 3.2.6, 6.1 and table 3.1; density EN 1991-1-1"
    return NamedMaterial(name, 210e9, 0.3, 7850.0, strength * 1e6, 12e-6, says, source)


def _timber(name: str, young: float, density: float, strength: float, says: str, source: str) -> NamedMaterial:
    source += "; strength factors EN 1995-1-1; thermal expansion EN 1991-1-5; Poisson's ratio assumed"
    return NamedMaterial(name, young, 0.3, density, strength, 5e-6, f"tension along the grain {says}", source)


_ALL = (
    _steel("S235", 235),
    _steel("S275", 275),
    _steel("S355", 355),
    _steel("S460", 460, "S460N; "),
    _timber("C24", 11e9, 420.0, 8.92e6, "14.5 MPa x 0.8 / 1.3", "EN 338, table 1"),
    _timber("C30", 12e9, 460.0, 11.7e6, "19 MPa x 0.8 / 1.3", "EN 338, table 1"),
    _timber("GL24h", 11.5e9, 420.0, 12.3e6, "19.2 MPa x 0.8 / 1.25", "EN 14080, table 5"),
    _timber("GL28h", 12.6e9, 460.0, 14.3e6, "22.3 MPa x 0.8 / 1.25", "EN 14080, table 5"),
    _timber("GL32h", 14.2e9, 490.0, 16.4e6, "25.6 MPa x 0.8 / 1.25", "EN 14080, table 5"),
    NamedMaterial(
        *("LVL 48 P", 13.8e9, 0.3, 510.0, 23.3e6, 5e-6),
        says="tension along the grain 35 MPa x 0.8 / 1.2",
        source="EN 14374, makers' bulletin of 2019; strength factors EN 1995-1-1; thermal expansion as timber; "
        "Poisson's ratio assumed",
    ),
    NamedMaterial(
        *("CLT", 5.5e9, 0.1, 420.0, 4.6e6, 5e-6),
        says="tension along the boards 14.5 MPa / 2 x 0.8 / 1.25; half of the layers run across, so young is half of "
        "the timber's value",
        source="C24 of EN 338; strength factors EN 1995-1-1; thermal expansion EN 1991-1-5; Poisson's ratio assumed",
    ),
    NamedMaterial(
        *("plywood", 8.75e9, 0.1, 680.0, 25e6, 5e-6),
        says="tension 37.5 MPa x 0.8 / 1.2, the mean of the values along and across the grain",
        source="birch, Handbook of Finnish Plywood; strength factors EN 1995-1-1; thermal expansion as timber; "
        "Poisson's ratio assumed",
    ),
    NamedMaterial(
        *("aluminium 6082", 70e9, 0.3, 2700.0, 218e6, 23e-6),
        says="temper T6, proof strength 240 MPa / 1.1, up to 100 mm thick; the strength beside welds is about half",
        source="EN 1999-1-1, 3.2.5, 6.1.3 and table 3.2a",
    ),
    NamedMaterial(
        *("concrete C30/37", 33e9, 0.2, 2500.0, 20e6, 10e-6),
        says="compression 30 MPa / 1.5; reinforcement carries the tension",
        source="EN 1992-1-1, 3.1 and table 3.1, for uncracked concrete; density of reinforced concrete: EN 1991-1-1",
    ),
    NamedMaterial(
        *("GFRP", 17e9, 0.23, 1800.0, 57e6, 10e-6),
        says="tension along the profile 170 MPa / 3; across the profile, tension 30 MPa / 3 and young 5 GPa",
        source="E17 of EN 13706-3; strength factor roughly as in the EUROCOMP code; other values from makers' data",
    ),
    NamedMaterial(
        *("PLA", 3.5e9, 0.36, 1240.0, 20e6, 68e-6),
        says="tension 50 MPa / 2.5; no standard gives this factor for printed layers and creep",
        source="Farah, Anderson and Langer 2016; manufacturers' data sheets",
    ),
)
MATERIALS = {material.name: material for material in _ALL}  # Materials by name.


class Stock(NamedTuple):
    """Thicknesses (mm) in which a material is sold, ascending, and their source."""

    millimetres: tuple[float, ...]
    source: str

    @property
    def metres(self) -> tuple[float, ...]:
        return tuple(round(t / 1000, 6) for t in self.millimetres)


_STOCK = (
    ("S235, S275, S355, S460", "3 4 5 6 8 10 12 15 20 25 30 35 40 50 60 70 80 100", "plates of EN 10029"),
    ("C24, C30", "16 19 22 25 32 38 44 50 63 75 100 125 150 175 200 225 250 300", "sawn softwood, EN 1313-1"),
    (
        *("GL24h, GL28h, GL32h", "20 30 40 60 80 100 120 140 160 180 200 220 240 280 320 360 400 440 480 520 560 600"),
        "thicknesses of laminations and standard beams of manufacturers, EN 14080",
    ),
    (
        *("LVL 48 P", "21 24 27 30 33 39 45 51 57 63 69 75 90 102 114 126 138 150 189 225 300"),
        "panels of manufacturers up to 75 mm thick; thicker sheets consist of two to four panels, glued together",
    ),
    ("CLT", "60 80 90 100 120 140 160 180 200 220 240 260 280 300 320", "manufacturers' panels with 3 to 8 layers"),
    ("plywood", "4 6.5 9 12 15 18 21 24 27 30 35 40 45 50", "birch plywood, Handbook of Finnish Plywood"),
    ("aluminium 6082", "2 3 4 5 6 8 10 12 15 20 25 30 35 40 50 60 80 100", "plates of EN 485"),
    ("concrete C30/37", "40 50 60 70 80 90 100 110 120 140 160 180 200 220 240 270 300 350 400", "steps of a formwork"),
    ("GFRP", "3 5 6 8 10 12 15 20 25 30 40", "pultruded plates of manufacturers, single or two glued together"),
    ("PLA", "0.8 1 1.2 1.6 2 2.4 3 4 5 6 8 10 12 14 16 20 24 30", "multiples of a printer's layers of 0.2 mm"),
)
STOCK = {
    name: Stock(tuple(map(float, sizes.split())), source)
    for names, sizes, source in _STOCK
    for name in names.split(", ")
}
"""Stock of each material, by its name."""

NO_STRENGTH = (
    "the preset gives neither a material nor a strength, so dsfab cannot check the members; set statics.material = "
    '"S355" (`dsfab materials` lists all), or statics.strength'
)
"""Message for a preset without a material and without a strength."""


def material_named(name: str) -> NamedMaterial:
    """Return the material with this name; letter case does not matter. Raises PresetError for an unknown name."""
    key = " ".join(name.split()).lower()
    by_lower_name = {label.lower(): material for label, material in MATERIALS.items()}
    if key in by_lower_name:
        return by_lower_name[key]
    hint = did_you_mean(key, by_lower_name)  # the search ignores capitals, but the hint shows them
    for small, material in by_lower_name.items():
        hint = hint.replace(f" {small}?", f" {material.name}?")
    raise PresetError(
        f"{name!r} is not known{hint}; use one of {', '.join(MATERIALS)}, or leave material out and give "
        f"young, poisson and density"
    )
