"""Colours and lettering of pictures."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.units import MM_PER_M
from dsfab.render.scene import Bytes, Colour

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

MarkName = Literal["load", "support", "reaction", "person", "masonry", "tension", "compression", "gradient"]


@dataclass(frozen=True)
class Palette:
    """Colours of a picture: red, green and blue in 0..255.
    families : colours of major members, minor members, kept regions.    ink : darkness of lines, 0 to 1."""

    paper: Colour = (253, 252, 249)
    shadow: Colour = (118, 112, 110)
    members: Colour = (220, 156, 122)
    families: tuple[Colour, ...] = ((220, 156, 122), (236, 196, 140), (176, 110, 92))
    load: Colour = (32, 84, 168)
    support: Colour = (58, 74, 70)
    reaction: Colour = (134, 62, 140)
    plain: Colour = (232, 227, 218)
    person: Colour = (146, 145, 148)
    masonry: Colour = (186, 185, 181)
    tension: Colour = (200, 48, 40)
    compression: Colour = (28, 92, 176)
    gradient: Colour = (20, 112, 44)
    tints: tuple[Colour, Colour, Colour] = ((208, 104, 76), (78, 128, 172), (196, 188, 176))
    text: Colour = (56, 54, 52)
    ink: float = 0.45

    def colour_bytes(self, name: MarkName) -> Bytes:
        return np.array(getattr(self, name), dtype=np.uint8)


PAPER = Palette()  # terracotta on white; colour-blind people can distinguish blue loads and slate-grey supports


@dataclass(frozen=True)
class Legend:
    """Caption, names of marks, pixels per metre, and swatches: colours with names."""

    caption: str
    names: list[MarkName]
    pixels_per_metre: float
    swatches: tuple[tuple[str, Colour], ...] = ()


def round_length(longest: float) -> float:
    """Return the largest round length up to `longest` metres: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(step * power for step in (1, 2, 5) if step * power <= longest * (1 + 1e-9)))


def length_label(length: float) -> str:
    """Return a length in words: "20 m", "0.5 m", "50 mm"."""
    return f"{length:g} m" if length >= 0.1 else f"{length * MM_PER_M:g} mm"


def with_legend(image: "Image", legend: Legend, palette: Palette, larger: float = 1.0) -> "Image":
    """Return the picture with caption, marks and scale bar. larger : factor on the default size of letters."""
    from PIL import ImageDraw, ImageFont

    width, height = image.size
    letter = larger * max(height / 46, 9.0)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(size=letter)
    margin, base = 0.035 * width, height - 1.5 * letter
    bar = _scale_bar(draw, legend, palette, (width - margin, base), letter, 0.16 * width)
    x, above = margin, base - (1.9 * letter if legend.caption or larger == 1.0 else 0.0)
    if legend.caption:
        room = width - 2 * margin - bar - letter
        words = _shortened_caption(legend.caption, room, draw, letter)
        draw.text((x, base), words, fill=palette.text, font=font, anchor="ls")
    for name in legend.names:
        x = _mark_sign(draw, name, palette, (x, above), letter) + 1.4 * letter
    for text, colour in legend.swatches:
        x = _swatch(draw, text, colour, palette, (x, above), letter) + 1.4 * letter
    return image


def _swatch(
    draw: "ImageDraw", text: str, colour: Colour, palette: Palette, place: tuple[float, float], letter: float
) -> float:
    from PIL import ImageFont

    x, base = place
    side = 0.72 * letter
    draw.rectangle((x, base - side, x + side, base), fill=colour)
    font, start = ImageFont.load_default(size=0.9 * letter), x + side + 0.4 * letter
    draw.text((start, base), text, fill=palette.text, font=font, anchor="ls")
    return start + draw.textlength(text, font=font)


def _shortened_caption(words: str, room: float, draw: "ImageDraw", letter: float) -> str:
    from PIL import ImageFont

    font = ImageFont.load_default(size=letter)
    if draw.textlength(words, font=font) <= room:
        return words
    while words and draw.textlength(words + "...", font=font) > room:
        words = words[:-1]
    return words.rstrip(" ,-") + "..."


def _scale_bar(
    draw: "ImageDraw", legend: Legend, palette: Palette, end: tuple[float, float], letter: float, longest: float
) -> float:
    from PIL import ImageFont

    length = round_length(longest / legend.pixels_per_metre)
    bar_pixels = length * legend.pixels_per_metre
    right_end, base = end
    thick, tick = max(letter / 12, 1.0), letter / 3
    left_end = right_end - bar_pixels
    draw.rectangle((left_end, base - thick, right_end, base), fill=palette.text)
    for x in (left_end, right_end - thick):
        draw.rectangle((x, base - tick, x + thick, base), fill=palette.text)
    font = ImageFont.load_default(size=0.9 * letter)
    above = (left_end + right_end) / 2, base - 0.55 * letter
    draw.text(above, length_label(length), fill=palette.text, font=font, anchor="ms")
    return bar_pixels


def _mark_sign(draw: "ImageDraw", name: MarkName, palette: Palette, place: tuple[float, float], letter: float) -> float:
    from PIL import ImageFont

    x, base = place
    colour = tuple(int(value) for value in palette.colour_bytes(name))
    top, half = base - 0.85 * letter, 0.3 * letter
    middle, shaft = x + half, max(letter / 20, 0.75)
    if name == "reaction":
        low = top + 0.45 * letter
        draw.rectangle((middle - shaft, low, middle + shaft, base), fill=colour)
        tip = [(middle - 0.6 * half, low), (middle + 0.6 * half, low), (middle, top)]
    elif name == "load":
        draw.rectangle((middle - shaft, top, middle + shaft, base - 0.4 * letter), fill=colour)
        tip = [(middle - 0.6 * half, base - 0.45 * letter), (middle + 0.6 * half, base - 0.45 * letter), (middle, base)]
    else:
        tip = [(middle, top + 0.1 * letter), (middle - half, base), (middle + half, base)]
    draw.polygon(tip, fill=colour)
    font = ImageFont.load_default(size=0.9 * letter)
    start = x + 2 * half + 0.4 * letter
    draw.text((start, base), name, fill=palette.text, font=font, anchor="ls")
    return start + draw.textlength(name, font=font)


GRID_PIXELS = 4  # cell size (pixels) of the grid that records occupied areas
NAME_DISTANCES = np.arange(1.5, 30.0, 1.0)  # distances from a member at which a name is tried, in letter heights
NAME_DIRECTIONS = np.linspace(0, 2 * np.pi, 16, endpoint=False)  # angles around a member at which a name is tried


@dataclass(frozen=True, eq=False)
class Nameplate:
    """Name of a member to write into a picture. places : (k, 2) possible places, pixels, the best first.
    visible : (k,) True for places that nothing hides."""

    text: str
    colour: Colour
    places: Floats
    visible: Bools


@dataclass(frozen=True, eq=False)
class PlacedName:
    """Name in a picture, in pixels. middle : (2,) centre of the letters.    anchor : (2,) named point on the member."""

    plate: Nameplate
    middle: Floats
    anchor: Floats


def place_names(plates: list[Nameplate], size: tuple[int, int], letter: float) -> list[PlacedName]:
    """Return a place for each member's name. letter : letter height (px)."""
    taken = np.zeros((size[1] // GRID_PIXELS + 2, size[0] // GRID_PIXELS + 2), dtype=bool)
    names = []
    for plate in sorted(plates, key=lambda one: (int(one.visible.sum()), len(one.places))):
        half = np.array([0.31 * letter * len(plate.text) + 2, 0.5 * letter + 1])
        candidates = plate.places[plate.visible] if plate.visible.any() else plate.places
        anchor, middle = _free_place(taken, candidates, half, letter)
        if (window := _grid_window(taken, middle, half)) is not None:
            taken[window] = True
        names.append(PlacedName(plate, middle, anchor))
    return names


def _free_place(taken: Bools, places: Floats, half: Floats, letter: float) -> tuple[Floats, Floats]:
    for place in places:
        if not _is_taken(taken, place, half):
            return place, place
    around = np.stack([np.cos(NAME_DIRECTIONS), np.sin(NAME_DIRECTIONS)], axis=1)
    few = places[:: max(len(places) // 5, 1)]
    for away in NAME_DISTANCES * letter:
        for place in few:
            for middle in place + away * around:
                if not _is_taken(taken, middle, half):
                    return place, middle
    return places[0], places[0]


def _grid_window(taken: Bools, middle: Floats, half: Floats) -> tuple[slice, slice] | None:
    low, high = np.floor((middle - half) / GRID_PIXELS).astype(int), np.ceil((middle + half) / GRID_PIXELS).astype(int)
    if (low < 0).any() or high[0] >= taken.shape[1] or high[1] >= taken.shape[0]:
        return None
    return slice(low[1], high[1] + 1), slice(low[0], high[0] + 1)


def _is_taken(taken: Bools, middle: Floats, half: Floats) -> bool:
    window = _grid_window(taken, middle, half)
    return window is None or bool(taken[window].any())


def with_names(image: "Image", names: list[PlacedName], letter: float, paper: Colour) -> "Image":
    """Return the picture with `names` written on it. letter : height of letters, pixels."""
    from PIL import ImageDraw, ImageFont

    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=letter)
    line, rim = max(round(letter / 12), 1), max(round(letter / 6), 1)
    for placed in names:
        if not np.array_equal(placed.middle, placed.anchor):
            draw.line((*placed.anchor.tolist(), *placed.middle.tolist()), fill=placed.plate.colour, width=line)
    for placed in names:
        position, words = (float(placed.middle[0]), float(placed.middle[1])), placed.plate
        draw.text(position, words.text, fill=words.colour, font=font, anchor="mm", stroke_width=rim, stroke_fill=paper)
    return image
