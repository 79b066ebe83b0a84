"""A `Document` as one HTML file: pictures within, nothing fetched, A4 pages when it is printed."""

import base64
from collections.abc import Sequence
from html import escape

from dsfab.limits import MARKS
from dsfab.report.compliance.document import (
    Across,
    Banner,
    Block,
    Bullets,
    Code,
    Document,
    Figure,
    Paragraph,
    Scale,
    Section,
    Table,
)
from dsfab.report.compliance.style import STYLE


def page(document: Document) -> str:
    """The whole file."""
    title = escape(f"{document.title}: {document.subject}")
    style = STYLE.replace("RUNNING", _css_text(f"{document.title} · {document.subject}"))
    style = style.replace("FOOTER", _css_text(document.footer))
    head = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}</style></head><body>'
    )
    parts = [head, _title(document)]
    parts += [_section(number, section) for number, section in enumerate(document.sections, start=1)]
    parts.append(f"<footer>{escape(document.footer)}</footer></body></html>\n")
    return "\n".join(parts)


def _css_text(text: str) -> str:
    """For `content: "..."` of a style: no character that could end it."""
    return "".join(c if c.isalnum() or c in " .,:;+-()/" else f"\\{ord(c):x} " for c in text)


def _title(document: Document) -> str:
    facts = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in document.facts)
    over, title = escape(document.title), escape(document.subject)
    return f'<header><p class="over">{over}</p><h1>{title}</h1><dl>{facts}</dl></header>'


def _section(number: int, section: Section) -> str:
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
        case Across(figures):
            return f'<div class="across">{"".join(_figure(one) for one in figures)}</div>'
        case Figure():
            return _figure(block)


def _table(table: Table) -> str:
    def cells(row: Sequence[str], tag: str) -> str:
        return "".join(f"<{tag}{_kind(cell, i < table.left)}>{cell}</{tag}>" for i, cell in enumerate(row))

    rows = "".join(
        f"<tr{' class=strong' if i in table.strong else ''}>{cells(row, 'td')}</tr>" for i, row in enumerate(table.rows)
    )
    note = f'<p class="note">{table.note}</p>' if table.note else ""
    return (
        f'<div class="table"><table><caption>{table.caption}</caption>'
        f"<thead><tr>{cells(table.head, 'th')}</tr></thead><tbody>{rows}</tbody></table>{note}</div>"
    )


def _kind(cell: str, left: bool) -> str:
    names = [name for name, true in (("left", left), (cell, cell in MARKS)) if true]
    return f' class="{" ".join(names)}"' if names else ""


def _figure(figure: Figure) -> str:
    caption = f"<figcaption>{figure.caption}</figcaption>"
    if figure.missing:
        return f'<figure><p class="missing">{escape(figure.missing)}</p>{caption}</figure>'
    wide, high = figure.size
    data = base64.b64encode(figure.image).decode("ascii")
    style = "" if figure.width == 1 else f' style="width: {100 * figure.width:.0f}%"'
    scale = _scale(figure.scale) if figure.scale else ""
    return (
        f'<figure{style}><img src="data:image/{figure.kind};base64,{data}" width="{wide}" height="{high}" '
        f'alt="{escape(_plain(figure.caption), quote=True)}">{scale}{caption}</figure>'
    )


def _plain(markup: str) -> str:
    from re import sub

    return sub(r"<[^>]+>", "", markup)


def _scale(scale: Scale) -> str:
    bands = "".join(f'<i style="background: rgb{colour}"></i>' for colour in scale.colours)
    labels = "".join(f"<span>{escape(label)}</span>" for label in scale.labels)
    return f'<div class="scale"><p>{escape(scale.title)}</p><div>{bands}</div><div class="labels">{labels}</div></div>'
