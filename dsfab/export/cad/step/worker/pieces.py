"""OCCT's findings about each solid of a STEP file.

tessellates : True if every face gets triangles.    volume : mm3.    bad : (k, 3) ends of crossing edges, mm.
box : lowest and highest corner, mm.    gap : largest measured distance between an edge and its curve on a face, mm."""

import ctypes
import json
import os
import signal
import sys
from array import array
from collections.abc import Callable
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

from dsfab.export.cad.step.worker.shapes import (
    bounds,
    diagonal,
    faces_of,
    gauss_kronrod_volume,
    is_valid,
    parts,
    step_reader,
    without_triangles,
)
from dsfab.export.cad.step.worker.triangles import draw, keep_drawn
from dsfab.export.cad.step.worker.volume import VOLUME, volume

CAN_FORK = sys.platform == "linux"  # true if the process can be forked safely


class ForkedWork:
    """Function that runs in a fork of this process. A call returns the function's result, as read from JSON."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self._result, write_end = os.pipe()
        self._copy = os.fork()
        if not self._copy:
            self._run(work, write_end)
        os.close(write_end)

    @staticmethod
    def _run(work: Callable[[], Any], to: int) -> None:
        try:
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: the fork ends with its parent
            with os.fdopen(to, "w") as pipe:
                json.dump(work(), pipe)
        finally:
            os._exit(0)

    def __call__(self) -> Any:
        with os.fdopen(self._result) as pipe:
            text = pipe.read()
        os.waitpid(self._copy, 0)
        return json.loads(text)

    def stop(self) -> None:
        """Kill the forked process and lose its result."""
        os.close(self._result)
        os.kill(self._copy, signal.SIGKILL)
        os.waitpid(self._copy, 0)


def map_with_fork(work: Callable[[int], Any], count: int) -> list[Any]:
    """Call `work` with 0, 1 ... count - 1 in two processes, and return the results in order."""
    numbers, issue = os.pipe()
    os.write(issue, array("I", range(count)).tobytes())
    os.close(issue)
    share = partial(_share, work, numbers)
    copy = ForkedWork(share)
    results = share() + copy()
    os.close(numbers)
    return [result for _, result in sorted(results, key=itemgetter(0))]


def _share(work: Callable[[int], Any], numbers: int) -> list[tuple[int, Any]]:
    return [(i, work(i)) for (i,) in iter(lambda: array("I", os.read(numbers, 4)).tolist(), [])]


REPAIRS = (
    *("Orientation", "ShellOrientation", "FaceOrientation", "Reorder", "Shifted", "Connected", "VertexPosition"),
    *("SelfIntersection", "SelfIntersectingEdge", "IntersectingEdges", "NonAdjacentIntersectingEdges"),
    *("IntersectingWires", "LoopWires", "NotchedEdges", "Tail", "Small", "SmallAreaWire", "Lacking", "Degenerated"),
    *("AddNaturalBound", "MissingSeam", "Seam", "SplitFace", "VertexTolerance"),
)
"""Repairs that OCCT's reader must not make, because a file that needs a repair is refused."""


def solid_findings(path: str, folder: str = "", deflection: float = 0.0, copies: bool = False) -> list[dict[str, Any]]:
    """Return OCCT's findings about each solid of a STEP file; [] if OCCT cannot read the file.
    deflection : largest distance (mm) of triangles from the solid. `folder` gets the triangles as `0.stl`, `1.stl` ...
    copies     : True to use forked processes. OCCT must not have made triangles in this process before."""
    reader = _reader(path)
    if reader is None:
        return []
    work = partial(_root, reader, folder, deflection, copies)
    count = reader.NbRootsForTransfer()
    groups = map_with_fork(work, count) if copies and count > 1 else [work(i) for i in range(count)]
    return [finding for group in groups for finding in group]


def whole_findings(path: str, folder: str, deflection: float, copies: bool = False) -> list[dict[str, Any]]:
    """Return OCCT's findings about each solid of a STEP file, read as a single shape; [] if OCCT cannot read it.
    If every face has triangles, `folder` gets the triangles and the shape.    copies : True to use a forked process."""
    reader = _reader(path)
    if reader is None or not reader.TransferRoots():
        return []
    shape = reader.OneShape()
    solids = parts(shape, "SOLID")
    collect = partial(_untriangulated_findings, solids)
    copy = ForkedWork(collect) if copies else None
    findings_list = [] if copy else collect()
    valid = all(finding["valid"] for finding in findings_list)
    has_triangles = [_triangulates(deflection, solid) for solid in solids if valid]
    if len(has_triangles) == len(solids) and all(has_triangles):
        keep_drawn(shape, Path(folder))
    findings_list = copy() if copy else findings_list
    complete = [finding["valid"] and all(has_triangles[i : i + 1]) for i, finding in enumerate(findings_list)]
    return [
        {**finding, "tessellates": complete, "volume": finding["volume"] * complete}
        for finding, complete in zip(findings_list, complete, strict=True)
    ]


def _reader(path: str) -> Any | None:
    from OCP.collections import DataMap_TCollection_AsciiString_TCollection_AsciiString
    from OCP.TCollection import TCollection_AsciiString

    reader = step_reader(Path(path))
    if reader is not None:
        repairs = DataMap_TCollection_AsciiString_TCollection_AsciiString()
        for name in REPAIRS:
            repairs.Bind(TCollection_AsciiString(f"FixShape.Fix{name}Mode"), TCollection_AsciiString("0"))
        reader.SetShapeFixParameters(repairs)  # reading resets these parameters
    return reader


def _root(reader: Any, folder: str, deflection: float, copies: bool, i: int) -> list[dict[str, Any]]:
    from OCP.StlAPI import StlAPI_Writer

    if not reader.TransferRoot(i + 1):
        return []
    shape = reader.Shape(reader.NbShapes())
    results = [_findings(solid, partial(_tessellates, deflection), copies) for solid in parts(shape, "SOLID")]
    if folder:
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        writer.Write(shape, str(Path(folder) / f"{i}.stl"))
    return results


def _findings(solid: Any, triangulate: Callable[[Any, list[Any]], bool], copies: bool) -> dict[str, Any]:
    faces = faces_of(solid)
    meanwhile = ForkedWork(partial(_measures, solid, faces)) if copies else None
    checked = _shape_findings(solid)
    tessellates = checked["valid"] and triangulate(solid, faces)
    if meanwhile and not tessellates:
        meanwhile.stop()
        meanwhile = None
    gap, content = (meanwhile or partial(_measures, solid, faces, tessellates))()
    return {**checked, "tessellates": tessellates, "gap": gap, "volume": content}


def _shape_findings(solid: Any) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer

    faces, box = faces_of(solid), bounds(solid, with_triangles=False)
    analyzer = BRepCheck_Analyzer(solid, True, True)
    valid = bool(analyzer.IsValid())
    return {
        "valid": valid,
        "closed": all(BRep_Tool.IsClosed_s(shell) for shell in parts(solid, "SHELL")),
        "faces": len(faces),
        "box": box,
        "bad": [] if valid else _crossing([face for face in faces if not analyzer.IsValid(face)] or faces),
    }


def _triangulates(deflection: float, solid: Any) -> bool:
    draw(solid, deflection)
    return not without_triangles(faces_of(solid))


def _tessellates(deflection: float, solid: Any, faces: list[Any]) -> bool:
    angle = 0.5  # largest angle (radians) between neighbouring triangles
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IMeshTools import IMeshTools_MeshAlgoType, IMeshTools_Parameters

    parameters = IMeshTools_Parameters()
    parameters.Deflection = deflection or 1e-3 * diagonal(solid, optimal=False)
    parameters.Angle, parameters.InParallel = angle, True
    parameters.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Delabella
    BRepMesh_IncrementalMesh(solid, parameters)
    unmeshed = without_triangles(faces)
    parameters.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Watson
    for face in unmeshed:
        BRepMesh_IncrementalMesh(face, parameters)
    return not without_triangles(unmeshed)


def _measures(solid: Any, faces: list[Any], with_volume: bool = True) -> tuple[float, float]:
    return max(map(_gap, faces), default=0.0), float(volume(solid)) if with_volume else 0.0


def _untriangulated_findings(solids: list[Any]) -> list[dict[str, Any]]:
    results = []  # uses the Gauss-Kronrod rule, which suits many small faces
    for solid in solids:
        checked = _shape_findings(solid)
        gap, _ = _measures(solid, faces_of(solid), with_volume=False)
        content = gauss_kronrod_volume(solid, VOLUME) if checked["valid"] else 0.0
        results.append({**checked, "gap": gap, "volume": content})
    return results


def _gap(face: Any) -> float:
    samples = 24  # each edge has 24 samples
    from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
    from OCP.BRep import BRep_Tool
    from OCP.BRepLib import BRepLib_ValidateEdge
    from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
    from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
    from OCP.TopoDS import TopoDS

    widest, surface = 0.0, GeomAdaptor_Surface(BRep_Tool.Surface_s(face))
    for shape in parts(face, "EDGE"):
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
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepCheck import BRepCheck_Status, BRepCheck_Wire
    from OCP.TopoDS import TopoDS, TopoDS_Edge

    ends = list[list[float]]()
    for face in faces:
        if is_valid(face):
            continue
        named = []
        for wire in parts(face, "WIRE"):
            edge_a, edge_b = TopoDS_Edge(), TopoDS_Edge()
            status = BRepCheck_Wire(TopoDS.Wire(wire)).SelfIntersect(face, edge_a, edge_b)
            if status != BRepCheck_Status.BRepCheck_NoError:
                named += [edge for edge in (edge_a, edge_b) if not edge.IsNull()]
        for edge in named or [TopoDS.Edge(shape) for shape in parts(face, "EDGE")]:
            curve = BRepAdaptor_Curve(edge)
            for parameter in (curve.FirstParameter(), curve.LastParameter()):
                point = curve.Value(parameter)
                ends.append([point.X(), point.Y(), point.Z()])
    return ends
