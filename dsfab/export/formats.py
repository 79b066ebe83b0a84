"""File formats, and the function `write` that writes a solid or a sheet."""

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
from dsfab.export.cad import ifc, rhino
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.strategies import Estimate, estimates
from dsfab.export.drawing import dxf, svg
from dsfab.export.mesh import gltf, triangles
from dsfab.export.part import Details, Part, Route, StepOptions, in_single_precision, part_of
from dsfab.export.readback import ReadBack, with_single_shapes
from dsfab.export.tables import forces, geometry
from dsfab.export.writing import atomic_file, write_chunks
from dsfab.surface.mesh import Surface
from dsfab.thickening.solid import Solid

MemberContent = Literal["members", "shapes", "section_forces", "member_forces", "utilisation", "frame"]
MISSING: dict[MemberContent, str] = {
    "members": "no members to write; only a design has members",
    "shapes": "no members to write; only a design has members",
    "section_forces": "no section forces; only a design has section forces",
    "member_forces": "no forces of members; only a design has members",
    "utilisation": "no members to check; only a design has members",
    "frame": "no beam model; only a design has a beam model",
}
"""Error message for a part without content, by the kind of content."""


@dataclass(frozen=True)
class Format:
    """A file format. encode : function that yields the bytes of the file.
    check   : function that reads the file back; raises ExportError if the content differs.
    prepare : function that returns the part with the format's rounding of numbers.
    ready   : function that raises ExportError if a library of the format is not installed."""

    encode: Callable[[Part], Iterator[bytes]]
    check: Callable[[Part, Path], ReadBack]
    prepare: Callable[[Part], Part] = lambda part: part
    ready: Callable[[], None] = field(default=lambda: None, kw_only=True)


@dataclass(frozen=True)
class MeshFormat(Format):
    """A format for meshes. sheets : True if the format can contain an open sheet.
    alternatives : function that yields versions of the part, the best first; an ExportError for an omitted version.
    sentence     : function that returns a sentence about the chosen version.
    refusal      : function that returns the error to raise if all versions were refused."""

    sheets: bool = True
    alternatives: Callable[[Part], Iterable[Part | ExportError]] = lambda part: (part,)
    sentence: Callable[[Part, Sequence[ExportError]], str] = lambda part, refused: ""
    refusal: Callable[[Sequence[ExportError]], ExportError] = lambda refused: refused[-1]


@dataclass(frozen=True)
class SheetFormat(Format):
    """A format for lines on a sheet or for fields (values at its vertices and faces).
    content : required content of the part.    curves : True if the format contains smooth curves."""

    content: Literal["lines", "solid and lines", "fields"] = "lines"
    curves: bool = False


@dataclass(frozen=True)
class MemberFormat(Format):
    """A format for members, their forces, or the beam model. content : attribute of `Details` with the content.
    sentence : function that returns a sentence about the content, or ''."""

    content: MemberContent = field(kw_only=True)
    sentence: Callable[[Part], str] = lambda part: ""


@dataclass(frozen=True)
class Written:
    """A file that was written and read back in `seconds`. size : bytes.    found : content that was read back."""

    path: Path
    size: int
    seconds: float
    found: ReadBack

    @property
    def summary(self) -> str:
        """Text such as 'step: 2.23 MB, 1,408 faces, volume error 3e-04, 16 s'."""
        seconds = f"{self.seconds:.2g}" if self.seconds < 100 else f"{self.seconds:.0f}"
        return f"{suffix_of(self.path)[1:]}: {self.size / 1e6:.3g} MB, {self.found.summary}, {seconds} s"


_STEP = MeshFormat(
    file.encode,
    file.check,
    strategies.prepare,
    sheets=False,
    alternatives=strategies.attempts,
    sentence=strategies.route_sentence,
    refusal=strategies.refusal,
)

FORMATS: dict[str, MeshFormat | SheetFormat | MemberFormat] = {
    ".stl": MeshFormat(triangles.encode_stl, triangles.check_stl, triangles.prepare_stl),
    ".3mf": MeshFormat(triangles.encode_3mf, triangles.check_3mf, in_single_precision, sheets=False),
    ".step": _STEP,
    ".stp": _STEP,
    ".stpz": replace(_STEP, encode=file.encode_compressed, check=file.check_compressed),
    ".lines.step": SheetFormat(file.encode_lines, file.check_lines_file, curves=True),
    ".brep": replace(_STEP, encode=file.encode_brep, check=file.check_brep, sentence=file.route_sentence),
    ".ifc": MeshFormat(ifc.encode, ifc.check, sheets=False, ready=ifc.require_ifcopenshell),
    ".obj": MeshFormat(triangles.encode_obj, triangles.check_with_trimesh),
    ".ply": MeshFormat(triangles.encode_ply, triangles.check_ply),
    ".off": MeshFormat(triangles.encode_off, triangles.check_with_trimesh),
    ".glb": MeshFormat(gltf.encode, gltf.check, in_single_precision),
    ".3dm": SheetFormat(
        rhino.encode,
        rhino.check,
        in_single_precision,
        curves=True,
        ready=rhino.require_rhino3dm,
        content="solid and lines",
    ),
    ".dxf": SheetFormat(dxf.encode, dxf.check, curves=True),
    ".svg": SheetFormat(svg.encode, svg.check),
    ".csv": SheetFormat(geometry.encode_csv, geometry.check_csv),
    ".json": SheetFormat(geometry.encode_json, geometry.check_json),
    ".members.json": MemberFormat(geometry.encode_members_json, geometry.check_members_json, content="members"),
    ".members.csv": MemberFormat(geometry.encode_members, geometry.check_members, content="members"),
    ".nodes.csv": MemberFormat(geometry.encode_nodes, geometry.check_nodes, content="members"),
    ".members.3dm": MemberFormat(
        rhino.encode_members, rhino.check_members, with_single_shapes, ready=rhino.require_rhino3dm, content="shapes"
    ),
    ".members.ifc": MemberFormat(
        ifc.encode_members, ifc.check_members, ready=ifc.require_ifcopenshell, content="shapes"
    ),
    ".members.glb": MemberFormat(gltf.encode_members, gltf.check_members, with_single_shapes, content="shapes"),
    ".members.dxf": MemberFormat(dxf.encode_members, dxf.check_members, content="shapes"),
    ".vtu": SheetFormat(vtu.encode, vtu.check, vtu.prepare, content="fields"),
    ".forces.vtu": MemberFormat(vtu.encode, vtu.check, forces.prepare_fields, content="section_forces"),
    ".forces.csv": MemberFormat(forces.encode_sheet, forces.check_sheet, content="section_forces"),
    ".member_forces.csv": MemberFormat(forces.encode_members, forces.check_members, content="member_forces"),
    ".member_forces.xlsx": MemberFormat(
        forces.encode_workbook, forces.check_workbook, ready=saf.require_xlsxwriter, content="member_forces"
    ),
    ".member_utilisation.csv": MemberFormat(
        forces.encode_utilisation, forces.check_utilisation, sentence=forces.sentence, content="utilisation"
    ),
    opensees.SUFFIX: MemberFormat(opensees.encode, opensees.check, sentence=saf.agreement_text, content="frame"),
    calculix.SUFFIX: MemberFormat(calculix.encode, calculix.check, sentence=saf.agreement_text, content="frame"),
    saf.SUFFIX: MemberFormat(
        saf.encode, saf.check, sentence=saf.agreement_text, ready=saf.require_xlsxwriter, content="frame"
    ),
}
"""File formats by the suffix of the file."""


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
    """Write a solid or a sheet in the format of the suffix of `path`; return the path.
    thing   : solid or sheet, m. Files are in millimetres (.glb in metres).
    name    : name of the part in the file; by default the file's name without suffix.
    step    : options of STEP files, or only the name of the strategy (route).
    details : content besides the mesh: lines, values at vertices or faces, members.
    note    : function that receives a sentence on the chosen route of a STEP file.
    report  : function that receives the size, the seconds, and the content that was read back.
    Raises ExportError for an unknown suffix, a missing library, missing data, or a failed export."""
    begin, path = time.perf_counter(), Path(path)
    form = format_of(path)
    form.ready()
    part = part_of(thing, path.name[: -len(suffix_of(path))] if name is None else name)
    if not (part.is_solid or holds_sheets(form)):
        open_formats = ", ".join(suffix for suffix, f in FORMATS.items() if holds_sheets(f))
        raise ExportError(
            f"{path.name}: a {path.suffix.lower()} file needs a closed solid, but {part.name!r} is an open sheet; "
            f"thicken the sheet first, or write {open_formats}"
        )
    part = _with_options(part, step, details)
    _require_content(form, part, suffix_of(path))
    part = form.prepare(part)
    with atomic_file(path) as temporary:
        sentence, readback = _put(form, part, temporary)
    if note and sentence:
        note(sentence)
    if report:
        report(Written(path, path.stat().st_size, time.perf_counter() - begin, readback))
    return path


def step_estimates(
    thing: Solid | Surface, *, name: str = "part", step: StepOptions | Route = "auto", details: Details | None = None
) -> tuple[Estimate, ...]:
    """Return the estimated cost of each way (route) to write a solid as STEP. name : name of the part."""
    part = part_of(thing, name)
    if not part.is_solid:
        raise ExportError(f"STEP needs a closed solid, but {name!r} is an open sheet; thicken the sheet first")
    return estimates(strategies.prepare(_with_options(part, step, details)))


def _with_options(part: Part, step: StepOptions | str, details: Details | None) -> Part:
    options = StepOptions(step) if isinstance(step, str) else step
    if options.route not in strategies.ROUTES:
        raise ExportError(f"step = {options.route!r} is not known; use one of {', '.join(strategies.ROUTES)}")
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
    """Return True if a format can contain an open sheet."""
    return not isinstance(form, MeshFormat) or form.sheets


def _require_content(form: Format, part: Part, suffix: str) -> None:
    details = part.details
    if isinstance(form, SheetFormat) and form.content == "lines" and not details.lines:
        raise ExportError(f"a {suffix} file needs lines, but {part.name!r} has none; pass `details` with lines")
    if not isinstance(form, MemberFormat):
        return
    if form.content == "member_forces" and details.member_forces is not None and not details.member_forces:
        raise ExportError(
            f"no member of {part.name!r} is long enough between two nodes for a table of forces; write forces.csv"
        )
    if not getattr(details, form.content):
        raise ExportError(f"{part.name!r} has {MISSING[form.content]}: use design.write(...)")


def _put(form: MeshFormat | SheetFormat | MemberFormat, part: Part, temporary: Path) -> tuple[str, ReadBack]:
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
    """Return the suffix of a file name in lower case, such as `.step` or `.lines.step`."""
    double = "".join(path.suffixes[-2:]).lower()
    file_name = f".{path.name}".lower() if path.suffix else ""
    return next((name for name in (file_name, double) if name in FORMATS), path.suffix.lower())


def format_of(path: Path) -> MeshFormat | SheetFormat | MemberFormat:
    """Return the file format for the suffix of `path`. Raises ExportError for an unknown suffix."""
    suffix = suffix_of(path)
    if suffix in FORMATS:
        return FORMATS[suffix]
    similar = difflib.get_close_matches(suffix, FORMATS, n=1, cutoff=0.5)
    hint = f"did you mean {similar[0]}? " if similar else ""
    problem = (
        f"the suffix {suffix!r} of {path.name} is not a known file format" if suffix else f"{str(path)!r} has no suffix"
    )
    raise ExportError(f"{problem}; {hint}use one of {', '.join(FORMATS)}")
