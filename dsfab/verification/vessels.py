"""Vessels under pressure, with answers in closed form."""

from collections.abc import Callable

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.statics import Equilibrium, Material, SpreadLoad
from dsfab.surface import Surface
from dsfab.verification.problems import Mesh, Problem, Test, held_directions, is_at, octasphere, square

VESSEL, WALL, PRESSURE = Material(210e9, 0.3), 0.01, 1e5  # Vessels of radius 1 m, 10 mm thick, under 1 bar.


def pressurised_sphere(cells: int, mesh: Mesh) -> Problem:
    """Return a closed sphere. Its poles on the three axes cannot move sideways; these supports have no reactions."""
    V, F = octasphere(cells)
    surface = Surface(V, F)
    poles = [(np.abs(V[:, axis]) > 1 - 1e-12, "xyz".replace("xyz"[axis], "")) for axis in range(3)]
    return Problem(
        surface,
        VESSEL,
        WALL,
        fixed=held_directions(surface.n, *poles),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.broadcast(surface, face=PRESSURE * surface.normals),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=_swelling(V),
    )


def pressurised_cylinder(cells: int, mesh: Mesh) -> Problem:
    """Return a tube 2 m long with free ends; supports at four vertices of one end prevent only rigid motions."""
    uv, F = square(cells, cells // 2, mesh)
    # the last line of vertices is the first line, because the tube is closed around
    F = np.where(cells * (cells // 2 + 1) <= F, F - cells * (cells // 2 + 1), F)
    uv = uv[uv[:, 0] < 1 - 1e-9]
    turn = 2 * np.pi * uv[:, 0]
    out = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    surface = Surface(out + uv[:, 1, None] * np.array([0.0, 0.0, 2.0]), F)
    end = is_at(uv[:, 1], 0.0)
    x_axis, y_axis = end & (np.abs(out[:, 1]) < 1e-9), end & (np.abs(out[:, 0]) < 1e-9)
    return Problem(
        surface,
        VESSEL,
        WALL,
        fixed=held_directions(surface.n, (x_axis, "yz"), (y_axis, "xz")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.broadcast(surface, face=PRESSURE * surface.normals),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=_swelling(out),
    )


def _swelling(out: Floats) -> Callable[[Equilibrium], float]:
    def value(answer: Equilibrium) -> float:
        return float(np.einsum("ni,ni->n", answer.u, out).mean())

    return value


TESTS = [
    Test(
        "pressurised_sphere",
        PRESSURE * (1 - VESSEL.poisson) / (2 * VESSEL.young * WALL),
        "closed form, p R^2 (1 - nu) / (2 E h); whole sphere",
        "closed sphere under inner pressure: how far it swells",
        pressurised_sphere,
        (4, 8, 16),
        ("diagonal",),
    ),
    Test(
        "pressurised_cylinder",
        PRESSURE / (VESSEL.young * WALL),
        "closed form, p R^2 / (E h); whole tube",
        "open tube under inner pressure: how far it swells",
        pressurised_cylinder,
        (16, 32, 64),
    ),
]
