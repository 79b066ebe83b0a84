"""Parts as drawings: what is cut, drilled and engraved, each on its own layer."""

from collections.abc import Iterator, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.export import FlatCircle, FlatDrawing, FlatLine
from dsfab.surface import simplified_line
from dsfab.workshop.parts import FlatPart

TOLERANCE = 2e-5
"""Metres that a drawn outline may be off the part's."""


def part_drawing(part: FlatPart) -> FlatDrawing:
    """A part alone, with its middle line on a layer of its own, AXIS, which is not to be cut."""
    axis = [FlatLine("AXIS", part.axis)] if len(part.axis) else []
    return FlatDrawing(part.id, (*part_lines(part), *axis), part_circles(part))


def part_lines(part: FlatPart) -> Iterator[FlatLine]:
    """Outline, openings and engraved lines of a part."""
    yield FlatLine("CUT", _closed(part.outline), closed=True)
    yield from (FlatLine("SLOTS", _closed(slot), closed=True) for slot in part.slots)
    yield from (FlatLine("ENGRAVE", mark) for mark in part.marks)


def part_circles(part: FlatPart) -> tuple[FlatCircle, ...]:
    """The holes of a part."""
    return tuple(FlatCircle("HOLES", (float(h.at[0]), float(h.at[1])), h.diameter) for h in part.holes)


def _closed(P: Floats) -> Floats:
    """(k, 2) corners of a closed polygon, without those that lie on a line with others."""
    space: Sequence[Floats] = (P, P[:1])
    return simplified_line(np.pad(np.concatenate(space), ((0, 0), (0, 1))), TOLERANCE)[:-1, :2]
