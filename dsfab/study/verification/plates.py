"""Flat sheets: bent plates, cantilevers, Cook's membrane, patches of constant stress."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.statics import Material, SpreadLoad
from dsfab.study.verification.problem import (
    MESHES,
    Mesh,
    Problem,
    Test,
    at,
    edges_on,
    held,
    lines_on,
    mean_move,
    square,
)
from dsfab.surface import Surface

PLATE = Material(young=1e7, poisson=0.3)
THIN = 0.01
IN_PLANE, ACROSS = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


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


def tip_loaded(
    uv: Floats,
    F: Ints,
    V: Floats,
    material: Material,
    thickness: float,
    force: tuple[float, float, float],
) -> Problem:
    """A strip built in where u = 0, with a force spread along its end u = 1; the value is how far that end moves."""
    surface = Surface(V, F)
    root, tip = at(uv[:, 0], 0.0), at(uv[:, 0], 1.0)
    end = edges_on(surface, tip)
    ends = surface.V[surface.edges.ends[end]]
    width = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    along = np.array(force)
    direction = along / np.linalg.norm(along)
    return Problem(
        surface,
        material,
        thickness,
        fixed=held(surface.n, (root, "xyz")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, edge=lines_on(surface, end, tuple(along / width))),
        clamped=edges_on(surface, root),
        value=mean_move(tip, tuple(direction)),
    )


def straight_beam(cells: int, mesh: Mesh, force: tuple[float, float, float]) -> Problem:
    """6 x 0.2 x 0.1, `cells` across the width and six times as many along it."""
    uv, F = square(6 * cells, cells, mesh)
    V = np.stack([6 * uv[:, 0], 0.2 * uv[:, 1], 0 * uv[:, 0]], axis=1)
    return tip_loaded(uv, F, V, Material(1e7, 0.3), 0.1, force)


def curved_beam(cells: int, mesh: Mesh, force: tuple[float, float, float]) -> Problem:
    """A quarter ring between the radii 4.12 and 4.32, 0.1 thick, built in at one end."""
    uv, F = square(8 * cells, cells, mesh)
    radius, turn = 4.12 + 0.2 * uv[:, 1], np.pi / 2 * (1 - uv[:, 0])
    V = np.stack([radius * np.sin(turn), radius * np.cos(turn), 0 * turn], axis=1)
    return tip_loaded(uv, F, V, Material(1e7, 0.25), 0.1, force)


def twisted_beam(cells: int, mesh: Mesh, force: tuple[float, float, float]) -> Problem:
    """12 x 1.1 x 0.32, twisted by a quarter turn from the root to the tip."""
    uv, F = square(11 * cells, cells, mesh)
    across, turn = 1.1 * (uv[:, 1] - 0.5), np.pi / 2 * uv[:, 0]
    V = np.stack([12 * uv[:, 0], across * np.cos(turn), across * np.sin(turn)], axis=1)
    return tip_loaded(uv, F, V, Material(29e6, 0.22), 0.32, force)


def cook(cells: int, mesh: Mesh) -> Problem:
    """A tapered panel 48 long, from 44 to 16 high, sheared by a unit force; the value is the middle of its free end."""
    uv, F = square(cells, cells, mesh)
    low, high = 44 * uv[:, 0], 44 + 16 * uv[:, 0]
    V = np.stack([48 * uv[:, 0], low + (high - low) * uv[:, 1], 0 * low], axis=1)
    middle = at(uv[:, 0], 1.0) & at(uv[:, 1], 0.5)
    panel = tip_loaded(uv, F, V, Material(1.0, 1 / 3), 1.0, (0.0, 1.0, 0.0))
    return replace(panel, value=mean_move(middle, (0.0, 1.0, 0.0)))


def patch(cells: int, mesh: Mesh, shear: bool) -> Problem:
    """A square metre, 10 mm thick, under 1 kN/m of tension or shear on its sides; the value is the move of one side."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)
    left, right, bottom, top = (at(uv[:, axis], end) for axis in (0, 1) for end in (0.0, 1.0))
    sides = {(1.0, 0.0): (right,), (-1.0, 0.0): (left,)}
    if shear:
        sides = {(0.0, 1.0): (right,), (0.0, -1.0): (left,), (1.0, 0.0): (top,), (-1.0, 0.0): (bottom,)}
    load = sum(lines_on(surface, edges_on(surface, *side), (1e3 * q[0], 1e3 * q[1], 0.0)) for q, side in sides.items())
    corner = left & bottom
    return Problem(
        surface,
        Material(210e9, 0.3),
        0.01,
        fixed=held(surface.n, (corner, "xy"), (bottom & right, "y") if shear else (left & top, "x")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, edge=load),
        clamped=np.zeros(len(surface.edges.ends), dtype=bool),
        value=mean_move(top if shear else right, (1.0, 0.0, 0.0)),
    )


STRIP = (
    "curved beam theory with a thin strip's torsion constant b t^3 / 3 (MacNeal and Harder's 0.5022 is for the true "
    "section, twice as wide as thick, which no theory of thin sheets has); unit load on the whole end"
)


def _curved_strip() -> float:
    """P R^3 (pi / 4 / (E I) + (3 pi / 4 - 2) / (G J)) of a quarter ring loaded across its plane [Timoshenko 1955]."""
    young, poisson, radius, width, thickness = 1e7, 0.25, 4.22, 0.2, 0.1
    bending = young * width * thickness**3 / 12
    torsion = young / (2 * (1 + poisson)) * width * thickness**3 / 3
    return float(radius**3 * (np.pi / 4 / bending + (3 * np.pi / 4 - 2) / torsion))


def _tests() -> list[Test]:
    harder = "MacNeal and Harder 1985, unit load on the whole end"
    plates = "Timoshenko and Woinowsky-Krieger 1959, series; whole plate"
    beams: list[tuple[str, float, Callable[[int, Mesh], Problem], tuple[int, ...]]] = [
        ("straight_beam_in_plane", 0.1081, partial(straight_beam, force=IN_PLANE), (1, 2, 4)),
        ("straight_beam_out_of_plane", 0.4321, partial(straight_beam, force=ACROSS), (1, 2, 4)),
        ("curved_beam_in_plane", 0.08734, partial(curved_beam, force=IN_PLANE), (1, 2, 4)),
        ("twisted_beam_in_plane", 0.005424, partial(twisted_beam, force=(0.0, 0.0, 1.0)), (1, 2, 4)),
        ("twisted_beam_out_of_plane", 0.001754, partial(twisted_beam, force=(0.0, 1.0, 0.0)), (1, 2, 4)),
    ]
    return [
        Test("plate_supported", 0.00406235, plates, partial(plate, clamped=False), (4, 8, 16), MESHES),
        Test("plate_clamped", 0.00126532, plates, partial(plate, clamped=True), (4, 8, 16), MESHES),
        *(Test(name, reference, harder, problem, cells) for name, reference, problem, cells in beams),
        Test("curved_beam_out_of_plane", _curved_strip(), STRIP, partial(curved_beam, force=ACROSS), (1, 2, 4)),
        Test("cook", 23.96, "Cook 1974, reference of refined meshes; whole panel", cook, (4, 8, 16)),
        Test(
            "patch_tension", 1e3 / (210e9 * 0.01), "closed form, N / (E h)", partial(patch, shear=False), (2, 4, 8),
            ("jittered",), 1e-9,
        ),
        Test(
            "patch_shear", 1e3 * 2 * 1.3 / (210e9 * 0.01), "closed form, N / (G h)", partial(patch, shear=True),
            (2, 4, 8), ("jittered",), 1e-9,
        ),
    ]  # fmt: skip


TESTS = _tests()
