"""Does a triangle mesh bound a solid? Closed, two triangles on each edge, facing outward, not crossing itself.

Asked of every file by `dsfab check`, and of STEP files with curved faces by the build before they are shipped.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.export.shells import winding
from dsfab.export.step_read import StepMesh, drawn_anew, read_step
from dsfab.surface import signed_volumes, total_area
from dsfab.surface.topology import duplicate_faces, edge_table, misoriented_edges, pieces, pinches
from dsfab.thickening.intersect import intersecting_pairs
from dsfab.units import METRES_PER

FINER = 2
"""How often triangles of curved faces are drawn at a quarter of the distance, where they cross."""

SAME_PLACE = 1e-9
"""Points of a STEP file that are closer than this share of its size are one: its faces are triangulated one by one."""

FAULTS = {
    "open": "{} edges have one triangle only: there is a hole in the skin",
    "crowded": "{} edges have more than two triangles: parts touch along a line",
    "turned": "{} edges have triangles that face opposite sides: some faces are flipped",
    "repeated": "{} triangles repeat an earlier one",
    "crossing": "{} pairs of triangles cross: parts of the solid run through each other",
    "inside_out": "{} closed surfaces face inward: their faces are flipped",
}
"""What each kind of fault is: what it means for the one who has to mend it."""


@dataclass(frozen=True)
class Fault:
    """What keeps a mesh from being a solid: how many of what, and a place of the first one, metres."""

    kind: str
    count: int
    place: tuple[float, float, float]

    @property
    def told(self) -> str:
        """What it is and what that means."""
        return FAULTS[self.kind].format(self.count)


@dataclass(frozen=True, eq=False)
class Soundness:
    """Whether a mesh is a solid, and what it measures.

    faults    : none for a sound one. Kinds: `open` edges with one triangle, `crowded` edges with more than two,
                `turned` edges whose two triangles face opposite sides, `repeated` triangles, `inside_out` shells,
                `crossing` pairs of triangles.
    pinches   : points in which nothing but corners meet; told, and no fault: the two parts are sound.
    tested    : whether crossings were looked for, which takes an oriented manifold.
    shells    : closed surfaces; a hollow body has two.    pieces : connected bodies of material.
    volume    : m3, of triangles as they are oriented; not to be trusted unless closed.     area : m2.
    """

    faults: tuple[Fault, ...]
    pinches: int
    tested: bool
    shells: int
    pieces: int
    volume: float
    area: float
    box: Floats

    def __post_init__(self) -> None:
        lock(self, "box", np.float64, (2, 3))

    @property
    def watertight(self) -> bool:
        """Closed, two triangles on each edge that agree about the outside."""
        return not any(fault.kind in ("open", "crowded", "turned", "repeated") for fault in self.faults)

    @property
    def sound(self) -> bool:
        """No faults at all."""
        return not self.faults


def soundness(V: Floats, F: Ints) -> Soundness:
    """Judge a mesh.

    V : (n, 3) metres, no two at one place.     F : (m, 3) seen from outside.
    """
    edges = edge_table(F)
    middles = V[edges.ends].mean(axis=1)
    crowded = np.flatnonzero(edges.count > 2)
    faults = [
        _fault("open", middles[edges.boundary]),
        _fault("crowded", middles[crowded]),
        _fault("turned", middles[misoriented_edges(F, edges)]),
        _fault("repeated", V[F[duplicate_faces(F)]].mean(axis=1)),
    ]
    manifold = not any(faults)
    count, label = pieces(F, edges)
    volumes = signed_volumes(V, F, label, count)
    if manifold:
        pairs = intersecting_pairs(V, F)
        faults.append(_fault("crossing", V[F[pairs[:, 0]]].mean(axis=1)))
    bodies, inverted = _bodies(V, F, label, volumes) if manifold else (count, np.zeros(0, dtype=np.int64))
    faults.append(_fault("inside_out", np.array([V[F[label == k][0, 0]] for k in inverted]).reshape(-1, 3)))
    return Soundness(
        tuple(fault for fault in faults if fault),
        len(pinches(F, edges, len(V))) if manifold else 0,
        manifold,
        count,
        bodies,
        float(volumes.sum()),
        total_area(V, F),
        np.stack([V.min(axis=0), V.max(axis=0)]),
    )


def curved_soundness(
    V: Floats, F: Ints, deflection: float, shape: bytes, tell: Callable[[], None] = lambda: None
) -> Soundness:
    """Judge the solid that triangles were drawn of.

    V, F  : as for `soundness`.    deflection : metres that they may be off curved faces; 0 where there are none.
    shape : what they were drawn of, as OCCT keeps it.    tell : called before they are drawn anew.

    Triangles of curved faces that cross are drawn finer before that is said of the faces: where two edges come close,
    chords of theirs may cross which the edges do not. Raises ExportError where OCCT takes too long for that.
    """
    sound = soundness(V, F)
    for _ in range(FINER):
        if not deflection or {fault.kind for fault in sound.faults} != {"crossing"}:
            break
        tell()
        deflection /= 4
        V, F, _ = step_triangles(drawn_anew(shape, deflection / METRES_PER["mm"]))
        sound = soundness(V, F)
    return sound


def step_fault(path: Path, deflection: float) -> str:
    """What keeps a STEP file with curved faces from being a solid, drawn to a deflection, metres; "" if nothing does.

    Raises ExportError when OCCT cannot read it or takes too long.
    """
    mesh = read_step(path, deflection / METRES_PER["mm"])
    V, F, _ = step_triangles(mesh)
    sound = curved_soundness(V, F, deflection, mesh.shape)
    if sound.sound:
        return ""
    fault = sound.faults[0]
    place = ", ".join(f"{x:.4g}" for x in fault.place)
    return f"{fault.told.partition(':')[0]} where OCCT draws it as triangles, at ({place}) m"


def step_triangles(mesh: StepMesh) -> tuple[Floats, Ints, int]:
    """Points in metres, no two at the same place, triangles with three different corners, and how many have not."""
    size = float(np.linalg.norm(np.ptp(mesh.V, axis=0)))
    grid = np.round(mesh.V / (SAME_PLACE * size))
    _, once, of = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    F = of.reshape(-1)[mesh.F]
    whole = (np.roll(F, -1, axis=1) != F).all(axis=1)
    return mesh.V[once] * METRES_PER["mm"], F[whole], int((~whole).sum())


def _fault(kind: str, places: Floats) -> Fault | None:
    if not len(places):
        return None
    x, y, z = places[0].tolist()
    return Fault(kind, len(places), (x, y, z))


def _bodies(V: Floats, F: Ints, label: Ints, volumes: Floats) -> tuple[int, Ints]:
    """Number of outer shells, and the shells that face inward without one around them."""
    outer = np.flatnonzero(volumes > 0)
    homeless = []
    for k in np.flatnonzero(volumes <= 0):
        point = V[F[label == k][0, 0]]
        around = (o for o in outer if volumes[o] > -volumes[k] and winding(point, V, F[label == o]) > 0.5)
        if next(around, None) is None:
            homeless.append(int(k))
    return len(outer), np.array(homeless, dtype=np.int64)
