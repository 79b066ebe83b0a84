"""How many pieces of random patterns become smooth STEP solids, and what that costs.

    DSFAB_MESHES=... python -m tests.benchmarks.smooth_rate RESULTS.jsonl [patterns] [names]

For each surface of SURFACES (or those named, with commas), so many patterns (60) of two of the surface's own modes cut
at random; a hundredth of the half diagonal is the thickness. Every pattern adds a line to the file, and those that are
in it already are not made again; the first pattern of each surface comes before the second of any. The table is
printed in the end: pieces smooth of pieces made, patterns, reasons of refusals, medians of faces, size against one face
per triangle, the largest distance both ways and gap in parts of the thickness, and CPU seconds.
"""

import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import igl
import numpy as np
from scipy.sparse.linalg import eigsh

from dsfab.core.errors import DsfabError
from dsfab.design.output.files import curved_sheet
from dsfab.export.cad.step import file as step
from dsfab.export.cad.step import strategies
from dsfab.export.cad.step.smooth.build import smooth_file
from dsfab.export.part import Part, part_of
from dsfab.slicing import cut, resolve_pinches
from dsfab.surface import Surface
from dsfab.surface.shapes.roofs import barrel_vault, hypar
from dsfab.surface.shapes.round_shapes import dome, sphere, torus
from dsfab.thickening import offsets, thicken
from tests.benchmarks.common import cpu

SHARE = 0.01
FACES = 9000
"""Coarser files are divided [Loop 1987] until they have so many."""
PER_TRIANGLE = 740
"""Bytes of a faceted file for each triangle (see `dsfab.export.cad.step.file`)."""


def from_file(name: str) -> Surface:
    V, _, _, F, _, _ = igl.readOBJ(str(Path(os.environ["DSFAB_MESHES"]) / f"{name}.obj"))
    if F.shape[1] == 4:
        F = np.concatenate([F[:, [0, 1, 2]], F[:, [0, 2, 3]]])
    V = V[:, :3]
    while len(F) < FACES:
        V, F = igl.loop(V, F)
    return Surface(V, F)


SURFACES: dict[str, Callable[[], Surface]] = {
    "dome": lambda: dome(edge=0.28),
    "cylinder": lambda: barrel_vault(edge=0.2),
    "sphere": lambda: sphere(edge=0.13),
    "torus": lambda: torus(edge=0.22),
    "hypar": lambda: hypar(edge=0.2),
    "bob": lambda: from_file("bob"),
    "roof_with_opening": lambda: from_file("roof_with_opening"),
    "canopy": lambda: from_file("canopy_quad"),
}


@cache
def surface_of(name: str) -> tuple[Surface, np.ndarray]:
    """A surface and its first modes (n, 12)."""
    surface = SURFACES[name]()
    stiffness = -igl.cotmatrix(surface.V, surface.F)
    mass = igl.massmatrix(surface.V, surface.F, igl.MASSMATRIX_TYPE_VORONOI)
    U = eigsh(stiffness, 12, mass, sigma=-1e-6, v0=np.ones(surface.n))[1]
    return surface, np.asarray(U / np.abs(U).max(axis=0))


def patterned(name: str, number: int) -> tuple[Part, int, float]:
    """A part with random stripes, its number of triangles, and the thickness in millimetres."""
    surface, U = surface_of(name)
    thickness, rng = SHARE * surface.size / 2, np.random.default_rng(number)
    scale, which, width = rng.uniform(1.5, 4, 2), rng.choice(np.arange(1, 9), 2, replace=False), rng.uniform(0.15, 0.3)
    fields = [a * U[:, k] + 0.013 for a, k in zip(scale, which, strict=True)]
    steps = [np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2) for z in fields]
    levels = [np.sort(np.concatenate([x - width, x + width])) for x in steps]
    sheet = resolve_pinches(cut(surface, fields, levels), thickness / 2).sheet.subset()
    D = sheet.carry_corners(offsets(surface, thickness).at_corners(surface.F), surface.F)
    solid = thicken(sheet.surface, D)
    smooth = replace(part_of(solid, "part", 10**6), step="smooth")
    part = replace(strategies.prepare(smooth), curved=partial(curved_sheet, surface, sheet, thickness))
    return part, len(solid.F), thickness


def measured(name: str, number: int) -> dict[str, Any]:
    """A line of the file."""
    line: dict[str, Any] = {"surface": name, "pattern": number}
    try:
        part, triangles, thickness = patterned(name, number)
    except DsfabError as error:
        return line | {"no_solid": str(error)}
    start = cpu()
    try:
        file = smooth_file(part)
    except DsfabError as error:
        return line | {"smooth": 0, "pieces": len(step.solids_of(part)[1]), "why": str(error), "cpu": cpu() - start}
    t = 1000 * thickness
    return line | {
        "smooth": file.smooth,
        "pieces": file.pieces,
        "why": file.refused,
        "faces": file.faces,
        "triangles": triangles,
        "ratio": PER_TRIANGLE * triangles / len(file.text),
        "distance": max(file.there, file.back) / t,
        "chord": file.limits.usual_chord / t,
        "gap": file.gap / t,
        "volume": file.volume / part.volume - 1,
        "cpu": cpu() - start,
    }


def table(lines: list[dict[str, Any]]) -> str:
    """The table of all patterns in the file."""
    rows = ["surface              patterns  pieces smooth    share  faces  size 1/  dist/t  gap/t  CPU s  refusals"]
    for name in SURFACES:
        some = [line for line in lines if line["surface"] == name and "pieces" in line]
        if not some:
            continue
        smooth, pieces = (sum(line[key] for line in some) for key in ("smooth", "pieces"))
        good = [line for line in some if line["smooth"]]
        middle = {k: float(np.median([line[k] for line in good] or [0])) for k in ("faces", "ratio", "cpu")}
        most = {k: max((line[k] for line in good), default=0.0) for k in ("distance", "gap")}
        why = Counter(" ".join(line["why"].split()[:5]) for line in some if line["why"])
        rows.append(
            f"{name:20} {len(some):8} {smooth:7} of {pieces:4} {smooth / max(pieces, 1):7.1%} {middle['faces']:6.0f} "
            f"{middle['ratio']:8.1f} {most['distance']:7.3f} {most['gap']:6.3f} {middle['cpu']:6.1f}  "
            + ", ".join(f"{text} ({k})" for text, k in why.most_common(3))
        )
    return "\n".join(rows)


def main(path: str, patterns: str = "60", names: str = ",".join(SURFACES)) -> None:
    file = Path(path)
    lines = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {(line["surface"], line["pattern"]) for line in lines}
    for number in range(int(patterns)):
        for name in names.split(","):
            if (name, number) not in done:
                lines.append(measured(name, number))
                with file.open("a") as more:
                    more.write(json.dumps(lines[-1]) + "\n")
    print(table(lines))


if __name__ == "__main__":
    main(*sys.argv[1:])
