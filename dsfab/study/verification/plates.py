"""Plates bent by a load across them."""

from functools import partial

import numpy as np

from dsfab.statics import Material, SpreadLoad
from dsfab.study.verification.meshes import MESHES, Mesh, at, edges_on, square
from dsfab.study.verification.problem import Problem, Test, held
from dsfab.surface import Surface

PLATE = Material(young=1e7, poisson=0.3)
THIN = 0.01


def plate(cells: int, mesh: Mesh, clamped: bool) -> Problem:
    """A unit square under 1 Pa across; the value is the sag of its centre times D / (q a^4)."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)
    sides = [at(uv[:, axis], end) for axis in (0, 1) for end in (0.0, 1.0)]
    rim = np.logical_or.reduce(sides)
    centre = np.arange(surface.n) == np.abs(uv - 0.5).max(axis=1).argmin()
    stiffness = PLATE.bending_stiffness(THIN)
    return Problem(
        surface,
        PLATE,
        THIN,
        fixed=held(surface.n, (np.ones(surface.n, dtype=bool), "xy"), (rim, "z")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, face=(0.0, 0.0, 1.0)),
        clamped=edges_on(surface, *sides) & clamped,
        value=lambda answer: stiffness * float(answer.u[centre, 2][0]),
    )


SERIES = "Timoshenko and Woinowsky-Krieger 1959, series; whole plate"

TESTS = [
    Test(
        "plate_supported",
        0.00406235,
        SERIES,
        "square plate on simple supports under a uniform load: sag of the centre",
        partial(plate, clamped=False),
        cells=(4, 8, 16),
        meshes=MESHES,
        targets={8: 0.005},
    ),
    Test(
        "plate_clamped",
        0.00126532,
        SERIES,
        "square plate clamped all round under a uniform load: sag of the centre",
        partial(plate, clamped=True),
        cells=(4, 8, 16),
        meshes=MESHES,
        targets={8: 0.005},
    ),
]
