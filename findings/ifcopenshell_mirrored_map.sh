#!/usr/bin/env bash
# What: ifcopenshell 0.9.0.post1, `geom.create_shape`.
# Input: a closed box of 2 x 1 x 1 m as four kinds of IFC4 items: an extrusion, a faceted brep, a closed polygonal face
#       set and a closed triangulated face set. IfcMappedItem places each twice: as it is, and mirrored, with an
#       IfcCartesianTransformationOperator3D whose Axis1 is (-1, 0, 0).
# An expert expects: the normals of a closed solid point outwards in both, so that its signed volume is 2 m3. IFC4 says so
#       of closed face sets, and an extrusion has no order of vertices that could be wrong.
# It does: the mirrored box has the right vertices, but the triangles of all four kinds are inside out: -2 m3.
# Output seen:
#       IfcExtrudedAreaSolid: plain 2.0 m3, mirrored -2.0 m3
#       IfcFacetedBrep: plain 2.0 m3, mirrored -2.0 m3
#       IfcPolygonalFaceSet: plain 2.0 m3, mirrored -2.0 m3
#       IfcTriangulatedFaceSet: plain 2.0 m3, mirrored -2.0 m3
# Date 2026-11-29
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check ifcopenshell==0.9.0.post1 numpy==2.4.6 2>pip.log ||
    { cat pip.log; exit 2; }

cat >test.py <<'PYTHON'
import sys

import ifcopenshell
import ifcopenshell.geom
import numpy as np

CORNERS = [(x, y, z) for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))]
SIDES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]  # seen from outside

ifc = ifcopenshell.file(schema="IFC4")
new = ifcopenshell.guid.new
origin = ifc.createIfcCartesianPoint((0.0, 0.0, 0.0))
axes = ifc.createIfcAxis2Placement3D(origin)
context = ifc.createIfcGeometricRepresentationContext(None, "Model", 3, 1e-5, axes)
metre = ifc.createIfcUnitAssignment([ifc.createIfcSIUnit(None, "LENGTHUNIT", None, "METRE")])
ifc.createIfcProject(new(), None, "project", RepresentationContexts=[context], UnitsInContext=metre)


def boxes():
    middle = ifc.createIfcAxis2Placement2D(ifc.createIfcCartesianPoint((1.0, 0.5)))
    profile = ifc.createIfcRectangleProfileDef("AREA", None, middle, 2.0, 1.0)
    yield ifc.createIfcExtrudedAreaSolid(profile, axes, ifc.createIfcDirection((0.0, 0.0, 1.0)), 1.0)
    points = [ifc.createIfcCartesianPoint(corner) for corner in CORNERS]
    loops = [ifc.createIfcPolyLoop([points[k] for k in side]) for side in SIDES]
    faces = [ifc.createIfcFace([ifc.createIfcFaceOuterBound(loop, True)]) for loop in loops]
    yield ifc.createIfcFacetedBrep(ifc.createIfcClosedShell(faces))
    numbers = ifc.createIfcCartesianPointList3D(CORNERS)
    polygons = [ifc.createIfcIndexedPolygonalFace([k + 1 for k in side]) for side in SIDES]
    yield ifc.createIfcPolygonalFaceSet(numbers, True, polygons)
    triangles = [(a + 1, c + 1, d + 1) for a, b, c, d in SIDES] + [(a + 1, b + 1, c + 1) for a, b, c, _ in SIDES]
    yield ifc.createIfcTriangulatedFaceSet(numbers, None, True, triangles)


def placed_volume(source, first_axis):
    """Signed volume of an element that maps the source, with the given Axis1."""
    y, z = (ifc.createIfcDirection(axis) for axis in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    operator = ifc.createIfcCartesianTransformationOperator3D(ifc.createIfcDirection(first_axis), y, origin, 1.0, z)
    item = ifc.createIfcMappedItem(source, operator)
    shape = ifc.createIfcShapeRepresentation(context, "Body", "MappedRepresentation", [item])
    element = ifc.createIfcBuildingElementProxy(
        new(), Name="box", ObjectPlacement=ifc.createIfcLocalPlacement(None, axes),
        Representation=ifc.createIfcProductDefinitionShape(None, None, [shape]),
    )
    mesh = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), element).geometry
    V, F = np.array(mesh.verts).reshape(-1, 3), np.array(mesh.faces).reshape(-1, 3)
    a, b, c = V[F].transpose(1, 0, 2)
    return round(float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6, 9)


volumes = {}
for box in boxes():
    shape = ifc.createIfcShapeRepresentation(context, "Body", "Body", [box])
    source = ifc.createIfcRepresentationMap(axes, shape)
    volumes[box.is_a()] = [placed_volume(source, (sign, 0.0, 0.0)) for sign in (1.0, -1.0)]
    print("{}: plain {} m3, mirrored {} m3".format(box.is_a(), *volumes[box.is_a()]))
if len(volumes) != 4 or any(pair != [2.0, -2.0] for pair in volumes.values()):
    sys.exit("Changed: ifcopenshell no longer turns mirrored mapped solids inside out.")
PYTHON
nice venv/bin/python test.py
