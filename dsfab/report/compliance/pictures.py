"""The pictures of a report: the design, each load case, stress and displacement, or why there are none."""

import io
import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.render.colouring import rising
from dsfab.render.palette import PAPER, Palette
from dsfab.render.scene import Bytes, Colour
from dsfab.render.view import up_axis
from dsfab.report.compliance.document import ReportFigure, Scale
from dsfab.report.compliance.findings import Findings
from dsfab.report.compliance.words import digits_of, nice, unit_for
from dsfab.slicing.features import kept_cells
from dsfab.study.judging import Answered
from dsfab.study.verdict.stresses import quantile
from dsfab.surface import LoadCase, Surface

SIZE = (1500, 1000)
"""Pixels."""

SMALL = (1050, 760)

BANDS = 10
"""Of colour, or a few less."""

STEEPEST = 0.98
"""Colours of stress end at what this share of the area does not exceed: peaks would hide the rest."""

MOVES = 0.07
"""Displacements are exaggerated until the largest is this share of the surface's size, or a little less."""

WHITE = replace(PAPER, paper=(255, 255, 255))

RED: Colour = (200, 60, 40)
"""Of what is not built."""

LETTERS = 7.0
"""Points that the words on pictures are high on paper."""

TEXT = 174 / 25.4 * 72
"""Points that pictures of the whole width are wide on paper."""

QUALITY = 90
"""Of JPEG."""


class Pictures:
    """Draws what is found; every method returns a figure, with the reason in it where nothing could be drawn."""

    def __init__(self, found: Findings) -> None:
        self.found = found

    @cached_property
    def missing(self) -> str:
        """Why nothing can be drawn, or ''."""
        from dsfab.render.opengl import why_no_pictures

        why = why_no_pictures()
        return f"no picture: {why}" if why else ""

    @cached_property
    def up(self) -> Floats:
        """(3,) the direction that is up, the same in all pictures."""
        task = self.found.task
        return up_axis(task.surface.V, task.surface, task.statics.load)

    def design(self, caption: str, width: float) -> ReportFigure:
        """What is built, with its loads and supports."""
        sheet, task = self.found.structure.sheet.surface, self.found.task
        return self._figure(caption, width, SIZE, sheet.V, sheet.F, task.surface, task.statics.load)

    def everything(self, caption: str, width: float) -> ReportFigure:
        """All material, with its loads and supports; what is not built is red."""
        made, task = self.found.structure, self.found.task
        sheet = made.drawn
        lost = np.where(kept_cells(sheet, made.sheet), -1, 0)
        red = replace(WHITE, families=(RED,))
        return self._figure(
            caption, width, SIZE, sheet.surface.V, sheet.surface.F, task.surface, task.statics.load, red, lost
        )

    def case(self, name: str, caption: str, width: float, beside: bool = False) -> ReportFigure:
        """The uncut surface with the loads and supports of one case; beside: another one, both half as wide."""
        surface = self.found.task.surface
        load = self.found.task.all_loads[name]
        palette = replace(WHITE, members=WHITE.plain)
        letters = larger_letters(SMALL, width / 2 if beside else width)
        return self._figure(caption, width, SMALL, surface.V, surface.F, surface, load, palette, letters=letters)

    def stress(self, shown: Answered, caption: str) -> ReportFigure:
        """The largest von Mises stress of both sides and the middle, on the cut sheet."""
        sheet, value = self.found.structure.sheet.surface, shown.stress.largest
        limit = quantile(value, sheet.areas, STEEPEST) or 1.0
        return self._banded(caption, sheet.V, sheet.F, value, limit, "Pa", "von Mises stress")

    def displacement(self, shown: Answered, limit: float, caption: str) -> ReportFigure:
        """The deformed sheet, coloured by how far it moved; `caption` is given the factor as {factor}."""
        sheet, u = self.found.structure.sheet.surface, shown.equilibrium.u
        factor = nice(MOVES * self.found.task.surface.size / float(np.linalg.norm(u, axis=1).max())) / 2
        moved = np.linalg.norm(u, axis=1)[sheet.F].mean(axis=1)
        told = caption.format(factor=digits_of(factor, 2))
        return self._banded(told, sheet.V + factor * u, sheet.F, moved, limit, "m", "displacement")

    def _banded(
        self, caption: str, V: Floats, F: Ints, value: Floats, limit: float, unit: str, what: str
    ) -> ReportFigure:
        step = nice(limit / BANDS)
        count = max(2, math.ceil(limit / step - 1e-9))
        bands = [(int(r), int(g), int(b)) for r, g, b in rising(np.linspace(0.04, 1, count))]
        palette = replace(WHITE, families=tuple(bands))
        band = np.minimum((value / step).astype(np.int64), count - 1)
        factor, name = (1e-3, "mm") if unit == "m" and limit < 1 else unit_for(limit, unit)
        labels = [f"{k * step / factor:.4g}" for k in range(count + 1)]
        over = ", and above" if float(value.max()) > count * step else ""
        scale = Scale(f"{what}, {name} (darkest band: up to {labels[-1]} {name}{over})", bands, labels)
        return self._figure(caption, 0.86, SIZE, V, F, None, None, palette, band, scale)

    def _figure(
        self,
        caption: str,
        width: float,
        size: tuple[int, int],
        V: Floats,
        F: Ints,
        surface: Surface | None,
        load: LoadCase | None,
        palette: Palette = WHITE,
        family: Ints | None = None,
        scale: Scale | None = None,
        letters: float | None = None,
    ) -> ReportFigure:
        from dsfab.render.picture import Look, picture

        if self.missing:
            return ReportFigure(caption, b"", size, missing=self.missing)
        look = Look(size, self.up, palette, letters or larger_letters(size, width))
        pixels = picture(V, F, surface=surface, load=load, family=family, look=look)
        pixels = trimmed(pixels, palette.paper)
        high, wide = pixels.shape[:2]
        return ReportFigure(caption, jpeg(pixels), (wide, high), width, scale)


def larger_letters(size: tuple[int, int], width: float) -> float:
    """How much larger than on a preview the words of a picture are, to be `LETTERS` high at this share of the text's
    width: at half of it they were 3 points high."""
    point = size[0] / (TEXT * width)
    return max(1.0, LETTERS * point / (size[1] / 46))


def trimmed(pixels: Bytes, paper: Colour, margin: int = 12) -> Bytes:
    """Without empty rows at the top and at the bottom, and with few between the structure and the words below it."""
    drawn = np.flatnonzero((np.abs(pixels.astype(np.int16) - np.array(paper)).max(axis=2) > 6).any(axis=1))
    if not len(drawn):
        return pixels
    gap = 3 * margin
    keep = [np.arange(max(drawn[0] - margin, 0), drawn[0])]
    for before, row in zip(drawn, [*drawn[1:], drawn[-1] + margin], strict=True):
        keep.append(np.arange(before, min(row, before + gap)))
    return np.asarray(pixels[np.concatenate(keep)])


def jpeg(pixels: Bytes) -> bytes:
    """(height, width, 3) bytes as a file."""
    from PIL import Image

    written = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(written, format="JPEG", quality=QUALITY, subsampling=0)
    return written.getvalue()
