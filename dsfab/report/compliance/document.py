"""A document as plain blocks, from which the HTML page and the PDF are both made, so that they say the same.

Text of blocks is markup: escaped text with `<b>`, `<i>`, `<sub>`, `<sup>` and `<code>` at most (see `escaped`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Paragraph:
    """Words. kind : '' or 'quiet', or 'lead' for the first and larger ones."""

    text: str
    kind: str = ""


@dataclass(frozen=True)
class Bullets:
    """A list."""

    items: Sequence[str]


@dataclass(frozen=True)
class Code:
    """Plain text, line by line, as it is typed."""

    text: str


@dataclass(frozen=True)
class Banner:
    """A verdict, large: status `pass`, `fail` or `unknown`, and what it means."""

    status: str
    title: str
    text: str


@dataclass(frozen=True)
class Table:
    """Rows under a head, numbers flush right but for the first `left` columns; a cell `pass` or `fail` is coloured.

    widths : shares of the page's width, or none for even ones.    note : below it.   strong : rows that stand out.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    note: str = ""
    widths: Sequence[float] = ()
    strong: Sequence[int] = ()


@dataclass(frozen=True)
class Scale:
    """Bands of colour from left to right, with what stands at the borders between them, and what they show."""

    title: str
    colours: Sequence[Colour]
    labels: Sequence[str]


@dataclass(frozen=True)
class ReportFigure:
    """A picture: PNG or JPEG bytes of (width, height) pixels, with the `width` it takes of the page, 0 to 1.

    missing : why there is none, instead of it.
    """

    caption: str
    image: bytes
    size: tuple[int, int]
    width: float = 1.0
    scale: Scale | None = None
    missing: str = ""

    @property
    def kind(self) -> str:
        """Of the file."""
        return "png" if self.image.startswith(b"\x89PNG") else "jpeg"


@dataclass(frozen=True)
class Across:
    """Figures side by side."""

    figures: Sequence[ReportFigure]


Block = Paragraph | Bullets | Code | Banner | Table | ReportFigure | Across


@dataclass(frozen=True)
class ReportSection:
    """A numbered part. own_page : whether it begins one when printed."""

    title: str
    blocks: Sequence[Block]
    own_page: bool = False


@dataclass(frozen=True)
class Document:
    """title, subject : what it is, and of what.  facts : of the title block, name and value.  footer : of all pages."""

    title: str
    subject: str
    facts: Sequence[tuple[str, str]]
    sections: Sequence[ReportSection]
    footer: str


@dataclass
class Numbers:
    """Counts figures and tables in the order in which they are made."""

    figures: int = 0
    tables: int = 0
    names: dict[str, int] = field(default_factory=dict)

    def figure(self, text: str) -> str:
        """'<b>Figure 3.</b> ...'"""
        self.figures += 1
        return f"<b>Figure {self.figures}.</b> {text}"

    def table(self, text: str) -> str:
        """'<b>Table 2.</b> ...'"""
        self.tables += 1
        return f"<b>Table {self.tables}.</b> {text}"


def escaped(text: str) -> str:
    """Any text as markup."""
    return escape(text, quote=False)
