"""Words on pictures: the caption, the legend of loads and supports, and a scale bar."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dsfab.render.palette import MarkName, Palette
from dsfab.render.scene import Colour
from dsfab.units import MM_PER_M

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw


@dataclass(frozen=True)
class Legend:
    """caption: one line.  names: of the marks, such as 'load' and 'support'.  pixels_per_metre: for the scale bar.

    swatches: names and colours of what the colours tell apart.
    """

    caption: str
    names: list[MarkName]
    pixels_per_metre: float
    swatches: tuple[tuple[str, Colour], ...] = ()


def round_length(longest: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer than `longest` metres."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(step * power for step in (1, 2, 5) if step * power <= longest * (1 + 1e-9)))


def length_label(length: float) -> str:
    """'20 m', '0.5 m', '50 mm'."""
    return f"{length:g} m" if length >= 0.1 else f"{length * MM_PER_M:g} mm"


def lettered(image: "Image", legend: Legend, palette: Palette, larger: float = 1.0) -> "Image":
    """The picture with its words, in the strip below the structure; larger : than on a build's preview, so many
    times."""
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
        words = _shortened(legend.caption, room, draw, letter)
        draw.text((x, base), words, fill=palette.text, font=font, anchor="ls")
    for name in legend.names:
        x = _named(draw, name, palette, (x, above), letter) + 1.4 * letter
    for text, colour in legend.swatches:
        x = _swatch(draw, text, colour, palette, (x, above), letter) + 1.4 * letter
    return image


def _swatch(
    draw: "ImageDraw", text: str, colour: Colour, palette: Palette, at: tuple[float, float], letter: float
) -> float:
    """A small square of a colour and what it stands for; returns where it ends."""
    from PIL import ImageFont

    x, base = at
    side = 0.72 * letter
    draw.rectangle((x, base - side, x + side, base), fill=colour)
    font, start = ImageFont.load_default(size=0.9 * letter), x + side + 0.4 * letter
    draw.text((start, base), text, fill=palette.text, font=font, anchor="ls")
    return start + draw.textlength(text, font=font)


def _shortened(words: str, room: float, draw: "ImageDraw", letter: float) -> str:
    """A caption that fits: what does not is cut off with dots."""
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
    """A bar of a round length that ends at `end`, its length written above; returns its pixels."""
    from PIL import ImageFont

    length = round_length(longest / legend.pixels_per_metre)
    long = length * legend.pixels_per_metre
    right, base = end
    thick, tick = max(letter / 12, 1.0), letter / 3
    left = right - long
    draw.rectangle((left, base - thick, right, base), fill=palette.text)
    for x in (left, right - thick):
        draw.rectangle((x, base - tick, x + thick, base), fill=palette.text)
    font = ImageFont.load_default(size=0.9 * letter)
    draw.text(
        ((left + right) / 2, base - 0.55 * letter), length_label(length), fill=palette.text, font=font, anchor="ms"
    )
    return long


def _named(draw: "ImageDraw", name: MarkName, palette: Palette, at: tuple[float, float], letter: float) -> float:
    """A small sign and its name; returns where it ends."""
    from PIL import ImageFont

    x, base = at
    colour = tuple(int(value) for value in palette.of(name))
    top, half = base - 0.85 * letter, 0.3 * letter
    middle = x + half
    if name == "reaction":
        shaft = max(letter / 20, 0.75)
        draw.rectangle((middle - shaft, top + 0.45 * letter, middle + shaft, base), fill=colour)
        low = top + 0.45 * letter
        tip = [(middle - 0.6 * half, low), (middle + 0.6 * half, low), (middle, top)]
    elif name == "load":
        shaft = max(letter / 20, 0.75)
        draw.rectangle((middle - shaft, top, middle + shaft, base - 0.4 * letter), fill=colour)
        tip = [(middle - 0.6 * half, base - 0.45 * letter), (middle + 0.6 * half, base - 0.45 * letter), (middle, base)]
    else:
        tip = [(middle, top + 0.1 * letter), (middle - half, base), (middle + half, base)]
    draw.polygon(tip, fill=colour)
    font = ImageFont.load_default(size=0.9 * letter)
    start = x + 2 * half + 0.4 * letter
    draw.text((start, base), name, fill=palette.text, font=font, anchor="ls")
    return start + draw.textlength(name, font=font)
