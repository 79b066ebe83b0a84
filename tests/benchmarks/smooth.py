"""How many pieces of random patterns become smooth STEP solids, and what that costs.

    DSFAB_MESHES=... python tests/benchmarks/smooth.py dome [patterns] [seconds]

Names: dome, barrel_vault, hypar, or an OBJ file of `DSFAB_MESHES` without its suffix. Two of the surface's own modes
are cut at random; a hundredth of the half diagonal is the thickness. A row for each pattern: pieces accepted and
made, faces, size against one face per triangle, widest gap, volume, CPU seconds. The sum is the last row.
"""

import os
import resource
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import igl
import numpy as np
from scipy.sparse.linalg import eigsh

from dsfab.errors import DsfabError
from dsfab.export import step
from dsfab.export.part import Part, part_of
from dsfab.export.smooth.make import made
from dsfab.slicing import cut, resolve_pinches
from dsfab.study.curved import curved_sheet
from dsfab.surface import Surface
from dsfab.surface.shapes.roofs import barrel_vault, hypar
from dsfab.surface.shapes.turned import dome
from dsfab.thickening import offsets, thicken

SHAPES = {"dome": dome, "barrel_vault": barrel_vault, "hypar": hypar}
SHARE = 0.01
PER_TRIANGLE = 740
"""Bytes of a faceted file for each triangle (see `dsfab.export.step`)."""


def surface_of(name: str) -> Surface:
    if name in SHAPES:
        return SHAPES[name](edge=0.35)
    V, _, _, F, _, _ = igl.readOBJ(str(Path(os.environ["DSFAB_MESHES"]) / f"{name}.obj"))
    if F.shape[1] == 4:
        F = np.concatenate([F[:, [0, 1, 2]], F[:, [0, 2, 3]]])
    return Surface(V[:, :3], F)


def modes(surface: Surface) -> np.ndarray:
    stiffness = -igl.cotmatrix(surface.V, surface.F)
    mass = igl.massmatrix(surface.V, surface.F, igl.MASSMATRIX_TYPE_VORONOI)
    U = eigsh(stiffness, 12, mass, sigma=-1e-6)[1]
    return np.asarray(U / np.abs(U).max(axis=0))


def patterned(surface: Surface, U: np.ndarray, thickness: float, rng: np.random.Generator) -> tuple[Part, int]:
    """A part with random stripes, and its number of triangles."""
    scale, which, width = rng.uniform(1.5, 4, 2), rng.choice(np.arange(1, 9), 2, replace=False), rng.uniform(0.15, 0.3)
    fields = [a * U[:, k] + 0.013 for a, k in zip(scale, which, strict=True)]
    steps = [np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2) for z in fields]
    levels = [np.sort(np.concatenate([x - width, x + width])) for x in steps]
    sheet = resolve_pinches(cut(surface, fields, levels), thickness / 2).sheet.kept()
    D = sheet.carry_corners(offsets(surface, thickness).at_corners(surface.F), surface.F)
    solid = thicken(sheet.surface, D)
    part = step.prepare(part_of(solid, "part", 10**6))
    return replace(part, step="smooth", curved=partial(curved_sheet, surface, sheet, thickness)), len(solid.F)


def cpu() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def main(name: str, patterns: int = 60, seconds: float = 600) -> None:
    surface = surface_of(name)
    thickness, U, rng = SHARE * surface.size / 2, modes(surface), np.random.default_rng(1)
    smooth = pieces = 0
    begin = time.monotonic()
    for i in range(patterns):
        if time.monotonic() - begin > seconds:
            break
        try:
            part, triangles = patterned(surface, U, thickness, rng)
        except DsfabError as error:
            print(f"{i:3} no solid: {error}")
            continue
        start = cpu()
        try:
            file = made(part)
        except DsfabError as error:
            pieces += 1
            print(f"{i:3} refused: {error}")
            continue
        smooth, pieces = smooth + file.smooth, pieces + file.pieces
        ratio = PER_TRIANGLE * triangles / len(file.text)
        print(
            f"{i:3} {file.smooth}/{file.pieces} {file.faces} faces of {triangles} triangles, "
            f"{len(file.text) / 1e6:.2f} MB (1/{ratio:.1f}), gap {file.gap / thickness / 1000:.4f} t, "
            f"volume {file.volume / part.volume - 1:+.1e}, {cpu() - start:.1f} s {file.refused}",
            flush=True,
        )
    print(f"{name}: {smooth} of {pieces} pieces")


if __name__ == "__main__":
    main(sys.argv[1], *(int(x) for x in sys.argv[2:]))
