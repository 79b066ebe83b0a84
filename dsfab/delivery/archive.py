"""`design.npz`: what a build keeps of a design, so that other formats are written from it without making it again.

A zip of NumPy arrays (`numpy.load` opens it), SI units; whole numbers are of 32 bits.

    about            JSON: version of this layout, of dsfab, the sections of the preset, numbers of pattern and solid
    V, F             the uncut surface
    sheet_...        V, F of the kept sheet; parent and family of its cells; the rows of its weights on the surface
    field_k, levels_k, half_width_k   of the k-th name of the pattern; evenly spaced: see `dsfab.delivery.archive_even`
    solid_V, solid_F the solid
    value_k          what a VTU file shows, in single precision: it takes most of the room
"""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from dsfab import __version__
from dsfab.delivery.archive_even import division_of, even_arrays, even_of, field_arrays, field_of
from dsfab.delivery.fields import design_fields
from dsfab.pipeline.design import Design
from dsfab.preset import STAGES, Preset
from dsfab.preset_surface import FileSurface, MeshSurface, OwnSurface
from dsfab.results import PatternResult
from dsfab.slicing import Sheet
from dsfab.surface import Surface, ply_chunks
from dsfab.thickening import Repairs, Solid

NAME = "design.npz"
LAYOUT = 1
"""Raised whenever what is inside changes its meaning; other layouts are not read."""

MADE_BY = tuple(stage for stage in STAGES if stage != "export")
"""Sections of a preset that a design is made by; the last one says how it is written only."""

MESH = "surface.ply"
"""The mesh of a design whose preset has none in a file: metres, every bit of it."""

_BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


def with_mesh(preset: Preset, folder: Path, home: Path) -> Preset:
    """The preset as a folder holds it: a mesh that lies in it, or that Python held, is named without a path; curves of
    drawings are in the preset.

    folder : where the mesh is written if no file holds it.  home : the same folder, by the name that it will have.
    Raises SurfaceError for a drawing that is not there any more.
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
    """Write the archive of a design into a folder, as made by `preset` (its own where left out); returns its path."""
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
    """The design that a folder holds, or None where it holds none that this preset would make."""
    try:
        with open(folder / NAME, "rb") as file, np.load(file) as archive:
            about = json.loads(str(archive["about"]))
            if about["layout"] != LAYOUT or about["preset"] != sections(with_mesh(preset, folder, folder)):
                return None
            return _read(archive, about, preset)
    except _BROKEN:
        return None


def sections(preset: Preset) -> dict[str, Any]:
    """What a design is made by, as JSON has it: of a material the values, however it is called."""
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
    """Whole numbers in 32 bits, if they fit."""
    if array.dtype == np.int64 and (not array.size or np.abs(array).max() < 2**31):
        return array.astype(np.int32)
    return array
