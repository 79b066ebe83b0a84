"""Tests of flat sheets under loads in their plane."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.statics import Equilibrium, Material, membrane_strains, membrane_stresses
from dsfab.statics.elements import tensor_matrices
from dsfab.surface import Surface
from dsfab.surface.fields import tangents
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
    tip_loaded,
)


def corner_stress(surface: Surface, material: Material, answer: Equilibrium) -> Floats:
    """Return the stress tensors (m, 3 corners, 3, 3) at the corners of the faces, Pa."""
    strain = membrane_strains(surface, answer)
    planar = membrane_stresses(surface, material, "plane_stress", answer.elements, strain)
    t = tangents(surface)
    return np.asarray(np.einsum("mai,mcab,mbj->mcij", t, tensor_matrices(planar), t))


def vertex_stress(surface: Surface, material: Material, answer: Equilibrium, vertex: int) -> Floats:
    """Return the mean stress tensor (3, 3) at a vertex, Pa."""
    return np.asarray(corner_stress(surface, material, answer)[vertex == surface.F].mean(axis=0))


STEEL = Material(210e9, 0.3)


def patch(cells: int, mesh: Mesh, shear: bool) -> Problem:
    """Return a square sheet, 1 m wide, 10 mm thick, under 1 kN/m of tension or shear.
    Value: displacement along x of the right side in tension, of the top side in shear."""
    uv, F = square(cells, cells, mesh)
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)
    left, right, bottom, top = (is_at(uv[:, axis], end) for axis in (0, 1) for end in (0.0, 1.0))
    sides = {(1.0, 0.0): (right,), (-1.0, 0.0): (left,)}
    if shear:
        sides = {(0.0, 1.0): (right,), (0.0, -1.0): (left,), (1.0, 0.0): (top,), (-1.0, 0.0): (bottom,)}
    load = sum(lines_on(edges_on(surface, *side), (1e3 * q[0], 1e3 * q[1], 0.0)) for q, side in sides.items())
    corner = left & bottom
    fixed = held_directions(surface.n, (corner, "xy"), (bottom & right, "y") if shear else (left & top, "x"))
    return Problem(surface, STEEL, 0.01, fixed, mean_move(top if shear else right, (1.0, 0.0, 0.0)), edge=load)


def cook(cells: int, mesh: Mesh) -> Problem:
    """Return a tapered panel 48 long, from 44 to 16 high, under a unit shear force.
    Value: displacement of the middle of the loaded end."""
    uv, F = square(cells, cells, mesh)
    if mesh == "diagonal":
        uv, F = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1), F[:, ::-1]
    low, high = 44 * uv[:, 0], 44 + 16 * uv[:, 0]
    V = np.stack([48 * uv[:, 0], low + (high - low) * uv[:, 1], 0 * low], axis=1)
    middle = is_at(uv[:, 0], 1.0) & is_at(uv[:, 1], 0.5)
    panel = tip_loaded(uv, F, V, Material(1.0, 1 / 3), 1.0, (0.0, 1.0, 0.0))
    return replace(panel, value=mean_move(middle, (0.0, 1.0, 0.0)))


def kirsch(cells: int, mesh: Mesh) -> Problem:
    """Return a quarter of a sheet in unit tension along x around a hole of radius 1.
    Value: largest stress at the hole, 3 in an infinite sheet."""
    uv, F = square(cells, cells, mesh)
    radius, turn = 5.0 ** uv[:, 1], np.pi / 2 * uv[:, 0]  # cells are about as long as wide
    V = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], axis=1)
    return quarter(uv, F[:, ::-1], V, Material(1.0, 0.3), 1.0, kirsch_stress, (1.0, "xx"))


def kirsch_stress(x: Floats, y: Floats) -> Floats:
    """Return the stress (..., 2, 2) around a hole of radius 1 under a unit tension along x [Kirsch 1898]."""
    q, turn = 1 / (x**2 + y**2), np.arctan2(y, x)
    c2, c4, s2, s4 = np.cos(2 * turn), np.cos(4 * turn), np.sin(2 * turn), np.sin(4 * turn)
    xx = 1 - q * (1.5 * c2 + c4) + 1.5 * q**2 * c4
    yy = -q * (0.5 * c2 - c4) - 1.5 * q**2 * c4
    xy = -q * (0.5 * s2 + s4) + 1.5 * q**2 * s4
    return tensor_matrices(np.stack([xx, yy, xy], axis=-1))


def elliptic_membrane(cells: int, mesh: Mesh) -> Problem:
    """Return NAFEMS LE1: a quarter of a sheet between two ellipses, pulled by 10 MPa on its outer edge.
    Value: stress along the inner edge at the end of its long axis, Pa."""
    uv, F = square(cells, cells, mesh)
    turn, out = np.pi / 2 * uv[:, 0], uv[:, 1]
    V = np.stack([(2 + 1.25 * out) * np.cos(turn), (1 + 1.75 * out) * np.sin(turn), 0 * out], axis=1)
    return quarter(uv, F[:, ::-1], V, STEEL, 0.1, lambda x, y: 10e6 * np.eye(2), (0.0, "yy"))


def quarter(
    uv: Floats,
    F: Ints,
    V: Floats,
    material: Material,
    thickness: float,
    stress: Callable[[Floats, Floats], Floats],
    target: tuple[float, str],
) -> Problem:
    """Return a quarter of a sheet with a hole, loaded by tractions on the outer edge.
    uv     : (n, 2) coordinates: u from 0 (x axis) to 1 (y axis), v from 0 (hole) to 1 (outer edge).
    stress : function (x, y) -> (..., 2, 2) of the stress, Pa.
    target : coordinate u of a point of the hole, and the stress component there ("xx") that is the problem's value."""
    end, component = target
    surface = Surface(V, F)
    outer = edges_on(surface, is_at(uv[:, 1], 1.0))
    vertex = np.flatnonzero(is_at(uv[:, 0], end) & is_at(uv[:, 1], 0.0))[0]
    row, column = ("xyz".index(axis) for axis in component)

    def value(answer: Equilibrium) -> float:
        return float(vertex_stress(surface, material, answer, vertex)[row, column])

    fixed = held_directions(surface.n, (is_at(uv[:, 0], 0.0), "y"), (is_at(uv[:, 0], 1.0), "x"))
    return Problem(surface, material, thickness, fixed, value, edge=thickness * tractions(surface, outer, stress))


def tractions(surface: Surface, marked: Bools, stress: Callable[[Floats, Floats], Floats]) -> Floats:
    """Return the mean traction (e, 3) of a stress field on marked boundary edges (e,), Pa; 0 on other edges."""
    ends = surface.V[surface.edges.ends[marked], :2]
    along = ends[:, 1] - ends[:, 0]
    n = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    n *= np.sign(np.einsum("ex,ex->e", n, ends.sum(axis=1)))[:, None]
    mean = np.zeros_like(n)
    for x, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
        point = ends[:, 0] + (1 + x) / 2 * along
        mean += weight / 2 * np.einsum("...ab,...b->...a", stress(point[:, 0], point[:, 1]), n)
    edge_tractions = np.zeros((len(marked), 3))
    edge_tractions[marked, :2] = mean
    return edge_tractions


TESTS = [
    Test(
        "cook",
        23.96,
        "Cook 1974, value from refined meshes; model: the whole panel",
        "tapered panel, built in on one side, sheared on the opposite side: displacement of that side's middle",
        cook,
        (2, 4, 8, 16),
        MESHES,
        targets={4: 0.01},
    ),
    Test(
        "kirsch_hole",
        3.0,
        "Kirsch 1898, closed form; model: a quarter of the sheet, with exact tractions at five radii",
        "round hole in a sheet under tension: stress at its edge, divided by the tension",
        kirsch,
        meshes=MESHES,
        quantity="stress",
    ),
    Test(
        "elliptic_membrane",
        92.7e6,
        "NAFEMS LE1, 1990; quarter",
        "sheet between two ellipses, pulled outwards: stress at the inner edge",
        elliptic_membrane,
        meshes=MESHES,
        targets={16: 0.02},
        quantity="stress",
    ),
    *(
        Test(
            f"patch_{name}",
            move / (STEEL.young * 0.01),
            f"closed form, N / ({modulus} h)",
            f"square under constant {name}, irregular mesh: the result must be exact",
            partial(patch, shear=name == "shear"),
            (2, 4, 8),
            ("jittered",),
            1e-9,
        )
        for name, modulus, move in (("tension", "E", 1e3), ("shear", "G", 1e3 * 2 * 1.3))
    ),
]
