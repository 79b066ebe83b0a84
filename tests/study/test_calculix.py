"""The elements against CalculiX, a solver that is not ours: the same meshes with six-node triangles (S6, CPS6).

Never its three-node shells (S3): they reach 0.56 of a clamped plate. Skipped where `ccx` is not installed.

Its elements are solid wedges whose change of thickness is continuous, so with nu > 0 they are in plane stress only
nearly: 0.03 % stiffer in the plane. They also shear across their thickness and ours do not: under a point load their
displacement grows without end as the mesh gets finer.
"""

import numpy as np
import pytest

import dsfab
from dsfab.core.units import GRAVITY
from dsfab.slicing import cut
from dsfab.statics import Elements, Equilibrium, Material, SheetModel, elements_of, solve_statics, spread_load
from dsfab.study import check_model
from dsfab.study.check_model import cut_model, nodal_forces, six_node_model
from dsfab.surface import Boundary, LoadCase, SelfWeight, Side, Support, Surface, read_surface
from dsfab.verification import TESTS
from dsfab.verification.problems import Problem
from tests.calculix import ccx, needs_ccx
from tests.meshes import mesh_file
from tests.shapes import grid, jittered, quartered

BEST = elements_of("displacement")

pytestmark = [needs_ccx, pytest.mark.slow]

STEEL = Material(210e9, 0.3, 7850.0)


def ccx_value(problem: Problem, folder, element: str) -> float:
    """The problem's value as CalculiX finds it."""
    surface, spread = problem.surface, problem.spread
    force = nodal_forces(surface, problem.force + spread.vertex_forces(surface), spread)
    sheet = SheetModel(surface, problem.material, problem.thickness, clamped=problem.clamped)
    model = six_node_model(sheet, {"SUPPORT_1": problem.fixed}, {"load": force}, element=element)
    u = ccx(model, folder)[0].u[: surface.n]
    return problem.value(Equilibrium(u, np.zeros((surface.n, 3)), 0.0, 0.0))


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Relative L2 difference of two displacement fields over the corner nodes."""
    return float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))


def test_quadratic_membranes_agree_with_plane_stress_triangles(tmp_path):
    problem = TESTS["cook"].problem(8, "union_jack")
    theirs = ccx_value(problem, tmp_path, "CPS6")
    assert problem.solve(Elements("quadratic", None)) == pytest.approx(theirs, rel=2e-4)


@pytest.mark.parametrize(
    ("name", "cells", "within"),
    [
        ("plate_supported", 16, 0.005),
        ("plate_clamped", 32, 0.02),  # theirs is still 1.3 % below the series solution, ours at it
        ("straight_beam_out_of_plane", 4, 0.01),
        ("twisted_beam_in_plane", 2, 0.005),
        ("scordelis_lo", 16, 0.002),
    ],
)
def test_the_pair_for_verdicts_agrees_with_six_node_shells(name, cells, within, tmp_path):
    problem = TESTS[name].problem(cells, "union_jack")
    assert problem.solve(BEST) == pytest.approx(ccx_value(problem, tmp_path, "S6"), rel=within)


def under_self_weight(surface: Surface, thickness: float, support: Support, direction=(0, 0, -1), material=STEEL):
    """The load case of a sheet under its own weight, and the part of it that is spread over faces."""
    loads, weight = [SelfWeight(direction)], material.density * thickness * GRAVITY
    return LoadCase.build(surface, [support], loads, weight), spread_load(surface, loads, weight)


def shells(surface: Surface, thickness: float, support: Support, folder, direction=(0, 0, -1)) -> tuple[float, float]:
    """Relative differences of the compliance and of the displacements from those of CalculiX' six-node shells."""
    load, spread = under_self_weight(surface, thickness, support, direction)
    force = nodal_forces(surface, load.force, spread)
    model = six_node_model(SheetModel(surface, STEEL, thickness), {"SUPPORT_1": load.fixed}, {"weight": force})
    (theirs,) = ccx(model, folder)
    assert (force * theirs.u).sum() == pytest.approx(2 * theirs.energy, rel=1e-3)
    ours = solve_statics(SheetModel(surface, STEEL, thickness), load, Elements("quadratic", "hhj"), spread)
    return ours.compliance / (2 * theirs.energy) - 1, difference(ours.u, theirs.u[: surface.n])


@pytest.mark.parametrize(
    ("name", "thickness", "support", "rounds"),
    [
        pytest.param("barrel_vault.obj", 0.3, Side("z", "min", 0.05), 1, marks=pytest.mark.slow),  # 30 m, on low sides
        ("canopy_quad.obj", 0.15, Boundary(), 1),  # 5 x 5 m
        ("shell_tube.obj", 0.2, Boundary(), 1),  # 9.5 x 8.6 m
        ("roof_with_opening.obj", 0.1, Boundary(), 1),  # 5 x 5 m
        ("hypar.obj", 0.1, Boundary(), 2),  # 5 x 5 m in 8 x 8 cells only
    ],
)
def test_roofs_under_their_own_weight_agree_with_six_node_shells(name, thickness, support, rounds, tmp_path):
    """On the same flat facets, each in four: compliance within 3 %, and both solvers come closer as they get finer.

    Coarser or thinner they part, ours soft: `hhj` lets an edge leave its chord freely, as a slab on its corners would,
    and that is little only where edges are short against sqrt(radius x thickness).
    """
    surface = read_surface(mesh_file(name))
    for _ in range(rounds - 1):
        surface = quartered(surface)
    coarse, fine = (np.abs(shells(s, thickness, Support(support), tmp_path)) for s in (surface, quartered(surface)))
    assert (fine < 0.03).all()
    assert (fine < coarse / 2).all()


def test_a_held_strip_of_a_plate_does_not_turn_in_either(tmp_path):
    """Faces that are held wholly are as good as built in; nodes that are held alone would let the plate rotate."""
    found = shells(jittered(grid(16, 8, 2.0, 1.0)), 0.08, Support(Side("x", "min", 0.25)), tmp_path)
    assert max(map(abs, found)) < 0.02


@pytest.mark.slow
def test_a_closed_surface_agrees_with_six_node_shells(tmp_path):
    """A torus 2.5 m wide, as it is: 4608 triangles, 30 mm thick, held by a band around its lowest circle."""
    surface = read_surface(mesh_file("torus.obj"), "m")
    found = shells(surface, 0.03, Support(Side("y", "min", 0.04)), tmp_path, direction=(0, -1, 0))
    assert max(map(abs, found)) < 0.03


def lattice(surface: Surface) -> Surface:
    """What is left of a flat sheet when it is cut along two families of stripes and a rim."""
    x, y = surface.V[:, 0], surface.V[:, 1]
    rim = np.minimum.reduce([x, 2 - x, y, 1 - y])
    bands = np.arange(0, 4, 0.25)
    return cut(surface, [-rim, x + 0.8 * y, x - 0.8 * y + 1], [[-0.1], bands, bands]).subset().surface


@pytest.mark.parametrize(("poisson", "within"), [(0.0, 1e-5), (0.3, 1e-3)])
def test_cut_plates_in_their_plane_agree_with_plane_stress_triangles(poisson, within, tmp_path):
    """Uncut edges, slanted cuts and slivers alike. At nu = 0 their solids do not change their thickness, and the two
    are the same method: they agree to the digits that are printed."""
    surface = lattice(jittered(grid(24, 12, 2.0, 1.0)))
    assert 0.5 < surface.area / 2 < 0.9
    material = Material(210e9, poisson, 7850.0)
    load, spread = under_self_weight(surface, 0.01, Support(Side("x", "min")), (0, -1, 0), material)
    ours = solve_statics(SheetModel(surface, material, 0.01), load, Elements("quadratic", "hinge"), spread)
    force = nodal_forces(surface, load.force, spread)
    model = six_node_model(
        SheetModel(surface, material, 0.01), {"SUPPORT_1": load.fixed}, {"weight": force}, element="CPS6"
    )
    (theirs,) = ccx(model, tmp_path)
    assert ours.compliance == pytest.approx(2 * theirs.energy, rel=within)
    assert difference(ours.u, theirs.u[: surface.n]) < within


@pytest.mark.parametrize("edge", [0.06, pytest.param(0.025, marks=pytest.mark.slow)])
def test_the_cut_cantilever_agrees_with_plane_stress_triangles(edge, tmp_path):
    """The preset's own sheet with the loads handed over, as `dsfab export` writes it."""
    made = cut_model(dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": edge})))
    assert made.model.element == "CPS6"
    (theirs,) = ccx(made.model, tmp_path)
    (ours,) = made.answers.values()
    assert ours.compliance == pytest.approx(2 * theirs.energy, rel=1e-3)
    assert difference(ours.u, theirs.u[: made.surface.n]) < 1e-3
    assert theirs.reaction["SUPPORT_1"][:2] == pytest.approx([0, 1000], abs=0.01)


def test_thick_plane_sections_would_not_be_in_plane_stress(monkeypatch, tmp_path):
    """Why the section is written thin: as thick as the sheet, CalculiX finds the cut cantilever stiffer."""
    design = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.1}))
    energy = []
    for thin in (check_model.THIN, 1e9):
        monkeypatch.setattr(check_model, "THIN", thin)
        made = cut_model(design)
        energy.append(ccx(made.model, tmp_path)[0].energy)
    assert made.model.thickness == 0.01
    assert energy[1] < energy[0] * (1 - 1e-3)
