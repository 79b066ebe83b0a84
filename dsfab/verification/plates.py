"""Plates: deflection and stress under a load normal to their plane, vibration, and buckling."""

from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.statics import (
    Elements,
    Equilibrium,
    Material,
    SheetModel,
    buckling,
    frequencies,
    sheet_stress,
    solve_statics,
)
from dsfab.surface import Surface
from dsfab.verification.problems import (
    MESHES,
    Mesh,
    Problem,
    Test,
    edges_on,
    held_directions,
    is_at,
    lines_on,
    mean_move,
    square,
)

PLATE = Material(young=1e7, poisson=0.3)
HEAVY = replace(PLATE, density=1000.0)
THIN = 0.01  # Thickness divided by the side of the plate.
ACROSS = (0.0, 0.0, 1.0)  # Load normal to the plane of a plate, Pa.


def plate(cells: int, mesh: Mesh, clamped: bool) -> Problem:
    """Return a square plate under a uniform load. Value: deflection of its centre times D / (q a^4).
    D: bending stiffness, q: load, a: side. clamped : false for simply supported edges."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)
    sides = [is_at(uv[:, axis], end) for axis in (0, 1) for end in (0.0, 1.0)]
    rim = np.logical_or.reduce(sides)
    centre = np.arange(surface.n) == np.abs(uv - 0.5).max(axis=1).argmin()
    sag = mean_move(centre, (0.0, 0.0, PLATE.bending_stiffness(THIN)))
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "xy"), (rim, "z"))
    return Problem(surface, PLATE, THIN, fixed, sag, face=ACROSS, clamped=edges_on(surface, *sides) & clamped)


SKEWED = Material(young=1085.0, poisson=0.31)


def skew_plate(cells: int, mesh: Mesh) -> Problem:
    """Return a rhombus with an angle of 60 degrees, simply supported on two opposite sides.
    The value is 100 D / (q a^4) times the deflection of its centre; stiffness D, load q, side a."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(100 * np.stack([uv[:, 0] + uv[:, 1] / 2, np.sqrt(3) / 2 * uv[:, 1], 0 * uv[:, 0]], axis=1), F)
    ends = is_at(uv[:, 1], 0.0) | is_at(uv[:, 1], 1.0)
    centre = np.arange(surface.n) == np.abs(uv - 0.5).max(axis=1).argmin()
    sag = mean_move(centre, (0.0, 0.0, 100 * SKEWED.bending_stiffness(0.1) / 100**4))
    fixed = held_directions(surface.n, (np.ones(surface.n, dtype=bool), "xy"), (ends, "z"))
    return Problem(surface, SKEWED, 0.1, fixed, sag, face=ACROSS)


def stressed_plate(cells: int, mesh: Mesh) -> Problem:
    """Return a simply supported plate. Value: largest stress at centre / (q (a/h)^2); load q, side a, thickness h."""
    problem = plate(cells, mesh, clamped=False)
    surface = problem.surface
    centre = np.abs(surface.V[:, :2] - 0.5).max(axis=1).argmin()

    def value(answer: Equilibrium) -> float:
        stress = sheet_stress(SheetModel(surface, PLATE, THIN), answer.elements, answer)
        top = stress.tensor("top")[(centre == surface.F).any(axis=1)]
        return float(np.abs(np.linalg.eigvalsh(top.mean(axis=0))).max()) * THIN**2

    return replace(problem, value=value)


def shaken_plate(cells: int, mesh: Mesh) -> Problem:
    """Return the simply supported square plate in free vibration. Value: lowest omega a^2 sqrt(rho h / D).
    omega: angular frequency, a: side, rho: density, h: thickness, D: bending stiffness."""
    problem = plate(cells, mesh, clamped=False)
    scale = 2 * np.pi * np.sqrt(HEAVY.density * THIN / HEAVY.bending_stiffness(THIN))

    def modes(elements: Elements) -> float:
        result = frequencies(SheetModel(problem.surface, HEAVY, THIN), problem.fixed, 1, elements=elements)
        return float(scale * result.hertz[0])

    return replace(problem, modes=modes)


def pressed_plate(cells: int, mesh: Mesh) -> Problem:
    """Return a simply supported square plate, pressed along x. Value: N a^2 / D at buckling.
    N: force per length, a: side, D: bending stiffness."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)
    ends = [is_at(uv[:, 0], end) for end in (0.0, 1.0)]
    rim = np.logical_or.reduce([*ends, is_at(uv[:, 1], 0.0), is_at(uv[:, 1], 1.0)])
    corner = ends[0] & is_at(uv[:, 1], 0.0)
    edge = lines_on(edges_on(surface, ends[0]), (1.0, 0.0, 0.0))
    edge = edge + lines_on(edges_on(surface, ends[1]), (-1.0, 0.0, 0.0))
    fixed = held_directions(surface.n, (rim, "z"), (corner, "xy"), (ends[1] & is_at(uv[:, 1], 0.0), "y"))
    problem = Problem(surface, PLATE, THIN, fixed, edge=edge)

    def modes(elements: Elements) -> float:
        sheet = SheetModel(surface, PLATE, THIN)
        answer = solve_statics(sheet, problem.load, Elements(elements.membrane, "hinge"), problem.spread)
        result = buckling(sheet, problem.load, answer, 1, elements=elements)
        return float(result.factor[0]) / PLATE.bending_stiffness(THIN)

    return replace(problem, modes=modes)


def _moment() -> float:
    """Return the moment M / (q a^2) at the centre of a simply supported square plate [Timoshenko 1959, 30]."""
    odd = np.arange(1, 400, 2)
    m, n = np.meshgrid(odd, odd, indexing="ij")
    sign = np.where((m + n) % 4 == 2, 1.0, -1.0)  # the sign is sin(m pi / 2) sin(n pi / 2)
    return float((sign * 16 / np.pi**4 * (m**2 + PLATE.poisson * n**2) / (m * n * (m**2 + n**2) ** 2)).sum())


SERIES = "Timoshenko and Woinowsky-Krieger 1959, series solution; model: the whole plate"
square_plate = partial(Test, cells=(4, 8, 16), meshes=MESHES)

TESTS = [
    square_plate(
        "plate_supported",
        0.00406235,
        SERIES,
        "square plate on simple supports under a uniform load: sag of the centre",
        partial(plate, clamped=False),
        targets={8: 0.005},
    ),
    square_plate(
        "plate_clamped",
        0.00126532,
        SERIES,
        "square plate clamped all round under a uniform load: sag of the centre",
        partial(plate, clamped=True),
        targets={8: 0.005},
    ),
    Test(
        "skew_plate",
        0.7945,
        "Razzaque 1973, finite differences (the value is quoted from memory); model: the whole plate",
        "rhombic plate of 60 degrees on two simple supports under a uniform load: sag of its centre",
        skew_plate,
        cells=(4, 8, 16, 32),
        meshes=MESHES,
        targets={16: 0.005},
    ),
    square_plate(
        "plate_stress",
        6 * _moment(),
        "Navier 1820, series; whole plate",
        "square plate on simple supports under a uniform load: stress at its centre",
        stressed_plate,
        quantity="stress",
    ),
    square_plate(
        "plate_frequency",
        2 * np.pi**2,
        "closed form of the frequency, 2 pi^2; model: the whole plate",
        "square plate on simple supports: its lowest frequency",
        shaken_plate,
        quantity="frequency",
    ),
    square_plate(
        "plate_buckling",
        4 * np.pi**2,
        "Bryan 1891, closed form, 4 pi^2; model: the whole plate",
        "square plate on simple supports, pressed from two sides: the load at which it buckles",
        pressed_plate,
        quantity="buckling",
    ),
]
