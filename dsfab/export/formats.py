"""The formats, one line each, and `write`: the one way a solid or a sheet becomes a file."""

import difflib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import ExportError
from dsfab.export import (
    brep,
    dxf,
    gltf,
    ifc,
    ladder,
    obj,
    off,
    ply,
    records,
    rhino,
    step_lines,
    stl,
    stpz,
    svg,
    tables,
    threemf,
    vtu,
)
from dsfab.export import step as step_format
from dsfab.export.atomic import replacing, write_chunks
from dsfab.export.estimate import Estimate, estimates
from dsfab.export.part import Details, Part, part_of
from dsfab.export.readback import Found
from dsfab.export.smooth.source import Curved
from dsfab.surface.mesh import Surface
from dsfab.thickening.solid import Solid
from dsfab.units import MM_PER_M

STEP_FACES = 30_000
"""Faces that a STEP file may have unless asked otherwise; `dsfab.export.step` has the measurements behind it."""


Route = Literal["auto", "planar", "smooth", "faceted", "tessellated"]
"""How a STEP file is made."""


Takes = Literal["mesh", "lines", "both", "fields"]


@dataclass(frozen=True)
class Format:
    """prepare: the part as the file will hold it. encode: its bytes. check: what is read back; ExportError if that is
    something else."""

    prepare: Callable[[Part], Part]
    encode: Callable[[Part], Iterator[bytes]]
    check: Callable[[Part, Path], Found]
    sheets: bool
    """Whether the format can hold an open sheet."""
    attempts: Callable[[Part], Iterable[Part | ExportError]] = lambda part: (part,)
    """The part in the ways to write it, the best first: the next is tried when one is refused. Or a refusal, of a way
    that need not be tried."""
    told: Callable[[Part, Sequence[ExportError]], str] = lambda part, refused: ""
    """A line about the way taken, given why those before it were refused."""
    refusal: Callable[[Sequence[ExportError]], ExportError] = lambda refused: refused[-1]
    """What to raise when all ways were refused."""
    takes: Takes = "mesh"
    """What it is for: a mesh; lines on a sheet; a solid and lines; or fields on a sheet."""
    curves: bool = False
    """Whether it draws lines as smooth curves, and so wants them exact."""
    ready: Callable[[], None] = lambda: None
    """Raises ExportError where a library is missing that the format needs."""


@dataclass(frozen=True)
class Written:
    """A file that was written and read back. size : bytes. seconds : for both, on the clock. found : by its reader."""

    path: Path
    size: int
    seconds: float
    found: Found

    @property
    def told(self) -> str:
        """'step: 2.23 MB, 1,408 faces, volume error 3e-04, 16 s'."""
        seconds = f"{self.seconds:.2g}" if self.seconds < 100 else f"{self.seconds:.0f}"
        return f"{suffix_of(self.path)[1:]}: {self.size / 1e6:.3g} MB, {self.found.told}, {seconds} s"


_STEP = Format(
    ladder.prepare,
    step_format.encode,
    step_format.check,
    sheets=False,
    attempts=ladder.attempts,
    told=ladder.told,
    refusal=ladder.refusal,
)

FORMATS: dict[str, Format] = {
    ".stl": Format(stl.prepare, stl.encode, stl.check, sheets=True),
    ".3mf": Format(threemf.prepare, threemf.encode, threemf.check, sheets=False),
    ".step": _STEP,
    ".stp": _STEP,
    ".stpz": replace(_STEP, encode=stpz.encode, check=stpz.check),
    ".lines.step": Format(
        step_lines.prepare, step_lines.encode, step_lines.check, sheets=True, takes="lines", curves=True
    ),
    ".brep": replace(_STEP, encode=brep.encode, check=brep.check, told=brep.told),
    ".ifc": Format(ifc.prepare, ifc.encode, ifc.check, sheets=False, ready=ifc.ready),
    ".obj": Format(obj.prepare, obj.encode, obj.check, sheets=True),
    ".ply": Format(ply.prepare, ply.encode, ply.check, sheets=True),
    ".off": Format(off.prepare, off.encode, off.check, sheets=True),
    ".glb": Format(gltf.prepare, gltf.encode, gltf.check, sheets=True),
    ".3dm": Format(rhino.prepare, rhino.encode, rhino.check, sheets=True, takes="both", curves=True, ready=rhino.ready),
    ".dxf": Format(dxf.prepare, dxf.encode, dxf.check, sheets=True, takes="lines", curves=True),
    ".svg": Format(svg.prepare, svg.encode, svg.check, sheets=True, takes="lines"),
    ".csv": Format(tables.prepare, tables.encode, tables.check, sheets=True, takes="lines"),
    ".json": Format(records.prepare, records.encode, records.check, sheets=True, takes="lines"),
    ".vtu": Format(vtu.prepare, vtu.encode, vtu.check, sheets=True, takes="fields"),
}
"""The suffixes that `write` knows."""


def write(
    thing: Solid | Surface,
    path: str | Path,
    *,
    step_faces: int = STEP_FACES,
    name: str | None = None,
    step: Route = "auto",
    step_tolerance: float = 0.0,
    step_mb: float = 0.0,
    corners: Floats | None = None,
    details: Details | None = None,
    curved: Callable[[], Curved] | None = None,
    note: Callable[[str], None] | None = None,
    report: Callable[[Written], None] | None = None,
) -> Path:
    """Write a solid, or a sheet, in the format that the suffix of `path` names, and read it back; returns the path.

    thing      : metres. Files are in millimetres (.glb in metres, its standard says so) and tell the unit if they can.
    step_faces : largest number of planar faces of a STEP file, counted after coplanar triangles were joined.
    name       : what the part is called inside the file; the file's own name without suffix if not given.
    step       : planar, for flat solids: lines and splines through the outline; smooth, for curved sheets: spline
                 skins and ruled walls; faceted: planar faces only; auto takes the first that the solid allows and
                 that stands the check. tessellated: its triangles, for viewers; auto never takes it.
    step_tolerance : metres that curves may be off the outline, a fortieth of the thickness if 0; and that a faceted
                 solid may be simplified by, which it is not if 0 unless nothing else is accepted.
    step_mb    : largest size of a STEP file in 1e6 bytes; 0 is no limit.
    corners    : (k, 3) points of a flat sheet's outline, metres, that stay corners even where it turns by little.
    details    : lines, fields and facts, for the formats that hold them.
    curved     : makes what smooth STEP needs of the sheet, see `dsfab.export.smooth.source`.
    note       : called with a line that says how the STEP file was made, and why not otherwise.
    report     : called with what was written: size, seconds, triangles or faces, and how far the volume is off.

    The same thing gives the same bytes. Another reader than the writer must find the same triangles, closed, and the
    same volume (area of a sheet) to 0.1 %; only then does the file take its name, in one step. After a failure there is
    no new file, and an older one of that name is as it was.
    Raises ExportError: unknown suffix, a library that is not installed, a sheet where the format needs a solid, lines
    where there are none, a shape that the format cannot hold, too many faces for STEP, no permission or space,
    and a file that reads back different.
    """
    begin, path = time.perf_counter(), Path(path)
    form = format_of(path)
    form.ready()
    part = part_of(thing, path.name[: -len(suffix_of(path))] if name is None else name, step_faces)
    if not (part.is_solid or form.sheets):
        open_formats = ", ".join(suffix for suffix, f in FORMATS.items() if f.sheets)
        raise ExportError(
            f"a {path.suffix.lower()} file holds closed solids and {part.name!r} is an open sheet; "
            f"thicken it first, or write {open_formats}"
        )
    part = form.prepare(replace(_with_options(part, step, step_tolerance, step_mb, corners, details), curved=curved))
    with replacing(path) as temporary:
        taken, refused, found = _put(form, part, temporary)
    if note and (how := form.told(taken, refused)):
        note(how)
    if report:
        report(Written(path, path.stat().st_size, time.perf_counter() - begin, found))
    return path


def step_estimates(
    thing: Solid | Surface,
    *,
    step_faces: int = STEP_FACES,
    name: str = "part",
    step: Route = "auto",
    step_tolerance: float = 0.0,
    step_mb: float = 0.0,
    corners: Floats | None = None,
    details: Details | None = None,
    curved: Callable[[], Curved] | None = None,
) -> tuple[Estimate, ...]:
    """What each way of writing a solid as STEP would cost; the keywords are those of `write`. Nothing is written."""
    part = part_of(thing, name, step_faces)
    if not part.is_solid:
        raise ExportError(f"STEP holds closed solids and {name!r} is an open sheet; thicken it first")
    part = _with_options(part, step, step_tolerance, step_mb, corners, details)
    return estimates(ladder.prepare(replace(part, curved=curved)))


def _with_options(
    part: Part, step: str, tolerance: float, megabytes: float, corners: Floats | None, details: Details | None
) -> Part:
    """The part with what was asked for; lengths become millimetres."""
    if step not in ladder.ROUTES:
        raise ExportError(f"step = {step!r} names no way to write STEP; use one of {', '.join(ladder.ROUTES)}")
    marked = np.zeros((0, 3)) if corners is None else np.asarray(corners, dtype=np.float64)
    about = (details or Details()).scaled(MM_PER_M)
    tolerance, marked = tolerance * MM_PER_M, marked * MM_PER_M
    return replace(part, details=about, step=step, step_mb=megabytes, tolerance=tolerance, corners=marked)


def _put(form: Format, part: Part, temporary: Path) -> tuple[Part, list[ExportError], Found]:
    """Write the first way that reads back as it should; returns it, why the ways before it were refused, and what was
    read."""
    refused = list[ExportError]()
    for attempt in form.attempts(part):
        if isinstance(attempt, ExportError):
            refused.append(attempt)
            continue
        try:
            write_chunks(temporary, form.encode(attempt))
            found = form.check(attempt, temporary)
        except ExportError as error:
            refused.append(error)
            temporary.unlink(missing_ok=True)
        else:
            return attempt, refused, found
    raise form.refusal(refused)


def suffix_of(path: Path) -> str:
    """The suffix in small letters, of two words where that names a format: `.lines.step`."""
    double = "".join(path.suffixes[-2:]).lower()
    return double if double in FORMATS else path.suffix.lower()


def format_of(path: Path) -> Format:
    """The format that a suffix names, in capitals or not; raises ExportError with the nearest one that exists."""
    suffix = suffix_of(path)
    if suffix in FORMATS:
        return FORMATS[suffix]
    near = difflib.get_close_matches(suffix, FORMATS, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    said = f"the suffix {suffix!r} of {path.name} names no format" if suffix else f"{str(path)!r} has no suffix"
    raise ExportError(f"{said}; {hint}use one of {', '.join(FORMATS)}")
