"""CPU seconds from a surface to a tested solid, stage by stage, the time by the clock, and the most memory in use.

    python tests/benchmarks/solid.py [50000,200000,1000000]

The numbers are triangles of the solid, which come out within a fifth. A sphere, two families of stripes of half the
width, thickness 2 % of the radius; each size in a process of its own, whose peak memory is told.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import manifold3d
import numpy as np

from dsfab.slicing import cut, resolve_pinches
from dsfab.surface import Surface
from dsfab.thickening import OffsetLayer, offsets, proven_cells, thicken
from dsfab.thickening.self_intersection import intersecting_pairs
from tests.benchmarks.common import sizes, sphere

ROWS = ("offsets", "slicing", "pinches", "carrying", "proof", "thickening", "of it: manifold3d", "test unproven")
STAGES = 6
"""The first of them are the stage; manifold3d is a part of the last one, and the exact test of all pairs is what the
proof saves, twice."""
INSIDE, ALONG = 2.67, 638.0
"""Triangles of the solid per vertex of the uncut surface, and per square root of that (along the stripes): measured."""

Made = TypeVar("Made")


def main() -> None:
    print(
        f"{'triangles':>10} "
        + " ".join(f"{row:>18}" for row in ROWS)
        + f" {'total':>7} {'clock':>7} {'GB':>6} {'pairs':>6}"
    )
    for triangles in sizes(__doc__ or "", "50000,200000,1000000"):
        subprocess.run([sys.executable, str(Path(__file__).resolve()), "one", str(triangles)], check=True)


def one(triangles: int) -> None:
    """Measure one size, in this process."""
    root = (np.sqrt(ALONG**2 + 4 * INSIDE * triangles) - ALONG) / (2 * INSIDE)
    surface = sphere(round(root**2)).surface.build()
    seconds: dict[str, float] = {}
    clock: dict[str, float] = {}

    def timed(row: str, work: Callable[[], Made]) -> Made:
        start, began = time.process_time(), time.perf_counter()
        done = work()
        seconds[row], clock[row] = time.process_time() - start, time.perf_counter() - began
        return done

    t = 0.02 * np.linalg.norm(surface.V, axis=1).mean()
    waves, levels = fields(surface)
    offset = timed("offsets", lambda: offsets(surface, t))
    cells = timed("slicing", lambda: cut(surface, waves, levels))
    whole = timed("pinches", lambda: resolve_pinches(cells, t / 2)).sheet
    sheet = whole.subset()
    D = timed("carrying", lambda: sheet.carry_corners(offset.at_corners(surface.F), surface.F))
    layer = OffsetLayer(surface, offset.D, whole.surface, whole.carry(offset.D), whole.parent)
    proven = timed("proof", lambda: proven_cells(layer))[whole.material]
    solid = timed("thickening", lambda: thicken(sheet.surface, D, proven=proven))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    timed("test unproven", lambda: intersecting_pairs(solid.V, solid.F))
    mesh = manifold3d.Mesh64(np.array(solid.V), np.array(solid.F, dtype=np.uint64))
    timed("of it: manifold3d", lambda: manifold3d.Manifold(mesh).status())
    total, whole_time = (sum(spent[row] for row in ROWS[:STAGES]) for spent in (seconds, clock))
    cells_ = " ".join(f"{seconds[row]:18.2f}" for row in ROWS)
    print(f"{len(solid.F):10,} {cells_} {total:7.2f} {whole_time:7.2f} {peak:6.2f} {solid.repairs.pairs:6}", flush=True)


def fields(surface: Surface) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Two smooth fields askew to each other, and levels of eight stripes for each."""
    x, y, z = (surface.V / np.linalg.norm(surface.V, axis=1).mean()).T
    waves = [x + 0.3 * y * z, y - 0.4 * x + 0.2 * z**2]
    return waves, [np.linspace(w.min(), w.max(), 34)[1:-1] for w in waves]


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        one(int(sys.argv[2]))
    else:
        main()
