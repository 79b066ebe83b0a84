"""Comparison of a written file with its part."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.export.part import MemberShape, Part, in_single_precision, open_edges
from dsfab.surface import bounding_box, polyline_length, signed_volume, total_area

NUMBERS_READ_BACK = 1e-9  # largest error of numbers read back, as a fraction of the largest number


@dataclass(frozen=True)
class ReadBack:
    """Content that was read back from a file: number of triangles, faces or lines, as `what` says.
    off : relative error of the `measure` (volume, area or length); NaN without a measure."""

    count: int
    what: str
    off: float = float("nan")
    measure: str = "volume"

    @property
    def summary(self) -> str:
        """Text such as '1,408 faces, volume error 3e-06'."""
        error = "" if np.isnan(self.off) else f", {self.measure} error {abs(self.off):.0e}".replace("0e+00", "0")
        return f"{self.count:,} {self.what}{error}"


_ODD = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
"""Odd factors of the three coordinates in a hash. Odd factors are invertible modulo 2^64, so no bits are lost."""


def read_with_igl(path: Path) -> tuple[Floats, Ints]:
    """Read vertices (n, 3) and faces (m, 3) of an STL or PLY file. Raises ExportError for other content."""
    if not str(path).isascii():
        return read_with_trimesh(path)
    import igl

    try:
        V, F = igl.read_triangle_mesh(str(path))[:2]
    except RuntimeError as error:
        raise ExportError(f"{path.name} cannot be read: {error}; free some space or write another format") from None
    if V.shape[1:] != (3,) or F.shape[1:] != (3,):
        raise ExportError(
            f"{path.name} has no triangles when the file is read back; free some space or write another format"
        )
    return np.asarray(V, dtype=np.float64), np.asarray(F, dtype=np.int64)


def read_with_trimesh(path: Path) -> tuple[Floats, Ints]:
    """Read vertices (n, 3) and faces (m, 3) of a file; raises ExportError if the file is not a mesh."""
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False)
    except (ValueError, LookupError, TypeError) as error:  # for example, the file ends too early
        raise ExportError(f"{path.name} cannot be read: {error}; free some space or write another format") from None
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def check_mesh(part: Part, V: Floats, F: Ints) -> ReadBack:
    """Compare a mesh from a file, V (n, 3), mm, and F (m, 3), with the mesh of the part.
    Raises ExportError if the mesh differs, or if the mesh of a solid is open."""
    require_equal(part, "triangles", len(part.F), len(F))
    vertices_read, vertices_expected = (int(np.count_nonzero(np.bincount(faces.ravel()))) for faces in (F, part.F))
    require_equal(part, "vertices", vertices_expected, vertices_read)
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    moved = float(np.abs(bounding_box(V, F) - part.box).max())
    if not moved <= READ_BACK * size:
        raise ExportError(
            f"the bounding box of {part.name!r} differs by {moved:.3g} mm when the file is read back; write another "
            f"format"
        )
    if part.is_solid and open_edges(F):
        raise ExportError(
            f"{part.name!r} is open at {open_edges(F)} edges when the file is read back; write another format"
        )
    error = check_measure(part, signed_volume(V, F) if part.is_solid else total_area(V, F))
    return ReadBack(len(F), "triangles", error, "volume" if part.is_solid else "area")


def check_measure(part: Part, measure_read: float) -> float:
    """Return the relative error of the volume (mm3) or area (mm2) in a file. Raises ExportError above 0.1 %."""
    what, unit, expected = ("volume", "mm3", part.volume) if part.is_solid else ("area", "mm2", part.area)
    if not abs(measure_read - expected) <= READ_BACK * abs(expected):
        raise ExportError(
            f"the file of {part.name!r} reads back with {what} {measure_read:.6g} {unit} instead of {expected:.6g} "
            f"{unit}; write another format"
        )
    return measure_read / expected - 1


def check_lines(part: Part, lines_read: Sequence[Floats]) -> ReadBack:
    """Compare polylines (k, 3) from a file with a part's lines. Raises ExportError if number or length differs."""
    lines = part.details.lines
    require_equal(part, "lines", len(lines), len(lines_read))
    expected, length_read = sum(polyline_length(line.points) for line in lines), sum(map(polyline_length, lines_read))
    if not abs(length_read - expected) <= READ_BACK * expected:
        raise ExportError(
            f"the total length of the lines of {part.name!r} is {length_read:.6g} mm in the file instead of "
            f"{expected:.6g} mm; write another format"
        )
    return ReadBack(len(lines_read), "lines", length_read / expected - 1, "length")


def require_equal(part: Part, what: str, expected: int | Collection[str], content: int | Collection[str]) -> None:
    """Raise ExportError if a number, or a collection of names, differs in a file. what : noun for the message."""
    if content != expected:
        count, expected_count = (x if isinstance(x, int) else len(x) for x in (content, expected))
        raise ExportError(
            f"the file of {part.name!r} reads back with {count} {what} instead of {expected_count}; use another format"
        )


def merged_mesh(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Return the mesh V (n, 3), F (m, 3) after merging vertices at exactly equal positions."""
    points, point = distinct_rows(V)
    return points, point[F]


def distinct_rows(rows: Floats) -> tuple[Floats, Ints]:
    """Return the different rows (n, 3) of an array (k, 3), and for each given row its number (k,) among them."""
    rows = rows + 0.0  # the sum turns -0 into 0
    bits = np.ascontiguousarray(rows).view(np.uint64)
    mixed = (bits ^ (bits >> np.uint64(29))) * _ODD
    _, first_row, number = np.unique(mixed[:, 0] ^ mixed[:, 1] ^ mixed[:, 2], return_index=True, return_inverse=True)
    different = rows[first_row]
    if not (different[number] == rows).all():
        different, number = np.unique(rows, axis=0, return_inverse=True)
    return different, number.reshape(-1)


COLOURS = {"major": (31, 78, 156), "minor": (179, 38, 30), "keep": (46, 125, 50), "rim": (0, 121, 134)}
"""Colours of layers: red, green and blue, from 0 to 255."""
GREY = (120, 120, 120)


def with_single_shapes(part: Part) -> Part:
    """Return the part with the vertices of its member bodies rounded to 32-bit numbers."""
    return replace(part, details=replace(part.details, shapes=tuple(map(_single, part.details.shapes))))


def _single(shape: MemberShape) -> MemberShape:
    rounded = in_single_precision(Part(shape.V, shape.F, shape.id, is_solid=True))
    return replace(shape, V=rounded.V, F=rounded.F)


def layer_colour(layer: str) -> tuple[int, int, int]:
    """Return a layer's colour as (red, green, blue), each from 0 to 255."""
    return COLOURS.get(layer, GREY)


def check_shapes(part: Part, meshes_read: Mapping[str, tuple[Floats, Ints]]) -> ReadBack:
    """Compare meshes from a file with a part's members. meshes_read : V (n, 3), mm, and F (m, 3), by member name.
    Raises ExportError if a mesh is open or differs."""
    shapes = part.details.shapes
    require_equal(part, "members", [shape.id for shape in shapes], list(meshes_read))
    total = total_read = 0.0
    for shape in shapes:
        V, F = meshes_read[shape.id]
        require_equal(part, f"triangles in {shape.id}", len(shape.F), len(F))
        volume, volume_read = (signed_volume(*mesh) for mesh in ((shape.V, shape.F), (V, F)))
        size = float(np.ptp(shape.V, axis=0).max())
        moved = float(np.abs(V[F].mean(axis=(0, 1)) - shape.V[shape.F].mean(axis=(0, 1))).max())
        is_near = abs(volume - volume_read) <= READ_BACK * volume and moved <= READ_BACK * size
        if open_edges(F) or not is_near:
            raise ExportError(
                f"the member {shape.id} of {part.name!r} differs when the file is read back; write .members.json"
            )
        total, total_read = total + volume, total_read + volume_read
    return ReadBack(len(meshes_read), "members", total_read / total - 1)
