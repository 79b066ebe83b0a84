"""A film over one parameter: variants one after another, forth and back, as GIF or WebP."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsfab.errors import DsfabError
from dsfab.render import Palette
from dsfab.report.contact_sheet import Tile
from dsfab.study.variations import Values

if TYPE_CHECKING:
    from PIL.Image import Image

COLOURS = 96
"""Colours of a GIF, the same in all of its pictures, so that what stands still does not flicker."""

HOLD = 4
"""The first and the last picture stand for this many others: one sees where it turns."""


def check_film(values: Values, fps: float) -> None:
    """Raises DsfabError where a film makes no sense: it runs along one key."""
    several = [key for key, listed in values.items() if len(listed) > 1]
    if len(several) != 1:
        raise DsfabError(
            f"--animate runs along one key with several values, here there are {len(several)}"
            + (f" ({', '.join(several)}); vary one of them and --set the others" if several else "")
        )
    if not 0.1 <= fps <= 50:
        raise DsfabError(f"--fps {fps:g} is not between 0.1 and 50 pictures a second; write for instance 8")


def write_film(tiles: Sequence[Tile], path: Path, name: str, fps: float, palette: Palette) -> None:
    """Write the pictures of the tiles with their parameters below, forth and back without end; impossible ones are
    left away."""
    frames = [_frame(shown, tile.label(), name, palette) for tile in tiles if (shown := tile.picture) is not None]
    turned = [*range(len(frames)), *range(len(frames) - 2, 0, -1)]
    ends = {0, len(frames) - 1}
    long = [round(1000 / fps * (HOLD if place in ends else 1)) for place in turned]
    if path.suffix == ".gif":
        frames = _of_few_colours(frames)
    first, *rest = [frames[place] for place in turned]
    lossy = {"quality": 85, "method": 4} if path.suffix == ".webp" else {"disposal": 1}
    first.save(path, save_all=True, append_images=rest, duration=long, loop=0, **lossy)


def _frame(picture: "Image", label: str, name: str, palette: Palette) -> "Image":
    from PIL import Image, ImageDraw, ImageFont

    letter = max(picture.height / 32, 10.0)
    page = Image.new("RGB", (picture.width, picture.height + round(3 * letter)), palette.paper)
    page.paste(picture, (0, 0))
    draw, base = ImageDraw.Draw(page), picture.height + 1.3 * letter
    font = ImageFont.load_default(size=letter)
    draw.text((0.035 * page.width, base), label, fill=palette.text, font=font, anchor="ls")
    draw.text((0.965 * page.width, base), name, fill=palette.text, font=font, anchor="rs")
    return page


def _of_few_colours(frames: "list[Image]") -> "list[Image]":
    """The frames in the colours that suit all of them: found on a strip of a few."""
    from PIL import Image

    some = frames[:: max(1, len(frames) // 4)]
    strip = Image.new("RGB", (some[0].width, sum(one.height for one in some)))
    for place, one in enumerate(some):
        strip.paste(one, (0, place * one.height))
    chosen = strip.quantize(COLOURS)
    return [one.quantize(palette=chosen, dither=Image.Dither.NONE) for one in frames]
