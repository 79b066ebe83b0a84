"""CPU seconds to cut a surface into stripes: dsfab's slicer beside VTK's clip, done correctly.

    python tests/benchmarks/clip.py [20000,80000,330000]

The numbers are faces of a sphere. Clipping is exact only for one linear field at one level at a time: each band between
two levels is clipped at its lower and its upper edge (vtkClipPolyData, through pyvista). Two families of 16 stripes:
the void bands of the first one, put together, are clipped again for the second. Areas of the material are compared.
Ours are all cells, void ones too, on shared vertices; VTK's are material only, and each band has vertices of its own.
"""

import time
from collections.abc import Callable
from itertools import pairwise
from typing import TypeVar

import numpy as np
import pyvista as pv

from dsfab.slicing import cut
from dsfab.surface import Surface
from tests.benchmarks.common import sizes, sphere

STRIPES = 16
Made = TypeVar("Made")


def main() -> None:
    print(" ".join(f"{row:>13}" for row in ("faces", "ours", "VTK", "ratio", "areas apart", "our cells")))
    for faces in sizes(__doc__ or "", "20000,80000,330000"):
        one(sphere(faces // 2).surface.build())


def one(surface: Surface) -> None:
    """Measure one size."""
    x, y, z = (surface.V / np.linalg.norm(surface.V, axis=1).mean()).T
    waves = [x + 0.3 * y * z, y - 0.4 * x + 0.2 * z**2]
    levels = [np.linspace(w.min(), w.max(), 2 * STRIPES + 2)[1:-1] for w in waves]
    ours, cells = timed(lambda: cut(surface, waves, levels))
    theirs, clipped = timed(lambda: by_vtk(surface, waves, levels))
    area = cut(surface, waves, levels, 0.0)
    apart = abs(area.surface.areas[area.material].sum() / clipped - 1)
    numbers = f"{ours:13.3f} {theirs:13.3f} {theirs / ours:13.1f} {apart:13.1e} {cells.surface.m:13,}"
    print(f"{surface.m:13,} {numbers}", flush=True)


def by_vtk(surface: Surface, fields: list[np.ndarray], levels: list[np.ndarray]) -> float:
    """The area of the union of two families of stripes, each clipped out of what the earlier ones left."""
    left = pv.PolyData.from_regular_faces(surface.V, surface.F)
    for k, field in enumerate(fields):
        left[str(k)] = field
    area = 0.0
    for k, at in enumerate(levels):
        limits = np.concatenate([[-np.inf], at, [np.inf]])
        bands = [band(left, str(k), low, high) for low, high in pairwise(limits)]
        area += sum(piece.triangulate().area for piece in bands[1::2])
        first, *others = [piece for piece in bands[::2] if piece.n_cells]
        left = first.append_polydata(*others)
    return area


def band(mesh: pv.PolyData, name: str, low: float, high: float) -> pv.PolyData:
    """What lies between two levels of a field."""
    if np.isfinite(low):
        mesh = mesh.clip_scalar(scalars=name, invert=False, value=low)
    return mesh.clip_scalar(scalars=name, invert=True, value=high) if np.isfinite(high) and mesh.n_cells else mesh


def timed(work: Callable[[], Made]) -> tuple[float, Made]:
    start = time.process_time()
    made = work()
    return time.process_time() - start, made


if __name__ == "__main__":
    main()
