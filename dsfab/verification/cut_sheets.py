"""Test of a vault that is cut into ribs. Its reference solution is from a model of solid elements."""

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.slicing import cut
from dsfab.statics import Material
from dsfab.study.calculix import end_face_nodes, solid_compliance, wedges
from dsfab.surface import Surface
from dsfab.verification.problems import Mesh, Problem, Test, edges_on, held_directions, is_at, square

CONCRETE = Material(33e9, 0.2, 2500.0)
THICKNESS = 0.05  # Metres, 1/80 of the vault's radius.
RADIUS, LENGTH, OPENING = 4.0, 4.0, np.pi / 2  # Radius and length in metres, and angle of the vault.
GRAVITY = np.array([0.0, 0.0, -9.81])
COARSE = 12  # Cells along the arc before the cut; finer meshes split each triangle of the cut mesh into four.


def vault(cells: int) -> Surface:
    """Return the mesh of a barrel vault cut into ribs. cells : number of cells along its arc."""
    uv, F = square(COARSE, COARSE - 2, "union_jack")
    turn = OPENING * (uv[:, 0] - 0.5)
    uncut = Surface(np.stack([RADIUS * np.sin(turn), LENGTH * uv[:, 1], RADIUS * np.cos(turn)], axis=1), F)
    stripes = [np.sort(np.concatenate([np.arange(n + 1) - 0.25, np.arange(n + 1) + 0.25])) for n in (6, 4)]
    ribs = cut(uncut, [6 * uv[:, 0], 4 * uv[:, 1]], stripes).subset().surface
    surface = Surface(on_cylinder(ribs.V)[0], ribs.F)
    for _ in range(round(np.log2(cells / COARSE))):
        surface = halved_on_cylinder(surface)
    return surface


def on_cylinder(points: Floats) -> tuple[Floats, Floats]:
    """Return the points (k, 3), metres, moved onto the vault's cylinder, and the cylinder's normals (k, 3)."""
    out = points * (1, 0, 1)
    normal = out / np.linalg.norm(out, axis=1, keepdims=True)
    return points * (0, 1, 0) + RADIUS * normal, normal


def halved_on_cylinder(surface: Surface) -> Surface:
    """Return the mesh with every triangle split into four, on the vault's cylinder."""
    F, edges = surface.F, surface.edges
    mid = surface.n + edges.of
    added = on_cylinder(surface.V[edges.ends].mean(axis=1))[0]
    parts = [np.stack([F[:, k], mid[:, k], mid[:, k - 1]], axis=1) for k in range(3)]
    return Surface(np.concatenate([surface.V, added]), np.concatenate([*parts, mid]))


def feet(surface: Surface) -> Bools:
    """Return a mask (n,) of the vertices on the two lower edges of the vault."""
    return is_at(np.abs(np.arctan2(surface.V[:, 0], surface.V[:, 2])), OPENING / 2)


def cut_vault(cells: int, mesh: Mesh) -> Problem:
    """Return the vault as a thin sheet under its own weight; value: compliance, J."""
    surface = vault(cells)
    where, weight = feet(surface), CONCRETE.density * THICKNESS * GRAVITY
    fixed, clamped = held_directions(surface.n, (where, "xyz")), edges_on(surface, where)
    return Problem(surface, CONCRETE, THICKNESS, fixed, lambda answer: answer.compliance, face=weight, clamped=clamped)


def vault_solid(cells: int, mesh: Mesh) -> tuple[int, float] | None:
    """Return the number of unknowns and the compliance (J) of the vault in solid elements; None without CalculiX."""
    surface = vault(cells)
    solid = wedges(surface, THICKNESS, on_cylinder)
    compliance = solid_compliance(solid, CONCRETE, end_face_nodes(solid, surface, feet(surface)), GRAVITY)
    return None if compliance is None else (3 * len(np.unique(solid.elements)), compliance)


TESTS = [
    Test(
        "cut_vault",
        # joules, extrapolated from .53056, .54628 and .55127 with 816, 3 264 and 13 056 wedges
        0.5536,
        "quadratic wedge elements by CalculiX 2.20, extrapolated from three meshes; model: the whole vault",
        "vault cut into ribs, clamped, under its own weight: compliance, compared with a solid model",
        cut_vault,
        cells=(COARSE, 2 * COARSE, 4 * COARSE),
        quantity="compliance",
        outside=vault_solid,
    )
]
