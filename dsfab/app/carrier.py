"""Designs and presets as bytes, for another process of ours."""

import io
import pickle
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from dsfab.preset.file import preset_from, preset_toml
from dsfab.preset.model import Preset


class _Carrier(pickle.Pickler):
    def reducer_override(self, thing: object) -> Any:
        if isinstance(thing, Preset):  # its parts are of classes that were made when dsfab was imported
            return carried_preset, (preset_toml(thing),)
        if isinstance(thing, MappingProxyType):
            return _proxy, (dict(thing),)
        return NotImplemented


def carried(thing: object) -> bytes:
    """A draft as bytes for `pickle.loads` in another process of ours, with what pickle does not know by itself."""
    file = io.BytesIO()
    _Carrier(file, protocol=5).dump(thing)
    return file.getvalue()


def carried_preset(text: str) -> Preset:
    """The preset that TOML says."""
    return preset_from(tomllib.loads(text))


def _proxy(values: dict[Any, Any]) -> Mapping[Any, Any]:
    return MappingProxyType(values)
