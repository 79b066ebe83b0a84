"""Checks of STEP files: a trial cut by OCCT, and a test of OCCT's triangles."""

import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.derived import derived
from dsfab.core.units import METRES_PER
from dsfab.export.cad.step.shared.skins import SmoothLimits
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.cad.step.worker.reports import StepMesh, drawn_anew, occt_report, read_step
from dsfab.export.cad.step.worker.use import TOGETHER_LIMIT
from dsfab.export.mesh.soundness import Soundness, fault_at, soundness
from dsfab.export.part import Part
from dsfab.export.subprocesses import ProgramError
from dsfab.surface.topology import duplicate_faces, edge_table, misoriented_edges
from dsfab.thickening.self_intersection import intersecting_pairs

REDRAWING_ROUNDS = 2  # largest number of rounds; each round makes the triangles of crossing faces four times as exact


class StepTriangles(NamedTuple):
    """Triangles of the solids in a STEP file. V : (n, 3) points, m, all different.    lost : dropped triangles.
    F : (m, 3) triangles, counter-clockwise from outside.    face : (m,) number of the STEP face of each triangle."""

    V: Floats
    F: Ints
    face: Ints
    lost: int


def step_triangles(mesh: StepMesh) -> StepTriangles:
    """Convert OCCT's triangles to metres, and merge points at the same place."""
    same_place = 1e-9  # points closer than 1e-9 * diagonal merge; OCCT triangulates each face separately
    grid = np.round(mesh.V / (same_place * float(np.linalg.norm(np.ptp(mesh.V, axis=0)))))
    _, once, point_number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    F = point_number.reshape(-1)[mesh.F]
    is_proper = (np.roll(F, -1, axis=1) != F).all(axis=1)
    return StepTriangles(mesh.V[once] * METRES_PER["mm"], F[is_proper], mesh.face[is_proper], int((~is_proper).sum()))


def curved_soundness(
    first_triangles: StepTriangles, deflection: float, shape: bytes, on_redraw: Callable[[], None] = lambda: None
) -> Soundness:
    """Judge a solid with curved faces by its triangles. Raises ExportError if OCCT takes too long.
    deflection : largest distance of the triangles from curved faces, m; 0 without such faces.
    shape      : OCCT's binary shape of the file.    on_redraw : function to call before each finer triangulation."""
    sound, triangles = soundness(first_triangles.V, first_triangles.F), first_triangles
    crossing_faces: Ints = np.zeros(0, dtype=np.int64)
    for k in range(1, REDRAWING_ROUNDS + 1):
        if not deflection or {fault.kind for fault in sound.faults} != {"crossing"}:
            break
        on_redraw()
        crossing_faces = np.union1d(crossing_faces, triangles.face[sound.crossings])  # with faces of earlier rounds
        faces = _faces_near(first_triangles, crossing_faces, deflection)
        sound, triangles = _redraw(sound, first_triangles, faces, deflection / 4**k, shape)
    return sound


def step_fault(path: Path, deflection: float) -> str:
    """Return the reason why a STEP file is not a solid; "" for a solid.
    Raises ExportError if OCCT fails or takes too long. deflection : largest error of triangles, m."""
    mesh = read_step(path, deflection / METRES_PER["mm"])
    return triangle_fault(step_triangles(mesh), deflection, mesh.shape)


def triangle_fault(first_triangles: StepTriangles, deflection: float, shape: bytes) -> str:
    """Return why triangles of a shape bound no solid; "" for a solid. deflection : largest error of triangles, m."""
    sound = curved_soundness(first_triangles, deflection, shape)
    if sound.sound:
        return ""
    fault = sound.faults[0]
    place = ", ".join(f"{x:.4g}" for x in fault.place)
    return f"{fault.message.partition(':')[0]} when OCCT divides the solid into triangles, at ({place}) m"


def _faces_near(triangles: StepTriangles, faces: Ints, deflection: float) -> Ints:
    count, corners = int(triangles.face.max()) + 1, triangles.V[triangles.F]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, triangles.face, corners.min(axis=1) - deflection)
    np.maximum.at(high, triangles.face, corners.max(axis=1) + deflection)
    is_near: Bools = np.isin(np.arange(count), faces)
    for k in faces:
        is_near |= ((low <= high[k]) & (high >= low[k])).all(axis=1)
    return np.flatnonzero(is_near)


def _redraw(
    sound: Soundness, first_triangles: StepTriangles, faces: Ints, deflection: float, shape: bytes
) -> tuple[Soundness, StepTriangles]:
    redrawn = step_triangles(drawn_anew(shape, deflection / METRES_PER["mm"], faces))
    if not np.array_equal(np.unique(redrawn.face), faces) or not _same_topology(first_triangles, redrawn):
        redrawn = step_triangles(drawn_anew(shape, deflection / METRES_PER["mm"]))
        return soundness(redrawn.V, redrawn.F), redrawn
    pairs = intersecting_pairs(redrawn.V, redrawn.F)
    fault = fault_at("crossing", redrawn.V[redrawn.F[pairs[:, 0]]].mean(axis=1))
    return replace(sound, faults=(fault,) if fault else (), crossings=pairs), redrawn


def _same_topology(coarse: StepTriangles, fine: StepTriangles) -> bool:
    """Return True if `fine` is an oriented manifold with the same Euler number as its faces have in `coarse`."""
    selected = np.isin(coarse.face, fine.face)
    edges = edge_table(fine.F)
    crowded = (edges.count > 2).any() or len(duplicate_faces(fine.F))
    return not crowded and not len(misoriented_edges(fine.F, edges)) and _euler(coarse.F[selected]) == _euler(fine.F)


def _euler(F: Ints) -> int:
    return len(np.unique(F)) - len(edge_table(F).ends) + len(F)


MOST_FACES = 2000  # largest number of faces for an automatic trial cut (up to 15 s)


@dataclass(frozen=True)
class SampledUse:
    """Result of a trial cut. tried : True if OCCT tried a cut.    fault : reason for failure, or ""."""

    tried: bool
    fault: str = ""


@derived
def smooth_use(part: Part) -> SampledUse:
    """Let OCCT cut the solid in a part's smooth file as a trial, and return the result."""
    most_faces = 500  # largest number of faces for a trial cut (half a minute for 1400 faces)
    file = smooth_file(part)
    if not part.cut or file.faces > most_faces:
        return SampledUse(False)
    return sampled_use(part, file.text.encode("ascii"), file.faces, file.limits)


def sampled_use(part: Part, file: bytes, faces: int, limits: SmoothLimits, suffix: str = ".step") -> SampledUse:
    """Cut the solid in a file once as a trial, and compare the solid's bounding box with the part's box.
    file : STEP text, or OCCT's binary shape (`suffix` ".bin")."""
    if faces > MOST_FACES:
        return SampledUse(False)
    with _file(file, suffix) as path:
        fault, bounds = cut_fault(path, faces)
    return SampledUse(True, fault or box_fault(part, bounds, limits))


def cut_fault(path: Path, faces: int) -> tuple[str, list[float]]:
    """Cut the solid in a file as a trial. Return the fault or "", and the solid's box (6 numbers, mm, or [])."""
    seconds = 30.0 + 0.03 * faces  # several times the usual duration of a trial cut
    try:
        report = occt_report("sample", str(path), seconds=seconds)
    except (subprocess.TimeoutExpired, ProgramError):
        return f"OCCT did not complete a trial cut within {seconds:.0f} s of processor time", []
    if not report["halves"]:
        return "a trial cut in OCCT makes a half that is not valid", report["box"]
    is_lossy = report["off"] > TOGETHER_LIMIT
    return (
        f"a trial cut in OCCT changes the total volume by {report['off']:.1e} (relative)" if is_lossy else "",
        report["box"],
    )


def use_report(text: str, seconds: float) -> dict[str, Any]:
    """Return OCCT's report on trial cuts and fillets with a STEP file. Raises ProgramError or TimeoutExpired.
    text : content of the file.    seconds : limit of processor time."""
    with _file(text.encode("ascii")) as path:
        return occt_report("use", str(path), seconds=seconds)


@contextmanager
def _file(content: bytes, suffix: str = ".step") -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(content)
        yield path


def box_fault(part: Part, bounds: list[float], limits: SmoothLimits, share: float = 1e-2) -> str:
    """Return a sentence if OCCT's bounding box differs from the part's box, else "".
    bounds : six numbers of OCCT's box, mm.    share : largest error / diagonal of the part's box."""
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    distance = float(np.abs(np.array(bounds).reshape(2, 3) - part.box).max())
    is_far = distance > share * size + limits.distance + limits.usual_chord
    return f"the bounding box that OCCT computes for the solid is wrong by {distance:.3g} mm" if is_far else ""
