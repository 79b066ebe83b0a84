"""What the theory of thin sheets leaves out: shares of bending and twisting, the term that is told, and its table."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsfab.statics import Material, SheetMaterial, equilibria, sheet_stiffness, sheet_stress
from dsfab.study.verdict import LoadedSurface, check, whole_sheet
from dsfab.study.verdict.calibration import TABLE
from dsfab.study.verdict.finer import meshes, shares
from dsfab.study.verdict.levels import MAIN
from dsfab.study.verdict.loaded_surface import attached_material
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.study.verdict.theory import NARROW, BendingShares, bending_shares, theory_share
from dsfab.surface import LoadCase, Surface
from tests.benchmarks.solid_truth import drawn_design, limit, needed, read
from tests.benchmarks.solid_wedges import solid_compliance
from tests.calculix import needs_ccx
from tests.zoo import grid, jittered

SOFT = Material(1e9, 0.25, 1.0)


def shares_under(surface, fixed, force, material=SOFT, thickness=0.01, clamped=()):
    """Of a sheet under forces (n, 3) on its vertices."""
    made = SheetMaterial(material, thickness)
    load = LoadCase(fixed, force, np.abs(force).any(axis=1), clamped=np.array(clamped, dtype=bool))
    K = sheet_stiffness(made.on(surface), MAIN)
    (answer,) = equilibria(surface, K, [load], MAIN)
    stress = sheet_stress(made.on(surface), MAIN, answer)
    return bending_shares(surface, made, stress, answer), stress, answer


def turned(surface):
    """The same in another place, and which way its x, y and z point then."""
    a, b = 0.7, -1.1
    R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    R = R @ np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    return Surface(surface.V @ R.T + 3.0, surface.F), R


def corner_plate():
    """A square on three corners, pushed at the fourth: w = c x y, m_xy alone."""
    surface = jittered(grid(6, 6, 1.0, 1.0))
    corners = [int(np.linalg.norm(surface.V[:, :2] - xy, axis=1).argmin()) for xy in ((0, 0), (1, 0), (0, 1), (1, 1))]
    fixed, force = np.zeros((surface.n, 3), dtype=bool), np.zeros((surface.n, 3))
    fixed[corners[:3], 2] = True
    fixed[corners[0]] = True
    fixed[corners[1], 1] = True
    force[corners[3], 2] = -10.0
    return surface, fixed, force


def test_a_square_on_three_corners_is_twisted_and_nothing_else():
    """c = F^2 a^2 12 (1 + nu) / (E h^3) [w = F a^2 / (2 D (1 - nu))], all of it twist."""
    surface, fixed, force = corner_plate()
    found, _, answer = shares_under(surface, fixed, force)
    assert answer.compliance == pytest.approx(100.0 * 6 * 1.25 / (1e9 * 1e-6), rel=1e-6)
    assert found == pytest.approx((1.0, 1.0), rel=1e-6)


def test_a_strip_that_is_bent_is_not_twisted():
    surface = jittered(grid(20, 4, 2.0, 0.4))
    x = surface.V[:, 0]
    force = np.zeros((surface.n, 3))
    force[x > 1.99, 2] = -1.0
    clamped = (x[surface.edges.ends] < 0.01).all(axis=1)
    fixed = np.repeat((x < 0.01)[:, None], 3, axis=1)
    bent, stress, answer = shares_under(surface, fixed, force, replace(SOFT, poisson=0.0), clamped=clamped)
    assert bent.bending == pytest.approx(1.0, rel=1e-6)
    assert bent.twisting < 0.01
    # both parts of the energy are those of the stress
    assert bent.bending == pytest.approx(2 * stress.bending_energy @ surface.areas / answer.compliance, rel=1e-9)
    pulled, *_ = shares_under(surface, fixed, force[:, [2, 1, 0]])
    assert pulled == pytest.approx((0.0, 0.0), abs=1e-9)


def test_shares_do_not_depend_on_where_the_sheet_lies_and_how_strong_it_is():
    surface, fixed, _ = corner_plate()
    x, y = surface.V[:, 0], surface.V[:, 1]
    fixed = np.repeat((x < 0.01)[:, None], 3, axis=1)
    force = np.zeros((surface.n, 3))
    force[(x > 0.99) & (y > 0.6), 2] = -1.0
    clamped = (x[surface.edges.ends] < 0.01).all(axis=1)
    known, *_ = shares_under(surface, fixed, force, clamped=clamped)
    assert 0.05 < known.twisting < known.bending
    other, R = turned(surface)
    again, *_ = shares_under(other, fixed, 7 * force @ R.T, replace(SOFT, young=3e5), clamped=clamped)
    assert again == pytest.approx(known, rel=1e-6)


def test_the_term_grows_as_ribs_get_narrow_and_is_nothing_in_the_plane():
    twisted, bent = BendingShares(0.6, 0.6), BendingShares(0.6, 0.0)
    assert theory_share(BendingShares(0.0, 0.0), 2.0) == 0
    assert theory_share(twisted, np.inf) == 0
    assert theory_share(twisted, 3.0) == pytest.approx(2 * theory_share(twisted, 6.0))
    # more than Saint-Venant's torsion of a rib alone, .63 h / w
    assert theory_share(twisted, 5.0) > max(0.63 * 0.6 / 5, theory_share(bent, 5.0))


SOLIDS = read(Path(str(TABLE)).parent / "solids.csv")


def test_the_solids_of_the_table_lie_within_what_verdicts_say_of_them():
    assert len(SOLIDS) >= 24
    assert len({row.kind for row in SOLIDS}) >= 10
    assert min(row.share for row in SOLIDS) < 0.35
    assert min(row.ratio for row in SOLIDS) < 2.5 < 10 < max(row.ratio for row in SOLIDS)
    assert np.mean([row.inside(NARROW) for row in SOLIDS]) >= 0.95
    assert np.mean([row.inside(0.0) for row in SOLIDS]) < 0.5  # the bound is about thin sheets
    flat = [row for row in SOLIDS if row.kind == "cantilever"]
    assert flat
    assert all(row.bending == 0 and row.inside(0.0) for row in flat)


def test_the_term_holds_for_kinds_that_it_was_not_fitted_to():
    kinds = {row.kind for row in SOLIDS}
    others = {kind: needed([row for row in SOLIDS if row.kind != kind]) for kind in kinds}
    assert np.mean([row.inside(others[row.kind]) for row in SOLIDS]) >= 0.95
    assert needed(SOLIDS) == pytest.approx(NARROW, rel=0.02)


def test_solids_are_carried_on_at_their_own_rate():
    for rate in (2.0, 3.5):
        assert limit([1 - 0.1 / rate**k for k in range(3)]) == pytest.approx(1)
    assert limit([0.7, 0.9]) == pytest.approx(1.0)


@pytest.mark.slow
@needs_ccx
def test_wedges_of_a_whole_plate_agree_with_the_thin_plate():
    """A plate of 516 triangles, 200 thicknesses long, on hinges: the solid is softer by .1 % and what meshes leave."""
    design, _ = drawn_design("plate", 0)
    setting = LoadedSurface.of(design)
    sheet, _, loads = attached_material(setting, whole_sheet(design.surface))
    forces, chain = shares(sheet, loads), meshes(sheet, SmoothSurface.through(design.surface))
    first, second, third = (next(chain) for _ in range(3))
    solid = [solid_compliance(setting, a, b, forces, 1) for a, b in ((first, second), (second, third))]
    assert limit(solid) == pytest.approx(check(setting, sheet).value, rel=0.01)
    assert solid_compliance(setting, first, second, forces, 2) / solid[0] == pytest.approx(1.0, abs=1e-3)
