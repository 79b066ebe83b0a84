"""What is kept around supports and loads: found once for a search, and anew for what is asked otherwise."""

from dsfab import load_preset
from dsfab.design import draft, stripe_pattern
from tests.presets import DOME_MODES


def test_kept_regions_are_computed_once_for_equal_loads_and_options(monkeypatch):
    made, counted = [], stripe_pattern.kept_layers

    def counting(*given):
        made.append(given[2:])
        return counted(*given)

    monkeypatch.setattr(stripe_pattern, "kept_layers", counting)
    coarse = draft(load_preset(DOME_MODES, {"surface.edge": 0.9}))
    wider = load_preset(DOME_MODES, {"surface.edge": 0.9, "pattern.keep": 0.7})
    first, again, other = (
        stripe_pattern.kept_regions(one, coarse.surface, coarse.load) for one in (coarse.preset, coarse.preset, wider)
    )
    assert first is again
    assert [reach for reach, *_ in made] == [coarse.preset.pattern.keep, 0.7]
    assert other[-1].levels[0] == -0.7
    twin = draft(coarse.preset)
    assert stripe_pattern.kept_regions(coarse.preset, twin.surface, twin.load) is not first
