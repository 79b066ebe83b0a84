"""Where the names of members stand on a picture: each beside its member, where that is seen, and none on another.

A name stands on its member if a place along it is free, as near to its middle as can be; else beside it, on a short
line. Members with few free places come first.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.render.scene import Colour

if TYPE_CHECKING:
    from PIL.Image import Image

GRID = 4
"""Pixels of the grid on which what is taken is kept."""
AWAY = np.arange(1.5, 30.0, 1.0)
"""How far beside a member a name may stand, in heights of a letter."""
TURNS = np.linspace(0, 2 * np.pi, 16, endpoint=False)
"""In which directions."""


@dataclass(frozen=True, eq=False)
class Nameplate:
    """What is to be written, in which colour, and the places (k, 2) on the picture at which it may, best first, pixels.

    seen : (k,) whether nothing is in front of them.
    """

    text: str
    colour: Colour
    places: Floats
    seen: Bools


@dataclass(frozen=True, eq=False)
class PlacedName:
    """A name, the middle (2,) of its letters and the place (2,) on its member that it stands for, pixels."""

    plate: Nameplate
    middle: Floats
    anchor: Floats


def placed_names(plates: list[Nameplate], size: tuple[int, int], letter: float) -> list[PlacedName]:
    """Where all of them stand on a picture of a size, with letters so high, pixels."""
    taken = np.zeros((size[1] // GRID + 2, size[0] // GRID + 2), dtype=bool)
    found = []
    for plate in sorted(plates, key=lambda one: (int(one.seen.sum()), len(one.places))):
        half = np.array([0.31 * letter * len(plate.text) + 2, 0.5 * letter + 1])
        first = plate.places[plate.seen] if plate.seen.any() else plate.places
        anchor, middle = _free(taken, first, half, letter)
        _take(taken, middle, half)
        found.append(PlacedName(plate, middle, anchor))
    return found


def _free(taken: Bools, places: Floats, half: Floats, letter: float) -> tuple[Floats, Floats]:
    """The place (2,) of (k, 2) that a name with half sizes (2,) stands for, and the free middle for its letters."""
    for place in places:
        if not _is_taken(taken, place, half):
            return place, place
    around = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)
    few = places[:: max(len(places) // 5, 1)]
    for away in AWAY * letter:
        for place in few:
            for middle in place + away * around:
                if not _is_taken(taken, middle, half):
                    return place, middle
    return places[0], places[0]


def _window(taken: Bools, middle: Floats, half: Floats) -> tuple[slice, slice] | None:
    """The part of the grid that a name takes; None where it would leave the picture."""
    low, high = np.floor((middle - half) / GRID).astype(int), np.ceil((middle + half) / GRID).astype(int)
    if (low < 0).any() or high[0] >= taken.shape[1] or high[1] >= taken.shape[0]:
        return None
    return slice(low[1], high[1] + 1), slice(low[0], high[0] + 1)


def _is_taken(taken: Bools, middle: Floats, half: Floats) -> bool:
    window = _window(taken, middle, half)
    return window is None or bool(taken[window].any())


def _take(taken: Bools, middle: Floats, half: Floats) -> None:
    if (window := _window(taken, middle, half)) is not None:
        taken[window] = True


def with_names(image: "Image", names: list[PlacedName], letter: float, paper: Colour) -> "Image":
    """The picture with names, in letters so high, pixels, on a rim of the colour of paper."""
    from PIL import ImageDraw, ImageFont

    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=letter)
    line, rim = max(round(letter / 12), 1), max(round(letter / 6), 1)
    for one in names:
        if not np.array_equal(one.middle, one.anchor):
            draw.line((*one.anchor.tolist(), *one.middle.tolist()), fill=one.plate.colour, width=line)
    for one in names:
        at, words = (float(one.middle[0]), float(one.middle[1])), one.plate
        draw.text(at, words.text, fill=words.colour, font=font, anchor="mm", stroke_width=rim, stroke_fill=paper)
    return image
