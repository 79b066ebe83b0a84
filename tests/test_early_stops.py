"""Supports and loads have names, are listed, and a design that cannot be built stops after the statics."""

import tomllib

import pytest

from dsfab import Boundary, Force, Nearest, Preset, SelfWeight, Snow, Support, load_preset
from dsfab.errors import PresetError
from dsfab.preset_file import preset_from, preset_toml
from dsfab.surface import load_names, support_names


def test_names_of_a_preset_come_back_and_stand_for_what_has_none():
    preset = load_preset("snow_vault", {"surface.support.0.name": "Kämpfer", "surface.load.1.name": "snow, all over"})
    assert preset_from(tomllib.loads(preset_toml(preset))) == preset
    assert support_names((*preset.surface.support, Support(Boundary()))) == ["Kämpfer", "support 2"]
    assert load_names(preset.surface.load) == ["self weight", "snow, all over", "snow 1", "snow 2"]
    assert load_names([SelfWeight(), Snow(800.0), Force(Nearest(((0, 0, 0),)), (0, 0, 1), name="lamp")]) == [
        "self weight",
        "snow",
        "lamp",
    ]


def test_a_preset_without_names_is_written_without_them():
    values = tomllib.loads(preset_toml(load_preset("snow_vault")))
    assert not any("name" in entry for key in ("support", "load") for entry in values["surface"][key])


@pytest.mark.parametrize("name", ["x" * 41, "two\nlines", " inner", "<b>"])
def test_a_name_that_breaks_a_table_is_refused(name):
    with pytest.raises(PresetError, match=r"surface\.support\.0\.name: .* must be up to 40 letters"):
        load_preset("dome", {"surface.support.0.name": name})
    with pytest.raises(PresetError, match="must be up to 40 letters"):
        Preset(surface=load_preset("dome").surface, statics={"thickness": 0.1}, loads=[SelfWeight(name=name)])
