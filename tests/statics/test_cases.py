"""Load cases and combinations: superposition, one factorisation for all, and what a pattern follows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab import load_preset, revise, run
from dsfab.core.errors import PresetError, StaticsError, SurfaceError
from dsfab.diffusion import combined_stress, diffusion_tensors
from dsfab.pattern import relative_stresses
from dsfab.preset.file import preset_toml, with_overrides
from dsfab.report.design.facts import design_facts
from dsfab.statics import (
    Elements,
    Material,
    SheetModel,
    factorisation,
    solve,
    solve_cases,
    solve_statics,
    spread_load,
    stress,
)
from dsfab.study.comparison import comparison
from dsfab.surface import Boundary, Force, LoadCase, Side, Snow, Support, Vertices, Wind, combined_case, load_cases
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, zoo

STEEL = Material(210e9, 0.3, 7850.0)
H = 0.02
PAIRS = [Elements("constant", "hinge"), Elements("constant", "midedge"), Elements("quadratic", "hhj")]
pairs = pytest.mark.parametrize("elements", PAIRS, ids=str)

LOADS = (
    Snow(900.0, case="snow"),
    Wind(600.0, (1.0, 0.2, -0.3), case="wind"),
    Force(Side("z", "max", 0.1), (50.0, 0.0, -700.0), case="crane"),
    Snow(100.0, (0.1, 0.0, -1.0), case="wind"),
)
SUMS = {"uls": {"snow": 1.5, "wind": 0.9}, "lift": {"crane": 1.0, "snow": -0.5, "wind": 2.0}}


def given(surface, loads=LOADS):
    """Load cases and spread loads of a sheet held along its boundary."""
    cases = load_cases(surface, [Support(Boundary())], loads)
    return cases, {name: spread_load(surface, [ld for ld in loads if ld.case == name]) for name in cases}


def solved(surface, elements, loads=LOADS, sums=SUMS):
    cases, spreads = given(surface, loads)
    return cases, spreads, solve_cases(SheetModel(surface, STEEL, H), cases, elements, spreads, sums)


@pairs
@pytest.mark.parametrize("solver", ["PARDISO", "SuperLU"])
def test_load_cases_and_combinations_equal_separate_solutions(elements, solver, monkeypatch):
    if solver == "PARDISO":
        pytest.importorskip("pypardiso")
    monkeypatch.setattr("dsfab.core.sparse.solver_name", lambda: solver)
    surface = ZOO["dome"]()
    cases, spreads, answers = solved(surface, elements)
    assert list(answers) == ["snow", "wind", "crane", "uls", "lift"]
    for name, case in cases.items():
        alone = solve_statics(SheetModel(surface, STEEL, H), case, elements, spreads[name])
        same(answers[name], alone, 1e-12)
    for name, factors in SUMS.items():
        parts = [(factor, answers[case]) for case, factor in factors.items()]
        assert_allclose(answers[name].u, sum(a * part.u for a, part in parts), rtol=1e-12, atol=1e-20)
        face = sum(a * spreads[case].face for case, a in factors.items())
        spread = type(spreads["snow"]).broadcast(surface, face)
        whole = solve_statics(SheetModel(surface, STEEL, H), combined_case(cases, factors), elements, spread)
        same(answers[name], whole, 1e-11)


def same(one, other, share):
    """Two equilibria that differ by rounding only."""
    for name in ("u", "reaction", "torque"):
        a, b = getattr(one, name), getattr(other, name)
        assert_allclose(a, b, rtol=0, atol=share * np.abs(b).max(initial=0))
    assert one.on_edges.keys() == other.on_edges.keys()
    for name, values in one.on_edges.items():
        assert_allclose(values, other.on_edges[name], rtol=0, atol=share * np.abs(values).max())
    assert one.compliance == pytest.approx(other.compliance, rel=share)
    assert one.imbalance < 1e-9
    assert one.residual < 1e-11


def test_many_cases_are_factorised_once(monkeypatch):
    count, factorise = [], factorisation.factorise
    monkeypatch.setattr(factorisation, "factorise", lambda *args, **more: count.append(1) or factorise(*args, **more))
    solved(ZOO["dome"](), PAIRS[0])
    assert len(count) == 1


def test_the_reported_residual_of_a_combination_bounds_its_true_residual(monkeypatch):
    """A solver that is off by d leaves every case with an error of d, if nothing is refined, and so the sum of two."""
    surface, factorise = grid(4, 4, 1.0, 1.0), factorisation.factorise

    def careless(*args, **more):
        exact = factorise(*args, **more)
        return lambda b: 0.9999 * exact(b)

    monkeypatch.setattr(factorisation, "factorise", careless)
    monkeypatch.setattr(factorisation, "REFINEMENTS", 0)
    monkeypatch.setattr(solve, "BALANCE", 1.0)
    monkeypatch.setattr(solve, "RESIDUAL", 1.0)
    loads = [Force(Side("x", "max"), (0.0, 0.0, -f), case=name) for name, f in (("a", 1.0), ("b", 3.0))]
    cases = load_cases(surface, [Support(Side("x", "min", 0.3))], loads)
    answers = solve_cases(
        SheetModel(surface, STEEL, H), cases, combinations={"sum": {"a": 1.0, "b": 2.0}, "less": {"b": -1.0}}
    )
    for name in answers:
        assert answers[name].residual == pytest.approx(1e-4, rel=0.01)


@zoo
def test_all_cases_together_are_the_load_case_without_names(name):
    s = ZOO[name]()
    supports = [Support(Vertices(tuple(np.unique(s.F[:: max(1, s.m // 6)]).tolist())))]
    loads = [load for load in LOADS if name != "moebius" or load.case != "wind"]  # no outside, no wind
    whole = LoadCase.build(s, supports, loads)
    cases = load_cases(s, supports, loads)
    assert list(cases) == list(dict.fromkeys(load.case for load in loads))
    assert_allclose(combined_case(cases).force, whole.force, rtol=1e-12, atol=1e-12 * np.abs(whole.force).max())
    for case in (combined_case(cases), *cases.values()):
        assert np.array_equal(case.loaded, whole.loaded)
        assert np.array_equal(case.fixed, whole.fixed)


def test_a_flat_sheet_is_solved_in_its_plane_if_all_load_cases_act_in_it():
    surface, root = grid(6, 2, 1.0, 0.3), Support(Side("x", "min", 0.2))
    pull, press = Force(Side("x", "max"), (9.0, 0, 0), case="pull"), Force(Side("x", "max"), (0, 0, -9.0), case="press")
    cases = load_cases(surface, [root], [pull, press])
    answers = solve_cases(SheetModel(surface, STEEL, H), cases)
    assert np.abs(answers["press"].u[:, 2]).max() > 0
    assert np.abs(answers["pull"].u[:, 2]).max() == 0
    alone = solve_statics(SheetModel(surface, STEEL, H), cases["pull"])
    assert_allclose(answers["pull"].u, alone.u, rtol=0, atol=1e-12 * np.abs(alone.u).max())


def test_impossible_cases_are_refused():
    surface = ZOO["dome"]()
    cases, _ = given(surface)
    moved = LoadCase.build(surface, [Support(Side("x", "min"))], LOADS[:1])
    with pytest.raises(StaticsError, match="need the same supports"):
        solve_cases(SheetModel(surface, STEEL, H), {**cases, "other": moved})
    with pytest.raises(StaticsError, match="combination uls has a factor for 'sno'; the cases are snow, wind, crane"):
        solve_cases(SheetModel(surface, STEEL, H), cases, combinations={"uls": {"sno": 1.5}})
    with pytest.raises(SurfaceError, match="case crane: all loads act on fixed vertices"):
        given(surface, (*LOADS[:2], Force(Boundary(), (0, 0, -1.0), case="crane")))


# what the pattern follows


@zoo
def test_the_combined_tensor_of_one_case_is_the_size_of_its_stress(name):
    """|sigma| by an eigensolver, in space: the normal has the eigenvalue 0."""
    s = ZOO[name]()
    sigma = stress(s, STEEL, np.random.default_rng(1).normal(size=(s.n, 3)) * 1e-4 * s.size)
    values, vectors = np.linalg.eigh(sigma)
    size = np.einsum("mik,mk,mjk->mij", vectors, np.abs(values), vectors)
    scale = np.abs(size).max()
    assert_allclose(combined_stress(s, [sigma], [1.0]), size, rtol=0, atol=1e-12 * scale)
    assert_allclose(combined_stress(s, [sigma, -sigma], [1.0, 0.5]), 1.5 * size, rtol=0, atol=1e-12 * scale)


def test_combined_tensors_turn_with_the_surface_and_have_one_labelling():
    s, rng = ZOO["dome"](), np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    turned = type(s)(s.V @ turn.T, s.F)
    u = rng.normal(size=(2, s.n, 3))
    pair = combined_stress(s, [stress(s, STEEL, x) for x in u], [1.0, 3.0])
    again = combined_stress(turned, [stress(turned, STEEL, x @ turn.T) for x in u], [1.0, 3.0])
    assert_allclose(again, turn @ pair @ turn.T, rtol=0, atol=1e-10 * np.abs(pair).max())
    signed, size = (diffusion_tensors(s, pair, labelling=name, isotropy=0.0) for name in ("signed", "magnitude"))
    assert np.array_equal(signed.major, size.major)
    assert np.array_equal(signed.principal, size.principal)
    assert signed.principal.min() >= 0


CASES = {
    "surface.edge": 0.8,
    "surface.load": [
        {"kind": "self_weight", "case": "dead"},
        {"kind": "snow", "pressure": 1000.0, "case": "snow"},
        {"kind": "wind", "pressure": 600.0, "direction": [1, 0, 0], "case": "wind"},
        {"kind": "wind", "pressure": 600.0, "direction": [-1, 0, 0], "case": "back"},
    ],
}
WINTER = {"name": "winter", "factors": {"dead": 1.35, "snow": 1.5}}
STORM = {"name": "storm", "factors": {"dead": 1.0, "wind": 1.5}}


@pytest.fixture(scope="module")
def design():
    return run(load_preset(DOME_MODES, {**CASES, "surface.combination": [WINTER, STORM]}))


def test_a_design_of_several_cases_follows_its_combinations(design):
    cases = design.statics.cases
    assert list(cases) == ["dead", "snow", "wind", "back", "winter", "storm"]
    assert design.preset.followed_weights == {"winter": 1.0, "storm": 1.0}
    want = combined_stress(design.surface, [cases["winter"].sigma, cases["storm"].sigma], [1, 1])
    assert np.array_equal(diffusion_tensors(design.surface, want).major, design.diffusion.tensors.major)
    dead, snow = cases["dead"], cases["snow"]
    assert_allclose(cases["winter"].sigma, 1.35 * dead.sigma + 1.5 * snow.sigma, atol=1e-9 * np.abs(dead.sigma).max())
    assert_allclose(cases["winter"].load.force, 1.35 * dead.load.force + 1.5 * snow.load.force, atol=1e-9)
    assert (dead.factors, cases["storm"].factors) == (None, STORM["factors"])
    every = sum(cases[name].equilibrium.u for name in ("dead", "snow", "wind", "back"))
    assert_allclose(design.statics.equilibrium.u, every, atol=1e-12 * np.abs(every).max())
    assert_allclose(design.load.force, sum(cases[n].load.force for n in ("dead", "snow", "wind", "back")), atol=1e-9)


def test_another_choice_of_followed_cases_needs_no_new_solution(design):
    seen = {design.diffusion.tensors.major.tobytes()}
    for changes in (
        {"diffusion.follow": "storm"},
        {"diffusion.follow": "dead"},
        {"diffusion.weights": {"winter": 0, "storm": 2.0}},
        {"surface.combination": []},
    ):
        other = revise(design, with_overrides(design.preset, changes))
        assert (other.statics is design.statics) == ("surface.combination" not in changes)
        seen.add(other.diffusion.tensors.major.tobytes())
        sigma = [other.statics.cases[name].sigma for name in other.preset.followed_weights]
        want = combined_stress(other.surface, sigma, [*other.preset.followed_weights.values()])
        if not other.preset.combines:
            (want,) = sigma
        assert np.array_equal(diffusion_tensors(other.surface, want).major, other.diffusion.tensors.major)
    assert len(seen) == 5


def test_graded_widths_follow_the_sum_of_all_combinations(design):
    """Each family is as wide as the sizes of the stresses of both combinations sum to along it, not as one of them."""
    graded = with_overrides(design.preset, {"pattern.width": {"rule": "graded", "q": 1.0}})
    both = revise(design, graded)
    cases, s = design.statics.cases, design.surface
    sizes = combined_stress(s, [cases["winter"].sigma, cases["storm"].sigma], [1, 1])
    wanted = relative_stresses(s, principal_in_plane(s, sizes))
    duty = 2 * np.stack(both.pattern.half_widths[-2:], axis=1)
    free = (duty < 0.99).all(axis=1)
    assert free.mean() > 0.3
    assert_allclose((duty / wanted)[free], np.median(duty[free] / wanted[free]), rtol=1e-6)
    alone = revise(both, with_overrides(graded, {"diffusion.follow": "winter"}))
    assert np.abs(2 * alone.pattern.half_widths[-2] - duty[:, 0]).max() > 0.05
    heavier = revise(both, with_overrides(graded, {"diffusion.weights": {"winter": 7.0, "storm": 7.0}}))
    assert_allclose(heavier.pattern.half_widths[-2], both.pattern.half_widths[-2], rtol=1e-6)


def principal_in_plane(surface, sigma):
    """(m, 2) the principal values of symmetric tensors (m, 3, 3) in the planes of the faces, the larger first."""
    a = surface.V[surface.F[:, 1]] - surface.V[surface.F[:, 0]]
    a = a / np.linalg.norm(a, axis=1, keepdims=True)
    axes = np.stack([a, np.cross(surface.normals, a)], axis=1)
    return np.linalg.eigvalsh(axes @ sigma @ axes.transpose(0, 2, 1))[:, ::-1]


def test_a_single_load_case_is_followed_alone_and_combined_on_request():
    preset = load_preset(DOME_MODES)
    assert preset.followed_weights == {"load": 1.0}
    assert not preset.combines
    asked = load_preset(DOME_MODES, {"diffusion.follow": "combined"})
    assert asked.combines
    named = load_preset(DOME_MODES, {**CASES, "diffusion.follow": "snow"})
    assert named.followed_weights == {"snow": 1.0}
    assert not named.combines
    some = load_preset(DOME_MODES, {**CASES, "diffusion.weights": {"back": 0, "wind": 3}})
    assert some.followed_weights == {"dead": 1.0, "snow": 1.0, "wind": 3.0}


def test_cases_are_written_and_read_again(tmp_path):
    preset = load_preset(
        DOME_MODES, {**CASES, "surface.combination": [WINTER, STORM], "diffusion.weights": {"storm": 0.5}}
    )
    (tmp_path / "again.toml").write_text(preset_toml(preset))
    assert load_preset(tmp_path / "again.toml") == preset


def test_each_load_case_reports_its_balance(design):
    told = design_facts(design, dict(design.seconds), [], [])["statics"]
    assert list(told["cases"]) == list(design.statics.cases)
    assert told["followed"] == {"winter": 1.0, "storm": 1.0}
    assert told["cases"]["winter"]["factors"] == WINTER["factors"]
    for case in told["cases"].values():
        assert_allclose(case["reaction_N"], -np.array(case["load_N"]), atol=1e-6 * np.abs(case["load_N"]).max())
        assert case["supports"][0]["reaction_N"] == pytest.approx(case["reaction_N"])
        assert "compliance_J" not in case, "the elements of the paper are fit for directions only"
    plan = np.pi * 36
    assert told["cases"]["snow"]["load_N"][2] == pytest.approx(-1000 * plan, rel=0.05)


@pytest.mark.slow
def test_compliances_of_the_followed_cases_are_added_with_their_weights():
    changes = {**CASES, "statics.bending": "midedge", "surface.edge": 1.0}
    full = []
    for more in (
        {"diffusion.follow": "dead"},
        {"diffusion.follow": "snow"},
        {"diffusion.weights": {"wind": 0, "back": 0, "snow": 3.0}},
    ):
        full.append(comparison(run(load_preset(DOME_MODES, {**changes, **more})), against=()).full.compliance)
    assert full[2] == pytest.approx(full[0] + 3 * full[1], rel=1e-10)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"diffusion.follow": "sno"}, r"diffusion\.follow = 'sno': no case or combination .* did you mean snow\? \(th"),
        (
            {"surface.combination": [{"name": "u", "factors": {"ded": 1}}]},
            r"factors\.ded = 1: no .* mean dead\? \(ther",
        ),
        (
            {"surface.combination": [{"name": "u", "factors": {}}]},
            r"combination\.0\.factors: all factors are 0 or missing",
        ),
        ({"surface.combination": [{"name": "snow", "factors": {"dead": 1}}]}, r"0\.name = 'snow': a case or combinat"),
        (
            {"surface.combination": [{"name": "combined", "factors": {"dead": 1}}]},
            r"name = 'combined': diffusion\.follow uses",
        ),
        (
            {"surface.load.1.case": "combined"},
            r"surface\.load\.1\.case = 'combined': diffusion\.follow uses the name 'combined'",
        ),
        ({"surface.load.1.case": "snow/2"}, r"surface\.load\.1\.case = 'snow/2': "),
        (
            {"diffusion.weights": {"snw": 1}},
            r"weights\.snw = 1: no case has this name; did you mean snow\? \(there are",
        ),
        ({"surface.combination": [WINTER], "diffusion.weights": {"snow": 1}}, r"weights\.snow = 1: no combination has"),
        ({"diffusion.weights": {"snow": -1}}, r"weights\.snow = -1: a weight must be 0 or more"),
        ({"diffusion.weights": dict.fromkeys(("dead", "snow", "wind", "back"), 0)}, "all weights are 0"),
        (
            {"diffusion.follow": "dead", "diffusion.weights": {"dead": 1}},
            r"weights have an effect only with "
            r"diffusion\.follow = ",
        ),
        ({"surface.combination": [{"name": "u", "factor": {}}]}, r"unknown key .*factor; did you mean factors\?"),
    ],
)
def test_invalid_names_of_cases_are_refused(changes, says):
    with pytest.raises(PresetError, match=says):
        load_preset(DOME_MODES, {**CASES, **changes})


def test_all_invalid_names_of_cases_are_reported_at_once():
    changes = {**CASES, "surface.combination": [{"name": "u", "factors": {"ded": 1}}], "diffusion.follow": "v"}
    with pytest.raises(PresetError, match=r"factors\.ded = 1.*; diffusion\.follow = 'v'"):
        load_preset(DOME_MODES, changes)
