"""The report of `dsfab compare`, from an architect to an engineer: one HTML file and one PDF.

Findings (findings.py) ─► sections.py ─► Document ─► html_pages.py ─► report.html
       with tables.py and figures.py             └─► pdf_pages.py ──► report.pdf
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dsfab.core.errors import ExportError
from dsfab.report.compliance import sections
from dsfab.report.compliance import sections as failed
from dsfab.report.compliance.figures import Charts, Pictures, charts
from dsfab.report.compliance.findings import Findings
from dsfab.report.design.facts import versions
from dsfab.report.html_pages import Document, Numbers, ReportSection, page
from dsfab.report.pdf_pages import pdf

FILES = ("report.html", "report.pdf")

__all__ = ["FILES", "Findings", "report", "write_report"]


def report(found: Findings, rows: Sequence[Mapping[str, Any]], pictures: Pictures) -> Document:
    """Return the report as a document. rows : those of `results.json`, at several volumes."""
    from dsfab.preset.file import preset_toml

    preset, known = found.task.preset, versions()
    make = _parts if found.carries else failed.parts
    parts = make(found, pictures, Numbers(), charts(found, rows), known, preset_toml(preset, brief=True))
    facts = [
        ("Design", preset.name),
        ("Date", datetime.now(UTC).strftime("%d %B %Y")),
        ("Checked by", f"dsfab {known['dsfab']}"),
        ("Verdict", found.status),
    ]
    subject = preset.name.replace("_", " ").capitalize()
    if found.share is not None:
        subject += f", at {found.share:.0%} of the material"
    footer = f"Made by dsfab {known['dsfab']}; about stiffness, no proof of safety under a code"
    return Document("Structural compliance report", subject, facts, parts, footer)


def _parts(
    found: Findings, pictures: Pictures, number: Numbers, drawn: Charts, known: Mapping[str, str], preset: str
) -> list[ReportSection]:
    return [
        sections.summary(found, pictures, number),
        sections.checks(found, number),
        sections.subject(found, number),
        sections.loads(found, pictures, number),
        sections.convergence(found, number),
        sections.reactions(found, number),
        sections.comparison(found, number, drawn),
        sections.answers(found, pictures, number),
        *sections.scope(found),
        sections.calibrated(number),
        sections.reproduction(found, known, preset, number),
    ]


def write_report(found: Findings, rows: Sequence[Mapping[str, Any]], folder: Path) -> tuple[list[str], list[str]]:
    """Write both files; return their names, and a sentence for each step that failed."""
    pictures = Pictures(found)
    document, told = report(found, rows, pictures), [pictures.missing] if pictures.missing else []
    (folder / FILES[0]).write_text(page(document), encoding="utf-8")
    try:
        (folder / FILES[1]).write_bytes(pdf(document))
    except ExportError as error:
        return [FILES[0]], [*told, str(error)]
    return list(FILES), told
