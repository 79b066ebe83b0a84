"""Type and colours of the PDF."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from dsfab.limits import MARKS
from dsfab.report.compliance.document import Colour
from dsfab.report.html import COLOURS as PAGE

MM = 72 / 25.4
"""Points."""

COLOURS: Mapping[str, Colour] = {
    **PAGE,
    "pass": PAGE["good"],
    "fail": PAGE["bad"],
    "unknown": PAGE["open"],
    "note": PAGE["quiet"],
}
"""Those of the page on a screen."""


def colour(rgb: Colour) -> Any:
    """As reportlab wants it."""
    from reportlab.lib.colors import Color

    return Color(*(part / 255 for part in rgb))


def hexed(rgb: Colour) -> str:
    """'#2054a8'."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)


@dataclass(frozen=True)
class Styles:
    """Paragraphs by kind, and the font that they are set in."""

    of: Mapping[str, Any]
    regular: str

    @classmethod
    def fit_for(cls, text: str) -> Self:
        """Helvetica, which every reader has, or where the text has other letters than Western ones DejaVu Sans."""
        names = fonts(text)
        return cls(_styles(*names), names[0])

    def text(self, markup: str, kind: str, **named: Any) -> Any:
        """A paragraph."""
        from reportlab.platypus import Paragraph

        code = f'<font face="{self.of["code"].fontName}">'
        return Paragraph(markup.replace("<code>", code).replace("</code>", "</font>"), self.of[kind], **named)

    def cell(self, markup: str, kind: str, left: bool) -> Any:
        """Of a table; verdicts are coloured."""
        if markup in MARKS:
            markup = f'<font color="{hexed(COLOURS[markup])}"><b>{markup}</b></font>'
        if not left and kind != "head" and "<" not in markup:
            markup = markup.replace(" ", "\u00a0")  # a number stays beside its unit
        return self.text(markup, f"{kind}_{'left' if left else 'right'}")

    def gap(self, millimetres: float) -> Any:
        """Nothing, so high."""
        from reportlab.platypus import Spacer

        return Spacer(1, millimetres * MM)


def fonts(text: str) -> tuple[str, str, str]:
    """Regular, bold and typed: Helvetica and Courier, which every reader has, or where a text has other letters than
    Western ones DejaVu Sans."""
    try:
        text.encode("cp1252")
    except UnicodeEncodeError:
        return _dejavu()
    return "Helvetica", "Helvetica-Bold", "Courier"


def _dejavu() -> tuple[str, str, str]:
    """The fonts that come with matplotlib."""
    import matplotlib
    from reportlab.lib.fonts import addMapping
    from reportlab.pdfbase.pdfmetrics import registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    names = ("DejaVuSans", "DejaVuSans-Bold", "DejaVuSansMono")
    for name in names:
        registerFont(TTFont(name, str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf")))
    for bold in (0, 1):
        for italic in (0, 1):
            addMapping("DejaVuSans", bold, italic, names[bold])
    return names


def _styles(regular: str, bold: str, typed: str) -> dict[str, Any]:
    from reportlab.lib.enums import TA_CENTER, TA_RIGHT
    from reportlab.lib.styles import ParagraphStyle

    ink, soft = colour(COLOURS["text"]), colour(COLOURS["quiet"])
    base = ParagraphStyle("body", fontName=regular, fontSize=9.5, leading=13.2, textColor=ink, spaceAfter=2.4 * MM)
    small = ParagraphStyle("small", base, fontSize=8, leading=10.2, spaceAfter=0)

    def made(parent: Any, **named: Any) -> Any:
        return ParagraphStyle("kind", parent, **named)

    kinds = {
        "body": base,
        "lead": made(base, fontSize=11, leading=15),
        "quiet": made(base, textColor=soft),
        "bullet": made(base, leftIndent=4 * MM, bulletIndent=0, spaceAfter=1 * MM),
        "code": made(small, fontName=typed, fontSize=7, leading=9.2, spaceAfter=4 * MM),
        "over": made(small, textColor=soft),
        "title": made(base, fontName=bold, fontSize=21, leading=25, spaceBefore=1 * MM, spaceAfter=4 * MM),
        "fact_name": made(small, fontSize=7, leading=9, textColor=soft),
        "fact": made(small, fontSize=9, leading=11.5),
        "heading": made(base, fontName=bold, fontSize=13, leading=16, spaceBefore=5 * MM, spaceAfter=2.2 * MM),
        "banner": made(base, fontName=bold, fontSize=13, leading=17, spaceAfter=1 * MM),
        "caption": made(small, spaceBefore=2 * MM, spaceAfter=1.2 * MM),
        "figure_caption": made(small, spaceBefore=1.2 * MM, spaceAfter=4 * MM),
        "note": made(small, fontSize=7.5, textColor=soft, spaceBefore=1 * MM, spaceAfter=4 * MM),
        "missing": made(base, textColor=soft, alignment=TA_CENTER, borderPadding=12, spaceBefore=8 * MM),
        "scale_title": made(small, spaceBefore=1 * MM, spaceAfter=0.6 * MM),
        "scale_left": made(small, fontSize=7, textColor=soft),
        "scale": made(small, fontSize=7, textColor=soft, alignment=TA_CENTER),
        "scale_right": made(small, fontSize=7, textColor=soft, alignment=TA_RIGHT),
    }
    for kind, font in (("cell", regular), ("strong", bold), ("head", bold)):
        kinds[f"{kind}_left"] = made(small, fontName=font)
        kinds[f"{kind}_right"] = made(small, fontName=font, alignment=TA_RIGHT)
    return kinds
