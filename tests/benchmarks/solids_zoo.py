"""Pairs of faces that intersect in solids over the shapes, presets and meshes of the zoo, at 1, 2 and 5 % thickness.

    python -m tests.benchmarks.solids_zoo [NAME ...]

Thickness is a share of half the diagonal; meshes come from DSFAB_MESHES. A row is a surface with its faces; a column a
thickness: triangles of the solid, pairs left in double and single precision (merged by position, as readers of STL do),
what was done to get there, and seconds of CPU. "bad" marks what trimesh does not take as a volume.
"""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.core.errors import DsfabError
from dsfab.core.units import MM_PER_M
from dsfab.surface import Surface
from dsfab.thickening.self_intersection import intersecting_pairs
from tests.meshes import mesh_file
from tests.thickening.solid_zoo import MESHES, SHAPE_OF, SHAPES
from tests.thickening.thick_solids import made, real

SHARES = (0.01, 0.02, 0.05)


def of_preset(name: str) -> Surface:
    preset = dsfab.load_preset(name)
    if not SHAPE_OF[name]:
        preset = dsfab.load_preset(name, {}, mesh_file(Path(preset.surface.file).name))
    return preset.surface.build()


def rows() -> Iterator[tuple[str, Callable[[], Surface]]]:
    yield from SHAPES.items()
    yield from ((f"preset {name}", lambda name=name: of_preset(name)) for name in SHAPE_OF)
    yield from ((name, lambda name=name: real(name)) for name in MESHES)


def cell(surface: Surface, share: float) -> str:
    try:
        begin = time.process_time()
        solid = made(surface, share * surface.size / 2)
    except DsfabError as error:
        return f"refused: {error}"
    seconds = time.process_time() - begin
    single = (solid.V * MM_PER_M).astype(np.float32).astype(float)
    merged, of = np.unique(single, axis=0, return_inverse=True)
    left = [len(intersecting_pairs(V, F)) for V, F in ((solid.V, solid.F), (merged, of.reshape(-1)[solid.F]))]
    sound = "" if trimesh.Trimesh(solid.V, solid.F, process=False).is_volume else " bad"
    return f"{len(solid.F)} {left[0]}/{left[1]} {solid.repairs.rung} {seconds:.1f}{sound}"


def main(names: list[str]) -> None:
    for name, make in rows():
        if names and name not in names:
            continue
        try:
            surface = make()
        except (DsfabError, OSError, pytest.skip.Exception) as error:
            print(f"{name:28} {error}", flush=True)
            continue
        cells = [cell(surface, share) for share in SHARES]
        print(f"{name:28} {surface.m:7} " + "  ".join(f"{text:26}" for text in cells), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
