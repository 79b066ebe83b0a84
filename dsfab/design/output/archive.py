"""The archive `design.npz` of a design, from which dsfab writes further formats without solving again."""

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
from dsfab.results import EvenStripes, PatternResult, StripeSteering
from dsfab.slicing import Chart, Sheet
from dsfab.slicing.cutting.sheet import CutLines
from dsfab.surface import Surface, ply_chunks
from dsfab.surface.fields import CornerField, DividedField, DividedSurface
from dsfab.thickening import Repairs, Solid

Field = Floats | CornerField | DividedField
Arrays = dict[str, NDArray[Any]]
STEERED = ("along", "guided", "over")  # Fields of `StripeSteering` in the archive.


def field_arrays(key: str, field: Field) -> Arrays:
    """Return the arrays that store a field, by name; `key` is the name of a plain array of values."""
    if isinstance(field, DividedField):
        divided = field.divided
        rows = {"data": divided.weights.data, "indices": divided.weights.indices, "indptr": divided.weights.indptr}
        parts = {"V": divided.surface.V, "F": divided.surface.F, "parent": divided.parent, **rows}
        return {key: field.x, **{f"part_{name}": array for name, array in parts.items()}}
    if not isinstance(field, CornerField):
        return {key: field}
    integers = {f"{key}_{name}": _rounded_integers(getattr(field, name)) for name in ("sign", "shift")}
    arrays: Arrays = {key: field.x, **integers, f"{key}_blank": field.blank}
    return arrays if field.wanted is None else {**arrays, f"{key}_wanted": field.wanted}


def division_from(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> DividedSurface | None:
    """Return the surface with divided faces from the arrays part_V (p, 3), metres, part_F ...; None without them."""
    if "part_V" not in arrays:
        return None
    parts = Surface(arrays["part_V"], arrays["part_F"])
    rows = tuple(arrays[f"part_{name}"] for name in ("data", "indices", "indptr"))
    return DividedSurface(surface, parts, arrays["part_parent"], csr_array(rows, shape=(parts.n, surface.n)))


def field_from(key: str, divided: DividedSurface | None, arrays: Mapping[str, NDArray[Any]]) -> Field:
    """Return the field of the array `key`: values (n,) or (n, 2) at vertices, or at vertices of divided faces."""
    if f"{key}_sign" not in arrays:
        x = arrays[key]
        return DividedField(divided, x) if divided and len(x) == divided.surface.n else x
    sign, shift, blank = (arrays[f"{key}_{name}"] for name in ("sign", "shift", "blank"))
    return CornerField(arrays[key], sign, shift, blank, arrays.get(f"{key}_wanted"))


def even_arrays(even: EvenStripes) -> Arrays:
    arrays: Arrays = {"even_slope": even.slope, "even_density": even.density, "even_first": np.array(even.first)}
    for k, (phase, line_shares) in enumerate(zip(even.phases, even.wanted, strict=True)):
        arrays |= {f"even_{k}_value": phase.value, f"even_{k}_singular": phase.singular}
        arrays |= {f"even_{k}_sign": _rounded_integers(phase.sign), f"even_{k}_shift": _rounded_integers(phase.shift)}
        arrays[f"even_{k}_wanted"] = np.reshape(line_shares, (len(line_shares), len(phase.sign)))
    if even.forces is not None:
        arrays["even_forces"] = even.forces
    chart = even.chart
    rows = {"data": chart.weights.data, "indices": chart.weights.indices, "indptr": chart.weights.indptr}
    if steered := even.steered:
        arrays |= {f"even_steered_{name}": getattr(steered, name) for name in STEERED}
    mesh = {"V": chart.surface.V, "F": chart.surface.F, "parent": chart.parent, "z": chart.z, "scale": chart.scale}
    return arrays | {f"even_chart_{name}": array for name, array in (mesh | rows).items()}


def even_stripes_from(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> EvenStripes | None:
    """Return the evenly spaced stripes from arrays such as even_slope (n, 2); None without such arrays."""
    if "even_slope" not in arrays:
        return None
    names = ("value", "sign", "shift", "singular")
    major_phase, minor_phase = (CornerPhase(*(arrays[f"even_{k}_{name}"] for name in names)) for k in (0, 1))
    major, minor = (tuple(arrays[f"even_{k}_wanted"]) for k in (0, 1))
    part = {name: arrays[f"even_chart_{name}"] for name in ("V", "F", "parent", "z", "scale")}
    divided = Surface(part["V"], part["F"])
    rows = tuple(arrays[f"even_chart_{name}"] for name in ("data", "indices", "indptr"))
    weights = csr_array(rows, shape=(divided.n, surface.n))
    chart = Chart(divided, part["parent"].astype(np.int64), weights, part["z"], part["scale"])
    density, first_family = arrays["even_density"], int(arrays["even_first"])
    along, guided, over = (arrays.get(f"even_steered_{name}") for name in STEERED)
    steered = None if along is None or guided is None or over is None else StripeSteering(along, guided, over)
    lines = (major_phase, minor_phase), (major, minor), arrays["even_slope"], density, first_family, chart
    return EvenStripes(*lines, steered=steered, forces=arrays.get("even_forces"))


def _rounded_integers(array: Floats) -> NDArray[Any]:
    return np.rint(array).astype(np.int64)


NAME = "design.npz"
LAYOUT = 2  # Version of the archive; dsfab does not read other versions.
MADE_BY = tuple(stage for stage in STAGES if stage != "export")  # Sections of a preset that determine a design.
MESH = "surface.ply"  # File for a mesh from Python, metres, without rounding.
_BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


def with_mesh(preset: Preset, folder: Path, home: Path) -> Preset:
    """Return the preset for a folder: mesh files in the folder have no path, and curves replace references to drawings.
    folder : receives a mesh that is not in a file.    home : the final path of this folder.
    Raises SurfaceError for a missing drawing."""
    preset = preset.self_contained()
    section = preset.surface
    if isinstance(section, MeshSurface):
        (folder / MESH).write_bytes(b"".join(ply_chunks(section.mesh.V, section.mesh.F, "metre")))
        values = {key: getattr(section, key) for key in OwnSurface.model_fields}
        file_section = FileSurface.model_construct(**values, file=Path(MESH), unit="m")
    elif isinstance(section, FileSurface) and section.file.parent.absolute() == home.absolute():
        file_section = section.model_copy(update={"file": Path(section.file.name)})
    else:
        return preset
    return preset.model_copy(update={"surface": file_section})


def write_archive(design: Design, folder: Path, preset: Preset | None = None) -> Path:
    """Write the archive of a design into a folder; return its path. preset : default: that of the design."""
    pattern, sheet, solid, values = design.pattern, design.sheet, design.solid, design_fields(design)
    about = {
        "layout": LAYOUT,
        "dsfab": __version__,
        "preset": sections(preset or design.resolved_preset),
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
    sheet_arrays = {
        "V": sheet.surface.V,
        "F": sheet.surface.F,
        "parent": sheet.parent,
        "family": sheet.family,
        "sides_on": sheet.sides_on,
        **weights,
        **{f"line_{key}": array for key, array in vars(sheet.lines).items()},
    }
    arrays |= {f"sheet_{key}": array for key, array in sheet_arrays.items()} | {"solid_V": solid.V, "solid_F": solid.F}
    for key, group in (("levels", pattern.levels), ("half_width", pattern.half_widths)):
        arrays |= {f"{key}_{k}": array for k, array in enumerate(group)}
    for k, field in enumerate(pattern.fields):
        arrays |= field_arrays(f"field_{k}", field)
    if pattern.even:
        arrays |= even_arrays(pattern.even)
    arrays |= {f"value_{k}": array.astype(np.float32) for k, array in enumerate(values.values())}
    path = folder / NAME
    compact: dict[str, Any] = {key: _compact(array) for key, array in arrays.items()}
    np.savez_compressed(path, **compact)
    return path


def read_archive(folder: Path, preset: Preset) -> Design | None:
    """Return the design in a folder; None if the folder contains no design of this preset."""
    try:
        with open(folder / NAME, "rb") as file, np.load(file) as archive:
            about = json.loads(str(archive["about"]))
            if about["layout"] != LAYOUT or about["preset"] != sections(with_mesh(preset, folder, folder)):
                return None
            return _read(archive, about, preset)
    except _BROKEN:
        return None


def sections(preset: Preset) -> dict[str, Any]:
    """Return the sections that determine a design, as JSON, with the values of a material in place of its name."""
    values: dict[str, Any] = json.loads(preset.model_dump_json(include=set(MADE_BY), exclude={"statics": {"material"}}))
    return values


def _read(archive: Any, about: dict[str, Any], preset: Preset) -> Design:
    surface, sheet = Surface(archive["V"], archive["F"]), Surface(archive["sheet_V"], archive["sheet_F"])
    rows = archive["sheet_data"], archive["sheet_indices"], archive["sheet_indptr"]
    weights = csr_array(rows, shape=(sheet.n, surface.n))
    lines = CutLines(*(archive[f"sheet_line_{key}"] for key in ("kind", "field", "number", "circle")))
    names, solid_facts = about["names"], about["solid"]
    levels, half_widths = (
        tuple(archive[f"{key}_{k}"] for k in range(len(names)) if f"{key}_{k}" in archive)
        for key in ("levels", "half_width")
    )
    divided = division_from(surface, archive)
    fields = tuple(field_from(f"field_{k}", divided, archive) for k in range(len(names)))
    choice = about["factor"], tuple(about["frequency"]), tuple(about["mode"]), tuple(about["phase"])
    even = even_stripes_from(surface, archive)
    pattern = PatternResult(tuple(names), fields, levels, half_widths, *choice, even=even)
    columns = archive["sheet_parent"], archive["sheet_family"]
    repairs = Repairs(rung=solid_facts["rung"])
    return Design.from_results(
        preset,
        surface=surface,
        pattern=pattern,
        sheet=Sheet(sheet, *columns, weights, 0, archive["sheet_sides_on"], lines),
        solid=Solid(
            archive["solid_V"], archive["solid_F"], solid_facts["genus"], solid_facts["pieces"], repairs=repairs
        ),
        fields={name: archive[f"value_{k}"].astype(np.float64) for k, name in enumerate(about["values"])},
    )


def _compact(array: NDArray[Any]) -> NDArray[Any]:
    if array.dtype == np.int64 and (not array.size or np.abs(array).max() < 2**31):
        return array.astype(np.int32)
    return array
