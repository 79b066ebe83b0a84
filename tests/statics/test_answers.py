"""What [statics] can be asked: by which elements, from how many factorisations, in notes, numbers and lines."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab import load_preset
from dsfab.app.build import Files, PictureFlags, build
from dsfab.app.build_page import Output
from dsfab.app.options import Source
from dsfab.core.errors import PresetError
from dsfab.core.units import GRAVITY
from dsfab.design import draft
from dsfab.statics import (
    PAPER,
    Elements,
    FactorCache,
    ResultRequest,
    SheetModel,
    buckling,
    elements_of,
    factorisation,
    frequencies,
    sheet_stiffness,
    solve_statics,
    spread_load,
    stiffness_factor,
)
from tests.presets import DOME_MODES
from tests.shapes import grid
from tests.statics.supports import STEEL, hold, rim

BEST = elements_of("displacement")

SMALL = {"surface.edge": 0.9, "diffusion.modes": 5, "pattern.minor.mode": 2}
ALL = {"statics.strength": 235e6, "statics.frequencies": 2, "statics.buckling": 3}


@pytest.fixture
def factorisations(monkeypatch):
    """Sizes of the matrices that statics factorise; modes of the pattern have their own."""
    made = []
    original = factorisation.factorise

    def counted(K, *rest, **more):
        made.append(len(rest[1]))
        return original(K, *rest, **more)

    monkeypatch.setattr(factorisation, "factorise", counted)
    return made


def small(**changes):
    return draft(load_preset(DOME_MODES, {**SMALL, **{f"statics.{key}": value for key, value in changes.items()}}))


def test_verified_elements_answer_everything_from_the_one_factor_of_the_statics(factorisations):
    made = small(membrane="quadratic", bending="hhj", frequencies=2, buckling=3)
    assert len(factorisations) == 1
    answers, sheet, s = made.statics.answers, made.preset.statics, made.surface
    assert answers.elements == sheet.elements
    assert answers.equilibrium is made.statics.equilibrium
    again = frequencies(SheetModel(s, sheet.elastic, sheet.thickness), made.load.fixed, 2, elements=sheet.elements)
    factors = buckling(
        SheetModel(s, sheet.elastic, sheet.thickness), made.load, answers.equilibrium, 3, elements=sheet.elements
    )
    assert_allclose(answers.vibration.hertz, again.hertz, rtol=1e-7)
    assert_allclose(answers.buckling.factor, factors.factor, rtol=1e-7)
    assert answers.vibration.shapes.shape == (2, s.n, 3)
    assert answers.buckling.shapes.shape == (3, s.n, 3)


def test_hinges_leave_the_answers_to_the_most_accurate_elements(factorisations):
    made = small(strength=235e6, frequencies=2, buckling=1)
    assert len(factorisations) == 2
    assert factorisations[0] < factorisations[1]
    answers, sheet = made.statics.answers, made.preset.statics
    assert answers.elements == BEST
    weight = sheet.density * sheet.thickness * GRAVITY
    spread = spread_load(made.surface, made.preset.surface.load, weight)
    rich = solve_statics(
        SheetModel(made.surface, sheet.elastic, sheet.thickness, sheet.law),
        made.load,
        elements=Elements("hybrid", "hhj"),
        spread=spread,
    )
    assert answers.equilibrium.compliance == pytest.approx(rich.compliance, rel=1e-9)
    assert 2 * answers.stress.energy @ made.surface.areas == pytest.approx(rich.compliance, rel=1e-9)
    assert made.statics.equilibrium.compliance != pytest.approx(rich.compliance, rel=0.02)
    assert any("each flat face bends under pressure" in note.text for note in made.notes)


def test_elements_that_are_not_verified_are_not_reported_from():
    made = small(bending="midedge", strength=235e6)
    assert made.statics.answers.elements == BEST
    told = [note.text for note in made.notes]
    assert any(
        "computed with hybrid+hhj elements" in text and "constant+midedge elements are not accurate" in text
        for text in told
    )


def test_answers_that_are_not_requested_cost_no_solution(factorisations):
    made = small()
    assert len(factorisations) == 1
    answers = made.statics.answers
    assert answers.elements == PAPER
    assert answers.equilibrium is made.statics.equilibrium
    assert answers.vibration is None
    assert answers.buckling is None
    assert 2 * answers.stress.energy @ made.surface.areas == pytest.approx(answers.equilibrium.compliance, rel=1e-9)
    assert not any("elements" in note.text for note in made.notes)


@pytest.mark.parametrize(
    ("ask", "given", "wanted"),
    [
        (ResultRequest(), PAPER, PAPER),
        (ResultRequest(1e6), PAPER, BEST),
        (ResultRequest(0.0, 1), PAPER, BEST),
        (ResultRequest(0.0, 0, 1), Elements("quadratic", "hinge"), BEST),
        (ResultRequest(1e6, 3, 3), Elements("constant", "midedge"), BEST),
        (ResultRequest(1e6, 3, 3), Elements("quadratic", "midedge"), BEST),
        (ResultRequest(1e6, 3, 3), Elements("quadratic", "hhj"), Elements("quadratic", "hhj")),
        (ResultRequest(), Elements("quadratic", "midedge"), Elements("quadratic", "midedge")),
    ],
)
def test_which_elements_answer(ask, given, wanted):
    assert ask.elements_for(given) == wanted
    assert isinstance(ask.factor_for(given), FactorCache) == (bool(ask.modes) and wanted == given)


def test_a_kept_factor_is_made_again_for_another_stiffness_or_other_supports(factorisations):
    s = grid(4, 4, 1.0, 1.0)
    K, other = (sheet_stiffness(SheetModel(s, STEEL, h), PAPER) for h in (0.01, 0.02))
    held = hold(s, (rim(s), "xyz")).ravel()
    less = held.copy()
    less[0] = False
    keep = FactorCache()
    first = keep(s, K, held)
    assert keep(s, K, held) is first
    assert keep(s, K.copy(), held.copy()) is first
    b = np.ones(len(first.free))
    for stiffness, fixed in ((other, held), (other, less), (K, held)):
        fresh = keep(s, stiffness, fixed)
        assert fresh is not first
        x = fresh.solve(np.ones(len(fresh.free)))
        assert_allclose(x, stiffness_factor(s, stiffness, fixed).solve(np.ones(len(fresh.free))), rtol=1e-12)
    assert_allclose(keep(s, K, held).solve(b), first.solve(b), rtol=1e-12)


def test_modes_that_cannot_be_found_are_notes_and_the_design_is_made():
    """Without density nothing vibrates; what stands on two single vertices falls over about the line through them."""
    corners = {"at": {"pick": "nearest", "points": [[-1, -0.5, 0], [-1, 0.5, 0]]}, "hold": "xy"}
    asked = {"surface.edge": 0.1, "statics.frequencies": 1, "statics.buckling": 1, "statics.check": False}
    made = draft(load_preset("cantilever", {**asked, "surface.support": [corners]}))
    answers = made.statics.answers
    assert answers.elements == BEST.in_plane
    assert answers.vibration is None
    assert answers.buckling is None
    assert [text.partition(":")[0] for text in answers.refusals] == ["no natural frequencies", "no buckling factors"]
    assert any(
        "the surface can turn about y" in n.text and "solved without movements out of its plane" in n.text
        for n in made.notes
    )
    point = {"kind": "force", "at": {"pick": "nearest", "points": [[0.0, 0.0, 4.0]]}, "force": [0.0, 0.0, -5e4]}
    asked = {**SMALL, "surface.load": [point], "statics.density": 0.0, "statics.frequencies": 1}
    light = draft(load_preset(DOME_MODES, asked))
    assert any("need a material with a density" in note.text for note in light.notes)


def test_a_sheet_held_only_in_its_plane_is_held_upright_with_a_note():
    """The cantilever swings as one that is built in: 3.5160 sqrt(D / (m L^4)) of a strip, a little more as a plate."""
    asked = {"surface.edge": 0.1, "statics.frequencies": 1, "statics.buckling": 1, "statics.density": 1000.0}
    made = draft(load_preset("cantilever", asked))
    answers, sheet = made.statics.answers, made.preset.statics.sheet()
    assert answers.refusals == ()
    assert any(
        "clamp the supported edges, because a sheet on hinged supports would fall over" in note.text
        for note in made.notes
    )
    length = np.ptp(made.surface.V[:, 0])
    beam = 3.5160 * np.sqrt(sheet.material.young * sheet.thickness**2 / (12 * 1000 * length**4)) / (2 * np.pi)
    assert 1.0 < answers.vibration.hertz[0] / beam < 1.05
    assert answers.buckling.factor[0] > 0
    assert np.abs(answers.buckling.shapes[0][:, 2]).max() > 0.99


def test_a_plane_sheet_buckles_out_of_its_plane(factorisations):
    """Held over a strip of faces, it cannot turn about their edge."""
    strip = {"at": {"pick": "box", "min": [-1.0, -0.5, -1.0], "max": [-0.85, 0.5, 1.0]}, "hold": "xyz"}
    asked = {"surface.edge": 0.1, "surface.support": [strip], "statics.buckling": 2, "statics.frequencies": 1}
    made = draft(load_preset("cantilever", asked))
    answers = made.statics.answers
    assert answers.elements == BEST.in_plane
    assert (
        len(factorisations) == 3
    )  # by the paper's elements, by those that answer, and out of the plane for both modes
    assert answers.buckling.factor[0] > 1
    assert np.abs(answers.buckling.shapes[0][:, 2]).max() > 0.99
    assert answers.stress.peak.layer == "middle"


def test_a_sheet_under_tension_does_not_buckle():
    end = {"pick": "side", "axis": "x", "end": "min"}
    pull = {"kind": "line", "at": {"pick": "side", "axis": "x", "end": "max"}, "per_metre": [1e4, 0.0, 0.0]}
    supports = [{"at": end, "hold": "x"}, {"at": {"pick": "all"}, "hold": "yz"}]
    asked = {"surface.edge": 0.1, "surface.support": supports, "surface.load": [pull], "statics.poisson": 0.0}
    plain = {"pattern.width.rule": "plain", "pattern.width.solid_fraction": 0.0, "pattern.width.min_width": 0.0}
    made = draft(load_preset("cantilever", {**asked, **plain, "pattern.width.min_gap": 0.0, "statics.buckling": 2}))
    assert len(made.statics.answers.buckling.factor) == 0
    assert any("does not buckle" in note.text for note in made.notes)
    assert made.statics.answers.stress.largest == pytest.approx(1e6)


def test_a_load_beyond_strength_or_buckling_gives_a_note():
    made = small(thickness=0.02, strength=1e3, buckling=1, bending="midedge", young=1e6)
    texts = [note.text for note in made.notes]
    share = made.statics.answers.stress.peak.stress / 1e3
    assert any(f"is {share:.0%} of the strength" in text for text in texts)
    assert any("buckles under less than the load" in text for text in texts)


@pytest.mark.parametrize(
    ("key", "value"), [("strength", -1.0), ("frequencies", 11), ("frequencies", -1), ("buckling", 11)]
)
def test_presets_ask_within_reason(key, value):
    with pytest.raises(PresetError, match=key):
        load_preset(DOME_MODES, {f"statics.{key}": value})


@pytest.mark.slow
def test_a_build_writes_and_prints_the_statics_answers(tmp_path, capsys, unjudged):
    sets = [f"{key}={json.dumps(value)}" for key, value in {**SMALL, **ALL, "export.formats": ["stl"]}.items()]
    where, verbose = Files(tmp_path / "out"), Output(verbose=True)
    build(DOME_MODES, source=Source(tuple(sets)), files=where, pictures=PictureFlags(False), output=verbose)
    facts = json.loads((tmp_path / "out" / "design.json").read_text())["statics"]
    assert facts["answered_by"] == "hybrid+hhj"
    assert facts["utilisation"] == pytest.approx(facts["largest_von_mises_Pa"] / 235e6)
    assert facts["strength_Pa"] == 235e6
    assert facts["largest_von_mises_at"]["layer"] in ("top", "bottom")
    assert np.linalg.norm(np.array(facts["largest_von_mises_at"]["point_m"]) - [0, 0, 4]) < 0.7  # under the point load
    energy = facts["membrane_energy_J"] + facts["bending_energy_J"]
    assert energy == pytest.approx(facts["compliance_J"] / 2, rel=1e-8)
    assert facts["largest_displacement_m"] > 0
    assert len(facts["frequencies_hz"]) == 2
    assert len(facts["buckling_factors"]) == 3
    told = capsys.readouterr().out
    assert "uncut sheet, 2 meshes: lowest factor of buckling " in told or "3 meshes: lowest factor of buckling " in told


def test_a_build_without_requested_answers_reports_no_stress_of_hinge_elements(tmp_path, capsys):
    sets = [f"{key}={json.dumps(value)}" for key, value in {**SMALL, "export.formats": ["stl"]}.items()]
    assert (
        build(DOME_MODES, source=Source(tuple(sets)), files=Files(tmp_path / "out"), pictures=PictureFlags(False)) == 0
    )
    facts = json.loads((tmp_path / "out" / "design.json").read_text())["statics"]
    assert facts["answered_by"] == "constant+hinge"
    assert not {"utilisation", "frequencies_hz", "compliance_J", "membrane_energy_J", "von_mises_99_Pa"} & set(facts)
    told = capsys.readouterr().out
    assert "uncut sheet:" not in told
    assert "compliance" not in told


def test_meshes_of_many_vertices_use_the_quick_elements(monkeypatch, factorisations):
    """At 250 000 they took 17 GB where all else took 3.6, and a million was killed."""
    monkeypatch.setattr("dsfab.design.surface_and_statics.MOST_VERTICES", 50)
    made = small(thickness=0.002, strength=1e3, frequencies=1)
    assert made.surface.n > 50
    assert len(factorisations) == 1
    assert made.statics.answers.elements == made.preset.statics.elements
    texts = [note.text for note in made.notes if note.stage == "statics"]
    assert sum("too many" in text for text in texts) == 2
    assert not any("of the strength" in text or "are computed with" in text for text in texts)
    assert "too many" in made.statics.answers.refusals[0]
