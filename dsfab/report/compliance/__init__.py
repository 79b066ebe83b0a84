"""The report of `dsfab compare`: one HTML file and one PDF.

Findings (findings.py) ─► sections.py ─► Document ─► html_pages.py ─► report.html
       with tables.py and figures.py             └─► pdf_pages.py ──► report.pdf"""

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from dsfab.core.limits import SEVERITY
from dsfab.core.messages import mass
from dsfab.report.compliance import sections
from dsfab.report.compliance.figures import FindingsPictures, chart_images
from dsfab.report.compliance.findings import LABELS, Findings, enumeration, share_words, significant_digits, within
from dsfab.report.design.facts import versions
from dsfab.report.html_pages import Block, CaptionNumbers, Document, Paragraph, ReportSection, Table, escaped_text
from dsfab.report.pdf_pages import FILES, write_document

if TYPE_CHECKING:
    from dsfab.preset.model import Preset
    from dsfab.study import Comparison

__all__ = ["FILES", "Findings", "compliance_document", "write_report"]


def compliance_document(findings: Findings, rows: Sequence[Mapping[str, Any]], pictures: FindingsPictures) -> Document:
    """Return the compliance report. rows : rows of `results.json`, each with the results of a structure."""
    from dsfab.preset.file import preset_toml

    preset, library_versions = findings.task.preset, versions()
    make_sections = sections.carrying_sections if findings.carries else sections.failed_sections
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
    footer = f"Made by dsfab {library_versions['dsfab']}; this report does not prove safety under a building code"
    return Document("Structural compliance report", subject, facts, document_sections, footer)


def write_report(findings: Findings, rows: Sequence[Mapping[str, Any]], folder: Path) -> tuple[list[str], list[str]]:
    """Write report.html and report.pdf; return the file names, and a sentence for each file that failed."""
    pictures = FindingsPictures(findings)
    document = compliance_document(findings, rows, pictures)
    files, messages = write_document(document, folder)
    return files, [pictures.no_picture_reason, *messages] if pictures.no_picture_reason else messages


def write_results(
    preset: "Preset", comparisons: "Sequence[tuple[float | None, Comparison]]", command: str, folder: Path
) -> str:
    """Write results.csv and results.json; return the text of results.json.
    comparisons : pairs (share, comparison). share : share of material if widths were scaled, or None."""
    from dsfab.preset.file import preset_toml

    rows = [{"volume": share, **row} for share, a in comparisons for row in a.record()["competitors"]]
    origin = {"name": preset.name, "command": command, "versions": versions(), "preset": preset_toml(preset)}
    comparison = next((a for share, a in comparisons if share is None), None)
    alternatives = {"alternatives": [a.record() for a in comparison.alternatives]} if comparison else {}
    document = json.dumps({**origin, **_verdict_facts(comparisons), **alternatives, "competitors": rows}, indent=2)
    (folder / "results.json").write_text(document + "\n", encoding="utf-8")
    (folder / "results.csv").write_text(_csv(rows), encoding="utf-8", newline="")
    shared = [row for row in rows if row["volume"] is not None]
    if len({row["volume"] for row in shared}) > 1:
        from dsfab.report.compliance.figures import write_chart

        write_chart(shared, f"{preset.name}: compliance against mass", folder / "chart")
    return document


def _verdict_facts(comparisons: "Sequence[tuple[float | None, Comparison]]") -> dict[str, Any]:
    for share, compared in comparisons:
        if share is None:
            if compared.design.judgement is None:
                return {"verdict": {"status": "fail", "reason": compared.design.error}}
            return {"verdict": check.record()} if (check := compared.design.judgement.check) else {}
    return {}


def _csv(rows: list[dict[str, Any]]) -> str:
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return " ".join(f"{x:.9g}" for x in value)
    return json.dumps(value) if isinstance(value, dict) else value


def summary_document(rows: Sequence[Mapping[str, Any]], against: Sequence[str], folder: Path) -> Document:
    """Return the summary of several designs. rows : results, a row for each design.
    against : names of the competing structures in the table.    folder : folder of the summary."""
    compared = [row for row in rows if not row["error"]]
    blocks: list[Block] = [Paragraph(_verdict_counts(rows), "lead")]
    if compared:
        blocks.append(_table(compared, against, folder))
    unfit = [row for row in rows if row["error"] or row["verdict"] == "fail"]
    reasons = [(escaped_text(row["name"]), escaped_text(row["error"] or row["reason"])) for row in unfit]
    if reasons:
        caption = "<b>Table 2.</b> Designs that were not compared, or do not carry their loads."
        blocks.append(Table(caption, ("Design", "Why"), reasons, 2, "", (1, 5)))
    facts = [("Designs", str(len(rows))), ("Checked by", f"dsfab {versions()['dsfab']}")]
    footer = "The reports do not prove safety under a building code; each report lists its assumptions"
    return Document("Structural compliance", "Several designs", facts, [ReportSection("Summary", blocks)], footer)


def _verdict_counts(rows: Sequence[Mapping[str, Any]]) -> str:
    counts = [f"{count} {verdict}" for verdict in SEVERITY if (count := sum(row["verdict"] == verdict for row in rows))]
    if refused := sum(bool(row["error"]) for row in rows):
        counts.append(f"{refused} refused")
    return f"Of {len(rows)} designs: {enumeration(counts)}."


def _table(compared: Sequence[Mapping[str, Any]], against: Sequence[str], folder: Path) -> Table:
    rows = []
    for row in compared:
        stiff = row["compliance_J"] is not None
        rows.append(
            (
                _report_link(row, folder),
                row["verdict"],
                mass(row["mass_kg"]) if row["mass_kg"] is not None else "-",
                share_words(row["area_fraction"]) if row["area_fraction"] is not None else "-",
                within(row["compliance_J"], row["bound"], "J") if stiff else "-",
                significant_digits(row["ratio_to_full"]) if stiff else "-",
                *(_ratio(row, name) for name in against),
                f"{row['seconds']:.0f}",
            )
        )
    head = ("Design", "Verdict", "Mass", "Kept", "Compliance", "/ whole sheet", *(LABELS[x] for x in against), "s")
    note = (
        "Columns of competitors: stiffness of the design / stiffness of the competitor, at equal mass; below 1, the "
        "design is softer. The verdict states whether the computed compliance is reliable, not whether it is good."
    )
    widths = (2.4, 1, 1.1, 1, 2, 1, *([1.2] * len(against)), 0.6)
    return Table("<b>Table 1.</b> Compliance, and competitors of the same mass.", head, rows, 1, note, widths)


def _report_link(row: Mapping[str, Any], folder: Path) -> str:
    report = Path(row["folder"]) / "report.html"
    name = escaped_text(row["name"])
    return f'<a href="{quote(os.path.relpath(report, folder))}">{name}</a>' if report.exists() else name


def _ratio(row: Mapping[str, Any], name: str) -> str:
    value = row.get(f"{name}_ratio")
    return "-" if value is None else f"{significant_digits(value)} ×"
