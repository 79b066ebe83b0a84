"""What colour a face of a preview has, and the bar that explains it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from dsfab.app.palette import Palette
from dsfab.app.scene import Bytes
from dsfab.arrays import Floats
from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from PIL.Image import Image

    from dsfab.design import Design, Draft

Show = Literal["structure", "stress", "major", "minor", "loads"]

STEEPEST = 98.0
"""Colours end at this percentile of the stress: single points under loads and supports would hide the rest."""

# compression, none, tension: blue and red, as engineers are used to, of equal darkness and safe for colour-blind eyes
_DIVERGING = np.array(
    [(33, 80, 140), (84, 140, 190), (166, 200, 222), (240, 236, 228), (238, 190, 160), (210, 110, 80), (150, 38, 40)],
    dtype=np.float64,
)


@dataclass(frozen=True, eq=False)
class Bar:
    """A scale of colours from `-limit` to `limit`, Pa."""

    limit: float


@dataclass(frozen=True, eq=False)
class Colouring:
    """face (m, 3) bytes; bar: what explains them, if they need it."""

    face: Bytes
    bar: Bar | None = None


def check_show(show: str) -> None:
    """Raises DsfabError for what cannot be shown."""
    if show not in get_args(Show):
        raise DsfabError(f"show {show!r} is not known; use one of {', '.join(get_args(Show))}")


def coloured(design: "Design | Draft", show: str, palette: Palette) -> Colouring:
    """The colours of the uncut surface's faces.

    stress is the principal stress of larger size on each face, tension positive.
    """
    if show == "stress":
        principal = design.diffusion.tensors.principal
        value = np.take_along_axis(principal, np.abs(principal).argmax(axis=1)[:, None], axis=1)[:, 0]
        limit = float(np.percentile(np.abs(value), STEEPEST)) or 1.0
        return Colouring(diverging(value / limit), Bar(limit))
    colour = {"major": palette.families[0], "minor": palette.families[2], "loads": palette.plain}
    one = np.array(colour.get(show, palette.members), dtype=np.uint8)
    return Colouring(np.broadcast_to(one, (design.surface.m, 3)))


def diverging(share: Floats) -> Bytes:
    """(k, 3) colours for shares from -1 (compression) to 1 (tension)."""
    place = (np.clip(share, -1, 1) + 1) / 2 * (len(_DIVERGING) - 1)
    known = np.arange(len(_DIVERGING))
    return np.stack([np.interp(place, known, channel) for channel in _DIVERGING.T], axis=1).astype(np.uint8)


def stress_label(pascals: float) -> str:
    """'12 MPa', '350 kPa', '0 Pa', with three digits."""
    size = abs(pascals)
    factor, unit = next(((f, u) for f, u in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa")) if size >= f), (1.0, "Pa"))
    return f"{pascals / factor:.3g} {unit}"


def with_bar(image: "Image", bar: Bar, palette: Palette) -> "Image":
    """The picture with the scale of colours above its caption, on the left."""
    from PIL import Image, ImageDraw, ImageFont

    width, height = image.size
    letter = max(height / 46, 9.0)
    left, base, long = 0.035 * width, height - 6.6 * letter, round(0.22 * width)
    ramp = np.broadcast_to(diverging(np.linspace(-1, 1, long)), (max(round(0.55 * letter), 4), long, 3))
    image.paste(Image.fromarray(np.ascontiguousarray(ramp)), (round(left), round(base)))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=0.9 * letter)
    top, below, label = base - 0.5 * letter, base + 1.55 * letter, stress_label(bar.limit)
    draw.text((left, top), "compression", fill=palette.text, font=font, anchor="ls")
    draw.text((left + long, top), "tension", fill=palette.text, font=font, anchor="rs")
    for share, text, anchor in ((0.0, f"-{label}", "ls"), (0.5, "0", "ms"), (1.0, label, "rs")):
        draw.text((left + share * long, below), text, fill=palette.text, font=font, anchor=anchor)
    return image
