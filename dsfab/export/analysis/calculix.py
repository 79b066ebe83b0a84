"""CalculiX: finite element models as an .inp file for the program `ccx`."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Bools, Floats, Ints, first_few, lock, read_only_copy
from dsfab.core.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import NUMBERS_READ_BACK, ReadBack, require_equal
from dsfab.export.writing import atomic_file, one_line, rows, write_chunks

if TYPE_CHECKING:
    from dsfab.members.frame import Frame

Element = Literal["S6", "CPS6"]

UNITS = "lengths in metres, forces in newtons, Young's modulus and stresses in pascals, density in kg/m3"


@dataclass(frozen=True, eq=False)
class CalculixModel:
    """Finite element model of a sheet: p nodes, m six-node triangles, supports and loads.
    nodes     : (p, 3) coordinates, m.    thickness : m.    young : Young's modulus, Pa.    density : kg/m3.
    triangles : (m, 6) node numbers: three corners, then the middle of the edge after each corner.
    steps     : (p, 3) forces on the nodes, N, by name of the load step.
    supports  : (p, 3) True for fixed directions of the nodes, by name of the support (capital letters).
    clamped   : (p,) True for fixed rotations; only for S6.    springs : (p, 3) stiffness of springs to the ground, N/m.
    Raises ExportError if shapes disagree, steps or supports are missing, or CPS6 triangles leave the plane z = 0."""

    nodes: Floats
    triangles: Ints
    thickness: float
    young: float
    poisson: float
    steps: Mapping[str, Floats]
    supports: Mapping[str, Bools]
    clamped: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    springs: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    density: float = 0.0
    element: Element = "S6"
    name: str = "sheet"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        lock(self, "nodes", np.float64, (None, 3))
        lock(self, "triangles", np.int64, (None, 6))
        p = len(self.nodes)
        for name, empty in (("clamped", np.zeros(p, dtype=bool)), ("springs", np.zeros((p, 3)))):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, empty)
        lock(self, "clamped", np.bool_, (p,))
        lock(self, "springs", np.float64, (p, 3))
        steps = {name: read_only_copy(force, np.float64, (p, 3)) for name, force in self.steps.items()}
        supports = {name: read_only_copy(directions, np.bool_, (p, 3)) for name, directions in self.supports.items()}
        object.__setattr__(self, "steps", MappingProxyType(steps))
        object.__setattr__(self, "supports", MappingProxyType(supports))
        self._check()

    def _check(self) -> None:
        numbers = (self.nodes, self.springs, *self.steps.values(), [self.thickness, self.young, self.poisson])
        if not all(np.isfinite(np.asarray(values)).all() for values in numbers):
            raise ExportError(f"the model {self.name!r} has numbers that are not finite; check its mesh and its loads")
        bad = np.flatnonzero((self.triangles < 0).any(axis=1) | (self.triangles >= len(self.nodes)).any(axis=1))
        if len(bad):
            raise ExportError(
                f"{len(bad)} triangles use node numbers that do not exist in the model (first: {first_few(bad)})"
            )
        if not self.steps or not (any(directions.any() for directions in self.supports.values()) or self.springs.any()):
            raise ExportError(f"the model {self.name!r} has no load step or no support; CalculiX needs both")
        if wrong := [name for name in self.supports if name != _set_name(name)]:
            raise ExportError(f"the name {wrong[0]!r} is not valid for a node set; use capitals, digits and _")
        if self.element == "CPS6" and np.ptp(self.nodes[:, 2]) > 0:
            raise ExportError(f"the model {self.name!r} is not in the plane z = 0; use S6 shells, not CPS6 triangles")


def write_calculix(model: CalculixModel, path: str | Path) -> Path:
    """Write a model as .inp file; return the path. `ccx NAME` (without .inp) writes results to NAME.frd and NAME.dat.
    Raises ExportError if the suffix is not .inp, or if the file cannot be written."""
    path = Path(path)
    if path.suffix != ".inp":
        raise ExportError(f"{path.name} does not end in .inp, as CalculiX needs; name it {path.stem}.inp")
    with atomic_file(path) as temporary:
        write_chunks(temporary, (text.encode("ascii", "replace") for text in cards(model)))
    return path


def cards(model: CalculixModel) -> Iterator[str]:
    """Yield the text of the .inp file in pieces."""
    yield from _header(model)
    numbers = np.arange(1, len(model.nodes) + 1)
    yield "*NODE, NSET=ALL\n"
    yield from rows("%d, %.11e, %.11e, %.11e\n", numbers, *model.nodes.T)  # ccx reads at most 20 characters of a number
    yield f"*ELEMENT, TYPE={model.element}, ELSET=SHEET\n"
    yield from rows("%d, %d, %d, %d, %d, %d, %d\n", np.arange(1, len(model.triangles) + 1), *(model.triangles.T + 1))
    yield from _section(model)
    yield from _supports(model)
    yield from _springs(model)
    for k, force in enumerate(model.steps.values(), 1):
        yield from _node_set(f"LOAD_{k}", np.asarray(_acting(force).any(axis=1)))
    for k, (name, force) in enumerate(model.steps.items(), 1):
        yield from _step(model, k, name, force)


def _header(model: CalculixModel) -> Iterator[str]:
    kind = "six-node shells (S6)" if model.element == "S6" else "six-node triangles in plane stress (CPS6)"
    lines = (
        f"{model.name}: {len(model.triangles)} {kind}, {len(model.nodes)} nodes, written by dsfab {__version__}",
        f"UNITS: {UNITS}",
        "Run it with: ccx NAME, where NAME is this file's name without .inp",
        *model.notes,
    )
    yield "".join(f"** {one_line(line)}\n" for line in lines)


def _section(model: CalculixModel) -> Iterator[str]:
    yield f"*MATERIAL, NAME=SHEET\n*ELASTIC\n{model.young:.12g}, {model.poisson:.12g}\n"
    if model.density:
        yield f"*DENSITY\n{model.density:.12g}\n"
    card = "*SHELL SECTION" if model.element == "S6" else "*SOLID SECTION"
    yield f"{card}, ELSET=SHEET, MATERIAL=SHEET\n{model.thickness:.12g}\n"


def _supports(model: CalculixModel) -> Iterator[str]:
    axes = range(3 if model.element == "S6" else 2)
    for name, directions in model.supports.items():
        members: Bools = np.asarray(directions.any(axis=1))
        yield from _node_set(name, members)
        for axis in axes:
            if members.any() and bool((directions[:, axis] == members).all()):
                yield f"*BOUNDARY\n{name}, {axis + 1}, {axis + 1}\n"
            elif directions[:, axis].any():
                yield "*BOUNDARY\n"
                yield from rows(f"%d, {axis + 1}, {axis + 1}\n", np.flatnonzero(directions[:, axis]) + 1)
    if model.element == "S6" and model.clamped.any():
        yield from _node_set("CLAMPED", model.clamped)
        yield "*BOUNDARY\nCLAMPED, 4, 6\n"


def _springs(model: CalculixModel) -> Iterator[str]:
    count, group = len(model.triangles), 0
    for axis in range(3 if model.element == "S6" else 2):
        for stiffness in np.unique(model.springs[:, axis][model.springs[:, axis] > 0]).tolist():
            nodes = np.flatnonzero(model.springs[:, axis] == stiffness)
            group += 1
            yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING_{group}\n"
            yield from rows("%d, %d\n", count + 1 + np.arange(len(nodes)), nodes + 1)
            # below *SPRING, integers are directions, and a number with a decimal point is a stiffness
            yield f"*SPRING, ELSET=SPRING_{group}\n{axis + 1}\n{stiffness:.11e}\n"
            count += len(nodes)


def _step(model: CalculixModel, k: int, name: str, force: Floats) -> Iterator[str]:
    yield f"** LOAD CASE {k}: {one_line(name)}\n"
    yield "*STEP\n*STATIC\n*CLOAD, OP=NEW\n"  # NEW removes the loads of the step before
    node, axis = np.nonzero(_acting(force))
    if len(node):
        yield from rows("%d, %d, %.11e\n", node + 1, axis + 1, force[node, axis])
    yield "*NODE PRINT, NSET=ALL\nU\n"
    for support, directions in model.supports.items():
        if directions.any():
            yield f"*NODE PRINT, NSET={support}, TOTALS=ONLY\nRF\n"
    yield "*EL PRINT, ELSET=SHEET, TOTALS=ONLY\nELSE\n"
    yield "*NODE FILE, OUTPUT=2D\nU, RF\n*EL FILE, OUTPUT=2D\nS\n*END STEP\n"


def _acting(force: Floats) -> Bools:
    rounding = 1e-14
    return np.asarray(np.abs(force) > rounding * np.abs(force).max())


def _node_set(name: str, members: Bools) -> Iterator[str]:
    if not members.any():
        return
    yield f"*NSET, NSET={name}\n"
    yield from rows("%d\n", np.flatnonzero(members) + 1)


def _set_name(text: str) -> str:
    word = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in text.upper())[:80]  # ccx's limit
    return word if word[:1].isalpha() else f"S{word}"


SUFFIX = ".beams.inp"
PIECES = 4  # number of elements per beam; with four elements, joints are up to 8 % too stiff in bending


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the .inp file with the beam model of a part."""
    for text in _cards(part.name, part.details.beam_model):
        yield text.encode("ascii", "replace")


def check(part: Part, path: Path) -> ReadBack:
    """Read the .inp file back. Raises ExportError if the beams or the nodes differ."""
    cards = path.read_text(encoding="ascii").split("\n*")
    frame = part.details.beam_model
    beams = sum(card.startswith("ELEMENT, TYPE=B32R") for card in cards)
    require_equal(part, "elements", PIECES * len(frame.ends), beams)
    lines = next(card for card in cards if card.startswith("NODE, NSET=ALL")).splitlines()[1:]
    points = np.array([line.split(",")[1:] for line in lines], dtype=np.float64)
    if not (np.abs(points - frame.points) <= NUMBERS_READ_BACK * np.abs(frame.points).max()).all():
        raise ExportError(
            f"the nodes of {part.name!r} have other coordinates when the file is read back; write saf.xlsx instead"
        )
    return ReadBack(beams, "elements")


def _cards(name: str, frame: "Frame") -> Iterator[str]:
    points, ends, n = frame.points, frame.ends, len(frame.points)
    yield f"** {one_line(name)}: {len(ends)} beams, written by dsfab {__version__}; units: metres, newtons, pascals\n"
    (
        yield "** The total force of the node set HELD is the reaction; at nodes with fixed rotations, this sum also "
        "includes the moments\n"
    )
    yield "*NODE, NSET=ALL\n"
    yield from rows("%d, %.11e, %.11e, %.11e\n", np.arange(1, n + 1), *points.T)
    yield "*NODE, NSET=BETWEEN\n"
    share = np.arange(1, 2 * PIECES)[:, None] / (2 * PIECES)
    between = np.concatenate([(1 - share) * points[i] + share * points[j] for i, j in ends])
    yield from rows("%d, %.11e, %.11e, %.11e\n", n + np.arange(1, len(between) + 1), *between.T)
    yield f"*MATERIAL, NAME=BEAMS\n*ELASTIC\n{frame.material.young:.12g}, {frame.material.poisson:.12g}\n"
    columns = zip(ends, frame.thickness, frame.width, frame.axes[:, 2], frame.beam_members, strict=True)
    for k, ((i, j), thickness, width, z, member) in enumerate(columns, 1):
        chain = [i + 1, *range(n + (k - 1) * (2 * PIECES - 1) + 1, n + k * (2 * PIECES - 1) + 1), j + 1]
        yield f"** {member or 'link'}\n"
        for piece in range(PIECES):
            nodes = ", ".join(map(str, chain[2 * piece : 2 * piece + 3]))
            yield f"*ELEMENT, TYPE=B32R, ELSET=B{k}\n{PIECES * (k - 1) + piece + 1}, {nodes}\n"
        yield f"*BEAM SECTION, ELSET=B{k}, MATERIAL=BEAMS, SECTION=RECT\n{thickness:.9g}, {width:.9g}\n"
        yield ", ".join(f"{value + 0.0:.9g}" for value in z) + "\n"
    yield f"*ELSET, ELSET=BEAMS, GENERATE\n1, {PIECES * len(ends)}\n"
    yield from _calculix_beams_supports(frame)
    for case, load in frame.all_loads.items():
        yield from _calculix_beams_step(case, load)


def _calculix_beams_supports(frame: "Frame") -> Iterator[str]:
    yield "*NSET, NSET=HELD\n" + "".join(f"{k + 1}\n" for k in np.flatnonzero(frame.fixed.any(axis=1)))
    yield "*BOUNDARY\n"
    node, direction = np.nonzero(frame.fixed)
    yield from rows("%d, %d, %d\n", node + 1, direction + 1, direction + 1)
    count = PIECES * len(frame.ends)
    for k, axis in np.argwhere(frame.spring > 0).tolist():
        count += 1
        yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING{count}\n{count}, {k + 1}\n"
        yield f"*SPRING, ELSET=SPRING{count}\n{axis + 1}\n{frame.spring[k, axis]:.11e}\n"


def _calculix_beams_step(case: str, load: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> Iterator[str]:
    yield f"** {one_line(case)}\n*STEP\n*STATIC\n*CLOAD, OP=NEW\n"
    node, direction = np.nonzero(load)
    if len(node):
        yield from rows("%d, %d, %.11e\n", node + 1, direction + 1, load[node, direction])
    yield "*NODE PRINT, NSET=ALL\nU\n*NODE PRINT, NSET=HELD, TOTALS=ONLY\nRF\n"
    yield "*EL PRINT, ELSET=BEAMS, TOTALS=ONLY\nELSE\n*NODE FILE\nU\n*END STEP\n"
