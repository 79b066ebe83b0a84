"""What OCCT finds in a STEP file of smooth solids, one by one: a program of its own, because a check may not end.

    python -P check.py FILE [FOLDER DEFLECTION]

prints one line of JSON, {"solids": [{...}, ...]}, in the order of the file; each with `valid`, `closed`, `tessellates`,
`faces`, `volume` (cubic millimetres), `gap` (millimetres: the largest distance between an edge and its curve on a face,
measured, whatever tolerance it was given), and `bad`, the ends (k, 3) of the edges that cross others. A solid that is
not valid gets no triangles, and one without them no volume: it is refused, and they take most of the time.
The triangles of each solid, no farther than `DEFLECTION` millimetres from it, become `0.stl`, `1.stl` ... in `FOLDER`.
Without arguments it loads OCCT and then reads them from its input, a list as one line of JSON.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

ACROSS = 1e-3
"""Deflection of the triangles unless told, as a share of a solid's size."""

SAMPLES = 24
"""Places along each edge where its gap is measured."""

VOLUME = 1e-3
"""Share that a volume may be off, as the adaptive rule estimates it: it was off by a hundredth of that. The rule of
Gauss and Kronrod, asked for the same, is no quicker and off by a tenth of it."""

COPIES = sys.platform == "linux"
"""Where a process is copied safely."""

LATEST = 600
"""Seconds of CPU after which a copy of this process ends, whatever became of the others."""


def inspected(path: str, folder: str = "", deflection: float = 0.0, copies: bool = False) -> list[dict[str, Any]]:
    """The findings for each solid of a file; empty when it cannot be read.

    copies : whether a copy of the process may find the volume, a third of the work, meanwhile.
    """
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader
    from OCP.StlAPI import StlAPI_Writer
    from OCP.TopAbs import TopAbs_ShapeEnum

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_ReturnStatus.IFSelect_RetDone:
        return []
    reader.TransferRoots()
    found = []
    for i, solid in enumerate(_parts(reader.OneShape(), TopAbs_ShapeEnum.TopAbs_SOLID)):
        found.append(_findings(solid, deflection, copies))
        if folder:
            writer = StlAPI_Writer()
            writer.ASCIIMode = False
            writer.Write(solid, str(Path(folder) / f"{i}.stl"))
    return found


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


class _Meanwhile:
    """A number that a copy of this process finds: OCCT does not let go of Python's lock, so threads would wait."""

    def __init__(self, work: Callable[[], float]) -> None:
        self._said, mine = os.pipe()
        self._copy = os.fork()
        if not self._copy:
            self._find(work, mine)
        os.close(mine)

    @staticmethod
    def _find(work: Callable[[], float], to: int) -> None:
        import resource

        try:
            resource.setrlimit(resource.RLIMIT_CPU, (LATEST, LATEST))
            os.write(to, repr(work()).encode())
        finally:
            os._exit(0)

    def __call__(self) -> float:
        with os.fdopen(self._said) as said:
            found = said.read()
        os.waitpid(self._copy, 0)
        return float(found)

    def stop(self) -> None:
        """Nobody wants to know any more."""
        os.close(self._said)
        os.kill(self._copy, signal.SIGKILL)
        os.waitpid(self._copy, 0)


def _findings(solid: Any, deflection: float, copies: bool) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    faces = [TopoDS.Face(face) for face in _parts(solid, TopAbs_ShapeEnum.TopAbs_FACE)]
    meanwhile = _Meanwhile(partial(_volume, solid)) if copies else None
    valid = bool(BRepCheck_Analyzer(solid, True, True).IsValid())
    tessellates = valid and _tessellates(solid, faces, deflection)
    gap = max((_gap(face) for face in faces), default=0.0)
    if meanwhile and not tessellates:
        meanwhile.stop()
    return {
        "valid": valid,
        "closed": all(BRep_Tool.IsClosed_s(shell) for shell in _parts(solid, TopAbs_ShapeEnum.TopAbs_SHELL)),
        "tessellates": tessellates,
        "faces": len(faces),
        "volume": (meanwhile or partial(_volume, solid))() if tessellates else 0.0,
        "gap": gap,
        "bad": [] if valid else _crossing(faces),
    }


def _tessellates(solid: Any, faces: list[Any], deflection: float) -> bool:
    from OCP.Bnd import Bnd_Box
    from OCP.BRep import BRep_Tool
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box)
    BRepMesh_IncrementalMesh(solid, deflection or ACROSS * box.SquareExtent() ** 0.5, False, 0.5, True)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in faces)


def _volume(solid: Any) -> float:
    """By the adaptive rule: the plain one is off by up to a hundredth on faces with many holes."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties, VOLUME, False, False)
    return float(properties.Mass())


def _gap(face: Any) -> float:
    """Largest distance between the face's edges and their curves on it, sampled at the same parameters."""
    from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
    from OCP.BRep import BRep_Tool
    from OCP.BRepLib import BRepLib_ValidateEdge
    from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
    from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    widest, surface = 0.0, GeomAdaptor_Surface(BRep_Tool.Surface_s(face))
    for shape in _parts(face, TopAbs_ShapeEnum.TopAbs_EDGE):
        edge = TopoDS.Edge(shape)
        curve = BRep_Tool.Curve_s(edge, 0.0, 1.0)
        first, last = BRep_Tool.Range_s(edge)
        flat = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
        if flat is None:
            continue
        on = Adaptor3d_CurveOnSurface(Geom2dAdaptor_Curve(flat, first, last), surface)
        both = BRepLib_ValidateEdge(GeomAdaptor_Curve(curve, first, last), on, True)
        both.SetControlPointsNumber(SAMPLES)
        both.Process()
        widest = max(widest, both.GetMaxDistance())
    return widest


def _crossing(faces: list[Any]) -> list[list[float]]:
    """The ends of the edges that cross others of their wire; of all edges of invalid faces when none is named."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_Status, BRepCheck_Wire
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS, TopoDS_Edge

    found = list[list[float]]()
    for face in faces:
        if BRepCheck_Analyzer(face).IsValid():
            continue
        named = []
        for wire in _parts(face, TopAbs_ShapeEnum.TopAbs_WIRE):
            one, two = TopoDS_Edge(), TopoDS_Edge()
            status = BRepCheck_Wire(TopoDS.Wire(wire)).SelfIntersect(face, one, two)
            if status != BRepCheck_Status.BRepCheck_NoError:
                named += [edge for edge in (one, two) if not edge.IsNull()]
        for edge in named or [TopoDS.Edge(shape) for shape in _parts(face, TopAbs_ShapeEnum.TopAbs_EDGE)]:
            curve = BRepAdaptor_Curve(edge)
            for at in (curve.FirstParameter(), curve.LastParameter()):
                point = curve.Value(at)
                found.append([point.X(), point.Y(), point.Z()])
    return found


def _loaded() -> list[str]:
    """The arguments, after what takes longest to import."""
    import OCP.BRepMesh
    import OCP.STEPControl  # noqa: F401

    return list(json.loads(sys.stdin.readline()))


if __name__ == "__main__":
    path, *more = sys.argv[1:] or _loaded()
    folder, deflection = (more[0], float(more[1])) if more else ("", 0.0)
    sys.stdout.write(json.dumps({"solids": inspected(path, folder, deflection, COPIES)}) + "\n")
