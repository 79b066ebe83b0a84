#!/usr/bin/env bash
# What: build123d 0.13.0, `Mesher.read` of a 3MF file. The file is written by lib3mf 2.5.0, on which build123d stands.
# Input: one mesh, a cube of 1, in a 3MF file in inches. Its build places it twice.
#       Once it is as it is, and once it is twice as large and 10 to the right.
#       So two cubes of 1 and 8 cubic inches are to be printed.
# An expert expects: two shapes where the build places them, in build123d's millimetres: 16387 and 131097 mm3.
#       `import_step` of a cube of one inch gives 25.4.
# It does: it reads the list of meshes, not the build. One cube comes back, at the origin, unscaled.
#       Its volume is 1, since the numbers of the file stay. Only `model_unit` tells the unit.
#       No warning is given. lib3mf itself finds both build items and their transforms in the same file.
# Output seen:
#       lib3mf: 2 build items, in inches, scales 1 and 2
#       build123d: 1 shape, volume 1, from 0 to 1 in x, model_unit IN
# Date 2026-11-29
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    build123d==0.13.0 cadquery-ocp-novtk==8.0.1.1.0 lib3mf==2.5.0 2>pip.log || { cat pip.log; exit 2; }

cat >test.py <<'PYTHON'
import sys

import build123d
import lib3mf

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
         (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


def filled(made, field, values):
    for k, value in enumerate(values):
        getattr(made, field)[k] = value
    return made


def placed(scale, x):
    move = lib3mf.Transform()
    for k in range(3):
        move.Fields[k][k] = scale
    move.Fields[3][0] = x
    return move


model = lib3mf.get_wrapper().CreateModel()
model.SetUnit(lib3mf.ModelUnit.Inch)
cube = model.AddMeshObject()
cube.SetGeometry([filled(lib3mf.Position(), "Coordinates", p) for p in CORNERS],
                 [filled(lib3mf.Triangle(), "Indices", f) for f in FACES])
assert cube.IsManifoldAndOriented()
model.AddBuildItem(cube, placed(1, 0))
model.AddBuildItem(cube, placed(2, 10))
model.QueryWriter("3mf").WriteToFile("two.3mf")

again = lib3mf.get_wrapper().CreateModel()
reader = again.QueryReader("3mf")
reader.ReadFromFile("two.3mf")
assert reader.GetWarningCount() == 0
items, scales = again.GetBuildItems(), []
while items.MoveNext():
    scales.append(items.GetCurrent().GetObjectTransform().Fields[0][0])
inches = again.GetUnit() == lib3mf.ModelUnit.Inch
print(f"lib3mf: {len(scales)} build items, in {'inches' if inches else 'another unit'}, "
      f"scales {' and '.join(f'{s:g}' for s in scales)}")

mesher = build123d.Mesher()
shapes = mesher.read("two.3mf")
box = shapes[0].bounding_box()
print(f"build123d: {len(shapes)} shape, volume {shapes[0].volume:.6g}, from {box.min.X:.6g} to {box.max.X:.6g} in x, "
      f"model_unit {mesher.model_unit.name}")
assert inches and scales == [1, 2]
if not (len(shapes) == 1 and abs(shapes[0].volume - 1) < 1e-6 and abs(box.max.X - 1) < 1e-6):
    sys.exit("Changed: build123d's Mesher.read now takes the build items or the unit of a 3MF file into account.")
PYTHON
nice venv/bin/python test.py
