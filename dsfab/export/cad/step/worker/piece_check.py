"""What OCCT finds in a STEP file of smooth solids, one by one: a program of its own, because a check may not end.

    python -P check.py FILE [FOLDER DEFLECTION [whole]]

prints one line of JSON, {"solids": [{...}, ...]}, in the order of the file; each with `valid`, `closed`, `tessellates`,
`faces`, `volume` (cubic millimetres), `box` (its lowest corner and its highest one, as OCCT bounds it), `gap`
(millimetres: the largest distance between an edge and its curve on a face, measured, whatever tolerance it was given),
and `bad`, the ends (k, 3) of the edges that cross others. A solid that is not valid gets no triangles, and one without
them no volume: it is refused, and they take most of the time.
The triangles of each solid, no farther than `DEFLECTION` millimetres from it, become `0.stl`, `1.stl` ... in `FOLDER`.
With `whole` they are those that `step_mesh` draws of the file, and become what it writes, unless a solid is refused.
Without arguments it loads OCCT and then reads them from its input, a list as one line of JSON.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import ctypes
import gc
import json
import os
import signal
import sys
from array import array
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib.util import module_from_spec, spec_from_file_location
from operator import itemgetter
from pathlib import Path
from types import ModuleType
from typing import Any

ACROSS = 1e-3
"""Deflection of the triangles unless told, as a share of a solid's size."""

ANGLE = 0.5
"""Largest turn between neighbouring triangles, radians."""

SAMPLES = 24
"""Places along each edge where its gap is measured."""

COPIES = sys.platform == "linux"
"""Where a process is copied safely."""

REPAIRS = (
    *("Orientation", "ShellOrientation", "FaceOrientation", "Reorder", "Shifted", "Connected", "VertexPosition"),
    *("SelfIntersection", "SelfIntersectingEdge", "IntersectingEdges", "NonAdjacentIntersectingEdges"),
    *("IntersectingWires", "LoopWires", "NotchedEdges", "Tail", "Small", "SmallAreaWire", "Lacking", "Degenerated"),
    *("AddNaturalBound", "MissingSeam", "Seam", "SplitFace", "VertexTolerance"),
)
"""What OCCT mends as it reads unless told not to; a file that needs it is refused, and asking takes four tenths of the
time. It still adds what STEP leaves to readers: curves on surfaces, and the tolerances of edges."""


def solid_findings(path: str, folder: str = "", deflection: float = 0.0, copies: bool = False) -> list[dict[str, Any]]:
    """The findings for each solid of a file, one to a product; empty when it cannot be read.

    copies : whether copies of the process may take half of the solids, and measure them meanwhile. Not where OCCT made
             triangles before: a copy would wait for threads that it has not got.
    """
    reader = _read(path)
    if reader is None:
        return []
    work = partial(_root, reader, folder, deflection, copies)
    count = reader.NbRootsForTransfer()
    found = _shared(work, count) if copies and count > 1 else [work(i) for i in range(count)]
    return [one for some in found for one in some]


def whole_findings(path: str, folder: str, deflection: float, copies: bool = False) -> list[dict[str, Any]]:
    """The findings for each solid of a file that is judged as a whole; empty when it cannot be read.

    Its triangles are those that `dsfab check` draws, though that lets OCCT mend what it reads: on what is valid without
    there is nothing to mend. They and the shape lie in the folder as `step_mesh` writes them, if every face has some,
    and with `copies` before the rest is known: whoever asks can look at them meanwhile.
    """
    from OCP.TopAbs import TopAbs_ShapeEnum

    reader, drawing = _read(path), _beside("../step_mesh.py")
    if reader is None or not reader.TransferRoots():
        return []
    shape = reader.OneShape()
    solids = list(_parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID))
    ask = partial(_asked, solids)
    copy = _Meanwhile(ask) if copies else None
    asked = [] if copy else ask()
    drawn = [_drawn(drawing, deflection, solid) for solid in solids if all(one["valid"] for one in asked)]
    if len(drawn) == len(solids) and all(drawn):
        drawing.keep_drawn(shape, Path(folder))
    asked = copy() if copy else asked
    has = [one["valid"] and all(drawn[i : i + 1]) for i, one in enumerate(asked)]
    return [{**one, "tessellates": has, "volume": one["volume"] * has} for one, has in zip(asked, has, strict=True)]


def _read(path: str) -> Any | None:
    """A reader that repairs nothing, with a file."""
    from OCP.collections import DataMap_TCollection_AsciiString_TCollection_AsciiString
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TCollection import TCollection_AsciiString

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_ReturnStatus.IFSelect_RetDone:
        return None
    repairs = DataMap_TCollection_AsciiString_TCollection_AsciiString()
    for name in REPAIRS:
        repairs.Bind(TCollection_AsciiString(f"FixShape.Fix{name}Mode"), TCollection_AsciiString("0"))
    reader.SetShapeFixParameters(repairs)  # reading sets all anew: not before it
    return reader


def _root(reader: Any, folder: str, deflection: float, copies: bool, i: int) -> list[dict[str, Any]]:
    """The findings for product i of a file: one, if it is one solid."""
    from OCP.StlAPI import StlAPI_Writer
    from OCP.TopAbs import TopAbs_ShapeEnum

    if not reader.TransferRoot(i + 1):
        return []
    shape = reader.Shape(reader.NbShapes())
    draw = partial(_tessellates, deflection)
    found = [_findings(solid, draw, copies) for solid in _parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID)]
    if folder:
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        writer.Write(shape, str(Path(folder) / f"{i}.stl"))
    return found


def _shared(work: Callable[[int], Any], count: int) -> list[Any]:
    """What `work` says to 0, 1 ... count - 1, asked here and in a copy: who is free takes the next."""
    numbers, issue = os.pipe()
    os.write(issue, array("I", range(count)).tobytes())
    os.close(issue)
    share = partial(_share, work, numbers)
    copy = _Meanwhile(share)
    both = share() + copy()
    os.close(numbers)
    return [said for _, said in sorted(both, key=itemgetter(0))]


def _share(work: Callable[[int], Any], numbers: int) -> list[tuple[int, Any]]:
    return [(i, work(i)) for (i,) in iter(lambda: array("I", os.read(numbers, 4)).tolist(), [])]


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


class _Meanwhile:
    """What a copy of this process finds: OCCT does not let go of Python's lock, so threads would wait."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self._said, mine = os.pipe()
        self._copy = os.fork()
        if not self._copy:
            self._find(work, mine)
        os.close(mine)

    @staticmethod
    def _find(work: Callable[[], Any], to: int) -> None:
        try:
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: it ends with what it is a copy of
            with os.fdopen(to, "w") as said:
                json.dump(work(), said)
        finally:
            os._exit(0)

    def __call__(self) -> Any:
        with os.fdopen(self._said) as said:
            found = said.read()
        os.waitpid(self._copy, 0)
        return json.loads(found)

    def stop(self) -> None:
        """Nobody wants to know any more."""
        os.close(self._said)
        os.kill(self._copy, signal.SIGKILL)
        os.waitpid(self._copy, 0)


def _findings(solid: Any, draw: Callable[[Any, list[Any]], bool], copies: bool) -> dict[str, Any]:
    """About a solid; `draw` makes triangles of it and its faces, and says whether every face has some."""
    faces = _faces(solid)
    meanwhile = _Meanwhile(partial(_measures, solid, faces)) if copies else None
    checked = _checked(solid)
    tessellates = checked["valid"] and draw(solid, faces)
    if meanwhile and not tessellates:
        meanwhile.stop()
        meanwhile = None
    gap, volume = (meanwhile or partial(_measures, solid, faces, tessellates))()
    return {**checked, "tessellates": tessellates, "gap": gap, "volume": volume}


def _faces(solid: Any) -> list[Any]:
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    return [TopoDS.Face(face) for face in _parts(solid, TopAbs_ShapeEnum.TopAbs_FACE)]


def _checked(solid: Any) -> dict[str, Any]:
    """What is found of a solid but its triangles and measures."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_ShapeEnum

    faces, box = _faces(solid), _box(solid)
    checked = BRepCheck_Analyzer(solid, True, True)
    valid = bool(checked.IsValid())
    return {
        "valid": valid,
        "closed": all(BRep_Tool.IsClosed_s(shell) for shell in _parts(solid, TopAbs_ShapeEnum.TopAbs_SHELL)),
        "faces": len(faces),
        "box": box,
        "bad": [] if valid else _crossing([face for face in faces if not checked.IsValid(face)] or faces),
    }


def _drawn(drawing: ModuleType, deflection: float, solid: Any) -> bool:
    """Whether every face of a solid becomes triangles as `step_mesh` draws them."""
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    drawing.draw(solid, deflection)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in _faces(solid))


def _tessellates(deflection: float, solid: Any, faces: list[Any]) -> bool:
    """Whether every face becomes triangles, by Delabella's sweep; faces that it cannot do, by OCCT's own method.

    A skin with hundreds of holes takes the sweep a quarter of the time, for triangles as many and as close.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_MeshAlgoType, IMeshTools_Parameters
    from OCP.TopLoc import TopLoc_Location

    how = IMeshTools_Parameters()
    how.Deflection, how.Angle, how.InParallel = deflection or _deflection(solid), ANGLE, True
    how.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Delabella
    BRepMesh_IncrementalMesh(solid, how)
    left = [face for face in faces if BRep_Tool.Triangulation_s(face, TopLoc_Location()) is None]
    how.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Watson
    for face in left:
        BRepMesh_IncrementalMesh(face, how)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in left)


def _deflection(solid: Any) -> float:
    """Of the triangles where none is asked for, millimetres."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box)
    return float(ACROSS * box.SquareExtent() ** 0.5)


@cache
def _beside(name: str) -> ModuleType:
    """What lies beside this file by its path: as part of dsfab it would bring much with it."""
    path = Path(__file__).parent / name
    at = spec_from_file_location(path.stem, path)
    if at is None or at.loader is None:
        raise ImportError(f"{name} is not where check.py looks for it")
    found = module_from_spec(at)
    at.loader.exec_module(found)
    return found


def _measures(solid: Any, faces: list[Any], volume: bool = True) -> tuple[float, float]:
    """Its widest gap, millimetres, and its volume, cubic millimetres, or 0 where nobody wants to know."""
    gap = max((_gap(face) for face in faces), default=0.0)
    return gap, float(_beside("occt_volume.py").volume(solid)) if volume else 0.0


def _asked(solids: list[Any]) -> list[dict[str, Any]]:
    """All that is found of solids but their triangles."""
    found, volume = [], _beside("occt_volume.py").volume_of_small_faces
    for solid in solids:
        checked = _checked(solid)
        gap, _ = _measures(solid, _faces(solid), volume=False)
        found.append({**checked, "gap": gap, "volume": volume(solid) if checked["valid"] else 0.0})
    return found


def _box(solid: Any) -> list[float]:
    """Its lowest corner and its highest one: surfaces beside their faces count, as they do in most programs."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box, False)
    low, high = box.CornerMin(), box.CornerMax()
    return [low.X(), low.Y(), low.Z(), high.X(), high.Y(), high.Z()]


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

    _beside("occt_volume.py")
    return list(json.loads(sys.stdin.readline()))


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # copies of this process have no threads, and need none
    gc.disable()  # a tenth of the time that importing OCCT takes
    path, *more = sys.argv[1:] or _loaded()
    folder, deflection = (more[0], float(more[1])) if more else ("", 0.0)
    findings = whole_findings if "whole" in more[2:] else solid_findings
    sys.stdout.write(json.dumps({"solids": findings(path, folder, deflection, COPIES)}) + "\n")
    sys.stdout.flush()
    os._exit(0)  # taking the solids apart takes a quarter of a second
