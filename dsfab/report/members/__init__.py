"""The report of `dsfab report`: members against the code of their material, as one HTML file and as a PDF.

rating     bands of colour for the cells of bays      diagrams   N, Vz and My along members
sections   its parts, in their order
"""

from datetime import UTC, datetime
from pathlib import Path

from dsfab.errors import ExportError
from dsfab.pipeline import Design
from dsfab.report.compliance.document import Document, Numbers
from dsfab.report.compliance.html import page
from dsfab.report.compliance.pdf import pdf
from dsfab.report.design.facts import versions
from dsfab.report.members import sections
from dsfab.report.members.rating import rating_figure

FILES = ("report.html", "report.pdf")

__all__ = ["FILES", "member_report", "write_member_report"]


def member_report(design: Design, command: str) -> Document:
    """What members bear, over what they can. command : the line that makes it again.

    Raises StaticsError where neither the material nor a strength is known, or nothing carries the loads.
    """
    found, number, known = design.member_utilisation, Numbers(), versions()
    facts = [
        ("Design", design.preset.name),
        ("Date", datetime.now(UTC).strftime("%d %B %Y")),
        ("Checked by", f"dsfab {known['dsfab']}"),
        ("Worst member", sections.worst_words(found)),
    ]
    parts = [
        sections.summary(found, rating_figure(design, number), number),
        sections.worst(found, number),
        sections.along(design, number),
        sections.checks(found, number),
        sections.scope(found),
        sections.members(found, number),
        sections.reproduction(design, command, known, number),
    ]
    footer = f"Made by dsfab {known['dsfab']}; a first look at members, no proof of safety under a code"
    return Document("Members against the code", design.preset.name.replace("_", " ").capitalize(), facts, parts, footer)


def write_member_report(design: Design, command: str, folder: Path) -> tuple[list[str], list[str]]:
    """Write both files; returns their names, and what could not be done, a sentence each."""
    document = member_report(design, command)
    (folder / FILES[0]).write_text(page(document), encoding="utf-8")
    try:
        (folder / FILES[1]).write_bytes(pdf(document))
    except ExportError as error:
        return [FILES[0]], [str(error)]
    return list(FILES), []
