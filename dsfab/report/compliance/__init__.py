"""The report of `dsfab compare`, from an architect to an engineer: one HTML file and one PDF.

Findings (findings.py) ─► sections.py ─► Document ─► html_pages.py ─► report.html
       with tables.py and figures.py             └─► pdf_pages.py ──► report.pdf"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dsfab.core.errors import ExportError
from dsfab.report.compliance import sections
from dsfab.report.compliance.figures import ChartImages, FindingsPictures, chart_images
from dsfab.report.compliance.findings import Findings
from dsfab.report.design.facts import versions
from dsfab.report.html_pages import CaptionNumbers, Document, ReportSection, document_html
from dsfab.report.pdf_pages import document_pdf

FILES = ("report.html", "report.pdf")
__all__ = ["FILES", "Findings", "compliance_document", "write_report"]


def compliance_document(findings: Findings, rows: Sequence[Mapping[str, Any]], pictures: FindingsPictures) -> Document:
    """Return the report as a document. rows : rows of `results.json` for several shares of material."""
    from dsfab.preset.file import preset_toml

    preset, library_versions = findings.task.preset, versions()
    make_sections = _sections if findings.carries else sections.failed_sections
    charts, preset_text = chart_images(findings, rows), preset_toml(preset, for_people=True)
    document_sections = make_sections(findings, pictures, CaptionNumbers(), charts, library_versions, preset_text)
    facts = [
        ("Design", preset.name),
        ("Date", datetime.now(UTC).strftime("%d %B %Y")),
        ("Checked by", f"dsfab {library_versions['dsfab']}"),
        ("Verdict", findings.status),
    ]
    subject = preset.name.replace("_", " ").capitalize()
    if findings.share is not None:
        subject += f", at {findings.share:.0%} of the material"
    footer = f"Made by dsfab {library_versions['dsfab']}; about stiffness, no proof of safety under a code"
    return Document("Structural compliance report", subject, facts, document_sections, footer)


def _sections(
    findings: Findings,
    pictures: FindingsPictures,
    number: CaptionNumbers,
    chart_images: ChartImages,
    library_versions: Mapping[str, str],
    preset: str,
) -> list[ReportSection]:
    return [
        sections.summary_section(findings, pictures, number),
        sections.checks_section(findings, number),
        sections.structure_section(findings, number),
        sections.loads_section(findings, pictures, number),
        sections.convergence_section(findings, number),
        sections.reactions_section(findings, number),
        sections.comparison_section(findings, number, chart_images),
        sections.displacement_and_stress_section(findings, pictures, number),
        *sections.scope_sections(findings),
        sections.calibration_section(number),
        sections.reproduction_section(findings.command, library_versions, preset, number),
    ]


def write_report(findings: Findings, rows: Sequence[Mapping[str, Any]], folder: Path) -> tuple[list[str], list[str]]:
    """Write report.html and report.pdf; return their names, and a sentence for each step that failed."""
    pictures = FindingsPictures(findings)
    document = compliance_document(findings, rows, pictures)
    messages = [pictures.no_picture_reason] if pictures.no_picture_reason else []
    (folder / FILES[0]).write_text(document_html(document), encoding="utf-8")
    try:
        (folder / FILES[1]).write_bytes(document_pdf(document))
    except ExportError as error:
        return [FILES[0]], [*messages, str(error)]
    return list(FILES), messages
