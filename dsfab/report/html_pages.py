"""HTML pages that load nothing from the network."""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from dsfab.core.limits import MARKS
from dsfab.render import PAPER

COLOURS: Mapping[str, tuple[int, int, int]] = {
    "paper": PAPER.paper,
    "text": PAPER.text,
    "quiet": (112, 107, 102),
    "hair": (219, 216, 212),
    "tint": (245, 242, 237),
    "blue": PAPER.load,
    "clay": (184, 92, 56),
    "good": (28, 110, 66),
    "bad": (168, 50, 26),
    "open": (138, 90, 0),
}
"""Red, green and blue from 0 to 255 by the names of CSS variables, for pages and PDFs."""

_STYLE = """
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 3.5rem 2.5rem 4rem; background: var(--paper); color: var(--text);
  font: 16px/1.5 var(--sans); }
h1 { margin: 0; font-size: 2.1rem; font-weight: 600; letter-spacing: -0.02em; line-height: 1.2; }
h2 { margin: 0; font-size: 1.45rem; font-weight: 600; letter-spacing: -0.01em; line-height: 1.25; }
a { border-radius: 4px; } :focus-visible { outline: 3px solid var(--blue); outline-offset: 3px; }
figure { margin: 0; } img { display: block; width: 100%; height: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .2rem 0; }
th, td { text-align: right; padding: .15rem .6rem; border-bottom: 1px solid var(--hair); white-space: nowrap; }
th { font-weight: 600; }
dt { color: var(--quiet); } dd { margin: 0; }
code { font: 12.5px/1.55 var(--mono); background: var(--tint); padding: .15rem .45rem; border-radius: 4px; }
.quiet { color: var(--quiet); }
.why { margin: 0; aspect-ratio: 4 / 3; display: grid; place-content: center; text-align: center; padding: 0 12%;
  border: 1px solid var(--hair); border-radius: 4px; color: var(--quiet); font-size: .9rem; }
@media (max-width: 60rem) { body { padding: 1.5rem 1rem; } }
@media print { body { margin: 0; padding: 0; max-width: none; background: none; font-size: 10pt; }
  figure, tr { break-inside: avoid; } }
"""


def page_style() -> str:
    """Return the CSS that all pages share."""
    colours = " ".join(f"--{name}: rgb{colour};" for name, colour in COLOURS.items())
    fonts = (
        '--sans: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; '
        '--mono: ui-monospace, SFMono-Regular, Menlo, Consolas, "Liberation Mono", monospace;'
    )
    return f"\n:root {{ color-scheme: light; {colours}\n  {fonts} }}{_STYLE}"


def html_page(title: str, body: str, page_rules: str = "") -> str:
    """Return an HTML file: `title` is plain text, `body` is markup, `page_rules` is CSS."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{page_style()}{page_rules}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def image_tag(source: str, alt: str, size: tuple[int, int], lazy: bool = True) -> str:
    """Return an HTML image tag. size : width and height, pixels.    alt : plain text in place of the image."""
    wide, high = size
    loading = ' loading="lazy"' if lazy else ""
    return f'<img src="{source}" alt="{escape(alt, quote=True)}" width="{wide}" height="{high}"{loading}>'


def reason_paragraph(text: str) -> str:
    """Return a paragraph with the reason for a missing picture."""
    return f'<p class="why">{escape(text)}</p>'


PageColour = tuple[int, int, int]


@dataclass(frozen=True)
class Paragraph:
    """A paragraph. kind : '' for normal, 'quiet' for grey, or 'lead' for larger text."""

    text: str
    kind: str = ""


@dataclass(frozen=True)
class Bullets:
    """A list of items with bullets."""

    items: Sequence[str]


@dataclass(frozen=True)
class Code:
    """Plain text in a monospaced font."""

    text: str


@dataclass(frozen=True)
class Banner:
    """A box with a verdict in large type. status : `pass`, `fail` or `unknown`."""

    status: str
    title: str
    text: str


@dataclass(frozen=True)
class Table:
    """A table. left_columns : number of columns that are flush left.    strong : indices of emphasised rows.
    widths : relative widths of the columns; empty if equal.    note : text below the table."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left_columns: int = 1
    note: str = ""
    widths: Sequence[float] = ()
    strong: Sequence[int] = ()


@dataclass(frozen=True)
class ColourScale:
    """A legend of colour bands. labels : texts at the limits of the bands."""

    title: str
    colours: Sequence[PageColour]
    labels: Sequence[str]


@dataclass(frozen=True)
class ReportFigure:
    """A picture: PNG or JPEG bytes of (width, height) pixels. width : share of the page's width, 0 to 1.
    missing : reason for a missing picture."""

    caption: str
    image: bytes
    size: tuple[int, int]
    width: float = 1.0
    scale: ColourScale | None = None
    missing: str = ""

    @property
    def kind(self) -> str:
        """Type of the image file: png or jpeg."""
        return "png" if self.image.startswith(b"\x89PNG") else "jpeg"


@dataclass(frozen=True)
class FigureRow:
    """Figures side by side."""

    figures: Sequence[ReportFigure]


Block = Paragraph | Bullets | Code | Banner | Table | ReportFigure | FigureRow


@dataclass(frozen=True)
class ReportSection:
    """A numbered section. own_page : True if the section begins on a new page."""

    title: str
    blocks: Sequence[Block]
    own_page: bool = False


@dataclass(frozen=True)
class Document:
    """A document with a title block, sections and a footer."""

    title: str
    subject: str
    facts: Sequence[tuple[str, str]]
    sections: Sequence[ReportSection]
    footer: str


@dataclass
class CaptionNumbers:
    """Counters that number the captions of figures and tables."""

    figures: int = 0
    tables: int = 0

    def figure(self, text: str) -> str:
        """Return a caption such as '<b>Figure 3.</b> ...'."""
        self.figures += 1
        return f"<b>Figure {self.figures}.</b> {text}"

    def table(self, text: str) -> str:
        """Return a caption such as '<b>Table 2.</b> ...'."""
        self.tables += 1
        return f"<b>Table {self.tables}.</b> {text}"


def escaped_text(text: str) -> str:
    """Return plain text with &, < and > escaped."""
    return escape(text, quote=False)


def document_html(document: Document) -> str:
    """Return a document as an HTML file."""
    running_title, footer = _css_text(f"{document.title} · {document.subject}"), _css_text(document.footer)
    rules = DOCUMENT_STYLE.replace("QUIET", f"rgb{COLOURS['quiet']}")
    rules = rules.replace("RUNNING", running_title).replace("FOOTER", footer)
    sections = [_section(number, section) for number, section in enumerate(document.sections, start=1)]
    body = [_title(document), *sections, f"<footer>{escape(document.footer)}</footer>"]
    return html_page(f"{document.title}: {document.subject}", "\n".join(body), rules)


def _css_text(text: str) -> str:
    return "".join(c if c.isalnum() or c in " .,:;+-()/" else f"\\{ord(c):x} " for c in text)


def _title(document: Document) -> str:
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in document.facts)
    over, title = escape(document.title), escape(document.subject)
    return f'<header><p class="over">{over}</p><h1>{title}</h1><dl>{facts}</dl></header>'


def _section(number: int, section: ReportSection) -> str:
    blocks = "\n".join(_block(block) for block in section.blocks)
    kind = ' class="page"' if section.own_page else ""
    return f'<section{kind}><h2><span class="no">{number}</span>{escape(section.title)}</h2>{blocks}</section>'


def _block(block: Block) -> str:
    match block:
        case Paragraph(text, kind):
            return f'<p class="{kind}">{text}</p>' if kind else f"<p>{text}</p>"
        case Bullets(items):
            return "<ul>" + "".join(f"<li>{item}</li>" for item in items) + "</ul>"
        case Code(text):
            return f"<pre>{escape(text)}</pre>"
        case Banner(status, title, text):
            return f'<div class="banner {status}"><b>{title}</b><p>{text}</p></div>'
        case Table():
            return _table(block)
        case FigureRow(figures):
            return f'<div class="across">{"".join(_figure(figure) for figure in figures)}</div>'
        case ReportFigure():
            return _figure(block)


def _table(table: Table) -> str:
    def cells(row: Sequence[str], tag: str) -> str:
        return "".join(f"<{tag}{_kind(cell, i < table.left_columns)}>{cell}</{tag}>" for i, cell in enumerate(row))

    kinds = (" class=strong" if i in table.strong else "" for i in range(len(table.rows)))
    rows = "".join(f"<tr{kind}>{cells(row, 'td')}</tr>" for kind, row in zip(kinds, table.rows, strict=True))
    note = f'<p class="note">{table.note}</p>' if table.note else ""
    return (
        f'<div class="table"><table><caption>{table.caption}</caption>'
        f"<thead><tr>{cells(table.head, 'th')}</tr></thead><tbody>{rows}</tbody></table>{note}</div>"
    )


def _kind(cell: str, is_left: bool) -> str:
    names = [name for name, applies in (("left", is_left), (cell, cell in MARKS)) if applies]
    return f' class="{" ".join(names)}"' if names else ""


def _figure(figure: ReportFigure) -> str:
    caption = f"<figcaption>{figure.caption}</figcaption>"
    if figure.missing:
        return f"<figure>{reason_paragraph(figure.missing)}{caption}</figure>"
    data = base64.b64encode(figure.image).decode("ascii")
    source = f"data:image/{figure.kind};base64,{data}"
    inside = image_tag(source, without_markup(figure.caption), figure.size, lazy=False)
    width = "" if figure.width == 1 else f' style="width: {100 * figure.width:.0f}%"'
    scale = _scale(figure.scale) if figure.scale else ""
    return f"<figure{width}>{inside}{scale}{caption}</figure>"


def without_markup(markup: str) -> str:
    """Return markup without its tags."""
    return re.sub(r"<[^>]+>", "", markup)


def _scale(scale: ColourScale) -> str:
    bands = "".join(f'<i style="background: rgb{colour}"></i>' for colour in scale.colours)
    labels = "".join(f"<span>{escape(label)}</span>" for label in scale.labels)
    return f'<div class="scale"><p>{escape(scale.title)}</p><div>{bands}</div><div class="labels">{labels}</div></div>'


DOCUMENT_STYLE = """
:root { --paper: white; } html { background: rgb(236, 233, 228); }
body { margin: 2rem auto; padding: 18mm 20mm; max-width: 210mm; font-size: 10pt; line-height: 1.45;
  box-shadow: 0 1px 8px rgba(0, 0, 0, .14); font-variant-numeric: tabular-nums; }
header { border-top: 3px solid var(--blue); padding-top: 4mm; margin-bottom: 7mm; }
.over { margin: 0; color: var(--quiet); font-size: 9pt; letter-spacing: .08em; text-transform: uppercase; }
h1 { margin: 0 0 4mm; font-size: 22pt; line-height: 1.15; }
dl { display: grid; grid-template-columns: repeat(4, auto); gap: 1.5mm 6mm; margin: 0;
  border-top: 1px solid var(--hair); border-bottom: 1px solid var(--hair); padding: 2.5mm 0; }
dt { font-size: 7.5pt; }
h2 { margin: 9mm 0 2.5mm; font-size: 13.5pt; break-after: avoid; }
h2 .no { display: inline-block; min-width: 9mm; color: var(--blue); }
section:first-of-type h2 { margin-top: 0; }
p { margin: 0 0 2.5mm; } .lead { font-size: 11.5pt; } .note { color: var(--quiet); font-size: 8pt; margin: 1.2mm 0 0; }
ul { margin: 0 0 2.5mm; padding-left: 5mm; } li { margin: 0 0 1mm; }
.banner { border-left: 4px solid var(--open); background: var(--tint); padding: 3mm 4mm; margin: 0 0 4mm; }
.banner b { font-size: 13pt; color: var(--open); } .banner p { margin: .8mm 0 0; }
.banner.pass { border-color: var(--good); } .banner.fail { border-color: var(--bad); }
.banner.pass b, td.pass { color: var(--good); } .banner.fail b, td.fail { color: var(--bad); }
td.unknown { color: var(--open); } td.pass, td.fail, td.unknown { font-weight: 600; }
.table { margin: 3mm 0 4.5mm; overflow-x: auto; break-inside: avoid; }
table { width: 100%; font-size: 8.5pt; }
caption, figcaption { text-align: left; font-size: 8.5pt; font-weight: 400; padding: 0 0 1.5mm; }
figcaption { padding: 1.5mm 0 0; } thead { display: table-header-group; }
th, td { padding: .9mm 1.6mm; vertical-align: top; }
th { border-top: 1px solid var(--text); border-bottom: 1px solid var(--text); vertical-align: bottom;
  white-space: normal; }
.left { text-align: left; white-space: normal; } .strong td { background: var(--tint); font-weight: 600; }
tbody tr:last-child td { border-bottom: 1px solid var(--text); }
figure { margin: 3mm 0 4.5mm; }
.across { display: grid; grid-template-columns: repeat(2, 1fr); gap: 0 6mm; } .across figure { width: auto !important; }
.why { aspect-ratio: auto; padding: 8mm; }
.scale { font-size: 8pt; margin: 1mm 0; } .scale p { margin: 0 0 .6mm; } .scale div { display: flex; }
.scale i { flex: 1; height: 3.2mm; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.scale .labels { justify-content: space-between; color: var(--quiet); padding-top: .5mm; }
code { font-size: 8.5pt; padding: 0 .8mm; }
pre { font: 7.5pt/1.4 var(--mono); background: var(--tint);
  padding: 3mm; white-space: pre-wrap; overflow-wrap: anywhere; margin: 0 0 4mm; }
footer { border-top: 1px solid var(--hair); margin-top: 8mm; padding-top: 2mm; color: var(--quiet); font-size: 8pt; }
@page { size: A4; margin: 20mm 18mm 18mm;
  @top-left { content: "RUNNING"; font: 7.5pt Helvetica, Arial, sans-serif; color: QUIET; }
  @bottom-left { content: "FOOTER"; font: 7.5pt Helvetica, Arial, sans-serif; color: QUIET; }
  @bottom-right { content: counter(page) " / " counter(pages); font: 7.5pt Helvetica, Arial, sans-serif; } }
@media print { html { background: none; } body { margin: 0; padding: 0; max-width: none; box-shadow: none; }
  .banner, .strong td, pre { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .page { break-before: page; } .page h2 { margin-top: 0; } footer { display: none; } .table { overflow: visible; } }
@media screen and (max-width: 60rem) { body { padding: 1.2rem; margin: 0; } dl { grid-template-columns: 1fr 1fr; }
  .across { grid-template-columns: 1fr; } th, td { padding: .9mm 1mm; }
  caption { max-width: calc(100vw - 2.4rem); } }
"""
"""CSS of a document: an A4 sheet on screen and on paper. RUNNING and FOOTER stand for texts at the edges of printed
pages. QUIET stands for a colour, because CSS variables do not work at the edges of a page."""
