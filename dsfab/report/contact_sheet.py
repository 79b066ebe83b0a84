"""Contact sheets and films of many variants."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.render import Palette
from dsfab.report.html_pages import html_page, image_tag, reason_paragraph
from dsfab.study.variations import Values

if TYPE_CHECKING:
    from PIL.Image import Image

GAP, MARGIN, FOOT, HEAD = 22, 48, 54, 104  # pixels between tiles, around the sheet, for a tile's label, for the title
MAX_COLUMNS = 8  # Largest number of tiles in a row.
PAGE_NAME, SHEET_NAME = "index.html", "sheet.png"


@dataclass(frozen=True, eq=False)
class ContactTile:
    """A variant of a design on a contact sheet. number : from 1.
    command : command line that makes the variant.    png : content of a PNG file; None after an error."""

    number: int
    parameters: tuple[tuple[str, str], ...]
    command: str
    png: bytes | None
    error: str = ""

    @property
    def picture(self) -> "Image | None":
        """The picture, decoded at each access."""
        from PIL import Image

        return None if self.png is None else Image.open(BytesIO(self.png))

    @property
    def file(self) -> str:
        """Name of the file for the picture."""
        return f"{self.number:03}.png"

    def label(self, letters: int | None = None) -> str:
        """Return the parameters as a text line. letters : length of words in shortened names; None for full names."""
        names = (".".join(word[:letters] for word in name.split(".")) for name, _ in self.parameters)
        return "   ".join(f"{name} {text}" for name, (_, text) in zip(names, self.parameters, strict=True))


def column_count(count: int, runs: Sequence[int]) -> int:
    """Return the number of tiles in a row, for `count` tiles. runs : number of values of each varied preset key."""
    row, columns_of_runs = 1, 1
    for run in reversed(runs[1:]):
        row *= run
        columns_of_runs = row if row <= MAX_COLUMNS else columns_of_runs
    return columns_of_runs if columns_of_runs > 1 else min(count, MAX_COLUMNS, int(np.ceil(np.sqrt(1.3 * count))))


def contact_sheet(
    tiles: Sequence[ContactTile],
    title: str,
    subtitle: str,
    columns: int,
    tile_width: int,
    aspect: float,
    palette: Palette,
) -> "Image":
    """Return a sheet of tiles with title and subtitle. tile_width : pixels.    aspect : width / height of a tile."""
    from PIL import Image, ImageDraw, ImageFont

    tile_height, rows = round(tile_width / aspect), -(-len(tiles) // columns)
    width = max(2 * MARGIN + columns * tile_width + (columns - 1) * GAP, 520)
    height = MARGIN + HEAD + rows * (tile_height + FOOT + GAP) - GAP + MARGIN // 2
    sheet = Image.new("RGB", (width, height), palette.paper)
    draw = ImageDraw.Draw(sheet)
    draw.text((MARGIN, MARGIN + 6), title, fill=palette.text, font=ImageFont.load_default(size=34), anchor="lt")
    grey = _mixed_colour(palette.text, palette.paper, 0.35)
    font = ImageFont.load_default(size=17)
    draw.text((MARGIN, MARGIN + 56), _shortened(subtitle, width - 2 * MARGIN, font), fill=grey, font=font, anchor="lt")
    for place, tile in enumerate(tiles):
        x = MARGIN + place % columns * (tile_width + GAP)
        y = MARGIN + HEAD + place // columns * (tile_height + FOOT + GAP)
        _paste_tile(sheet, tile, (x, y), (tile_width, tile_height), palette)
    return sheet


def _paste_tile(
    sheet: "Image", tile: ContactTile, corner: tuple[int, int], size: tuple[int, int], palette: Palette
) -> None:
    from PIL import Image, ImageDraw, ImageFont

    draw, (x, y), (wide, high) = ImageDraw.Draw(sheet), corner, size
    hair, grey = _mixed_colour(palette.text, palette.paper, 0.86), _mixed_colour(palette.text, palette.paper, 0.5)
    if (picture := tile.picture) is None:
        small = ImageFont.load_default(size=15)
        lines = _wrapped_lines(tile.error, wide - 48, small)[: max(1, high // 22 - 2)]
        draw.rectangle((x, y, x + wide - 1, y + high - 1), outline=hair)
        middle, text = (x + wide / 2, y + high / 2), "\n".join(lines)
        draw.multiline_text(middle, text, fill=grey, font=small, anchor="mm", align="center", spacing=6)
    else:
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), corner)
    draw.line((x, y + high + 6, x + wide - 1, y + high + 6), fill=hair)
    number, font = f"{tile.number:03}", ImageFont.load_default(size=17)
    base = y + high + 30
    draw.text((x + wide - 2, base), number, fill=grey, font=font, anchor="rs")
    draw.text((x + 2, base), tile_label(tile, wide - 50, font), fill=palette.text, font=font, anchor="ls")


def _mixed_colour(start: tuple[int, int, int], end: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    r, g, b = (round(p + share * (q - p)) for p, q in zip(start, end, strict=True))
    return r, g, b


def tile_label(tile: ContactTile, room: float, font: Any) -> str:
    """Return the label of a tile, shortened to fit into `room` (pixels)."""
    labels = (tile.label(letters) for letters in (None, 6, 5, 4, 3, 2, 1))
    return next((text for text in labels if font.getlength(text) <= room), _shortened(tile.label(1), room, font))


def _shortened(text: str, room: float, font: Any) -> str:
    if font.getlength(text) <= room:
        return text
    while text and font.getlength(text + "...") > room:
        text = text[:-1]
    return text.rstrip() + "..."


def _wrapped_lines(text: str, room: float, font: Any) -> list[str]:
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def contact_page(tiles: Sequence[ContactTile], title: str, subtitle: str, columns: int) -> str:
    """Return the contact sheet as HTML, without the pictures."""
    figures = "\n".join(_figure(tile) for tile in tiles)
    body = f"<header><h1>{escape(title)}</h1><p>{escape(subtitle)}</p></header>\n<main>\n{figures}\n</main>\n{_FOOT}"
    across = columns if columns <= 4 else next((k for k in (4, 3) if columns % k == 0), 4)
    return html_page(title, body, _STYLE.replace("ACROSS", str(across)))


def _figure(tile: ContactTile) -> str:
    terms = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(text)}</dd></div>" for name, text in tile.parameters)
    if (picture := tile.picture) is None:
        shown = reason_paragraph(tile.error)
    else:
        inside = image_tag(tile.file, f"Variant {tile.number}: {tile.label()}", picture.size)
        shown = f'<a href="{tile.file}">{inside}</a>'
    return (
        f'<figure id="v{tile.number:03}">{shown}<figcaption><span class="number">{tile.number:03}</span>'
        f"<dl>{terms}</dl><code>{escape(tile.command)}</code></figcaption></figure>"
    )


def pictures_on_page(folder: Path) -> set[str]:
    """Return the file names of the pictures in the index.html of a folder."""
    try:
        return set(re.findall(r'src="(\d{3,}\.png)"', (folder / PAGE_NAME).read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError):
        return set()


def save(tiles: Sequence[ContactTile], folder: Path) -> None:
    """Write the pictures of the tiles to a folder."""
    for tile in tiles:
        if tile.png is not None:
            (folder / tile.file).write_bytes(tile.png)


_STYLE = """
body { max-width: 116rem; } header p { margin: 0.35rem 0 2.6rem; color: var(--quiet); }
main { display: grid; gap: 2.6rem 1.8rem; grid-template-columns: repeat(ACROSS, minmax(0, 1fr)); }
@media (max-width: 72rem) { main { grid-template-columns: repeat(auto-fill, minmax(19rem, 1fr)); } }
figure { display: flex; flex-direction: column; }
figcaption { position: relative; border-top: 1px solid var(--hair); margin-top: 0.5rem; padding-top: 0.6rem; }
.number { position: absolute; right: 0; font-size: 0.85rem; color: var(--quiet); font-variant-numeric: tabular-nums; }
dl { margin: 0 3rem 0.55rem 0; display: flex; flex-wrap: wrap; gap: 0 1.3rem; }
dl div { display: flex; gap: 0.45rem; } dd { font-weight: 600; }
code { display: block; padding: 0.5rem 0.7rem; overflow-wrap: anywhere; user-select: all; }
footer { margin-top: 3.5rem; font-size: 0.9rem; color: var(--quiet); }
@media print { main { grid-template-columns: repeat(3, 1fr); } }
"""

_FOOT = """<footer>A picture opens at full size; a click on a command selects all of it. Pictures show the pattern
before it is cut: pieces that reach no support may still be there, and the thickness is not drawn.</footer>"""


def check_film(values: Values, fps: float) -> None:
    """Raise DsfabError unless exactly one preset key has several values, and `fps` is between 0.1 and 50."""
    several = [key for key, listed in values.items() if len(listed) > 1]
    if len(several) != 1:
        raise DsfabError(
            f"--animate needs exactly one key with several values, but {len(several)} keys have several values"
            + (f" ({', '.join(several)}); give a single value to all keys except one" if several else "")
        )
    if not 0.1 <= fps <= 50:
        raise DsfabError(f"--fps {fps:g} is not between 0.1 and 50 pictures per second; write for instance --fps 8")


def write_film(tiles: Sequence[ContactTile], path: Path, name: str, fps: float, palette: Palette) -> None:
    """Write a film, forward and backward, of the tiles with a picture.
    name : text in the lower right.    fps : pictures a second."""
    frames = [_frame(shown, tile.label(), name, palette) for tile in tiles if (shown := tile.picture) is not None]
    order = [*range(len(frames)), *range(len(frames) - 2, 0, -1)]
    ends = {0, len(frames) - 1}
    durations = [round(1000 / fps * (4 if place in ends else 1)) for place in order]  # the film pauses at both ends
    if path.suffix == ".gif":
        frames = _with_shared_palette(frames)
    first_frame, *rest = [frames[place] for place in order]
    lossy = {"quality": 85, "method": 4} if path.suffix == ".webp" else {"disposal": 1}
    first_frame.save(path, save_all=True, append_images=rest, duration=durations, loop=0, **lossy)


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


def _with_shared_palette(frames: "list[Image]") -> "list[Image]":
    from PIL import Image

    sample = frames[:: max(1, len(frames) // 4)]
    strip = Image.new("RGB", (sample[0].width, sum(frame.height for frame in sample)))
    for place, frame in enumerate(sample):
        strip.paste(frame, (0, place * frame.height))
    palette = strip.quantize(96)
    return [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
