"""`[pattern] method = "auto"`: what is tried is told, the best is taken, and it is made again without a search."""

from types import SimpleNamespace

import numpy as np
import pytest

import dsfab
from dsfab.design import Log, method_search
from dsfab.design.method_search import NEAR_BEST
from dsfab.design.mode_search import StressedTrial
from dsfab.report.design.facts import attempt_facts, attempt_lines
from dsfab.results import Attempt
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judges import quick
from tests.benchmarks import against_simp
from tests.designs import sliced, untried
from tests.presets import DOME_MODES

pytestmark = pytest.mark.slow

SMALL = {"surface.edge": 0.8, "pattern.major.spacing": 1.6, "pattern.minor.spacing": 1.6, "pattern.width.steps": 2}
PLATE = {"surface.edge": 0.065, "pattern.method": "auto", "pattern.width.steps": 2}


@pytest.fixture(scope="module")
def chosen():
    return dsfab.run(dsfab.load_preset(DOME_MODES, {**SMALL, "pattern.method": "auto"}))


@pytest.fixture(scope="module")
def cantilever():
    return dsfab.run(dsfab.load_preset("cantilever", PLATE))


def test_auto_lists_all_attempts_and_takes_the_best(chosen):
    tried = chosen.pattern.attempts
    assert {one.name for one in tried} >= {
        f"{way}, {rule}" for way in ("stripes", "modes") for rule in ("graded", "graded q 0.5")
    }
    note = next(note.text for note in chosen.notes if note.text.startswith("pattern.method = 'auto' chose"))
    assert note.startswith(f"pattern.method = 'auto' chose {tried[0].name}; ")
    assert any("stripes along optimal forces" in one.name for one in tried)
    assert all(f"{one.name} {one.over_uncut:.3g} x" in note for one in tried if not one.refused)
    found = [one.rank for one in tried]
    assert [rank[:-1] for rank in found] == [rank[:-1] for rank in sorted(found)]
    close = [rank for rank in found if rank[:-1] == found[0][:-1] and rank[-1] <= (1 + NEAR_BEST) * min(found)[-1]]
    assert found[0] in close  # these are put in order by better elements
    assert found[len(close) :] == sorted(found)[len(close) :]
    width = chosen.resolved_preset.pattern.width
    assert tried[0].name.endswith(width.rule if width.q == chosen.preset.pattern.width.q else f"q {width.q:g}")
    assert ("modes" in tried[0].name) == (chosen.resolved_preset.pattern.method == "modes")


@pytest.mark.slow
def test_the_best_stripes_and_the_best_modes_are_tried_with_evened_widths(chosen, cantilever):
    """From the stiffest of each without flaws, and never softer than the graded widths that evening begins with."""
    for design in (chosen, cantilever):
        listed = [one for one in design.pattern.attempts if " apart" not in one.name]
        stressed = [one for one in listed if one.name.endswith("stressed")]
        evened = {one.name.split(",")[0]: one for one in stressed if "optimal forces" not in one.name}
        assert len(evened) == 2
        assert "modes" in evened
        for name, one in evened.items():
            (graded,) = [other for other in design.pattern.attempts if other.name == f"{name}, graded"]
            assert one.compliance * one.kept <= 1.02 * graded.compliance * graded.kept
        others = [one for one in listed if "stripes" in one.name and not one.name.endswith("stressed")]
        assert next(iter(set(evened) - {"modes"})) == min(others, key=lambda one: one.rank).name.split(",")[0]


def test_attempts_rank_by_dead_ends_then_slits_then_stiffness():
    """By hand: 3 is the only one without both; of the others a slit is the lesser evil, then stiffness counts."""
    soft, stiff, clean, slit, dead = (
        Attempt("soft", 9.0, 9.0, 0.5),
        Attempt("stiff", 8.0, 8.0, 0.5),
        Attempt("clean but for material", 7.0, 7.0, 0.6),
        Attempt("slit", 1.0, 1.0, 0.5, slits=1),
        Attempt("dead", 0.5, 0.5, 0.5, dead_ends=1),
    )
    alike = Attempt("as slit, to three digits", 1.0001, 1.0001, 0.5, slits=7)
    refused = Attempt("refused", refused="why")
    ranked = sorted((refused, dead, alike, slit, soft, clean, stiff), key=lambda one: one.rank)
    assert ranked == [stiff, clean, soft, alike, slit, dead, refused]


@pytest.mark.slow
def test_counted_are_those_of_the_sheet_that_would_be_built():
    """The best is built: what was counted on the trial is what the build tells, but for slits at the limit: the share
    of material is met to 2e-3 in a trial, to 4e-4 in the build, and round corners come in the build only. Tidied ones
    have none."""
    plate = sliced(dsfab.load_preset("cantilever", {**PLATE, "pattern.tidy": False}))
    found, best = plate.quality(symmetry=False), plate.pattern.attempts[0]
    assert best.dead_ends == found.dead_ends
    assert best.slits == pytest.approx(found.slits, rel=0.2)
    assert any(one.slits for one in plate.pattern.attempts)  # or nothing was compared


def spaced(found, asked, monkeypatch, crowded=True):
    """Presets of the ways at other distances, by name, none of which is drawn."""
    even = SimpleNamespace(wanted=((np.ones(1),), ()) if crowded else ((), ()))
    monkeypatch.setattr(method_search, "even_stripes", lambda *_: even)
    monkeypatch.setattr(method_search, "Trial", untried)
    monkeypatch.setattr(method_search, "stressed_step", untried)
    best = method_search.MethodCandidate(asked, Attempt(found, 1.0, 1.0, 0.5), None, even)
    given = dsfab.design.Design.from_preset(asked).analysis
    return {way.attempt.name: way.preset for way in method_search.respaced_candidates(asked, [best], given, Log(None))}


def test_auto_varies_default_spacings(monkeypatch):
    """A twelfth of the plate's side is 118 mm; 88 mm are too close where edges are 45 mm long."""
    words = {"surface.edge": 0.04, "pattern.method": "stripes", "pattern.width.rule": "stressed"}
    asked = dsfab.load_preset("cantilever", words)
    found = spaced("stripes along optimal forces, stressed", asked, monkeypatch)
    names = {f"stripes {h} m apart along optimal forces, stressed" for h in (0.088, 0.15)}
    assert found.keys() == names | {f"halved {name}" for name in names}
    assert spaced("halved stripes along optimal forces, stressed", asked, monkeypatch, crowded=False).keys() == names
    for name, made in found.items():
        assert f"{made.pattern.major.spacing:g} m" in name
        assert made.pattern.halve == ("halved" in name)
        assert dsfab.Preset(**made.model_dump()).pattern.minor.spacing == made.pattern.major.spacing
    given = asked.with_pattern(major=asked.pattern.major.model_copy(update={"spacing": 0.1, "frequency": 0.0}))
    fixed = spaced("stripes, stressed", given, monkeypatch)
    assert {made.pattern.major.spacing for made in fixed.values()} == {0.1}
    assert {made.pattern.minor.spacing for made in fixed.values()} == {0.088, 0.15}
    coarse = dsfab.load_preset("cantilever", {**words, "surface.edge": 0.046})
    assert all("0.15 m" in name for name in spaced("stripes, stressed", coarse, monkeypatch))
    without = asked.with_pattern(width=asked.pattern.width.model_copy(update={"solid_fraction": 0.0}))
    assert not spaced("stripes, stressed", without, monkeypatch)


def test_the_table_has_a_line_for_each_and_the_facts_too(chosen):
    attempts = (*chosen.pattern.attempts, Attempt("modes, plain", refused="no piece of material reaches a support"))
    (table,) = attempt_lines(attempts)
    head, *rows = table.split("\n")
    assert head.split() == ["method", "over", "uncut", "kept", "dead", "ends", "slits"]
    assert len(rows) == len(attempts)
    assert rows[-1].endswith("no piece of material reaches a support")
    facts = attempt_facts(attempts)["attempts"]
    assert [fact["method"] for fact in facts] == [one.name for one in attempts]
    assert facts[0]["compliance_over_uncut"] == attempts[0].over_uncut
    assert facts[-1] == {"method": "modes, plain", "refused": "no piece of material reaches a support"}
    assert attempt_lines(()) == []
    assert attempt_facts(()) == {}


def test_the_settled_preset_makes_the_same_sheet(chosen):
    asked = chosen.resolved_preset
    assert asked == chosen.resolved_preset
    assert asked.pattern.method in ("stripes", "modes")
    again = dsfab.run(asked)
    assert np.array_equal(again.sheet.surface.V, chosen.sheet.surface.V)
    assert np.array_equal(again.sheet.surface.F, chosen.sheet.surface.F)
    assert again.resolved_preset is again.preset
    assert again.pattern.attempts == ()


def test_a_resolved_preset_on_modes_loads_for_any_forces(monkeypatch):
    """Modes run along no others than those of the uncut sheet, and a preset that says so is refused."""
    asked = dsfab.load_preset(
        "cantilever", {"surface.edge": 0.2, "pattern.method": "auto", "pattern.forces": "optimal"}
    )
    monkeypatch.setattr(method_search, "Trial", untried)
    monkeypatch.setattr(method_search, "stressed_step", untried)
    (way, *_) = method_search.method_candidates(
        asked, dsfab.design.Design.from_preset(asked).analysis, Log(None), "modes", halve=True
    )
    assert dsfab.Preset(**way.preset.model_dump()).pattern.method == "modes"


@pytest.mark.slow
def test_a_plain_width_is_not_exchanged():
    made = dsfab.design.draft(
        dsfab.load_preset(DOME_MODES, {**SMALL, "pattern.method": "auto", "pattern.width": {"rule": "plain"}})
    )
    assert len(made.pattern.attempts) >= 3
    assert all(one.name.endswith(", plain") or one.refused for one in made.pattern.attempts)


@pytest.mark.slow
def test_stressed_widths_are_judged_evened(cantilever):
    """By the rule `stressed` the trial is worth what the width search ends with, not what it begins with."""
    evened = {**PLATE, "pattern.width.rule": "stressed", "pattern.width.steps": 4}
    both = {}
    for rule, made in (
        ("graded", cantilever),
        ("stressed", dsfab.design.draft(dsfab.load_preset("cantilever", evened))),
    ):
        both[rule] = {
            one.name.split(",")[0]: one
            for one in made.pattern.attempts
            if one.name.endswith(rule) and " apart" not in one.name
        }
    assert both["stressed"].keys() == both["graded"].keys() == {"halved stripes", "stripes", "modes"}
    assert all(one.compliance < 0.99 * both["graded"][name].compliance for name, one in both["stressed"].items())


def coarse_shape(name, share, edge, **pattern):
    """A shape to be held against topology optimisation, of longer triangles."""
    asked = against_simp.preset(name, share, **pattern)
    return asked.model_copy(update={"surface": asked.surface.model_copy(update={"edge": edge})})


@pytest.mark.slow
def test_a_bracket_of_method_auto_comes_near_to_topology_optimisation():
    """1.15 times its compliance are asked; 2.56 it had while widths were constant or graded only.

    On half of the benchmark's triangles, where topology optimisation is as stiff to 1.4 %, and the design has 1.137
    times its compliance; 1.26 if the best of graded widths is taken. Of .3 of the material it has 1.392, asked are 1.5;
    what method auto makes of so little is held against a record in design/test_targets.py.
    """
    share = 0.5
    first = {family: {"mode": 1} for family in ("major", "minor")}  # the search for a pair, which wins nothing here
    few = {
        "rule": "graded",
        "solid_fraction": share,
        "steps": 4,
    }  # of evening, after which it is as stiff as after eight
    made = dsfab.design.draft(coarse_shape("bracket", share, 0.055, **first, width=few))
    own = against_simp.structure(made)
    task = ComparisonTask.from_design(made, own.sheet.surface.area)
    most = against_simp.ASKED[share] * quick(task, against_simp.simp(task)).compliance
    assert quick(task, own).compliance < most
    assert own.sheet.surface.area / made.surface.area == pytest.approx(share, abs=6e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "edge", "share"), [("hole", 0.035, 0.3), ("arch", 0.09, 0.5)])
def test_a_plate_with_a_hole_and_a_wall_over_an_arch_come_near_to_topology_optimisation(name, edge, share):
    """The plate with a hole had 1.28 times its compliance while stripes were a twelfth of its side apart; on meshes
    coarser than these topology optimisation itself is three times as soft."""
    quicker = {
        "major": {"mode": 1},
        "minor": {"mode": 1},
        "width": {"rule": "graded", "solid_fraction": share, "steps": 2},
    }
    made = dsfab.design.draft(coarse_shape(name, share, edge, **quicker))
    own = against_simp.structure(made)
    task = ComparisonTask.from_design(made, own.sheet.surface.area)
    other = quick(task, against_simp.simp(task)).compliance
    assert quick(task, own).compliance < against_simp.ASKED[share] * other
    assert other < 1.3 * against_simp.least(task) * quick(task, Structure.uncut(made.surface, own.thickness)).compliance


@pytest.mark.slow
def test_half_a_sphere_is_as_stiff_as_topology_optimisation_begun_at_ribs():
    """1.15 times its compliance are asked; begun at an even density it stays grey, so that nothing can be cut of it."""
    asked = against_simp.preset(
        "half-sphere",
        0.5,
        method="stripes",
        forces="optimal",
        major={},
        minor={},
        width={"rule": "stressed", "solid_fraction": 0.5, "steps": 4},
    )
    made = dsfab.design.draft(asked)
    own = against_simp.structure(made)
    task = ComparisonTask.from_design(made, own.sheet.surface.area)
    other = against_simp.over_uncut(*against_simp.ribbed(task))
    assert other < against_simp.POOR * against_simp.least(task)
    assert against_simp.over_uncut(task, own) < other


@pytest.mark.slow
def test_of_modes_the_pair_that_evening_makes_the_stiffest_is_taken():
    """At 30 % of the cantilever the pair that is the stiffest with graded widths is not with evened ones."""
    auto = {f"pattern.{family}.{key}": "auto" for family in ("major", "minor") for key in ("mode", "phase")}
    light = {"surface.edge": 0.045, "pattern.width.rule": "stressed", "pattern.width.solid_fraction": 0.3}
    made = dsfab.design.draft(dsfab.load_preset("cantilever", {**auto, **light}))
    ranked = made.pattern.choice
    first = made.pattern.mode
    assert (first, made.pattern.phase) == (ranked.mode, ranked.phase)
    graded = min((one for one in ranked.candidates if not one.refused), key=lambda one: one.compliance * one.kept)
    assert graded.mode != first  # or nothing would be tested
    assert evened(made, ranked.candidates[0]) < 0.95 * evened(made, graded)


def evened(made, one):
    """What modes and phases are worth after eight steps."""
    trial = StressedTrial(made.preset.with_modes(one.mode, one.phase), made.analysis)
    worth, grading = [], trial.start
    for _ in range(8):
        step = trial.step(grading)
        worth.append(step.worth)
        grading = step.after
    return min(worth)
