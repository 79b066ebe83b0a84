#!/usr/bin/env bash
# What: rhino3dm 8.35.0, `MeshVertexList.Add` and `MeshVertexList.AddPoint3d`.
# Input: a mesh with a vertex at x = 1000000 + 1/3, written to a 3DM file and read again.
# An expert expects: `UseDoublePrecisionVertices` says whether the mesh keeps all digits of the number that Add takes.
# It does: a fresh mesh says False. One `Add(x, y, z)` makes it True, and x is rounded to single precision.
#       The file holds the rounded numbers as doubles, and the mesh that is read says True again.
#       `AddPoint3d(x, y, z)` keeps all digits. `Point3dAt(k)` shows them, and `Vertices[k]` rounds them.
# Output seen:
#       fresh: double False
#       Add: double True, Point3dAt 1000000.3125, index 1000000.3125, again 1000000.3125, double True
#       AddPoint3d: double True, Point3dAt 1000000.3333333334, index 1000000.3125, again 1000000.3333333334, double True
# Date 2026-11-29
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check rhino3dm==8.35.0 2>pip.log ||
    { cat pip.log; exit 2; }

cat >test.py <<'PYTHON'
import sys

import rhino3dm

X = 1000000 + 1 / 3
fresh = rhino3dm.Mesh().Vertices.UseDoublePrecisionVertices
print("fresh: double", fresh)
found = {}
for way in ("Add", "AddPoint3d"):
    mesh = rhino3dm.Mesh()
    for corner in ((X, 0, 0), (X + 1, 0, 0), (X, 1, 0)):
        getattr(mesh.Vertices, way)(*corner)
    mesh.Faces.AddFace(0, 1, 2)
    file = rhino3dm.File3dm()
    file.Objects.AddMesh(mesh)
    file.Write(f"{way}.3dm", 8)
    again = rhino3dm.File3dm.Read(f"{way}.3dm").Objects[0].Geometry.Vertices
    here = mesh.Vertices
    found[way] = (here.UseDoublePrecisionVertices, here.Point3dAt(0).X, here[0].X, again.Point3dAt(0).X,
                  again.UseDoublePrecisionVertices)
    print("{}: double {}, Point3dAt {!r}, index {!r}, again {!r}, double {}".format(way, *found[way]))
rounded = 1000000.3125
if fresh or found != {"Add": (True, rounded, rounded, rounded, True), "AddPoint3d": (True, X, rounded, X, True)}:
    sys.exit("Changed: rhino3dm's flag of double precision no longer says True of vertices that Add has rounded.")
PYTHON
nice venv/bin/python test.py
