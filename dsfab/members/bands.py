"""What the fields of a pattern draw, as bands with a middle line: stripes, and what is kept besides them."""

from typing import Literal, NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.results import PatternResult
from dsfab.slicing import DrawnBand, Sheet, divided_at_vertices
from dsfab.surface import CornerField, DividedField, Surface

Kind = Literal["strip", "stub", "rim", "band", "ring", "disc", "plate", "fill"]
"""What members are, see `dsfab.members.graph.Member`; what is kept is a "keep" before its shape is known."""
FAMILIES = {"major": "A", "minor": "B"}
"""Letters of the families of stripes."""
FULL = 0.5
"""Half-width in periods at which stripes touch: then there is one sheet, without members."""
NOWHERE = 10.0
"""Where the middle line of a region is that has none: farther away than any of its values."""


class NamedBand(NamedTuple):
    """A band, and what its parts are: "strip" of a family, or "rim", "band", "keep" or "plate"."""

    kind: str
    family: str
    drawn: DrawnBand


def pattern_bands(surface: Surface, sheet: Sheet, pattern: PatternResult) -> list[NamedBand]:
    """One for each field that the sheet was cut by, from `surface`, in their order."""
    found = []
    for k, (name, field, levels) in enumerate(zip(pattern.names, pattern.fields, pattern.levels, strict=True)):
        if name in FAMILIES:
            found.append(NamedBand("strip", name, _striped(sheet, pattern, k)))
            continue
        assert not isinstance(field, CornerField)
        x = divided_at_vertices(sheet, surface, field) if isinstance(field, DividedField) else sheet.carry(field)
        kind, drawn = _kept(f"{name} {k}", x, float(levels[0]))
        found.append(NamedBand(name if kind == "reach" else kind, name, drawn))
    return found


def _striped(sheet: Sheet, pattern: PatternResult, k: int) -> DrawnBand:
    """The stripes of a family: between whole numbers of a phase, as wide as they were drawn."""
    name, field, levels = pattern.names[k], pattern.fields[k], pattern.levels[k]
    if isinstance(field, CornerField):
        return DrawnBand(name, field, levels)
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return DrawnBand(name, sheet.carry(field), levels)
    which, d = list(FAMILIES).index(name), pattern.half_widths[k]
    if (d >= FULL).all():
        return DrawnBand(name, np.tile([1.0, -1.0], (sheet.surface.n, 1)), np.zeros(1), NOWHERE)
    z = pattern.frequency[which] * field + pattern.phase[which]
    whole = np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2)
    return DrawnBand(name, sheet.carry(np.stack([z + d, z - d], axis=1)), whole)


def _kept(name: str, x: Floats, level: float) -> tuple[str, DrawnBand]:
    """What is kept besides the stripes, by values at the vertices of the sheet, and whether that is what is within
    "reach" of something (n,), a "plate" (n,), or a "band" along an outline (n, 2)."""
    zero = np.zeros(1)
    if x.ndim == 2:  # over 0 in the region, and minus the width at its outline
        width = -float(x[:, 1].min())
        inward = np.where(x[:, 0] >= 0, -x[:, 1], x[:, 1] + 2 * width)
        return "band", DrawnBand(name, np.stack([inward, inward - width], axis=1), zero, hides=True)
    if level == 0:
        both = np.stack([x, np.full(len(x), -2.0)], axis=1)
        return "plate", DrawnBand(name, both, zero, NOWHERE, hides=True)
    reach = -level
    return "reach", DrawnBand(name, np.stack([x + reach, x - reach], axis=1), zero, -reach / 2, hides=True)
