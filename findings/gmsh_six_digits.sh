#!/usr/bin/env bash
# What: gmsh 4.15.2, `gmsh.write` to OFF.
# Input: a flat rectangle of 8 x 6 m in coordinates of a survey (x 500 km, y 5400 km), meshed with edges of .7 m.
# An expert expects: the file holds the coordinates of the mesh, as gmsh's OBJ files do.
# It does: OFF holds six significant digits, so that y has steps of 10 m and x of 1 m. There is no warning.
# Output seen:
#       obj: 48 m2, 99 values of y
#       off: 80 m2, 2 values of y
# Date 2026-11-29
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check gmsh==4.15.2 numpy==2.4.6 2>pip.log ||
    { cat pip.log; exit 2; }

cat >test.py <<'PYTHON'
import sys
from pathlib import Path

import gmsh
import numpy as np

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addRectangle(500_000, 5_400_000, 100, 8, 6)
gmsh.model.occ.synchronize()
gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
gmsh.model.mesh.generate(2)


def vertices_and_triangles(path):
    lines = [line.split() for line in path.read_text().splitlines()]
    if path.suffix == ".obj":
        V = [line[1:] for line in lines if line[:1] == ["v"]]
        F = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    else:
        count = int(lines[0][1])
        V, F = lines[1 : 1 + count], [[int(k) for k in line[1:]] for line in lines[1 + count :] if line[:1] == ["3"]]
    return np.array(V, dtype=float), np.array(F)


found = {}
for suffix in ("obj", "off"):
    path = Path(f"roof.{suffix}")
    gmsh.write(str(path))
    V, F = vertices_and_triangles(path)
    a, b, c = V[F].transpose(1, 0, 2)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    found[suffix] = (round(area, 6), np.unique(V[:, 1]).tolist())
    print(f"{suffix}: {found[suffix][0]:g} m2, {len(found[suffix][1])} values of y")
gmsh.finalize()
if found["obj"][0] != 48.0 or found["off"][1] != [5_400_000.0, 5_400_010.0]:
    sys.exit("Changed: gmsh no longer writes OFF with six significant digits.")
PYTHON
nice venv/bin/python test.py
