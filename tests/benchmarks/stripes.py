"""What evenly spaced stripes cost beside modes: directions, densities, both phases and the halving; and their cut.

    python tests/benchmarks/stripes.py [2500,10000,17000] [--repeat 3]

On `dome` and, with DSFAB_MESHES, on Botanic.obj, remeshed to about these numbers of vertices. Each row is measured in a
process of its own after the statics; of some runs the one counts that takes the least of the processor.

    modes            tensors, operators and five modes of both families
    fields           directions, densities and both phases alone: `even_stripes` without halving or symmetry
    halved, free     `even_stripes`, halved where they crowd or not: these, the search for symmetry, what is drawn
    single           the cut along stripes of a mode of each family, as far apart as the others in the mean
    at corners       the same stripes as corner fields
    halved cut       the cut of the halved stripes

Memory in MiB is what each takes at most beyond what was held before, where the system tells (Linux).
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import table
from dsfab.core.sparse import peak_memory, release_freed_memory
from dsfab.design import Design, Log
from dsfab.design.directions import diffusion_step
from dsfab.design.even_stripes import even_stripes
from dsfab.preset.file import load_preset, with_overrides
from dsfab.preset.model import Preset
from dsfab.preset.proposal import preset_for
from dsfab.results import DiffusionResult
from dsfab.slicing import cut
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField, hat_gradients

ROOT = Path(__file__).parents[2]
LEVELS = np.arange(-200.0, 201.0)
MESHES = Path(os.environ.get("DSFAB_MESHES", ROOT / "../shared/meshes")).resolve()
PLAIN = {"pattern.width.rule": "plain", "pattern.width.solid_fraction": 0.0, "pattern.fillet": 0.0}
"""Widths as the thresholds say: none is sought for."""
COLUMNS = ("modes", "fields", "halved", "free", "single", "at corners", "halved cut")


def preset_of(name: str, vertices: int) -> Preset:
    """The preset of a shipped shape or of a mesh file, on about so many vertices."""
    preset = load_preset(ROOT / "presets" / "dome.toml") if name == "dome" else preset_for(MESHES / name)
    area = preset.surface.build().area
    edge = (2 * area / (3**0.5 * vertices)) ** 0.5  # of a net of equal triangles
    return with_overrides(preset, {"surface.edge": edge, **PLAIN})


def measured(make: Callable[[], Any], repeat: int) -> tuple[Any, float, float]:
    """What is made, the least processor's seconds of some runs, and the memory in MiB that the first took."""
    release_freed_memory(float("inf"))  # all that was freed
    before = _resident()
    _forget_peak()
    seconds = []
    for k in range(repeat):
        start = time.process_time()
        made = make()
        seconds.append(time.process_time() - start)
        if not k:
            memory = (peak_memory_now() - before) / 2**20
    return made, min(seconds), memory


def _resident() -> int:
    return _status("VmRSS") or 0


def peak_memory_now() -> int:
    """Bytes, the most since `_forget_peak` where Linux tells it, else of the whole process."""
    return _status("VmHWM") or peak_memory()


def _forget_peak() -> None:
    if sys.platform.startswith("linux"):
        with suppress(OSError):  # not everywhere is this allowed
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _status(key: str) -> int | None:
    if not sys.platform.startswith("linux"):
        return None
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{key}:"))


def one_row(name: str, vertices: int, repeat: int) -> dict[str, Any]:
    """Seconds and MiB by column, numbers of vertices and of cells."""
    preset = preset_of(name, vertices)
    design = Design.from_preset(preset).until("statics")
    surface, statics = design.surface, design.statics
    five = with_overrides(preset, {"diffusion.modes": 5})
    free = with_overrides(preset, {"pattern.halve": False})
    alone = with_overrides(free, {"pattern.symmetry": "none"})
    found = {
        "fields": measured(lambda: even_stripes(alone, surface, statics), repeat),
        "modes": measured(lambda: diffusion_step(five, surface, statics, Log(None)), repeat),
        "halved": measured(lambda: even_stripes(preset, surface, statics), repeat),
        "free": measured(lambda: even_stripes(free, surface, statics), repeat),
    }
    plain = mode_bands(preset, surface, found["modes"][0])
    pattern = design.pattern
    jobs = {
        "single": (plain, [LEVELS] * len(plain)),
        "at corners": ([at_corners(surface, x) for x in plain], [LEVELS] * len(plain)),
        "halved cut": (pattern.fields, pattern.levels),
    }
    for column, job in jobs.items():
        found[column] = measured(partial(cut, surface, *job), repeat)
    row = {column: found[column][1:] for column in COLUMNS}
    return {"name": name, "n": surface.n, "cells": [found[column][0].surface.m for column in jobs], **row}


def mode_bands(preset: Preset, surface: Surface, found: DiffusionResult) -> list[Floats]:
    """(n, 2) each: stripes on the second mode of both families, half of the material, as far apart as `preset` asks."""
    bands = []
    for family, modes in ((preset.pattern.major, found.major), (preset.pattern.minor, found.minor)):
        x = modes.mode(2)
        slope = np.linalg.norm(np.einsum("mci,mc->mi", hat_gradients(surface), x[surface.F]), axis=1)
        spacing = family.distance(surface.area, surface.mean_edge)
        z = x * surface.area / (spacing * float(surface.areas @ slope))
        bands.append(np.stack([z + 0.15, z - 0.15], axis=1))
    return bands


def at_corners(surface: Surface, band: Floats) -> CornerField:
    """The same stripes as every corner sees them."""
    sides = (surface.m, 3)
    return CornerField(band, np.ones(sides), np.zeros(sides), np.zeros(surface.m, dtype=bool))


def in_own_process(name: str, vertices: int, repeat: int) -> dict[str, Any]:
    """`one_row`, with one thread for BLAS and the solver: seconds of threads that wait for each other say nothing."""
    single = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-m", "tests.benchmarks.stripes", "--row", name, str(vertices), "--repeat", str(repeat)]
    done = subprocess.run(words, cwd=ROOT, env=single, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def told(rows: list[dict[str, Any]]) -> str:
    """The rows as three tables: seconds, ratios, memory."""
    lines = []
    for part, unit in ((0, "CPU s"), (1, "MiB")):
        head = ("surface", "vertices", *(f"{column}, {unit}" for column in COLUMNS))
        body = [(r["name"], f"{r['n']:,}", *(f"{r[c][part]:.{0 if part else 3}f}" for c in COLUMNS)) for r in rows]
        lines.append(table(head, body))
    pairs = (("fields", "modes"), ("halved", "modes"), ("free", "modes"), ("at corners", "single"))
    head = ("surface", "vertices", *(f"{one} / {other}" for one, other in pairs), "cells: single", "halved")
    body = [
        (
            *(r["name"], f"{r['n']:,}", *(f"{r[one][0] / r[other][0]:.2f}" for one, other in pairs)),
            *(f"{count:,}" for count in r["cells"][::2]),
        )
        for r in rows
    ]
    return "\n\n".join([*lines, table(head, body)])


def main() -> None:
    """Print the tables, or one row as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vertices", nargs="?", default="2500,10000,17000")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--row", nargs=2, metavar=("NAME", "VERTICES"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.row:
        print(json.dumps(one_row(given.row[0], int(given.row[1]), given.repeat)))
        return
    sizes = [int(number) for number in given.vertices.split(",")]
    names = ["dome", *(["Botanic.obj"] if (MESHES / "Botanic.obj").exists() else [])]
    print(told([in_own_process(name, size, given.repeat) for name in names for size in sizes]))


if __name__ == "__main__":
    main()
