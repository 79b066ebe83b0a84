"""Curved sheets: the shell obstacle course [Belytschko et al. 1985], and vessels under pressure in closed form."""

from collections.abc import Callable

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.statics import Equilibrium, Material, SpreadLoad
from dsfab.study.verification.problem import (
    MESHES,
    Mesh,
    Problem,
    Test,
    at,
    edges_on,
    held,
    mean_move,
    point_force,
    square,
)
from dsfab.surface import Surface


def scordelis_lo(cells: int, mesh: Mesh) -> Problem:
    """The whole roof: radius 25, length 50, 80 degrees, 0.25 thick, 90 per area, on diaphragms at both curved ends."""
    uv, F = square(cells, cells, mesh)
    turn = np.radians(80) * (uv[:, 0] - 0.5)
    surface = Surface(np.stack([25 * np.sin(turn), 50 * uv[:, 1], 25 * np.cos(turn)], axis=1), F)
    ends = at(uv[:, 1], 0.0) | at(uv[:, 1], 1.0)
    crown = at(uv[:, 1], 0.0) & at(uv[:, 0], 0.5)  # one vertex held lengthwise: it carries nothing
    return Problem(
        surface,
        Material(4.32e8, 0.0),
        0.25,
        fixed=held(surface.n, (ends, "xz"), (crown, "y")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, face=(0.0, 0.0, -90.0)),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=mean_move(at(uv[:, 0], 0.0) & at(uv[:, 1], 0.5), (0.0, 0.0, -1.0)),
    )


def holed_hemisphere(cells: int, mesh: Mesh) -> Problem:
    """A quarter of a hemisphere with a hole of 18 degrees: radius 10, 0.04 thick, forces of 2 in and out at the rim.

    A force of 1 on each of the quarter's two corners is half of what the hemisphere carries there.
    """
    uv, F = square(cells, cells, mesh)
    turn, polar = np.pi / 2 * uv[:, 0], np.radians(18 + 72 * uv[:, 1])
    V = 10 * np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    surface = Surface(V, F)
    start, end, rim = at(uv[:, 0], 0.0), at(uv[:, 0], 1.0), at(uv[:, 1], 1.0)
    return Problem(
        surface,
        Material(6.825e7, 0.3),
        0.04,
        fixed=held(surface.n, (start, "y"), (end, "x"), (start & rim, "z")),
        force=point_force(surface.n, (start & rim, (1.0, 0.0, 0.0)), (end & rim, (0.0, -1.0, 0.0))),
        spread=SpreadLoad.on(surface),
        clamped=edges_on(surface, start, end),
        value=mean_move(start & rim, (1.0, 0.0, 0.0)),
    )


def pinched_cylinder(cells: int, mesh: Mesh) -> Problem:
    """An eighth of a cylinder between diaphragms: radius 300, length 600, 3 thick, two opposite unit forces.

    The eighth carries a quarter of one force.
    """
    uv, F = square(cells, cells, mesh)
    turn = np.pi / 2 * uv[:, 0]
    surface = Surface(np.stack([300 * np.cos(turn), 300 * uv[:, 1], 300 * np.sin(turn)], axis=1), F)
    side, top, middle, end = at(uv[:, 0], 0.0), at(uv[:, 0], 1.0), at(uv[:, 1], 0.0), at(uv[:, 1], 1.0)
    return Problem(
        surface,
        Material(3e6, 0.3),
        3.0,
        fixed=held(surface.n, (side, "z"), (top, "x"), (middle, "y"), (end, "xz")),
        force=point_force(surface.n, (top & middle, (0.0, 0.0, -0.25))),
        spread=SpreadLoad.on(surface),
        clamped=edges_on(surface, side, top, middle),
        value=mean_move(top & middle, (0.0, 0.0, -1.0)),
    )


VESSEL, WALL, PRESSURE = Material(210e9, 0.3), 0.01, 1e5
"""Vessels of radius 1 m, 10 mm thick, under 1 bar."""


def pressurised_sphere(cells: int, mesh: Mesh) -> Problem:
    """A whole closed sphere; each pole of the three axes is held across its axis, which carries nothing."""
    V, F = octasphere(cells)
    surface = Surface(V, F)
    poles = [(np.abs(V[:, axis]) > 1 - 1e-12, "xyz".replace("xyz"[axis], "")) for axis in range(3)]
    return Problem(
        surface,
        VESSEL,
        WALL,
        fixed=held(surface.n, *poles),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, face=PRESSURE * surface.normals),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=_swelling(V),
    )


def pressurised_cylinder(cells: int, mesh: Mesh) -> Problem:
    """A whole tube with free ends, 2 m long; four vertices of one end are held against rigid motions only."""
    uv, F = square(cells, cells // 2, mesh)
    # glue the first and the last line
    F = np.where(cells * (cells // 2 + 1) <= F, F - cells * (cells // 2 + 1), F)
    uv = uv[uv[:, 0] < 1 - 1e-9]
    turn = 2 * np.pi * uv[:, 0]
    out = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    surface = Surface(out + uv[:, 1, None] * np.array([0.0, 0.0, 2.0]), F)
    end = at(uv[:, 1], 0.0)
    x_axis, y_axis = end & (np.abs(out[:, 1]) < 1e-9), end & (np.abs(out[:, 0]) < 1e-9)
    return Problem(
        surface,
        VESSEL,
        WALL,
        fixed=held(surface.n, (x_axis, "yz"), (y_axis, "xz")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, face=PRESSURE * surface.normals),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=_swelling(out),
    )


def octasphere(cells: int) -> tuple[Floats, Ints]:
    """The unit sphere as an octahedron whose edges are cut into `cells`; normals point outwards."""
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    inside = i + j <= cells
    number = np.full((cells + 1, cells + 1), -1)
    number[inside] = np.arange(inside.sum())
    b = np.stack([cells - i - j, i, j], axis=-1)[inside]
    up, down = i + j < cells, i + j < cells - 1
    a = np.stack(np.nonzero(up), axis=1)
    d = np.stack(np.nonzero(down), axis=1)
    faces = np.concatenate(
        [
            np.stack([number[a[:, 0], a[:, 1]], number[a[:, 0] + 1, a[:, 1]], number[a[:, 0], a[:, 1] + 1]], axis=1),
            np.stack(
                [number[d[:, 0] + 1, d[:, 1]], number[d[:, 0] + 1, d[:, 1] + 1], number[d[:, 0], d[:, 1] + 1]], axis=1
            ),
        ]
    )
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    points = (b[None] * signs[:, None]).reshape(-1, 3)
    F = np.concatenate([(faces if s.prod() > 0 else faces[:, ::-1]) + k * len(b) for k, s in enumerate(signs)])
    unique, of = np.unique(points, axis=0, return_inverse=True)
    # equal angles along the octahedron's edges: all triangles stay of similar size
    bent = np.sign(unique) * np.sin(np.pi / 2 * np.abs(unique) / cells)
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), of.reshape(-1)[F]


def _swelling(out: Floats) -> Callable[[Equilibrium], float]:
    """The value: mean displacement along the unit vectors `out` (n, 3)."""

    def value(answer: Equilibrium) -> float:
        return float(np.einsum("ni,ni->n", answer.u, out).mean())

    return value


TESTS = [
    Test(
        "scordelis_lo", 0.3024, "MacNeal and Harder 1985 (0.3006 deep shell); whole roof", scordelis_lo, meshes=MESHES
    ),
    Test(
        "holed_hemisphere",
        0.0940,
        "MacNeal and Harder 1985, 18 degree hole (flat triangles converge to 0.0935); quarter, half of each force",
        holed_hemisphere,
    ),
    Test(
        "pinched_cylinder",
        1.8248e-5,
        "Belytschko et al. 1985; eighth, a quarter of the force",
        pinched_cylinder,
        (16, 32, 64),
    ),
    Test(
        "pressurised_sphere",
        PRESSURE * (1 - VESSEL.poisson) / (2 * VESSEL.young * WALL),
        "closed form, p R^2 (1 - nu) / (2 E h); whole sphere",
        pressurised_sphere,
        cells=(4, 8, 16),
        meshes=("diagonal",),
    ),
    Test(
        "pressurised_cylinder",
        PRESSURE / (VESSEL.young * WALL),
        "closed form, p R^2 / (E h); whole tube",
        pressurised_cylinder,
        cells=(16, 32, 64),
    ),
]
