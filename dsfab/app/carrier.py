"""Pickled designs and presets, for another process of dsfab."""

import io
import pickle
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from dsfab.preset.file import preset_from, preset_toml
from dsfab.preset.model import Preset


class _DraftPickler(pickle.Pickler):
    def reducer_override(self, thing: object) -> Any:
        if isinstance(thing, Preset):  # pickle cannot find the classes that dsfab makes at import
            return preset_from_text, (preset_toml(thing),)
        if isinstance(thing, MappingProxyType):
            return _proxy, (dict(thing),)
        return NotImplemented


def pickled(thing: object) -> bytes:
    """Pickle a value for another process; presets and read-only mappings are allowed, unlike in `pickle`."""
    file = io.BytesIO()
    _DraftPickler(file, protocol=5).dump(thing)
    return file.getvalue()


def preset_from_text(text: str) -> Preset:
    """Return the preset of a TOML text."""
    return preset_from(tomllib.loads(text))


def _proxy(values: dict[Any, Any]) -> Mapping[Any, Any]:
    return MappingProxyType(values)
