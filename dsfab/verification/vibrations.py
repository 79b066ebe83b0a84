"""Free vibrations of NAFEMS: a plate across its plane and a membrane in its plane, both built in at one side."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.statics import Elements, Material, SheetModel, SpreadLoad, frequencies
from dsfab.surface import Surface
from dsfab.verification.problems import MESHES, Mesh, Problem, Test, edges_on, held_directions, is_at, square

STEEL = Material(200e9, 0.3, 8000.0)
THICKNESS = 0.05

PLATE_HERTZ = (0.421, 1.029, 2.582, 3.306, 3.753, 6.555)
"""Frequencies of FV16 [Abbassian, Dawswell and Knowles 1987, Selected benchmarks for natural frequency analysis, NAFEMS
R0015], as Altair OptiStruct's verification problem OS-V 0430 lists them. They are Barton's of 1951, by a Ritz method
with few terms. All pairs of elements converge to values .5 to 1 % lower, for example 3.471 instead of 3.494."""

MEMBRANE_HERTZ = (44.623, 130.03, 162.70, 246.05, 379.90, 391.44)
"""Frequencies of FV32 in the same report, as ENERCALC 3D's verification problem F-03 lists them."""


def cantilevered_plate(cells: int, mesh: Mesh, mode: int) -> Problem:
    """Return the frequency (Hz) of NAFEMS test FV16: a plate 10 m square and 50 mm thick, clamped along x = 0. The
    plate
    moves only perpendicular to its plane.
    """
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(10 * uv, ((0, 0), (0, 1))), F)
    root = is_at(uv[:, 0], 0.0)
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "xy"), (root, "z"))
    return vibrating(surface, fixed, edges_on(surface, root), mode)


def tapered_membrane(cells: int, mesh: Mesh, mode: int) -> Problem:
    """Return FV32: 10 m long, 5 m to 1 m high, 50 mm thick, built in at its high end, moving in its plane; in hertz."""
    uv, F = square(2 * cells, cells, mesh)
    high = 5 - 4 * uv[:, 0]
    surface = Surface(np.stack([10 * uv[:, 0], high * (uv[:, 1] - 0.5), 0 * high], axis=1), F)
    root = is_at(uv[:, 0], 0.0)
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "z"), (root, "xy"))
    return vibrating(surface, fixed, edges_on(surface, root), mode)


def vibrating(surface: Surface, fixed: Bools, clamped: Bools, mode: int) -> Problem:
    """Return a sheet in free vibration; the value is the frequency with number `mode`, from 1 on, in hertz."""
    sheet = SheetModel(surface, STEEL, THICKNESS, clamped=clamped)
    still: Floats = np.zeros((surface.n, 3))

    def modes(elements: Elements) -> float:
        return float(frequencies(sheet, fixed, mode, elements=elements).hertz[mode - 1])

    return Problem(
        surface, STEEL, THICKNESS, fixed, still, SpreadLoad.broadcast(surface), clamped, lambda answer: np.nan, modes
    )


def _tests(
    name: str, hertz: Sequence[float], source: str, words: str, problem: Callable[..., Problem]
) -> Iterator[Test]:
    for k, value in enumerate(hertz, start=1):
        yield Test(
            f"{name}_{k}",
            value,
            source,
            f"{words}: its frequency number {k}",
            partial(problem, mode=k),
            cells=(4, 8, 16),
            meshes=MESHES if k == 1 else ("union_jack",),
            quantity="frequency",
        )


TESTS = [
    *_tests(
        "cantilevered_plate",
        PLATE_HERTZ,
        "NAFEMS FV16, 1987; whole plate",
        "thin square plate built in at one side",
        cantilevered_plate,
    ),
    *_tests(
        "tapered_membrane",
        MEMBRANE_HERTZ,
        "NAFEMS FV32, 1987; whole membrane",
        "tapered sheet built in at its high end, moving in its plane",
        tapered_membrane,
    ),
]
