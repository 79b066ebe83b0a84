"""A draft as bytes for another process of ours, and back: with what pickle does not know by itself."""

import io
import pickle
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from dsfab.preset import Preset
from dsfab.preset_file import preset_from, preset_toml


def carried(thing: object) -> bytes:
    """To be read by `pickle.loads`, in a process of ours alone."""
    file = io.BytesIO()
    _Carrier(file, protocol=5).dump(thing)
    return file.getvalue()


class _Carrier(pickle.Pickler):
    def reducer_override(self, thing: object) -> Any:
        if isinstance(thing, Preset):  # its parts are of classes that were made when dsfab was imported
            return _preset, (preset_toml(thing),)
        if isinstance(thing, MappingProxyType):
            return _proxy, (dict(thing),)
        return NotImplemented


def _preset(text: str) -> Preset:
    return preset_from(tomllib.loads(text))


def _proxy(values: dict[Any, Any]) -> Mapping[Any, Any]:
    return MappingProxyType(values)
