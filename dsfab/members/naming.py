"""Names of components: letters for families, numbers along the structure."""

from collections.abc import Sequence
from string import ascii_lowercase

import numpy as np

from dsfab.arrays import Floats
from dsfab.members.bands import FAMILIES
from dsfab.members.components import Component
from dsfab.members.order import along_structure
from dsfab.surface import Surface

KINDS = ("rim", "band", "ring", "disc", "plate", "fill")
"""Members besides strips, in the order in which they are listed."""


def named(surface: Surface, found: Sequence[Component]) -> list[tuple[str, int, Component]]:
    """Names, parts and components in the order of their names: "A01", "A02a", "A02b", ..., "B01", ..., "rim 1".

    surface : whose cells components have.
    """
    listed = list[tuple[str, int, Component]]()
    for letter, some in _kinds(found):
        groups = _groups(some) if len(letter) == 1 else [[one] for one in some]
        places = np.array([_place(surface, group) for group in groups]).reshape(-1, 3)
        lengths = np.array([sum(one.line.length if one.line else 0.0 for one in group) for group in groups])
        digits = len(str(max(len(groups), 10)))
        for number, k in enumerate(along_structure(places, lengths, surface.size).tolist(), 1):
            group = groups[k]
            label = f"{letter}{number:0{digits}d}" if len(letter) == 1 else f"{letter} {number}"
            for part, one in enumerate(group, 1):
                listed.append((label + (_letters(part) if len(group) > 1 else ""), part, one))
    return listed


def _kinds(found: Sequence[Component]) -> list[tuple[str, list[Component]]]:
    """What is named alike: the families by their letters, then the other kinds."""
    strips = [one for one in found if one.kind == "strip"]
    families = [(letter, [one for one in strips if one.family == name]) for name, letter in FAMILIES.items()]
    return families + [(kind, [one for one in found if one.kind == kind]) for kind in KINDS]


def _groups(some: list[Component]) -> list[list[Component]]:
    """The parts of one stripe together."""
    groups: dict[int, list[Component]] = {}
    for number, one in enumerate(some):
        groups.setdefault(one.group if one.group >= 0 else -1 - number, []).append(one)
    return list(groups.values())


def _place(surface: Surface, group: list[Component]) -> Floats:
    """(3,) the centroid of components, metres."""
    cells = np.concatenate([one.cells for one in group])
    return np.asarray(surface.areas[cells] @ surface.centroids[cells] / surface.areas[cells].sum())


def _letters(part: int) -> str:
    """a, b, ..., z, aa, ab, ..."""
    text = ""
    while part:
        part, digit = divmod(part - 1, len(ascii_lowercase))
        text = ascii_lowercase[digit] + text
    return text
