"""Soundness of a STEP file for CAD programs: a trial cut by OCCT, and the triangles that OCCT draws of it."""

import json
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.units import METRES_PER
from dsfab.export.cad.step.shared.skins import Limits
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.cad.step.worker import use_check
from dsfab.export.cad.step.worker.reports import StepMesh, drawn_anew, read_step
from dsfab.export.mesh.soundness import Soundness, fault_at, soundness
from dsfab.export.part import Part
from dsfab.export.subprocesses import ProgramError, last_line
from dsfab.surface.topology import duplicate_faces, edge_table, misoriented_edges
from dsfab.thickening.self_intersection import intersecting_pairs

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


MOST_FACES = 2000
"""Of a file that is cut unasked: so many take OCCT 4 seconds to cut and to ask whether the halves are valid, and 10 to
15 where the text is read again for it."""

MOST_SMOOTH = 500
"""Of a smooth file: its skins have all openings' edges, and 1400 faces took OCCT half a minute."""

SECONDS, SECONDS_PER_FACE = 30.0, 0.03
"""Of the processor: some times what was measured. Volumes of smooth halves with hundreds of edges take that long."""

BOX = 1e-2
"""Share of its diagonal that the box of a solid may be off at each side."""


@dataclass(frozen=True)
class SampledUse:
    """tried : whether the solid was cut.    fault : what went wrong, "" if nothing did."""

    tried: bool
    fault: str = ""


_TRIED: WeakKeyDictionary[Part, SampledUse] = WeakKeyDictionary()


def smooth_use(part: Part) -> SampledUse:
    """What becomes of one cut of a part's smooth file, tried once, where that is wanted of the part."""
    if part not in _TRIED:
        file = smooth_file(part)
        wanted = part.cut and file.faces <= MOST_SMOOTH
        text = file.text.encode("ascii")
        _TRIED[part] = sampled_use(part, text, file.faces, file.limits) if wanted else SampledUse(False)
    return _TRIED[part]


def sampled_use(part: Part, file: bytes, faces: int, limits: Limits, suffix: str = ".step") -> SampledUse:
    """What becomes of one cut of a part's file with so many faces, or of what OCCT keeps of it once read (`.bin`)."""
    if faces > MOST_FACES:
        return SampledUse(False)
    with _file(file, suffix) as path:
        fault, bounds = cut_fault(path, faces)
    return SampledUse(True, fault or box_fault(part, bounds, limits))


def cut_fault(path: Path, faces: int) -> tuple[str, list[float]]:
    """What is wrong with the halves that one cut leaves of a file with so many faces, "" if nothing is; and the box of
    the whole, six numbers in millimetres, if OCCT came that far."""
    seconds = SECONDS + SECONDS_PER_FACE * faces
    try:
        said = json.loads(last_line(use_check.__file__, str(path), "sample", seconds=seconds))
    except (subprocess.TimeoutExpired, ProgramError):
        return f"OCCT did not cut it within {seconds:.0f} s of the processor", []
    if not said["halves"]:
        return "a half of it is not valid once OCCT has cut it", said["box"]
    missed = said["off"] > use_check.ADDS
    return f"its halves miss {said['off']:.1e} of its volume once OCCT has cut it" if missed else "", said["box"]


def said_of_use(text: str, seconds: float) -> dict[str, Any]:
    """All that `use_check` says of a file; raises as `last_line`."""
    with _file(text.encode("ascii")) as path:
        return dict(json.loads(last_line(use_check.__file__, str(path), seconds=seconds)))


@contextmanager
def _file(content: bytes, suffix: str = ".step") -> Iterator[Path]:
    """A file with a content, for as long as it is looked at."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(content)
        yield path


def box_fault(part: Part, bounds: list[float], limits: Limits, share: float = BOX) -> str:
    """What is wrong with a box, six numbers in millimetres, that OCCT finds around a part's file; "" if nothing is.

    share : of the part's size that it may be off.
    """
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    off = float(np.abs(np.array(bounds).reshape(2, 3) - part.box).max())
    return f"OCCT's box of it is {off:.3g} mm off" if off > share * size + limits.distance + limits.usual else ""
