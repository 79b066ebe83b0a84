"""Does a STEP file with curved faces hold a solid? OCCT draws it as triangles, and `soundness` judges these.

Asked by `dsfab check`, and by the build before such a file is shipped. Triangles of curved faces may cross where the
faces do not: where two edges come close, chords of theirs may cross. Such faces are drawn finer before it is said of
them, and with them those that they could meet; all others were found apart from each other, and are not asked again.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.mesh_soundness import Soundness, fault_at, soundness
from dsfab.export.step_read import StepMesh, drawn_anew, read_step
from dsfab.surface.topology import duplicate_faces, edge_table, misoriented_edges
from dsfab.thickening.intersect import intersecting_pairs
from dsfab.units import METRES_PER

FINER = 2
"""How often triangles of curved faces are drawn at a quarter of the distance, where they cross."""

SAME_PLACE = 1e-9
"""Points of a STEP file that are closer than this share of its size are one: its faces are triangulated one by one."""


class StepTriangles(NamedTuple):
    """V (n, 3) metres, no two at the same place; F (m, 3) with three different corners, seen from outside.

    face : (m,) of the file that each is of.     lost : triangles that had not three different corners.
    """

    V: Floats
    F: Ints
    face: Ints
    lost: int


def step_triangles(mesh: StepMesh) -> StepTriangles:
    """What OCCT drew, its points joined by place."""
    size = float(np.linalg.norm(np.ptp(mesh.V, axis=0)))
    grid = np.round(mesh.V / (SAME_PLACE * size))
    _, once, of = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    F = of.reshape(-1)[mesh.F]
    whole = (np.roll(F, -1, axis=1) != F).all(axis=1)
    return StepTriangles(mesh.V[once] * METRES_PER["mm"], F[whole], mesh.face[whole], int((~whole).sum()))


def curved_soundness(
    first: StepTriangles, deflection: float, shape: bytes, tell: Callable[[], None] = lambda: None
) -> Soundness:
    """Judge the solid that triangles were drawn of.

    first : the triangles.    deflection : metres that they may be off curved faces; 0 where there are none.
    shape : what they were drawn of, as OCCT keeps it.    tell : called before faces are drawn anew.

    What is said but of crossings is of the first triangles. Raises ExportError where OCCT takes too long.
    """
    sound, drawn, met = soundness(first.V, first.F), first, np.zeros(0, dtype=np.int64)
    for k in range(1, FINER + 1):
        if not deflection or {fault.kind for fault in sound.faults} != {"crossing"}:
            break
        tell()
        met = np.union1d(met, drawn.face[sound.crossings])  # none is let off for one drawing without a crossing
        sound, drawn = _finer(sound, first, _near(first, met, deflection), deflection / 4**k, shape)
    return sound


def step_fault(path: Path, deflection: float) -> str:
    """What keeps a STEP file with curved faces from being a solid, drawn to a deflection, metres; "" if nothing does.

    Raises ExportError when OCCT cannot read it or takes too long.
    """
    mesh = read_step(path, deflection / METRES_PER["mm"])
    return drawn_fault(step_triangles(mesh), deflection, mesh.shape)


def drawn_fault(first: StepTriangles, deflection: float, shape: bytes) -> str:
    """The same of what OCCT has read and drawn: see `curved_soundness`."""
    sound = curved_soundness(first, deflection, shape)
    if sound.sound:
        return ""
    fault = sound.faults[0]
    place = ", ".join(f"{x:.4g}" for x in fault.place)
    return f"{fault.told.partition(':')[0]} where OCCT draws it as triangles, at ({place}) m"


def _near(first: StepTriangles, faces: Ints, deflection: float) -> Ints:
    """Numbers of faces, and of all that they could meet: whose boxes overlap when each is larger by the deflection,
    which holds a face whose triangles the box is of."""
    count, corners = int(first.face.max()) + 1, first.V[first.F]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, first.face, corners.min(axis=1) - deflection)
    np.maximum.at(high, first.face, corners.max(axis=1) + deflection)
    near: Bools = np.isin(np.arange(count), faces)
    for k in faces:
        near |= ((low <= high[k]) & (high >= low[k])).all(axis=1)
    return np.flatnonzero(near)


def _finer(
    sound: Soundness, first: StepTriangles, faces: Ints, deflection: float, shape: bytes
) -> tuple[Soundness, StepTriangles]:
    """What is known of a solid once some of its faces are drawn finer, and their triangles.

    All are drawn where those do not hang together as they did, for then they say nothing of the rest.
    """
    drawn = step_triangles(drawn_anew(shape, deflection / METRES_PER["mm"], faces))
    if not np.array_equal(np.unique(drawn.face), faces) or not _alike(first, drawn):
        drawn = step_triangles(drawn_anew(shape, deflection / METRES_PER["mm"]))
        return soundness(drawn.V, drawn.F), drawn
    pairs = intersecting_pairs(drawn.V, drawn.F)
    fault = fault_at("crossing", drawn.V[drawn.F[pairs[:, 0]]].mean(axis=1))
    return replace(sound, faults=(fault,) if fault else (), crossings=pairs), drawn


def _alike(coarse: StepTriangles, fine: StepTriangles) -> bool:
    """Whether fine triangles of some faces are an oriented manifold of the same Euler number as coarse ones of these:
    what OCCT leaves out, or does not join, makes it another one."""
    ones = np.isin(coarse.face, fine.face)
    edges = edge_table(fine.F)
    crowded = (edges.count > 2).any() or len(duplicate_faces(fine.F))
    return not crowded and not len(misoriented_edges(fine.F, edges)) and _euler(coarse.F[ones]) == _euler(fine.F)


def _euler(F: Ints) -> int:
    return len(np.unique(F)) - len(edge_table(F).ends) + len(F)
