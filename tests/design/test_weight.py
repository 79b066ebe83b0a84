"""`[pattern] weight_rounds`: directions under the weight of what stripes leave, not under that of the uncut sheet."""

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import PatternError
from dsfab.design import Design, Log, method_search, pattern_stage
from dsfab.design.directions import followed_stress
from dsfab.design.even_stripes import even_stripes, same_stripes
from dsfab.design.pattern_stage import direction_change, drawn_share, statics_with_weight_share
from dsfab.surface import Surface
from tests.benchmarks.weight_rounds import compliance, plain
from tests.designs import untried

COARSE = {"surface.edge": 1.2, "pattern.minor.spacing": 1.6, "pattern.fillet": 0.0}


@pytest.fixture(scope="module")
def vault() -> Design:
    """Coarse; weight is a quarter of what it carries."""
    return Design.from_preset(plain("barrel_vault", **COARSE))


def under(design: Design, share: np.ndarray) -> np.ndarray:
    """(m, 3, 3) Pa, what its pattern follows where faces weigh these shares of what they do."""
    lighter = statics_with_weight_share(design.preset, design.surface, design.statics, share)
    return followed_stress(design.preset, design.surface, lighter)


def test_directions_that_are_turned_by_an_angle_are_that_far_apart():
    surface = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 3, 2]]))
    before = np.broadcast_to(np.diag([3.0, 1.0, 0.0]), (2, 3, 3))
    c, s = np.cos(np.radians(12)), np.sin(np.radians(12))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    after = np.stack([R @ before[0] @ R.T, before[1]])
    assert direction_change(surface, before, after) == pytest.approx((6.0, 12.0))
    alike = np.broadcast_to(np.diag([2.0, 2.0, 0.0]), (2, 3, 3))
    assert direction_change(surface, alike, after) == (0.0, 0.0)  # no direction is clear before


def test_stress_is_linear_in_the_weight(vault):
    """Half of the weight everywhere: the mean of the stresses with all of it and with none."""
    surface = vault.surface
    whole, half, none = (under(vault, np.full(surface.m, share)) for share in (1.0, 0.5, 0.0))
    size = np.abs(whole).max()
    assert np.abs(whole - followed_stress(vault.preset, surface, vault.statics)).max() < 1e-9 * size
    assert np.abs(whole - none).max() > 0.1 * size
    assert np.abs(half - (whole + none) / 2).max() < 1e-9 * size


@pytest.mark.parametrize("membrane", ["constant", "quadratic"])
def test_uniformly_reduced_weight_does_not_turn_the_stripes(membrane):
    asked = plain("barrel_vault", **COARSE, **{"statics.membrane": membrane})
    alone = [load for load in asked.surface.load if load.kind == "self_weight"]
    light = Design.from_preset(
        asked.model_copy(update={"surface": asked.surface.model_copy(update={"load": tuple(alone)})})
    )
    followed = followed_stress(light.preset, light.surface, light.statics)
    less = under(light, np.full(light.surface.m, 0.4))
    assert np.abs(less - 0.4 * followed).max() < 1e-9 * np.abs(followed).max()
    assert max(direction_change(light.surface, followed, less)) < 1e-4
    uneven = np.where(light.surface.centroids[:, 0] > 0, 0.2, 1.0)
    assert max(direction_change(light.surface, followed, under(light, uneven))) > 1


def test_each_face_weighs_its_share_of_material(vault):
    share = drawn_share(vault.preset, vault.analysis, vault.pattern.even)
    surface = vault.surface
    assert share.min() < 0.5 < share.max() <= 1
    assert share @ surface.areas == pytest.approx(vault.sheet.surface.area, rel=0.02)
    lighter = statics_with_weight_share(vault.preset, surface, vault.statics, share)
    (name,) = vault.preset.followed_weights
    gone = lighter.cases[name].load.force.sum(axis=0) - vault.statics.cases[name].load.force.sum(axis=0)
    weight = vault.preset.statics.area_weight * (surface.area - share @ surface.areas)
    assert gone == pytest.approx([0, 0, weight], abs=1e-6 * weight)
    assert lighter.load is vault.statics.load  # what the cut sheet is judged under


def test_a_round_draws_stripes_along_the_stress_of_the_lighter_sheet(vault):
    asked, statics = vault.preset.with_pattern(weight_rounds=1), vault.statics
    made = dsfab.design.draft(asked, earlier=vault)
    share = drawn_share(vault.preset, vault.analysis, vault.pattern.even)
    lighter = statics_with_weight_share(asked, vault.surface, vault.statics, share)
    expected, found = even_stripes(asked, vault.surface, lighter), made.pattern.even
    assert made.statics is statics
    assert np.array_equal(found.phases[1].value, expected.phases[1].value)
    assert not np.array_equal(found.phases[1].value, vault.pattern.even.phases[1].value)
    assert np.array_equal(found.forces, expected.forces)  # what graded widths follow
    told = [note.text for note in made.notes if note.text.startswith("directions of stripes follow")]
    assert len(told) == 1
    assert f"{share @ vault.surface.areas / vault.surface.area:.0%} of the uncut sheet's weight" in told[0]


def test_other_widths_need_other_stripes_only_with_weight_rounds(vault):
    for rounds in (0, 1):
        before = vault.preset.pattern.model_copy(update={"weight_rounds": rounds})
        assert same_stripes(before, before.model_copy(update={"rim": 0.3})) is (rounds == 0)


def test_without_weight_a_round_changes_nothing_and_says_so(vault):
    other = tuple(load for load in vault.preset.surface.load if load.kind != "self_weight")
    surface = vault.preset.surface.model_copy(update={"load": other})
    asked = vault.preset.model_copy(update={"surface": surface}).with_pattern(weight_rounds=2)
    made = dsfab.design.draft(asked)
    assert made.pattern.even.forces is None
    assert any(
        "weight_rounds = 2 has no effect, because the sheet's own weight is not among the loads" in one.text
        for one in made.notes
    )


@pytest.mark.parametrize(("after", "told"), [(0, "a second time"), (1, "a third time")])
def test_the_former_stripes_stay_if_no_width_reaches_the_share(vault, monkeypatch, after, told):
    shares = iter([np.full(vault.surface.m, 0.5)] * after)

    def refused(*_args):
        try:
            return next(shares)
        except StopIteration:
            raise PatternError("too wide") from None

    monkeypatch.setattr(pattern_stage, "drawn_share", refused)
    log = Log(None)
    found = pattern_stage.stripes_under_own_weight(vault.preset.with_pattern(weight_rounds=2), vault.analysis, log)
    assert f"directions were not computed {told}: too wide" in [note.text for note in log.notes]
    assert np.array_equal(found.phases[1].value, vault.pattern.even.phases[1].value) is (after == 0)


def test_weight_rounds_have_no_effect_on_modes_and_give_a_note(vault):
    made = [
        dsfab.design.draft(vault.preset.with_pattern(method="modes", weight_rounds=k), earlier=vault) for k in (0, 1)
    ]
    assert all(np.array_equal(*pair) for pair in zip(*(one.pattern.fields[2:] for one in made), strict=True))
    told = [[note.text for note in one.notes if "weight_rounds has no effect" in note.text] for one in made]
    assert [len(one) for one in told] == [0, 1]


def test_auto_tries_each_method_without_weight_rounds(vault, monkeypatch):
    """What is settled makes the same design again, whichever width was the best."""
    asked = vault.preset.with_pattern(method="auto", weight_rounds=1)
    monkeypatch.setattr(method_search, "Trial", untried)
    monkeypatch.setattr(method_search, "stressed_step", untried)
    (way, *_) = method_search.method_candidates(asked, vault.analysis, Log(None), "stripes", halve=True)
    assert way.preset.pattern.weight_rounds == 0
    assert np.array_equal(way.even.phases[1].value, vault.pattern.even.phases[1].value)


@pytest.mark.slow
def test_a_tower_that_weighs_most_of_its_load_is_stiffer_by_a_round():
    made = [Design.from_preset(plain("tower", rounds)).until("slicing") for rounds in (0, 1)]
    assert made[0].sheet.surface.area == pytest.approx(made[1].sheet.surface.area, rel=0.02)
    before, after = (compliance(one) for one in made)
    assert after < 0.98 * before
