"""What is drawn of one plank: its outline with slots and ends, and what is engraved on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.workshop.development import Development
from dsfab.workshop.ground import STEEP, Ground
from dsfab.workshop.layering import END, Layering
from dsfab.workshop.letters import text_length
from dsfab.workshop.parts import label
from dsfab.workshop.planks.slots import Slot
from dsfab.workshop.splices import SCARF
from dsfab.workshop.strips import letter_height

PAST = 3.0
"""Thicknesses that a plank goes on beyond its last node, at least."""

Ends = tuple[tuple[float, float], tuple[float, float]]
"""Arc lengths of a beginning, then of an end, at the right and left edges of a plank."""


@dataclass(frozen=True)
class PlankStock:
    """Thickness and depth of planks, and diameter of the bolts of splices, metres; the height of letters, at most.

    splice : "cover", "scarf" or "none".
    """

    thickness: float
    depth: float
    bolt: float
    splice: str
    letters: tuple[float, float]

    @property
    def layering(self) -> Layering:
        """How far cover plates and their bolts reach."""
        return Layering(self.thickness, 2, self.bolt)

    @property
    def past(self) -> float:
        """Metres beyond the last node."""
        return max(PAST * self.thickness, END * self.bolt)

    @property
    def lap(self) -> float:
        """Metres that two pieces overlap by."""
        return SCARF * self.thickness if self.splice == "scarf" else 0.0

    @property
    def reach(self) -> float:
        """Metres from a splice to the end of what belongs to it."""
        return self.layering.half_cover if self.splice == "cover" else max(self.lap / 2, self.past)


def level_cut(layer: Development, ground: Ground, at: float, last: bool, depth: float) -> tuple[float, float] | None:
    """Arc lengths at the right and at the left edge where a plank that ends near a support is cut along the ground
    there; None for others, and where it comes down less steeply than 25 degrees."""
    point = layer.course.at(np.array([at]))[0][0]
    height = ground.height_near(point, depth)
    way = layer.frame(np.array([at]))[1][0] * (1 if last else -1)
    if height is None or -way @ ground.up < STEEP:
        return None
    found = ground.meeting(layer, np.array([-depth / 2, depth / 2]), at, height)
    return None if found is None else (float(found[0]), float(found[1]))


def plank_outline(layer: Development, ends: Ends, slots: Sequence[Slot], depth: float) -> Floats:
    """(k, 2) counter-clockwise, from the right edge at the beginning."""
    (a, b), (c, d) = ends
    right = _notched(layer, (a, c), -depth / 2, [slot for slot in slots if not slot.above])
    left = _notched(layer, (b, d), depth / 2, [slot for slot in slots if slot.above])
    return np.concatenate([right, left[::-1]])


def _notched(layer: Development, span: tuple[float, float], edge: float, slots: Sequence[Slot]) -> Floats:
    """(k, 2) an edge of a plank, metres over its axis, over a span, with its slots."""
    s = layer.stations(*span)
    found, first = list[Floats](), 0
    for slot in slots:
        stretch = 1 - edge * float(np.interp(slot.s, layer.course.s, layer.course.kg))
        low, high = (slot.s + x / stretch for x in slot.mouth(edge))
        before = s[first:][s[first:] < low]
        first = int(np.searchsorted(s, high, side="right"))
        bottom = np.array([slot.s - slot.half, slot.s + slot.half])
        found += [layer.flat(before, np.full(len(before), edge)), layer.flat(np.array([low]), np.array([edge]))]
        found += [layer.flat(bottom, np.full(2, slot.y)), layer.flat(np.array([high]), np.array([edge]))]
    return np.concatenate([*found, layer.flat(s[first:], np.full(len(s) - first, edge))])


def plank_marks(
    layer: Development, name: str, span: tuple[float, float], slots: Sequence[Slot], stock: PlankStock
) -> tuple[Floats, ...]:
    """The name of a piece in the middle of its longest bay, and at each slot that of its node, on the other half."""
    stops = np.array([span[0], *(slot.s for slot in slots), span[1]])
    longest = int(np.diff(stops).argmax())
    middle = (stops[longest] + stops[longest + 1]) / 2
    at, angle = layer.at(np.array([middle]))
    wide = max((slot.half for slot in slots), default=0.0)
    room = (stops[longest + 1] - stops[longest]) / 2 - wide - stock.bolt
    found = list(label(name, at[0], float(angle[0]), letters_within(name, stock, max(room, stock.bolt))))
    small = min(letter_height(stock.depth, stock.letters[1]), stock.depth / 5)
    for slot in slots:
        long = text_length(slot.node, small)
        others = [one for one in slots if one is not slot and one.above != slot.above]
        if all(abs(one.s - slot.s) > long / 2 + 1.5 * one.half for one in others):
            y = stock.depth / 4 * (-1 if slot.above else 1)
            at, angle = layer.at(np.array([slot.s]))
            place = at[0] + y * np.array([-np.sin(angle[0]), np.cos(angle[0])])
            found += label(slot.node, place, float(angle[0]), small)
    return tuple(found)


def letters_within(name: str, stock: PlankStock, room: float) -> float:
    """Of letters that fit into metres on both sides of their middle."""
    high = letter_height(stock.depth, stock.letters[0])
    return high * min(1.0, 2 * room / text_length(name, high))
