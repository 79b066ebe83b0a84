"""The page over several comparisons: a line for each, with a link to its report."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dsfab.limits import SEVERITY
from dsfab.report.compliance.document import Block, Document, Paragraph, ReportSection, Table, escaped
from dsfab.report.compliance.findings import LABELS
from dsfab.report.compliance.words import digits_of, enumeration, share_of, within
from dsfab.report.design.facts import versions
from dsfab.wording import mass


def summary_page(rows: Sequence[Mapping[str, Any]], against: Sequence[str], folder: Path) -> Document:
    """rows : see `dsfab.app.compare_many.Row`.    folder : where the page will stand."""
    made = [row for row in rows if not row["error"]]
    blocks: list[Block] = [Paragraph(_counted(rows), "lead")]
    if made:
        blocks.append(_table(made, against, folder))
    told = [row for row in rows if row["error"] or row["verdict"] == "fail"]
    reasons = [(escaped(row["name"]), escaped(row["error"] or row["reason"])) for row in told]
    if reasons:
        caption = "<b>Table 2.</b> Not compared, or not carrying their loads."
        blocks.append(Table(caption, ("Design", "Why"), reasons, 2, "", (1, 5)))
    facts = [("Designs", str(len(rows))), ("Checked by", f"dsfab {versions()['dsfab']}")]
    footer = "About stiffness, no proof of safety under a code; what was assumed stands in each report"
    return Document("Structural compliance", "Several designs", facts, [ReportSection("Summary", blocks)], footer)


def _counted(rows: Sequence[Mapping[str, Any]]) -> str:
    """'3 designs pass, 1 is unknown and 1 was refused.'"""
    told = [f"{count} {verdict}" for verdict in SEVERITY if (count := sum(row["verdict"] == verdict for row in rows))]
    if refused := sum(bool(row["error"]) for row in rows):
        told.append(f"{refused} refused")
    return f"Of {len(rows)} designs: {enumeration(told)}."


def _table(made: Sequence[Mapping[str, Any]], against: Sequence[str], folder: Path) -> Table:
    rows = []
    for row in made:
        stiff = row["compliance_J"] is not None
        rows.append(
            (
                _linked(row, folder),
                row["verdict"],
                mass(row["mass_kg"]) if row["mass_kg"] is not None else "-",
                share_of(row["area_fraction"]) if row["area_fraction"] is not None else "-",
                within(row["compliance_J"], row["bound"], "J") if stiff else "-",
                digits_of(row["ratio_to_full"]) if stiff else "-",
                *(_ratio(row, name) for name in against),
                f"{row['seconds']:.0f}",
            )
        )
    head = ("Design", "Verdict", "Mass", "Kept", "Compliance", "Over whole sheet", *(LABELS[x] for x in against), "s")
    note = (
        "Columns of competitors: their compliance over the design's at the same mass, so how many times as stiff the "
        "design is; under 1 it is softer. Verdict: whether the compliance is known, not whether the design is good."
    )
    widths = (2.4, 1, 1.1, 1, 2, 1, *([1.2] * len(against)), 0.6)
    return Table("<b>Table 1.</b> Compliance, and competitors of the same mass.", head, rows, 1, note, widths)


def _linked(row: Mapping[str, Any], folder: Path) -> str:
    report = Path(row["folder"]) / "report.html"
    name = escaped(row["name"])
    return f'<a href="{quote(os.path.relpath(report, folder))}">{name}</a>' if report.exists() else name


def _ratio(row: Mapping[str, Any], name: str) -> str:
    value = row.get(f"{name}_ratio")
    return "-" if value is None else f"{digits_of(value)} ×"
