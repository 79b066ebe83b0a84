"""Places on a picture, each with a ring around it and words in a row above the structure that a line leads to."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from dsfab.arrays import Floats
from dsfab.render.drawing import FINER
from dsfab.render.palette import Palette
from dsfab.render.scene import Colour
from dsfab.render.view import View

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

ROW = 0.66
"""The words stand above this height of the page, where -1 is its lower edge and 1 its upper one."""


@dataclass(frozen=True, eq=False)
class Callout:
    """place (3,), metres; what it is in two lines; the colour of both."""

    place: Floats
    lines: tuple[str, str]
    colour: Colour


def called_out(image: "Image", callouts: list[Callout], view: View, palette: Palette) -> "Image":
    """The picture with the callouts, their words in such an order that the lines are short, and so do not cross.

    Rings are drawn over everything: a place on the far side has one too.
    """
    from PIL import Image, ImageDraw, ImageFont

    if not callouts:
        return image
    width, height = FINER * np.array(image.size)
    letter = max(height / 46, FINER * 9.0)
    over = Image.new("RGBA", (int(width), int(height)))
    draw, font = ImageDraw.Draw(over), ImageFont.load_default(size=0.95 * letter)
    seen = view.seen(np.array([one.place for one in callouts]))
    spots = np.stack([width / 2 + seen[:, 0] * height / 2, height / 2 - seen[:, 1] * height / 2], axis=1)
    base = 2.2 * letter
    words = np.stack([(np.arange(len(spots)) + 0.5) * width / len(spots), np.full(len(spots), base)], axis=1)
    for k, which in zip(*linear_sum_assignment(cdist(words, spots)), strict=True):
        one, middle = callouts[which], float(words[k, 0])
        for number, text in enumerate(one.lines):
            at = (middle, base + 1.3 * letter * number)
            draw.text(at, text, fill=one.colour if number == 0 else palette.text, font=font, anchor="ms")
        _lead(draw, np.array([middle, base + 1.9 * letter]), spots[which], 0.9 * letter, one.colour)
    return Image.alpha_composite(image.convert("RGBA"), over.reduce(FINER)).convert(image.mode)


def _lead(draw: "ImageDraw", start: Floats, end: Floats, radius: float, colour: Colour) -> None:
    """A line from the words to a ring."""
    far = max(float(np.linalg.norm(end - start)), np.finfo(float).tiny)
    edge = start + max(1 - radius / far, 0.0) * (end - start)
    stroke = max(round(radius / 9), 1)
    draw.line((*start.tolist(), *edge.tolist()), fill=colour, width=stroke)
    draw.ellipse((*(end - radius).tolist(), *(end + radius).tolist()), outline=colour, width=2 * stroke)
