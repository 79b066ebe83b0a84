"""Combinations after EN 1990: by hand, by what must hold for any loads, and in a design and its report."""

from itertools import combinations as pairs

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import dsfab
from dsfab.core.errors import PresetError
from dsfab.design.design import Design
from dsfab.preset.file import preset_toml
from dsfab.surface import Force, Nearest, SelfWeight, Snow, Wind
from dsfab.surface.loads.combinations import PSI, DesignFactors, action_mistakes, en1990_combinations

DEAD, SNOW = SelfWeight(case="dead"), Snow(pressure=800, case="snow")
WEST, EAST = (Wind(pressure=500, direction=(x, 0, 0), case=case) for x, case in ((1, "west"), (-1, "east")))
CROWD = Force(at=Nearest((0, 0, 0)), force=(0, 0, -1000), case="crowd")


def sums(loads, rule="EN 1990 6.10", actions=None, factors=None):
    return {
        one.name: one.factors for one in en1990_combinations(loads, actions or {}, rule, factors or DesignFactors())
    }


def test_a_roof_under_snow_and_wind_by_hand():
    found = sums([DEAD, SNOW, WEST])
    assert found == {
        "ULS-permanent": {"dead": 1.35},
        "ULS-west": {"dead": 1.35, "west": 1.5},
        "ULS-light-west": {"dead": 1.0, "west": 1.5},
        "ULS-snow": {"dead": 1.35, "snow": 1.5},
        "ULS-snow-west": {"dead": 1.35, "snow": 1.5, "west": 0.9},
        "ULS-light-snow-west": {"dead": 1.0, "snow": 1.5, "west": 0.9},
        "ULS-west-snow": {"dead": 1.35, "west": 1.5, "snow": 0.75},
        "ULS-light-west-snow": {"dead": 1.0, "west": 1.5, "snow": 0.75},
        "SLS-permanent": {"dead": 1.0},
        "SLS-west": {"dead": 1.0, "west": 1.0},
        "SLS-frequent-west": {"dead": 1.0, "west": 0.2},
        "SLS-snow": {"dead": 1.0, "snow": 1.0},
        "SLS-frequent-snow": {"dead": 1.0, "snow": 0.2},
        "SLS-snow-west": {"dead": 1.0, "snow": 1.0, "west": 0.6},
        "SLS-west-snow": {"dead": 1.0, "west": 1.0, "snow": 0.5},
    }


def test_the_pair_of_expressions_and_an_imposed_load_by_hand():
    found = sums([DEAD, CROWD, SNOW], "EN 1990 6.10a/b", {"crowd": "imposed C", "snow": "snow high"})
    assert found["ULS-a-permanent"] == {"dead": 1.35}
    assert found["ULS-a-crowd-snow"] == pytest.approx({"dead": 1.35, "crowd": 1.05, "snow": 1.05})
    assert found["ULS-b-crowd-snow"] == pytest.approx({"dead": 1.1475, "crowd": 1.5, "snow": 1.05})
    assert found["SLS-frequent-snow-crowd"] == {"dead": 1.0, "snow": 0.5, "crowd": 0.6}
    assert found["SLS-quasi-crowd-snow"] == {"dead": 1.0, "crowd": 0.6, "snow": 0.2}


def test_national_factors_count():
    own = DesignFactors(permanent=1.2, variable=1.6, psi={"snow": (0.6, 0.3, 0.1)})
    found = sums([DEAD, SNOW, WEST], factors=own)
    assert found["ULS-west-snow"] == pytest.approx({"dead": 1.2, "west": 1.6, "snow": 0.96})
    assert found["SLS-quasi-snow"] == {"dead": 1.0, "snow": 0.1}


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.sampled_from(["permanent", *PSI]), min_size=1, max_size=5),
    st.sampled_from(["EN 1990 6.10", "EN 1990 6.10a/b"]),
)
def test_for_any_actions(kinds, rule):
    """Names and factors differ; permanent loads are in all; what excludes one another never meets; one leads."""
    loads = [Force(at=Nearest((0, 0, 0)), force=(0, 0, -1), case=f"c{k}") for k in range(len(kinds))]
    actions = {f"c{k}": kind for k, kind in enumerate(kinds)}
    made = en1990_combinations(loads, actions, rule, DesignFactors())
    assert len({one.name for one in made}) == len(made)
    assert len({(one.limit_state, tuple(sorted(one.factors.items()))) for one in made}) == len(made)
    permanent = {case for case, kind in actions.items() if kind == "permanent"}
    for one in made:
        variable = set(one.factors) - permanent
        assert permanent <= set(one.factors)
        for a, b in pairs(sorted(variable), 2):
            assert {actions[a], actions[b]} != {"wind"}
            assert not {actions[a], actions[b]} <= {"snow", "snow high"}
        assert sum(one.factors[case] >= (1.5 if one.limit_state == "ULS" else 1.0) for case in variable) <= 1 or any(
            actions[case] == "imposed E" for case in variable
        )
        assert max((one.factors[case] for case in variable), default=0) <= (1.5 if one.limit_state == "ULS" else 1.0)


def test_loads_without_a_category_are_listed():
    told = list(action_mistakes([DEAD, CROWD], {}, "EN 1990 6.10"))
    assert len(told) == 1
    assert "crowd (force) do not show their kind of action" in told[0]
    assert "imposed C" in told[0]
    both = [SelfWeight(case="all"), Snow(pressure=800, case="all")]
    assert "self_weight, snow) are of several kinds" in next(action_mistakes(both, {}, "EN 1990 6.10"))
    assert "no load has this case" in next(action_mistakes([DEAD], {"deed": "permanent"}, None))
    many = [Force(at=Nearest((0, 0, 0)), force=(0, 0, -1), case=f"c{k}") for k in range(8)]
    assert "combinations, over 200" in next(
        action_mistakes(many, {f"c{k}": "imposed C" for k in range(8)}, "EN 1990 6.10")
    )


@pytest.fixture(scope="module")
def preset():
    given = {"support": [{"at": {"pick": "boundary"}, "hold": "xyz"}], "combinations": "EN 1990 6.10"}
    loads = [
        {"kind": "self_weight", "case": "dead"},
        {"kind": "snow", "pressure": 800.0, "case": "snow"},
        {"kind": "wind", "pressure": 2500.0, "direction": [0, 1, 0], "case": "west"},
    ]
    surface = {"shape": "barrel_vault", "edge": 1.2, "load": loads, **given}
    return dsfab.Preset(name="roof", surface=surface, statics={"thickness": 0.1, "material": "GL24h"})


def test_each_combination_belongs_to_its_limit_state(preset):
    names = [*("dead", "snow", "west"), *(one.name for one in preset.surface.sums)]
    assert all(name.startswith("ULS") for name in preset.followed_weights)
    assert preset.judged_in("ULS", names) == [name for name in names if name.startswith("ULS")]
    assert preset.judged_in("SLS", names) == [name for name in names if name.startswith("SLS")]
    plain = dsfab.Preset(surface=preset.surface.model_copy(update={"combinations": None}), statics=preset.statics)
    assert plain.judged_in("ULS", ["dead", "snow"]) == ["dead", "snow"]


def test_combinations_are_sums_of_their_factored_cases(preset):
    cases = Design.from_preset(preset).statics.cases
    alone = cases["snow"].equilibrium.u * 1.5 + cases["dead"].equilibrium.u * 1.35
    assert_allclose(cases["ULS-snow"].equilibrium.u, alone, atol=1e-9 * abs(alone).max())


def test_a_preset_with_a_standard_is_written_and_read_again(preset, tmp_path):
    own = {"combinations": "EN 1990 6.10a/b", "factors": {"variable": 1.6}, "actions": {"snow": "snow high"}}
    given = dsfab.Preset(surface=preset.surface.model_copy(update=own), statics=preset.statics)
    path = tmp_path / "roof.toml"
    path.write_text(preset_toml(given))
    assert dsfab.load_preset(path).surface.sums == given.surface.sums


def test_a_load_case_of_unknown_action_is_refused():
    loads = [{"kind": "force", "at": {"pick": "all"}, "force": [0, 0, -1000.0], "case": "people"}]
    with pytest.raises(PresetError, match=r"case people \(force\) do not show their kind of action.*surface.actions"):
        dsfab.Preset(
            surface={"shape": "plate", "combinations": "EN 1990 6.10", "load": loads}, statics={"thickness": 0.1}
        )
    with pytest.raises(PresetError, match=r"surface\.combinations = 'EN 1990': .*EN 1990 6\.10"):
        dsfab.Preset(surface={"shape": "plate", "combinations": "EN 1990"}, statics={"thickness": 0.1})
