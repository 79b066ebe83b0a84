"""`VariantTray`: designs that a person keeps while trying others: named, looked at side by side, and gone back to."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dsfab.app.editor.source import Opened
from dsfab.errors import DsfabError
from dsfab.preset import Preset

MOST = 48
"""Variants of one session."""

LARGEST = 2 * 2**20
"""Characters of a picture."""

FIGURES = ("share", "area", "mass", "pieces", "narrowest", "compliance")
"""What is kept of what was measured (see `figures.figures`)."""


@dataclass(frozen=True)
class KeptVariant:
    """What was open, what the person had changed, and how it looked. figures: by name, None where not measured."""

    name: str
    opened: Opened
    changes: Mapping[str, Any]
    picture: str = ""
    figures: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def preset(self) -> Preset:
        """What the variant is."""
        return self.opened.changed(self.changes)


class VariantTray:
    """Variants by their numbers, in the order in which they were kept; they go with the session."""

    def __init__(self) -> None:
        self._all: dict[int, KeptVariant] = {}
        self._numbers = itertools.count(1)

    def __getitem__(self, number: int) -> KeptVariant:
        """Raises DsfabError for one that is not there."""
        if number not in self._all:
            raise DsfabError("that variant is not kept any more")
        return self._all[number]

    def listed(self) -> list[dict[str, Any]]:
        """All of them for the page."""
        return [
            {"number": number, "name": one.name, "picture": one.picture, "figures": dict(one.figures)}
            for number, one in self._all.items()
        ]

    def keep(self, variant: KeptVariant) -> None:
        """One more; without a name it gets its number. Raises DsfabError for what is none, and where there are many."""
        _ = variant.preset
        if len(self._all) >= MOST:
            raise DsfabError(f"{MOST} variants are kept already; remove one first")
        if variant.picture and not (variant.picture.startswith("data:image/") and len(variant.picture) <= LARGEST):
            raise DsfabError("the picture of the variant did not arrive whole; keep it again")
        number = next(self._numbers)
        figures = {name: variant.figures.get(name) for name in FIGURES}
        self._all[number] = replace(variant, name=_short(variant.name) or f"Variant {number}", figures=figures)

    def rename(self, number: int, name: str) -> None:
        """Another name, if it is one. Raises DsfabError for a variant that is not there."""
        old = self[number]
        self._all[number] = replace(old, name=_short(name) or old.name)

    def drop(self, number: int) -> None:
        """Keep it no longer. Raises DsfabError for a variant that is not there."""
        _ = self[number]
        del self._all[number]


def differences(one: Preset, other: Preset) -> list[tuple[str, Any, Any]]:
    """Dotted keys whose values differ, and both values; a name makes no difference. Lists are compared as a whole."""
    a, b = (dict(_leaves(preset.model_dump(mode="json", exclude={"name", "description"}))) for preset in (one, other))
    return [(key, a.get(key), b.get(key)) for key in {**a, **b} if a.get(key) != b.get(key)]


def _leaves(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield above + key, value


def _short(name: str) -> str:
    return " ".join(name.split())[:60]
