"""The formats, one entry each, and `write`, which turns a solid or a sheet into a file."""

import difflib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
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

MemberContent = Literal["members", "bodies", "section forces", "member forces", "utilisation", "beam model"]


@dataclass(frozen=True)
class Format:
    """A format of files: its functions for a part.

    prepare : returns the part with the format's rounding.    encode : returns the bytes.
    check   : reads the file back; raises ExportError if the content differs.
    ready   : raises ExportError if a library of the format is not installed.
    """

    prepare: Callable[[Part], Part]
    encode: Callable[[Part], Iterator[bytes]]
    check: Callable[[Part, Path], ReadBack]
    ready: Callable[[], None] = field(default=lambda: None, kw_only=True)


@dataclass(frozen=True)
class MeshFormat(Format):
    """A format of a solid, or of any mesh.

    sheets       : whether it can hold an open sheet.
    alternatives : returns alternatives of the part, the best first; `write` takes the first that passes the check. An
                   ExportError in place of a part is an alternative that is refused without a trial.
    sentence     : returns a sentence about the alternative that `write` took, from the refusals before it.
    refusal      : returns the error to raise if `write` refused all alternatives.
    """

    sheets: bool = True
    alternatives: Callable[[Part], Iterable[Part | ExportError]] = lambda part: (part,)
    sentence: Callable[[Part, Sequence[ExportError]], str] = lambda part, refused: ""
    refusal: Callable[[Sequence[ExportError]], ExportError] = lambda refused: refused[-1]


@dataclass(frozen=True)
class SheetFormat(Format):
    """A format of lines, or of fields.

    content : lines on a sheet; a solid and lines; or fields of the uncut surface.
    curves  : whether the format needs exact lines because it holds smooth curves.
    """

    content: Literal["lines", "solid and lines", "fields"] = "lines"
    curves: bool = False


@dataclass(frozen=True)
class MemberFormat(Format):
    """A format of members, of their forces, or of their beam model.

    content  : members and nodes; members as bodies; forces in the sheet's faces or along members; utilisation; or
               the beam model.
    sentence : returns a sentence about the content, or ''.
    """

    content: MemberContent
    sentence: Callable[[Part], str] = lambda part: ""


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


_STEP = MeshFormat(
    strategies.prepare,
    file.encode,
    file.check,
    sheets=False,
    alternatives=strategies.attempts,
    sentence=strategies.route_sentence,
    refusal=strategies.refusal,
)

FORMATS: dict[str, MeshFormat | SheetFormat | MemberFormat] = {
    ".stl": MeshFormat(triangles.prepare_stl, triangles.encode_stl, triangles.check_stl),
    ".3mf": MeshFormat(triangles.prepare_3mf, triangles.encode_3mf, triangles.check_3mf, sheets=False),
    ".step": _STEP,
    ".stp": _STEP,
    ".stpz": replace(_STEP, encode=file.encode_compressed, check=file.check_compressed),
    ".lines.step": SheetFormat(file.prepare_lines, file.encode_lines, file.check_lines_file, curves=True),
    ".brep": replace(_STEP, encode=file.encode_brep, check=file.check_brep, sentence=file.route_sentence),
    ".ifc": MeshFormat(ifc.prepare, ifc.encode, ifc.check, sheets=False, ready=ifc.require_ifcopenshell),
    ".obj": MeshFormat(triangles.prepare_obj, triangles.encode_obj, triangles.check_obj),
    ".ply": MeshFormat(triangles.prepare_ply, triangles.encode_ply, triangles.check_ply),
    ".off": MeshFormat(triangles.prepare_off, triangles.encode_off, triangles.check_off),
    ".glb": MeshFormat(gltf.prepare, gltf.encode, gltf.check),
    ".3dm": SheetFormat(
        rhino.prepare, rhino.encode, rhino.check, curves=True, ready=rhino.require_rhino3dm, content="solid and lines"
    ),
    ".dxf": SheetFormat(dxf.prepare, dxf.encode, dxf.check, curves=True),
    ".svg": SheetFormat(svg.prepare, svg.encode, svg.check),
    ".csv": SheetFormat(geometry.prepare_csv, geometry.encode_csv, geometry.check_csv),
    ".json": SheetFormat(geometry.prepare_json, geometry.encode_json, geometry.check_json),
    ".members.json": MemberFormat(
        geometry.prepare_members, geometry.encode_members_json, geometry.check_members_json, content="members"
    ),
    ".members.csv": MemberFormat(
        geometry.prepare_members, geometry.encode_members, geometry.check_members, content="members"
    ),
    ".nodes.csv": MemberFormat(
        geometry.prepare_members, geometry.encode_nodes, geometry.check_nodes, content="members"
    ),
    ".members.3dm": MemberFormat(
        with_single_shapes, rhino.encode_members, rhino.check_members, ready=rhino.require_rhino3dm, content="bodies"
    ),
    ".members.ifc": MemberFormat(
        with_shapes, ifc.encode_members, ifc.check_members, ready=ifc.require_ifcopenshell, content="bodies"
    ),
    ".members.glb": MemberFormat(with_single_shapes, gltf.encode_members, gltf.check_members, content="bodies"),
    ".members.dxf": MemberFormat(with_shapes, dxf.encode_members, dxf.check_members, content="bodies"),
    ".vtu": SheetFormat(vtu.prepare, vtu.encode, vtu.check, content="fields"),
    ".forces.vtu": MemberFormat(forces.prepare_fields, vtu.encode, vtu.check, content="section forces"),
    ".forces.csv": MemberFormat(
        forces.prepare_sheet, forces.encode_sheet, forces.check_sheet, content="section forces"
    ),
    ".member_forces.csv": MemberFormat(
        forces.prepare_members, forces.encode_members, forces.check_members, content="member forces"
    ),
    ".member_forces.xlsx": MemberFormat(
        forces.prepare_members,
        forces.encode_workbook,
        forces.check_workbook,
        ready=saf.require_xlsxwriter,
        content="member forces",
    ),
    ".member_utilisation.csv": MemberFormat(
        forces.prepare_utilisation,
        forces.encode_utilisation,
        forces.check_utilisation,
        sentence=forces.sentence,
        content="utilisation",
    ),
    opensees.SUFFIX: MemberFormat(
        saf.prepare, opensees.encode, opensees.check, sentence=saf.agreement_text, content="beam model"
    ),
    calculix.SUFFIX: MemberFormat(
        saf.prepare, calculix.encode, calculix.check, sentence=saf.agreement_text, content="beam model"
    ),
    saf.SUFFIX: MemberFormat(
        saf.prepare,
        saf.encode,
        saf.check,
        sentence=saf.agreement_text,
        ready=saf.require_xlsxwriter,
        content="beam model",
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
    if not (part.is_solid or holds_sheets(form)):
        open_formats = ", ".join(suffix for suffix, f in FORMATS.items() if holds_sheets(f))
        raise ExportError(
            f"a {path.suffix.lower()} file holds closed solids and {part.name!r} is an open sheet; "
            f"thicken it first, or write {open_formats}"
        )
    part = form.prepare(_with_options(part, step, details))
    with atomic_file(path) as temporary:
        sentence, readback = _put(form, part, temporary)
    if note and sentence:
        note(sentence)
    if report:
        report(Written(path, path.stat().st_size, time.perf_counter() - begin, readback))
    return path


def step_estimates(
    thing: Solid | Surface,
    *,
    name: str = "part",
    step: StepOptions | Route = "auto",
    details: Details | None = None,
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


def holds_sheets(form: Format) -> bool:
    """Return whether a format can hold an open sheet."""
    return not isinstance(form, MeshFormat) or form.sheets


def _put(form: MeshFormat | SheetFormat | MemberFormat, part: Part, temporary: Path) -> tuple[str, ReadBack]:
    """Write and check the first alternative that passes; return the format's sentence about it and its content."""
    if not isinstance(form, MeshFormat):
        write_chunks(temporary, form.encode(part))
        readback = form.check(part, temporary)
        return form.sentence(part) if isinstance(form, MemberFormat) else "", readback
    refused = list[ExportError]()
    for alternative in form.alternatives(part):
        if isinstance(alternative, ExportError):
            refused.append(alternative)
            continue
        try:
            write_chunks(temporary, form.encode(alternative))
            readback = form.check(alternative, temporary)
        except ExportError as error:
            refused.append(error)
            temporary.unlink(missing_ok=True)
        else:
            return form.sentence(alternative, refused), readback
    raise form.refusal(refused)


def suffix_of(path: Path) -> str:
    """Return the suffix in lower case; two words if they name a format: `.lines.step`, and `members.json` alone."""
    double = "".join(path.suffixes[-2:]).lower()
    file_name = f".{path.name}".lower() if path.suffix else ""
    return next((name for name in (file_name, double) if name in FORMATS), path.suffix.lower())


def format_of(path: Path) -> MeshFormat | SheetFormat | MemberFormat:
    """Return the format of a suffix in any case; raises ExportError that names the most similar suffix."""
    suffix = suffix_of(path)
    if suffix in FORMATS:
        return FORMATS[suffix]
    similar = difflib.get_close_matches(suffix, FORMATS, n=1, cutoff=0.5)
    hint = f"did you mean {similar[0]}? " if similar else ""
    problem = f"the suffix {suffix!r} of {path.name} names no format" if suffix else f"{str(path)!r} has no suffix"
    raise ExportError(f"{problem}; {hint}use one of {', '.join(FORMATS)}")
