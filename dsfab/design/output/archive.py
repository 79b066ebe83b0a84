"""`design.npz`: the archive of a design, from which other formats are written without solving again."""

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.design.design import Design
from dsfab.design.output.fields import design_fields
from dsfab.pattern import CornerPhase
from dsfab.preset.model import STAGES, Preset
from dsfab.preset.surface_section import FileSurface, MeshSurface, OwnSurface
from dsfab.results import EvenStripes, PatternResult, Steered
from dsfab.slicing import Chart, Sheet
from dsfab.surface import Surface, ply_chunks
from dsfab.surface.fields import CornerField, Divided, DividedField
from dsfab.thickening import Repairs, Solid

Field = Floats | CornerField | DividedField
Arrays = dict[str, NDArray[Any]]
STEERED = ("along", "guided", "over")
"""Fields of `Steered` in the archive; its message is among the notes."""


def field_arrays(key: str, field: Field) -> Arrays:
    """Return the arrays of a field; a field without corners is one array with the name `key`."""
    if isinstance(field, DividedField):
        divided = field.divided
        rows = {"data": divided.weights.data, "indices": divided.weights.indices, "indptr": divided.weights.indptr}
        parts = {"V": divided.surface.V, "F": divided.surface.F, "parent": divided.parent, **rows}
        return {key: field.x, **{f"part_{name}": array for name, array in parts.items()}}
    if not isinstance(field, CornerField):
        return {key: field}
    seen = {"sign": _whole(field.sign), "shift": _whole(field.shift), "blank": field.blank}
    wanted = {} if field.wanted is None else {"wanted": field.wanted}
    return {key: field.x, **{f"{key}_{name}": array for name, array in (seen | wanted).items()}}


def division_of(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> Divided | None:
    """Return the division of a surface's faces from arrays part_V (p, 3), metres, part_F ...; None without these."""
    if "part_V" not in arrays:
        return None
    parts = Surface(arrays["part_V"], arrays["part_F"])
    rows = tuple(arrays[f"part_{name}"] for name in ("data", "indices", "indptr"))
    return Divided(surface, parts, arrays["part_parent"], csr_array(rows, shape=(parts.n, surface.n)))


def field_of(key: str, divided: Divided | None, arrays: Mapping[str, NDArray[Any]]) -> Field:
    """Return the field with the array `key`, (n,) or (n, 2), perhaps on parts of faces."""
    if f"{key}_sign" not in arrays:
        x = arrays[key]
        return DividedField(divided, x) if divided and len(x) == divided.surface.n else x
    sign, shift, blank = (arrays[f"{key}_{name}"] for name in ("sign", "shift", "blank"))
    return CornerField(arrays[key], sign, shift, blank, arrays.get(f"{key}_wanted"))


def even_arrays(even: EvenStripes) -> Arrays:
    """Return the arrays of evenly spaced stripes."""
    found: Arrays = {"even_slope": even.slope, "even_density": even.density, "even_first": np.array(even.first)}
    for k, (phase, wanted) in enumerate(zip(even.phases, even.wanted, strict=True)):
        found |= {f"even_{k}_value": phase.value, f"even_{k}_singular": phase.singular}
        found |= {f"even_{k}_sign": _whole(phase.sign), f"even_{k}_shift": _whole(phase.shift)}
        found[f"even_{k}_wanted"] = np.reshape(wanted, (len(wanted), len(phase.sign)))
    if even.forces is not None:
        found["even_forces"] = even.forces
    chart = even.chart
    rows = {"data": chart.weights.data, "indices": chart.weights.indices, "indptr": chart.weights.indptr}
    if steered := even.steered:
        found |= {f"even_steered_{name}": getattr(steered, name) for name in STEERED}
    whole = {"V": chart.surface.V, "F": chart.surface.F, "parent": chart.parent, "z": chart.z, "scale": chart.scale}
    return found | {f"even_chart_{name}": array for name, array in (whole | rows).items()}


def even_of(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> EvenStripes | None:
    """Return the evenly spaced stripes of these arrays, such as even_slope (n, 2); None without these."""
    if "even_slope" not in arrays:
        return None
    one, two = (_phase(arrays, k) for k in (0, 1))
    major, minor = (tuple(arrays[f"even_{k}_wanted"]) for k in (0, 1))
    part = {name: arrays[f"even_chart_{name}"] for name in ("V", "F", "parent", "z", "scale")}
    divided = Surface(part["V"], part["F"])
    rows = tuple(arrays[f"even_chart_{name}"] for name in ("data", "indices", "indptr"))
    weights = csr_array(rows, shape=(divided.n, surface.n))
    chart = Chart(divided, part["parent"].astype(np.int64), weights, part["z"], part["scale"])
    density, first = arrays["even_density"], int(arrays["even_first"])
    along, guided, over = (arrays.get(f"even_steered_{name}") for name in STEERED)
    steered = None if along is None or guided is None or over is None else Steered(along, guided, over)
    lines, forces = ((one, two), (major, minor), arrays["even_slope"], density, first, chart), arrays.get("even_forces")
    return EvenStripes(*lines, steered=steered, forces=forces)


def _whole(array: Floats) -> NDArray[Any]:
    return np.rint(array).astype(np.int64)


def _phase(arrays: Mapping[str, NDArray[Any]], k: int) -> CornerPhase:
    value, sign, shift, singular = (arrays[f"even_{k}_{name}"] for name in ("value", "sign", "shift", "singular"))
    return CornerPhase(value, sign, shift, singular)


NAME = "design.npz"
LAYOUT = 1
"""Version of the archive; other versions are not read."""

MADE_BY = tuple(stage for stage in STAGES if stage != "export")
"""Sections of a preset that determine a design; `export` determines the files only."""

MESH = "surface.ply"
"""File of a mesh that Python held, metres, to the last bit."""

_BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


def with_mesh(preset: Preset, folder: Path, home: Path) -> Preset:
    """Return the preset for a folder: meshes in the folder have no path, and curves of drawings are in the preset.

    folder : receives a mesh that no file holds.  home : the same folder, by its final name.
    Raises SurfaceError for a missing drawing.
    """
    preset = preset.self_contained()
    given = preset.surface
    if isinstance(given, MeshSurface):
        (folder / MESH).write_bytes(b"".join(ply_chunks(given.mesh.V, given.mesh.F, "metre")))
        values = {key: getattr(given, key) for key in OwnSurface.model_fields}
        there = FileSurface.model_construct(**values, file=Path(MESH), unit="m")
    elif isinstance(given, FileSurface) and given.file.parent.absolute() == home.absolute():
        there = given.model_copy(update={"file": Path(given.file.name)})
    else:
        return preset
    return preset.model_copy(update={"surface": there})


def write_archive(design: Design, folder: Path, preset: Preset | None = None) -> Path:
    """Write the archive of a design into a folder, as made by `preset` (by default its own); return its path."""
    pattern, sheet, solid, values = design.pattern, design.sheet, design.solid, design_fields(design)
    about = {
        "layout": LAYOUT,
        "dsfab": __version__,
        "preset": sections(preset or design.settled),
        "names": pattern.names,
        "factor": pattern.factor,
        "frequency": pattern.frequency,
        "mode": pattern.mode,
        "phase": pattern.phase,
        "solid": {"genus": solid.genus, "pieces": solid.pieces, "rung": solid.repairs.rung},
        "values": list(values),
    }
    arrays = {"about": np.array(json.dumps(about)), "V": design.surface.V, "F": design.surface.F}
    weights = {"data": sheet.weights.data, "indices": sheet.weights.indices, "indptr": sheet.weights.indptr}
    whole = {"V": sheet.surface.V, "F": sheet.surface.F, "parent": sheet.parent, "family": sheet.family, **weights}
    arrays |= {f"sheet_{key}": array for key, array in whole.items()} | {"solid_V": solid.V, "solid_F": solid.F}
    for key, group in (("levels", pattern.levels), ("half_width", pattern.half_widths)):
        arrays |= {f"{key}_{k}": array for k, array in enumerate(group)}
    for k, field in enumerate(pattern.fields):
        arrays |= field_arrays(f"field_{k}", field)
    if pattern.even:
        arrays |= even_arrays(pattern.even)
    arrays |= {f"value_{k}": array.astype(np.float32) for k, array in enumerate(values.values())}
    path = folder / NAME
    short: dict[str, Any] = {key: _short(array) for key, array in arrays.items()}
    np.savez_compressed(path, **short)
    return path


def read_archive(folder: Path, preset: Preset) -> Design | None:
    """Return the design in a folder, or None if it has no design of this preset."""
    try:
        with open(folder / NAME, "rb") as file, np.load(file) as archive:
            about = json.loads(str(archive["about"]))
            if about["layout"] != LAYOUT or about["preset"] != sections(with_mesh(preset, folder, folder)):
                return None
            return _read(archive, about, preset)
    except _BROKEN:
        return None


def sections(preset: Preset) -> dict[str, Any]:
    """Return the sections that determine a design, as JSON; a material by its values, not by its name."""
    found: dict[str, Any] = json.loads(preset.model_dump_json(include=set(MADE_BY), exclude={"statics": {"material"}}))
    return found


def _read(archive: Any, about: dict[str, Any], preset: Preset) -> Design:
    surface, sheet = Surface(archive["V"], archive["F"]), Surface(archive["sheet_V"], archive["sheet_F"])
    rows = archive["sheet_data"], archive["sheet_indices"], archive["sheet_indptr"]
    weights = csr_array(rows, shape=(sheet.n, surface.n))
    names, said = about["names"], about["solid"]
    levels, half_widths = (
        tuple(archive[f"{key}_{k}"] for k in range(len(names)) if f"{key}_{k}" in archive)
        for key in ("levels", "half_width")
    )
    divided = division_of(surface, archive)
    fields = tuple(field_of(f"field_{k}", divided, archive) for k in range(len(names)))
    pattern = PatternResult(
        tuple(names),
        fields,
        levels,
        half_widths,
        about["factor"],
        tuple(about["frequency"]),
        tuple(about["mode"]),
        tuple(about["phase"]),
        even=even_of(surface, archive),
    )
    repairs = Repairs(rung=said["rung"])
    return Design.known(
        preset,
        surface=surface,
        pattern=pattern,
        sheet=Sheet(sheet, archive["sheet_parent"], archive["sheet_family"], weights),
        solid=Solid(archive["solid_V"], archive["solid_F"], said["genus"], said["pieces"], repairs=repairs),
        fields={name: archive[f"value_{k}"].astype(np.float64) for k, name in enumerate(about["values"])},
    )


def _short(array: NDArray[Any]) -> NDArray[Any]:
    if array.dtype == np.int64 and (not array.size or np.abs(array).max() < 2**31):
        return array.astype(np.int32)
    return array
