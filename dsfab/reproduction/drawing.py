"""Pictures of the paper's figures in files."""

from dataclasses import dataclass
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.design import Design
from dsfab.render.colouring import ColourBar
from dsfab.render.light import LightQuality
from dsfab.render.previewer import Previewer
from dsfab.render.scene import Bytes

SMALL, LARGE = (560, 420), (1120, 840)  # Sizes of the pictures of steps, and of the structure, pixels.
LIGHT = LightQuality(8, 24, 5, 896, 512, (0.006, 0.035))  # Better light than in pictures of sweeps.

VIEWS = {
    "pavilion": "25,35",
    "camel_none": "20,25",
    "camel_head": "20,52",
    "camel_nose": "40,20",
    "camel_ears": "60,35",
    "climbing_hold": "210,25",
    "mouse": "40,40",
    "boys_surface": "30,25",
}
"""Camera views (see `dsfab.render.view`) of figures, by preset. The default view would hide their subjects."""

MARKS = ("loads", "supports", "person", "gradients")  # Marks in the pictures; "gradients" appear only with modes.
SCALE = {"pavilion": "tree"}  # Figures that show a tree for scale instead of a person, as the published figures do.


@dataclass(frozen=True, eq=False)
class PaperPicture:
    """A picture in a file, or the reason for its absence. file : name in the page's folder; '' without a picture.
    title : subject of the picture.     words : caption, or the reason.     bar : legend of colours."""

    file: str
    title: str
    words: str = ""
    bar: ColourBar | None = None
    size: tuple[int, int] = SMALL


@dataclass(frozen=True, eq=False)
class PaperComparison:
    """A comparison from the paper of Madan, Jacobson and Levin. words : text. rows : rows of pictures."""

    title: str
    words: str
    rows: tuple[tuple[PaperPicture, ...], ...]


def paper_picture(design: Design, folder: Path, show: str, stem: str, title: str = "") -> PaperPicture:
    """Draw a design into the file `stem`-`show`.webp. show : subject of the picture, such as 'loads'."""
    size = LARGE if show == "structure" and not title else SMALL
    title = title or _title(design, show)
    file = f"{stem}-{show.replace('_', '-')}.webp"
    try:
        with previewer_of(design, show) as previewer:
            pixels = previewer.picture(size, quality=LIGHT, words=False)
            words, bar = previewer.words, previewer.bar
    except DsfabError as error:
        return PaperPicture("", title, str(error))
    save_picture(pixels, folder / file)
    return PaperPicture(file, title, words, bar, size)


def previewer_of(design: Design, show: str = "structure") -> Previewer:
    """Return a previewer of a figure; the caller must close the previewer."""
    name = design.preset.name
    marks = {*MARKS} - {"person"} | {SCALE.get(name, "person")}
    return Previewer(design, show=show, view=VIEWS.get(name, "iso"), marks=marks)


def save_picture(pixels: Bytes, path: Path) -> None:
    """Write a picture as WebP."""
    from PIL import Image

    Image.fromarray(pixels).save(path, format="WEBP", quality=82, method=6)


def _title(design: Design, show: str) -> str:
    pattern = design.preset.pattern
    return {
        "structure": "Structure",
        "loads": "Surface, loads and supports",
        "directions": "Principal directions",
        "vonmises": "Von Mises stress",
        "major_mode": f"Mode {pattern.major.mode} of the major family",
        "minor_mode": f"Mode {pattern.minor.mode} of the minor family",
        "major": "Major stripes",
        "minor": "Minor stripes",
    }[show]
