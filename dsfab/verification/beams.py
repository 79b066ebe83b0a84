"""Cantilever strips: straight, curved, twisted, bent in an arc, and Raasch's hook."""

from collections.abc import Iterator
from functools import partial
from typing import Literal

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.statics import Material
from dsfab.verification.problems import Mesh, Problem, Test, square, tip_loaded

Shape = Literal["rectangles", "trapezoids", "parallelograms"]
Vector = tuple[float, float, float]
IN_PLANE, ACROSS = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
CELLS: tuple[int, ...] = (1, 2, 4)
PATTERNS: tuple[Mesh, ...] = ("diagonal", "union_jack")
"""Mesh patterns of strips. `jittered` is missing, because a strip of one cell has no inner vertices to move."""


def straight_beam(cells: int, mesh: Mesh, force: Vector, shape: Shape = "rectangles") -> Problem:
    """Return a cantilever 6 x 0.2 x 0.1 with a force on its end.
    cells : number of cells across the width; six times as many cells lie along the length."""
    uv, F = square(6 * cells, cells, mesh)
    V = np.stack([6 * uv[:, 0] + lean(6 * uv[:, 0], shape) * (2 * uv[:, 1] - 1), 0.2 * uv[:, 1], 0 * uv[:, 0]], axis=1)
    return tip_loaded(uv, F, V, Material(1e7, 0.3), 0.1, force)


def lean(station: Floats, shape: Shape) -> Floats:
    """Return the distances (k,) along the strip by which the upper ends of the mesh's cross lines move.
    station : (k,) positions along the strip, 0 to 6."""
    lines = np.full(7, 0.0 if shape == "rectangles" else 1.0)
    if shape == "trapezoids":
        lines[1::2] = -1.0
    lines[[0, -1]] = 0.0
    return np.asarray(0.1 * np.interp(station, np.arange(7), lines))


def curved_beam(cells: int, mesh: Mesh, force: Vector) -> Problem:
    """Return a quarter ring between the radii 4.12 and 4.32, 0.1 thick, loaded at its free end."""
    uv, F = square(6 * cells, cells, mesh)
    radius, turn = 4.12 + 0.2 * uv[:, 1], np.pi / 2 * (1 - uv[:, 0])
    V = np.stack([radius * np.sin(turn), radius * np.cos(turn), 0 * turn], axis=1)
    return tip_loaded(uv, F, V, Material(1e7, 0.25), 0.1, force)


def twisted_beam(cells: int, mesh: Mesh, force: Vector, thickness: float = 0.32) -> Problem:
    """Return a cantilever 12 x 1.1, twisted by 90 degrees, with a force on the tip."""
    uv, F = square(11 * cells, cells, mesh)
    across, turn = 1.1 * (uv[:, 1] - 0.5), np.pi / 2 * uv[:, 0]
    V = np.stack([12 * uv[:, 0], across * np.cos(turn), across * np.sin(turn)], axis=1)
    return tip_loaded(uv, F, V, Material(29e6, 0.22), thickness, force)


BENT = Material(young=1e9, poisson=0.0)
BENT_WIDTH = 0.2  # Metres; the axis has a radius of 1 m.


def bent_strip(cells: int, mesh: Mesh, slenderness: float) -> Problem:
    """Return a strip 0.2 wide, bent into a quarter circle of radius 1, with a radial force on its free end.
    slenderness : radius divided by thickness."""
    uv, F = square(8 * cells, cells, mesh)
    turn = np.pi / 2 * uv[:, 0]
    V = np.stack([np.sin(turn), BENT_WIDTH * uv[:, 1], np.cos(turn)], axis=1)
    return tip_loaded(uv, F, V, BENT, 1 / slenderness, (1.0, 0.0, 0.0))


def bent_strip_tip(slenderness: float) -> float:
    """Return the exact radial movement of the free end of `bent_strip`: pi / 4 P R^3 / (E I) for P = 1, R = 1."""
    return float(np.pi / 4 / (BENT.young * BENT_WIDTH / slenderness**3 / 12))


def raasch_hook(cells: int, mesh: Mesh) -> Problem:
    """Return a strip 20 wide and 2 thick: a bend of 60 degrees at radius 14, then back by 150 degrees at radius 46."""
    uv, F = square(9 * cells, cells, mesh)
    turn = np.radians(210 * uv[:, 0])
    first_arc = np.minimum(turn, np.pi / 3)
    lean = np.pi / 3 - (turn - first_arc)
    x = 14 * np.sin(first_arc) + 46 * (np.sin(np.pi / 3) - np.sin(lean))
    z = 14 * (1 - np.cos(first_arc)) + 46 * (np.cos(lean) - np.cos(np.pi / 3))
    return tip_loaded(uv, F, np.stack([x, 20 * uv[:, 1], z], axis=1), Material(3300.0, 0.35), 2.0, (0.0, 1.0, 0.0))


HOOK = 5.022
"""Displacement of the hook's end. 20-node bricks give 5.02 [Abaqus 6.5 Benchmarks, 2.3.6; Knight 1997].
Extrapolation from three meshes of bricks gives 5.02201 [FinEtoolsFlexStructures.jl]."""

EDGES_OF_STRIP = 0.63 * 2 / 20
"""Fraction .63 t / b by which the torsional stiffness of a strip is below b t^3 / 3 (width b, thickness t) [de Saint
Venant]. Theories of thin sheets lack the shear across the thickness that causes this loss."""

IN_TORSION = 0.9899  # Fraction of torsion in the strain energy of the hook as a curved beam.

STRIP = (
    "curved beam theory with the torsion constant b t^3 / 3 of a thin strip, unit load on the whole end (the value "
    "0.5022 of MacNeal and Harder is for a section twice as wide as thick, and thin-sheet theories cannot represent "
    "this section)"
)


def _curved_strip() -> float:
    """Return the displacement of a quarter ring normal to its plane [Timoshenko 1955]."""
    young, poisson, radius, width, thickness = 1e7, 0.25, 4.22, 0.2, 0.1
    bending = young * width * thickness**3 / 12
    torsion = young / (2 * (1 + poisson)) * width * thickness**3 / 3
    return float(radius**3 * (np.pi / 4 / bending + (3 * np.pi / 4 - 2) / torsion))


def _curved_plane() -> float:
    """Return the displacement of a quarter ring in its plane [Golovin 1881; Timoshenko and Goodier 1951, 33]."""
    a, b, young, thickness = 4.12, 4.32, 1e7, 0.1
    squares = a**2 + b**2
    return float(np.pi * squares / (young * thickness * (a**2 - b**2 + squares * np.log(b / a))))


HARDER = "value of MacNeal and Harder 1985 for a unit load on the whole end"
RING = f"{HARDER} (the closed form of plane stress, Golovin 1881, gives {_curved_plane():.5f}, which is 1.4 % more)"
THIN = "value of Simo, Fox and Rifai 1989 for thickness 0.0032 and a load of 1e-6 on the whole end"


def _straight_beams() -> Iterator[Test]:
    shapes: tuple[tuple[Shape, str], ...] = (("rectangles", ""), ("trapezoids", "_trapezoids"))
    for shape, suffix in (*shapes, ("parallelograms", "_parallelograms")):
        about = "straight cantilever" + (f" on a mesh of {shape}" if suffix else "")
        for name, force, reference, target in (
            ("in_plane", IN_PLANE, 0.1081, 0.015 if suffix else 0.02),
            ("out_of_plane", ACROSS, 0.4321, 0.015 if suffix else 0.005),
        ):
            bent = "in its plane" if name == "in_plane" else "across its plane"
            problem = partial(straight_beam, force=force, shape=shape)
            yield Test(
                f"straight_beam_{name}{suffix}", reference, HARDER, f"{about}, bent {bent}: tip displacement", problem,
                CELLS, PATTERNS, targets={1: target},
            )  # fmt: skip


def _curved_beams() -> Iterator[Test]:
    for name, force, reference, source, limit in (
        ("in_plane", IN_PLANE, 0.08734, RING, _curved_plane()),
        ("out_of_plane", ACROSS, _curved_strip(), STRIP, None),
    ):
        about = f"quarter ring, flat, bent {name.replace('_', ' ')}: displacement of the tip"
        problem = partial(curved_beam, force=force)
        yield Test(
            f"curved_beam_{name}", reference, source, about, problem, CELLS, PATTERNS, targets={1: 0.015}, limit=limit
        )


def _twisted_beams() -> Iterator[Test]:
    for suffix, thickness, load, references, source in (
        ("", 0.32, 1.0, (0.005424, 0.001754), HARDER),
        ("_thin", 0.0032, 1e-6, (0.005256, 0.001294), THIN),
    ):
        for name, force, reference in (
            ("in_plane", (0.0, 0.0, load), references[0]),
            ("out_of_plane", (0.0, load, 0.0), references[1]),
        ):
            about = f"cantilever twisted by 90 degrees, {thickness} thick, loaded {name.replace('_', ' ')} of its end"
            yield Test(
                f"twisted_beam_{name}{suffix}", reference, source, about,
                partial(twisted_beam, force=force, thickness=thickness), CELLS, targets={1: 0.015},
            )  # fmt: skip


def _bent_strips() -> Iterator[Test]:
    for slenderness in (100, 1000):
        yield Test(
            f"bent_strip_{slenderness}",
            bent_strip_tip(slenderness),
            "closed form, pi / 4 P R^3 / (E I), no stretching; whole strip",
            f"strip bent into a quarter circle, R / h = {slenderness}: test for membrane locking",
            partial(bent_strip, slenderness=slenderness),
            CELLS,
            PATTERNS,
            targets={1: 0.015},
        )


def _hooks() -> Iterator[Test]:
    yield Test(
        "raasch_hook",
        HOOK,
        "Abaqus 6.5 Benchmarks 2.3.6, brick elements; unit load on the whole end",
        "Raasch's hook, a strip of two opposite arcs, pushed sideways: displacement of its end",
        raasch_hook,
        (1, 2, 4, 8),
        PATTERNS,
        limit=HOOK * (1 - EDGES_OF_STRIP * IN_TORSION),
        beyond="a strip ten thicknesses wide twists 6 % more than a thin sheet: its edges shear through the thickness",
    )


TESTS = [*_straight_beams(), *_curved_beams(), *_twisted_beams(), *_bent_strips(), *_hooks()]
