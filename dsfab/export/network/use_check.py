"""What CAD programs do with the solids of a STEP file, tried by OCCT: a program of its own, since OCCT may not end.

    python -P use_check.py FILE.step [CUTS]

prints one line of JSON: `solids`; `valid`; `faces`; `volume` by the adaptive rule and `plain` by the rule that most
programs take, cubic millimetres; `box` as OCCT bounds the solids, six numbers, millimetres; `sound`, how many of CUTS
half-space cuts (8 unless told) leave two valid halves whose volumes add up to `ADDS` of the whole; `worst`, by what
share the halves of the valid ones miss it most; `closed`, whether a section has no open ends; `seconds` of CPU.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

ADDS = 1e-5
"""Share of the volume that two halves may miss."""

ADAPTIVE = 1e-6
"""Relative error that volumes are asked for."""

MEET = 0.05
"""Millimetres within which the ends of a section's edges are one."""

PLANES = (
    *((1.0, 0.11, 0.07, 0.03), (0.09, 1.0, -0.13, -0.05), (0.05, 0.08, 1.0, 0.02), (1.0, 0.9, 0.2, 0.07)),
    *((1.0, -1.1, 0.3, -0.04), (0.4, 1.0, 0.9, 0.06), (0.9, -0.3, 1.0, -0.08), (-0.7, 1.0, 0.15, 0.11)),
)
"""Normals of cuts, and how far from the middle of the box they are, as shares of its diagonal."""


def use(path: Path, cuts: int) -> dict[str, Any]:
    """The findings about a file."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum

    begin = time.process_time()
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    shape, box = reader.OneShape(), Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    low, high = box.CornerMin(), box.CornerMax()
    bounds, whole = [low.X(), low.Y(), low.Z(), high.X(), high.Y(), high.Z()], _volume(shape)
    sizes = [_sizes(shape, bounds, plane) for plane in PLANES[:cuts]]
    off = [abs(sum(both) / whole - 1) for both in sizes if both]
    return {
        "solids": len(_parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID)),
        "valid": _valid(shape),
        "faces": len(_parts(shape, TopAbs_ShapeEnum.TopAbs_FACE)),
        "volume": whole,
        "plain": _volume(shape, plain=True),
        "box": bounds,
        "sound": sum(one <= ADDS for one in off),
        "worst": max(off, default=0.0),
        "closed": _closed_section(shape, bounds, PLANES[0]),
        "seconds": time.process_time() - begin,
    }


def _parts(shape: Any, kind: Any) -> list[Any]:
    from OCP.TopExp import TopExp_Explorer

    found, parts = TopExp_Explorer(shape, kind), []
    while found.More():
        parts.append(found.Current())
        found.Next()
    return parts


def _valid(shape: Any) -> bool:
    from OCP.BRepCheck import BRepCheck_Analyzer

    return bool(BRepCheck_Analyzer(shape).IsValid())


def _volume(shape: Any, plain: bool = False) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    if plain:
        BRepGProp.VolumeProperties_s(shape, properties)
    else:
        BRepGProp.VolumeProperties_s(shape, properties, ADAPTIVE, False, False)
    return float(properties.Mass())


def _plane(bounds: list[float], plane: tuple[float, ...]) -> tuple[Any, Any, Any]:
    """The plane of a cut, and a point on each side of it."""
    from OCP.gp import gp_Dir, gp_Pln, gp_Pnt

    low, high = bounds[:3], bounds[3:]
    diagonal = sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5
    length = sum(x * x for x in plane[:3]) ** 0.5
    normal = [x / length for x in plane[:3]]
    at = [(a + b) / 2 + plane[3] * diagonal * n for a, b, n in zip(low, high, normal, strict=True)]
    sides = [gp_Pnt(*(x + s * diagonal * n for x, n in zip(at, normal, strict=True))) for s in (-1, 1)]
    return gp_Pln(gp_Pnt(*at), gp_Dir(*normal)), sides[0], sides[1]


def _sizes(shape: Any, bounds: list[float], plane: tuple[float, ...]) -> list[float]:
    """The volumes of both halves of a cut; none where one is not valid."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeHalfSpace

    surface, *sides = _plane(bounds, plane)
    found = []
    for side in sides:
        space = BRepPrimAPI_MakeHalfSpace(BRepBuilderAPI_MakeFace(surface).Face(), side).Solid()
        half = BRepAlgoAPI_Common(shape, space)
        if not half.IsDone() or not _valid(half.Shape()):
            return []
        found.append(_volume(half.Shape()))
    return found


def _farthest_alone(points: Any) -> float:
    """The largest distance of one of some points (k, 3) from the nearest other one."""
    from scipy.spatial import cKDTree

    away: Any = cKDTree(points).query(points, k=2)[0]
    return float(away[:, 1].max())


def _closed_section(shape: Any, bounds: list[float], plane: tuple[float, ...]) -> bool:
    """Whether at every end of a section's edges another one begins."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Section
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    section = BRepAlgoAPI_Section(shape, _plane(bounds, plane)[0])
    if not section.IsDone():
        return False
    ends = list[list[float]]()
    for edge in _parts(section.Shape(), TopAbs_ShapeEnum.TopAbs_EDGE):
        for vertex in _parts(edge, TopAbs_ShapeEnum.TopAbs_VERTEX):
            at = BRep_Tool.Pnt_s(TopoDS.Vertex(vertex))
            ends.append([at.X(), at.Y(), at.Z()])
    return bool(ends) and _farthest_alone(ends) <= MEET


if __name__ == "__main__":
    given = sys.argv[1:]
    sys.stdout.write(json.dumps(use(Path(given[0]), int(given[1]) if len(given) > 1 else len(PLANES))) + "\n")
