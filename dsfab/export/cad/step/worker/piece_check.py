"""OCCT's findings about each solid of a STEP file of smooth pieces. A program of its own, because a check may not end.

    python -P piece_check.py FILE [FOLDER DEFLECTION [whole]]

prints one line of JSON, {"solids": [{...}, ...]}, in the order of the file, each with `valid`, `closed`, `tessellates`,
`faces`, `volume` (mm3), `box` (its lowest and highest corner), `gap` (mm: measured largest distance between an edge and
its curve on a face, whatever its tolerance) and `bad`, the ends (k, 3) of crossing edges. An invalid solid gets no
triangles, and a solid without triangles no volume, because they take most of the time.
Triangles within `DEFLECTION` mm of each solid become `0.stl`, `1.stl` ... in `FOLDER`. With `whole`, the program writes
the files of `step_triangles` instead, unless a solid is refused.
Without arguments it loads OCCT and then reads them from its input, a list as one line of JSON.
It imports nothing from dsfab, so that it is a second opinion and starts from anywhere.
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

COPIES = sys.platform == "linux"
"""True if the process can be forked safely."""

REPAIRS = (
    *("Orientation", "ShellOrientation", "FaceOrientation", "Reorder", "Shifted", "Connected", "VertexPosition"),
    *("SelfIntersection", "SelfIntersectingEdge", "IntersectingEdges", "NonAdjacentIntersectingEdges"),
    *("IntersectingWires", "LoopWires", "NotchedEdges", "Tail", "Small", "SmallAreaWire", "Lacking", "Degenerated"),
    *("AddNaturalBound", "MissingSeam", "Seam", "SplitFace", "VertexTolerance"),
)
"""Repairs of OCCT's reader that are switched off: a file that needs one is refused, and the tests take 40 % of the
time. OCCT still adds what STEP leaves to readers: curves on surfaces, and tolerances of edges."""


def solid_findings(path: str, folder: str = "", deflection: float = 0.0, copies: bool = False) -> list[dict[str, Any]]:
    """Return the findings for each solid of a file, one to a product; [] if OCCT cannot read it.

    copies : fork processes to share the solids and measure them. False after OCCT made triangles, because a fork would
             wait for threads that it does not have.
    """
    reader = _read(path)
    if reader is None:
        return []
    work = partial(_root, reader, folder, deflection, copies)
    count = reader.NbRootsForTransfer()
    groups = _map_with_fork(work, count) if copies and count > 1 else [work(i) for i in range(count)]
    return [finding for group in groups for finding in group]


def whole_findings(path: str, folder: str, deflection: float, copies: bool = False) -> list[dict[str, Any]]:
    """Return the findings for each solid of a file that is judged as a whole; [] if OCCT cannot read it.

    The triangles are those of `dsfab check`. Its reader also repairs, but a file that is valid here needs no repair. If
    every face has triangles, they and the shape appear in the folder as from `step_triangles`; with `copies` before all
    findings are complete, so that the caller can use them in parallel.
    """
    from OCP.TopAbs import TopAbs_ShapeEnum

    reader, drawing = _read(path), _neighbour_module("step_triangles.py")
    if reader is None or not reader.TransferRoots():
        return []
    shape = reader.OneShape()
    solids = list(_parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID))
    collect = partial(_untriangulated_findings, solids)
    copy = _ForkedWork(collect) if copies else None
    findings_list = [] if copy else collect()
    has_triangles = [
        _triangulates(drawing, deflection, solid)
        for solid in solids
        if all(finding["valid"] for finding in findings_list)
    ]
    if len(has_triangles) == len(solids) and all(has_triangles):
        drawing.keep_drawn(shape, Path(folder))
    findings_list = copy() if copy else findings_list
    complete = [finding["valid"] and all(has_triangles[i : i + 1]) for i, finding in enumerate(findings_list)]
    return [
        {**finding, "tessellates": complete, "volume": finding["volume"] * complete}
        for finding, complete in zip(findings_list, complete, strict=True)
    ]


def _read(path: str) -> Any | None:
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
    reader.SetShapeFixParameters(repairs)  # after reading, which resets the parameters
    return reader


def _root(reader: Any, folder: str, deflection: float, copies: bool, i: int) -> list[dict[str, Any]]:
    from OCP.StlAPI import StlAPI_Writer
    from OCP.TopAbs import TopAbs_ShapeEnum

    if not reader.TransferRoot(i + 1):
        return []
    shape = reader.Shape(reader.NbShapes())
    draw = partial(_tessellates, deflection)
    results = [_findings(solid, draw, copies) for solid in _parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID)]
    if folder:
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        writer.Write(shape, str(Path(folder) / f"{i}.stl"))
    return results


def _map_with_fork(work: Callable[[int], Any], count: int) -> list[Any]:
    """Results of `work` for 0, 1 ... count - 1, shared with a fork: a free process takes the next number."""
    numbers, issue = os.pipe()
    os.write(issue, array("I", range(count)).tobytes())
    os.close(issue)
    share = partial(_share, work, numbers)
    copy = _ForkedWork(share)
    results = share() + copy()
    os.close(numbers)
    return [result for _, result in sorted(results, key=itemgetter(0))]


def _share(work: Callable[[int], Any], numbers: int) -> list[tuple[int, Any]]:
    return [(i, work(i)) for (i,) in iter(lambda: array("I", os.read(numbers, 4)).tolist(), [])]


def _parts(shape: Any, kind: Any) -> Iterator[Any]:
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


class _ForkedWork:
    """Work in a fork of this process. OCCT holds Python's lock, so threads would wait."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self._said, write_end = os.pipe()
        self._copy = os.fork()
        if not self._copy:
            self._run(work, write_end)
        os.close(write_end)

    @staticmethod
    def _run(work: Callable[[], Any], to: int) -> None:
        try:
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: it ends with its parent
            with os.fdopen(to, "w") as pipe:
                json.dump(work(), pipe)
        finally:
            os._exit(0)

    def __call__(self) -> Any:
        with os.fdopen(self._said) as pipe:
            text = pipe.read()
        os.waitpid(self._copy, 0)
        return json.loads(text)

    def stop(self) -> None:
        os.close(self._said)
        os.kill(self._copy, signal.SIGKILL)
        os.waitpid(self._copy, 0)


def _findings(solid: Any, draw: Callable[[Any, list[Any]], bool], copies: bool) -> dict[str, Any]:
    """Findings about a solid. `draw` triangulates its faces and returns True if every face has triangles."""
    faces = _faces(solid)
    meanwhile = _ForkedWork(partial(_measures, solid, faces)) if copies else None
    checked = _shape_findings(solid)
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


def _shape_findings(solid: Any) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_ShapeEnum

    faces, box = _faces(solid), _box(solid)
    analyzer = BRepCheck_Analyzer(solid, True, True)
    valid = bool(analyzer.IsValid())
    return {
        "valid": valid,
        "closed": all(BRep_Tool.IsClosed_s(shell) for shell in _parts(solid, TopAbs_ShapeEnum.TopAbs_SHELL)),
        "faces": len(faces),
        "box": box,
        "bad": [] if valid else _crossing([face for face in faces if not analyzer.IsValid(face)] or faces),
    }


def _triangulates(drawing: ModuleType, deflection: float, solid: Any) -> bool:
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    drawing.draw(solid, deflection)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in _faces(solid))


def _tessellates(deflection: float, solid: Any, faces: list[Any]) -> bool:
    """Return whether every face gets triangles, by Delabella's sweep, or else by OCCT's own method.

    The sweep takes a quarter of the time for a skin with hundreds of holes, with as many and as close triangles.
    """
    angle = 0.5  # largest turn between neighbouring triangles, radians
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_MeshAlgoType, IMeshTools_Parameters
    from OCP.TopLoc import TopLoc_Location

    parameters = IMeshTools_Parameters()
    parameters.Deflection, parameters.Angle, parameters.InParallel = deflection or _deflection(solid), angle, True
    parameters.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Delabella
    BRepMesh_IncrementalMesh(solid, parameters)
    unmeshed = [face for face in faces if BRep_Tool.Triangulation_s(face, TopLoc_Location()) is None]
    parameters.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Watson
    for face in unmeshed:
        BRepMesh_IncrementalMesh(face, parameters)
    return all(BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None for face in unmeshed)


def _deflection(solid: Any) -> float:
    across = 1e-3  # share of the solid's size
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box)
    return float(across * box.SquareExtent() ** 0.5)


@cache
def _neighbour_module(name: str) -> ModuleType:
    """Import a module beside this file by its path, because an import of dsfab would load much more."""
    path = Path(__file__).parent / name
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{name} is not where piece_check.py looks for it")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _measures(solid: Any, faces: list[Any], volume: bool = True) -> tuple[float, float]:
    gap = max((_gap(face) for face in faces), default=0.0)
    return gap, float(_neighbour_module("piece_volume.py").volume(solid)) if volume else 0.0


def _untriangulated_findings(solids: list[Any]) -> list[dict[str, Any]]:
    results, volume = [], _neighbour_module("piece_volume.py").volume_of_small_faces
    for solid in solids:
        checked = _shape_findings(solid)
        gap, _ = _measures(solid, _faces(solid), volume=False)
        results.append({**checked, "gap": gap, "volume": volume(solid) if checked["valid"] else 0.0})
    return results


def _box(solid: Any) -> list[float]:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    BRepBndLib.Add_s(solid, box, False)
    low, high = box.CornerMin(), box.CornerMax()
    return [low.X(), low.Y(), low.Z(), high.X(), high.Y(), high.Z()]


def _gap(face: Any) -> float:
    """Largest distance between a face's edges and their curves on it, sampled at equal parameters."""
    samples = 24  # along each edge
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
        begin, end = BRep_Tool.Range_s(edge)
        flat = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
        if flat is None:
            continue
        curve_on_face = Adaptor3d_CurveOnSurface(Geom2dAdaptor_Curve(flat, begin, end), surface)
        comparison = BRepLib_ValidateEdge(GeomAdaptor_Curve(curve, begin, end), curve_on_face, True)
        comparison.SetControlPointsNumber(samples)
        comparison.Process()
        widest = max(widest, comparison.GetMaxDistance())
    return widest


def _crossing(faces: list[Any]) -> list[list[float]]:
    """Ends of edges that cross within their wire; of all edges of invalid faces if OCCT names none."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_Status, BRepCheck_Wire
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS, TopoDS_Edge

    ends = list[list[float]]()
    for face in faces:
        if BRepCheck_Analyzer(face).IsValid():
            continue
        named = []
        for wire in _parts(face, TopAbs_ShapeEnum.TopAbs_WIRE):
            edge_a, edge_b = TopoDS_Edge(), TopoDS_Edge()
            status = BRepCheck_Wire(TopoDS.Wire(wire)).SelfIntersect(face, edge_a, edge_b)
            if status != BRepCheck_Status.BRepCheck_NoError:
                named += [edge for edge in (edge_a, edge_b) if not edge.IsNull()]
        for edge in named or [TopoDS.Edge(shape) for shape in _parts(face, TopAbs_ShapeEnum.TopAbs_EDGE)]:
            curve = BRepAdaptor_Curve(edge)
            for parameter in (curve.FirstParameter(), curve.LastParameter()):
                point = curve.Value(parameter)
                ends.append([point.X(), point.Y(), point.Z()])
    return ends


def _late_arguments() -> list[str]:
    import OCP.BRepMesh
    import OCP.STEPControl  # noqa: F401

    _neighbour_module("piece_volume.py")
    return list(json.loads(sys.stdin.readline()))


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # copies of this process have no threads, and need none
    gc.disable()  # a tenth of the time that importing OCCT takes
    path, *more = sys.argv[1:] or _late_arguments()
    folder, deflection = (more[0], float(more[1])) if more else ("", 0.0)
    findings = whole_findings if "whole" in more[2:] else solid_findings
    sys.stdout.write(json.dumps({"solids": findings(path, folder, deflection, COPIES)}) + "\n")
    sys.stdout.flush()
    os._exit(0)  # taking the solids apart takes a quarter of a second
