"""The verification course: its loads and stresses in closed form, published numbers of the same class, locking."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import StaticsError
from dsfab.statics import PAPER, Elements, Equilibrium, Material, elements_of
from dsfab.statics.elements import edge_frames
from dsfab.surface import Surface
from dsfab.verification import TESTS, Problem, pattern_spread, results, series, shortfalls, standings, verify
from dsfab.verification.beams import bent_strip, bent_strip_tip, straight_beam
from dsfab.verification.plane import corner_stress, kirsch, kirsch_stress, vertex_stress
from dsfab.verification.problems import MESHES, Test, octant, square
from dsfab.verification.results import PUBLISHED, Publication, Published, VerificationRow, observed_rate

BEST = elements_of("displacement")

NODAL = Publication("made up for this test", "page")


def ratio(name: str, cells: int, elements: Elements, mesh="diagonal") -> float:
    return TESTS[name].problem(cells, mesh).solve(elements) / TESTS[name].reference


def test_corner_stress_of_a_quadratic_field_is_exact():
    """u = (x y, x^2 / 3 - y^2) on an irregular mesh: strains (y, -2 y, 5 x / 3), linear on each face."""
    uv, F = square(3, 3, "jittered")
    surface = Surface(np.pad(uv, ((0, 0), (0, 1))), F)

    def field(p):
        x, y = p[:, 0], p[:, 1]
        return np.stack([x * y, x**2 / 3 - y**2, 0 * x], axis=1)

    ends = surface.V[surface.edges.ends]
    bulge = field(ends.mean(axis=1)) - (field(ends[:, 0]) + field(ends[:, 1])) / 2
    along, across, _ = np.einsum("edx,ex->de", edge_frames(surface), bulge)
    u = field(surface.V)
    answer = Equilibrium(u, 0 * u, 0.0, 0.0, on_edges={"along": along, "across": across})
    material = Material(3.0, 0.2)
    x, y = surface.V[surface.F][..., 0], surface.V[surface.F][..., 1]
    expected = np.stack([y, -2 * y, 5 / 3 * x], axis=-1) @ material.membrane("plane_stress").T
    stress = corner_stress(surface, material, answer)
    assert stress[..., 0, 0] == pytest.approx(expected[..., 0])
    assert stress[..., 1, 1] == pytest.approx(expected[..., 1])
    assert stress[..., 0, 1] == pytest.approx(expected[..., 2])
    inner = int(np.abs(surface.V[:, :2] - 0.5).max(axis=1).argmin())
    assert vertex_stress(surface, material, answer, inner)[0, 1] == pytest.approx(
        expected[inner == surface.F][:, 2].mean()
    )


def test_kirsch_solution_is_free_at_the_hole_and_plain_tension_far_away():
    turn = np.linspace(0, 2 * np.pi, 13)
    n = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    assert np.einsum("eab,eb->ea", kirsch_stress(*n.T), n) == pytest.approx(np.zeros((13, 2)), abs=1e-12)
    assert kirsch_stress(np.array(0.0), np.array(1.0))[0, 0] == pytest.approx(3)
    assert kirsch_stress(np.array(1.0), np.array(0.0))[1, 1] == pytest.approx(-1)
    assert kirsch_stress(np.array(3e4), np.array(2e4)) == pytest.approx(np.diag([1.0, 0.0]), abs=1e-8)


def test_tractions_on_the_cut_around_the_hole_pull_with_the_whole_tension():
    """Across x = 0 the quarter carries the integral of sigma_xx over 1 < y < 5."""
    problem = kirsch(16, "union_jack")
    y = np.linspace(1, 5, 20001)
    stress = kirsch_stress(0 * y, y)[:, 0, 0]
    carried = float(((stress[1:] + stress[:-1]) / 2 * np.diff(y)).sum())
    assert problem.load.force[:, 0].sum() == pytest.approx(carried, rel=1e-6)


@pytest.mark.parametrize("shape", ["rectangles", "trapezoids", "parallelograms"])
def test_distorted_beams_lean_by_45_degrees_inside_and_stand_upright_at_their_ends(shape):
    surface = straight_beam(1, "diagonal", (0.0, 1.0, 0.0), shape).surface
    assert surface.area == pytest.approx(1.2)
    x = surface.V[:, 0].reshape(7, 2)
    lean = {"rectangles": [0] * 7, "trapezoids": [0, -0.2, 0.2, -0.2, 0.2, -0.2, 0]}
    assert x[:, 1] - x[:, 0] == pytest.approx(np.array(lean.get(shape, [0, 0.2, 0.2, 0.2, 0.2, 0.2, 0])))
    assert x.mean(axis=1) == pytest.approx(np.arange(7))


def test_an_octant_is_an_eighth_of_the_sphere():
    V, F = octant(12)
    assert Surface(V, F).area == pytest.approx(np.pi / 2, rel=0.01)
    assert V.min() >= 0


@pytest.mark.parametrize(
    ("name", "cells", "published", "within"),
    [
        ("cook", 2, 11.99 / 23.96, 0.001),
        ("cook", 4, 18.28 / 23.96, 0.001),
        ("cook", 8, 22.02 / 23.96, 0.001),
        ("straight_beam_in_plane", 1, 0.032, 0.001),
        ("straight_beam_in_plane_trapezoids", 1, 0.019, 0.001),
        ("straight_beam_in_plane_parallelograms", 1, 0.012, 0.001),
        ("curved_beam_in_plane", 1, 0.025, 0.001),
    ],
)
def test_constant_strain_gives_the_numbers_published_for_its_class(name, cells, published, within):
    assert ratio(name, cells, PAPER) == pytest.approx(published, abs=within)
    assert any(p.test == name and p.constant and p.ratio == pytest.approx(published, abs=1e-9) for p in PUBLISHED)


@pytest.mark.parametrize("elements", [BEST, Elements("quadratic", "midedge")], ids=str)
def test_membranes_do_not_lock_up_to_a_thousandth_of_the_radius(elements):
    for cells, near in ((1, 0.01), (2, 0.003)):
        found = [bent_strip(cells, "union_jack", h).solve(elements) / bent_strip_tip(h) for h in (30, 300, 1000)]
        assert found == pytest.approx([1.0] * 3, abs=near)
        assert found[2] == pytest.approx(found[1], abs=1e-4)


def test_a_hemisphere_four_times_thinner_moves_64_times_as_far():
    """R / h = 250 and 1000; it bends nearly without stretching, so locking would show as a drop."""
    thick = TESTS["holed_hemisphere"].problem(16, "union_jack")
    thin = replace(thick, thickness=0.01, force=thick.force / 64)
    assert thin.solve(BEST) == pytest.approx(thick.solve(BEST), rel=0.01)


@pytest.mark.parametrize(
    ("name", "widest"),
    [("plate_supported", 1e-4), ("plate_clamped", 1e-4), ("scordelis_lo", 0.01), ("cook", 0.01)]
    # wanted below 1 % as well, and not met: irregular meshes of flat faces on doubly or strongly curved sheets
    + [("elliptic_membrane", 0.01), ("pinched_cylinder", 0.023), ("holed_hemisphere", 0.011)],
)
def test_mesh_patterns_differ_little_at_sixteen_cells(name, widest):
    test = replace(TESTS[name], cells=(16,))
    spread = pattern_spread(row for mesh in MESHES for row in series(test, mesh, BEST))
    assert list(spread) == [(name, str(BEST), 16)]
    assert 0 < spread[name, str(BEST), 16] <= widest


def test_unknowns_are_those_that_the_supports_leave_free():
    """A square of n by n cells on simple supports: (n - 1)^2 deflections, and per edge two rotations and a bubble."""
    for n in (4, 6):
        problem = TESTS["plate_supported"].problem(n, "union_jack")
        edges, rim = 3 * n**2 + 2 * n, 4 * n
        assert problem.unknowns(PAPER) == (n - 1) ** 2
        assert problem.unknowns(BEST) == (n - 1) ** 2 + 2 * edges + edges - rim
        assert problem.nodal_unknowns() == (n - 1) ** 2 + 2 * (n + 1) ** 2
    beam = TESTS["straight_beam_in_plane"].problem(1, "diagonal")
    assert beam.nodal_unknowns() == 2 * 2 * 6
    assert TESTS["straight_beam_out_of_plane"].problem(1, "diagonal").nodal_unknowns() == 5 * 2 * 6


def rows_of(*found: tuple[int, int, float], test="cook") -> list[VerificationRow]:
    return [
        VerificationRow(test, "diagonal", str(BEST), cells, unknowns, value, 1.0, value, None, "", "ok")
        for cells, unknowns, value in found
    ]


@pytest.mark.parametrize(
    ("published", "ours", "basis", "outcome"),
    [
        (Published("cook", "x", 8, 0.9, NODAL, unknowns=1000), 0.01, "unknowns", "better"),
        (Published("cook", "x", 8, 0.9, NODAL, unknowns=100), 0.1, "unknowns", "alike"),
        (Published("cook", "x", 8, 1.001, NODAL, unknowns=316), 0.1**1.5, "unknowns", "worse"),
        (Published("cook", "x", 8, 0.97, NODAL, unknowns=90000), 0.001, "unknowns", "better"),
        (Published("cook", "x", 4, 0.5, NODAL, unknowns=20), 0.1, "cells", "better"),
        (Published("cook", "x", 3, 0.5, NODAL, unknowns=20), None, "", "unknown"),
        (Published("cook", "x", None, 0.5, NODAL), None, "", "unknown"),
    ],
)
def test_published_values_are_compared_at_equal_unknowns_else_on_equal_cells(
    monkeypatch, published, ours, basis, outcome
):
    monkeypatch.setattr(results, "PUBLISHED", (published,))
    (found,) = standings(rows_of((4, 100, 0.9), (8, 1000, 1.01), (16, 10000, 0.999)), TESTS)
    assert (found.basis, found.outcome) == (basis, outcome)
    assert found.ours == (None if ours is None else pytest.approx(ours, rel=0.01))


def test_a_value_that_crosses_the_reference_counts_with_its_later_error(monkeypatch):
    published = Published("cook", "x", 4, 0.98, NODAL, unknowns=100)
    monkeypatch.setattr(results, "PUBLISHED", (published,))
    (found,) = standings(rows_of((4, 100, 1.0001), (8, 1000, 1.04), (16, 10000, 1.01)), TESTS)
    assert found.ours == pytest.approx(0.04)
    assert found.outcome == "worse"


def test_published_values_name_tests_meshes_and_sources():
    assert {p.test for p in PUBLISHED} <= set(TESTS)
    assert all(0 < p.ratio < 2 and p.source.title and (p.cells or p.note) for p in PUBLISHED)
    assert len({(p.test, p.element, p.cells, p.note, p.source) for p in PUBLISHED}) == len(PUBLISHED) > 100
    assert "recalled" in str(next(p.source for p in PUBLISHED if p.element == "NASTRAN QUAD4"))


def test_shortfalls_list_values_of_constant_strain_and_published_values():
    test = replace(TESTS["cook"], meshes=("diagonal",))
    lines = shortfalls(list(verify([test, TESTS["patch_shear"]], [PAPER])))
    assert list(lines) == ["cook"]
    assert "0.501, 0.763, 0.919, 0.977 at 2, 4, 8, 16; published for constant strain: 0.500, 0.763" in lines["cook"]


def test_rates_need_three_values():
    assert observed_rate([1.0, 1.1, 1.125]) == pytest.approx(2)
    assert observed_rate([1.0, None, 1.125]) is None
    assert observed_rate([1.0, 1.0, 1.0]) is None


def test_a_refused_solve_is_a_verdict_and_fails_the_command(monkeypatch, capsys):
    def refuse(self: Problem, elements: Elements) -> float:
        raise StaticsError("too thin")

    monkeypatch.setattr(Problem, "solve", refuse)
    rows = series(TESTS["bent_strip_1000"], "diagonal", BEST)
    assert [(row.verdict, row.value, row.met) for row in rows] == [
        ("refused", None, met) for met in (False, None, None)
    ]
    assert main(["verify", "bent_strip_1000", "-e", str(BEST)]) == 1
    assert "refused" in capsys.readouterr().out


def test_targets_lie_near_the_limit_of_refinement():
    test = TESTS["holed_hemisphere"]
    assert isinstance(test, Test)
    row = series(replace(test, cells=(16,)), "union_jack", BEST)[0]
    assert row.met
    assert abs(row.value / 0.0935 - 1) < 0.001
    assert not series(replace(test, cells=(16,), limit=0.0945), "union_jack", BEST)[0].met


@pytest.mark.parametrize(("name", "within"), [("curved_beam_in_plane", 0.0015), ("scordelis_lo", 0.001)])
def test_recorded_limits_equal_the_limit_of_refinement(name, within):
    test = TESTS[name]
    row = series(replace(test, cells=(test.cells[2],)), "union_jack", BEST)[0]
    assert row.limit == test.limit
    assert row.of_limit == pytest.approx(1, abs=within)
    assert abs(row.ratio - 1) > 4 * within
