"""Smooth STEP against faceted STEP of the same designs: size, seconds, distances and volume.

    python -m tests.benchmarks.smooth_sizes [dome vault hypar sphere torus]

Each of 60 000 solid triangles or more. Seconds are those of building, checking and writing the smooth file on the
clock, and of all processes' CPU; the faceted one is written only, without simplification. Distances, from the smooth
solid to the mesh and back, and what is allowed (t/20 and the mesh's usual chord error), are in millimetres; the volume
is OCCT's of the file, against the mesh's and, since the mesh cuts its curves short, what that may be less.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from dsfab.design import run
from dsfab.design.output.files import curved_design
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.cad.step.strategies import prepare
from dsfab.export.formats import FORMATS
from dsfab.export.part import part_of
from dsfab.preset.file import load_preset
from tests.benchmarks.common import cpu

OPENING = {"slicing.min_opening": 0.03}

DESIGNS: dict[str, tuple[str, dict[str, Any]]] = {
    "dome": ("dome", {"surface.edge": 0.125} | OPENING),
    "vault": ("barrel_vault", {"surface.edge": 0.08} | OPENING),
    "hypar": ("dome", {"surface": {"shape": "hypar", "edge": 0.075, "support": [{"at": {"pick": "boundary"},
              "hold": "xyz"}], "load": [{"kind": "self_weight"}]}, "pattern.minor.frequency": 7.0} | OPENING),
    "sphere": ("globe", {"surface.edge": 0.032, "slicing.min_opening": 0.01}),
    "torus": ("dome", {"surface": {"shape": "torus", "edge": 0.085, "support": [{"at": {"pick": "side", "axis": "z",
              "end": "min", "depth": 0.1}, "hold": "xyz"}], "load": [{"kind": "self_weight"}]},
              "pattern.keep": 0.0, "pattern.major": {"mode": 5, "frequency": 5.0},
              "pattern.minor": {"mode": 7, "frequency": 5.0}} | OPENING),
}  # fmt: skip


def row(name: str, folder: Path) -> str:
    preset, changes = DESIGNS[name]
    design = run(load_preset(preset, changes))
    part = replace(prepare(part_of(design.solid, name, 10**7)), curved=lambda: curved_design(design))
    faceted = FORMATS[".step"].encode(replace(part, step="faceted"))
    large = sum(len(chunk) for chunk in faceted)
    start, spent = time.perf_counter(), cpu()
    file = smooth_file(replace(part, step="smooth"))
    (folder / "a.step").write_text(file.text, encoding="ascii")
    seconds, spent = time.perf_counter() - start, cpu() - spent
    return (
        f"{name:8} {len(design.solid.F):>9,} {file.smooth:>2}/{file.pieces:<2} {file.faces:6} {large / 1e6:8.1f} "
        f"{len(file.text) / 1e6:7.2f}  1/{large / len(file.text):<5.1f} {seconds:6.1f} {spent:6.1f}  "
        f"{file.there:5.2f} {file.back:5.2f}  {file.limits.distance:.2f} + {file.limits.usual_chord:.2f}  "
        f"{file.gap:5.2f}  {file.volume / (1e9 * design.solid.volume) - 1:+.1e} ({file.limits.rounder.mean():.1e})"
    )


def main() -> None:
    print("design   triangles smooth faces   faceted  smooth MB  size     s  CPU s"
          "  there  back     allowed     gap  volume")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or DESIGNS:
            print(row(name, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
