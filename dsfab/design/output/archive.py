"""Lines and fields of a design, and the archive `design.npz`."""

import json
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.design.design import Design
from dsfab.pattern import CornerPhase, distance_to_boundary, distance_to_vertices
from dsfab.pattern.stripes import wave
from dsfab.preset.model import STAGES, Preset
from dsfab.preset.surface_section import FileSurface, MeshSurface, OwnSurface
from dsfab.results import EvenStripes, PatternResult, StripeSteering
from dsfab.slicing import Chart, Sheet, Tidy
from dsfab.slicing.cutting.sheet import ON_SIMPLEX, CutLines
from dsfab.slicing.measures.lines import STRIPES, CornerLines, Phase, centre_lines, chart_lines, edge_lines
from dsfab.surface import StructureLine, Surface, ply_chunks, simplified_line
from dsfab.surface.fields import CornerField, DividedField, DividedSurface
from dsfab.thickening import Repairs, Solid


def design_lines(design: Design, tolerance: float = 0.0) -> tuple[StructureLine, ...]:
    """Return the edges of the sheet and the centre lines of members, metres.
    tolerance : largest distance (m) between a line and its simplification."""
    pattern, sheet, surface = design.pattern, design.sheet, design.surface
    phases = [stripe_phase(design, k) for k in range(len(pattern.names))]
    lines = edge_lines(sheet, surface, pattern.names, phases)
    half_widths = dict(zip(pattern.names, pattern.half_widths, strict=True))
    for k, name in enumerate(pattern.names):
        z, d = phases[k], half_widths[name]
        if z is None or pattern.names.index(name) < k or not ((d > 0).any() and (d < 0.5).any()):
            continue  # without stripes, or with stripes that touch everywhere, there are no centre lines
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            lines += chart_lines(sheet, surface, pattern.names, name, pattern.even.chart, d)
        else:
            lines += centre_lines(sheet, name, z, d)
    return tuple(replace(line, points=simplified_line(line.points, tolerance)) for line in lines)


def stripe_phase(design: Design, k: int) -> Phase:
    """Return the stripe phase of field k of the pattern, which is a whole number on each centre line.
    The values are at vertices (n,) or at corners of faces. None for a field without stripes."""
    pattern = design.pattern
    field = pattern.fields[k]
    if pattern.names[k] not in STRIPES:
        return None
    if isinstance(field, CornerField):
        return CornerLines(field, pattern.levels[k])
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return np.asarray(field.mean(axis=1))
    which = STRIPES.index(pattern.names[k])
    return np.asarray(pattern.frequency[which] * field + pattern.phase[which])


def design_fields(design: Design) -> dict[str, Floats]:
    """Return results such as displacement and stress by name, at vertices (n, ...) or on faces (m, ...)."""
    statics, tensors = design.statics, design.diffusion.tensors
    fields = {
        "force [N]": design.load.force,
        "held [1]": design.load.fixed.astype(np.float64),
        "loaded [1]": design.load.loaded.astype(np.float64),
    }
    cases = statics.cases if len(statics.cases) > 1 else {"": statics}
    for name, case in cases.items():
        tail = f" {name}" if name else ""
        fields[f"displacement{tail} [m]"] = case.equilibrium.u
        fields[f"stress{tail} [Pa]"] = case.sigma
    fields["principal stress x gamma [Pa]"] = tensors.principal
    fields["isotropic [1]"] = tensors.isotropic.astype(np.float64)
    for family, modes in (("major", design.diffusion.major), ("minor", design.diffusion.minor)):
        fields |= {f"{family} mode {k} [1]": modes.mode(k) for k in range(1, len(modes.lam) + 1)}
    pattern = design.pattern
    for name, away in _distances(design).items():
        fields[f"{name} distance [m]"] = away
    for k, name in enumerate(pattern.names):
        z = stripe_phase(design, k)
        if z is None:
            continue
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            fields |= _even_fields(pattern.even, STRIPES.index(name))
        else:
            fields |= {f"{name} phase [1]": z, f"{name} wave [1]": wave(z)}
        fields[f"{name} half-width [1]"] = np.asarray(pattern.half_widths[k])
    return fields


def _distances(design: Design) -> dict[str, Floats]:
    options, surface = design.preset.pattern, design.surface
    distances = {}
    if options.keep and "keep" in design.pattern.names:
        distances["keep"] = distance_to_vertices(surface, design.load.supported | design.load.loaded, options.keep)
    if options.rim and "rim" in design.pattern.names:
        distances["rim"] = distance_to_boundary(surface, options.rim)
    return {name: np.where(np.isfinite(away), away, surface.size) for name, away in distances.items()}


def _even_fields(even: EvenStripes, family: int) -> dict[str, Floats]:
    name, chart, density = STRIPES[family], even.chart, even.density[:, family]
    weights = chart.weights.tocoo()
    row, vertex = (index.astype(np.int64) for index in weights.coords)
    on_vertex = (weights.data >= ON_SIMPLEX) & (chart.scale[row, family] > 0)
    z = chart.z[row[on_vertex], family]
    distance = np.full(len(density), 0.5)  # in periods; 0.5 at vertices without a phase
    np.minimum.at(distance, vertex[on_vertex], np.abs(z - np.rint(z)))
    return {
        f"{name} middle [m]": distance / density,
        f"{name} density [1/m]": np.asarray(density),
        f"{name} wave [1]": wave(distance),
    }


Field = Floats | CornerField | DividedField
Arrays = dict[str, NDArray[Any]]
STEERED = ("along", "guided", "over")  # Fields of `StripeSteering` in the archive.


def field_arrays(key: str, field: Field) -> Arrays:
    """Return the arrays that store a field in the archive, by name. key : name of the array that holds the values."""
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
    """Read the divided surface from stored arrays, such as part_V (p, 3) in metres; None if they are missing."""
    if "part_V" not in arrays:
        return None
    parts = Surface(arrays["part_V"], arrays["part_F"])
    rows = tuple(arrays[f"part_{name}"] for name in ("data", "indices", "indptr"))
    return DividedSurface(surface, parts, arrays["part_parent"], csr_array(rows, shape=(parts.n, surface.n)))


def field_from(key: str, divided: DividedSurface | None, arrays: Mapping[str, NDArray[Any]]) -> Field:
    """Return the field that `field_arrays` stored under `key`. divided : result of `division_from`."""
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
    """Read the evenly spaced stripes from stored arrays, such as even_slope (n, 2); None if they are missing."""
    if "even_slope" not in arrays:
        return None

    def phase(k: int) -> CornerPhase:
        value, sign, shift, singular = (arrays[f"even_{k}_{name}"] for name in ("value", "sign", "shift", "singular"))
        return CornerPhase(value, sign, shift, singular)

    major_phase, minor_phase = phase(0), phase(1)
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


def tidy_arrays(tidy: Tidy) -> Arrays:
    columns = {"astray": tidy.astray, "closed": tidy.closed}
    of_fields = {f"tidy_{name}_{k}": x for name, column in columns.items() for k, x in enumerate(column)}
    striped = {"tidy_striped": np.array(tidy.striped), "tidy_anchor": tidy.anchor}
    return striped | {name: x for name, x in of_fields.items() if x is not None}


def tidy_from(arrays: Mapping[str, NDArray[Any]]) -> Tidy | None:
    """Read the rules for the removal of loose stripe ends from stored arrays; None if they are missing."""
    if "tidy_striped" not in arrays:
        return None
    striped = tuple(arrays["tidy_striped"].tolist())
    astray, closed = (
        tuple(arrays.get(f"tidy_{name}_{k}") for k in range(len(striped))) for name in ("astray", "closed")
    )
    return Tidy(striped, astray, arrays["tidy_anchor"], closed)


def _rounded_integers(array: Floats) -> NDArray[Any]:
    return np.rint(array).astype(np.int64)


NAME = "design.npz"
LAYOUT = 3  # Version of the archive; dsfab does not read other versions.
MADE_BY = tuple(stage for stage in STAGES if stage != "export")  # Sections of a preset that determine a design.
MESH = "surface.ply"  # File for a mesh that came from Python; metres, not rounded.
_BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


def with_mesh(preset: Preset, folder: Path, home: Path) -> Preset:
    """Return the preset to write into the folder of a build; write a mesh that came from Python to a file in `folder`.
    home : final path of `folder` after the build. Raises SurfaceError if a drawing file is missing."""
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
    """Write the archive of a design into a folder; return the path."""
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
    if pattern.tidy:
        arrays |= tidy_arrays(pattern.tidy)
    arrays |= {f"value_{k}": array.astype(np.float32) for k, array in enumerate(values.values())}
    path = folder / NAME
    compact: dict[str, Any] = {key: _compact(array) for key, array in arrays.items()}
    np.savez_compressed(path, **compact)
    return path


def read_archive(folder: Path, preset: Preset) -> Design | None:
    """Return the design that is stored in a folder; None if the folder has no design of `preset`."""
    try:
        with open(folder / NAME, "rb") as file, np.load(file) as archive:
            about = json.loads(str(archive["about"]))
            if about["layout"] != LAYOUT or about["preset"] != sections(with_mesh(preset, folder, folder)):
                return None
            return _read(archive, about, preset)
    except _BROKEN:
        return None


def sections(preset: Preset) -> dict[str, Any]:
    """Return the sections of a preset that determine a design, as JSON values by section."""
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
    tidy = tidy_from(archive)
    pattern = PatternResult(tuple(names), fields, levels, half_widths, *choice, even=even, tidy=tidy)
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
