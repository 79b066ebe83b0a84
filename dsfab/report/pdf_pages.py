"""Documents as PDF on A4 with reportlab."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self

from dsfab.core.errors import ExportError
from dsfab.core.limits import MARKS
from dsfab.report.html_pages import COLOURS as PAGE
from dsfab.report.html_pages import (
    Banner,
    Block,
    Bullets,
    Code,
    ColourScale,
    Document,
    FigureRow,
    PageColour,
    Paragraph,
    ReportFigure,
    ReportSection,
    Table,
    document_html,
    escaped_text,
)

FILES = ("report.html", "report.pdf")
MM = 72 / 25.4  # Points per millimetre.

COLOURS: Mapping[str, PageColour] = {
    **PAGE,
    "pass": PAGE["good"],
    "fail": PAGE["bad"],
    "unknown": PAGE["open"],
    "note": PAGE["quiet"],
}
"""Colours of HTML pages, and the colours of verdicts."""


def reportlab_colour(rgb: PageColour) -> Any:
    """Return a colour as an object of reportlab."""
    from reportlab.lib.colors import Color

    return Color(*(part / 255 for part in rgb))


def hex_colour(rgb: PageColour) -> str:
    """Return a colour in hexadecimal digits, for example '#2054a8'."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)


@dataclass(frozen=True)
class PdfStyles:
    """Paragraph styles by kind, and the name of the regular font."""

    by_kind: Mapping[str, Any]
    regular: str

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Return styles with fonts that have all letters of a text."""
        names = fonts(text)
        return cls(_styles(*names), names[0])

    def text(self, markup: str, kind: str, **named: Any) -> Any:
        """Return a reportlab paragraph in the style `kind`."""
        from reportlab.platypus import Paragraph

        code = f'<font face="{self.by_kind["code"].fontName}">'
        return Paragraph(markup.replace("<code>", code).replace("</code>", "</font>"), self.by_kind[kind], **named)

    def cell(self, markup: str, kind: str, is_left: bool) -> Any:
        """Return a cell of a table. kind : style.    is_left : True for left-aligned text."""
        if markup in MARKS:
            markup = f'<font color="{hex_colour(COLOURS[markup])}"><b>{markup}</b></font>'
        if not is_left and kind != "head" and "<" not in markup:
            markup = markup.replace(" ", "\u00a0")  # no line break between number and unit
        return self.text(markup, f"{kind}_{'left' if is_left else 'right'}")


def fonts(text: str) -> tuple[str, str, str]:
    """Return the names of a regular, a bold and a monospaced font that have all letters of a text."""
    try:
        text.encode("cp1252")
    except UnicodeEncodeError:
        return _dejavu()
    return "Helvetica", "Helvetica-Bold", "Courier"


def _dejavu() -> tuple[str, str, str]:
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

    ink, soft = reportlab_colour(COLOURS["text"]), reportlab_colour(COLOURS["quiet"])
    base = ParagraphStyle("body", fontName=regular, fontSize=9.5, leading=13.2, textColor=ink, spaceAfter=2.4 * MM)
    small = ParagraphStyle("small", base, fontSize=8, leading=10.2, spaceAfter=0)

    def style(parent: Any, **named: Any) -> Any:
        return ParagraphStyle("kind", parent, **named)

    kinds = {
        "body": base,
        "lead": style(base, fontSize=11, leading=15),
        "quiet": style(base, textColor=soft),
        "bullet": style(base, leftIndent=4 * MM, bulletIndent=0, spaceAfter=1 * MM),
        "code": style(small, fontName=typed, fontSize=7, leading=9.2, spaceAfter=4 * MM),
        "over": style(small, textColor=soft),
        "title": style(base, fontName=bold, fontSize=21, leading=25, spaceBefore=1 * MM, spaceAfter=4 * MM),
        "fact_name": style(small, fontSize=7, leading=9, textColor=soft),
        "fact": style(small, fontSize=9, leading=11.5),
        "heading": style(base, fontName=bold, fontSize=13, leading=16, spaceBefore=5 * MM, spaceAfter=2.2 * MM),
        "banner": style(base, fontName=bold, fontSize=13, leading=17, spaceAfter=1 * MM),
        "caption": style(small, spaceBefore=2 * MM, spaceAfter=1.2 * MM),
        "figure_caption": style(small, spaceBefore=1.2 * MM, spaceAfter=4 * MM),
        "note": style(small, fontSize=7.5, textColor=soft, spaceBefore=1 * MM, spaceAfter=4 * MM),
        "missing": style(base, textColor=soft, alignment=TA_CENTER, borderPadding=12, spaceBefore=8 * MM),
        "scale_title": style(small, spaceBefore=1 * MM, spaceAfter=0.6 * MM),
        "scale_left": style(small, fontSize=7, textColor=soft),
        "scale": style(small, fontSize=7, textColor=soft, alignment=TA_CENTER),
        "scale_right": style(small, fontSize=7, textColor=soft, alignment=TA_RIGHT),
    }
    for kind, font in (("cell", regular), ("strong", bold), ("head", bold)):
        kinds[f"{kind}_left"] = style(small, fontName=font)
        kinds[f"{kind}_right"] = style(small, fontName=font, alignment=TA_RIGHT)
    return kinds


TEXT_WIDTH = 174.0  # Width of the text on A4, millimetres.
FRAME_PADDING = 6.0  # Padding of reportlab's frames, points.


def write_document(document: Document, folder: Path) -> tuple[list[str], list[str]]:
    """Write a document as report.html and report.pdf; return the file names, and a sentence if the PDF failed."""
    (folder / FILES[0]).write_text(document_html(document), encoding="utf-8")
    try:
        (folder / FILES[1]).write_bytes(document_pdf(document))
    except ExportError as error:
        return [FILES[0]], [str(error)]
    return list(FILES), []


def require_pdf() -> None:
    """Raise ExportError if reportlab is not installed."""
    try:
        import reportlab  # noqa: F401
    except ImportError:
        raise ExportError("report.pdf needs reportlab, which is not installed; run pip install reportlab") from None


def document_pdf(document: Document) -> bytes:
    """Return a document as a PDF. Raises ExportError without reportlab."""
    require_pdf()
    from reportlab.platypus import SimpleDocTemplate

    styles = PdfStyles.from_text(repr(document.sections) + document.subject + repr(document.facts))
    file = io.BytesIO()
    template = SimpleDocTemplate(
        file,
        pagesize=(210 * MM, 297 * MM),
        leftMargin=18 * MM - FRAME_PADDING,
        rightMargin=18 * MM - FRAME_PADDING,
        topMargin=18 * MM,
        bottomMargin=16 * MM,
        title=f"{document.title}: {document.subject}",
        author="dsfab",
        invariant=1,
    )
    story = _title(document, styles)
    for number, section in enumerate(document.sections, start=1):
        story += _section(number, section, styles)
    template.build(story, canvasmaker=partial(_numbered_canvas, document, styles))
    return file.getvalue()


def _numbered_canvas(document: Document, styles: PdfStyles, *arguments: Any, **named: Any) -> Any:
    from reportlab.pdfgen.canvas import Canvas

    class NumberedCanvas(Canvas):  # type: ignore[misc]
        def __init__(self, *arguments: Any, **named: Any) -> None:
            super().__init__(*arguments, **named)
            self.pages: list[dict[str, Any]] = []

        def showPage(self) -> None:  # noqa: N802
            self.pages.append(dict(self.__dict__))
            self._startPage()

        def save(self) -> None:
            for number, page in enumerate(self.pages, start=1):
                self.__dict__.update(page)
                _edges(self, document, styles, number, len(self.pages))
                Canvas.showPage(self)
            Canvas.save(self)

    return NumberedCanvas(*arguments, **named)


def _edges(canvas: Any, document: Document, styles: PdfStyles, number: int, count: int) -> None:
    canvas.setFont(styles.regular, 7.5)
    canvas.setFillColor(reportlab_colour(COLOURS["quiet"]))
    canvas.setStrokeColor(reportlab_colour(COLOURS["hair"]))
    if number > 1:
        canvas.drawString(18 * MM, 284 * MM, f"{document.title} · {document.subject}")
        canvas.line(18 * MM, 282 * MM, 192 * MM, 282 * MM)
    canvas.line(18 * MM, 13.5 * MM, 192 * MM, 13.5 * MM)
    canvas.drawString(18 * MM, 9.5 * MM, document.footer)
    canvas.drawRightString(192 * MM, 9.5 * MM, f"{number} / {count}")


def _title(document: Document, styles: PdfStyles) -> list[Any]:
    from reportlab.platypus import HRFlowable, Spacer

    rule = HRFlowable(width="100%", thickness=2, color=reportlab_colour(COLOURS["blue"]), spaceAfter=3 * MM)
    over, subject = escaped_text(document.title.upper()), escaped_text(document.subject)
    words = [styles.text(over, "over"), styles.text(subject, "title")]
    cells = [
        [styles.text(escaped_text(name), "fact_name"), styles.text(escaped_text(value), "fact")]
        for name, value in document.facts
    ]
    cells += [[]] * (-len(cells) % 4 or 4 * (not cells))
    rows = [cells[i : i + 4] for i in range(0, len(cells), 4)]
    lines = [("LINEABOVE", (0, 0), (-1, 0)), ("LINEBELOW", (0, -1), (-1, -1))]
    return [rule, *words, _grid(rows, [TEXT_WIDTH / 4] * 4, lines), Spacer(1, 5 * MM)]


def _grid(rows: Sequence[Sequence[Any]], widths: Sequence[float], lines: Sequence[tuple[Any, ...]] = ()) -> Any:
    from reportlab.platypus import Table as Cells

    line_styles = [(*line, 0.5, reportlab_colour(COLOURS["hair"])) for line in lines]
    look = [("VALIGN", (0, 0), (-1, -1), "TOP"), ("LEFTPADDING", (0, 0), (-1, -1), 0), *line_styles]
    return Cells([list(row) for row in rows], [width * MM for width in widths], style=look, hAlign="LEFT")


def _section(number: int, section: ReportSection, styles: PdfStyles) -> list[Any]:
    from reportlab.platypus import CondPageBreak, KeepTogether, PageBreak

    number_markup = f'<font color="{hex_colour(COLOURS["blue"])}">{number}</font>'
    head = styles.text(f"{number_markup}&nbsp;&nbsp;&nbsp;{escaped_text(section.title)}", "heading")
    page_break = [PageBreak()] if section.own_page else [CondPageBreak(45 * MM)]
    first_block, *rest = [_block(block, styles) for block in section.blocks]
    # reportlab does not allow a KeepTogether inside a KeepTogether
    with_heading = first_block[0]._content if isinstance(first_block[0], KeepTogether) else first_block[:1]
    further = [part for parts in rest for part in parts]
    return [*page_break, KeepTogether([head, *with_heading]), *first_block[1:], *further]


def _block(block: Block, styles: PdfStyles) -> list[Any]:
    from reportlab.platypus import KeepTogether

    match block:
        case Paragraph(text, kind):
            return [styles.text(text, kind or "body")]
        case Bullets(items):
            return [styles.text(item, "bullet", bulletText="•") for item in items]
        case Code(text):
            return [_code(text, styles)]
        case Banner():
            return [_banner(block, styles)]
        case Table():
            return _table(block, styles)
        case FigureRow(figures):
            return _figure_rows(figures, styles)
        case ReportFigure():
            return [KeepTogether(_figure(block, styles, TEXT_WIDTH * block.width))]


def _code(text: str, styles: PdfStyles) -> Any:
    from reportlab.platypus import XPreformatted

    size = 112  # number of characters in a line
    lines = [line[i : i + size] for line in text.splitlines() for i in range(0, max(len(line), 1), size)]
    return XPreformatted(escaped_text("\n".join(lines)), styles.by_kind["code"])


def _banner(banner: Banner, styles: PdfStyles) -> Any:
    from reportlab.platypus import Table as Cells

    shade = reportlab_colour(COLOURS[banner.status])
    words = [
        styles.text(f'<font color="{hex_colour(COLOURS[banner.status])}">{banner.title}</font>', "banner"),
        styles.text(banner.text, "body"),
    ]
    look = [
        ("BACKGROUND", (0, 0), (-1, -1), reportlab_colour(COLOURS["tint"])),
        ("LINEBEFORE", (0, 0), (0, -1), 3, shade),
        ("LEFTPADDING", (0, 0), (-1, -1), 10),
        ("TOPPADDING", (0, 0), (-1, -1), 7),
    ]
    return Cells([[words]], [TEXT_WIDTH * MM], style=look, spaceAfter=4 * MM)


def _table(table: Table, styles: PdfStyles) -> list[Any]:
    from reportlab.platypus import KeepTogether, Spacer
    from reportlab.platypus import Table as Cells

    def line(row: Sequence[str], kind: str) -> list[Any]:
        return [styles.cell(cell, kind, i < table.left_columns) for i, cell in enumerate(row)]

    body = [line(row, "strong" if i in table.strong else "cell") for i, row in enumerate(table.rows)]
    shares = table.widths or [1.0] * len(table.head)
    widths = [TEXT_WIDTH * MM * share / sum(shares) for share in shares]
    ink, faint = reportlab_colour(COLOURS["text"]), reportlab_colour(COLOURS["hair"])
    look: list[Any] = [
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("VALIGN", (0, 0), (-1, 0), "BOTTOM"),
        ("LINEABOVE", (0, 0), (-1, 0), 0.7, ink),
        ("LINEBELOW", (0, 0), (-1, 0), 0.7, ink),
        ("LINEBELOW", (0, 1), (-1, -2), 0.4, faint),
        ("LINEBELOW", (0, -1), (-1, -1), 0.7, ink),
        *((f"{side}PADDING", (0, 0), (-1, -1), pad) for side, pad in (("LEFT", 2), ("RIGHT", 3))),
        *((f"{side}PADDING", (0, 0), (-1, -1), 2.2) for side in ("TOP", "BOTTOM")),
        *(("BACKGROUND", (0, i + 1), (-1, i + 1), reportlab_colour(COLOURS["tint"])) for i in table.strong),
    ]
    cells = Cells([line(table.head, "head"), *body], widths, style=look, repeatRows=1, hAlign="LEFT")
    below = [styles.text(table.note, "note")] if table.note else [Spacer(1, 4 * MM)]
    flowables = [styles.text(table.caption, "caption"), cells, *below]
    return [KeepTogether(flowables)] if len(body) < 20 else flowables


def _figure_rows(figures: Sequence[ReportFigure], styles: PdfStyles) -> list[Any]:
    half = TEXT_WIDTH / 2 - 3
    cells = [_figure(figure, styles, half) for figure in figures] + [[]] * (len(figures) % 2)
    return [_grid([cells[i : i + 2]], [TEXT_WIDTH / 2] * 2) for i in range(0, len(cells), 2)]


def _figure(figure: ReportFigure, styles: PdfStyles, width: float) -> list[Any]:
    from reportlab.platypus import Image

    caption = styles.text(figure.caption, "figure_caption")
    if figure.missing:
        return [styles.text(escaped_text(figure.missing), "missing"), caption]
    wide, high = figure.size
    height = min(width * high / wide, 150.0)  # millimetres
    image = Image(io.BytesIO(figure.image), height * wide / high * MM, height * MM, hAlign="LEFT")
    return [image, *(_scale(figure.scale, styles, width) if figure.scale else ()), caption]


def _scale(scale: ColourScale, styles: PdfStyles, width: float) -> list[Any]:
    from reportlab.platypus import Table as Cells

    count, share = len(scale.colours), width * MM
    look: list[Any] = [("BACKGROUND", (i, 0), (i, 0), reportlab_colour(band)) for i, band in enumerate(scale.colours)]
    bands = Cells([[""] * count], [share / count] * count, [3.2 * MM], style=look, hAlign="LEFT")
    ends = len(scale.labels)
    kinds = ["scale_left", *["scale"] * (ends - 2), "scale_right"]
    words = [styles.text(escaped_text(text), kind) for text, kind in zip(scale.labels, kinds, strict=True)]
    bare = [(f"{side}PADDING", (0, 0), (-1, -1), 0) for side in ("LEFT", "RIGHT", "TOP", "BOTTOM")]
    step = share / (ends - 1)
    labels = Cells([words], [step / 2, *[step] * (ends - 2), step / 2], style=bare, hAlign="LEFT")
    return [styles.text(escaped_text(scale.title), "scale_title"), bands, labels]
