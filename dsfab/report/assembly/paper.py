"""Drawing on paper with reportlab, millimetres from the lower left corner."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.report.assembly.axonometry import FaceList
from dsfab.report.html_pages import COLOURS
from dsfab.report.pdf_pages import MM

PAPER_WIDTH, PAPER_HEIGHT = 420.0, 297.0  # Size of A3 paper, millimetres.
MARGIN, HEAD, FOOT = 14.0, 26.0, 18.0  # Margins of a page, millimetres: at both sides, above, and below.
SCALE_STEPS = (1.0, 2.0, 2.5, 5.0)  # Usual scales are 1:k; k is one of these numbers times a power of ten.
Colour = tuple[float, float, float]


def _ink(name: str) -> Colour:
    red, green, blue = COLOURS[name]
    return red / 255, green / 255, blue / 255


INK, QUIET, HAIR, RED = _ink("text"), _ink("quiet"), _ink("hair"), _ink("bad")


@dataclass(frozen=True)
class PaperBox:
    """A rectangle on a page. x, y : lower left corner, mm. wide, high : size, mm."""

    x: float
    y: float
    wide: float
    high: float

    def cells(self, across: int, down: int, gap: float = 0.0) -> "list[PaperBox]":
        """Divide this box into columns and rows; return the cells row by row from the upper left.
        across, down : number of columns and rows.    gap : distance between cells, mm."""
        w, h = (self.wide - gap * (across - 1)) / across, (self.high - gap * (down - 1)) / down
        tops = [self.y + self.high - h - k * (h + gap) for k in range(down)]
        return [PaperBox(self.x + k * (w + gap), y, w, h) for y in tops for k in range(across)]


PAGE = PaperBox(MARGIN, FOOT, PAPER_WIDTH - 2 * MARGIN, PAPER_HEIGHT - HEAD - FOOT)  # box for the drawings of a page


@dataclass(frozen=True, eq=False)
class DrawingTransform:
    """Map from metres of a drawing to millimetres of paper: points * scale + shift (2,)."""

    scale: float
    shift: Floats

    @classmethod
    def fit_to_box(cls, low: Floats, high: Floats, box: PaperBox, scale: float = 0.0) -> "DrawingTransform":
        """Return the map that centres a drawing in a box.
        low, high : (2,) corners of the drawing, m.    scale : mm of paper per metre; 0 fills the box."""
        size = np.maximum(high - low, 1e-9)
        scale = scale or float(min(box.wide / size[0], box.high / size[1]))
        return cls(scale, np.array([box.x + box.wide / 2, box.y + box.high / 2]) - scale * (low + high) / 2)

    def to_paper(self, points: Floats) -> Floats:
        """Convert points (..., 2) from metres of the drawing to millimetres of paper."""
        return np.asarray(points * self.scale + self.shift)


def usual_scale(largest: float) -> tuple[float, str]:
    """Return the largest usual scale (mm of paper per metre) that is at most `largest`, and its name, as "1:20"."""
    least = 1000 / largest
    power = 10.0 ** np.floor(np.log10(least) - 1)
    step = next(float(f"{k * power * 10**j:.6g}") for j in range(3) for k in SCALE_STEPS if k * power * 10**j >= least)
    return 1000 / step, f"1:{step:g}"


class Paper:
    """Pages of a PDF document; drawing goes to the last page."""

    def __init__(self, canvas: Any, fonts: tuple[str, str]) -> None:
        self.canvas, self.fonts = canvas, fonts

    def text(
        self,
        place: tuple[float, float] | Floats,
        words: str,
        size: float = 7.0,
        colour: Colour = INK,
        side: Literal["left", "middle", "right"] = "left",
        bold: bool = False,
    ) -> None:
        """Write a line of text. size : points. side : part of the line at `place` (mm), such as "left"."""
        self.canvas.setFont(self.fonts[bold], size)
        self.canvas.setFillColorRGB(*colour)
        draw = {"left": "drawString", "middle": "drawCentredString", "right": "drawRightString"}[side]
        getattr(self.canvas, draw)(float(place[0]) * MM, float(place[1]) * MM, words)

    def upright_text(self, place: tuple[float, float], words: str, size: float, colour: Colour = INK) -> None:
        """Write a line of text vertically, upwards from `place` (mm). size : points."""
        self.canvas.saveState()
        self.canvas.translate(place[0] * MM + size * 0.35, place[1] * MM)  # half of a letter's height
        self.canvas.rotate(90)
        self.canvas.setFont(self.fonts[0], size)
        self.canvas.setFillColorRGB(*colour)
        self.canvas.drawString(0, 0, words)
        self.canvas.restoreState()

    def width(self, words: str, size: float, bold: bool = False) -> float:
        """Return the width of a text, mm. size : points."""
        return float(self.canvas.stringWidth(words, self.fonts[bold], size)) / MM

    def wrapped_lines(self, words: str, width: float, size: float) -> list[str]:
        """Break a text into lines of at most `width`, mm. size : points."""
        from reportlab.lib.utils import simpleSplit

        return list(simpleSplit(words, self.fonts[0], size, width * MM))

    def polylines(self, polylines: Sequence[Floats], colour: Colour, width: float, closed: bool = False) -> None:
        """Draw polylines (k, 2), millimetres; `width` is in points."""
        path = self.canvas.beginPath()
        for points in polylines:
            (x, y), *rest = (points * MM).tolist()
            path.moveTo(x, y)
            for x, y in rest:
                path.lineTo(x, y)
            if closed:
                path.close()
        self.canvas.setStrokeColorRGB(*colour)
        self.canvas.setLineWidth(width)
        self.canvas.drawPath(path)

    def polygon(self, points: Floats, colour: Colour) -> None:
        """Fill a polygon (k, 2), millimetres."""
        path = self.canvas.beginPath()
        (x, y), *rest = (points * MM).tolist()
        path.moveTo(x, y)
        for x, y in rest:
            path.lineTo(x, y)
        path.close()
        self.canvas.setFillColorRGB(*colour)
        self.canvas.drawPath(path, stroke=0, fill=1)

    def circles(self, places: Floats, diameter: float, colour: Colour) -> None:
        """Draw circles with centres at `places` (k, 2), mm. diameter : mm."""
        self.canvas.setStrokeColorRGB(*colour)
        self.canvas.setLineWidth(0.3)
        for x, y in (places * MM).tolist():
            self.canvas.circle(x, y, diameter / 2 * MM)

    def faces(self, faces: FaceList, fitted: DrawingTransform) -> None:
        """Draw filled quadrilaterals with outlines. fitted : map from metres to millimetres of paper."""
        P = (fitted.to_paper(faces.corners) * MM).reshape(-1, 8)
        dark = 0.55 * faces.colours
        rows = np.concatenate([faces.colours, P, dark, P[:, :4], P[:, 4:]], axis=1)
        face = (
            "%.3f %.3f %.3f rg %.2f %.2f m %.2f %.2f l %.2f %.2f l %.2f %.2f l h f "
            "%.3f %.3f %.3f RG %.2f %.2f m %.2f %.2f l %.2f %.2f m %.2f %.2f l S\n"
        )
        self.canvas.saveState()
        self.canvas.setLineWidth(0.25)
        self.canvas._code.append(face * len(rows) % tuple(rows.ravel().tolist()))
        self.canvas.restoreState()

    def scale_bar(self, corner: tuple[float, float], scale: float) -> None:
        """Draw a scale bar to the right of a corner; scale : millimetres of paper per metre."""
        metres = float(f"{10.0 ** np.floor(np.log10(45 / scale)):.6g}")
        metres = max(metres * k for k in (1, 2, 5) if metres * k * scale <= 45) if metres * scale <= 45 else metres
        x, y = corner
        end = x + metres * scale
        ends = [np.array([[place, y - 1], [place, y + 1]]) for place in (x, end)]
        self.polylines([np.array([[x, y], [end, y]]), *ends], INK, 0.6)
        self.text((end + 2, y - 1), f"{metres:g} m" if metres >= 1 else f"{metres * 1000:g} mm", 7)
