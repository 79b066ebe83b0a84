"""STEP files of solids and of lines, and BREP files."""

import io
import subprocess
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from dsfab.core.errors import ExportError
from dsfab.core.limits import DEFLECTION, READ_BACK
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step import entities as tessellated
from dsfab.export.cad.step import strategies
from dsfab.export.cad.step.by_members.build import member_file
from dsfab.export.cad.step.entities import (
    StepEntities,
    entities,
    faceted_bytes,
    header,
    outward_polyhedron,
    references,
    step_string,
)
from dsfab.export.cad.step.file_size import BudgetError
from dsfab.export.cad.step.folded_sheets import planar_file
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.cad.step.soundness import smooth_use, step_fault
from dsfab.export.cad.step.worker.reports import occt_report
from dsfab.export.cad.step.worker.shapes import read as read_shape
from dsfab.export.curves import Curve, chains, check_length, curve_tolerance, halves
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_measure, require_equal
from dsfab.export.subprocesses import ProgramError
from dsfab.export.writing import one_line
from dsfab.surface import StructureLine

CHECK_SECONDS = 120
CHECK_SECONDS_PER_FACE = 0.02
"""Seconds per face in the time limit for OCCT to read a written file; several times the usual time."""

LIGHT = 8.0  # megabytes; a faceted file up to this size replaces a smooth file that OCCT cannot cut


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the part's STEP file. Raises ExportError, or BudgetError if the file is too large."""
    faces, size, texts = ENCODERS[part.step](part)
    if faces > part.step_faces:
        raise BudgetError(part, faces, size)
    return _within_size(part, faces, size, (text.encode("ascii") for text in texts))


def _encode_planar(part: Part) -> tuple[int, float, Iterable[str]]:
    file = planar_file(part)
    return file.faces, sum(map(len, file.texts)), file.texts


def _encode_smooth(part: Part) -> tuple[int, float, Iterable[str]]:
    file = smooth_file(part)
    if part.hurry and part.cut and (fault := smooth_use(part).fault):
        faces, size, _ = _encode_faceted(part)
        if size <= 1e6 * LIGHT and faces <= part.step_faces:
            raise ExportError(f"smooth {fault}")
    return file.faces, len(file.text), [file.text]


def _encode_members(part: Part) -> tuple[int, float, Iterable[str]]:
    return member_file(part).faces, len(member_file(part).text), [member_file(part).text]


def _encode_tessellated(part: Part) -> tuple[int, float, Iterable[str]]:
    return 0, tessellated.expected_bytes(part), tessellated.tessellated_entities(part)


def _encode_faceted(part: Part) -> tuple[int, float, Iterable[str]]:
    shape, solids = outward_polyhedron(part)
    return len(shape.normals), faceted_bytes(shape), entities(shape, solids, part.name)


ENCODERS: dict[str, Callable[[Part], tuple[int, float, Iterable[str]]]] = {
    "planar": _encode_planar,
    "members": _encode_members,
    "smooth": _encode_smooth,
    "faceted": _encode_faceted,
    "tessellated": _encode_tessellated,
}
"""Function of each strategy. It returns the number of faces, the expected size in bytes, and the text of the file."""


def _within_size(part: Part, faces: int, expected: float, chunks: Iterator[bytes]) -> Iterator[bytes]:
    size = 0
    for chunk in chunks:
        size += len(chunk)
        if part.step_mb and size > 1e6 * part.step_mb:
            raise BudgetError(part, faces, max(size, expected))
        yield chunk


def check(part: Part, path: Path) -> ReadBack:
    """Compare the file, read by OCCT, with the part. Raises ExportError."""
    if part.step == "members":
        file = member_file(part)
        _require_same(part, path, file.text)
        return ReadBack(file.faces, "faces", file.volume / part.volume - 1)
    if part.step == "smooth":
        smooth = smooth_file(part)
        _require_same(part, path, smooth.text)
        if part.cut and (fault := step_fault(path, DEFLECTION * smooth.limits.distance / MM_PER_M)):
            raise ExportError(f"smooth, {fault}")
        if smooth.smooth == smooth.pieces:
            return ReadBack(smooth.faces, "faces", smooth.volume / part.volume - 1)
    report = inspection(part, path)
    if part.step == "tessellated":
        return tessellated.check(part, report)
    faces = path.read_bytes().count(b"=ADVANCED_FACE(")
    require_equal(part, "solids", len(solids_of(part)[1]), report["solids"])
    require_equal(part, "faces", faces, report["faces"])
    if not report["valid"]:
        raise ExportError(
            f"OCCT finds the STEP solid of {part.name!r} invalid: check for parts that touch or cross; write STL or 3MF"
        )
    if not report["tessellates"]:
        raise ExportError(
            f"OCCT cannot divide a face of the STEP solid of {part.name!r} into triangles; write step = 'faceted'"
        )
    volume_error = report["volume"] / part.volume - 1
    return ReadBack(faces, "faces", volume_error if part.step == "smooth" else check_measure(part, report["volume"]))


def _require_same(part: Part, path: Path, text: str) -> None:
    if path.read_bytes() != text.encode("ascii"):
        raise ExportError(
            f"the STEP file of {part.name!r} differs from the text that OCCT checked; write the file again"
        )


def inspection(part: Part, path: Path) -> dict[str, Any]:
    """Return OCCT's report on the file that was written for a part. Raises ExportError."""
    limit = CHECK_SECONDS + (CHECK_SECONDS_PER_FACE * part.step_faces if part.step in ("faceted", "smooth") else 0)
    try:
        return occt_report("facts", str(path), seconds=limit)
    except subprocess.TimeoutExpired as error:
        raise ExportError(
            f"reading back the STEP file of {part.name!r} did not end within {limit:.0f} s, so its validity is "
            "unknown; write STL or 3MF instead, or coarsen the mesh"
        ) from error
    except ProgramError as error:
        raise ExportError(
            f"OCCT could not read the STEP file of {part.name!r} ({error}); write STL or 3MF instead"
        ) from error


_BEGINNING_OF_ZIP = (1980, 1, 1, 0, 0, 0)


def encode_compressed(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a zip archive with the STEP file of the part."""
    level = 6  # level 9 of deflate takes five times as long and saves 2 %
    package = io.BytesIO()
    entry = zipfile.ZipInfo(f"{one_line(part.name).replace('/', '-')}.stp", _BEGINNING_OF_ZIP)
    entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 0
    with zipfile.ZipFile(package, "w", compresslevel=level) as archive, archive.open(entry, "w") as file:
        for chunk in encode(part):
            file.write(chunk)
    yield package.getvalue()


def check_compressed(part: Part, path: Path) -> ReadBack:
    """Check a zip archive and the STEP file inside. Raises ExportError."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder, zipfile.ZipFile(path) as archive:
        if len(archive.namelist()) != 1 or archive.testzip() is not None:
            raise ExportError(f"the compressed STEP file of {part.name!r} does not unpack; write .step instead")
        unpacked = Path(folder) / "a.step"
        unpacked.write_bytes(archive.read(archive.namelist()[0]))
        return check(part, unpacked)


def route_sentence(part: Part, refused: Sequence[ExportError]) -> str:
    """Return a sentence about the strategy of a BREP file. refused : errors of earlier strategies."""
    return strategies.route_sentence(part, refused).replace("STEP", "BREP", 1)


def encode_brep(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the part's BREP file."""
    chunks = encode(part)
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        step_path, path = Path(folder) / "a.step", Path(folder) / "a.brep"
        step_path.write_bytes(b"".join(chunks))
        from OCP.BRepTools import BRepTools

        if not BRepTools.Write_s(read_shape(step_path), str(path)):
            raise ExportError(f"OCCT could not write {part.name!r} as BREP; write STEP instead")
        yield path.read_bytes()


def check_brep(part: Part, path: Path) -> ReadBack:
    """Compare the file, read by OCCT, with the part. Raises ExportError."""
    report = inspection(part, path)
    require_equal(part, "solids", len(solids_of(part)[1]), report["solids"])
    if not (report["valid"] and report["tessellates"]):
        raise ExportError(f"OCCT finds the BREP solid of {part.name!r} invalid; write STL or 3MF instead")
    if part.step not in ("smooth", "members"):
        return ReadBack(report["faces"], "faces", check_measure(part, report["volume"]))
    if part.step == "members":
        volume = member_file(part).volume
        if not abs(report["volume"] - volume) <= READ_BACK * volume:
            raise ExportError(
                f"the BREP file of {part.name!r} (step = 'members') has a wrong volume; write STEP instead"
            )
    else:
        smooth = smooth_file(part)  # the mesh's volume is no reference, because mesh edges are chords
        if smooth.smooth == smooth.pieces and not abs(report["volume"] - smooth.volume) <= READ_BACK * smooth.volume:
            raise ExportError(
                f"the smooth BREP file of {part.name!r} reads back with another volume; write STEP instead"
            )
    return ReadBack(report["faces"], "faces", report["volume"] / part.volume - 1)


COLOURS = {"major": (0.12, 0.31, 0.61), "minor": (0.70, 0.15, 0.12), "keep": (0.18, 0.49, 0.20), "rim": (0, 0.47, 0.53)}
"""Red, green and blue of each family of lines; lines of unknown families are black."""


def encode_lines(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a STEP file with all lines of the part. Each family of lines has a layer and a colour."""
    entity_list, layers = StepEntities(), dict[str, list[int]]()
    for line, chain in zip(part.details.lines, chains(part), strict=True):
        layers.setdefault(line.layer, []).append(_line(entity_list, line, chain))
    everything = references(k for members in layers.values() for k in members)
    curves = entity_list.add(f"GEOMETRIC_CURVE_SET('',{everything})")
    shape = entity_list.add(f"GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION('',(#18,#{curves}),#14)")
    entity_list.add(f"SHAPE_DEFINITION_REPRESENTATION(#8,#{shape})")
    styled = []
    for layer, members in layers.items():
        entity_list.add(f"PRESENTATION_LAYER_ASSIGNMENT('{step_string(layer)}','',{references(members)})")
        style = _style(entity_list, COLOURS.get(layer.partition("-")[2], (0.0, 0.0, 0.0)))
        styled += [entity_list.add(f"STYLED_ITEM('',(#{style}),#{k})") for k in members]
    entity_list.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{references(styled)},#14)")
    about = f"edges and centre lines as curves within {curve_tolerance(part):.2g} mm of the mesh"
    yield header(part.name, about).encode("ascii")
    yield "".join(entity_list.text).encode("ascii")
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def _line(entity_list: StepEntities, line: StructureLine, chain: list[Curve]) -> int:
    chain = halves(chain[0]) if line.is_closed and len(chain) == 1 else chain
    title = step_string(f"{line.id} {line.length:.3f} mm")
    if len(chain) == 1:
        return entity_list.curve(chain[0], chain[0].poles, title, bounded=True)
    parts = [entity_list.curve(curve, curve.poles, bounded=True) for curve in chain]
    segments = [entity_list.add(f"COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,.T.,#{k})") for k in parts]
    return entity_list.add(f"COMPOSITE_CURVE('{title}',{references(segments)},.F.)")


def _style(entity_list: StepEntities, colour: tuple[float, float, float]) -> int:
    rgb = entity_list.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    font = entity_list.once("DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous')")
    style = entity_list.add(f"CURVE_STYLE('',#{font},POSITIVE_LENGTH_MEASURE(0.1),#{rgb})")
    return entity_list.add(f"PRESENTATION_STYLE_ASSIGNMENT((#{style}))")


def check_lines_file(part: Part, path: Path) -> ReadBack:
    """Compare the lines in the file, read by OCCT, with the part. Raises ExportError."""
    report = inspection(part, path)
    require_equal(part, "lines", len(part.details.lines), report["lines"])
    return ReadBack(report["lines"], "lines", check_length(part, report["length"]), "length")
