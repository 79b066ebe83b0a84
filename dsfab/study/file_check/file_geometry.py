"""Walls and gaps of an exported file, and the file's distance from the design."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, lock
from dsfab.core.errors import ExportError, SurfaceError
from dsfab.core.limits import DEFLECTION, OFF_SURFACE, SIMPLIFIED_OFF_SURFACE
from dsfab.core.units import METRES_PER, MM_PER_M, metres_per
from dsfab.design.design import Design
from dsfab.design.output import curved_design
from dsfab.export import SmoothLimits, read_step, smooth_limits, step_triangles
from dsfab.preset.model import Preset
from dsfab.surface import DEFAULT_TRIANGLES, Surface, nearest_places, raw_mesh
from dsfab.surface.files.other_libraries import stl_by_trimesh, threemf_by_lib3mf
from dsfab.surface.topology import edge_table
from dsfab.thickening.offset_vectors import SHIFT
from dsfab.thickening.wall_thickness import INSIDE, OPPOSED, Facets, Rays

SUFFIXES = (".stl", ".3mf", ".step", ".stp")  # suffixes of files that can be checked
STEP_BEGINS = b"ISO-10303-21"  # text at the beginning of every STEP file
BY_CONVENTION = "mm"  # assumed unit of STL files
CURVED = (
    *(f"{word}_SURFACE".encode() for word in ("B_SPLINE", "UNIFORM", "BEZIER")),
    *(f"{word}_SURFACE".encode() for word in ("CYLINDRICAL", "CONICAL", "SPHERICAL", "TOROIDAL")),
    b"SURFACE_OF_",
)
"""Words in the text of a STEP file that mark curved faces."""


@dataclass(frozen=True, eq=False)
class FileContents:
    """The solid in an STL, 3MF or STEP file, as a triangle mesh.
    V      : (n, 3) distinct points, metres.    F : (m, 3) triangles with three different corners.
    metres : length of the file's unit, metres.    declared : True if the file names the unit.
    collapsed : number of triangles that were left out, because corners coincide.
    deflection : largest distance (m) between triangles and curved STEP faces; 0 if there are none.
    shape  : STEP shape in OCCT's binary format, or empty.    face : (m,) number of each triangle's STEP face."""

    path: Path
    V: Floats
    F: Ints
    unit: str
    declared: bool
    metres: float
    collapsed: int
    reader: str
    deflection: float = 0.0
    shape: bytes = b""
    face: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "face", np.int64, (None,))

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, metres."""
        return float(np.linalg.norm(np.ptp(self.V, axis=0)))


def read_shipped(
    path: str | Path, unit: str | None = None, max_triangles: int = DEFAULT_TRIANGLES, deflection: float = 0.0
) -> FileContents:
    """Read the solid in an STL, 3MF or STEP file.
    unit : unit of the numbers in an STL file, default millimetres. For other files, a unit raises ExportError.
    max_triangles : largest accepted number of triangles in an STL or 3MF file.
    deflection : largest distance (m) between triangles and curved STEP faces; 0 for the reader's default.
    Raises SurfaceError or ExportError for a missing, empty or unreadable file, or coordinates that are not finite."""
    path = Path(path)
    suffix = path.suffix.lower()
    if path.is_dir():
        names = sorted(file.name for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        hint = f"give {path / names[0]}" if names else f"the folder has no file to check ({', '.join(SUFFIXES)})"
        raise ExportError(f"{path} is a folder; {hint}")
    if suffix not in SUFFIXES:
        raise ExportError(f"{path} has the suffix {suffix!r}; `dsfab check` reads {', '.join(SUFFIXES)}")
    if unit is not None and suffix != ".stl":
        raise ExportError(f"the file {path} already states a unit; leave out --unit, which is for STL files")
    if suffix in (".step", ".stp"):
        contents = _step_contents(path, deflection)
    else:
        raw = raw_mesh(path, max_triangles)
        unit_name = unit or raw.unit or BY_CONVENTION
        metres = raw.metres if raw.unit else metres_per(unit_name)
        V, F, lost = _join_vertices(*(stl_by_trimesh if suffix == ".stl" else threemf_by_lib3mf)(path))
        reader = "lib3mf" if raw.unit else "trimesh"
        contents = FileContents(path, V * metres, F, unit_name, raw.unit is not None, metres, lost, reader)
    if not np.isfinite(contents.V).all():
        raise SurfaceError(f"{path} has coordinates that are not finite numbers; export the file again")
    if not len(contents.F):
        raise ExportError(f"{path} has no triangle with three different corners; export the file again")
    return contents


def _step_contents(path: Path, deflection: float) -> FileContents:
    if not path.is_file():
        raise ExportError(f"{path} does not exist; check the path")
    if not path.stat().st_size:
        raise ExportError(f"{path} is empty; export the file again")
    with path.open("rb") as file:
        if STEP_BEGINS not in file.read(1000):
            raise ExportError(
                f"{path} does not begin with {STEP_BEGINS.decode()} as STEP files do; export the file again"
            )
    mesh = read_step(path, deflection * MM_PER_M)
    if not mesh.solids or not len(mesh.F):
        raise ExportError(f"{path} contains no solid; export the part again as a solid")
    V, F, face, lost = step_triangles(mesh)
    metres = METRES_PER["mm"]
    text = path.read_bytes()
    chord_error = mesh.deflection * metres if any(word in text for word in CURVED) else 0.0
    return FileContents(path, V, F, "mm", True, metres, lost, "OCCT", chord_error, mesh.shape, face)


def _join_vertices(V: Floats, F: Ints) -> tuple[Floats, Ints, int]:
    points, vertex_numbers = np.unique(V + 0.0, axis=0, return_inverse=True)
    F = vertex_numbers.reshape(-1)[F]
    is_proper = (np.roll(F, -1, axis=1) != F).all(axis=1)
    return points, F[is_proper], int((~is_proper).sum())


FLAT = 64 * float(np.finfo(np.float32).eps)  # flatter triangles (height / mesh size) have no normal
PARALLEL = float(np.cos(np.radians(3)))  # cosine of the smallest angle between faces that form a tip or a notch


@dataclass(frozen=True, eq=False)
class Clearance:
    """Shortest distance between opposite faces of a mesh (`size`, m), and a point where it occurs (`place`, m)."""

    size: float
    place: Floats

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class Clearances:
    """The thinnest wall and the smallest gap of a mesh; None if the mesh has no wall or no gap."""

    wall: Clearance | None
    gap: Clearance | None


def clearances(V: Floats, F: Ints) -> Clearances:
    """Return the thinnest wall and the smallest gap of a closed mesh.
    V : (n, 3) vertices, metres.    F : (m, 3) faces with normals that point outwards."""
    N, has_normal = _normals(V, F)
    face = np.flatnonzero(has_normal)
    corners = V[F[face]]
    centre = corners.mean(axis=1)
    start = np.concatenate([centre, *(INSIDE * centre + (1 - INSIDE) * corners[:, k] for k in range(3))])
    face = np.tile(face, 4)
    rays, facets = Rays(V, F), Facets(F, N)

    def shortest(sign: float) -> Clearance | None:
        hit = rays.first_hits(start, sign * N[face])
        opposed = -np.einsum("ki,ki->k", N[face], N[hit])
        met = (hit >= 0) & has_normal[hit] & (opposed > OPPOSED)
        tapering = np.flatnonzero(met & (opposed < PARALLEL))
        met[tapering[_neighbours(F, face[tapering], hit[tapering])]] = False
        depth = np.einsum("ki,ki->k", V[F[hit, 0]] - start, N[hit])
        depth = np.where(met, np.abs(depth), np.inf)
        k = facets.nearest_separate_pair(depth, face, hit)
        return None if k is None else Clearance(float(depth[k]), start[k])

    return Clearances(shortest(-1.0), shortest(1.0)) if len(face) else Clearances(None, None)


def _normals(V: Floats, F: Ints) -> tuple[Floats, Bools]:
    P, cross = V[F], area_vectors(V, F)
    twice = np.linalg.norm(cross, axis=1)
    longest = np.linalg.norm(np.roll(P, -1, axis=1) - P, axis=2).max(axis=1)
    has_normal = twice > FLAT * float(np.linalg.norm(np.ptp(V, axis=0))) * longest
    return cross / np.where(twice > 0, twice, 1.0)[:, None], np.asarray(has_normal)


def _neighbours(F: Ints, first_faces: Ints, second_faces: Ints) -> Bools:
    n = int(F.max()) + 1
    ends = edge_table(F).ends
    keys = np.sort(ends[:, 0] * n + ends[:, 1])
    adjacent = np.zeros(len(first_faces), dtype=bool)
    for a in F[first_faces].T:
        for b in F[second_faces].T:
            key = np.minimum(a, b) * n + np.maximum(a, b)
            adjacent |= (a == b) | (keys[np.minimum(np.searchsorted(keys, key), len(keys) - 1)] == key)
    return adjacent


MIXED_UP = {1e-3: "m", 1e-2: "dm", 1e-1: "cm", 25.4: "mm", 1e3: "mm", 1 / 25.4: "in", 1 / 304.8: "ft"}
"""Probable true unit of a file's numbers, for a ratio of sizes: size of the file's solid / size of the design."""


@dataclass(frozen=True, eq=False)
class Distance:
    """Distances (m) between the solid in a file and the solid of a design, with the points (3,) where they occur.
    skin      : largest distance of the file's top and bottom faces from their exact position.    skin_mean : mean.
    to_design : largest distance from a point of the file to the design.
    from_design : largest distance from a point of the design to the file.
    beyond    : largest difference "distance - allowed distance"; at most 0 if all distances are allowed.
    allowed   : the allowed distance where this difference occurs.
    scale     : diagonal of the file's bounding box divided by that of the design."""

    skin: float
    skin_place: Floats
    skin_mean: float
    to_design: float
    to_place: Floats
    from_design: float
    from_place: Floats
    beyond: float
    allowed: float
    scale: float

    def __post_init__(self) -> None:
        for name in ("skin_place", "to_place", "from_place"):
            lock(self, name, np.float64, (3,))

    @property
    def largest(self) -> float:
        """The larger value of `to_design` and `from_design`, metres."""
        return max(self.to_design, self.from_design)

    @property
    def meant_unit(self) -> str | None:
        """Probable true unit of the file's numbers if the assumed unit is wrong; None if it is right."""
        return next((unit for factor, unit in MIXED_UP.items() if abs(self.scale / factor - 1) < 0.02), None)


@dataclass(frozen=True, eq=False)
class Allowance:
    """Allowed distance between the solid in a file and the solid of a design.
    flat : allowed distance on flat faces, m.    limits : distances to add on curved faces; None without such faces."""

    flat: float
    limits: SmoothLimits | None = None

    @classmethod
    def from_design(cls, contents: FileContents, design: Design) -> "Allowance":
        """Return the allowed distance between the solid in a file and a design's solid."""
        flat, step_tolerance = off_surface(design.preset), design.preset.export.step_tolerance
        if contents.reader != "OCCT":
            return cls(OFF_SURFACE * design.preset.statics.thickness)
        if not contents.deflection:
            return cls(step_tolerance or SIMPLIFIED_OFF_SURFACE * flat)
        try:
            curved = curved_design(design)
            limits = smooth_limits(Surface(curved.V, curved.F), curved, MM_PER_M * step_tolerance)
        except ExportError:  # the design has no smooth sheet
            limits = None
        return cls(flat + contents.deflection, limits)

    def at_points(self, points: Floats) -> Floats:
        """Return the allowed distance (k,), metres, at points (k, 3)."""
        flat = np.full(len(points), self.flat)
        if self.limits is None:
            return flat
        return np.asarray(flat + (self.limits.chord[self.limits.nearest(MM_PER_M * points)] / MM_PER_M))


def off_surface(preset: Preset) -> float:
    """Return the allowed distance (m) between a STEP file's curved faces and the design's exact surface."""
    return preset.export.step_tolerance or OFF_SURFACE * preset.statics.thickness


def deflection_for(preset: Preset) -> float:
    """Return the largest allowed distance (m) between a STEP file's curved faces and the triangles of a check."""
    return DEFLECTION * off_surface(preset)


def distance(contents: FileContents, design: Design) -> Distance:
    """Measure distances from the solid in a file to a design's solid, and in the opposite direction."""
    V, F, allowed = contents.V, contents.F, Allowance.from_design(contents, design)
    to, to_place, to_excess = _farthest(V, F, design.solid.V, design.solid.F, allowed)
    back, back_place, back_excess = _farthest(design.solid.V, design.solid.F, V, F, allowed)
    skin, place, mean = _skin_offsets(V, F, design)
    scale = float(np.linalg.norm(np.ptp(V, axis=0)) / np.linalg.norm(np.ptp(design.solid.box, axis=0)))
    return Distance(skin, place, mean, to, to_place, back, back_place, *max(to_excess, back_excess), scale)


def _farthest(
    V: Floats, F: Ints, onto_V: Floats, onto_F: Ints, allowed: Allowance
) -> tuple[float, Floats, tuple[float, float]]:
    P = np.concatenate([V, V[F].mean(axis=1)])
    offsets = nearest_places(P, onto_V, onto_F).distance
    k = int(offsets.argmax())
    candidates = np.flatnonzero(offsets > allowed.flat)  # points within the limit for flat faces need no check
    candidates = candidates if len(candidates) else np.array([k])
    permitted = allowed.at_points(P[candidates])
    worst = int((offsets[candidates] - permitted).argmax())
    return float(offsets[k]), P[k], (float(offsets[candidates][worst] - permitted[worst]), float(permitted[worst]))


def _skin_offsets(V: Floats, F: Ints, design: Design) -> tuple[float, Floats, float]:
    sheet: Surface = design.sheet.surface
    cross = area_vectors(V, F)
    twice = np.linalg.norm(cross, axis=1)
    P = V[F].mean(axis=1)
    projection = nearest_places(P, sheet.V, sheet.F)
    distances, face = projection.distance, projection.simplex
    along = np.abs(np.einsum("mi,mi->m", cross, sheet.normals[face]))
    skin = (twice > 0) & (along > 0.9 * twice)  # faces at the top and bottom; the others are walls
    half = design.preset.statics.thickness / 2
    shift = abs(SHIFT[design.preset.thickening.side])
    differences = np.abs(distances[:, None] - np.array([half * (1 - shift), half * (1 + shift)])).min(axis=1)
    if not skin.any():
        return 0.0, np.zeros(3), 0.0
    k = int(np.where(skin, differences, -1).argmax())
    return float(differences[k]), P[k], float((differences * twice)[skin].sum() / twice[skin].sum())
