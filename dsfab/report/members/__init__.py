"""The report of `dsfab report`: members against the code of their material, as one HTML file and as a PDF.

rating     bands of colour for the cells of bays      diagrams   section forces along members
sections   its parts, in their order
"""

from datetime import UTC, datetime
from pathlib import Path

from dsfab.errors import DsfabError, ExportError
from dsfab.pipeline import Design
from dsfab.render import up_axis
from dsfab.report.assembly import assembly_page
from dsfab.report.compliance.document import Document, Numbers
from dsfab.report.compliance.html import page
from dsfab.report.compliance.pdf import pdf
from dsfab.report.design.facts import versions
from dsfab.report.members import sections
from dsfab.report.members.rating import rating_figure
from dsfab.workshop import workshop_plan

FILES = ("report.html", "report.pdf")
STRUCTURE = "structure.html"
"""The structure to turn, cut and colour, for a client."""

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
    """Write the report and the page of the structure; returns their names, and what could not be done, in sentences."""
    document, files, told = member_report(design, command), [FILES[0]], list[str]()
    (folder / FILES[0]).write_text(page(document), encoding="utf-8")
    try:
        (folder / FILES[1]).write_bytes(pdf(document))
        files.append(FILES[1])
    except ExportError as error:
        told.append(str(error))
    try:
        plan = workshop_plan(design, up_axis(design.surface.V, design.surface, design.load))
    except DsfabError as error:
        return files, [*told, f"{STRUCTURE} is left out, for the design has no flat parts: {error}"]
    if plan.graph is None:
        return files, told
    (folder / STRUCTURE).write_text(assembly_page(plan, design, judged=True), encoding="utf-8")
    return [*files, STRUCTURE], told
