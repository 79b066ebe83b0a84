"""Buckling of a cylinder under axial load."""

from dataclasses import replace

import numpy as np

from dsfab.statics import Elements, Material, SheetModel, SpreadLoad, buckling, solve_statics
from dsfab.surface import LoadCase, Surface
from dsfab.verification.problems import Mesh, Problem, Test, edges_on, held_directions, is_at, lines_on, square

WALL, THICKNESS = Material(young=1e7, poisson=0.3), 0.02  # Material and thickness of the tube, whose radius is 1.
CLASSICAL = 1 / np.sqrt(
    3 * (1 - WALL.poisson**2)
)  # Buckling load N R / (E t^2) of a cylinder, .605 for nu = .3 [Lorenz 1908].

WAVE = np.pi * np.sqrt(THICKNESS) / (12 * (1 - WALL.poisson**2)) ** 0.25
"""Half wavelength of the buckling rings of a tube of radius 1, and the length of the tube.
In so short a tube the lowest modes are rings; modes with waves around the tube have loads within 1 %. A longer
tube buckles like a chessboard with few waves around. There the theory of shallow shells gives .605, too, which is 4 %
too high for six waves. A tube of three half waves converges to .952 of .605 here, and its rings to .991."""


def axial_cylinder(cells: int, mesh: Mesh) -> Problem:
    """Return a quarter of a tube pressed along its axis, on simple supports at its ends; the value is N R / (E t^2).
    Before buckling the ends can widen, so that the stress is uniform; for the buckling modes they keep their radius."""
    uv, F = square(cells, 2 * max(1, round(cells * WAVE / np.pi)), mesh)
    turn = np.pi / 2 * uv[:, 0]
    surface = Surface(np.stack([np.cos(turn), np.sin(turn), WAVE * uv[:, 1]], axis=1), F)
    start, end, low, high = is_at(uv[:, 0], 0.0), is_at(uv[:, 0], 1.0), is_at(uv[:, 1], 0.0), is_at(uv[:, 1], 1.0)
    edge = lines_on(surface, edges_on(surface, low), (0.0, 0.0, 1.0))
    edge = edge + lines_on(surface, edges_on(surface, high), (0.0, 0.0, -1.0))
    spread, clamped = SpreadLoad.broadcast(surface, edge=edge), edges_on(surface, start, end)
    sides = ((start, "y"), (end, "x"), (start & low, "z"))
    fixed = held_directions(surface.n, *sides, (low | high, "xy"))
    still = np.zeros((surface.n, 3))
    problem = Problem(surface, WALL, THICKNESS, fixed, still, spread, clamped, lambda answer: np.nan)

    def modes(elements: Elements) -> float:
        sheet = SheetModel(surface, WALL, THICKNESS, clamped=clamped)
        load = LoadCase(held_directions(surface.n, *sides), problem.load.force, low, clamped=clamped)
        answer = solve_statics(sheet, load, elements, spread)
        round_ends = replace(load, fixed=fixed)
        return float(buckling(sheet, round_ends, answer, 1, elements=elements).factor[0]) / (WALL.young * THICKNESS**2)

    return replace(problem, modes=modes)


TESTS = [
    Test(
        "axial_cylinder",
        float(CLASSICAL),
        "classical theory, 1 / sqrt(3 (1 - nu^2)); quarter of a tube half a wave long",
        "tube pressed along its axis: the load at which it buckles",
        axial_cylinder,
        cells=(16, 32, 64),
        quantity="buckling",
    )
]
