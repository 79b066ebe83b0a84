"""Comparison of a written file with its part, on the mesh, lines or member bodies that a second reader returns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.export.part import MemberShape, Part, in_single_precision, open_edges
from dsfab.surface import box, polyline_length, signed_volume, total_area


@dataclass(frozen=True)
class ReadBack:
    """What a reader found in a file: how many of `what`, and by what share the measure is off, NaN if nothing was.

    measure : volume of a solid, area of a sheet, length of lines.
    """

    count: int
    what: str
    off: float = float("nan")
    measure: str = "volume"

    @property
    def told(self) -> str:
        """'1,408 faces, volume error 3e-06'."""
        error = "" if np.isnan(self.off) else f", {self.measure} error {abs(self.off):.0e}".replace("0e+00", "0")
        return f"{self.count:,} {self.what}{error}"


_ODD = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
"""Odd numbers without a pattern, one per coordinate: products keep what differs."""


def read_with_igl(path: Path) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and faces (m, 3) of an STL or PLY file as they are in it, nothing merged or dropped.

    Importing trimesh, which finds the same, takes half a second. It reads what lies where libigl may not look: names of
    files beyond ASCII are not the same to all systems. Raises ExportError for a file that is no such mesh.
    """
    if not str(path).isascii():
        return read_with_trimesh(path)
    import igl

    try:
        V, F = igl.read_triangle_mesh(str(path))[:2]
    except RuntimeError as error:
        raise ExportError(f"{path.name} does not read back: {error}; free some space or write another format") from None
    if V.shape[1:] != (3,) or F.shape[1:] != (3,):
        raise ExportError(f"{path.name} reads back without triangles; free some space or write another format")
    return np.asarray(V, dtype=np.float64), np.asarray(F, dtype=np.int64)


def read_with_trimesh(path: Path) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and faces (m, 3) as they are in the file, nothing merged or dropped.

    Raises ExportError for a file that is no such mesh.
    """
    import trimesh

    try:
        mesh = trimesh.load_mesh(path, process=False)
    except (ValueError, LookupError, TypeError) as error:  # of a file that ends too early
        raise ExportError(f"{path.name} does not read back: {error}; free some space or write another format") from None
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def check_mesh(part: Part, V: Floats, F: Ints) -> ReadBack:
    """What was found; raises ExportError unless V (n, 3), millimetres, and F (m, 3) have the part's triangles, box
    and volume and is closed."""
    if len(F) != len(part.F):
        raise differs(part, "triangles", len(part.F), len(F))
    used, kept = (int(np.count_nonzero(np.bincount(faces.ravel()))) for faces in (F, part.F))
    if used != kept:
        raise differs(part, "vertices", kept, used)
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    moved = float(np.abs(box(V, F) - part.box).max())
    if not moved <= READ_BACK * size:
        raise ExportError(
            f"{part.name!r} reads back with its bounding box moved by {moved:.3g} mm; write another format"
        )
    if part.is_solid and open_edges(F):
        raise ExportError(f"{part.name!r} reads back open at {open_edges(F)} edges; write another format")
    off = check_measure(part, signed_volume(V, F) if part.is_solid else total_area(V, F))
    return ReadBack(len(F), "triangles", off, "volume" if part.is_solid else "area")


def check_measure(part: Part, found: float) -> float:
    """The share that `found` is off; raises ExportError unless it is the volume (mm3) of a solid or the area (mm2) of a
    sheet, to 0.1 %."""
    what, unit, expected = ("volume", "mm3", part.volume) if part.is_solid else ("area", "mm2", part.area)
    if not abs(found - expected) <= READ_BACK * abs(expected):
        raise ExportError(
            f"{part.name!r} reads back with {what} {found:.6g} {unit} instead of {expected:.6g} {unit}; "
            "write another format"
        )
    return found / expected - 1


def check_lines(part: Part, found: Sequence[Floats]) -> ReadBack:
    """What was found; raises ExportError unless as many polylines (k, 3) were found, as long together to 0.1 %."""
    lines = part.details.lines
    if len(found) != len(lines):
        raise differs(part, "lines", len(lines), len(found))
    expected, there = (sum(map(polyline_length, points)) for points in ([line.points for line in lines], found))
    if not abs(there - expected) <= READ_BACK * expected:
        raise ExportError(
            f"the lines of {part.name!r} read back {there:.6g} mm long instead of {expected:.6g} mm; "
            "write another format"
        )
    return ReadBack(len(found), "lines", there / expected - 1, "length")


def with_lines(part: Part, format_name: str) -> Part:
    """The part itself; raises ExportError if it has no lines, and so nothing for such a file."""
    if not part.details.lines:
        raise ExportError(f"a {format_name} file holds lines and {part.name!r} comes with none; give write() details")
    return part


def differs(part: Part, what: str, expected: int, found: int) -> ExportError:
    """The error for a count that came back different."""
    return ExportError(f"{part.name!r} reads back with {found} {what} instead of {expected}; write another format")


def merged_mesh(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """The mesh V (n, 3), F (m, 3) with vertices at exactly equal positions made one."""
    points, of = distinct(V)
    return points, of[F]


def distinct(rows: Floats) -> tuple[Floats, Ints]:
    """The different ones among rows of three numbers (k, 3), and the one of each (k,).

    They are told apart by a number made of their bits, a sixth of the time of comparing rows. Two that get the same
    number by chance would show, and are then compared as rows.
    """
    rows = rows + 0.0  # no -0
    bits = np.ascontiguousarray(rows).view(np.uint64)
    mixed = (bits ^ (bits >> np.uint64(29))) * _ODD
    _, first, of = np.unique(mixed[:, 0] ^ mixed[:, 1] ^ mixed[:, 2], return_index=True, return_inverse=True)
    found = rows[first]
    if not (found[of] == rows).all():
        found, of = np.unique(rows, axis=0, return_inverse=True)
    return found, of.reshape(-1)


COLOURS = {"major": (31, 78, 156), "minor": (179, 38, 30), "keep": (46, 125, 50), "rim": (0, 121, 134)}
"""Of layers; others are grey."""
GREY = (120, 120, 120)


def with_shapes(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without members."""
    if not part.details.shapes:
        raise ExportError(f"{part.name!r} has no members to write; only a design knows them: use design.write(...)")
    return part


def with_single_shapes(part: Part) -> Part:
    """The part with its members in single precision."""
    return replace(with_shapes(part), details=replace(part.details, shapes=tuple(map(_single, part.details.shapes))))


def _single(shape: MemberShape) -> MemberShape:
    held = in_single_precision(Part(shape.V, shape.F, shape.id, is_solid=True))
    return replace(shape, V=held.V, F=held.F)


def member_entries(part: Part) -> dict[str, Mapping[str, Any]]:
    """What is known of each member, by its name (see `dsfab.design.output.records`), millimetres."""
    return {entry["id"]: entry for entry in part.details.records["members"]}


def member_facts(entry: Mapping[str, Any]) -> dict[str, str]:
    """What an object of a drawing program may say of itself."""
    facts = {key: str(entry[key]) for key in ("kind", "family", "stripe") if entry[key] != ""}
    facts |= {"length_mm": f"{entry['length']:.1f}", "width_mm": f"{entry['width']['median']:.1f}"}
    if entry["ends"]:
        facts |= {"start": entry["ends"][0], "end": entry["ends"][1]}
    return facts | ({"nodes": " ".join(entry["nodes"])} if entry["nodes"] else {})


def layer_colour(layer: str) -> tuple[int, int, int]:
    """Red, green, blue of 255."""
    return COLOURS.get(layer, GREY)


def check_shapes(part: Part, found: Mapping[str, tuple[Floats, Ints]]) -> ReadBack:
    """What was found; raises ExportError unless these are the part's members by name, each V (n, 3), millimetres, and
    F (m, 3) closed, of as many triangles, at its place, with its volume to 0.1 %."""
    shapes = part.details.shapes
    if [shape.id for shape in shapes] != list(found):
        raise differs(part, "members", len(shapes), len(found))
    total = there = 0.0
    for shape in shapes:
        V, F = found[shape.id]
        if len(F) != len(shape.F) or open_edges(F):
            raise differs(part, f"triangles in {shape.id}", len(shape.F), len(F))
        one, other = (signed_volume(*mesh) for mesh in ((shape.V, shape.F), (V, F)))
        size = float(np.ptp(shape.V, axis=0).max())
        moved = float(np.abs(V[F].mean(axis=(0, 1)) - shape.V[shape.F].mean(axis=(0, 1))).max())
        if not (abs(one - other) <= READ_BACK * one and moved <= READ_BACK * size):
            raise ExportError(f"the member {shape.id} of {part.name!r} reads back changed; write .members.json instead")
        total, there = total + one, there + other
    return ReadBack(len(found), "members", there / total - 1)
