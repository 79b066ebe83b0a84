"""Tests of a triangle mesh for faults such as open edges and crossing triangles."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Floats, Ints, lock
from dsfab.core.errors import ExportError
from dsfab.export.part import Part
from dsfab.surface import signed_volume, signed_volumes, total_area
from dsfab.surface.topology import duplicate_faces, edge_table, misoriented_edges, pieces, pinches
from dsfab.thickening.self_intersection import intersecting_pairs


def solids_of(part: Part) -> tuple[Ints, list[list[int]]]:
    """Return the shell number (m,) of each triangle, and for each solid its shell numbers: outer shell, then voids.
    Raises ExportError for a void without an outer shell."""
    count, shell = pieces(part.F, edge_table(part.F))
    volumes = [signed_volume(part.V, part.F[shell == i]) for i in range(count)]
    outer = sorted((i for i in range(count) if volumes[i] > 0), key=lambda i: volumes[i])
    voids: dict[int, list[int]] = {i: [] for i in outer}
    for i in range(count):
        if volumes[i] > 0:
            continue
        point = part.V[part.F[(shell == i).argmax(), 0]]
        around = (o for o in outer if volumes[o] > -volumes[i] and winding(point, part.V, part.F[shell == o]) > 0.5)
        owner = next(around, None)
        if owner is None:
            raise ExportError(f"piece {i} of the solid {part.name!r} is inside out; reverse its faces")
        voids[owner].append(i)
    return shell, [[i, *voids[i]] for i in sorted(outer)]


def winding(point: Floats, V: Floats, F: Ints) -> float:
    """Return the winding number of the closed mesh V (n, 3), F (m, 3) around a point (3,): 1 inside, 0 outside.
    Source: van Oosterom, Strackee 1983."""
    a, b, c = (V[F[:, i]] - point for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    dot = [np.einsum("mi,mi->m", x, y) for x, y in ((a, b), (b, c), (c, a))]
    half = np.arctan2(np.einsum("mi,mi->m", a, np.cross(b, c)), la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)
    return float(half.sum() / (2 * np.pi))


FAULTS = {
    "open": "{} edges have only one triangle: the surface of the solid has a hole",
    "crowded": "{} edges have more than two triangles: parts of the solid touch along a line",
    "turned": "{} edges have two triangles that face opposite sides: some faces are flipped",
    "repeated": "{} triangles are copies of other triangles",
    "crossing": "{} pairs of triangles cross: parts of the solid run through each other",
    "inside_out": "{} closed surfaces face inward: their faces are flipped",
}
"""Description of each kind of fault, for the person who repairs the mesh."""


@dataclass(frozen=True)
class Fault:
    """Faults of a kind in a mesh: their `count`, and the place of the first fault, metres."""

    kind: str
    count: int
    place: tuple[float, float, float]

    @property
    def message(self) -> str:
        """Text with the number of the faults and their description."""
        return FAULTS[self.kind].format(self.count)


@dataclass(frozen=True, eq=False)
class Soundness:
    """Faults and measures of a mesh. faults : empty for a sound mesh.
    pinches   : number of points where two parts touch. This is not a fault.
    shells    : number of closed surfaces; a hollow body has two.    pieces : number of connected bodies.
    crossings : (k, 2) pairs of triangles that cross.    tested : True if crossings were tested.
    volume    : m3, valid for closed meshes only.     area : m2."""

    faults: tuple[Fault, ...]
    pinches: int
    tested: bool
    shells: int
    pieces: int
    volume: float
    area: float
    box: Floats
    crossings: Ints

    def __post_init__(self) -> None:
        lock(self, "box", np.float64, (2, 3))
        lock(self, "crossings", np.int64, (None, 2))

    @property
    def watertight(self) -> bool:
        """True for a closed mesh with consistently oriented triangles."""
        return not any(fault.kind in ("open", "crowded", "turned", "repeated") for fault in self.faults)

    @property
    def sound(self) -> bool:
        return not self.faults


def soundness(V: Floats, F: Ints) -> Soundness:
    """Return the faults and measures of a mesh.
    V : (n, 3) metres, distinct points.     F : (m, 3) counter-clockwise seen from outside."""
    edges = edge_table(F)
    middles = V[edges.ends].mean(axis=1)
    faults = [
        fault_at("open", middles[edges.boundary]),
        fault_at("crowded", middles[edges.count > 2]),
        fault_at("turned", middles[misoriented_edges(F, edges)]),
        fault_at("repeated", V[F[duplicate_faces(F)]].mean(axis=1)),
    ]
    manifold = not any(faults)
    count, label = pieces(F, edges)
    volumes = signed_volumes(V, F, label, count)
    pairs = intersecting_pairs(V, F) if manifold else np.zeros((0, 2), dtype=np.int64)
    faults.append(fault_at("crossing", V[F[pairs[:, 0]]].mean(axis=1)))
    bodies, inverted = _bodies(V, F, label, volumes) if manifold else (count, np.zeros(0, dtype=np.int64))
    faults.append(fault_at("inside_out", np.array([V[F[label == k][0, 0]] for k in inverted]).reshape(-1, 3)))
    return Soundness(
        tuple(fault for fault in faults if fault),
        len(pinches(F, edges, len(V))) if manifold else 0,
        manifold,
        count,
        bodies,
        float(volumes.sum()),
        total_area(V, F),
        np.stack([V.min(axis=0), V.max(axis=0)]),
        pairs,
    )


def fault_at(kind: str, places: Floats) -> Fault | None:
    """Return the faults of this kind at `places` (k, 3), m; None without places."""
    if not len(places):
        return None
    x, y, z = places[0].tolist()
    return Fault(kind, len(places), (x, y, z))


def _bodies(V: Floats, F: Ints, label: Ints, volumes: Floats) -> tuple[int, Ints]:
    outer = np.flatnonzero(volumes > 0)
    homeless = []
    for k in np.flatnonzero(volumes <= 0):
        point = V[F[label == k][0, 0]]
        around = (o for o in outer if volumes[o] > -volumes[k] and winding(point, V, F[label == o]) > 0.5)
        if next(around, None) is None:
            homeless.append(int(k))
    return len(outer), np.array(homeless, dtype=np.int64)
