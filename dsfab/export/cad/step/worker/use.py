"""OCCT's trials with the solids of a STEP file: cuts, fillets, sections and writing."""

import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from math import acos, cos, degrees, radians
from pathlib import Path
from typing import Any, NamedTuple

from dsfab.export.cad.step.worker.shapes import bounds, compound, faces_of, gauss_kronrod_volume, is_valid, parts, read

TOGETHER_LIMIT = 1e-5  # largest relative volume error of a cut solid, if its two halves are measured as one shape
ALONE_LIMIT = 1e-4  # largest relative volume error of a cut solid, if its two halves are measured separately

PLANES = (
    *((1.0, 0.11, 0.07, 0.03), (0.09, 1.0, -0.13, -0.05), (0.05, 0.08, 1.0, 0.02), (1.0, 0.9, 0.2, 0.07)),
    *((1.0, -1.1, 0.3, -0.04), (0.4, 1.0, 0.9, 0.06), (0.9, -0.3, 1.0, -0.08), (-0.7, 1.0, 0.15, 0.11)),
)
"""Cutting planes: the normal, and the distance from the middle of the bounding box / the box's diagonal."""

BOX = ((0.13, 0.21, -0.1), (0.71, 0.83, 1.1))  # corners of the cutting box, as fractions of the solids' box

FILLETS, SHARP = 10, 20.0  # number of edges to round; smallest angle (degrees) between their faces

ROUND, OF_EDGE = 10.0, 1 / 8  # largest radius of a fillet: in mm, and as a fraction of the edge's length
SMOOTH = cos(radians(1.0))  # cosine of the largest angle between an edge and its continuation


def use_findings(path: Path, cuts: int, every_cut: bool = False) -> dict[str, Any]:
    """Cut the solids of a STEP file with OCCT and fillet their edges, as a trial; return the findings.
    solids, faces : their numbers.    valid : True if OCCT finds no fault.    seconds : processor time.
    volume, plain : volumes by the Gauss-Kronrod rule, and by OCCT's default rule, mm3.
    box           : OCCT's bounding box, six numbers, mm.
    sound         : number of good cuts. Cutting ends with the first failure, unless `every_cut` is set.
    worst, alone  : largest volume errors of the valid cuts: `together` and `alone` in `VolumeErrors`.
    missed        : for each cut: 0 if it is good, 1 if a half is invalid, otherwise the relative volume error.
    boxed         : True if a cut with a box succeeds.    box_missed : as `missed`, for this cut.
    closed        : True if a section has no open ends.
    again         : True if a file that OCCT writes of the solid has the same faces and volume.
    fillets, sharp : number of edges that OCCT rounded, and number of tried edges."""
    begin = time.process_time()
    shape = read(path)
    box, whole_volume = bounds(shape), _volume(shape)
    tried = list(_cuts(shape, box, whole_volume, cuts, every_cut))
    missed = [errors.fault for errors in tried]
    go_on = every_cut or not any(missed)
    box_errors = volume_errors(_split(shape, _box(box)), whole_volume) if go_on else INVALID
    rounded = fillet_counts(shape) if go_on else (0, 0)
    return {
        "solids": len(parts(shape, "SOLID")),
        "valid": is_valid(shape),
        "faces": len(faces_of(shape)),
        "volume": whole_volume,
        "plain": _plain_volume(shape),
        "box": box,
        "sound": missed.count(0.0),
        "worst": max((errors.together for errors in tried if errors.together < 1), default=0.0),
        "alone": max((errors.alone for errors in tried if errors.alone < 1), default=0.0),
        "missed": missed,
        "boxed": not box_errors.fault,
        "box_missed": box_errors.fault,
        "closed": go_on and _closed_section(shape, box, PLANES[0]),
        "again": go_on and _survives_rewriting(shape, whole_volume),
        "fillets": rounded[0],
        "sharp": rounded[1],
        "seconds": time.process_time() - begin,
    }


def sample(path: Path) -> dict[str, Any]:
    """Cut the shape in a file through the middle, and return a report on the result.
    box : bounding box.    halves : True if they are valid.    off : relative volume error."""
    begin = time.process_time()
    shape = read(path)
    box = bounds(shape)
    halves = _split(shape, _half_space(box, PLANES[0]))
    lost = volume_errors(halves, _volume(shape)).fault if halves else 1.0
    return {"box": box, "halves": bool(halves), "off": lost, "seconds": time.process_time() - begin}


def _volume(shape: Any) -> float:
    return gauss_kronrod_volume(shape, accuracy=1e-6)  # OCCT's adaptive rule is too inaccurate for many holes


def _plain_volume(shape: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


class VolumeErrors(NamedTuple):
    """Relative errors of the total volume of a cut solid's two halves.
    alone : error if the halves are measured separately.    together : error if they are measured as a group."""

    alone: float
    together: float

    @property
    def fault(self) -> float:
        """Relative error of the halves' total volume; 0 if it is negligible."""
        return self.together if self.together > TOGETHER_LIMIT else 0.0


INVALID = VolumeErrors(1.0, 1.0)


def volume_errors(halves: list[Any], whole_volume: float) -> VolumeErrors:
    """Return the volume errors of the two halves of a cut solid. whole_volume : volume before the cut, mm3."""
    if not halves:
        return INVALID
    alone = abs(sum(map(_volume, halves)) / whole_volume - 1)
    if not TOGETHER_LIMIT < alone <= ALONE_LIMIT:
        return VolumeErrors(alone, alone)
    return VolumeErrors(alone, abs(_volume(compound(halves)) / whole_volume - 1))


def _cuts(shape: Any, box: list[float], whole_volume: float, cuts: int, every_cut: bool) -> Iterator[VolumeErrors]:
    for plane in PLANES[:cuts]:
        missed = volume_errors(_split(shape, _half_space(box, plane)), whole_volume)
        yield missed
        if missed.fault and not every_cut:
            return


def _half_space(box: list[float], plane: tuple[float, ...]) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeHalfSpace

    surface, side = _plane(box, plane)
    return BRepPrimAPI_MakeHalfSpace(BRepBuilderAPI_MakeFace(surface).Face(), side).Solid()


def _plane(box: list[float], plane: tuple[float, ...]) -> tuple[Any, Any]:
    from OCP.gp import gp_Dir, gp_Pln, gp_Pnt

    low, high = box[:3], box[3:]
    diagonal = sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5
    length = sum(x * x for x in plane[:3]) ** 0.5
    normal = [x / length for x in plane[:3]]
    point = [(a + b) / 2 + plane[3] * diagonal * n for a, b, n in zip(low, high, normal, strict=True)]
    side = gp_Pnt(*(x - diagonal * n for x, n in zip(point, normal, strict=True)))
    return gp_Pln(gp_Pnt(*point), gp_Dir(*normal)), side


def _box(box: list[float]) -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt

    low, high = box[:3], box[3:]
    low_corner, high_corner = ([a + s * (b - a) for a, b, s in zip(low, high, share, strict=True)] for share in BOX)
    return BRepPrimAPI_MakeBox(gp_Pnt(*low_corner), gp_Pnt(*high_corner)).Solid()


def _split(shape: Any, tool: Any) -> list[Any]:
    """Return the parts of a shape inside and outside of a solid `tool`; [] if a part is invalid."""
    from OCP.BOPAlgo import BOPAlgo_CellsBuilder
    from OCP.collections import List_TopoDS_Shape

    only_shape, only_tool, none, all_shapes = (List_TopoDS_Shape() for _ in range(4))
    for shape_list, item in ((only_shape, shape), (only_tool, tool), (all_shapes, shape), (all_shapes, tool)):
        shape_list.Append(item)
    cells = BOPAlgo_CellsBuilder()
    cells.SetArguments(all_shapes)
    cells.SetNonDestructive(True)
    cells.SetToFillHistory(False)
    cells.Perform()
    if cells.HasErrors():
        return []
    parts = []
    for take, avoid in ((all_shapes, none), (only_shape, only_tool)):
        cells.RemoveAllFromResult()
        cells.AddToResult(take, avoid)
        parts.append(cells.Shape())
    return parts if all(map(is_valid, parts)) else []


def _closed_section(shape: Any, box: list[float], plane: tuple[float, ...]) -> bool:
    meet = 0.05  # edge ends count as one point if their distance (mm) is smaller
    from OCP.BRep import BRep_Tool
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Section
    from OCP.TopoDS import TopoDS
    from scipy.spatial import cKDTree

    section = BRepAlgoAPI_Section(shape, _plane(box, plane)[0])
    if not section.IsDone():
        return False
    ends: Any = []
    for edge in parts(section.Shape(), "EDGE"):
        for vertex in parts(edge, "VERTEX"):
            point = BRep_Tool.Pnt_s(TopoDS.Vertex(vertex))
            ends.append([point.X(), point.Y(), point.Z()])
    if not ends:
        return False
    away: Any = cKDTree(ends).query(ends, k=2)[0]
    return float(away[:, 1].max()) <= meet


def _survives_rewriting(shape: Any, whole_volume: float) -> bool:
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = str(Path(folder) / "again.step")
        writer.Write(path)
        copy = read(Path(path))
    counts = [len(faces_of(version)) for version in (shape, copy)]
    return counts[0] == counts[1] and is_valid(copy) and abs(_volume(copy) / whole_volume - 1) <= TOGETHER_LIMIT


def fillet_counts(shape: Any) -> tuple[int, int]:
    """Return the number of edges that OCCT can round with a fillet, and the number of tried edges."""
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet

    edges = thickness_edges(shape)
    tried = edges[:: max(1, -(-len(edges) // FILLETS))]
    count = 0
    for edge, length in tried:
        fillet = BRepFilletAPI_MakeFillet(shape)
        fillet.Add(min(ROUND, OF_EDGE * length), edge)
        try:
            fillet.Build()
            count += fillet.IsDone() and is_valid(fillet.Shape())
        except Exception:
            continue
    return count, len(tried)


def thickness_edges(shape: Any) -> list[tuple[Any, float]]:
    """Return the sharp straight edges through the sheet's thickness, each with its length (mm)."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.collections import IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as Faces
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS

    faces, edges, straight = Faces(), Faces(), list[tuple[Any, float, list[Any]]]()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_ShapeEnum.TopAbs_EDGE, TopAbs_ShapeEnum.TopAbs_FACE, faces)
    for i in range(1, faces.Extent() + 1):
        edge = TopoDS.Edge(faces.FindKey(i))
        curve, adjacent = BRepAdaptor_Curve(edge), [TopoDS.Face(face) for face in faces.FindFromIndex(i)]
        begin, end = BRep_Tool.Range_s(edge)
        a, middle, b = (curve.Value(x) for x in (begin, (begin + end) / 2, end))
        length = a.Distance(b)
        if len(adjacent) == 2 and length and a.Distance(middle) + middle.Distance(b) <= (1 + 1e-9) * length:
            straight.append((edge, length, adjacent))
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_ShapeEnum.TopAbs_VERTEX, TopAbs_ShapeEnum.TopAbs_EDGE, edges)
    sharp = [x for x in straight if _turn(x[0], x[2]) >= SHARP and _ends_at_corners(x[0], edges)]
    usual = Counter(round(length, 1) for _, length, _ in sharp).most_common(1)
    return [(edge, length) for edge, length, _ in sharp if abs(length / usual[0][0] - 1) < 0.1]


def _ends_at_corners(edge: Any, edges: Any) -> bool:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopExp import TopExp
    from OCP.TopoDS import TopoDS

    for vertex in (TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)):
        neighbours = (TopoDS.Edge(neighbour) for neighbour in edges.FindFromKey(vertex) if not neighbour.IsSame(edge))
        around = (edge, *neighbours)
        direction, *directions = (BRepAdaptor_Curve(x).DN(BRep_Tool.Parameter_s(vertex, x), 1) for x in around)
        if any(abs(direction.Dot(w)) > SMOOTH * direction.Magnitude() * w.Magnitude() for w in directions):
            return False
    return True


def _turn(edge: Any, faces: list[Any]) -> float:
    from OCP.BRep import BRep_Tool
    from OCP.GeomLProp import GeomLProp_SLProps
    from OCP.TopAbs import TopAbs_Orientation

    begin, end = BRep_Tool.Range_s(edge)
    normals = []
    for face in faces:
        place = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0).Value((begin + end) / 2)
        normal = GeomLProp_SLProps(BRep_Tool.Surface_s(face), place.X(), place.Y(), 1, 1e-9).Normal()
        normals.append(normal.Reversed() if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED else normal)
    return degrees(acos(max(-1.0, min(1.0, normals[0].Dot(normals[1])))))
