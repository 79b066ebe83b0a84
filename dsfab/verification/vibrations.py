"""Vibrations of a plate and a membrane built in at one side [NAFEMS], and buckling of a cylinder."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.core.arrays import Bools
from dsfab.statics import Elements, Material, SheetModel, buckling, frequencies, solve_statics
from dsfab.surface import LoadCase, Surface
from dsfab.verification.problems import MESHES, Mesh, Problem, Test, edges_on, held_directions, is_at, lines_on, square

STEEL = Material(200e9, 0.3, 8000.0)
THICKNESS = 0.05  # Metres, of all vibrating plates.

PLATE_HERTZ = (0.421, 1.029, 2.582, 3.306, 3.753, 6.555)
"""Frequencies of FV16 [Abbassian, Dawswell and Knowles 1987, Selected benchmarks for natural frequency analysis,
NAFEMS R0015], as Altair OptiStruct's verification problem OS-V 0430 lists them.
The source is a Ritz method with few terms [Barton 1951]; elements converge to values .5 to 1 % lower."""

MEMBRANE_HERTZ = (44.623, 130.03, 162.70, 246.05, 379.90, 391.44)
"""Frequencies of FV32 [NAFEMS R0015], as ENERCALC 3D's verification problem F-03 lists them."""


def cantilevered_plate(cells: int, mesh: Mesh, mode: int) -> Problem:
    """Return the NAFEMS test FV16: a plate 10 m square, 50 mm thick, clamped along x = 0.
    The problem's value is the frequency of a bending mode, hertz. mode : number of the mode, from 1 on."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(10 * uv, ((0, 0), (0, 1))), F)
    root = is_at(uv[:, 0], 0.0)
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "xy"), (root, "z"))
    return vibrating(surface, fixed, edges_on(surface, root), mode)


def tapered_membrane(cells: int, mesh: Mesh, mode: int) -> Problem:
    """Return the NAFEMS test FV32: a sheet 10 m long, 5 m to 1 m high, 50 mm thick, built in at its high end.
    The problem's value is the frequency of a mode in the sheet's plane, hertz."""
    uv, F = square(2 * cells, cells, mesh)
    high = 5 - 4 * uv[:, 0]
    surface = Surface(np.stack([10 * uv[:, 0], high * (uv[:, 1] - 0.5), 0 * high], axis=1), F)
    root = is_at(uv[:, 0], 0.0)
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "z"), (root, "xy"))
    return vibrating(surface, fixed, edges_on(surface, root), mode)


def vibrating(surface: Surface, fixed: Bools, clamped: Bools, mode: int) -> Problem:
    """Return a sheet in free vibration. The problem's value is the frequency (Hz) of mode number `mode`, from 1 on."""
    sheet = SheetModel(surface, STEEL, THICKNESS, clamped=clamped)

    def modes(elements: Elements) -> float:
        return float(frequencies(sheet, fixed, mode, elements=elements).hertz[mode - 1])

    return Problem(surface, STEEL, THICKNESS, fixed, clamped=clamped, modes=modes)


TUBE, TUBE_WALL = Material(young=1e7, poisson=0.3), 0.02  # Material and thickness of the tube, whose radius is 1.
CLASSICAL = 1 / np.sqrt(3 * (1 - TUBE.poisson**2))
"""Buckling load N R / (E t^2) of a cylinder, .605 for nu = .3 [Lorenz 1908]."""
WAVE = np.pi * np.sqrt(TUBE_WALL) / (12 * (1 - TUBE.poisson**2)) ** 0.25
"""Half wavelength of the buckling rings of a tube of radius 1. The tube has this length, so its lowest modes are rings.
Longer tubes buckle with few waves around the circumference; shallow-shell theory overestimates these loads by 4 %."""


def axial_cylinder(cells: int, mesh: Mesh) -> Problem:
    """Return a quarter tube pressed along its axis. Value: load N R / (E t^2) at buckling; N: force per length."""
    uv, F = square(cells, 2 * max(1, round(cells * WAVE / np.pi)), mesh)
    turn = np.pi / 2 * uv[:, 0]
    surface = Surface(np.stack([np.cos(turn), np.sin(turn), WAVE * uv[:, 1]], axis=1), F)
    start, end, low, high = is_at(uv[:, 0], 0.0), is_at(uv[:, 0], 1.0), is_at(uv[:, 1], 0.0), is_at(uv[:, 1], 1.0)
    edge = lines_on(edges_on(surface, low), (0.0, 0.0, 1.0))
    edge = edge + lines_on(edges_on(surface, high), (0.0, 0.0, -1.0))
    sides, clamped = ((start, "y"), (end, "x"), (start & low, "z")), edges_on(surface, start, end)
    fixed = held_directions(surface.n, *sides, (low | high, "xy"))
    problem = Problem(surface, TUBE, TUBE_WALL, fixed, edge=edge, clamped=clamped)

    def modes(elements: Elements) -> float:
        sheet = SheetModel(surface, TUBE, TUBE_WALL, clamped=clamped)
        load = LoadCase(held_directions(surface.n, *sides), problem.load.force, low, clamped=clamped)
        answer = solve_statics(sheet, load, elements, problem.spread)
        round_ends = replace(load, fixed=fixed)
        return float(buckling(sheet, round_ends, answer, 1, elements=elements).factor[0]) / (TUBE.young * TUBE_WALL**2)

    return replace(problem, modes=modes)


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
        "thin square plate clamped at one side",
        cantilevered_plate,
    ),
    *_tests(
        "tapered_membrane",
        MEMBRANE_HERTZ,
        "NAFEMS FV32, 1987; whole membrane",
        "tapered sheet clamped at its high end, vibrating in its plane",
        tapered_membrane,
    ),
    Test(
        "axial_cylinder",
        float(CLASSICAL),
        "classical theory, 1 / sqrt(3 (1 - nu^2)); model: 1/4 of a tube; the tube is half of a buckling wave long",
        "tube pressed along its axis: the load at which it buckles",
        axial_cylinder,
        cells=(16, 32, 64),
        quantity="buckling",
    ),
]
