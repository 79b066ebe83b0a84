"""CPU seconds, size and memory of files by format, with and without reading them back; and of STEP by other ways.

    python tests/benchmarks/formats.py [1000000]           # STL, 3MF, PLY, GLB, OBJ and more of so many triangles
    python tests/benchmarks/formats.py step [66000]        # faceted STEP against sewing and build123d's own way
    python tests/benchmarks/formats.py write [1000000]     # faceted STEP, written only

A ring whose triangles are in no common plane; each row in a process of its own, whose peak memory is told (the ring and
the libraries included), and which is ended after DSFAB_SECONDS (1200): sewing 66 000 triangles does not end in 900 s.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsfab.export import FORMATS
from dsfab.export.formats import write
from dsfab.export.part import part_of
from dsfab.thickening import Solid

FEW = (".stl", ".3mf", ".ply", ".glb", ".obj", ".off")
WAYS = ("dsfab", "sewing", "build123d")
SECONDS = float(os.environ.get("DSFAB_SECONDS", "1200"))


def ring(triangles: int) -> Solid:
    """Radii 1 m and 0.3 m, in about so many triangles, moved a little out of their planes."""
    nv = round(np.sqrt(triangles / 4))
    nu = 2 * nv
    i, j = np.divmod(np.arange(nu * nv), nv)
    u, v = 2 * np.pi * i / nu, 2 * np.pi * j / nv
    r = 1 + 0.3 * np.cos(v) + np.random.default_rng(0).normal(scale=1e-5, size=len(u))
    a, b = i * nv + j, (i + 1) % nu * nv + j
    c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    return Solid(np.c_[r * np.cos(u), r * np.sin(u), 0.3 * np.sin(v)], np.r_[np.c_[a, b, c], np.c_[a, c, d]], 1, 1)


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """CPU and clock seconds."""
    cpu, clock = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - cpu, time.perf_counter() - clock


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def mesh_row(suffix: str, triangles: int, folder: Path) -> None:
    solid, form, path = ring(triangles), FORMATS[suffix], folder / f"a{suffix}"
    part = part_of(solid, "a", 10**8)

    def only() -> None:
        with open(path, "wb") as file:
            file.writelines(form.encode(form.prepare(part)))

    alone, after = timed(only), peak()
    whole, size = timed(lambda: write(solid, path)), path.stat().st_size / 1e6
    head = f"{suffix:6} {len(solid.F):>10,} {size:8.1f} MB"
    wrote = f"write {alone[0]:6.2f} cpu {alone[1]:6.2f} s {after:5.2f} GB"
    print(f"{head}  {wrote}; and read back {whole[0]:6.2f} cpu {whole[1]:6.2f} s {peak():5.2f} GB", flush=True)


def step_row(way: str, triangles: int, folder: Path) -> None:
    """From a mesh in memory to a STEP file of one face per triangle, nothing checked."""
    solid, path = ring(triangles), folder / "a.step"
    if way != "dsfab":
        import build123d  # noqa: F401
    seconds = timed(lambda: {"dsfab": _ours, "sewing": _sewn, "build123d": _imported}[way](solid, path))
    print(f"{way:10} {len(solid.F):>10,} {path.stat().st_size / 1e6:8.1f} MB {seconds[0]:8.2f} cpu {seconds[1]:8.2f} s "
          f"{peak():5.2f} GB", flush=True)  # fmt: skip


def _ours(solid: Solid, path: Path) -> None:
    form = FORMATS[".step"]
    part = replace(form.prepare(part_of(solid, "a", 10**8)), step="faceted")
    with open(path, "wb") as file:
        file.writelines(form.encode(part))


def _sewn(solid: Solid, path: Path) -> None:
    from build123d import Solid as Made
    from build123d import export_step
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon, BRepBuilderAPI_Sewing
    from OCP.gp import gp_Pnt

    points = [gp_Pnt(*p) for p in (1000 * solid.V).tolist()]
    sewing = BRepBuilderAPI_Sewing(1e-5)
    for a, b, c in solid.F.tolist():
        wire = BRepBuilderAPI_MakePolygon(points[a], points[b], points[c], True).Wire()
        sewing.Add(BRepBuilderAPI_MakeFace(wire, True).Face())
    sewing.Perform()
    export_step(Made.cast(sewing.SewedShape()), path)


def _imported(solid: Solid, path: Path) -> None:
    from build123d import Mesher, export_step

    mesh = write(solid, path.with_suffix(".3mf"))
    export_step(Mesher().read(mesh)[0], path)


def main() -> None:
    what = sys.argv[1] if len(sys.argv) > 1 and not sys.argv[1].isdigit() else "mesh"
    count = int(sys.argv[-1]) if sys.argv[-1].isdigit() else {"step": 66_000}.get(what, 1_000_000)
    rows = {"mesh": FEW, "step": WAYS, "write": ("dsfab",)}[what]
    for row in rows:
        with tempfile.TemporaryDirectory() as place:
            command = [sys.executable, str(Path(__file__).resolve()), "one", what, row, str(count), place]
            try:
                subprocess.run(command, check=False, timeout=SECONDS)
            except subprocess.TimeoutExpired:
                print(f"{row:10} {count:>10,} no end within {SECONDS:g} s", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        (mesh_row if sys.argv[2] == "mesh" else step_row)(sys.argv[3], int(sys.argv[4]), Path(sys.argv[5]))
    else:
        main()
