"""Content of a file (`Part`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, first_few, lock
from dsfab.core.errors import ExportError
from dsfab.core.limits import READ_BACK
from dsfab.core.messages import count_phrase
from dsfab.core.units import MM_PER_M
from dsfab.surface import StructureLine, Surface, bounding_box, link_components, signed_volume, total_area
from dsfab.surface.topology import half_edges
from dsfab.thickening.solid import Solid

if TYPE_CHECKING:
    from dsfab.members import MemberGraph
    from dsfab.members.eurocode import Utilisation
    from dsfab.members.frame import Frame, MemberForces
    from dsfab.statics import SectionForces

NO_PAIRS = np.zeros((0, 2), dtype=np.int64)
NO_PAIRS.setflags(write=False)


class DividedSheet(NamedTuple):
    """A sheet in charts (parts). V, F, D : (n', 3) vertices, (m', 3) faces and (n', 3) half-thickness vectors, m.
    chart     : (m',) number of the chart of each face.
    half_edge : (k,) half-edges on the boundary of the sheet; the number is 3 * face + corner.
    family    : (k,) number of the pattern's field that cut the sheet at each half-edge; -1 on the uncut boundary."""

    V: Floats
    F: Ints
    D: Floats
    chart: Ints
    half_edge: Ints
    family: Ints


class StripedSheet(NamedTuple):
    """A sheet divided along all edges of its stripes. F : (m, 3) "cells" (triangles), oriented as the uncut surface.
    weights : (n', n) barycentric weights on the n vertices of the uncut surface.
    label   : (m,) number of the combination of stripes on a cell.    loose : (m,) True outside of all stripes.
    seam    : (k, 2) pairs of half-edges at the cut through a one-sided surface."""

    F: Ints
    weights: csr_array
    label: Ints
    loose: Bools
    seam: Ints = NO_PAIRS


@dataclass(frozen=True, eq=False)
class Curved:
    """The uncut surface of a cut sheet, and functions that divide the sheet. D : (n, 3) half-thickness vectors, m.
    V, F  : (n, 3) vertices and (m, 3) faces of the uncut, oriented surface, m.
    shift : distance of the sheet's middle from the surface, as a multiple of D: 0, 1 or -1.
    divided : function that divides the sheet by fields (n, c). Part k is the part where field k is largest.
    striped : function that divides the sheet along its stripes, or None.
    twins : (k, 2) pairs of vertices at equal places with opposite D."""

    V: Floats
    F: Ints
    D: Floats
    shift: int
    divided: Callable[[Floats], DividedSheet]
    striped: Callable[[], StripedSheet] | None = None
    twins: Ints = field(default_factory=lambda: NO_PAIRS)

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "D", np.float64, (None, 3))
        lock(self, "twins", np.int64, (None, 2))


@dataclass(frozen=True, eq=False)
class MemberShape:
    """A member as a closed mesh and lines. plate : True for a plate, False for a long and narrow member.
    id    : name of the member.    layer : "major", "minor", "rim", "keep" or "fill".
    V, F  : (n, 3) vertices and (m, 3) triangles, counter-clockwise seen from outside.
    axis  : (k, 3) points along the middle of the member; (0, 3) without an axis.
    edges : points (k, 3) of each closed outline on the middle surface."""

    id: str
    layer: str
    V: Floats
    F: Ints
    axis: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    edges: tuple[Floats, ...] = ()
    plate: bool = False

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "axis", np.float64, (None, 3))

    def scaled_by(self, factor: float) -> "MemberShape":
        """Return the shape with all lengths multiplied by `factor`."""
        edges = tuple(factor * line for line in self.edges)
        return replace(self, V=factor * self.V, axis=factor * self.axis, edges=edges)


STEP_FACES = 30_000  # default limit of the faces of a STEP file
Route = Literal["auto", "quick", "planar", "members", "smooth", "compact", "faceted", "tessellated"]
"""Names of the ways to write a STEP file; `compact` means the same as `smooth`."""


@dataclass(frozen=True, eq=False)
class Details:
    """Content of a file besides its mesh.

    lines     : edges and centre lines, m.    tolerance : largest error of `lines` or of curves along them, m.
    values    : values at the vertices (n, ...) or in the faces (m, ...) of the mesh, by name with SI unit.
    facts     : short texts for a title block, or about `values`.
    measures  : thickness (m), density (kg/m3), young (Pa) and poisson, as far as known.
    section_forces : section forces in the m faces of `sheet`, by load case or combination.
    shapes    : members as bodies, m.    whole_members : True if crossing members lie on top of each other.
    drawings  : drawing files of parts, by member.    origin : origin of the file on its site (east, north, up), m."""

    lines: tuple[StructureLine, ...] = ()
    tolerance: float = 0.0
    values: Mapping[str, Floats] = field(default_factory=dict)
    facts: tuple[str, ...] = ()
    measures: Mapping[str, float] = field(default_factory=dict)
    material: str = ""
    members: "MemberGraph | None" = None
    whole_members: bool = False
    drawings: Mapping[str, Sequence[str]] = field(default_factory=dict)
    frame: "Frame | None" = None
    sheet: Surface | None = None
    section_forces: Mapping[str, "SectionForces"] = field(default_factory=dict)
    member_forces: Mapping[str, "MemberForces"] | None = None
    utilisation: "Utilisation | None" = None
    description: str = ""
    shapes: tuple[MemberShape, ...] = ()
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def beam_model(self) -> "Frame":
        """Beam model of the members."""
        assert self.frame is not None
        return self.frame

    def scaled_by(self, factor: float) -> "Details":
        """Return the details with all lengths of lines and shapes multiplied by `factor`."""
        lines = tuple(replace(x, points=factor * x.points, length=factor * x.length) for x in self.lines)
        shapes = tuple(shape.scaled_by(factor) for shape in self.shapes)
        return replace(self, lines=lines, shapes=shapes, tolerance=factor * self.tolerance)


@dataclass(frozen=True, eq=False)
class StepOptions:
    """Options of a STEP file.

    route     : "planar"       lines and splines along the outline, for flat or folded sheets;
                "members"      untrimmed four-sided patches, for curved sheets;
                "smooth"       or "compact": few skins and ruled walls; CAD programs often fail to cut this file;
                "faceted"      planar faces only;    "tessellated"  triangles, for viewers only;
                "auto"         the first possible route above, except "tessellated".
    faces     : largest number of planar faces.    megabytes : largest size, 1e6 bytes; 0: no limit.
    tolerance : largest error of curves along the outline, m; 0 means a fortieth of the thickness.
    corners   : (k, 3) points of a flat sheet's outline, m, that stay corners.
    curved    : function that returns the curved sheet for smooth STEP."""

    route: str = "auto"
    faces: int = STEP_FACES
    tolerance: float = 0.0
    megabytes: float = 0.0
    corners: Floats | None = None
    curved: Callable[[], Curved] | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """A triangle mesh and the further content of a file.

    V, F       : (n, 3) vertices, mm, and (m, 3) faces; of a solid, counter-clockwise seen from outside.
    is_solid   : True for a closed mesh with a volume, False for a sheet.
    step_faces : largest number of faces of a STEP file.    step_mb : largest size, 1e6 bytes; 0: no limit.
    step       : strategy for a STEP file, as `StepOptions.route`.
    tolerance  : largest error of the curves of a planar STEP file, mm; 0 is the default.
    corners    : (k, 3) points of the outline that stay corners, mm.
    details    : content besides the mesh; lengths in mm.    note : text about earlier changes of the mesh.
    curved     : function that returns the sheet for smooth STEP, or None.
    cut        : True to test a smooth file by a trial cut.    hurry : factor on limits for STEP work; 0: no limits."""

    V: Floats
    F: Ints
    name: str
    is_solid: bool
    step_faces: int = 0
    step: str = "faceted"
    tolerance: float = 0.0
    corners: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    details: Details = field(default_factory=Details)
    step_mb: float = 0.0
    note: str = ""
    simpler: bool = False
    curved: Callable[[], Curved] | None = None
    hurry: int = 0
    cut: bool = False

    def __post_init__(self) -> None:
        lock(self, "corners", np.float64, (None, 3))
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))

    @cached_property
    def box(self) -> Floats:
        """Lowest and highest corner (2, 3) of the faces, millimetres."""
        return bounding_box(self.V, self.F)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, cubic millimetres."""
        return signed_volume(self.V, self.F)

    @cached_property
    def area(self) -> float:
        """Area, square millimetres."""
        return total_area(self.V, self.F)


def part_of(thing: Solid | Surface, name: str, step_faces: int = STEP_FACES) -> Part:
    """Return a solid or sheet as a part in millimetres. Raises ExportError for an impossible mesh."""
    part = Part(thing.V * MM_PER_M, thing.F, name, isinstance(thing, Solid), step_faces)
    if not len(part.F):
        raise ExportError(f"{name!r} has no faces, so the file would be empty; check the mesh")
    bad = np.flatnonzero(~np.isfinite(part.V).all(axis=1))
    if len(bad):
        where = f"{count_phrase(len(bad), 'vertex')} (first: {first_few(bad)})"
        raise ExportError(f"{name!r} has coordinates that are not finite numbers at {where}")
    if part.is_solid:
        faults = open_edges(part.F)
        if faults:
            raise ExportError(f"the solid {name!r} is open at {faults} edges; close its holes first")
        if not part.volume > 0:
            raise ExportError(
                f"the volume of {name!r} is {part.volume:.3g} mm3, which is not positive; reverse the solid's faces"
            )
    return part


def without_collapsed(part: Part, V: Floats, holding: str) -> Part:
    """Return the part with rounded vertices V (n, 3). Edges with zero length are removed.
    Raises ExportError if rounding spoils the solid. holding : name of the rounded content, for the error message."""
    a, b = half_edges(part.F)
    lost = np.flatnonzero((V[a] == V[b]).all(axis=1))
    if not len(lost):
        return replace(part, V=V)
    count, component = link_components(len(V), a[lost], b[lost])
    F = component[part.F]
    F = F[(np.roll(F, -1, axis=1) != F).all(axis=1)]
    merged = np.empty((count, 3))
    merged[component] = V
    small = replace(part, V=merged, F=F)
    if not len(F) or (part.is_solid and (open_edges(F) or abs(small.volume - part.volume) > READ_BACK * part.volume)):
        collapsed = np.unique([a[lost], b[lost]])
        raise ExportError(
            f"in {holding}, {len(collapsed)} vertices of {part.name!r} coincide after rounding (first: "
            f"{first_few(collapsed)}), and the shape changes; coarsen the mesh at these vertices, or move the mesh to "
            f"the origin (surface.origin)"
        )
    return small


def in_single_precision(part: Part) -> Part:
    """Round the vertices of a part to 32-bit numbers. Raises ExportError if rounding spoils the solid."""
    return without_collapsed(part, part.V.astype(np.float32).astype(np.float64), "numbers of single precision")


def open_edges(F: Ints) -> int:
    """Return the number of edges of F (m, 3) without an opposite edge; 0 for a closed, oriented mesh."""
    a, b = half_edges(F)
    keys = np.minimum(a, b) * (int(F.max()) + 1) + np.maximum(a, b)
    forward, backward = (np.sort(keys[mask]) for mask in (a < b, a > b))
    if np.array_equal(forward, backward) and len(forward) + len(backward) == len(keys):
        return 0  # nearly all meshes end here, without the slower count of open edges below
    keys, edge = np.unique(keys, return_inverse=True)
    return int(np.count_nonzero(np.bincount(edge, np.where(a < b, 1.0, -1.0), len(keys))))
