"""Benchmarks with a solid or another theory behind them: wedges, the cut vault, Raasch's hook, NAFEMS' frequencies."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.errors import StaticsError
from dsfab.statics import REPORTED, Material, SheetModel, elements_of, frequencies
from dsfab.study import calculix
from dsfab.study.calculix import end_face_nodes, solid_compliance, wedges
from dsfab.surface import Surface
from dsfab.verification import TESTS, failures, series, verify
from dsfab.verification.beams import EDGES_OF_STRIP, HOOK, IN_TORSION
from dsfab.verification.cut_sheets import CONCRETE, RADIUS, THICKNESS, feet, halved_on_cylinder, on_cylinder, vault
from dsfab.verification.results import OUTSIDE, outside_series
from dsfab.verification.vibrations import PLATE_HERTZ, STEEL
from tests.calculix import needs_ccx
from tests.shapes import grid, jittered

BUCKLING = elements_of("buckling")


def flat(points):
    """The plane z = 0."""
    return points * (1, 1, 0), np.broadcast_to([0.0, 0.0, 1.0], points.shape)


def turned_over(surface: Surface, faces) -> Surface:
    F = surface.F.copy()
    F[faces] = F[faces, ::-1]
    return Surface(surface.V, F)


def wedge_volume(solid) -> float:
    """By the six corners of each, as three tetrahedra."""
    X = solid.nodes[solid.elements[:, :6]]
    corners = ((0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5))
    parts = [np.einsum("mi,mi->m", np.cross(X[:, b] - X[:, a], X[:, c] - X[:, a]), X[:, d] - X[:, a]) / 6
             for a, b, c, d in corners]  # fmt: skip
    return float(np.abs(parts).sum())


def test_wedges_fill_the_sheet_and_run_the_same_way_round_whichever_side_a_face_shows():
    sheet = jittered(grid(4, 3, 2.0, 1.0))
    solid = wedges(turned_over(sheet, [1, 5, 6]), 0.1, flat)
    assert wedge_volume(solid) == pytest.approx(2.0 * 0.1)
    X = solid.nodes[solid.elements]
    up = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])[:, 2]
    assert (up > 0).all()
    assert X[:, [3, 4, 5, 9, 10, 11], 2] == pytest.approx(0.05)
    assert X[:, 6] == pytest.approx((X[:, 0] + X[:, 1]) / 2)  # the middles of edges, in CalculiX's order
    assert X[:, 11] == pytest.approx((X[:, 5] + X[:, 3]) / 2)
    assert X[:, 13] == pytest.approx((X[:, 1] + X[:, 4]) / 2)
    assert len(end_face_nodes(solid, sheet, sheet.V[:, 0] < 1e-9)) == 3 * 4 + 2 * 3


@needs_ccx
def test_a_solid_that_hangs_under_its_own_weight_has_the_closed_form():
    """No Poisson's ratio: rho^2 g^2 A L^3 / (3 E)."""
    sheet, material = grid(3, 8, 0.5, 2.0), Material(1e7, 0.0, 1000.0)
    solid = wedges(sheet, 0.1, flat)
    top = end_face_nodes(solid, sheet, sheet.V[:, 1] > 2 - 1e-9)
    found = solid_compliance(solid, material, top, np.array([0.0, -9.81, 0.0]))
    assert found == pytest.approx((1000 * 9.81) ** 2 * 0.05 * 2**3 / (3 * 1e7), rel=1e-4)
    with pytest.raises(StaticsError, match="CalculiX did not solve the solid"):
        solid_compliance(wedges(sheet, -0.1, flat), material, top, np.array([0.0, -9.81, 0.0]))


@pytest.mark.slow
@needs_ccx
def test_the_solid_of_the_vault_comes_to_its_reference_from_the_stiff_side():
    test = TESTS["cut_vault"]
    rows = outside_series(replace(test, cells=(12, 24)), "union_jack")
    assert [row.elements for row in rows] == [OUTSIDE] * 2
    assert rows[0].value == pytest.approx(0.53056, rel=1e-3)
    assert rows[1].value == pytest.approx(0.54628, rel=1e-3)
    assert [row.verdict for row in rows] == ["coarse", "ok"]


def test_without_calculix_the_recorded_number_stands_alone(monkeypatch):
    monkeypatch.setattr(calculix.shutil, "which", lambda name: None)
    rows = list(verify([replace(TESTS["cut_vault"], cells=(12, 24))], [BUCKLING]))
    assert [row.elements for row in rows] == [str(BUCKLING)] * 2
    assert not failures(rows)
    monkeypatch.undo()
    assert outside_series(TESTS["cook"], "diagonal") == []
    assert shutil.which("no such program") is None


def test_finer_meshes_of_the_vault_are_the_same_structure_on_the_cylinder():
    coarse, fine = vault(12), vault(24)
    assert len(coarse.loops) == len(fine.loops) == 1 + 6 * 4
    assert fine.m == 4 * coarse.m
    assert fine.V[: coarse.n] == pytest.approx(coarse.V)
    assert np.linalg.norm(fine.V[:, [0, 2]], axis=1) == pytest.approx(RADIUS)
    assert np.abs(halved_on_cylinder(coarse).V - fine.V).max() < 1e-12
    whole = RADIUS * np.pi / 2 * 4.0
    assert fine.area / whole == pytest.approx(0.75, abs=0.01)  # half and half kept: a quarter is open
    assert on_cylinder(fine.V)[1][feet(fine)][:, 2] == pytest.approx(np.cos(np.pi / 4))
    force = TESTS["cut_vault"].problem(24, "union_jack").load.force.sum(axis=0)
    assert force == pytest.approx([0, 0, -9.81 * CONCRETE.density * THICKNESS * fine.area], abs=1e-9)


def hook_work(torsion_constant: float) -> tuple[float, float]:
    """Of torsion, and in all, per unit force: moments of a force along y about the points of the hook's axis."""
    turn = np.linspace(0, np.radians(210), 20001)
    first = np.minimum(turn, np.pi / 3)
    lean = np.where(turn > first, np.pi / 3 - (turn - first), first)
    x = 14 * np.sin(first) + 46 * np.where(turn > first, np.sin(np.pi / 3) - np.sin(lean), 0)
    z = 14 * (1 - np.cos(first)) + 46 * np.where(turn > first, np.cos(lean) - 0.5, 0)
    radius, young, shear = np.where(turn > first, 46.0, 14.0), 3300.0, 3300 / 2.7
    dx, dz = x[-1] - x, z[-1] - z
    twist, bend = -dz * np.cos(lean) + dx * np.sin(lean), dz * np.sin(lean) + dx * np.cos(lean)
    torsion = np.trapezoid(twist**2 * radius, turn) / (shear * torsion_constant)
    rest = np.trapezoid((bend**2 / (young * 2 * 20**3 / 12) + 1.2 / (shear * 40)) * radius, turn)
    return float(torsion), float(torsion + rest)


def test_the_limit_of_the_hook_follows_from_de_saint_venants_torsion():
    """A curved beam with the strip's true torsion constant, and with that of a thin sheet: b t^3 / 3."""
    thin = 20 * 2**3 / 3
    torsion, whole = hook_work(thin * (1 - EDGES_OF_STRIP))
    assert torsion / whole == pytest.approx(IN_TORSION, abs=2e-4)
    assert hook_work(thin)[1] / whole * HOOK == pytest.approx(TESTS["raasch_hook"].limit, rel=1e-3)


def test_the_hook_test_distinguishes_good_from_bad_elements():
    hook = TESTS["raasch_hook"]
    rows = series(replace(hook, cells=(4, 8)), "union_jack", BUCKLING)
    assert [row.verdict for row in rows] == ["theory", "theory"]
    assert rows[-1].ratio == pytest.approx(0.938, abs=1e-3)
    assert rows[-1].of_limit == pytest.approx(1, abs=1e-3)
    assert not failures(rows)
    for wrong in (replace(hook, limit=HOOK), replace(hook, beyond="")):
        off = series(replace(wrong, cells=(4, 8)), "union_jack", BUCKLING)
        assert {row.verdict for row in off} == {"off"}
        assert len(failures(off)) == 2


def test_the_cantilevered_plate_comes_to_the_frequency_of_thin_plates_and_not_to_bartons():
    """3.4710 sqrt(D / (rho h)) / (2 pi a^2) by Ritz methods with many terms, where Barton has 3.494."""
    assert REPORTED[0] != REPORTED[1]
    problem = TESTS["cantilevered_plate_1"].problem(16, "union_jack")
    sheet = SheetModel(problem.surface, STEEL, 0.05, clamped=problem.clamped)
    found = frequencies(sheet, problem.fixed, 6).hertz
    scale = np.sqrt(STEEL.bending_stiffness(0.05) / (STEEL.density * 0.05)) / (2 * np.pi * 100)
    assert found[0] / scale == pytest.approx(3.4710, rel=1e-3)
    assert 3.494 * scale == pytest.approx(PLATE_HERTZ[0], abs=5e-4)
    assert found == pytest.approx(PLATE_HERTZ, rel=0.011)
