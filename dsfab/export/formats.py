"""The formats, one entry each, and `write`, which turns a solid or a sheet into a file."""

import difflib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.analysis import calculix, opensees, saf, vtu
from dsfab.export.bim import ifc
from dsfab.export.cad import rhino
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.strategies import Estimate, estimates
from dsfab.export.drawing import dxf, svg
from dsfab.export.mesh import gltf, triangles
from dsfab.export.part import Details, Part, Route, StepOptions, part_of
from dsfab.export.readback import ReadBack, with_shapes, with_single_shapes
from dsfab.export.tables import forces, geometry
from dsfab.export.writing import atomic_file, write_chunks
from dsfab.surface.mesh import Surface
from dsfab.thickening.solid import Solid

Takes = Literal["mesh", "lines", "both", "fields", "members", "bodies", "forces", "frame", "bars", "utilisation"]


@dataclass(frozen=True)
class Format:
    """A format of files.

    prepare : returns the part with the format's rounding.    encode : returns the bytes.
    check   : reads the file back; raises ExportError if the content differs.
    """

    prepare: Callable[[Part], Part]
    encode: Callable[[Part], Iterator[bytes]]
    check: Callable[[Part, Path], ReadBack]
    sheets: bool
    """Whether the format can hold an open sheet."""
    attempts: Callable[[Part], Iterable[Part | ExportError]] = lambda part: (part,)
    """Alternatives of the part, the best first; `write` takes the first that passes the check. An ExportError in place
    of a part is an alternative that is refused without a trial.
    """
    told: Callable[[Part, Sequence[ExportError]], str] = lambda part, refused: ""
    """Line about the alternative that `write` took, from the refusals before it."""
    refusal: Callable[[Sequence[ExportError]], ExportError] = lambda refused: refused[-1]
    """The error to raise if `write` refused all alternatives."""
    takes: Takes = "mesh"
    """Content: a mesh; lines on a sheet; a solid and lines; fields; members; members as bodies; section forces; the
    beam model; member forces; or their utilisation.
    """
    curves: bool = False
    """Whether the format needs exact lines because it holds smooth curves."""
    ready: Callable[[], None] = lambda: None
    """Raises ExportError if a library of the format is not installed."""


@dataclass(frozen=True)
class Written:
    """A file that was written and read back.

    size : bytes.    seconds : wall time of both steps.    found : content by the second reader.
    """

    path: Path
    size: int
    seconds: float
    found: ReadBack

    @property
    def summary(self) -> str:
        """Summary: 'step: 2.23 MB, 1,408 faces, volume error 3e-04, 16 s'."""
        seconds = f"{self.seconds:.2g}" if self.seconds < 100 else f"{self.seconds:.0f}"
        return f"{suffix_of(self.path)[1:]}: {self.size / 1e6:.3g} MB, {self.found.summary}, {seconds} s"


_STEP = Format(
    strategies.prepare,
    file.encode,
    file.check,
    sheets=False,
    attempts=strategies.attempts,
    told=strategies.route_sentence,
    refusal=strategies.refusal,
)

FORMATS: dict[str, Format] = {
    ".stl": Format(triangles.prepare_stl, triangles.encode_stl, triangles.check_stl, sheets=True),
    ".3mf": Format(triangles.prepare_3mf, triangles.encode_3mf, triangles.check_3mf, sheets=False),
    ".step": _STEP,
    ".stp": _STEP,
    ".stpz": replace(_STEP, encode=file.encode_compressed, check=file.check_compressed),
    ".lines.step": Format(
        file.prepare_lines, file.encode_lines, file.check_lines_file, sheets=True, takes="lines", curves=True
    ),
    ".brep": replace(_STEP, encode=file.encode_brep, check=file.check_brep, told=file.route_sentence),
    ".ifc": Format(ifc.prepare, ifc.encode, ifc.check, sheets=False, ready=ifc.require_ifcopenshell),
    ".obj": Format(triangles.prepare_obj, triangles.encode_obj, triangles.check_obj, sheets=True),
    ".ply": Format(triangles.prepare_ply, triangles.encode_ply, triangles.check_ply, sheets=True),
    ".off": Format(triangles.prepare_off, triangles.encode_off, triangles.check_off, sheets=True),
    ".glb": Format(gltf.prepare, gltf.encode, gltf.check, sheets=True),
    ".3dm": Format(
        rhino.prepare, rhino.encode, rhino.check, sheets=True, takes="both", curves=True, ready=rhino.require_rhino3dm
    ),
    ".dxf": Format(dxf.prepare, dxf.encode, dxf.check, sheets=True, takes="lines", curves=True),
    ".svg": Format(svg.prepare, svg.encode, svg.check, sheets=True, takes="lines"),
    ".csv": Format(geometry.prepare_csv, geometry.encode_csv, geometry.check_csv, sheets=True, takes="lines"),
    ".json": Format(geometry.prepare_json, geometry.encode_json, geometry.check_json, sheets=True, takes="lines"),
    ".members.json": Format(
        geometry.prepare_members,
        geometry.encode_members_json,
        geometry.check_members_json,
        sheets=True,
        takes="members",
    ),
    ".members.csv": Format(
        geometry.prepare_members, geometry.encode_members, geometry.check_members, sheets=True, takes="members"
    ),
    ".nodes.csv": Format(
        geometry.prepare_members, geometry.encode_nodes, geometry.check_nodes, sheets=True, takes="members"
    ),
    ".members.3dm": Format(
        with_single_shapes,
        rhino.encode_members,
        rhino.check_members,
        sheets=True,
        takes="bodies",
        ready=rhino.require_rhino3dm,
    ),
    ".members.ifc": Format(
        with_shapes, ifc.encode_members, ifc.check_members, sheets=True, takes="bodies", ready=ifc.require_ifcopenshell
    ),
    ".members.glb": Format(with_single_shapes, gltf.encode_members, gltf.check_members, sheets=True, takes="bodies"),
    ".members.dxf": Format(with_shapes, dxf.encode_members, dxf.check_members, sheets=True, takes="bodies"),
    ".vtu": Format(vtu.prepare, vtu.encode, vtu.check, sheets=True, takes="fields"),
    ".forces.vtu": Format(forces.prepare_fields, vtu.encode, vtu.check, sheets=True, takes="forces"),
    ".forces.csv": Format(forces.prepare_sheet, forces.encode_sheet, forces.check_sheet, sheets=True, takes="forces"),
    ".member_forces.csv": Format(
        forces.prepare_members, forces.encode_members, forces.check_members, sheets=True, takes="bars"
    ),
    ".member_forces.xlsx": Format(
        forces.prepare_members,
        forces.encode_workbook,
        forces.check_workbook,
        sheets=True,
        takes="bars",
        ready=saf.require_xlsxwriter,
    ),
    ".member_utilisation.csv": Format(
        forces.prepare_utilisation,
        forces.encode_utilisation,
        forces.check_utilisation,
        sheets=True,
        told=forces.sentence,
        takes="utilisation",
    ),
    opensees.SUFFIX: Format(
        saf.prepare, opensees.encode, opensees.check, sheets=True, told=saf.agreement_text, takes="frame"
    ),
    calculix.SUFFIX: Format(
        saf.prepare, calculix.encode, calculix.check, sheets=True, told=saf.agreement_text, takes="frame"
    ),
    saf.SUFFIX: Format(
        saf.prepare,
        saf.encode,
        saf.check,
        sheets=True,
        told=saf.agreement_text,
        takes="frame",
        ready=saf.require_xlsxwriter,
    ),
}
"""Formats by suffix."""


def write(
    thing: Solid | Surface,
    path: str | Path,
    *,
    name: str | None = None,
    step: StepOptions | Route = "auto",
    details: Details | None = None,
    note: Callable[[str], None] | None = None,
    report: Callable[[Written], None] | None = None,
) -> Path:
    """Write a solid or a sheet in the format of the suffix of `path`, read it back, and return the path.

    thing   : metres. Files are in millimetres (.glb in metres, as its standard demands) and name the unit if they can.
    name    : name of the part in the file; by default the file's name without suffix.
    step    : options of STEP files, or the word for the route alone.
    details : lines, fields and facts, for the formats that hold them.
    note    : called with a line on the route of a STEP file and the reasons against better routes.
    report  : called with size, seconds, triangles or faces, and the error of the volume.

    Equal input gives equal bytes. A second reader must find the same closed triangles and the same volume (area of a
    sheet) to 0.1 %; then the file takes its name in one step. A failure leaves an older file as it was.
    Raises ExportError: unknown suffix, a missing library, a sheet where the format needs a solid, no lines, a shape
    that the format cannot hold, too many faces for STEP, no permission or space, and a file that reads back different.
    """
    begin, path = time.perf_counter(), Path(path)
    form = format_of(path)
    form.ready()
    part = part_of(thing, path.name[: -len(suffix_of(path))] if name is None else name)
    if not (part.is_solid or form.sheets):
        open_formats = ", ".join(suffix for suffix, f in FORMATS.items() if f.sheets)
        raise ExportError(
            f"a {path.suffix.lower()} file holds closed solids and {part.name!r} is an open sheet; "
            f"thicken it first, or write {open_formats}"
        )
    part = form.prepare(_with_options(part, step, details))
    with atomic_file(path) as temporary:
        attempt, refused, readback = _put(form, part, temporary)
    if note and (how := form.told(attempt, refused)):
        note(how)
    if report:
        report(Written(path, path.stat().st_size, time.perf_counter() - begin, readback))
    return path


def step_estimates(
    thing: Solid | Surface, *, name: str = "part", step: StepOptions | Route = "auto", details: Details | None = None
) -> tuple[Estimate, ...]:
    """Estimate the cost of each route to a STEP file of a solid; keywords as in `write`. No file is written."""
    part = part_of(thing, name)
    if not part.is_solid:
        raise ExportError(f"STEP holds closed solids and {name!r} is an open sheet; thicken it first")
    return estimates(strategies.prepare(_with_options(part, step, details)))


def _with_options(part: Part, step: StepOptions | str, details: Details | None) -> Part:
    options = StepOptions(step) if isinstance(step, str) else step
    if options.route not in strategies.ROUTES:
        raise ExportError(
            f"step = {options.route!r} names no way to write STEP; use one of {', '.join(strategies.ROUTES)}"
        )
    marked = np.zeros((0, 3)) if options.corners is None else MM_PER_M * np.asarray(options.corners, dtype=np.float64)
    return replace(
        part,
        details=(details or Details()).scaled_by(MM_PER_M),
        step="smooth" if options.route == "compact" else options.route,
        step_faces=options.faces,
        step_mb=options.megabytes,
        tolerance=MM_PER_M * options.tolerance,
        corners=marked,
        curved=options.curved,
    )


def _put(form: Format, part: Part, temporary: Path) -> tuple[Part, list[ExportError], ReadBack]:
    refused = list[ExportError]()
    for attempt in form.attempts(part):
        if isinstance(attempt, ExportError):
            refused.append(attempt)
            continue
        try:
            write_chunks(temporary, form.encode(attempt))
            readback = form.check(attempt, temporary)
        except ExportError as error:
            refused.append(error)
            temporary.unlink(missing_ok=True)
        else:
            return attempt, refused, readback
    raise form.refusal(refused)


def suffix_of(path: Path) -> str:
    """Return the suffix in lower case; two words if they name a format: `.lines.step`, and `members.json` alone."""
    double = "".join(path.suffixes[-2:]).lower()
    file_name = f".{path.name}".lower() if path.suffix else ""
    return next((name for name in (file_name, double) if name in FORMATS), path.suffix.lower())


def format_of(path: Path) -> Format:
    """Return the format of a suffix in any case; raises ExportError that names the most similar suffix."""
    suffix = suffix_of(path)
    if suffix in FORMATS:
        return FORMATS[suffix]
    similar = difflib.get_close_matches(suffix, FORMATS, n=1, cutoff=0.5)
    hint = f"did you mean {similar[0]}? " if similar else ""
    problem = f"the suffix {suffix!r} of {path.name} names no format" if suffix else f"{str(path)!r} has no suffix"
    raise ExportError(f"{problem}; {hint}use one of {', '.join(FORMATS)}")
